# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sensors: from the course of a drive to typed measurements in the order of arrival."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_lab.evaluation.bench_drive import Arrival

FloatArray = NDArray[np.float64]

START = 1_700_000_000_000_000_000  # [ns], stamp of the beginning
_OUTLIER_SHARE, _DROPOUT_SHARE = 0.01, 0.03
_OUTLIER_SIZE = 10.0  # deviations
_STAMP_JITTER = 5e-4  # [s]


@dataclass(frozen=True)
class Course:
    """What happened: k steps, n wheels."""

    time: FloatArray  # (k,) [s]
    rate: FloatArray  # (k, n) [rad/s]
    torque: FloatArray  # (k, n) [N m]
    sinkage: FloatArray  # (k, n) [m]
    speed: FloatArray  # (k, 3) forward, left, yaw rate
    specific_force: FloatArray  # (k, 3) in axes of the ground [m/s^2]
    slopes: FloatArray  # (k, 2) ahead, to the left [rad]
    tilt: FloatArray  # (k, 2) of the chassis on its wheels: nose up, left side up [rad]
    heading: FloatArray  # (k,) [rad]
    steering: FloatArray  # (k, n) [rad]
    silent: FloatArray  # (k, n) 1 where a wheel sends nothing

    def at(self, name: str, time: FloatArray) -> FloatArray:
        """Return a quantity at other times, by linear interpolation."""
        values = np.asarray(getattr(self, name))
        if values.ndim == 1:
            return np.interp(time, self.time, values)
        columns = [np.interp(time, self.time, column) for column in values.T]
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class SensorSet:
    """True sensors of a drive; noise as one standard deviation."""

    odometry_rate: float  # [Hz]
    encoder_steps: float  # per turn of the wheel, gear included
    torque_noise: float  # [N m]
    torque_zero: FloatArray  # (n,) [N m]
    torque_gain: FloatArray  # (n,)
    imu_rate: float  # [Hz]
    force_noise: float  # [m/s^2]
    force_bias: FloatArray  # (3,)
    force_bias_walk: float  # [m/s^2/sqrt(s)]
    vibration: float  # [m/s^2] at the nominal speed
    gyro_noise: float  # [rad/s]
    gyro_bias: FloatArray  # (3,)
    gyro_bias_walk: float  # [rad/s/sqrt(s)]
    mounting: FloatArray  # (2,) nose up, left side up [rad]
    attitude_error: float  # [rad], wanders within a minute
    attitude: bool
    sinkage_rate: float  # [Hz]
    sinkage_noise: float  # [m]
    sinkage_zero: FloatArray  # (n,) [m]
    sinkage_step: float  # [m]
    reference_rate: float  # [Hz]
    reference_noise: float  # [m/s], from one reading to the next
    reference_wander: float  # [m/s], over some 15 s
    reference_scale: float
    reference_delay: float  # [s]
    stated_variance: float  # in its messages; 0 = none
    steering_zero: FloatArray  # (n,) [rad], nan = not steered


_WANDER_TIME = {'reference': 15.0, 'attitude': 60.0}  # [s]


def measure(
    generator: np.random.Generator, course: Course, sensors: SensorSet, nominal_speed: float
) -> list[Arrival]:
    """Return all measurements of a drive in the order of arrival."""
    arrivals = [
        *_wheel_odometry(generator, course, sensors),
        *_inertial(generator, course, sensors, nominal_speed),
        *_sinkage(generator, course, sensors),
        *_reference(generator, course, sensors),
    ]
    arrivals.sort(key=lambda a: a.arrival)
    return arrivals


def odometry_times(course: Course, sensors: SensorSet) -> FloatArray:
    """Return the times of the wheel odometry [s], without jitter of the stamps."""
    return np.arange(course.time[0], course.time[-1], 1.0 / sensors.odometry_rate)[1:]


def stamps(time: FloatArray) -> NDArray[np.int64]:
    """Return stamps [ns] of times [s]."""
    return START + np.round(np.asarray(time) * 1e9).astype(np.int64)


def _wheel_odometry(
    generator: np.random.Generator, course: Course, sensors: SensorSet
) -> list[Arrival]:
    time = odometry_times(course, sensors)
    turned = np.concatenate(
        [
            np.zeros((1, course.rate.shape[1])),
            np.cumsum(
                0.5 * (course.rate[1:] + course.rate[:-1]) * np.diff(course.time)[:, None], axis=0
            ),
        ]
    )
    period = 1.0 / sensors.odometry_rate
    step = 2.0 * np.pi / sensors.encoder_steps
    phase = generator.uniform(0.0, step, course.rate.shape[1])
    both = [
        np.stack([np.interp(t, course.time, c) for c in turned.T], axis=1)
        for t in (time - period, time)
    ]
    counts = [np.floor((angle + phase) / step) for angle in both]
    rate = (counts[1] - counts[0]) * step / period
    torque = course.at('torque', time) * sensors.torque_gain + sensors.torque_zero
    torque = torque + sensors.torque_noise * generator.standard_normal(torque.shape)
    silent = course.at('silent', time) > 0.5
    rate, torque = np.where(silent, np.nan, rate), np.where(silent, np.nan, torque)
    angles: list[FloatArray | None] = [None] * len(time)
    if not np.isnan(sensors.steering_zero).all():
        angles = list(course.at('steering', time) + sensors.steering_zero)
    # The difference of two counts belongs to the middle of its interval, but nobody stamps it so.
    late = generator.uniform(0.001, 0.006, len(time))
    return [
        Arrival(int(stamp + 1e9 * delay), WheelOdometry(int(stamp), rate[i], torque[i], angles[i]))
        for i, (stamp, delay) in enumerate(zip(stamps(time), late, strict=True))
    ]


