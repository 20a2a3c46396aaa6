# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimator that is told: what it is told is true of the drive."""

from __future__ import annotations

import numpy as np
import pytest

from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.studies import told_estimator


def test_zero_and_gain_of_a_torque_sensor_are_found_beside_wild_readings() -> None:
    generator = np.random.default_rng(0)
    truth = generator.uniform(-5.0, 15.0, 2000)
    reading = 0.4 + 1.05 * truth + 0.2 * generator.standard_normal(2000)
    reading[::50] += 40.0
    reading[1::50] = np.nan
    zero, gain, noise = told_estimator.zero_and_gain(reading, truth)
    assert zero == pytest.approx(0.4, abs=0.03)
    assert gain == pytest.approx(1.05, abs=0.003)
    assert noise == pytest.approx(0.2, rel=0.1)


def test_a_gain_that_no_torque_tells_stays_one() -> None:
    reading = 0.4 + 0.2 * np.random.default_rng(1).standard_normal(50)
    zero, gain, _ = told_estimator.zero_and_gain(reading, np.zeros(50))
    assert zero == pytest.approx(0.4, abs=0.1)
    assert gain == pytest.approx(1.0)


def test_what_is_told_of_a_drive_and_what_its_teacher_says() -> None:
    drive = SIMULATORS['B'].simulate('climb', 1000, 6.0, None)
    told = told_estimator.told_sensors(drive)
    # The file's radius is off by about 1 %; rim speed over wheel rate is that of the rover.
    truth = drive.truth
    moving = truth.slip > 0.05
    rim = (truth.slip_velocity[moving] / truth.slip[moving]).ravel()
    told_rim = (told.wheels.slip_radius * truth.wheel_rate)[moving]
    assert moving.sum() > 20
    assert np.median(told_rim / rim) == pytest.approx(1.0, abs=1e-3)
    torque = told_estimator.pairs(drive, told_estimator.WheelOdometry, 'torque', truth.torque)
    off = torque[0] - told.sensors.torque_zero - told.sensors.torque_gain * torque[1]
    assert np.abs(np.median(off, axis=0)).max() < 0.5 * told.sensors.torque_std
    taught = [m for m in told_estimator.taught(drive) if isinstance(m, ReferenceVelocity)]
    said = np.interp([m.stamp for m in taught], truth.stamp, truth.forward_velocity)
    assert [m.forward for m in taught] == pytest.approx(said.tolist())
    assert len(taught) == pytest.approx(6.0 / told_estimator.TEACHING_PERIOD, rel=0.2)
    stated = list(told_estimator.with_noise(drive, 0.01, 'reference'))
    assert {m.variance for m in stated if isinstance(m, ReferenceVelocity)} == {1e-4}
