# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Nakashima et al. 2010: tables 6 and 7, figures 6 to 18, section 6, from runs of the soil bin."""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wheel_terra_lab.reproduction.statement import Statement, page
from wheel_terra_lab.soilbin import metrics, reproduced_figures, reproduction
from wheel_terra_lab.soilbin.metrics import Row

TITLE = 'Nakashima et al. 2010, J. Terramechanics 47'
KEPT = 'kept results of the shipped runs; --run computes them anew (hours)'
SLIP_POINTS, FORCE_SHARE, SINKAGE_SHARE = 8.0, 0.10, 0.15
"""Allowed: the paper's own tests lie some 8 points of slip from its runs."""
RANK_AGREEMENT = 0.7
WHY = {
    'sinkage': 'z_a counts from the start of rotation, and how far the wheel sinks before hangs on '
    'how the load is put on, which the paper does not state',
    'steep': 'one or two beds; the wheel digs on, so slip grows with the travel that is counted',
    'soft': 'grain friction and rolling resistance of ours are a stand-in for a strength that the '
    'published list does not contain',
}
MOON = {(0.0, 'slip [%]'): 26.3, (21.0, 'slip [%]'): 94.4, (21.0, 'z_a [cm]'): 3.01}
MOON_KEYS = {'slip [%]': 'slip', 'z_a [cm]': 'sinkage_average'}
MOON_SHARE = 0.10
ON_EARTH = (68.3, 1.53)  # wheel 5, 14.7 N, 25 degrees: slip [%], z_a under 19.6 N [cm]


def kept() -> list[Row]:
    """Return the rows of the shipped runs."""
    with (metrics.DATA / reproduction.TABLE).open(newline='', encoding='utf-8') as stream:
        return list(csv.DictReader(stream))


def statements(rows: Sequence[Row]) -> list[Statement]:
    """Return everything the paper states in numbers or words, beside the rows."""
    return [
        *_table7(rows),
        *_paper_speed(rows),
        *_table6(rows),
        *_figures(rows),
        *_moon(rows),
    ]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the figures side by side."""
    reproduced_figures.draw(rows, path)


def report(_: argparse.Namespace, rows: Sequence[Row], folder: Path) -> None:
    """Write the page and the picture of a study of the soil bin."""
    page_of, picture = (folder / name for name in reproduction.PAGES)
    lines = [*page(TITLE, statements(rows)), f'![paper and ours]({picture.name})', '']
    stopped = [row for row in rows if row.get('stopped')]
    lines += [f'- stopped early, {row["name"]}: {row["stopped"]}' for row in stopped]
    page_of.write_text('\n'.join(lines).rstrip() + '\n', encoding='utf-8')
    draw(rows, picture)


def _table7(rows: Sequence[Row]) -> list[Statement]:
    found = []
    paper, ours = metrics.published('table7'), reproduction.table7_comparison(rows)
    named = {'slip': ('slip [%]', 100.0), 'gross_traction': ('H [N]', 1.0)}
    named |= {'motion_resistance': ('R_r [N]', 1.0), 'sinkage_average': ('z_a [cm]', 100.0)}
    for wheel, values in ours.items():
        for key, (name, unit) in named.items():
            said, have = unit * paper[wheel][key], unit * values[key][0]
            off = abs(have - said)
            share = SINKAGE_SHARE if key == 'sinkage_average' else FORCE_SHARE
            good = off <= SLIP_POINTS if key == 'slip' else off <= share * said
            why = f'{off:.1f} points' if key == 'slip' else f'{100 * off / said:.0f} % apart'
            if not good:
                why += f'; {WHY["sinkage" if key == "sinkage_average" else "soft"]}'
            place, what = 'table 7', f'wheel {wheel}, 25 degrees: {name}'
            found.append(Statement(place, what, f'{said:.3g}', f'{have:.3g}', good, why))
    return found


def _paper_speed(rows: Sequence[Row]) -> list[Statement]:
    """Slip of the nine wheels at the paper's own rim speed, as far as they were run."""
    paper = metrics.published('table7')
    steep = [
        row
        for row in reproduction.of(rows, reproduction.PAPER_SPEED)
        if float(row['slope_deg']) == reproduction.TABLE7_SLOPE
    ]
    pairs = [
        (np.mean([metrics.number(row, 'slip') for row in mine]), paper[wheel]['slip'])
        for wheel in reproduction.WHEELS
        if (mine := [row for row in steep if row['wheel'] == str(wheel)])
    ]
    what = "nine wheels, 25 degrees, the paper's rim speed: largest miss of slip [points]"
    if len(pairs) < len(paper):
        return [Statement('table 7', what, '0', '-', None, f'{len(pairs)} wheels run')]
    off = 100.0 * max(abs(ours - theirs) for ours, theirs in pairs)
    order = metrics.rank_correlation(*zip(*pairs, strict=True))
    why = f'{SLIP_POINTS:g} allowed; rank correlation {order:.2f}'
    return [Statement('table 7', what, '0', f'{off:.1f}', bool(off <= SLIP_POINTS), why)]


