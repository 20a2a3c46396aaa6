# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Reproduction of Nakashima et al. 2010: tables 6 and 7, figures 11 to 16, section 6.

The calibrated case turns its wheels eight times as fast as the paper's; the part `paper_speed`
runs a choice of the same cases at the paper's own speed, eight times the cost.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_lab.soilbin import files, metrics, reproduced_figures
from wheel_terra_lab.soilbin.case import EARTH_GRAVITY, Case
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.study import Job

TABLE = 'reproduction.csv'
PAGES = ('comparison.md', reproduced_figures.PAGE, reproduced_figures.PICTURE)
PARTS = ('table7', 'table6', 'loads', 'moon', 'high_lugs')
SPEED_SENTENCE = "Rim speed: eight times the paper's."
PAPER_SPEED = 'paper_speed'
"""Part that runs only where it is asked for: some half an hour per case and core."""
SLOPES_PAPER_SPEED = (0.0, 25.0, 10.0, 20.0, 15.0)  # of wheel 2, the most telling ones first
WHEELS_PAPER_SPEED = (8, 1, 5, 4, 7, 3, 6, 9)  # of table 7 beside wheel 2, the extremes first
WHEELS = range(1, 10)
SLOPES_TABLE6 = (0.0, 5.0, 10.0, 15.0)
TABLE7_SLOPE = 25.0  # [deg]
MOON = EARTH_GRAVITY / 6
MOON_PULLS = (0.0, 0.1, 0.2, 0.3)  # P/W on the level
MOON_SLOPES = (10.0, 15.0, 21.0, 25.0)
EARTH_SLOPES = (0.0, 15.0, 25.0)
LEAST_WHEELS_IN_ORDER = 5  # fewer have no order to speak of
HIGH_LUGS = 8  # wheel of figures 12(b) and 13(b): lugs of 20 mm
HIGH_LUG_SLOPES = (25.0, 0.0, 15.0)  # the most telling ones first
HIGH_LUG_GRAINS = 2.0  # least grain scale of these figures
OTHER_LOADS = (9.8, 14.7)  # [N] of figure 12, beside 19.6
OTHER_WIDTHS = (0.05, 0.15)  # [m] of figure 13, beside 0.1
FIGURES_TABLE7 = {
    'slip': 'slip',
    'H': 'gross_traction',
    'R_r': 'motion_resistance',
    'z_a': 'sinkage_average',
}


def wheel_case(wheel: int, slope_deg: float, seed: int, grain_scale: float) -> Case:
    """Return the calibrated case of one of the paper's wheels under 19.6 N."""
    case = files.load(['calibrated', f'wheel_{wheel}'])
    name = f'wheel {wheel}, {slope_deg:g} deg, bed {seed}'
    return case.replace(
        name=name,
        operation__slope=math.radians(slope_deg),
        bed__seed=seed,
        bed__grain_scale=grain_scale or case.bed.grain_scale,
        numerics__samples=400,
        numerics__frames=0,
    )


def _job(case: Case, part: str, wheel: int | str, slope_deg: float, **labels: object) -> Job:
    base: dict[str, object] = {
        'name': case.name,
        'part': part,
        'wheel': wheel,
        'slope_deg': slope_deg,
        'load': case.operation.vertical_load,
        'gravity': round(case.operation.gravity, 4),
        'pull_ratio': 0.0,
        'grain_scale': case.bed.grain_scale,
        'seed': case.bed.seed,
        'speed_factor': case.operation.speed_factor,
    }
    return Job(case, base | labels)


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """Return the cases, the most telling ones first: every part over one bed, then the next."""
    parts = tuple(arguments.part or PARTS)
    scale = arguments.grain_scale or 1.0
    found: list[Job] = []
    for seed in range(1, 1 + (arguments.seeds or 3)):
        if 'table7' in parts:
            found += [_job(wheel_case(w, 25.0, seed, scale), 'table7', w, 25.0) for w in WHEELS]
        if 'table6' in parts:
            found += [
                _job(wheel_case(w, slope, seed, scale), 'table6', w, slope)
                for slope in SLOPES_TABLE6
                for w in WHEELS
            ]
            # Wheel 2 also where the paper's slips 20 %, and between its two steep slopes.
            found += [
                _job(wheel_case(2, slope, seed, scale), 'table6', 2, slope) for slope in (7.1, 20.0)
            ]
        if 'loads' in parts:
            for load in OTHER_LOADS:
                for slope in (0.0, 15.0, 25.0):
                    case = wheel_case(2, slope, seed, scale).replace(
                        name=f'wheel 2, {load:g} N, {slope:g} deg, bed {seed}',
                        operation__vertical_load=load,
                    )
                    found.append(_job(case, 'loads', 2, slope))
        if 'moon' in parts:
            found += _moon(seed, scale)
        if 'high_lugs' in parts:
            found += _high_lugs(seed, scale)
        if PAPER_SPEED in parts:
            found += _paper_speed(seed, scale)
    return found


