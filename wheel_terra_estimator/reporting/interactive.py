# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The drive as one figure that can be zoomed: all panels on one time axis, wheels on and off.

The figure is data for plotly.js, which lies in the page once; colours of text, grid and truth come
from the page, so that they follow its light or dark mode.
"""

from __future__ import annotations

import json
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_summary import short_names
from wheel_terra_estimator.reporting.style import (
    BAND,
    CLASS_COLOURS,
    LINE_COLOURS,
    drawn_slip,
    thin,
)

FloatArray = NDArray[np.float64]

SCRIPT = Path(__file__).parent / 'static' / 'plotly-basic.min.js'

LINE_POINTS, BAND_POINTS, TRUTH_POINTS = 2000, 300, 600
"""Points of a line in the page: what a wide screen shows, and a file below 4 MB."""
DIGITS = 4  # significant, of what is drawn
REASON_WIDTH = 34  # characters of a line of a warning's reason

PANELS = (
    ('velocity', 'velocity [m/s]', 0.17),
    ('slip', 'slip ratio [-]', 0.25),
    ('class', 'slip class', 0.16),
    ('sinkage', 'sinkage [mm]', 0.21),
    ('drawbar_pull', 'drawbar pull [N]', 0.21),
)
"""Panels from top to bottom: name, title, share of the height (the gaps aside)."""


def plotly_script() -> str:
    """Return the library's text, to be embedded once."""
    return SCRIPT.read_text(encoding='utf-8')


def drive_figure(history: EstimateHistory, truth: Truth | None) -> str:
    """Return traces, layout and wheel names as JSON for the page's script.

    Each trace has ``meta`` = {kind: line, band, truth or class; wheel: index or -1}, by which the
    page switches it.
    """
    names = short_names(history.names)
    traces = _velocity(history, truth)
    for panel, quantity, scale in ((2, 'slip', 1.0), (4, 'sinkage', 1e3), (5, 'drawbar_pull', 1.0)):
        known = getattr(truth, quantity) if truth is not None else None
        for wheel, name in enumerate(names):
            traces += _wheel(history, quantity, scale, panel, wheel, name, known)
    traces += _classes(history)
    return _json(
        {
            'traces': traces,
            'layout': _layout(history, names),
            'wheels': [
                {'name': name, 'colour': LINE_COLOURS[i % len(LINE_COLOURS)]}
                for i, name in enumerate(names)
            ],
            'hasTruth': truth is not None,
        }
    )


def _velocity(history: EstimateHistory, truth: Truth | None) -> list[dict[str, Any]]:
    velocity = history.forward_velocity
    rim = velocity + history.values['slip_velocity'].mean(axis=1)
    traces = [
        _line(history.seconds, rim, 1, 'mean rim speed', '#8a949e', -1, width=1.0),
        _line(history.seconds, velocity, 1, 'body', LINE_COLOURS[0], -1),
    ]
    if truth is not None:
        traces.append(_truth(history, truth.velocity, 0, 1.0, 1, 'truth', -1))
    return traces


def _wheel(
    history: EstimateHistory,
    quantity: str,
    scale: float,
    panel: int,
    wheel: int,
    name: str,
    truth: WheelTruth | None,
) -> list[dict[str, Any]]:
    colour = LINE_COLOURS[wheel % len(LINE_COLOURS)]
    values = drawn_slip(history)[:, wheel] if quantity == 'slip' else None
    values = scale * (history.values[quantity][:, wheel] if values is None else values)
    deviation = scale * BAND * history.values[f'{quantity}_std'][:, wheel]
    traces = [
        *_band(history.seconds, values, deviation, panel, colour, wheel),
        _line(history.seconds, values, panel, name, colour, wheel),
    ]
    if truth is not None:
        traces.append(_truth(history, truth, wheel, scale, panel, f'{name}, truth', wheel))
    return traces


def _line(
    x: FloatArray, y: FloatArray, panel: int, name: str, colour: str, wheel: int, width: float = 1.4
) -> dict[str, Any]:
    few_x, few_y = thin(x, y, LINE_POINTS)
    return {
        'x': _seconds(few_x),
        'y': _numbers(few_y),
        'yaxis': f'y{panel}',
        'name': name,
        'mode': 'lines',
        'line': {'color': colour, 'width': width},
        'hovertemplate': '%{y}',
        'meta': {'kind': 'line', 'wheel': wheel},
    }


def _band(
    x: FloatArray, y: FloatArray, half: FloatArray, panel: int, colour: str, wheel: int
) -> list[dict[str, Any]]:
    few_x, low = thin(x, y - half, BAND_POINTS)
    high = np.interp(few_x, x, y + half)
    whole = np.isfinite(low) & np.isfinite(high)
    edge = {
        'x': _seconds(few_x[whole]),
        'yaxis': f'y{panel}',
        'mode': 'lines',
        'line': {'width': 0},
        'hoverinfo': 'skip',
        'visible': False,
        'meta': {'kind': 'band', 'wheel': wheel},
    }
    return [
        {**edge, 'y': _numbers(low[whole])},
        {**edge, 'y': _numbers(high[whole]), 'fill': 'tonexty', 'fillcolor': f'{colour}33'},
    ]


