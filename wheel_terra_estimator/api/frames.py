# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers to and from pandas, which is optional and imported late."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.errors import UserError

if TYPE_CHECKING:
    from pandas import DataFrame

Columns: TypeAlias = dict[str, NDArray[Any]]


def to_frame(columns: Mapping[str, NDArray[Any]]) -> DataFrame:
    """Return columns as a DataFrame.

    Raises
    ------
    UserError
        If pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError:
        raise UserError(
            'pandas is not installed; run pip install pandas, or ask for arrays (as_frame=False)'
        ) from None
    return DataFrame(dict(columns))


def columns_of(table: Any, name: str) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a DataFrame or mapping as arrays of one length.

    Parameters
    ----------
    table : DataFrame or mapping of str to array_like
        The columns.
    name : str
        What messages call it.

    Raises
    ------
    UserError
        For a column that is no list of numbers, or of another length than the others.
    """
    columns: dict[str, NDArray[np.float64]] = {}
    for key in table:
        try:
            column = np.asarray(table[key], dtype=np.float64)
        except (TypeError, ValueError):
            raise UserError(f'{name}: column {key!r} does not hold numbers; convert it') from None
        if column.ndim != 1:
            raise UserError(f'{name}: column {key!r} is not one-dimensional')
        columns[str(key)] = column
    lengths = {len(column) for column in columns.values()}
    if len(lengths) > 1:
        raise UserError(f'{name}: columns are of different lengths {sorted(lengths)}')
    return columns
