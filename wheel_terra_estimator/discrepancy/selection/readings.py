# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns that hold something else than was taken: another unit, load or rule for the slip.

Each such reading of the rows competes with all effects: where the soil alone then fits, and is far
likelier, a column is asked for and nothing is named.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
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
_LIKELIER = 5.0  # nats by which it must fit better, beside a rough floor, to be weighed
_FLOOR_NEEDED = 0.8  # probability of a structural error from which soil alone does not fit
_LOADS = (0.5, 2.0)  # of a pair of wheels, or one of it
_TOGETHER = (('normal_load', 'drawbar_pull'), ('drawbar_pull', 'torque'))  # of one unit of force
_LIKE_MODEL = math.log(3.0)  # a reading must come so near to the size that the model gives
_NEAR = math.log(2.0)  # a unit so near is a gain as well (``decision``)
_ROUGH = 0.03  # floor beside which readings are ranked [share of the range]
_TRIED = 2  # best of them that are weighed
_LEAST_CHANGE = 4e-4  # of a slip by another rule [-]: that of a slip of 2 %
_SAME, _MOST_ALIKE = 0.03, 0.15  # between two units: a factor of ten, or that of a kilopond
BY_SPEED, BY_RIM = 'r w/v - 1', '1 - v/(r w)'


def units_apart(column: str, times: float, std: float = 0.0, stated: float | None = None) -> str:
    """Return which unit in place of which would be so many times as large; empty: none.

    ``std`` is the deviation of ``times`` over it [-]; ``stated``: of the unit that its title says.
    """
    near = min(max(_SAME, 2.0 * std), _MOST_ALIKE)
    units = UNITS[unit_of(column)]
    pairs = itertools.permutations(units, 2)
    alike = (
        f'{found} in place of {said}'
        for said, found in pairs
        if abs(math.log(units[found] / units[said] / times)) < near
        if units[found] != units[said] and stated in (None, units[said])
    )
    return next(alike, '')


@dataclass(frozen=True)
class Reading:
    """What the columns may hold in place of what was taken."""

    said: Mapping[str, float | str]  # column -> factor that it lacks, or what it is
    table: SteadyTable
    points: OperatingPoints
    scale: FloatArray  # (4,) factor on the quantities


