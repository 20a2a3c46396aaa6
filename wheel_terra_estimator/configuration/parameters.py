# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The declared parameters: one table from which checks, descriptors and documentation come.

To add a parameter, add one line to ``DECLARED``, such as
``number('filter.gate', 0.999, '-', 'what it does', above=0.0, at_most=1.0)``: the reader then
accepts and checks the key, the node declares it, ``configuration.filter.gate`` has its value, and
``python -m wheel_terra_estimator.configuration.documentation`` writes it to ``docs/parameters.md``
(a test says when that was forgotten). ``size='wheels'`` makes a per-wheel list, a number a list of
that length. A key that ends in ``_deg`` is in degrees in files and in radians in the code, where
its name has no suffix.

The keys ``effects.<name>.enabled``, ``effects.<name>.form`` (where there are several),
``effects.<name>.<parameter>`` and ``effects.<name>.<parameter>_std`` come from the catalogue of
effects.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Literal, TypeAlias

from wheel_terra_estimator.configuration.ros_yaml import Value

Kind: TypeAlias = Literal['number', 'integer', 'flag', 'text']


@dataclass(frozen=True)
class Parameter:
    """One declared parameter.

    Attributes
    ----------
    key : str
        Canonical dotted key.
    kind : str
        ``number`` (an integer will do), ``integer``, ``flag`` or ``text``.
    default : bool, int, float, str or list
        Value where no file states one; a scalar default of a per-wheel key counts for each wheel.
    unit : str
        Unit of the value in files.
    meaning : str
        One sentence for the documentation and the node's descriptor.
    size : 'wheels', int or None
        Per-wheel list, list of that length (0: any length), or a scalar.
    lower, upper : float
        Allowed range of each number.
    open_lower, open_upper : bool
        Whether the bound itself is excluded.
    choices : tuple of str
        Allowed texts, if not any.
    aliases : tuple of str
        Other spellings that are accepted.
    required : bool
        Whether a complete configuration must state it.
    one_for_all : bool
        Whether a per-wheel list of one entry counts for all wheels.
    """

    key: str
    kind: Kind
    default: Value
    unit: str
    meaning: str
    size: int | Literal['wheels'] | None = None
    lower: float = -inf
    upper: float = inf
    open_lower: bool = False
    open_upper: bool = False
    choices: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    required: bool = False
    one_for_all: bool = False

    @property
    def allowed(self) -> str:
        """What a value must be, in words, for messages and documentation."""
        noun = {'number': 'number', 'integer': 'integer', 'flag': 'true/false', 'text': 'text'}
        words = noun[self.kind]
        if self.choices:
            words = 'one of ' + ', '.join(self.choices)
        if self.size is not None:
            plural = words if self.kind in ('flag', 'text') else f'{words}s'
            words = f'list of {plural}'
            if self.size == 'wheels':
                words += ', one per wheel' + (', or one for all' if self.one_for_all else '')
            elif self.size:
                words = f'list of {self.size} {plural}'
        limits = []
        if self.lower > -inf:
            limits.append(f'{"above" if self.open_lower else "at least"} {self.lower:g}')
        if self.upper < inf:
            limits.append(f'{"below" if self.open_upper else "at most"} {self.upper:g}')
        if limits:
            words += f' ({" and ".join(limits)})'
        return words


def number(
    key: str,
    default: float | list[float],
    unit: str,
    meaning: str,
    *,
    size: int | Literal['wheels'] | None = None,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    aliases: tuple[str, ...] = (),
    required: bool = False,
    one_for_all: bool = False,
) -> Parameter:
    """Declare a finite number, or a list of such."""
    return Parameter(
        key,
        'number',
        default,
        unit,
        meaning,
        size=size,
        lower=above if above is not None else (-inf if at_least is None else at_least),
        upper=below if below is not None else (inf if at_most is None else at_most),
        open_lower=above is not None,
        open_upper=below is not None,
        aliases=aliases,
        required=required,
        one_for_all=one_for_all,
    )


