# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers checked: units that look wrong, signs, dead channels, too few rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, IndexArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.tables.averaging import MINIMUM_ROWS, MOST_ROWS, averaged
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    ONE_OF,
    ORDER_COLUMNS,
    QUANTITIES,
    SteadyTable,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import unit_of

MINIMUM_SLIP_SPAN = 0.1
MINIMUM_LOAD_RATIO = 1.5
SAME_SLIP = 1e-3
FLIPPED = 0.5  # a sign is wrong where the other one halves the misfit of the whole column
CLEAR_SLIP = 0.2  # beyond it a wheel's torque has the sign of its slip
_TIMES_LOAD = {'three': 3.0, 'five': 5.0}  # a sunken flank gives more than a thrust
_NO_FORCE = 2e-3  # share of the load
_NO_LOAD = 0.5  # [N]: no wheel of a test bears less
CLEAR_SLIP_ANGLE = 0.1  # beyond it the lateral force has the sign against it [rad]
LIKE_WHEEL = 1.4  # factor within which a row's wheel may differ from that of the model file


def check_table(
    name: str,
    values: Mapping[str, Iterable[float]],
    lines: Sequence[int] | IndexArray | None = None,
    notes: Sequence[str] = (),
    most: int = MOST_ROWS,
    computed: Sequence[str] = (),
) -> SteadyTable:
    """Check columns of numbers (SI, nan = not measured) and return them as a table.

    The columns in ``computed`` come from this program: their unit is known, so that small values
    are no sign of another one.

    Raises UserError as `read_table` does.
    """
    arrays = {key: np.asarray(value, dtype=float) for key, value in values.items()}
    for key in ('slip', 'normal_load'):
        if key not in arrays:
            raise UserError(f'{name}: no column {key!r}; it is required')
    if not any(quantity in arrays for quantity in ONE_OF):
        raise UserError(
            f'{name}: none of the columns sinkage, drawbar_pull, torque; add at least one'
        )
    count = len(arrays['slip'])
    where = np.arange(2, count + 2) if lines is None else np.asarray(lines, dtype=np.intp)
    remarks = list(notes)
    _check_ranges(name, arrays, where, computed)
    _check_signs(name, arrays, where)
    measured = _columns(arrays, QUANTITIES, count)
    empty = ~np.isfinite(measured[:, : len(ONE_OF)]).any(axis=1)
    if empty.any():
        row = where[empty][0]
        raise UserError(
            f'{name}, line {row}: none of sinkage, drawbar_pull, torque is measured; '
            'fill one in or delete the row'
        )
    stated = _columns(arrays, tuple(f'{q}_std' for q in QUANTITIES), count)
    slip_std = np.nan_to_num(arrays.get('slip_std', np.zeros(count)), nan=0.0)
    inputs = {key: arrays[key] for key in INPUT_COLUMNS if key in arrays}
    # No inputs of the model: a measured angle, and when the rows of a drive were.
    beside = ('leaving_angle', 'time', *ORDER_COLUMNS)
    inputs.update({key: arrays[key] for key in beside if key in arrays})
    angle_std = np.nan_to_num(arrays.get('leaving_angle_std', np.zeros(count)), nan=0.0)
    readings = np.zeros(count, dtype=bool)
    table = SteadyTable(name, where, inputs, measured, stated, slip_std, angle_std, readings)
    table, copies = _without_copies(table)
    if copies:
        remarks.append(
            f'{copies} rows are exact copies of others and were counted once; '
            'a repeated measurement would scatter'
        )
    _check_dead_columns(table, remarks)
    table = _without_held_readings(table, remarks)
    _check_range_of_design(table, remarks)
    if len(table) > most:
        before, table = len(table), averaged(table, most)
        remarks.append(
            f'{before} rows were averaged to {len(table)} over neighbouring inputs; '
            'a line number below is the first of its rows'
        )
    constant = [key for key in inputs if key in INPUT_COLUMNS and key not in table.varying()]
    if constant:
        remarks.append(f'constant in this table: {", ".join(constant)}')
    return replace(table, notes=tuple(remarks))