@dataclass(frozen=True)
class Columns:
    """The columns as they were taken, and what explains them so."""

    table: SteadyTable
    forward: Forward
    nuisance: tuple[Coordinate, ...]
    effects: Mapping[str, Effect]
    findings: Findings
    configured: FloatArray  # (N, 4) values of the configured model
    strictly: bool = False  # only what leaves a soil that can be believed

    def asked(self, tens_alone: bool) -> Mapping[str, float | str]:
        """Return what to ask for: other readings, else (or alone) powers of ten."""
        tens = self.tens_off()
        return tens if tens_alone else self.misread() or tens

    def tens_off(self) -> dict[str, float | str]:
        """Return quantity -> power of ten that it lacks, where the rows are then far likelier.

        Only those more than half a decade off the model's size. Where all are, it is no unit.
        """
        decades = {quantity: round(math.log10(due / size)) for quantity, size, due in self._sizes()}
        off = [{quantity: 10.0**power} for quantity, power in decades.items() if power]
        said: dict[str, float | str] = {}
        if len(off) == len(self.table.quantities):
            return said
        tens = (_scaled(lacked, self.table, self.forward.points) for lacked in off)
        for reading in self._likeliest(tens):
            gain = self._explained(reading, self.effects).selection.totals[0]
            if gain + self._density(reading) > self.findings.selection.totals[0] + _CLEARLY:
                said.update(reading.said)
        return said

    def misread(self) -> Mapping[str, float | str]:
        """Return columns with the factor that they lack, or what they are; empty: none is clear.

        Soil may go far, where its numbers are wrong as well, unless it fits the rows as they are
        without a floor.
        """
        setting, selection = self.findings.setting, self.findings.selection
        as_they_are = remainder(selection, selection.nothing, setting.problem)
        far = not self.strictly and (
            as_they_are.probability_of_any > _FLOOR_NEEDED
            or not (as_they_are.only_far or as_they_are.accounted_for)
        )
        count = len(selection.explanations[0].names)
        few = [len(explanation.names) < 2 for explanation in selection.explanations]
        best_single = float(selection.totals[few].max())  # of at most one effect
        for reading in self._likeliest(self._readings())[:_TRIED]:
            density, alone = self._density(reading), -math.inf
            for tried in ({}, self.effects)[: 2 if density or count > 1 else 1]:
                if tried and alone + density < best_single:
                    break  # what is read wrongly says more than any one effect
                found = self._explained(reading, tried)
                alone = found.selection.totals[0]
                verdict = choose(found.selection, found.setting.problem)
                fits = verdict.status == 'agrees' or (far and verdict.left.only_far)
                if tried:  # effects beside it: fewer than without it, and nothing is left
                    names = found.selection.explanations[verdict.index].names
                    fits = len(names) + (not density) <= count and not verdict.left.noticeable
                if fits and alone + density > selection.totals[0] + _CLEARLY:
                    return reading.said
        return {}

    def _likeliest(self, readings: Iterable[Reading]) -> list[Reading]:
        """Return those that soil alone fits best, by one fit each, likeliest first."""
        setting, plain = self.findings.setting, self.findings.nothing
        variance = setting.problem.variance(_ROUGH)
        nothing = setting.refit(plain, variance)
        ranked = []
        for reading in readings:
            cells = reading.scale[setting.problem.quantity]
            problem = replace(
                setting.problem,
                wanted=setting.problem.wanted * cells,
                rotation=setting.problem.rotation / cells,
            )
            forward = replace(self.forward, points=reading.points)
            other = replace(setting, forward=forward, problem=problem)
            fitted = other.fit([()], [np.zeros(len(self.nuisance))], None, variance)[0]
            if fitted.objective < nothing.objective - _LIKELIER:
                ranked.append((fitted.objective, reading))
        return [reading for _, reading in sorted(ranked, key=lambda r: r[0])]

    def _explained(self, reading: Reading, effects: Mapping[str, Effect]) -> Findings:
        forward = replace(self.forward, points=reading.points)
        floors = self.findings.setting.floors
        return search(reading.table, forward, self.nuisance, effects, floors)

    def _density(self, reading: Reading) -> float:
        """Return what the density of the same rows gains in whatever unit [nats]."""
        return float(np.log(reading.scale[self.findings.setting.problem.quantity]).sum())

    def _sizes(self) -> Iterator[tuple[str, float, float]]:
        """Yield each quantity with its size, and that by the configured model."""
        measured = self.table.measured
        for q, quantity in enumerate(QUANTITIES):
            here = np.isfinite(measured[:, q])
            size, due = (
                float(np.sum(np.abs(values[here, q]))) for values in (measured, self.configured)
            )
            if size > 0.0 < due:
                yield quantity, size, due

    def _readings(self) -> Iterator[Reading]:
        """Yield what the columns may hold."""
        table, points, one = self.table, self.forward.points, np.ones(len(QUANTITIES))
        sizes = {quantity: due / size for quantity, size, due in self._sizes()}
        for said in self._lacked():
            load = said.get('normal_load', 1.0)  # forces grow in proportion
            judged = said if load == 1.0 else ('torque',)
            off = (said.get(q, 1.0) / sizes[q] / load for q in judged if q in sizes)
            if all(abs(math.log(times)) < _LIKE_MODEL for times in off):
                yield _scaled(said, table, replace(points, normal_load=load * points.normal_load))
        if table.true_rows.any():
            return  # slips of a drive are our own
        slip = table.columns['slip']
        for rule, read in (
            (BY_SPEED, np.where(slip > 0.0, slip / (1.0 + np.abs(slip)), slip)),
            (BY_RIM, np.where(slip < 0.0, slip / (1.0 + np.abs(slip)), slip)),
        ):
            if np.abs(read - slip).max() > _LEAST_CHANGE:
                rows = replace(table, columns={**table.columns, 'slip': read})
                yield Reading({'slip': rule}, rows, replace(points, slip=read), one)
        for radius in {'rim', 'lug_tip'} - {points.slip_radius}:
            if np.max(points.wheel.lug_height) > 0.0:
                yield Reading({'slip': radius}, table, replace(points, slip_radius=radius), one)

    def _lacked(self) -> Iterator[dict[str, float]]:
        """Yield column -> factor that it lacks, beside the unit that its title says.

        In one column, or in those of one unit of force.
        """
        columns = ('normal_load', *self.table.quantities)
        found = [{c: unit} for c in columns for unit in UNITS[unit_of(c)].values()]
        for name, torque in UNITS['N m'].items():
            force = UNITS['N'].get(name.split()[0])
            if force:
                units = {'normal_load': force, 'drawbar_pull': force, 'torque': torque}
                groups = (*_TOGETHER, tuple(units))
                found += [{c: units[c] for c in one if c in columns} for one in groups]
        said = self.table.units
        lacked = [{c: u / said.get(c, 1.0) for c, u in some.items()} for some in found]
        seen = list[dict[str, float]]()
        for some in (*lacked, *({'normal_load': times} for times in _LOADS)):
            off = {c: times for c, times in some.items() if times != 1.0}
            alone = len(off) == 1 and 'normal_load' not in off
            gain = alone and max(abs(math.log(times)) for times in off.values()) < _NEAR
            if off and off not in seen and not gain:
                seen.append(off)
                yield off


def _scaled(said: Mapping[str, float], table: SteadyTable, points: OperatingPoints) -> Reading:
    scale = np.array([said.get(quantity, 1.0) for quantity in QUANTITIES])
    other = replace(table, measured=table.measured * scale, stated_std=table.stated_std * scale)
    return Reading(said, other, points, scale)
