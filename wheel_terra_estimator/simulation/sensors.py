# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sensors of the simulated rover: truth in, typed measurements with arrival times out.

Noise, zero errors and rates are those of the rover file (``sensors.*``): each seed draws its own
zeros, gains and biases with these standard deviations, on top of those that the file states.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.rover import SensorFigures
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors
from wheel_terra_estimator.simulation.scenario import Fault, Scenario
from wheel_terra_estimator.simulation.truth import Truth

START = 1_000_000_000_000
"""Stamp of the start of a drive [ns]; not 0, which is no stamp."""
LEAST_GAIN = 0.1
"""Least gain of a torque that is drawn [-]: another scale is no other sign."""
COMMON_GAIN, OWN_GAIN = 0.8, 0.6  # gain error of all torques (one sensor type), of each one [-]
ATTITUDE_NOISE = 0.2  # noise of the orientation over its lasting error [-]
# What the faults do: chance of a reading to be hit [-], and the error.
SPIKE_CHANCE, SPIKE = 0.1, 50.0  # of a torque, in deviations of its noise
NAN_CHANCE = 0.2  # of a wheel rate
IMU_BIAS = np.array([0.3, 0.0, 0.0])  # [m/s^2]
WILD_CHANCE, WILD_ERROR = 0.3, 10.0  # of a reference, in deviations of its noise


class Arrival(NamedTuple):
    """A measurement and when it arrives [ns]."""

    arrival: int
    measurement: Measurement


