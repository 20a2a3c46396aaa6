# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip to expect on slopes, from the traction curve learned in the drive.

For a demand p, the required pull over the load (tan of the slope at constant speed), the shear law
of Janosi and Hanamoto (1961), inverted, gives the slip:

    s = a - s_0 ln(1 - p / p_max)

a: slip on level ground, by rolling resistance and by errors such as a wrong radius [-]; s_0: slip
that mobilises the soil [-]; p_max: greatest pull over the load [-]. The thrust balances demand and
rolling resistance. For a > 0 it vanishes at s = 0; for a smaller demand the soil brakes by the same
law:

    s = s_0 ln(2 - (1 - p / p_max) e^(-a/s_0))

For a negative a there is no rolling resistance: s = a + s_0 ln(1 + p / p_max) for p < 0.
An extended Kalman filter of (a, ln s_0, ln p_max) is corrected by the published slip, and needs
nothing else of the estimator. Beyond the demands that occurred neither law nor soil is known to go
on: the deviation of p_max grows in proportion to the distance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.estimates import SLOPES, SlipOnSlope
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.scalars import TINY, gain_of

_DEMANDS = np.tan(np.radians(SLOPES))
_DRAWS = 64


# Prior, walks and noise of the curve; set on simulators A, B and C, seeds 6000 to 6002.
MEAN = (0.05, math.log(0.5), math.log(0.6))
STD = (0.1, 0.5, 0.6)
WALK = 0.03  # of a, per root metre of rim travel
_REVERSAL_STD = 0.2  # of a, at a change of direction
_DEMAND_TIME = 0.4  # low-pass of the demand [s]
_MOST_SHARE = 0.97  # of p_max in the gradient
_FREEDOM = 4.0  # of the heavy tail of a slip (Student t)
SCATTER = 0.03  # of the slip from place to place [-]
_CORRELATION = 1.0  # rim travel within which slips are one piece of information [m]
_MOST_STD = 0.4  # of a slip that teaches
_BEYOND_STD = 1.5  # of ln p_max, per unit of demand beyond those driven
_LEVEL = 0.05  # demand within which nothing is seen of braking [-]; assumed


class Instant(NamedTuple):
    """Inputs of the curve at one time."""

    time: float  # [s]
    demand: float  # in the direction of driving [-]; nan = unknown
    slip: float  # median of the wheels [-]
    slip_std: float
    travel: float  # of the rims since the last instant, 0 where slip is no steady one [m]
    direction: float  # of the drive, 1 or -1


class CurveState(NamedTuple):
    """Estimate of the curve: (a, ln s_0, ln p_max)."""

    mean: FloatArray  # (3,)
    covariance: FloatArray  # (3, 3)
    driven: tuple[float, float] = (0.0, 0.0)  # least and greatest demand so far [-]
    demand: float = math.nan  # low-passed
    time: float = math.nan  # [s]
    direction: float = 0.0
    latest: SlipOnSlope | None = None
    latest_second: int = -1


