# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of sensors: as an IMU's messages state it where no file does, and as it is seen.

Three readings in step differ from a straight line by their noise and by how the quantity bends:
x1 - 2 x2 + x3 has six times the variance of white noise, and hardly any of slow motion. A reference
velocity is compared with the filter in place of a line: innovations of a slow state differ from one
another by the noise of two references.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Mapping
from math import isnan
from typing import NamedTuple

from wheel_terra_estimator.arrays import Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.measurements import InertialVariance, StepInputs
from wheel_terra_estimator.estimation.rover import SensorFigures
from wheel_terra_estimator.estimation.scalars import clipped

_Range = tuple[float, float]

KEYS = ('sensors.specific_force_std', 'sensors.angular_rate_std', 'sensors.orientation_std_deg')
"""Where a file states each entry of `StatedNoise`."""
_CREDIBLE: tuple[_Range, ...] = ((5e-5, 5.0), (1e-5, 0.3), (1e-4, 0.1))
"""Least and greatest deviation of each that is no placeholder.

Specific force [m/s^2]: a tactical-grade accelerometer resolves 7 micro-g in 1 Hz (Safran MS1002
datasheet, 2016); rovers vibrate with up to 3 m/s^2. Angular rate [rad/s]: a fibre-optic gyro of
0.012 deg/sqrt(h) at 10 Hz; sixty times the 0.005 of a common one. Orientation [rad]: 0.006 deg, as
of survey-grade systems; 6 deg, beyond which an inclination says nothing of the ground.
"""


def credible(variance: InertialVariance) -> InertialVariance:
    """Return the variances without placeholders: 0 stands for what no sensor has."""
    kept = [
        value if least**2 <= value <= most**2 else 0.0
        for value, (least, most) in zip(variance, _CREDIBLE, strict=True)
    ]
    return InertialVariance(*kept)


class StatedNoise(NamedTuple):
    """Standard deviations that count in place of the defaults; 0 = that of ``sensors.*`` counts."""

    specific_force_std: float = 0.0  # [m/s^2], per message
    angular_rate_std: float = 0.0  # [rad/s], per message
    orientation_std: float = 0.0  # roll and pitch [rad]

    def completed(self, variance: InertialVariance, given: Container[str]) -> StatedNoise:
        """Return it with what a message states and neither a file nor a message before it did.

        `variance` holds no placeholders; `given` are the keys that a file states.
        """
        stds = list(self)
        for i, key in enumerate(KEYS):
            if not stds[i] and key not in given:
                stds[i] = math.sqrt(variance[i])
        return StatedNoise(*stds)


NOTHING_STATED = StatedNoise()

_LINE = 6.0  # variance of x1 - 2 x2 + x3 over that of each

# How slowly it is learned, and within which bounds.
_ONE_SECOND_IN = 4  # is learned from; the noise of sensors changes slowly
_FIRST_SECONDS = 12.0  # of a run; of what nobody stated they are all learned from
_READINGS = 200.0  # over which the mean goes
_REFERENCES = 30.0
_MOST_JUMP = 2.0
"""Deviations of what is seen for which one reading counts at most: steps are no noise, and with
four, one wild reading in 16 would raise it without end."""
_WILD = 10.0
"""Deviations of what is seen beyond which a reference is wild: no noise, and the gate's."""
_IN_STEP = 0.2  # share by which two spacings of readings may differ
_LONGEST_GAP = 0.5  # between readings that are compared [s]
_LEAST_SHARE = 0.01  # of the stated deviation
_MOST_SHARE = 100.0
_REPORTED_AFTER = 100  # readings before it is reported
_TOLD_REFERENCES = 10
_MUCH = 5.0  # times what is stated, to be said
_FAR = 1000.0  # times what is stated, from which the figure means nothing more
_CLEARLY = 2.0
"""Times what is stated, to be taken in its place: less may be the motion's own."""


