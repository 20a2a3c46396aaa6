# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A table of logged values as a rosbag2, row by row: for rovers that do not speak ROS.

A map states quantity, unit and sign of each column (`EXAMPLE`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.configuration.column_map import UNITS, Column, entry_of, factor, read_map
from wheel_terra_estimator.configuration.parameters import nearest
from wheel_terra_estimator.csv_file import CsvFile, check_width, number, open_csv
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.messages import pack
from wheel_terra_estimator.messages.convert import INPUT_TYPES

EXAMPLE = Path(__file__).with_name('columns_example.yaml').read_text(encoding='utf-8')

# Readings and their SI units.
_JOINT = {'velocity': 'rad/s', 'effort': 'N m', 'position': 'rad'}
_IMU = {
    **{f'linear_acceleration.{axis}': 'm/s^2' for axis in 'xyz'},
    **{f'angular_velocity.{axis}': 'rad/s' for axis in 'xyz'},
    **{f'orientation.{axis}': '-' for axis in 'xyzw'},
}
_REFERENCE = {
    'linear.x': 'm/s',
    'variance': '-',
    'position.x': 'm',
    'position.y': 'm',
    'latitude': 'rad',
    'longitude': 'rad',
}
_PLACES = (('position.x', 'position.y'), ('latitude', 'longitude'))
EARTH_RADIUS = 6_371_000.0  # mean [m]
BASELINE = 1.0  # positions so far apart [s] make a speed: closer ones are noise
UNSTEADY = 0.1  # deviation of the rates meanwhile, from which its own is stated, as a share [-]
ONE_WAY = 0.5
"""Share of their rate that the wheels have in common, metre for metre, if all count one way [-]."""
_LATEST = 2**31 - 1  # stamp that a message can hold [s]
_TOPICS = ('joint_states', 'imu/data', 'sinkage', 'reference_odom')
REGULAR = 0.8
"""Share of the runs of one value as long as the others of a sensor whose value is held [-]."""
LEAST_RUNS = 10  # runs of one value that tell it


@dataclass(frozen=True)
class ColumnMap:
    """Columns by what they mean; joints (wheels, and what steers them) and sinkage by name."""

    time: Column
    joints: dict[str, dict[str, Column]]
    imu: dict[str, Column]
    sinkage: dict[str, Column]
    reference: dict[str, Column]


class Converted(NamedTuple):
    """What was written of a table."""

    counts: dict[str, int]  # messages by topic
    short: list[int]  # lines that end before a column of the map
    held: dict[str, int]  # rows that each reading of a topic is repeated over, where it is
    period: float  # of the wheel rates [s], 0 of fewer than two


def convert(table: Path, columns: Path, output: Path, overwrite: bool = False) -> Converted:
    """Write the rows of a CSV file as messages.

    Raises UserError where map or table cannot be used: file, row, column and remedy.
    """
    with open_csv(table) as file:
        if not file.header:
            raise UserError(f'{table}: empty; the first line must name the columns')
        layout = _read_map(columns, file.header, table)
        there = (layout.joints, layout.imu, layout.sinkage, layout.reference)
        used = [name for name, those in zip(_TOPICS, there, strict=True) if those]
        topics = {f'/{name}': INPUT_TYPES[name] for name in used}
        held = _held(table, layout)
        with BagFile(output, topics, overwrite=overwrite) as bag:
            sender = _Sender(bag, layout, file, held)
            for line, row in file.rows:
                sender.send(line, row)
            if not sender.sent:
                raise UserError(f'{table}: no rows below the header')
            if sender.one_way < ONE_WAY * sender.any_way:
                raise UserError(
                    f'{columns}: forward is taken from the wheels, but their signs disagree; give '
                    'sign: -1 for each that reads negative, and wheels.direction 1'
                )
        return Converted(bag.counts, list(sender.short), held, sender.period)


def _held(table: Path, layout: ColumnMap) -> dict[str, int]:
    """Return over how many rows each reading of a slow sensor is repeated, where it is held.

    A logger that writes all at the fastest rate repeats the last value; one that is rounded, or
    stands, stays for as long as it happens to.
    """
    held = {}
    for topic, columns in (('/sinkage', layout.sinkage), ('/reference_odom', layout.reference)):
        if not columns:
            continue
        with open_csv(table) as file:
            cells = (_cells(row, columns) for _, row in file.rows)
            runs = [len(list(same)) for _, same in groupby(cells)]
        usual = sorted(runs)[len(runs) // 2] if len(runs) >= LEAST_RUNS else 1
        alike = sum(abs(run - usual) <= 1 for run in runs)
        if usual > 1 and alike > REGULAR * len(runs):
            held[topic] = usual
    return held


def _cells(row: list[str], columns: Mapping[str, Column]) -> list[str]:
    return [row[column.place] for column in columns.values() if column.place < len(row)]


def _read_map(path: Path, header: list[str], table: Path) -> ColumnMap:
    document = read_map(path)
    known = ('time', *_TOPICS)
    for key in document:
        if key not in known:
            raise UserError(f"{path}: unknown entry '{key}'; nearest: '{nearest(str(key), known)}'")
    reader = _MapReader(path, header, table)
    if 'time' not in document or 'joint_states' not in document:
        raise UserError(
            f'{path}: time and joint_states are needed; see wheel-terra convert --example'
        )
    joints = {
        str(joint): reader.group(f'joint_states.{joint}', entry, _JOINT)
        for joint, entry in reader.mapping('joint_states', document['joint_states']).items()
    }
    for joint, found in joints.items():
        if 'velocity' not in found and set(found) != {'position'}:
            raise UserError(
                f'{path}: joint_states.{joint}: velocity is missing (a joint that steers has '
                'position alone)'
            )
    if not any('velocity' in found for found in joints.values()):
        raise UserError(
            f'{path}: joint_states: no velocity; of angles of wheels, add columns of their change '
            'per time to the table, and name these as velocity'
        )
    sinkage = {
        str(wheel): reader.column(f'sinkage.{wheel}', entry, 'm')
        for wheel, entry in reader.mapping('sinkage', document.get('sinkage') or {}).items()
    }
    imu = reader.group('imu/data', document.get('imu/data') or {}, _IMU)
    reference = reader.group('reference_odom', document.get('reference_odom') or {}, _REFERENCE)
    given = sum(key in reference for key in ('linear.x', *_PLACES[0], *_PLACES[1]))
    whole = sum(2 for pair in _PLACES if set(pair) <= set(reference)) + ('linear.x' in reference)
    if reference and (given != whole or whole not in (1, 2)):
        raise UserError(
            f'{path}: reference_odom: give linear.x, or position.x and position.y, or latitude and '
            'longitude'
        )
    time = reader.column('time', document['time'], 's')
    return ColumnMap(time, joints, imu, sinkage, reference)


class _MapReader:
    """Reads entries of the map against the header of the table."""

    def __init__(self, path: Path, header: list[str], table: Path) -> None:
        self.path, self.header, self.table = path, header, table

    def mapping(self, where: str, entry: Any) -> Mapping[Any, Any]:
        if not isinstance(entry, Mapping):
            raise UserError(f'{self.path}: {where}: must be entries, one a line')
        return entry

    def group(self, where: str, entry: Any, units: Mapping[str, str]) -> dict[str, Column]:
        found = {}
        for key, value in self.mapping(where, entry).items():
            if key not in units:
                raise UserError(
                    f"{self.path}: {where}: unknown '{key}'; nearest: '{nearest(str(key), units)}'"
                )
            found[str(key)] = self.column(f'{where}.{key}', value, units[key])
        return found

    def column(self, where: str, value: Any, si: str) -> Column:
        value = dict(self.mapping(where, value))
        radius = 1.0
        if si == 'rad/s' and 'radius' in value:  # a rim speed
            si, radius = 'm/s', value.pop('radius')
            if not isinstance(radius, (int, float)) or not 0.0 < radius < math.inf:
                raise UserError(f'{self.path}: {where}: radius [m] must be a number above 0')
        entry = entry_of(value, f'{self.path}: {where}')
        times = factor(si, entry.unit) if entry.unit else 1.0
        if times is None:
            known = ', '.join(UNITS[si])
            rim = ', nor m/s with radius: 0.15' if si == 'rad/s' else ''
            raise UserError(f"{self.path}: {where}: unit '{entry.unit}' is none of {known}{rim}")
        if entry.column not in self.header:
            raise UserError(
                f"{self.table}: no column '{entry.column}' ({self.path}: {where}); nearest: "
                f"'{nearest(entry.column, self.header) if self.header else ''}'"
            )
        place = self.header.index(entry.column)
        return Column(place, entry.column, entry.sign * times / radius)


class _Sender:
    """Writes the messages of each row, at its own stamp."""

    def __init__(
        self, bag: BagFile, layout: ColumnMap, file: CsvFile, held: Mapping[str, int]
    ) -> None:
        self.bag, self.layout, self.table, self.held = bag, layout, file.path, held
        self.width, self.decimal_comma = len(file.header), file.decimal_comma
        self.last: dict[str, tuple[list[str], int]] = {}  # a reading, and rows since
        self.sent = 0
        self.short: dict[int, None] = {}  # lines, in order
        # Stamp, place, turned, squared
        self.places: deque[tuple[int, float, float, float, float]] = deque()
        self.turned = 0.0  # how far all wheels have turned together [rad]
        self.squared = 0.0  # integral of the square of their rate [rad^2/s]
        self.common = 0, 0.0  # stamp [ns] and rate that the wheels last had in common
        self.first, self.rows = 0, 0  # stamp of their first row [ns], rows of theirs
        self.one_way = self.any_way = 0.0  # common rate and mean size of rates, times speed

    def send(self, line: int, row: list[str]) -> None:
        check_width(row, self.width, f'{self.table}, line {line}')
        seconds = self.value(line, row, self.layout.time)
        if not 0.0 <= seconds < _LATEST:
            where = f'{self.table}, line {line}, column {self.layout.time.name}'
            if math.isnan(seconds):
                raise UserError(f'{where}: no time; delete the row, or fill in its time')
            raise UserError(
                f'{where}: {seconds:g} s is not within 1970 to 2038; is its unit right?'
            )
        stamp = max(round(seconds * 1e6) * 1000, 1)  # of a date no more is held; 0 is no stamp
        joints = self.layout.joints
        rates, torques, angles = (
            [self.value(line, row, columns.get(field)) for columns in joints.values()]
            for field in _JOINT
        )
        if _any_given(rates):
            (before, was), rate = self.common, _mean(rates)
            seconds = (stamp - before) * 1e-9 if before else 0.0
            self.turned += 0.5 * (was + rate) * seconds
            self.squared += 0.5 * (was**2 + rate**2) * seconds
            self.common = stamp, rate
            self.first, self.rows = self.first or stamp, self.rows + 1
        if _any_given(rates) or _any_given(angles):
            message = pack.joint_state(
                stamp,
                tuple(joints),
                velocity=rates,
                effort=torques if _any_given(torques) else (),
                position=angles if _any_given(angles) else (),
            )
            self.bag.write('/joint_states', message, stamp)
        self._imu(line, row, stamp)
        if self._is_new('/sinkage', _cells(row, self.layout.sinkage)):
            sinkage = self.layout.sinkage
            depths = [self.value(line, row, column) for column in sinkage.values()]
            if _any_given(depths):
                message = pack.joint_state(stamp, tuple(sinkage), position=depths)
                self.bag.write('/sinkage', message, stamp)
        if self._is_new('/reference_odom', _cells(row, self.layout.reference)):
            self._reference(line, row, stamp, rates)
        self.sent += 1

    @property
    def period(self) -> float:
        return (self.common[0] - self.first) * 1e-9 / max(self.rows - 1, 1)

    def _is_new(self, topic: str, cells: list[str]) -> bool:
        """Return whether a row holds a reading of its own, not a held one."""
        before, rows = self.last.get(topic, ([], 0))
        new = cells != before or rows >= self.held.get(topic, 1)
        self.last[topic] = (cells, 1 if new else rows + 1)
        return new

    def value(self, line: int, row: list[str], column: Column | None) -> float:
        if column is None:
            return math.nan
        if column.place >= len(row):
            self.short[line] = None
            return math.nan
        where = f'{self.table}, line {line}, column {column.name}'
        return column.factor * number(row[column.place], where, self.decimal_comma)

    def _imu(self, line: int, row: list[str], stamp: int) -> None:
        columns = self.layout.imu
        values = {name: self.value(line, row, column) for name, column in columns.items()}
        if not values or any(math.isnan(value) for value in values.values()):
            return
        force, rate = (
            [values.get(f'{name}.{axis}', 0.0) for axis in 'xyz']
            for name in ('linear_acceleration', 'angular_velocity')
        )
        quaternion = [values.get(f'orientation.{axis}') for axis in 'xyzw']
        whole = all(part is not None for part in quaternion)
        orientation = [float(part or 0.0) for part in quaternion] if whole else None
        self.bag.write('/imu/data', pack.imu(stamp, force, rate, orientation), stamp)

    def _speed(self, stamp: int, place: list[float], *, degrees: bool) -> tuple[int, float, float]:
        """Return the speed between two positions, at the stamp in their middle; nan for none.

        Its sense is that in which the wheels turned from one to the other. Its variance is that of
        their rates meanwhile, as a share, where they did not turn steadily; else 0.
        """
        x, y = place
        if math.isnan(x) or math.isnan(y):
            return stamp, math.nan, 0.0
        self.places.append((stamp, x, y, self.turned, self.squared))
        first = self.places[0]
        seconds = (stamp - first[0]) * 1e-9
        if seconds < BASELINE:
            return stamp, math.nan, 0.0
        self.places.popleft()
        there, across = x - first[1], y - first[2]
        if degrees:  # latitude, longitude [rad], on a sphere
            there, across = EARTH_RADIUS * there, EARTH_RADIUS * across * math.cos(x)
        turned = self.turned - first[3]
        speed = math.copysign(math.hypot(there, across) / seconds, turned)
        share = (self.squared - first[4]) * seconds / turned**2 - 1.0 if turned else 0.0
        variance = speed**2 * share if share > UNSTEADY**2 else 0.0
        return (stamp + first[0]) // 2, speed, variance

    def _reference(self, line: int, row: list[str], stamp: int, rates: list[float]) -> None:
        columns, arrival = self.layout.reference, stamp
        speed = self.value(line, row, columns.get('linear.x'))
        given = self.value(line, row, columns.get('variance'))
        variance = 0.0 if math.isnan(given) else given  # 0: the rover file decides
        for pair in _PLACES:
            if set(pair) <= set(columns):
                place = [self.value(line, row, columns[key]) for key in pair]
                stamp, speed, changing = self._speed(stamp, place, degrees=pair == _PLACES[1])
                variance += changing
                if not math.isnan(speed):
                    self.one_way += abs(speed * _mean(rates))
                    self.any_way += abs(speed) * _mean([abs(rate) for rate in rates])
        if math.isnan(speed):
            return
        covariance = [0.0] * 36
        covariance[0] = variance
        self.bag.write('/reference_odom', pack.odometry(stamp, speed, 0.0, covariance), arrival)


def _mean(values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else 0.0


def _any_given(values: list[float]) -> bool:
    return not all(math.isnan(value) for value in values)
