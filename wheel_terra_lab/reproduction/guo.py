# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Guo, Ding et al., high-slip contact model: what its public text states, on digitised rows.

The rows are those of ``data/single_wheel.csv`` (third-party digitisation, MIT, 5 to 10 %).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction.ding_curves import SUPPORT
from wheel_terra_lab.reproduction.equivalent_contact import equivalent_contact
from wheel_terra_lab.reproduction.statement import Statement
from wheel_terra_lab.studies.model_validation import hit_wheels
from wheel_terra_lab.studies.model_validation.fitting import Free, Model, fit
from wheel_terra_lab.studies.model_validation.hit_wheels import BASE, read

TITLE = 'Guo, Ding et al., high-slip wheel-terrain contact, Mech. Mach. Theory (public text)'
ROWS = Path(__file__).parent / 'data' / 'single_wheel.csv'
LUGGED = 'HIT_Wh32_lug10'
SERIES = {
    'HIT_Wh34_smooth': 'HIT, smooth',
    LUGGED: 'HIT, lugs of 10 mm',
    'KLS1_smooth': 'KLS-1, smooth',
    'KLS1_lug10': 'KLS-1, lugs of 10 mm',
}
STATED = (0.05, 0.6)  # slip ratios over which errors of their earlier model are below 10 %
ALLOWED = 0.10  # of the pull
USABLE = 'usable (here: 10 %)'
LEAST_PULL = 0.1
"""Pull over load below which a relative error says nothing."""
CLASSES = ((0.3, 'low'), (0.6, 'moderate'), (0.9, 'high'))
ONSET = 0.6
HEIGHTS = (0.005, 0.01, 0.02)  # of lugs, for the mound [m]
ANGLES = {
    'soil.peak_stress_ratio',
    'effects.stress_peak_shift.c2',
    'soil.leaving_angle_ratio',
}
REFUSED = 10.0  # relative error of angles that no contact has
WHY_UNFITTED = {
    'HIT_Wh34_smooth': 'above slip 0.3 the stress moves further forward than the fixed angles',
    'KLS1_lug10': '1 N m and more of its torque comes from no contact stress',
}
WHY_FITTED = {
    'HIT_Wh34_smooth': 'its peak moves forward up to slip 0.3 and back at 0.6; '
    'digitised to 1 N, 7 to 9 %',
    'KLS1_lug10': 'the measured pull falls from 12.7 to 6.4 N between slip 0.4 and 0.5',
}
WHY_PRINTED = (
    'they let the soil shear within itself at every slip; the measured gain over the smooth rim '
    'grows with slip'
)
SIGMA = (0.0015, 0.5, 0.3)  # weights of sinkage [m], pull [N], torque [N m]: the pull first
PRIOR = 0.1  # weight of expected values


def statements() -> list[Statement]:
    """Return the statements beside ours."""
    return [*_models(), *_pulls(), *_high_slip(), *_definitions()]


def _judged(points: OperatingPoints, measured: FloatArray) -> BoolArray:
    """Return the rows of the stated slips whose pull is large enough for a relative error."""
    low, high = STATED
    there = np.isfinite(measured).all(axis=1) & (points.slip >= low) & (points.slip <= high)
    return there & (np.abs(measured[:, 1]) > LEAST_PULL * points.normal_load)


def _worst(pull: FloatArray, measured: FloatArray, rows: BoolArray) -> float:
    return float(np.max(np.abs(pull[rows] / measured[rows, 1] - 1.0)))


def _row(what: str, worst: float, why: str) -> Statement:
    """A row of the closed form, of which the text states no figure."""
    return Statement('equation 13', what, USABLE, f'{100 * worst:.0f} %', worst <= ALLOWED, why)


def _models() -> list[Statement]:
    """The model of stresses, fitted to each wheel as their earlier one is, with eleven numbers."""
    smooth, lugged = read(ROWS, 'HIT_Wh34_smooth'), read(ROWS, LUGGED)
    plain = _fit(BASE, smooth, hit_wheels.SMOOTH_PARAMETERS)
    printed = plain.with_values(hit_wheels.PUBLISHED_LUGS)
    start = printed.with_values({'effects.lug_digging.rework': 1.0})
    angles = [free for free in hit_wheels.SMOOTH_PARAMETERS if free.name in ANGLES]
    own = _fit(start, lugged, (*hit_wheels.FITTED_LUGS, *angles))
    found = []
    for label, fitted, model, (points, measured) in (
        ('HIT, smooth', 'seven numbers fitted', plain, smooth),
        ('HIT, lugs of 10 mm', 'that soil, the printed lug terms', printed, lugged),
        (
            'HIT, lugs of 10 mm',
            'that soil; two lug numbers, three of angles fitted',
            own,
            lugged,
        ),
    ):
        rows = _judged(points, measured)
        said = model.predict(points)
        worst = _worst(said[:, 1], measured, rows)
        depth, _, torque = np.abs(said - measured)[rows].max(axis=0)
        why = f'sinkage within {1e3 * depth:.1f} mm, torque within {torque:.1f} N m'
        why = WHY_PRINTED if worst > ALLOWED else why
        what = f'{label}, {fitted}: error of the pull'
        told, holds = f'{100 * worst:.0f} %', worst <= ALLOWED
        found.append(Statement('text, earlier model', what, 'below 10 %', told, holds, why))
    why = 'the rows of that wheel (Sutoh et al.) are not public'
    what = 'wheel of 327 x 150 mm, slip 0.3: error of a classical model'
    found.append(Statement('text', what, 'about 40 %', '-', None, why))
    return found


