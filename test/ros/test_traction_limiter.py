# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The limiter passes, slows and stops commands, and is careful without estimates."""

import pytest

ESTIMATOR = '/wheel_terra_estimator'


def test_commands_follow_the_estimates(start, listener):
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Bool, UInt8MultiArray

    node, until = listener
    start('traction_limiter_node', '--ros-args', '-p', 'stale_after:=3', '-p', 'stale_scale:=0.25')
    heard = []
    node.create_subscription(TwistStamped, 'cmd_vel_out', heard.append, 10)
    commands = node.create_publisher(TwistStamped, 'cmd_vel_in', 10)
    slip = node.create_publisher(JointState, f'{ESTIMATOR}/slip', 10)
    classes = node.create_publisher(UInt8MultiArray, f'{ESTIMATOR}/slip_class', 10)
    mobility = node.create_publisher(JointState, f'{ESTIMATOR}/mobility', 10)
    stuck = node.create_publisher(Bool, f'{ESTIMATOR}/stuck', latched_profile())
    publishers = (commands, slip, classes, mobility, stuck)
    until(lambda: all(p.get_subscription_count() for p in publishers))
    command = TwistStamped()
    command.twist.linear.x, command.twist.angular.z = 0.1, -0.2
    command.header.stamp.sec = 7

    def shares(estimate, expected):
        """Send estimates and commands until a command comes out with the expected share."""

        def arrived():
            if estimate is not None:
                value, travel, trapped = estimate
                slip.publish(JointState(position=[value] * 4))
                classes.publish(UInt8MultiArray(data=[1] * 4))
                mobility.publish(JointState(position=[travel] * 4))
                stuck.publish(Bool(data=trapped))
            commands.publish(command)
            return heard and heard[-1].twist.linear.x == pytest.approx(0.1 * expected)

        until(arrived)
        assert heard[-1].twist.angular.z == pytest.approx(-0.2 * expected)
        assert heard[-1].header.stamp.sec == 7

    shares(None, 0.25)
    shares((0.1, 10.0, False), 1.0)
    shares((0.9, 10.0, False), 0.3)
    shares((0.1, 0.1, False), 0.0)
    shares((0.1, 10.0, False), 1.0)
    shares((0.1, 10.0, True), 0.0)
    shares(None, 0.25)  # the estimator fell silent


def latched_profile():
    from rclpy.qos import DurabilityPolicy, QoSProfile

    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