def _table6(rows: Sequence[Row]) -> list[Statement]:
    found = []
    paper = metrics.published('table6')
    ours = {
        wheel: {
            key: value[0]
            for key, value in metrics.table6_spread(reproduction.table6_rows(rows, wheel)).items()
        }
        for wheel in reproduction.WHEELS
        if reproduction.of(rows, 'table6', wheel)
    }
    for key in metrics.TABLE6:
        pairs = [
            (values[key], paper[wheel][key])
            for wheel, values in ours.items()
            if math.isfinite(values[key])
        ]
        if len(pairs) < len(paper):
            found.append(Statement('table 6', key, 'nine wheels', f'{len(pairs)}', None, 'not run'))
            continue
        order = metrics.rank_correlation(*zip(*pairs, strict=True))
        off = float(np.median([abs(a - b) / abs(b) for a, b in pairs]))
        why = f'rank correlation, {RANK_AGREEMENT} asked; median {100 * off:.0f} % apart'
        what = f'{key.replace("_", " ")}: order of nine wheels'
        holds = order >= RANK_AGREEMENT
        why += '' if holds else f'; {WHY["soft"]}'
        found.append(Statement('table 6', what, 'its order', f'{order:.2f}', holds, why))
    if len(ours) == len(paper) and all(np.isfinite(list(v.values())).all() for v in ours.values()):
        sums = metrics.rank_sums(ours)
        best = min(sums, key=lambda wheel: sums[wheel])
        what = 'wheel of the smallest sum of ranks'
        found.append(Statement('table 6', what, '5', str(best), best == 5))
    return found


def _figures(rows: Sequence[Row]) -> list[Statement]:
    found = []
    for figure in reproduced_figures.FIGURES:
        values = figure.at(rows, reproduced_figures.STEEPEST)
        told = ', '.join(
            f'{curve.label}: {value:.2f}'
            for curve, value in zip(figure.curves, values, strict=True)
            if math.isfinite(value)
        )
        answer = figure.holds(figure, rows)
        holds = None if answer is None else bool(answer)
        why = 'not run' if holds is None else '' if holds else WHY['soft']
        place = f'figure {figure.name}'
        found.append(Statement(place, figure.statement, 'yes', told or '-', holds, why))
    not_drawn = {
        'figure 8': ('path of the hub', "the paper's is a picture; its end is z_a of table 7"),
        'figure 10': ('soil under two wheels', 'a picture: `soilbin run` draws bed.png, film.gif'),
        'figure 19': ('soil on the Moon', 'a picture, as figure 10'),
        'figure 20': ('soil on the Earth', 'a picture, as figure 10'),
    }
    found += [Statement(p, what, 'picture', '-', None, why) for p, (what, why) in not_drawn.items()]
    return found


def _moon(rows: Sequence[Row]) -> list[Statement]:
    if not reproduction.of(rows, 'moon'):
        return [Statement('section 6', 'wheel 5 in 1/6 g', '-', '-', None, 'not run')]
    found = []
    for (slope, name), said in MOON.items():
        have = _mean(rows, slope, moon=True, name=name)
        good = abs(have - said) <= MOON_SHARE * said
        why = f'{100 * abs(have - said) / said:.0f} % apart'
        reason = 'sinkage' if name == 'z_a [cm]' else 'steep' if slope else 'soft'
        why += '' if good else f'; {WHY[reason]}'
        what = f'wheel 5, 1/6 g, {slope:g} degrees: {name}'
        found.append(Statement('section 6', what, f'{said:g}', f'{have:.3g}', good, why))
    climbs = _mean(rows, 25.0, moon=True, name='slip [%]')
    stuck = not math.isfinite(climbs) or climbs > 95.0
    ours = 'does not climb' if stuck else f'slip {climbs:.0f} %'
    what = 'wheel 5, 1/6 g, 25 degrees'
    why = '' if stuck else WHY['steep']
    found.append(Statement('section 6', what, 'cannot climb', ours, stuck, why))
    slip = _mean(rows, 25.0, moon=False, name='slip [%]')
    good = abs(slip - ON_EARTH[0]) <= SLIP_POINTS
    why = f'{abs(slip - ON_EARTH[0]):.1f} points'
    what = 'wheel 5, 14.7 N, 1 g, 25 degrees: slip [%]'
    found.append(Statement('section 6', what, f'{ON_EARTH[0]:g}', f'{slip:.3g}', good, why))
    depth = _mean(rows, 25.0, moon=False, name='z_a [cm]')
    why = 'the bed of 15 cm in the long bin: the wheel had sunk before it turned'
    what = 'the same: z_a [cm], beside 1.53 under 19.6 N'
    found.append(Statement('section 6', what, '-', f'{depth:.2g}', None, why))
    return found


def _mean(rows: Sequence[Row], slope: float, *, moon: bool, name: str) -> float:
    chosen = [
        metrics.number(row, MOON_KEYS[name])
        for row in reproduction.of(rows, 'moon')
        if float(row['slope_deg']) == slope
        and (float(row['gravity']) < reproduced_figures.EARTH) == moon
        and not metrics.number(row, 'pull_ratio')
    ]
    return 100.0 * float(np.mean(chosen)) if chosen else math.nan
