# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages to measurements."""

import math
from typing import Any

import numpy as np
import pytest
from estimate_sets import STAMP
from recordings import Converter
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.messages.convert import input_layout, stamp_of


@pytest.fixture
def converter(rover):
    return Converter(input_layout(rover))


def test_stamp_is_exact(factory):
    assert stamp_of(factory.joint_state(factory.header(STAMP), [])) == STAMP


def test_joint_state_is_sorted_into_the_order_of_the_wheels(converter, factory):
    message = factory.joint_state(
        factory.header(STAMP),
        ('right', 'mast', 'left'),
        velocity=(-3.0, 99.0, 2.0),
        effort=(-5.0, 99.0, 4.0),
    )
    measured = converter.convert('joint_states', message)
    assert measured.stamp == STAMP
    # The right joint counts negative forward: rate and torque are flipped.
    assert measured.rate.tolist() == [2.0, 3.0]
    assert measured.torque.tolist() == [4.0, 5.0]


def test_wheels_that_a_message_does_not_hold_are_unknown(converter, factory):
    message = factory.joint_state(factory.header(STAMP), ('right',), velocity=(-3.0,))
    measured = converter.convert('joint_states', message)
    assert math.isnan(measured.rate[0])
    assert measured.rate[1] == 3.0
    assert np.isnan(measured.torque).all()


@pytest.mark.parametrize(
    ('names', 'velocity', 'effort', 'reason'),
    [
        (('mast',), (1.0,), (), 'none of the configured wheels in it'),
        ((), (), (), 'none of the configured wheels in it'),
        (('left', 'right'), (), (), 'velocity and name differ in length'),
        (('left', 'right'), (1.0,), (), 'velocity and name differ in length'),
    ],
)
def test_joint_state_that_does_not_fit_is_counted(
    converter, factory, names, velocity, effort, reason
):
    message = factory.joint_state(factory.header(STAMP), names, velocity=velocity, effort=effort)
    assert converter.convert('joint_states', message) is None
    assert converter.rejected == {('joint_states', reason): 1}


def test_other_joints_on_the_topic_of_the_wheels_are_no_fault(converter, factory):
    """A mast publishes there too, without a rate: unknown names are ignored."""
    header = factory.header(STAMP)
    mast = factory.joint_state(header, ('mast',), position=(0.1,))
    wheel = factory.joint_state(header, ('left',), velocity=(1.0,))
    assert converter.convert('joint_states', mast) is None
    assert converter.rejected  # for so long as nothing else comes
    assert converter.convert('joint_states', wheel) is not None
    assert converter.convert('joint_states', mast) is None
    assert not converter.rejected


def test_wheels_that_come_no_more_under_their_names_are_told(converter, factory):
    for name, stamp in (('left', STAMP), ('wheel_1', STAMP), ('wheel_1', STAMP + 2 * 10**9)):
        message = factory.joint_state(factory.header(stamp), (name,), velocity=(1.0,))
        converter.convert('joint_states', message)
    ((topic, reason),) = converter.rejected
    assert 'in it but wheel_1; wheels.names: left, right' in converter.in_words(topic, reason)


@pytest.mark.parametrize(
    ('names', 'words'),
    [
        ((), 'no names'),
        (('mast', ''), "mast, ''"),
        (('a\nb', '\x1b[2J'), r"'a\nb', '\x1b[2J'"),
        (('x' * 5000,), f'{"x" * 300} ...'),
    ],
)
def test_odd_names_stay_in_one_short_line(converter, factory, names, words):
    message = factory.joint_state(factory.header(STAMP), names, velocity=(0.0,) * len(names))
    converter.convert('joint_states', message)
    ((topic, reason),) = converter.rejected
    assert f'in it but {words}; wheels.names' in converter.in_words(topic, reason)


def test_effort_of_another_length_costs_the_torque_only(converter, factory):
    message = factory.joint_state(
        factory.header(STAMP), ('left', 'right'), velocity=(1.0, -1.0), effort=(1.0,)
    )
    measured = converter.convert('joint_states', message)
    assert measured.rate.tolist() == [1.0, 1.0]
    assert np.isnan(measured.torque).all()
    assert converter.rejected == {('joint_states', 'effort and name differ in length'): 1}


