# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimator of one rover: filter, slips and warnings; one step per stamp, estimates on demand.

Between two cycles of the filter (``filter.period``) readings are only summed and the speed is
extrapolated, so that wheel odometry at 100 Hz costs little more than at 10 Hz. A cycle is
`WheelSoilEstimator._run_cycle`: predict, fuse the readings since the last one, compute the pulls.
"""

from __future__ import annotations

import math
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.contact_age import ContactAge
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.cycle import TURN, Cycle, RimSpeeds
from wheel_terra_estimator.estimation.contacts.demand import Demand, SteepestClimb
from wheel_terra_estimator.estimation.contacts.linearisation import (
    ContactForces,
    Linearisation,
    contact_states,
    turning_wheels,
)
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.measured_wheels import (
    Opinion,
    SpeedAndVariance,
    pooled,
    slip_of_torque,
)
from wheel_terra_estimator.estimation.contacts.pulls import PullEvidence, Pulls
from wheel_terra_estimator.estimation.contacts.ruts import Ruts, curvature_of
from wheel_terra_estimator.estimation.contacts.stationary_wheels import (
    StationaryPull,
    StationaryWheels,
)
from wheel_terra_estimator.estimation.contacts.steering import Steering
from wheel_terra_estimator.estimation.contacts.turning import Turning, sides_oppose
from wheel_terra_estimator.estimation.contacts.unloaded_wheels import UnloadedWheels
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.filter.consistency import correlated_cycles, excess
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row
from wheel_terra_estimator.estimation.filter.force_balance import ForceBalance, SumOfPulls, rut_tilt
from wheel_terra_estimator.estimation.filter.initial_state import (
    gravity_bias_std,
    initial_filter,
    layout_of,
    with_soil_of,
)
from wheel_terra_estimator.estimation.filter.reference import ReferenceUpdate
from wheel_terra_estimator.estimation.filter.sinkage import SinkageUpdate
from wheel_terra_estimator.estimation.filter.sinkage_process import SinkageProcess
from wheel_terra_estimator.estimation.filter.soil_process import SoilProcess
from wheel_terra_estimator.estimation.filter.speed_process import (
    EQUILIBRIUM_LENGTH,
    HELD_LENGTH,
    Reversion,
    SpeedProcess,
)
from wheel_terra_estimator.estimation.filter.state import (
    GRAVITY_BIAS,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SPEED,
    Prediction,
)
from wheel_terra_estimator.estimation.filter.torque import TorqueUpdate
from wheel_terra_estimator.estimation.filter.zero_velocity import ZeroVelocityUpdate
from wheel_terra_estimator.estimation.inputs.contact_sensors import (
    SMOOTHED_NOISE,
    LeavingAngleInput,
    SinkageInput,
)
from wheel_terra_estimator.estimation.inputs.inertial import InertialInput, InertialWindow
from wheel_terra_estimator.estimation.inputs.noise import NOTHING_STATED, ObservedNoise, StatedNoise
from wheel_terra_estimator.estimation.inputs.wheel_odometry import WheelOdometryInput
from wheel_terra_estimator.estimation.judgement.pull_margin import PullMargin
from wheel_terra_estimator.estimation.judgement.slip import BodyMotion, SlipJudge, WheelSlip
from wheel_terra_estimator.estimation.judgement.slip_on_slope import Instant as SlopeInstant
from wheel_terra_estimator.estimation.judgement.slip_on_slope import SlopeCurve
from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment, StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    RoverMotion,
    WheelMotion,
    driving_share,
)
from wheel_terra_estimator.estimation.learned import Learned
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity, StepInputs
from wheel_terra_estimator.estimation.outputs import Outputs, Sources
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, NANOSECOND, known, median
from wheel_terra_estimator.estimation.sideways import Sideways, SidewaysInputs, SidewaysMotion
from wheel_terra_estimator.estimation.smoothing.history_buffer import Gaussian, HistoryBuffer
from wheel_terra_estimator.estimation.taught import Taught, Teaching, with_model_errors
from wheel_terra_estimator.estimation.words import COST

_PERIOD_ROUNDING = 1e-4
"""A cycle is due this much before its period is over [s]: stamps jitter."""
_SHARP_TURN = 0.3
"""Lateral speed ratio above which slip is due to turning and is no sign of entrapment [-]."""
_ANGLE_KNOWN = 0.6  # slip angle std up to which lateral forces are used [rad]


class Instant(NamedTuple):
    """Inputs of the outputs at one stamp, from which a smoother recomputes them."""

    time: float  # [s] since the start of the run
    motion: BodyMotion
    sources: Sources
    """Speed as filtered; mean and covariance are empty: the smoother supplies its own."""
    cycle: SpeedAndVariance  # of the filter at its last cycle
    by_torque: Opinion | None  # by the typical slip at the measured torques


class _Clock(NamedTuple):
    """Times of a run."""

    origin: int = 0  # [ns]
    stamp: int = 0
    time: float = 0.0  # [s] since the origin
    assessment: StuckAssessment = StuckAssessment()  # of the last stamp that was judged
    speed: SpeedAndVariance | None = None  # where this stamp was judged


class WheelSoilEstimator:
    """Estimator of one rover; stamps must be in order and measurements checked.

    `buffer` records the states and transitions that a smoother needs.
    """

    def __init__(self, configuration: Configuration, buffer: HistoryBuffer | None = None) -> None:
        self._configuration = configuration
        self._rover = rover = Rover.from_configuration(configuration)
        sensors = SensorFigures.from_configuration(configuration)
        self._sensors = sensors
        self._layout = layout = layout_of(rover, sensors)
        models = contact_models(configuration)
        # Readings between two cycles.
        self._inertial = InertialInput(rover.gravity, given=configuration.stated)
        self._wheels = WheelOdometryInput(rover, sensors)
        self._sinkages = SinkageInput(rover.wheel_count)
        self._leaving_angles = LeavingAngleInput(rover.wheel_count)
        self._noise = ObservedNoise(sensors, given=configuration.stated)
        # Wheels on the ground.
        self._steering = Steering(rover)
        self._turning = Turning(rover, sensors)
        self._loads = WheelLoads(rover)
        level = self._loads.state.load
        self._contact_age = ContactAge(rover)
        self._ruts = Ruts(rover)
        self._unloaded = UnloadedWheels(rover, sensors)
        self._demand = Demand()
        self._torque_coefficient = Demand()
        self._climb = SteepestClimb()
        angle_std = sensors.leaving_angle_std * SMOOTHED_NOISE
        self._linearisation = Linearisation(rover, layout, models, angle_std)
        self._stationary = StationaryWheels(rover, sensors, layout, models)
        self._pulls = Pulls(rover, sensors, layout, level)
        # The filter: process and measurements.
        self._ekf = initial_filter(configuration, rover, sensors, layout, models, level)
        self._speed = SpeedProcess(configuration, rover, sensors)
        self._sinkage_process = SinkageProcess(rover, layout, models)
        self._soil_process = SoilProcess(configuration, layout)
        self._reference = ReferenceUpdate(configuration, rover, sensors, layout)
        self._zero_velocity = ZeroVelocityUpdate(rover)
        self._sinkage = SinkageUpdate(configuration, layout)
        self._torque = TorqueUpdate(configuration, rover, layout)
        self._balance = ForceBalance(configuration, rover, sensors, layout)
        # What it means.
        self._slips = SlipJudge(rover)
        self._margin = PullMargin(rover.wheel_count, models)
        self._slopes = SlopeCurve()
        self._sideways = SidewaysMotion(rover)
        self._stuck = StuckMonitor(StuckSettings.from_configuration(configuration))
        self._outputs = Outputs(configuration, rover, sensors, layout)
        self._learned = Learned(configuration, layout, self._ekf.P, self._outputs.learned_soil)
        self._teaching = Teaching.of_filter(layout, self._ekf.P)
        self._clock = _Clock()
        # What has a memory.
        self._parts: tuple[Component[Any] | GatedFilter | HistoryBuffer, ...] = tuple(
            part for part in vars(self).values() if isinstance(part, Component | GatedFilter)
        )
        self._buffer = buffer
        if buffer is not None:
            self._ekf.buffer = buffer
            self._parts += (buffer,)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the state, (size,) each."""
        return self._ekf.bounds

    # -- Runs and snapshots ----------------------------------------------------------------------

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Restart at a stamp [ns]; `keep_soil` keeps soil and biases with inflated covariance."""
        soil, gyro = self._ekf.state, self._zero_velocity.state
        rejected = self._reference.state.rejected, self._sinkage.state.rejected
        stated = self._inertial.stated
        for part in self._parts:
            part.reset()
        self._clock = _Clock(stamp, stamp)
        if keep_soil:
            self._inertial.keep_stated(stated)
            self._reset_gravity_bias(stated)
            self._ekf.state = with_soil_of(soil, self._ekf.state, self._layout)
            self._zero_velocity.keep_zero_of(gyro)
            self._reference.state = self._reference.state._replace(rejected=rejected[0])
            self._sinkage.state = self._sinkage.state._replace(rejected=rejected[1])

    def snapshot(self) -> tuple[Any, ...]:
        """Return the complete state, for `restore`."""
        return self._clock, tuple([part.state for part in self._parts])

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        self._clock, states = snapshot
        for part, state in zip(self._parts, states, strict=True):
            part.state = state

    # -- One stamp -------------------------------------------------------------------------------

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to a stamp [ns] with the measurements of that stamp."""
        clock = self._clock
        origin = clock.origin or stamp
        time = (stamp - origin) * NANOSECOND
        self._clock = _Clock(origin, stamp, time, clock.assessment)
        self._take(time, inputs)
        rolled = inputs.wheel_odometry is not None
        silent = self._wheels.silent(time)
        if inputs.reference is not None and not isnan(inputs.reference.lateral):
            stated = inputs.reference.lateral_variance or self._sensors.reference_std**2
            floor = self._sensors.reference_std_floor**2
            self._sideways.correct(inputs.reference.lateral, max(stated, floor))
        is_due = (rolled or silent) and self._is_due(time, self._speed.state.cycle_time)
        resumes = rolled and isnan(self._speed.state.rims.typical)
        if inputs.reference is not None or is_due or resumes:
            self._run_cycle(time, inputs.reference)
        if rolled or silent:
            self._judge(time)

    def _take(self, time: float, inputs: StepInputs) -> None:
        """Take in the measurements of a stamp, `time` [s] after the start of the run."""
        self._noise.update(time, inputs)
        if inputs.inertial is not None:
            before = self._inertial.stated
            self._inertial.update(time, inputs.inertial, self._zero_velocity.state.zero)
            if self._inertial.stated is not before:
                self._reset_gravity_bias(self._inertial.stated, before)
        if inputs.sinkage is not None:
            self._sinkages.update(inputs.sinkage)
        if inputs.leaving_angle is not None:
            self._leaving_angles.update(time, inputs.leaving_angle)
        if inputs.wheel_odometry is not None:
            rate_std = math.sqrt(self._noise.variance('wheel_rate'))
            self._wheels.update(time, inputs.wheel_odometry, rate_std)
            if inputs.wheel_odometry.steering is not None:
                self._steering.update(inputs.wheel_odometry.steering)

    def _reset_gravity_bias(
        self, stated: StatedNoise, before: StatedNoise = NOTHING_STATED
    ) -> None:
        """Reset the variance of the gravity bias to the orientation noise that the IMU reports."""
        if stated.orientation_std != before.orientation_std:
            std = gravity_bias_std(self._rover, self._sensors, stated.orientation_std)
            self._ekf.set(GRAVITY_BIAS, float(self._ekf.x[GRAVITY_BIAS]), std**2)

    def _is_due(self, time: float, before: float) -> bool:
        """Return whether the period that began at `before` [s] is over; nan = none began."""
        return isnan(before) or time - before >= self._rover.period - _PERIOD_ROUNDING

    # -- One cycle of the filter -----------------------------------------------------------------

    def _run_cycle(self, time: float, reference: ReferenceVelocity | None) -> None:
        """Predict to a time [s], fuse the readings since the last cycle, compute the pulls."""
        ekf, layout = self._ekf, self._layout
        cycle = self._begin_cycle(time)
        sinkage_before = ekf.x[layout.sinkage]

        self._torque_coefficient.update(
            self._torque_over_load(cycle), cycle.dt, settled=self._contact_age.settled
        )
        self._predict(cycle)
        if not cycle.reference_known and self._contact_age.half_formed:
            self._speed.remove_start_transient(ekf, cycle)

        if reference is not None:
            self._fuse_reference(cycle, reference)
        self._zero_velocity.update(ekf, cycle, sliding=time < self._reference.state.sliding_until)

        unmodelled_std = self._sinkage_process.state.unmodelled_std
        rows = self._sinkage.update(
            ekf,
            time,
            self._sinkages.take(),
            self._noise.variance('sinkage'),
            unmodelled_std,
            slip_known=cycle.reference_known,
        )
        self._unloaded.update(cycle)
        forces, total = None, None
        stationary: list[StationaryPull | None] = [None] * self._rover.wheel_count
        if cycle.still:
            self._contact_age.stop()  # contacts form again after a standstill
        else:
            forces, total, stationary, force_rows = self._force_rows(cycle)
            if self._contact_age.settled or cycle.reference_known:
                rows += force_rows
        unread = self._sinkage.unread(time)
        # The pull of a soil that nobody states gives no slip; against the wheels it is the same at
        # any speed.
        shown = cycle.reference_known or self._curve_known(time)
        believed = self._reference.contradiction(time) <= 1.0
        opposed = cycle.yaw_compensated.oppose(float(ekf.x[SPEED]))
        considered = layout.considered(
            forces_show_speed=shown and believed and self._contact_age.settled and not opposed,
            unread=unread,
            blurred=forces is not None and forces.blurred,
        )
        ekf.fuse(rows, considered)

        if not cycle.reference_known:
            self._speed.keep_with_rims(ekf, cycle.yaw_compensated)
            if cycle.lateral_motion <= _SHARP_TURN:  # in it no wheel speed is that of the body
                self._speed.keep_behind_driving_wheels(ekf, cycle)
        self._speed.end_cycle(
            time,
            ekf,
            cycle.yaw_compensated,
            settled=self._contact_age.settled,
            turning=cycle.lateral_motion > _SHARP_TURN,
        )
        self._sinkage_process.end_cycle(ekf, sinkage_before, unread, cycle.dt)
        self._speed.keep_least_variance(ekf, cycle.rims)
        self._update_pulls(cycle, forces, total, stationary)

    def _update_pulls(
        self,
        cycle: Cycle,
        forces: ContactForces | None,
        total: SumOfPulls | None,
        stationary: list[StationaryPull | None],
    ) -> None:
        """Compute the pulls after the update of a cycle; arguments as in `PullEvidence`."""
        ekf, zeros = self._ekf, self._torque.zeros(self._ekf.x)
        torques = zip(self._wheels.state.torque, zeros, strict=True)
        tilt_stds = self._sinkage_process.state.unmodelled_std * self._rover.rut_tilt
        evidence = PullEvidence(
            forces=forces,
            total=total,
            cycle=cycle,
            readings=tuple([reading - zero for reading, zero in torques]),
            stationary=stationary,
            sideways=self._lateral_forces(cycle),
            tilt_std=math.hypot(*tilt_stds),
        )
        tilt = rut_tilt(self._rover, self._layout, ekf.x)
        self._pulls.update(ekf.x, ekf.P, evidence, tilt=tilt)
        if self._buffer is not None:
            present = Gaussian(ekf.x, ekf.P)
            self._buffer.mark((evidence, ekf.x), present)

    def _begin_cycle(self, time: float) -> Cycle:
        """Update turning, loads, demand and direction of the drive; return the new cycle."""
        ekf, speed, rover = self._ekf, self._speed, self._rover
        dt = speed.since_cycle(time)
        window = self._inertial.take()
        fastest = self._wheels.fastest()
        headings = self._steering.state.headings
        rims = self._wheels.rim_speeds(time)
        turning = self._turning.update(
            window,
            dt,
            float(ekf.x[SPEED]),
            fastest,
            headings,
            rims,
            gyro_silent=time - self._inertial.state.rate_time > rover.silence,
        )
        pulls = self._pulls.state
        loads = self._loads.update(
            window, pulls.model_pull, pulls.torque, self._unloaded.state.unloaded, headings
        )
        yaw_compensated = RimSpeeds.of(rims, turning.yaw_rate, headings)
        reference_known = self._reference.known(time)
        reverses = self._contact_age.update(yaw_compensated.typical)
        demand = self._contact_age.state.direction * loads.slope_share if window.has_force else NAN
        if reverses:
            speed.reverse_direction(ekf, self._demand.state, demand)
            if self._buffer is not None:
                # The soil that was learned downhill is not that of the climb before it.
                self._buffer.cut()
        demand_change = self._demand.update(demand, dt, settled=self._contact_age.settled)
        self._note_climb(demand, yaw_compensated.typical, dt, slip_known=reference_known)
        speed.begin(ekf, yaw_compensated)
        speed.follow_sides(yaw_compensated, dt)
        measured = known(rims)
        return Cycle(
            time=time,
            dt=dt,
            window=window,
            rims=rims,
            rim_noise=self._wheels.white_noise(dt),
            yaw_compensated=yaw_compensated,
            yaw_rate=turning.yaw_rate,
            lateral_motion=turning.lateral_motion,
            headings=headings,
            still=bool(measured) and all(abs(rim) < rover.rest_speed for rim in measured),
            torque=self._wheels.take_torque(),
            leaving_angles=self._leaving_angles.angles(time),
            loads=loads,
            turns=turning_wheels(rover, rims, loads.load),
            reference_known=reference_known,
            demand_change=demand_change if reference_known else 0.0,
        )

    def _torque_over_load(self, cycle: Cycle) -> float:
        """Return the torques over loads times radii, positive where they drive; nan = none [-]."""
        torques = [
            (torque - zero, load * radius)
            for torque, zero, load, radius, turns in zip(
                cycle.torque,
                self._torque.zeros(self._ekf.x),
                cycle.loads.load,
                self._rover.slip_radius,
                cycle.turns,
                strict=True,
            )
            if turns and not isnan(torque)
        ]
        most = sum(lever for _, lever in torques)
        if most <= 0.0:
            return NAN
        return self._contact_age.state.direction * sum(torque for torque, _ in torques) / most

    def _note_climb(self, demand: float, rim: float, dt: float, *, slip_known: bool) -> None:
        """Update the steepest climb with demand [-] and slip, while it is steady and observed."""
        steady = slip_known and self._contact_age.settled and abs(rim) >= self._rover.low_rim
        straight = self._turning.state.lateral_motion <= _SHARP_TURN
        slip = 1.0 - float(self._ekf.x[SPEED]) / rim if steady and straight else NAN
        self._climb.update(demand, slip, dt)

    def _predict(self, cycle: Cycle) -> None:
        """Predict speed, sinkage, soil and errors of the shear model to the time of a cycle."""
        speed, direction = self._speed, self._contact_age.state.direction
        inflation = speed.state.inflation if cycle.reference_known else 0.0
        by_wheels = expected = speed.by_wheels(cycle.dt, cycle.yaw_compensated, inflation)
        unseen = not cycle.still and not cycle.reference_known
        # There is no equilibrium slip where the ground holds the rover.
        held, buried = self._clock.assessment.holds, self._clock.assessment.buried
        length = HELD_LENGTH if held and not buried else EQUILIBRIUM_LENGTH
        reversion = Reversion()
        if unseen:
            reversion = speed.reversion(cycle, direction, length, buried=buried)
            expected = reversion.of(by_wheels)
        lacking = speed.learn_bias(self._ekf, cycle, expected, by_wheels)
        by_wheels = by_wheels._replace(variance=by_wheels.variance + lacking)
        x = self._ekf.x
        prediction = Prediction.unchanged(x)
        window = self._trusted(cycle.window, cycle.time)
        step = speed.combined(by_wheels, cycle.dt, window, lacking)
        if unseen:
            step = reversion.of(step)
        speed.predict(prediction, step, cycle)
        self._reference.predict(prediction, cycle.dt)
        if not cycle.still and cycle.dt > 0.0:
            travel = self._sinkage_process.predict(prediction, x, cycle)
            self._contact_age.advance(travel)
            self._note_ruts(cycle.dt)
            if travel > 0.0:
                torque_known = self._wheels.torque_known(cycle.time)
                self._soil_process.predict(prediction, travel, torque_known=torque_known)
        self._ekf.predict(prediction.mean, prediction.F, prediction.Q)

    def _trusted(self, window: InertialWindow, time: float) -> InertialWindow:
        """Return the IMU readings that may change the speed: none if slip is not observable.

        Without references and torques slip cannot be separated from accelerometer drift:
        0.02 m/s^2 would stop a rover at 5 cm/s within seconds.
        """
        shown = self._reference.known(time) or self._wheels.torque_known(time)
        return window if shown else InertialWindow()

    def _note_ruts(self, dt: float) -> None:
        """Record the rut depths along the travel of the last `dt` [s], for following wheels."""
        x = self._ekf.x
        speed = float(x[SPEED])
        self._ruts.advance(
            abs(speed) * dt,
            self._contact_age.state.direction,
            tuple(x[self._layout.sinkage].tolist()),
            curvature_of(speed, self._turning.state.yaw_rate),
        )

    def _fuse_reference(self, cycle: Cycle, reference: ReferenceVelocity) -> None:
        """Fuse a reference velocity."""
        time, ekf = cycle.time, self._ekf
        innovation, variance = self._reference.innovation(ekf, reference)
        noise = self._reference.variance(reference, self._noise)
        if not cycle.still:  # a camera that stands sees its own motion better than one that moves
            self._noise.compare_reference(time, innovation, noise, variance, reference.variance)
        self._reference.update(
            self._ekf,
            time,
            reference,
            still=cycle.still,
            fastest_rim=self._wheels.fastest(),
            opposed=cycle.yaw_compensated.oppose(reference.forward),
            variance=noise,
        )

    def _force_rows(
        self, cycle: Cycle
    ) -> tuple[ContactForces, SumOfPulls | None, list[StationaryPull | None], list[Row]]:
        """Return contact forces, measured sum of pulls, what standing wheels give, and the rows."""
        ekf = self._ekf
        forces = self._linearisation.update(ekf.x, cycle, self._ruts.state.depth)
        speed_std = math.sqrt(float(ekf.P[SPEED, SPEED]))
        stationary = self._stationary.update(ekf.x, speed_std, cycle)
        start = self._contact_age.shear_variance
        repeats = correlated_cycles(cycle.rims, cycle.dt) * self._reference.model_variance_factor
        rows = self._torque.update(
            ekf,
            forces,
            cycle,
            variance=self._noise.variance('torque'),
            model_variance=start,
            repeats=repeats,
        )
        self._speed.follow_contacts(
            self._contact_age.state.travel,
            self._clock.assessment.digging if self._depth_read(cycle.time) else NAN,
            contradiction=self._reference.contradiction(cycle.time),
            reference_known=cycle.reference_known,
        )
        if not cycle.window.readings:
            return forces, None, stationary, rows
        curvature = self._turning.curvature(float(ekf.x[SPEED]))
        total = self._balance.sum_of_pulls(cycle, curvature)
        if any(each and each.unread for each in stationary):
            # The sum of all pulls tells the drag of this wheel, not the soil of the others.
            return forces, total, stationary, rows
        balance = self._balance.update(
            ekf, forces, total, cycle, stationary=stationary, model_variance=start, repeats=repeats
        )
        return forces, total, stationary, [*rows, balance]

    def _curve_known(self, time: float) -> bool:
        """Return whether a stated soil or torques tell slip from pull."""
        return self._configuration.soil_stated or self._wheels.torque_known(time)

    def _depth_read(self, time: float) -> bool:
        """Return whether the sinkage of most wheels is measured."""
        return 2 * len(self._sinkage.unread(time)) < self._rover.wheel_count

    # -- Slip, stuck warning, margins ------------------------------------------------------------

    def _judge(self, time: float) -> None:
        """Judge the slip of each wheel and the stuck warning at a time [s]."""
        rims = self._wheels.rim_speeds(time)
        present = self._present_speed(rims)
        motion = self._turning.state
        body = BodyMotion(
            present.speed,
            math.sqrt(max(present.variance, 0.0)),
            motion.yaw_rate,
            motion.yaw_rate_std,
            self._steering.state.headings,
            motion.lateral_motion,
            stopped=self._zero_velocity.standing() and time >= self._reference.state.sliding_until,
            rim_stds=self._wheels.stds(),
        )
        slips = self._slips.update(time, rims, body)
        ekf = self._ekf
        fastest = max(known(rims), key=abs, default=0.0)
        stands = abs(fastest) <= self._rover.rest_speed
        # Where all wheels stand that of the last drive, 0 before one.
        drive_sign = self._contact_age.state.direction if stands else fastest
        loads = self._loads.state
        assessment = self._stuck.update(
            time,
            RoverMotion(
                present.speed,
                self._reference.fresh(time),
                self._wheel_motions(rims, slips, drive_sign, present.widening),
                turning=motion.lateral_motion > _SHARP_TURN
                or sides_oppose(rims, body.headings.by_yaw_rate),
                depth_read=self._depth_read(time),
                slip_known=self._reference.known_twice(time),
                demand=self._demand.state,
                holding_share=self._holding_share() if stands else 0.0,
            ),
        )
        self._clock = self._clock._replace(assessment=assessment, speed=present)
        if self._is_due(time, self._slopes.state.time):
            if int(time) != self._slopes.state.latest_second:
                direction = self._contact_age.state.direction or 1.0
                states = contact_states(ekf.x, self._layout, loads.load, self._ruts.state.depth)
                self._margin.update(states, direction * loads.slope_share)
            self._learn_slopes(time, slips, rims, motion.lateral_motion)
            self._follow_sideways(time, body, rims)
        if self._buffer is not None:
            self._buffer.mark(self._instant(time, body), Gaussian(ekf.x, ekf.P))

    def _wheel_motions(
        self, rims: Floats, slips: tuple[WheelSlip, ...], drive_sign: float, widening: float
    ) -> tuple[WheelMotion, ...]:
        """Return what the stuck warning needs of each wheel.

        The sign of `drive_sign` is the direction in which a locked wheel is driven or dragged. A
        slip that may be far greater is no less a warning: its deviation is without `widening`.
        """
        rover, torques = self._rover, self._wheels.state.torque
        sinkage = self._ekf.x[self._layout.sinkage].tolist()
        motions = []
        for i, (wheel, rim) in enumerate(zip(slips, rims, strict=True)):
            turns = abs(rim) > rover.rest_speed
            motions.append(
                WheelMotion(
                    wheel.slip,
                    wheel.std / widening,
                    rim,
                    turns and not wheel.resting,
                    driving_share(torques[i], rover.torque_limit[i], rim if turns else drive_sign),
                    sinkage[i],
                    rover.rim_radius[i],
                )
            )
        return tuple(motions)

    def _holding_share(self) -> float:
        """Return the share of all torque limits that holds the rover on its slope [-]."""
        limit, loads = sum(self._rover.torque_limit), self._loads.state
        if limit <= 0.0:
            return 0.0
        levers = zip(loads.load, self._rover.slip_radius, strict=True)
        return abs(loads.slope_share) * sum([load * radius for load, radius in levers]) / limit

    def _learn_slopes(
        self, time: float, slips: tuple[WheelSlip, ...], rims: Floats, lateral_motion: float
    ) -> None:
        """Update slip as a function of slope, while driving straight on steady contacts."""
        since = time - self._slopes.state.time
        inertial = self._inertial.state
        turning = [
            (wheel, abs(rim))
            for wheel, rim in zip(slips, rims, strict=True)
            if wheel.judged and abs(rim) > self._rover.low_rim
        ]
        steady = self._contact_age.settled and lateral_motion <= _SHARP_TURN and bool(turning)
        measured = time - inertial.force_time <= self._rover.silence
        self._slopes.update(
            SlopeInstant(
                time,
                self._demand.state if measured else NAN,
                median([wheel.slip for wheel, _ in turning]) if steady else 0.0,
                median([wheel.std for wheel, _ in turning]) if steady else 1.0,
                median([rim for _, rim in turning]) * since if steady and since > 0.0 else 0.0,
                self._contact_age.state.direction,
            )
        )

    def _follow_sideways(self, time: float, body: BodyMotion, rims: Floats) -> None:
        """Update the lateral motion (side slip) from loads, pulls and soil strength."""
        loads, ekf, soil = self._loads.state, self._ekf, self._configuration.soil
        strength = math.exp(float(ekf.x[SHEAR_STRENGTH]))
        self._sideways.update(
            time,
            SidewaysInputs(
                speed=body.speed,
                speed_std=body.speed_std,
                yaw_rate=body.yaw_rate,
                yaw_rate_std=body.yaw_rate_std,
                rims=rims,
                steering=self._steering.state.angles,
                loads=loads.load,
                pulls=tuple(self._pulls.state.pull),
                sinkage=tuple(ekf.x[self._layout.sinkage].tolist()),
                lateral_force=loads.force[1] if loads.force_known else NAN,
                lateral_force_std=self._sensors.specific_force_bias_std,
                cohesion=float(soil.cohesion) * strength,
                tan_friction=math.tan(float(soil.friction_angle)) * strength,
                shear_modulus=float(soil.shear_modulus) * math.exp(float(ekf.x[SHEAR_MODULUS])),
            ),
        )

    def _lateral_forces(self, cycle: Cycle) -> Sideways | None:
        """Return the lateral forces in a turn, None where they are unknown."""
        sideways = self._sideways.state.latest
        if sideways is None or cycle.lateral_motion < TURN:
            return None
        if max(sideways.angle_std) > _ANGLE_KNOWN:
            return None
        return sideways

    def _instant(self, time: float, body: BodyMotion) -> Instant:
        """Return what a smoother needs to recompute the outputs of a stamp."""
        ekf, nothing = self._ekf, np.empty(0)
        rims = self._yaw_compensated(self._wheels.rim_speeds(time))
        speed, variance, _ = self._filtered_speed(rims)
        sources = self._sources()._replace(
            mean=nothing, covariance=nothing, speed=speed, speed_variance=variance
        )
        cycle = SpeedAndVariance(float(ekf.x[SPEED]), float(ekf.P[SPEED, SPEED]))
        return Instant(time, body, sources, cycle, self._speed_by_torque(rims))

    def _present_speed(self, rims: Floats) -> SpeedAndVariance:
        """Return speed [m/s] and variance at the present stamp."""
        rolling = self._yaw_compensated(rims)
        filtered = self._filtered_speed(rolling)
        usual = self._speed_by_torque(rolling)
        return filtered if usual is None else pooled(filtered, usual)

    def _yaw_compensated(self, rims: Floats) -> RimSpeeds:
        return RimSpeeds.of(rims, self._turning.state.yaw_rate, self._steering.state.headings)

    def _filtered_speed(self, rims: RimSpeeds) -> SpeedAndVariance:
        """Return speed [m/s] and variance of the filter, extrapolated from the last cycle."""
        time = self._clock.time
        window = self._trusted(self._inertial.state.window, time)
        slip_known = self._reference.known(time)
        speed, variance = self._speed.present(self._ekf, time, rims, window, inflated=slip_known)
        variance *= excess(self._reference.state.nis)
        return SpeedAndVariance(speed, variance + self._reference.doubt_variance(time))

    def _speed_by_torque(self, rims: RimSpeeds) -> Opinion | None:
        """Return speed [m/s] and variance by the typical slip at the measured torques.

        None with a reference velocity, without torques, in turns, on forming contacts, or while
        the stuck assessment says that the ground holds the rover. Its share grows as the filter
        forgets what the last reference showed, as its slip reverts to equilibrium.
        """
        time, turns = self._clock.time, self._turning.state.lateral_motion > _SHARP_TURN
        straight = self._contact_age.settled and not turns
        applies = straight and self._wheels.torque_known(time)
        if self._reference.known(time) or not applies or self._clock.assessment.holds:
            return None
        usual = slip_of_torque(self._torque_coefficient.state)
        if isnan(usual.slip) or not abs(rims.typical) >= self._rover.low_rim:
            return None
        rim, unknown = rims.typical, self._reference.unknown_for(time)
        share = -math.expm1(-abs(rim) * unknown / EQUILIBRIUM_LENGTH)
        return Opinion((1.0 - usual.slip) * rim, (usual.std * rim) ** 2, share, rim)

    # -- Outputs ---------------------------------------------------------------------------------

    def estimates(self) -> EstimateSet:
        """Return all outputs at the present stamp; the state is not changed."""
        time = self._clock.time
        inertial = self._inertial.state
        silent = time - inertial.time > self._rover.silence
        missing = {
            'wheel_odometry': self._wheels.silent(time),
            'imu': silent,
            'orientation': not silent and not inertial.attitude.reported,
            'torque': not self._wheels.torque_known(time),
            'sinkage': len(self._sinkage.unread(time)) == self._rover.wheel_count,
            'acceleration': not silent and time - inertial.force_time > self._rover.silence,
            'angular_rate': not silent and time - inertial.rate_time > self._rover.silence,
            'reference': not self._reference.fresh(time),
        }
        faults = {name: words for name, words in COST.items() if missing[name]}
        return self._outputs.estimate_set(self._sources(), faults)

    def _sources(self) -> Sources:
        """Return the quantities from which the outputs of the present stamp are computed."""
        time, loads = self._clock.time, self._loads.state
        rims = self._wheels.rim_speeds(time)
        speed, variance, _ = self._clock.speed or self._present_speed(rims)
        return Sources(
            stamp=self._clock.stamp,
            mean=self._ekf.x,
            covariance=self._ekf.P,
            speed=speed,
            speed_variance=variance,
            yaw_rate=self._turning.state.yaw_rate,
            yaw_rate_std=self._turning.state.yaw_rate_std,
            rims=rims,
            slips=self._slips.state,
            loads=loads,
            pulls=self._pulls.state,
            sinkage=self._sinkage_process.state,
            margin=self._margin.state,
            assessment=self._clock.assessment,
            slip_on_slope=self._slopes.state.latest,
            sideways=self._sideways.state.latest,
        )

    def learned(self) -> dict[str, Any]:
        """Return identified parameters: configuration key -> value; ``_std`` = deviation."""
        ekf = self._ekf
        zero, climbed = self._zero_velocity.state.zero, self._climb.state
        return self._learned.values(ekf.x, ekf.P, zero, climbed)

    def taught(self) -> tuple[Taught, ...]:
        """Return the information gained on each parameter in this drive so far."""
        ekf = self._ekf
        return self._teaching.judged(with_model_errors(ekf.x, ekf.P, self._layout))

    def health(self) -> dict[str, Any]:
        """Return counters and consistency figures for diagnostics."""
        reference, sinkage = self._reference.state, self._sinkage.state
        report: dict[str, Any] = {
            'rejected_reference': reference.rejected,
            'rejected_sinkage': sinkage.rejected,
            'filter_restarts': self._ekf.restarts,
        }
        for channel, nis in (
            ('sinkage', sinkage.nis),
            ('reference', reference.nis),
            ('torque', self._torque.nis),
            ('balance', self._balance.state),
        ):
            if nis is not None:
                report[f'nis_{channel}'] = round(nis, 3)
        zero = self._zero_velocity.state.zero
        report['gyro_zero_yaw_rad_s'] = float(f'{zero.yaw:.3g}')
        report['accelerometer_bias_m_s2'] = float(f'{float(self._ekf.x[GRAVITY_BIAS]):.3g}')
        return report | self._noise.report(self._inertial.stated)
