# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How grain size, time step, speed and bin change slip and forces of wheel 2 on slopes."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_lab.soilbin import metrics
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.reproduction import wheel_case
from wheel_terra_lab.soilbin.study import Job

TABLE = 'convergence.csv'
PAGES = ('convergence_table.md',)
SLOPES = (15.0, 25.0)
SPEEDS = ('coarse (grains x2)', 'coarse, speed x1')
"""Variants that run on all of the paper's slopes: what its own rim speed changes."""
OTHER_SLOPES = (10.0, 0.0, 20.0)  # the most telling ones first
VARIANTS: dict[str, dict[str, object]] = {
    'coarse (grains x2)': {},
    'grains x1.5': {'bed__grain_scale': 1.5},
    'full scale': {'bed__grain_scale': 1.0},
    'coarse, half the time step': {'numerics__time_step': 1.35e-4},
    'coarse, quarter of the time step': {'numerics__time_step': 0.675e-4},
    'coarse, speed x1': {'operation__speed_factor': 1.0},
    'coarse, speed x2': {'operation__speed_factor': 2.0},
    'coarse, speed x8': {'operation__speed_factor': 8.0},
    'coarse, bin of 0.7 m': {'bed__length': 0.7},
    'coarse, bed half as deep again': {'bed__rows': 42},
}


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """Return variants x slopes x beds, the cheap ones first."""
    found = []
    for seed in range(1, 1 + (arguments.seeds or 3)):
        cases = [(variant, slope) for variant in VARIANTS for slope in SLOPES]
        cases += [(variant, slope) for slope in OTHER_SLOPES for variant in SPEEDS]
        for variant, slope in cases:
            case = wheel_case(2, slope, seed, 2.0).replace(**VARIANTS[variant])
            case = case.replace(name=f'{variant}, {slope:g} deg, bed {seed}')
            labels = {'name': case.name, 'variant': variant, 'slope_deg': slope, 'seed': seed}
            found.append(Job(case, labels))
    return found


def report(arguments: argparse.Namespace, rows: Sequence[Row], folder: Path) -> None:
    """Write the table."""
    from wheel_terra_lab.soilbin.tables import page, table, value

    head = ['variant', 'slope [deg]', 'beds', 'slip [%]', 'H [N]', 'R_r [N]', 'z_a [cm]',
            'time step [s]', 'wall time [s]']  # fmt: skip
    body = []
    for variant in VARIANTS:
        for slope in sorted((*SLOPES, *OTHER_SLOPES)):
            part = [
                row
                for row in rows
                if row['variant'] == variant
                and float(row['slope_deg']) == slope
                and row.get('slip')
            ]
            if not part:
                continue
            cells = []
            for name, unit in (('slip', 100), ('gross_traction', 1), ('motion_resistance', 1),
                               ('sinkage_average', 100)):  # fmt: skip
                mean, deviation = metrics.spread(metrics.number(row, name) for row in part)
                cells.append(value(unit * mean, unit * deviation))
            step = metrics.number(part[0], 'time_step')
            wall = metrics.spread(metrics.number(row, 'wall_seconds') for row in part)[0]
            body.append([variant, f'{slope:g}', str(len(part)), *cells, f'{step:.2e}',
                         f'{wall:.0f}' if math.isfinite(wall) else ''])  # fmt: skip
    page(
        folder / 'convergence_table.md',
        ['# Grain size, time step, speed and bin (wheel 2, 19.6 N)', '', *table(head, body), '',
         "Mean (deviation between beds). Rim speed eight times the paper's but where the variant "
         'says its own. Written by `wheel-terra soilbin convergence`.'],
    )  # fmt: skip