def integer(
    key: str,
    default: int | list[int],
    unit: str,
    meaning: str,
    *,
    size: int | Literal['wheels'] | None = None,
    at_least: float = -inf,
    at_most: float = inf,
    aliases: tuple[str, ...] = (),
) -> Parameter:
    """Declare an integer, or a list of such."""
    return Parameter(
        key,
        'integer',
        default,
        unit,
        meaning,
        size=size,
        lower=at_least,
        upper=at_most,
        aliases=aliases,
    )


def flag(key: str, default: bool, meaning: str, *, aliases: tuple[str, ...] = ()) -> Parameter:
    """Declare a switch."""
    return Parameter(key, 'flag', default, '', meaning, aliases=aliases)


def text(
    key: str,
    default: str | list[str],
    meaning: str,
    *,
    size: int | Literal['wheels'] | None = None,
    choices: tuple[str, ...] = (),
    aliases: tuple[str, ...] = (),
    required: bool = False,
) -> Parameter:
    """Declare a text, or a list of such."""
    return Parameter(
        key,
        'text',
        default,
        '',
        meaning,
        size=size,
        choices=choices,
        aliases=aliases,
        required=required,
    )


DECLARED: tuple[Parameter, ...] = (
    # General
    text('provenance', '', 'where this configuration comes from, in words'),
    text(
        'effect_file',
        '',
        'Python file that registers effects of your own (path, relative to the file that names '
        'it); it is executed, with --allow-effect-files only',
    ),
    text(
        'slip_radius',
        'lug_tip',
        'radius that the slip ratio refers to: rim + lug height, or rim',
        choices=('lug_tip', 'rim'),
        aliases=('wheels.slip_radius',),
    ),
    text(
        'wheel_odometry',
        'joint_states',
        'topic that carries the wheel rates',
        choices=('joint_states', 'odom'),
        aliases=('sensors.wheel_odometry',),
    ),
    number(
        'reference_odom_max_rate',
        0.0,
        'Hz',
        'thins reference_odom to this rate, by stamps; 0 = all messages',
        at_least=0.0,
        aliases=('sensors.reference_odom_max_rate',),
    ),
    number(
        'rest_speed',
        0.002,
        'm/s',
        'rim or ground speed below which a wheel counts as standing still',
        above=0.0,
        aliases=('filter.rest_speed',),
    ),
    number(
        'output_rate',
        20.0,
        'Hz',
        'sets of estimates per second of stamps: one at the first wheel odometry at or after each '
        'multiple of its period; 0 = one for every stamp of the wheel odometry',
        at_least=0.0,
        at_most=1000.0,
    ),
    number(
        'max_lag',
        -1.0,
        's',
        'how long inputs are held back to be sorted by stamp; -1 = as long as wheel odometry and '
        'IMU are seen to lag, at most 0.5; 0 = released at once',
        at_least=-1.0,
        at_most=60.0,
        aliases=('filter.max_lag',),
    ),
    number(
        'history',
        2.0,
        's',
        'how far back a late input is still fused at its own stamp',
        at_least=0.0,
        at_most=60.0,
        aliases=('filter.history',),
    ),
    # The node's process; the commands accept them, so that they take the very same files
    text(
        'record_arrival',
        '',
        'file in which the node notes each input in the order of arrival, for `wheel-terra replay '
        '--arrival`; empty = none',
    ),
    text(
        'executor',
        'events',
        "executor of the node: events (rclpy's, less CPU) or single_threaded",
        choices=('events', 'single_threaded'),
    ),
    flag(
        'publish_markers',
        False,
        'whether the node publishes ~/markers for RViz: slip class as colour, sinkage, pull',
    ),
    flag(
        'autostart',
        True,
        'configure and activate the node at its start; false: a life cycle manager does',
    ),
    text(
        'soil_file',
        '',
        'parameter file with the soil and the sensor zeros that were learned: read at start, '
        'written at ~/save_soil, every 10 s and at the end; a new file, or one written so; '
        'empty = none',
    ),
    # Wheels
    text(
        'wheels.names',
        ['wheel'],
        'joint names, front to rear, left before right; every list and output is in this order',
        size=0,
        required=True,
    ),
    number(
        'wheels.radius',
        0.15,
        'm',
        'radius of the rim, lugs not counted',
        size='wheels',
        above=0.0,
        at_most=10.0,
        required=True,
    ),
    number(
        'wheels.width',
        0.15,
        'm',
        'width of the rim',
        size='wheels',
        above=0.0,
        at_most=10.0,
        required=True,
    ),
    number(
        'wheels.lug_height',
        0.0,
        'm',
        'height of the lugs above the rim; 0 = smooth',
        size='wheels',
        at_least=0.0,
        at_most=1.0,
    ),
    integer(
        'wheels.lug_count',
        0,
        '-',
        'number of lugs around the wheel',
        size='wheels',
        at_least=0,
        at_most=1000,
    ),
    number(
        'wheels.lug_thickness',
        0.0,
        'm',
        'thickness of a lug along the circumference',
        size='wheels',
        at_least=0.0,
        at_most=1.0,
    ),
    number('wheels.x', 0.0, 'm', 'hub position in base_link, forward', size='wheels'),
    number('wheels.y', 0.0, 'm', 'hub position in base_link, left', size='wheels'),
    number('wheels.z', 0.0, 'm', 'hub position in base_link, up', size='wheels'),
    integer(
        'wheels.direction',
        1,
        '-',
        '1, or -1 for a wheel whose joint counts negative when it drives forward (flips rate and '
        'torque)',
        size='wheels',
        at_least=-1,
        at_most=1,
    ),
    text(
        'wheels.steering_joints',
        '',
        'joint that steers each wheel: its angle [rad, positive left] comes in `position` of '
        'joint_states; one joint may steer several wheels; empty text = not steered',
        size='wheels',
    ),
    number(
        'wheels.torque_limit',
        0.0,
        'N m',
        'greatest drive torque, for the stall test; 0 = not known',
        size='wheels',
        at_least=0.0,
    ),
    text(
        'wheels.wrench_frame',
        '',
        'frame of ~/wrench/<wheel> (x forward, z up, at the hub, not turning with the rim); empty '
        '= not published',
        size='wheels',
    ),
    integer(
        'wheels.passes',
        1,
        '-',
        'pass number of the soil that the wheel runs in when driving straight (2 = in the rut of '
        'one wheel before it)',
        size='wheels',
        at_least=1,
        at_most=100,
    ),
    # Rover
    text('rover.name', '', 'name of the rover or test rig, for reports'),
    number('rover.mass', 0.0, 'kg', 'mass carried by the wheels', above=0.0, required=True),
    number('rover.gravity', 9.80665, 'm/s^2', 'gravity of the place', above=0.0, at_most=300.0),
    number(
        'rover.centre_of_gravity',
        [0.0, 0.0, 0.0],
        'm',
        'centre of gravity x, y, z in base_link',
        size=3,
    ),
    text(
        'rover.suspension',
        'rigid',
        'how the load is shared: a rigid (or soft, symmetric) chassis, a rocker-bogie, or given '
        'shares',
        choices=('rigid', 'rocker_bogie', 'shares'),
    ),
    number(
        'rover.load_shares',
        0.0,
        '-',
        'share of the load on each wheel, sum 1, for suspension shares; 0 everywhere = equal',
        size='wheels',
        at_least=0.0,
        at_most=1.0,
    ),
    number(
        'rover.rocker_pivot',
        [0.0, 0.0],
        'm',
        'x, z of the rocker pivots in base_link, for suspension rocker_bogie',
        size=2,
    ),
    number(
        'rover.bogie_pivot',
        [0.0, 0.0],
        'm',
        'x, z of the bogie pivots in base_link, for suspension rocker_bogie',
        size=2,
    ),
    text(
        'rover.bogie_wheels',
        'rear',
        'which two wheels of each side hang on the bogie, for suspension rocker_bogie',
        choices=('front', 'rear'),
    ),
    number(
        'rover.load_std',
        0.03,
        '-',
        'standard deviation of the load of a wheel that the load model leaves open, as a share of '
        'the mean load',
        at_least=0.0,
        at_most=1.0,
    ),
    # Soil
    text('soil.name', '', 'name of the soil, for reports'),
    text(
        'soil.source',
        '',
        'class of the source of soil numbers whose deviation is not stated, for diagnose: tests '
        'of this soil (empty), numbers published elsewhere, or proxies from another soil',
        choices=('', 'published', 'proxy'),
    ),
    text(
        'soil.pressure_law',
        'bekker',
        'how the two moduli are read: (kc/b + kphi) z^n, or with reece, where both are pure '
        "numbers, (c kc' + density g b kphi') (z/b)^n",
        choices=('bekker', 'reece'),
    ),
    number('soil.cohesive_modulus', 1.37e3, 'N/m^(n+1)', 'kc (may be negative in a fit)'),
    number('soil.frictional_modulus', 814.0e3, 'N/m^(n+2)', 'kphi', at_least=0.0),
    number('soil.sinkage_exponent', 1.0, '-', 'sinkage exponent n0', above=0.0, at_most=4.0),
    number('soil.cohesion', 800.0, 'Pa', 'cohesion c', at_least=0.0, at_most=1.0e6),
    number(
        'soil.friction_angle_deg',
        37.2,
        'deg',
        'angle of internal friction phi',
        at_least=0.0,
        at_most=60.0,
    ),
    number(
        'soil.shear_modulus',
        0.015,
        'm',
        'shear deformation modulus K',
        above=0.0,
        at_most=1.0,
    ),
    number(
        'soil.peak_stress_ratio',
        0.4,
        '-',
        'angle of greatest stress over entrance angle at zero slip, c1',
        at_least=0.0,
        at_most=1.0,
    ),
    number(
        'soil.leaving_angle_ratio',
        0.0,
        '-',
        'leaving angle over entrance angle, c3 (zero or negative)',
        at_least=-1.5,
        at_most=0.0,
    ),
    number('soil.density', 1600.0, 'kg/m^3', 'bulk density', above=0.0, at_most=3.0e4),
    number(
        'soil.relative_std',
        0.1,
        '-',
        'standard deviation of a soil parameter whose own is not stated, as a share of its value; '
        'where no soil.* is stated at all the estimator takes the spread of the shipped soils',
        at_least=0.0,
        at_most=10.0,
    ),
    *(
        number(
            f'soil.{field}',
            0.0,
            unit,
            f'standard deviation of {symbol}; 0 = soil.relative_std of the value',
            at_least=0.0,
        )
        for field, unit, symbol in (
            ('cohesive_modulus_std', 'N/m^(n+1)', 'kc'),
            ('frictional_modulus_std', 'N/m^(n+2)', 'kphi'),
            ('sinkage_exponent_std', '-', 'n0'),
            ('cohesion_std', 'Pa', 'c'),
            ('friction_angle_std_deg', 'deg', 'phi'),
            ('shear_modulus_std', 'm', 'K'),
            ('peak_stress_ratio_std', '-', 'c1'),
            ('leaving_angle_ratio_std', '-', 'c3'),
            ('density_std', 'kg/m^3', 'the density'),
        )
    ),
    # Sensors: what the estimator assumes and the simulator makes
    number('sensors.wheel_odometry_rate', 10.0, 'Hz', 'rate of the wheel odometry', above=0.0),
    number(
        'sensors.wheel_rate_std',
        0.005,
        'rad/s',
        'noise of a wheel rate, one standard deviation',
        at_least=0.0,
    ),
    number(
        'sensors.torque_std',
        0.2,
        'N m',
        'noise of a drive torque, one standard deviation; where it is not stated the estimator '
        'takes 0.015 of mean load times radius, then what the first seconds show',
        at_least=0.0,
    ),
    number(
        'sensors.torque_zero',
        0.0,
        'N m',
        'zero of each torque reading: reading = gain * torque + zero',
        size='wheels',
        one_for_all=True,
    ),
    number(
        'sensors.torque_zero_std',
        0.1,
        'N m',
        'what is not known of the zero of a drive torque, one standard deviation for all wheels; '
        'where it is not stated the estimator takes 0.02 of mean load times radius',
        at_least=0.0,
    ),
    number(
        'sensors.torque_gain',
        1.0,
        '-',
        'gain of each torque reading: reading = gain * torque + zero',
        size='wheels',
        one_for_all=True,
        above=0.0,
    ),
    number(
        'sensors.torque_gain_std',
        0.05,
        '-',
        'what is not known of the gain of the drive torques, one standard deviation for all wheels',
        at_least=0.0,
    ),
    number('sensors.imu_rate', 50.0, 'Hz', 'rate of the IMU', above=0.0),
    number(
        'sensors.specific_force_std',
        0.05,
        'm/s^2',
        'noise of the accelerometer, one standard deviation per message; where no file states it, '
        'the covariance of imu/data comes before this default',
        at_least=0.0,
    ),
    number(
        'sensors.specific_force_bias',
        [0.0, 0.0, 0.0],
        'm/s^2',
        'bias of the accelerometer along x, y, z of base_link (behind the mounting), taken off',
        size=3,
    ),
    number(
        'sensors.specific_force_bias_std',
        0.03,
        'm/s^2',
        'what is not known of the bias of the accelerometer, one standard deviation for all axes',
        at_least=0.0,
    ),
    number(
        'sensors.angular_rate_std',
        0.005,
        'rad/s',
        'noise of the gyroscope, one standard deviation per message; where no file states it, '
        'the covariance of imu/data comes before this default',
        at_least=0.0,
    ),
    number(
        'sensors.angular_rate_bias',
        [0.0, 0.0, 0.0],
        'rad/s',
        'bias of the gyroscope about x, y, z of base_link (behind the mounting), taken off',
        size=3,
    ),
    number(
        'sensors.angular_rate_bias_std',
        0.001,
        'rad/s',
        'what is not known of the bias of the gyroscope, one standard deviation for all axes',
        at_least=0.0,
    ),
    number(
        'sensors.orientation_std_deg',
        0.3,
        'deg',
        'error of the roll and pitch of the orientation, one standard deviation; where no file '
        'states it, the covariance of imu/data comes before this default',
        at_least=0.0,
    ),
    *(
        number(
            f'sensors.imu_mounting_{angle}_deg',
            0.0,
            'deg',
            f'{angle} of the IMU frame in base_link (fixed axes x, then y, then z, as in URDF)',
            at_least=-360.0,
            at_most=360.0,
        )
        for angle in ('roll', 'pitch', 'yaw')
    ),
    number('sensors.sinkage_rate', 10.0, 'Hz', 'rate of the sinkage sensor', above=0.0),
    number(
        'sensors.sinkage_std',
        0.002,
        'm',
        'noise of a sinkage reading, one standard deviation',
        at_least=0.0,
    ),
    number(
        'sensors.sinkage_zero',
        0.0,
        'm',
        'zero of each sinkage reading: reading = gain * sinkage + zero',
        size='wheels',
        one_for_all=True,
    ),
    number(
        'sensors.sinkage_zero_std',
        0.001,
        'm',
        'what is not known of the zero of a sinkage sensor, one standard deviation for all wheels',
        at_least=0.0,
    ),
    number(
        'sensors.sinkage_gain',
        1.0,
        '-',
        'gain of each sinkage reading: reading = gain * sinkage + zero',
        size='wheels',
        one_for_all=True,
        above=0.0,
    ),
    number(
        'sensors.leaving_angle_std_deg',
        3.0,
        'deg',
        'error of a measured leaving angle, one standard deviation',
        above=0.0,
    ),
    number('sensors.reference_rate', 1.0, 'Hz', 'rate of the reference velocity', above=0.0),
    number(
        'sensors.reference_std',
        0.003,
        'm/s',
        'noise of the reference velocity where its message states no variance',
        above=0.0,
    ),
    number(
        'sensors.reference_std_floor',
        0.0005,
        'm/s',
        'least standard deviation of a reference velocity that is believed',
        above=0.0,
    ),
    number(
        'sensors.reference_wander_std',
        0.0,
        'm/s',
        'error of the reference velocity that lasts from one reading to the next (satellite '
        'receivers: some cm/s), beside its noise; 0 = none',
        at_least=0.0,
    ),
    number(
        'sensors.reference_wander_time',
        15.0,
        's',
        'time over which that error lasts',
        above=0.0,
    ),
    number(
        'sensors.reference_delay',
        0.4,
        's',
        'typical age of a reference velocity when it arrives',
        at_least=0.0,
    ),
    *(
        number(
            f'sensors.{name}_stamp_offset',
            0.0,
            's',
            f'what the stamps of {topic} lie too late (negative: too early); taken off them before '
            'anything else',
            at_least=-1.0e4,
            at_most=1.0e4,
        )
        for name, topic in (
            ('imu', 'imu/data'),
            ('wheel_odometry', 'joint_states or odom'),
            ('reference', 'reference_odom'),
            ('sinkage', 'sinkage'),
        )
    ),
    # Filter: time
    number(
        'filter.silence',
        0.5,
        's',
        'wheel odometry silent for this long: sets go on on the stamps of the other inputs',
        above=0.0,
    ),
    number('filter.heartbeat_rate', 5.0, 'Hz', 'rate of the sets during such a silence', above=0.0),
    number(
        'filter.rerun_rate',
        60.0,
        '1/s',
        'steps that may be run again for late inputs, per second of stamps; what would cost more '
        'is fused with delay; 0 = any number',
        at_least=0.0,
    ),
    number(
        'filter.clock_step',
        1.0,
        's',
        'a step back of the clock by more than this ends the run',
        above=0.0,
    ),
    # Filter: speed and soil model (docs/estimation/design.md gives the reasons)
    number(
        'filter.period',
        0.1,
        's',
        'least time between two updates with the wheel-soil model; in between the speed goes on '
        'with wheels and accelerometer',
        above=0.0,
        at_most=1.0,
    ),
    number(
        'filter.ratio_walk',
        0.1,
        '1/sqrt(m)',
        'random walk of ground speed over rim speed per rim travel',
        above=0.0,
    ),
    number(
        'filter.shear_error_std',
        0.05,
        '-',
        'error of the shear model per wheel, as a share of the shear stress',
        above=0.0,
    ),
    number(
        'filter.shear_error_common_std',
        0.12,
        '-',
        'the part of it that all wheels share',
        at_least=0.0,
    ),
    number(
        'filter.shear_error_length',
        0.5,
        'm',
        'travel over which that error changes',
        above=0.0,
    ),
    number(
        'filter.soil_walk',
        1.0,
        '-',
        'factor on the random walk of the soil parameters per travel; more = soil that changes '
        'more often',
        at_least=0.0,
    ),
    number(
        'filter.gate',
        10.8,
        '-',
        'squared innovation over its variance beyond which a reading is an outlier (10.8: one in '
        '1000 good readings)',
        above=1.0,
    ),
    # Filter: classes and warnings
    number(
        'filter.class_thresholds',
        [0.3, 0.6, 0.9],
        '-',
        'upper bounds of |slip| of the classes low, moderate, high',
        size=3,
        above=0.0,
        at_most=1.0,
    ),
    number(
        'filter.class_hysteresis',
        0.02,
        '-',
        'hysteresis of the slip classes',
        at_least=0.0,
        at_most=0.3,
    ),
    number(
        'filter.class_dwell',
        0.3,
        's',
        'how long |slip| must be outside of a class before it changes',
        at_least=0.0,
    ),
    number(
        'filter.class_std',
        0.25,
        '-',
        'deviation of the slip above which the class is unknown (255)',
        above=0.0,
    ),
    number(
        'filter.rest_time',
        0.5,
        's',
        'how long rim and ground speed must stay below rest_speed before a wheel is at rest',
        at_least=0.0,
    ),
    number(
        'filter.stuck_horizon',
        15.0,
        's',
        'an entrapment expected within this time raises the stuck warning',
        above=0.0,
    ),
    number(
        'filter.stuck_travel',
        0.3,
        'm',
        'an entrapment expected within this rim travel raises the stuck warning',
        above=0.0,
    ),
    number(
        'filter.stuck_threshold',
        0.5,
        '-',
        'probability of an entrapment within them that raises the stuck warning',
        above=0.0,
        at_most=1.0,
    ),
    number(
        'filter.stuck_clear_slip',
        0.6,
        '-',
        'the stuck warning clears when the median |slip| has been below this',
        above=0.0,
        at_most=1.0,
    ),
    number(
        'filter.stuck_clear_time',
        3.0,
        's',
        'for how long, before the stuck warning clears',
        at_least=0.0,
    ),
)


