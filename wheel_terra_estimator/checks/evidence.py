# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All channels of a recording on the stamps of the wheel odometry, in the rover's signs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.checks.finding import FAULTS, Finding, found
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import (
    LONGEST_HELD,
    Channel,
    JointSeries,
    Recording,
    VelocitySeries,
    beside,
    nearest,
    of_one_wheel,
    rows_of,
)
from wheel_terra_estimator.checks.statistics import (
    Estimate,
    averaged,
    bend_noise,
    block_fit,
    moving_mean,
    robust_std,
    without_drift,
)

Mask = BoolArray
Result = TypeVar('Result')

REST_RATE = 0.02  # wheel rate below which a wheel stands, as a share of its working rate [-]
SHORTEST_REST = 1.0  # A standstill counts as rest after this time [s]
LEAST_REST = 0.4  # rest from which the bias of a gyro is taken [s]
SETTLING = 0.5  # A speed counts as steady this long after it changed [s]
STRAIGHT_SHARE = 0.25  # speed of the sides against the middle of a straight, at most [-]
LEAST_MOVING_ROWS = 30  # least rows of driving for a check
LEAST_DRIVING = 3.0  # least driving for a check [s]
EVEN_GROUND_STD = math.radians(0.8)  # deviation of a tilt by circles on a plane, at most [rad]
NO_NOISE = 5e-4  # noise of rates that have none, over the working rate, at most [-]
BEND = 4  # order of the differences in which no motion is left
BEND_OF_NOISE = math.sqrt(70.0)  # their deviation over that of the values [-]
SLIDES_BACK = 0.15  # slope against the wheels from which a rover may slide back on them [-]
AROUND = 0.25  # half of the time around a velocity that rim speeds are averaged over [s]


