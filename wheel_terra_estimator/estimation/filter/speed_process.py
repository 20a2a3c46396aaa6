# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Process model of the body speed: propagated with the wheels and with the accelerometer.

Two predictions of the change of speed over a step, each with its own variance, are combined by
their inverse variances:

* with the wheels: v / rim speed changes by the change of the required traction coefficient times
  the slip per demand (state), and by a random walk over rim travel. Exact through ramps, stops and
  restarts of a slow rover; poor where wheels spin up fast.
* with the accelerometer: dv = (f_x - g_x - bias) dt. Good for fractions of a second; its error over
  a second is negligible beside 1 m/s, and as large as a speed of 5 cm/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.cycle import Cycle, RimSpeeds
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import EquilibriumSlip
from wheel_terra_estimator.estimation.filter.consistency import excess, smoothed_nis
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter, Row, chi_square_gate
from wheel_terra_estimator.estimation.filter.state import (
    GRAVITY_BIAS,
    SLIP_PER_DEMAND,
    SPEED,
    Prediction,
)
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.inputs.noise import StatedNoise
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import (
    NAN,
    TIME_ROUNDING,
    clipped,
    gain_of,
    known,
    median,
)

LEAST_SLIP_STD = 0.02
"""Least deviation of the speed over the rim speed [-]: no soil model is better."""
_LEAST_WHEELS = 3  # needed for a median absolute deviation

# Tuned on simulated drives, seeds 1000 to 1019, where no other source is given.
_FIRST_RATIO = 0.95  # v / rim speed before anything is known: level, loose soil
_FIRST_RATIO_STD = 0.3
_LEAST_REVERSED_RATIO = 0.2
_MOST_REVERSED_RATIO = 1.1
_REVERSED_SLIP_SHARE = 0.5
"""Slip right after a reversal over the steady one [-]: it grows as ruts and shear form again.
Tuned on stops and reversals in simulators A and B, seeds 1000 to 1005."""
_FIRST_SPEED_SHARE = 0.3
"""Deviation of the speed over the rim speed when wheel rates first arrive [-]."""
_LEAST_RATIO = 0.0  # remembered v / rim speed: no wheel drives a rover that moves against it
_MOST_RATIO = 2.0
_LEAST_RATIO_STD = 0.1
_MOST_RATIO_STD = 0.5
_RATIO_RIM = 2.0  # over the low rim speed: v / rim speed is remembered above it
_COAST_DRIFT = 0.05  # [m/s^2] of a rover whose wheel rates are missing
_COAST_WALK = 0.02  # [m/s/sqrt(s)]
_RIM_CHANGE = 0.2
"""Error of a change of rim speed as a change of speed, over that change [-]."""
_FLOOR_WALK = 1e-8  # [(m/s)^2/s]
_START_WALK = 0.4
"""Random walk of v / rim speed at a start [1/sqrt(m)]: ruts form and the slip settles."""
_START_WALK_TRAVEL = 0.2  # [m] with which it decays
_DIGGING_WALK = 12.0
"""The same over the sinkage that most wheels gain per rim travel [1/sqrt(m)]: the slip changes with
the contacts."""
_MOST_WALK = 0.6  # limit of that walk [1/sqrt(m)]
_WATCHED_SHARE = 0.5
"""Factor on ``filter.ratio_walk`` where measured sinkages would show such a change [-]."""
_SLIP_PER_DEMAND_WALK = 0.2  # [1/sqrt(m)]
_INFLATION_RATE = 2.0
"""Process noise of an expected change of speed, over its square [1/s]: it takes half a second."""
_INFLATION_TIME = 0.3  # with which the inflation decays [s]
_RATE_NOISE = 3.0
"""Deviations of the wheel rates within which wheels do not disagree or change their speed [-]."""
_SIDE_TIME = 1.0  # time constant of the rim speeds that sides are compared with [s]
_SIDE_CHANGE = 1.0  # change of speed over the change of one side against the other [-]
_LEAST_COVERED = 0.5  # of a step by the IMU, to use it
_BIAS_WALK = 1e-3  # of the accelerometer's bias [m/s^2/sqrt(s)]
_ATTITUDE_TIME = 20.0
"""Time constant of the errors of the attitude [s]; faster ones are seen as noise."""
_EQUILIBRIUM_SLIP_STD = 0.2  # of the slip about that of the configured soil on such a slope [-]
EQUILIBRIUM_LENGTH = 1.5  # rim travel over which the slip reverts to it [m]
HELD_LENGTH = 15.0
"""The same for a rover that is held by the ground [m]: no attempt to drive on lasts longer."""
_LEAST_EQUILIBRIUM_SLIP = -0.2
_MOST_EQUILIBRIUM_SLIP = 0.8
_DRIVING_TORQUE = 0.3
"""Torque over load times radius of a wheel that drives [-]: on loose soil it slips by a tenth."""
_BOUND_DEVIATIONS = 2.0  # of the speed, by which it may exceed that of such a wheel
_START_SHARE = 0.5
"""Relative difference from the expected speed above which, at a start without a reference velocity,
the speed may be a transient of the accelerometer [-]."""
_MOST_TRANSIENT = 0.1
"""Greatest speed that a transient causes [m/s] (0.3 m/s^2 for 0.3 s); more is a slide."""


