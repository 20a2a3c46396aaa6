# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimates of a whole drive once it is over.

The forward pass is the estimator itself. A backward pass (Rauch, Tung and Striebel 1965) smooths
curve, sinkage and the slip that references hold; then each cycle is solved once more by the
estimator's own methods, with torques whose low-pass is run back over time and so has no delay. What
warns of things to come stays the filter's: what was warned of when is what a recording is asked.
Pulls too: they follow from torques and specific force of the moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.judgement.classes import PublishedClasses
from wheel_terra_estimator.estimation.judgement.slip import SlipJudge
from wheel_terra_estimator.estimation.output_guard import OutputGuard
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import gain_of
from wheel_terra_estimator.estimation.smoothing.backward import smoothed_before
from wheel_terra_estimator.estimation.smoothing.smoother import Kept
from wheel_terra_estimator.estimation.smoothing.spool import Spool
from wheel_terra_estimator.estimation.smoothing.tape import Gaussian, Transition
from wheel_terra_lab.traction_filter.estimator import Resolved, TractionEstimator
from wheel_terra_lab.traction_filter.references import HeldSlip
from wheel_terra_lab.traction_filter.speed import rims_at
from wheel_terra_lab.traction_filter.tape import Cycle, DriveTape, Instant

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SmootherTuning:
    """Looked at on simulators A and B, seeds 1021 to 1023."""

    least_share: float = 0.7
    """Of the filter's deviation of a speed: model errors do not average out as noise does."""
    longest_gap: float = 0.25  # between a set and a cycle beside it [s]