class SensorSuite:
    """All sensors of a rover, and how they fail; ``random`` is the source of all errors."""

    def __init__(
        self, scenario: Scenario, random: np.random.Generator, faults: Sequence[Fault]
    ) -> None:
        configuration = scenario.configuration
        self._configuration: Configuration = configuration
        self._there = scenario.sensors
        self._figures = figures = configuration.sensors
        self._torque = SensorFigures.from_configuration(configuration)  # as the estimator takes it
        self._errors = SensorErrors(configuration)
        self._random = random
        self._faults = faults
        n = configuration.wheels.count
        self._scale = scale = self._there.noise
        # (n,) zeros of the torques, as drawn [N m]
        self.torque_zero = scale * self._torque.torque_zero_std * random.standard_normal(n)
        gain = COMMON_GAIN * random.standard_normal() + OWN_GAIN * random.standard_normal(n)
        self._torque_gain = np.maximum(1.0 + scale * figures.torque_gain_std * gain, LEAST_GAIN)
        self._sinkage_zero = scale * figures.sinkage_zero_std * random.standard_normal(n)
        self._force_bias = scale * figures.specific_force_bias_std * random.standard_normal(3)
        self._rate_bias = scale * figures.angular_rate_bias_std * random.standard_normal(3)
        self._attitude_error = scale * figures.orientation_std * random.standard_normal(2)
        asked = self._there.reference_delay  # below 0: nothing
        self._delay = asked if asked >= 0.0 else figures.reference_delay
        self.odometry_period = 1.0 / figures.wheel_odometry_rate  # [s] between two messages
        self._periods = {
            'odometry': self.odometry_period,
            'imu': 1.0 / figures.imu_rate,
            'sinkage': 1.0 / figures.sinkage_rate,
            'reference': 1.0 / (self._there.reference_rate or figures.reference_rate),
        }
        # Sensors are not in step with each other.
        self._next = {
            name: period * (1.0 if name == 'odometry' else random.uniform())
            for name, period in self._periods.items()
        }
        self._steered = np.array(configuration.wheels.steered)
        self._before: Truth | None = None
        self._counted: FloatArray | None = None
        self._held_sinkage = np.zeros(n)
        self._last_stamp = dict.fromkeys(self._periods, START)
        self._last_arrival: dict[type, int] = {}  # of each topic

    def measure(self, truth: Truth) -> list[Arrival]:
        """Return what was measured since the last call, in the order of stamps.

        Call it for each step of the plant; the truth between two calls is taken as linear.
        """
        before = self._before or truth
        found: list[tuple[float, str]] = []
        for name, period in self._periods.items():
            while self._next[name] <= truth.time + 1e-9:
                found.append((self._next[name], name))
                self._next[name] += period
        self._before = truth
        span = max(truth.time - before.time, 1e-9)
        arrivals: list[Arrival] = []
        for time, name in sorted(found):
            part = min(max((time - before.time) / span, 0.0), 1.0)
            now = _between(before, truth, part)
            for measurement in getattr(self, f'_{name}')(now, time):
                arrivals.append(self._sent(self._errors.as_read(measurement), name, time))
        return arrivals

    # One sensor each, at a time [s] of which this is the truth ------------------------------------

    def _odometry(self, truth: Truth, time: float) -> Iterator[Measurement]:
        angle = truth.wheel_angle
        if counts := self._there.encoder_counts:
            step = 2.0 * math.pi / counts
            angle = np.floor(angle / step) * step
        counted, self._counted = self._counted, angle
        if counted is None or self._failed('no_wheel_odometry', time) is not None:
            return
        n = angle.size
        noise = self._random.standard_normal((2, n))
        rate = (angle - counted) / self.odometry_period
        # The mean rate of the period is that of its middle; drives report a filtered value too.
        rate = rate + self._scale * self._figures.wheel_rate_std * noise[0]
        torque = self._torque_gain * truth.torque + self.torque_zero
        torque += self._scale * self._torque.torque_std * noise[1]
        if (wheels := self._failed('torque_spikes', time)) is not None:
            spikes = wheels & (self._random.uniform(size=n) < SPIKE_CHANCE)
            torque = np.where(spikes, torque + SPIKE * self._torque.torque_std, torque)
        if not self._there.torque:
            torque = np.full(n, np.nan)
        elif (missing := self._failed('no_torque', time)) is not None:
            torque = np.where(missing, np.nan, torque)
        if (wheels := self._failed('nan_values', time)) is not None:
            rate = np.where(wheels & (self._random.uniform(size=n) < NAN_CHANCE), np.nan, rate)
        steering = None
        if self._steered.any():
            steering = np.where(self._steered, truth.steering, np.nan)
        yield WheelOdometry(self._stamp(time), rate, torque, steering)

    def _imu(self, truth: Truth, time: float) -> Iterator[Measurement]:
        if not self._there.imu or self._failed('no_imu', time) is not None:
            return
        figures, scale = self._figures, self._scale
        noise = self._random.standard_normal((2, 3))
        force = truth.specific_force + self._force_bias
        force = force + scale * figures.specific_force_std * noise[0]
        if self._failed('imu_bias', time) is not None:
            force = force + IMU_BIAS
        rate = truth.angular_rate + self._rate_bias
        rate = rate + scale * figures.angular_rate_std * noise[1]
        orientation = None
        if self._there.orientation and self._failed('no_orientation', time) is None:
            noise_std = ATTITUDE_NOISE * scale * figures.orientation_std
            error = self._attitude_error + noise_std * self._random.standard_normal(2)
            roll, pitch = truth.roll + error[0], truth.pitch + error[1]
            heading = float(truth.position[2])
            orientation = Rotation.from_euler('xyz', [roll, -pitch, heading]).as_quat()
        yield InertialReading(self._stamp(time), force, rate, orientation)

    def _sinkage(self, truth: Truth, time: float) -> Iterator[Measurement]:
        n = truth.sinkage.size
        if self._there.leaving_angle:
            error = self._scale * self._figures.leaving_angle_std * self._random.standard_normal(n)
            yield LeavingAngleReading(self._stamp(time), truth.leaving_angle + error)
        if not self._there.sinkage:
            return
        reading = truth.sinkage + self._sinkage_zero
        reading += self._scale * self._figures.sinkage_std * self._random.standard_normal(n)
        chance = self._random.uniform(size=(2, n))
        wild = self._random.uniform(-0.5, 1.0, size=n) * self._configuration.wheels.radius
        reading = np.where(chance[0] < self._there.sinkage_outliers, wild, reading)
        reading = np.where(chance[1] < self._there.sinkage_dropouts, np.nan, reading)
        if (missing := self._failed('no_sinkage', time)) is not None:
            reading = np.where(missing, np.nan, reading)
        if (held := self._failed('sinkage_stuck', time)) is not None:
            reading = np.where(held, self._held_sinkage, reading)
        self._held_sinkage = reading
        yield SinkageReading(self._stamp(time), reading)

    def _reference(self, truth: Truth, time: float) -> Iterator[Measurement]:
        chance = self._random.uniform(size=2)
        std = self._figures.reference_std
        error = self._scale * std * self._random.standard_normal()
        if not self._there.reference or self._failed('no_reference', time) is not None:
            return
        if chance[0] < self._there.reference_dropouts:
            return
        wild = chance[1] < self._there.reference_outliers
        if wild or (self._failed('reference_wild', time) is not None and chance[1] < WILD_CHANCE):
            error += WILD_ERROR * std * (1.0 if self._random.uniform() < 0.5 else -1.0)
        yield ReferenceVelocity(self._stamp(time), truth.forward_velocity + error, std**2)

    # Faults and transport -----------------------------------------------------------------------

    def _failed(self, kind: str, time: float) -> BoolArray | None:
        """Return the (n,) wheels that a fault of this kind concerns now; None if there is none."""
        wheels = None
        for fault in self._faults:
            if fault.kind == kind and fault.active(time):
                if wheels is None:
                    wheels = np.zeros(self._configuration.wheels.count, dtype=bool)
                wheels[slice(None) if fault.wheel is None else fault.wheel] = True
        return wheels

    def _stamp(self, time: float) -> int:
        return START + round(time * 1e9)

    def _sent(self, measurement: Measurement, name: str, time: float) -> Arrival:
        delay = self._random.exponential(self._there.jitter) if self._there.jitter else 0.0
        if name == 'reference':
            delay += self._delay
        # A topic's messages wait for one another: none overtakes the one before.
        arrival = measurement.stamp + round(delay * 1e9)
        arrival = max(arrival, self._last_arrival.get(type(measurement), 0))
        self._last_arrival[type(measurement)] = arrival
        if name != 'reference' and self._failed('zero_stamps', time) is not None:
            measurement = replace(measurement, stamp=0)
        elif name != 'reference' and self._failed('repeated_stamps', time) is not None:
            measurement = replace(measurement, stamp=self._last_stamp[name])
        else:
            self._last_stamp[name] = measurement.stamp
        return Arrival(arrival, measurement)


def _between(before: Truth, after: Truth, part: float) -> Truth:
    """Return the truth between two times, interpolated linearly."""
    ends = zip(vars(before).values(), vars(after).values(), strict=True)
    return Truth(*(first + part * (last - first) for first, last in ends))
