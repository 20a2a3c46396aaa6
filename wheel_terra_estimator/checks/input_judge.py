# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Monitor of the inputs: no slip class and no stuck warning from faulty inputs.

A finding about single wheels silences these alone, and none a warning that a reference at rest, or
a torque at its limit that no finding contradicts, has confirmed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wheel_terra_estimator.checks.finding import INTERNAL_ERROR, Finding
from wheel_terra_estimator.checks.online import OnlineChecks
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass

SUBJECT = 'check of '  # begins the subject of a finding among the faults of a set
_NOT_CHECKED = {SUBJECT + 'the inputs': f'not checked: {INTERNAL_ERROR}'}
LONGEST_WAIT = 4_000_000_000  # of a stuck warning for the checks of its inputs [ns of stamps]
FAR_NIS = 10.0
"""Mean normalised innovation squared of torque or balance that says that they do not fit. Usual
0.03 to 1; up to 7 for seconds in turns without a reference and on snow; with the wrong sign 13."""
_MISFITS = {
    'nis_torque': ('fit of torque', 'torque contradicts the soil model'),
    'nis_balance': ('fit of balance', 'torques, weight and slope contradict each other'),
}
"""Figure of the filter -> subject and words of the fault."""
_NOISE = 'noise_beyond_stated'
"""Key of the filter's message on sensors much noisier than a file or a message states."""


class InputJudge(OnlineChecks):
    """The checks while driving, and what their findings change in the estimates."""

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration)
        self._names = tuple(configuration.wheels.names)
        self._stuck_since: int | None = None  # [ns] of the warning; None = there is none
        self._confirmed = False  # the warning, since it began
        self._waits_for = ''  # why a warning is not out; empty: it is, or there is none

    def judged(self, estimates: EstimateSet, health: Mapping[str, Any]) -> EstimateSet:
        """Return the estimates of the last step; slip is not judged while a finding stands.

        ``health``: counters and texts of the estimator.
        """
        misfits = _misfits(health, dug_in=estimates.stuck and estimates.stuck_confirmed)
        failed = _NOT_CHECKED if self._failed else {}
        findings = self.standing('slip')
        silenced = self._silenced(findings)
        classes, reasons = estimates.slip_class.copy(), list(estimates.reasons)
        for i, why in silenced.items():
            classes[i], reasons[i] = SlipClass.UNKNOWN, why
        estimates = replace(
            estimates,
            slip_class=classes,
            reasons=tuple(reasons),
            faults=_reported(
                estimates.faults | misfits | failed, (*self.standing('beside'), *findings)
            ),
        )
        doubted = any(finding.fault.startswith('torque') for finding in findings)
        unknown = reasons[0] if len(silenced) == len(self._names) else ''
        self._follow(estimates, unknown, doubted)
        if not self._waits_for:
            return estimates
        reasons = [self._waits_for] * len(reasons)
        return replace(estimates, stuck=False, stuck_direction=0, reasons=tuple(reasons))

    def _silenced(self, findings: tuple[Finding, ...]) -> dict[int, str]:
        """Return the wheels whose slip is meaningless, and why: all, where it is half of them."""
        names, silenced = self._names, dict[int, str]()
        for finding in reversed(findings):
            named = finding.wheel.split(', ') if finding.wheel else names
            why = f'not judged: {finding.words}'
            silenced |= {i: why for i, name in enumerate(names) if name in named}
        if 2 * len(silenced) < len(names):
            return silenced
        return dict.fromkeys(range(len(names)), f'not judged: {findings[0].words}')

    def _follow(self, estimates: EstimateSet, silenced: str, doubted: bool) -> None:
        """Follow the stuck warning: what it waits for, if anything.

        `silenced`: reason why no wheel has a class, if so; `doubted`: torques may be wrong.
        """
        if not estimates.stuck:
            self._stuck_since, self._confirmed, self._waits_for = None, False, ''
            return
        rises = self._stuck_since is None
        begun = estimates.stamp if self._stuck_since is None else self._stuck_since
        waits = rises or bool(self._waits_for)
        doubts = self.undecided if estimates.stamp - begun < LONGEST_WAIT else ''
        self._stuck_since, self._waits_for = begun, ''
        self._confirmed |= estimates.stuck_confirmed and not doubted
        if self._confirmed:
            return
        if silenced:
            self._waits_for = silenced
        elif waits and not self._failed and (doubts or estimates.stuck_clears):
            # What has passed while it was checked is no warning any more.
            self._waits_for = f'stuck warning waits: {doubts or "no sign of it is left"}'


def _misfits(health: Mapping[str, Any], *, dug_in: bool) -> dict[str, str]:
    """Return messages on torque, balance or noise that are far from what the filter expects.

    No model fits a rover that is `dug_in`.
    """
    misfits = {
        subject: f'{words} (NIS {health[key]:.0f}, usual below 1): sign or scale of the '
        'torques, rover.mass or soil -> wheel-terra check'
        for key, (subject, words) in _MISFITS.items()
        if health.get(key, 0.0) > FAR_NIS and not dug_in
    }
    if _NOISE in health:
        misfits['noise'] = f'{health[_NOISE]} -> state that'
    return misfits


def _reported(faults: Mapping[str, str], findings: tuple[Finding, ...]) -> dict[str, str]:
    """Return the faults of a set with what was found, by topic."""
    result = dict(faults)
    for finding in findings:
        subject = SUBJECT + finding.topic
        wheel = f'{finding.wheel} ' if finding.wheel else ''
        text = f'{wheel}{finding.words} ({100 * finding.confidence:.0f} %) -> {finding.cure}'
        result[subject] = f'{result[subject]}; {text}' if subject in result else text
    return result