def test_unknown_rate_of_a_named_wheel_is_counted(converter, factory):
    header = factory.header(STAMP)
    message = factory.joint_state(header, ('left', 'mast'), velocity=(1.0, math.nan))
    converter.convert('joint_states', message)
    assert not converter.rejected
    message = factory.joint_state(header, ('left', 'right'), velocity=(1.0, math.nan))
    measured = converter.convert('joint_states', message)
    assert measured.rate[0] == 1.0
    assert math.isnan(measured.rate[1])
    assert sum(converter.rejected.values()) == 1


def test_odometry_gives_each_wheel_its_own_rim_speed(rover, factory):
    converter = Converter(input_layout(rover.replace({'wheel_odometry': 'odom'})))
    twist = factory.twist_with_covariance(1.0, 0.5, np.zeros(36))
    measured = converter.convert('odom', factory.odometry(factory.header(STAMP), twist))
    # Left (y = 0.4): 1.0 - 0.5 * 0.4 = 0.8 m/s, right 1.2 m/s, at the lug tips (0.21 m).
    np.testing.assert_allclose(measured.rate * 0.21, [0.8, 1.2], rtol=1e-14)
    assert np.isnan(measured.torque).all()


def test_imu_without_orientation(converter, factory):
    message = factory.imu(factory.header(STAMP), (0.1, 0.2, 9.8), (0.01, 0.02, 0.03), None)
    measured = converter.convert('imu/data', message)
    assert measured.orientation is None
    assert measured.specific_force.tolist() == [0.1, 0.2, 9.8]
    assert measured.angular_rate.tolist() == [0.01, 0.02, 0.03]
    zero = factory.imu(factory.header(STAMP), (0, 0, 9.8), (0, 0, 0), (0.0, 0.0, 0.0, 0.0))
    assert converter.convert('imu/data', zero).orientation is None
    assert sum(converter.rejected.values()) == 1


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('absurd', [math.nan, math.inf, -math.inf, 1.7e308])
def test_absurd_values_pass_without_a_warning_on_the_terminal(rover, factory, absurd):
    turned = rover.replace({'wheel_odometry': 'odom', 'sensors.imu_mounting_yaw_deg': 30.0})
    converter = Converter(input_layout(turned))
    header = factory.header(STAMP)
    imu = factory.imu(header, (absurd,) * 3, (absurd,) * 3, (absurd,) * 4)
    assert converter.convert('imu/data', imu).orientation is None
    twist = factory.twist_with_covariance(absurd, absurd, np.zeros(36))
    assert converter.convert('odom', factory.odometry(header, twist)) is not None
    counted = {topic for topic, _ in converter.rejected}
    assert ('odom' in counted) != math.isfinite(absurd)


@pytest.mark.parametrize('field', ['linear_acceleration', 'angular_velocity'])
def test_imu_that_says_it_lacks_a_field_keeps_the_others(converter, factory, field):
    message = factory.imu(factory.header(STAMP), (0.0, 0.0, 9.8), (0.0, 0.0, 0.0), None)
    getattr(message, f'{field}_covariance')[0] = -1.0
    measured = converter.convert('imu/data', message)
    vectors = {
        'linear_acceleration': measured.specific_force,
        'angular_velocity': measured.angular_rate,
    }
    assert np.isnan(vectors.pop(field)).all()
    assert all(np.isfinite(other).all() for other in vectors.values())
    ((topic, reason),) = converter.rejected
    assert topic == 'imu/data'
    assert field.replace('_', ' ') in reason


def test_imu_with_nothing_but_an_orientation_keeps_that(converter, factory):
    level = (0.0, 0.0, 0.0, 1.0)
    for orientation in (level, None):
        message = factory.imu(factory.header(STAMP), (0.0,) * 3, (0.0,) * 3, orientation)
        message.linear_acceleration_covariance[0] = -1.0
        message.angular_velocity_covariance[0] = -1.0
        measured = converter.convert('imu/data', message)
        assert (measured is None) == (orientation is None)
        if measured is not None:
            assert measured.orientation.tolist() == list(level)


