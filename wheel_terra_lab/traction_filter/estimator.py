# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimator of one rover on the traction curve: candidate for the core, behind the same interface.

State: the shift of the soil file's traction curve (offset, ln scale, ln strength) and the strength
under each wheel. It walks with the travel of the rims. The speed of the body is no state: it is
the one at which the curve gives the torques that are measured; a reference velocity corrects the
curve. Sinkage and stiffness, and the pulls, follow wheel by wheel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.steering import Headings, Steering
from wheel_terra_estimator.estimation.contacts.turning import Turning, sides_oppose
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.filter.initial_state import SoilPriors
from wheel_terra_estimator.estimation.inputs.contact_sensors import (
    LeavingAngleInput,
    SinkageInput,
)
from wheel_terra_estimator.estimation.inputs.inertial import GyroZero, InertialInput
from wheel_terra_estimator.estimation.inputs.wheel_odometry import WheelOdometryInput
from wheel_terra_estimator.estimation.judgement.slip import BodyMotion, SlipJudge
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment, StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.settings import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    RoverMotion,
    WheelMotion,
    driving_share,
)
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity, StepInputs
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, clipped, gain_of, known
from wheel_terra_estimator.estimation.smoothing.tape import Gaussian
from wheel_terra_estimator.estimation.words import MissingInputs
from wheel_terra_lab.traction_filter.companions import (
    SHARP_TURN,
    Companions,
    Scene,
    seen_noise,
)
from wheel_terra_lab.traction_filter.consistency import Consistency
from wheel_terra_lab.traction_filter.curve import LOG_STRENGTH, OFFSET, WHEELS
from wheel_terra_lab.traction_filter.learned import learned_parameters
from wheel_terra_lab.traction_filter.outputs import Sources, estimate_set
from wheel_terra_lab.traction_filter.pulls import Contact, PullModel, SumOfPulls, WheelPulls
from wheel_terra_lab.traction_filter.references import (
    HeldSlip,
    ReferenceTuning,
    joined,
    mixed,
    weighed,
)
from wheel_terra_lab.traction_filter.sinkage import SinkageFilter
from wheel_terra_lab.traction_filter.soil import (
    NamedSoil,
    SoilLogs,
    SoilPosterior,
    named_soil,
    soil_shifts,
)
from wheel_terra_lab.traction_filter.speed import BodySlip, Rims, TorqueBalance, rims_at
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel
from wheel_terra_lab.traction_filter.tape import Cycle, DriveTape, Evidence, Instant, Prediction

FloatArray = NDArray[np.float64]
_SECOND = 1e-9  # of a nanosecond


@dataclass(frozen=True)
class TractionTuning:
    """Numbers of the filter; tuned on simulators A and B, seeds 1000 to 1002."""

    offset_std: float = 0.03  # what no deviation of the soil explains [-]
    log_scale_std: float = 0.2
    log_strength_std: float = 0.1
    wheel_std: float = 0.15  # ln strength of one wheel against the others
    offset_walk: float = 0.004  # [1/sqrt(m)] of rim travel, as all walks
    offset_jump: float = 0.15  # of the curve that does not hold, at each reference
    strength_jump: float = 0.15
    log_scale_walk: float = 0.015
    log_strength_walk: float = 0.015
    wheel_walk: float = 0.1
    reversal_std: float = 0.1  # of the offset, at a change of direction
    torque_time: float = 0.25  # low-pass of the torques [s]
    most_demand: float = 5.0  # torque coefficient: more is no reading of a wheel on soil
    torque_std: float = 0.02  # of a torque coefficient, what the sensor's noise leaves
    wheel_noise: float = 0.07  # of a wheel's torque coefficient against the curve
    freedom: float = 4.0  # of the heavy tail of references and torques
    start_std: float = 0.1  # of a torque coefficient, contact fresh after a start
    start_share: float = 0.5  # of the contact length, after which it is not
    rest_time: float = 0.5  # [s] of standing wheels after which the gyro's zero is learned
    most_yaw_rate: float = 0.05  # [rad/s] of a rover that stands
    most_cycles: float = 200.0  # in the mean of the gyro's zero
    sinkage_floor: float = 0.1  # of the slip's deviation, which the sinkage does not make smaller
    blind_std: float = 0.3  # of the slip where nothing tells
    grade_std: float = 0.03  # of a torque coefficient that the slope tells
    known_time: float = 20.0  # age up to which a reference is one [s]
    fresh_time: float = 10.0  # age up to which the speed rests on it, for the warning [s]
    sinkage_age: float = 2.0  # up to which a sinkage was read of late [s]
    speed_std: float = 5e-4  # [m/s]
    limits: tuple[float, float, float, float] = (0.6, 2.5, 1.5, 0.8)
    """Of offset, ln scale, ln strength and ln strength of a wheel."""


