# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Every number that the text of Ding et al. 2010 states, against the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.reporting.style import picture_style
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.model_validation import hit_wheels
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Free, Model, fit, listed
from wheel_terra_lab.studies.model_validation.pictures import save

LOAD = 80.0
LUG_NUMBERS = (30, 24, 15, 8)
STATED = np.array([[0.0, 5.0], [0.6, 30.0]])  # slip, sinkage of Wh3 [mm]
CROSSING = 0.4  # slip at which the order of the lug heights turns round
WHEELS = {'Wh1': (0.135, 0.165), 'Wh2': (0.135, 0.110), 'Wh3': (0.1574, 0.165)}
PRINTED = {'Wh2': (0.93, 0.54), 'Wh3': (0.84, 0.72)}
SUPPORT = {0.0: 0.0, 0.005: 0.0, 0.010: 0.0015, 0.015: 0.003}
FITTED = 'second model only: the first is fitted to it'
SLIPS = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
# The text's own numbers do not fix moduli and angles: free, for the two sinkages that it states.
FREE = (
    Free('soil.frictional_modulus', 2407.4e3, 2000e3, 2e5, 2e7),
    Free('soil.peak_stress_ratio', 0.45, 0.1, 0.2, 0.8),
    Free('effects.stress_peak_shift.c2', 0.15, 0.1, 0.0, 0.4),
    Free('soil.leaving_angle_ratio', -0.15, 0.15, -0.8, -0.001),
)


def lugged(model: Model, height: float) -> Model:
    """Return the model with the paper's terms for lugs of a height."""
    if height == 0.0:
        return model
    return model.with_values(
        {
            'effects.lug_shear_radius.lam': 0.5,
            'effects.lug_digging.kd': 1.0,
            'effects.lug_support.dz4': SUPPORT[height],
        }
    )


def sinkage(model: Model, wheel: str, height: float, count: int = 30) -> FloatArray:
    """Sinkage over ``SLIPS`` [mm]."""
    points = OperatingPoints(SLIPS, LOAD, Wheel(*WHEELS[wheel], height, count), slip_radius='shear')
    return 1e3 * lugged(model, height).predict(points)[:, 0]


def crossover(model: Model, low: float, high: float) -> float:
    """Slip above which the higher lug sinks more."""
    difference = sinkage(model, 'Wh3', high) - sinkage(model, 'Wh3', low)
    above = np.flatnonzero(difference > 0.0)
    if above.size == 0 or above[0] == 0:
        return np.nan
    k = above[0]
    share = -difference[k - 1] / (difference[k] - difference[k - 1])
    return float(SLIPS[k - 1] + share * (SLIPS[k] - SLIPS[k - 1]))


def draw(model: Model, path: Path) -> None:
    """Draw the ten curves of the paper's figures 3 to 5, and what its text says of them."""
    from matplotlib.figure import Figure

    panels = {
        'figure 3: number of lugs (Wh3, 10 mm)': {
            f'{count} lugs': sinkage(model, 'Wh3', 0.010, count) for count in LUG_NUMBERS
        },
        'figure 4: height of lugs (Wh3, 30 lugs)': {
            f'{1e3 * height:.0f} mm': sinkage(model, 'Wh3', height)
            for height in SUPPORT
            if height > 0.0
        },
        'figure 5: dimensions (10 mm, 30 lugs)': {
            f'{name}: {1e3 * r:.0f} mm x {1e3 * b:.0f} mm': sinkage(model, name, 0.010)
            for name, (r, b) in WHEELS.items()
        },
    }
    with picture_style():
        figure = Figure(figsize=(9.6, 3.2))
        axes = figure.subplots(1, 3, sharey=True)
        for axis, (title, curves) in zip(axes, panels.items(), strict=True):
            for i, (label, values) in enumerate(curves.items()):
                # The curves of figure 3 lie on one another: each a little thinner than the last.
                width = 3.5 - 0.7 * i if axis is axes[0] else 1.4
                axis.plot(SLIPS, values, '-o', ms=3, lw=width, label=label)
            axis.set_title(title, fontsize=8)
            axis.set_xlabel('slip [-]')
            axis.legend(fontsize=7)
        axes[0].plot(*STATED.T, 'k_', ms=14, mew=2, label='stated: 5 and 30 mm')
        axes[0].legend(fontsize=7)
        axes[1].axvline(CROSSING, color='k', ls=':', lw=1)
        axes[0].set_ylabel('sinkage [mm]')
        axes[0].invert_yaxis()
        save(figure, path)


def with_printed_exponents(model: Model, wheel: str) -> Model:
    """Return the model with the exponents that the paper prints for a wheel, where it does."""
    if wheel not in PRINTED:
        return model
    n0, n1 = PRINTED[wheel]
    return model.with_values({'soil.sinkage_exponent': n0, 'effects.slip_sinkage_exponent.n1': n1})


def printed_model(fitted: Model) -> Model:
    """Return the printed exponents, with stiffness and angles free for the stated sinkages."""
    return _compromise(fitted)[0]


def _compromise(fitted: Model) -> tuple[Model, dict[str, float]]:
    printed_start = with_printed_exponents(fitted, 'Wh3').with_values(
        {'effects.rim_friction.ring_height': 0.003}
    )
    points = OperatingPoints(
        np.array([0.0, 0.6]), LOAD, Wheel(*WHEELS['Wh3'], 0.010, 30), slip_radius='shear'
    )
    stated = np.full((2, 3), np.nan)
    stated[:, 0] = (0.005, 0.030)
    compromise, values = fit(
        lugged(printed_start, 0.010), [(points, stated)], (0.001, 1.0, 1.0), FREE
    )
    effects = {k: v for k, v in compromise.effects.items() if not k.startswith('lug_')}
    return Model(compromise.soil, effects), values