def declared() -> dict[str, Parameter]:
    """Return all parameters by canonical key, those of the effects catalogue included."""
    from wheel_terra_estimator.terramechanics.effects import catalogue

    table = {parameter.key: parameter for parameter in DECLARED}
    for name, effect in catalogue().items():
        prefix = f'effects.{name}'
        table[f'{prefix}.enabled'] = flag(f'{prefix}.enabled', False, effect.claim)
        if len(effect.forms) > 1:
            names = tuple(variant.form for variant in effect.forms)
            laws = '; '.join(f'{variant.form}: {variant.symbol}' for variant in effect.forms)
            table[f'{prefix}.form'] = text(f'{prefix}.form', names[0], laws, choices=names)
        if effect.sparse:
            table.update(_lists(prefix))
            continue
        for item in effect.all_parameters:
            key = f'{prefix}.{item.name}'
            table[key] = number(
                key,
                float(item.default),
                item.unit,
                item.meaning,
                at_least=float(item.lower),
                at_most=float(item.upper),
            )
            table[f'{key}_std'] = number(
                f'{key}_std',
                0.0,
                item.unit,
                f'standard deviation of {item.name} as fitted; 0 = not stated',
                at_least=0.0,
            )
    return table


def _lists(prefix: str) -> dict[str, Parameter]:
    """Return the flat lists that state a sparse law."""
    from wheel_terra_estimator.terramechanics.effects import learned_closure as law

    target, feature = 'torque', 'one'
    items = (
        text(f'{prefix}.targets', [target], 'what each term changes', size=0,
             choices=tuple(law.TARGETS)),
        text(f'{prefix}.features', [feature], 'with what it changes', size=0,
             choices=tuple(law.FEATURES)),
        number(f'{prefix}.coefficients', [0.0], '-', 'by how much', size=0),
        number(f'{prefix}.coefficients_std', [0.0], '-',
               'standard deviations of the coefficients as fitted; 0 = not stated', size=0,
               at_least=0.0),
    )  # fmt: skip
    return {item.key: item for item in items}


def by_spelling(table: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the parameters by every spelling that is accepted, aliases included."""
    spellings = dict(table)
    for parameter in table.values():
        for alias in parameter.aliases:
            spellings[alias] = parameter
    return spellings


def nearest(key: str, known: Iterable[str]) -> str:
    """Return the known key that looks most like ``key``; a right name in a wrong section wins."""
    known = list(known)
    last = key.rsplit('.', 1)[-1]
    for candidates in (
        difflib.get_close_matches(key, known, n=1, cutoff=0.8),
        [other for other in known if other.rsplit('.', 1)[-1] == last],
        difflib.get_close_matches(key, known, n=1, cutoff=0.0),
    ):
        if candidates:
            return candidates[0]
    return known[0]
