# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ding et al. 2010: figures and every number of the text, from shipped soil and wheels."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction import ding_curves, integration
from wheel_terra_lab.reproduction.ding_curves import (
    LOAD,
    LUGS,
    SLIPS,
    STATED,
    SUPPORT,
    WHEELS,
    crossover,
    lugged,
    sinkage,
    with_printed_exponents,
    wong_reece,
)
from wheel_terra_lab.reproduction.statement import Statement, within
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Model

TITLE = 'Ding et al. 2010, J. Cent. South Univ. Technol. 17 (doi 10.1007/s11771-010-0021-7)'
RATIO = (3.0, 7.0)  # z(0.6)/z(0)
WONG_REECE = 5.0  # [mm]
CROSSING_SHARE = 0.15
SMALL = 0.1  # of the sinkage: "relatively small"
SPEED = 0.01  # [m/s] of the wheel's centre
RIPPLE = 20.0  # [N]
RIPPLE_LUGS = (30, 24, 15)
NOT_FIXED = 'stiffness and angles are fitted to these two, since no moduli are printed'


def statements(count: int = integration.POINTS) -> list[Statement]:
    """Return what the paper states beside ours; `count` contacts judge the integration."""
    model = ding_curves.printed_model()
    return [
        *_sinkages(model),
        *_lugs(model),
        *_dimensions(model),
        *_flow(model),
        *_ripple(model),
        *(integration.statements(count) if count else ()),
    ]


def draw(path: Path) -> None:
    """Draw the curves of figures 3 to 5 and 10."""
    ding_curves.draw(ding_curves.printed_model(), path)


def _ratio(place: str, what: str, curve: FloatArray, why: str = '') -> Statement:
    ratio = float(curve[-1] / curve[0])
    holds = RATIO[0] <= ratio <= RATIO[1]
    return Statement(
        place, f'z(0.6)/z(0) of {what}', '3 to 7', f'{ratio:.1f}', holds, '' if holds else why
    )


def _sinkages(model: Model) -> list[Statement]:
    curves = {height: sinkage(model, 'Wh3', height) for height in SUPPORT}
    what = f'Wh3: {", ".join(f"z({slip:g})" for slip, _ in STATED)} [mm]'
    said = ', '.join(f'{value:g}' for _, value in STATED)
    told = ', '.join(f'{value:.1f}' for value in curves[0.010][[0, -1]])
    found = [Statement('figure 3', what, said, told, None, NOT_FIXED)]
    spread = np.abs(sinkage(model, 'Wh3', 0.01, 8) - sinkage(model, 'Wh3', 0.01, 30)).max()
    why = 'no term of the model has the number of lugs'
    what = 'lugs 8 to 30 change the sinkage by [mm]'
    found.append(Statement('figure 3', what, 'little', f'{spread:.1f}', None, why))
    for height, curve in curves.items():
        support = 1e3 * SUPPORT[height]
        bearing = curve[[0, -1]] + support
        most = (RATIO[1] * bearing[0] - bearing[1]) / (RATIO[1] - 1.0)
        why = (
            f'the printed support of {support:g} mm leaves {curve[0]:.1f} mm at rest; '
            f'{most:.1f} mm would give {RATIO[1]:g}'
        )
        what, place = f'Wh3, h = {1e3 * height:.0f} mm', 'figure 4' if height else 'text'
        found.append(_ratio(place, what, curve, why))
    return found


def _lugs(model: Model) -> list[Statement]:
    found = []
    for low, high in ((0.010, 0.015), (0.0, 0.010)):
        ours = crossover(model, low, high)
        holds, why = within(ding_curves.CROSSING, ours, CROSSING_SHARE)
        more, deeper = 1e3 * (SUPPORT[high] - SUPPORT[low]), 1e3 * (high - low)
        if not holds:
            why += (
                f'; the printed h s - dz4 cross at {more:g}/{deeper:g} = {more / deeper:.2f} on '
                f'any soil; {ding_curves.CROSSING:g} takes supports '
                f'{ding_curves.CROSSING * deeper:g} mm apart, not {more:g}'
            )
        what = f'slip above which {1e3 * high:.0f} mm lugs sink more than {1e3 * low:.0f} mm'
        found.append(Statement('figure 4', what, 'about 0.4', f'{ours:.2f}', holds, why))
    curves = [sinkage(model, 'Wh3', height) for height in LUGS]
    slopes = [float((curve[-1] - curve[0]) / SLIPS[-1]) for curve in curves]
    told = ', '.join(f'{value:.0f}' for value in slopes)
    what = 'slope of z(s) at h = 5, 10, 15 mm [mm]'
    grows = bool(np.all(np.diff(slopes) > 0.0))
    found.append(Statement('figure 4', what, 'grows with h', told, grows))
    apart = float(np.abs(curves[2] - curves[1]).max())
    what = 'lugs of 10 and 15 mm differ by at most [mm]'
    why = f'below {100 * SMALL:.0f} % of the sinkage at slip 0.6'
    holds = apart < SMALL * float(curves[1][-1])
    found.append(Statement('figure 10', what, 'relatively small', f'{apart:.1f}', holds, why))
    return found


