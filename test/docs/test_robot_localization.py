# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``docs/tutorials/nav2.md``, run: our velocity in the filter of robot_localization.

robot_localization is C++ and in no package index that we have. Its published equations stand here
(T. Moore, D. Stouch: A generalized extended Kalman filter implementation for the Robot Operating
System, IAS-13, 2014), as ``src/ekf.cpp`` and ``src/filter_base.cpp`` have them: 15 states of
omnidirectional motion with constant acceleration, corrections of the states that the flags choose,
a first reading that is taken as it is, defaults of its process noise and initial covariance.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader

from wheel_terra_estimator.cli.main import main

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'tutorials' / 'nav2.md'
# x y z, roll pitch yaw, vx vy vz, vroll vpitch vyaw, ax ay az; its defaults.
PROCESS_NOISE = [0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04]
PROCESS_NOISE += [0.01, 0.01, 0.02, 0.01, 0.01, 0.015]
INITIAL_VARIANCE = 1e-9
LEAST_VARIANCE = 1e-9
STEP = 1e-6


def rotation(roll: float, pitch: float, yaw: float) -> Any:
    """Return the matrix that turns body axes into world axes."""
    (sr, sp, sy), (cr, cp, cy) = np.sin((roll, pitch, yaw)), np.cos((roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def moved(state: Any, dt: float) -> Any:
    """Return the state after dt."""
    new = state.copy()
    roll, pitch = state[3:5]
    rates = np.array(
        [
            [1.0, np.sin(roll) * np.tan(pitch), np.cos(roll) * np.tan(pitch)],
            [0.0, np.cos(roll), -np.sin(roll)],
            [0.0, np.sin(roll) / np.cos(pitch), np.cos(roll) / np.cos(pitch)],
        ]
    )
    new[:3] += rotation(*state[3:6]) @ (state[6:9] * dt + 0.5 * dt * dt * state[12:15])
    new[3:6] += rates @ state[9:12] * dt
    new[6:9] += state[12:15] * dt
    return new


class Filter:
    """The extended Kalman filter, fed by stamps."""

    def __init__(self) -> None:
        self.state = np.zeros(15)
        self.covariance = INITIAL_VARIANCE * np.eye(15)
        self.stamp: int | None = None

    def take(self, stamp: int, flags: Any, values: Any, covariance: Any) -> None:
        """Go on to a stamp [ns] and correct the states that the flags choose."""
        dt = 0.0 if self.stamp is None else (stamp - self.stamp) * 1e-9
        if dt > 0.0:
            steps = STEP * np.eye(15)
            ends = [[moved(self.state + k * step, dt) for step in steps] for k in (1, -1)]
            jacobian = ((np.array(ends[0]) - np.array(ends[1])) / (2 * STEP)).T
            self.state = moved(self.state, dt)
            self.covariance = jacobian @ self.covariance @ jacobian.T + dt * np.diag(PROCESS_NOISE)
        chosen = np.flatnonzero(flags)
        noise = np.array(covariance)[np.ix_(chosen, chosen)]
        if self.stamp is None:
            self.stamp, self.state[chosen] = stamp, np.array(values)[chosen]
            self.covariance[np.ix_(chosen, chosen)] = noise
            return
        self.stamp = max(stamp, self.stamp)
        np.fill_diagonal(noise, np.maximum(np.abs(np.diag(noise)), LEAST_VARIANCE))
        part = self.covariance[:, chosen]
        gain = part @ np.linalg.inv(self.covariance[np.ix_(chosen, chosen)] + noise)
        innovation = np.array(values)[chosen] - self.state[chosen]
        angles = (chosen >= 3) & (chosen < 6)
        innovation[angles] = (innovation[angles] + np.pi) % (2 * np.pi) - np.pi
        self.state = self.state + gain @ innovation
        rest = np.eye(15)
        rest[:, chosen] -= gain
        self.covariance = rest @ self.covariance @ rest.T + gain @ noise @ gain.T


def imu_input(message: Any) -> tuple[Any, Any]:
    """Return values and covariance of all 15 states as an Imu states them."""
    q = message.orientation
    values, covariance = np.zeros(15), np.zeros((15, 15))
    values[3] = np.arctan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2))
    values[4] = np.arcsin(2 * (q.w * q.y - q.z * q.x))
    rate = message.angular_velocity
    values[9:12] = rate.x, rate.y, rate.z
    covariance[3:6, 3:6] = message.orientation_covariance.reshape(3, 3)
    covariance[9:12, 9:12] = message.angular_velocity_covariance.reshape(3, 3)
    return values, covariance


