# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Which topics of a bag are inputs, where they do not have the names that the estimator uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wheel_terra_estimator.bags.storage import Bag, Topic
from wheel_terra_estimator.messages.convert import INPUT_TYPES

NO_INPUTS = ('/wheel_terra_estimator/', '/ground_truth/')
"""Topics that look like inputs and are estimates or truth."""

_REFERENCE_WORDS = ('reference', 'truth', 'visual', 'vio', 'gps', 'gnss', 'rtk', 'mocap', 'vo')
_JOINT_WORDS = ('joint_states', 'wheel', 'joint')
_IMU_WORDS = ('imu/data', 'imu')
WHEEL_RATES = '/joint_states'  # a namespace that has them is a rover

_OTHER_REFERENCES = (
    'sensor_msgs/msg/NavSatFix',
    'geometry_msgs/msg/PoseStamped',
    'geometry_msgs/msg/PoseWithCovarianceStamped',
    'geometry_msgs/msg/TwistStamped',
    'geometry_msgs/msg/TwistWithCovarianceStamped',
)
"""Types that hold a velocity, or places, and are no input."""


def other_references(bag: Bag) -> str:
    """Return how topics of another type become a reference velocity, '' for none."""
    inputs = [t for t in _inputs(bag) if t.type in _OTHER_REFERENCES and 'cmd' not in t.name]
    there = ', '.join(f'{t.name} ({t.type})' for t in inputs)
    return there and (
        f'{there}: to use a source other than the wheels as a reference, publish it as '
        f'{INPUT_TYPES["reference_odom"]} with twist.twist.linear.x, of positions their change '
        'over a second, forward positive; or log all to one table for wheel-terra convert'
    )


def choose_topics(bag: Bag, remaps: Mapping[str, str]) -> dict[str, str]:
    """Return {estimator's topic: topic in the bag}: as named, else the likeliest one.

    Of several rovers all is of one: that of the wheel rates or another topic that is named, else
    the first.
    """
    rovers = _rovers(bag)
    first = rovers[0] if rovers and WHEEL_RATES not in bag.topics else ''
    named = remaps.get('joint_states', ''), *remaps.values()
    own = next((rover for topic in named if (rover := _rover_of(topic, rovers))), first)
    there = [
        topic
        for topic in _inputs(bag)
        if not own or topic.name in remaps.values() or _rover_of(topic.name, rovers) in ('', own)
    ]
    chosen: dict[str, str] = {}
    # A slip-free velocity first: another one may be wheel odometry.
    for name in sorted(INPUT_TYPES, key=lambda name: name == 'odom'):
        kind = INPUT_TYPES[name]
        wanted = remaps.get(name, f'/{name}')
        fitting = [topic.name for topic in there if topic.type == kind]
        if wanted in fitting:
            chosen[name] = wanted
        elif name not in remaps:
            taken = {*chosen.values(), *(f'/{other}' for other in INPUT_TYPES)}
            guess = _likeliest(name, [topic for topic in fitting if topic not in taken])
            if guess:
                chosen[name] = guess
    return chosen


def other_rovers(bag: Bag, chosen: Mapping[str, str]) -> list[str]:
    """Return the options that choose each other rover of a bag, where one in a namespace is."""
    rovers = _rovers(bag)
    own = _rover_of(chosen.get('joint_states', ''), rovers)
    others = [rover for rover in rovers if own and rover != own]
    return [as_options(choose_topics(bag, {'joint_states': r + WHEEL_RATES})) for r in others]


def as_options(chosen: Mapping[str, str]) -> str:
    """Return the options of a command that choose topics; a truth is kept apart on purpose."""
    return ' '.join(
        f'--remap {name}:={topic}'
        for name, topic in chosen.items()
        if topic != f'/{name}' and name != 'odom' and 'truth' not in topic
    )


def _inputs(bag: Bag) -> list[Topic]:
    return [t for t in bag.topics.values() if t.message_count and not t.name.startswith(NO_INPUTS)]


def _rovers(bag: Bag) -> list[str]:
    """Return the namespaces of a bag with wheel rates."""
    rates = [t.name for t in _inputs(bag) if t.type == INPUT_TYPES['joint_states']]
    return [name.removesuffix(WHEEL_RATES) for name in rates if name.endswith(WHEEL_RATES)]


def _rover_of(topic: str, rovers: Sequence[str]) -> str:
    """Return the namespace of a rover that a topic is in, '' for none."""
    return max((rover for rover in rovers if topic.startswith(f'{rover}/')), key=len, default='')


def _likeliest(name: str, topics: Sequence[str]) -> str | None:
    words = {
        'joint_states': _JOINT_WORDS,
        'imu/data': _IMU_WORDS,
        'reference_odom': _REFERENCE_WORDS,
        'leaving_angle': ('leaving',),
        'odom': ('wheel', 'odom'),
    }.get(name, (name,))
    for word in words:
        for topic in topics:
            slip_free = any(w in topic.lower().replace('/', '_').split('_') for w in words)
            if word in topic.lower() and (name != 'reference_odom' or slip_free):
                return topic
    if name in ('joint_states', 'imu/data') and len(topics) == 1:
        return topics[0]
    return None
