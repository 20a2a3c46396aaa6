# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sets of effects, none to several, fitted with the soil free and weighed; errors of sensors too.

Every hypothesis is a set of effects together with an assumption on the structural error: none, a
model-error floor of a few per cent, or a smooth misfit beyond it that no listed effect explains.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    Coordinate,
    effect_coordinates,
    loose_precision,
)
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor, evidence, log_sum
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit, fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.selection.signatures import shapes
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of

# Floor during the fits [share of the range]; the evidence then weighs all floors.
FIT_FLOOR = 0.01
_STRONGEST_START, _WEAKEST_START = 2.5, 0.15


@dataclass(frozen=True)
class Explanation:
    """A fitted set of effects with its evidence."""

    fitted: Fit
    log_joint: FloatArray  # (F,) of evidence and prior of the floor

    @property
    def log_evidence(self) -> float:
        """The floor integrated out."""
        return float(log_sum(self.log_joint))

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
    nuisance: tuple[Coordinate, ...]  # soil and stated base effects
    effects: Mapping[str, Effect]  # the visible effects
    floors: tuple[Floor, ...]
    deepest: float  # greatest rim sinkage of the baseline [m]

    def coordinates(self, names: Iterable[str]) -> tuple[Coordinate, ...]:
        """Return nuisance coordinates followed by those of the effects."""
        own = [c for name in names for c in effect_coordinates(self.effects[name])]
        return (*self.nuisance, *own)

    def at(self, slip: FloatArray, coordinates: Sequence[Coordinate], u: FloatArray) -> FloatArray:
        """Return the model's outputs (N, 4) at other slips than those of the fits.

        Where slips are uncertain these are the most probable ones, not those that were read.
        """
        points = replace(self.forward.points, slip=slip)
        forward = replace(self.forward, points=points)
        return forward.solve([coordinates], [u], jacobian=False).outputs[0]

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
            [(names, self.coordinates(names)) for names in sets],
            starts,
            weights,
            angles,
            iterations,
        )

    def refit(self, fitted: Fit, variance: FloatArray | None = None, iterations: int = 10) -> Fit:
        """Fit a set again, from its present values."""
        return self.fit([fitted.names], [fitted.u], fitted.angle, variance, iterations)[0]

    def predicted(self, outputs: Sequence[FloatArray], variance: FloatArray) -> FloatArray:
        """(K, N, 4) outputs with the structural error that a reference shows beside each."""
        problem, values = self.problem, np.array(outputs)
        cells = values[:, problem.row, problem.quantity]
        residual = (problem.wanted - cells).T
        values[:, problem.row, problem.quantity] += problem.shared_error(
            residual, self.forward.active, variance
        ).T
        return values

    def explain(self, fitted: Fit) -> Explanation:
        """Weigh a fit."""
        return Explanation(fitted, evidence(self.problem, fitted, self.floors))


Start: TypeAlias = tuple[tuple[str, ...], FloatArray, FloatArray]
"""Effects of a set, coordinates and entrance angles from which it is fitted."""


def linear_starts(setting: Setting, base: Fit, names: Sequence[str]) -> list[tuple[float, Start]]:
    """Return (promised fall of the objective, start) for ``base`` plus each effect.

    It comes from the signatures at the base fit. An effect's second parameter (an onset, a
    depth) has no gradient while its strength is nil, so a few values of it compete.
    """
    trials: list[tuple[str, tuple[Coordinate, ...], FloatArray]] = []
    for name in names:
        own = effect_coordinates(setting.effects[name])
        trials += [(name, own, shape) for shape in shapes(own, setting.deepest, 0.0)]
    if not trials:
        return []
    state = setting.forward.solve(
        [(*base.coordinates, *own) for _, own, _ in trials],
        [np.concatenate([base.u, shape]) for _, _, shape in trials],
        base.angle,
        by=[[len(base.u)]] * len(trials),
    )
    problem, best = setting.problem, dict[str, tuple[float, Start]]()
    for (name, own, shape), outputs, column in zip(
        trials, state.outputs, state.jacobian, strict=True
    ):
        # By the strength only: the shape has no gradient here.
        jacobian = problem.rotation @ np.concatenate(
            [base.sensitivity, problem.flat(column)], axis=1
        )
        prior = loose_precision([*base.coordinates, own[0]])
        precision = jacobian.T @ (jacobian / base.variance[:, None]) + np.diag(prior)
        target = problem.residual(outputs) + jacobian @ np.append(base.u, shape[0])
        mean = np.linalg.solve(precision, jacobian.T @ (target / base.variance))
        strength = np.clip(mean[-1], own[0].lower, own[0].upper)
        # Fall of the objective that the linear signature promises inside the bounds.
        fall = (mean[-1] - shape[0]) ** 2 - (mean[-1] - strength) ** 2
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
        full = np.concatenate([np.clip(mean[:-1], base.u - 1.5, base.u + 1.5), start])
        if name not in best or score > best[name][0]:
            best[name] = score, ((*base.names, name), full, base.angle)
    return list(best.values())


