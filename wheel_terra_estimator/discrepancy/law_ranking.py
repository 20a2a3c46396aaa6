# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rival contact laws on one table: evidence, error of the fit, error on what was held out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.special import gammaln

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.readings import Readings
from wheel_terra_estimator.discrepancy.fitting.coordinates import Coordinate
from wheel_terra_estimator.discrepancy.numbers import SHOWN
from wheel_terra_estimator.discrepancy.result import Diagnosis, OtherLaw
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable
from wheel_terra_estimator.discrepancy.workflow import nuisance_coordinates, operating_points
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.contact_law import LAWS, RESISTIVE_FORCE, contact_law
from wheel_terra_estimator.terramechanics.effects import by_variant, catalogue
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

Rows = BoolArray

STRAIGHT = 0.02  # slip angle below which a row counts as without [rad]
# Prior of the misfit: as if one cell beside those of the table were off by this share of the range.
USUAL_MISFIT = 0.05
_SCALE_DEVIATION = np.log(3.0)  # of the resistive scale, known from the soil's plate test alone
_LOAD_GROUPS = 3  # by load, where the greatest is more than `_LOADS_DIFFER` times the least
_LOADS_DIFFER = 1.2
_FEWEST_ROWS = 4
_ROUNDS = 6  # of fit and misfit in turn; the misfit settles to some per cent in three


@dataclass(frozen=True)
class RankedLaw:
    """What a table says of a law."""

    name: str  # one of ``contact_law.LAWS``
    free: int  # parameters that were fitted
    log_evidence: float  # natural logarithm, with all rows [-]
    # Quantity -> root mean square error on the rows of the fit, on loads and on wheels that the
    # fit had not seen [m, N, N m]; empty where the table has only one
    fitted: dict[str, float]
    by_load: dict[str, float]
    by_wheel: dict[str, float]
    values: dict[str, float]  # fitted parameter -> value [its unit]


def rank_laws(table: SteadyTable, configuration: Configuration) -> list[RankedLaw]:
    """Fit every law to a table and rank them by evidence, the best first.

    Soil and stated effects are free as ``diagnose`` has them; the scale of resistive force theory
    is free around that of the soil's plate. The misfit of each quantity is unknown and integrated
    out; rows count as independent. Raises UserError if fewer than four rows are without slip angle,
    or the wheel is stated nowhere.
    """
    table = _straight(table)
    if len(table) < _FEWEST_ROWS:
        raise UserError(
            f'{table.name}: {len(table)} rows without slip angle; the laws are compared on '
            f'{_FEWEST_ROWS} or more'
        )
    fits = [_Fit(name, table, configuration) for name in LAWS]
    return sorted((fit.ranked() for fit in fits), key=lambda law: -law.log_evidence)


def _straight(table: SteadyTable) -> SteadyTable:
    """Return the rows without slip angle."""
    aside = np.nan_to_num(table.columns.get('slip_angle', np.zeros(len(table))))
    table = table.select(np.abs(aside) <= STRAIGHT)
    columns = {k: v for k, v in table.columns.items() if k != 'slip_angle'}
    return replace(table, columns=columns)


def with_other_laws(diagnosis: Diagnosis) -> Diagnosis:
    """Return a diagnosis that says what each other law leaves of its table, no effect added.

    Nothing where the model agrees, or fewer than four rows are without slip angle.
    """
    table = _straight(diagnosis.table)
    if diagnosis.verdict == 'agrees' or len(table) < _FEWEST_ROWS:
        return diagnosis
    everything = np.ones(len(table), bool)
    evidence, misfit = {}, {}
    for law in LAWS:
        fit = _Fit(law, table, diagnosis.configuration)
        u, jacobian, size = fit.fit(everything)
        evidence[law] = fit.log_evidence(u, jacobian, size)
        left = (fit.measured - fit.outputs(u)) / fit.usual
        misfit[law] = float(np.sqrt(np.nanmean(left**2)))
    own = LAWS[0]
    found = {
        law: OtherLaw(evidence[law] - evidence[own], misfit[law] / max(misfit[own], 1e-12))
        for law in LAWS[1:]
    }
    return replace(diagnosis, contact_laws=found)