@dataclass(frozen=True)
class Evidence:
    """The recording, the rover and what follows from both.

    Rates, torques, forces and angular rates are in the rover's signs, without the errors that the
    rover file states.
    """

    recording: Recording
    facts: RoverFacts
    time: FloatArray  # (k,) stamps of the wheel odometry since the first one [s], increasing
    rate: FloatArray  # (k, n) per wheel of ``facts.names`` [rad/s]; nan where not there
    torque: FloatArray  # (k, n) [N m]
    force: FloatArray | None  # (k, 3) in base_link, over the period of the wheel odometry [m/s^2]
    gyro: FloatArray | None  # (k, 3) likewise [rad/s]
    rotation: FloatArray  # (3, 3) from the IMU's frame into base_link
    figures: dict[str, Any]  # what the report shows beside findings; the checks write into it
    steering: FloatArray  # (k, n) angles, positive left [rad]; nan of a wheel that has none
    likelier_radius: float = 1.0  # over those of ``facts``, of a finding with an alternative [-]

    def found(self, key: str, confidence: float, **details: Any) -> Finding:
        """Return a finding on the topic of its fault's channel; see `finding.found`."""
        channel = getattr(self.recording, FAULTS[key].channel)
        return found(key, channel.topic, confidence, **details)

    @property
    def joints(self) -> JointSeries:
        """The wheel odometry, a message per row."""
        assert self.recording.joints is not None
        return self.recording.joints

    def seconds(self, channel: Channel) -> FloatArray:
        """Return stamps of a channel since that of the first row [s]."""
        return np.asarray((channel.stamp - self.joints.stamp[0]) * 1e-9, dtype=np.float64)

    @cached_property
    def period(self) -> float:
        """Median time between two rows [s]."""
        return float(np.median(np.diff(self.time))) if self.time.size > 1 else math.nan

    def rows_in(self, duration: float) -> int:
        """Return the number of rows in a time [s], one at least."""
        return max(round(duration / max(self.period, 1e-3)), 1)

    def enough(self, rows: Mask, times: float = 1.0) -> bool:
        """Return whether there is enough driving in rows, or so many times that."""
        least = max(LEAST_MOVING_ROWS, self.rows_in(LEAST_DRIVING))
        return bool(rows.sum() >= times * least)

    @cached_property
    def common_rate(self) -> FloatArray:
        """Median rate of the wheels (k,) [rad/s]."""
        return _shared(row_medians(self.rate))

    @cached_property
    def size(self) -> FloatArray:
        """Median size of the rates (k,) [rad/s]."""
        return _shared(row_medians(np.abs(self.rate)))

    @cached_property
    def working_rate(self) -> float:
        """Typical size of the wheel rates when moving [rad/s]; 0 if the rover never moves."""
        size = self.size[np.isfinite(self.size)]
        top = float(np.quantile(size, 0.95)) if size.size else 0.0
        moving = size[size > 0.2 * top]
        return float(np.median(moving)) if moving.size else 0.0

    @cached_property
    def moving(self) -> Mask:
        """Rows in which the wheels turn."""
        return _shared(self.size > 0.2 * max(self.working_rate, 1e-9))

    @cached_property
    def rate_noise(self) -> float:
        """Noise of the rates [rad/s]."""
        return bend_noise(np.nan_to_num(self.rate)) if self.rate.shape[0] > 2 else 0.0

    @cached_property
    def rest_rate(self) -> float:
        """Mean rate over `SHORTEST_REST` up to which a wheel may stand, for its noise [rad/s]."""
        noisy = 4.0 * self.rate_noise / math.sqrt(self.rows_in(SHORTEST_REST))
        return max(REST_RATE * self.working_rate, noisy, 1e-9)

    @cached_property
    def at_rest(self) -> Mask:
        """Rows in which every wheel has stood still for a while."""
        rate, width = np.nan_to_num(self.rate), self.rows_in(SHORTEST_REST)
        mean = np.column_stack([moving_mean(one, width) for one in rate.T])
        still = (np.abs(mean) <= self.rest_rate).all(axis=1)
        still &= np.abs(rate).max(axis=1) <= max(self.rest_rate, 5.0 * self.rate_noise)
        still &= np.isfinite(self.rate).any(axis=1)
        return _shared(self._after(still, SETTLING + SHORTEST_REST))

    def _after(self, condition: Mask, duration: float) -> Mask:
        """Return where a condition has held for some time [s]."""
        width = max(math.ceil(duration / max(self.period, 1e-3)), 1)
        held = np.zeros(condition.size, dtype=bool)
        if condition.size >= width:
            windows = np.lib.stride_tricks.sliding_window_view(condition, width)
            held[width - 1 :] = windows.all(axis=1)
        return held

    @cached_property
    def yaw(self) -> FloatArray:
        """Yaw rate (k,) less its bias at rest [rad/s]; zeros without a gyro."""
        if self.gyro is None:
            return _shared(np.zeros(self.time.size))
        yaw = self.gyro[:, 2]
        return _shared(yaw - (np.median(yaw[self.at_rest]) if self.rested else 0.0))

    @property
    def rested(self) -> bool:
        """Whether there is a standstill for the bias of the gyro."""
        return float(self.at_rest.sum()) * self.period > LEAST_REST

    @cached_property
    def steady(self) -> Mask:
        """Rows in which the rover moves and its speed has not changed for a while."""
        rate = self.common_rate
        width = self.rows_in(SETTLING)
        change = np.zeros_like(rate)
        if rate.size > 2 * width:  # means over that time: noise is no change
            mean = np.convolve(rate, np.ones(width) / width, mode='valid')
            change[2 * width - 1 :] = np.abs(mean[width:] - mean[:-width])
        calm = change < 0.15 * max(self.working_rate, 1e-9)
        return _shared(self._after(self.moving & calm, SETTLING))

    @cached_property
    def radius(self) -> FloatArray:
        """Radii (n,) [m], 1 where they are not known."""
        return np.where(np.isfinite(self.facts.radius), self.facts.radius, 1.0)

    @cached_property
    def speed(self) -> FloatArray:
        """Rim speeds along x (k, n) [m/s]; with radius 1 where it is not known.

        Of a wheel that rolls where it is steered to, this is v_x - w_z y, as of one that is not.
        """
        return _shared(self.rate * self.radius * np.cos(np.nan_to_num(self.steering)))

    @cached_property
    def rim(self) -> FloatArray:
        """Mean rim speed of the wheels along x (k,) [m/s]."""
        return _shared(_row_means(self.speed))

    @cached_property
    def side_difference(self) -> FloatArray:
        """Mean rim speed right minus left (k,) [m/s]; nan where the sides are not known."""
        speed = self.speed
        right, left = self.facts.side < 0, self.facts.side > 0
        if not right.any() or not left.any():
            return _shared(np.full(self.time.size, np.nan))
        return _shared(_row_means(speed[:, right]) - _row_means(speed[:, left]))

    @cached_property
    def curve(self) -> FloatArray:
        """By how much the right side runs faster for a while (k,) [m/s]; 0: not known."""
        return _shared(moving_mean(np.nan_to_num(self.side_difference), self.rows_in(SETTLING)))

    @cached_property
    def unturned(self) -> Mask:
        """Rows of driving without a turn, neither by the gyro nor by the wheels."""
        rim = np.abs(self.rim)
        rows = self.moving & (np.abs(self.curve) <= STRAIGHT_SHARE * rim)
        if self.gyro is not None and self.facts.known:
            yaw = np.abs(self.gyro[:, 2] - np.median(self.gyro[:, 2]))
            rows &= yaw * float(np.abs(self.facts.lateral).max()) < STRAIGHT_SHARE * rim
        return _shared(rows)

    @cached_property
    def exactly_even(self) -> Mask:
        """Rows in which no rate changes, of rates without noise (a simulator's); else none."""
        rate = np.nan_to_num(self.rate)
        same = np.append(True, (np.diff(rate, axis=0) == 0.0).all(axis=1))
        # Rates that stay show no noise, and they may be most of the drive.
        changed = np.append(0, np.cumsum(self.moving & ~same))
        bends = changed[BEND + 1 :] - changed[: -BEND - 1] > BEND
        noisy = noise_of(rate, bends) > NO_NOISE * self.working_rate
        return _shared(same & (not noisy))

    @cached_property
    def straight(self) -> Mask:
        """Steady rows without a turn, and with all torques of a rover that has such."""
        there = np.isfinite(self.torque)
        return _shared(self.steady & self.unturned & (there.all(axis=1) | ~there.any(axis=0).all()))

    @cached_property
    def turning(self) -> Mask:
        """Rows in which the gyro or the wheels see a turn."""
        if self.gyro is None:
            return _shared(np.zeros(self.time.size, dtype=bool))
        rate = np.abs(self.gyro[:, 2])
        return _shared(self.moving & (rate > 0.3 * np.quantile(rate, 0.98)))

    def rim_at(self, channel: Channel, values: FloatArray) -> FloatArray:
        """Return means of (k,) values within `AROUND` of stamps of a channel; nan far from any."""
        at = self.seconds(channel) + AROUND
        mean = averaged(self.time, values[:, None], at, 2.0 * AROUND)[:, 0]
        return np.where(beside(channel, self.joints), mean, np.nan)

    def rows(self, kept: Mask) -> Evidence:
        """Return the evidence with some messages of the wheel odometry."""
        recording = replace(self.recording, joints=rows_of(self.joints, kept))
        of_rows = 'time', 'rate', 'torque', 'steering'
        left: dict[str, Any] = {name: getattr(self, name)[kept] for name in of_rows}
        left |= {name: self._between(getattr(self, name), kept) for name in ('force', 'gyro')}
        return replace(self, recording=recording, **left)

    def _between(self, values: FloatArray | None, kept: Mask) -> FloatArray | None:
        """Return means of (k, 3) values over the time from one of some rows to the next."""
        if values is None:
            return None
        spans = since_the_row_before(self.time)
        total = np.cumsum(np.column_stack([values, np.ones(spans.size)]) * spans[:, None], axis=0)
        table = np.diff(total[kept], axis=0, prepend=0.0)
        return table[:, :-1] / table[:, -1:]

    def with_channel(self, name: str, **values: Any) -> Evidence:
        """Return the evidence with other values in a channel of the recording."""
        channel = replace(getattr(self.recording, name), **values)
        return replace(self, recording=replace(self.recording, **{name: channel}))

    def with_reference(self, reference: VelocitySeries | None) -> Evidence:
        """Return the evidence with another reference."""
        return replace(self, recording=replace(self.recording, reference=reference))

    def turned(self, rotation: FloatArray) -> Evidence:
        """Return the evidence with another mounting of the IMU."""
        change = rotation @ self.rotation.T
        force = None if self.force is None else self.force @ change.T
        gyro = None if self.gyro is None else self.gyro @ change.T
        return replace(self, rotation=rotation, force=force, gyro=gyro)


