# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Virtual measurements from grains, as rows for ``wheel-terra diagnose``."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from wheel_terra_lab.soilbin import output
from wheel_terra_lab.soilbin.case import Case
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.reproduction import wheel_case
from wheel_terra_lab.soilbin.study import Job

TABLE = 'sweep.csv'
PAGES = ('pull_sweep.csv', 'slip_sweep.csv', 'slopes.csv')
PULL_RATIOS = (0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.24, 0.28, 0.32, 0.36)
SLIPS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
SLOPES = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0)


def sweep_case(sweep: str, value: float, seed: int, grain_scale: float) -> Case:
    """Return one operating point of wheel 2: a pull or an imposed slip on the level.

    The sweep "pull" has free travel with a pull at the hitch; "slip" holds the travel speed.
    """
    case = wheel_case(2, 0.0, seed, grain_scale)
    if sweep == 'pull':
        pull = value * case.operation.vertical_load
        return case.replace(name=f'pull ratio {value:g}, bed {seed}', operation__hitch_pull=pull)
    return case.replace(name=f'slip {value:g}, bed {seed}', operation__imposed_slip=value)


def jobs(arguments: argparse.Namespace) -> list[Job]:
    """Return the operating points of a sweep; the pull sweep also climbs the paper's slopes."""
    sweep, scale = arguments.sweep, arguments.grain_scale or 2.0
    values = PULL_RATIOS if sweep == 'pull' else SLIPS
    found = []
    for seed in range(1, 1 + (arguments.seeds or 2)):
        cases = [sweep_case(sweep, value, seed, scale) for value in values]
        if sweep == 'pull':
            cases += [wheel_case(2, slope, seed, scale) for slope in SLOPES[1:]]
        for case in cases:
            labels: dict[str, object] = {
                'name': case.name,
                'sweep': sweep,
                'slope': case.operation.slope,
                'seed': seed,
                'normal_load': case.operation.vertical_load * math.cos(case.operation.slope),
                'wheel_radius': case.wheel.rim_radius,
                'wheel_width': case.wheel.width,
                'lug_height': case.wheel.lug_height,
                'lug_count': case.wheel.lug_count,
                'gravity': case.operation.gravity,
                'angular_velocity': case.rim_rate,
            }
            found.append(Job(case, labels))
    return found


def report(sweep: str, rows: Sequence[Row], folder: Path) -> None:
    """Write the rows that travelled (level ones, and all) in the table format of diagnose."""
    usable = [row for row in rows if row.get('slip') and -1 <= float(row['slip']) <= 1]
    usable.sort(key=lambda row: (float(row['slope']), float(row['slip'])))

    def measured(row: Row) -> dict[str, float]:
        named = {'drawbar_pull': 'net_traction', 'torque': 'torque_body'}
        return {name: float(row[named.get(name, name)]) for name in output.ROW_COLUMNS}

    level = [measured(row) for row in usable if float(row['slope']) == 0]
    output.write_rows(folder / f'{sweep}_sweep.csv', level)
    if any(float(row['slope']) > 0 for row in usable):
        climbing = [measured(row) for row in usable if row['name'].startswith('wheel')]
        output.write_rows(folder / 'slopes.csv', climbing)
