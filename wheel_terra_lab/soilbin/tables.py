# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Markdown tables of the studies' pages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    if not body:
        return ['Not computed yet.']
    rows = [head, ['---'] * len(head), *body]
    return ['| ' + ' | '.join(row) + ' |' for row in rows]


def value(mean: float, deviation: float = math.nan) -> str:
    """Return a mean with its deviation in brackets, three digits."""
    if math.isnan(mean):
        return '-'
    text = f'{mean:.3g}'
    return text if math.isnan(deviation) else f'{text} ({deviation:.2g})'


def page(path: Path, lines: Sequence[str]) -> None:
    """Write a page, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix('.part')
    part.write_text('\n'.join(lines).rstrip() + '\n', encoding='utf-8')
    part.replace(path)
