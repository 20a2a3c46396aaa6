# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Readings between two cycles: sums, means, ages, and the body's slope."""

import math

import numpy as np
import pytest
from parts import on_sand

from wheel_terra_estimator.estimation.inputs.contact_sensors import LeavingAngleInput, SinkageInput
from wheel_terra_estimator.estimation.inputs.inertial import GyroZero, InertialInput
from wheel_terra_estimator.estimation.inputs.wheel_odometry import WheelOdometryInput
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    SinkageReading,
    WheelOdometry,
)

GRAVITY = 9.81
NAN = float('nan')


def reading(force=(0.0, 0.0, GRAVITY), rate=(0.0, 0.0, 0.0), orientation=None):
    turned = None if orientation is None else np.array(orientation)
    return InertialReading(0, np.array(force), np.array(rate), turned)


def test_nose_up_is_a_negative_pitch():
    pitch = -0.2
    imu = InertialInput(GRAVITY)
    imu.update(
        0.0,
        reading(orientation=(0.0, math.sin(pitch / 2), 0.0, math.cos(pitch / 2))),
        GyroZero(),
    )
    assert imu.state.attitude.sine_up == pytest.approx(math.sin(0.2))
    assert imu.state.attitude.reported


def test_without_orientation_gyro_and_gravity_give_the_slope():
    imu, slope, zero = InertialInput(GRAVITY), 0.15, GyroZero(pitch=0.02)
    force = (GRAVITY * math.sin(slope), 0.0, GRAVITY * math.cos(slope))
    for i in range(2000):
        imu.update(0.02 * i, reading(force=force, rate=(0.0, 0.02, 0.0)), zero)
    assert imu.state.attitude.sine_up == pytest.approx(math.sin(slope), abs=1e-3)
    # Nose going up at 0.1 rad/s for half a second.
    for i in range(2000, 2025):
        imu.update(0.02 * i, reading(force=force, rate=(0.0, -0.08, 0.0)), zero)
    assert imu.state.attitude.sine_up == pytest.approx(math.sin(slope) + 0.05, abs=0.01)
    assert not imu.state.attitude.reported


def test_a_gap_of_the_imu_is_not_integrated_over():
    imu = InertialInput(GRAVITY)
    for time in (0.0, 5.0):
        imu.update(time, reading(force=(1.0, 0.0, 9.7), orientation=(0, 0, 0, 1)), GyroZero())
    window = imu.take()
    assert window.readings == 2
    assert window.duration == 0.0
    imu.update(5.1, reading(force=(1.0, 0.0, 9.7), orientation=(0, 0, 0, 1)), GyroZero())
    assert imu.take().speed_change == pytest.approx(0.1)


def test_the_noise_of_a_vibrating_accelerometer_is_seen_raw_and_in_means():
    """A density is the same for readings at 100 Hz and for their means at 20 Hz."""
    raw = np.random.default_rng(3).normal(0.0, 1.0, 4000)
    seen = {}
    for rate, force in ((100.0, raw), (20.0, raw.reshape(-1, 5).mean(axis=1))):
        imu = InertialInput(GRAVITY)
        for i, value in enumerate(force):
            imu.update(i / rate, reading(force=(value, 0.0, GRAVITY)), GyroZero())
        seen[rate] = imu.take().noise_density
        assert imu.take().noise_density == seen[rate]  # it outlives the window
    assert seen[100.0] == pytest.approx(0.01, rel=0.25)
    assert seen[20.0] == pytest.approx(0.01, rel=0.5)


@pytest.mark.parametrize('lost', [[], [(NAN, NAN)]])
def test_a_stone_that_shakes_the_imu_hardly_changes_the_speed(lost):
    """Three readings 1.5 g off, the noise being 0.05 m/s^2; braking counts in full."""
    imu, noise = InertialInput(GRAVITY), np.random.default_rng(4).normal(0.0, 0.05, (500, 3))
    level = (0.0, 0.0, 0.0, 1.0)

    def take(first, accelerations):
        for i, (x, z) in enumerate(accelerations, first):
            force = (x, 0.0, GRAVITY + z) + noise[i]
            imu.update(0.02 * i, reading(force=force, orientation=level), GyroZero())
        return imu.take()

    take(0, [(0.0, 0.0)] * 400)
    window = take(400, [*lost, *[(15.0, -15.0)] * 3, *[(0.0, 0.0)] * 5])
    assert abs(window.speed_change) < 0.1  # [m/s]; 0.9 unlimited
    assert window.mean_force()[2] == pytest.approx(GRAVITY, abs=0.6)
    take(410, [(0.0, 0.0)] * 40)
    assert take(450, [(-1.0, 0.0)] * 25).speed_change == pytest.approx(-0.5, abs=0.06)


