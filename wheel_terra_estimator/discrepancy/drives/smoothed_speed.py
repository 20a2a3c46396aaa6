# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Body speed of a drive from the fixed-interval smoother, for the slip of its windows.

A window holds a few references; the smoother also knows those before and behind it, and how the
wheels and the accelerometer carry the speed from one to the next. It hears neither torque nor
sinkage: rows that are to judge a soil model must not be made with what that model says of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.drives.series import Channel
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    Measurement,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother


class SpeedSmoother:
    """Listens to the measurements of a drive and tells its speed afterwards.

    Parameters
    ----------
    configuration : Configuration
        Rover and sensors.
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
        """Return forward velocity [m/s] and its variance [(m/s)^2], (k, 2), once all is heard."""
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
