# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Completion in bash and zsh, shipped as files that ``tools/complete_shells.py`` writes."""

from __future__ import annotations

from pathlib import Path

FILES = {'bash': 'wheel-terra', 'zsh': '_wheel-terra'}
"""Shell -> its file beside this module, under the name that the shell looks for."""


def path(shell: str) -> Path:
    """Return the shipped file of a shell."""
    return Path(__file__).with_name(FILES[shell])
