# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Runs for Nakashima et al. 2010: tables 6 and 7, figures 6 to 18, section 6.

The calibrated case turns its wheels eight times as fast as the paper's; the part `paper_speed`
runs a choice of the same cases at the paper's own speed, eight times the cost. What the rows say
of the paper's statements is in ``wheel_terra_lab.reproduction.nakashima``.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from wheel_terra_lab.soilbin import files, metrics
from wheel_terra_lab.soilbin.case import EARTH_GRAVITY, Case
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.study import Job

TABLE = 'reproduction.csv'
PARTS = ('table7', 'table6', 'loads', 'moon', 'high_lugs')
PAPER_SPEED = 'paper_speed'
"""Part that runs only where it is asked for: some half an hour per case and core."""
SLOPES_PAPER_SPEED = (0.0, 25.0, 10.0, 20.0, 15.0)  # of wheel 2, the most telling ones first
WHEELS_PAPER_SPEED = (8, 1, 5, 4, 7, 3, 6, 9)  # of table 7 beside wheel 2, the extremes first
WHEELS = range(1, 10)
SLOPES_TABLE6 = (0.0, 5.0, 10.0, 15.0)
TABLE7_SLOPE = 25.0  # [deg]
FULL_LOAD = 19.6  # [N], of `wheel_case`
MOON = EARTH_GRAVITY / 6
MOON_LOAD = 14.7  # [N]
MOON_PULLS = (0.0, 0.1, 0.2, 0.3)  # P/W on the level
MOON_SLOPES = (10.0, 15.0, 21.0, 25.0)
EARTH_SLOPES = (15.0, 25.0)
HIGH_LUGS = 8  # wheel of figures 12(b) and 13(b): lugs of 20 mm
HIGH_LUG_SLOPES = (25.0, 0.0, 15.0)  # the most telling ones first
HIGH_LUG_GRAINS = 2.0  # least grain scale of these figures
PATH_LOAD = 14.7  # [N]
PATH_SLOPES = (10.0, 20.0)  # of figure 8, beside those above
OTHER_LOADS = (9.8, 14.7)  # [N] of figure 12, beside 19.6
OTHER_WIDTHS = (0.05, 0.15)  # [m] of figure 13, beside 0.1


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


def _job(
    part: str, wheel: int, slope_deg: float, seed: int, scale: float, name: str = '', **changes: Any
) -> Job:
    """Return a case of a part; ``name`` says what is changed in it, ``changes`` what it is."""
    case = wheel_case(wheel, slope_deg, seed, scale)
    case = case.replace(name=f'{name}, bed {seed}' if name else case.name, **changes)
    width = changes.get('wheel__width')
    pull = case.operation.hitch_pull / case.operation.vertical_load
    labels: dict[str, object] = {
        'name': case.name,
        'part': part,
        'wheel': wider(wheel, width) if width else wheel,
        'slope_deg': slope_deg,
        'load': case.operation.vertical_load,
        'gravity': round(case.operation.gravity, 4),
        'pull_ratio': round(pull, 6),
        'grain_scale': case.bed.grain_scale,
        'seed': case.bed.seed,
        'speed_factor': case.operation.speed_factor,
    }
    return Job(case, labels)


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """Return the cases, the most telling ones first: every part over one bed, then the next."""
    parts = tuple(arguments.part or PARTS)
    scale = arguments.grain_scale or 1.0
    found: list[Job] = []
    for seed in range(1, 1 + (arguments.seeds or 3)):
        bed = seed, scale
        if 'table7' in parts:
            found += [_job('table7', wheel, TABLE7_SLOPE, *bed) for wheel in WHEELS]
        if 'table6' in parts:
            found += [_job('table6', w, slope, *bed) for slope in SLOPES_TABLE6 for w in WHEELS]
            # Wheel 2 also where the paper's slips 20 %, and between its two steep slopes.
            found += [_job('table6', 2, slope, *bed) for slope in (7.1, 20.0)]
        if 'loads' in parts:
            found += [
                _loaded('loads', 2, load, slope, *bed)
                for load in OTHER_LOADS
                for slope in (0.0, 15.0, TABLE7_SLOPE)
            ]
        if 'moon' in parts:
            found += _moon(seed, scale)
        if 'high_lugs' in parts:
            found += _high_lugs(seed, max(scale, HIGH_LUG_GRAINS))
        if PAPER_SPEED in parts:
            found += _paper_speed(seed, scale)
    return found


def _loaded(part: str, wheel: int, load: float, slope: float, seed: int, scale: float) -> Job:
    name = f'wheel {wheel}, {load:g} N, {slope:g} deg'
    return _job(part, wheel, slope, seed, scale, name, operation__vertical_load=load)


def _high_lugs(seed: int, scale: float) -> list[Job]:
    """Figures 8, 12(b), 13(b): lugs of 20 mm under three loads and on wheels of other widths."""
    found = []
    for slope in HIGH_LUG_SLOPES:
        for load in (*OTHER_LOADS, FULL_LOAD):
            found.append(_loaded('high_lugs', HIGH_LUGS, load, slope, seed, scale))
        for width in OTHER_WIDTHS:
            name = f'wheel {wider(HIGH_LUGS, width)}, {slope:g} deg'
            found.append(_job('high_lugs', HIGH_LUGS, slope, seed, scale, name, wheel__width=width))
    for slope in PATH_SLOPES:
        found.append(_loaded('high_lugs', HIGH_LUGS, PATH_LOAD, slope, seed, scale))
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
            PAPER_SPEED, wheel, slope, seed, scale,
            f"wheel {wheel}, {slope:g} deg, paper's speed", operation__speed_factor=1.0,
        )
        for wheel, slope in cases
    ]  # fmt: skip


def _moon(seed: int, scale: float) -> list[Job]:
    """Section 6: wheel 5 under 14.7 N on a bed of 15 cm; slopes of the Moon in the bin of 1.6 m.

    Slopes of the Earth are those of section 5, in its bin: figure 20 alone is captioned "with
    extended soil bin condition".
    """
    found = []
    deep: dict[str, Any] = {'operation__vertical_load': MOON_LOAD, 'bed__rows': 40}
    for gravity, place in ((MOON, 'Moon'), (EARTH_GRAVITY, 'Earth')):
        for ratio in MOON_PULLS:
            pull = {'operation__gravity': gravity, 'operation__hitch_pull': ratio * MOON_LOAD}
            name = f'{place}, level, P/W {ratio:g}'
            found.append(_job('moon', 5, 0.0, seed, scale, name, **deep, **pull))
    long = {'operation__gravity': MOON, 'operation__start': 0.7, 'bed__length': 1.6}
    for slope in MOON_SLOPES:
        found.append(_job('moon', 5, slope, seed, scale, f'Moon, {slope:g} deg', **deep, **long))
    for slope in EARTH_SLOPES:
        name = f'Earth, {slope:g} deg'
        found.append(_job('moon', 5, slope, seed, scale, name, operation__vertical_load=MOON_LOAD))
    return found


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


def table6_rows(rows: Sequence[Row], wheel: int) -> list[Row]:
    """Return the rows over the slopes of one wheel."""
    return of(rows, 'table6', wheel) + of(rows, 'table7', wheel)
