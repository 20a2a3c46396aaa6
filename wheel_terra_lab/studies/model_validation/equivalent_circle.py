# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull from measured torque and sinkage on the equivalent circle, nothing fitted to the rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.closed_form import decoupled_pull
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Model
from wheel_terra_lab.studies.model_validation.hit_wheels import BASE, read
from wheel_terra_lab.terramechanics.equivalent_contact import equivalent_contact

SERIES = {
    'HIT_Wh34_smooth': 'HIT, smooth',
    'HIT_Wh32_lug10': 'HIT, lugs of 10 mm',
    'KLS1_smooth': 'KLS-1, smooth',
    'KLS1_lug10': 'KLS-1, lugs of 10 mm',
}
STATED = (0.05, 0.6)
"""Slip ratios over which Guo et al. state errors below 10 % for the model of their group."""
LEAST_PULL = 0.1
"""Pull over load below which a relative error says nothing."""


def pull_from_torque(points: OperatingPoints, measured: FloatArray) -> FloatArray:
    """Return the pull [N] (N,) from measured sinkage, torque and load; angles as in ``BASE``.

    Lugs share half of their height in the radius; what they dig stays in the sinkage.
    """
    sinkage, _, torque = measured.T
    entrance = np.arccos(1.0 - sinkage / points.wheel.radius)
    leaving = BASE.soil.leaving_angle_ratio * entrance
    rear = points.wheel.radius * (1.0 - np.cos(leaving))
    contact = equivalent_contact(points.wheel, sinkage, rear, BASE.soil.peak_stress_ratio)
    return np.asarray(contact.drawbar_pull(torque, points.normal_load))


def without_leaving_angle(points: OperatingPoints, measured: FloatArray) -> FloatArray:
    """Return the pull [N] (N,) of the form before: rim radius, t2 = 0, tm = t1/2."""
    sinkage, _, torque = measured.T
    entrance = np.arccos(1.0 - sinkage / points.wheel.radius)
    zero = np.zeros_like(entrance)
    radius = points.wheel.radius
    pull = decoupled_pull(torque, points.normal_load, entrance, 0.5 * entrance, zero, radius)
    return np.asarray(pull)


def soil_tests_alone(points: OperatingPoints) -> FloatArray:
    """Return the pull [N] (N,) of the plain stress model with the soil tests, no effect."""
    return Model(BASE.soil, {}).predict(points)[:, 1]


def section(shared: Path, figures: Path) -> str:
    """Return the section."""
    table = shared / 'reference' / 'measured_single_wheel.csv'
    lines = []
    for series, label in SERIES.items():
        points, measured = read(table, series)
        rows = (
            np.isfinite(measured).all(axis=1)
            & (points.slip >= STATED[0])
            & (points.slip <= STATED[1])
        )
        pull = measured[rows, 1]
        cells = []
        for found in (
            pull_from_torque(points, measured),
            without_leaving_angle(points, measured),
            soil_tests_alone(points),
        ):
            error = found[rows] - pull
            told = np.abs(pull) > LEAST_PULL * points.normal_load[rows]
            worst = np.max(np.abs(error[told] / pull[told]), initial=-np.inf)
            cells += [f'{np.sqrt(np.mean(error**2)):.1f}']
            cells += [f'{100 * worst:.0f} %' if told.any() else '-']
        lines.append(f'| {label} | {rows.sum()} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(
        [
            '## Equivalent circle: pull from measured torque and sinkage',
            '',
            'Guo, Ding et al. state errors of pull below 10 % for slip 0.05 to 0.6 for the earlier '
            'model of their group (fitted, with eleven more parameters), and of some 40 % at slip '
            '0.3 for stresses after Bekker and Janosi without lugs and slip-sinkage. Here nothing '
            'is fitted to the rows: the pull follows from measured torque, sinkage and load on the '
            f'equivalent circle with c1 = {BASE.soil.peak_stress_ratio:g} and '
            f'c3 = {BASE.soil.leaving_angle_ratio:g}; beside it the same algebra on the rim '
            'without a leaving angle, and the plain stress model with the numbers of the soil '
            'tests (HIT; for KLS-1 its soil is another, so that column only says that numbers of '
            'one soil do not serve the next). Worst: error over pull, where the pull exceeds a '
            'tenth of the load.',
            '',
            '| wheel | rows | equivalent circle, rms [N] | worst | rim, no leaving angle, rms [N] '
            '| worst | soil tests alone, rms [N] | worst |',
            '|---|---|---|---|---|---|---|---|',
            *lines,
            '',
            'The lugged HIT wheel meets the 10 %. The smooth one is 15 to 25 % too high above '
            'slip 0.3, and both KLS-1 wheels by ten newtons and more: torque is measured at the '
            'drive, and what the drive itself takes (1 N m, see KLS-1 below) counts as shear '
            'here. A form that lives on torque needs the drive friction first.',
        ]
    )
