# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Guo, Ding et al., high-slip contact model: what its public text states, on digitised rows.

The rows are those of ``data/single_wheel.csv`` (third-party digitisation, MIT, 5 to 10 %).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction.statement import Statement
from wheel_terra_lab.studies.model_validation.fitting import FloatArray
from wheel_terra_lab.studies.model_validation.hit_wheels import BASE, read
from wheel_terra_lab.terramechanics.equivalent_contact import equivalent_contact

TITLE = 'Guo, Ding et al., high-slip wheel-terrain contact, Mech. Mach. Theory (public text)'
ROWS = Path(__file__).parent / 'data' / 'single_wheel.csv'
SERIES = {
    'HIT_Wh34_smooth': 'HIT, smooth',
    'HIT_Wh32_lug10': 'HIT, lugs of 10 mm',
    'KLS1_smooth': 'KLS-1, smooth',
    'KLS1_lug10': 'KLS-1, lugs of 10 mm',
}
STATED = (0.05, 0.6)  # slip ratios over which errors below 10 % are stated
ALLOWED = 0.10  # of the pull
LEAST_PULL = 0.1
"""Pull over load below which a relative error says nothing."""
CLASSES = ((0.3, 'low'), (0.6, 'moderate'), (0.9, 'high'))
WHY = (
    'the eleven empirical parameters of their model are not public; ours has none fitted to these '
    'rows'
)
WHY_KLS = f'{WHY}; the torque of this rig holds 1 N m that no contact stress gives (validation)'
ONSET = 0.6


def statements() -> list[Statement]:
    """Return the statements beside ours."""
    return [*_pulls(), *_high_slip()]


def pull_from_torque(points: OperatingPoints, measured: FloatArray) -> FloatArray:
    """Return the pull [N] (N,) from measured sinkage, torque and load; angles as in ``BASE``.

    Nothing is fitted to the rows. Lugs share half of their height in the radius; what they dig
    stays in the sinkage.
    """
    sinkage, _, torque = measured.T
    entrance = np.arccos(1.0 - sinkage / points.wheel.radius)
    leaving = BASE.soil.leaving_angle_ratio * entrance
    rear = points.wheel.radius * (1.0 - np.cos(leaving))
    contact = equivalent_contact(points.wheel, sinkage, rear, BASE.soil.peak_stress_ratio)
    return np.asarray(contact.drawbar_pull(torque, points.normal_load))


def _pulls() -> list[Statement]:
    found = []
    for series, label in SERIES.items():
        points, measured = read(ROWS, series)
        low, high = STATED
        rows = np.isfinite(measured).all(axis=1) & (points.slip >= low) & (points.slip <= high)
        pull = measured[rows, 1]
        error = pull_from_torque(points, measured)[rows] - pull
        told = np.abs(pull) > LEAST_PULL * points.normal_load[rows]
        what = f'{label}: worst error of the pull from torque, slip 0.05 to 0.6'
        if not told.any():
            why = 'no pull above a tenth of the load: a relative error says nothing'
            found.append(Statement('text', what, 'below 10 %', '-', None, why))
            continue
        worst = float(np.max(np.abs(error[told] / pull[told])))
        holds = worst <= ALLOWED
        why = '' if holds else WHY_KLS if series.startswith('KLS') else WHY
        found.append(Statement('text', what, 'below 10 %', f'{100 * worst:.0f} %', holds, why))
    return found


def _high_slip() -> list[Statement]:
    """Return what a mound behind the wheel does, on the shipped soil with the mound's law."""
    shipped = reader.load(['grc3_fit'], complete=False)
    slips = np.array([ONSET, 0.7, 0.8, 0.9])
    wheel = Wheel(0.25, 0.2, 0.01, 24)
    points = OperatingPoints(slips, 150.0, wheel)
    without = {name: v for name, v in shipped.effects.items() if name != 'soil_mound'}
    pulls = [
        WheelSoilModel(shipped.soil, effects, strict=False).steady_state(points)
        for effects in (without, shipped.effects)
    ]
    plain, mound = (state.drawbar_pull for state in pulls)
    rises = bool(mound[-1] > mound[0]) and not plain[-1] - plain[0] > mound[-1] - mound[0]
    told = f'{mound[-1] - mound[0]:+.1f} N with the mound, {plain[-1] - plain[0]:+.1f} N without'
    what = 'pull from slip 0.6 to 0.9'
    found = [Statement('text', what, 'increases; classical models miss it', told, rises)]
    deeper = float(np.degrees(pulls[1].leaving_angle - pulls[0].leaving_angle)[-1])
    what = 'a mound above the free surface moves the leaving angle at slip 0.9 by [deg]'
    found.append(Statement('text', what, 'backwards', f'{deeper:+.0f}', deeper < 0.0))
    # The equivalent contact takes the soil behind the wheel as measured: higher soil, more pull.
    state = pulls[1]
    torque = state.torque[-1]
    values = [
        float(
            equivalent_contact(
                wheel, state.sinkage[-1], share * state.sinkage[-1], 0.5
            ).drawbar_pull(torque, 150.0)
        )
        for share in (0.1, 1.2)
    ]
    what = 'equivalent contact: pull where the soil behind stands at 0.1 and 1.2 of the sinkage'
    ours = f'{values[0]:.0f} N, {values[1]:.0f} N'
    found.append(Statement('equation 13', what, 'more with a mound', ours, values[1] > values[0]))
    edges = ', '.join(f'{name} to {edge:g}' for edge, name in CLASSES)
    why = 'definition, used by ~/slip_class'
    found.append(Statement('text', 'classes of slip', edges, edges, None, why))
    return found
