# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Signals that ask a program to end in order."""

from __future__ import annotations

import signal


def terminations() -> list[signal.Signals]:
    """Return those beside Ctrl-C: the hang-up of a lost terminal is one unless `nohup` says no."""
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return [signal.SIGTERM] if ignored else [signal.SIGTERM, signal.SIGHUP]
