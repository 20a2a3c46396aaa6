# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The drive as one figure that can be zoomed: velocity, slip, classes, sinkage, pull."""

from __future__ import annotations

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import BAND, CLASS_COLOURS, drawn_slip
from wheel_terra_estimator.reporting.drive_summary import short_names
from wheel_terra_estimator.reporting.style import LINE_COLOURS, RIM_COLOUR
from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure, limits

SLIP_RANGE = (-0.05, 1.0)
"""What the slip panel shows at least [-]."""
VELOCITY, SLIP, CLASSES, SINKAGE, PULL = range(5)


def drive_figure(history: EstimateHistory, truth: Truth | None) -> str:
    """Return the figure of a drive as JSON for the page's script."""
    names = short_names(history.names)
    slip = drawn_slip(history)
    panels = (
        Panel('velocity [m/s]', 0.17),
        Panel('slip ratio [-]', 0.25, limits(slip, within=SLIP_RANGE)),
        Panel('slip class', 0.16, strips=tuple(names)),
        Panel('sinkage [mm]', 0.21),
        Panel('drawbar pull [N]', 0.21),
    )
    figure = TimeFigure(
        panels,
        _switches(names, truth),
        float(history.seconds[-1]),
        'time since the first set [s]',
    )
    _velocity(figure, history, truth)
    for panel, quantity, scale in (
        (SLIP, 'slip', 1.0),
        (SINKAGE, 'sinkage', 1e3),
        (PULL, 'drawbar_pull', 1.0),
    ):
        known = getattr(truth, quantity) if truth is not None else None
        for wheel, name in enumerate(names):
            _wheel(figure, history, quantity, scale, panel, wheel, name, known)
    for slip_class, colour in CLASS_COLOURS.items():
        figure.strips(
            CLASSES,
            history.seconds,
            history.slip_class == slip_class,
            slip_class.name.lower(),
            colour,
            slender=slip_class is SlipClass.UNKNOWN,
        )
    last = float(history.seconds[-1])
    for warning in history.warnings:
        begin, end = (
            None if stamp is None else (stamp - history.stamp[0]) * 1e-9
            for stamp in (warning.start, warning.end)
        )
        words = f'stuck warning: {warning.reason or "no reason given"}'
        figure.shade(SLIP, begin or 0.0, last if end is None else end, words, 'stuck warning')
    return figure.as_json()


def _switches(names: list[str], truth: Truth | None) -> list[Switch]:
    wheels = [
        Switch(f'wheel {i}', name, colour=LINE_COLOURS[i % len(LINE_COLOURS)])
        for i, name in enumerate(names)
    ]
    wheels.append(Switch('band', f'± {BAND:g} standard deviations', on=False))
    if truth is not None:
        wheels.append(Switch('truth', 'truth of each wheel', on=False))
    return wheels


def _velocity(figure: TimeFigure, history: EstimateHistory, truth: Truth | None) -> None:
    velocity = history.forward_velocity
    rim = velocity + history.values['slip_velocity'].mean(axis=1)
    figure.line(VELOCITY, history.seconds, rim, 'mean rim speed', RIM_COLOUR, width=1.0)
    figure.line(VELOCITY, history.seconds, velocity, 'body', LINE_COLOURS[0])
    if truth is not None:
        seconds = (truth.velocity.stamp - history.stamp[0]) * 1e-9
        figure.truth(VELOCITY, seconds, truth.velocity.value[:, 0], 'truth')


def _wheel(
    figure: TimeFigure,
    history: EstimateHistory,
    quantity: str,
    scale: float,
    panel: int,
    wheel: int,
    name: str,
    truth: WheelTruth | None,
) -> None:
    colour, switch = LINE_COLOURS[wheel % len(LINE_COLOURS)], f'wheel {wheel}'
    values = drawn_slip(history) if quantity == 'slip' else history.values[quantity]
    line = scale * values[:, wheel]
    half = scale * BAND * history.values[f'{quantity}_std'][:, wheel]
    figure.band(panel, history.seconds, line, half, colour, switch)
    figure.line(panel, history.seconds, line, name, colour, switch)
    if truth is not None:
        seconds = (truth.stamp - history.stamp[0]) * 1e-9
        true = scale * truth.value[:, wheel]
        figure.truth(panel, seconds, true, f'{name}, truth', switch, 'truth')
