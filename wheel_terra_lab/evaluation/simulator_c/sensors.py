# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the sensors of simulator C make of a drive: typed measurements with their arrival."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    InertialVariance,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_lab.evaluation.bench_drive import Arrival
from wheel_terra_lab.evaluation.simulator_c.dynamics import STEP, Course
from wheel_terra_lab.evaluation.simulator_c.plans import Kind
from wheel_terra_lab.evaluation.simulator_c.rover import Rover

FloatArray = NDArray[np.float64]

START = 1_900_000_000_000_000_000
"""Stamp of the beginning of every drive [ns]."""
_SMOOTHED = 5  # steps over which attitude and acceleration are averaged before they are sensed


@dataclass(frozen=True)
class Instruments:
    """Rates, errors and delays of the sensors of one drive; a rate of 0 means there is none."""

    odometry_rate: float  # [Hz]
    encoder_step: float  # of the wheel's angle [rad]
    torque: bool
    torque_gain: FloatArray  # (n,)
    torque_zero: FloatArray  # (n,) [N m]
    torque_friction: FloatArray  # (n,) of the drive, seen by the current only [N m]
    torque_std: float  # [N m]
    imu_rate: float
    force_std: float  # at rest [m/s^2]
    vibration: float  # at the usual speed [m/s^2]
    force_bias: FloatArray  # (3,)
    gyro_std: float
    gyro_bias: FloatArray  # (3,)
    orientation: bool
    tilt_error: FloatArray  # (2,) roll and pitch [rad]
    wild_share: float  # of the samples of the accelerometer that are wild
    sinkage_rate: float
    sinkage_std: float
    sinkage_zero: FloatArray  # (n,)
    sinkage_wrong: float  # share of outliers
    reference_rate: float
    reference_std: float  # [m/s]
    reference_scale: float
    reference_wander: float  # slow error [m/s]
    reference_lag: float  # [s]
    reference_lost: float  # share of the time without
    covariances: bool  # whether messages state their variances


def draw_instruments(rng: np.random.Generator, kind: Kind, rover: Rover) -> Instruments:
    """Return the sensors of a drive."""
    n, radius = rover.count, rover.rims.radius[0]
    usual = rover.mean_load * radius  # [N m]
    odometry_rate = kind.odometry_rate or float(rng.choice([10, 10, 20, 50, 100, 200]))
    coarse = 0.05 * rover.speed / radius / odometry_rate
    reference_rate = float(np.exp(rng.uniform(np.log(0.3), np.log(5.0))))
    if kind.reference_period is not None:
        reference_rate = 1.0 / kind.reference_period if kind.reference_period else 0.0
    has_sinkage = kind.sinkage and (kind.file != 'lines' or rng.uniform() < 0.4)
    return Instruments(
        odometry_rate=odometry_rate,
        encoder_step=float(coarse * 10.0 ** rng.uniform(-2.0, 0.0)),
        torque=kind.torque,
        torque_gain=rng.normal(1.0, 0.05) * rng.normal(1.0, 0.03, n),
        torque_zero=rng.normal(0.0, 0.01, n) * usual,
        torque_friction=usual * rng.uniform(0.005, 0.04) * rng.uniform(0.7, 1.3, n),
        torque_std=float(usual * rng.uniform(0.005, 0.04)),
        imu_rate=float(rng.choice([25, 50, 100, 200])),
        force_std=float(rng.uniform(0.01, 0.06)),
        vibration=float(np.exp(rng.uniform(np.log(0.03), np.log(1.5)))),
        force_bias=rng.normal(0.0, 0.03, 3),
        gyro_std=float(rng.uniform(0.001, 0.006)),
        gyro_bias=rng.normal(0.0, 0.001, 3),
        orientation=bool(rng.uniform() < 0.7),
        tilt_error=np.radians(rng.normal(0.0, 0.3, 2)),
        wild_share=0.0007 if kind.wild else 0.0,
        sinkage_rate=float(rng.choice([2, 5, 10, 15])) if has_sinkage else 0.0,
        sinkage_std=float(radius * rng.uniform(0.004, 0.02)),
        sinkage_zero=rng.normal(0.0, 0.008, n) * radius,
        sinkage_wrong=float(rng.uniform(0.0, 0.03)),
        reference_rate=reference_rate,
        reference_std=float(rover.speed * rng.uniform(0.01, 0.08) + 0.001),
        reference_scale=float(rng.normal(1.0, 0.01)),
        reference_wander=float(rover.speed * rng.uniform(0.0, 0.03)),
        reference_lag=float(rng.uniform(0.3, 2.0)),
        reference_lost=float(rng.uniform(0.0, 0.15)),
        covariances=bool(rng.uniform() < 0.6),
    )