class SlopeCurve(Component[CurveState]):
    """Learns the curve of a drive, and evaluates it at the slopes once a second."""

    def __init__(self) -> None:
        super().__init__(CurveState(np.array(MEAN), np.diag(np.array(STD) ** 2)))

    def update(self, now: Instant) -> None:
        """Learn from an instant."""
        old = self.state
        dt = 0.0 if math.isnan(old.time) else max(now.time - old.time, 0.0)
        state = old._replace(time=now.time, direction=now.direction or old.direction)
        if math.isnan(now.demand):
            state = state._replace(demand=math.nan)
        else:
            gain = 1.0 if math.isnan(old.demand) else gain_of(dt, _DEMAND_TIME)
            before = now.demand if math.isnan(old.demand) else old.demand
            state = state._replace(demand=before + gain * (now.demand - before))
            if now.travel > 0.0 and now.slip_std < _MOST_STD:
                reversed_ = old.direction * state.direction < 0.0
                state = self._corrected(state, now, reversed_)
        second = int(now.time)
        if second != state.latest_second:
            latest = slips_at(state.mean, state.covariance, SCATTER, self._beyond(state.driven))
            state = state._replace(latest=latest, latest_second=second)
        self.state = state

    def _beyond(self, driven: tuple[float, float]) -> FloatArray:
        """Return the deviation of ln p_max at the slopes (11,) for demands that were not driven."""
        least, greatest = driven
        beyond = np.maximum(np.maximum(_DEMANDS - greatest, least - _DEMANDS), 0.0)
        # Before any downhill drive the braking of the soil is as unknown as at the start.
        unseen = (_DEMANDS < 0.0) & (least > -_LEVEL)
        return np.hypot(_BEYOND_STD * beyond, STD[2] * unseen)

    def _linearised(self, mean: FloatArray, demand: float) -> tuple[float, FloatArray]:
        """Return the slip for a demand, and its gradient by a, ln s_0 and ln p_max, (3,)."""
        offset, scale, greatest = mean[0], math.exp(mean[1]), math.exp(mean[2])
        rolling = max(offset, 0.0)
        share = min(demand / greatest, _MOST_SHARE)
        unused = 1.0 - share  # of the greatest pull
        eased = math.exp(-rolling / scale)
        braked = min(unused * eased, 1.0 + _MOST_SHARE)  # over 1: the soil brakes
        if braked <= 1.0:
            slip = offset - scale * math.log(unused)
            gradient = np.array([1.0, slip - offset, -scale * share / unused])
        else:
            left = 2.0 - braked
            braking = scale * math.log(left)
            slip = offset - rolling + braking
            by_rolling = braked / left
            gradient = np.array(
                [
                    by_rolling if rolling > 0.0 else 1.0,
                    braking - rolling * by_rolling,
                    scale * (braked - eased) / left,
                ]
            )
        return slip, gradient

    def _corrected(self, state: CurveState, now: Instant, reversed_: bool) -> CurveState:
        mean = state.mean
        covariance = state.covariance.copy()
        covariance[0, 0] += WALK**2 * now.travel + (_REVERSAL_STD * reversed_) ** 2
        slip, gradient = self._linearised(mean, state.demand)
        residual = now.slip - slip
        repeats = _CORRELATION / min(now.travel, _CORRELATION)
        noise = (now.slip_std**2 + SCATTER**2) * repeats
        column = covariance @ gradient
        spread = float(gradient @ column)
        tail = (_FREEDOM + residual**2 / (spread + noise)) / (_FREEDOM + 1.0)
        gain = column / (spread + noise * max(tail, 1.0))
        covariance -= gain[:, None] * column
        covariance = 0.5 * (covariance + covariance.T)
        least, greatest = state.driven
        return state._replace(
            mean=mean + gain * residual,
            covariance=covariance,
            driven=(min(least, state.demand), max(greatest, state.demand)),
        )


# Evenly spread draws of four standard normal numbers, (draws, 4); Halton (1960).
_STANDARD = ndtri(qmc.Halton(4, scramble=False).random(_DRAWS + 1)[1:])
_STANDARD = (_STANDARD - _STANDARD.mean(axis=0)) / _STANDARD.std(axis=0)


def slips_at(
    mean: FloatArray, covariance: FloatArray, scatter: float, beyond: FloatArray | float = 0.0
) -> SlipOnSlope:
    """Return the slips that a curve gives at the `SLOPES`, driving forward.

    Mean (3,) and covariance (3, 3) are those of a, ln s_0, ln p_max; `scatter` is the deviation of
    the slip from place to place on one slope [-]; `beyond` (11,) that of ln p_max which comes on
    top, of slopes beyond those driven.
    """
    lower = np.linalg.cholesky(covariance + TINY * np.eye(3))
    offset, scale, greatest = (mean + _STANDARD[:, :3] @ lower.T).T[:, :, None]
    scale = np.exp(scale)
    unused = 1.0 - _DEMANDS / np.exp(greatest + _STANDARD[:, 3:] * beyond)
    rolling = np.maximum(offset, 0.0)
    braked = unused * np.exp(-rolling / scale)  # over 1: the soil brakes
    driving = offset - scale * np.log(np.maximum(unused, TINY))
    braking = offset - rolling + scale * np.log(np.maximum(2.0 - braked, TINY))
    slip = np.where(braked <= 1.0, driving, braking)
    slip = np.clip(slip, -1.0, 1.0)
    beyond = (slip - ENTRAPPED_SLIP) / scatter
    return SlipOnSlope(
        slip.mean(axis=0), np.hypot(slip.std(axis=0), scatter), ndtr(beyond).mean(axis=0)
    )
