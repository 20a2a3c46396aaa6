# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From posterior weights to a verdict, and to the set of names that stays open.

The thresholds were chosen on campaigns apart from those that score them (docs/diagnose.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from wheel_terra_estimator.discrepancy.selection import Selection

FloatArray = NDArray[np.float64]

# "Something is missing" must beat "nothing is missing" by these odds.
ODDS_TO_SPEAK = 3.0
# Members of the open set: tempered weights are added up to this mass.
SET_MASS = 0.97
TEMPERATURE = 1.5


@dataclass(frozen=True)
class Verdict:
    """What was decided.

    Attributes
    ----------
    word : str
        ``agrees``, ``named`` or ``unexplained``.
    index : int
        Explanation that is reported as the fit: of the named set, else of nothing.
    open_sets : tuple of tuple of str
        For each named effect, the others that the data cannot tell from it.
    probability_something : float
        That anything beyond soil and floor is there.
    """

    word: str
    index: int
    open_sets: tuple[tuple[str, ...], ...]
    probability_something: float


def decide(selection: Selection) -> Verdict:
    """Return the verdict on a selection."""
    joint, unexplained = selection.log_joint, selection.unexplained
    total = np.array([logsumexp(row) for row in joint])
    nothing = next(h for h, e in enumerate(selection.explanations) if not e.names)
    agrees = float(logsumexp(joint[nothing][~unexplained]))
    rest = float(logsumexp(joint[nothing][unexplained]))
    named = [h for h, e in enumerate(selection.explanations) if e.names]
    something = rest
    if named:
        something = float(logsumexp([rest, *total[named]]))
    probability = float(1.0 / (1.0 + np.exp(np.clip(agrees - something, -700, 700))))
    if something - agrees < np.log(ODDS_TO_SPEAK):
        return Verdict('agrees', nothing, (), probability)
    if not named or rest > logsumexp(total[named]):
        return Verdict('unexplained', nothing, (), probability)
    best = max(named, key=lambda h: total[h])
    names = selection.explanations[best].names
    open_sets = tuple(_rivals(selection, total, names, name) for name in names)
    return Verdict('named', best, open_sets, probability)


def _rivals(
    selection: Selection, total: FloatArray, names: tuple[str, ...], name: str
) -> tuple[str, ...]:
    """Return effects that could stand in the place of ``name``, most probable first."""
    others = set(names) - {name}
    places: dict[str, float] = {}
    for h, explanation in enumerate(selection.explanations):
        mine = set(explanation.names)
        if len(mine) == len(names) and others <= mine:
            (own,) = mine - others
            places[own] = float(total[h])
    order = sorted(places, key=lambda key: -places[key])
    logs = np.array([places[key] for key in order]) / TEMPERATURE
    weights = np.exp(logs - logsumexp(logs))
    kept: list[str] = []
    mass = 0.0
    for key, weight in zip(order, weights, strict=True):
        if mass >= SET_MASS and name in kept:
            break
        kept.append(key)
        mass += weight
    return tuple(key for key in kept if key != name and key not in names)
