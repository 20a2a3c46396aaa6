# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a drive taught, as the next drive starts from it, and how sure it is."""

import math

import numpy as np
import pytest
from fake_estimator import SECOND, play
from parts import SAND

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.ros_yaml import read as read_values
from wheel_terra_estimator.configuration.soil_file import write_values
from wheel_terra_estimator.estimation.contacts.demand import Climbed, SteepestClimb
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import EquilibriumSlip
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.filter.state import SHEAR_STRENGTH, StateLayout
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.taught import (
    ASSUMED,
    CONFOUNDED,
    LEARNED,
    Parameter,
    Teaching,
    with_model_errors,
)
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator

START = 100 * SECOND
SOIL = ('friction_angle_deg', 'cohesion', 'shear_modulus', 'frictional_modulus', 'cohesive_modulus')
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
GRAVITY = 9.80665
OVERRIDES = {'sensors.specific_force_bias_std': 0.1, 'sensors.orientation_std_deg': 0.05}


def run(configuration, measurements):
    core = EstimatorCore(configuration)
    return core, play(core, measurements)


def deviation(key):
    return key.replace('_deg', '') + ('_std_deg' if key.endswith('_deg') else '_std')


def first_odometry(drive):
    return next(a.measurement for a in drive.arrivals if isinstance(a.measurement, WheelOdometry))


