# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Text on a proposed law and the limits of its validity."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from wheel_terra_estimator.discrepancy.numbers import SHOWN, amount, number, with_unit
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    QUANTITIES,
    SteadyTable,
)
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import FEATURES, TARGETS, pair_of
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

_TWICE = math.log(2.0)  # from which a growth is stated as a factor
# Feature -> for which step of it a change is stated, and that step.
_PER = {
    'one': ('everywhere alike', 1.0),
    'slip': ('per 0.1 of slip', 0.1),
    'slip_squared': ('with the square of slip, at 1', 1.0),
    'slip_over_02': ('per 0.1 of slip beyond 0.2', 0.1),
    'slip_over_04': ('per 0.1 of slip beyond 0.4', 0.1),
    'slip_over_06': ('per 0.1 of slip beyond 0.6', 0.1),
    'slip_near_02': ('in a band of slip around 0.2', 1.0),
    'slip_near_04': ('in a band of slip around 0.4', 1.0),
    'slip_near_06': ('in a band of slip around 0.6', 1.0),
    'load': ('per doubling of the load', math.log10(2.0)),
    'lug': ('per 0.05 r of lug height', 0.05),
    'width': ('per 0.1 r of width', 0.1),
    'rim_speed': ('per decade of rim speed', 1.0),
    'pass': ('per earlier pass', 1.0),
    'slope': ('per 10 degrees of slope', math.radians(10.0)),
    'depth': ('per 0.01 r of sinkage', 0.01),
    'torque_squared': (
        'with the square of the torque, where T^2 is 0.1 W r times rho g b r^3',
        0.1,
    ),
}


def law_in_words(
    names: Sequence[str], coefficients: Sequence[float], table: SteadyTable, points: OperatingPoints
) -> str:
    """Return the terms in words: "torque grows by 0.1 N m (4 % of its mean) per decade of ..."."""
    parts = []
    for name, value in zip(names, coefficients, strict=True):
        target, feature = pair_of(name)
        law = TARGETS[target]
        per, step = _per(feature)
        change = value * step
        change *= law.bound / (law.bound + abs(change))
        if law.factor and change > _TWICE:
            parts.append(
                f'{law.meaning} grows to {number(math.exp(change), 2)} times as much {per}'
            )
            continue
        if law.factor:
            size = f'{number(100 * abs(math.expm1(change)), 2)} %'
        elif law.unit == '-':
            size = f'{number(abs(change), 2)}'
        else:
            size = _size(target, abs(change), table, points)
        parts.append(f'{law.meaning} {"grows" if change > 0.0 else "falls"} by {size} {per}')
    text = '; '.join(parts)
    return f'{text[0].upper()}{text[1:]}, beyond what the soil explains.'


def _per(feature: str) -> tuple[str, float]:
    """Return for which step of a feature a change is stated, and that step."""
    parts = [_PER[part] for part in FEATURES[feature].factors or (feature,)]
    words = ' times '.join(text.removeprefix('per ') for text, _ in parts)
    return parts[0][0] if len(parts) == 1 else f'per {words}', math.prod(s for _, s in parts)


def _size(target: str, change: float, table: SteadyTable, points: OperatingPoints) -> str:
    """Return a change of an angle or an output in the units of the rows."""
    if target not in QUANTITIES:
        return f'{number(100 * change, 2)} % of the entrance angle'
    rows = slice(len(table))
    load = np.asarray(points.normal_load)[rows]
    radius = np.broadcast_to(points.wheel.radius, (len(points),))[rows]
    scale = {'sinkage': radius, 'drawbar_pull': load, 'torque': load * radius}[target]
    size = change * float(np.mean(scale))
    mean = float(np.nanmean(np.abs(table.measured[:, QUANTITIES.index(target)])))
    shown = f'{amount(target, size, 2)} {SHOWN[target][1]}'
    return f'{shown} ({number(100 * size / mean, 2)} % of its mean)' if mean else shown


def limits_of_trust(table: SteadyTable) -> tuple[str, ...]:
    """Return where the law must not be used: outside the ranges of the rows that it came from."""
    varying = set(table.varying())
    found = []
    for name in INPUT_COLUMNS:
        if name not in varying:
            continue
        values = table.columns[name][np.isfinite(table.columns[name])]
        ends = f'{number(values.min())} to {number(values.max())}'
        found.append(with_unit(f'{name} outside {ends}', unit_of(name)))
    still = [name for name in INPUT_COLUMNS if name in table.columns and name not in varying]
    if still:
        found.append(f'other values of what did not vary: {", ".join(still)}')
    return (*found, 'another soil')