class ChannelState(NamedTuple):
    """One sensor: its last two readings, and the mean of what they scatter."""

    time: float = -math.inf  # of the last reading [s]
    gap: float = 0.0  # between the last two [s]
    last: Floats = ()
    before: Floats = ()
    variance: float = 0.0
    readings: int = 0


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
"""The covariance of a reference's message comes before the key."""
_ALL = frozenset(sensor.key for sensor in SENSORS.values())


class SeenNoiseState(NamedTuple):
    """What was read of each sensor, and what the last reference states."""

    channels: Mapping[str, ChannelState] = dict.fromkeys(SENSORS, ChannelState())
    reference_stated: float = 0.0  # [m/s], 0 = nothing


class SeenNoise(Component[SeenNoiseState]):
    """Learns the noise of a message of each sensor; readings are means of those of a step.

    `given` are the keys that somebody stated, as against defaults; all of them by default.
    """

    def __init__(self, sensors: SensorFigures, given: Container[str] = _ALL) -> None:
        super().__init__(SeenNoiseState())
        self._figures = sensors
        self._defaults = {name for name, sensor in SENSORS.items() if sensor.key not in given}
        self.stated: dict[str, float] = {
            name: getattr(sensors, sensor.std) for name, sensor in SENSORS.items()
        }

    def take(self, time: float, inputs: StepInputs) -> None:
        """Take the readings of a step at a time [s]; one second in four is enough to learn from.

        Of what nobody stated the first seconds are all learned from.
        """
        skipped: Collection[str] = ()
        if int(time) % _ONE_SECOND_IN:
            if time > _FIRST_SECONDS:
                return
            skipped = SENSORS.keys() - self._defaults
        found: dict[str, Floats] = {}
        if inputs.inertial is not None:
            found['accelerometer'] = (float(inputs.inertial.specific_force[0]),)
            found['gyro'] = (float(inputs.inertial.angular_rate[2]),)
        if inputs.wheel_odometry is not None:
            found['wheel_rate'] = tuple(inputs.wheel_odometry.rate.tolist())
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
        in_step = abs(gap - state.gap) <= _IN_STEP * gap <= _IN_STEP * _LONGEST_GAP
        if in_step and len(state.before) == len(values):
            bends = [
                (a - 2.0 * b + c) ** 2
                for a, b, c in zip(state.before, state.last, values, strict=True)
                if not isnan(a + b + c)
            ]
            if bends:
                # The mean of n messages has an n-th of their variance.
                rate: float = getattr(self._figures, SENSORS[sensor].rate)
                messages = max(gap * rate, 1.0)
                seen = messages * sum(bends) / (_LINE * len(bends))
                variance, count = self._mean(sensor, variance, count, seen, _READINGS)
        self._keep(sensor, ChannelState(time, gap, values, state.last, variance, count))

    def compare_reference(
        self, time: float, innovation: float, variance: float, P: float, stated: float = 0.0
    ) -> None:
        """Take the innovation of a reference [m/s], its variance and that of the speed [(m/s)^2].

        `stated` is the variance in the message [(m/s)^2]; none where it is not above 0. The speed
        took over the share K = P / (P + R) of the innovation before, so that the difference of two
        has the variance (1 + (1 + K)^2) R.
        """
        state = self.state.channels['reference']
        seen_variance, count = state.variance, state.readings
        if state.last:
            last, gain = state.last
            seen = (innovation - last) ** 2 / (1.0 + (1.0 + gain) ** 2)
            if seen <= _WILD**2 * max(seen_variance, variance):
                seen_variance, count = self._mean(
                    'reference', seen_variance, count, seen, _REFERENCES
                )
        kept = (innovation, P / (P + variance))
        self._keep('reference', ChannelState(time, 0.0, kept, (), seen_variance, count))
        own = math.sqrt(stated) if stated > 0.0 else 0.0
        self.state = self.state._replace(reference_stated=own)

    def _mean(
        self, sensor: str, variance: float, count: int, seen: float, length: float
    ) -> tuple[float, int]:
        stated = self.stated[sensor] ** 2
        if count and seen > _MOST_JUMP**2 * max(variance, stated):
            # Louder for good is learned, a little at a time; a step is not.
            seen = _MOST_JUMP**2 * max(variance, stated)
        count += 1
        variance += (seen - variance) / min(count, length)
        low, high = _LEAST_SHARE**2 * stated, _MOST_SHARE**2 * stated
        return clipped(variance, low, high), count

    def _keep(self, sensor: str, channel: ChannelState) -> None:
        self.state = self.state._replace(channels={**self.state.channels, sensor: channel})

    def seen(self, sensor: str) -> float | None:
        """Return the deviation of one message as seen; None while too few came."""
        state = self.state.channels[sensor]
        least = _TOLD_REFERENCES if sensor == 'reference' else _REPORTED_AFTER
        return math.sqrt(state.variance) if state.readings >= least else None

    def variance(self, sensor: str, stated: float | None = None) -> float:
        """Return the variance of one message: as stated, or as seen where that is clearly more.

        Where nobody stated one, as seen once it is; the default before. `stated` is that of the
        message itself, where it states one.
        """
        seen = self.seen(sensor) or 0.0
        if stated is None:
            stated = self.stated[sensor] ** 2
            if seen and sensor in self._defaults:
                return seen**2
        return seen**2 if seen**2 > _CLEARLY**2 * stated else stated

    def _stated(self, sensor: str, by_imu: StatedNoise) -> tuple[float, bool, bool]:
        """Return the deviation of a message as stated; by the message, and whether more is a fault.

        The message of an IMU states what its sensors have at rest: a rover that vibrates is no
        fault of anybody.
        """
        own = {
            'reference': self.state.reference_stated,
            'accelerometer': by_imu.specific_force_std,
            'gyro': by_imu.angular_rate_std,
        }.get(sensor, 0.0)
        if own:
            return own, True, sensor == 'reference'
        return self.stated[sensor], False, sensor not in self._defaults

    def report(self, by_imu: StatedNoise = NOTHING_STATED) -> dict[str, float]:
        """Return stated and seen noise by key, with the unit at its end.

        `by_imu` is what the messages of the IMU state, where no file does.
        """
        found = {}
        for name, sensor in SENSORS.items():
            seen = self.seen(name)
            if seen is not None:
                stated, _, _ = self._stated(name, by_imu)
                found[f'{name}_noise_stated_{sensor.unit}'] = float(f'{stated:.3g}')
                found[f'{name}_noise_seen_{sensor.unit}'] = float(f'{seen:.3g}')
        return found

    def in_words(self, by_imu: StatedNoise = NOTHING_STATED) -> dict[str, str]:
        """Return what is much noisier than stated, and than a default; empty where nothing is.

        An IMU that is noisier than its messages state is among the latter.
        """
        words: dict[str, list[str]] = {'stated': [], 'default': []}
        for name, sensor in SENSORS.items():
            seen = self.seen(name)
            if seen is None:
                continue
            stated, by_message, binding = self._stated(name, by_imu)
            if 0.0 < _MUCH * stated < seen:
                where = sensor.key
                if by_message:
                    where = _BY_MESSAGE.get(name, f'covariance of imu/data, or {sensor.key}')
                times = f'{seen / stated:.0f}' if seen < _FAR * stated else f'over {_FAR:.0f}'
                than = 'what is stated' if binding or by_message else 'the default'
                words['stated' if binding else 'default'].append(
                    f'{name.replace("_", " ")} noise {times} times {than} ({where}: {seen:.2g})'
                )
        return {than: '; '.join(found) for than, found in words.items() if found}


_BY_MESSAGE = {'reference': 'covariance of reference_odom, or sensors.reference_std_floor'}
