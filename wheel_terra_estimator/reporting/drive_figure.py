# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The drive as one figure that can be zoomed: velocity, slip, classes, sinkage, pull."""

from __future__ import annotations

import math

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.track import Track
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.estimation.estimates import SLOPES, SlipClass, SlipOnSlope
from wheel_terra_estimator.reporting.drive_style import BAND, CLASS_COLOURS, Border, known
from wheel_terra_estimator.reporting.drive_summary import short_names
from wheel_terra_estimator.reporting.style import LINE_COLOURS, RIM_COLOUR, WARNING_COLOUR
from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure, limits

WITHIN = 1.96
"""Deviations that hold 95 % of a Gaussian."""
SLIP_RANGE = (-0.05, 1.0)
"""What the slip panel shows at least [-]."""
LEAST_EXTENT = 0.5
"""Way below which a drive has no picture of the ground [m]."""
STRENGTHS = (
    ('below 0.7', -math.inf, 0.7, '#9b59b6'),
    ('0.7 to 0.9', 0.7, 0.9, '#c9a3d9'),
    ('0.9 to 1.1, as stated', 0.9, 1.1, RIM_COLOUR),
    ('1.1 to 1.3', 1.1, 1.3, '#8cc9a1'),
    ('above 1.3', 1.3, math.inf, '#2e8b57'),
)
"""Words, bounds and colour of the learned shear strength over the stated one: purple is weaker."""
VELOCITY, SLIP, CLASSES, SINKAGE, PULL = range(5)
QUANTITIES = ((SLIP, 'slip', 1.0), (SINKAGE, 'sinkage', 1e3), (PULL, 'drawbar_pull', 1.0))
"""Panel, quantity, its factor from SI to the panel."""


def drive_figure(history: EstimateHistory, truth: Truth | None, border: Border) -> TimeFigure:
    """Return the figure of a drive."""
    names = short_names(history.names)
    slip = known(history, 'slip', border)
    panels = (
        Panel('velocity [m/s]; grey: mean rim speed', 0.17),
        Panel('slip ratio [-]', 0.25, limits(slip, within=SLIP_RANGE)),
        Panel('slip class', 0.04 * len(names), strips=tuple(names)),
        Panel('sinkage [mm]', 0.21),
        Panel('drawbar pull [N]', 0.21),
    )
    end = float(history.seconds[-1])
    switches = [
        Switch(f'wheel {i}', name, colour=LINE_COLOURS[i % len(LINE_COLOURS)])
        for i, name in enumerate(names)
    ]
    switches.append(Switch('band', f'± {BAND:g} standard deviations', on=False))
    if truth is not None:
        switches.append(Switch('truth', 'truth of each wheel', on=False))
    figure = TimeFigure(panels, switches, end, 'time since the first estimate [s]')
    _velocity(figure, history, truth)
    for wheel, name in enumerate(names):
        switch = f'wheel {wheel}'
        for panel, quantity, scale in QUANTITIES:
            line = scale * known(history, quantity, border)[:, wheel]
            half = scale * BAND * history.values[f'{quantity}_std'][:, wheel]
            colour = LINE_COLOURS[wheel % len(LINE_COLOURS)]
            figure.band(panel, history.seconds, line, half, colour, switch)
            figure.line(panel, history.seconds, line, name, colour, switch)
            true: WheelTruth | None = getattr(truth, quantity, None)
            if true is not None:
                seconds = (true.stamp - history.stamp[0]) * 1e-9
                values = scale * true.value[:, wheel]
                figure.truth(panel, seconds, values, 'truth', switch, 'truth')
    for slip_class, colour in CLASS_COLOURS.items():
        figure.strips(
            CLASSES,
            history.seconds,
            history.slip_class == slip_class,
            slip_class.name.lower(),
            colour,
            slender=slip_class is SlipClass.UNKNOWN,
        )
    for begin, last in history.warning_times:
        figure.shade(begin, end if last is None else last)
    return figure


def way_figure(track: Track) -> TimeFigure | None:
    """Return class and soil strength along the way; None where a drive went nowhere."""
    values, way = track.values, track.values['distance']
    if track.stamp.size < 2 or way[-1] < LEAST_EXTENT:
        return None
    panels = (
        Panel('worst slip class of a wheel', 0.05, strips=('class',)),
        Panel('shear strength learned, over that stated', 0.05, strips=('soil',)),
    )
    figure = TimeFigure(panels, (), float(way[-1]), 'distance [m]')
    for slip_class, colour in CLASS_COLOURS.items():
        member = (values['slip_class'] == slip_class)[:, None]
        slender = slip_class is SlipClass.UNKNOWN
        figure.strips(0, way, member, slip_class.name.lower(), colour, slender=slender)
    for words, low, high, colour in STRENGTHS:
        member = ((values['soil_strength'] >= low) & (values['soil_strength'] < high))[:, None]
        figure.strips(1, way, member, words, colour)
    return figure


def slopes_figure(found: SlipOnSlope) -> TimeFigure:
    """Return slip over slope uphill with its band of 95 %, and the probability of entrapment."""
    uphill = SLOPES >= 0.0
    slopes, half = SLOPES[uphill], WITHIN * found.std[uphill]
    panels = (
        Panel('slip ratio [-]', 0.25, (-0.05, 1.05)),
        Panel('probability of entrapment [-]', 0.12, (-0.05, 1.05)),
    )
    switches = (Switch('band', 'band of 95 %'),)
    figure = TimeFigure(panels, switches, float(slopes[-1]), 'slope, uphill [deg]')
    slip = found.slip[uphill]
    figure.band(0, slopes, slip, half, LINE_COLOURS[0])
    figure.line(0, slopes, slip, 'slip expected', LINE_COLOURS[0])
    figure.line(1, slopes, found.entrapment[uphill], 'probability', WARNING_COLOUR)
    return figure


def _velocity(figure: TimeFigure, history: EstimateHistory, truth: Truth | None) -> None:
    velocity = history.forward_velocity
    rim = velocity + history.values['slip_velocity'].mean(axis=1)
    figure.line(VELOCITY, history.seconds, rim, 'mean rim speed', RIM_COLOUR, width=1.0)
    figure.line(VELOCITY, history.seconds, velocity, 'body', LINE_COLOURS[0])
    if truth is not None:
        seconds = (truth.velocity.stamp - history.stamp[0]) * 1e-9
        figure.truth(VELOCITY, seconds, truth.velocity.value[:, 0], 'truth')