def _high_lugs(seed: int, scale: float) -> list[Job]:
    """Figures 12(b) and 13(b): lugs of 20 mm under three loads and on wheels of other widths."""
    found = []
    for slope in HIGH_LUG_SLOPES:
        base = wheel_case(HIGH_LUGS, slope, seed, max(scale, HIGH_LUG_GRAINS))
        for load in (*OTHER_LOADS, base.operation.vertical_load):
            name = f'wheel {HIGH_LUGS}, {load:g} N, {slope:g} deg, bed {seed}'
            case = base.replace(name=name, operation__vertical_load=load)
            found.append(_job(case, 'high_lugs', HIGH_LUGS, slope))
        for width in OTHER_WIDTHS:
            wheel = wider(HIGH_LUGS, width)
            name = f'wheel {wheel}, {slope:g} deg, bed {seed}'
            case = base.replace(name=name, wheel__width=width)
            found.append(_job(case, 'high_lugs', wheel, slope))
    return found


def wider(wheel: int, width: float) -> str:
    """Return how one of the paper's wheels is called at another width [m]."""
    return f'{wheel} of {1000 * width:g} mm'


def _paper_speed(seed: int, scale: float) -> list[Job]:
    """Wheel 2 over the slopes on every bed, the wheels of table 7 on the first."""
    cases = [(2, slope) for slope in SLOPES_PAPER_SPEED]
    if seed == 1:
        cases += [(wheel, TABLE7_SLOPE) for wheel in WHEELS_PAPER_SPEED]
    return [
        _job(
            wheel_case(wheel, slope, seed, scale).replace(
                name=f"wheel {wheel}, {slope:g} deg, bed {seed}, paper's speed",
                operation__speed_factor=1.0,
            ),
            PAPER_SPEED,
            wheel,
            slope,
        )
        for wheel, slope in cases
    ]


def _moon(seed: int, scale: float) -> list[Job]:
    """Section 6: wheel 5 under 14.7 N on a bed of 15 cm; slopes in the bin of 1.6 m."""
    found = []
    for gravity, place in ((MOON, 'Moon'), (EARTH_GRAVITY, 'Earth')):
        flat = wheel_case(5, 0.0, seed, scale).replace(
            operation__gravity=gravity, operation__vertical_load=14.7, bed__rows=40
        )
        for ratio in MOON_PULLS:
            case = flat.replace(
                name=f'{place}, level, P/W {ratio:g}, bed {seed}',
                operation__hitch_pull=ratio * 14.7,
            )
            found.append(_job(case, 'moon', 5, 0.0, pull_ratio=ratio))
        slopes = MOON_SLOPES if place == 'Moon' else EARTH_SLOPES[1:]
        for slope in slopes:
            case = flat.replace(
                name=f'{place}, {slope:g} deg, bed {seed}',
                operation__slope=math.radians(slope),
                operation__start=0.7,
                bed__length=1.6,
            )
            found.append(_job(case, 'moon', 5, slope))
    return found


# -- page -----------------------------------------------------------------------------------------


