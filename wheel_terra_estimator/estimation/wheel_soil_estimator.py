# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Filter, classes and warnings of one rover: one step per stamp, estimates on demand.

Between two filter cycles (``filter.period``) only sums are kept and the speed is carried on, so
that wheel odometry at 100 Hz costs little more than at 10 Hz; a cycle predicts, fuses what came
since, and works out the outputs. What a cycle does stands in ``estimation/steps``.
"""

from __future__ import annotations

from typing import Any

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.measurements import StepInputs
from wheel_terra_estimator.estimation.steps.collection import collect
from wheel_terra_estimator.estimation.steps.cycle import run_cycle
from wheel_terra_estimator.estimation.steps.outputs import estimate_set
from wheel_terra_estimator.estimation.steps.slips_and_warning import judge
from wheel_terra_estimator.estimation.steps.start import (
    begin_anew,
    begin_with_soil,
    start_context,
)


class WheelSoilEstimator:
    """Estimator of one rover; sees stamps in order and only checked numbers.

    Parameters
    ----------
    configuration : Configuration
        Rover, soil, sensors, tuning.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._context = start_context(configuration)

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start anew at a stamp [ns]; with `keep_soil` soil and biases are kept, widened."""
        (begin_with_soil if keep_soil else begin_anew)(self._context, stamp)

    def snapshot(self) -> tuple[Any, ...]:
        """Return what `restore` needs to come back to this state."""
        c = self._context
        return (
            c.run.copy(),
            c.filter.snapshot(),
            c.classifier.snapshot(),
            c.monitor.snapshot(),
            c.pull_jacobian,
        )

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        c = self._context
        run, filter_memory, classes, monitor, c.pull_jacobian = snapshot
        c.run = run.copy()
        c.filter.restore(filter_memory)
        c.classifier.restore(classes)
        c.monitor.restore(monitor)

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to a stamp [ns] with the measurements of that stamp."""
        c = self._context
        run, settings = c.run, c.settings
        if run.origin == 0:
            run.origin = stamp
        run.stamp = stamp
        run.time = time = (stamp - run.origin) * 1e-9
        collect(c, time, inputs)
        rolled = inputs.wheel_odometry is not None
        silent = run.odometry_time is None or time - run.odometry_time > settings.silence
        period = float(settings.filter.period) - 1e-4
        due = run.cycle_time is None or time - run.cycle_time >= period
        if inputs.reference is not None or (due and (rolled or silent)):
            run_cycle(c, time, inputs.reference)
        if rolled or silent:
            judge(c, time)

    def estimates(self) -> EstimateSet:
        """Return all outputs at the present stamp; nothing changes."""
        return estimate_set(self._context)

    def health(self) -> dict[str, Any]:
        """Return counters and consistency figures for diagnostics."""
        c = self._context
        report: dict[str, Any] = {f'rejected_{k}': v for k, v in c.run.rejected.items()}
        report['filter_restarts'] = c.filter.restarts
        for channel, value in c.run.nis.items():
            report[f'nis_{channel}'] = round(value, 3)
        return report
