# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the sensors: as the messages of an IMU state it, and as it is observed.

A reading less the one interpolated between its neighbours has white noise of 1.5 times the
variance, if they are equally spaced, and hardly any part of a slow motion. Reference velocities are
compared with the filter instead: successive innovations of a slow state differ by the noise of both
references.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Mapping
from math import isnan
from typing import Any, NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.measurements import InertialVariance, StepInputs
from wheel_terra_estimator.estimation.rover import SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, clipped

_Range = tuple[float, float]

KEYS = ('sensors.specific_force_std', 'sensors.angular_rate_std', 'sensors.orientation_std_deg')
"""Configuration key of each entry of `StatedNoise`."""
_CREDIBLE: tuple[_Range, ...] = ((5e-5, 5.0), (1e-5, 0.3), (1e-4, 0.1))
"""Least and greatest credible deviation of each; anything else is a placeholder.
Specific force [m/s^2]: a tactical-grade accelerometer resolves 7 micro-g in 1 Hz (Safran MS1002
datasheet, 2016); rovers vibrate with up to 3 m/s^2. Angular rate [rad/s]: a fibre-optic gyro of
0.012 deg/sqrt(h) at 10 Hz; sixty times the 0.005 of a common one. Orientation [rad]: 0.006 deg, as
of survey-grade systems; 6 deg, beyond which an inclination says nothing of the ground.
"""


def credible(variance: InertialVariance) -> InertialVariance:
    """Return the variances, with 0 (not stated) in place of placeholders."""
    kept = [
        value if least**2 <= value <= most**2 else 0.0
        for value, (least, most) in zip(variance, _CREDIBLE, strict=True)
    ]
    return InertialVariance(*kept)


class StatedNoise(NamedTuple):
    """Standard deviations stated by messages; 0 = not stated, that of ``sensors.*`` is used."""

    specific_force_std: float = 0.0  # [m/s^2], per message
    angular_rate_std: float = 0.0  # [rad/s], per message
    orientation_std: float = 0.0  # roll and pitch [rad]

    def completed(self, variance: InertialVariance, given: Container[str]) -> StatedNoise:
        """Return it completed by a message, where neither a file nor an earlier message states it.

        `variance` holds no placeholders; `given` are the keys that a file states.
        """
        stds = list(self)
        for i, key in enumerate(KEYS):
            if not stds[i] and key not in given:
                stds[i] = math.sqrt(variance[i])
        return StatedNoise(*stds)


NOTHING_STATED = StatedNoise()

# How fast the observed noise is learned, and within which bounds.
_SECONDS_PER_SAMPLE = 4  # one second in four is used: the noise of sensors changes slowly
_FIRST_SECONDS = 12.0  # of a run [s], all of which are used where nobody states the noise
_READINGS = 200.0  # length of the running mean of the variance, in readings
_REFERENCES = 30.0  # the same, in references
_MOST_DEVIATIONS = 2.0
"""Limit of one reading in that mean, over the observed deviation: steps are no noise. With a limit
of four, one outlier in 16 readings would raise the mean without end."""
_OUTLIER_DEVIATIONS = 10.0
"""Observed deviations beyond which a reference is an outlier, left to the gate of the filter."""
_LONGEST_GAP = 0.5  # between readings that are compared [s]
_LEAST_SHARE = 0.01  # bounds of the observed deviation, over the stated one
_MOST_SHARE = 100.0
_REPORTED_AFTER = 100  # readings before it is used and reported
_SOONER = {'wheel_rate': 25, 'reference': 10}  # the same of sensors that count in motion only
_FAULT_FACTOR = 5.0  # observed over stated deviation that is reported as a fault
_MOST_FACTOR = 1000.0  # the same above which no figure is given
_REPLACING_FACTOR = 2.0
"""The same above which the observed one replaces the stated one; less may be motion."""


class ChannelState(NamedTuple):
    """One sensor: its last two readings, and the running mean of its observed variance."""

    time: float = -math.inf  # of the last reading [s]
    gap: float = 0.0  # between the last two [s]
    last: Floats = ()  # last reading, or last innovation and gain of a reference
    before: Floats = ()  # the reading before it
    variance: float = 0.0
    readings: int = 0  # in the mean


class Sensor(NamedTuple):
    """Where the noise of a sensor is stated, and how often it is read."""

    std: str  # of `SensorFigures`, and of the keys ``sensors.*``
    unit: str  # as in the keys of diagnostics
    rate: str = ''  # of `SensorFigures`: messages a second

    @property
    def key(self) -> str:
        """Key of the standard deviation."""
        return f'sensors.{self.std}'


