# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Smoothed estimates of a whole drive.

The forward pass is the estimator itself. Its own components then compute the outputs again from the
smoothed states. Warnings (stuck warning, its probability and times, rim travel left, pull margin
and their reasons) stay those of the filter, because a recording is asked what was warned of when.
So do the normal loads, which follow from attitude and specific force alone, and the rates of
sinkage. Where the filter gives a wheel no class, the smoother does not either.

Pulls: the errors of the shear model have a short memory, so that later readings say less of them
than the torques of the moment. They stay those of the filter, and the mean of filtered and smoothed
pull is published, since the two err differently.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.measured_wheels import SpeedAndVariance, pooled
from wheel_terra_estimator.estimation.contacts.pulls import PullEvidence, Pulls
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.filter.force_balance import rut_tilt
from wheel_terra_estimator.estimation.filter.initial_state import layout_of
from wheel_terra_estimator.estimation.filter.speed_process import LEAST_SLIP_STD
from wheel_terra_estimator.estimation.filter.state import SPEED
from wheel_terra_estimator.estimation.judgement.classes import PublishedClasses
from wheel_terra_estimator.estimation.judgement.slip import SlipJudge
from wheel_terra_estimator.estimation.output_guard import OutputGuard
from wheel_terra_estimator.estimation.outputs import Outputs
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import known
from wheel_terra_estimator.estimation.smoothing.history_buffer import (
    DiskBuffer,
    Gaussian,
    HistoryBuffer,
    packed,
    smoothed_states,
    unpacked,
)
from wheel_terra_estimator.estimation.smoothing.window import Moment, centred
from wheel_terra_estimator.estimation.wheel_soil_estimator import Instant, WheelSoilEstimator

_FILTERED_FIELDS = (
    'stuck',
    'stuck_direction',
    'stuck_confirmed',
    'stuck_clears',
    'slip_on_slope',
    'stuck_probability',
    'time_to_stuck',
    'rim_travel_left',
    'pull_margin',
    'normal_load',
    'normal_load_std',
    'sideways',
    'reasons',
    'faults',
)
"""Fields of a set that stay those of the filter."""
_LEAST_STD_SHARE = 0.9
"""Least deviation of a smoothed speed over the filter's [-]: model errors do not average out.
Tuned on drives of simulators A and B, seeds 1021 to 1024 and 2180."""


class Kept(NamedTuple):
    """A set of the filter, and what its caller wants back with the smoothed one."""

    estimates: EstimateSet
    companion: Any


class _Key(NamedTuple):
    """Place of a set in a recording whose clock may step back."""

    run: int = 0
    stamp: int = 0  # [ns]

    def next(self, stamp: int) -> _Key:
        """Return the key of what follows; a stamp that goes back begins a new run."""
        return _Key(self.run + (stamp < self.stamp), stamp)


