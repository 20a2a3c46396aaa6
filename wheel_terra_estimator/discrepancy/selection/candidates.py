# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Candidate explanations: every visible effect, fitted inside the forward model with the soil free.

Sensor and radius errors are candidates like any other: they enter through the same terms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    BELIEVED_WIDTHS,
    Coordinate,
    effect_coordinates,
    loose_precision,
)
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor, Posterior, evidence, log_sum
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit, fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.selection.signatures import shapes
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of

# Floor during the fits [share of the range]; the evidence then weighs all floors.
FIT_FLOOR = 0.01
_STRONGEST_START, _WEAKEST_START = 2.5, 0.15


@dataclass(frozen=True)
class Explanation:
    """A fitted set of effects with its evidence."""

    fitted: Fit
    posterior: Posterior
    log_evidence: float  # the floor integrated out

    @property
    def names(self) -> tuple[str, ...]:
        """The effects in it, by their keys: each in a form."""
        return self.fitted.names

    @property
    def effects(self) -> frozenset[str]:
        """The same whatever their forms."""
        return frozenset(map(effect_of, self.fitted.names))


@dataclass(frozen=True)
class Setting:
    """What all fits of one table share."""

    forward: Forward
    problem: Problem
    observed: FloatArray  # (m,) measured cells (moved along the slip where slip is latent)
    nuisance: tuple[Coordinate, ...]  # soil and stated base effects
    effects: Mapping[str, Effect]  # the visible effects
    floors: tuple[Floor, ...]
    deepest: float  # greatest rim sinkage of the baseline [m]
    # Of the priors of configured numbers, as in ``evidence``
    believed_widths: Sequence[tuple[float, float]] = BELIEVED_WIDTHS

    def coordinates(self, names: Iterable[str]) -> tuple[Coordinate, ...]:
        """Return nuisance coordinates followed by those of the effects."""
        own = [c for name in names for c in effect_coordinates(self.effects[name])]
        return (*self.nuisance, *own)

    def fit(
        self,
        sets: Sequence[tuple[str, ...]],
        starts: Sequence[FloatArray],
        angle: FloatArray | None = None,
        variance: FloatArray | None = None,
        iterations: int = 10,
    ) -> list[Fit]:
        """Fit sets of effects, from entrance angles (N,) of all or (B, N) of each."""
        if not sets:
            return []
        weights = self.problem.variance(FIT_FLOOR) if variance is None else variance
        angles = None if angle is None else np.broadcast_to(angle, (len(sets), angle.shape[-1]))
        return fit(
            self.forward,
            self.problem,
            self.observed,
            [(names, self.coordinates(names)) for names in sets],
            starts,
            weights,
            angles,
            iterations,
        )

    def explain(self, fitted: Fit) -> Explanation:
        """Weigh a fit."""
        posterior = evidence(self.problem, fitted, self.floors, self.believed_widths)
        return Explanation(fitted, posterior, float(log_sum(posterior.log_joint)))


def linear_starts(
    setting: Setting, base: Fit, names: Sequence[str]
) -> list[tuple[float, tuple[str, ...], FloatArray]]:
    """Return (promised fall of the objective, names, start) for ``base`` plus each effect.

    It comes from the signatures at the base fit. An effect's second parameter (an onset, a
    depth) has no gradient while its strength is nil, so a few values of it compete.
    """
    trials: list[Trial] = []
    for name in names:
        own = effect_coordinates(setting.effects[name])
        for shape in shapes(own, setting.deepest, 0.0):
            trials.append((name, own, shape))
    if not trials:
        return []
    coordinates = [(*base.coordinates, *own) for _, own, _ in trials]
    responses = _strength_responses(setting, base, trials)
    problem, fixed = setting.problem, len(base.u)
    best: dict[str, tuple[float, tuple[str, ...], FloatArray]] = {}
    for index, (name, own, shape) in enumerate(trials):
        outputs, angle, column = responses[index]
        own_column = problem.flat(column)
        sensitivity = np.concatenate([base.sensitivity, own_column], axis=1)
        residual = problem.rotate(setting.observed - problem.flat(outputs))
        keep = [*range(fixed), fixed]  # the strength only: the shape has no gradient here
        reduced = Fit(
            (name,),
            tuple(coordinates[index][k] for k in keep),
            np.concatenate([base.u, shape])[keep],
            outputs,
            angle,
            sensitivity,
            residual,
            problem.rotate(sensitivity),
            base.variance,
            0.0,
            loose_precision([coordinates[index][k] for k in keep]),
        )
        precision = reduced.precision()
        target = reduced.residual + reduced.jacobian @ reduced.u
        mean = np.linalg.solve(precision, reduced.jacobian.T @ (target / base.variance))
        strength = np.clip(mean[-1], own[0].lower, own[0].upper)
        # Fall of the objective that the linear signature promises inside the bounds.
        fall = (mean[-1] - reduced.u[-1]) ** 2 - (mean[-1] - strength) ** 2
        score = 0.5 * fall / np.linalg.inv(precision)[-1, -1]
        neutral = own[0].coordinate(own[0].neutral)
        away = strength - neutral
        size = np.clip(abs(away), _WEAKEST_START, _STRONGEST_START)
        side = np.sign(away) if away else 1.0
        if not own[0].lower <= neutral + side * size <= own[0].upper:
            side = -side
        start = shape.copy()
        # Terms whose prior sits away from neutral (a full tilt of the weight) start at the prior.
        start[0] = neutral + side * size if neutral == 0.0 else 0.0
        full = np.concatenate([np.clip(mean[:fixed], base.u - 1.5, base.u + 1.5), start])
        if name not in best or score > best[name][0]:
            best[name] = (score, (*base.names, name), full)
    return list(best.values())


Trial = tuple[str, tuple[Coordinate, ...], FloatArray]
"""Name, its coordinates, and the values at which it starts."""


def _strength_responses(
    setting: Setting, base: Fit, trials: Sequence[Trial]
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return outputs (N, 4), entrance angle (N,) and derivative (N, 4, 1) by strength of each.

    Terms of a sparse law have nothing but a strength, so that all of them stand in one model side
    by side.
    """
    fixed = len(base.u)
    if all(setting.effects[name].sparse for name, _, _ in trials):
        together = (*base.coordinates, *(own[0] for _, own, _ in trials))
        starts = np.concatenate([base.u, *(shape for _, _, shape in trials)])
        by = [range(fixed, len(together))]
        state = setting.forward.solve([together], [starts], base.angle[None], by=by)
        return [
            (state.outputs[0], state.angle[0], state.jacobian[0][..., k : k + 1])
            for k in range(len(trials))
        ]
    state = setting.forward.solve(
        [(*base.coordinates, *own) for _, own, _ in trials],
        [np.concatenate([base.u, shape]) for _, _, shape in trials],
        base.angle,
        by=[[fixed]] * len(trials),
    )
    return list(zip(state.outputs, state.angle, state.jacobian, strict=True))
