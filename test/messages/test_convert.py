# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages to measurements."""

import math

import numpy as np
import pytest
from estimate_sets import STAMP
from recordings import Converter
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.messages.convert import imu_mounting, stamp_of

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
NONE = 'contains none of the configured wheels'
LENGTHS = 'velocity and name differ in length'
EMPTY = 'velocity is empty -> publish the wheel rates there, or set wheel_odometry: odom'


@pytest.fixture
def make_converter(rover):
    """Make a converter for the cart, with other parameters."""
    return lambda **changes: Converter(
        rover.replace({key.replace('__', '.'): v for key, v in changes.items()})
    )


@pytest.fixture
def converter(make_converter):
    return make_converter()


@pytest.fixture
def joints(converter, factory):
    """Convert a JointState of these names and columns."""

    def convert(names, by=converter, topic='joint_states', **columns):
        return by.convert(topic, factory.joint_state(factory.header(STAMP), names, **columns))

    return convert


@pytest.fixture
def imu(converter, factory):
    """Convert an Imu; diagonals of its covariances by the names of their fields."""

    def convert(attitude=UPRIGHT, force=(0.0, 0.0, 9.8), rate=(0.0,) * 3, by=converter, **fields):
        message = factory.imu(factory.header(STAMP), force, rate, attitude)
        for field, diagonal in fields.items():
            setattr(message, f'{field}_covariance', np.diag(diagonal).reshape(9))
        return by.convert('imu/data', message)

    return convert


@pytest.fixture
def odometry(factory):
    """Convert an Odometry of these speeds; variances along x and y."""

    def convert(by, topic, forward, yaw_rate=0.0, lateral=0.0, variances=(0.0, 0.0)):
        covariance = np.zeros(36)
        covariance[[0, 7]] = variances
        twist = factory.twist_with_covariance(forward, yaw_rate, covariance)
        twist.twist.linear.y = lateral
        return by.convert(topic, factory.odometry(factory.header(STAMP), twist))

    return convert


def test_joint_state_is_sorted_into_the_order_of_the_wheels(joints, factory):
    assert stamp_of(factory.joint_state(factory.header(STAMP), [])) == STAMP
    measured = joints(('right', 'mast', 'left'), velocity=(-3, 99, 2), effort=(-5, 99, 4))
    assert measured.stamp == STAMP
    # The right joint counts negative forward: rate and torque are flipped.
    assert measured.rate.tolist() == [2.0, 3.0]
    assert measured.torque.tolist() == [4.0, 5.0]
    # Wheels that a message does not hold are unknown.
    measured = joints(('right',), velocity=(-3.0,))
    assert math.isnan(measured.rate[0]) and measured.rate[1] == 3.0
    assert np.isnan(measured.torque).all()


@pytest.mark.parametrize(
    ('names', 'velocity', 'reason'),
    [
        (('mast',), (1.0,), NONE),
        ((), (), NONE),
        (('left', 'right'), (), EMPTY),
        (('left', 'right'), (1.0,), LENGTHS),
    ],
)
def test_joint_state_that_does_not_fit_is_counted(joints, converter, names, velocity, reason):
    assert joints(names, velocity=velocity) is None
    assert converter.rejected == {('joint_states', reason): 1}


def test_other_joints_on_the_topic_of_the_wheels_are_no_fault(joints, converter):
    """A mast publishes there too, without a rate: unknown names are ignored."""
    assert joints(('mast',), position=(0.1,)) is None
    assert converter.rejected  # for so long as nothing else comes
    assert joints(('left',), velocity=(1.0,)) is not None
    assert joints(('mast',), position=(0.1,)) is None
    assert not converter.rejected


def test_wheels_that_come_no_more_under_their_names_are_told(converter, factory):
    for name, stamp in (('left', STAMP), ('wheel_1', STAMP), ('wheel_1', STAMP + 2 * 10**9)):
        message = factory.joint_state(factory.header(stamp), (name,), velocity=(1.0,))
        converter.convert('joint_states', message)
    ((topic, reason),) = converter.rejected
    assert 'wheels, but wheel_1; wheels.names: left, right' in converter.in_words(topic, reason)


@pytest.mark.parametrize(
    ('names', 'words'),
    [
        ((), 'no names'),
        (('mast', ''), "mast, ''"),
        (('a\nb', '\x1b[2J'), r"'a\nb', '\x1b[2J'"),
        (('x' * 5000,), f'{"x" * 300} ...'),
    ],
)
def test_odd_names_stay_in_one_short_line(joints, converter, names, words):
    joints(names, velocity=(0.0,) * len(names))
    ((topic, reason),) = converter.rejected
    assert f'wheels, but {words}; wheels.names' in converter.in_words(topic, reason)


