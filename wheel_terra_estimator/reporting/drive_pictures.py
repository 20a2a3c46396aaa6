# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a drive: an overview on one time axis, and each quantity wheel by wheel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import BAND, CLASS_COLOURS, drawn_slip
from wheel_terra_estimator.reporting.drive_summary import short_names
from wheel_terra_estimator.reporting.style import (
    LINE_COLOURS,
    RIM_COLOUR,
    TRUTH_COLOUR,
    WARNING_COLOUR,
    picture_style,
    thin,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]

FILTER_COLOUR = '#9aa5b0'
LINE_POINTS, BAND_POINTS, SPANS = 400, 150, 250
"""Points of a line on a printed page; more would only make the file large."""


def overview(history: EstimateHistory, truth: Truth | None) -> Figure:
    """Draw body velocity, slip, class, sinkage and pull of all wheels under one another."""
    from matplotlib.figure import Figure

    wheels, names = len(history.names), short_names(history.names)
    with picture_style():
        figure = Figure(figsize=(10.5, 8.6 + 0.12 * wheels))
        axes = figure.subplots(
            5, 1, sharex=True, gridspec_kw={'height_ratios': [1.1, 1.3, 0.16 * wheels + 0.25, 1, 1]}
        )
        _velocity(axes[0], history, truth)
        for axis, quantity, label in (
            (axes[1], 'slip', 'slip ratio [-]'),
            (axes[3], 'sinkage', 'sinkage [mm]'),
            (axes[4], 'drawbar_pull', 'drawbar pull [N]'),
        ):
            scale = 1e3 if quantity == 'sinkage' else 1.0
            for i in range(wheels):
                x, y = thin(history.seconds, scale * _drawn(history, quantity)[:, i], LINE_POINTS)
                axis.plot(x, y, color=_colour(i), label=names[i])
            axis.set_ylabel(label)
        axes[1].set_ylim(-1.05, 1.05)
        axes[1].legend(ncols=min(wheels, 6), loc='lower left', bbox_to_anchor=(0, 1.0))
        _class_strips(axes[2], history)
        axes[4].set_xlabel('time since the first set [s]')
        for axis in axes:
            _shade_warnings(axis, history)
        figure.align_ylabels(axes)
    return figure


def slip_by_wheel(history: EstimateHistory, truth: Truth | None) -> Figure:
    """Draw the slip of each wheel with its band, its class below, and the truth if known."""
    return _by_wheel(history, 'slip', 'slip ratio [-]', truth.slip if truth else None)


def sinkage_by_wheel(history: EstimateHistory, truth: Truth | None) -> Figure:
    """Draw the sinkage of each wheel with its band, and the truth if known."""
    return _by_wheel(
        history, 'sinkage', 'sinkage [mm]', truth.sinkage if truth else None, scale=1e3
    )


def pull_by_wheel(history: EstimateHistory, truth: Truth | None) -> Figure:
    """Draw the drawbar pull of each wheel with its band, and the truth if known."""
    known = truth.drawbar_pull if truth else None
    return _by_wheel(history, 'drawbar_pull', 'drawbar pull [N]', known)


def smoother_and_filter(
    history: EstimateHistory, filtered: EstimateHistory, quantity: str, truth: Truth | None
) -> Figure:
    """Draw ``slip`` or ``drawbar_pull`` of each wheel by the smoother, and the filter's in grey."""
    label = {'slip': 'slip ratio [-]', 'drawbar_pull': 'drawbar pull [N]'}[quantity]
    known = getattr(truth, quantity) if truth else None
    return _by_wheel(history, quantity, label, known, filtered=filtered)


