# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Quality of service of the topics (docs/topics.md), and why nothing comes from a publisher."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy import qos
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo

from wheel_terra_estimator.errors import UserError

OVERRIDABLE = QoSOverridingOptions(
    (
        QoSPolicyKind.HISTORY,
        QoSPolicyKind.DEPTH,
        QoSPolicyKind.RELIABILITY,
        QoSPolicyKind.DURABILITY,
    )
)
"""Users may set ``qos_overrides.<topic>.<subscription|publisher>.<policy>``."""

FAST_DEPTH = 250
"""Queue of topics that may come at 1000 Hz: a quarter of a second in which the node is held up."""

NOT_NUMBERED = 2**64 - 1
"""Number of a message where the middleware does not count them."""

FREQUENT = ('joint_states', 'odom', 'imu/data')
"""These topics, which come many times between two sets."""


def input_profile(topic: str = '') -> QoSProfile:
    """Best effort fits both kinds of publishers; a lost sensor value need not be resent."""
    depth = FAST_DEPTH if topic in FREQUENT else 10
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def output_profile(latched: bool = False) -> QoSProfile:
    """Reliable, as all profiles are by default; a latched one keeps its last message for others."""
    if latched:
        return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return QoSProfile(depth=10)


def check_overrides(node: Node) -> None:
    """Raise UserError for a quality of service over which rclpy would end the process."""
    for end in node.get_parameters_by_prefix('qos_overrides'):
        name, policy = f'qos_overrides.{end}', end.rpartition('.')[2]
        value = node.get_parameter(name).value
        known = getattr(qos, f'{policy.capitalize()}Policy', None)
        allowed = ', '.join(known.__members__).lower() if known else 'integer (at least 0)'
        bad_depth = policy == 'depth' and (type(value) is not int or value < 0)
        if bad_depth or (known and str(value).lower() not in allowed.split(', ')):
            raise UserError(f'parameters: {name}: {value!r}; allowed: {allowed}')


def name_of(publisher: TopicEndpointInfo) -> str:
    """Return the full name of a publisher's node."""
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'


def other_type(publishers: Iterable[TopicEndpointInfo], kind: str) -> str:
    """Return a message on types published in place of the required one; empty: none."""
    others = sorted({p.topic_type for p in publishers} - {kind})
    return f'{", ".join(others)} is published there, {kind} is needed' if others else ''


def other_quality(publishers: Iterable[TopicEndpointInfo], asked: QoSProfile) -> str:
    """Return a message on publishers with incompatible QoS; empty: none."""
    for publisher in publishers:
        compatible, reason = qos.qos_check_compatible(publisher.qos_profile, asked)
        if compatible == qos.QoSCompatibility.ERROR:
            reason = reason.removeprefix('ERROR: ').rstrip('; ')
            return f'nothing comes from {name_of(publisher)}: {reason[:1].lower()}{reason[1:]}'
    return ''
