# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All faults that the checks know, worst first: one for recordings and while driving."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from wheel_terra_estimator.checks.finding import Finding
from wheel_terra_estimator.configuration.configuration import Configuration

RATE_UNITS = {
    'revolutions per minute': 2.0 * math.pi / 60.0,
    'degrees per second': math.pi / 180.0,
    'revolutions per second': 2.0 * math.pi,
    'thousandths of rad/s': 1e-3,
}
"""Units that wheel rates come in by mistake: factor to rad/s."""
SKID_TRACKS = (0.7, 6.0)
"""Effective over geometric track of rovers, skidding or not [-]."""
LEAST_TURN_RATE = 0.02
"""Yaw rate [rad/s] below which sides are not compared."""
STANDARD_GRAVITY = 9.80665  # [m/s^2]


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Attributes
    ----------
    kind : str
        One of ``finding.KINDS``.
    words, cure : str
        Format strings of what was seen and what mends it.
    parameter : str or None
        Key of the rover file that mends it.
    channel : str
        Channel of the recording that it is told of.
    """

    kind: str
    words: str
    cure: str
    parameter: str | None = None
    channel: str = 'joints'


_DIRECTIONS = 'wheels.direction: [{directions}]'
_OFFSET = 'sensors.{name}_stamp_offset: {value:.3f}, or synchronise the clocks'
_LATE = 'its stamps are {size:.2f} +- {std:.2f} s too {side}, by {against}'

FAULTS: dict[str, Fault] = {
    # Names and missing inputs
    'missing_input': Fault(
        'drop_outs', 'no {what} in the recording, which the estimator needs: {effect}', '{how}'
    ),
    'topic_name': Fault(
        'unknown_name', 'the estimator listens to {own}, the recording has {topic}', '{remap}'
    ),
    'missing_wheel': Fault(
        'missing_wheel',
        '{how}',
        'publish {wheels}, or take {it} out of wheels.names and of every per-wheel list',
        'wheels.names',
    ),
    'joint_name': Fault(
        'unknown_name',
        'no joint of this name in the recording, but {other}',
        'wheels.names: [{names}]',
        'wheels.names',
    ),
    'spare_joint': Fault(
        'unknown_name',
        'turns like a wheel and is not in wheels.names',
        'add {wheels} to wheels.names, with radius, width, x and y',
        'wheels.names',
    ),
    'steering': Fault(
        'unknown_name',
        '{listed} look like joints that steer, and no wheel is said to be steered: its slip '
        'would be that of a wheel that points straight ahead',
        'wheels.steering_joints: [{joints}]',
        'wheels.steering_joints',
    ),
    # Units and gravity
    'rate_unit': Fault(
        'unit',
        'velocity is in {unit} ({how})',
        'multiply velocity by {value:.6g} in the driver (rad/s, REP 103)',
    ),
    'rate_counts': Fault(
        'unit',
        'velocity is {times:.0f} times what the {how} allows: counts of an encoder per second, '
        'about {counts:.0f} in a turn of the wheel?',
        'multiply velocity by 2 pi / counts per turn (about {value:.3g}) in the driver '
        '(rad/s, REP 103)',
    ),
    'gravity_off': Fault(
        'gravity',
        'mean specific force {size:.3g} m/s^2 where gravity is {gravity:.4g}: gravity was taken '
        'off',
        'publish the specific force with gravity (+g on z at rest, REP 145), such as '
        'imu/data_raw in place of a linear acceleration',
        channel='imu',
    ),
    'force_unit': Fault(
        'unit',
        'mean specific force {size:.3g} where gravity is {gravity:.4g}: linear_acceleration is '
        'in {unit}',
        'multiply linear_acceleration by {value:.5g} in the driver (m/s^2, REP 103)',
        channel='imu',
    ),
    'planet': Fault(
        'gravity',
        'mean specific force {size:.3g} m/s^2 where gravity is {gravity:.4g}: this is {place}',
        'rover.gravity: {value:.4g}',
        'rover.gravity',
        channel='imu',
    ),
    'force_scale': Fault(
        'gain',
        'mean specific force {size:.3g} m/s^2 where gravity is {gravity:.4g}: the accelerometer '
        'has another scale',
        'multiply linear_acceleration by {value:.4g} in the driver, or state rover.gravity',
        channel='imu',
    ),
    'gyro_degrees': Fault(
        'unit',
        'angular_velocity is {times:.0f} times what the {how} allows: degrees per second',
        'multiply angular_velocity by 0.0174533 in the driver (rad/s, REP 103)',
        channel='imu',
    ),
    'force_zero': Fault(
        'placeholder',
        '{field} is 0 in every message',
        'fill {field}, or say that there is none: {field}_covariance[0] = -1',
        channel='imu',
    ),
    'orientation_placeholder': Fault(
        'placeholder',
        'orientation is ({shown}) in every message',
        'say that there is none: orientation_covariance[0] = -1 (REP 145)',
        channel='imu',
    ),
    'torque_placeholder': Fault(
        'placeholder',
        'effort is 0 in every message',
        'publish the torque at the wheel, or leave effort empty where there is none',
    ),
    # Signs and places of the wheels
    'imu_upside': Fault(
        'mounting',
        '{force}: the IMU is mounted upside down or on its side',
        '{angles}',
        channel='imu',
    ),
    'backwards': Fault(
        'sign',
        'counts backwards when the rover drives forward{trial}',
        _DIRECTIONS + '{torque}',
        'wheels.direction',
    ),
    'all_backwards': Fault(
        'sign',
        'all wheels may count backwards: they run against the reference',
        _DIRECTIONS,
        'wheels.direction',
    ),
    'reference_reversed': Fault(
        'sign',
        'linear.x runs against the wheels',
        'negate twist.linear.x in its driver, or turn its frame into base_link{or_wheels}',
        channel='reference',
    ),
    'swapped_sides': Fault(
        'swapped_sides',
        'left and right wheels turn against the gyro: the sides are swapped{rival}{trial}',
        'exchange left and right in wheels.names: [{names}]{mirrored}',
        'wheels.names',
    ),
    'gyro_reversed': Fault(
        'sign',
        'angular_velocity.{axis} turns against {against}',
        'negate angular_velocity.{axis} in the driver (REP 103: positive to the left; no '
        'mounting angle does that)',
        channel='imu',
    ),
    'exchanged': Fault(
        'exchanged_wheels',
        'each turns like a wheel of the other side{trial}',
        'wheels.names: [{names}]',
        'wheels.names',
    ),
    'rate_frozen': Fault(
        'frozen',
        '{how} while the other wheels change',
        'look at encoder and cable of {wheels}; publish nan, or leave it out of the message, '
        'while it is dead',
        'wheels.names',
    ),
    'sensor_frozen': Fault(
        'frozen',
        '{how}',
        'publish a message when the sensor has measured, not on a timer; nothing while it is dead',
        channel='imu',
    ),
    # Stamps
    'order': Fault(
        'order',
        '{how}',
        'stamp each message in the driver, once, when it is measured, and publish in order',
    ),
    'drop_outs': Fault(
        'drop_outs',
        '{gaps} gaps, the longest {longest:.2g} s at a period of {period:.3g} s; '
        '{missing:.1f} % of the messages are missing',
        'look at the load of bus and network, and record with a larger cache '
        '(ros2 bag record --max-cache-size)',
    ),
    'imu_offset': Fault('delay', _LATE, _OFFSET, 'sensors.imu_stamp_offset', channel='imu'),
    'reference_offset': Fault(
        'delay', _LATE, _OFFSET, 'sensors.reference_stamp_offset', channel='reference'
    ),
    'wheel_odometry_offset': Fault('delay', _LATE, _OFFSET, 'sensors.wheel_odometry_stamp_offset'),
    'sinkage_offset': Fault(
        'delay', _LATE, _OFFSET, 'sensors.sinkage_stamp_offset', channel='sinkage'
    ),
    # IMU
    'imu_yaw': Fault(
        'mounting',
        'forward acceleration, curves and slopes show {angle:.0f} +- {off:.0f} degrees off its x '
        'axis{trial}',
        '{angles}',
        channel='imu',
    ),
    'imu_tilt': Fault(
        'mounting',
        'its axes lie {size:.2f} degrees off the chassis, seen in full turns',
        '{angles}',
        channel='imu',
    ),
    'gyro_bias': Fault(
        'zero',
        'angular_velocity.{axis} reads {bias:.3g} rad/s {where}',
        'sensors.angular_rate_bias: [{biases}]',
        'sensors.angular_rate_bias',
        channel='imu',
    ),
    'imu_wild': Fault(
        'noise',
        '{count} samples ({share:.1f} %) leave their neighbours by up to {most:.3g} m/s^2, what no '
        'body does: they are left out',
        'look at bus, cable and driver of the IMU; the node leaves such samples out and counts '
        'them',
        channel='imu',
    ),
    'imu_noise': Fault(
        'noise',
        'noise {noise:.2g} {unit} where the rover file has {stated:g} {unit}',
        '{parameter}: {noise:.2g}',
        channel='imu',
    ),
    # Reference
    'reference_world': Fault(
        'mounting',
        'the direction of its velocity turns with the heading: it is given in the world frame',
        'publish twist in child_frame_id base_link (nav_msgs/Odometry), or turn it by the heading '
        'first',
        channel='reference',
    ),
    'reference_axis': Fault(
        'mounting',
        'the rover moves along y of its frame, not along x',
        'turn twist.linear by {turn:.0f} degrees about z into base_link (x forward)',
        channel='reference',
    ),
    'reference_unit': Fault(
        'unit',
        'linear.x is {ratio:.3g} times the rim speed: it is in {unit}',
        'multiply twist.linear by {value:.5g} in its driver (m/s, REP 103)',
        channel='reference',
    ),
    'radius': Fault(
        'radius',
        'the rover runs {ratio:.3f} +- {off:.3f} of what its rims say on the straight{rival}'
        '{trial}',
        'wheels.radius: [{radii}]{separate}',
        'wheels.radius',
    ),
    'reference_scale': Fault(
        'gain',
        'linear.x is {ratio:.3f} +- {off:.3f} of the speed of the rims on the straight{rival}'
        '{trial}',
        'multiply twist.linear by {value:.4f} in its driver{separate}',
        None,
        channel='reference',
    ),
    'track': Fault(
        'track',
        'turns need a track of {ratio:.3f} +- {off:.3f} of the stated {stated:.3f} m{trial}',
        'wheels.y: [{lateral}]',
        'wheels.y',
    ),
    # Torque
    'torque_unit': Fault(
        'unit',
        'sum of T/r is {traction:.3g} times the weight: effort is in N mm',
        'multiply effort by 0.001 in the driver (N m, REP 103)',
    ),
    'torque_sign': Fault(
        'sign',
        'torque brakes where the wheel drives on the level or uphill',
        'negate effort of {wheels} in the driver (wheels.direction flips rate and torque together)',
    ),
    'torque_scale': Fault(
        'gain',
        'sum of T/r is {traction:.3g} of the weight on the level, what no soil asks for: a motor '
        'current, or a torque before the gear?',
        'sensors.torque_gain: [{gains}], or turn current into torque at the wheel (motor constant '
        'times gear ratio times efficiency)',
        'sensors.torque_gain',
    ),
    'torque_gain': Fault(
        'gain',
        'slopes cost {gain:.2f} +- {off:.2f} of what weight and torque say: the torque has '
        'another scale, or the mass is another{trial}',
        'sensors.torque_gain: [{gains}] (or rover.mass: {mass:.1f}: weigh the rover)',
        'sensors.torque_gain',
    ),
    'mass': Fault(
        'mass',
        'slopes cost {gain:.2f} +- {off:.2f} of what weight and torque say: the mass is another, '
        'or the torque has another scale{trial}',
        'rover.mass: {mass:.1f} (or sensors.torque_gain: [{gains}]: weigh the rover)',
        'rover.mass',
    ),
    'torque_zero': Fault(
        'zero',
        'torque reads {left} N m off zero, {where}{rival}',
        'sensors.torque_zero: [{zeros}]',
        'sensors.torque_zero',
    ),
    # Sinkage
    'sinkage_missing': Fault(
        'missing_wheel',
        'has no sinkage',
        'publish the sinkage of {wheels}, nan while there is none',
        channel='sinkage',
    ),
    'sinkage_unit': Fault(
        'unit',
        'median sinkage {level:.3g} with noise {noise:.2g} at a wheel radius of {radius:.3g} m: it '
        'is in {unit}',
        'multiply position by {value:g} in the driver (m, REP 103)',
        channel='sinkage',
    ),
    'sinkage_sign': Fault(
        'sign',
        'median sinkage {reading:.0f} mm{others}: counted upwards',
        'negate position{of} in the driver (positive down)',
        channel='sinkage',
    ),
    'sinkage_zero': Fault(
        'zero',
        '{how}',
        'sensors.sinkage_zero: [{zeros}]',
        'sensors.sinkage_zero',
        channel='sinkage',
    ),
    # What the estimator lives with
    'jumps': Fault(
        'jumps',
        '{count} velocities ({share:.1f} %) leave their neighbours by up to {most:.2g} m/s',
        'use the filtered velocity of the receiver in place of differences of raw positions, and '
        'leave out what has no solution',
        channel='reference',
    ),
    'rate_noise': Fault(
        'noise',
        'rate scatters by {noise:.2g} rad/s where the rover file has {stated:g}',
        'sensors.wheel_rate_std: {noise:.2g}',
        'sensors.wheel_rate_std',
    ),
    'rate_steps': Fault(
        'noise',
        'rate comes in steps of {step:.3g} rad/s ({share:.0f} % of the usual rate), as of an '
        'encoder of {counts:.0f} counts per turn of the wheel read every {period:.3g} s; the '
        'rover file has a noise of {stated:g}',
        'sensors.wheel_rate_std: {noise:.2g}, or form the rate over more counts (a longer '
        'interval) in the driver',
        'sensors.wheel_rate_std',
    ),
    'sinkage_noise': Fault(
        'noise',
        'readings scatter by {noise_mm:.2g} mm where the rover file has {stated:.2g} mm',
        'sensors.sinkage_std: {noise:.2g}',
        'sensors.sinkage_std',
        channel='sinkage',
    ),
    'reference_noise': Fault(
        'noise',
        'velocity scatters by {noise:.2g} m/s and states {stated:.2g} m/s',
        'state the variance {variance:.2g} in twist.covariance[0] (sensors.reference_std: '
        '{noise:.2g} where it states none)',
        'sensors.reference_std',
        channel='reference',
    ),
    'covariance': Fault(
        'covariance',
        'covariance is a placeholder: it {how}',
        'sensors.reference_std: {noise:.2g} and twist.covariance[0] = 0, or the true variance '
        '({variance:.2g}) there',
        'sensors.reference_std',
        channel='reference',
    ),
}

RANK = {key: rank for rank, key in enumerate(FAULTS)}
"""Place of a fault, worst first."""


def found(
    key: str,
    topic: str,
    confidence: float,
    *,
    wheel: str | None = None,
    value: float | None = None,
    std: float | None = None,
    **figures: Any,
) -> Finding:
    """Return a finding in the words of its fault.

    Parameters
    ----------
    key : str
        A name of ``FAULTS``.
    topic : str
        Topic in the recording.
    confidence : float
        Probability that it is so.
    wheel : str, optional
        The wheel concerned, or several with commas between.
    value, std : float, optional
        Of the parameter.
    figures
        What the words name.
    """
    fault = FAULTS[key]
    figures = {'trial': '', 'rival': '', 'separate': '', 'wheels': wheel, 'topic': topic} | figures
    figures.setdefault('value', value)
    figures.setdefault('std', std)
    return Finding(
        kind=fault.kind,
        topic=topic,
        wheel=wheel,
        parameter=figures.get('parameter', fault.parameter),
        value=value,
        std=std,
        confidence=confidence,
        words=fault.words.format(**figures),
        cure=fault.cure.format(**figures),
        fault=key,
    )


def of_offset(
    name: str, left: float, std: float, against: str, configuration: Configuration | None
) -> dict[str, Any]:
    """Return what a finding says of stamps that are ``left`` [s] off beyond what is stated."""
    key = f'{name}_stamp_offset'
    stated = 0.0 if configuration is None else float(getattr(configuration.sensors, key))
    return {
        'value': round(left + stated, 3),
        'std': round(std, 3),
        'name': name,
        'size': abs(left),
        'side': 'late' if left > 0.0 else 'early',
        'against': against,
    }


def listed(values: Any, form: str = '.4f') -> str:
    """Return numbers with commas between, as a flat list of a rover file has them."""
    return ', '.join(format(value, form) for value in values)