def _columns(arrays: Mapping[str, FloatArray], names: Sequence[str], count: int) -> FloatArray:
    return np.column_stack([arrays.get(name, np.full(count, np.nan)) for name in names])


_NO_SLIP = 'is outside -1..1; divide percent by 100, and turn i = r w/v - 1 into i/(1 + i)'
_KILONEWTON = 'looks like kN; multiply the column by 1000'
_DEGREES = 'looks like degrees; multiply the column by pi/180'
_MILLIMETRES = 'looks like millimetres; divide the column by 1000'
_NO_LENGTH = 'is not a positive length in m'
_NO_DEVIATION = 'is not positive, or next to nothing; leave it empty where the deviation is unknown'
_FEW = 2  # readings of exactly nought that are no sign of a channel that was off
_HELD_CHANCE = 1e-3  # that so many readings are equal, below which their sensor did not move
_LEAST_DEVIATION = 1e-12  # [m], [N], [N m] or [rad]: below all that is measured

_MOST = math.inf
_LEAST = 5e-324  # above nought
# Columns, in SI: the least and the greatest value that can be, and what one beyond looks like.
_RANGES: tuple[tuple[str, float, float, str], ...] = (
    ('slip', -1.0, 1.0, _NO_SLIP),
    ('normal_load', _LEAST, _MOST, 'is not positive; state the load in N'),
    ('normal_load', _LEAST, 1e7, 'is more than any wheel carries; state the load in N'),
    ('slope', -0.9, 0.9, _DEGREES),
    ('slip_angle', -3.15, 3.15, _DEGREES),
    ('leaving_angle', -1.7, 1.7, _DEGREES),
    ('wheel_radius', -_MOST, 5.0, _MILLIMETRES),
    ('wheel_radius', _LEAST, _MOST, _NO_LENGTH),
    ('wheel_width', -_MOST, 5.0, _MILLIMETRES),
    ('wheel_width', _LEAST, _MOST, _NO_LENGTH),
    ('lug_height', -_MOST, 0.5, _MILLIMETRES),
    ('lug_height', 0.0, _MOST, _NO_LENGTH),
    ('lug_count', 0.0, 1000.0, 'is outside 0..1000'),
    ('gravity', 1e-3, 100.0, 'is outside 0.001..100'),
    ('pass_number', 1.0, 1000.0, 'is outside 1..1000'),
    ('angular_velocity', -60.0, 60.0, 'looks like degrees per second; give rad/s'),
    ('sinkage', -900.0, _MOST, 'looks like a missing-value code; leave the cell empty'),
    ('sinkage', -1.0, 1.0, 'looks like millimetres (or centimetres); give it in m'),
    *((f'{name}_std', _LEAST_DEVIATION, _MOST, _NO_DEVIATION) for name in QUANTITIES),
    ('slip_std', 0.0, _MOST, _NO_DEVIATION),
    ('slip_std', 0.0, 0.5, 'is over 0.5; it looks like percent'),
    ('leaving_angle_std', _LEAST_DEVIATION, _MOST, _NO_DEVIATION),
)


def _refuse(
    name: str,
    lines: IndexArray,
    column: str,
    values: FloatArray,
    bad: BoolArray,
    why: str | Callable[[int], str],
) -> None:
    """Raise where rows are bad: the first of them, its value, and why (of that row)."""
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        shown = 'the number' if np.isnan(values[row]) else f'{values[row]:g}'
        said = why if isinstance(why, str) else why(row)
        raise UserError(f'{name}, line {lines[row]}, column {column}: {shown} {said}')


