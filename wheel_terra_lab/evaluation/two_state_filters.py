# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The simplest filters with which the estimator has to bear comparison: two or three states.

The slip of the rover follows what the wheels are asked to give, q: the mean torque over the load
times the radius, or the slope. Two states: s = a + k q. Three states: the shear law of Janosi and
Hanamoto (1961) read backwards, s = a - s0 sign(q) ln(1 - |q| / q_max). The offset a walks with the
travel of the rims, the rest is learned, and each reference velocity v = (1 - s) r w is fused at its
own stamp. They see the measurements that the estimator sees, in the order of arrival.
"""

from __future__ import annotations

import bisect
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    WheelOdometry,
)
from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

Demand = Literal['torque', 'pitch', 'curve']
"""Two states over the torque, two over the slope, three over the torque."""


@dataclass(frozen=True)
class TwoStateTuning:
    """Numbers of a filter; found on tuning seeds of simulators A and B."""

    offset: float = 0.05  # of the slip at demand 0, at the start
    offset_std: float = 0.15
    gain: float = 0.7  # slip per demand, at the start
    gain_std: float = 0.5
    offset_walk: float = 0.1  # of the offset per root of the travel [1/sqrt(m)]
    gain_walk: float = 0.2  # of the gain per root of the travel [1/sqrt(m)]
    radius_std: float = 0.01  # of the wheels, as a share: correlated error of the slip
    smoothing: float = 0.5  # [s], of the demand
    yaw_smoothing: float = 0.2  # [s]
    largest_slip: float = 1.1  # sliding back no faster than a tenth of the rims
    turning_share: float = 0.3  # mean over fastest rim below which a reference tells no slip


TUNING: dict[Demand, TwoStateTuning] = {
    'torque': TwoStateTuning(),
    'pitch': TwoStateTuning(gain=1.0, gain_std=1.0),
    'curve': TwoStateTuning(offset=0.0, offset_std=0.1, offset_walk=0.03, smoothing=0.4),
}
_SLIP_SCALE, _SLIP_SCALE_STD = 0.5, 0.4  # s0 of three states, and of its logarithm
_LARGEST_DEMAND, _LARGEST_DEMAND_STD = 0.6, 0.3  # q_max, and of its logarithm
_NEAREST = 0.97  # |q| / q_max beyond which the curve is read no further


_YAW_BIAS = 5e-4  # [rad/s], left of the gyro's bias after a rest
_LEAST_SPEED_STD = 5e-4  # [m/s], as that of a reference that is believed


@dataclass(frozen=True)
class SlipCourse:
    """Slip (k, n) with one standard deviation at the stamps asked for."""

    slip: FloatArray
    std: FloatArray


@dataclass
class _Odometry:
    """What is kept of each message of the wheels."""

    stamp: list[int] = field(default_factory=list)
    rim: list[FloatArray] = field(default_factory=list)  # (n,) [m/s]
    demand: list[float] = field(default_factory=list)
    travel: list[float] = field(default_factory=list)  # of the mean rim [m]
    yaw_rate: list[float] = field(default_factory=list)

    def before(self, stamp: int) -> int:
        """Return the last row at or before a stamp, the first if none."""
        return max(bisect.bisect_right(self.stamp, stamp) - 1, 0)


class _LowPass:
    def __init__(self, time: float) -> None:
        self.value, self._time, self._last = 0.0, time, 0

    def add(self, stamp: int, value: float) -> float:
        dt = 0.0 if self._last == 0 else max(stamp - self._last, 0) * 1e-9
        share = 1.0 if self._last == 0 else 1.0 - np.exp(-dt / self._time)
        self.value += share * (value - self.value)
        self._last = stamp
        return self.value


class TwoStateFilter:
    """Offset and gain of the slip over a demand."""

    def __init__(self, configuration: Configuration, demand: Demand) -> None:
        self._configuration = configuration
        self._demand = demand
        self._tuning = tuning = TUNING[demand]
        self._state = np.array([tuning.offset, tuning.gain])
        self._covariance = np.diag([tuning.offset_std**2, tuning.gain_std**2])
        self._fused_travel: float | None = None
        self._odometry = _Odometry()
        self._pitch = _LowPass(tuning.smoothing)
        self._torque = _LowPass(tuning.smoothing)
        self._yaw_rate = _LowPass(tuning.yaw_smoothing)
        self._gyro_bias = 0.0
        self._rim = np.zeros(configuration.wheels.count)

    def add(self, measurement: Measurement) -> None:
        """Take a measurement, in the order of arrival."""
        if isinstance(measurement, WheelOdometry):
            self._wheels(measurement)
        elif isinstance(measurement, InertialReading):
            self._inertial(measurement)
        elif isinstance(measurement, ReferenceVelocity) and self._odometry.stamp:
            self._reference(measurement)

    def now(self) -> tuple[FloatArray, FloatArray]:
        """Return slip (n,) and its deviation at the newest wheel odometry."""
        kept = self._odometry
        rim, demand = kept.rim[-1], kept.demand[-1]
        mean = float(np.mean(rim))
        slip, row = self._slip(demand)
        covariance = self._covariance + self._walked(kept.travel[-1])
        tuning = self._tuning
        slip = min(slip, tuning.largest_slip)
        wheel_speed = (1.0 - slip) * mean - kept.yaw_rate[-1] * self._configuration.wheels.y
        found = np.nan_to_num(slip_ratio(wheel_speed, rim, self._configuration.rest_speed))
        spread = (row @ covariance @ row + tuning.radius_std**2) * mean**2
        arm = self._configuration.wheels.y
        sensors = self._configuration.sensors
        spread = spread + (arm * float(np.hypot(sensors.angular_rate_std, _YAW_BIAS))) ** 2
        spread = spread + _LEAST_SPEED_STD**2
        larger = np.maximum(np.maximum(np.abs(rim), np.abs(wheel_speed)), 1e-6)
        return found, np.minimum(np.sqrt(spread) / larger, 1.0)

    def _wheels(self, m: WheelOdometry) -> None:
        configuration, kept = self._configuration, self._odometry
        if kept.stamp and m.stamp <= kept.stamp[-1]:
            return
        wheels, rover = configuration.wheels, configuration.rover
        rim = m.rate * wheels.slip_radius
        known = ~np.isnan(rim)
        others = float(np.mean(rim[known])) if known.any() else float(np.mean(self._rim))
        self._rim = rim = np.where(known, rim, others)
        mean = float(np.mean(rim))
        direction = 1.0 if mean >= 0.0 else -1.0
        working = ~np.isnan(m.torque)
        if working.any():
            force = float(np.mean(m.torque[working] / wheels.slip_radius[working]))
            force *= wheels.count / (rover.mass * rover.gravity)
            self._torque.add(m.stamp, force)
        demand = self._pitch.value if self._demand == 'pitch' else self._torque.value
        travelled = 0.0
        if kept.stamp:
            travelled = abs(mean) * min((m.stamp - kept.stamp[-1]) * 1e-9, 1.0)
        kept.stamp.append(m.stamp)
        kept.rim.append(rim)
        kept.demand.append(direction * demand)
        kept.travel.append((kept.travel[-1] if kept.travel else 0.0) + travelled)
        kept.yaw_rate.append(self._yaw_rate.value - self._gyro_bias)

    def _inertial(self, m: InertialReading) -> None:
        gravity = self._configuration.rover.gravity
        if m.orientation is not None:
            x, y, z, w = m.orientation
            up = 2.0 * (x * z - w * y)  # z component of the rover's x axis
        else:
            up = float(m.specific_force[0]) / gravity
        if np.isfinite(up):
            self._pitch.add(m.stamp, float(up))
        if np.isfinite(m.angular_rate[2]):
            self._yaw_rate.add(m.stamp, float(m.angular_rate[2]))
            if np.abs(self._rim).max() < self._configuration.rest_speed:
                self._gyro_bias += 0.02 * (self._yaw_rate.value - self._gyro_bias)

    def _reference(self, m: ReferenceVelocity) -> None:
        kept, tuning = self._odometry, self._tuning
        row = kept.before(m.stamp)
        rim = kept.rim[row]
        mean, fastest = float(np.mean(rim)), float(np.abs(rim).max())
        if fastest < 2.0 * self._configuration.rest_speed:
            return
        if abs(mean) < tuning.turning_share * fastest:
            return
        variance = m.variance if m.variance > 0.0 else self._configuration.sensors.reference_std**2
        self._covariance = self._covariance + self._walked(kept.travel[row])
        self._fused_travel = max(kept.travel[row], self._fused_travel or 0.0)
        slip, gradient = self._slip(kept.demand[row])
        sensitivity = -mean * gradient
        innovation = m.forward - (1.0 - slip) * mean
        spread = sensitivity @ self._covariance @ sensitivity + variance
        gain = self._covariance @ sensitivity / spread
        self._state = self._state + gain * innovation
        kept_share = np.eye(len(gain)) - np.outer(gain, sensitivity)
        self._covariance = kept_share @ self._covariance @ kept_share.T + variance * np.outer(
            gain, gain
        )

    def _slip(self, demand: float) -> tuple[float, FloatArray]:
        """Return the slip at a demand and its gradient by the state."""
        row = np.array([1.0, demand])
        return float(row @ self._state), row

    def _walked(self, travel: float) -> FloatArray:
        """Return the covariance that the travel since the last fused reference adds."""
        tuning = self._tuning
        since = max(travel - (self._fused_travel or 0.0), 0.0)
        return np.asarray(np.diag([tuning.offset_walk**2, tuning.gain_walk**2]) * since)


class ThreeStateFilter(TwoStateFilter):
    """Offset, ln s0 and ln q_max of the traction curve; arguments as of `TwoStateFilter`."""

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration, 'curve')
        self._state = np.array([0.0, np.log(_SLIP_SCALE), np.log(_LARGEST_DEMAND)])
        deviations = [self._tuning.offset_std, _SLIP_SCALE_STD, _LARGEST_DEMAND_STD]
        self._covariance = np.diag(np.square(deviations))

    def _slip(self, demand: float) -> tuple[float, FloatArray]:
        offset, log_scale, log_most = self._state
        scale, most = np.exp(log_scale), np.exp(log_most)
        sign, share = np.sign(demand), min(abs(demand) / most, _NEAREST)
        mobilised = -sign * np.log1p(-share)
        gradient = np.array([1.0, scale * mobilised, -scale * sign * share / (1.0 - share)])
        return float(offset + scale * mobilised), gradient

    def _walked(self, travel: float) -> FloatArray:
        since = max(travel - (self._fused_travel or 0.0), 0.0)
        return np.diag([self._tuning.offset_walk**2 * since, 0.0, 0.0])


def slip_course(
    configuration: Configuration,
    measurements: Iterable[Measurement],
    stamps: IntArray,
    demand: Demand,
) -> SlipCourse:
    """Return the slip that the filter had, in the order of arrival, when each stamp came."""
    curved = demand == 'curve'
    two_states = (
        ThreeStateFilter(configuration) if curved else TwoStateFilter(configuration, demand)
    )
    times: list[int] = []
    rows: list[tuple[FloatArray, FloatArray]] = []
    for m in measurements:
        two_states.add(m)
        if isinstance(m, WheelOdometry) and (not times or m.stamp > times[-1]):
            times.append(m.stamp)
            rows.append(two_states.now())
    if not times:
        unknown = np.zeros((len(stamps), configuration.wheels.count))
        return SlipCourse(unknown, unknown + 1.0)
    place = np.maximum(np.searchsorted(np.array(times), stamps, side='right') - 1, 0)
    slip, std = (np.array(column)[place] for column in zip(*rows, strict=True))
    return SlipCourse(slip, std)