def report(arguments: argparse.Namespace, rows: Sequence[Row], folder: Path) -> None:
    """Write the comparison with the paper, misses included, and the page of its figures."""
    from wheel_terra_lab.soilbin.tables import page

    scales = sorted({row['grain_scale'] for row in rows})
    parts = ['# Paper and virtual soil bin side by side', '']
    parts.append(
        f'{len(rows)} runs, grain scale {", ".join(scales) or "-"}; mean (deviation between beds). '
        'Written by `wheel-terra soilbin reproduce`.'
    )
    for lines in (table7_lines, table6_lines, reproduced_figures.lines, load_lines, moon_lines):
        title, *body = lines(rows)
        parts += ['', title, '', SPEED_SENTENCE, *body]
    parts += ['', *paper_speed_lines(rows)]
    failed = [row for row in rows if row.get('stopped')]
    if failed:
        parts += ['', '## Runs that stopped early', '']
        parts += [f'- {row["name"]}: {row["stopped"]}' for row in failed]
    page(folder / 'comparison.md', parts)
    page(folder / reproduced_figures.PAGE, reproduced_figures.page_lines(rows))
    reproduced_figures.draw(rows, folder / reproduced_figures.PICTURE)


def of(rows: Sequence[Row], part: str, wheel: int | None = None) -> list[Row]:
    """Return the rows of a part (and a wheel) that gave a result."""
    return [
        row
        for row in rows
        if row['part'] == part and (wheel is None or row['wheel'] == str(wheel)) and row.get('slip')
    ]


def table7_comparison(rows: Sequence[Row]) -> dict[int, dict[str, tuple[float, float]]]:
    """Return slip, H, R_r, z_a with deviation of the wheels that have rows at 25 deg."""
    found = {w: metrics.table7_spread(of(rows, 'table7', w)) for w in WHEELS}
    return {w: values for w, values in found.items() if math.isfinite(values['slip'][0])}


def table7_lines(rows: Sequence[Row]) -> list[str]:
    """Return table 7 side by side with the errors and rank correlations."""
    from wheel_terra_lab.soilbin.tables import table, value

    paper, ours = metrics.published('table7'), table7_comparison(rows)
    units = {'slip': 100.0, 'gross_traction': 1.0, 'motion_resistance': 1.0, 'sinkage_average': 100}
    names = ('slip [%]', 'H [N]', 'R_r [N]', 'z_a [cm]')
    head = ['wheel', 'beds', *(f'{name} {who}' for name in names for who in ('paper', 'ours'))]
    body = []
    for wheel, values in ours.items():
        cells = [str(wheel), str(len(of(rows, 'table7', wheel)))]
        for key, unit in units.items():
            mean, deviation = values[key]
            cells += [f'{unit * paper[wheel][key]:.3g}', value(unit * mean, unit * deviation)]
        body.append(cells)
    lines = ['## Table 7: 25 deg, W 19.6 N', '', *table(head, body), '']
    others = [wheel for wheel in ours if wheel != 2]
    if len(others) > 2:
        lines.append('Median error over the wheels other than 2 (which the fit used): '
                     + ', '.join(median_errors(ours, others)) + '.')  # fmt: skip
        lines.append('')
        agreement = (
            f'{name} {metrics.rank_correlation(*zip(*pairs, strict=True)):.2f}'
            for name, key in FIGURES_TABLE7.items()
            if (pairs := [(ours[w][key][0], paper[w][key]) for w in ours])
        )
        lines.append(f'Rank correlation with the paper over all wheels: {", ".join(agreement)}.')
        lines += _rank_lines(rows, ours)
    return lines


def _rank_lines(rows: Sequence[Row], ours: dict[int, dict[str, tuple[float, float]]]) -> list[str]:
    """Return what the scatter between beds leaves of the rank correlation of z_a."""
    import numpy as np

    deviations = [ours[w]['sinkage_average'][1] for w in ours]
    beds = min(len(of(rows, 'table7', w)) for w in ours)
    if beds < 2 or not np.isfinite(deviations).all():
        return []
    deviation = float(np.sqrt(np.mean(np.square(deviations))))
    published = metrics.published('table7')
    low, middle, high = metrics.rank_spread(
        [published[w]['sinkage_average'] for w in ours], deviation, beds
    )
    return [
        '',
        f'z_a scatters by {1000 * deviation:.1f} mm between beds. Were the wheels exactly as in '
        f"the paper's table, that scatter alone, in one bed of theirs and {beds} of ours, would "
        f'leave a rank correlation of {middle:.2f} ({low:.2f} to {high:.2f}, 5 to 95 %).',
    ]


