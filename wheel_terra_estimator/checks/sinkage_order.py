# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether two sinkage sensors go by each other's wheel.

A wheel that sinks deeper than another, by a softer spot or by more load, takes more torque. So the
differences of sinkage and of torque of two wheels go together; with exchanged sensors they go
against each other. The difference that is always there (zero errors, the places of the wheels) is
left out, and so are turns, in which the sides push against each other, and high slip: there the
shear of the soil is used up, and a wheel that digs itself in takes no more torque but less, the
others its share.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import NotChecked, Outcome
from wheel_terra_estimator.checks.series import SinkageSeries
from wheel_terra_estimator.checks.statistics import (
    averaged,
    block_fit,
    confidence,
    correlation,
    even_times,
)
from wheel_terra_estimator.checks.trial import halves

FloatArray = NDArray[np.float64]

WINDOW = 1.0
"""Readings are averaged over this [s]."""
LEAST_ROWS = 40
CLEAR = 4.0
"""Deviations by which a slope of torque over sinkage must differ from 0."""
ALIKE = 0.5
"""Correlation of the two differences that tells the order."""
HIGH_SLIP = 0.3
"""Slip of the rover above which a deeper wheel may take less torque: left out."""
SHOWN = 3
"""Pairs that are listed by name."""
_STANDING = 1e-6
"""Rim speed [m/s]; slower rows are not straight driving and are left out."""


class Pair(NamedTuple):
    """Two wheels, how their differences go together, and how many deviations that is off 0."""

    first: str
    second: str
    correlation: float
    sigmas: float

    @property
    def told(self) -> bool:
        """Whether it is clear which way they go together."""
        sense = math.copysign(1.0, self.correlation)
        return abs(self.correlation) > ALIKE and sense * self.sigmas > CLEAR


def check_order(evidence: Evidence) -> list[Outcome]:
    """Return sinkage sensors that go by each other's wheel."""
    sinkage = evidence.recording.sinkage
    if sinkage is None or not evidence.facts.known:
        return []
    if not np.isfinite(evidence.torque).any():
        return [_not_told('without torques it does not show')]
    if evidence.reference_speed is None:
        return [_not_told('without a reference velocity high slip is not seen')]
    compared = pairs(evidence, sinkage)
    told = [p for p in compared if p.told]
    outcomes: list[Outcome] = []
    exchanged: set[str] = set()
    for pair in sorted(told, key=lambda p: p.correlation):
        both = {pair.first, pair.second}
        if pair.correlation > 0.0 or exchanged & both:
            continue
        exchanged |= both
        words = {'fit': pair.correlation, 'both': f'{pair.first} and {pair.second}'}
        wheel, sure = f'{pair.first}, {pair.second}', confidence(pair.sigmas)
        outcomes.append(evidence.found('sinkage_order', sure, wheel=wheel, **words))
    left = [p for p in compared if p not in told]
    if left or not compared:
        shown = ', '.join(f'{p.first} / {p.second}' for p in left[:SHOWN])
        listed = f' ({shown}{", ..." if len(left) > SHOWN else ""})' if shown else ''
        outcomes.append(
            _not_told(
                f'{len(left) or "all"} pairs of wheels do not show theirs{listed}; drive '
                'straight over soft, patchy ground, up and down, or along a side slope'
            )
        )
    return outcomes


def _not_told(reason: str) -> NotChecked:
    return NotChecked('exchanged_wheels', f'order of the sinkage sensors: {reason}')


def pairs(evidence: Evidence, sinkage: SinkageSeries) -> list[Pair]:
    """Return every pair of wheels whose differences of sinkage and torque can be compared."""
    names = [n for n in evidence.facts.names if n in sinkage.names]
    time = even_times(evidence.time, WINDOW)
    if time.size < LEAST_ROWS:
        return []
    straight = averaged(evidence.time, evidence.straight.astype(float)[:, None], time, WINDOW)
    rows = (straight[:, 0] > 0.99) & (_slip(evidence, time) < HIGH_SLIP)
    if rows.sum() < LEAST_ROWS:
        return []
    at = evidence.seconds(sinkage)
    depth, thrust = {}, {}
    sense = np.sign(evidence.rim)
    for name in names:
        index = evidence.facts.names.index(name)
        column = sinkage.sinkage[:, sinkage.names.index(name)]
        known = np.isfinite(column)
        torque = evidence.torque[:, index] * sense
        if known.sum() < LEAST_ROWS or not np.isfinite(torque).all():
            continue
        if float(np.median(torque)) < 0.0:
            continue  # its sign or zero is wrong
        depth[name] = averaged(at[known], column[known, None], time, WINDOW)[rows, 0]
        thrust[name] = averaged(evidence.time, torque[:, None], time, WINDOW)[rows, 0]
    compared = []
    for first, second in itertools.combinations(depth, 2):
        deeper = depth[first] - depth[second]
        harder = thrust[first] - thrust[second]
        deeper, harder = deeper - deeper.mean(), harder - harder.mean()
        slope = block_fit(deeper[:, None], harder)[0]
        sigmas = math.copysign(slope.sigmas_from(0.0), slope.value)
        parts = [correlation(deeper[half], harder[half]) for half in halves(deeper**2)]
        compared.append(Pair(first, second, min(parts, key=abs), sigmas))
    return compared


def _slip(evidence: Evidence, time: FloatArray) -> FloatArray:
    """Return the slip of the rover in the windows around some times [-]."""
    assert evidence.reference_speed is not None
    speeds = np.column_stack([evidence.reference_speed, np.abs(evidence.rim)])
    speed, rim = averaged(evidence.time, speeds, time, WINDOW).T
    return 1.0 - speed / np.maximum(rim, _STANDING)
