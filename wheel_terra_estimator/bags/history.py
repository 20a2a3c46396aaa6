# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates of a whole drive as arrays, for summaries and pictures.

They come from the sets of a replay, or from a bag of the live node's outputs; the arrays are the
same.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IntArray
from wheel_terra_estimator.bags.storage import Bag, messages_of
from wheel_terra_estimator.bags.writer import DIAGNOSTICS, TOPICS
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass, SlipOnSlope
from wheel_terra_estimator.messages.diagnostics import NODE
from wheel_terra_estimator.messages.pack import JOINT_OUTPUTS
from wheel_terra_estimator.messages.unpack import Message

MOST_ROWS = 20_000
"""Rows that are kept: a thousand seconds at 20 Hz, ten times what a picture can show."""


class ThinnedRows:
    """Stamped rows; once there are too many, the first of each 2, 4, 8 ... is kept.

    ``most``: greatest number of rows that are kept; even.
    """

    def __init__(self, most: int = MOST_ROWS) -> None:
        self._most = most
        self._rows: list[tuple[int, FloatArray]] = []
        self._together = 1  # rows of which the first is kept
        self._count = 0  # of those, the rows that the last one kept stands for

    def add(self, stamp: int, values: ArrayLike) -> None:
        """Append a row."""
        if 0 < self._count < self._together:
            self._count += 1
            return
        if len(self._rows) >= self._most:
            self._rows = self._rows[::2]
            self._together *= 2
        self._count = 1
        self._rows.append((stamp, np.array(values, dtype=np.float64)))

    def stamps(self) -> IntArray:
        """Return the stamps that were kept, (k,) [ns]."""
        return np.array([stamp for stamp, _ in self._rows], dtype=np.int64)

    def values(self, width: int) -> FloatArray:
        """Return the values that were kept, (k, width)."""
        found = np.array([values for _, values in self._rows], dtype=np.float64)
        return found.reshape(len(self._rows), width)


WHEEL_FIELDS = {
    'slip': 'slip',
    'slip_std': 'slip_std',
    'slip_velocity': 'slip_velocity',
    'drawbar_pull': 'drawbar_pull',
    'drawbar_pull_std': 'drawbar_pull_std',
    'sinkage': 'sinkage',
    'sinkage_std': 'sinkage_std',
    'normal_load': 'normal_load',
    'rim_travel_left': 'rim_travel_left',
    'pull_margin': 'pull_margin',
    'slip_angle': 'sideways_known.angle',
    'slip_angle_std': 'sideways_known.angle_std',
    'lateral_force': 'sideways_known.force',
    'lateral_force_std': 'sideways_known.force_std',
}
"""Quantity of a wheel -> field of an `EstimateSet`."""
LONGEST_STEP = 1.0
"""A longer pause between sets, or a step back of the clock, is no time in any class [s]."""

_QUANTITIES = {field: name for name, field in WHEEL_FIELDS.items()}
_values_of = attrgetter(*WHEEL_FIELDS.values())
_TOPIC_FIELDS = {
    topic: names
    for topic, fields in JOINT_OUTPUTS.items()
    if not set(WHEEL_FIELDS).isdisjoint(names := [_QUANTITIES.get(f, f) for f in fields])
}
"""Topic -> quantities that are its position, velocity and effort."""


_ROW = np.full(256, list(SlipClass).index(SlipClass.UNKNOWN), dtype=np.intp)
"""Class to its place among all."""
_ROW[list(SlipClass)] = np.arange(len(SlipClass))


@dataclass(frozen=True)
class StuckWarning:
    """One stuck warning: from, to [ns] (None: until the end), and why, in words."""

    start: int
    end: int | None
    reason: str


