# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The result folder of one run: summary, time series, rows for diagnose, pictures, film."""

from __future__ import annotations

import base64
import csv
import json
import math
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure
from wheel_terra_lab.soilbin import pictures
from wheel_terra_lab.soilbin.bookkeeping import SERIES
from wheel_terra_lab.soilbin.case import Case, to_dict

ROW_COLUMNS = (
    'slip',
    'normal_load',
    'slope',
    'sinkage',
    'drawbar_pull',
    'torque',
    'wheel_radius',
    'wheel_width',
    'lug_height',
    'lug_count',
    'gravity',
    'angular_velocity',
    'leaving_angle',
)


TEMPLATES = Path(__file__).parent / 'templates'
SHARES = {'force [N]': 0.4}
"""Share of the height of the panels that need more than the others."""
WORK = '.work/'
FILES = (
    'summary.json',
    'time_series.csv',
    'rows.csv',
    'bed.png',
    'time_series.png',
    'film.gif',
    'report.html',
    WORK,
)
"""What a run may leave in its folder."""

COARSE = 2.0  # grain scale of the slips below
COARSE_SLIP = {10.0: ('21 to 27', '31'), 15.0: ('50', '52'), 25.0: ('73', '73')}
"""Slope [deg] -> slip of wheel 2 under 19.6 N [%] with coarse grains and at full scale."""


def grain_note(case: Case) -> str:
    """Say how far coarse grains are from full scale at the nearest slope; '' at full scale.

    From the case ``quick`` over three beds (10 deg) and the study ``convergence`` over two.
    """
    if case.bed.grain_scale < COARSE:
        return ''
    slope = math.degrees(case.operation.slope)
    nearest = min(COARSE_SLIP, key=lambda known: abs(known - slope))
    coarse, full = COARSE_SLIP[nearest]
    return (
        f'x{case.bed.grain_scale:g}: for trying things. Wheel 2 under 19.6 N on {nearest:g} deg '
        f'slips {coarse} % with grains x{COARSE:g} and {full} % at full scale'
    )


def measurement_row(case: Case, summary: Mapping[str, object]) -> dict[str, float]:
    """Return the run as one row of a table of steady measurements.

    `normal_load` is W cos(slope), `drawbar_pull` H - R_r along the slope, `sinkage` the depth of
    the rim below the undisturbed surface, `torque` the true moment on the body (the paper's
    H r_w is in the summary).
    """

    def number(name: str) -> float:
        return float(str(summary[name]))

    return {
        'slip': number('slip'),
        'normal_load': case.operation.vertical_load * math.cos(case.operation.slope),
        'slope': case.operation.slope,
        'sinkage': number('sinkage'),
        'drawbar_pull': number('net_traction'),
        'torque': number('torque_body'),
        'wheel_radius': case.wheel.rim_radius,
        'wheel_width': case.wheel.width,
        'lug_height': case.wheel.lug_height,
        'lug_count': case.wheel.lug_count,
        'gravity': case.operation.gravity,
        'angular_velocity': case.rim_rate,
        'leaving_angle': number('leaving_angle'),
    }


def write_rows(path: Path, rows: list[dict[str, float]]) -> None:
    """Write a table of steady measurements."""
    part = path.with_suffix('.part')
    with part.open('w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, ROW_COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({name: f'{row[name]:.6g}' for name in ROW_COLUMNS})
    part.replace(path)


def write_folder(
    folder: Path, work: Path, case: Case, summary: Mapping[str, object], film: bool
) -> None:
    """Write the results of a finished run into its folder; `summary.json` comes last."""
    series = np.load(work / 'series.npy')
    with (folder / 'time_series.csv').open('w', encoding='utf-8') as file:
        file.write(','.join(SERIES) + '\n')
        np.savetxt(file, series, delimiter=',', fmt='%.7g')
    write_rows(folder / 'rows.csv', [measurement_row(case, summary)])
    frames = sorted((work / 'frames').glob('*.npz'))
    if frames:
        pictures.draw(frames[-1], frames[0], case, summary, folder / 'bed.png')
        pictures.draw_series(series, case, folder / 'time_series.png')
        if film:
            pictures.film(frames, case, summary, folder / 'film.gif')
    write_report(folder, series, case, figures_of(summary, case))
    part = folder / 'summary.part'
    finite = {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in summary.items()
    }
    case_data = to_dict(case)
    if math.isnan(case.operation.imposed_slip):
        case_data['operation']['imposed_slip'] = None
    part.write_text(json.dumps({'summary': finite, 'case': case_data}, indent=2) + '\n')
    part.replace(folder / 'summary.json')
    shutil.rmtree(work / 'checkpoint', ignore_errors=True)


def figures_of(summary: Mapping[str, object], case: Case) -> dict[str, str]:
    """Return the main figures of a run: words -> value with unit."""

    def number(name: str) -> float:
        return float(str(summary[name]))

    note = grain_note(case)
    return {
        'slip (second half)': f'{100 * number("slip"):.1f} % '
        f'({100 * number("slip_second_half"):.1f} %)',
        'gross traction H': f'{number("gross_traction"):.2f} N',
        'motion resistance R_r': f'{number("motion_resistance"):.2f} N',
        'net traction P_d (demanded)': f'{number("net_traction"):.2f} N '
        f'({number("demanded_pull"):.2f} N)',
        'torque H r_w; on the body': f'{number("torque_gross"):.3f} N m; '
        f'{number("torque_body"):.3f} N m',
        'sinkage below the undisturbed surface': f'{1000 * number("sinkage"):.1f} mm '
        f'(before rotation {1000 * number("sinkage_static"):.1f} mm, z_a '
        f'{1000 * number("sinkage_average"):.1f} mm)',
        'power number': f'{number("power_number"):.3f}',
        'pull coefficient': f'{number("pull_coefficient"):.3f}',
    } | ({'grains': note} if note else {})


def as_text(summary: Mapping[str, object], case: Case) -> str:
    """Return the main figures, one a line."""
    return '\n'.join(f'{words}: {value}' for words, value in figures_of(summary, case).items())


def write_report(
    folder: Path,
    series: np.ndarray,  # (k, columns of ``bookkeeping.SERIES``) over the travel
    case: Case,
    figures: Mapping[str, str],  # words of a figure -> its value with unit
) -> None:
    """Write ``report.html`` into the folder of a run, with ``bed.png`` and ``film.gif`` of it."""
    from wheel_terra_estimator.reporting.html import render

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
    part.write_text(page, encoding='utf-8')
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