# Prior probabilities: nothing missing, one effect, two effects.
PRIOR_NOTHING, PRIOR_ONE, PRIOR_TWO = 0.50, 0.45, 0.05
PRIOR_MORE = 0.2  # each further effect, relative to one effect less
MOST_EFFECTS = 6
MISFIT = 0.5  # probability of a misfit that asks for a name, from which more effects are tried
# Prior of the structural error: floors that a good model may have, with their shares of what the
# misfits below leave over ...
_FLOORS = ((0.0, 0.60), (0.007, 0.10), (0.015, 0.12), (0.025, 0.10), (0.04, 0.04))
# ... and smooth misfits that ask for a name, in all quantities or in one of them.
_UNEXPLAINED_PRIOR = 0.094
_UNEXPLAINED = (0.08, 0.16, 0.35)
_UNEXPLAINED_SOME = (0.015, 0.03, 0.06, 0.15, 0.4)
_SOME = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 1, 1, 1))

_FURTHER = 8  # sets with one effect more that are fitted, at most
_COMPETITORS = 2  # other effects that are put in the place of each effect of a set
# A further effect must promise so many nats over the best set without: its prior costs four.
_PROMISE = 1.5


def default_floors() -> tuple[Floor, ...]:
    """Return the assumptions on the structural error with their priors."""
    share = (1.0 - _UNEXPLAINED_PRIOR) / sum(p for _, p in _FLOORS)
    floors = [Floor((a,) * len(QUANTITIES), math.log(p * share), False) for a, p in _FLOORS]
    patterns = [(a,) * len(QUANTITIES) for a in _UNEXPLAINED]
    patterns += [
        tuple(a * there for there in some)
        for some, a in itertools.product(_SOME, _UNEXPLAINED_SOME)
    ]
    each = math.log(_UNEXPLAINED_PRIOR / len(patterns))
    floors.extend(Floor(pattern, each, True) for pattern in patterns)
    return tuple(floors)


