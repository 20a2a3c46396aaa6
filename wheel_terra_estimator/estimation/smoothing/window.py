# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Centred moving averages: the noise of encoders, gyro and torques is not in the smoothed state.

Slip and pull follow from the smoothed speed and from the rim speeds, the yaw rate and the torques
of the moment, with their noise. A symmetric window reduces it without delay. It does not reach over
a start, a stop or a reversal of a wheel, nor over missing sets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.scalars import TIME_ROUNDING
from wheel_terra_estimator.estimation.smoothing.history_buffer import Gaussian
from wheel_terra_estimator.estimation.wheel_soil_estimator import Instant

Companion = TypeVar('Companion')

HALF_WIDTH = 0.5
"""Of the window [s]; tuned on drives of simulators A and B, seeds 1021 to 1024."""
LONGEST_GAP = 0.25  # between two sets of a window [s]
TURNING = 5e-3  # rim speed above which a wheel turns [m/s]


class Moment(NamedTuple):
    """Smoothed quantities of an instant."""

    instant: Instant
    state: Gaussian
    rims: FloatArray  # (n,) [m/s], nan = unknown
    speed: float  # [m/s]
    yaw_rate: float  # [rad/s]
    speed_std: float  # [m/s]
    pull: FloatArray  # (n,) [N]


@dataclass(frozen=True)
class _Place(Generic[Companion]):  # no NamedTuple: Python 3.10 has no generic ones
    companion: Companion
    moment: Moment
    begin: float  # of the stretch that may be averaged [s]


def centred(
    pairs: Iterable[tuple[Companion, Moment | None]],
) -> Iterator[tuple[Companion, Moment | None]]:
    """Yield the same pairs with rim speeds, speed, yaw rate and pull over load averaged."""
    places: deque[_Place[Companion]] = deque()
    given = 0  # how many of the places were yielded; they remain for the windows of later ones
    for companion, moment in pairs:
        before = places[-1] if places else None
        goes_on = before is not None and moment is not None and _alike(before.moment, moment)
        if before is not None and not goes_on:
            yield from _averaged(places, given, before.moment.instant.time)
            places.clear()
            given = 0
        if moment is None:
            yield companion, None
            continue
        time = moment.instant.time
        places.append(_Place(companion, moment, places[-1].begin if places else time))
        while places[given].moment.instant.time + HALF_WIDTH <= time + TIME_ROUNDING:
            place = places[given]
            yield place.companion, _mean_around(place, places, time)
            given += 1
        oldest = places[given].moment.instant.time - HALF_WIDTH - TIME_ROUNDING
        while places[0].moment.instant.time < oldest:
            places.popleft()
            given -= 1
    if places:
        yield from _averaged(places, given, places[-1].moment.instant.time)


def _averaged(
    places: deque[_Place[Companion]], given: int, end: float
) -> Iterator[tuple[Companion, Moment]]:
    """Yield the places from index `given` on, at the `end` of a stretch [s]."""
    for index in range(given, len(places)):
        yield places[index].companion, _mean_around(places[index], places, end)


def _mean_around(place: _Place[Companion], places: deque[_Place[Companion]], end: float) -> Moment:
    """Return the mean around a place within its stretch, which ends at `end` [s] or later."""
    moment = place.moment
    time = moment.instant.time
    half = min(HALF_WIDTH, time - place.begin, end - time) + TIME_ROUNDING
    near = [p.moment for p in places if abs(p.moment.instant.time - time) <= half]
    load = np.array(moment.instant.sources.loads.load)
    share = np.mean([m.pull / _load(m) for m in near], axis=0)
    return moment._replace(
        rims=np.mean([m.rims for m in near], axis=0),
        speed=float(np.mean([m.speed for m in near])),
        yaw_rate=float(np.mean([m.yaw_rate for m in near])),
        pull=np.where(load > 0.0, share * load, moment.pull),
    )


def _load(moment: Moment) -> FloatArray:
    """Return the loads (n,) as divisors [N]: infinite where there is none."""
    load = np.array(moment.instant.sources.loads.load)
    return np.where(load > 0.0, load, np.inf)


def _alike(before: Moment, after: Moment) -> bool:
    """Return whether a window may reach over both moments."""
    if not 0.0 < after.instant.time - before.instant.time <= LONGEST_GAP:
        return False
    return bool(np.array_equal(_turning(before), _turning(after), equal_nan=True))


def _turning(moment: Moment) -> FloatArray:
    """Return per wheel (n,): 1 forward, -1 backward, 0 stands, nan unknown."""
    return np.where(np.abs(moment.rims) < TURNING, 0.0, 1.0) * np.sign(moment.rims)
