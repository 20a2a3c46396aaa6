# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How speed goes on between fixes."""

import math

import numpy as np
import pytest

from wheel_terra_estimator.estimation.measurements import InertialReading
from wheel_terra_estimator.estimation.speed_process import (
    Attitude,
    InertialWindow,
    speed_step,
    take_inertial,
)


def step(speed, **changes):
    values = {
        'dt': 0.1,
        'rim_before': 0.05,
        'rim_now': 0.05,
        'ratio': 0.8,
        'ratio_std': 0.1,
        'low_rim': 0.006,
        'ratio_walk': 0.1,
        'unrest': 0.0,
        'window': InertialWindow(),
        'acceleration_noise': 0.03,
    } | changes
    found = speed_step(**values)
    return found.speed_gain * speed + found.constant, found.variance


def test_slow_rover_follows_its_wheels_through_a_ramp():
    assert step(0.04, rim_now=0.075)[0] == pytest.approx(0.06)


def test_restart_takes_the_remembered_ratio():
    assert step(0.0, rim_before=0.0, rim_now=0.02)[0] == pytest.approx(0.016)


def test_fast_rover_follows_its_accelerometer_when_wheels_spin_up():
    window = InertialWindow(speed_change=0.05, duration=0.1)
    fast, _ = step(1.0, rim_before=1.2, rim_now=2.4, window=window)
    assert fast == pytest.approx(1.05, abs=0.02)


def test_contacts_under_change_open_the_speed_and_the_accelerometer_bounds_it():
    calm, _ = step(0.04)
    mean, variance = step(0.04, unrest=0.02)
    assert mean == pytest.approx(calm)
    assert variance == pytest.approx(step(0.04)[1] + 2.0 * 0.02**2 * 0.1)
    window = InertialWindow(speed_change=0.0, duration=0.1)
    assert step(0.04, unrest=0.5, window=window)[1] <= 0.03**2 * 0.1


def test_wheels_that_disagree_leave_the_speed_to_the_accelerometer():
    """Two wheels spin up, two stand: the mean rim speed says nothing of the body."""
    window = InertialWindow(speed_change=0.0, duration=0.1)
    together, _ = step(0.1, rim_before=0.25, rim_now=0.30, window=window)
    apart, variance = step(0.1, rim_before=0.25, rim_now=0.30, window=window, discord=0.05)
    assert together > 0.105
    assert apart == pytest.approx(0.1, abs=0.001)
    assert variance <= 0.03**2 * 0.1


def test_slow_rover_does_not_integrate_a_bias():
    window = InertialWindow(speed_change=0.02 * 0.1, duration=0.1)
    assert step(0.04, window=window)[0] == pytest.approx(0.04, abs=1e-4)


def test_combination_is_better_than_either():
    window = InertialWindow(speed_change=0.0, duration=0.1)
    both = step(0.5, rim_before=0.6, rim_now=0.6, window=window)[1]
    wheels = step(0.5, rim_before=0.6, rim_now=0.6)[1]
    assert both < wheels
    assert both < 0.03**2 * 0.1


def reading(force=(0.0, 0.0, 9.81), rate=(0.0, 0.0, 0.0), orientation=None):
    turned = None if orientation is None else np.array(orientation)
    return InertialReading(0, np.array(force), np.array(rate), turned)


def test_nose_up_is_a_negative_pitch():
    pitch = -0.2
    attitude = Attitude()
    attitude.update(
        reading(orientation=(0.0, math.sin(pitch / 2), 0.0, math.cos(pitch / 2))), 0.01, 9.81
    )
    assert attitude.sine_up == pytest.approx(math.sin(0.2))


def test_without_orientation_gyro_and_gravity_give_the_slope():
    attitude = Attitude()
    slope = 0.15
    still = reading(force=(9.81 * math.sin(slope), 0.0, 9.81 * math.cos(slope)))
    for _ in range(2000):
        attitude.update(still, 0.02, 9.81)
    assert attitude.sine_up == pytest.approx(math.sin(slope), abs=1e-3)
    # Nose going up at 0.1 rad/s for half a second.
    for _ in range(25):
        attitude.update(reading(force=still.specific_force, rate=(0.0, -0.1, 0.0)), 0.02, 9.81)
    assert attitude.sine_up == pytest.approx(math.sin(slope) + 0.05, abs=0.01)


def test_a_gap_of_the_imu_is_not_integrated_over():
    window, attitude = InertialWindow(), Attitude()
    take_inertial(window, attitude, reading(force=(1.0, 0.0, 9.7)), 5.0, 9.81, 0.0, 0.0)
    assert window.duration == 0.0
