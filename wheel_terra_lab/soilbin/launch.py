# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Run one case in an engine process of its own and collect what it leaves."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin.bookkeeping import summary
from wheel_terra_lab.soilbin.case import Case, check, to_dict
from wheel_terra_lab.soilbin.stability import time_step

MODULE = 'wheel_terra_lab.soilbin.engine_process'
Progress = Callable[[str, float], None]


class StoppedByUserError(UserError):
    """The run was interrupted; its folder holds a state to go on from."""


class CaseFailedError(UserError):
    """The case cannot give a result (weak bed, engine error): said in words."""


def run_case(
    case: Case,
    folder: Path,
    cache: Path | None,
    progress: Progress | None = None,
) -> dict[str, object]:
    """Run (or go on with) a case in a working folder; return its summary.

    The folder keeps ``series.npy``, ``outcome.json`` and the frames; an interrupted run leaves
    ``checkpoint/`` and goes on from it when called again with the same case. ``progress`` takes
    (stage, fraction). The engine ends, and keeps its state, when this process does.
    """
    check(case)
    time_step(case)
    folder.mkdir(parents=True, exist_ok=True)
    job = {'case': to_dict(case), 'cache': str(cache) if cache else ''}
    job_file = folder / 'job.json'
    if job_file.exists() and json.loads(job_file.read_text())['case'] != _plain(job['case']):
        for name in ('checkpoint', 'checkpoint.new', 'frames'):
            shutil.rmtree(folder / name, ignore_errors=True)
        (folder / 'outcome.json').unlink(missing_ok=True)
    if not (folder / 'outcome.json').exists():
        _write(job_file, json.dumps(job))
        _engine(folder, case.name, progress)
    outcome = json.loads((folder / 'outcome.json').read_text())
    series = np.load(folder / 'series.npy')
    if len(series) < 4:
        raise CaseFailedError(f'{case.name}: {outcome["stopped"] or "the travel is too short"}')
    return summary(case, series, outcome['facts'], outcome['stopped'])


def _plain(data: object) -> object:
    return json.loads(json.dumps(data))


def _write(path: Path, text: str) -> None:
    part = path.with_suffix('.part')
    part.write_text(text)
    part.replace(path)


def _engine(folder: Path, name: str, progress: Progress | None) -> None:
    environment = dict(os.environ, OMP_NUM_THREADS='1')
    with (folder / 'engine.err').open('w') as errors:
        process = subprocess.Popen(
            [sys.executable, '-m', MODULE, str(folder)],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            env=environment,
            start_new_session=True,  # an interrupt at the terminal goes through us
        )
        words, kind = '', ''
        interrupted = False
        while True:
            try:
                for line in process.stdout or ():
                    try:
                        message = json.loads(line)
                    except ValueError:
                        continue
                    if 'error' in message:
                        words, kind = message['error'], message.get('kind', '')
                    elif progress:
                        progress(message['stage'], message['fraction'])
                break
            except KeyboardInterrupt:
                interrupted = True
                process.send_signal(signal.SIGTERM)
        status = process.wait()
    if interrupted or status == 130:
        raise StoppedByUserError(f'{name}: interrupted; its state is kept in {folder}')
    if status:
        if not words:
            lines = (folder / 'engine.err').read_text().strip().splitlines()
            words = f'the engine process ended with status {status}: {lines[-1] if lines else "-"}'
        failed = CaseFailedError if kind or status == 3 else UserError
        raise failed(f'{name}: {words}')
    (folder / 'engine.err').unlink(missing_ok=True)