def _inertial(
    generator: np.random.Generator, course: Course, sensors: SensorSet, nominal_speed: float
) -> list[Arrival]:
    time = np.arange(course.time[0], course.time[-1], 1.0 / sensors.imu_rate)[1:]
    n = len(time)
    dt = 1.0 / sensors.imu_rate
    tilt = course.at('tilt', time) + sensors.mounting
    force = course.at('specific_force', time)
    nose, left = np.sin(tilt[:, 0]), np.sin(tilt[:, 1])
    felt = np.stack(
        [
            force[:, 0] * np.cos(tilt[:, 0]) + force[:, 2] * nose,
            force[:, 1] * np.cos(tilt[:, 1]) + force[:, 2] * left,
            force[:, 2] * np.cos(tilt[:, 0]) * np.cos(tilt[:, 1])
            - force[:, 0] * nose
            - force[:, 1] * left,
        ],
        axis=1,
    )
    rim = np.abs(course.at('rate', time)).mean(axis=1)
    running = rim / max(float(np.max(rim)), 1e-9)
    noise = np.hypot(sensors.force_noise, sensors.vibration * running)[:, None]
    felt = felt + sensors.force_bias + noise * generator.standard_normal((n, 3))
    felt = felt + sensors.force_bias_walk * np.sqrt(dt) * np.cumsum(
        generator.standard_normal((n, 3)), axis=0
    )
    up = np.gradient(course.at('slopes', time) + tilt, time, axis=0)  # nose, left side [rad/s]
    turn = np.stack([up[:, 1], -up[:, 0], course.at('speed', time)[:, 2]], axis=1)
    turn = turn + sensors.gyro_bias + sensors.gyro_noise * generator.standard_normal((n, 3))
    turn = turn + sensors.gyro_bias_walk * np.sqrt(dt) * np.cumsum(
        generator.standard_normal((n, 3)), axis=0
    )
    attitude = None
    if sensors.attitude:
        error = np.stack(
            [_wander(generator, time, sensors.attitude_error, 'attitude') for _ in range(2)], axis=1
        )
        attitude = _quaternions(
            course.at('slopes', time) + tilt + error, course.at('heading', time)
        )
    jitter = _STAMP_JITTER * generator.standard_normal(n)
    return [
        Arrival(
            int(stamp + 1_000_000),
            InertialReading(
                int(stamp), felt[i], turn[i], None if attitude is None else attitude[i]
            ),
        )
        for i, stamp in enumerate(np.maximum.accumulate(stamps(time + jitter)))
    ]


def _quaternions(up: FloatArray, heading: FloatArray) -> FloatArray:
    """Return quaternions x, y, z, w (k, 4): yaw, then nose up (about -y), then left side up."""
    a, b, c = 0.5 * heading, -0.5 * up[:, 0], 0.5 * up[:, 1]
    ca, sa, cb, sb, cc, sc = (f(v) for v in (a, b, c) for f in (np.cos, np.sin))
    return np.stack(
        [
            ca * cb * sc - sa * sb * cc,
            ca * sb * cc + sa * cb * sc,
            sa * cb * cc - ca * sb * sc,
            ca * cb * cc + sa * sb * sc,
        ],
        axis=1,
    )


def _sinkage(generator: np.random.Generator, course: Course, sensors: SensorSet) -> list[Arrival]:
    time = np.arange(course.time[0], course.time[-1], 1.0 / sensors.sinkage_rate)[1:]
    read = course.at('sinkage', time) + sensors.sinkage_zero
    read = read + sensors.sinkage_noise * generator.standard_normal(read.shape)
    wild = generator.uniform(size=read.shape) < _OUTLIER_SHARE
    read = read + wild * _OUTLIER_SIZE * sensors.sinkage_noise * generator.uniform(
        -1, 1, read.shape
    )
    read = np.round(read / sensors.sinkage_step) * sensors.sinkage_step
    read = np.where(generator.uniform(size=read.shape) < _DROPOUT_SHARE, np.nan, read)
    late = generator.uniform(0.03, 0.12, len(time))
    return [
        Arrival(int(stamp + 1e9 * delay), SinkageReading(int(stamp), read[i]))
        for i, (stamp, delay) in enumerate(zip(stamps(time), late, strict=True))
    ]


def _reference(generator: np.random.Generator, course: Course, sensors: SensorSet) -> list[Arrival]:
    time = np.arange(course.time[0], course.time[-1], 1.0 / sensors.reference_rate)
    time = time + generator.uniform(0.0, 1.0 / sensors.reference_rate)
    time = time[(time < course.time[-1]) & (generator.uniform(size=len(time)) > _DROPOUT_SHARE)]
    read = (1.0 + sensors.reference_scale) * course.at('speed', time)[:, 0]
    read = read + sensors.reference_noise * generator.standard_normal(len(time))
    read = read + _wander(generator, time, sensors.reference_wander, 'reference')
    late = sensors.reference_delay * generator.uniform(0.9, 1.1, len(time))
    return [
        Arrival(
            int(stamp + 1e9 * delay),
            ReferenceVelocity(int(stamp), float(read[i]), sensors.stated_variance),
        )
        for i, (stamp, delay) in enumerate(zip(stamps(time), late, strict=True))
    ]


def _wander(
    generator: np.random.Generator, time: FloatArray, deviation: float, what: str
) -> FloatArray:
    """Return a first-order Gauss-Markov error at increasing times (k,)."""
    values = deviation * generator.standard_normal(len(time))
    if deviation == 0.0 or not len(time):
        return values
    kept = np.exp(-np.diff(time) / _WANDER_TIME[what])
    for i, share in enumerate(kept):
        values[i + 1] = share * values[i] + np.sqrt(1.0 - share**2) * values[i + 1]
    return values
