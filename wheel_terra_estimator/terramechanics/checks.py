# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Checks of physical input: every complaint names the quantity, its value and what is allowed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


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

    Parameters
    ----------
    quantity : str
        Name for the message.
    value : array_like
        Any shape; infinite values are always refused, nan unless `allow_nan`.
    lower, upper : float
        Bounds, in `unit`; `open_lower` excludes the lower one.
    """
    array = np.asarray(value, dtype=float)
    good = (array > lower) if open_lower else (array >= lower)
    good &= (array <= upper) & np.isfinite(array)
    if allow_nan:
        good |= np.isnan(array)
    if np.all(good):
        return
    first = np.atleast_1d(array)[~np.atleast_1d(good)][0]
    where = ''
    if array.ndim and array.size > 1:
        where = f' (entry {int(np.flatnonzero(~good.ravel())[0])})'
    unit_text = '' if unit == '-' else f' {unit}'
    bracket = '(' if open_lower or lower == -np.inf else '['
    close = ')' if upper == np.inf else ']'
    raise ValueError(
        f'{quantity} is {first:g}{unit_text}{where}; '
        f'allowed is {bracket}{lower:g}, {upper:g}{close}{unit_text}'
    )