def twist_input(message: Any) -> tuple[Any, Any]:
    """Return the same of a TwistWithCovarianceStamped."""
    twist = message.twist.twist
    values, covariance = np.zeros(15), np.zeros((15, 15))
    values[6:12] = (
        *(twist.linear.x, twist.linear.y, twist.linear.z),
        *(twist.angular.x, twist.angular.y, twist.angular.z),
    )
    covariance[6:12, 6:12] = message.twist.covariance.reshape(6, 6)
    return values, covariance


def wheels_input(message: Any) -> tuple[Any, Any]:
    """Return what wheel odometry alone would say: the mean rim speed, one per cent sure."""
    values, covariance = np.zeros(15), np.zeros((15, 15))
    values[6] = RADIUS * float(np.mean(message.velocity))
    covariance[6, 6] = (0.01 * values[6]) ** 2 + 1e-4**2
    return values, covariance


RADIUS = 0.125  # lug tips of generic_six_wheel [m]


@pytest.fixture(scope='module')
def drive(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Messages in order of arrival, and where the rover truly ended [m]."""
    folder = tmp_path_factory.mktemp('drive')
    bag, out = str(folder / 'bag'), str(folder / 'out')
    run = ['--scenario', 'climb_soft_patch', '--duration', '30', '--seed', '2']
    assert main(['simulate', *run, '-o', bag]) == 0
    assert main(['replay', bag, '--config', 'generic_six_wheel', '-o', out]) == 0
    with AnyReader([Path(bag), Path(out)]) as reader:
        messages = [
            (c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()
        ]
    speeds = [
        (stamp_of(m), m.twist.twist.linear.x) for t, m in messages if t == '/ground_truth/twist'
    ]
    stamps, speed = np.array(speeds, dtype=float).T
    return messages, float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(stamps))) * 1e-9


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def located(messages: Any, velocity: str) -> Filter:
    """Return the filter of the page after a drive; ``velocity`` is the topic behind twist0."""
    block = re.search(r'^```yaml\n(.*?)^```', PAGE.read_text(encoding='utf-8'), re.M | re.S)
    assert block
    values = yaml.safe_load(block[1])['ekf_filter_node']['ros__parameters']
    assert values['twist0'] == '/wheel_terra_estimator/twist'
    inputs = {
        values['imu0']: (values['imu0_config'], imu_input),
        velocity: (values['twist0_config'], twist_input),
    }
    if velocity == '/joint_states':
        inputs[velocity] = ([k == 6 for k in range(15)], wheels_input)
    ekf = Filter()
    for topic, message in messages:
        if topic in inputs:
            flags, read = inputs[topic]
            ekf.take(stamp_of(message), flags, *read(message))
    return ekf


@pytest.mark.slow
def test_our_velocity_keeps_robot_localization_on_its_way(drive: Any) -> None:
    messages, travelled = drive
    ends = {
        topic: float(np.linalg.norm(located(messages, topic).state[:3]))
        for topic in ('/wheel_terra_estimator/twist', '/joint_states')
    }
    off = {topic: abs(end - travelled) for topic, end in ends.items()}
    assert travelled > 1.0
    assert off['/wheel_terra_estimator/twist'] < 0.1 * travelled
    assert off['/joint_states'] > 3.0 * off['/wheel_terra_estimator/twist']


def test_the_equations_turn_and_climb() -> None:
    """A circle on a slope of known radius closes; the height is that of the chord."""
    ekf = Filter()
    noise = 1e-8 * np.eye(15)
    flags = [k in (3, 4, 6, 7, 8, 9, 10, 11) for k in range(15)]
    values = np.zeros(15)
    values[6], values[11] = 0.5, 0.25  # a circle of 2 m
    for k in range(round(2 * np.pi / 0.25 / 0.02) + 1):
        ekf.take(k * 20_000_000, flags, values, noise)
    np.testing.assert_allclose(ekf.state[:3], 0.0, atol=0.02)
    climbing = Filter()
    values = np.zeros(15)
    values[4], values[6] = -0.2, 0.5
    for k in range(501):
        climbing.take(k * 20_000_000, flags, values, noise)
    assert climbing.state[2] == pytest.approx(5.0 * np.sin(0.2), rel=0.02)
