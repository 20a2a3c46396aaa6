# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How noisy the sensors are seen to be, beside what their file or their messages state.

Three readings in step differ from a straight line by their noise and by how the quantity bends:
x1 - 2 x2 + x3 has six times the variance of white noise, and hardly any of slow motion. A reference
velocity is compared with the filter in place of a line: innovations of a slow state differ from one
another by the noise of two references.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container
from math import isnan
from typing import Any, NamedTuple

from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.inputs.stated_noise import NOTHING_STATED, StatedNoise
from wheel_terra_estimator.estimation.measurements import StepInputs
from wheel_terra_estimator.estimation.rover import SensorFigures
from wheel_terra_estimator.estimation.scalars import clipped

Floats = tuple[float, ...]

_LINE = 6.0  # variance of x1 - 2 x2 + x3 over that of each


# How slowly it is learned, and within which bounds.
_ONE_SECOND_IN = 4  # is learned from; the noise of sensors changes slowly
_FIRST_SECONDS = 12.0  # of a run; of what nobody stated they are all learned from
_READINGS = 200.0  # over which the mean goes
_REFERENCES = 30.0
_MOST_JUMP = 4.0
"""Deviations of what is seen beyond which one reading does not count: steps are no noise."""
_WILD = 10.0
"""Deviations of what is seen beyond which a reference is wild: no noise, and the gate's."""
_IN_STEP = 0.2  # share by which two spacings of readings may differ
_LONGEST_GAP = 0.5  # between readings that are compared [s]
_LEAST_SHARE = 0.01  # of the stated deviation
_MOST_SHARE = 100.0
_TOLD_AFTER = 100  # readings before it is told
_TOLD_REFERENCES = 10
_MUCH = 5.0  # times what is stated, to be said
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


class SeenNoiseState(NamedTuple):
    """One entry per sensor."""

    accelerometer: ChannelState = ChannelState()
    gyro: ChannelState = ChannelState()
    wheel_rate: ChannelState = ChannelState()
    torque: ChannelState = ChannelState()
    sinkage: ChannelState = ChannelState()
    reference: ChannelState = ChannelState()
    reference_stated: float = math.nan  # by its last message [m/s], nan = by none
    by_imu: StatedNoise = NOTHING_STATED  # what its messages state, where no file does


UNITS = {
    'accelerometer': 'm_s2',
    'gyro': 'rad_s',
    'wheel_rate': 'rad_s',
    'torque': 'N_m',
    'sinkage': 'm',
    'reference': 'm_s',
}
"""Sensor -> unit in the keys of diagnostics."""
KEYS = {
    'accelerometer': 'sensors.specific_force_std',
    'gyro': 'sensors.angular_rate_std',
    'wheel_rate': 'sensors.wheel_rate_std',
    'torque': 'sensors.torque_std',
    'sinkage': 'sensors.sinkage_std',
    'reference': 'sensors.reference_std',
}
"""Sensor -> where its noise is stated; the covariance of a reference's message comes first."""


