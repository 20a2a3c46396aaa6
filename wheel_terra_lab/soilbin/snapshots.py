# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Beds that other runs can use again, keyed by all that made them."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

from wheel_terra_lab.soilbin.case import Case

ROOM = 100_000_000  # [bytes] free on the disk, or nothing is kept: the engine does not say
FORMAT = 2  # raise when the stages change what a bed is


def default_cache() -> Path:
    """Return the cache folder of the XDG base directory specification."""
    base = os.environ.get('XDG_CACHE_HOME') or str(Path.home() / '.cache')
    return Path(base) / 'wheel_terra_estimator' / 'soilbin'


def key(case: Case, stage: str) -> str:
    """Return the hash of everything that a settled (or turned) bed depends on."""
    operation = case.operation
    made_of = {
        'format': FORMAT,
        'stage': stage,
        'bed': dataclasses.asdict(case.bed),
        'grains': dataclasses.asdict(case.grains) | {'wheel_friction': None},
        'width': case.wheel.width,
        'gravity': operation.gravity,
        'time_step': case.numerics.time_step,
    }
    if stage == 'turned':
        made_of |= {'slope': operation.slope, 'turning_time': operation.turning_time}
    text = json.dumps(made_of, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def path(cache: Path | None, case: Case, stage: str) -> Path | None:
    """Return where the bed of this stage is kept; None without a cache."""
    return None if cache is None else cache / f'{stage}-{key(case, stage)}.bed'


def store(target: Path | None, write: Callable[[Path], None]) -> None:
    """Write a bed whole or not at all; the cache is a convenience, so a failure is not an error."""
    if target is None:
        return
    part = target.with_suffix(f'.part{os.getpid()}')
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(target.parent).free < ROOM:
            return
        write(part)
        if part.exists() and part.stat().st_size > 0:
            part.replace(target)
    except OSError:
        part.unlink(missing_ok=True)