class DriveFigures:
    """Figures of a whole drive, set by set; per-wheel arrays are (n,)."""

    def __init__(self, wheels: int) -> None:
        self.sets = 0
        self.duration = 0.0  # from the first set to the latest stamp [s]
        self._seconds = np.zeros((len(SlipClass), wheels))
        self._wheel = np.arange(wheels)
        self.slip_travel = np.zeros(wheels)  # (n,) in the classes high and stuck [m]
        self._slipping = np.zeros(wheels)  # slip velocity in them at the last set [m/s]
        self.max_slip = np.zeros(wheels)  # (n,) greatest |slip| outside of class unknown [-]
        # ``max_sinkage``, ``max_sinkage_std``: (n,) greatest sinkage since slip was first known,
        # so not the one assumed before the first motion, and its standard deviation [m]
        self.max_sinkage = np.full(wheels, -np.inf)
        self.max_sinkage_std = np.full(wheels, np.inf)
        self.least_margin = np.full(wheels, np.inf)  # (n,) least pull margin [N]
        # (n,) greatest size of the lateral force outside of class unknown [N]
        self.max_lateral_force = np.zeros(wheels)
        self._pull = np.zeros(wheels)
        self._known = np.zeros(wheels)
        self._first = self._stamp = 0
        self._class: NDArray[np.uint8] = np.zeros(wheels, dtype=np.uint8)

    @property
    def seconds_in_class(self) -> dict[SlipClass, FloatArray]:
        """Class to the time of each wheel in it [s]."""
        return dict(zip(SlipClass, self._seconds, strict=True))

    @property
    def mean_pull(self) -> FloatArray:
        """Mean drawbar pull outside of class unknown, (n,) [N]."""
        return self._pull / np.maximum(self._known, 1.0)

    def add(
        self, stamp: int, slip_class: NDArray[np.uint8], values: Mapping[str, FloatArray]
    ) -> None:
        """Take a set: stamp [ns], classes and quantities of `WHEEL_FIELDS`."""
        if self.sets == 0:
            self._first = stamp
        else:
            step = (stamp - self._stamp) * 1e-9
            if 0.0 <= step <= LONGEST_STEP:
                self._seconds[_ROW[self._class], self._wheel] += step
                self.slip_travel += self._slipping * step
        self.sets += 1
        self._stamp, self._class = stamp, slip_class
        self.duration = max(self.duration, (stamp - self._first) * 1e-9)
        known = slip_class != SlipClass.UNKNOWN
        high = known & (slip_class >= SlipClass.HIGH)
        self._slipping = np.where(high, np.abs(values['slip_velocity']), 0.0)
        self._pull += np.where(known, values['drawbar_pull'], 0.0)
        self._known += known
        self.max_slip = np.maximum(self.max_slip, np.where(known, np.abs(values['slip']), 0.0))
        deeper = (self._known > 0.0) & (values['sinkage'] > self.max_sinkage)
        self.max_sinkage = np.where(deeper, values['sinkage'], self.max_sinkage)
        self.max_sinkage_std = np.where(deeper, values['sinkage_std'], self.max_sinkage_std)
        self.least_margin = np.minimum(self.least_margin, values['pull_margin'])
        aside = np.where(known, np.abs(values['lateral_force']), 0.0)
        self.max_lateral_force = np.maximum(self.max_lateral_force, aside)