def _truth(
    history: EstimateHistory,
    truth: WheelTruth,
    column: int,
    scale: float,
    panel: int,
    name: str,
    wheel: int,
) -> dict[str, Any]:
    seconds = (truth.stamp - history.stamp[0]) * 1e-9
    x, y = thin(seconds, scale * truth.value[:, column], TRUTH_POINTS)
    return {
        'x': _seconds(x),
        'y': _numbers(y),
        'yaxis': f'y{panel}',
        'name': name,
        'mode': 'lines',
        'line': {'dash': 'dash', 'width': 1.0},
        'hovertemplate': '%{y}',
        'visible': wheel < 0,
        'meta': {'kind': 'truth', 'wheel': wheel},
    }


def _classes(history: EstimateHistory) -> list[dict[str, Any]]:
    """Draw the classes of the wheels as thick strips, one trace per class; unknown is thin."""
    seconds, count = history.seconds, len(history.names)
    traces = []
    for slip_class, colour in CLASS_COLOURS.items():
        x: list[float | None] = []
        y: list[int | None] = []
        for wheel in range(count):
            mine = np.concatenate(([0], history.slip_class[:, wheel] == slip_class, [0]))
            edges = np.flatnonzero(np.diff(mine.astype(np.int8))).reshape(-1, 2)
            for start, end in edges:
                last = seconds[min(end, seconds.size - 1)]
                x += [round(float(seconds[start]), 2), round(float(last), 2), None]
                y += [count - 1 - wheel, count - 1 - wheel, None]
        width = 2 if slip_class is SlipClass.UNKNOWN else 11
        traces.append(
            {
                'x': x,
                'y': y,
                'yaxis': 'y3',
                'name': slip_class.name.lower(),
                'mode': 'lines',
                'line': {'color': colour, 'width': width, 'simplify': False},
                'hoverinfo': 'skip',
                'meta': {'kind': 'class', 'wheel': -1},
            }
        )
    return traces


def _layout(history: EstimateHistory, names: list[str]) -> dict[str, Any]:
    """Return axes, titles and warnings; every panel hangs on the one time axis ``x``."""
    gap = 0.052
    room = 1.0 - gap * (len(PANELS) - 1)
    layout: dict[str, Any] = {
        'hovermode': 'x unified',
        'showlegend': False,
        'dragmode': 'zoom',
        'xaxis': {
            'title': {'text': 'time since the first set [s]'},
            'anchor': f'y{len(PANELS)}',
            'showspikes': True,
            'spikemode': 'across',
            'spikethickness': 1,
            'spikedash': 'dot',
            'range': [0.0, round(float(history.seconds[-1]), 2)],
        },
        'shapes': [],
        'annotations': [],
    }
    top = 1.0
    total = sum(share for *_, share in PANELS)
    for number, (name, title, share) in enumerate(PANELS, start=1):
        bottom = top - room * share / total
        axis: dict[str, Any] = {
            'domain': [max(bottom, 0.0), top],
            'anchor': 'x',
            'automargin': True,
        }
        if name == 'slip':
            axis['range'] = [-1.05, 1.05]
        if name == 'class':
            axis |= {
                'tickvals': list(range(len(names)))[::-1],
                'ticktext': names,
                'range': [-0.6, len(names) - 0.4],
                'showgrid': False,
                'fixedrange': True,
            }
        layout[f'yaxis{number}'] = axis
        layout['annotations'].append(
            {
                'text': f'<b>{title}</b>',
                'xref': 'paper',
                'yref': 'paper',
                'x': 0,
                'y': top,
                'xanchor': 'left',
                'yanchor': 'bottom',
                'showarrow': False,
            }
        )
        top = bottom - gap
    layout['yaxis'] = layout.pop('yaxis1')
    for warning in history.warnings:
        _add_warning(layout, history, warning.start, warning.end, warning.reason)
    return layout


def _add_warning(
    layout: dict[str, Any], history: EstimateHistory, begin: int, end: int | None, reason: str
) -> None:
    start = (begin - history.stamp[0]) * 1e-9
    last = float(history.seconds[-1])
    stop = last if end is None else (end - history.stamp[0]) * 1e-9
    layout['shapes'].append(
        {'type': 'rect', 'xref': 'x', 'yref': 'paper', 'x0': start, 'x1': stop, 'y0': 0, 'y1': 1}
    )
    words = '<br>'.join(wrap(f'stuck warning: {reason or "no reason given"}', REASON_WIDTH)[:4])
    late = start > 0.5 * last
    layout['annotations'].append(
        {
            'name': 'warning',
            'text': words,
            'xref': 'x',
            'yref': 'y2 domain',
            'x': start,
            'y': 0.02,
            'xanchor': 'right' if late else 'left',
            'align': 'right' if late else 'left',
            'yanchor': 'bottom',
            'showarrow': False,
        }
    )


def _seconds(values: FloatArray) -> list[float]:
    return [round(v, 2) for v in values.tolist()]


def _numbers(values: FloatArray) -> list[float | None]:
    """Return rounded numbers; None, a gap, for nan."""
    return [
        float(f'{v:.{DIGITS}g}') if known else None
        for v, known in zip(values.tolist(), np.isfinite(values).tolist(), strict=True)
    ]


def _json(content: Any) -> str:
    """Return JSON that cannot end the script element in which it stands."""
    return json.dumps(content, separators=(',', ':'), allow_nan=False).replace('</', '<\\/')
