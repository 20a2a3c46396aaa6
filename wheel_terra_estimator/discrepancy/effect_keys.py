# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Effects and their forms are told apart by key: ``multipass``, ``multipass:rut``."""

from __future__ import annotations

from wheel_terra_estimator.terramechanics.effects.base import FORM_MARK


def effect_of(key: str) -> str:
    """Return the name of the effect, whichever its form: ``multipass`` for ``multipass:rut``."""
    return key.partition(FORM_MARK)[0]