class _Fit:
    """One law and the cells of a table."""

    def __init__(self, name: str, table: SteadyTable, configuration: Configuration) -> None:
        self.name = name
        self.configuration = configuration
        self.points = operating_points(table.columns, configuration, table.name)
        self.readings = Readings.of(configuration).true_on(table.true_rows)
        self.measured = table.measured[:, : len(OUTPUTS)]
        spread = [np.ptp(v[np.isfinite(v)]) if np.isfinite(v).any() else 0 for v in self.measured.T]
        self.usual = USUAL_MISFIT * np.where(np.array(spread) > 0.0, spread, 1.0)
        self.width = float(np.median(self.points.wheel.width))
        soil = nuisance_coordinates(configuration, catalogue())
        self.coordinates = (
            (Coordinate('law', 'scale', 0.0, _SCALE_DEVIATION, logarithmic=True),)
            if name == RESISTIVE_FORCE
            else soil
        )

    def outputs(self, u: FloatArray) -> FloatArray:
        """Return (N, 3) readings of the law at the coordinates."""
        soil = self.configuration.soil
        effects: dict[str, dict[str, Any]] = by_variant(self.configuration.effects)
        values = {c.key: float(c.value(x)) for c, x in zip(self.coordinates, u, strict=True)}
        factor = values.get('soil.stiffness', 1.0) * values.get('law.scale', 1.0)
        changes: dict[str, Any] = {
            'cohesive_modulus': soil.cohesive_modulus * factor,
            'frictional_modulus': soil.frictional_modulus * factor,
        }
        for c in self.coordinates:
            if c.name == 'tan_friction':
                changes['friction_angle'] = float(np.arctan(values[c.key]))
            elif c.owner in effects:
                effects[c.owner][c.name] = values[c.key]
            elif c.owner == 'soil' and c.name != 'stiffness':
                changes[c.name] = values[c.key]
        law = contact_law(self.name, replace(soil, **changes), effects, self.width, strict=False)
        return self.readings.read(law.steady_state(self.points).outputs())

    def ranked(self) -> RankedLaw:
        """Return the law's evidence and errors."""
        everything = np.ones(len(self.points), bool)
        u, jacobian, misfit = self.fit(everything)
        found = self.errors(lambda _: u, [everything])
        load = np.asarray(self.points.normal_load)
        loads = np.array_split(np.argsort(load, kind='stable'), _LOAD_GROUPS)
        by_load = [np.isin(np.arange(load.size), group) for group in loads]
        if load.max() <= _LOADS_DIFFER * load.min() or len(load) < 2 * _FEWEST_ROWS:
            by_load = []
        return RankedLaw(
            self.name,
            len(u),
            self.log_evidence(u, jacobian, misfit),
            found,
            self.errors(lambda rows: self.fit(~rows)[0], by_load),
            self.errors(lambda rows: self.fit(~rows)[0], _wheels(self.points)),
            {c.key: float(c.value(x)) for c, x in zip(self.coordinates, u, strict=True)},
        )

    def errors(self, fit: Callable[[Rows], FloatArray], groups: list[Rows]) -> dict[str, float]:
        """Return quantity -> rms error over groups of rows, each with its own fit."""
        if not groups:
            return {}
        left = np.full_like(self.measured, np.nan)
        for rows in groups:
            left[rows] = (self.measured - self.outputs(fit(rows)))[rows]
        return {
            quantity: float(np.sqrt(np.nanmean(left[:, q] ** 2)))
            for q, quantity in enumerate(OUTPUTS)
            if np.isfinite(left[:, q]).any()
        }

    def fit(self, rows: Rows) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return coordinates, derivatives of the weighed cells by them, and the misfits (3,)."""
        u = np.zeros(len(self.coordinates))
        known = np.isfinite(self.measured) & rows[:, None]
        lower = np.array([c.lower for c in self.coordinates])
        upper = np.array([c.upper for c in self.coordinates])
        misfit, jacobian = 2.0 * self.usual, np.zeros((0, len(u)))
        for _ in range(_ROUNDS):
            size = misfit

            def residual(at: FloatArray, size: FloatArray = size) -> FloatArray:
                return np.concatenate([((self.outputs(at) - self.measured) / size)[known], at])

            answer = least_squares(residual, u, bounds=(lower, upper), diff_step=1e-4, max_nfev=12)
            u, jacobian = answer.x, answer.jac[: -len(u)]
            left = np.where(known, self.outputs(u) - self.measured, 0.0)
            misfit = np.sqrt((self.usual**2 + (left**2).sum(axis=0)) / (1.0 + known.sum(axis=0)))
        return u, jacobian, misfit

    def log_evidence(self, u: FloatArray, jacobian: FloatArray, misfit: FloatArray) -> float:
        """Laplace's method; each quantity's misfit is integrated out (Student's t of all cells)."""
        count = np.isfinite(self.measured).sum(axis=0)
        square = (1.0 + count) * misfit**2  # of the prior's cell and the others
        cells = gammaln(0.5 * (1.0 + count)) - gammaln(0.5) - 0.5 * count * np.log(np.pi)
        cells += 0.5 * np.log(self.usual**2) - 0.5 * (1.0 + count) * np.log(square)
        information = jacobian.T @ jacobian + np.eye(len(u))
        volume = 0.5 * np.linalg.slogdet(information)[1]
        return float(cells[count > 0].sum() - 0.5 * u @ u - volume)


def _wheels(points: OperatingPoints) -> list[Rows]:
    """Return the rows of each wheel; none if there is only one."""
    wheel = points.wheel
    names = ('radius', 'width', 'lug_height', 'lug_count')
    columns = [np.broadcast_to(getattr(wheel, name), (len(points),)) for name in names]
    keys, group = np.unique(np.round(np.column_stack(columns), 6), axis=0, return_inverse=True)
    return [np.ravel(group) == k for k in range(len(keys))] if len(keys) > 1 else []


def as_text(laws: list[RankedLaw]) -> str:
    """Return the ranking as a Markdown table."""

    def cells(errors: dict[str, float]) -> str:
        parts = (f'{SHOWN[q][0] * v:.2f} {SHOWN[q][1]}' for q, v in errors.items())
        return ', '.join(parts) or '-'

    lines = [
        '| law | free | ln evidence | error of the fit | on loads held out | on wheels held out |',
        '|---|---|---|---|---|---|',
    ]
    for law in laws:
        errors = ' | '.join(cells(e) for e in (law.fitted, law.by_load, law.by_wheel))
        behind = law.log_evidence - laws[0].log_evidence
        lines.append(f'| {law.name} | {law.free} | {behind:.1f} | {errors} |')
    return '\n'.join(lines)