def _fit(model: Model, data: tuple[OperatingPoints, FloatArray], free: Sequence[Free]) -> Model:
    """Return the model fitted to the rows of the stated slips."""
    points, measured = data
    judged = np.where(_judged(points, measured)[:, np.newaxis], measured, np.nan)
    return fit(model, [(points, judged)], SIGMA, free, PRIOR)[0]


def pull_from_torque(
    points: OperatingPoints,
    measured: FloatArray,
    # c1, c2: the peak of the stress is at (c1 + c2 s) times the entrance angle
    peak: tuple[float, float] = (BASE.soil.peak_stress_ratio, 0.0),
    friction: float = 0.0,  # torque that the drive itself takes [N m]
    dug: FloatArray | float = 0.0,  # part of the sinkage that lugs dug or saved [m]
) -> FloatArray:
    """Return the pull [N] (N,) from measured sinkage, torque and load.

    Lugs share half of their height in the radius.
    """
    sinkage, _, torque = measured.T
    entrance = np.arccos(1.0 - (sinkage - dug) / points.wheel.radius)
    leaving = BASE.soil.leaving_angle_ratio * entrance
    rear = points.wheel.radius * (1.0 - np.cos(leaving))
    peaks = peak[0] + peak[1] * points.slip
    contact = equivalent_contact(points.wheel, sinkage, rear, peaks, dug)
    return np.asarray(contact.drawbar_pull(torque - friction, points.normal_load))


def _pulls() -> list[Statement]:
    """The closed form, equation 13, on the equivalent circle."""
    found = []
    for series, label in SERIES.items():
        points, measured = read(ROWS, series)
        rows = _judged(points, measured)
        what = f'{label}: error of the pull from torque'
        if not rows.any():
            why = 'no pull above a tenth of the load'
            found.append(Statement('equation 13', what, USABLE, '-', None, why))
            continue
        worst = _worst(pull_from_torque(points, measured), measured, rows)
        unfitted = f'{what} (nothing fitted)'
        why = WHY_UNFITTED.get(series, '')
        if series == LUGGED:
            dug = points.wheel.lug_height * points.slip - SUPPORT[0.010]
            other = _worst(pull_from_torque(points, measured, dug=dug), measured, rows)
            why = f'{100 * other:.0f} % where h s - dz4 is taken out of the sinkage'
        found.append(_row(unfitted, worst, why))
        rig = series.startswith('KLS')
        fitted = f'{what} (peak angle{", friction of the drive" * rig} fitted)'
        worst = _fitted(points, measured, rows, rig)
        found.append(_row(fitted, worst, WHY_FITTED.get(series, '')))
    return found


def _fitted(points: OperatingPoints, measured: FloatArray, rows: BoolArray, rig: bool) -> float:
    """Return the worst error with c1 and c2 (and the friction of a rig's drive) fitted to it."""

    def worst(x: FloatArray) -> float:
        friction = float(x[2]) if rig else 0.0
        try:
            pull = pull_from_torque(points, measured, (float(x[0]), float(x[1])), friction)
        except ValueError:  # a peak outside the contact
            return REFUSED
        return _worst(pull, measured, rows)

    start = [BASE.soil.peak_stress_ratio, 0.2, *([1.0] * rig)]
    options = {'xatol': 1e-4, 'fatol': 1e-4, 'maxiter': 2000}
    return float(minimize(worst, start, method='Nelder-Mead', options=options).fun)


def _high_slip() -> list[Statement]:
    """Return what a mound behind the wheel does, on the shipped soil with the mound's law."""
    shipped = reader.load(['grc3_fit'], complete=False)
    slips = np.array([ONSET, 0.7, 0.8, 0.9])
    wheel = Wheel(0.25, 0.2, 0.01, 24)
    points = OperatingPoints(slips, 150.0, wheel)
    without = {name: v for name, v in shipped.effects.items() if name != 'soil_mound'}
    pulls = [
        WheelSoilModel(shipped.soil, effects).steady_state(points)
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
    kappa = shipped.effects['soil_mound']['kappa']
    by_lugs = {**without, 'soil_mound': {'form': 'conveyed', 'kappa': kappa}}
    model = WheelSoilModel(shipped.soil, by_lugs)
    gains = [
        float(np.ptp(model.steady_state(OperatingPoints(slips[[0, -1]], 150.0, of)).drawbar_pull))
        for of in (Wheel(0.25, 0.2, height, 24) for height in HEIGHTS)
    ]
    told = ', '.join(f'{value:+.0f}' for value in gains)
    why = 'mound by the soil that lugs carry back (`soil_mound`, form conveyed)'
    what = 'gain of pull from slip 0.6 to 0.9, lugs of 5, 10, 20 mm [N]'
    found.append(Statement('text', what, 'severe flow by grousers', told, None, why))
    # The equivalent contact takes the soil behind the wheel as measured: higher soil, more pull.
    state = pulls[1]
    values = [
        float(
            equivalent_contact(
                wheel, state.sinkage[-1], share * state.sinkage[-1], 0.5
            ).drawbar_pull(state.torque[-1], 150.0)
        )
        for share in (0.1, 1.2)
    ]
    what = 'equivalent contact: pull with the soil behind at 0.1 and 1.2 of the sinkage'
    ours = f'{values[0]:.0f} N, {values[1]:.0f} N'
    found.append(Statement('equation 13', what, 'more with a mound', ours, values[1] > values[0]))
    return found


def _definitions() -> list[Statement]:
    edges = ', '.join(f'{name} to {edge:g}' for edge, name in CLASSES)
    why = 'definition, used by ~/slip_class'
    return [Statement('text', 'classes of slip', edges, edges, None, why)]
