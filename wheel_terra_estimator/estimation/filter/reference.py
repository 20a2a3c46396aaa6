# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Update with a reference velocity; the state is opened to references that keep disagreeing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.filter.consistency import smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row, chi_square_gate
from wheel_terra_estimator.estimation.filter.prediction import Prediction
from wheel_terra_estimator.estimation.filter.state import SPEED, StateLayout
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import clipped

_LEAST_GAP = 0.01  # between references [s]
_RISE = 1.76
"""By which a limit of chi square (one degree of freedom) rises for each e-th part of what exceeds
it by chance, from 5 to 0.05 % [-]."""


@dataclass(frozen=True)
class ReferenceTuning:
    """Tuned on simulated drives, seeds 1000 to 1019, and the nine snow immobilisations."""

    known_time: float = 5.0
    """Age [s] up to which a reference tells slip and soil apart; after that the soil is held."""
    fresh_time: float = 10.0
    """Age [s] up to which the speed rests on more than a guess, for the stuck warning."""
    longest_gap: float = 10.0  # between references that is remembered [s]
    gap_gain: float = 0.3  # smoothing of it, per reference
    moving_std: float = 3.0  # deviations from 0 of a reference that moves
    moving_rest: float = 2.0  # times ``rest_speed``
    slide_gaps: float = 2.0  # gaps for which a slide on standing wheels is believed
    shortest_slide: float = 1.0  # [s]
    mean_count: float = 6.0
    """References over which their innovations' mean is taken."""
    lasting_count: float = 30.0
    """The same of a common-mode bias that lasts: smaller, and over longer."""
    most_deviations: float = 3.0  # deviations that one reference counts for in it
    most_variance_factor: float = 100.0
    run_excess: float = 4.0
    """Square of that mean over its variance above which the references run to one side."""
    beyond_rim: float = 1.5  # times the fastest rim speed: no rover drives faster than its wheels
    beyond_std: float = 5.0
    same_std: float = 4.0  # deviations within which two references disagree by the same amount
    count_beyond: int = 4  # references beyond the rim speed that must agree to be believed
    count: int = 2  # references that must agree to be believed
    gate: float = 4.0  # to which an outlier is weakened (squared deviations)
    gate_beyond: float = 0.01


class ReferenceState(NamedTuple):
    """What is remembered of the references."""

    time: float = -math.inf  # of the last one [s]
    gap: float = 10.0  # between them, smoothed [s]
    sliding_until: float = -1.0  # a slide on standing wheels is believed until then [s]
    rejected: int = 0
    rejected_in_a_row: int = 0
    last_rejected: float = 0.0  # innovation of the last rejected one [m/s]
    nis: float | None = None  # running mean; None = none came yet
    mean_innovation: float = 0.0
    """Running mean of the innovations, each over its deviation."""
    lasting_innovation: float = 0.0  # the same over more of them


