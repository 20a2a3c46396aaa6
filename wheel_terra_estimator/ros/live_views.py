# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Outputs for looking at: a wrench per wheel, and markers for RViz; both off by default.

Nothing here is imported by a node that publishes neither.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, WrenchStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.messages.pack import BASE_FRAME
from wheel_terra_estimator.ros.outputs import make_publisher, time_message

MARKER_PERIOD = 200_000_000
"""Least time between two sets of markers [ns of stamps]: an eye sees no more."""
LIFETIME = 2  # lifetime of the markers, for a node that has ended [s]
ARROW_RADII = 3.0  # length of the arrow of a pull as great as the wheel's load, in wheel radii
SURFACE_THICKNESS = 0.004  # of the plate that shows the surface of the soil [m]
SURFACE_SHARE = 1.5  # of the wheel's diameter and width
ARROW_SHAFT, ARROW_HEAD = 0.08, 0.2  # diameters, in wheel radii
TEXT_SHARE = 0.5  # height of a letter, in wheel radii
TEXT_RADII = 1.8  # of the words above the hub

CLASS_COLOURS = {
    SlipClass.LOW: (0.10, 0.62, 0.25),
    SlipClass.MODERATE: (0.90, 0.80, 0.10),
    SlipClass.HIGH: (0.95, 0.50, 0.05),
    SlipClass.STUCK: (0.85, 0.10, 0.10),
    SlipClass.UNKNOWN: (0.55, 0.55, 0.55),
}
"""Red, green, blue of a wheel by its slip class."""
_SOIL_COLOUR = ColorRGBA(r=0.55, g=0.42, b=0.25, a=0.6)
_PULL_COLOUR = ColorRGBA(r=0.15, g=0.35, b=0.90, a=1.0)
_TEXT_COLOUR = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
_AXLE = math.sqrt(0.5)  # quaternion x and w that lay a cylinder's axis along y


def topic_names(names: Sequence[str]) -> list[str]:
    """Return a valid and unique name of a topic for each wheel."""
    found: list[str] = []
    for name in names:
        topic = re.sub(r'_+', '_', re.sub(r'[^A-Za-z0-9]', '_', name)).strip('_') or 'wheel'
        if topic[0].isdigit():
            topic = f'wheel_{topic}'
        while topic in found:
            topic += '_2'
        found.append(topic)
    return found


class LiveViews:
    """Publishes ``~/wrench/<wheel>`` and ``~/markers``, as far as they are enabled."""

    def __init__(self, node: Node, configuration: Configuration) -> None:
        self._node = node
        wheels = configuration.wheels
        self._wrenches: list[tuple[int, Publisher, WrenchStamped]] = []
        frames, topics = wheels.wrench_frame, topic_names(wheels.names)
        for i, (topic, frame) in enumerate(zip(topics, frames, strict=True)):
            if frame:
                message = WrenchStamped()
                message.header.frame_id = frame
                publisher = make_publisher(node, WrenchStamped, f'~/wrench/{topic}')
                self._wrenches.append((i, publisher, message))
        self._markers: Publisher | None = None
        if configuration.flat()['publish_markers']:
            self._markers = make_publisher(node, MarkerArray, '~/markers')
        columns = np.stack([wheels.x, wheels.y, wheels.z, wheels.radius, wheels.width])
        self._wheels = [
            _WheelMarkers(i, (x, y, z), *size)
            for i, (x, y, z, *size) in enumerate(columns.T.tolist())
        ]
        self._shown = -MARKER_PERIOD

    def destroy(self) -> None:
        """Take the topics away."""
        for _, publisher, _ in self._wrenches:
            self._node.destroy_publisher(publisher)
        if self._markers is not None:
            self._node.destroy_publisher(self._markers)

    def publish(self, estimates: EstimateSet) -> None:
        """Publish the topics that have subscribers."""
        stamp = time_message(estimates.stamp)
        for i, publisher, wrench in self._wrenches:
            if publisher.get_subscription_count():
                wrench.header.stamp = stamp
                wrench.wrench.force.x = float(estimates.drawbar_pull[i])
                wrench.wrench.force.z = float(estimates.normal_load[i])
                publisher.publish(wrench)
        if self._markers is None or not self._markers.get_subscription_count():
            return
        if 0 <= estimates.stamp - self._shown < MARKER_PERIOD:
            return
        self._shown = estimates.stamp
        message = MarkerArray()
        for i, wheel in enumerate(self._wheels):
            wheel.show(estimates, i)
            for marker in wheel.markers:
                marker.header.stamp = stamp
                message.markers.append(marker)
        self._markers.publish(message)


class _WheelMarkers:
    """Wheel, soil surface, pull and words of one wheel."""

    def __init__(
        self, index: int, hub: tuple[float, float, float], radius: float, width: float
    ) -> None:
        self._hub, self._radius = hub, radius
        self.wheel = _marker('slip', index, Marker.CYLINDER, hub)
        self.wheel.pose.orientation.x = self.wheel.pose.orientation.w = _AXLE
        self.wheel.scale.x = self.wheel.scale.y = 2.0 * radius
        self.wheel.scale.z = width
        self.soil = _marker('sinkage', index, Marker.CUBE, hub)
        self.soil.scale.x, self.soil.scale.y = 2.0 * SURFACE_SHARE * radius, SURFACE_SHARE * width
        self.soil.scale.z, self.soil.color = SURFACE_THICKNESS, _SOIL_COLOUR
        self.pull = _marker('pull', index, Marker.ARROW, (0.0, 0.0, 0.0))
        self.pull.scale.x, self.pull.scale.y = ARROW_SHAFT * radius, ARROW_HEAD * radius
        self.pull.color = _PULL_COLOUR
        self.words = _marker('words', index, Marker.TEXT_VIEW_FACING, hub)
        self.words.pose.position.z = hub[2] + TEXT_RADII * radius
        self.words.scale.z, self.words.color = TEXT_SHARE * radius, _TEXT_COLOUR
        self.markers = (self.wheel, self.soil, self.pull, self.words)

    def show(self, estimates: EstimateSet, i: int) -> None:
        """Take the estimates of wheel `i`."""
        x, y, z = self._hub
        red, green, blue = CLASS_COLOURS[SlipClass(int(estimates.slip_class[i]))]
        self.wheel.color = ColorRGBA(r=red, g=green, b=blue, a=0.8)
        sinkage = float(estimates.sinkage[i])
        self.soil.pose.position.z = z - self._radius + sinkage
        share = float(estimates.drawbar_pull[i]) / max(float(estimates.normal_load[i]), 1.0)
        tip = x + ARROW_RADII * self._radius * min(max(share, -1.0), 1.0)
        self.pull.points = [Point(x=x, y=y, z=z), Point(x=tip, y=y, z=z)]
        self.words.text = f'slip {float(estimates.slip[i]):.2f}\n{1000.0 * sinkage:.0f} mm'


def _marker(space: str, index: int, kind: int, position: tuple[float, float, float]) -> Marker:
    marker = Marker(ns=space, id=index, type=kind, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = BASE_FRAME
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = position
    marker.lifetime = Duration(sec=LIFETIME)
    return marker
