# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The words that reports and site use, explained once (``glossary.csv``)."""

from __future__ import annotations

import csv
import functools
import re
from dataclasses import dataclass
from pathlib import Path

_FILE = Path(__file__).with_suffix('.csv')


@dataclass(frozen=True)
class Term:
    """A word, another for the same (or empty), and what it means, in a sentence."""

    term: str
    also: str
    meaning: str


@functools.cache
def terms() -> tuple[Term, ...]:
    """Return all words, in the order in which they build on one another."""
    with _FILE.open(encoding='utf-8', newline='') as file:
        return tuple(Term(**row) for row in csv.DictReader(file))


def used_in(text: str) -> list[Term]:
    """Return the words that a text uses."""
    plain = text.replace('_', ' ').lower()
    return [
        term
        for term in terms()
        if any(re.search(rf'\b{re.escape(w)}\b', plain) for w in (term.term, term.also) if w)
    ]
