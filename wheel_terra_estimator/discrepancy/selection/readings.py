# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns that hold something else than was taken: another unit, load or rule for the slip.

Each such reading of the rows competes with all effects: where the soil alone then fits, and is far
likelier, a column is asked for and nothing is named.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.column_map import UNITS
from wheel_terra_estimator.discrepancy.fitting.coordinates import Coordinate
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.selection.search import Findings, search
from wheel_terra_estimator.discrepancy.selection.verdict import choose, remainder
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

_CLEARLY = 10.0  # nats by which another reading must explain the rows better than any effect
_LIKELIER = 5.0  # the same, where the rows as they are do not fit the soil
_FLOOR_NEEDED = 0.8  # probability of a structural error from which soil alone does not fit
_FORCES = [times for f in (9.80665, 4.4482216) for times in (f, 1.0 / f)]  # kgf, lbf; or N as these
_LOADS = (0.5, 2.0, *_FORCES)  # of a pair of wheels, or one of it
_LIKE_MODEL = math.log(3.0)  # a reading must come so near to the size that the model gives
_ROUGH = 0.03  # floor beside which readings are ranked [share of the range]
_TRIED = 2  # best of them that are weighed
_LEAST_SKID = 0.02
BY_SPEED, BY_RIM = 'r w/v - 1', '1 - v/(r w)'


@dataclass(frozen=True)
class Reading:
    """What the columns may hold in place of what was taken."""

    said: Mapping[str, float | str]  # column -> factor that it lacks, or what it is
    table: SteadyTable
    points: OperatingPoints
    scale: FloatArray  # (4,) factor on the quantities


def tens_off(
    table: SteadyTable,
    forward: Forward,
    nuisance: tuple[Coordinate, ...],
    effects: Mapping[str, Effect],
    findings: Findings,  # of the rows as they are
    configured: FloatArray,  # (N, 4) values of the configured model
) -> dict[str, float | str]:
    """Return quantity -> power of ten that it lacks, where the rows are then far likelier.

    Only those more than half a decade off the model's size. Where all are, it is no unit.
    """
    found: dict[str, float] = {}
    for q, quantity in enumerate(QUANTITIES):
        here = np.isfinite(table.measured[:, q])
        size, due = (np.sum(np.abs(values[here, q])) for values in (table.measured, configured))
        decades = round(math.log10(due / size)) if size > 0.0 and due > 0.0 else 0
        if decades:
            found[quantity] = 10.0**decades
    if len(found) == len(table.quantities):
        return {}
    said: dict[str, float | str] = {}
    for quantity, times in found.items():
        scaled = _scaled({quantity: times}, table, forward.points)
        other = search(scaled.table, forward, nuisance, effects, findings.setting.floors)
        density = float(np.log(scaled.scale[findings.setting.problem.quantity]).sum())
        if other.selection.best + density > findings.selection.best + _CLEARLY:
            said[quantity] = times
    return said


def misread(
    table: SteadyTable,
    forward: Forward,
    nuisance: tuple[Coordinate, ...],
    effects: Mapping[str, Effect],
    findings: Findings,  # of the rows as they are
    configured: FloatArray,  # (N, 4) values of the configured model
) -> Mapping[str, float | str]:
    """Return columns with the factor that they lack, or what they are; empty where none is clear.

    Soil may go far, where its numbers are wrong as well, unless it fits the rows as they are
    without a floor.
    """
    setting, selection = findings.setting, findings.selection
    as_they_are = remainder(selection, selection.nothing, setting.problem)
    far = as_they_are.probability_of_any > _FLOOR_NEEDED or not (
        as_they_are.only_far or as_they_are.accounted_for
    )
    variance = setting.problem.variance(_ROUGH)
    nothing = setting.fit([()], [findings.nothing.u], findings.nothing.angle, variance)[0]
    count = len(selection.explanations[0].names)
    ranked = []
    for reading in _readings(table, forward.points, configured):
        cells = reading.scale[setting.problem.quantity]
        problem = replace(
            setting.problem,
            wanted=setting.problem.wanted * cells,
            rotation=setting.problem.rotation / cells,
        )
        other = replace(setting, forward=forward.at(reading.points), problem=problem)
        fitted = other.fit([()], [np.zeros(len(nuisance))], None, variance)[0]
        ranked.append((fitted.objective, reading))
    ranked = sorted((r for r in ranked if r[0] < nothing.objective - _LIKELIER), key=lambda r: r[0])
    for _, reading in ranked[:_TRIED]:
        # Density of the same rows in whatever unit.
        density = float(np.log(reading.scale[setting.problem.quantity]).sum())
        for tried in ({}, effects)[: 2 if density or count > 1 else 1]:
            found = search(
                reading.table, forward.at(reading.points), nuisance, tried, setting.floors
            )
            verdict = choose(found.selection, found.setting.problem)
            fits = verdict.status == 'agrees' or (far and verdict.left.only_far)
            if tried:  # effects beside it: fewer than without it, and nothing is left
                names = found.selection.explanations[verdict.index].names
                fits = len(names) + (not density) <= count and not verdict.left.noticeable
            # A biased radius looks like another one where all lugs are alike.
            surely = tried or not far or 'slip' in reading.said
            needed = _CLEARLY if surely else _LIKELIER
            if fits and found.selection.best + density > selection.best + needed:
                return reading.said
    return {}


def _readings(
    table: SteadyTable, points: OperatingPoints, configured: FloatArray
) -> Iterator[Reading]:
    """Yield what the columns may hold."""
    one = np.ones(len(QUANTITIES))
    for times in _LOADS:
        other = replace(points, normal_load=times * points.normal_load)
        yield Reading({'normal_load': times}, table, other, one)
        if times in _FORCES and 'drawbar_pull' in table.quantities:
            said = {'normal_load': times, 'drawbar_pull': times}
            yield _scaled(said, table, other)
    for q, quantity in enumerate(QUANTITIES):
        here = np.isfinite(table.measured[:, q])
        size, due = (np.sum(np.abs(values[here, q])) for values in (table.measured, configured))
        units = UNITS[unit_of(quantity)].values()
        for times in {*units, *(1.0 / f for f in units)} if size > 0.0 < due else ():
            if times != 1.0 and abs(math.log(times * size / due)) < _LIKE_MODEL:
                yield _scaled({quantity: times}, table, points)
    if table.true_rows.any():
        return  # slips of a drive are our own
    slip = table.columns['slip']
    for rule, read in (
        (BY_SPEED, np.where(slip > 0.0, slip / (1.0 + np.abs(slip)), slip)),
        (BY_RIM, np.where(slip < 0.0, slip / (1.0 + np.abs(slip)), slip)),
    ):
        if np.abs(read - slip).max() > _LEAST_SKID**2:
            rows = replace(table, columns={**table.columns, 'slip': read})
            yield Reading({'slip': rule}, rows, replace(points, slip=read), one)
    for radius in {'rim', 'lug_tip'} - {points.slip_radius}:
        if np.max(points.wheel.lug_height) > 0.0:
            yield Reading({'slip': radius}, table, replace(points, slip_radius=radius), one)


def _scaled(said: Mapping[str, float], table: SteadyTable, points: OperatingPoints) -> Reading:
    scale = np.array([said.get(quantity, 1.0) for quantity in QUANTITIES])
    other = replace(table, measured=table.measured * scale, stated_std=table.stated_std * scale)
    return Reading(said, other, points, scale)