class SeenNoise(Component[SeenNoiseState]):
    """Learns the noise of a message of each sensor; readings are means of those of a step.

    Parameters
    ----------
    sensors : SensorFigures
        What is stated, or the defaults.
    rates : dict
        Messages a second, by sensor.
    given : container of str
        Keys that somebody stated, as against defaults; all of them by default.
    """

    def __init__(
        self,
        sensors: SensorFigures,
        rates: dict[str, float],
        given: Container[str] = frozenset(KEYS.values()),
    ) -> None:
        super().__init__(SeenNoiseState())
        self._defaults = {sensor for sensor, key in KEYS.items() if key not in given}
        self._rates = rates  # messages a second, by sensor
        self.stated = {
            'accelerometer': sensors.specific_force_std,
            'gyro': sensors.angular_rate_std,
            'wheel_rate': sensors.wheel_rate_std,
            'torque': sensors.torque_std,
            'sinkage': sensors.sinkage_std,
            'reference': sensors.reference_std,
        }

    def take(self, time: float, inputs: StepInputs) -> None:
        """Take the readings of a step at a time [s]; one second in four is enough to learn from.

        Of what nobody stated the first seconds are all learned from.
        """
        skipped: Collection[str] = ()
        if int(time) % _ONE_SECOND_IN:
            if time > _FIRST_SECONDS:
                return
            skipped = KEYS.keys() - self._defaults
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
        state: ChannelState = getattr(self.state, sensor)
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
                messages = max(gap * self._rates[sensor], 1.0)
                seen = messages * sum(bends) / (_LINE * len(bends))
                variance, count = self._mean(sensor, variance, count, seen, _READINGS)
        self._keep(sensor, ChannelState(time, gap, values, state.last, variance, count))

    def compare_reference(
        self,
        time: float,
        innovation: float,
        variance: float,
        P: float,
        stated: float = math.nan,
    ) -> None:
        """Take the innovation of a reference [m/s], its variance and that of the speed [(m/s)^2].

        `stated` is the variance in the message [(m/s)^2]; not above zero or nan: none. The speed
        took over the share K = P / (P + R) of the innovation before, so that the difference of two
        has the variance (1 + (1 + K)^2) R.
        """
        state = self.state.reference
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
        own = math.sqrt(stated) if stated > 0.0 else math.nan
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
        changed: dict[str, Any] = {sensor: channel}
        self.state = self.state._replace(**changed)

    def seen(self, sensor: str) -> float | None:
        """Return the deviation of one message as seen; None while too few came."""
        state: ChannelState = getattr(self.state, sensor)
        least = _TOLD_REFERENCES if sensor == 'reference' else _TOLD_AFTER
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

    def take_stated(self, by_imu: StatedNoise) -> None:
        """Take what the messages of the IMU state, where no file does."""
        self.state = self.state._replace(by_imu=by_imu)

    def _own(self, sensor: str) -> float:
        """Return the deviation that the sensor's messages state; 0 = none that counts."""
        if sensor == 'reference':
            own = self.state.reference_stated
            return 0.0 if isnan(own) else own
        by_imu = self.state.by_imu
        own_ones = {'accelerometer': by_imu.specific_force_std, 'gyro': by_imu.angular_rate_std}
        return own_ones.get(sensor, 0.0)

    def _stated(self, sensor: str) -> tuple[float, bool]:
        """Return the deviation of a message as stated, and whether more than that is a fault.

        It is where a file or the message of a reference states it. The message of an IMU states
        what its sensors have at rest: a rover that vibrates is no fault of anybody.
        """
        own = self._own(sensor)
        if own:
            return own, sensor == 'reference'
        return self.stated[sensor], sensor not in self._defaults

    def report(self) -> dict[str, float]:
        """Return stated and seen noise by key, with the unit at its end."""
        found = {}
        for sensor, unit in UNITS.items():
            seen = self.seen(sensor)
            if seen is not None:
                found[f'{sensor}_noise_stated_{unit}'] = float(f'{self._stated(sensor)[0]:.3g}')
                found[f'{sensor}_noise_seen_{unit}'] = float(f'{seen:.3g}')
        return found

    def in_words(self) -> dict[str, str]:
        """Return what is much noisier than stated, and than a default; empty where nothing is.

        An IMU that is noisier than its messages state is among the latter.
        """
        words: dict[str, list[str]] = {'stated': [], 'default': []}
        for sensor in UNITS:
            seen, (stated, given) = self.seen(sensor), self._stated(sensor)
            if seen is not None and stated > 0.0 and seen > _MUCH * stated:
                than = 'what is stated' if given or self._own(sensor) else 'the default'
                words['stated' if given else 'default'].append(
                    f'{sensor.replace("_", " ")} noise {seen / stated:.0f} times {than} '
                    f'({self._where(sensor)}: {seen:.2g})'
                )
        return {than: '; '.join(found) for than, found in words.items() if found}

    def _where(self, sensor: str) -> str:
        """Return where the noise of a sensor can be stated, as far as that counts."""
        if not self._own(sensor):
            return KEYS[sensor]
        if sensor == 'reference':
            return 'covariance of reference_odom, or sensors.reference_std_floor'
        return f'covariance of imu/data, or {KEYS[sensor]}'
