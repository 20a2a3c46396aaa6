# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What of each effect these rows could show: its signature beyond what the soil can imitate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    Coordinate,
    bounds,
    effect_coordinates,
)
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem, over_covariance
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.terramechanics.effects.base import Effect

LARGE = 4.0  # prior deviations: no effect is expected to be larger
SEEN = 2.0  # d' from which an effect counts as visible
HUGE = 30.0  # prior deviations, bounds permitting: smaller effects are tried
CLEAR = 5.0  # d' from which it would have been named
_ONSETS = (-1.0, 0.0, 1.0)  # of parameters that only shape an effect, in prior deviations
_DEPTHS = (0.4, 0.65, 0.85)  # of those that are a depth: share of the deepest row


@dataclass(frozen=True)
class Signature:
    """Change of the cells by an effect of a large but plausible size."""

    change: FloatArray  # (m,) whitened and rotated
    # D' of that size beyond the soil: noise and prior deviations that a soil refit would need
    distance: float
    size: float  # the size [unit of the first parameter], from neutral
    greatest: float  # d' of the greatest size that is tried (in proportion)


def against_soil(fitted: Fit, variance: FloatArray, vectors: FloatArray) -> FloatArray:
    """Multiply rotated (m, ...) vectors by the inverse covariance of the cells, soil free.

    The soil's tangent space enters with its prior.
    """
    soil = [i for i, c in enumerate(fitted.coordinates) if c.owner not in fitted.names]
    return over_covariance(vectors, variance, fitted.jacobian[:, soil])


def unavailable(effect: Effect, table: SteadyTable, lug_height: FloatArray) -> str:
    """Return why the columns of the table cannot show the effect; empty if they can."""
    if not effect.touches & set(table.quantities):
        return f'needs {" or ".join(sorted(effect.touches))}, which was not measured'
    varying = set(table.varying())
    for column in effect.needs:
        if column in QUANTITIES:
            if column not in table.quantities:
                return f'needs {column}, which was not measured'
        elif column == 'lug_height':
            if not (lug_height > 0.0).any():
                return 'needs a wheel with lugs'
        elif column not in table.columns:
            return f'needs the column {column}'
        elif column not in varying:
            values = table.columns[column]
            if column in ('slope', 'slip_angle') and np.abs(np.nan_to_num(values)).max() > 0.0:
                continue
            return f'needs a {column} that varies'
    return ''


def signatures(
    forward: Forward, problem: Problem, nothing: Fit, effects: Mapping[str, Effect], deepest: float
) -> dict[str, Signature]:
    """Return the signature of each effect around the soil-only fit.

    Of several shapes (the onset of a mound, the depth of a layer) the most visible one counts.
    """
    trials = [
        (name, own, shape)
        for name, effect in effects.items()
        for own in (effect_coordinates(effect),)
        for shape in shapes(own, deepest, LARGE)
    ]
    if not trials:
        return {}
    state = forward.solve(
        [(*nothing.coordinates, *own) for _, own, _ in trials],
        [np.concatenate([nothing.u, shape]) for _, _, shape in trials],
        np.broadcast_to(nothing.angle, (len(trials), len(nothing.angle))),
        jacobian=False,
    )
    found: dict[str, Signature] = {}
    for index, (name, own, shape) in enumerate(trials):
        change = problem.rotation @ problem.flat(state.outputs[index] - nothing.outputs)
        # How far it is beyond what the soil can imitate.
        far = max(float(change @ against_soil(nothing, nothing.variance, change)), 0.0) ** 0.5
        size = float(own[0].value(shape[0])) - own[0].neutral
        if name not in found or far > found[name].distance:
            limit = max(abs(own[0].lower), abs(own[0].upper))
            used = abs(shape[0] - own[0].coordinate(own[0].neutral))
            greatest = far * max(1.0, min(HUGE, limit) / max(used, 1e-9))
            found[name] = Signature(change, far, size, greatest)
    return found


def shapes(own: tuple[Coordinate, ...], deepest: float, strength: float) -> list[FloatArray]:
    """Return coordinates of an effect: its strength, with a few values of its shape.

    ``deepest``: greatest rim sinkage of the rows [m]; scales parameters that are depths.
    ``strength``: prior deviations of the first parameter from neutral, on the side where it may go;
    an effect whose prior sits away from neutral stands at its prior.
    """
    lower, upper = bounds(own)
    neutral = own[0].coordinate(own[0].neutral)
    first = np.zeros(len(own))
    first[0] = neutral + strength if neutral == 0.0 or strength == 0.0 else 0.0
    if first[0] > upper[0]:
        first[0] = max(lower[0], neutral - strength) if upper[0] <= neutral else upper[0]
    values: Sequence[float] = (0.0,)
    if len(own) > 1:
        second = own[1]
        if second.unit == 'm':
            values = [second.coordinate(share * deepest) for share in _DEPTHS]
        elif second.coordinate(second.neutral) != 0.0:
            values = _ONSETS
    starts = []
    for value in values:
        start = first.copy()
        start[1:2] = value
        starts.append(np.clip(start, lower, upper))
    return starts