class ReferenceUpdate(Component[ReferenceState]):
    """Fuses reference velocities."""

    def __init__(
        self,
        configuration: Configuration,
        rover: Rover,
        sensors: SensorFigures,
        layout: StateLayout,
        tuning: ReferenceTuning = ReferenceTuning(),
    ) -> None:
        super().__init__(ReferenceState())
        self._error = layout.reference_error
        self._reading = np.zeros(layout.size)  # of speed and of the error that lasts
        self._reading[SPEED if self._error is None else [SPEED, self._error]] = 1.0
        self._gate = float(configuration.filter.gate)
        self._rover, self._sensors, self._tuning = rover, sensors, tuning

    def predict(self, prediction: Prediction, dt: float) -> None:
        """Add the error that lasts to a prediction over `dt` [s], if there is one."""
        if self._error is None:
            return
        mean, F, Q = prediction
        entry, sensors = self._error, self._sensors
        hold = math.exp(-dt / sensors.reference_wander_time)
        mean[entry] *= hold
        F[entry, entry] = hold
        Q[entry, entry] = sensors.reference_wander_std**2 * (1.0 - hold * hold)

    def innovation(self, ekf: GatedFilter, reference: ReferenceVelocity) -> tuple[float, float]:
        """Return what a reading says beyond the state [m/s], and the variance of the state's."""
        if self._error is None:
            state, variance = float(ekf.mean[SPEED]), float(ekf.covariance[SPEED, SPEED])
        else:
            state = float(self._reading @ ekf.mean)
            variance = float(self._reading @ ekf.covariance @ self._reading)
        return reference.forward - state, variance

    def known(self, time: float) -> bool:
        """Say whether a reference is young enough to tell slip and soil apart."""
        return time - self.state.time < self._tuning.known_time

    def fresh(self, time: float) -> bool:
        """Say whether the present speed rests on a reference."""
        return time - self.state.time < self._tuning.fresh_time

    def keep_count(self, rejected: int) -> None:
        """Go on with the count of rejected references of an old run."""
        self.state = self.state._replace(rejected=rejected)

    @property
    def model_variance_factor(self) -> float:
        """Factor on the variance of the wheel-soil models [-]: 1 while the references scatter.

        Innovations of a filter that is right are white. Where they keep to one side for several
        references, the models hold the speed against them; a gate on single ones cannot see it.
        The running mean of white innovations has variance 1 / (2 n - 1) over n.
        """
        tuning, state = self._tuning, self.state
        excess = max(
            self._excess(state.mean_innovation, tuning.mean_count),
            self._excess(state.lasting_innovation, tuning.lasting_count),
        )
        return clipped(excess**2, 1.0, tuning.most_variance_factor)

    def _excess(self, mean: float, count: float) -> float:
        """Return the square of a mean of `count` innovations over the variance of white ones [-].

        Where references come faster than one a second it counts less, so that white ones pass the
        limit of a run as seldom a second as slow ones do.
        """
        gap = clipped(self.state.gap, _LEAST_GAP, 1.0)
        limit = self._tuning.run_excess
        return mean * mean * (2.0 * count - 1.0) * limit / (limit - _RISE * math.log(gap))

    def believes(self, agreeing: int, *, beyond: bool) -> bool:
        """Say whether so many references in a row that disagree by the same amount are right."""
        tuning = self._tuning
        return agreeing >= (tuning.count_beyond if beyond else tuning.count)

    def update(
        self,
        ekf: GatedFilter,
        time: float,
        reference: ReferenceVelocity,
        *,
        still: bool,
        fastest_rim: float,
        variance: float,
    ) -> bool:
        """Fuse a reference velocity; return whether the speed was opened to it.

        Parameters
        ----------
        ekf : GatedFilter
            Is updated.
        time : float
            [s].
        reference : ReferenceVelocity
            The reading.
        still : bool
            Whether all wheels stand.
        fastest_rim : float
            Greatest rim speed [m/s].
        variance : float
            Of the reading as stated, or more where more is seen [(m/s)^2].
        """
        tuning = self._tuning
        self._note_time(time)
        if still:
            self._note_slide(ekf, time, reference.forward, variance)
        residual, prior = self.innovation(ekf, reference)
        total = prior + variance
        nis = residual * residual / total
        most = tuning.most_deviations
        score = clipped(residual / math.sqrt(total), -most, most)
        state = self.state
        state = state._replace(nis=smoothed_nis(state.nis, nis))
        if nis <= self._gate or state.rejected_in_a_row:  # a single wild one is no bias
            mean, lasting = state.mean_innovation, state.lasting_innovation
            state = state._replace(
                mean_innovation=mean + (score - mean) / tuning.mean_count,
                lasting_innovation=lasting + (score - lasting) / tuning.lasting_count,
            )
        opened = False
        if nis > self._gate:
            beyond = abs(reference.forward) > (
                tuning.beyond_rim * fastest_rim + tuning.beyond_std * math.sqrt(total)
            )
            apart = abs(residual - state.last_rejected)
            same = apart < tuning.same_std * math.sqrt(2.0 * variance + total)
            agreeing = state.rejected_in_a_row + 1
            opened = same and self.believes(agreeing, beyond=beyond)
            if opened:
                ekf.inflate(SPEED, residual * residual)
            else:
                gate = tuning.gate_beyond if beyond else tuning.gate
                variance += chi_square_gate(residual, total, gate)
            state = state._replace(
                rejected=state.rejected + 1,
                rejected_in_a_row=0 if opened else agreeing,
                last_rejected=residual,
            )
        else:
            state = state._replace(rejected_in_a_row=0)
        ekf.fuse([Row(self.innovation(ekf, reference)[0], self._reading, variance)])
        self.state = state
        return opened

    def variance(self, reference: ReferenceVelocity) -> float:
        """Return the variance of a reading, the sensor's where it states none [(m/s)^2]."""
        sensors = self._sensors
        stated = reference.variance
        variance = stated if stated > 0.0 else sensors.reference_std**2
        return max(variance, sensors.reference_std_floor**2)

    def _note_time(self, time: float) -> None:
        state, tuning = self.state, self._tuning
        gap = state.gap
        if state.time > -math.inf:
            gap += tuning.gap_gain * (min(time - state.time, tuning.longest_gap) - gap)
        self.state = state._replace(time=time, gap=gap)

    def _note_slide(self, ekf: GatedFilter, time: float, forward: float, variance: float) -> None:
        """Wheels that stand: the references agree with rest, or the rover slides on them.

        A single one that moves may be wild: the slide is believed from the second in a row.
        """
        tuning = self._tuning
        noise = tuning.moving_std * math.sqrt(variance)
        until = time
        moves = abs(forward) > max(noise, tuning.moving_rest * self._rover.rest_speed)
        if moves and (self.state.rejected_in_a_row or time < self.state.sliding_until):
            until += max(tuning.slide_gaps * self.state.gap, tuning.shortest_slide)
            ekf.inflate(SPEED, forward**2)
        self.state = self.state._replace(sliding_until=until)