def median_errors(
    ours: dict[int, dict[str, tuple[float, float]]], wheels: Sequence[int]
) -> list[str]:
    """Return the median error of each figure of table 7 in words."""
    import numpy as np

    paper = metrics.published('table7')
    words = []
    for name, key in FIGURES_TABLE7.items():
        errors = [abs(ours[w][key][0] - paper[w][key]) for w in wheels]
        if key == 'slip':
            words.append(f'slip {100 * np.median(errors):.1f} points')
        else:
            ratio = np.median([e / paper[w][key] for e, w in zip(errors, wheels, strict=True)])
            words.append(f'{name} {100 * ratio:.0f} %')
    return words


def table6_rows(rows: Sequence[Row], wheel: int) -> list[Row]:
    """Return the rows over the slopes of one wheel."""
    return of(rows, 'table6', wheel) + of(rows, 'table7', wheel)


def table6_lines(rows: Sequence[Row]) -> list[str]:
    """Return table 6 side by side with the sums of ranks."""
    from wheel_terra_lab.soilbin.tables import table, value

    paper = metrics.published('table6')
    ours = {w: metrics.table6_spread(table6_rows(rows, w)) for w in WHEELS if of(rows, 'table6', w)}
    if not ours:
        return ['## Table 6', '', 'Not computed yet.']
    sums: dict[int, int] = {}
    # Ranks among fewer wheels, or before their slopes are run, are not the paper's.
    needed = {0.0, 5.0, 15.0}
    if all(needed <= set(metrics.by_slope(table6_rows(rows, w), 'slip')[0]) for w in WHEELS):
        sums = metrics.rank_sums({w: {k: v[0] for k, v in ours[w].items()} for w in ours})
    names = ('slope at 20 % [deg]', 'PN level', 'PN 15 deg', 'PN 20 %')
    head = ['wheel', *(f'{name} {who}' for name in names for who in ('paper', 'ours'))]
    head += ['ranks paper', 'ranks ours']
    body = []
    for wheel, values in ours.items():
        cells = [str(wheel)]
        for key in metrics.TABLE6:
            cells += [f'{paper[wheel][key]:.3g}', value(*values[key])]
        body.append([*cells, f'{paper[wheel]["sum_of_ranks"]:.0f}', str(sums.get(wheel, '-'))])
    lines = ['## Table 6: W 19.6 N', '', *table(head, body), '']
    if sums:
        best = min(sums, key=lambda w: sums[w])
        agreement = metrics.rank_correlation(
            [sums[w] for w in sums], [paper[w]['sum_of_ranks'] for w in sums]
        )
        lines.append(
            f'Smallest sum of ranks: wheel {best} (paper: wheel 5); rank correlation of the sums '
            f'{agreement:.2f}.'
        )
    return lines


def load_lines(rows: Sequence[Row]) -> list[str]:
    """Return figure 12 and the text's numbers on the wheel load."""
    from wheel_terra_lab.soilbin.tables import table, value

    paper = {9.8: (1.46, 1.18), 14.7: (2.18, 1.59), 19.6: (2.94, 1.71)}
    body = []
    for load, (resistance, sinkage) in paper.items():
        part = of(rows, 'loads') + of(rows, 'table7', 2)
        part = [r for r in part if r['slope_deg'] == '25' and float(r['load']) == load]
        if part:
            mean = {k: metrics.spread(metrics.number(r, k) for r in part)
                    for k in ('motion_resistance', 'sinkage_average', 'torque_coefficient',
                              'power_number')}  # fmt: skip
            za = mean['sinkage_average']
            body.append([f'{load:g}', f'{resistance:g}', value(*mean['motion_resistance']),
                         f'{sinkage:g}', value(100 * za[0], 100 * za[1]),
                         '0.572-0.574', value(*mean['torque_coefficient']),
                         value(*mean['power_number'])])  # fmt: skip
    head = ['W [N]', 'R_r paper', 'R_r ours', 'z_a [cm] paper', 'z_a ours', 'H/W paper',
            'H/W ours', 'PN ours']  # fmt: skip
    return ['## Figure 12: wheel 2 at 25 deg under three loads', '', *table(head, body)]