class Sensing:
    """Measurements of one drive."""

    def __init__(
        self, rng: np.random.Generator, rover: Rover, instruments: Instruments, course: Course
    ) -> None:
        self._rng, self._rover, self._with, self._course = rng, rover, instruments, course
        self.odometry_stamps = self._stamps(instruments.odometry_rate)

    def arrivals(self) -> list[Arrival]:
        """Return all measurements in the order of arrival."""
        found = [*self._odometry(), *self._inertial(), *self._sinkage(), *self._reference()]
        return sorted(found, key=lambda a: a.arrival)

    def _stamps(self, rate: float) -> NDArray[np.int64]:
        """Return stamps of a sensor with a little jitter [ns]."""
        if rate <= 0.0:
            return np.zeros(0, dtype=np.int64)
        period, end = 1.0 / rate, self._course.time[-1]
        time = np.arange(self._rng.uniform(0.0, min(period, 1.0)), end, period)
        time = time + self._rng.uniform(0.0, 0.1 * min(period, 0.02), len(time))
        return np.asarray(START + np.round(time * 1e9).astype(np.int64))

    def _at(self, stamps: NDArray[np.int64], values: FloatArray) -> FloatArray:
        return sampled(self._course.time, values, stamps)

    def _timed(
        self, measurements: Iterator[Measurement], latency: float, lagging: bool = False
    ) -> Iterator[Arrival]:
        for measurement in measurements:
            share = self._rng.uniform(0.8, 1.2) if lagging else self._rng.uniform(0.5, 1.5)
            yield Arrival(measurement.stamp + round(latency * share * 1e9), measurement)

    def _odometry(self) -> Iterator[Arrival]:
        rng, tools, stamps = self._rng, self._with, self.odometry_stamps
        steps = np.diff(self._course.time, prepend=0.0)[:, None]
        angle = self._at(stamps, np.cumsum(self._course.rate * steps, axis=0))
        counted = np.round(angle / tools.encoder_step) * tools.encoder_step
        period = np.diff(stamps, prepend=stamps[0] - round(1e9 / tools.odometry_rate)) * 1e-9
        rate = np.diff(counted, axis=0, prepend=counted[:1]) / period[:, None]
        turning = np.tanh(self._at(stamps, self._course.rate) / 0.02)
        torque = self._at(stamps, self._course.motor) + tools.torque_friction * turning
        torque = tools.torque_gain * torque + tools.torque_zero
        torque = torque + rng.normal(0.0, tools.torque_std, torque.shape)
        if not tools.torque:
            torque = np.full_like(torque, np.nan)
        steered = self._rover.steered
        angles = self._at(stamps, self._course.steering) + rng.normal(0.0, 0.002, torque.shape)
        steering = np.where(steered, angles, np.nan)
        messages = (
            WheelOdometry(int(stamp), rate[k], torque[k], steering[k] if steered.any() else None)
            for k, stamp in enumerate(stamps)
        )
        return self._timed(messages, 0.008)

    def _inertial(self) -> Iterator[Arrival]:
        rng, tools, course = self._rng, self._with, self._course
        stamps = self._stamps(tools.imu_rate)
        force, rate = _inertia(course, self._rover.gravity)
        moving = np.abs(course.rate).mean(axis=1) / (self._rover.speed / self._rover.rims.radius[0])
        shake = np.hypot(tools.force_std, tools.vibration * self._at(stamps, moving))
        size = (len(stamps), 3)
        walk = np.cumsum(rng.normal(0.0, 0.002 / np.sqrt(tools.imu_rate), size), axis=0)
        felt = self._at(stamps, force) + tools.force_bias + walk
        felt = felt + rng.normal(0.0, 1.0, size) * shake[:, None]
        wild = rng.uniform(size=size) < tools.wild_share
        felt = np.where(wild, rng.uniform(-600.0, 600.0, size), felt)
        turned = self._at(stamps, rate) + tools.gyro_bias + 0.05 * walk
        turned = turned + rng.normal(0.0, tools.gyro_std, size)
        attitude = self._attitude(stamps) if tools.orientation else None
        variance = InertialVariance()
        if tools.covariances:
            spread = np.hypot(tools.force_std, tools.vibration)
            variance = InertialVariance(float(spread**2), tools.gyro_std**2, np.radians(0.3) ** 2)
        messages = (
            InertialReading(
                int(stamp), felt[k], turned[k], None if attitude is None else attitude[k], variance
            )
            for k, stamp in enumerate(stamps)
        )
        return self._timed(messages, 0.004)

    def _attitude(self, stamps: NDArray[np.int64]) -> FloatArray:
        """Return (k, 4) quaternions x, y, z, w with the errors of an attitude filter."""
        noise = np.radians(0.08) * self._rng.normal(size=(2, len(stamps)))
        roll = self._at(stamps, self._course.roll) + self._with.tilt_error[0] + noise[0]
        pitch = -self._at(stamps, self._course.pitch) + self._with.tilt_error[1] + noise[1]
        return quaternion(roll, pitch, self._at(stamps, self._course.yaw))

    def _sinkage(self) -> Iterator[Arrival]:
        rng, tools = self._rng, self._with
        stamps = self._stamps(tools.sinkage_rate)
        depth = self._at(stamps, self._course.sinkage) + tools.sinkage_zero
        depth = depth + rng.normal(0.0, tools.sinkage_std, depth.shape)
        radius = self._rover.rims.radius
        wrong = rng.uniform(size=depth.shape) < tools.sinkage_wrong
        depth = np.where(wrong, rng.uniform(-0.1, 0.5, depth.shape) * radius, depth)
        depth = np.where(rng.uniform(size=depth.shape) < 0.03, np.nan, depth)
        messages = (SinkageReading(int(stamp), depth[k]) for k, stamp in enumerate(stamps))
        return self._timed(messages, 0.06)

    def _reference(self) -> Iterator[Arrival]:
        rng, tools = self._rng, self._with
        stamps = self._stamps(tools.reference_rate)
        time = (stamps - START) * 1e-9
        speed = self._at(stamps, self._course.velocity[:, 0])
        phase, period = rng.uniform(0.0, 6.28), rng.uniform(20.0, 80.0)
        wander = tools.reference_wander * np.sin(2.0 * np.pi * time / period + phase)
        seen = tools.reference_scale * speed + wander
        seen = seen + tools.reference_std * rng.standard_t(5.0, len(stamps)) / np.sqrt(5.0 / 3.0)
        # Drop-outs come in stretches of some seconds.
        lost = np.sin(2.0 * np.pi * time / rng.uniform(15.0, 40.0) + rng.uniform(0.0, 6.28))
        kept = lost < np.cos(np.pi * tools.reference_lost)
        variance = tools.reference_std**2 if tools.covariances else 0.0
        messages = (
            ReferenceVelocity(int(stamp), float(seen[k]), variance)
            for k, stamp in enumerate(stamps)
            if kept[k]
        )
        return self._timed(messages, tools.reference_lag, lagging=True)


