# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip against slope: a single wheel in its rig beside a rover of such wheels in free travel."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.slope_locomotion import rover_climb
from wheel_terra_lab.studies.model_validation import grc3_wheel
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, fit
from wheel_terra_lab.studies.model_validation.pictures import save

WHEEL_COUNT = 4
HEIGHT_PER_WHEELBASE = 0.4  # of the centre of mass; assumed, a tall rover
STIFFENING = 0.5  # of the soil under a second pass; the expected value of the effect
SLOPES_DEG = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)
LEVELS = 0.1  # slip between two levels of the measured rows


def climbed(slip: FloatArray, pull: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return traction slope [rad], rising, and mean slip of the rows of each level of slip."""
    level = np.round(slip / LEVELS)
    groups = [level == value for value in np.unique(level)]
    angle = np.array([np.arctan(pull[group].mean() / grc3_wheel.LOAD) for group in groups])
    mean = np.array([slip[group].mean() for group in groups])
    rising = np.append(True, angle[1:] > np.maximum.accumulate(angle)[:-1])
    return angle[rising], mean[rising]


def rover_loads(slopes: FloatArray, height: float) -> FloatArray:
    """Return (N, 4) loads [N] on two front and two rear wheels, transfer by the slope included."""
    tilt = 2.0 * height * np.tan(slopes)
    shares = np.stack([1.0 - tilt, 1.0 - tilt, 1.0 + tilt, 1.0 + tilt], axis=1)
    return grc3_wheel.LOAD * np.cos(slopes)[:, None] * shares


def section(shared: Path, figures: Path) -> str:
    """Return the section and draw its picture."""
    slip, measured = grc3_wheel.read(shared)
    even = np.arange(slip.size) % 2 == 0
    data = [(grc3_wheel.points_at(slip[even]), measured[even])]
    fitted, _ = fit(grc3_wheel.BASE, data, grc3_wheel.SIGMA, (*grc3_wheel.SOIL, *grc3_wheel.MOUND))
    plain = WheelSoilModel(fitted.soil, fitted.effects)
    tracked = WheelSoilModel(
        fitted.soil, fitted.effects | {'multipass': {'stiffening': STIFFENING}}
    )
    angle, mean = climbed(slip[~even], measured[~even, 1])

    def slips(model: WheelSoilModel, loads: FloatArray, slopes: FloatArray, *passes: int):  # type: ignore[no-untyped-def]
        state = rover_climb(
            model, grc3_wheel.WHEEL, loads, slopes, passes or 1.0, slip_radius='shear'
        )
        return state.slip

    def forms(slopes: FloatArray) -> dict[str, FloatArray]:
        level = np.full((slopes.size, 1), grc3_wheel.LOAD)
        equal, leaning = (rover_loads(slopes, height) for height in (0.0, HEIGHT_PER_WHEELBASE))
        return {
            'measured': np.interp(slopes, angle, mean, left=np.nan, right=np.nan),
            'single wheel': slips(plain, level, slopes),
            'equal loads': slips(plain, equal, slopes),
            'load transfer': slips(plain, leaning, slopes),
            'and tracks': slips(tracked, leaning, slopes, 1, 1, 2, 2),
        }

    slopes = np.radians(SLOPES_DEG)
    columns = forms(slopes)
    lines = [
        f'| {slope:g} | ' + ' | '.join(_percent(values[k]) for values in columns.values()) + ' |'
        for k, slope in enumerate(SLOPES_DEG)
    ]
    _draw(figures / 'rover_slope.svg', (angle, mean), forms)
    return '\n'.join(
        [
            '## Slip against slope: single wheel and rover',
            '',
            'The wheel on GRC-3 again, fitted with the mound on every second row. Measured: the '
            'rows that the fit did not see, by level of slip, pull over load as the tangent of '
            'the slope. Beside it the model for the wheel in its rig (17.5 kg on every slope), and '
            f'a rover of {WHEEL_COUNT} such wheels in free travel: each with W cos(a) of its own, '
            'then with the load that the slope moves to the rear wheels (centre of mass '
            f'{HEIGHT_PER_WHEELBASE:g} of the wheelbase high), then with the rear wheels in the '
            f'tracks of the front ones (stiffer by {100 * STIFFENING:.0f} %). Rover and tracks are '
            'assumed: no rover on slopes is among the measurements. Slip in %; - where the soil '
            'does not carry the rover up (or none was measured).',
            '',
            '| slope [deg] | measured, held out | model, wheel in the rig | rover, equal loads '
            '| with load transfer | and in tracks |',
            '|---|---|---|---|---|---|',
            *lines,
            '',
            '![slip against slope](figures/rover_slope.svg)',
        ]
    )


def _percent(slip: float) -> str:
    return f'{100.0 * slip:.0f}' if np.isfinite(slip) else '-'


def _draw(path: Path, measured: tuple[FloatArray, FloatArray], forms) -> None:  # type: ignore[no-untyped-def]
    from matplotlib.figure import Figure

    dense = np.radians(np.linspace(0.0, 30.0, 31))
    with picture_style():
        figure = Figure(figsize=(5.0, 3.2))
        axis = figure.subplots()
        axis.plot(np.degrees(measured[0]), measured[1], 'o', ms=4, color=LINE_COLOURS[0],
                  label='measured, held out')  # fmt: skip
        curves = list(forms(dense).items())[1:]
        for colour, (label, values) in zip(LINE_COLOURS[1:], curves, strict=False):
            axis.plot(np.degrees(dense), values, color=colour, label=label)
        axis.set_xlabel('slope [deg]')
        axis.set_ylabel('slip [-]')
        axis.legend(fontsize=7)
        save(figure, path)
