# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Update with a reference velocity; consistent outliers inflate the variance of the speed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.filter.consistency import smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row, chi_square_gate
from wheel_terra_estimator.estimation.filter.state import SPEED, Prediction, StateLayout
from wheel_terra_estimator.estimation.inputs.noise import ObservedNoise
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import clipped

# Tuned on simulated drives, seeds 1000 to 1019, and the nine snow immobilisations.
_KNOWN_TIME = 5.0
"""Age of the last reference up to which slip counts as observed [s]."""
_FRESH_TIME = 10.0
"""The same up to which the stuck warning takes the speed as measured [s]."""
_LONGEST_SLIDE = 20.0  # [s]
_MOVING_STD = 3.0  # deviations from 0 of a reference that shows motion
_MOVING_REST = 2.0  # times ``rest_speed``
_SLIDE_GAPS = 2.0  # duration assumed for a slide on locked wheels, in gaps to the last reference
_SHORTEST_SLIDE = 1.0  # [s]
_MEAN_COUNT = 6.0
"""References over which their innovations' mean is taken."""
_MOST_DEVIATIONS = 3.0  # limit of one normalised innovation in that mean
_MOST_VARIANCE_FACTOR = 100.0
_CONTRADICTING = 9.0
"""Factor on their variance from which on models are contradicted, not only doubted [-]: references
that scatter seldom reach it. Tuned on A 1000, B 1000, C 5000 to 5010, 5231, 5241, 5242."""
_BEYOND_RIM = 1.5  # over the fastest rim speed: no rover drives faster than its wheels [-]
_BEYOND_STD = 5.0  # deviations added to that bound
_SAME_STD = 4.0  # deviations within which two references disagree by the same amount
_JUMP_STD = 2.5
_UNSEEN_ACCELERATION = 0.05
"""Deviations, and acceleration [m/s^2], by which a reference differs from the last one without a
jump: a speed changes gradually, errors of satellites begin at once."""
_LASTING = 2.2
"""Time since a reference was last believed from which agreeing outliers that began with a jump are
believed [s], and gap from which readings are seldom: errors of satellites last a second or two."""
_LASTING_BEYOND = 4.2  # the same for outliers beyond the rim speed [s]
_GATE = 4.0  # NIS to which that of an outlier is reduced [-]
_GATE_BEYOND = 0.01  # the same for one beyond the rim speed [-]


class ReferenceState(NamedTuple):
    """Memory of past references."""

    time: float = -math.inf  # of the last one [s]
    gap: float = math.inf  # between the last two [s]
    slip_time: float = -math.inf
    """Of the last one that shows the slip [s]: not rejected, and not at rest."""
    slip_time_before: float = -math.inf  # of the one before it [s]
    sliding_until: float = -1.0  # a slide on locked wheels is assumed until then [s]
    rejected: int = 0
    rejected_in_a_row: int = 0
    last_rejected: float = 0.0  # innovation of the last rejected one [m/s]
    doubt: float = 0.0
    """Deviation of the speed by the last one, if rejected: as likely wild as true [m/s]."""
    forward: float = math.nan  # the last one [m/s]
    jumped: bool = False  # whether the first rejected one in a row differs much from that before it
    nis: float | None = None  # running mean; None = no reading yet
    mean_innovation: float = 0.0
    """Running mean of the innovations, each over its deviation."""


class _Reading(NamedTuple):
    """A reference velocity beside the speed of the filter."""

    time: float  # [s]
    forward: float  # [m/s]
    variance: float  # [(m/s)^2]
    innovation: float  # [m/s]
    total: float  # variance of the innovation [(m/s)^2]

    @property
    def nis(self) -> float:
        """Normalised innovation squared [-]."""
        return self.innovation * self.innovation / self.total

    @property
    def score(self) -> float:
        """Innovation over its deviation, within limits [-]."""
        most = _MOST_DEVIATIONS
        return clipped(self.innovation / math.sqrt(self.total), -most, most)


