# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers for people."""

from __future__ import annotations

import math
from collections.abc import Iterable

from wheel_terra_estimator.terramechanics.effects.base import effect_of

# Factor and unit in which quantities are printed.
OF_BEDS = {'stiffness': 'stiffness', 'tan_friction': 'tan phi'}  # that differ between beds
SHOWN = {
    'sinkage': (1e3, 'mm'),
    'drawbar_pull': (1.0, 'N'),
    'torque': (1.0, 'N m'),
    'lateral_force': (1.0, 'N'),
}


def plain(name: str) -> str:
    """Return the name of a quantity, an input or an effect for a reader."""
    return name.replace('_', ' ')


def joined(keys: Iterable[str]) -> str:
    """Return the effects of a set, whatever their forms, in words."""
    return ' + '.join(map(effect_of, keys)) or 'nothing'


def axis_label(quantity: str) -> str:
    """Return the axis label of a quantity: name and unit."""
    return f'{plain(quantity)} [{SHOWN[quantity][1]}]'


def with_unit(text: str, unit: str) -> str:
    """Return a number with its unit; a ratio has none."""
    return text if unit in ('', '-') else f'{text} {unit}'


def number(value: float, digits: int = 3) -> str:
    """Return significant digits, with an exponent for tiny values alone."""
    if not math.isfinite(value):
        return '-'
    if value == 0.0:
        return '0'
    text = f'{value:.{digits}g}'
    if 'e' in text and abs(value) >= 1e-4:
        decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
        text = f'{float(text):.{decimals}f}'
    return text


def amount(quantity: str, value: float | None, digits: int = 3) -> str:
    """Return a value of a quantity as printed, without its unit."""
    return '-' if value is None else number(SHOWN[quantity][0] * value, digits)


def percent(probability: float) -> str:
    """Return a probability; one next to 0 or 1 is not rounded to certainty."""
    if probability > 0.99:
        return 'over 99 %'
    return 'below 1 %' if probability < 0.01 else f'{100.0 * probability:.0f} %'
