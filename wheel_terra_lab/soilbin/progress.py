# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A progress bar for the stages of one run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def bar() -> Iterator[Callable[[str, float], None]]:
    """Show one bar per stage with the time left; yield what takes (stage, fraction)."""
    from tqdm import tqdm

    shown: dict[str, tqdm] = {}
    form = '{l_bar}{bar}| {elapsed}, {remaining} left'

    def report(stage: str, fraction: float) -> None:
        if stage not in shown:
            close()
            shown[stage] = tqdm(total=1.0, desc=f'{stage:14s}', bar_format=form, leave=True)
        current = shown[stage]
        current.n = min(1.0, fraction)
        current.refresh()

    def close() -> None:
        for current in shown.values():
            current.close()

    try:
        yield report
    finally:
        close()
