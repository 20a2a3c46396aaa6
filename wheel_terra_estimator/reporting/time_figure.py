# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A figure over time that can be zoomed: panels on one time axis, lines switched on and off.

The figure is data for plotly.js, which lies in the page once (template ``time_figure.html``);
colours of text, grid and truth come from the page, so that they follow its light or dark mode.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.reporting.style import DARK, LINE_COLOURS, thin

FloatArray = NDArray[np.float64]

SCRIPT = Path(__file__).parent / 'static' / 'plotly-basic.min.js'

LINE_POINTS, BAND_POINTS, TRUTH_POINTS = 2000, 300, 600
"""Points of a line in the page: what a wide screen shows, and a file below 4 MB."""
DIGITS = 4  # significant, of what is drawn
REASON_WIDTH = 34  # characters of a line of words beside a shaded stretch
REASON_LINES = 4
GAP = 0.052  # between two panels, as a share of the height
STRIP, THIN_STRIP = 11, 2  # widths of a strip [px]
MARGIN = 0.08  # room above and below a line, as a share of its range


def plotly_script() -> str:
    """Return the library's text, to be embedded once."""
    return SCRIPT.read_text(encoding='utf-8')


@dataclass(frozen=True)
class Panel:
    """One panel: title with unit, share of the height, fixed range or None, names of strips."""

    title: str
    share: float = 1.0
    limits: tuple[float, float] | None = None
    strips: tuple[str, ...] = ()


@dataclass(frozen=True)
class Switch:
    """A box of the page that shows or hides the traces that name it."""

    key: str
    text: str
    on: bool = True
    colour: str = ''


