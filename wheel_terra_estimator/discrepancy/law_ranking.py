# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rival contact laws on one table: what each leaves of it, and its evidence."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.special import gammaln

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.readings import Readings
from wheel_terra_estimator.discrepancy.fitting.coordinates import Coordinate
from wheel_terra_estimator.discrepancy.result import Diagnosis, OtherLaw
from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable
from wheel_terra_estimator.discrepancy.workflow import nuisance_coordinates, operating_points
from wheel_terra_estimator.terramechanics.contact_law import LAWS, RESISTIVE_FORCE, contact_law
from wheel_terra_estimator.terramechanics.effects import by_variant, catalogue
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS

STRAIGHT = 0.02  # slip angle below which a row counts as without [rad]
# Prior of the misfit: as if one cell beside those of the table were off by this share of the range.
USUAL_MISFIT = 0.05
_SCALE_DEVIATION = np.log(3.0)  # of the resistive scale, known from the soil's plate test alone
_FEWEST_ROWS = 4
_ROUNDS = 6  # of fit and misfit in turn; the misfit settles to some per cent in three


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
    evidence, misfit = {}, {}
    for law in LAWS:
        fit = _Fit(law, table, diagnosis.configuration)
        u, jacobian, size = fit.fit()
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

    def fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return coordinates, derivatives of the weighed cells by them, and the misfits (3,)."""
        u = np.zeros(len(self.coordinates))
        known = np.isfinite(self.measured)
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
