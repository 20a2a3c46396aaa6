# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Publishers of the estimator and the messages they send."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistWithCovarianceStamped
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Int8, MultiArrayDimension, UInt8MultiArray

from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages.cdr import JointStatePacker, TwistPacker
from wheel_terra_estimator.messages.convert import (
    BASE_FRAME,
    JOINT_OUTPUTS,
    joint_fields,
    planar_velocity,
    twist_covariance,
)
from wheel_terra_estimator.messages.diagnostics import Status
from wheel_terra_estimator.ros.qos import OVERRIDABLE, output_profile

# rclpy looks at every event handler whenever anything happens, which costs more than a message.
# A subscriber whose quality of service does not fit is told so by its own node.
NO_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)


class EstimatePublisher:
    """Publishes estimate sets on the private topics of a node, and its diagnostics."""

    def __init__(self, node: Node, names: tuple[str, ...]) -> None:
        self._node = node
        self._names = names
        self._stuck: tuple[bool, int] | None = None

        def publisher(kind: type, topic: str, latched: bool = False):  # type: ignore[no-untyped-def]
            return node.create_publisher(
                kind,
                topic,
                output_profile(latched),
                event_callbacks=NO_EVENTS,
                qos_overriding_options=OVERRIDABLE,
            )

        self._joint_publishers = {t: publisher(JointState, f'~/{t}') for t in JOINT_OUTPUTS}
        self._class_publisher = publisher(UInt8MultiArray, '~/slip_class')
        self._twist_publisher = publisher(TwistWithCovarianceStamped, '~/twist')
        self._stuck_publisher = publisher(Bool, '~/stuck', latched=True)
        self._direction_publisher = publisher(Int8, '~/stuck_direction', latched=True)
        self._diagnostics_publisher = publisher(DiagnosticArray, '/diagnostics')
        # Bytes, as a recording has them: rclpy would check and convert every field.
        self._joint_states = JointStatePacker(BASE_FRAME)
        self._twists = TwistPacker(BASE_FRAME)
        self._classes = UInt8MultiArray()
        size = len(names)
        self._classes.layout.dim = [MultiArrayDimension(label='wheel', size=size, stride=size)]

    def destroy(self) -> None:
        """Take the topics away."""
        for publisher in (
            *self._joint_publishers.values(),
            self._class_publisher,
            self._twist_publisher,
            self._stuck_publisher,
            self._direction_publisher,
            self._diagnostics_publisher,
        ):
            self._node.destroy_publisher(publisher)

    def publish(self, estimates: EstimateSet) -> None:
        """Publish the messages of a set that somebody listens to."""
        stamp = estimates.stamp
        wanted = {t for t, p in self._joint_publishers.items() if p.get_subscription_count()}
        classes_wanted = self._class_publisher.get_subscription_count() > 0
        fields_of = joint_fields(estimates, self._names) if wanted else {}
        if classes_wanted and 'slip' not in wanted:
            self._publish_classes(estimates)
        for topic, fields in fields_of.items():
            if topic not in wanted:
                continue
            data = self._joint_states.packed(stamp, *fields)
            self._joint_publishers[topic].publish(data)
            if topic == 'slip' and classes_wanted:
                self._publish_classes(estimates)
        if self._twist_publisher.get_subscription_count():
            data = self._twists.packed(
                stamp,
                planar_velocity(estimates),
                estimates.yaw_rate,
                twist_covariance(estimates),
            )
            self._twist_publisher.publish(data)
        self.publish_stuck(estimates.stuck, estimates.stuck_direction)

    def _publish_classes(self, estimates: EstimateSet) -> None:
        self._classes.data = array('B', estimates.slip_class.tolist())
        self._class_publisher.publish(self._classes)

    def publish_stuck(self, stuck: bool, direction: int, *, again: bool = False) -> None:
        """Publish the stuck warning and the direction that led to it, if new or `again`."""
        if again or (stuck, direction) != self._stuck:
            self._stuck = stuck, direction
            self._direction_publisher.publish(Int8(data=direction))
            self._stuck_publisher.publish(Bool(data=stuck))

    def publish_diagnostics(self, stamp: Time, statuses: Sequence[Status]) -> None:
        """Publish statuses on ``/diagnostics``."""
        message = DiagnosticArray()
        message.header.stamp = stamp
        message.header.frame_id = BASE_FRAME
        message.status = [
            DiagnosticStatus(
                level=bytes([status.level]),
                name=status.name,
                message=status.message,
                hardware_id=status.hardware_id,
                values=[KeyValue(key=key, value=value) for key, value in status.values],
            )
            for status in statuses
        ]
        self._diagnostics_publisher.publish(message)


def time_message(stamp: int) -> Time:
    """Return a stamp [ns] as a message."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