def test_mounting_turns_the_imu_into_base_link(rover, factory):
    """A sensor turned by 90 deg to the left and tilted sees the same rover."""
    turned = rover.replace(
        {'sensors.imu_mounting_yaw_deg': 90.0, 'sensors.imu_mounting_roll_deg': 180.0}
    )
    converter = Converter(input_layout(turned))
    # Upside down, its x to the left of the rover: its y then points forward, its z down.
    message = factory.imu(
        factory.header(STAMP), (0.2, 0.1, -9.8), (0.02, 0.01, -0.03), (0.0, 0.0, 0.0, 1.0)
    )
    measured = converter.convert('imu/data', message)
    np.testing.assert_allclose(measured.specific_force, [0.1, 0.2, 9.8], atol=1e-12)
    np.testing.assert_allclose(measured.angular_rate, [0.01, 0.02, 0.03], atol=1e-12)


def _with_variances(factory: Any, **fields: tuple[float, float, float]) -> Any:
    upright = (0.0, 0.0, 0.0, 1.0)
    message = factory.imu(factory.header(STAMP), (0.0, 0.0, 9.8), (0.0, 0.0, 0.0), upright)
    for field, diagonal in fields.items():
        setattr(message, f'{field}_covariance', np.diag(diagonal).reshape(9))
    return message


def test_imu_states_its_variances_along_the_axes_of_the_rover(rover, factory):
    message = _with_variances(
        factory,
        linear_acceleration=(0.01, 0.04, 0.09),
        angular_velocity=(1e-4, 4e-4, 9e-4),
        orientation=(1e-4, 2e-4, 5e-2),  # heading, the last, is not used
    )
    level = Converter(input_layout(rover)).convert('imu/data', message)
    assert level.variance == (0.01, 9e-4, 2e-4)
    # Half a right angle about z mixes x and y; a sensor on its side turns its y about the vertical.
    for angles, expected in (
        ({'yaw': 45.0}, (0.025, 9e-4, 2e-4)),
        ({'roll': 90.0}, (0.01, 4e-4, 2e-4)),
    ):
        keys = {f'sensors.imu_mounting_{name}_deg': angle for name, angle in angles.items()}
        turned = Converter(input_layout(rover.replace(keys))).convert('imu/data', message)
        assert turned.variance == pytest.approx(expected)


@pytest.mark.parametrize(
    'diagonal',
    [
        (0.0,) * 3,
        (1.0,) * 3,
        (-1.0, 0.0, 0.0),
        (math.nan,) * 3,
        (0.1, -0.1, 0.1),
        (0.1, 0.0, 0.1),
        (math.inf,) * 3,
    ],
)
def test_placeholders_in_an_imu_state_nothing(converter, factory, diagonal):
    message = _with_variances(
        factory, linear_acceleration=diagonal, angular_velocity=diagonal, orientation=diagonal
    )
    if diagonal[0] == -1.0:  # that field is not there at all; one of them has to be
        message.linear_acceleration_covariance = np.zeros(9)
    assert converter.convert('imu/data', message).variance == (0.0, 0.0, 0.0)


def test_orientation_of_base_link_agrees_with_the_turned_vectors(rover, factory):
    """World vectors do not depend on how the sensor is mounted: R_base f_base = R_imu f_imu."""
    turned = rover.replace(
        {
            'sensors.imu_mounting_roll_deg': 20.0,
            'sensors.imu_mounting_pitch_deg': -35.0,
            'sensors.imu_mounting_yaw_deg': 110.0,
        }
    )
    converter = Converter(input_layout(turned))
    sensor = np.array([0.1, -0.3, 0.2, 0.9])
    sensor /= np.linalg.norm(sensor)
    force = np.array([0.5, -1.0, 9.0])
    message = factory.imu(factory.header(STAMP), force, (0, 0, 0), tuple(sensor))
    measured = converter.convert('imu/data', message)
    np.testing.assert_allclose(
        Rotation.from_quat(measured.orientation).as_matrix() @ measured.specific_force,
        Rotation.from_quat(sensor).as_matrix() @ force,
        atol=1e-12,
    )


