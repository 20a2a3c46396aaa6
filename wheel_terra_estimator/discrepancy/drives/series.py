# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A drive as time series: the measurements of all sensors, sorted by stamp."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother


@dataclass(frozen=True)
class Channel:
    """Samples of one sensor: ``time`` (k,) [s], strictly increasing, and ``values`` (k, m)."""

    time: FloatArray
    values: FloatArray

    def within(self, start: float, end: float) -> Channel:
        """Return the samples with start <= time < end."""
        first, last = np.searchsorted(self.time, [start, end])
        return Channel(self.time[first:last], self.values[first:last])

    def longest_gap(self, start: float, end: float) -> float:
        """Return the longest silence [s] within a stretch, its ends included."""
        times = self.within(start, end).time
        return float(np.max(np.diff(np.concatenate([[start], times, [end]]))))


@dataclass(frozen=True)
class DriveSeries:
    """Everything that a drive measured; stamps count from the first wheel odometry."""

    # (k, n) wheel rates [rad/s] and drive torques [N m] at the same stamps, nan = not in the
    # message
    rate: Channel
    torque: Channel
    specific_force: Channel  # (k, 3) [m/s^2]
    yaw_rate: Channel  # (k, 1) [rad/s]
    sinkage: Channel  # (k, n) [m], nan = no reading
    # (k, 2) forward velocity of the body [m/s] and its stated variance [(m/s)^2]
    reference: Channel
    # The same of the fixed-interval smoother: the slip comes from it where it is there
    smoothed: Channel | None = None

    @property
    def speed(self) -> Channel:
        """Forward velocity from which the slip comes, as ``reference``."""
        return self.reference if self.smoothed is None else self.smoothed

    def speed_std(self, start: float, end: float) -> float:
        """Return the stated deviation of the mean speed of a stretch [m/s]; 0: none is stated.

        Errors of references are independent, those of the smoother are common to all samples.
        """
        variances = self.speed.within(start, end).values[:, 1]
        stated = variances[variances > 0]
        if not stated.size:
            return 0.0
        apart = len(stated) if self.smoothed is None else 1
        return float(np.sqrt(stated.mean() / apart))


def collect(measurements: Iterable[Measurement], wheels: int, name: str) -> DriveSeries:
    """Sort the measurements of a drive into series.

    They come in any order; ``name`` says where from, for messages. Raises UserError if a sensor is
    missing without which no steady row can be had.
    """
    widths = {
        'rate': wheels, 'torque': wheels, 'specific_force': 3, 'yaw_rate': 1, 'sinkage': wheels,
        'reference': 2,
    }  # fmt: skip
    found: dict[str, dict[int, FloatArray]] = {key: {} for key in widths}
    for item in measurements:
        stamp = item.stamp
        if isinstance(item, WheelOdometry):
            # A message may hold some of the wheels only: equal stamps complete one another.
            for key, values in (('rate', item.rate), ('torque', item.torque)):
                before = found[key].get(stamp, values)
                found[key][stamp] = np.where(np.isnan(values), before, values)
        elif isinstance(item, InertialReading):
            # A message may hold some of the fields only.
            if not np.isnan(item.specific_force).any():
                found['specific_force'][stamp] = item.specific_force
            if not np.isnan(item.angular_rate[2]):
                found['yaw_rate'][stamp] = item.angular_rate[2:]
        elif isinstance(item, SinkageReading):
            found['sinkage'][stamp] = item.sinkage
        elif isinstance(item, ReferenceVelocity):
            found['reference'][stamp] = np.array([item.forward, item.variance])
    for key, topic, why in (
        ('rate', 'wheel odometry', 'wheel rates'),
        ('specific_force', 'imu/data', 'loads and pull come from the specific force'),
        ('yaw_rate', 'imu/data', 'turns are left out by the angular rate'),
        ('reference', 'reference_odom', 'the slip of a drive comes from it'),
    ):
        if len(found[key]) < 2:
            raise UserError(
                f'{name}: no {topic} ({why}); if it has another name in the bag, give '
                f'--remap {"joint_states" if key == "rate" else topic}:=/ITS/NAME'
            )
    origin = min(found['rate'])
    return DriveSeries(**{key: _channel(found[key], origin, widths[key]) for key in widths})


def _channel(series: dict[int, FloatArray], origin: int, width: int) -> Channel:
    stamps = sorted(series)
    time = np.array([(stamp - origin) * 1e-9 for stamp in stamps])
    values = np.array([series[stamp] for stamp in stamps], dtype=float).reshape(-1, width)
    return Channel(time, values)


class SpeedSmoother:
    """Takes the measurements of a drive and returns its speed by the fixed-interval smoother.

    A window holds a few references; the smoother also knows those before and behind it, and how the
    wheels and the accelerometer carry the speed from one to the next. It uses neither torque nor
    sinkage: rows that test a soil model must not depend on that model.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._smoother = DriveSmoother(configuration)
        self._core = EstimatorCore(configuration, self._smoother.estimator)
        self._origin: int | None = None  # first stamp of the wheel odometry [ns]

    def hear(self, measurements: Iterable[Measurement]) -> Iterator[Measurement]:
        """Pass measurements on as they are, in the order of arrival."""
        for measurement in measurements:
            if isinstance(measurement, WheelOdometry):
                stamp = measurement.stamp
                self._origin = stamp if self._origin is None else min(self._origin, stamp)
                silent = np.full_like(measurement.torque, np.nan)
                self._add(replace(measurement, torque=silent))
            elif not isinstance(measurement, SinkageReading):
                self._add(measurement)
            yield measurement

    def _add(self, measurement: Measurement) -> None:
        for estimates in self._core.add(measurement):
            self._smoother.keep(estimates)

    def speed(self) -> Channel:
        """Return forward velocity [m/s] and its variance [(m/s)^2], (k, 2)."""
        for estimates in self._core.flush():
            self._smoother.keep(estimates)
        found = {
            kept.estimates.stamp: (
                kept.estimates.forward_velocity,
                kept.estimates.forward_velocity_variance,
            )
            for kept in self._smoother.sets()
        }
        stamps = sorted(found)
        time = np.array([(stamp - (self._origin or 0)) * 1e-9 for stamp in stamps])
        return Channel(time, np.array([found[stamp] for stamp in stamps]).reshape(-1, 2))