class DriveSmoother:
    """Fixed-interval smoother of one drive.

    Run the drive through a core with `estimator`, keep the sets that it gives, then ask for those
    of the smoother. `estimator` makes the forward pass.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._buffer = HistoryBuffer()
        self.estimator = WheelSoilEstimator(configuration, self._buffer)
        self._configuration = configuration
        self._kept: DiskBuffer[Kept] = DiskBuffer()

    def keep(self, estimates: EstimateSet, companion: Any = None) -> None:
        """Keep a set of the filter; `companion` is returned with the smoothed one."""
        self._kept.append(Kept(estimates, companion))

    def smoothed(self, sets: Iterable[EstimateSet]) -> Iterator[EstimateSet]:
        """Yield the smoothed sets of a whole drive, once all of the filter have come."""
        for estimates in sets:
            self.keep(estimates)
        for kept in self.sets():
            yield kept.estimates

    def sets(self) -> Iterator[Kept]:
        """Yield the smoothed sets in the order of those that were kept, with their companions.

        Where there is nothing to smooth the set of the filter is returned.
        """
        parts = _SmoothedOutputs(self._configuration)
        guard = OutputGuard(self._configuration)
        classes, last = PublishedClasses(self._configuration), 0
        for kept, moment in centred(self._moments(parts)):
            estimates = kept.estimates
            if moment is not None:
                smoothed = parts.estimates_at(moment, estimates)
                estimates = guard.repaired(smoothed.stamp, smoothed)[0]
            if estimates.stamp < last:  # the clock stepped back
                classes.reset()
            last = estimates.stamp
            yield Kept(classes.follow(estimates), kept.companion)

    def _moments(self, parts: _SmoothedOutputs) -> Iterator[tuple[Kept, Moment | None]]:
        """Yield each set that was kept with the smoothed quantities of its instant."""
        moments = self._smoothed(parts)
        place, key = _Key(), _Key()
        moment: Moment | None = None
        for index in range(len(self._kept)):
            kept = self._kept[index]
            key = key.next(kept.estimates.stamp)
            while place < key:
                moment = next(moments, None)
                if moment is None:
                    break
                place = place.next(moment.instant.sources.stamp)
            if moment is not None and place == key:
                pull = 0.5 * (moment.pull + kept.estimates.drawbar_pull)
                yield kept, moment._replace(pull=pull)
            else:
                yield kept, None

    def _smoothed(self, parts: _SmoothedOutputs) -> Iterator[Moment]:
        """Yield the smoothed quantities at each instant of the buffer, in order of time."""
        buffer = self._buffer
        backwards: DiskBuffer[tuple[FloatArray, FloatArray] | None] = DiskBuffer()
        for state in smoothed_states(buffer, *self.estimator.bounds):
            backwards.append(packed(state) if state else None)
        position, now = -1, None
        for index in range(len(buffer.marks)):
            mark = buffer.marks[index]
            if mark.position != position:
                position = mark.position
                kept = backwards[len(buffer) - position]
                now = unpacked(kept) if kept else None
            if now is None:
                continue
            if isinstance(mark.content, Instant):
                yield parts.moment(mark.content, now)
            else:
                evidence, filtered = mark.content
                parts.follow_pulls(evidence, filtered, now)


class _SmoothedOutputs:
    """The components of the estimator that compute outputs from a state, for the smoothed one."""

    def __init__(self, configuration: Configuration) -> None:
        self._rover = rover = Rover.from_configuration(configuration)
        sensors = SensorFigures.from_configuration(configuration)
        self._layout = layout = layout_of(rover, sensors)
        self._most_std = float(configuration.filter.class_std)
        self._slips = SlipJudge(rover)
        self._pulls = Pulls(rover, sensors, layout, WheelLoads(rover).state.load)
        self._outputs = Outputs(configuration, rover, sensors, layout)

    def follow_pulls(self, evidence: PullEvidence, filtered: FloatArray, now: Gaussian) -> None:
        """Compute the pulls of a cycle; the errors of the shear model stay those of the filter."""
        mean, own = now.mean.copy(), self._layout.shear_error
        mean[own] = filtered[own]
        tilt = rut_tilt(self._rover, self._layout, mean)
        self._pulls.update(mean, now.covariance, evidence, tilt=tilt)

    def moment(self, instant: Instant, now: Gaussian) -> Moment:
        """Return the smoothed quantities of an instant."""
        # The smoothed correction at the last cycle also holds for the speed extrapolated from it.
        given = instant.sources
        speed = given.speed + float(now.mean[SPEED]) - instant.cycle.speed
        carried = max(given.speed_variance - instant.cycle.variance, 0.0)
        variance = float(now.covariance[SPEED, SPEED]) + carried
        if instant.by_torque is not None:
            speed, variance, _ = pooled(SpeedAndVariance(speed, variance), instant.by_torque)
        rims = known(given.rims)
        typical = sum(map(abs, rims)) / len(given.rims)
        least = max(typical * LEAST_SLIP_STD, _LEAST_STD_SHARE * instant.motion.speed_std)
        return Moment(
            instant,
            now,
            np.array(given.rims),
            speed,
            given.yaw_rate,
            max(math.sqrt(variance), least),
            np.array(self._pulls.state.pull),
        )

    def estimates_at(self, moment: Moment, live: EstimateSet) -> EstimateSet:
        """Return the estimates of a moment; `live` are those of the filter."""
        given = moment.instant.sources
        rims = tuple(moment.rims.tolist())
        body = moment.instant.motion._replace(
            speed=moment.speed, speed_std=moment.speed_std, yaw_rate=moment.yaw_rate
        )
        slips = self._slips.update(moment.instant.time, rims, body)
        smoothed = self._outputs.estimate_set(
            given._replace(
                mean=moment.state.mean,
                covariance=moment.state.covariance,
                rims=rims,
                speed=moment.speed,
                speed_variance=moment.speed_std**2,
                yaw_rate=moment.yaw_rate,
                slips=slips,
            ),
            {},
        )
        # Where only its deviation kept the filter from a class, the smoother may give one.
        unjudged = (live.slip_class == SlipClass.UNKNOWN) & (live.slip_std <= self._most_std)
        return replace(
            smoothed,
            drawbar_pull=moment.pull,
            drawbar_pull_std=live.drawbar_pull_std,
            slip_class=np.where(unjudged, live.slip_class, smoothed.slip_class),
            **{name: getattr(live, name) for name in _FILTERED_FIELDS},
        )