def _check_ranges(
    name: str, arrays: Mapping[str, FloatArray], lines: IndexArray, computed: Sequence[str]
) -> None:
    """Raise where a value is impossible, with the unit that it looks like."""

    def refuse(bad: BoolArray, column: str, why: str) -> None:
        _refuse(name, lines, column, arrays[column], bad, why)

    if not arrays['slip'].size:
        raise UserError(f'{name}, line 2: no rows below the column names; add one per steady point')
    for column in ('slip', 'normal_load'):
        refuse(np.isnan(arrays[column]), column, 'is missing; every row needs it')
    for column, values in arrays.items():
        refuse(np.isinf(values), column, 'is not finite; leave the cell empty')
    for column, least, greatest, why in _RANGES:
        if column in arrays:
            refuse((arrays[column] < least) | (arrays[column] > greatest), column, why)
    load = arrays['normal_load']
    refuse(np.full(lines.shape, load.max() < _NO_LOAD), 'normal_load', _KILONEWTON)
    if 'wheel_radius' in arrays and 'lug_height' in arrays:
        high = arrays['lug_height'] > arrays['wheel_radius']
        refuse(high, 'lug_height', 'is more than the wheel radius; check both, in m')
    for column, most in (('drawbar_pull', 'three'), ('lateral_force', 'five')):
        if column in arrays:
            force, far = arrays[column], f'is over {most} times the normal load; check both units'
            refuse(abs(force) > _TIMES_LOAD[most] * load, column, f'{far} (N, not kg or kN)')
            measured = np.isfinite(force) & (column not in computed)
            if measured.sum() > 2 and 0.0 < abs(force[measured]).max() < _NO_FORCE * load.max():
                refuse(measured, column, _KILONEWTON)
    for quantity in QUANTITIES:
        if quantity in arrays and f'{quantity}_std' in arrays and quantity not in computed:
            std, values = arrays[f'{quantity}_std'], np.abs(arrays[quantity])
            greatest = values[np.isfinite(values)].max(initial=0.0)
            # A deviation far above its whole column has another unit.
            if np.nanmin(std, initial=np.inf) > 10.0 * greatest > 0.0:
                far = f'is over ten times the largest {quantity}; give both in {unit_of(quantity)}'
                refuse(np.isfinite(std), f'{quantity}_std', far)


def _check_signs(name: str, arrays: Mapping[str, FloatArray], lines: IndexArray) -> None:
    """Raise where torque works against the slip, or where most sinkages are negative."""

    def refuse_most(
        column: str,
        wrong: BoolArray,
        clear: BoolArray,
        why: str | Callable[[int], str],
        least: int = 1,
    ) -> None:
        """Refuse a column whose sign is wrong in most of the clear rows."""
        if wrong.sum() >= least and wrong.sum() > 0.8 * clear.sum():
            _refuse(name, lines, column, arrays[column], wrong, why)

    direction = np.where(arrays.get('angular_velocity', np.ones(len(lines))) < 0.0, -1.0, 1.0)
    if 'torque' in arrays:
        slip, torque = arrays['slip'], direction * arrays['torque']
        pull = direction * arrays.get('drawbar_pull', np.full(len(lines), np.nan))
        clear = (np.abs(slip) > CLEAR_SLIP) & np.isfinite(torque)
        # A driven wheel takes torque; a skidding one may too (friction), but it does not pull.
        wrong = clear & (torque * np.sign(slip) < 0.0) & ((slip > 0.0) | (pull > 0.0))
        refuse_most(
            'torque',
            wrong,
            clear,
            lambda row: (
                f'N m at slip {slip[row]:g} has the wrong sign, as in most rows; torque '
                'that drives the wheel forward and the slip of a driven wheel are positive '
                '(angular_velocity < 0: reverse)'
            ),
            3,
        )
    if 'lateral_force' in arrays and 'slip_angle' in arrays:
        angle, force = arrays['slip_angle'], arrays['lateral_force']
        clear = (np.abs(np.sin(angle)) > CLEAR_SLIP_ANGLE) & np.isfinite(force)
        refuse_most(
            'lateral_force',
            clear & (np.sin(angle) * force > 0.0),
            clear,
            lambda row: (
                f'N at a slip angle of {angle[row]:g} rad has the wrong sign, as in most '
                'rows; both are positive to the left, and the soil pushes against the sliding: '
                'multiply the column by -1'
            ),
            3,
        )
    for column, sign, why in (
        ('leaving_angle', 1.0, 'rad and most others are positive; one behind the hub is negative'),
        (
            'sinkage',
            -1.0,
            'm and most others are negative; sinkage is positive where the rim runs below the '
            'undisturbed surface: multiply the column by -1',
        ),
    ):
        if column in arrays:
            values = sign * arrays[column]
            refuse_most(column, values > 0.0, np.isfinite(values), why)