@dataclass(frozen=True)
class EstimateHistory:
    """Estimates of a drive; per-wheel arrays are (k, n), the others (k,).

    ``values`` holds the arrays of ``WHEEL_FIELDS`` by name, units as in `EstimateSet`. A long
    drive may be thinned; ``whole`` are the figures of all its sets.
    """

    names: tuple[str, ...]
    stamp: IntArray  # [ns]
    values: dict[str, FloatArray]
    slip_class: NDArray[np.uint8]
    forward_velocity: FloatArray  # [m/s]
    forward_velocity_std: FloatArray
    warnings: tuple[StuckWarning, ...]
    whole: DriveFigures | None = None  # None: the arrays are all there is
    slip_on_slope: SlipOnSlope | None = None  # as the drive ended; None: not known

    @property
    def seconds(self) -> FloatArray:
        """Time since the first set [s]."""
        return (self.stamp - self.stamp[0]) * 1e-9 if self.stamp.size else np.empty(0)

    @property
    def warning_times(self) -> list[tuple[float, float | None]]:
        """Start and end of each stuck warning since the first set [s]; None: until the end."""
        begin = int(self.stamp[0]) if self.stamp.size else 0
        return [
            ((w.start - begin) * 1e-9, None if w.end is None else (w.end - begin) * 1e-9)
            for w in self.warnings
        ]

    @property
    def stuck(self) -> BoolArray:
        """Whether a stuck warning ran, per set."""
        running = np.zeros(self.stamp.size, dtype=bool)
        for warning in self.warnings:
            until = True if warning.end is None else self.stamp < warning.end
            running |= (self.stamp >= warning.start) & until
        return running

    def figures(self) -> DriveFigures:
        """Return the figures of the whole drive."""
        if self.whole is not None:
            return self.whole
        found = DriveFigures(len(self.names))
        for i, stamp in enumerate(self.stamp.tolist()):
            row = {name: values[i] for name, values in self.values.items()}
            found.add(stamp, self.slip_class[i], row)
        return found


class HistoryRecorder:
    """Collects estimate sets into an `EstimateHistory`.

    Of a long drive at most ``most`` sets are kept (see `ThinnedRows`); the figures count all.
    """

    def __init__(self, names: Sequence[str], most: int | None = None) -> None:
        self._names = tuple(names)
        self._figures = DriveFigures(len(self._names))
        self._rows = ThinnedRows(sys.maxsize if most is None else most)
        self._warnings: list[StuckWarning] = []
        self._slopes: SlipOnSlope | None = None

    def add(self, estimates: EstimateSet) -> None:
        """Append a set."""
        e = estimates
        self._slopes = e.slip_on_slope or self._slopes
        values = dict(zip(WHEEL_FIELDS, _values_of(e), strict=True))
        self._figures.add(e.stamp, e.slip_class, values)
        general = (e.forward_velocity, e.forward_velocity_variance)
        row = np.concatenate([general, e.slip_class, *values.values()])
        self._rows.add(e.stamp, row)
        _follow(self._warnings, e.stuck, e.stamp, e.stuck_reason)

    def history(self) -> EstimateHistory:
        """Return what was collected."""
        wheels = len(self._names)
        rows = self._rows.values(2 + wheels * (1 + len(WHEEL_FIELDS)))
        classes, *fields = (
            rows[:, at : at + wheels] for at in range(2, rows.shape[1], wheels or 1)
        )
        return EstimateHistory(
            names=self._names,
            stamp=self._rows.stamps(),
            forward_velocity=rows[:, 0],
            forward_velocity_std=np.sqrt(rows[:, 1]),
            slip_class=classes.astype(np.uint8),
            values=dict(zip(WHEEL_FIELDS, fields, strict=True)),
            warnings=tuple(self._warnings),
            whole=self._figures,
            slip_on_slope=self._slopes,
        )


def read_estimates(bag: Bag) -> EstimateHistory:
    """Read the estimates out of a bag of the node's outputs.

    Raises UserError where the bag holds no estimates.
    """
    if f'/{NODE}/slip' not in bag.topics:
        raise UserError(
            f'{bag.path}: no /{NODE}/slip in it, so no estimates; there are: '
            + ', '.join(bag.topics)
        )
    found = _EstimateMessages()
    for log_time, topic, message in messages_of(bag, TOPICS):
        found.add(topic.removeprefix(f'/{NODE}/'), message, log_time)
    return found.history()


