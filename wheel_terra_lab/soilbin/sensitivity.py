# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which assumption decides: the calibrated case with one of them changed, on coarse grains.

Wheel 2 at 15 and 25 degrees, and section 6: wheel 5 on the level in 1/6 g at no pull.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_lab.soilbin import metrics
from wheel_terra_lab.soilbin.case import Case
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.reproduction import MOON, wheel_case
from wheel_terra_lab.soilbin.study import Job

TABLE = 'sensitivity.csv'
PAGES = ('sensitivity_table.md',)
SLOPES = (15.0, 25.0)
NO_ROLLING: dict[str, object] = {'grains__rolling_friction': 0.0}
CALIBRATED = 'calibrated'
# What each line changes against the calibrated case; cheap and telling ones first.
SLOPE_SETTINGS: dict[str, dict[str, object]] = {
    CALIBRATED: {},
    'no resistance to rolling': NO_ROLLING,
    'random bed': {'bed__arrangement': 'random'},
    'tangential stiffness x10': {'grains__tangential_stiffness': 5000.0},
    'published contact list alone': NO_ROLLING | {'grains__damping_ratio': 1.0},
    'grains that do not turn': {'grains__rotation': 'locked'},
    'dense bed (settled with friction 0.05)': {'bed__preparation_friction': 0.05},
    'wheel held along the slope until it turns': {'operation__free_sinkage': 'held'},
    'wheel falls from 2 cm': {'operation__drop_height': 0.02},
    'axle starts 40 cm from the low end': {'operation__start': 0.4},
    'friction on the wheel 0.75': {'grains__wheel_friction': 0.75},
    'critical damping': {'grains__damping_ratio': 1.0},
}
# In 1/6 g the rim speed's Froude number is that on Earth at a speed lower by sqrt(6).
SAME_FROUDE = 8.0 / math.sqrt(6.0)
MOON_SETTINGS: dict[str, dict[str, object]] = {
    CALIBRATED: {},
    'no resistance to rolling': NO_ROLLING,
    'rim speed / sqrt(6)': {'operation__speed_factor': SAME_FROUDE},
    'random bed': {'bed__arrangement': 'random'},
    'mu_r 0.6, k_r 2000': {'grains__rolling_friction': 0.6, 'grains__rolling_stiffness': 2000.0},
    'mu_r 0.3, k_r 2000': {'grains__rolling_friction': 0.3, 'grains__rolling_stiffness': 2000.0},
    'rolling stiffness k_r 750': {'grains__rolling_stiffness': 750.0},
    'tangential stiffness x10': {'grains__tangential_stiffness': 5000.0},
    'load as weight of the same mass (2.45 N)': {'operation__vertical_load': 14.7 / 6},
    'the same on Earth (1 g)': {'operation__gravity': 9.80665},
}


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """Return the settings over every bed, one bed after the other, the dear ones last."""
    found = []
    parts = tuple(arguments.part or ('slopes', 'moon'))
    scale = arguments.grain_scale or 2.0
    for seed in range(1, 1 + (arguments.seeds or 2)):
        for setting, changes in SLOPE_SETTINGS.items() if 'slopes' in parts else ():
            for slope in SLOPES:
                found.append(_job(wheel_case(2, slope, seed, scale), setting, slope, changes))
        if 'moon' not in parts:
            continue
        level = wheel_case(5, 0.0, seed, scale).replace(
            operation__gravity=MOON, operation__vertical_load=14.7, bed__rows=40
        )
        found += [_job(level, name, 0.0, changes) for name, changes in MOON_SETTINGS.items()]
    # The small time step of critical damping costs five times as much: last.
    return sorted(found, key=lambda job: job.case.grains.damping_ratio)


def _job(base: Case, setting: str, slope_deg: float, changes: dict[str, object]) -> Job:
    part = '1/6 g' if slope_deg == 0 else 'slopes'
    name = f'{part}, {setting}, {slope_deg:g} deg, bed {base.bed.seed}'
    labels = {
        'name': name,
        'part': part,
        'setting': setting,
        'slope_deg': slope_deg,
        'seed': base.bed.seed,
    }
    return Job(base.replace(name=name, **changes), labels)


def report(arguments: argparse.Namespace, rows: Sequence[Row], folder: Path) -> None:
    """Write the two tables."""
    from wheel_terra_lab.soilbin.tables import page, table

    names = ['slip [%]', 'H [N]', 'R_r [N]', 'z_a [cm]', 'sinkage before rotation [cm]']
    head = ['changed against the calibrated case', 'beds', 'slip at 15 deg [%]']
    head += ['slip at 25 deg [%]', *names[1:]]
    steep = []
    for setting in SLOPE_SETTINGS:
        both = [_of(rows, 'slopes', setting, slope) for slope in SLOPES]
        if any(both):
            steep.append([setting, str(max(map(len, both))), _figure(both[0], 'slip', 100),
                          *_figures(both[1])])  # fmt: skip
    level = []
    for setting in MOON_SETTINGS:
        part = _of(rows, '1/6 g', setting, 0.0)
        if part:
            level.append([setting, str(len(part)), *_figures(part)])
    lines = ['# Which assumption decides', '', '## Wheel 2, W 19.6 N', '']
    lines += ['Paper at 25 degrees: 73.4 %, 11.25 N, 2.94 N, 1.71 cm. The last columns are those '
              'of 25 degrees.', '', *table(head, steep), '']  # fmt: skip
    lines += ['## Section 6: wheel 5, W 14.7 N, level, 1/6 g, no pull', '']
    lines += ['Paper: slip 26.3 %.', '', *table([head[0], 'beds', *names], level), '']
    lines.append(
        "Mean (deviation between beds), grains x2, rim speed eight times the paper's. Written by "
        '`wheel-terra soilbin sensitivity`.'
    )
    page(folder / 'sensitivity_table.md', lines)


def _of(rows: Sequence[Row], part: str, setting: str, slope_deg: float) -> list[Row]:
    return [
        row
        for row in rows
        if row['part'] == part
        and row['setting'] == setting
        and float(row['slope_deg']) == slope_deg
        and (row.get('slip') or row.get('stopped'))
    ]


def _figure(part: Sequence[Row], name: str, unit: float) -> str:
    """Return a figure in its unit, or why there is none."""
    from wheel_terra_lab.soilbin.tables import value

    mean, deviation = metrics.spread(metrics.number(row, name) for row in part)
    if math.isnan(mean):
        if any('slides' in row.get('stopped', '') for row in part):
            return 'the bed slides'
        return 'stopped' if any(row.get('stopped') for row in part) else '-'
    return value(unit * mean, unit * deviation)


def _figures(part: Sequence[Row]) -> list[str]:
    slip = _figure(part, 'slip', 100)
    if not any(row.get('slip') for row in part):
        return [slip, *['-'] * 4]
    return [slip] + [
        _figure(part, name, unit)
        for name, unit in (('gross_traction', 1), ('motion_resistance', 1),
                           ('sinkage_average', 100), ('sinkage_static', 100))
    ]  # fmt: skip