def gather(recording: Recording, facts: RoverFacts, figures: dict[str, Any]) -> Evidence | None:
    """Return the evidence of a recording; None where no wheel of the rover is in it.

    Messages may hold some of the wheels only: a row has the nearest reading of each. Rows are where
    there is an IMU as well, unless hardly any are.
    """
    joints = recording.joints
    if joints is None or not (joints.stamp > 0).any():
        return None
    rows = of_one_wheel(joints, facts.names)
    rows = rows_of(rows, rows.stamp > 0)
    rows = rows_of(rows, np.unique(rows.stamp, return_index=True)[1])
    if recording.imu is not None:
        together = beside(rows, recording.imu)
        if together.sum() < LEAST_MOVING_ROWS:
            recording = replace(recording, imu=None)
        else:
            rows = rows_of(rows, together)
    recording = replace(recording, joints=rows)
    for name in ('imu', 'sinkage', 'reference'):
        channel = getattr(recording, name)
        if channel is not None and (kept := beside(channel, rows)).any():
            recording = replace(recording, **{name: rows_of(channel, kept)})
    time = rows.seconds
    rate, torque, steering = np.full((3, time.size, len(facts.names)), np.nan)
    for index, name in enumerate(facts.names):
        if name in joints.names:
            column, sign = joints.names.index(name), facts.direction[index]
            rate[:, index] = sign * nearest(joints.stamp, joints.rate[:, column], rows.stamp)
            torque[:, index] = sign * nearest(joints.stamp, joints.torque[:, column], rows.stamp)
    if joints.position is not None:
        for index, name in enumerate(facts.configuration.wheels.steering_joints):
            if name in joints.names:
                angle = joints.position[:, joints.names.index(name)]
                steering[:, index] = nearest(joints.stamp, angle, rows.stamp)
    torque = facts.errors.torque.true(torque)
    force = gyro = None
    imu = recording.imu
    if imu is not None:
        at = (imu.stamp - rows.stamp[0]) * 1e-9
        width = since_the_row_before(time)
        force, gyro = (
            averaged(at, np.nan_to_num(values) @ facts.mounting.T, time, width) - bias
            if np.isfinite(values).any()
            else None
            for values, bias in (
                (imu.force, facts.errors.specific_force_bias),
                (imu.rate, facts.errors.angular_rate_bias),
            )
        )
    return Evidence(
        recording, facts, time, rate, torque, force, gyro, facts.mounting, figures, steering
    )


