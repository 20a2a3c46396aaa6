# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Why nothing comes from publishers of a topic, in words."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo


def name_of(publisher: TopicEndpointInfo) -> str:
    """Return the full name of a publisher's node."""
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'


def other_type(publishers: Iterable[TopicEndpointInfo], kind: str) -> str:
    """Say which types come on a topic instead of that which is needed; empty: none."""
    others = sorted({p.topic_type for p in publishers} - {kind})
    return f'{", ".join(others)} is published there, {kind} is needed' if others else ''


def other_quality(publishers: Iterable[TopicEndpointInfo], asked: QoSProfile) -> str:
    """Say which publisher offers less than what is asked for, and in what; empty: none does."""
    for publisher in publishers:
        compatible, reason = qos_check_compatible(publisher.qos_profile, asked)
        if compatible == QoSCompatibility.ERROR:
            reason = reason.removeprefix('ERROR: ').rstrip('; ')
            return f'nothing comes from {name_of(publisher)}: {reason[:1].lower()}{reason[1:]}'
    return ''