SENSORS = {
    'accelerometer': Sensor('specific_force_std', 'm_s2', 'imu_rate'),
    'gyro': Sensor('angular_rate_std', 'rad_s', 'imu_rate'),
    'wheel_rate': Sensor('wheel_rate_std', 'rad_s', 'wheel_odometry_rate'),
    'torque': Sensor('torque_std', 'N_m', 'wheel_odometry_rate'),
    'sinkage': Sensor('sinkage_std', 'm', 'sinkage_rate'),
    'reference': Sensor('reference_std', 'm_s'),
}
"""The covariance in a message of the reference precedes ``sensors.reference_std``."""
_ALL = frozenset(sensor.key for sensor in SENSORS.values())


class ObservedNoiseState(NamedTuple):
    """Memory of each sensor, and the deviation that the last reference states."""

    channels: Mapping[str, ChannelState] = dict.fromkeys(SENSORS, ChannelState())
    reference_stated: float = 0.0  # [m/s], 0 = nothing


class ObservedNoise(Component[ObservedNoiseState]):
    """Learns the noise of one message of each sensor from the merged readings of the steps.

    `given` are the configuration keys that a file states (not defaults); by default all of them.
    """

    def __init__(self, sensors: SensorFigures, given: Container[str] = _ALL) -> None:
        super().__init__(ObservedNoiseState())
        self._figures = sensors
        self._defaults = {name for name, sensor in SENSORS.items() if sensor.key not in given}
        self.stated: dict[str, float] = {
            name: getattr(sensors, sensor.std) for name, sensor in SENSORS.items()
        }

    def update(self, time: float, inputs: StepInputs) -> None:
        """Take the readings of a step at a time [s]."""
        skipped: Collection[str] = ()
        if int(time) % _SECONDS_PER_SAMPLE:
            if time > _FIRST_SECONDS:
                return
            skipped = SENSORS.keys() - self._defaults
        found: dict[str, Floats] = {}
        if inputs.inertial is not None:
            found['accelerometer'] = (float(inputs.inertial.specific_force[0]),)
            found['gyro'] = (float(inputs.inertial.angular_rate[2]),)
        if inputs.wheel_odometry is not None:
            # Encoders read exactly 0 on wheels that stand, which says nothing of their noise.
            found['wheel_rate'] = tuple(rate or NAN for rate in inputs.wheel_odometry.rate.tolist())
            found['torque'] = tuple(inputs.wheel_odometry.torque.tolist())
        if inputs.sinkage is not None:
            found['sinkage'] = tuple(inputs.sinkage.sinkage.tolist())
        for sensor, values in found.items():
            if sensor not in skipped:
                self.read(sensor, time, values)

    def read(self, sensor: str, time: float, values: Floats) -> None:
        """Take a reading (one value per wheel or axis, nan = none) at a time [s]."""
        state = self.state.channels[sensor]
        gap = time - state.time
        variance, count = state.variance, state.readings
        if max(gap, state.gap) <= _LONGEST_GAP and len(state.before) == len(values):
            early = gap / (gap + state.gap)  # weight of the earlier neighbour
            late = 1.0 - early
            differences = [
                (b - early * a - late * c) ** 2
                for a, b, c in zip(state.before, state.last, values, strict=True)
                if not isnan(a + b + c)
            ]
            if differences:
                # The mean of n messages has an n-th of their variance.
                rate: float = getattr(self._figures, SENSORS[sensor].rate)
                messages = max(0.5 * (gap + state.gap) * rate, 1.0)
                factor = 1.0 + early**2 + late**2
                observed = messages * sum(differences) / (factor * len(differences))
                variance, count = self._mean(sensor, variance, count, observed, _READINGS)
        self._keep(sensor, ChannelState(time, gap, values, state.last, variance, count))

    def compare_reference(
        self, time: float, innovation: float, variance: float, P: float, stated: float = 0.0
    ) -> None:
        """Take the innovation of a reference [m/s], its variance and that of the speed [(m/s)^2].

        `stated` is the variance in the message [(m/s)^2], 0 or less = not stated. The speed was
        corrected by the share K = P / (P + R) of the innovation before, so that the difference of
        two has the variance (1 + (1 + K)^2) R.
        """
        state = self.state.channels['reference']
        observed_variance, count = state.variance, state.readings
        if state.last:
            last, gain = state.last
            observed = (innovation - last) ** 2 / (1.0 + (1.0 + gain) ** 2)
            if observed <= _OUTLIER_DEVIATIONS**2 * max(observed_variance, variance):
                observed_variance, count = self._mean(
                    'reference', observed_variance, count, observed, _REFERENCES
                )
        kept = (innovation, P / (P + variance))
        self._keep('reference', ChannelState(time, 0.0, kept, (), observed_variance, count))
        own = math.sqrt(stated) if stated > 0.0 else 0.0
        self.state = self.state._replace(reference_stated=own)

    def _mean(
        self, sensor: str, variance: float, count: int, observed: float, length: float
    ) -> tuple[float, int]:
        stated = self.stated[sensor] ** 2
        if count and observed > _MOST_DEVIATIONS**2 * max(variance, stated):
            # A lasting increase is learned step by step; a single step of the reading is not.
            observed = _MOST_DEVIATIONS**2 * max(variance, stated)
        count += 1
        variance += (observed - variance) / min(count, length)
        low, high = _LEAST_SHARE**2 * stated, _MOST_SHARE**2 * stated
        return clipped(variance, low, high), count

    def _keep(self, sensor: str, channel: ChannelState) -> None:
        self.state = self.state._replace(channels={**self.state.channels, sensor: channel})

    def observed(self, sensor: str) -> float | None:
        """Return the observed deviation of one message; None after too few readings."""
        state = self.state.channels[sensor]
        least = _SOONER.get(sensor, _REPORTED_AFTER)
        return math.sqrt(state.variance) if state.readings >= least else None

    def variance(self, sensor: str, stated: float | None = None) -> float:
        """Return the variance of one message: as stated, or as observed where that is clearly more.

        Where no file states it, as observed, and the default until then. `stated` is the variance
        in the message itself, where it holds one.
        """
        observed = self.observed(sensor) or 0.0
        if stated is None:
            stated = self.stated[sensor] ** 2
            if observed and sensor in self._defaults:
                return observed**2
        return observed**2 if observed**2 > _REPLACING_FACTOR**2 * stated else stated

    def _stated(self, sensor: str, by_imu: StatedNoise) -> tuple[float, bool, bool]:
        """Return the stated deviation, whether a message states it, and whether more is a fault.

        The messages of an IMU state its noise at rest: the vibration of a rover is no fault.
        """
        own = {
            'reference': self.state.reference_stated,
            'accelerometer': by_imu.specific_force_std,
            'gyro': by_imu.angular_rate_std,
        }.get(sensor, 0.0)
        if own:
            return own, True, sensor == 'reference'
        return self.stated[sensor], False, sensor not in self._defaults

    def report(self, by_imu: StatedNoise = NOTHING_STATED) -> dict[str, Any]:
        """Return stated and observed noise by key, with the unit at its end, and messages.

        `by_imu` is what the messages of the IMU state, where no file does. ``noise_beyond_stated``
        and ``noise_beyond_default`` tell of sensors much noisier than stated, and than a default;
        an IMU that is noisier than its messages state counts among the latter.
        """
        found: dict[str, Any] = {}
        words: dict[str, list[str]] = {'stated': [], 'default': []}
        for name, sensor in SENSORS.items():
            observed = self.observed(name)
            if observed is None:
                continue
            stated, by_message, binding = self._stated(name, by_imu)
            found[f'{name}_noise_stated_{sensor.unit}'] = float(f'{stated:.3g}')
            found[f'{name}_noise_seen_{sensor.unit}'] = float(f'{observed:.3g}')
            if 0.0 < _FAULT_FACTOR * stated < observed:
                where = sensor.key
                if by_message:
                    where = _BY_MESSAGE.get(name, f'covariance of imu/data, or {sensor.key}')
                limited = f'over {_MOST_FACTOR:.0f}'
                times = f'{observed / stated:.0f}' if observed < _MOST_FACTOR * stated else limited
                than = 'what is stated' if binding or by_message else 'the default'
                words['stated' if binding else 'default'].append(
                    f'{name.replace("_", " ")} noise {times} times {than} ({where}: {observed:.2g})'
                )
        told = {f'noise_beyond_{than}': '; '.join(each) for than, each in words.items() if each}
        return found | told


_BY_MESSAGE = {'reference': 'covariance of reference_odom, or sensors.reference_std_floor'}