def since_the_row_before(time: FloatArray) -> FloatArray:
    """Return the time since the row before [s]; no more than a reading stands, usual at first."""
    step = np.diff(time)
    return np.minimum(np.append(np.median(step), step), LONGEST_HELD * 1e-9)


def noise_of(values: FloatArray, bends: Mask | slice = slice(None)) -> float:
    """Return the noise of (k, ...) values that follow one another, whatever moves them.

    `bends` chooses some of the (k - BEND,) differences; nan: there is none.
    """
    return robust_std(np.diff(values, BEND, axis=0)[bends].ravel()) / BEND_OF_NOISE


def once(function: Callable[[Evidence], Result]) -> Callable[[Evidence], Result]:
    """Cache the result of a function of an evidence with it, as a cached property does."""

    @wraps(function)
    def kept_result(evidence: Evidence) -> Result:
        kept: dict[str, Any] = evidence.__dict__
        if function.__name__ not in kept:
            kept[function.__name__] = function(evidence)
        return kept[function.__name__]

    return kept_result


def _shared(values: NDArray[Any]) -> NDArray[Any]:
    """Return values that every check sees, so that none may change them."""
    values.flags.writeable = False
    return values


def row_medians(values: FloatArray) -> FloatArray:
    """Return the median of each row of (k, n) without nan, 0 where all are nan."""
    count = np.isfinite(values).sum(axis=1, keepdims=True)
    ordered = np.sort(values, axis=1)  # nan behind all others
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, values.shape[1] - 1)
    both = [np.take_along_axis(ordered, middle, axis=1) for middle in (low, high)]
    return np.where(count > 0, 0.5 * (both[0] + both[1]), 0.0)[:, 0]


