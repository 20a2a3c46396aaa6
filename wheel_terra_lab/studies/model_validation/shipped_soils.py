# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Print the fitted numbers of config/soils/{hit,kls1,cmu_sand,grc3}_fit.yaml, with deviations.

    python -m wheel_terra_lab.studies.model_validation.shipped_soils ../shared

Fitted to all rows (a wheel that is locked aside), where the validation page fits every second one
of CMU and GRC-3.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_lab.studies.model_validation import cmu_wheel, grc3_wheel, hit_wheels, small_wheels
from wheel_terra_lab.studies.model_validation.fitting import (
    FloatArray,
    Free,
    Model,
    deviations,
    fit,
)

Case = tuple[Model, list[tuple[OperatingPoints, FloatArray]], Sequence[float], Sequence[Free]]


def cmu_sand(shared: Path) -> Case:
    """Return start, rows, weights and free parameters of cmu_sand_fit."""
    soil, points, measured = cmu_wheel.rows(shared)
    turning = points.slip > -0.99
    data = [(cmu_wheel.chosen(points, turning), measured[turning])]
    free = (*cmu_wheel.FREE, cmu_wheel.SKID_PEAK, *cmu_wheel.MOUND)
    return Model(soil, cmu_wheel.EFFECTS), data, cmu_wheel.SIGMA, free


def grc3(shared: Path) -> Case:
    """Return start, rows, weights and free parameters of grc3_fit."""
    slip, pull = grc3_wheel.read(shared)
    points = replace(grc3_wheel.points_at(slip), slip_radius='rim')
    free = (*grc3_wheel.SOIL, *grc3_wheel.MOUND)
    return grc3_wheel.BASE, [(points, pull)], grc3_wheel.SIGMA, free


def report(
    name: str,
    model: Model,
    data: Sequence[tuple[OperatingPoints, FloatArray]],
    sigma: Sequence[float],
    free: Sequence[Free],
) -> None:
    """Fit and print value and deviation of each parameter, and the misfit of the rows."""
    fitted, values = fit(model, data, sigma, free)
    std = deviations(fitted, data, sigma, free)
    print(name)
    for key, value in values.items():
        angle = np.degrees(1.0) if key.endswith('friction_angle') else 1.0
        print(f'  {key}: {angle * value:.5g} +- {angle * std[key]:.2g}')
    for points, measured in data:
        error = fitted.predict(points) - measured
        print('  rms', np.sqrt(np.nanmean(error**2, axis=0)))


def main() -> None:
    """Fit all four soils."""
    shared = Path(sys.argv[1])
    table = shared / 'reference' / 'measured_single_wheel.csv'
    smooth = hit_wheels.read(table, 'HIT_Wh34_smooth')
    report('hit_fit', hit_wheels.BASE, [smooth], hit_wheels.SIGMA, hit_wheels.SMOOTH_PARAMETERS)
    kls = small_wheels.KLS.with_values({small_wheels.TORQUE.name: small_wheels.TORQUE.expected})
    free_kls = (*small_wheels.BEARING, *small_wheels.KLS_EXTRA, small_wheels.TORQUE)
    rows = [hit_wheels.read(table, 'KLS1_smooth')]
    report('kls1_fit', kls, rows, small_wheels.SIGMA, free_kls)
    report('cmu_sand_fit', *cmu_sand(shared))
    report('grc3_fit', *grc3(shared))


if __name__ == '__main__':
    main()