class TimeFigure:
    """Collects lines, bands, strips and shaded stretches of panels under one another.

    Parameters
    ----------
    panels : sequence of Panel
        From top to bottom; other methods count them from 0.
    switches : sequence of Switch
        Boxes above the figure. A trace is drawn while all switches that it names are on.
    end : float
        Last time on the axis [s].
    time : str
        Title of the time axis.
    """

    def __init__(
        self, panels: Sequence[Panel], switches: Sequence[Switch], end: float, time: str
    ) -> None:
        self._panels = tuple(panels)
        self._switches = tuple(switches)
        self._end = end
        self._time = time
        self._traces: list[dict[str, Any]] = []
        self._shapes: list[dict[str, Any]] = []
        self._notes: list[dict[str, Any]] = []

    def line(
        self,
        panel: int,
        seconds: FloatArray,
        values: FloatArray,
        name: str,
        colour: str,
        *switches: str,
        width: float = 1.4,
        dash: str = 'solid',
    ) -> None:
        """Add a line; nan is a gap."""
        style = {'color': colour, 'width': width, 'dash': dash}
        self._curve(panel, switches, name, thin(seconds, values, LINE_POINTS), line=style)

    def truth(
        self, panel: int, seconds: FloatArray, values: FloatArray, name: str, *switches: str
    ) -> None:
        """Add a dashed line in the page's ink."""
        style = {'dash': 'dash', 'width': 1.0}
        points = thin(seconds, values, TRUTH_POINTS)
        self._curve(panel, switches, name, points, line=style, ink=True)

    def _curve(
        self,
        panel: int,
        switches: tuple[str, ...],
        name: str,
        points: tuple[FloatArray, FloatArray],
        **style: Any,
    ) -> None:
        """Add a curve whose values are told where the pointer is."""
        x, y = _seconds(points[0]), _numbers(points[1])
        self._add(panel, switches, x=x, y=y, name=name, hovertemplate='%{y}', **style)

    def band(
        self,
        panel: int,
        seconds: FloatArray,
        values: FloatArray,
        half: FloatArray,
        colour: str,
        *switches: str,
    ) -> None:
        """Add a band of plus and minus ``half``; only while the switch ``band`` is on."""
        x, low = thin(seconds, values - half, BAND_POINTS)
        high = np.interp(x, seconds, values + half)
        whole = np.isfinite(low) & np.isfinite(high)
        edge: dict[str, Any] = {
            'x': _seconds(x[whole]),
            'line': {'width': 0},
            'hoverinfo': 'skip',
        }
        named = ('band', *switches)
        self._add(panel, named, **edge, y=_numbers(low[whole]))
        self._add(
            panel, named, **edge, y=_numbers(high[whole]), fill='tonexty', fillcolor=f'{colour}33'
        )

    def strips(
        self, panel: int, seconds: FloatArray, member: NDArray[np.bool_], name: str, colour: str,
        *, slender: bool = False,
    ) -> None:  # fmt: skip
        """Add the stretches (k, n) of n strips that belong to one class, first strip on top."""
        count = member.shape[1]
        x: list[float | None] = []
        y: list[int | None] = []
        for strip in range(count):
            edges = np.flatnonzero(np.diff(np.concatenate(([0], member[:, strip], [0]))))
            for start, end in edges.reshape(-1, 2):
                last = seconds[min(end, seconds.size - 1)]
                x += [round(float(seconds[start]), 2), round(float(last), 2), None]
                y += [count - 1 - strip, count - 1 - strip, None]
        width = THIN_STRIP if slender else STRIP
        self._add(
            panel,
            (),
            x=x,
            y=y,
            name=name,
            line={'color': colour, 'width': width, 'simplify': False},
            hoverinfo='skip',
        )

    def shade(self, panel: int, start: float, end: float, words: str, short: str) -> None:
        """Shade a stretch of all panels; the words stand in one, ``short`` ones on a phone."""
        self._shapes.append(
            {'type': 'rect', 'xref': 'x', 'yref': 'paper', 'x0': start, 'x1': end, 'y0': 0, 'y1': 1}
        )
        side = 'right' if start > 0.5 * self._end else 'left'
        self._notes.append(
            {
                'name': 'warning',
                'short': short,
                'text': '<br>'.join(wrap(words, REASON_WIDTH)[:REASON_LINES]),
                'xref': 'x',
                'yref': f'y{panel + 1} domain' if panel else 'y domain',
                'x': start,
                'y': 0.98,
                'xanchor': side,
                'align': side,
                'yanchor': 'top',
                'showarrow': False,
            }
        )

    def as_json(self) -> str:
        """Return traces, layout, switches and colours on dark pages for the page's script."""
        content = {
            'traces': self._traces,
            'layout': self._layout(),
            'switches': [vars(switch) for switch in self._switches],
            'dark': {colour: DARK[colour] for colour in LINE_COLOURS if colour in DARK},
        }
        # Text that cannot end the script element in which it stands.
        text = json.dumps(content, separators=(',', ':'), allow_nan=False)
        return text.replace('</', '<\\/')

    def _add(self, panel: int, switches: Sequence[str], ink: bool = False, **trace: Any) -> None:
        known = {switch.key for switch in self._switches}
        named = [key for key in switches if key in known]
        meta: dict[str, Any] = {'switches': named, 'ink': ink}
        axis = f'y{panel + 1}' if panel else 'y'
        self._traces.append({**trace, 'yaxis': axis, 'mode': 'lines', 'meta': meta})

    def _layout(self) -> dict[str, Any]:
        """Return axes and titles; every panel hangs on the one time axis ``x``."""
        room = 1.0 - GAP * (len(self._panels) - 1)
        total = sum(panel.share for panel in self._panels)
        last = len(self._panels)
        layout: dict[str, Any] = {
            'hovermode': 'x unified',
            'showlegend': False,
            'dragmode': 'zoom',
            'xaxis': {
                'title': {'text': self._time},
                'anchor': f'y{last}' if last > 1 else 'y',
                'showspikes': True,
                'spikemode': 'across',
                'spikethickness': 1,
                'spikedash': 'dot',
                'range': [0.0, round(self._end, 2)],
            },
            'shapes': self._shapes,
            'annotations': list(self._notes),
        }
        top = 1.0
        for number, panel in enumerate(self._panels, start=1):
            bottom = top - room * panel.share / total
            axis: dict[str, Any] = {
                'domain': [max(bottom, 0.0), top],
                'anchor': 'x',
                'automargin': True,
            }
            if panel.limits:
                axis['range'] = [round(limit, 6) for limit in panel.limits]
            if panel.strips:
                count = len(panel.strips)
                axis |= {
                    'tickvals': list(range(count))[::-1],
                    'ticktext': list(panel.strips),
                    'range': [-0.6, count - 0.4],
                    'showgrid': False,
                    'fixedrange': True,
                }
            layout[f'yaxis{number}' if number > 1 else 'yaxis'] = axis
            layout['annotations'].append(
                {
                    'text': f'<b>{panel.title}</b>',
                    'xref': 'paper',
                    'yref': 'paper',
                    'x': 0,
                    'y': top,
                    'xanchor': 'left',
                    'yanchor': 'bottom',
                    'showarrow': False,
                }
            )
            top = bottom - GAP
        return layout


def limits(*lines: FloatArray, within: tuple[float, float] | None = None) -> tuple[float, float]:
    """Return a range that holds the lines with a margin, and at least ``within``."""
    ends = [] if within is None else list(within)
    for values in lines:
        known = values[np.isfinite(values)]
        if known.size:
            ends += [float(known.min()), float(known.max())]
    low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
    margin = MARGIN * (high - low) or 1.0
    return low - margin, high + margin


def _seconds(values: FloatArray) -> list[float]:
    return [round(v, 2) for v in values.tolist()]


def _numbers(values: FloatArray) -> list[float | None]:
    """Return rounded numbers; None, a gap, for nan."""
    return [
        float(f'{v:.{DIGITS}g}') if known else None
        for v, known in zip(values.tolist(), np.isfinite(values).tolist(), strict=True)
    ]
