# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How many faults `wheel-terra check` finds, and how often it names a wrong remedy.

python -m wheel_terra_lab.studies.fault_study B:turns C:firm drive=my_rover.yaml --seeds 7001 7002

A case is KIND of a simulator or BAG=CONFIG (several files with a +). Sixty kinds of fault are
put into the readings of each, or into its rover file; wheel, size, sign and time are drawn by the
seed. What was found without the fault is left out. A fault counts as

- found: a finding of its kind, on its wheel, whose value is the one that was put in within two
  deviations or 3 %, or that says what to do instead of a number,
- wrong: any other finding of more than 60 % (also beside a right one), or a value farther off,
- told: the check says that this recording cannot tell, - missed: nothing.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.bags.series_reader import read_series
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.checks.finding import CheckReport, Finding
from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_lab.evaluation.bench_drive import BenchDrive
from wheel_terra_lab.evaluation.simulators import SIMULATORS

SURE = 0.6
"""Confidence from which a finding counts as said [-]."""
NEAR = 0.03
"""Share by which a value may be off whatever its deviation [-]."""


@dataclass(frozen=True)
class Case:
    """A recording with its rover file."""

    recording: Recording
    rover: Configuration

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the wheels."""
        return self.rover.wheels.names

    def column(self, wheel: int) -> int:
        """Return the column of a wheel in the joint states."""
        assert self.recording.joints is not None
        return self.recording.joints.names.index(self.names[wheel])

    def having(self, channel: str, **values: Any) -> Case:
        """Return the case with other values in a channel."""
        series = replace(getattr(self.recording, channel), **values)
        return replace(self, recording=replace(self.recording, **{channel: series}))


@dataclass(frozen=True)
class Faulty:
    """A case with a fault; the wheels that it concerns and the value that cures it, if any.

    ``parameter`` is that of the value, ``own`` the error that the sensor may have without it.
    """

    case: Case
    wheels: tuple[int, ...] = ()
    value: float | None = None
    parameter: str | None = None
    own: float = 0.0


Random = np.random.Generator
Put = Callable[[Case, Random], 'Faulty | None']


@dataclass(frozen=True)
class Fault:
    """A fault: its kinds of finding, further ones of the same cause, and how it is put in."""

    name: str
    kinds: tuple[str, ...]
    put: Put
    beside: tuple[str, ...] = ()


# What may go wrong -------------------------------------------------------------------------------


def _drawn(random: Random, low: float, high: float) -> float:
    """Return a size between two, of either sign."""
    return float(random.choice([-1.0, 1.0]) * random.uniform(low, high))


def _wheels(case: Case, wheels: tuple[int, ...], change: Callable[..., Any], torque: bool) -> Case:
    """Return the case with the rates (and torques) of some wheels changed."""
    joints = case.recording.joints
    assert joints is not None
    rate, effort = joints.rate.copy(), joints.torque.copy()
    for column in (case.column(w) for w in wheels):
        rate[:, column] = change(rate[:, column])
        if torque:
            effort[:, column] = change(effort[:, column])
    return case.having('joints', rate=rate, torque=effort)


def _backwards(count: int | str, torque: bool) -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        number = len(case.names)
        if count == 'side':
            rows = np.flatnonzero(np.sign(case.rover.wheels.y) == random.choice([-1, 1]))
        else:
            size = number if count == 'all' else int(count)
            rows = random.choice(number, size, replace=False)
        if 2 * len(rows) > number and count != 'all':
            return None
        wheels = tuple(sorted(int(row) for row in rows))
        return Faulty(_wheels(case, wheels, np.negative, torque), wheels)

    return put


def _exchanged(pairs: str, channel: str = 'joints') -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None or not set(case.names) <= set(series.names):
            return None
        y = case.rover.wheels.y
        left, right = np.flatnonzero(y > 0.0), np.flatnonzero(y < 0.0)
        if pairs == 'one':
            if len(case.names) < 3:
                return None
            both = [(int(random.choice(left)), int(random.choice(right)))]
        else:
            both = list(zip(left.tolist(), right.tolist(), strict=True))
        names = list(series.names)
        for a, b in both:
            i, j = names.index(case.names[a]), names.index(case.names[b])
            names[i], names[j] = names[j], names[i]
        wheels = both[0] if pairs == 'one' else ()
        return Faulty(case.having(channel, names=tuple(names)), wheels)

    return put


def _scaled(channel: str, field: str, factor: float | tuple[float, float], **told: Any) -> Put:
    """Multiply a field; a pair of factors is the greatest scale down and up, 5 % apart from 1."""

    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None or not np.nan_to_num(getattr(series, field)).any():
            return None
        size = factor
        if isinstance(size, tuple):
            ends = [(size[0], 0.95), (1.05, size[1])]
            size = float(random.uniform(*ends[int(random.integers(2))]))
        values = getattr(series, field) * size
        value = told['value'](size) if 'value' in told else None
        return Faulty(case.having(channel, **{field: values}), (), value, told.get('parameter'))

    return put


def _stamped(channel: str, low: float, high: float) -> Put:
    key = f'sensors.{"wheel_odometry" if channel == "joints" else channel}_stamp_offset'

    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None:
            return None
        late = _drawn(random, low, high)
        stamp = series.stamp + round(late * 1e9)
        return Faulty(case.having(channel, stamp=stamp), (), late, key)

    return put


def _turned(axis: str, low: float, high: float) -> Put:
    """Mount the IMU otherwise than the rover file says."""

    def put(case: Case, random: Random) -> Faulty | None:
        imu = case.recording.imu
        if imu is None:
            return None
        angle = _drawn(random, low, high)
        turn = Rotation.from_euler(axis, angle, degrees=True).as_matrix()
        none = np.full_like(imu.orientation, np.nan)
        turned = case.having('imu', force=imu.force @ turn, rate=imu.rate @ turn, orientation=none)
        named = {'x': 'roll', 'y': 'pitch', 'z': 'yaw'}[axis]
        return Faulty(turned, (), angle, f'sensors.imu_mounting_{named}_deg')

    return put


def _in_file(key: str, low: float, high: float) -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        factor = 1.0 + _drawn(random, low, high)
        value: Any = case.rover.flat()[key]
        wrong: Any = np.multiply(value, factor).tolist()
        right = float(np.mean(np.abs(value))) * (2.0 if key == 'wheels.y' else 1.0)
        return Faulty(replace(case, rover=case.rover.replace({key: wrong})), (), right, key)

    return put


def _stretch(seconds: FloatArray, random: Random, least: float) -> BoolArray:
    """Return the messages of a stretch of the drive."""
    length = max(least, float(random.uniform(0.15, 0.4)) * seconds[-1])
    start = float(random.uniform(0.2, 0.55)) * seconds[-1]
    return np.asarray((seconds >= start) & (seconds < start + length))


def _frozen(at_zero: bool) -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        joints, wheel = case.recording.joints, int(random.integers(len(case.names)))
        assert joints is not None
        held = _stretch(joints.seconds, random, 15.0)
        size = np.median(np.abs(np.nan_to_num(joints.rate)), axis=1)
        if not held.any() or size[held].mean() < 0.3 * size.max():
            return None
        rate, column = joints.rate.copy(), case.column(wheel)
        rate[held, column] = 0.0 if at_zero else rate[np.argmax(held), column]
        return Faulty(case.having('joints', rate=rate), (wheel,))

    return put


def _held(channel: str, field: str, one_wheel: bool) -> Put:
    """Let a sensor repeat its last value for a stretch in which the rover drives."""

    def put(case: Case, random: Random) -> Faulty | None:
        series, joints = getattr(case.recording, channel), case.recording.joints
        wheel = int(random.integers(len(case.names)))
        if series is None or joints is None or not np.nan_to_num(getattr(series, field)).any():
            return None
        size = np.median(np.abs(np.nan_to_num(joints.rate)), axis=1)
        held = np.flatnonzero(_stretch(series.seconds, random, 20.0))
        driven = np.interp(series.stamp[held], joints.stamp, size) > 0.3 * size.max()
        if held.size < 20 or driven.mean() < 0.9:
            return None
        values = getattr(series, field).copy()
        column = series.names.index(case.names[wheel]) if one_wheel else slice(None)
        values[held, column] = values[held[0], column]
        return Faulty(case.having(channel, **{field: values}), (wheel,) if one_wheel else ())

    return put


def _unsigned(channel: str, field: str) -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None or not np.nan_to_num(getattr(series, field)).any():
            return None
        direction = case.rover.wheels.direction if field == 'torque' else 1.0
        values = direction * np.abs(getattr(series, field))
        back = np.mean(np.nan_to_num(getattr(series, field) * direction) < 0.0)
        return Faulty(case.having(channel, **{field: values})) if back > 0.1 else None

    return put


def _imu_frozen(case: Case, random: Random) -> Faulty | None:
    imu = case.recording.imu
    if imu is None:
        return None
    held = _stretch(imu.seconds, random, 5.0)
    force, rate = imu.force.copy(), imu.rate.copy()
    force[held], rate[held] = force[np.argmax(held)], rate[np.argmax(held)]
    return Faulty(case.having('imu', force=force, rate=rate))


def _imu_wild(case: Case, random: Random) -> Faulty | None:
    imu = case.recording.imu
    if imu is None:
        return None
    wild = random.uniform(size=imu.stamp.size) < random.uniform(0.005, 0.02)
    force = imu.force.copy()
    force[wild] += random.uniform(150.0, 1000.0, (int(wild.sum()), 3))
    return Faulty(case.having('imu', force=force))


def _without(channel: str, share: bool) -> Put:
    """Lose messages: every now and then a second and more, or one in four."""

    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None:
            return None
        keep = random.uniform(size=series.stamp.size) > 0.25
        if not share:
            keep = np.asarray(series.seconds % random.uniform(8.0, 15.0) > random.uniform(1.0, 2.0))
        values = {f.name: getattr(series, f.name) for f in fields(series)}
        kept = {k: v[keep] for k, v in values.items() if isinstance(v, np.ndarray)}
        return Faulty(case.having(channel, **kept))

    return put


def _added(channel: str, field: str, size: Callable[[Case, Random], Any]) -> Put:
    def put(case: Case, random: Random) -> Faulty | None:
        series = getattr(case.recording, channel)
        if series is None or not np.isfinite(getattr(series, field)).any():
            return None
        return Faulty(case.having(channel, **{field: getattr(series, field) + size(case, random)}))

    return put


def _noise(share: float, channel: str, field: str) -> Put:
    def size(case: Case, random: Random) -> FloatArray:
        values = getattr(getattr(case.recording, channel), field)
        scatter = share * float(np.nanquantile(np.abs(values), 0.8))
        return scatter * random.standard_normal(values.shape)

    return _added(channel, field, size)


def _torque_zero(case: Case, random: Random) -> Faulty | None:
    joints, wheel = case.recording.joints, int(random.integers(len(case.names)))
    assert joints is not None
    if not np.nan_to_num(joints.torque).any():
        return None
    rover, wheels = case.rover.rover, case.rover.wheels
    lift = float(rover.mass * rover.gravity * np.mean(wheels.slip_radius)) / len(case.names)
    zero = _drawn(random, 0.5, 0.9) * lift * float(wheels.direction[wheel])
    torque = joints.torque.copy()
    torque[:, case.column(wheel)] += zero
    value = zero * float(wheels.direction[wheel])
    faulty = case.having('joints', torque=torque)
    own = 2.0 * float(case.rover.sensors.torque_zero_std)
    return Faulty(faulty, (wheel,), value, 'sensors.torque_zero', own)


def _torque_sign(case: Case, random: Random) -> Faulty | None:
    joints, wheel = case.recording.joints, int(random.integers(len(case.names)))
    assert joints is not None
    if not np.nan_to_num(joints.torque).any():
        return None
    torque = joints.torque.copy()
    torque[:, case.column(wheel)] *= -1.0
    return Faulty(case.having('joints', torque=torque), (wheel,))


def _sinkage_zero(case: Case, random: Random) -> Faulty | None:
    series, wheel = case.recording.sinkage, int(random.integers(len(case.names)))
    if series is None or case.names[wheel] not in series.names:
        return None
    table, zero = series.sinkage.copy(), _drawn(random, 0.04, 0.07)
    table[:, series.names.index(case.names[wheel])] += zero
    own = 2.0 * float(case.rover.sensors.sinkage_zero_std)
    faulty = case.having('sinkage', sinkage=table)
    return Faulty(faulty, (wheel,), zero, 'sensors.sinkage_zero', own)


def _renamed(case: Case, random: Random) -> Faulty | None:
    joints, wheel = case.recording.joints, int(random.integers(len(case.names)))
    assert joints is not None
    own = case.names[wheel]
    names = tuple(f'{name}_motor' if name == own else name for name in joints.names)
    return Faulty(case.having('joints', names=names), (wheel,))


def _mute(case: Case, random: Random) -> Faulty | None:
    wheel = int(random.integers(len(case.names)))
    return Faulty(_wheels(case, (wheel,), lambda v: np.full_like(v, np.nan), True), (wheel,))


def _repeating(case: Case, random: Random) -> Faulty | None:
    joints = case.recording.joints
    assert joints is not None
    return Faulty(case.having('joints', stamp=joints.stamp[np.arange(joints.stamp.size) // 2 * 2]))


def _jumping(case: Case, random: Random) -> Faulty | None:
    reference = case.recording.reference
    if reference is None:
        return None
    velocity = reference.velocity.copy()
    wild = random.uniform(size=velocity.shape[0]) < 0.06
    velocity[wild, 0] += 4.0 * float(np.quantile(np.abs(velocity[:, 0]), 0.9))
    return Faulty(case.having('reference', velocity=velocity))


def _counted(case: Case, random: Random) -> Faulty | None:
    """Rates of an encoder that counts a few times in the usual interval at the usual rate."""
    joints = case.recording.joints
    assert joints is not None
    usual = float(np.median(np.diff(joints.seconds)))
    interval = np.maximum(np.diff(joints.seconds, prepend=-usual), 1e-3)
    size = np.abs(joints.rate[np.isfinite(joints.rate)])
    angle = float(np.median(size[size > 0.2 * np.quantile(size, 0.95)])) * usual
    angle /= random.uniform(1.5, 3.0)
    turned = np.cumsum(np.nan_to_num(joints.rate) * interval[:, None], axis=0)
    counts = np.diff(np.floor(turned / angle), axis=0, prepend=0.0)
    rate = np.where(np.isfinite(joints.rate), angle * counts / interval[:, None], np.nan)
    return Faulty(case.having('joints', rate=rate))


def _no_gravity(case: Case, random: Random) -> FloatArray:
    imu = case.recording.imu
    assert imu is not None
    return -np.median(imu.force, axis=0)


def _reversed_yaw(case: Case, random: Random) -> Faulty | None:
    imu = case.recording.imu
    if imu is None:
        return None
    none = np.full_like(imu.orientation, np.nan)
    return Faulty(case.having('imu', rate=imu.rate * [1.0, 1.0, -1.0], orientation=none))


TURNS = ('swapped_sides', 'sign', 'exchanged_wheels')
SCALES = ('gain', 'mass', 'unit')
G = 9.80665
FAULTS = (
    Fault('a wheel backwards', ('sign',), _backwards(1, True)),
    Fault('a wheel backwards, torque right', ('sign',), _backwards(1, False)),
    Fault('two wheels backwards', ('sign',), _backwards(2, True)),
    Fault('a side backwards', ('sign',), _backwards('side', True), TURNS),
    Fault('all wheels backwards', ('sign',), _backwards('all', True), TURNS),
    Fault('sides swapped', ('swapped_sides',), _exchanged('all'), TURNS),
    Fault('two wheels exchanged', ('exchanged_wheels',), _exchanged('one')),
    Fault('a wheel without rate', ('missing_wheel',), _mute),
    Fault('a wheel under another name', ('unknown_name',), _renamed),
    Fault('rates in rpm', ('unit',), _scaled('joints', 'rate', 30.0 / math.pi)),
    Fault('rates in degrees', ('unit',), _scaled('joints', 'rate', 180.0 / math.pi)),
    Fault('rates in counts', ('unit',), _scaled('joints', 'rate', 4096.0 / 2.0 / math.pi)),
    Fault('a frozen rate', ('frozen',), _frozen(False)),
    Fault('a dead encoder', ('frozen',), _frozen(True)),
    Fault('a frozen reference', ('frozen',), _held('reference', 'velocity', False)),
    Fault('a frozen torque', ('frozen',), _held('joints', 'torque', True)),
    Fault('a frozen sinkage', ('frozen',), _held('sinkage', 'sinkage', True)),
    Fault('a frozen accelerometer', ('frozen',), _held('imu', 'force', False)),
    Fault('a reference of zeros', ('placeholder',), _scaled('reference', 'velocity', 0.0)),
    Fault('a speed without a sign', ('sign',), _unsigned('reference', 'velocity')),
    Fault('torques without a sign', ('sign',), _unsigned('joints', 'torque')),
    Fault('noisy rates', ('noise',), _noise(0.5, 'joints', 'rate')),
    Fault('coarse encoders', ('noise',), _counted),
    Fault('gaps of the rates', ('drop_outs',), _without('joints', False)),
    Fault('messages of the IMU lost', ('drop_outs',), _without('imu', True)),
    Fault('stamps repeated', ('order',), _repeating),
    Fault('IMU upside down', ('mounting',), _turned('x', 180.0, 180.0)),
    Fault('IMU turned a quarter', ('mounting',), _turned('z', 90.0, 90.0)),
    Fault('IMU turned about z', ('mounting',), _turned('z', 40.0, 140.0)),
    Fault('IMU tilted', ('mounting',), _turned('y', 4.0, 12.0)),
    Fault('gyro in degrees', ('unit',), _scaled('imu', 'rate', 180.0 / math.pi)),
    Fault('force in g', ('unit',), _scaled('imu', 'force', 1.0 / G)),
    Fault('gravity taken off', ('gravity',), _added('imu', 'force', _no_gravity)),
    Fault('gyro all zero', ('placeholder',), _scaled('imu', 'rate', 0.0)),
    Fault('yaw rate reversed', ('sign',), _reversed_yaw, TURNS),
    Fault('gyro bias', ('zero',), _added(
        'imu', 'rate', lambda c, r: np.array([0.0, 0.0, _drawn(r, 0.03, 0.08)]))),
    Fault('IMU frozen for a while', ('frozen',), _imu_frozen),
    Fault('wild samples of the IMU', ('noise', 'jumps'), _imu_wild),
    Fault('stamps of the IMU off', ('delay',), _stamped('imu', 0.4, 1.8)),
    Fault('stamps of the wheels off', ('delay',), _stamped('joints', 0.4, 1.5)),
    Fault('stamps of the reference off', ('delay',), _stamped('reference', 0.5, 2.0)),
    Fault('stamps of the sinkage off', ('delay',), _stamped('sinkage', 0.4, 2.0)),
    Fault('torque of a wheel reversed', ('sign',), _torque_sign),
    Fault('torque in N mm', ('unit',), _scaled('joints', 'torque', 1000.0), SCALES),
    Fault('scale of the torques', ('gain',), _scaled(
        'joints', 'torque', (0.45, 2.2), value=lambda f: f, parameter='sensors.torque_gain'),
        SCALES),
    Fault('zero of a torque', ('zero',), _torque_zero),
    Fault('effort all zero', ('placeholder',), _scaled('joints', 'torque', 0.0)),
    Fault('sinkage in mm', ('unit',), _scaled('sinkage', 'sinkage', 1000.0)),
    Fault('sinkage upwards', ('sign',), _scaled('sinkage', 'sinkage', -1.0), ('zero',)),
    Fault('zero of a sinkage', ('zero',), _sinkage_zero, ('sign',)),
    # No drive tells it; it stays to be sure that nothing else is named for it.
    Fault('sinkage sensors exchanged', ('exchanged_wheels',), _exchanged('one', 'sinkage')),
    Fault('reference reversed', ('sign',), _scaled('reference', 'velocity', -1.0)),
    Fault('reference in km/h', ('unit',), _scaled('reference', 'velocity', 3.6)),
    Fault('scale of the reference', ('gain',), _scaled(
        'reference', 'velocity', (0.85, 1.15), value=lambda f: 1.0 / f), ('radius',)),
    Fault('reference that jumps', ('jumps',), _jumping),
    Fault('covariance of 1e6', ('covariance',), _scaled('reference', 'variance', 1e9)),
    Fault('radius', ('radius',), _in_file('wheels.radius', 0.05, 0.18), ('gain',)),
    Fault('track', ('track',), _in_file('wheels.y', 0.15, 0.3)),
    Fault('mass', ('mass',), _in_file('rover.mass', 0.3, 0.5), SCALES),
    Fault('gravity of another planet', ('gravity',), _in_file('rover.gravity', 0.6, 0.6)),
)  # fmt: skip


# How it is scored --------------------------------------------------------------------------------


def outcome(fault: Fault, faulty: Faulty, before: CheckReport) -> tuple[str, list[str]]:
    """Return found, told or missed, and the wrong findings in words."""
    report = check_recording(faulty.case.recording, faulty.case.rover)
    old = {(f.fault, f.wheel) for f in before.findings}
    fresh = [f for f in report.findings if (f.fault, f.wheel) not in old or f.kind in fault.kinds]
    right, wrong = [], []
    for finding in fresh:
        if finding.kind in fault.kinds and _fits(finding, faulty):
            right.append(finding)
        elif (finding.fault, finding.wheel) in old:
            continue
        elif finding.kind not in fault.beside and finding.confidence > SURE:
            wrong.append(f'{finding} (true: {faulty.value})')
    if right:
        return 'found', wrong
    silent = {entry.kind for entry in report.not_checked} & {*fault.kinds, *fault.beside}
    beside = any(f.kind in fault.beside for f in fresh)
    return 'told' if silent or beside else 'missed', wrong


def _fits(finding: Finding, faulty: Faulty) -> bool:
    names = faulty.case.names
    told = set((finding.wheel or '').split(', '))
    if faulty.wheels and not {names[wheel] for wheel in faulty.wheels} <= told:
        return False
    if faulty.value is None or finding.value is None:
        return True
    if faulty.parameter is not None and finding.parameter != faulty.parameter:
        return False
    off = abs(finding.value - faulty.value)
    if (finding.parameter or '').endswith('_deg'):
        off = abs(math.remainder(off, 360.0))
    near = max(2.0 * (finding.std or 0.0), NEAR * abs(faulty.value))
    return off <= near + faulty.own


def recording_of(drive: BenchDrive, name: str) -> Recording:
    """Return what a simulated rover would have recorded, in its sensors' signs."""
    by_type: dict[type, list[Any]] = {}
    for arrival in drive.arrivals:
        by_type.setdefault(type(arrival.measurement), []).append(arrival)

    def times(kind: type) -> tuple[Any, Any]:
        heard = by_type.get(kind, [])
        stamps = [one.measurement.stamp for one in heard]
        return np.array(stamps, np.int64), np.array([one.arrival for one in heard], np.int64)

    def table(kind: type, value: Callable[[Any], Any]) -> FloatArray:
        return np.array([value(one.measurement) for one in by_type[kind]], dtype=float)

    wheels = drive.configuration.wheels
    imu = sinkage = reference = None
    joints = JointSeries(
        '/joint_states',
        *times(WheelOdometry),
        wheels.names,
        wheels.direction * table(WheelOdometry, lambda m: m.rate),
        wheels.direction * table(WheelOdometry, lambda m: m.torque),
    )
    if InertialReading in by_type:
        force = table(InertialReading, lambda m: m.specific_force)
        rate = table(InertialReading, lambda m: m.angular_rate)
        none = np.full((force.shape[0], 4), np.nan)
        imu = ImuSeries('/imu/data', *times(InertialReading), force, rate, none)
    if SinkageReading in by_type:
        depth = table(SinkageReading, lambda m: m.sinkage)
        sinkage = SinkageSeries('/sinkage', *times(SinkageReading), wheels.names, depth)
    if ReferenceVelocity in by_type:
        forward = table(ReferenceVelocity, lambda m: m.forward)
        velocity = np.column_stack([forward, 0.0 * forward, 0.0 * forward])
        variance = table(ReferenceVelocity, lambda m: m.variance)
        heard = times(ReferenceVelocity)
        reference = VelocitySeries('/reference_odom', *heard, velocity, 0.0 * forward, variance)
    return Recording(name, (), joints, imu, sinkage, reference, None)