def sampled(time: FloatArray, values: FloatArray, stamps: NDArray[np.int64]) -> FloatArray:
    """Return values (k,) or (k, m) of a course between its times, at stamps."""
    place = np.clip((stamps - START) * 1e-9, 0.0, time[-1]) / STEP
    lower = np.clip(place.astype(int), 0, len(time) - 2)
    part = place - lower
    part = part[:, None] if values.ndim > 1 else part
    return np.asarray(values[lower] * (1.0 - part) + values[lower + 1] * part)


def quaternion(roll: FloatArray, pitch: FloatArray, yaw: FloatArray) -> FloatArray:
    """Return (k, 4) x, y, z, w of rotations about fixed x, then y, then z [rad]."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a / 2), np.sin(a / 2)) for a in (roll, pitch, yaw))
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=1,
    )


def _inertia(course: Course, gravity: float) -> tuple[FloatArray, FloatArray]:
    """Return (k, 3) specific force and angular rate in base_link."""
    pitch, roll = (_smooth(a) for a in (course.pitch, course.roll))
    ax, ay = (_smooth(a) for a in course.acceleration.T)
    force = np.stack(
        [
            ax + gravity * np.sin(pitch),
            ay + gravity * np.sin(roll) * np.cos(pitch),
            gravity * np.cos(pitch) * np.cos(roll),
        ],
        axis=1,
    )
    yaw_rate = course.velocity[:, 2]
    rate = np.stack(
        [
            np.gradient(roll, STEP) + yaw_rate * np.sin(pitch),
            -np.gradient(pitch, STEP) + yaw_rate * np.sin(roll),
            yaw_rate * np.cos(pitch) * np.cos(roll),
        ],
        axis=1,
    )
    return force, rate


def _smooth(values: FloatArray) -> FloatArray:
    padded = np.pad(values, _SMOOTHED // 2, mode='edge')
    return np.convolve(padded, np.full(_SMOOTHED, 1.0 / _SMOOTHED), mode='valid')
