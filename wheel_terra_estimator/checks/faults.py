# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The faults that the checks know, worst first, and findings in their words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wheel_terra_estimator.checks.finding import Finding, NotChecked
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.configuration.parameters import plain_table

RATE_UNITS = {
    'revolutions per minute': 2.0 * math.pi / 60.0,
    'degrees per second': math.pi / 180.0,
    'revolutions per second': 2.0 * math.pi,
    'thousandths of rad/s': 1e-3,
}
"""Units that wheel rates come in by mistake: factor to rad/s."""
SKID_TRACKS = (0.7, 6.0)  # effective over geometric track of rovers, skidding or not [-]
LEAST_TURN_RATE = 0.01  # yaw rate [rad/s] below which sides are not compared
STANDARD_GRAVITY = 9.80665  # [m/s^2]


@dataclass(frozen=True)
class Fault:
    """A kind of fault; `faults.yaml` says what its fields are."""

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
    figures = {'trial': '', 'rival': '', 'separate': '', 'wheels': wheel, 'topic': topic} | figures
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


def untold(kind: str, why: str, **figures: Any) -> NotChecked:
    """Return why a kind of fault was not checked, in the words of `not_checked.yaml`."""
    return NotChecked(kind, NOT_CHECKED[kind][why].format(**figures))


def of_offset(
    name: str, left: float, std: float, against: str, facts: RoverFacts
) -> dict[str, Any]:
    """Return what a finding says of stamps that are ``left`` [s] off beyond what is stated."""
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