def test_effort_of_another_length_costs_the_torque_only(joints, converter):
    measured = joints(('left', 'right'), velocity=(1.0, -1.0), effort=(1.0,))
    assert measured.rate.tolist() == [1.0, 1.0]
    assert np.isnan(measured.torque).all()
    assert converter.rejected == {('joint_states', 'effort and name differ in length'): 1}


def test_unknown_rate_of_a_named_wheel_is_counted(joints, converter):
    joints(('left', 'mast'), velocity=(1.0, math.nan))
    assert not converter.rejected
    measured = joints(('left', 'right'), velocity=(1.0, math.nan))
    assert measured.rate[0] == 1.0 and math.isnan(measured.rate[1])
    assert sum(converter.rejected.values()) == 1


def test_odometry_gives_each_wheel_its_own_rim_speed(make_converter, odometry):
    measured = odometry(make_converter(wheel_odometry='odom'), 'odom', 1.0, 0.5)
    # Left (y = 0.4): 1.0 - 0.5 * 0.4 = 0.8 m/s, right 1.2 m/s, at the lug tips (0.21 m).
    np.testing.assert_allclose(measured.rate * 0.21, [0.8, 1.2], rtol=1e-14)
    assert np.isnan(measured.torque).all()


def test_imu_without_orientation(imu, converter):
    measured = imu(None, (0.1, 0.2, 9.8), (0.01, 0.02, 0.03))
    assert measured.orientation is None
    assert measured.specific_force.tolist() == [0.1, 0.2, 9.8]
    assert measured.angular_rate.tolist() == [0.01, 0.02, 0.03]
    assert imu((0.0, 0.0, 0.0, 0.0)).orientation is None
    assert imu((0.0, 0.0, 0.0, 2.5)).orientation is None
    assert sum(converter.rejected.values()) == 2
    assert imu((0.0, 0.0, 0.0, 1.5)).orientation.tolist() == list(UPRIGHT)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('absurd', [math.nan, math.inf, -math.inf, 1.7e308])
def test_absurd_values_pass_without_a_warning_on_the_terminal(
    make_converter, imu, odometry, absurd
):
    turned = make_converter(wheel_odometry='odom', sensors__imu_mounting_yaw_deg=30.0)
    assert imu((absurd,) * 4, (absurd,) * 3, (absurd,) * 3, turned).orientation is None
    assert odometry(turned, 'odom', absurd, absurd) is not None
    counted = {topic for topic, _ in turned.rejected}
    assert ('odom' in counted) != math.isfinite(absurd)


LACKING = (-1.0, 0.0, 0.0)  # a first variance of -1: the sensor does not measure this


@pytest.mark.parametrize(
    ('field', 'lost', 'kept'),
    [
        ('linear_acceleration', 'specific_force', 'angular_rate'),
        ('angular_velocity', 'angular_rate', 'specific_force'),
    ],
)
def test_imu_that_says_it_lacks_a_field_keeps_the_others(imu, converter, field, lost, kept):
    measured = imu(None, **{field: LACKING})
    assert np.isnan(getattr(measured, lost)).all() and np.isfinite(getattr(measured, kept)).all()
    ((topic, reason),) = converter.rejected
    assert topic == 'imu/data' and field.replace('_', ' ') in reason


def test_imu_with_nothing_but_an_orientation_keeps_that(imu):
    nothing = {'linear_acceleration': LACKING, 'angular_velocity': LACKING}
    assert imu(UPRIGHT, **nothing).orientation.tolist() == list(UPRIGHT)
    assert imu(None, **nothing) is None


def test_mounting_turns_the_imu_into_base_link(make_converter, imu):
    """A sensor turned by 90 deg to the left and tilted sees the same rover."""
    turned = make_converter(
        sensors__imu_mounting_yaw_deg=90.0, sensors__imu_mounting_roll_deg=180.0
    )
    # Upside down, its x to the left of the rover: its y then points forward, its z down.
    measured = imu(UPRIGHT, (0.2, 0.1, -9.8), (0.02, 0.01, -0.03), turned)
    np.testing.assert_allclose(measured.specific_force, [0.1, 0.2, 9.8], atol=1e-12)
    np.testing.assert_allclose(measured.angular_rate, [0.01, 0.02, 0.03], atol=1e-12)