def moon_lines(rows: Sequence[Row]) -> list[str]:
    """Return section 6: level pull and slopes in 1/6 g."""
    from wheel_terra_lab.soilbin.tables import table, value

    groups: dict[tuple[str, float, float], list[Row]] = {}
    for row in (r for r in rows if r['part'] == 'moon'):
        key = (
            'Moon' if float(row['gravity']) < 5 else 'Earth',
            float(row['slope_deg']),
            float(row['pull_ratio']),
        )
        groups.setdefault(key, []).append(row)
    told = {('Moon', 0.0, 0.0): '26.3', ('Moon', 21.0, 0.0): '94.4 (z_a 3.01)',
            ('Moon', 25.0, 0.0): 'cannot climb', ('Earth', 25.0, 0.0): '68.3'}  # fmt: skip
    body = []
    for key, part in sorted(groups.items()):
        slip = metrics.spread(100 * metrics.number(r, 'slip') for r in part)
        sinkage = metrics.spread(100 * metrics.number(r, 'sinkage_average') for r in part)
        why = next((r['stopped'] for r in part if r.get('stopped')), '')
        body.append([key[0], f'{key[1]:g}', f'{key[2]:g}', told.get(key, ''), value(*slip),
                     value(*sinkage), why])  # fmt: skip
    head = ['gravity', 'slope [deg]', 'P/W', 'slip paper [%]', 'slip ours [%]', 'z_a ours [cm]', '']
    return ['## Section 6: wheel 5, W 14.7 N, bed of 15 cm', '', *table(head, body)]


def paper_speed_lines(rows: Sequence[Row]) -> list[str]:
    """Return the cases at the paper's rim speed beside the same ones eight times as fast."""
    from wheel_terra_lab.soilbin.tables import table, value

    paper = metrics.published('table7')
    body = []
    for wheel, slope in sorted(
        {(int(row['wheel']), float(row['slope_deg'])) for row in of(rows, PAPER_SPEED)}
    ):
        slow = [r for r in of(rows, PAPER_SPEED, wheel) if float(r['slope_deg']) == slope]
        beds = {row['seed'] for row in slow}
        fast = [
            r
            for r in table6_rows(rows, wheel)
            if float(r['slope_deg']) == slope and r['seed'] in beds
        ]
        cells = [str(wheel), f'{slope:g}', str(len(beds))]
        for key, unit in (('slip', 100.0), ('gross_traction', 1.0), ('sinkage_average', 100.0)):
            stated = f'{unit * paper[wheel][key]:.3g}' if slope == TABLE7_SLOPE else '-'
            cells.append(stated)
            for part in (slow, fast):
                mean, deviation = metrics.spread(unit * metrics.number(r, key) for r in part)
                cells.append(value(mean, deviation))
        body.append(cells)
    names = ('slip [%]', 'H [N]', 'z_a [cm]')
    head = ['wheel', 'slope [deg]', 'beds']
    head += [f'{name} {who}' for name in names for who in ('paper', 'its speed', '8 x its speed')]
    title = "## At the paper's rim speed: W 19.6 N"
    if not body:
        return [title, '', 'Not computed yet.']
    said = ['The same beds at both speeds.', *_agreement_at_paper_speed(rows)]
    return [title, '', *table(head, body), '', *said]


def _agreement_at_paper_speed(rows: Sequence[Row]) -> list[str]:
    """Return how far table 7's wheels are from the paper's at its speed, and their order."""
    paper = metrics.published('table7')
    steep = [r for r in of(rows, PAPER_SPEED) if float(r['slope_deg']) == TABLE7_SLOPE]
    wheels = sorted({int(row['wheel']) for row in steep})
    if len(wheels) < LEAST_WHEELS_IN_ORDER:
        return []

    def pairs(key: str) -> tuple[list[float], list[float]]:
        ours = [
            metrics.spread(metrics.number(r, key) for r in of(steep, PAPER_SPEED, wheel))[0]
            for wheel in wheels
        ]
        return ours, [paper[wheel][key] for wheel in wheels]

    apart = [100.0 * abs(a - b) for a, b in zip(*pairs('slip'), strict=True)]
    order = ', '.join(
        f'{name} {metrics.rank_correlation(*pairs(key)):.2f}'
        for name, key in FIGURES_TABLE7.items()
        if name != 'R_r'  # the slope fixes H - R_r
    )
    return [
        f'Slip of the {len(wheels)} wheels on {TABLE7_SLOPE:g} degrees is at most {max(apart):.1f} '
        f"points from the paper's; rank correlations: {order}."
    ]
