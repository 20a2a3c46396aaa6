# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Types of ROS by their names, imported where they are used: tests are collected without rclpy."""

import importlib

PLACES = {
    'diagnostic_msgs.msg': 'DiagnosticArray DiagnosticStatus',
    'geometry_msgs.msg': 'Twist TwistStamped TwistWithCovarianceStamped WrenchStamped',
    'lifecycle_msgs.msg': 'Transition',
    'lifecycle_msgs.srv': 'ChangeState GetState',
    'nav_msgs.msg': 'Odometry',
    'rcl_interfaces.msg': 'Parameter ParameterType ParameterValue',
    'rcl_interfaces.srv': 'GetParameters SetParameters',
    'rclpy.qos': 'DurabilityPolicy QoSProfile ReliabilityPolicy',
    'rosgraph_msgs.msg': 'Clock',
    'sensor_msgs.msg': 'Imu JointState',
    'std_msgs.msg': 'Bool Float64 Int64 Int8 UInt8MultiArray',
    'std_srvs.srv': 'SetBool Trigger',
    'visualization_msgs.msg': 'MarkerArray',
}


def __getattr__(name):
    for place, names in PLACES.items():
        if name in names.split():
            return getattr(importlib.import_module(place), name)
    raise AttributeError(name)