def _check_dead_columns(table: SteadyTable, remarks: list[str]) -> None:
    """Raise where a reading never changes although the inputs do: a dead channel, or a default."""
    for q, quantity in enumerate(QUANTITIES):
        here = np.isfinite(table.measured[:, q])
        values = table.measured[here, q]
        noughts = np.count_nonzero(values == 0.0)
        if _FEW < noughts < len(values):
            remarks.append(
                f'{quantity} is exactly 0 in {noughts} rows: taken as measured; where nothing '
                'was, leave the cell empty'
            )
        if len(values) < MINIMUM_ROWS or np.ptp(values) > 0.0:
            continue
        said = f'{values[0]:g} {unit_of(quantity)} in all {len(values)} rows'
        if np.isfinite(table.stated_std[here, q]).all():
            remarks.append(f'{quantity} is {said}: taken as measured, with its stated deviation')
            continue
        raise UserError(
            f'{table.name}, line {table.lines[here][0]}, column {quantity}: {said}; no '
            f'measurement is that constant: leave the column out, or state its {quantity}_std'
        )


def _without_held_readings(table: SteadyTable, remarks: list[str]) -> SteadyTable:
    """Leave out readings that are equal in more rows than can be by chance, noughts aside.

    The sensor is at the end of its range, or stands still. That one of the others equals another is
    seen from them, and at least as likely as the smallest step over the range says.
    """
    measured = table.measured.copy()
    for q, quantity in enumerate(QUANTITIES):
        values, counts = np.unique(measured[np.isfinite(measured[:, q]), q], return_counts=True)
        if len(values) < _FEW:
            continue
        step = float(np.diff(values).min()) / (values[-1] - values[0])
        pairs, total = counts * (counts - 1), int(counts.sum())
        for value, count in zip(values.tolist(), counts.tolist(), strict=True):
            others = max(total - count, 2)
            equal = (pairs.sum() - count * (count - 1)) / (others * (others - 1))
            chance = math.comb(total, count) * max(equal, step) ** (count - 1)
            if value != 0.0 and count > _FEW and chance < _HELD_CHANCE:
                measured[measured[:, q] == value, q] = np.nan
                remarks.append(
                    f'{quantity} is exactly {value:g} {unit_of(quantity)} in {count} rows: taken '
                    'for a sensor at the end of its range, or one that stood still, and left out'
                )
    return replace(table, measured=measured).select(np.isfinite(measured).any(axis=1))


def check_wheel_of_model(table: SteadyTable, configuration: Configuration) -> None:
    """Raise where the table names another wheel than the model file does."""
    for column in ('wheel_radius', 'wheel_width'):
        key = column.removeprefix('wheel_')
        stated = getattr(configuration.wheels, key)
        if column not in table.columns or f'wheels.{key}' not in configuration.stated:
            continue
        values = table.columns[column]
        ratio = np.abs(np.log(values[:, None] / np.asarray(stated, dtype=float)[None, :]))
        if not (ratio < np.log(LIKE_WHEEL)).any():
            other = (
                f'm, but the model file states {stated[0]:g} m (wheels.{key}); give the --config '
                'of this wheel, or correct the column'
            )
            _refuse(table.name, table.lines, column, values, np.isfinite(values), other)