def cases(texts: list[str], seeds: list[int]) -> Iterator[Case]:
    """Yield the cases that are named."""
    for text in texts:
        simulator, _, kind = text.partition(':')
        path, _, files = text.partition('=')
        if files:
            with open_bag(path) as bag:
                recording = read_series(bag, {}, Path(path).name)
            yield Case(recording, reader.load(files.split('+')))
            continue
        for seed in seeds:
            drive = SIMULATORS[simulator].simulate(kind, seed, None, None)
            yield Case(recording_of(drive, f'{text} {seed}'), drive.configuration)


def scored(case: Case, seed: int, table: dict[str, Counter[str]], word: str) -> None:
    """Print what is found in a case without a fault, and what is wrong; count the rest."""
    before = check_recording(case.recording, case.rover)
    for finding in before.findings:
        print(f'without a fault: {case.recording.name}: {finding}', flush=True)
    table['(without a fault)']['found' if before.findings else 'silent'] += 1
    for place, fault in enumerate(FAULTS):
        if word not in fault.name:
            continue
        faulty = fault.put(case, np.random.default_rng([seed, place]))
        if faulty is None:
            continue
        result, wrong = outcome(fault, faulty, before)
        table[fault.name][result] += 1
        table[fault.name]['wrong'] += bool(wrong)
        if result == 'missed' or wrong:
            which = [case.names[wheel] for wheel in faulty.wheels] or faulty.value
            print(f'{result}: {case.recording.name}: {fault.name} {which} {wrong}', flush=True)


