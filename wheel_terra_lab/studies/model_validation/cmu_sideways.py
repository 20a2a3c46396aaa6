# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""CMU smooth wheel sliding sideways: fitted at 0 and 30 degrees, predicted at the others."""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_lab.studies.model_validation.cmu_wheel import WHEEL, plates
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Free, Model

FITTED = (0, 30)  # slip angles whose rows are fitted [deg]
SIGMA = (0.002, 1.0, 1.0)  # weights: sinkage [m], pull, lateral force [N]
PRIOR_WEIGHT = 0.3
DENSITY = 1330.0  # stated by the authors [kg/m^3]
LEAST_RIM_SPEED = 1e-5  # stands for that of a locked wheel [m/s]
FLANKS = ('ishigami', 'plate')
FREE = (
    Free('soil.friction_angle', 0.55, 0.1, 0.2, 0.9),
    Free('soil.shear_modulus', 0.01, 0.006, 0.001, 0.04),
    Free('soil.cohesion', 100.0, 200.0, 0.0, 1500.0),
    Free('soil.peak_stress_ratio', 0.4, 0.1, 0.1, 0.9),
    Free('soil.leaving_angle_ratio', -0.3, 0.2, -0.99, -0.001),
    Free('effects.slip_sinkage_exponent.n1', 0.3, 0.4, 0.0, 2.0),
    Free('effects.slip_sinkage_exponent.n2', 0.0, 0.5, -1.0, 2.0),
    Free('effects.slip_sinkage_exponent.side', 0.5, 0.5, 0.0, 0.98),
    Free('effects.stress_peak_shift.c2', 0.1, 0.2, -0.3, 0.5),
    Free('effects.side_bulldozing.ks', 1.0, 0.5, 0.0, 5.0),
    Free('effects.bulldozing.kb', 0.5, 0.5, 0.0, 5.0),
)


@dataclass(frozen=True)
class Rows:
    """Steady rows: what was set, (N,), and measured, (N, 3) sinkage, pull, lateral force."""

    slip_angle: NDArray[np.int_]  # [deg]
    speed: FloatArray  # of the hub [m/s]
    rim_speed: FloatArray  # [m/s]
    load: FloatArray  # [N]
    measured: FloatArray

    @classmethod
    def read(cls, path: Path) -> Rows:
        """Read ``steady_state.csv``, whose wheel slides right: the lateral force is positive."""
        with path.open(encoding='utf-8') as stream:
            rows = list(csv.DictReader(stream))

        def column(name: str) -> FloatArray:
            return np.array([float(row[name]) for row in rows])

        forces = column('drawbar_pull_N'), column('lateral_force_N')
        return cls(
            column('beta_cmd_deg').astype(int),
            1e-3 * column('vx_mm_s'),
            1e-3 * column('wheel_rim_speed_mm_s'),
            column('vertical_load_N'),
            np.stack([1e-3 * column('sinkage_mm'), *forces], axis=1),
        )

    def points(self) -> OperatingPoints:
        """Return the rows as points."""
        angle = np.radians(self.slip_angle)
        along, aside = self.speed * np.cos(angle), -self.speed * np.sin(angle)
        rim = np.maximum(self.rim_speed, LEAST_RIM_SPEED)
        slip = np.where(along <= rim, 1.0 - along / rim, rim / np.maximum(along, rim) - 1.0)
        # At 90 degrees the slip ratio says nothing: the law takes the two speeds.
        return OperatingPoints(
            slip,
            self.load,
            WHEEL,
            slip_radius='rim',
            slip_angle=np.arctan2(aside, along),
            lateral_speed_ratio=aside / rim,
        )


def predict(model: Model, flank: str, rows: Rows) -> FloatArray:
    """Return (N, 3) sinkage, pull, lateral force."""
    side = {**model.effects['side_bulldozing'], 'form': flank}
    effects = {**model.effects, 'side_bulldozing': side}
    state = WheelSoilModel(model.soil, effects).steady_state(rows.points())
    return np.stack([state.sinkage, state.drawbar_pull, state.lateral_force], axis=1)


def fit(soil: Soil, flank: str, rows: Rows) -> tuple[Model, dict[str, float]]:
    """Fit the free numbers to the rows at the slip angles ``FITTED``."""
    chosen = np.isin(rows.slip_angle, FITTED)
    columns = {name: getattr(rows, name)[chosen] for name in vars(rows)}
    part, base = Rows(**columns), Model(replace(soil, density=DENSITY), {})
    expected, scale, lower, upper = np.array(
        [(f.expected, f.scale, f.lower, f.upper) for f in FREE]
    ).T

    def model(x: FloatArray) -> Model:
        return base.with_values({f.name: v for f, v in zip(FREE, x.tolist(), strict=True)})

    def residual(x: FloatArray) -> FloatArray:
        error = (predict(model(x), flank, part) - part.measured) / np.asarray(SIGMA)
        return np.concatenate([error.ravel(), PRIOR_WEIGHT * (x - expected) / scale])

    found = least_squares(
        residual, expected, bounds=(lower, upper), x_scale=scale, loss='soft_l1', max_nfev=60
    )
    values = {f.name: float(v) for f, v in zip(FREE, found.x, strict=True)}
    return model(found.x), values


def section(shared: Path, figures: Path) -> str:
    """Return the section; it has no picture."""
    folder = shared / 'measured' / 'cmu_single_wheel'
    rows = Rows.read(folder / 'steady_state.csv')
    soil, _, _ = plates(folder / 'pressure_sinkage.csv')
    found, texts = {}, []
    for flank in FLANKS:
        model, values = fit(soil, flank, rows)
        found[flank] = predict(model, flank, rows)
        texts.append(f'{flank}: ' + ', '.join(f'{k} = {v:.4g}' for k, v in values.items()))
    lines = [
        '## CMU smooth wheel sliding sideways',
        '',
        'Root mean square errors: sinkage [mm] / pull [N] / lateral force [N].',
        '',
        '| slip angle [deg] | rows | ' + ' | '.join(found) + ' |',
        '|---|---|' + '---|' * len(found),
    ]
    for angle in np.unique(rows.slip_angle):
        at = rows.slip_angle == angle
        cells = []
        for values_of in found.values():
            error = (values_of - rows.measured)[at]
            rms = np.sqrt(np.mean(error**2, axis=0)) * (1e3, 1.0, 1.0)
            cells.append(' / '.join(f'{value:.1f}' for value in rms))
        lines.append(f'| {angle} | {at.sum()} | ' + ' | '.join(cells) + ' |')
    return '\n'.join([*lines, '', *texts])