def check_against_wheel(table: SteadyTable, radius: FloatArray) -> None:
    """Raise where a row cannot belong to the wheel: sinkage or torque out of proportion."""
    sinkage, torque = table.measured[:, 0], table.measured[:, 2]

    def too_deep(row: int) -> str:
        remedy = 'check the unit, and that --config states the wheel of the table'
        if abs(np.nanmedian(sinkage)) > np.median(radius):
            remedy = 'it looks like millimetres, divide the column by 1000'
        return f'm is deeper than the wheel radius {radius[row]:g} m; {remedy}'

    _refuse(table.name, table.lines, 'sinkage', sinkage, abs(sinkage) > radius, too_deep)
    strong = abs(torque) > 5.0 * table.columns['normal_load'] * radius
    why = 'N m is over five times load times radius; check its unit (N m), and that --config states'
    _refuse(table.name, table.lines, 'torque', torque, strong, f'{why} the wheel of the table')


def check_pull_against_model(table: SteadyTable, predicted: FloatArray) -> None:
    """Raise where the pulls have the other sign than any soil near the configured one gives.

    ``predicted`` are the (N,) pulls of the configured model [N].
    """
    measured = table.measured[:, 1]
    here = np.isfinite(measured) & np.isfinite(predicted)
    pull, model = measured[here], predicted[here]
    if pull.size < MINIMUM_ROWS or min(np.ptp(pull), np.ptp(model)) == 0.0:
        return
    as_it_is, flipped = np.sum((pull - model) ** 2), np.sum((pull + model) ** 2)
    if np.corrcoef(pull, model)[0, 1] < -FLIPPED and flipped < FLIPPED**2 * as_it_is:
        row = int(np.flatnonzero(here)[np.argmax(np.abs(pull))])
        raise UserError(
            f'{table.name}, line {table.lines[row]}, column drawbar_pull: {measured[row]:g} N at '
            f'slip {table.columns["slip"][row]:g}, as in most rows of the other sign than the '
            'model gives; a pull of the wheel forward is positive: multiply the column by -1'
        )


def _without_copies(table: SteadyTable) -> tuple[SteadyTable, int]:
    """Drop rows in which every number equals that of an earlier row."""
    everything = np.column_stack(
        [*table.columns.values(), table.measured, table.stated_std, table.slip_std]
    )
    whole = np.ascontiguousarray(everything).view(f'V{everything.shape[1] * 8}')
    _, first = np.unique(whole, return_index=True)
    return table.select(np.sort(first)), len(everything) - len(first)


def _check_range_of_design(table: SteadyTable, remarks: list[str]) -> None:
    """Raise where the rows are too few or too alike for a diagnosis.

    A drive (its slip is uncertain) cannot choose its slips, and may still show a wrong radius.
    """
    if len(table) < MINIMUM_ROWS:
        rows = 'one row' if len(table) == 1 else f'{len(table)} different rows'
        raise UserError(
            f'{table.name}: {rows}; at least {MINIMUM_ROWS} are needed, best '
            '8 slips from 0.05 to 0.8 at 2 loads'
        )
    slip, load = table.columns['slip'], table.columns['normal_load']
    span, ratio = np.ptp(slip), load.max() / load.min()
    if span < SAME_SLIP and not (table.slip_std > 0).any():
        raise UserError(
            f'{table.name}: slip is {slip[0]:.3g} in every row; nothing can be told from a single '
            'slip: add rows at other slips, best from 0.05 to 0.8'
        )
    if span < MINIMUM_SLIP_SPAN and ratio < MINIMUM_LOAD_RATIO:
        if (table.slip_std > 0).all():
            remarks.append(
                f'narrow: slip only from {slip.min():.3g} to {slip.max():.3g} at one load; little '
                'but a wrong radius can be told from it'
            )
            return
        raise UserError(
            f'{table.name}: slip only from {slip.min():.3g} to {slip.max():.3g} and load only from '
            f'{load.min():.3g} to {load.max():.3g} N: too narrow to tell anything; add rows with '
            f'slip between {max(0.02, slip.min() - 0.3):.2g} and {min(0.8, slip.max() + 0.4):.2g}'
        )
    if span < MINIMUM_SLIP_SPAN:
        remarks.append(
            f'slip only from {slip.min():.3g} to {slip.max():.3g}: what grows with slip is hardly '
            'seen; rows with a slip up to 0.6 would show it'
        )
