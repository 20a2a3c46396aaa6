# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a check says: a finding with its cure, or why it could not look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeAlias

SUREST = 0.99  # confidence that is said at most: nothing is certain
INTERNAL_ERROR = 'internal error, see --debug'  # why a check that failed has nothing to say


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Something wrong, and what mends it."""

    kind: str  # what it is, such as sign, unit or delay
    topic: str  # in the recording
    wheel: str | None = None  # concerned, or several with commas between; None: all
    parameter: str | None = None  # of the rover file that mends it
    value: float | None = None  # of the parameter, with one standard deviation
    std: float | None = None
    confidence: float  # probability that it is so
    words: str  # what was seen, with figures
    cure: str  # what to do, ready to copy where a parameter or a remap does it
    fault: str = ''  # its name in `faults.FAULTS`

    def __str__(self) -> str:
        wheel = f' {self.wheel}:' if self.wheel else ''
        sure = f'{100 * min(self.confidence, SUREST):.0f} %'
        return f'{self.kind} ({sure}), {self.topic}:{wheel} {self.words} -> {self.cure}'


@dataclass(frozen=True)
class NotChecked:
    """A kind of fault that this recording cannot tell, and why (with what to drive instead)."""

    kind: str
    reason: str


Outcome: TypeAlias = 'Finding | NotChecked'


SHOWN = 5  # findings that a terminal shows
ALWAYS_SHOWN = ('sign', 'unit', 'swapped_sides', 'exchanged_wheels', 'missing_wheel', 'drop_outs')
"""Kinds without whose cure nothing else counts: never cut."""


def shown(findings: Sequence[Finding]) -> list[str]:
    """Return the lines of a terminal: the worst findings, and how many more there are."""
    lines = [str(f) for i, f in enumerate(findings) if i < SHOWN or f.kind in ALWAYS_SHOWN]
    more = len(findings) - len(lines)
    return [*lines, f'{more} more (wheel-terra check --json)'] if more else lines


@dataclass
class CheckReport:
    """Findings, what was not checked, and the figures behind both."""

    findings: list[Finding] = field(default_factory=list)
    not_checked: list[NotChecked] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def take(self, outcomes: list[Outcome]) -> None:
        """Sort outcomes in."""
        self.findings += [o for o in outcomes if isinstance(o, Finding)]
        self.not_checked += [o for o in outcomes if isinstance(o, NotChecked)]

    def as_dict(self) -> dict[str, Any]:
        """Return what ``check --json`` prints."""
        return {
            'findings': [
                {key: value for key, value in asdict(finding).items() if key != 'fault'}
                for finding in self.findings
            ],
            'not_checked': [asdict(entry) for entry in self.not_checked],
            'figures': self.figures,
        }