def test_a_slope_that_the_attitude_follows_is_no_noise():
    imu = InertialInput(GRAVITY)
    for i, pitch in enumerate(np.linspace(0.0, 0.3, 200)):  # nose up: about -y
        orientation = (0.0, -np.sin(0.5 * pitch), 0.0, np.cos(0.5 * pitch))
        force = (GRAVITY * np.sin(pitch), 0.0, GRAVITY * np.cos(pitch))
        imu.update(0.01 * i, reading(force=force, orientation=orientation), GyroZero())
    assert imu.take().noise_density == pytest.approx(0.0, abs=1e-20)


def test_a_gyro_without_accelerometer_and_the_reverse_are_kept_apart():
    """A rover tilted nose up by 0.1 rad, each part of the IMU sent by itself."""
    inertial, unknown = InertialInput(9.8), np.full(3, NAN)
    rate = np.array([0.0, 0.0, 0.3])
    half = 0.5 * 0.1
    up = np.array([0.0, -np.sin(half), 0.0, np.cos(half)])
    for i in range(5):
        inertial.update(0.02 * i, InertialReading(0, unknown, rate, None), GyroZero())
    window = inertial.take()
    assert (window.readings, window.rate_readings, window.has_force) == (0, 5, False)
    assert window.yaw_rate / window.rate_readings == pytest.approx(0.3)
    force = np.array([1.0, 0.0, 9.7])
    inertial.update(0.1, InertialReading(0, force, unknown, None), GyroZero())
    window = inertial.take()
    assert (window.readings, window.rate_readings) == (1, 0)
    assert window.mean_force() == pytest.approx((1.0, 0.0, 9.7))
    # An orientation alone gives the specific force of a rover that stands so.
    inertial.update(0.12, InertialReading(0, unknown, unknown, up), GyroZero())
    window = inertial.take()
    assert window.has_force
    assert window.mean_force() == pytest.approx((9.8 * np.sin(0.1), 0.0, 9.8 * np.cos(0.1)))


PARTS = on_sand()
RADIUS = PARTS.rover.slip_radius[0]


def odometry(rate, torque):
    return WheelOdometry(0, np.array(rate), np.array(torque))


NOISE = PARTS.sensors.wheel_rate_std


@pytest.fixture
def wheels():
    return WheelOdometryInput(PARTS.rover, PARTS.sensors)


def test_torques_are_means_and_the_last_one_is_held(wheels):
    wheels.update(0.0, odometry([0.4] * 6, [2.0] * 5 + [NAN]), NOISE)
    wheels.update(0.1, odometry([0.4] * 6, [4.0] * 5 + [NAN]), NOISE)
    mean = wheels.take_torque()
    assert mean[:5] == pytest.approx([3.0] * 5)
    assert math.isnan(mean[5])
    assert math.isnan(wheels.take_torque()[0])
    assert wheels.state.torque[0] == pytest.approx(3.0)
    assert wheels.torque_known(1.9)
    assert not wheels.torque_known(2.2)


def test_a_rate_that_is_too_old_is_unknown(wheels):
    wheels.update(0.0, odometry([0.4] * 6, [NAN] * 6), NOISE)
    wheels.update(0.4, odometry([0.4] * 3 + [NAN] * 3, [NAN] * 6), NOISE)
    rims = wheels.rim_speeds(0.6)
    assert not any(math.isnan(rim) for rim in rims[:3])
    assert all(math.isnan(rim) for rim in rims[3:])
    assert not wheels.silent(0.8)
    assert wheels.silent(1.0)


def test_fast_odometry_is_smoothed_and_slow_is_not(wheels):
    for i in range(100):
        wheels.update(0.01 * i, odometry([0.4 + (0.1 if i % 2 else -0.1)] * 6, [NAN] * 6), NOISE)
    assert wheels.state.rims[0].speed / 0.4 == pytest.approx(RADIUS, rel=0.04)
    wheels.update(1.09, odometry([0.8] * 6, [NAN] * 6), NOISE)
    assert wheels.state.rims[0].speed == pytest.approx(0.8 * RADIUS)


