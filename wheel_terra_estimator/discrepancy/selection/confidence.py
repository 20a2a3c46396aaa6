# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Calibrated probability of a name: a map from posterior weights to frequencies, fitted on trials.

The posterior of an imperfect model family is overconfident. A logistic map,
fitted on campaigns with other formulas, structural error, outliers, unknown noise and unlisted
effects, brings it to the frequency with which such names are right.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
from scipy.special import expit

from wheel_terra_estimator.discrepancy.fitting.evidence import log_sum
from wheel_terra_estimator.discrepancy.selection.verdict import Verdict
from wheel_terra_estimator.discrepancy.selection.weights import Selection
from wheel_terra_estimator.terramechanics.effects.base import effect_of

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


@dataclass(frozen=True)
class Confidence:
    """Probability that a name is right, and that it or one of its competitors is."""

    of_name: float
    of_set: float

    def times(self, probability: float) -> Confidence:
        """Return both beside something else that may be the truth."""
        return Confidence(self.of_name * probability, self.of_set * probability)


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


def confidence(values: Mapping[str, float], alike: int = 0, odds: float = 1.0) -> Confidence:
    """Map features to probabilities.

    ``odds``: by which something that the map does not know speaks for the names. ``alike``: effects
    that are known to look like the name and were not tried: each may be the truth as well, and the
    set does not have it.
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


@lru_cache(maxsize=1)
def _weights() -> dict[str, list[float]]:
    text = files(__package__).joinpath('confidence_map.json').read_text()
    loaded: dict[str, list[float]] = json.loads(text)
    return loaded
