# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Outcome of a check: a finding with its remedy, or the reason why it was not possible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.configuration.parameters import plain_table

SUREST = 0.99  # greatest confidence that is reported
INTERNAL_ERROR = 'internal error, see --debug'  # reason of a check that failed


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
    fault: str = ''  # its name in `FAULTS`

    def __str__(self) -> str:
        wheel = f' {self.wheel}:' if self.wheel else ''
        sure = f'{100 * min(self.confidence, SUREST):.0f} %'
        return f'{self.kind} ({sure}), {self.topic}:{wheel} {self.words} -> {self.cure}'


@dataclass(frozen=True)
class NotChecked:
    """A kind of fault that this recording cannot show, and why (with what to drive instead)."""

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


# Faults -------------------------------------------------------------------------------------------

RATE_UNITS = {
    'revolutions per minute': 2.0 * math.pi / 60.0,
    'degrees per second': math.pi / 180.0,
    'revolutions per second': 2.0 * math.pi,
}
"""Units that wheel rates come in by mistake: factor to rad/s."""
SKID_TRACKS = (0.7, 6.0)  # effective over geometric track of rovers, skidding or not [-]
LEAST_TURN_RATE = 0.01  # yaw rate [rad/s] below which sides are not compared
STANDARD_GRAVITY = 9.80665  # [m/s^2]


@dataclass(frozen=True)
class Fault:
    """A kind of fault; fields as in `faults.yaml`."""

    kind: str
    words: str
    cure: str
    parameter: str | None = None
    channel: str = 'joints'
    driving: str = ''
    begins: str = ''


FAULTS = {
    name: Fault(**entry)
    for name, entry in plain_table(Path(__file__).with_name('faults.yaml')).items()
}
"""The faults, worst first: one table for recordings and while driving."""
NOT_CHECKED = plain_table(Path(__file__).with_name('not_checked.yaml'))  # by kind and reason
RANK = {key: rank for rank, key in enumerate(FAULTS)}  # place of a fault, worst first


def found(
    key: str,
    topic: str,
    confidence: float,
    *,
    wheel: str | None = None,
    value: float | None = None,
    std: float | None = None,
    **figures: Any,
) -> Finding:
    """Return a finding in the words of its fault, which name further figures; see `Finding`."""
    fault = FAULTS[key]
    none = dict.fromkeys(('trial', 'alternative', 'separate'), '')
    figures = none | {'wheels': wheel, 'topic': topic} | figures
    figures.setdefault('value', value)
    figures.setdefault('std', std)
    return Finding(
        kind=fault.kind,
        topic=topic,
        wheel=wheel,
        parameter=figures.get('parameter', fault.parameter),
        value=value,
        std=std,
        confidence=confidence,
        words=fault.words.format(**figures),
        cure=fault.cure.format(**figures),
        fault=key,
    )


def not_checked(kind: str, why: str, **figures: Any) -> NotChecked:
    """Return why a kind of fault was not checked, in the words of `not_checked.yaml`."""
    return NotChecked(kind, NOT_CHECKED[kind][why].format(**figures))


def of_offset(
    name: str, left: float, std: float, against: str, facts: RoverFacts
) -> dict[str, Any]:
    """Return the text of a finding on stamps that are ``left`` [s] off beyond the stated offset."""
    return {
        'value': round(left + float(getattr(facts.sensors, f'{name}_stamp_offset')), 3),
        'std': round(std, 3),
        'name': name,
        'size': abs(left),
        'side': 'late' if left > 0.0 else 'early',
        'against': against,
    }


def listed(values: Any, form: str = '.4f') -> str:
    """Return numbers with commas between, as a flat list of a rover file has them."""
    return ', '.join(format(value, form) for value in values)
