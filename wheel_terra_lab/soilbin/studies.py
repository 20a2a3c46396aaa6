# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The studies behind ``wheel-terra soilbin``: which cases."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from wheel_terra_estimator.output_folder import working_folder
from wheel_terra_lab.soilbin import measurements, reproduction
from wheel_terra_lab.soilbin.metrics import Row
from wheel_terra_lab.soilbin.output import WORK
from wheel_terra_lab.soilbin.study import Job, run_study

STUDIES = {
    'reproduce': reproduction,
    'rows': measurements,
}


def run(
    arguments: argparse.Namespace,
    cache: Path | None,
    report: Callable[[argparse.Namespace, Sequence[Row], Path], None],
) -> int:
    """Run (or go on with) a study; write its table as rows come and its report at the end."""
    module = STUDIES[arguments.action]
    folder: Path = arguments.output
    jobs: list[Job] = module.jobs(arguments)
    workers = arguments.jobs or os.cpu_count() or 1
    with working_folder(
        folder,
        arguments.overwrite,
        arguments.resume,
        (module.TABLE, *module.PAGES, 'series/', WORK),
    ):
        rows = run_study(
            jobs, folder / module.TABLE, folder / '.work', cache, workers, arguments.scheduler or ''
        )
        report(arguments, rows, folder)
    return 0
