# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""True state of the simulated rover at one time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IntArray, Quantity
from wheel_terra_estimator.estimation.judgement.entrapment import entrapments
from wheel_terra_estimator.frames import Columns, to_frame

if TYPE_CHECKING:
    from wheel_terra_estimator.frames import DataFrame


@dataclass(frozen=True)
class Recorded:
    """What is recorded of a state: at one time, or with an axis of times in front.

    Per wheel, in the order of ``wheels.names``, and of the rover; in SI units.
    """

    slip: FloatArray  # nan for a wheel at rest (below ``rest_speed``)
    slip_velocity: FloatArray  # r w - v
    drawbar_pull: FloatArray
    normal_load: FloatArray
    sinkage: FloatArray
    sinkage_rate: FloatArray
    torque: FloatArray
    wheel_rate: FloatArray
    slip_angle: FloatArray  # [rad]
    lateral_force: FloatArray  # positive left [N]
    forward_velocity: Quantity
    lateral_velocity: Quantity
    yaw_rate: Quantity
    slope: Quantity  # of the ground in the direction of the heading, positive uphill
    position: FloatArray  # x, y, heading


@dataclass(frozen=True)
class Truth(Recorded):
    """State of rover and soil at one time; arrays are (n,), those of the rover (3,)."""

    time: float  # since the start of the drive [s]
    wheel_angle: FloatArray
    steering: FloatArray  # positive left [rad]
    leaving_angle: FloatArray
    pass_number: FloatArray  # 1 on virgin soil
    pitch: float  # of the chassis, positive nose up
    roll: float  # of the chassis, positive left side up
    specific_force: FloatArray  # in the chassis frame
    angular_rate: FloatArray  # in the chassis frame


@dataclass(frozen=True)
class TruthTable(Recorded):
    """Truth of a whole drive, one row per stamp of the wheel odometry.

    (k, n), in SI units: ``slip`` (nan at rest), ``slip_velocity``, ``drawbar_pull``,
    ``normal_load``, ``sinkage``, ``sinkage_rate``, ``torque``, ``wheel_rate``, ``slip_angle``,
    ``lateral_force``; ``slip_class`` (without hysteresis, 255 at rest). (k,): ``stamp`` [ns],
    ``stuck`` (median abs(slip) of the turning wheels above 0.9 for 1 s; clears after 3 s below
    0.6), ``forward_velocity``, ``lateral_velocity``, ``yaw_rate``, ``slope``; (k, 3): ``position``
    (x, y, heading). ``wheels``: names of the n wheels.
    """

    forward_velocity: FloatArray
    lateral_velocity: FloatArray
    yaw_rate: FloatArray
    slope: FloatArray
    stamp: IntArray
    slip_class: NDArray[np.uint8]
    stuck: BoolArray
    wheels: tuple[str, ...] = ()

    @classmethod
    def from_rows(
        cls,
        stamps: Sequence[int],
        rows: Sequence[Truth],
        thresholds: FloatArray,
        wheels: Sequence[str],
    ) -> TruthTable:
        """Collect rows and add class and stuck."""
        names = [f.name for f in fields(Recorded)]
        columns = {name: np.array([getattr(row, name) for row in rows]) for name in names}
        stamp = np.array(stamps, dtype=np.int64)
        return cls(
            stamp=stamp,
            slip_class=slip_classes(columns['slip'], thresholds),
            stuck=entrapped(stamp, columns['slip']),
            wheels=tuple(wheels),
            **columns,
        )

    def to_frame(self) -> DataFrame:
        """Return a DataFrame (needs pandas): columns and index as those of ``api.estimate``.

        ``<quantity>.<wheel>``, ``position.x``, ``position.y``, ``heading``, ``forward_velocity``,
        ``lateral_velocity``, ``yaw_rate``, ``slope`` and ``stuck``; units: ``attrs['units']``.
        """
        columns: Columns = {'stamp': self.stamp, 'time': (self.stamp - self.stamp[:1]) * 1e-9}
        for f in fields(self):
            values = getattr(self, f.name)
            if f.name in ('stamp', 'wheels', 'position'):
                continue
            if values.ndim == 1:
                columns[f.name] = values
            else:
                columns |= {f'{f.name}.{w}': values[:, i] for i, w in enumerate(self.wheels)}
        columns |= zip(('position.x', 'position.y', 'heading'), self.position.T, strict=True)
        return to_frame(columns, self.stamp)

    def __repr__(self) -> str:
        """Return length, wheels and greatest slip."""
        seconds = float(self.stamp[-1] - self.stamp[0]) * 1e-9 if self.stamp.size else 0.0
        greatest = np.nanmax(np.abs(self.slip), initial=0.0)
        stuck = 'stuck' if self.stuck.any() else 'not stuck'
        return (
            f'TruthTable of {self.stamp.size} rows over {seconds:.1f} s, '
            f'{len(self.wheels)} wheels, greatest slip {greatest:.2f}, {stuck}'
        )

    def time_in_class(self) -> dict[str, float]:
        """Return the share of the wheel time in each class [-]."""
        names = {0: 'low', 1: 'moderate', 2: 'high', 3: 'stuck', 255: 'at rest'}
        return {name: float((self.slip_class == c).mean()) for c, name in names.items()}

    def first_stuck(self) -> float | None:
        """Return when the rover was first entrapped, from the first row on [s]."""
        rows = np.flatnonzero(self.stuck)
        return None if rows.size == 0 else float(self.stamp[rows[0]] - self.stamp[0]) * 1e-9


def slip_classes(slip: FloatArray, thresholds: FloatArray) -> NDArray[np.uint8]:
    """Return the class of each slip ratio, upper bounds included, 255 where slip is nan."""
    classes = np.searchsorted(thresholds, np.abs(np.nan_to_num(slip)), side='left')
    return np.where(np.isnan(slip), 255, classes).astype(np.uint8)


def entrapped(stamp: IntArray, slip: FloatArray) -> BoolArray:
    """Return where the rover is entrapped, from an entrapment until it is free again.

    It is free once the median abs(slip) has been below 0.6 for 3 s.

    ``stamp``: (k,) [ns]. ``slip``: (k, n) slip ratio, nan at rest.
    """
    turning: BoolArray = np.asarray(~np.isnan(slip).all(axis=1))
    median = np.zeros(len(stamp))
    median[turning] = np.nanmedian(np.abs(slip[turning]), axis=1)
    result = np.zeros(len(stamp), dtype=bool)
    time = np.asarray(stamp * 1e-9, dtype=np.float64)
    result[entrapments(time, slip).entrapped] = True
    since_low, stuck = None, False
    for i, now in enumerate(time):
        low = median[i] < 0.6
        since_low = (now if since_low is None else since_low) if low else None
        free = since_low is not None and now - since_low >= 3.0
        stuck = result[i] or (stuck and not free)
        result[i] = stuck
    return result
