# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From posterior weights to a verdict, its ambiguity groups and the confidence of its names.

The thresholds were chosen on other trials than those that score them (docs/diagnose.md).
"""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, expit  # scipy.stats takes longer to load than a diagnosis

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.evidence import log_sum
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem, over_covariance
from wheel_terra_estimator.discrepancy.selection.weights import Selection
from wheel_terra_estimator.terramechanics.effects.base import effect_of

# Misfit that even the best floor leaves improbable.
IMPROBABLE = 1e-3
# Stated deviations by which no configured number may be pulled: a chance of 5 % for the farthest of
# seven, of which 15 % are known 2.5 times worse than stated (``coordinates.BELIEVED_WIDTHS``).
LARGEST_Z_SCORE = 5.0


@dataclass(frozen=True)
class Remainder:
    """What one explanation leaves."""

    probability: float  # that a smooth misfit beyond the model-error floor is left
    # That any structural error of more than one per cent is left, floor included
    probability_of_any: float
    amplitude: float  # most probable amplitude of the structural error, share of the range
    p_value: float  # of the whole misfit under the best floor (chi-square)
    z_score: float  # farthest of a configured number, in its stated deviations
    shared: bool = False  # a reference has the structural error as well: it is nothing left

    @property
    def accounted_for(self) -> bool:
        """True where model-error floor, noise and plausible numbers explain the rows."""
        return self.p_value > IMPROBABLE and self.z_score < LARGEST_Z_SCORE

    @property
    def only_far(self) -> bool:
        """True where everything fits, but with an implausible number."""
        return self.significant and self.probability <= 0.5 and self.p_value > IMPROBABLE

    @property
    def significant(self) -> bool:
        """True where something is left that wants a name."""
        return self.probability > 0.5 or not self.accounted_for

    @property
    def noticeable(self) -> bool:
        """True where noise alone is not enough: also a misfit within the model-error floor."""
        return self.significant or (self.probability_of_any > 0.8 and not self.shared)


def remainder(selection: Selection, index: int, problem: Problem) -> Remainder:
    """Test what explanation number ``index`` leaves of the cells."""
    explanation = selection.explanations[index]
    joint = selection.log_joint[index]
    share = float(np.exp(log_sum(joint[selection.unexplained]) - log_sum(joint)))
    top = int(np.argmax(joint))
    real = np.array([floor.largest >= 0.01 for floor in selection.floors])
    any_share = float(np.exp(log_sum(joint[real]) - log_sum(joint)))
    variance = problem.variance(selection.floors[selection.quiet_floor(index)].amplitude)
    # Beside a reference no misfit asks for a name: its structural error moves the soil as well.
    shared = not selection.unexplained.any()
    return Remainder(
        share,
        any_share,
        0.0 if shared else selection.floors[top].largest,
        chi_square_p_value(explanation.fitted, variance),
        0.0 if shared else largest_z_score(explanation.fitted),
        shared,
    )


def chi_square_p_value(fitted: Fit, variance: FloatArray) -> float:
    """P-value of the whole misfit, parameters and their priors integrated out.

    Residual and the soil's prior pull together are chi-square with one degree of freedom per cell,
    however many soil parameters were fitted; an effect's strength takes one.
    """
    target = fitted.residual + fitted.jacobian @ fitted.u
    strength = np.array([c.role == 'strength' for c in fitted.coordinates])
    prior = np.where(strength, 1e-9, 1.0)
    square = target @ over_covariance(target, variance, fitted.jacobian, prior)
    return float(chdtrc(len(target) - strength.sum(), float(square)))


def largest_z_score(fitted: Fit) -> float:
    """Return the largest shift of a configured number in its stated deviations; 0 if none is free.

    Soil numbers and parameters of effects that are on: a fit may hide what is missing in either. A
    sum would dilute one huge shift, by which an unlisted effect that works like another soil shows.
    """
    believed = zip(fitted.coordinates, fitted.u, strict=True)
    return max((abs(c.stated * float(u)) for c, u in believed if c.role == 'believed'), default=0.0)


# "Something is missing" must beat "nothing is missing" by these odds, and by more where agreement
# itself is sure to need a model-error floor: a model with one error can have another.
ODDS_TO_SPEAK = 3.5
ODDS_OVER_FLOOR = 10.0
SURE_OF_FLOOR = 0.95
# Members of the open set: tempered weights are added up to this mass.
SET_MASS = 0.97
# A named set that leaves something must at least have removed this share of the excess misfit.
MOST = 0.9
# Nats by which a competitor must at least beat the same set without it.
BETTER_THAN_EMPTY = 1.0
TEMPERATURE = 1.3
# Between what has no name (a law, other beds, an effect that is on) and names: more counts no more.
MOST_ODDS = 10.0  # [nats]


@dataclass(frozen=True)
class Verdict:
    """What was decided."""

    status: str  # ``agrees``, ``named``, ``unexplained`` or ``undecided``
    index: int  # explanation that is reported as the fit: of the named set, else of nothing
    # For each named effect, the others (in their best form) that the data cannot separate from it
    ambiguity_groups: tuple[tuple[str, ...], ...]
    left: Remainder  # what that explanation leaves


def unnamed(selection: Selection, problem: Problem) -> Verdict:
    """Return a verdict on the soil alone."""
    nothing = selection.nothing
    return Verdict('unexplained', nothing, (), remainder(selection, nothing, problem))


def choose(
    selection: Selection, problem: Problem, barred: Collection[int] = (), *, off: bool = False
) -> Verdict:
    """Return the verdict on a selection; barred explanations were too doubtful to be named.

    ``off``: unseen rows are off by more than noise and the allowed model error: then a floor is no
    reason to ask a name for higher odds, and nothing agrees.
    """
    joint, unexplained, total = selection.log_joint, selection.unexplained, selection.totals
    nothing = selection.nothing
    alone = unnamed(selection, problem)
    agrees = float(log_sum(joint[nothing][~unexplained]))
    rest = float(log_sum(joint[nothing][unexplained]))
    named = [h for h, e in enumerate(selection.explanations) if e.names]
    effects = float(log_sum(total[named])) if named else -np.inf
    exact = np.array([floor.largest == 0.0 for floor in selection.floors])
    floor_share = 1.0 - np.exp(log_sum(joint[nothing][exact]) - agrees)
    odds = ODDS_OVER_FLOOR if floor_share > SURE_OF_FLOOR and not off else ODDS_TO_SPEAK
    if np.logaddexp(effects, rest) - agrees < np.log(odds):
        agreement = 'undecided' if off else 'agrees'
        return replace(alone, status=agreement) if alone.left.accounted_for else alone
    named = [h for h in named if h not in barred]
    if not named:
        return alone
    best = _best_set(selection, total, named)
    if barred and total[nothing] - total[best] > -np.log(ODDS_TO_SPEAK):
        return alone  # what is left to name is no better
    after = remainder(selection, best, problem)
    if after.significant and _explained(selection, nothing, best) < MOST:
        return alone
    names = selection.explanations[best].names
    ambiguity_groups = tuple(_competitors(selection, total, names, name) for name in names)
    return Verdict('named', best, ambiguity_groups, after)


def _best_set(selection: Selection, weight: FloatArray, named: list[int]) -> int:
    """Return the best form of the best set of effects: the forms of an effect add up."""
    sets: dict[frozenset[str], list[int]] = {}
    for h in named:
        sets.setdefault(selection.explanations[h].effects, []).append(h)
    forms = max(sets.values(), key=lambda mine: float(log_sum(weight[mine])))
    return max(forms, key=lambda h: float(weight[h]))


def _explained(selection: Selection, nothing: int, best: int) -> float:
    """Share of the squared misfit in excess of the noise that a set of effects removes."""
    before = selection.explanations[nothing].fitted.residual
    after = selection.explanations[best].fitted.residual
    excess = max(float(before @ before) - len(before), 1e-9)
    return (float(before @ before) - float(after @ after)) / excess


def _competitors(
    selection: Selection, total: FloatArray, names: tuple[str, ...], name: str
) -> tuple[str, ...]:
    """Return effects that could stand in the place of ``name``, most probable first."""
    others = set(names) - {name}
    places: dict[str, float] = {}
    without = max(
        (e.log_evidence for e in selection.explanations if set(e.names) == others), default=-np.inf
    )
    for h, explanation in enumerate(selection.explanations):
        mine = set(explanation.names)
        if len(mine) == len(names) and others <= mine:
            (own,) = mine - others
            # An explanation no better than without that effect is no competitor.
            if effect_of(own) == effect_of(name) and own != name:
                continue  # another form of the same effect
            if own == name or explanation.log_evidence > without + BETTER_THAN_EMPTY:
                places[own] = float(total[h])
    by_weight = sorted(places, key=lambda key: -places[key])
    # Of a competitor's forms the best one counts.
    best_form = {effect_of(key): key for key in reversed(by_weight)}
    order = [key for key in by_weight if best_form[effect_of(key)] == key]
    logs = np.array([places[key] for key in order]) / TEMPERATURE
    weights = np.exp(logs - log_sum(logs))
    kept: list[str] = []
    mass = 0.0
    for key, weight in zip(order, weights, strict=True):
        if mass >= SET_MASS and name in kept:
            break
        kept.append(key)
        mass += weight
    return tuple(key for key in kept if key != name and key not in names)


# The posterior of an imperfect model family is overconfident: a logistic map, fitted on campaigns
# with other formulas, structural error, outliers, unknown noise and unlisted effects, brings it to
# the frequency with which such names are right.
FEATURES = (
    'one',
    'margin',  # log odds of the name against everything without it
    'margin_of_set',  # the same of the name and its competitors
    'gain',  # log evidence over the soil alone, compressed
    'remainder',  # something is left beyond the floor
    'floor',  # probability of a structural error
    'two',  # two effects or more are named
    'margin_floor',  # a margin counts for less beside a structural error,
    'margin_two',  # and for less in a pair
    'gain_squared',
    'worse',  # a quantity is predicted worse on unseen rows than by the soil alone
    'idle',  # share of the signature in quantities that were never off
    'misfit',  # improbability of the residual,
    'pull',  # largest pull of a soil number beyond what soils usually need
    'strength',  # in deviations of the prior
)

# The odds of a model family that is never quite right, tempered: 1.5 to 2.4 on mixed campaigns.
_TEMPERATURE = 1.5


class Confidence(NamedTuple):
    """Probability that a name is right, and that it or one of its competitors is."""

    of_name: float
    of_set: float


def features(selection: Selection, verdict: Verdict, place: int) -> dict[str, float]:
    """Return the features of the name at ``place`` in the named set."""
    total = selection.totals
    name = selection.explanations[verdict.index].names[place]
    has = np.array([effect_of(name) in e.effects for e in selection.explanations])
    inside = {effect_of(key) for key in (name, *verdict.ambiguity_groups[place])}
    covered = np.array([bool(inside & e.effects) for e in selection.explanations])

    def margin(mine: np.ndarray) -> float:
        """Log odds; beyond some ten nats only the model family's own error counts."""
        against = total[~mine]
        odds = float(log_sum(total[mine]) - log_sum(against)) if against.size else 20.0
        return float(4.0 * np.tanh(odds / 8.0))

    alone = margin(has)
    gain = float(np.log1p(max(total[verdict.index] - total[selection.nothing], 0.0)))
    two = float(len(selection.explanations[verdict.index].names) > 1)
    return {
        'one': 1.0,
        'margin': alone,
        'margin_of_set': margin(covered),
        'gain': gain,
        'remainder': float(verdict.left.significant),
        'floor': verdict.left.probability_of_any,
        'two': two,
        'margin_floor': alone * verdict.left.probability_of_any,
        'margin_two': alone * two,
        'gain_squared': gain**2,
    }


def confidence(values: Mapping[str, float], alike: float = 0.0, odds: float = 1.0) -> Confidence:
    """Map features to probabilities.

    ``odds``: by which something that the map does not know speaks for the names. ``alike``: effects
    that are known to look like the name and were not tried, as a number of equally frequent ones:
    each may be the truth as well, and the set does not have it.
    """
    weights = _weights()
    vector = np.array([values[name] for name in FEATURES])
    of_name = float(expit(vector @ np.array(weights['name']) + np.log(odds)))
    # Never more than the posterior: two names that fit alike share it.
    margin = 8.0 * np.arctanh(np.clip(values['margin'] / 4.0, -0.999, 0.999))  # of the odds
    of_name = min(of_name, float(expit(margin / _TEMPERATURE)))
    of_set = float(expit(vector @ np.array(weights['set']) + np.log(odds)))
    share = 1.0 / (1.0 + alike)
    return Confidence(min(of_name, share), min(max(of_name, of_set), share))


@cache
def _weights() -> dict[str, list[float]]:
    text = files(__package__).joinpath('confidence_map.json').read_text()
    loaded: dict[str, list[float]] = json.loads(text)
    return loaded
