# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Checks of physical input: every complaint names the quantity, its value and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray


def check_range(
    quantity: str,
    value: ArrayLike,
    lower: float = -np.inf,
    upper: float = np.inf,
    unit: str = '-',
    *,
    open_lower: bool = False,
    allow_nan: bool = False,
) -> None:
    """Raise ``ValueError`` unless every element of `value` lies in the allowed range.

    ``value``: any shape; infinite values are always refused, nan unless `allow_nan`. ``lower``,
    ``upper``: bounds, in `unit`; `open_lower` excludes the lower one.
    """
    array = numbers(quantity, value)
    good = (array > lower) if open_lower else (array >= lower)
    good &= (array <= upper) & np.isfinite(array)
    if allow_nan:
        good |= np.isnan(array)
    if np.all(good):
        return
    first = float(np.atleast_1d(array)[~np.atleast_1d(good)][0])
    shown = f'{first:g}'
    if first != float(shown) and lower <= float(shown) <= upper and math.isfinite(first):
        shown = repr(first)  # rounding would hide what is wrong
    where = ''
    if array.ndim and array.size > 1:
        where = f' (entry {int(np.flatnonzero(~good.ravel())[0])})'
    unit_text = '' if unit == '-' else f' {unit}'
    bracket = '(' if open_lower or lower == -np.inf else '['
    close = ')' if upper == np.inf else ']'
    raise ValueError(
        f'{quantity} is {shown}{unit_text}{where}; '
        f'allowed is {bracket}{lower:g}, {upper:g}{close}{unit_text}'
        + _other_unit(first, upper, unit)
    )


def _other_unit(value: float, upper: float, unit: str) -> str:
    """Return the remedy of a number that may be in degrees or per cent."""
    if unit == 'rad' and abs(value) <= 180.0:
        return f'; from degrees: math.radians({value:g})'
    if unit == '-' and upper == 1.0 < abs(value) <= 100.0:
        return f'; from per cent: {value:g} / 100'
    return ''


def numbers(quantity: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as an array of floats; ``ValueError`` names what is none."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f'{quantity} is {value!r}; allowed is a number or an array') from None


def common_length(columns: Mapping[str, ArrayLike]) -> int:
    """Return the length that all columns share; single values fit any.

    Raises ValueError if two lengths differ, or a column has more than one axis; the message names
    them.
    """
    longest = ''
    shapes = {name: np.shape(value) for name, value in columns.items()}
    for name, shape in shapes.items():
        if len(shape) > 1:
            raise ValueError(f'{name} has shape {shape}; allowed is a number or one axis')
        if shape and shape != (1,):
            longest = longest or name
            if shape != shapes[longest]:
                raise ValueError(
                    f'{name} has {shape[0]} entries, {longest} has {shapes[longest][0]}; allowed '
                    'is one number, or the same length for all'
                )
    return shapes[longest][0] if longest else 1