@pytest.mark.parametrize(
    ('mounting', 'expected'),
    [
        ({}, (0.01, 9e-4, 2e-4)),
        # Half a right angle about z mixes x and y; on its side its y turns about the vertical.
        ({'sensors__imu_mounting_yaw_deg': 45.0}, (0.025, 9e-4, 2e-4)),
        ({'sensors__imu_mounting_roll_deg': 90.0}, (0.01, 4e-4, 2e-4)),
    ],
)
def test_imu_states_its_variances_along_the_axes_of_the_rover(
    make_converter, imu, mounting, expected
):
    measured = imu(
        by=make_converter(**mounting),
        linear_acceleration=(0.01, 0.04, 0.09),
        angular_velocity=(1e-4, 4e-4, 9e-4),
        orientation=(1e-4, 2e-4, 5e-2),  # heading, the last, is not used
    )
    assert measured.variance == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    'diagonal',
    [
        (0.0,) * 3,
        (1.0,) * 3,
        LACKING,
        (math.nan,) * 3,
        (0.1, -0.1, 0.1),
        (0.1, 0.0, 0.1),
        (math.inf,) * 3,
    ],
)
def test_placeholders_in_an_imu_state_nothing(imu, diagonal):
    force = (0.0,) * 3 if diagonal is LACKING else diagonal  # one of the fields has to be there
    measured = imu(linear_acceleration=force, angular_velocity=diagonal, orientation=diagonal)
    assert measured.variance == (0.0, 0.0, 0.0)


def test_orientation_of_base_link_agrees_with_the_turned_vectors(make_converter, imu):
    """World vectors do not depend on how the sensor is mounted: R_base f_base = R_imu f_imu."""
    roll, pitch, yaw = (f'sensors__imu_mounting_{name}_deg' for name in ('roll', 'pitch', 'yaw'))
    sensor = np.array([0.1, -0.3, 0.2, 0.9])
    sensor /= np.linalg.norm(sensor)
    force = np.array([0.5, -1.0, 9.0])
    turned = make_converter(**{roll: 20.0, pitch: -35.0, yaw: 110.0})
    measured = imu(tuple(sensor), force, by=turned)
    np.testing.assert_allclose(
        Rotation.from_quat(measured.orientation).as_matrix() @ measured.specific_force,
        Rotation.from_quat(sensor).as_matrix() @ force,
        atol=1e-12,
    )


def test_roll_pitch_yaw_are_about_fixed_axes(rover):
    """That is, about its own axes as they turn with it: yaw, pitch, roll."""
    angles = {'roll': 20.0, 'pitch': -30.0, 'yaw': 60.0}
    turned = rover.replace({f'sensors.imu_mounting_{key}_deg': a for key, a in angles.items()})
    found = imu_mounting(turned).as_euler('ZYX', degrees=True)
    np.testing.assert_allclose(found, [60.0, -30.0, 20.0], atol=1e-12)


def test_sinkage_leaving_angle_and_reference(joints, converter, odometry):
    told = {'names': ('right', 'left'), 'position': (0.03, math.nan)}
    np.testing.assert_array_equal(joints(topic='sinkage', **told).sinkage, [math.nan, 0.03])
    assert joints(topic='leaving_angle', **told).leaving_angle[1] == 0.03
    reference = odometry(converter, 'reference_odom', 0.7, 0.1, variances=(4e-4, 0.0))
    assert (reference.forward, reference.variance) == (0.7, 4e-4)


@pytest.fixture
def steered(make_converter):
    """The left wheel steers; the right one does not."""
    return make_converter(wheels__steering_joints=['turn', ''])


def test_steering_angles_come_in_the_position_of_their_joints(joints, steered):
    names = ('turn', 'right', 'left')
    measured = joints(names, steered, position=(0.2, 7.0, 8.0), velocity=(0.0, -3.0, 2.0))
    assert measured.rate.tolist() == [2.0, 3.0]
    np.testing.assert_array_equal(measured.steering, [0.2, math.nan])


def test_a_message_of_steering_joints_alone_is_no_fault(joints, steered):
    measured = joints(('turn',), steered, position=(-0.1,))
    assert np.isnan(measured.rate).all() and measured.steering[0] == -0.1
    assert not steered.rejected
    assert joints(('turn', 'left'), steered, velocity=(0.0, 2.0)).steering is None
    assert steered.rejected == {('joint_states', 'position of steering joints missing'): 1}
    # Without steering joints positions are not looked at.
    assert joints(('left',), position=(math.nan,), velocity=(2.0,)).steering is None


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
    converter, odometry, lateral, stated, told, variance
):
    found = odometry(converter, 'reference_odom', 0.7, 0.0, lateral, (4e-4, stated))
    np.testing.assert_equal((found.lateral, found.lateral_variance), (told, variance))


def test_a_pose_alone_is_no_velocity(converter, factory):
    """Of a rover that is stuck it does not move: zero is its velocity."""
    still, rolls = (factory.twist_with_covariance(v, 0.0, np.zeros(36)) for v in (0.0, 0.1))
    messages = [(still, 0.0), (still, 0.0), (still, 0.1), (still, 0.2), (still, 0.2), (rolls, 0.3)]
    found = [
        converter.convert('reference_odom', factory.odometry(factory.header(STAMP), twist, x))
        for twist, x in messages
    ]
    assert [f and f.forward for f in found] == [0.0, 0.0, None, None, 0.0, 0.1]
    ((topic, why),) = converter.rejected
    assert topic == 'reference_odom' and why.startswith('holds a pose only')