@pytest.mark.parametrize(('rate', 'error'), [(0.5, 0.1 / math.sqrt(10.0)), (8.0, 0.1)])
def test_noisy_rates_of_a_slow_wheel_are_means_over_a_second(wheels, rate, error):
    """A noise of 0.1 rad/s: a fifth of a slow rate, and of no account at a fast one."""
    rng, errors = np.random.default_rng(2), []
    for i in range(2000):
        wheels.update(0.1 * i, odometry(rng.normal(rate, 0.1, 6), [NAN] * 6), 0.1)
        errors += [rim.speed / RADIUS - rate for rim in wheels.state.rims]
    assert wheels.stds()[0] == pytest.approx(error * RADIUS)
    assert np.std(errors) == pytest.approx(error, rel=0.1)
    assert wheels.white_noise(0.1)[0] == pytest.approx(0.1 * RADIUS), 'ten cycles share an error'


def test_a_change_beyond_the_noise_of_the_rates_begins_a_new_mean(wheels):
    for i in range(30):
        wheels.update(0.1 * i, odometry([0.5] * 6, [NAN] * 6), 0.1)
    wheels.update(3.0, odometry([0.95] * 3 + [0.6] * 3, [NAN] * 6), 0.1)
    assert wheels.state.rims[0].speed == pytest.approx(0.95 * RADIUS)
    assert wheels.state.rims[5].speed < 0.52 * RADIUS
    assert wheels.stds()[0] == pytest.approx(0.1 * RADIUS)
    for rate in (0.0, 0.2, 0.1):  # it stands, starts, and is a mean again
        wheels.update(4.0 + rate, odometry([rate] * 6, [NAN] * 6), 0.1)
        assert (wheels.state.rims[0].speed == rate * RADIUS) is (rate != 0.1)


def test_a_ramp_goes_on_to_the_stamp_of_a_reference_between_two_messages(wheels):
    """A reference velocity halfway through a ramp belongs to the rim speed of its own stamp."""
    for i in range(10):
        wheels.update(0.1 * i, odometry([0.1 * i] * 6, [NAN] * 6), NOISE)
    assert wheels.rim_speeds(0.95)[0] == pytest.approx(0.95 * RADIUS, rel=0.01)
    # A constant rate that scatters by its noise stays what it is.
    for i in range(10, 40):
        wheels.update(0.1 * i, odometry([0.9 + 0.002 * (-1) ** i] * 6, [NAN] * 6), NOISE)
    assert wheels.rim_speeds(3.95) == tuple(rim.speed for rim in wheels.state.rims)


def test_smoothing_does_not_put_a_ramp_behind(wheels):
    """Odometry at 100 Hz is smoothed over 50 ms: 5 % of the speed a second after a start."""
    for i in range(101):
        wheels.update(0.01 * i, odometry([0.01 * i] * 6, [NAN] * 6), NOISE)
    assert wheels.state.rims[0].speed < 0.97 * RADIUS
    assert wheels.rim_speeds(1.0)[0] == pytest.approx(RADIUS, rel=0.002)


@pytest.mark.parametrize('rate', [10, 20, 50, 100])
def test_a_wheel_that_stops_at_once_does_not_turn_back(wheels, rate):
    speeds = []
    for i in range(2 * rate):
        wheels.update(i / rate, odometry([1.0 if i < rate else 0.0] * 6, [NAN] * 6), NOISE)
        speeds += [wheels.rim_speeds((i + part) / rate)[0] for part in (0.0, 0.5)]
    assert min(speeds) >= 0.0
    assert speeds[-1] == pytest.approx(0.0, abs=1e-6)


def test_a_wheel_in_messages_of_its_own_is_smoothed_by_its_own_rate(wheels):
    """Six wheels at 20 Hz in turns, on a ramp that ends at 1 s."""
    for i in range(126):
        time, rates = i / 120, np.full(6, NAN)
        rates[i % 6] = min(time, 1.0)
        wheels.update(time, odometry(rates, [NAN] * 6), NOISE)
        if time == 0.95:
            np.testing.assert_allclose(wheels.rim_speeds(time), 0.95 * RADIUS, rtol=0.02)
    np.testing.assert_allclose([rim.speed for rim in wheels.state.rims], RADIUS, rtol=0.03)


def test_sinkage_and_leaving_angle_are_kept_wheel_by_wheel():
    sinkage = SinkageInput(2)
    for value in (0.01, 0.03):
        sinkage.update(SinkageReading(0, np.array([value, NAN])))
    assert sinkage.take() == ((0.04, 0.0), (2, 0))
    assert sinkage.take() == ((0.0, 0.0), (0, 0))
    angle = LeavingAngleInput(2)
    for i in range(30):
        angle.update(0.1 * i, LeavingAngleReading(0, np.array([-0.2, NAN])))
    assert angle.angles(3.0)[0] == pytest.approx(-0.2)
    assert math.isnan(angle.angles(3.0)[1])
    assert angle.angles(4.0) is None
