# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Least-squares fits of the model to measured rows, and how errors are written down."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil

Effects = dict[str, dict[str, float]]


@dataclass(frozen=True)
class Free:
    """A parameter to be fitted: expected value, its uncertainty, allowed range."""

    name: str
    expected: float
    scale: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Model:
    """Soil and effects, changed by parameter name."""

    soil: Soil
    effects: Effects

    def with_values(self, values: Mapping[str, float]) -> Model:
        """Return the model with some parameters set (an effect named there is switched on)."""
        soil, effects = self.soil, {k: dict(v) for k, v in self.effects.items()}
        for name, value in values.items():
            kind, _, rest = name.partition('.')
            if kind == 'soil':
                soil = replace(soil, **{rest: float(value)})
            else:
                effect, parameter = rest.split('.')
                effects.setdefault(effect, {})[parameter] = float(value)
        return Model(soil, effects)

    def predict(self, points: OperatingPoints, method: str = 'quadrature') -> FloatArray:
        """Return (N, 3) sinkage, drawbar pull, torque."""
        model = WheelSoilModel(self.soil, self.effects, method)
        return model.steady_state(points).outputs()


PRIOR_WEIGHT = 0.3  # of an expected value against a row, at the scale of the parameter


def fit(
    model: Model,
    data: Sequence[tuple[OperatingPoints, FloatArray]],  # with what was measured (N, 3), or nan
    sigma: Sequence[float],  # weight of an error in sinkage [m], pull [N], torque [N m]
    free: Sequence[Free],
    prior_weight: float = PRIOR_WEIGHT,
) -> tuple[Model, dict[str, float]]:
    """Fit parameters to rows; a weak pull towards the expected values settles what rows do not."""
    names = [item.name for item in free]
    expected = np.array([item.expected for item in free])
    scale = np.array([item.scale for item in free])

    def residual(x: Any) -> FloatArray:
        trial = model.with_values(dict(zip(names, x, strict=True)))
        parts = [prior_weight * (x - expected) / scale]
        for points, measured in data:
            error = (trial.predict(points) - measured) / np.asarray(sigma)
            parts.append(np.where(np.isnan(error), 0.0, error).ravel())
        return np.concatenate(parts)

    bounds = ([item.lower for item in free], [item.upper for item in free])
    found = least_squares(residual, expected, bounds=bounds, x_scale=scale)
    values = {name: float(value) for name, value in zip(names, found.x, strict=True)}
    return model.with_values(values), values


def rows_of(
    data: tuple[OperatingPoints, FloatArray], chosen: BoolArray
) -> tuple[OperatingPoints, FloatArray]:
    """Return some of the rows."""
    points, measured = data

    def part(of: Any) -> dict[str, Any]:
        values = {item.name: getattr(of, item.name) for item in fields(of)}
        return {name: v[chosen] for name, v in values.items() if np.ndim(v) == 1}

    wheel = replace(points.wheel, **part(points.wheel))
    return replace(points, wheel=wheel, **part(points)), measured[chosen]


def left_out(
    model: Model,
    data: tuple[OperatingPoints, FloatArray],
    sigma: Sequence[float],
    free: Sequence[Free],
) -> FloatArray:
    """Predict each row by a fit to all others: (N, 3)."""
    predicted = np.empty_like(data[1])
    for k in range(len(predicted)):
        one = np.arange(len(predicted)) == k
        fitted, _ = fit(model, [rows_of(data, ~one)], sigma, free)
        predicted[one] = fitted.predict(rows_of(data, one)[0])
    return predicted


def deviations(
    model: Model,
    data: Sequence[tuple[OperatingPoints, FloatArray]],
    sigma: Sequence[float],
    free: Sequence[Free],
) -> dict[str, float]:
    """Return standard deviations of fitted parameters.

    The inverse of the normal matrix of `fit` at its end, expected values included, times the misfit
    per degree of freedom where that exceeds one. What the rows do not settle has a large one.
    """
    rows = []
    misfit = np.concatenate([_errors(model, points, m, sigma) for points, m in data])
    names = [item.name for item in free]
    for item in free:
        name = item.name
        kind, _, rest = name.partition('.')
        source: Any = model.soil if kind == 'soil' else model.effects[rest.split('.')[0]]
        value = getattr(source, rest) if kind == 'soil' else source[rest.split('.')[1]]
        step = 1e-4 * item.scale
        ends = [min(value + step, item.upper), max(value - step, item.lower)]
        pair = [
            np.concatenate(
                [_errors(model.with_values({name: end}), points, m, sigma) for points, m in data]
            )
            for end in ends
        ]
        rows.append((pair[0] - pair[1]) / (ends[0] - ends[1]))
    slopes = np.array(rows)
    freedom = max(int(np.count_nonzero(misfit)) - len(names), 1)
    factor = max(1.0, float(misfit @ misfit) / freedom)
    normal = slopes @ slopes.T / factor
    normal += np.diag([(PRIOR_WEIGHT / item.scale) ** 2 for item in free])
    variance = np.diag(np.linalg.inv(normal))
    return {name: float(np.sqrt(v)) for name, v in zip(names, variance, strict=True)}


def _errors(
    model: Model, points: OperatingPoints, measured: FloatArray, sigma: Sequence[float]
) -> FloatArray:
    """Return the errors of a prediction in shares of their weights; 0 where not measured."""
    error = (model.predict(points) - measured) / np.asarray(sigma)
    return np.where(np.isnan(error), 0.0, error).ravel()


@dataclass(frozen=True)
class Misfit:
    """Errors of a prediction against measured rows."""

    pull_rms: float
    pull_worst: float
    pull_range: float
    sinkage_rms: float
    torque_rms: float

    @classmethod
    def of(cls, predicted: FloatArray, measured: FloatArray) -> Misfit:
        """Compare (N, 3) with (N, 3); nan = not measured."""
        error = predicted - measured
        rms = [
            float(np.sqrt(np.nanmean(e**2))) if np.isfinite(e).any() else np.nan for e in error.T
        ]
        pull = measured[:, 1]
        known = np.isfinite(pull).any()
        return cls(
            rms[1],
            float(np.nanmax(np.abs(error[:, 1]))) if known else np.nan,
            float(np.nanmax(pull) - np.nanmin(pull)) if known else np.nan,
            rms[0],
            rms[2],
        )

    def row(self, label: str) -> str:
        """Return a row of the table that ``HEADER`` starts."""
        cells = [
            f'{self.pull_rms:.2f}',
            f'{100 * self.pull_rms / self.pull_range:.1f} %',
            f'{100 * self.pull_worst / self.pull_range:.1f} %',
            f'{1e3 * self.sinkage_rms:.2f}',
            f'{self.torque_rms:.2f}',
        ]
        return (
            f'| {label} | '
            + ' | '.join(c.replace('nan %', '-').replace('nan', '-') for c in cells)
            + ' |'
        )


HEADER = (
    '| | pull rms [N] | of its range | worst, of its range | sinkage rms [mm] '
    '| torque rms [N m] |\n'
    '|---|---|---|---|---|---|'
)


def listed(values: Mapping[str, float]) -> str:
    """Return fitted values as text, names without their section."""
    return ', '.join(f'{name.split(".", 1)[1]} = {value:.4g}' for name, value in values.items())