def test_roll_pitch_yaw_are_about_fixed_axes(rover):
    roll, pitch, yaw = 0.3, -0.5, 1.1
    x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    angles = {'roll': roll, 'pitch': pitch, 'yaw': yaw}
    turned = rover.replace(
        {f'sensors.imu_mounting_{name}_deg': math.degrees(a) for name, a in angles.items()}
    )
    found = input_layout(turned).imu_mounting.as_matrix()
    np.testing.assert_allclose(found, z @ y @ x, atol=1e-15)


def test_sinkage_leaving_angle_and_reference(converter, factory):
    header = factory.header(STAMP)
    message = factory.joint_state(header, ('right', 'left'), position=(0.03, math.nan))
    sinkage = converter.convert('sinkage', message)
    assert math.isnan(sinkage.sinkage[0])
    assert sinkage.sinkage[1] == 0.03
    assert converter.convert('leaving_angle', message).leaving_angle[1] == 0.03
    twist = factory.twist_with_covariance(0.7, 0.1, [4e-4] + [0.0] * 35)
    reference = converter.convert('reference_odom', factory.odometry(header, twist))
    assert (reference.forward, reference.variance) == (0.7, 4e-4)


@pytest.fixture
def steered(rover):
    """The left wheel steers; the right one does not."""
    return Converter(input_layout(rover.replace({'wheels.steering_joints': ['turn', '']})))


def test_steering_angles_come_in_the_position_of_their_joints(steered, factory):
    message = factory.joint_state(
        factory.header(STAMP),
        ('turn', 'right', 'left'),
        position=(0.2, 7.0, 8.0),
        velocity=(0.0, -3.0, 2.0),
    )
    measured = steered.convert('joint_states', message)
    assert measured.rate.tolist() == [2.0, 3.0]
    np.testing.assert_array_equal(measured.steering, [0.2, math.nan])


def test_a_message_of_steering_joints_alone_is_no_fault(steered, factory):
    message = factory.joint_state(factory.header(STAMP), ('turn',), position=(-0.1,))
    measured = steered.convert('joint_states', message)
    assert np.isnan(measured.rate).all()
    assert measured.steering[0] == -0.1
    assert not steered.rejected
    message = factory.joint_state(factory.header(STAMP), ('turn', 'left'), velocity=(0.0, 2.0))
    assert steered.convert('joint_states', message).steering is None
    assert steered.rejected == {('joint_states', 'position of steering joints missing'): 1}


def test_without_steering_joints_positions_are_not_looked_at(converter, factory):
    message = factory.joint_state(
        factory.header(STAMP), ('left',), position=(math.nan,), velocity=(2.0,)
    )
    assert converter.convert('joint_states', message).steering is None


@pytest.mark.parametrize(
    ('lateral', 'stated', 'told', 'variance'),
    [
        (0.2, 1e-4, 0.2, 1e-4),
        (-0.2, 0.0, -0.2, 0.0),  # variance not stated
        (-0.2, -1.0, -0.2, 0.0),
        (0.0, 1e-4, math.nan, 1e-4),  # what a source without a lateral speed sends
        (0.2, 1e6, math.nan, 1e6),  # says that nothing is known
    ],
)
def test_a_reference_tells_a_lateral_speed_where_it_knows_one(
    converter, factory, lateral, stated, told, variance
):
    covariance = np.zeros(36)
    covariance[[0, 7]] = 4e-4, stated
    twist = factory.twist_with_covariance(0.7, 0.0, covariance)
    twist.twist.linear.y = lateral
    message = factory.odometry(factory.header(STAMP), twist)
    reference = converter.convert('reference_odom', message)
    np.testing.assert_equal((reference.lateral, reference.lateral_variance), (told, variance))