def _dimensions(model: Model) -> list[Statement]:
    curves = {
        wheel: sinkage(with_printed_exponents(model, wheel), wheel, 0.010) for wheel in WHEELS
    }
    found = [_ratio('figure 5', wheel, curves[wheel]) for wheel in ('Wh1', 'Wh2')]
    same = {wheel: float(sinkage(model, wheel, 0.010)[-1]) for wheel in WHEELS}
    for what, more in (
        ('narrower (Wh2 - Wh1)', same['Wh2'] - same['Wh1']),
        ('smaller (Wh1 - Wh3)', same['Wh1'] - same['Wh3']),
    ):
        name = f'{what} at s = 0.6 [mm]'
        found.append(Statement('figure 5', name, 'sinks more', f'{more:+.1f}', more > 0.0))
    slopes = [float((curve[-1] - curve[0]) / SLIPS[-1]) for curve in curves.values()]
    told = ', '.join(f'{value:.0f}' for value in slopes)
    what = 'slope of z(s) of Wh1, Wh2, Wh3 [mm]'
    alike = max(slopes) - min(slopes) < SMALL * max(slopes)
    why = f'within {100 * SMALL:.0f} %'
    found.append(Statement('figure 5', what, 'little influence', told, alike, why))
    return found


def _flow(model: Model) -> list[Statement]:
    """Figure 10: what the stresses alone give, and what the growing exponent adds."""
    found = []
    for wheel in ding_curves.PRINTED:
        of = with_printed_exponents(model, wheel)
        alone, whole = wong_reece(of, wheel), sinkage(of, wheel, 0.010)
        growth, grown = float(alone[-1] - alone[0]), float(whole[-1] - whole[0])
        what = f'{wheel}: growth by Wong-Reece, s = 0 to 0.6 [mm]'
        holds = growth < WONG_REECE
        found.append(Statement('figure 10', what, 'below 5', f'{growth:.1f}', holds))
        digging = 1e3 * 0.010 * float(SLIPS[-1])
        share = 100.0 * (grown - growth - digging) / grown
        what = f'{wheel}: share of n1 s (lateral flow) in the growth [%]'
        holds = share > 50.0
        found.append(Statement('figure 10', what, 'a primary part', f'{share:.0f}', holds))
    why = 'the paper sets them aside'
    what = 'longitudinal slip-sinkage from the slip lines'
    found.append(Statement('equations 3 to 8', what, '-', '-', None, why))
    return found


def _ripple(model: Model) -> list[Statement]:
    """Equation 2, and the load of a wheel that stands on one lug, then on two."""
    radius, width = WHEELS['Wh3']
    periods = [2.0 * math.pi * radius * (1.0 - s) / (max(RIPPLE_LUGS) * SPEED) for s in SLIPS]
    told = f'{periods[0]:.2f} to {periods[-1]:.2f}'
    what = 'period of the lugs, 30 of them, s = 0 to 0.6 [s]'
    falls = bool(np.all(np.diff(periods) < 0.0))
    found = [Statement('equation 2', what, 'falls with slip', told, falls)]
    height, step = 0.010, 1.0
    points = OperatingPoints(
        0.0, np.array([LOAD - step, LOAD + step]), Wheel(radius, width, height), slip_radius='shear'
    )
    low, high = lugged(model, height).predict(points)[:, 0]
    rise = [(radius + height) * (1.0 - math.cos(math.pi / lugs)) for lugs in RIPPLE_LUGS]
    ripple = [0.5 * value * 2.0 * step / float(high - low) for value in rise]
    what = 'ripple of the load with 30, 24, 15 lugs [N]'
    told = ', '.join(f'+-{value:.0f}' for value in ripple)
    why = 'the model is a mean over a lug; ours: axle held, on one lug, then on two'
    found.append(Statement('text', what, f'about +-{RIPPLE:g}', told, None, why))
    return found