class SpeedStep(NamedTuple):
    """Linear prediction v' = a v + b bias + c with variance q."""

    speed_gain: float
    bias_gain: float
    constant: float
    variance: float
    wheel_weight: float = 1.0  # of the prediction with the wheels in it [-]


class Reversion(NamedTuple):
    """Mean reversion of the speed over a step: v' = keep v + constant, and variance of its own."""

    keep: float = 1.0
    constant: float = 0.0  # [m/s]
    variance: float = 0.0  # [(m/s)^2]

    def of(self, step: SpeedStep) -> SpeedStep:
        """Return a prediction with it."""
        return step._replace(
            speed_gain=self.keep * step.speed_gain,
            bias_gain=self.keep * step.bias_gain,
            constant=self.keep * step.constant + self.constant,
            variance=self.keep * self.keep * step.variance + self.variance,
        )


class PastDrive(NamedTuple):
    """Last drive in a direction."""

    ratio: float  # v / rim speed
    ratio_std: float
    demand: float  # required traction coefficient [-]; nan = unknown


class SpeedState(NamedTuple):
    """Memory of the prediction of the speed."""

    cycle_time: float  # of the last cycle [s], nan = none yet
    rims: RimSpeeds  # at the last cycle
    ratio: float  # v / rim speed
    ratio_std: float
    ratio_walk: float  # random walk of it [1/sqrt(m)]
    inflation: float = 0.0
    """Change of speed that changing contacts may cause [m/s], for the process noise."""
    slow_rims: Floats = ()  # `rims.each`, low-passed over a second [m/s]
    settled: bool = True  # whether the contacts were, at the last cycle
    other_direction: PastDrive | None = None
    acceleration_nis: float | None = None
    """Running mean of the NIS of wheels against accelerometer; None = never compared."""