class _EstimateMessages:
    """Puts the messages of one set together again, by their stamp."""

    def __init__(self) -> None:
        self._sets: dict[int, dict[str, Any]] = {}
        self._names: tuple[str, ...] = ()
        self._latest: dict[str, Any] = {}
        self._warnings: list[StuckWarning] = []
        self._reasons: dict[str, str] = {}

    def add(self, topic: str, message: Any, log_time: int) -> None:
        """Take in a message; of private topics the last part of the name."""
        if topic in _TOPIC_FIELDS:
            self._add_joints(topic, message, log_time)
        elif topic == 'slip_class' and self._latest:
            self._latest['slip_class'] = message.data
        elif topic == 'twist':
            row = self._sets.setdefault(message.stamp, {})
            velocity, variance = message.numbers[0][[0, 6]]
            row.update(forward_velocity=velocity, forward_velocity_std=np.sqrt(variance))
        elif topic == 'stuck':
            _follow(self._warnings, bool(message.data), log_time)
        elif topic == DIAGNOSTICS:
            self._add_reasons(message)

    def _add_joints(self, topic: str, message: Message, log_time: int) -> None:
        row = self._sets.setdefault(message.stamp, {})
        row.update(zip(_TOPIC_FIELDS[topic], message.numbers, strict=True))
        if topic == 'slip':
            self._names, self._latest = message.names, row
            row['log_time'] = log_time

    def _add_reasons(self, message: Any) -> None:
        for status in message.status:
            texts = [pair.value for pair in status.values if pair.key == 'reason']
            self._reasons.update((status.name, text) for text in texts)
        if self._warnings and not self._warnings[-1].reason:
            # Each wheel states that of the rover, else its own.
            words = (reason.rpartition('rover: ')[2] for reason in self._reasons.values())
            said = '; '.join(dict.fromkeys(filter(None, words)))
            self._warnings[-1] = replace(self._warnings[-1], reason=said)

    def history(self) -> EstimateHistory:
        """Return the sets that are whole; nan (class 255) for fields without a message."""
        present = set().union(*self._sets.values())
        wanted = present.intersection((*WHEEL_FIELDS, 'slip_class', 'forward_velocity'))
        whole = {stamp: row for stamp, row in self._sets.items() if wanted <= row.keys()}
        shape = len(whole), len(self._names)
        nothing = [np.nan] * len(self._names)
        unknown = {
            **dict.fromkeys(WHEEL_FIELDS, nothing),
            'slip_class': [SlipClass.UNKNOWN] * len(self._names),
            'forward_velocity': np.nan,
            'forward_velocity_std': np.nan,
        }

        def column(name: str) -> NDArray[Any]:
            return np.array([row.get(name, unknown[name]) for row in whole.values()])

        return EstimateHistory(
            names=self._names,
            stamp=np.array(list(whole), dtype=np.int64),
            forward_velocity=column('forward_velocity'),
            forward_velocity_std=column('forward_velocity_std'),
            slip_class=column('slip_class').astype(np.uint8).reshape(shape),
            values={name: column(name).reshape(shape) for name in WHEEL_FIELDS},
            warnings=tuple(_in_stamps(self._warnings, whole)),
        )


def _follow(warnings: list[StuckWarning], stuck: bool, time: int, reason: str = '') -> None:
    """Begin or end a warning at a time [ns]."""
    running = bool(warnings) and warnings[-1].end is None
    if stuck and not running:
        warnings.append(StuckWarning(time, None, reason))
    elif running and not stuck:
        warnings[-1] = replace(warnings[-1], end=time)


def _in_stamps(warnings: list[StuckWarning], sets: dict[int, dict[str, Any]]) -> list[StuckWarning]:
    """``~/stuck`` has no stamp: take that of the set it was sent with."""
    stamps = list(sets)
    logged = np.array([row['log_time'] for row in sets.values()])

    def stamp(log_time: int) -> int:
        return stamps[max(int(np.searchsorted(logged, log_time, side='right')) - 1, 0)]

    return [
        StuckWarning(stamp(w.start), None if w.end is None else stamp(w.end), w.reason)
        for w in warnings
        if stamps
    ]
