# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Reasons why no message arrives from the publishers of a topic."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo


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
        compatible, reason = qos_check_compatible(publisher.qos_profile, asked)
        if compatible == QoSCompatibility.ERROR:
            reason = reason.removeprefix('ERROR: ').rstrip('; ')
            return f'nothing comes from {name_of(publisher)}: {reason[:1].lower()}{reason[1:]}'
    return ''