def shared_floors() -> tuple[Floor, ...]:
    """Return the assumptions on a structural error that table and reference have in common.

    However large, it is no gap: it is there without the effect in question as well.
    """
    amplitudes = (0.0, 0.015, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
    each = -math.log(len(amplitudes))
    return tuple(Floor((a,) * len(QUANTITIES), each, False) for a in amplitudes)


@dataclass(frozen=True)
class Selection:
    """All hypotheses with their posterior probabilities."""

    explanations: tuple[Explanation, ...]  # best first
    log_joint: FloatArray  # (H, F) log of prior times evidence per explanation and floor
    probability: FloatArray  # (H, F), normalised
    floors: tuple[Floor, ...]

    @property
    def unexplained(self) -> BoolArray:
        """(F,) True for floors that ask for a name."""
        return np.array([floor.unexplained for floor in self.floors])

    @property
    def totals(self) -> FloatArray:
        """(H,) log of prior times evidence of each explanation, falling."""
        return log_sum(self.log_joint, axis=1)

    @property
    def nothing(self) -> int:
        """Place of the explanation without an effect."""
        return self.index(())

    def quiet_floor(self, index: int) -> int:
        """Return the place of an explanation's best floor among those that ask for no name."""
        return int(np.argmax(np.where(self.unexplained, -np.inf, self.log_joint[index])))

    def without_misfit(self, count: int) -> list[tuple[float, Explanation]]:
        """Return the best explanations, were there no such misfit, with their log weights."""
        weights = log_sum(self.log_joint[:, ~self.unexplained], axis=1)
        order = np.argsort(-weights)[:count]
        return [(float(weights[h]), self.explanations[h]) for h in order]

    def index(self, names: Sequence[str]) -> int:
        """Return the place of the explanation with exactly these effects."""
        return next(h for h, e in enumerate(self.explanations) if set(e.names) == set(names))


def log_prior(names: Sequence[str], visible: Iterable[str]) -> float:
    """Return the log prior of a set of effects among all ``visible`` effects and forms.

    The forms of an effect share its weight.
    """
    forms, count = Counter(map(effect_of, visible)), len(names)
    if count == 0:
        return math.log(PRIOR_NOTHING)
    prior = PRIOR_ONE if count == 1 else PRIOR_TWO * PRIOR_MORE ** (count - 2)
    prior /= max(math.comb(len(forms), count), 1)
    return math.log(prior) - sum(math.log(max(forms[effect_of(key)], 1)) for key in names)


def weigh(
    explanations: Sequence[Explanation], floors: tuple[Floor, ...], visible: Iterable[str]
) -> Selection:
    """Return posterior probabilities of all explanations and floors."""
    keys = tuple(visible)
    joint = np.array([e.log_joint + log_prior(e.names, keys) for e in explanations])
    order = np.argsort(-log_sum(joint, axis=1))
    joint = joint[order]
    return Selection(
        tuple(explanations[k] for k in order), joint, np.exp(joint - log_sum(joint)), floors
    )


def _compatible(setting: Setting, names: Sequence[str]) -> list[str]:
    """Return the effects that may stand beside a set; never two forms of one effect."""
    effects, taken = setting.effects, {effect_of(key) for key in names}
    excluded = set().union(*(effects[key].incompatible_with for key in names))
    return [
        key
        for key, effect in effects.items()
        if effect_of(key) not in taken | excluded and not taken & effect.incompatible_with
    ]


def explain_more(setting: Setting, seeds: Sequence[Explanation]) -> list[Explanation]:
    """Add one effect to sets of one size, where the linear evidence promises most; all refitted."""
    starts: dict[frozenset[str], tuple[float, Start]] = {}
    for seed in seeds:
        others = _compatible(setting, seed.names)
        for gain, start in linear_starts(setting, seed.fitted, others):
            expected_gain, key = gain - seed.fitted.objective, frozenset(start[0])
            if key not in starts or starts[key][0] < expected_gain:
                starts[key] = expected_gain, start
    enough = _PROMISE - min((e.fitted.objective for e in seeds), default=0.0)
    worth = sorted((s for s in starts.values() if s[0] > enough), key=lambda s: -s[0])
    return explained(setting, [start for _, start in worth[:_FURTHER]])


def explained(setting: Setting, starts: Sequence[Start]) -> list[Explanation]:
    """Fit sets of effects, each from its own start and entrance angles, and weigh them."""
    names, values, angles = zip(*starts, strict=True) if starts else ((), (), ())
    return [setting.explain(f) for f in setting.fit(names, values, np.array(angles))]


def explain_fewer(setting: Setting, best: Explanation) -> list[Explanation]:
    """Leave one effect of a set out; the others are refitted from where they are."""
    fitted = best.fitted
    starts = []
    for name in best.names:
        own = [c.key for c in setting.coordinates((name,))[len(setting.nuisance) :]]
        kept = [u for c, u in zip(fitted.coordinates, fitted.u, strict=True) if c.key not in own]
        left = tuple(n for n in best.names if n != name)
        starts.append((left, np.array(kept), fitted.angle))
    return explained(setting, starts)


def explain_swaps(setting: Setting, best: Explanation) -> list[Explanation]:
    """Leave each effect of a set out, put others in its place: other forms, best competitors."""
    starts: list[Start] = []
    fewer = explain_fewer(setting, best)
    for reduced in fewer:
        (left_out,) = set(best.names) - set(reduced.names)
        others = [key for key in _compatible(setting, reduced.names) if key != left_out]
        found = sorted(linear_starts(setting, reduced.fitted, others), key=lambda s: -s[0])
        forms = [s for _, s in found if effect_of(s[0][-1]) == effect_of(left_out)]
        competitors = [s for _, s in found if effect_of(s[0][-1]) != effect_of(left_out)]
        starts += [*forms, *competitors[:_COMPETITORS]]
    return [*fewer, *explained(setting, starts)]
