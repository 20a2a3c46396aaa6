# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A recording as arrays, in the units and signs that the sensors sent.

Stamps and log times are integer nanoseconds; ``nan`` marks what a message did not hold.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IndexArray, IntArray

ASIDE = math.radians(30.0)  # direction of a velocity that no rover slides in all along [rad]
IN_MOST = 0.6  # share of messages with a wheel below which others hold other wheels [-]
LONGEST_HELD = 1_000_000_000  # time for which a reading stands before and after it [ns]
REACH = 1.5  # A reading counts for so many of its usual periods before and after its stamp [-]


@dataclass(frozen=True)
class Channel:
    """One topic: its name in the recording, stamps and log times (k,) [ns] in order of arrival."""

    topic: str
    stamp: IntArray
    log_time: IntArray

    @property
    def seconds(self) -> FloatArray:
        """Stamps relative to the first one [s]."""
        return (self.stamp - self.stamp[:1].sum()) * 1e-9

    @property
    def ascending(self) -> IntArray:
        """Different stamps in their order, (k,) or fewer [ns]."""
        stamp = self.stamp[self.stamp > 0]
        return stamp if (stamp[1:] > stamp[:-1]).all() else np.unique(stamp)

    @property
    def late(self) -> FloatArray:
        """Log time less stamp of the messages that have a stamp [s]."""
        late = (self.log_time - self.stamp)[self.stamp > 0]
        return np.asarray(late * 1e-9, dtype=np.float64)

    @property
    def period(self) -> float:
        """Median time between the stamps of one message and the next [s]."""
        return float(np.median(np.abs(np.diff(self.stamp)))) * 1e-9


Series = TypeVar('Series', bound=Channel)


def rows_of(series: Series, kept: BoolArray | IndexArray) -> Series:
    """Return some messages of a channel."""
    values = {f.name: getattr(series, f.name) for f in fields(series)}
    arrays: dict[str, Any] = {k: v[kept] for k, v in values.items() if isinstance(v, np.ndarray)}
    return replace(series, **arrays)


def beside(channel: Channel, other: Channel) -> BoolArray:
    """Return the messages (k,) of a channel that are not far from any of another one."""
    stamp = other.ascending
    if stamp.size < 2:
        return np.zeros(channel.stamp.size, dtype=bool)
    off = np.abs(channel.stamp - stamp[_nearest_of(stamp, channel.stamp)])
    return np.asarray(off <= max(LONGEST_HELD, REACH * np.median(np.diff(stamp))))


def _nearest_of(stamp: IntArray, at: IntArray) -> IndexArray:
    """Return which of two or more ascending stamps is the nearest to each of others (m,)."""
    after = np.clip(np.searchsorted(stamp, at), 1, stamp.size - 1)
    return np.where(at - stamp[after - 1] <= stamp[after] - at, after - 1, after)


def shifted(channel: Any, offset: int | IntArray) -> Any:
    """Return a channel with an offset, () or (k,) [ns], taken off its stamps; 0 stays no stamp."""
    return replace(channel, stamp=np.where(channel.stamp > 0, channel.stamp - offset, 0))


@dataclass(frozen=True)
class JointSeries(Channel):
    """Joint states: rate, effort and, where kept, position of every joint that occurs, (k, n)."""

    names: tuple[str, ...]
    rate: FloatArray
    torque: FloatArray
    position: FloatArray | None = None


@dataclass(frozen=True)
class ImuSeries(Channel):
    """IMU messages in the sensor's own frame."""

    force: FloatArray  # (k, 3)
    rate: FloatArray  # (k, 3)
    orientation: FloatArray  # (k, 4) x, y, z, w; nan where the message marks none
    absent: tuple[str, ...] = ()  # force or rate that every message marks as missing


@dataclass(frozen=True)
class SinkageSeries(Channel):
    """Measured sinkage of every name that occurs, (k, n)."""

    names: tuple[str, ...]
    sinkage: FloatArray


@dataclass(frozen=True)
class VelocitySeries(Channel):
    """Twists of an odometry topic."""

    velocity: FloatArray  # (k, 3) linear
    yaw_rate: FloatArray  # (k,)
    variance: FloatArray  # (k,) of linear.x as stated

    @property
    def points_aside(self) -> bool:
        """Whether it is no velocity along x of the rover."""
        forward, side = np.nanmedian(np.abs(self.velocity[:, :2]), axis=0)
        return bool(side > math.tan(ASIDE) * forward)


def of_one_wheel(series: Series, wheels: Sequence[str]) -> Series:
    """Return the messages of the wheel that is reported most often, where each holds one or few."""
    if not isinstance(series, JointSeries | SinkageSeries):
        return series
    there = np.isfinite(series.rate if isinstance(series, JointSeries) else series.sinkage)
    there[:, [name not in wheels for name in series.names]] = False
    if not there.any():
        return series
    one = there[:, np.argmax(there.sum(axis=0))]
    return rows_of(series, one) if one.mean() < IN_MOST else series


def nearest(stamp: IntArray, values: FloatArray, at: IntArray) -> FloatArray:
    """Return the reading, of values (k,) at stamps (k,), nearest to each of other stamps (m,) [ns].

    Each is one that was measured, so that its noise and its steps are; nan where none is near.
    """
    known = np.flatnonzero(np.isfinite(values) & (stamp > 0))
    known = known[np.unique(stamp[known], return_index=True)[1]]
    if known.size < 2:
        return np.full(at.size, np.nan)
    own = stamp[known]
    near = _nearest_of(own, at)
    reached = np.abs(own[near] - at) <= REACH * np.median(np.diff(own))
    return np.where(reached, values[known[near]], np.nan)


@dataclass(frozen=True)
class Recording:
    """What the checks look at; None where the recording has no such topic.

    ``topics`` lists (name, type, number of messages) of everything that was recorded; ``heard``
    has the last log time [ns] of a topic where more is there than was read; ``lost`` is the share
    of messages that a damage took, as far as it is known; ``notes`` say what is damaged, and
    whether it is read to its end; ``moved`` has the time [s] that log time took off stamps.
    """

    name: str
    topics: tuple[tuple[str, str, int], ...]
    joints: JointSeries | None
    imu: ImuSeries | None
    sinkage: SinkageSeries | None
    reference: VelocitySeries | None
    wheel_odometry: VelocitySeries | None
    heard: Mapping[str, int] = field(default_factory=dict)
    lost: float = 0.0
    notes: tuple[str, ...] = ()
    moved: Mapping[str, float] = field(default_factory=dict)