class ReferenceUpdate(Component[ReferenceState]):
    """Fuses reference velocities."""

    def __init__(
        self,
        configuration: Configuration,
        rover: Rover,
        sensors: SensorFigures,
        layout: StateLayout,
    ) -> None:
        super().__init__(ReferenceState())
        self._error = layout.reference_error
        self._row = np.zeros(layout.size)  # row h: speed plus lasting (correlated) error
        self._row[SPEED if self._error is None else [SPEED, self._error]] = 1.0
        self._gate = float(configuration.filter.gate)
        self._rover, self._sensors = rover, sensors

    def predict(self, prediction: Prediction, dt: float) -> None:
        """Predict the lasting error over `dt` [s] as a Gauss-Markov process, if in the state."""
        if self._error is None:
            return
        mean, F, Q = prediction
        entry, sensors = self._error, self._sensors
        hold = math.exp(-dt / sensors.reference_wander_time)
        mean[entry] *= hold
        F[entry, entry] = hold
        Q[entry, entry] = sensors.reference_wander_std**2 * (1.0 - hold * hold)

    def innovation(self, ekf: GatedFilter, reference: ReferenceVelocity) -> tuple[float, float]:
        """Return the innovation [m/s] and the variance h P h' of its prediction."""
        variance = float(self._row @ ekf.P @ self._row)
        return reference.forward - float(self._row @ ekf.x), variance

    def known(self, time: float) -> bool:
        """Return whether the last reference that shows slip is younger than `_KNOWN_TIME`."""
        return self.unknown_for(time) < 0.0

    def unknown_for(self, time: float) -> float:
        """Return how long slip has not been known [s]; negative while it is."""
        return time - self.state.slip_time - _KNOWN_TIME

    def known_twice(self, time: float) -> bool:
        """Return whether the last two are: one alone may average over a start."""
        return time - self.state.slip_time_before < _KNOWN_TIME

    def fresh(self, time: float) -> bool:
        """Return whether the last reference is younger than `_FRESH_TIME`."""
        return time - self.state.time < _FRESH_TIME

    def doubt_variance(self, time: float) -> float:
        """Return the variance by a rejected reference [(m/s)^2], while the slip is known."""
        return self.state.doubt**2 if self.known(time) else 0.0

    @property
    def model_variance_factor(self) -> float:
        """Factor on the variance of the wheel-soil models [-]: 1 while the references scatter.

        Innovations of a consistent filter are white. If several keep one sign, model errors bias
        the speed, which a gate on single innovations cannot detect. The running mean of white
        normalised innovations with gain 1/n has the variance 1 / (2 n - 1).
        """
        square = self.state.mean_innovation**2 * (2.0 * _MEAN_COUNT - 1.0)
        return clipped(square**2, 1.0, _MOST_VARIANCE_FACTOR)

    def contradiction(self, time: float) -> float:
        """Return how clearly references contradict the models of the forces [-]; above 1 they do.

        Then forces say nothing of the speed until the soil is learned anew, and the slip changes
        faster than its random walk allows for. Without references there is nothing else but forces.
        """
        return self.model_variance_factor / _CONTRADICTING if self.known(time) else 0.0

    def update(
        self,
        ekf: GatedFilter,
        time: float,
        reference: ReferenceVelocity,
        *,
        still: bool,
        fastest_rim: float,
        opposed: bool,
        variance: float,
    ) -> bool:
        """Fuse a reference velocity at a time [s]; return whether an outlier is believed.

        `still`: no wheel turns; `opposed`: all wheels turn against the reading; `fastest_rim` is
        the greatest rim speed [m/s], `variance` that of the reading, as stated or, if greater, as
        observed [(m/s)^2].
        """
        if still:
            self._note_slide(ekf, time, reference.forward, variance)
        innovation, prior = self.innovation(ekf, reference)
        reading = _Reading(time, reference.forward, variance, innovation, prior + variance)
        state = self._followed(reading)
        outlying = reading.nis > self._gate
        if outlying:
            rim = 0.0 if opposed else fastest_rim
            possible = abs(reading.forward) < rim + _MOVING_STD * math.sqrt(variance)
            beyond = abs(reading.forward) > (
                _BEYOND_RIM * fastest_rim + _BEYOND_STD * math.sqrt(reading.total)
            )
            state = self._with_outlier(state, reading, beyond, possible=possible, still=still)
            if state.rejected_in_a_row:
                gate = _GATE_BEYOND if beyond else _GATE
                variance += chi_square_gate(innovation, reading.total, gate)
            else:
                ekf.inflate(SPEED, innovation * innovation)
        else:
            state = state._replace(rejected_in_a_row=0, doubt=0.0)
        ekf.fuse([Row(self.innovation(ekf, reference)[0], self._row, variance)])
        rests = still and time >= state.sliding_until
        if not rests and not state.rejected_in_a_row:
            state = state._replace(slip_time=time, slip_time_before=state.slip_time)
        self.state = state
        return outlying and not state.rejected_in_a_row

    def _followed(self, reading: _Reading) -> ReferenceState:
        """Return the memory with time, reading and running means of one reference more."""
        state, nis = self.state, reading.nis
        mean = state.mean_innovation
        if nis <= self._gate or state.rejected_in_a_row:  # a single outlier is no bias
            mean += (reading.score - mean) / _MEAN_COUNT
        return state._replace(
            time=reading.time,
            gap=reading.time - state.time,
            forward=reading.forward,
            nis=smoothed_nis(state.nis, min(nis, self._gate)),
            mean_innovation=mean,
        )

    def _with_outlier(
        self, state: ReferenceState, reading: _Reading, beyond: bool, *, possible: bool, still: bool
    ) -> ReferenceState:
        """Return the memory with an outlier; `rejected_in_a_row` is 0 where it is believed.

        `beyond`: much faster than the wheels; `possible`: no faster than they, nor against them.
        """
        before, (time, forward, variance, innovation, total) = self.state, reading
        if not state.rejected_in_a_row:
            unseen = _JUMP_STD * math.sqrt(2.0 * variance) + _UNSEEN_ACCELERATION * state.gap
            state = state._replace(jumped=abs(forward - before.forward) > unseen)
        agrees = state.rejected_in_a_row > 0 and abs(
            innovation - state.last_rejected
        ) < _SAME_STD * math.sqrt(2.0 * variance + total)
        lasts = time - state.slip_time > (_LASTING_BEYOND if beyond else _LASTING)
        believed = agrees and (lasts or not (beyond or state.jumped))
        # Where readings are seldom, the slip has more often changed than one is wild: it is
        # believed at once, unless the rover would be faster than its wheels or against them.
        if _LASTING < min(state.gap, before.gap) < math.inf and possible and not still:
            believed = True
            # The models did not foresee it, and would draw the speed back until the next one.
            state = state._replace(mean_innovation=reading.score)
        return state._replace(
            rejected=state.rejected + 1,
            rejected_in_a_row=0 if believed else state.rejected_in_a_row + 1,
            last_rejected=innovation,
            doubt=0.5 * innovation if possible and not believed else 0.0,
        )

    def variance(self, reference: ReferenceVelocity, noise: ObservedNoise) -> float:
        """Return the variance of a reading [(m/s)^2]: as it states, else as of its sensor."""
        least = self._sensors.reference_std_floor**2
        stated = max(reference.variance, least) if reference.variance > 0.0 else None
        return max(noise.variance('reference', stated), least)

    def _note_slide(self, ekf: GatedFilter, time: float, forward: float, variance: float) -> None:
        """With all wheels at rest, decide between standstill and a slide on locked wheels.

        A single reference that shows motion may be an outlier; two alike in a row are a slide.
        """
        noise = _MOVING_STD * math.sqrt(variance)
        until = time
        moves = abs(forward) > max(noise, _MOVING_REST * self._rover.rest_speed)
        gap = time - self.state.time
        alike = abs(forward - self.state.forward) < noise + _UNSEEN_ACCELERATION * gap
        slides = time < self.state.sliding_until or (self.state.rejected_in_a_row and alike)
        if moves and slides:
            until += clipped(_SLIDE_GAPS * gap, _SHORTEST_SLIDE, _LONGEST_SLIDE)
            ekf.inflate(SPEED, forward**2)
        self.state = self.state._replace(sliding_until=until)
