# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The tables of the bench as an HTML page, with a picture of slip errors or of the limiter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.reporting.style import EDGE, INK, LINE_COLOURS, picture_style
from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure
from wheel_terra_lab.evaluation import scores
from wheel_terra_lab.evaluation.bench import Results
from wheel_terra_lab.evaluation.closed_loop import Comparison
from wheel_terra_lab.evaluation.scores import Samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TEMPLATES = Path(__file__).parent / 'templates'
WIDE, PHONE = 9.0, 3.6  # widths of a picture [inch]
ROW, ROOM = 0.28, 1.1  # height of a kind in it, and of its axis and legend [inch]


@dataclass
class Block:
    """A heading, a paragraph or a table of a report."""

    kind: str
    text: str = ''
    head: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


def is_page(path: Path | None) -> bool:
    """Say whether an output is wanted as a page, by its name."""
    return path is not None and path.suffix.lower() in ('.html', '.htm')


def write(
    path: Path, title: str, text: str, results: Results | None, drive: Comparison | None
) -> None:
    """Write a report, given as the Markdown that this folder makes, as a page.

    Parameters
    ----------
    path : Path
        HTML file.
    title : str
        Heading of the page.
    text : str
        Headings, paragraphs and tables.
    results : Results or None
        Drives of the bench, of which slip errors are drawn.
    drive : Comparison or None
        A drive with and without the traction limiter, drawn over time.
    """
    from wheel_terra_estimator.reporting.html import picture, render, write_page

    found = list(blocks(text))
    page = render(
        'evaluation.html',
        TEMPLATES,
        title=title,
        blocks=found,
        contents=[(n, b.text) for n, b in enumerate(found) if b.kind == 'heading'],
        errors={
            name: picture(slip_errors(results, width))
            for name, width in (('wide', WIDE), ('narrow', PHONE))
        }
        if results and results.drives
        else None,
        limiter=limiter_figure(drive) if drive else None,
        seed=drive.seed if drive else None,
        stopped=drive.limited.reason if drive and drive.limited.stopped is not None else '',
    )
    write_page(path, page)


def blocks(text: str) -> Iterator[Block]:
    """Yield the blocks of a report; bold cells lose their stars."""
    table: Block | None = None
    for line in (raw.strip() for raw in text.splitlines()):
        if line.startswith('|'):
            cells = [cell.strip().strip('*') for cell in line.strip('|').split('|')]
            if table is None:
                table = Block('table', head=cells)
            elif not all(set(cell) <= {'-'} and cell for cell in cells):
                table.rows.append(cells)
            continue
        if table is not None:
            yield table
            table = None
        if line.startswith('#'):
            yield Block('heading', line.lstrip('# '))
        elif line:
            yield Block('paragraph', line)
    if table is not None:
        yield table


def slip_errors(results: Results, width: float) -> Figure:
    """Draw the slip error of each kind in each mode, beside the best baseline filter."""
    from matplotlib.figure import Figure

    modes = list(dict.fromkeys(drive.mode for drive in results.drives))
    kinds = list(dict.fromkeys((drive.simulator, drive.kind) for drive in results.drives))[::-1]
    several = len(results.simulators) > 1
    with picture_style():
        figure = Figure(figsize=(width, ROOM + ROW * len(kinds)))
        axis = figure.subplots()
        for m, mode in enumerate(modes):
            for y, (simulator, kind) in enumerate(kinds):
                drives = results.of_mode(mode, simulator).get(kind, [])
                if not drives:
                    continue
                data = Samples.joined(d.samples for d in drives)
                ours = scores.rms(data.slip_error)
                other = scores.rms(scores.better_baseline(data)[1])
                colour, height = LINE_COLOURS[m], y + 0.12 * (m - 0.5 * (len(modes) - 1))
                first = kind == kinds[-1][1] and simulator == kinds[-1][0]
                axis.plot([ours, other], [height, height], color=EDGE, lw=0.7, zorder=1)
                axis.plot(other, height, 'o', ms=5, mfc='none', mec=colour)
                axis.plot(
                    ours, height, 'o', ms=5, color=colour, label=mode.replace('_', ' ') * first
                )
        axis.plot(np.nan, np.nan, 'o', ms=5, mfc='none', mec=INK, label='two-state filter')
        names = [f'{kind} ({simulator})' if several else kind for simulator, kind in kinds]
        axis.set_yticks(range(len(kinds)), [name.replace('_', ' ') for name in names])
        axis.set_xlim(left=0.0)
        axis.set_xlabel('root-mean-square error of slip [-]')
        handles, labels = axis.get_legend_handles_labels()
        kept = [(h, text) for h, text in zip(handles, labels, strict=True) if text]
        figure.legend(
            *zip(*kept, strict=True), loc='outside upper left', ncols=3 if width > PHONE else 1
        )
    return figure


RUNS = ('without limiter', 'with limiter')


def courses(drive: Comparison) -> Iterator[tuple[str, str, str, Any, Any]]:
    """Yield panel, run, colour, times [s] and values of a drive with and without the limiter."""
    for name, run, colour in zip(
        RUNS, (drive.free, drive.limited), (LINE_COLOURS[1], LINE_COLOURS[0]), strict=True
    ):
        slip = np.median(np.nan_to_num(run.slip), axis=1)
        yield 'way [m]', name, colour, run.time, run.position
        yield 'median slip [-]', name, colour, run.time, slip
        yield 'deepest wheel [mm]', name, colour, run.time, 1e3 * run.sinkage.max(axis=1)
        yield 'scale of the command [-]', name, colour, run.time, run.scale


def limiter_figure(drive: Comparison) -> TimeFigure:
    """Return a drive with and without the limiter over time."""
    lines = list(courses(drive))
    panels = list(dict.fromkeys(panel for panel, *_ in lines))
    switches = [
        Switch(run, run, colour=next(c for _, r, c, *_ in lines if r == run)) for run in RUNS
    ]
    end = float(max(drive.free.time[-1], drive.limited.time[-1]))
    figure = TimeFigure([Panel(panel) for panel in panels], switches, end, 'time [s]')
    for panel, run, colour, time, values in lines:
        figure.line(panels.index(panel), time, values, run, colour, run)
    stopped = drive.limited.stopped
    if stopped is not None:
        figure.shade(stopped, end)
    return figure


def draw_limiter(drive: Comparison, path: Path) -> None:
    """Draw a drive with and without the limiter: way, slip, sinkage, scale of the command."""
    from matplotlib.figure import Figure

    lines = list(courses(drive))
    panels: Sequence[str] = list(dict.fromkeys(panel for panel, *_ in lines))
    with picture_style():
        figure = Figure(figsize=(8.0, 1.6 * len(panels) + 0.8))
        axes = dict(zip(panels, figure.subplots(len(panels), 1, sharex=True).tolist(), strict=True))
        for panel, run, colour, time, values in lines:
            axes[panel].plot(time, values, color=colour, label=run)
        for panel, axis in axes.items():
            axis.set_title(panel)
        axes[panels[0]].legend(loc='lower right', bbox_to_anchor=(1.0, 1.0), ncols=2)
        axes[panels[-1]].set_xlabel('time [s]')
        figure.savefig(path, format='png', dpi=110)
