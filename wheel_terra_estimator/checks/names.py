# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Topics and joints by name."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.checks.finding import Finding, Outcome, found, not_checked
from wheel_terra_estimator.checks.rover_facts import RoverFacts, place, side_of, wheel_names
from wheel_terra_estimator.checks.series import JointSeries, Recording

IMU = 'sensor_msgs/msg/Imu'
SECOND = 1_000_000_000  # [ns]
MOST_SILENT = 0.5  # seconds with a rate, over those of the wheel with most, of one that is told [-]
LONGEST_SILENCE = 2.0  # of all wheels at the end, while other joints are reported [s]

DEFAULT_TOPICS = {
    'joints': '/joint_states',
    'wheel_odometry': '/odom',
    'imu': '/imu/data',
    'sinkage': '/sinkage',
    'reference': '/reference_odom',
}


def check_required(recording: Recording, facts: RoverFacts) -> list[Outcome]:
    """Return the inputs that the estimator cannot do without and the recording does not have."""
    own = facts.configuration.wheel_odometry
    outcomes: list[Outcome] = []
    if (recording.joints if own == 'joint_states' else recording.wheel_odometry) is None:
        other = recording.wheel_odometry
        cure = f'record the wheel rates, or name their topic: --remap {own}:=/TOPIC'
        if own == 'joint_states' and other is not None:
            cure = f'-p wheel_odometry:=odom --remap odom:={other.topic}'
            if not facts.known:
                cure = 'wheel-terra init --bag BAG --wheels NAMES makes a rover file for that'
        outcomes.append(_required(own, 'wheel rates', 'there is nothing to estimate', cure))
    if recording.imu is None:
        effect = 'slip then rests on a reference velocity alone, and the slope is unknown'
        cure = 'record the IMU, or name its topic: --remap imu/data:=/TOPIC'
        outcomes.append(_required('imu/data', 'IMU', effect, cure))
    return outcomes


def _required(own: str, what: str, effect: str, cure: str) -> Finding:
    return found('missing_input', f'/{own}', 0.999, what=what, effect=effect, how=cure)


def check_topics(
    recording: Recording, remapped: Sequence[str], odometry: str = 'joint_states'
) -> list[Outcome]:
    """Return topics that are there under another name than the estimator listens to.

    ``odometry``: topic of the wheel odometry.
    """
    outcomes: list[Outcome] = []
    unheard = 'wheel_odometry' if odometry == 'joint_states' else 'joints'
    for name, default in DEFAULT_TOPICS.items():
        series = getattr(recording, name) if name != unheard else None
        own = default.lstrip('/')
        if series is None or series.topic == default or own in remapped:
            continue
        if 'truth' not in series.topic:  # excluded on purpose, for comparison
            there = [series.topic]
            if name == 'imu':
                there += [
                    t for t, kind, n in recording.topics if kind == IMU and n and t not in there
                ]
            details: dict[str, Any] = {'own': default, 'there': ' and '.join(there)}
            remap = f'--remap {own}:={series.topic}'
            outcomes.append(found('topic_name', series.topic, 0.9, remap=remap, **details))
    return outcomes


def of_rims(recording: Recording, facts: RoverFacts) -> Recording:
    """Return a recording with rates of the rims from its odometry in place of joint states."""
    odometry, wheels = recording.wheel_odometry, facts.configuration.wheels
    if odometry is None or not facts.known:
        return recording
    speed = odometry.velocity[:, :1] - odometry.yaw_rate[:, np.newaxis] * wheels.y
    rate = wheels.direction * speed / wheels.slip_radius
    times = odometry.stamp, odometry.log_time
    torque = np.full_like(rate, np.nan)
    return replace(recording, joints=JointSeries(odometry.topic, *times, facts.names, rate, torque))