class SpeedProcess(Component[SpeedState]):
    """Predicts the body speed."""

    def __init__(self, configuration: Configuration, rover: Rover, sensors: SensorFigures) -> None:
        self._walk = float(configuration.filter.ratio_walk)
        self._gate = float(configuration.filter.gate)
        self._soil_stated = configuration.soil_stated
        unknown = RimSpeeds((NAN,) * rover.wheel_count, NAN, NAN)
        super().__init__(
            SpeedState(
                NAN, unknown, _FIRST_RATIO, _FIRST_RATIO_STD, self._walk, slow_rims=unknown.each
            )
        )
        self._rover, self._sensors = rover, sensors
        self._equilibrium_slip = EquilibriumSlip(configuration, rover)
        self._rim_noise = _RATE_NOISE * sensors.wheel_rate_std * max(rover.slip_radius)

    def acceleration_noise(self, stated: StatedNoise) -> tuple[float, float]:
        """Return the noise of specific force less gravity, as the IMU states it or by default.

        Power spectral density of the white noise [(m/s^2)^2 s], and of the random walk of the bias,
        with gravity by errors of the attitude [(m/s^2)^2/s].
        """
        sensors = self._sensors
        force = stated.specific_force_std or sensors.specific_force_std
        attitude = self._rover.gravity * (stated.orientation_std or sensors.orientation_std)
        walk = _BIAS_WALK**2 + 2.0 * attitude**2 / _ATTITUDE_TIME
        return force**2 / max(sensors.imu_rate, 1.0), walk

    # -- Inputs from other components ------------------------------------------------------------

    def inflate(self, speed_change: float) -> None:
        """Inflate the process noise for changing contacts, by `speed_change` [m/s]."""
        if speed_change > self.state.inflation:
            self.state = self.state._replace(inflation=speed_change)

    def follow_sides(self, rims: RimSpeeds, dt: float) -> None:
        """Inflate the process noise where rim speeds change relative to one another.

        At the start or end of a turn the two sides slip differently, so that the body speed is not
        that of their mean.
        """
        slow = self.state.slow_rims
        gain = gain_of(dt, _SIDE_TIME)
        self.state = self.state._replace(
            slow_rims=tuple(
                [
                    now if isnan(old) else old if isnan(now) else old + gain * (now - old)
                    for old, now in zip(slow, rims.each, strict=True)
                ]
            )
        )
        changes = spread([now - old for old, now in zip(slow, rims.each, strict=True)])
        self.inflate(_SIDE_CHANGE * max(changes - self._rim_noise, 0.0))

    def reverse_direction(self, ekf: GatedFilter, before: float, now: float) -> None:
        """Set v / rim speed for a drive in the other direction: uphill becomes downhill.

        It starts from the last drive in this direction, else from the drive that ended. The slip
        changes by the learned slip per demand times the change of the demand, and begins with a
        share of that. `before` and `now` are the demands of the drive that ended and of this one
        [-]; nan = unknown.
        """
        state = self.state
        ended = PastDrive(state.ratio, state.ratio_std, before)
        known_one = state.other_direction or ended
        change = now - known_one.demand
        if isnan(change):
            change = 0.0
        slip = 1.0 - known_one.ratio + float(ekf.x[SLIP_PER_DEMAND]) * change
        ratio = 1.0 - _REVERSED_SLIP_SHARE * slip
        gain_std = math.sqrt(float(ekf.P[SLIP_PER_DEMAND, SLIP_PER_DEMAND]))
        self.state = state._replace(
            ratio=clipped(ratio, _LEAST_REVERSED_RATIO, _MOST_REVERSED_RATIO),
            ratio_std=clipped(
                math.hypot(known_one.ratio_std, gain_std * change),
                _LEAST_RATIO_STD,
                _FIRST_RATIO_STD,
            ),
            other_direction=ended,
        )

    def follow_contacts(
        self, travel: float, digging: float, *, contradiction: float, reference_known: bool
    ) -> None:
        """Set the random walk of v / rim speed, greater where contacts change.

        `travel` is the travel since a start [m], `digging` the sinkage that most wheels gain over
        rim travel [m/m], nan = not measured. Without a reference the steady walk is not reduced.
        Above 1, `contradiction` by the references is a factor on its variance [-].
        """
        walk = self._walk
        start = _START_WALK * math.exp(-travel / _START_WALK_TRAVEL)
        if not isnan(digging):
            steady = walk * (_WATCHED_SHARE if reference_known else 1.0)
            changing = min(_DIGGING_WALK * max(digging, 0.0), _MOST_WALK)
            walk = math.hypot(steady, changing)
        walk = max(walk, start)
        faster = min(walk * math.sqrt(max(contradiction, 1.0)), _MOST_WALK)
        self.state = self.state._replace(ratio_walk=max(walk, faster))

    # -- Prediction ------------------------------------------------------------------------------

    def since_cycle(self, time: float) -> float:
        """Return the time since the last cycle [s]; 0 before the first."""
        before = self.state.cycle_time
        return 0.0 if isnan(before) else time - before

    def step(
        self, time: float, rims: RimSpeeds, window: InertialWindow, *, inflated: bool
    ) -> SpeedStep:
        """Return the prediction of the speed from the last cycle to a time [s].

        `inflated`: changing contacts inflate its variance. Not without a reference velocity: the
        speed would then follow soil models whose errors are as large.
        """
        state = self.state
        by_wheels = self.by_wheels(
            self.since_cycle(time), rims, state.inflation if inflated else 0.0
        )
        return self.combined(by_wheels, self.since_cycle(time), window)

    def predict(self, prediction: Prediction, step: SpeedStep, cycle: Cycle) -> None:
        """Add speed, gravity bias and slip per demand to a prediction.

        `step` predicts the speed for an unchanged demand (required traction coefficient).
        """
        dt, rim, demand_change = cycle.dt, cycle.yaw_compensated.typical, cycle.demand_change
        mean, F, Q = prediction
        mean[SPEED] = (
            step.speed_gain * mean[SPEED] + step.bias_gain * mean[GRAVITY_BIAS] + step.constant
        )
        F[SPEED, SPEED] = step.speed_gain
        F[SPEED, GRAVITY_BIAS] = step.bias_gain
        Q[SPEED, SPEED] = step.variance
        Q[GRAVITY_BIAS, GRAVITY_BIAS] = self.acceleration_noise(cycle.window.stated)[1] * dt
        if demand_change and not isnan(rim):
            # v = (1 - s) rim, and ds = slip_per_demand times the change of the demand.
            gain = -step.wheel_weight * rim * demand_change
            mean[SPEED] += gain * float(mean[SLIP_PER_DEMAND])
            F[SPEED, SLIP_PER_DEMAND] = gain
            walk = _SLIP_PER_DEMAND_WALK**2
            Q[SLIP_PER_DEMAND, SLIP_PER_DEMAND] = walk * abs(rim) * dt

    def by_wheels(self, dt: float, rims: RimSpeeds, inflation: float) -> SpeedStep:
        """Return the prediction with the wheels alone over `dt` [s]."""
        state = self.state
        before, now = state.rims.typical, rims.typical
        if isnan(before) or isnan(now):
            # No wheel rates: constant speed, with a variance that allows for braking.
            variance = (_COAST_DRIFT * dt) ** 2 + (_COAST_WALK**2) * dt
            return SpeedStep(1.0, 0.0, 0.0, variance)
        change = now - before
        mean = 0.5 * (abs(before) + abs(now))
        variance = mean * mean * state.ratio_walk**2 * mean * dt
        # Opposed sides slip independently; the body moves by half of the difference.
        magnitude = rims.magnitude
        opposed = max(magnitude**2 - now**2, 0.0)
        variance += 0.5 * opposed * _MOST_WALK**2 * magnitude * dt
        variance += (_RIM_CHANGE * change) ** 2 + _FLOOR_WALK * dt
        disagreement = self.disagreement(rims)
        variance += _INFLATION_RATE * inflation * inflation * dt + disagreement * disagreement
        if state.settled and state.ratio > 0.0 and state.rims.along(self._rover.low_rim):
            return SpeedStep(now / before, 0.0, 0.0, variance)
        # At a start: the ratio v / rim speed of slow wheels is noise, so the kept one is used.
        variance += state.ratio_std**2 * max(now * now - before * before, 0.0)
        return SpeedStep(1.0, 0.0, state.ratio * change, variance)

    def velocity_increment(self, dt: float, window: InertialWindow) -> tuple[float, float] | None:
        """Return the change of speed by the accelerometer over `dt` [s], and its variance.

        [m/s], [(m/s)^2], the bias included; None where the IMU covers too little of the step.
        """
        covered = window.duration
        if covered < _LEAST_COVERED * dt or dt <= 0.0:
            return None
        # Vibration: observed noise counts where it exceeds the configured one.
        stated, _ = self.acceleration_noise(window.stated)
        noise = max(stated, window.noise_density) * excess(self.state.acceleration_nis) ** 2
        # Gaps of the IMU are filled with the mean acceleration of the step.
        return window.speed_change * dt / covered, noise * dt

    def learn_bias(
        self, ekf: GatedFilter, cycle: Cycle, step: SpeedStep, by_wheels: SpeedStep
    ) -> float:
        """Fuse the pseudo-measurement that wheels and accelerometer give the same change of speed.

        Their difference shows the bias, best at rest, where the wheels are exact. `step` is the
        prediction without accelerometer. Changes of the wheel rates within their noise would look
        like wheels that the rover does not follow: of the speed only what sets `step` apart from
        `by_wheels` is then seen. Return the variance [(m/s)^2] to be added to either where the
        difference exceeds the gate: soil may fail suddenly, which is no random walk and which wheel
        rates do not show, or a stone shake the IMU. If the difference lasts, the accelerometer
        noise grows with the running NIS: the attitude is probably wrong.
        """
        increment = self.velocity_increment(cycle.dt, cycle.window)
        if (
            increment is None
            or isnan(self.state.rims.typical)
            or isnan(cycle.yaw_compensated.typical)
        ):
            return 0.0
        row = np.zeros(len(ekf.x))
        spun = abs(cycle.yaw_compensated.typical - self.state.rims.typical)
        known_gain = 1.0 if spun > _RATE_NOISE * median(cycle.rim_noise) else by_wheels.speed_gain
        row[SPEED], row[GRAVITY_BIAS] = step.speed_gain - known_gain, cycle.dt
        change = (step.speed_gain - 1.0) * float(ekf.x[SPEED]) + step.constant
        residual = increment[0] - change - cycle.dt * float(ekf.x[GRAVITY_BIAS])
        variance = step.variance + increment[1]
        expected = float(row @ ekf.P @ row) + variance
        lacking = chi_square_gate(residual, expected, self._gate)
        nis = smoothed_nis(self.state.acceleration_nis, min(residual**2 / expected, self._gate))
        self.state = self.state._replace(acceleration_nis=nis)
        ekf.fuse([Row(residual, row, variance + lacking)])
        return lacking

    def combined(
        self, step: SpeedStep, dt: float, window: InertialWindow, lacking: float = 0.0
    ) -> SpeedStep:
        """Return the prediction with the wheels combined with the accelerometer's over `dt` [s].

        `lacking` is variance of the accelerometer's beyond its noise [(m/s)^2].
        """
        increment = self.velocity_increment(dt, window)
        if increment is None:
            return step
        accelerated, noise = increment[0], increment[1] + lacking
        weight = noise / (noise + step.variance)  # of the wheels
        return SpeedStep(
            weight * step.speed_gain + (1.0 - weight),
            -(1.0 - weight) * dt,
            weight * step.constant + (1.0 - weight) * accelerated,
            step.variance * noise / (step.variance + noise),
            weight,
        )

    def disagreement(self, rims: RimSpeeds) -> float:
        """Return the spread of the changes of rim speed among wheels since the last cycle [m/s].

        Median absolute deviation, less that of rate noise: a single outlying wheel does not count,
        two that spin up beside two at rest do.
        """
        changes = [now - old for now, old in zip(rims.each, self.state.rims.each, strict=True)]
        return max(spread(changes) - self._rim_noise, 0.0)

    def reversion(
        self, cycle: Cycle, direction: float, length: float, *, buried: bool
    ) -> Reversion:
        """Without a reference velocity, revert v / rim speed to the equilibrium slip of the slope.

        On deep or saturated contacts torque and pull hardly change with slip. There slip
        is unobservable and a random walk diverges; mean reversion (Ornstein-Uhlenbeck) bounds it.
        `length` is its length in rim travel [m]; `buried` wheels revert to the greatest slip.
        """
        rim, demand = cycle.yaw_compensated.typical, direction * cycle.loads.slope_share
        if not abs(rim) >= self._rover.low_rim:
            return Reversion()
        most = _MOST_EQUILIBRIUM_SLIP
        slip = most if buried else self._equilibrium_slip.at(demand, beyond=most)
        ratio = 1.0 - clipped(slip, _LEAST_EQUILIBRIUM_SLIP, most)
        keep = math.exp(-abs(rim) * cycle.dt / length)
        # On an unknown slope or soil no more is known than before the drive.
        known_slip = self._soil_stated and cycle.loads.force_known
        std = _EQUILIBRIUM_SLIP_STD if known_slip else _FIRST_RATIO_STD
        return Reversion(keep, (1.0 - keep) * ratio * rim, (1.0 - keep * keep) * (std * rim) ** 2)

    def present(
        self,
        ekf: GatedFilter,
        time: float,
        rims: RimSpeeds,
        window: InertialWindow,
        *,
        inflated: bool,
    ) -> tuple[float, float]:
        """Return speed [m/s] and variance extrapolated from the last cycle to a time [s]."""
        x, P = ekf.x, ekf.P
        speed, variance = float(x[SPEED]), float(P[SPEED, SPEED])
        if self.since_cycle(time) < TIME_ROUNDING:
            return speed, variance
        a, b, constant, noise, _ = self.step(time, rims, window, inflated=inflated)
        carried = a * speed + b * float(x[GRAVITY_BIAS]) + constant
        return carried, (
            a * a * variance
            + 2.0 * a * b * float(P[SPEED, GRAVITY_BIAS])
            + b * b * float(P[GRAVITY_BIAS, GRAVITY_BIAS])
            + noise
        )

    # -- Corrections of the filter ---------------------------------------------------------------

    def begin(self, ekf: GatedFilter, rims: RimSpeeds) -> None:
        """Initialise the speed at the first wheel rates: the wheels may roll, spin or rest."""
        if isnan(self.state.rims.typical) and not isnan(rims.typical):
            spread = max(_FIRST_SPEED_SHARE * abs(rims.typical), self._rover.rest_speed)
            ekf.set(SPEED, self.state.ratio * rims.typical, spread * spread)

    def remove_start_transient(self, ekf: GatedFilter, cycle: Cycle) -> None:
        """At a start without a reference velocity, reset the speed to the slip of the last drive.

        While the wheels turn slowly a transient of the accelerometer dominates the speed. A slide,
        or wheels that spin up, make a greater difference than such a transient.
        """
        rim = cycle.yaw_compensated.typical
        expected = self.state.ratio * rim
        off = abs(float(ekf.x[SPEED]) - expected)
        transient = _START_SHARE * abs(expected) < off < _MOST_TRANSIENT
        if transient and abs(rim) > self._rover.low_rim:
            ekf.set(SPEED, expected, (self.state.ratio_std * rim) ** 2)

    def keep_with_rims(self, ekf: GatedFilter, rims: RimSpeeds) -> None:
        """Without a reference velocity, set the speed to 0 where it opposes the wheels.

        Only a slide does that, and the saturated forces of its wheels would never end the error.
        """
        if abs(rims.typical) > self._rover.low_rim and rims.oppose(float(ekf.x[SPEED])):
            _reset_speed(ekf, 0.0, rims)

    def keep_behind_driving_wheels(self, ekf: GatedFilter, cycle: Cycle) -> None:
        """Without a reference velocity, bound the speed by that of the slowest driving wheel.

        A wheel that the soil drags along turns; one that turns slowly under a torque has stalled.
        """
        rims, loads = cycle.yaw_compensated, cycle.loads.load
        sign = math.copysign(1.0, rims.typical)
        driving = [
            max(sign * rim, 0.0)
            for rim, torque, load, radius in zip(
                rims.each, cycle.torque, loads, self._rover.slip_radius, strict=True
            )
            if sign * torque > _DRIVING_TORQUE * load * radius
        ]
        slowest = min(known(driving), default=math.inf)
        margin = _BOUND_DEVIATIONS * math.sqrt(float(ekf.P[SPEED, SPEED]))
        if sign * float(ekf.x[SPEED]) - slowest > margin:
            _reset_speed(ekf, sign * slowest, rims)

    def keep_least_variance(self, ekf: GatedFilter, rims: Floats) -> None:
        """Keep the deviation of v / rim speed above `LEAST_SLIP_STD`, by covariance inflation."""
        typical = sum(abs(rim) for rim in known(rims)) / len(rims)
        lacking = (typical * LEAST_SLIP_STD) ** 2 - float(ekf.P[SPEED, SPEED])
        if lacking > 0.0:
            ekf.inflate(SPEED, lacking)

    def end_cycle(
        self,
        time: float,
        ekf: GatedFilter,
        rims: RimSpeeds,
        *,
        settled: bool,
        turning: bool = False,
    ) -> None:
        """Keep what the next cycle needs; v / rim speed is not kept from sharp turns."""
        state, rim = self.state, rims.typical
        inflation = state.inflation * math.exp(-self.since_cycle(time) / _INFLATION_TIME)
        ratio, ratio_std = state.ratio, state.ratio_std
        if settled and not turning and rims.along(_RATIO_RIM * self._rover.low_rim):
            speed, variance = float(ekf.x[SPEED]), float(ekf.P[SPEED, SPEED])
            ratio = clipped(speed / rim, _LEAST_RATIO, _MOST_RATIO)
            std = math.sqrt(variance) / abs(rim)
            ratio_std = clipped(std, _LEAST_RATIO_STD, _MOST_RATIO_STD)
        self.state = state._replace(
            cycle_time=time,
            rims=rims,
            ratio=ratio,
            ratio_std=ratio_std,
            inflation=inflation,
            settled=settled,
        )


def _reset_speed(ekf: GatedFilter, speed: float, rims: RimSpeeds) -> None:
    """Reset an impossible speed [m/s], with at least the variance of an initial slip."""
    least = (_FIRST_RATIO_STD * rims.typical) ** 2
    ekf.set(SPEED, speed, max(float(ekf.P[SPEED, SPEED]), least))


def spread(changes: Sequence[float]) -> float:
    """Return the median absolute deviation of the known changes; 0 if fewer than 3."""
    there = known(changes)
    if len(there) < _LEAST_WHEELS:
        return 0.0
    middle = median(there)
    return median([abs(change - middle) for change in there])
