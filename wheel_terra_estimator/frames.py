# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers to and from pandas, which is optional and imported late.

Units go with a DataFrame in ``attrs['units']``: column -> unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.errors import UserError

if TYPE_CHECKING:
    from pandas import DataFrame

Columns: TypeAlias = dict[str, NDArray[Any]]

_QUANTITIES = {
    'ns': 'stamp',
    's': 'time',
    'm': 'position rim_travel_left sinkage wheel_radius wheel_width lug_height',
    'm/s': 'forward_velocity lateral_velocity slip_velocity reference_velocity sinkage_rate',
    'm/s^2': 'specific_force gravity',
    'N': 'normal_load drawbar_pull lateral_force pull_margin',
    'N m': 'torque',
    'rad': 'slope heading steering slip_angle entrance_angle peak_stress_angle leaving_angle',
    'rad/s': 'yaw_rate wheel_rate angular_rate angular_velocity rate',
}
SI_UNITS = {name: unit for unit, names in _QUANTITIES.items() for name in names.split()}
"""Quantity (a column's name up to its point, without ``_std``) -> unit; all others are ratios."""


def unit_of(column: str) -> str:
    """Return the SI unit of a column such as ``slip_std.front_left``."""
    return SI_UNITS.get(column.partition('.')[0].removesuffix('_std'), '-')


def units_in(table: Any, name: str, known: Callable[[str], object]) -> Mapping[str, str]:
    """Return column -> unit as a DataFrame carries them; empty where it does not.

    pandas keeps the units of columns that were taken out; a name that neither is a column nor is
    ``known`` as that of one raises UserError, unless its unit is what it would be taken for.
    """
    units: Mapping[str, str] = getattr(table, 'attrs', {}).get('units', {})
    for key, unit in units.items():
        if key not in table and unit != unit_of(key) and not known(key):
            raise UserError(f"{name}: attrs['units'] has {key!r}, which is no column; correct it")
    return units


def to_frame(
    columns: Mapping[str, NDArray[Any]], stamp: IntArray | None = None, zone: Any = None
) -> DataFrame:
    """Return columns as a DataFrame with their units in ``attrs['units']``.

    ``columns``: columns of one length, in SI units. ``stamp``: (N,) ROS time [ns]; becomes the
    index, as dates (UTC; with a time zone, in that). Raises UserError if pandas is not installed.
    """
    try:
        from pandas import DataFrame, DatetimeIndex
    except ImportError:
        raise UserError(
            'pandas is not installed; run pip install pandas, or ask for arrays (as_frame=False)'
        ) from None
    frame = DataFrame(dict(columns))
    if stamp is not None:
        index = DatetimeIndex(stamp.astype('datetime64[ns]'), name='ros_time')
        frame.index = index.tz_localize('UTC').tz_convert(zone) if zone else index
    frame.attrs['units'] = {name: unit_of(name) for name in columns}
    return frame


def arrays_of(table: Any, name: str, dtype: type | None = None) -> dict[str, NDArray[Any]]:
    """Return the columns of a DataFrame or mapping as arrays of one length and one type.

    Raises UserError for a column that is no list, does not hold that type, or is of another length.
    """
    columns: dict[str, NDArray[Any]] = {}
    for key in table:
        try:
            column = columns[key] = np.asarray(table[key], dtype=dtype)
        except (TypeError, ValueError):
            raise UserError(f'{name}: column {key!r} does not hold numbers; convert it') from None
        if column.ndim != 1:
            raise UserError(f'{name}: column {key!r} is not one-dimensional')
    lengths = {len(column) for column in columns.values()}
    if len(lengths) > 1:
        raise UserError(f'{name}: columns are of different lengths {sorted(lengths)}')
    return columns


def dates_of(table: Any) -> IntArray | None:
    """Return the index of a DataFrame as ROS time [ns]; None unless of dates or durations."""
    index = getattr(table, 'index', None)
    kind = getattr(getattr(index, 'dtype', None), 'kind', None)  # dates of a time zone are M, too
    return np.asarray(index, f'{kind}8[ns]').astype(np.int64) if kind in ('m', 'M') else None


def columns_of(table: Any, name: str, known: Callable[[str], object]) -> dict[str, FloatArray]:
    """Return the columns of a DataFrame or mapping as arrays of one length.

    ``table``: the columns, in SI units unless ``attrs['units']`` says otherwise; ``known``: as for
    `units_in`. Raises UserError for a column that is no list of numbers, of another length than the
    others, or in a unit that is not known.
    """
    from wheel_terra_estimator.configuration.column_map import UNITS, factor

    units = units_in(table, name, known)
    columns: dict[str, FloatArray] = {}
    for key, column in arrays_of(table, name, np.float64).items():
        si = unit_of(str(key))
        given = units.get(key, si)
        times = 1.0 if given == si else factor(si, given) if si in UNITS else None
        if times is None:
            raise UserError(f'{name}: column {key!r} is in {given!r} (attrs); give it in {si}')
        columns[str(key)] = times * column
    return columns
