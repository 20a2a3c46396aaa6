# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rigs and mountings at the edge: one wheel, one axle, an IMU upside down, exact sensors."""

from dataclasses import replace

import numpy as np
import pytest
from parts import SAND, Parts, step_inputs

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.steering import straight_headings
from wheel_terra_estimator.estimation.contacts.turning import Turning
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.measurements import LeavingAngleReading
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator

ONE_WHEEL = ['hit_wh3', 'hit_lss1']


def run(estimator, seconds, wheels, up=9.8, gap=0.1, rate=0.4):
    sets = []
    for i in range(round(seconds / gap)):
        speed = 0.04 if gap > 1.0 or i % 10 == 5 else None
        rates, torques = np.full(wheels, rate), np.full(wheels, 2.0)
        estimator.step(*step_inputs(i * gap, rates, torques, (0.1, 0.0, up), speed))
        sets.append(estimator.estimates())
    return sets


def test_a_rover_with_one_axle_has_no_curvature_before_it_has_moved():
    parts = Parts(reader.load(ONE_WHEEL))
    turning = Turning(parts.rover, parts.sensors)
    assert turning.curvature(0.05) == 0.0
    turning.update(
        InertialWindow(5, 0.0, 0.0, 49.0, rates=5),
        0.1,
        0.0,
        0.05,
        straight_headings(parts.rover),
        (0.05,),
    )
    assert turning.curvature(0.05) == 0.0


@pytest.mark.parametrize('gap', [0.1, 2.0])
@pytest.mark.parametrize('rate', [0.0, 0.4, -3.0])
def test_a_rig_with_one_wheel_works(gap, rate):
    sets = run(WheelSoilEstimator(reader.load(ONE_WHEEL)), 50.0 * gap, 1, gap=gap, rate=rate)
    for s in sets:
        for name, value in vars(s).items():
            if isinstance(value, np.ndarray):
                assert np.isfinite(value).all(), name
                assert not name.endswith('_std') or (value > 0.0).all(), name
    if rate > 0.0:
        rim = rate * float(reader.load(ONE_WHEEL).wheels.slip_radius[0])
        assert sets[-1].slip[0] == pytest.approx(1.0 - 0.04 / rim, abs=0.02)


def test_loads_of_an_imu_upside_down_are_not_known():
    sets = run(WheelSoilEstimator(reader.load(SAND)), 3.0, 6, up=-9.8)
    rover = reader.load(SAND).rover
    share = rover.mass * rover.gravity / 6
    assert sets[-1].normal_load_std == pytest.approx([share] * 6)
    assert sets[-1].drawbar_pull_std == pytest.approx([share] * 6)


def test_loads_have_a_deviation_even_where_the_load_model_is_said_to_be_exact():
    exact = reader.load(SAND, ['rover.load_std:=0.0'])
    for s in run(WheelSoilEstimator(exact), 3.0, 6):
        assert (s.normal_load_std > 0.0).all()
        assert (s.drawbar_pull_std > 0.0).all()


@pytest.mark.parametrize('measured', [True, False])
def test_the_error_of_the_rear_camera_counts_where_it_measures(measured):
    deviations = []
    for degrees in (0.1, 10.0):
        configuration = reader.load(SAND, [f'sensors.leaving_angle_std_deg:={degrees}'])
        estimator = WheelSoilEstimator(configuration)
        for i in range(25):
            speed = 0.045 if i % 10 == 5 else None
            stamp, given = step_inputs(0.1 * i, np.full(6, 0.4), np.full(6, 12.0), speed=speed)
            if measured:
                given = replace(given, leaving_angle=LeavingAngleReading(stamp, np.full(6, -0.2)))
            estimator.step(stamp, given)
        deviations.append(estimator.estimates().drawbar_pull_std.mean())
    if measured:
        assert deviations[1] > 1.1 * deviations[0]
    else:
        assert deviations[1] == deviations[0]
