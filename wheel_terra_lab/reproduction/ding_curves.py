# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sinkage over slip of the wheels of Ding et al. 2010: figures 3 to 5 and 10."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.reporting.style import picture_style
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Free, Model, fit

LOAD = 80.0
LUG_NUMBERS = (30, 24, 15, 8)
STATED = np.array([[0.0, 5.0], [0.6, 30.0]])  # slip, sinkage of Wh3 [mm]
CROSSING = 0.4  # slip at which the order of the lug heights turns round
WHEELS = {'Wh1': (0.135, 0.165), 'Wh2': (0.135, 0.110), 'Wh3': (0.1574, 0.165)}
PRINTED = {'Wh2': (0.93, 0.54), 'Wh3': (0.84, 0.72)}
LUGS = (0.005, 0.010, 0.015)  # [m]
SUPPORT = {0.0: 0.0, 0.005: 0.0, 0.010: 0.0015, 0.015: 0.003}  # dz4 by height [m]
FIGURE_10 = {'Wh2': (0.010,), 'Wh3': (0.010, 0.015)}  # heights of lugs of which dz4 is printed
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
    """Draw the curves of figures 3 to 5 and 10, and what the text says of them."""
    from matplotlib.figure import Figure

    panels = {
        'figure 3: number of lugs (Wh3, 10 mm)': {
            f'{count} lugs': sinkage(model, 'Wh3', 0.010, count) for count in LUG_NUMBERS
        },
        'figure 4: height of lugs (Wh3, 30 lugs)': {
            f'{1e3 * height:.0f} mm': sinkage(model, 'Wh3', height) for height in LUGS
        },
        'figure 5: dimensions (10 mm, 30 lugs)': {
            f'{name}: {1e3 * r:.0f} mm x {1e3 * b:.0f} mm': sinkage(model, name, 0.010)
            for name, (r, b) in WHEELS.items()
        },
        **{
            f'figure 10: {name}': {
                **{
                    f'{1e3 * height:.0f} mm': sinkage(of, name, height)
                    for height in FIGURE_10[name]
                },
                'Wong-Reece': wong_reece(of, name),
            }
            for name in PRINTED
            if (of := with_printed_exponents(model, name))
        },
    }
    with picture_style():
        figure = Figure(figsize=(9.6, 6.4), layout='constrained')
        axes = figure.subplots(2, 3, sharey=True).ravel()
        for axis, (title, curves) in zip(axes, panels.items(), strict=False):
            for i, (label, values) in enumerate(curves.items()):
                # The curves of figure 3 lie on one another: each a little thinner than the last.
                width = 3.5 - 0.7 * i if axis is axes[0] else 1.4
                axis.plot(SLIPS, values, '-o', ms=3, lw=width, label=label)
            axis.set_title(title, fontsize=8)
        axes[0].plot(*STATED.T, 'k_', ms=14, mew=2, label='stated: 5 and 30 mm')
        axes[1].axvline(CROSSING, color='k', ls=':', lw=1)
        axes[0].invert_yaxis()
        for axis in axes[: len(panels)]:
            axis.set_xlabel('slip [-]')
            axis.set_ylabel('sinkage [mm]')
            axis.legend(fontsize=7)
        axes[-1].set_axis_off()
        figure.savefig(path, metadata={'Date': None})


def with_printed_exponents(model: Model, wheel: str) -> Model:
    """Return the model with the exponents that the paper prints for a wheel, where it does."""
    if wheel not in PRINTED:
        return model
    n0, n1 = PRINTED[wheel]
    return model.with_values({'soil.sinkage_exponent': n0, 'effects.slip_sinkage_exponent.n1': n1})


def wong_reece(model: Model, wheel: str) -> FloatArray:
    """Sinkage by the stresses alone [mm]: no growing exponent, no lugs."""
    return sinkage(model.with_values({'effects.slip_sinkage_exponent.n1': 0.0}), wheel, 0.0)


def printed_model() -> Model:
    """Return the printed exponents, with stiffness and angles free for the two stated sinkages.

    The rest is the shipped soil that was fitted to a smooth wheel of the same authors.
    """
    shipped = reader.load(['hit_fit'], complete=False)
    fitted = Model(shipped.soil, {name: dict(values) for name, values in shipped.effects.items()})
    start = with_printed_exponents(fitted, 'Wh3').with_values(
        {'effects.rim_friction.ring_height': 0.003}
    )
    points = OperatingPoints(
        STATED[:, 0], LOAD, Wheel(*WHEELS['Wh3'], 0.010, 30), slip_radius='shear'
    )
    stated = np.full((2, 3), np.nan)
    stated[:, 0] = 1e-3 * STATED[:, 1]
    found = fit(lugged(start, 0.010), [(points, stated)], (0.001, 1.0, 1.0), FREE)[0]
    effects = {k: v for k, v in found.effects.items() if not k.startswith('lug_')}
    return Model(found.soil, effects)