def standing(duration, rate, force=(0.0, 0.0, GRAVITY)):
    """A rover that stands; the IMU reads these."""
    stamps = range(START, START + round(duration * SECOND), SECOND // 50)
    for i, stamp in enumerate(stamps):
        yield InertialReading(stamp, np.array(force), np.array(rate), LEVEL)
        if i % 5 == 0:
            yield WheelOdometry(stamp, np.zeros(4), np.zeros(4))


def test_soil_is_that_of_the_topic_and_its_deviations_hold_elsewhere(climb, climbed):
    core, sets, _ = climbed
    learned = core.learned()
    last = dict(zip(sets[-1].soil_names, sets[-1].soil.tolist(), strict=True))
    std = dict(zip(sets[-1].soil_names, sets[-1].soil_std.tolist(), strict=True))
    start = dict(zip(sets[0].soil_names, sets[0].soil_std.tolist(), strict=True))
    assert set(last) == {f'soil.{name}' for name in SOIL}
    for key, value in last.items():
        assert learned[key] == pytest.approx(value, rel=1e-12)
    key = 'soil.friction_angle_deg'
    assert learned[deviation(key)] >= 0.999 * std[key]  # the moduli: no more than stated before
    assert std[key] < 0.95 * start[key]  # something was learned
    phi = np.radians(last[key])
    configured = climb.configuration.soil  # cohesion and tangent are scaled by one factor
    scale = np.tan(phi) / np.tan(float(configured.friction_angle))
    assert last['soil.cohesion'] == pytest.approx(scale * float(configured.cohesion))
    assert abs(scale - 1.0) > 0.01
    of_tangent = np.radians(learned[deviation(key)]) / (np.sin(phi) * np.cos(phi))
    assert 0.1 <= of_tangent <= 0.2  # sand from place to place: 12 %


def test_where_nothing_was_learned_restarts_do_not_add_up(climb):
    configuration = climb.configuration
    found = []
    for _ in range(3):
        core, _ = run(configuration, [first_odometry(climb)])
        found.append(core.learned())
        configuration = configuration.replace(found[-1])
    for key, value in found[0].items():
        assert found[2][key] == pytest.approx(value, rel=1e-6), key


def test_the_second_drive_begins_where_the_first_one_ended(climbed, climb, tmp_path):
    core, sets, _ = climbed
    learned = core.learned()
    path = tmp_path / 'learned.yaml'
    write_values(path, learned)
    assert read_values(path) == learned  # to the last bit
    again = climb.configuration.replace(read_values(path))
    _, second = run(again, [first_odometry(climb)])
    np.testing.assert_allclose(second[0].soil, sets[-1].soil, rtol=1e-6)
    away = [abs(sets_[0].soil[0] - sets[-1].soil[0]) for sets_ in (second, sets)]
    assert away[0] < 1e-4 < away[1]  # friction angle [deg]


def test_zeros_of_the_gyro_are_learned_at_rest_on_top_of_those_stated():
    rover = reader.load(['frostyboy', 'dry_sand_ding2015'])
    rate = (0.004, -0.006, 0.01)
    core, before = run(rover, standing(14.0, rate))
    learned = core.learned()['sensors.angular_rate_bias']
    np.testing.assert_allclose(learned, [0.0, -0.006, 0.01], atol=2e-4)
    again = rover.replace({'sensors.angular_rate_bias': learned})
    moved = tuple(r + 0.002 for r in rate)
    core, sets = run(again, standing(14.0, moved))
    assert max(abs(s.yaw_rate) for s in sets) < 0.0021
    assert max(abs(s.yaw_rate) for s in before) > 0.005
    np.testing.assert_allclose(
        core.learned()['sensors.angular_rate_bias'], [0.0, -0.004, 0.012], atol=4e-4
    )
    core.reset()
    assert not core.learned() and not core.taught()


def test_the_bias_of_the_accelerometer_has_the_sign_of_the_sensor():
    rover = reader.load(['generic_six_wheel', 'dry_sand_ding2015']).replace(OVERRIDES)
    rim_rate = 0.1 / float(rover.wheels.slip_radius[0])

    def driving():
        for i in range(50 * 3):
            stamp = START + i * SECOND // 50
            yield InertialReading(stamp, np.array([0.08, 0.0, GRAVITY]), np.zeros(3), LEVEL)
            if i % 5 == 0:
                yield WheelOdometry(stamp, np.full(6, rim_rate), np.full(6, np.nan))
            if i % 25 == 0:
                yield ReferenceVelocity(stamp, 0.1, 1e-6)

    core, _ = run(rover, driving())
    first = core.learned()['sensors.specific_force_bias']
    np.testing.assert_allclose(first, [0.08, 0.0, 0.0], atol=0.005)
    again = rover.replace({'sensors.specific_force_bias': first})
    core, _ = run(again, driving())
    second = core.learned()['sensors.specific_force_bias']
    np.testing.assert_allclose(second, [0.08, 0.0, 0.0], atol=0.002)


def test_nothing_before_the_first_set():
    assert EstimatorCore(reader.load(['frostyboy'])).learned() == {}


def test_what_is_known_exactly_here_is_known_elsewhere_as_well_as_soil_varies():
    """Phoon and Kulhawy 1999: 12 % of the tangent, 38 % of what makes it stiff, of a logarithm."""
    estimator = WheelSoilEstimator(reader.load(['generic_six_wheel']))  # which states no soil
    known = np.zeros_like(estimator._ekf.P)
    zero = estimator._zero_velocity.state.zero
    found = estimator._learned.values(estimator._ekf.x, known, zero)
    for key, spread in (('soil.cohesion', 0.12), ('soil.shear_modulus', 0.38)):
        assert found[f'{key}_std'] == pytest.approx(found[key] * spread, rel=0.03)


def test_the_soil_that_is_kept_carries_what_its_drive_was_seen_to_climb():
    """Strength learned too low beside errors that the file does not hold: the slip seen decides."""
    configuration = reader.load(['generic_six_wheel', 'hit_lss1'])
    estimator = WheelSoilEstimator(configuration)
    rover = Rover.from_configuration(configuration)
    mean, covariance = estimator._ekf.x.copy(), estimator._ekf.P
    mean[SHEAR_STRENGTH] = -0.5
    zero = estimator._zero_velocity.state.zero

    def usual(found, demand):
        return EquilibriumSlip(configuration.replace(found), rover).at(demand, 0.8)

    pulls, slips = EquilibriumSlip(configuration, rover).curve
    demand, slip = 0.8 * pulls[slips.index(0.3)], 0.3
    without = estimator._learned.values(mean, covariance, zero)
    kept = estimator._learned.values(mean, covariance, zero, Climbed(demand, slip))
    assert usual(without, demand) > slip + 0.05
    assert usual(kept, demand) == pytest.approx(slip, abs=0.005)
    # Never stronger than stated, and as learned where that is enough.
    beyond = estimator._learned.values(mean, covariance, zero, Climbed(2.0 * pulls[-1], slip))
    key = 'soil.friction_angle_deg'
    assert beyond[key] == pytest.approx(configuration.flat()[key], rel=1e-3)
    enough = estimator._learned.values(mean, covariance, zero, Climbed(0.01, 0.9))
    assert enough[key] == without[key]


def test_the_steepest_climb_is_a_mean_over_seconds_of_steady_driving():
    climb = SteepestClimb()
    for i in range(600):
        spike = 0.4 if i in (300, 301) else 0.0
        climb.update(0.2 + spike, 0.3, 0.1)
    assert climb.state.demand == pytest.approx(0.2, abs=0.02)
    assert climb.state.slip == pytest.approx(0.3)
    told = climb.state[:2]
    for _ in range(100):
        climb.update(0.5, math.nan, 0.1)  # no reference tells the slip
    assert climb.state[:2] == told


# Bits and verdicts against the posterior of linear measurements, worked out by hand.


def taught(rows, noise=0.1):
    """Judge three parameters of unit variance after measurements of sums of them."""
    names = ['a', 'b', 'c']
    start = np.eye(3)
    parameters = [Parameter(n, '-', row) for n, row in zip(names, start, strict=True)]
    H = np.array(rows, dtype=float).reshape(-1, 3)
    after = np.linalg.inv(start + H.T @ H / noise**2)
    return {row.name: row for row in Teaching(parameters, start).judged(after)}


def test_a_measured_parameter_is_learned_by_the_bits_of_its_deviation():
    found = taught([[1, 0, 0]])
    assert found['a'].verdict == LEARNED
    assert found['a'].std == pytest.approx(0.1 / np.sqrt(1.01))
    assert found['a'].bits == pytest.approx(0.5 * np.log2(101.0))  # capacity of a Gaussian channel
    assert found['b'].verdict == ASSUMED and found['b'].bits == 0.0
    assert found['b'].in_words() == 'assumed, not learned'


def test_a_sum_tells_none_of_its_parts():
    found = taught([[1, 1, 0]])
    for name, other in (('a', 'b'), ('b', 'a')):
        assert found[name].verdict == CONFOUNDED
        assert found[name].confounded_with == other
        assert found[name].std == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert found['c'].verdict == ASSUMED
    both = taught([[1, 1, 0], [1, -1, 0]])
    assert both['a'].verdict == both['b'].verdict == LEARNED


def test_the_estimator_has_learned_nothing_before_it_drives():
    rows = {row.name: row for row in WheelSoilEstimator(reader.load(SAND)).taught()}
    assert all(row.verdict != LEARNED and row.bits == 0.0 for row in rows.values())
    assert rows['soil.cohesion'].confounded_with == 'soil.friction_angle_deg'
    assert rows['soil.cohesive_modulus'].confounded_with == 'soil.frictional_modulus'
    assert rows['torque zeros'].confounded_with == 'soil.friction_angle_deg'


def test_a_deviation_that_grew_has_gained_nothing_nor_what_no_drive_tells_apart():
    alone = Teaching([Parameter('a', '-', np.ones(1))], np.eye(1)).judged(np.array([[4.0]]))[0]
    assert (alone.verdict, alone.bits, alone.std) == (ASSUMED, 0.0, 2.0)
    parameters = [Parameter('a', '-', np.ones(1), like='b')]
    row = Teaching(parameters, np.eye(1)).judged(np.array([[0.01]]))[0]
    assert (row.verdict, row.bits, row.std, row.confounded_with) == (CONFOUNDED, 0.0, 1.0, 'b')


def test_a_number_that_was_moved_far_is_believed_less():
    layout = StateLayout(2)
    mean, known = np.zeros(layout.size), np.zeros((layout.size, layout.size))
    near = with_model_errors(mean, known, layout)
    mean[SHEAR_STRENGTH], mean[layout.stiffness] = -0.5, (1.0, 0.0)
    far = with_model_errors(mean, known, layout)
    assert near[SHEAR_STRENGTH, SHEAR_STRENGTH] == pytest.approx(0.05**2)
    assert far[SHEAR_STRENGTH, SHEAR_STRENGTH] == pytest.approx(0.05**2 + 0.2**2)
    average = np.full(2, 0.5)  # moved by 0.5: 0.2 of error, common to both wheels
    for P, error in ((near, 0.0), (far, 0.2)):
        variance = average @ P[layout.stiffness, layout.stiffness] @ average
        assert variance == pytest.approx(0.25**2 + error**2)
