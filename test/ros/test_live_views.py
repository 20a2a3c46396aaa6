# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wrenches and markers: as asked for, with the numbers of the estimates."""

from types import SimpleNamespace

import numpy as np
import pytest
import ros_types as ros
from test_estimator_node import NODE, wheel_message

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.estimates import SlipClass

STEP = 0.1  # [s] between two messages


def test_wrenches_and_markers_hold_the_estimates(start, listener, tmp_path):
    rover = reader.load(['pathfinder'])
    names = rover.wheels.names
    path = tmp_path / 'rover.yaml'
    rover.replace(
        {
            'wheels.wrench_frame': ['', *(f'{name}_hub' for name in names[1:])],
            'publish_markers': True,
        }
    ).write(path)
    node, until = listener
    heard = {'slip': [], 'sinkage': [], 'wrench': [], 'markers': []}
    subscribe = node.create_subscription
    subscribe(ros.JointState, f'{NODE}/slip', heard['slip'].append, 10)
    subscribe(ros.JointState, f'{NODE}/sinkage', heard['sinkage'].append, 10)
    subscribe(ros.WrenchStamped, f'{NODE}/wrench/{names[1]}', heard['wrench'].append, 10)
    subscribe(ros.MarkerArray, f'{NODE}/markers', heard['markers'].append, 10)
    publisher = node.create_publisher(ros.JointState, 'joint_states', 10)
    start('estimator_node', '--ros-args', '--params-file', str(path))
    until(publisher.get_subscription_count)
    sent = 0

    def send():
        nonlocal sent
        publisher.publish(wheel_message(names, 100.0 + STEP * sent))
        sent += 1
        return all(heard.values())

    until(send)
    topics = {name for name, _ in node.get_topic_names_and_types()}
    assert f'{NODE}/wrench/{names[0]}' not in topics, 'its frame is empty'
    assert {f'{NODE}/wrench/{name}' for name in names[1:]} <= topics
    wrench = heard['wrench'][0]
    assert wrench.header.frame_id == f'{names[1]}_hub'

    def of(topic, stamp):
        return next((m for m in heard[topic] if m.header.stamp == stamp), None)

    until(lambda: of('slip', wrench.header.stamp) and of('sinkage', wrench.header.stamp))
    assert wrench.wrench.force.x == of('slip', wrench.header.stamp).effort[1]
    assert wrench.wrench.force.z == of('sinkage', wrench.header.stamp).effort[1] > 0.0
    markers = heard['markers'][0].markers
    assert len({(m.ns, m.id) for m in markers}) == len(markers) == 4 * len(names)
    assert {m.header.frame_id for m in markers} == {'base_link'}


@pytest.mark.parametrize(
    ('names', 'topics'),
    [
        (['front_left_wheel', 'rear'], ['front_left_wheel', 'rear']),
        (['wheel-1', 'rear left', '2nd', 'räder'], ['wheel_1', 'rear_left', 'wheel_2nd', 'r_der']),
        (['a.b', 'a b', '/'], ['a_b', 'a_b_2', 'wheel']),
    ],
)
def test_topics_of_odd_names_are_valid_and_apart(names, topics):
    from rclpy.validate_topic_name import validate_topic_name

    from wheel_terra_estimator.ros.live_views import topic_names

    assert topic_names(names) == topics
    assert all(validate_topic_name(f'~/wrench/{topic}') for topic in topic_names(names))


def test_markers_show_class_depth_and_pull():
    from wheel_terra_estimator.ros.live_views import ARROW_RADII, CLASS_COLOURS, _WheelMarkers

    radius, hub = 0.2, (0.4, -0.3, 0.05)
    wheel = _WheelMarkers(1, hub, radius, 0.1)

    def estimates(slip_class, pull):
        return SimpleNamespace(
            slip=np.array([0.0, 0.42]),
            slip_class=np.array([0, slip_class], dtype=np.uint8),
            sinkage=np.array([0.0, 0.03]),
            drawbar_pull=np.array([0.0, pull]),
            normal_load=np.array([100.0, 80.0]),
        )

    wheel.show(estimates(SlipClass.STUCK, -20.0), 1)
    colour = wheel.wheel.color
    assert (colour.r, colour.g, colour.b) == pytest.approx(CLASS_COLOURS[SlipClass.STUCK])
    # The rim's lowest point lies 30 mm below the surface that is shown.
    assert wheel.soil.pose.position.z - (hub[2] - radius) == pytest.approx(0.03)
    root, tip = wheel.pull.points
    assert (root.x, root.y, root.z) == hub
    assert tip.x - root.x == pytest.approx(-0.25 * ARROW_RADII * radius), 'braking points back'
    assert wheel.words.text == 'slip 0.42\n30 mm'
    wheel.show(estimates(SlipClass.UNKNOWN, 500.0), 1)
    assert wheel.pull.points[1].x - hub[0] == pytest.approx(ARROW_RADII * radius), 'as the load'
    assert len({tuple(c) for c in CLASS_COLOURS.values()}) == len(SlipClass)