def _by_wheel(
    history: EstimateHistory,
    quantity: str,
    label: str,
    truth: WheelTruth | None,
    scale: float = 1.0,
    filtered: EstimateHistory | None = None,
) -> Figure:
    from matplotlib.figure import Figure

    wheels = len(history.names)
    columns = 2 if wheels > 1 else 1
    rows = -(-wheels // columns)
    values = scale * _drawn(history, quantity)
    deviation = scale * BAND * history.values[f'{quantity}_std']
    with picture_style():
        figure = Figure(figsize=(10.5, 1.1 + 1.9 * rows))
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for i, name in enumerate(short_names(history.names)):
            axis = axes.flat[i]
            if filtered is not None:
                live = scale * _drawn(filtered, quantity)[:, i]
                x, y = thin(filtered.seconds, live, LINE_POINTS)
                axis.plot(x, y, color=FILTER_COLOUR, linewidth=0.9, label='filter')
            _band(axis, history.seconds, values[:, i], deviation[:, i], _colour(i))
            if truth is not None:
                _truth_line(axis, history, truth, i, scale)
            if quantity == 'slip':
                for border in (0.3, 0.6, 0.9):
                    axis.axhline(border, color='#b8c0c8', linewidth=0.7, zorder=0.5)
                _spans(axis, history, i, -1.32, 0.16)
                axis.set_ylim(-1.36, 1.08)
            _shade_warnings(axis, history)
            axis.set_title(name)
        if quantity != 'slip':
            _sensible_limits(axes.flat[0], values, deviation, truth, scale)
        for spare in axes.flat[wheels:]:
            spare.set_visible(False)
        for axis in axes[:, 0]:
            axis.set_ylabel(label)
        for axis in axes[-1]:
            axis.set_xlabel('time since the first set [s]')
        handles, labels = axes.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside upper right', ncols=4)
    return figure


def _drawn(history: EstimateHistory, quantity: str) -> FloatArray:
    return drawn_slip(history) if quantity == 'slip' else history.values[quantity]


def _velocity(axis: Axes, history: EstimateHistory, truth: Truth | None) -> None:
    velocity = history.forward_velocity
    rim = velocity + history.values['slip_velocity'].mean(axis=1)
    axis.plot(
        *thin(history.seconds, rim, LINE_POINTS),
        color=RIM_COLOUR,
        linewidth=1.0,
        label='mean rim speed',
    )
    _band(
        axis,
        history.seconds,
        velocity,
        BAND * history.forward_velocity_std,
        LINE_COLOURS[0],
        'body',
    )
    if truth is not None:
        _truth_line(axis, history, truth.velocity, 0, 1.0)
    speeds = [rim, velocity] + ([truth.velocity.value[:, 0]] if truth else [])
    low = min(float(np.nanmin(s)) for s in speeds)
    high = max(float(np.nanmax(s)) for s in speeds)
    margin = 0.15 * (high - low) + 1e-3
    axis.set_ylim(low - margin, high + margin)
    axis.set_ylabel('velocity [m/s]')
    axis.legend(ncols=4, loc='lower left', bbox_to_anchor=(0, 1.0))


def _band(
    axis: Axes,
    x: FloatArray,
    y: FloatArray,
    half_width: FloatArray,
    colour: str,
    label: str = 'estimate',
) -> None:
    lower_x, lower = thin(x, y - half_width, BAND_POINTS)
    upper = np.interp(lower_x, x, y + half_width)
    axis.fill_between(
        lower_x, lower, upper, color=colour, alpha=0.2, linewidth=0, label='± 2 std. deviations'
    )
    axis.plot(*thin(x, y, LINE_POINTS), color=colour, label=label)


def _truth_line(
    axis: Axes, history: EstimateHistory, truth: WheelTruth, column: int, scale: float
) -> None:
    seconds = (truth.stamp - history.stamp[0]) * 1e-9
    x, y = thin(seconds, scale * truth.value[:, column], LINE_POINTS)
    axis.plot(x, y, color=TRUTH_COLOUR, linewidth=0.9, linestyle=(0, (4, 2)), label='truth')


def _class_strips(axis: Axes, history: EstimateHistory) -> None:
    """Draw one strip per wheel in the colours of the classes."""
    from matplotlib.patches import Patch

    count = len(history.names)
    for i in range(count):
        _spans(axis, history, i, count - 1 - i - 0.42, 0.84)
    axis.set_ylim(-0.5, count - 0.5)
    axis.set_yticks(range(count), short_names(history.names)[::-1], fontsize=7.5)
    axis.grid(False)
    axis.legend(
        handles=[Patch(color=CLASS_COLOURS[c], label=c.name.lower()) for c in SlipClass],
        ncols=5,
        loc='lower left',
        bbox_to_anchor=(0, 1.0),
        handlelength=1.2,
    )


def _spans(axis: Axes, history: EstimateHistory, wheel: int, low: float, height: float) -> None:
    """Draw the classes of a wheel as coloured spans at a height of the axis."""
    classes, seconds = _coarser(history.slip_class[:, wheel], history.seconds)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(classes)) + 1))
    ends = np.append(seconds[starts[1:]], seconds[-1])
    for slip_class, colour in CLASS_COLOURS.items():
        mine = classes[starts] == slip_class
        bars: Any = np.column_stack((seconds[starts], ends - seconds[starts]))[mine]
        axis.broken_barh(bars, (low, height), color=colour, linewidth=0)


def _coarser(
    classes: NDArray[np.uint8], seconds: FloatArray
) -> tuple[NDArray[np.uint8], FloatArray]:
    """Return the worst known class of each of `SPANS` stretches of a long drive."""
    if classes.size <= SPANS:
        return classes, seconds
    starts = np.linspace(0, classes.size, SPANS, endpoint=False).astype(int)
    known = np.where(classes == SlipClass.UNKNOWN, -1, classes.astype(int))
    worst = np.maximum.reduceat(known, starts)
    ends = np.append(seconds[starts[1:]], seconds[-1])
    coarse = np.where(worst < 0, SlipClass.UNKNOWN, worst).astype(np.uint8)
    return np.append(coarse, coarse[-1]), np.append(seconds[starts], ends[-1])


def _shade_warnings(axis: Axes, history: EstimateHistory) -> None:
    for n, warning in enumerate(history.warnings):
        start = (warning.start - history.stamp[0]) * 1e-9
        end = (
            history.seconds[-1] if warning.end is None else (warning.end - history.stamp[0]) * 1e-9
        )
        label = 'stuck warning' if n == 0 else None
        axis.axvspan(start, end, color=WARNING_COLOUR, alpha=0.09, linewidth=0, label=label)
        axis.axvline(start, color=WARNING_COLOUR, linewidth=1.0)


def _sensible_limits(
    axis: Axes, values: FloatArray, deviation: FloatArray, truth: WheelTruth | None, scale: float
) -> None:
    """Keep a band of a quantity that is not known from flattening the line in it."""
    reach: Sequence[FloatArray] = [values] + ([scale * truth.value] if truth is not None else [])
    low = min(float(np.nanmin(r)) for r in reach)
    high = max(float(np.nanmax(r)) for r in reach)
    room = max(high - low, float(np.median(deviation)), 1e-6)
    axis.set_ylim(low - 0.6 * room, high + 0.6 * room)


def _colour(wheel: int) -> str:
    return LINE_COLOURS[wheel % len(LINE_COLOURS)]
