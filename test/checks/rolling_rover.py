# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover that rolls without slip, written down from kinematics alone: the truth of these tests."""

import functools
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.checks.run import check_recording
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.configuration import reader

NAMES = ('front_left', 'front_right', 'rear_left', 'rear_right')
RADIUS, HALF_TRACK, HALF_BASE, MASS, GRAVITY = 0.2, 0.4, 0.1, 60.0, 9.80665
DEPTH = 0.009  # sinkage [m]
RESISTANCE = 0.08  # rolling resistance over weight
START = 1_700_000_000_000_000_000
RATE = 10.0  # [Hz]


PARAMETERS = {
    'rover.mass': MASS,
    'wheels.names': list(NAMES),
    'wheels.radius': [RADIUS] * 4,
    'wheels.width': [0.1] * 4,
    'wheels.x': [HALF_BASE, HALF_BASE, -HALF_BASE, -HALF_BASE],
    'wheels.y': [HALF_TRACK, -HALF_TRACK] * 2,
    'sensors.reference_std': 0.01,
}


@functools.cache
def _usual_rover():
    return reader.from_parameters(PARAMETERS)


def rover(**changes):
    """The rover file; wheels in one row nearly, so that turns need no skid."""
    return reader.from_parameters(PARAMETERS | changes) if changes else _usual_rover()


@dataclass(frozen=True)
class Motion:
    time: np.ndarray
    speed: np.ndarray
    yaw_rate: np.ndarray
    slope: np.ndarray  # uphill along the drive [rad]


def rolling_radius():
    """Speed over rate where shear along the contact vanishes in the mean: the mean of cos t is
    sin(t1)/t1 from the front angle t1 to the bottom."""
    front = np.arccos(1.0 - DEPTH / RADIUS)
    return RADIUS * front / np.sin(front)


def ten_minute_drive(turns=True, until=220.0):
    """Rest, forward, back, over a hill, then a circle to each side."""
    time = np.arange(0.0, until, 1.0 / RATE)
    knots = [0, 15, 16, 60, 61, 65, 66, 100, 101, 105, 106, until]
    speed = np.interp(time, knots, [0, 0, 0.3, 0.3, 0, 0, -0.3, -0.3, 0, 0, 0.3, 0.3])
    yaw = np.interp(
        time, [130, 131, 164, 165, 170, 171, 204, 205], [0, 0.2, 0.2, 0, 0, -0.2, -0.2, 0]
    )
    hill = np.interp(time, [20, 22, 38, 40, 42, 58], [0, 0.12, 0.12, -0.12, -0.12, 0])
    back = np.interp(time, [70, 72, 95], [0, -0.1, 0])
    return Motion(time, speed, yaw if turns else 0.0 * yaw, np.where(time < 62, hill, back))


def starts_and_curves():
    """Starts and stops for half a minute, then curves, on the level."""
    knots = [2, 3, 8, 9, 11, 12, 18, 19, 21, 22, 70]
    speed = knots, [0, 0.3, 0.3, 0, 0, 0.3, 0.3, 0, 0, 0.3, 0.3]
    return motion(70.0, speed, yaw=([35, 36, 52, 53, 54, 69], [0, 0.3, 0.3, 0, -0.3, -0.3]))


def motion(until, speed, yaw=0.0, slope=0.0, rate=RATE):
    """A drive of so many seconds: numbers, (times, numbers between them), or functions of time."""
    time = np.arange(0.0, until, 1.0 / rate)

    def over(given):
        if callable(given):
            return given(time)
        return np.interp(time, *given) if isinstance(given, tuple) else np.full(time.size, given)

    return Motion(time, over(speed), over(yaw), over(slope))


@functools.cache
def _usual_recording(seed):
    return _recorded(ten_minute_drive(), seed)


def recording(motion=None, seed=0):
    """All channels of a drive, with honest noise."""
    return _usual_recording(seed) if motion is None else _recorded(motion, seed)


def driven(until, speed, **more):
    """All channels of a drive as `motion` has it."""
    return recording(motion(until, speed, **more))


def changed(whole=None, **channels):
    """A drive, by default the usual one, with other channels, or with other fields of them."""
    whole = whole or recording()
    others = {
        name: replace(getattr(whole, name), **given) if isinstance(given, dict) else given
        for name, given in channels.items()
    }
    return replace(whole, **others)


def checked(configuration=None, whole=None, **channels):
    """The report on such a drive."""
    return check_recording(changed(whole, **channels), configuration or rover())


def faults(report):
    return [finding.fault for finding in report.findings]


def found(**channels):
    return checked(**channels).findings


def _recorded(m, seed):
    random = np.random.default_rng(seed)
    stamp = START + np.round(m.time * 1e9).astype(np.int64)
    arrival = stamp + 2_000_000
    y = np.array([HALF_TRACK, -HALF_TRACK] * 2)
    rate = (m.speed[:, None] - m.yaw_rate[:, None] * y) / rolling_radius()
    acceleration = np.gradient(m.speed, m.time)
    demand = MASS * (acceleration + GRAVITY * np.sin(m.slope))
    resistance = RESISTANCE * MASS * GRAVITY * np.sign(np.round(rate, 6))
    torque = RADIUS * (demand[:, None] / 4 + resistance / 4)
    noise = lambda size, scale: scale * random.standard_normal(size)  # noqa: E731
    joints = JointSeries(
        '/joint_states', stamp, arrival, NAMES,
        rate + noise(rate.shape, 0.004), torque + noise(rate.shape, 0.2),
    )  # fmt: skip
    fine = np.arange(0.0, m.time[-1], 0.04)
    at = lambda values: np.interp(fine, m.time, values)  # noqa: E731
    imu_stamp = START + np.round(fine * 1e9).astype(np.int64)
    force = np.column_stack([
        at(acceleration) + GRAVITY * np.sin(at(m.slope)),
        at(m.speed) * at(m.yaw_rate),
        GRAVITY * np.cos(at(m.slope)),
    ])  # fmt: skip
    gyro = np.column_stack([0 * fine, -np.gradient(at(m.slope), fine), at(m.yaw_rate)])
    imu = ImuSeries(
        '/imu/data', imu_stamp, imu_stamp + 2_000_000,
        force + noise(force.shape, 0.04), gyro + noise(gyro.shape, 0.004),
        np.full((fine.size, 4), np.nan),
    )  # fmt: skip
    every = slice(0, None, 5)
    velocity = np.column_stack([m.speed[every], 0 * m.time[every], 0 * m.time[every]])
    velocity[:, 0] += noise(velocity.shape[0], 0.01)
    reference = VelocitySeries(
        '/reference_odom', stamp[every], arrival[every] + 300_000_000, velocity,
        m.yaw_rate[every], np.full(velocity.shape[0], 1e-4),
    )  # fmt: skip
    depth = DEPTH + 0.002 * np.sin(0.3 * m.time)[:, None] * np.ones(4)
    sinkage = SinkageSeries('/sinkage', stamp, arrival, NAMES, depth + noise(depth.shape, 0.0022))
    topics = (('/joint_states', 'sensor_msgs/msg/JointState', stamp.size),)
    return Recording('drive', topics, joints, imu, sinkage, reference, None)