class Memory(NamedTuple):
    """All that is remembered besides the filters and the parts."""

    origin: int = -1  # [ns]
    stamp: int = 0
    time: float = 0.0  # [s]
    cycle_time: float = NAN
    demand: FloatArray | None = None  # (n,) low-passed torque coefficients; None = not yet
    torque_told: bool = True
    solution: BodySlip | None = None
    slip: float = 0.1  # of the body, last known
    slip_variance: float = 1.0
    steady: tuple[float, float] = (0.1, 1.0)  # the same where the curve holds
    told_variance: float = 1.0  # of the error of the slip that the sinkage may tell
    held: HeldSlip = HeldSlip()
    travel: float = 0.0  # of the rims since a start or reversal [m]
    direction: float = 1.0
    still_since: float = NAN
    zero: GyroZero = GyroZero()
    zero_weight: float = 0.0
    reference_time: float = -math.inf
    sinkage_time: float = -math.inf
    rejected: int = 0
    disagreement: float = 0.0  # of the wheels' torques with the curve, over their variance
    speed: tuple[float, float] = (0.0, 1.0)  # of the body and its variance
    pulls: WheelPulls | None = None
    assessment: StuckAssessment = StuckAssessment()


class Resolved(NamedTuple):
    """What a cycle tells."""

    time: float  # [s]
    slip: float  # of the body [-]
    variance: float  # infinite where it is not known better than before
    sinkage: FloatArray  # (n,) [m]
    sinkage_std: FloatArray
    soil: NamedSoil


