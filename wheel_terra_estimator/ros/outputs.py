# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Publishers of the estimator and the messages they send."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Bool, Int8

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages import pack
from wheel_terra_estimator.messages.diagnostics import Status
from wheel_terra_estimator.ros.qos import OVERRIDABLE, output_profile


def message_class(name: str) -> Any:
    """Return the class of a message, such as ``nav_msgs/msg/Odometry``."""
    module, _, kind = name.replace('/', '.').rpartition('.')
    return getattr(import_module(module), kind)


SET_MESSAGES = {topic: message_class(pack.OUTPUT_TYPES[topic]) for topic in pack.SET_TOPICS}
"""Private topic -> class of the message that it has of each set."""


def make_publisher(node: Node, kind: Any, topic: str, latched: bool = False) -> Publisher:
    """Return a publisher whose quality of service the user may override."""
    return node.create_publisher(
        kind,
        topic,
        output_profile(latched),
        # rclpy looks at every event handler whenever anything happens, which costs more than a
        # message. A subscriber whose quality of service does not fit is warned by its own node.
        event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
        qos_overriding_options=OVERRIDABLE,
    )


class EstimatePublisher:
    """Publishes estimate sets on the private topics of a node, and its diagnostics."""

    def __init__(self, node: Node, names: tuple[str, ...]) -> None:
        self._node = node
        self._stuck: tuple[bool, int] | None = None
        self._of_sets = {
            t: make_publisher(node, kind, f'~/{t}') for t, kind in SET_MESSAGES.items()
        }
        self._stuck_publisher = make_publisher(node, Bool, '~/stuck', latched=True)
        self._direction_publisher = make_publisher(node, Int8, '~/stuck_direction', latched=True)
        self._diagnostics_publisher = make_publisher(node, DiagnosticArray, '/diagnostics')
        self._names = names

    def destroy(self) -> None:
        """Take the topics away."""
        for publisher in (
            *self._of_sets.values(),
            self._stuck_publisher,
            self._direction_publisher,
            self._diagnostics_publisher,
        ):
            self._node.destroy_publisher(publisher)

    def publish(self, estimates: EstimateSet) -> None:
        """Publish the messages of a set whose topics have subscribers."""
        wanted = {t for t, p in self._of_sets.items() if p.get_subscription_count()}
        if wanted:
            for topic, data in pack.pack(estimates, self._names, wanted):
                self._of_sets[topic].publish(data)
        self.publish_stuck(estimates.stuck, estimates.stuck_direction)

    def publish_stuck(self, stuck: bool, direction: int, *, again: bool = False) -> None:
        """Publish the stuck warning and the direction that led to it, if new or `again`."""
        if again or (stuck, direction) != self._stuck:
            self._stuck = stuck, direction
            self._direction_publisher.publish(Int8(data=direction))
            self._stuck_publisher.publish(Bool(data=stuck))

    def publish_diagnostics(self, stamp: int, statuses: Sequence[Status]) -> None:
        """Publish statuses on ``/diagnostics``; the stamp in ns."""
        self._diagnostics_publisher.publish(pack.diagnostic_array(stamp, statuses))


def time_message(stamp: int) -> Time:
    """Return a stamp [ns] as a message."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
