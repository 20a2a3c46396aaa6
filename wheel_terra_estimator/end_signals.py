# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Signals that ask a program to end in order."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager


def terminations() -> list[signal.Signals]:
    """Return those beside Ctrl-C: the hang-up of a lost terminal is one unless `nohup` says no."""
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return [signal.SIGTERM] if ignored else [signal.SIGTERM, signal.SIGHUP]


@contextmanager
def handled(numbers: Iterable[signal.Signals], on_signal: Callable[..., object]) -> Iterator[None]:
    """Have signals call a function within the block; nothing outside of the main thread."""
    kept = {}
    if threading.current_thread() is threading.main_thread():
        kept = {number: signal.signal(number, on_signal) for number in numbers}
    try:
        yield
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