def main() -> None:
    """Print the table of the study."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('cases', nargs='+', metavar='CASE', help='A:kind, or BAG=CONFIG')
    parser.add_argument('--seeds', nargs='+', type=int, default=[1])
    parser.add_argument('--faults', default='', metavar='WORD', help='only those with this word')
    arguments = parser.parse_args()
    table = {name: Counter[str]() for name in ('(without a fault)', *(f.name for f in FAULTS))}
    for number, case in enumerate(cases(arguments.cases, arguments.seeds)):
        scored(case, arguments.seeds[0] + number, table, arguments.faults)
    print_table(table)


def print_table(table: dict[str, Counter[str]]) -> None:
    """Print the counts by fault and in all."""
    columns = ('found', 'told', 'missed', 'wrong')
    print(f'\n{"fault":36}' + ''.join(f'{column:>9}' for column in columns))
    for name, counts in table.items():
        print(f'{name:36}' + ''.join(f'{counts[column]:9}' for column in columns))
    total = sum((table[fault.name] for fault in FAULTS), Counter[str]())
    shown = total['found'] + total['missed']
    print(
        f'found {total["found"]} of {shown} that the recording shows, reported as not visible '
        f'{total["told"]}; with a wrong remedy {total["wrong"]}'
    )


if __name__ == '__main__':
    main()