def check_wheel_names(recording: Recording, facts: RoverFacts) -> tuple[list[Outcome], RoverFacts]:
    """Return wheels that are absent from the recording, and the facts with the names it has."""
    joints = recording.joints
    if joints is None:
        return [not_checked('missing_wheel', 'no_joints')], facts
    if not facts.known:
        return [], facts
    second, columns = joints.log_time // SECOND, zip(joints.names, joints.rate.T, strict=True)
    heard = {name: np.unique(second[np.isfinite(rate)]).size for name, rate in columns}
    absent = [name for name in facts.names if name not in joints.names]
    known = {*facts.names, *facts.configuration.wheels.steering_joints}
    spare = [name for name in wheel_names(joints.names) if name not in known]
    renamed = _pairs(absent, spare)
    names = tuple(renamed.get(name, name) for name in facts.names)
    outcomes: list[Outcome] = []
    if renamed:
        pairs = {'wheel': renamed, 'other': renamed.values(), 'names': names}
        details: dict[str, Any] = {key: ', '.join(those) for key, those in pairs.items()}
        outcomes.append(found('joint_name', joints.topic, 0.95, **details))
    gone = [name for name in absent if name not in renamed]
    if gone:
        outcomes.append(_missing(joints.topic, gone, 'in no message'))
    told = np.isfinite(joints.rate[:, [name in names for name in joints.names]]).any(axis=1)
    last = int(np.flatnonzero(told)[-1]) if told.any() else -1
    silence = (joints.log_time[-1] - joints.log_time[last]) * 1e-9
    if silence > LONGEST_SILENCE:
        others: Any = np.isfinite(joints.rate[last + 1 :]).any(axis=0)
        later = itertools.compress(joints.names, others)
        how = f'in no message of the last {silence:.0f} s, only {", ".join(later)}'
        outcomes.append(_missing(joints.topic, facts.names, how))
    there = {name: heard[name] for name in names if name in heard}
    most = max(there.values(), default=0)
    mute = [name for name, seconds in there.items() if seconds <= MOST_SILENT * most]
    if mute:
        at = joints.position
        angles = at is not None and np.isfinite(at[:, joints.names.index(mute[0])]).any()
        share = 1.0 - max(there[name] for name in mute) / max(most, 1)
        seldom = f' in {100 * share:.0f} % of the seconds' if share < 1.0 else ''
        how = f'without a rate{seldom}: velocity is empty, NaN, infinite or of another length'
        how += '; take the change of its position' if angles else ''
        outcomes.append(_missing(joints.topic, mute, how))
    for name in spare:
        if name not in renamed.values() and 'wheel' in name.lower() and heard[name]:
            outcomes.append(found('spare_joint', joints.topic, 0.7, wheel=name))
    steering = [name for name in joints.names if 'steer' in name.lower()]
    if steering and not any(facts.configuration.wheels.steering_joints):
        outcomes.append(found('steering', joints.topic, 0.9, listed=', '.join(steering)))
    return outcomes, replace(facts, names=names)


def proposal(recording: Recording) -> dict[str, Any]:
    """Return what to write for a recording without a rover file: remaps and ``wheels.names``."""
    remaps = [o.cure for o in check_topics(recording, ()) if isinstance(o, Finding)]
    reference = recording.reference
    if reference is not None and 'truth' in reference.topic:
        remaps.append(f'--remap reference_odom:={reference.topic}  (or keep it to compare with)')
    names = wheel_names(recording.joints.names) if recording.joints is not None else ()
    return {'remaps': remaps, 'wheels.names': list(names)}


def _missing(topic: str, names: Sequence[str], how: str) -> Finding:
    them = 'it' if len(names) == 1 else 'them'
    return found('missing_wheel', topic, 0.99, wheel=', '.join(names), how=how, it=them)


def _pairs(absent: Sequence[str], spare: Sequence[str]) -> dict[str, str]:
    """Return {configured name: name in the recording} where they belong together."""
    if len(absent) == len(spare):
        pairs = dict(zip(sorted(absent, key=place), sorted(spare, key=place), strict=True))
        if all(side_of(name) * side_of(other) >= 0 for name, other in pairs.items()):
            return {name: pairs[name] for name in absent}
    left = list(spare)
    pairs = {}
    for name in absent:
        same_side = [other for other in left if side_of(other) in (0, side_of(name))]
        for other in difflib.get_close_matches(name, same_side, n=1, cutoff=0.5):
            pairs[name] = other
            left.remove(other)
    return pairs