class TractionEstimator:
    """Estimator of one rover; sees stamps in order and only checked numbers.

    Parameters
    ----------
    configuration : Configuration
        Rover, soil, sensors, tuning.
    tape : DriveTape, optional
        Keeps what a smoother needs.
    """

    def __init__(
        self,
        configuration: Configuration,
        tuning: TractionTuning = TractionTuning(),
        tape: DriveTape | None = None,
    ) -> None:
        self._configuration = configuration
        self._tuning, self._references = tuning, ReferenceTuning()
        self._rover = rover = Rover.from_configuration(configuration)
        self._sensors = sensors = SensorFigures.from_configuration(configuration)
        self._steady = SteadyWheel(configuration, rover)
        priors = SoilPriors.from_configuration(configuration)
        n = rover.wheel_count
        self._n, self._radius = n, np.array(rover.slip_radius)
        self._inertial = InertialInput(rover.gravity, given=configuration.stated)
        self._wheels = WheelOdometryInput(rover, sensors)
        self._sinkages = SinkageInput(n)
        self._leaving_angles = LeavingAngleInput(n)
        self._steering = Steering(rover)
        self._turning = Turning(rover, sensors)
        self._loads = WheelLoads(rover)
        self._sinkage = SinkageFilter(rover, self._steady, priors)
        self._pull_model = PullModel(configuration, rover, sensors)
        self._companions = Companions(configuration, rover, sensors)
        self._consistency = Consistency()
        self._noise = seen_noise(configuration, sensors)
        self._slips = SlipJudge(rover, sensors)
        self._stuck = StuckMonitor(StuckSettings.from_configuration(configuration))
        self._parts: tuple[Any, ...] = (
            self._inertial,
            self._wheels,
            self._sinkages,
            self._leaving_angles,
            self._steering,
            self._turning,
            self._loads,
            self._sinkage,
            self._slips,
            self._stuck,
            self._companions,
            self._consistency,
            self._noise,
        )
        curve = np.array([*tuning.limits[:3], *[tuning.limits[3]] * n])
        deepest = np.concatenate([rover.rim_radius, np.full(n + 1, np.inf)])
        self._change = np.zeros((3 + n, 3 + n))  # of the curve, where the soil has changed
        self._change[OFFSET, OFFSET] = tuning.offset_jump**2
        self._change[LOG_STRENGTH, LOG_STRENGTH] = tuning.strength_jump**2
        self._bounds = (-curve, curve), (-deepest, deepest)
        self._of_a_cycle: tuple[Any, ...] = (
            self._steering,
            self._turning,
            self._wheels,
            self._leaving_angles,
        )
        self._tape = tape
        if tape is not None:
            self._parts += (tape,)
        shifts = soil_shifts(self._steady, priors)
        self._start_covariance = self._prior(shifts)
        self._soil = SoilPosterior(shifts, self._start_covariance, priors)
        self._ekf = ExtendedKalmanFilter(dim_x=3 + n, dim_z=1)
        self._memory = Memory()
        self._balance: TorqueBalance | None = None
        self._begin()

    def _prior(self, shifts: FloatArray) -> FloatArray:
        """Return the covariance that follows from the deviations of the soil."""
        tuning, n = self._tuning, self._n
        own = [tuning.offset_std, tuning.log_scale_std, tuning.log_strength_std]
        P = np.diag(np.square(own + [tuning.wheel_std] * n))
        P[:3, :3] += shifts @ shifts.T
        return P

    def _begin(self) -> None:
        self._ekf.x, self._ekf.P = np.zeros(3 + self._n), self._start_covariance.copy()
        self._memory = Memory()

    # -- Runs and snapshots ----------------------------------------------------------------------

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start anew at a stamp [ns]; with `keep_soil` curve and biases are kept, widened."""
        x, P, memory = self._ekf.x, self._ekf.P, self._memory
        for part in self._parts:
            part.reset()
        self._begin()
        if keep_soil:
            self._ekf.x, self._ekf.P = x, 0.5 * (P + self._start_covariance)
            self._memory = Memory(
                zero=memory.zero, zero_weight=0.5 * memory.zero_weight, rejected=memory.rejected
            )
        self._memory = self._memory._replace(origin=stamp, stamp=stamp)
        if self._tape is not None:
            self._tape.cut()

    def snapshot(self) -> tuple[Any, ...]:
        """Return what `restore` needs to come back to this state."""
        filters = self._ekf.x, self._ekf.P
        return self._memory, filters, tuple([part.snapshot() for part in self._parts])

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        self._memory, (self._ekf.x, self._ekf.P), states = snapshot
        for part, state in zip(self._parts, states, strict=True):
            part.restore(state)

    # -- One stamp -------------------------------------------------------------------------------

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to a stamp [ns] with the measurements of that stamp."""
        memory = self._memory
        origin = stamp if memory.origin < 0 else memory.origin
        time = (stamp - origin) * _SECOND
        self._memory = memory._replace(origin=origin, stamp=stamp, time=time)
        self._take(time, inputs)
        rolled = inputs.wheel_odometry is not None
        silent = self._wheels.silent(time)
        due = isnan(memory.cycle_time) or time - memory.cycle_time >= self._rover.period - 1e-4
        if inputs.reference is not None and not isnan(inputs.reference.lateral):
            stated = inputs.reference.lateral_variance or self._sensors.reference_std**2
            floor = self._sensors.reference_std_floor**2
            self._companions.sideways.correct(inputs.reference.lateral, max(stated, floor))
        if inputs.reference is not None or (due and (rolled or silent)):
            self._run_cycle(time, inputs.reference)
        if rolled or silent:
            self._judge(time)

    def _take(self, time: float, inputs: StepInputs) -> None:
        self._noise.take(time, inputs)
        if inputs.inertial is not None:
            before = self._inertial.stated
            self._inertial.update(time, inputs.inertial, self._memory.zero)
            if self._inertial.stated is not before:
                self._noise.take_stated(self._inertial.stated)
        if inputs.sinkage is not None:
            self._sinkages.update(inputs.sinkage)
            if not np.isnan(inputs.sinkage.sinkage).all():
                self._memory = self._memory._replace(sinkage_time=time)
        if inputs.leaving_angle is not None:
            self._leaving_angles.update(time, inputs.leaving_angle)
        if inputs.wheel_odometry is not None:
            self._wheels.update(time, inputs.wheel_odometry)
            if inputs.wheel_odometry.steering is not None:
                self._steering.update(inputs.wheel_odometry.steering)

    # -- One cycle of the filter -----------------------------------------------------------------

    def _run_cycle(self, time: float, reference: ReferenceVelocity | None) -> None:
        """Walk on, solve for the speed, fuse what came since the last cycle."""
        memory, rover = self._memory, self._rover
        dt = 0.0 if isnan(memory.cycle_time) else time - memory.cycle_time
        window = self._inertial.take()
        headings = self._steering.state.headings
        speeds = self._wheels.rim_speeds(time)
        fastest = self._wheels.fastest()
        silent_gyro = time - self._inertial.state.rate_time > rover.silence
        turning = self._turning.update(
            window, dt, memory.speed[0], fastest, headings, speeds, gyro_silent=silent_gyro
        )
        torque = np.array(self._wheels.take_torque())
        pulls = memory.pulls
        held = np.nan_to_num(np.array(self._wheels.state.torque))
        share = self._loads.state.slope_share
        model_pull = pulls.pull if pulls else share * np.array(self._loads.state.load)
        loads = self._loads.update(
            window, tuple(model_pull), tuple(held), (False,) * self._n, headings
        )
        load = np.array(loads.load)
        heard = known(speeds)
        still = bool(heard) and all(abs(rim) < rover.rest_speed for rim in heard)
        self._note_rest(time, still, turning.yaw_rate, window)
        rims = rims_at(speeds, headings, turning.yaw_rate, rover.low_rim)
        travel = float(np.abs(rims.speed).max(initial=0.0)) * dt
        self._walk(travel, rims, still)
        walked = Prediction.of(self._ekf) if self._tape is not None else None
        self._note_demand(dt, torque, load, loads.slope_share, rims, still=still)
        self._solve(dt, rims, headings, turning.yaw_rate, load)
        if reference is not None:
            self._fuse_reference(time, reference, rims)
        self._follow_wheels(torque, load)
        self._sink(dt, rims, load)
        total = self._total(window, memory.speed[0], load)
        self._pull(time, dt, rims, load, loads.slope_share, total)
        self._memory = self._memory._replace(cycle_time=time)
        if self._tape is not None and walked is not None:
            parts = tuple([part.snapshot() for part in self._of_a_cycle])
            kept = self._memory._replace(assessment=StuckAssessment())
            self._tape.cycles.append(
                Cycle(
                    (walked, self._sinkage.predicted),
                    (Gaussian(self._ekf.x.copy(), self._ekf.P.copy()), self._sinkage.gaussian),
                    self._references.walk**2 * dt,
                    Evidence(time, kept, parts, rims, load),
                )
            )

    def _note_rest(self, time: float, still: bool, yaw_rate: float, window: Any) -> None:
        """Learn the zero of the gyro where all wheels stand."""
        memory, tuning = self._memory, self._tuning
        if not still:
            self._memory = memory._replace(still_since=NAN)
            return
        since = time if isnan(memory.still_since) else memory.still_since
        zero, weight = memory.zero, memory.zero_weight
        if (
            time - since > tuning.rest_time
            and window.rates
            and abs(yaw_rate) < tuning.most_yaw_rate
        ):
            weight = min(weight + 1.0, tuning.most_cycles)
            pitch = window.pitch_rate / window.rates
            zero = GyroZero(zero.yaw + yaw_rate / weight, zero.pitch + pitch / weight)
        self._memory = memory._replace(still_since=since, zero=zero, zero_weight=weight)

    def _walk(self, travel: float, rims: Rims, still: bool) -> None:
        """Let the curve change over the travel of the rims [m]."""
        memory, tuning, ekf, n = self._memory, self._tuning, self._ekf, self._n
        walks = [tuning.offset_walk, tuning.log_scale_walk, tuning.log_strength_walk]
        Q = np.square(walks + [tuning.wheel_walk] * n) * travel
        keep = np.ones(3 + n)
        keep[WHEELS:] = np.exp(-Q[WHEELS:] / (2.0 * tuning.wheel_std**2))
        Q[WHEELS:] = tuning.wheel_std**2 * (1.0 - keep[WHEELS:] ** 2)
        direction = 1.0 if rims.body >= 0.0 else -1.0
        reverses = abs(rims.body) > self._rover.rest_speed and direction != memory.direction
        if reverses:
            Q[OFFSET] += tuning.reversal_std**2
        ekf.F, ekf.Q = np.diag(keep), np.diag(Q)
        ekf.predict()
        begun = still or reverses
        self._memory = memory._replace(
            travel=0.0 if begun else memory.travel + travel,
            direction=direction if reverses else memory.direction,
            demand=None if begun else memory.demand,
            held=HeldSlip() if reverses else memory.held,
        )

    def _note_demand(
        self,
        dt: float,
        torque: FloatArray,
        load: FloatArray,
        slope_share: float,
        rims: Rims,
        *,
        still: bool,
    ) -> None:
        """Low-pass what each wheel is asked to give: its torque over load and radius."""
        if still or not rims.turning.any():
            self._memory = self._memory._replace(demand=None, solution=None)
            return
        load = np.maximum(load, 0.0)
        before = self._memory.demand
        carried = load > 0.05 * load.mean()
        torque_told = bool((~np.isnan(torque)).any()) or self._wheels.torque_known(
            self._memory.time
        )
        if not torque_told:
            torque = self._torque_of_grade(slope_share, load, rims)
        now = torque / (self._radius * np.where(carried, load, np.inf))
        now = np.clip(now, -self._tuning.most_demand, self._tuning.most_demand)
        if before is None:
            demand = now
        else:
            gain = gain_of(max(dt, 1e-6), self._tuning.torque_time)
            there = ~np.isnan(now)
            demand = np.where(there, before + gain * (now - before), before)
            demand = np.where(np.isnan(before), now, demand)
        self._memory = self._memory._replace(demand=demand, torque_told=torque_told)

    def _torque_of_grade(self, slope_share: float, load: FloatArray, rims: Rims) -> FloatArray:
        """Return the torques (n,) [N m] that the nominal soil asks for the pull of this slope."""
        direction = 1.0 if rims.scale >= 0.0 else -1.0
        stiffness = self._sinkage.relative_stiffness(np.maximum(load, 1e-3))
        share = self._steady.torque_for_pull(slope_share * direction, float(np.mean(stiffness)))
        return np.where(rims.turning, share * direction * load * self._radius, NAN)

    def _solve(
        self, dt: float, rims: Rims, headings: Headings, yaw_rate: float, load: FloatArray
    ) -> None:
        """Find the slip of the body that the torques tell."""
        memory = self._memory
        demand = memory.demand
        self._balance = None
        held = memory.held.later(dt, memory.steady, memory.disagreement, self._references)
        self._memory = memory = memory._replace(held=held)
        if demand is None:
            return
        told = ~np.isnan(demand) & rims.turning
        if not told.any():
            self._memory = memory._replace(solution=None)
            return
        self._balance = TorqueBalance(
            self._steady,
            rims._replace(turning=told),
            headings,
            yaw_rate,
            demand=np.nan_to_num(demand),
            load=np.maximum(load, 0.0) + 1e-9,
            stiffness=self._sinkage.relative_stiffness(np.maximum(load, 1e-3)),
        )
        self._settle()

    def _settle(self) -> None:
        """Solve the balance of torques, and join its slip with that of the references."""
        memory, ekf = self._memory, self._ekf
        if self._balance is None:
            return
        start = memory.solution.slip if memory.solution else memory.slip
        found = self._balance.solved(ekf.x, start, self._torque_variance(), ekf.P)
        most = self._references.most_slip
        steady = joined(found, memory.held, self._references)
        slip, variance = mixed(steady, memory.held)
        told = max(variance - self._tuning.sinkage_floor**2, 0.0)
        self._sinkage.limit_slip(told)
        self._memory = memory._replace(
            solution=found,
            steady=steady,
            slip=clipped(slip + self._sinkage.slip_error, -most, most),
            slip_variance=min(self._sinkage.slip_variance + variance - told, variance),
            told_variance=told,
        )

    def _torque_variance(self) -> float:
        """Return the variance of the mean torque coefficient [-]."""
        tuning, contact = self._tuning, self._rover.contact_length
        fresh = math.exp(-self._memory.travel / (tuning.start_share * contact))
        told = tuning.torque_std**2 / self._n if self._memory.torque_told else tuning.grade_std**2
        return told + (tuning.start_std * fresh) ** 2

    def _fuse_reference(
        self,
        time: float,
        reference: ReferenceVelocity,
        rims: Rims,
    ) -> None:
        """Correct the curve by a reference velocity, with a heavy-tailed error (Student t)."""
        memory, tuning, ekf, sensors = self._memory, self._tuning, self._ekf, self._sensors
        self._memory = memory = memory._replace(reference_time=time)
        if abs(rims.scale) < self._rover.low_rim:
            return
        stated = reference.variance if reference.variance > 0.0 else sensors.reference_std**2
        R = max(stated, sensors.reference_std_floor**2) / rims.scale**2
        seen = (rims.body - reference.forward) / rims.scale
        found, balance = memory.solution, self._balance
        spread = memory.slip_variance * rims.scale**2
        innovation = (memory.slip - seen) * rims.scale
        noise = R * rims.scale**2
        self._noise.compare_reference(time, innovation, noise, spread, reference.variance)
        weights = weighed(seen, R, memory.steady, memory.held, self._references)
        ekf.P = ekf.P + (1.0 - weights.holding) * self._change
        weight = weights.in_steady
        if found is not None and balance is not None:
            # Linear about the slip that was known before: on its plateau the torque tells none, but
            # a slip that is known tells the strength.
            curve = balance.mean(balance.at(ekf.x, memory.slip), found.weight)
            residual = curve.lacking - curve.slope * (seen - memory.slip)
            variance = self._torque_variance() + curve.slope**2 * R
            H = curve.gradient
            tail = residual**2 / (H @ ekf.P @ H + variance)
            self._consistency.note(reference=tail)
            weight *= min((tuning.freedom + 1.0) / (tuning.freedom + tail), 1.0)
            ekf.update(
                np.array([residual]),
                lambda x: H[None, :],
                lambda x: np.zeros(1),
                R=np.array([[variance / weight]]),
            )
            ekf.x = np.clip(ekf.x, *self.bounds[0])
        if weights.sound < 0.5:
            self._memory = memory = memory._replace(rejected=memory.rejected + 1)
        held = memory.held.corrected(seen, R, weights, self._references)
        self._memory = memory._replace(held=held)
        self._settle()

    def _follow_wheels(self, torque: FloatArray, load: FloatArray) -> None:
        """Learn the strength under each wheel from its torque against that of the curve."""
        memory, tuning, ekf = self._memory, self._tuning, self._ekf
        found, demand = memory.solution, memory.demand
        if found is None or demand is None:
            return
        use = np.flatnonzero(~np.isnan(torque) & ~np.isnan(demand) & (found.weight > 0.0))
        H = np.zeros((len(use), 3 + self._n))
        H[np.arange(len(use)), WHEELS + use] = found.expected[use]
        residual = demand[use] - found.expected[use]
        spread = found.expected[use] ** 2 * np.diagonal(ekf.P)[WHEELS + use] + tuning.wheel_noise**2
        weight = np.minimum((tuning.freedom + 1.0) / (tuning.freedom + residual**2 / spread), 1.0)
        if len(use):
            nis = float(np.mean(residual**2 / spread))
            self._consistency.note(torque=nis)
            self._memory = memory._replace(disagreement=nis)
        for row, r, w in zip(H, residual, weight, strict=True):
            place = int(np.argmax(row != 0.0)) if row.any() else -1
            if place < 0:
                continue
            h, p = row[place], ekf.P[place, place]
            gain = h * p / (h * h * p + tuning.wheel_noise**2 / w)
            ekf.x[place] += gain * r
            keep = 1.0 - gain * h
            ekf.P[place, :] *= keep
            ekf.P[:, place] *= keep
            ekf.P[place, place] = p * keep
        ekf.x = np.clip(ekf.x, *self.bounds[0])

    def _wheel_slips(self, rims: Rims) -> FloatArray:
        """Return the slip (n,) of the turning wheels."""
        headings, yaw_rate = self._steering.state.headings, self._turning.state.yaw_rate
        speed, _ = self._body_speed(rims)
        ground = np.array(headings.by_speed) * speed + np.array(headings.by_yaw_rate) * yaw_rate
        larger = np.maximum(np.maximum(np.abs(rims.speed), np.abs(ground)), 1e-3)
        slip = (rims.speed - ground) / larger * np.where(rims.speed >= 0.0, 1.0, -1.0)
        return np.clip(slip, -1.0, 1.0)

    def _sink(self, dt: float, rims: Rims, load: FloatArray) -> None:
        slip = self._wheel_slips(rims)
        self._sinkage.predict(
            slip,
            self._by_body(rims),
            self._memory.told_variance,
            np.abs(rims.speed) * dt,
            np.maximum(load, 1e-3),
            dt,
        )
        nis = self._sinkage.update(self._sinkages.take(), self._sensors.sinkage_std**2)
        self._consistency.note(sinkage=nis)

    def _by_body(self, rims: Rims) -> FloatArray:
        """Return the derivative (n,) of the wheels' slips by that of the body."""
        by_speed = np.array(self._steering.state.headings.by_speed)
        return np.minimum(np.abs(by_speed * rims.scale) / np.maximum(np.abs(rims.speed), 1e-3), 2.0)

    def _total(self, window: Any, speed: float, load: FloatArray) -> SumOfPulls | None:
        """Return what the specific force of a cycle says of the sum of the pulls."""
        if not window.readings:
            return None
        rover, sensors = self._rover, self._sensors
        force = window.mean_force()
        weight = rover.mass * force[2]
        # Ruts of unequal depth pitch the body up; on curved ground the wheels' slopes differ.
        tilt = float(np.array(rover.rut_tilt) @ self._sinkage.sinkage)
        curvature = self._turning.curvature(speed)
        uphill = curvature * float(load @ np.array(rover.longitudinal))
        std = window.stated.specific_force_std or sensors.specific_force_std
        noise = std**2 / window.readings
        if window.duration > 0.0:
            noise += window.noise_density / window.duration
        return SumOfPulls(
            rover.mass * force[0] + uphill - weight * tilt,
            rover.mass**2 * noise,
        )

    def _pull(
        self,
        time: float,
        dt: float,
        rims: Rims,
        load: FloatArray,
        slope_share: float,
        total: SumOfPulls | None,
    ) -> None:
        memory, n = self._memory, self._n
        slip = self._wheel_slips(rims)
        ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, 0.3))
        rolling = np.where(rims.turning, np.sign(rims.speed), 0.0)
        demand = memory.demand if memory.demand is not None else np.full(n, NAN)
        headings, turning = self._steering.state.headings, self._turning.state
        side = np.abs(np.array(headings.side_speeds(memory.speed[0], turning.yaw_rate)))
        ekf, found = self._ekf, memory.solution
        larger = np.maximum(np.abs(rims.speed), 1e-3)
        contact = Contact(
            speed_ratio=ratio,
            by_slip=-np.maximum(ratio, 1.0) * self._by_body(rims),
            slip_std=math.sqrt(min(memory.slip_variance, 1.0)),
            sinkage=np.maximum(self._sinkage.sinkage, 1e-4),
            sinkage_std=self._sinkage.std[:n],
            strength=float(ekf.x[LOG_STRENGTH]),
            strength_std=math.hypot(math.sqrt(ekf.P[LOG_STRENGTH, LOG_STRENGTH]), 0.05),
            agreement=found.agreement if found else np.ones(n),
            load=load,
            torque=demand * self._radius * load * np.where(rolling, rolling, 1.0),
            rolling=rolling,
            sideways=np.minimum(side / larger, 1.0) * (rolling != 0),
            leaving_angle=self._leaving_angles.angles(time),
        )
        along = np.array(headings.along)
        # A wheel that is held while the rover moves is dragged as one that skids at slip -1.
        speeds = np.array(headings.by_speed) * memory.speed[0]
        held = np.abs(np.array(self._wheels.rim_speeds(time))) <= self._rover.rest_speed
        dragged = held & (np.abs(speeds) > self._rover.low_rim)
        skidding = self._steady.pull(
            -np.ones(n), self._sinkage.relative_stiffness(np.maximum(load, 1e-3))
        )
        guess = np.where(dragged, np.sign(speeds) * skidding, slope_share)
        pulls = self._pull_model.pulls(contact, memory.pulls, guess, total, along, dt)
        self._memory = memory._replace(pulls=pulls)
        self._consistency.note(balance=pulls.nis)

    # -- What it means ---------------------------------------------------------------------------

    def _body_speed(self, rims: Rims) -> tuple[float, float]:
        """Return speed of the body [m/s] and its variance."""
        memory, tuning = self._memory, self._tuning
        found, least = memory.solution, tuning.speed_std**2
        if not isnan(memory.still_since):
            return 0.0, least
        if found is None:
            speed = rims.body - memory.slip * rims.scale
            return speed, least + (tuning.blind_std * rims.scale) ** 2
        return (
            rims.body - memory.slip * rims.scale,
            least + rims.scale**2 * min(memory.slip_variance, 1.0),
        )

    def _judge(self, time: float) -> None:
        """Judge slip and class of each wheel and the stuck warning at a time [s]."""
        rover, headings, turning = self._rover, self._steering.state.headings, self._turning.state
        speeds = self._wheels.rim_speeds(time)
        speed, variance = self._body_speed(
            rims_at(speeds, headings, turning.yaw_rate, rover.low_rim)
        )
        body = BodyMotion(
            speed,
            math.sqrt(variance),
            turning.yaw_rate,
            turning.yaw_rate_std,
            headings,
            turning.lateral_motion,
            stopped=not isnan(self._memory.still_since),
        )
        self._slips.update(time, speeds, body)
        assessment = self._warned(time, speeds, speed)
        self._memory = self._memory._replace(speed=(speed, variance), assessment=assessment)
        if self._tape is not None:
            cycle = len(self._tape.cycles) - 1
            self._tape.instants.append(Instant(self._memory.stamp, time, cycle, body, speeds))
        if self._companions.due(time):
            self._companions.follow(self._scene(time, body))

    def _scene(self, time: float, body: BodyMotion) -> Scene:
        memory, n = self._memory, self._n
        return Scene(
            time,
            body,
            self._wheels.rim_speeds(time),
            self._steering.state.angles,
            self._slips.state,
            self._loads.state,
            time - self._inertial.state.force_time <= self._rover.silence,
            memory.pulls.pull if memory.pulls else np.zeros(n),
            self._sinkage.sinkage,
            self._ekf.x[WHEELS:],
            self._soil_logs(),
            memory.direction,
            memory.travel > self._rover.contact_length,
        )

    def _soil_logs(self) -> SoilLogs:
        return self._soil.logs(self._ekf.x, self._ekf.P, self._sinkage.common_stiffness)

    def _warned(self, time: float, speeds: tuple[float, ...], speed: float) -> StuckAssessment:
        rover, wheels, turning = self._rover, self._wheels, self._turning.state
        onward = max(known(speeds), key=abs, default=0.0)
        seen = []
        for i, (wheel, rim) in enumerate(zip(self._slips.state, speeds, strict=True)):
            torque = wheels.state.torque[i]
            turns = abs(rim) > rover.rest_speed
            seen.append(
                WheelMotion(
                    wheel.slip,
                    wheel.std,
                    0.0 if isnan(rim) else rim,
                    turns and not wheel.resting,
                    driving_share(torque, rover.torque_limit[i], rim if turns else onward),
                    float(self._sinkage.sinkage[i]),
                    rover.rim_radius[i],
                    rate_told=not isnan(rim),
                )
            )
        fresh = time - self._memory.reference_time < self._tuning.fresh_time
        return self._stuck.update(
            time,
            RoverMotion(
                speed,
                fresh,
                tuple(seen),
                slip_told=fresh or wheels.torque_known(time) or self._sinkage_told(time),
                turning=turning.lateral_motion > SHARP_TURN
                or sides_oppose(speeds, self._steering.state.headings.by_yaw_rate),
            ),
        )

    # -- Once more, for a smoother ---------------------------------------------------------------

    @property
    def bounds(self) -> tuple[tuple[FloatArray, FloatArray], ...]:
        """Lower and upper bounds of the states of curve and sinkage."""
        return self._bounds

    @property
    def torque_time(self) -> float:
        """Time constant of the low-pass of the torques [s]."""
        return self._tuning.torque_time

    def resolved(
        self,
        evidence: Evidence,
        states: tuple[Gaussian, ...],
        held: HeldSlip,
        demand: FloatArray | None,
    ) -> Resolved:
        """Solve a cycle again, with states, held slip and torque coefficients known better."""
        (self._ekf.x, self._ekf.P), self._sinkage.gaussian = states
        for part, state in zip(self._of_a_cycle, evidence.parts, strict=True):
            part.restore(state)
        self._memory = evidence.memory._replace(held=held, demand=demand)
        yaw_rate, headings = self._turning.state.yaw_rate, self._steering.state.headings
        self._solve(0.0, evidence.rims, headings, yaw_rate, evidence.load)
        memory = self._memory
        # Behind a start neither torques nor references tell more than they did at first.
        settled = memory.travel > self._rover.contact_length
        told = settled and memory.solution is not None
        told = told and memory.slip_variance <= evidence.memory.slip_variance
        return Resolved(
            evidence.time,
            memory.slip,
            memory.slip_variance if told else math.inf,
            self._sinkage.sinkage,
            np.hypot(self._sinkage.std[: self._n], self._sensors.sinkage_zero_std),
            named_soil(self._configuration, self._soil_logs()),
        )

    # -- Outputs ---------------------------------------------------------------------------------

    def _sinkage_told(self, time: float) -> bool:
        return time - self._memory.sinkage_time < self._tuning.sinkage_age

    def estimates(self) -> EstimateSet:
        """Return all outputs at the present stamp; nothing changes."""
        time = self._memory.time
        inertial = self._inertial.state
        silent = time - inertial.time > self._rover.silence
        missing = MissingInputs(
            wheel_odometry=self._wheels.silent(time),
            imu=silent,
            orientation=not silent and not inertial.attitude.reported,
            torque=not self._wheels.torque_known(time),
            sinkage=not self._sinkage_told(time),
            acceleration=not silent and time - inertial.force_time > self._rover.silence,
            angular_rate=not silent and time - inertial.rate_time > self._rover.silence,
            reference=time - self._memory.reference_time > self._tuning.known_time,
        )
        return estimate_set(self._rover, self._sensors, self._sources(), missing)

    def _sources(self) -> Sources:
        """Return what the outputs of the present stamp follow from."""
        memory, n = self._memory, self._n
        loads, turning = self._loads.state, self._turning.state
        pulls = memory.pulls
        return Sources(
            stamp=memory.stamp,
            speed=memory.speed[0],
            speed_variance=memory.speed[1],
            yaw_rate=turning.yaw_rate,
            yaw_rate_std=turning.yaw_rate_std,
            headings=self._steering.state.headings,
            rims=self._wheels.rim_speeds(memory.time),
            slips=self._slips.state,
            loads=loads,
            pull=np.zeros(n) if pulls is None else pulls.pull,
            pull_std=np.array(loads.load) if pulls is None else pulls.std,
            sinkage=self._sinkage.sinkage,
            sinkage_std=self._sinkage.std[:n],
            sinkage_rate=self._companions.sinkage_rate,
            soil=named_soil(self._configuration, self._soil_logs()),
            assessment=memory.assessment,
            margin=self._companions.margin.state.margin,
            slip_on_slope=self._companions.slopes.state.told,
            sideways=self._companions.sideways.state.told,
        )

    def learned(self) -> dict[str, Any]:
        """Return what was learned: configuration key -> value, deviations ``_std`` too."""
        return learned_parameters(
            self._configuration, self._soil_logs(), self._soil.prior_std, self._memory.zero
        )

    def health(self) -> dict[str, Any]:
        """Return counters and consistency figures for diagnostics."""
        zero = self._memory.zero
        report: dict[str, Any] = {
            'rejected_reference': self._memory.rejected,
            'rejected_sinkage': self._sinkage.rejected,
            'gyro_zero_yaw_rad_s': float(f'{zero.yaw:.3g}'),
        }
        report |= self._consistency.report() | self._noise.report()
        for than, words in self._noise.in_words().items():
            report[f'noise_beyond_{than}'] = words
        return report
