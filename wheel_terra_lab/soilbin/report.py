# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a run: figures, time series that can be zoomed, bed and film, in one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure
from wheel_terra_lab.soilbin import pictures
from wheel_terra_lab.soilbin.case import Case

TEMPLATES = Path(__file__).parent / 'templates'
SHARES = {'force [N]': 0.4}
"""Share of the height of the panels that need more than the others."""


def write_report(folder: Path, series: np.ndarray, case: Case, figures: Mapping[str, str]) -> None:
    """Write ``report.html`` into the folder of a run.

    Parameters
    ----------
    folder : Path
        Folder of the run; ``bed.png`` and ``film.gif`` in it are embedded where they are there.
    series : numpy.ndarray
        (k, columns of ``bookkeeping.SERIES``) samples over the travel.
    case : Case
        What was run.
    figures : mapping
        Words of a figure -> its value with unit.
    """
    from wheel_terra_estimator.reporting.html import render, write_page

    def image(name: str) -> str:
        path = folder / name
        if not path.exists():
            return ''
        kind = path.suffix.removeprefix('.')
        return f'data:image/{kind};base64,' + base64.b64encode(path.read_bytes()).decode()

    page = render(
        'soilbin.html',
        TEMPLATES,
        case=case,
        figures=figures,
        figure=_figure(series, case),
        bed=image('bed.png'),
        film=image('film.gif'),
        frame=pictures.FRAME,
        frames=case.numerics.frames,
        between=case.operation.duration / max(case.numerics.frames, 1),
    )
    part = folder / 'report.part'
    write_page(part, page)
    part.replace(folder / 'report.html')


def _figure(series: np.ndarray, case: Case) -> TimeFigure:
    titles = list(dict.fromkeys(quantity.panel for quantity in pictures.QUANTITIES))
    panels = [Panel(title, SHARES.get(title, 0.2)) for title in titles]
    forces = [q for q in pictures.QUANTITIES if q.panel == titles[0]]
    switches = [Switch(q.name, q.name, colour=q.colour) for q in forces]
    end = float(pictures.clock(case, series[-1:, 0])[0])
    figure = TimeFigure(panels, switches, end, pictures.TIME)
    for quantity, time, values in pictures.lines(series, case):
        panel = titles.index(quantity.panel)
        figure.line(panel, time, values, quantity.name, quantity.colour, quantity.name)
    return figure