def section(shared: Path, figures: Path) -> str:
    """Return the section and draw its picture."""
    fitted = hit_wheels.fitted_soil(shared)
    compromise, values = _compromise(fitted)
    models = {'printed n0, n1': compromise, 'fitted to the 2011 rows': fitted}
    draw(compromise, figures / 'ding.svg')
    rows: list[tuple[str, str, list[str], str]] = []

    def add(statement: str, said: str, of: list[str], test: str = 'yes') -> None:
        rows.append((statement, said, of, test))

    at = {name: {h: sinkage(m, 'Wh3', h) for h in SUPPORT} for name, m in models.items()}
    add('sinkage of Wh3 at s = 0 [mm]', '5', [f'{at[n][0.01][0]:.1f}' for n in models], FITTED)
    add('sinkage of Wh3 at s = 0.6 [mm]', '30', [f'{at[n][0.01][-1]:.1f}' for n in models], FITTED)
    for h in SUPPORT:
        ratio = [f'{at[n][h][-1] / at[n][h][0]:.1f}' for n in models]
        add(f'z(0.6)/z(0), Wh3, h = {1e3 * h:.0f} mm', '3 to 7', ratio)
    second = [sinkage(with_printed_exponents(m, 'Wh2'), 'Wh2', 0.01) for m in models.values()]
    add(
        'z(0.6)/z(0), Wh2 with n0 = 0.93, n1 = 0.54, h = 10 mm',
        '3 to 7',
        [f'{z[-1] / z[0]:.1f}' for z in second],
    )
    first = [sinkage(m, 'Wh1', 0.01) for m in models.values()]
    add('z(0.6)/z(0), Wh1, h = 10 mm', '3 to 7', [f'{z[-1] / z[0]:.1f}' for z in first])
    alone = [
        sinkage(m.with_values({'effects.slip_sinkage_exponent.n1': 0.0}), 'Wh3', 0.0)
        for m in models.values()
    ]
    add('Wong-Reece alone, z(0.6) - z(0) [mm]', 'below 5', [f'{z[-1] - z[0]:.1f}' for z in alone])
    for h in (0.010, 0.015):
        said = f'{1e3 * SUPPORT[h]:g}'
        add(f'support of lugs of {1e3 * h:.0f} mm [mm]', said, [said] * len(models), 'no: input')
    add(
        'slip above which 15 mm lugs sink more than 10 mm',
        'about 0.4',
        [f'{crossover(m, 0.010, 0.015):.2f}' for m in models.values()],
    )
    add(
        'slip above which 10 mm lugs sink more than none',
        'about 0.4',
        [f'{crossover(m, 0.0, 0.010):.2f}' for m in models.values()],
    )
    add(
        'lugs 8 to 30 change the sinkage by [mm]',
        'little',
        [
            f'{np.abs(sinkage(m, "Wh3", 0.01, 8) - sinkage(m, "Wh3", 0.01, 30)).max():.1f}'
            for m in models.values()
        ],
        'no: no term has the count',
    )
    add(
        'narrower wheel (Wh2 - Wh1) at s = 0.6 [mm]',
        'sinks more',
        [
            f'{(sinkage(m, "Wh2", 0.01) - sinkage(m, "Wh1", 0.01))[-1]:+.1f}'
            for m in models.values()
        ],
    )
    add(
        'smaller wheel (Wh1 - Wh3) at s = 0.6 [mm]',
        'sinks more',
        [
            f'{(sinkage(m, "Wh1", 0.01) - sinkage(m, "Wh3", 0.01))[-1]:+.1f}'
            for m in models.values()
        ],
    )
    slopes = [
        [(z[-1] - z[0]) / 0.6 for z in (at[n][0.005], at[n][0.010], at[n][0.015])] for n in models
    ]
    add(
        'slope of z(s) at h = 5, 10, 15 mm [mm]',
        'grows with h',
        [', '.join(f'{v:.0f}' for v in values_) for values_ in slopes],
    )
    lines = [f'| {a} | {b} | ' + ' | '.join(c) + f' | {t} |' for a, b, c, t in rows]
    return '\n'.join(
        [
            '## What Ding et al. 2010 state',
            '',
            'The paper prints n0 and n1 for two wheels but not the moduli that belong to them. The '
            'first model keeps the printed exponents and frees stiffness and angles for the two '
            f'sinkages that the text states ({listed(values)}); the second is the fit to the rows '
            'of 2011. Both carry the printed lug terms.',
            '',
            '| statement | paper | ' + ' | '.join(models) + ' | can fail |',
            '|---|---|' + '---|' * (len(models) + 1),
            *lines,
            '',
            '![The ten curves of figures 3 to 5](figures/ding.svg)',
            '',
            'The ten curves of figures 3 to 5 with the first model; the paper shows its own as '
            'pictures only, so what its text says of them is drawn in: the two sinkages of figure '
            '3, the slip of 0.4 at which the order of the lug heights turns round.',
            '',
            'They cannot all hold at once. With z = r (1 - cos t1) + h s - dz4 the crossing of two '
            'heights lies where the heights times s make up for the support, s = 0.3 for 10 and '
            '15 mm, whatever the soil, unless the friction of the soil on the rim differs too; and '
            '30 mm at s = 0.6 with 5 mm at s = 0 is a ratio of 6 for that wheel, which a support '
            'of 3 mm lifts above 7 for the higher lugs.',
        ]
    )