class DriveSmoother:
    """Fixed-interval smoother of one drive.

    Run the drive through a core with `estimator`, keep the sets that it gives, then ask for those
    of the smoother.

    Parameters
    ----------
    configuration : Configuration
        Rover, soil, sensors, tuning.

    Attributes
    ----------
    estimator : TractionEstimator
        Makes the forward pass.
    """

    def __init__(
        self, configuration: Configuration, tuning: SmootherTuning = SmootherTuning()
    ) -> None:
        self._tape = DriveTape()
        self.estimator = TractionEstimator(configuration, tape=self._tape)
        self._configuration, self._tuning = configuration, tuning
        self._rover = Rover.from_configuration(configuration)
        self._most_std = float(configuration.filter.class_std)
        self._slips = SlipJudge(self._rover, SensorFigures.from_configuration(configuration))
        self._kept: Spool[Kept] = Spool()

    def keep(self, estimates: EstimateSet, companion: Any = None) -> None:
        """Keep a set of the filter, with anything that is to come back beside the smoothed one."""
        self._kept.append(Kept(estimates, companion))

    def sets(self) -> Iterator[Kept]:
        """Yield the smoothed sets in the order of those that were kept, with their companions.

        A set of the filter is given as it is where there is nothing to smooth.
        """
        backwards = self._backwards()
        guard = OutputGuard(self._configuration)
        classes = PublishedClasses(self._configuration)
        instants = _by_run(self._tape.instants)
        run, last, now = 0, 0, next(instants, None)
        for index in range(len(self._kept)):
            estimates, companion = self._kept[index]
            if estimates.stamp < last:  # the clock stepped back
                classes.reset()
                run += 1
            last = estimates.stamp
            while now is not None and (now[0], now[1].stamp) < (run, last):
                now = next(instants, None)
            if now is not None and (now[0], now[1].stamp) == (run, last):
                judged = self._judged(estimates, now[1], backwards)
                estimates = guard.repaired(judged.stamp, judged)[0]
            yield Kept(classes.follow(estimates), companion)

    def _backwards(self) -> Spool[Resolved | None]:
        """Return what each cycle tells with what came later, the last cycle first."""
        found: Spool[Resolved | None] = Spool()
        judge = TractionEstimator(self._configuration)
        later: Cycle | None = None
        states: tuple[Gaussian, ...] = ()
        held, demand, time = HeldSlip(), None, 0.0
        for index in range(len(self._tape.cycles) - 1, -1, -1):
            cycle = self._tape.cycles[index]
            if cycle is None:
                later, demand = None, None
                found.append(None)
                continue
            evidence = cycle.evidence
            if later is None:
                states, held = cycle.updated, evidence.memory.held
            else:
                states = tuple(
                    [
                        smoothed_before(Transition(now, step.F, step.state), known, *bounds)
                        for now, step, known, bounds in zip(
                            cycle.updated, later.predicted, states, judge.bounds, strict=True
                        )
                    ]
                )
                held = _held_before(evidence.memory.held, later.walked, held)
            demand = _delay_undone(
                evidence.memory.demand, demand, time - evidence.time, judge.torque_time
            )
            later, time = cycle, evidence.time
            found.append(judge.resolved(evidence, states, held, demand))
        return found

    def _judged(
        self, live: EstimateSet, now: Instant, backwards: Spool[Resolved | None]
    ) -> EstimateSet:
        """Return the estimates of an instant; `live` is what the filter said of it."""
        last = len(backwards) - 1
        here = backwards[last - now.cycle]
        after = backwards[last - now.cycle - 1] if now.cycle < last else None
        body, gap = now.body, self._tuning.longest_gap
        if here is None or now.time - here.time > gap:
            return live
        share = 0.0
        if after is not None and now.time < after.time <= here.time + gap:
            share = (now.time - here.time) / (after.time - here.time)
        beside = here if share == 0.0 or after is None else after
        rims = rims_at(now.rims, body.headings, body.yaw_rate, self._rover.low_rim)
        smoothed = replace(
            live,
            sinkage=here.sinkage + share * (beside.sinkage - here.sinkage),
            sinkage_std=np.minimum(here.sinkage_std, self._rover.rim_radius),
            soil=here.soil.soil,
            soil_std=here.soil.std,
        )
        if body.stopped or math.isinf(here.variance + beside.variance):
            self._slips.update(now.time, now.rims, body)
            return smoothed
        slip = here.slip + share * (beside.slip - here.slip)
        variance = here.variance + share * (beside.variance - here.variance)
        std = math.sqrt(variance) * abs(rims.scale)
        std = max(std, self._tuning.least_share * body.speed_std)
        body = body._replace(speed=rims.body - slip * rims.scale, speed_std=std)
        slips = self._slips.update(now.time, now.rims, body)
        # Where the filter alone knew the slip too badly, the smoother may know it.
        judged = np.array(
            [SlipClass.LOW if wheel.judged else SlipClass.UNKNOWN for wheel in slips],
            dtype=np.uint8,
        )
        unjudged = (live.slip_class == SlipClass.UNKNOWN) & (live.slip_std <= self._most_std)
        change = np.array(body.headings.by_speed) * (body.speed - live.forward_velocity)
        return replace(
            smoothed,
            slip=np.array([wheel.slip for wheel in slips]),
            slip_std=np.array([wheel.std for wheel in slips]),
            slip_velocity=live.slip_velocity - np.where(np.isnan(now.rims), 0.0, change),
            slip_class=np.where(unjudged, live.slip_class, judged),
            forward_velocity=float(body.speed),
            forward_velocity_variance=float(std**2),
        )


def _held_before(known: HeldSlip, walked: float, later: HeldSlip) -> HeldSlip:
    """Return the slip held by references, smoothed by what came after its walk."""
    if math.isinf(known.variance):
        return known._replace(slip=later.slip, variance=later.variance + walked)
    gain = known.variance / (known.variance + walked)
    spread = later.variance - known.variance - walked
    return known._replace(
        slip=known.slip + gain * (later.slip - known.slip),
        variance=known.variance + gain**2 * spread,
    )


def _delay_undone(
    demand: FloatArray | None, later: FloatArray | None, dt: float, time: float
) -> FloatArray | None:
    """Return torque coefficients whose low-pass has been run back over `dt` [s] too."""
    if demand is None or later is None:
        return demand
    gain = gain_of(max(dt, 1e-6), time)
    return np.where(np.isnan(later), demand, later + gain * (demand - later))


def _by_run(instants: Spool[Instant]) -> Iterator[tuple[int, Instant]]:
    """Yield the instants with the number of their run: one whose stamp goes back begins one."""
    run, last = 0, 0
    for index in range(len(instants)):
        instant = instants[index]
        run += instant.stamp < last
        last = instant.stamp
        yield run, instant
