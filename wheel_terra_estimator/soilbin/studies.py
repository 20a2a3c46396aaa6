# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The studies behind ``wheel-terra soilbin``: which cases, what page."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.soilbin import (
    calibration,
    convergence,
    measurements,
    reproduction,
    sensitivity,
)
from wheel_terra_estimator.soilbin.study import Job, run_study

STUDIES = {
    'calibrate': calibration,
    'reproduce': reproduction,
    'sensitivity': sensitivity,
    'convergence': convergence,
    'rows': measurements,
}


def run(arguments: argparse.Namespace, cache: Path | None) -> int:
    """Run (or go on with) a study; write its table as rows come and its page at the end."""
    module = STUDIES[arguments.action]
    folder: Path = arguments.output
    table = folder / module.TABLE
    if folder.exists() and not (arguments.resume or arguments.report_only):
        if not arguments.overwrite:
            raise UserError(f'{folder}: exists already; --resume goes on, --overwrite starts anew')
        for old in (table, *folder.glob('*.md')):
            old.unlink(missing_ok=True)
    jobs: list[Job] = module.jobs(arguments)
    workers = 0 if arguments.report_only else arguments.workers or os.cpu_count() or 1
    rows = run_study(jobs, table, folder / '.work', cache, workers, arguments.dask)
    module.report(arguments, rows, folder)
    return 0
