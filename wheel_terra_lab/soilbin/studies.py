# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The studies behind ``wheel-terra soilbin``: which cases, what page."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import working_folder
from wheel_terra_lab.soilbin import measurements, reproduction
from wheel_terra_lab.soilbin.output import WORK
from wheel_terra_lab.soilbin.study import Job, run_study

STUDIES = {
    'reproduce': reproduction,
    'rows': measurements,
}


def run(arguments: argparse.Namespace, cache: Path | None) -> int:
    """Run (or go on with) a study; write its table as rows come and its page at the end."""
    module = STUDIES[arguments.action]
    folder: Path = arguments.output
    table = folder / module.TABLE
    if arguments.report_only and not table.is_file():
        raise UserError(
            f'{table}: no rows to report; copy kept ones there, run the study without '
            '--report-only, or see the shipped ones with wheel-terra reproduce nakashima'
        )
    jobs: list[Job] = module.jobs(arguments)
    workers = 0 if arguments.report_only else arguments.jobs or os.cpu_count() or 1
    with working_folder(
        folder,
        arguments.overwrite,
        arguments.resume or arguments.report_only,
        (module.TABLE, *module.PAGES, 'series/', WORK),
    ):
        rows = run_study(jobs, table, folder / '.work', cache, workers, arguments.scheduler or '')
        module.report(arguments, rows, folder)
    return 0