def _row_means(values: FloatArray) -> FloatArray:
    known = np.isfinite(values)
    return np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)


# Motion by the IMU --------------------------------------------------------------------------------

Complex: TypeAlias = NDArray[np.complex128]

LEAST_YAW = math.radians(12.0)  # least yaw of starts and stops in a comparison [rad]
YAW_SIGMAS = 4.0
RATIOS = (0.4, 2.5)  # measured over expected motion along an axis; beyond, it is another [-]
YAW_BLOCKS = 10  # parts of a drive that a deviation comes from


def _motions(evidence: Evidence) -> tuple[Complex, Complex] | None:
    """Return expected (by wheels and gyro) and measured specific force (k,) [m/s^2]; None: no IMU.

    Along x the acceleration of starts and stops, along y that of curves, as complex numbers; the
    slope changes more slowly.
    """
    if evidence.force is None or evidence.gyro is None or evidence.time.size < 100:
        return None
    period = evidence.period
    width = max(round(0.4 / period), 1)
    speed = moving_mean(evidence.rim, width)
    curve = speed * moving_mean(evidence.gyro[:, 2], width)
    motion = without_drift(np.gradient(speed, evidence.time) + 1j * curve, period)
    along, across = (moving_mean(column, width) for column in evidence.force[:, :2].T)
    seen = without_drift(along + 1j * across, period)
    return motion, seen


@once
def acceleration_fits(evidence: Evidence) -> tuple[Estimate, Estimate] | None:
    """Return measured over expected accelerations of starts (x) and curves (y); None: no IMU."""
    both = _motions(evidence)
    if both is None:
        return None
    motion, seen = both
    pairs = (motion.real, seen.real), (motion.imag, seen.imag)
    along, across = (block_fit(wheels[:, None], measured)[0] for wheels, measured in pairs)
    # Few curves on a slope leave more open than their blocks differ.
    energy = max(float(motion.imag @ motion.imag), 1e-12)
    chance = math.sqrt(2.0) * _by_chance(motion.imag, seen.imag, across.value * energy) / energy
    return along, Estimate(across.value, max(across.std, chance))


def accelerometer_signs(evidence: Evidence) -> list[int]:
    """Return the signs of accelerations along x and y: 1 as by wheels and gyro, -1 opposite.

    0 is not clear. A rotated IMU measures both alike; no rotation reverses one of them.
    """
    fits = acceleration_fits(evidence)
    if fits is None:
        return [0, 0]
    clear = [RATIOS[0] < abs(f.value) < RATIOS[1] and f.sigmas_from(0.0) > YAW_SIGMAS for f in fits]
    return [int(np.sign(f.value)) * there for f, there in zip(fits, clear, strict=True)]


def mounting_yaw(evidence: Evidence) -> Estimate | None:
    """Return the angle by which a measured motion is rotated [rad]; None where it is not clear."""
    both = _motions(evidence)
    if both is None:
        return None
    motion, seen = both
    energy = np.cumsum(np.abs(motion) ** 2)
    edges = np.searchsorted(energy, np.linspace(0.0, energy[-1], YAW_BLOCKS + 1)[1:-1])
    blocks = zip(np.split(motion, edges), np.split(seen, edges), strict=True)
    parts = np.array([np.vdot(wheels, measured) for wheels, measured in blocks])
    total = parts.sum()
    spread = float(np.linalg.norm(parts - total / parts.size))
    chance = _by_chance(motion, seen, total)
    alike = 0.5 * energy[-1] < abs(total) < 2.0 * energy[-1]
    if not alike or abs(total) < 3.0 * max(spread, chance):
        return None
    across = (parts * np.conj(total)).imag / abs(total) ** 2  # along it they differ without a turn
    std = max(float(np.linalg.norm(across)), chance / abs(total))
    return Estimate(float(np.angle(total)), std)


def _by_chance(motion: Complex | FloatArray, seen: Complex | FloatArray, total: complex) -> float:
    """Return the chance correlation of a motion with the rest of the measured one at other lags."""
    left = seen - motion * total / np.vdot(motion, motion)
    at_lags = np.fft.ifft(np.fft.fft(left) * np.conj(np.fft.fft(motion)))
    return float(np.sqrt(0.5 * np.mean(np.abs(at_lags) ** 2)))
