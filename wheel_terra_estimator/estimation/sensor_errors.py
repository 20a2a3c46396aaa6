# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Known errors of the sensors: the zeros, gains, biases and stamp offsets of the configuration.

A sensor reads ``gain * true + zero``; an IMU adds its bias, in ``base_link``; stamps are late by
their offset. Readings are corrected once, where they enter the estimator core or the rows of a
drive; the simulator applies the same errors. An instrument effect in a model (``torque_gain``,
``sinkage_offset``) is an error that remains after this correction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.scalars import SECOND


@dataclass(frozen=True)
class LinearErrors:
    """Zero and gain of one kind of sensor: (n,) each, in the order of the wheels."""

    zero: FloatArray
    gain: FloatArray

    @cached_property
    def none(self) -> bool:
        """Whether the readings have no error."""
        return not self.zero.any() and bool((self.gain == 1.0).all())

    def true(self, reading: FloatArray) -> FloatArray:
        """Return the true values: (reading - zero) / gain."""
        return (reading - self.zero) / self.gain

    def reading(self, true: FloatArray) -> FloatArray:
        """Return what the sensor reads: gain * true + zero."""
        return self.gain * true + self.zero


class SensorErrors:
    """Errors that ``sensors.*`` states: of torque [N m], sinkage [m], IMU and stamps."""

    def __init__(self, configuration: Configuration) -> None:
        sensors = configuration.sensors
        self._count = configuration.wheels.count
        self.torque = LinearErrors(sensors.torque_zero, sensors.torque_gain)
        self.sinkage = LinearErrors(sensors.sinkage_zero, sensors.sinkage_gain)
        self.specific_force_bias: FloatArray = sensors.specific_force_bias
        self.angular_rate_bias: FloatArray = sensors.angular_rate_bias
        self._imu_position: FloatArray = sensors.imu_position
        inertial = self.specific_force_bias, self.angular_rate_bias, self._imu_position
        self._none_inertial = not any(values.any() for values in inertial)
        self._stamp_offset: dict[type, int] = {
            WheelOdometry: round(sensors.wheel_odometry_stamp_offset * SECOND),
            InertialReading: round(sensors.imu_stamp_offset * SECOND),
            SinkageReading: round(sensors.sinkage_stamp_offset * SECOND),
            ReferenceVelocity: round(sensors.reference_stamp_offset * SECOND),
        }

    def corrected(self, measurement: Measurement) -> Measurement:
        """Return a measurement without the stated errors; itself where none is stated.

        A message with the wrong number of wheels, and zeros of an accelerometer that is not
        running, are returned as they are; the checks of the inputs refuse them.
        """
        measurement = self._stamped(measurement, -1)
        if isinstance(measurement, WheelOdometry):
            if self.torque.none or len(measurement.torque) != self._count:
                return measurement
            return replace(measurement, torque=self.torque.true(measurement.torque))
        if isinstance(measurement, SinkageReading):
            if self.sinkage.none or len(measurement.sinkage) != self._count:
                return measurement
            return replace(measurement, sinkage=self.sinkage.true(measurement.sinkage))
        if isinstance(measurement, InertialReading):
            return self._inertial(measurement, -1.0)
        return measurement

    def as_read(self, measurement: Measurement) -> Measurement:
        """Return a true measurement as these sensors would read it."""
        measurement = self._stamped(measurement, 1)
        if isinstance(measurement, WheelOdometry) and not self.torque.none:
            return replace(measurement, torque=self.torque.reading(measurement.torque))
        if isinstance(measurement, SinkageReading) and not self.sinkage.none:
            return replace(measurement, sinkage=self.sinkage.reading(measurement.sinkage))
        if isinstance(measurement, InertialReading):
            return self._inertial(measurement, 1.0)
        return measurement

    def _stamped(self, measurement: Measurement, sign: int) -> Measurement:
        offset = self._stamp_offset.get(type(measurement), 0)
        if not offset or measurement.stamp <= 0:  # 0 stays no stamp
            return measurement
        return replace(measurement, stamp=measurement.stamp + sign * offset)

    def _inertial(self, reading: InertialReading, sign: float) -> InertialReading:
        """Remove (sign -1) or add (1) biases and the centripetal acceleration w x (w x r)."""
        if self._none_inertial or not np.any(reading.specific_force):
            return reading
        corrected_rate = reading.angular_rate + sign * self.angular_rate_bias
        rate = corrected_rate if sign < 0.0 else reading.angular_rate  # the true rate
        centripetal = np.cross(rate, np.cross(rate, self._imu_position))
        force = reading.specific_force + sign * (
            self.specific_force_bias + np.nan_to_num(centripetal)
        )
        return replace(reading, specific_force=force, angular_rate=corrected_rate)
