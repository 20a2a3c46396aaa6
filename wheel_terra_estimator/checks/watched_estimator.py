# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""An estimator whose inputs are judged: no slip class and no stuck warning from what is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.checks.finding import Finding
from wheel_terra_estimator.checks.online import OnlineChecks
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import (
    NO_ENTRAPMENT_IN_SIGHT,
    EstimateSet,
    SlipClass,
)
from wheel_terra_estimator.estimation.measurements import StepInputs
from wheel_terra_estimator.estimation.timing.input_log import Estimator

SUBJECT = 'check of '
"""Begins the subject of a finding among the faults of a set."""


class WatchedEstimator:
    """Runs an estimator and the online checks over the same steps, kept states included.

    Parameters
    ----------
    configuration : Configuration
        What the inputs are judged against.
    estimator : Estimator
        What estimates.
    """

    def __init__(self, configuration: Configuration, estimator: Estimator) -> None:
        self._estimator = estimator
        self._checks = OnlineChecks(configuration)

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring both to `stamp` [ns], later than the one before."""
        self._checks.step(stamp, inputs)
        self._estimator.step(stamp, inputs)

    def estimates(self) -> EstimateSet:
        """Return the estimates; slip is not judged while a finding stands."""
        estimates = self._estimator.estimates()
        findings = self._checks.findings
        return without_judgement(estimates, findings) if findings else estimates

    def snapshot(self) -> Any:
        """Return both states."""
        return self._estimator.snapshot(), self._checks.snapshot()

    def restore(self, snapshot: Any) -> None:
        """Return to a kept state."""
        estimator, checks = snapshot
        self._estimator.restore(estimator)
        self._checks.restore(checks)

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start anew."""
        self._checks.reset()
        self._estimator.begin_run(stamp, keep_soil)

    def health(self) -> dict[str, Any]:
        """Return what the estimator says of itself."""
        return dict(getattr(self._estimator, 'health', dict)())

    def learned(self) -> dict[str, Any]:
        """Return what the estimator learned of soil and sensors."""
        return dict(getattr(self._estimator, 'learned', dict)())


def without_judgement(estimates: EstimateSet, findings: tuple[Finding, ...]) -> EstimateSet:
    """Return the set with classes unknown, no stuck warning, and the findings in words."""
    faults = dict(estimates.faults)
    for finding in findings:
        subject = SUBJECT + finding.topic
        wheel = f'{finding.wheel} ' if finding.wheel else ''
        told = f'{wheel}{finding.words} ({100 * finding.confidence:.0f} %) -> {finding.cure}'
        faults[subject] = f'{faults[subject]}; {told}' if subject in faults else told
    wheels = len(estimates.slip_class)
    return replace(
        estimates,
        slip_class=np.full(wheels, SlipClass.UNKNOWN, dtype=np.uint8),
        stuck=False,
        stuck_probability=np.zeros(wheels),
        rim_travel_left=np.full(wheels, NO_ENTRAPMENT_IN_SIGHT),
        reasons=(f'not judged: {findings[0].words}',) * wheels,
        faults=faults,
    )
