# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Maximum a posteriori fits of many hypotheses in lockstep (Gauss-Newton with bounds)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    Coordinate,
    bounds,
    loose_precision,
)
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.problem import Problem

_LONGEST_STEP = 2.0  # prior standard deviations
_CLOSE_ENOUGH = 0.02  # in the objective
_DECIMALS = 12  # what stands at a bound is off by rounding; no cohesion is below 0, nor -0
_LEAST_DAMPING = 1e-6  # share of the precision that is added to its diagonal, at the start
_EASE, _STIFFEN = 0.1, 30.0  # factors on the damping after a better and after a worse step
_ANGLES = 2e-3, 1.5  # least and greatest first guess of an entrance angle [rad]


class Number(NamedTuple):
    """A fitted number: its coordinate with value and deviation, and those of u."""

    coordinate: Coordinate
    u: float
    value: float
    std: float
    std_of_u: float


@dataclass
class Fit:
    """A fitted hypothesis, with its linearisation in rotated coordinates."""

    names: tuple[str, ...]  # the effects in it
    coordinates: tuple[Coordinate, ...]
    u: FloatArray  # (P,) fitted coordinates
    outputs: FloatArray  # (N, 4) fitted values
    angle: FloatArray  # (N,) entrance angles [rad]
    sensitivity: FloatArray  # (m, P) derivative of the cells by u
    # (m,) and (m, P), whitened and rotated, at u
    residual: FloatArray
    jacobian: FloatArray
    variance: FloatArray  # (m,) of the fit
    objective: float  # half of chi-square plus prior
    prior: FloatArray  # (P,) precision of u in the fit

    def covariance(self) -> FloatArray:
        """Posterior covariance of u."""
        weighted = self.jacobian / self.variance[:, None]
        precision = self.jacobian.T @ weighted + np.diag(self.prior)
        return np.asarray(np.linalg.inv(precision), dtype=float)

    def numbers(self) -> list[Number]:
        """Return the fitted numbers."""
        std = np.sqrt(np.diag(self.covariance()))
        return [
            Number(c, u, round(float(c.value(u)), _DECIMALS) + 0.0, c.deviation(u, s), s)
            for c, u, s in zip(self.coordinates, self.u.tolist(), std.tolist(), strict=True)
        ]


class Descent:
    """One hypothesis on its way down the objective, by damped Gauss-Newton steps inside bounds."""

    def __init__(
        self, coordinates: Sequence[Coordinate], start: FloatArray, inverse: FloatArray
    ) -> None:
        self.prior = loose_precision(coordinates)  # (P,) precision of u
        self._limits = bounds(coordinates)
        self._inverse = inverse  # (m, m) inverse covariance of the cells
        self._damping = _LEAST_DAMPING
        self.objective = np.inf  # half of chi-square plus prior, at the best point
        self.trial = np.clip(np.asarray(start, dtype=float), *self._limits)  # to be looked at next
        self.going = True

    def is_better(self, residual: FloatArray, sensitivity: FloatArray) -> bool:
        """Take the trial point, with what it leaves of the cells, if the objective is no higher."""
        pull = self._inverse @ residual
        objective = 0.5 * float(residual @ pull + self.trial @ (self.prior * self.trial))
        self._gain = self.objective - objective
        better = self._gain >= 0.0
        if better:
            self.u, self.objective = self.trial, objective
            self._gradient = sensitivity.T @ pull - self.prior * self.u
            self._precision = sensitivity.T @ self._inverse @ sensitivity + np.diag(self.prior)
        damping = self._damping
        eased, stiffened = max(_EASE * damping, _LEAST_DAMPING), max(_STIFFEN * damping, 1.0)
        self._damping = eased if better else stiffened
        return better

    def step(self) -> FloatArray:
        """Set the next trial point; return the way there, which stays inside the bounds."""
        u, gradient, (lower, upper) = self.u, self._gradient, self._limits
        damped = self._precision + self._damping * np.diag(np.diag(self._precision))
        free = np.ones(len(u), dtype=bool)
        step = np.zeros(len(u))
        # Few passes suffice: a coordinate that would leave its range stays at the bound.
        for _ in range(3):
            fixed = ~free
            right = gradient[free] - damped[np.ix_(free, fixed)] @ step[fixed]
            step[free] = np.linalg.solve(damped[np.ix_(free, free)], right)
            # A strength may double, so that an effect of many prior deviations is reached.
            longest = np.maximum(_LONGEST_STEP, np.where(self.prior < 1.0, np.abs(u), 0.0))
            step /= max(1.0, float((np.abs(step) / longest).max(initial=0.0)))
            new = u + step
            outside = free & ((new < lower) | (new > upper))
            if not outside.any():
                break
            step[outside] = np.clip(new, lower, upper)[outside] - u[outside]
            free &= ~outside
        step = np.clip(u + step, lower, upper) - u
        expected = float(gradient @ step - 0.5 * step @ self._precision @ step)
        self.trial = u + step
        self.going = expected >= _CLOSE_ENOUGH and not 0.0 <= self._gain < _CLOSE_ENOUGH
        return step


def fit(
    forward: Forward,
    problem: Problem,
    hypotheses: Sequence[tuple[tuple[str, ...], tuple[Coordinate, ...]]],
    starts: Sequence[FloatArray],
    variance: FloatArray,
    angles: FloatArray | None = None,
    iterations: int = 10,
    kept: Sequence[FloatArray] | None = None,  # of each: inverse covariance (m, m) of what counts
) -> list[Fit]:
    """Fit all hypotheses to the cells; the variance is (m,), of the rotated axes.

    Each of the B hypotheses, (names, coordinates), has a start (P,), and entrance angles (N,) near
    its end.
    """
    every = kept or [problem.inverse(variance)] * len(hypotheses)
    ways = [Descent(h[1], u, w) for h, u, w in zip(hypotheses, starts, every, strict=True)]
    best = dict[int, tuple[FloatArray, FloatArray, FloatArray]]()
    angle = None if angles is None else np.array(angles, dtype=float)
    for _ in range(iterations):
        active = [b for b, way in enumerate(ways) if way.going]
        if not active:
            break
        state = forward.solve(
            [hypotheses[b][1] for b in active],
            [ways[b].trial for b in active],
            None if angle is None else angle[active],
        )
        if angle is None:
            angle = np.empty((len(ways), state.angle.shape[1]))
        for index, b in enumerate(active):
            way, outputs, angle[b] = ways[b], state.outputs[index], state.angle[index]
            sensitivity = problem.flat(state.jacobian[index])
            better = way.is_better(problem.wanted - problem.flat(outputs), sensitivity)
            if better:
                best[b] = outputs, state.angle[index], sensitivity
            step = way.step()
            if better and way.going:
                slope = state.angle_slope[index] @ step
                angle[b] = np.clip(state.angle[index] + slope, *_ANGLES)
    return [
        Fit(
            *hypotheses[b],
            way.u,
            *best[b],
            problem.residual(best[b][0]),
            problem.rotation @ best[b][2],
            variance,
            way.objective,
            way.prior,
        )
        for b, way in enumerate(ways)
    ]
