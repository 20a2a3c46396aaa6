# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Maximum a posteriori fits of many hypotheses in lockstep (Gauss-Newton with bounds)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
LEAST_DAMPING = 1e-6
"""Share of the precision that is added to its diagonal, at the start."""


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

    def precision(self) -> FloatArray:
        """Posterior precision of u."""
        weighted = self.jacobian / self.variance[:, None]
        return self.jacobian.T @ weighted + np.diag(self.prior)

    def covariance(self) -> FloatArray:
        """Posterior covariance of u."""
        return np.asarray(np.linalg.inv(self.precision()), dtype=float)

    def within(self, problem: Problem, observed: FloatArray) -> Fit:
        """Return the same fit seen through other noise: same cells, another rotation."""
        return replace(
            self,
            residual=problem.rotate(observed - problem.flat(self.outputs)),
            jacobian=problem.rotate(self.sensitivity),
        )

    def values(self) -> dict[str, float]:
        """Return key -> value of every coordinate."""
        return {c.key: float(c.value(x)) for c, x in zip(self.coordinates, self.u, strict=True)}


def fit(
    forward: Forward,
    problem: Problem,
    observed: FloatArray,
    hypotheses: Sequence[tuple[tuple[str, ...], tuple[Coordinate, ...]]],
    starts: Sequence[FloatArray],
    variance: FloatArray,
    angles: FloatArray | None = None,
    iterations: int = 10,
) -> list[Fit]:
    """Fit all hypotheses to the (m,) cells ``observed``; the variance is (m,), of the rotated axes.

    Each of the B hypotheses, (names, coordinates), has a start (P,), and entrance angles (N,) near
    its end.
    """
    count = len(hypotheses)
    limits = [bounds(coordinates) for _, coordinates in hypotheses]
    priors = [loose_precision(coordinates) for _, coordinates in hypotheses]
    trial = [
        np.clip(np.asarray(s, dtype=float), *limit) for s, limit in zip(starts, limits, strict=True)
    ]
    best: list[Fit | None] = [None] * count
    damping = np.full(count, LEAST_DAMPING)
    angle = None if angles is None else np.array(angles, dtype=float)
    active = list(range(count))
    for _ in range(iterations):
        state = forward.solve(
            [hypotheses[b][1] for b in active],
            [trial[b] for b in active],
            None if angle is None else angle[active],
        )
        if angle is None:
            angle = np.empty((count, state.angle.shape[1]))
        going = []
        for index, b in enumerate(active):
            u = trial[b]
            residual = problem.rotate(observed - problem.flat(state.outputs[index]))
            objective = 0.5 * float(residual @ (residual / variance) + u @ (priors[b] * u))
            previous = best[b]
            angle[b] = state.angle[index]
            improved = previous is None or objective <= previous.objective
            gain = np.inf if previous is None else previous.objective - objective
            if improved:
                sensitivity = problem.flat(state.jacobian[index])
                best[b] = Fit(
                    *hypotheses[b],
                    u,
                    state.outputs[index],
                    state.angle[index],
                    sensitivity,
                    residual,
                    problem.rotate(sensitivity),
                    variance,
                    objective,
                    priors[b],
                )
            damping[b] = next_damping(damping[b], improved)
            current = best[b]
            assert current is not None
            gradient = current.jacobian.T @ (current.residual / variance) - priors[b] * current.u
            step, expected = bounded_step(
                current.precision(), gradient, current.u, priors[b], limits[b], damping[b]
            )
            if has_settled(expected, gain):
                continue
            trial[b] = current.u + step
            if improved:
                slope = state.angle_slope[index] @ step
                angle[b] = np.clip(state.angle[index] + slope, 2e-3, 1.5)
            going.append(b)
        active = going
        if not active:
            break
    return [f for f in best if f is not None]


def next_damping(damping: float, improved: bool) -> float:
    """Return the damping of the step that follows one that made the fit better, or worse."""
    return max(0.1 * damping, LEAST_DAMPING) if improved else max(30.0 * damping, 1.0)


def has_settled(expected: float, gain: float) -> bool:
    """Tell whether the next step would fall by too little, or the last one did (< 0: it rose)."""
    return expected < _CLOSE_ENOUGH or 0.0 <= gain < _CLOSE_ENOUGH


def bounded_step(
    precision: FloatArray,
    gradient: FloatArray,
    u: FloatArray,
    prior: FloatArray,
    limit: tuple[FloatArray, FloatArray],
    damping: float,
) -> tuple[FloatArray, float]:
    """Return a damped step that stays inside the limits, and the fall that it should bring.

    ``gradient`` points where the objective falls; ``prior`` is the part of the precision that is
    known beforehand.
    """
    lower, upper = limit
    damped = precision + damping * np.diag(np.diag(precision))
    free = np.ones(len(u), dtype=bool)
    step = np.zeros(len(u))
    # Few passes suffice: a coordinate that would leave its range stays at the bound.
    for _ in range(3):
        fixed = ~free
        right = gradient[free] - damped[np.ix_(free, fixed)] @ step[fixed]
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], right)
        # A strength may double, so that an effect of many prior deviations is reached.
        longest = np.maximum(_LONGEST_STEP, np.where(prior < 1.0, np.abs(u), 0.0))
        step /= max(1.0, float((np.abs(step) / longest).max(initial=0.0)))
        new = u + step
        outside = free & ((new < lower) | (new > upper))
        if not outside.any():
            break
        step[outside] = np.clip(new, lower, upper)[outside] - u[outside]
        free &= ~outside
    step = np.clip(u + step, lower, upper) - u
    expected = float(gradient @ step - 0.5 * step @ precision @ step)
    return step, expected
