# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Start the estimator node.

``ros2 launch wheel_terra_estimator estimator.launch.py params_file:=generic_six_wheel``
"""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from wheel_terra_estimator.configuration import shipped

ARGUMENTS = {
    'params_file': (
        'generic_six_wheel',
        'parameter files, separated by commas, later ones win: paths, or names of shipped files',
    ),
    'namespace': ('', 'namespace of the node and its topics'),
    'use_sim_time': ('', 'true: take the time from /clock'),
    'log_level': ('info', 'debug, info, warn, error, fatal'),
    'soil_file': ('', 'file that keeps what was learned over a restart'),
    'autostart': ('', 'false: a life cycle manager configures and activates the node'),
    'record_arrival': ('', 'file that logs the order in which inputs arrive'),
}

TRUE = ('true', '1', 'yes', 'on')


def start(context):
    """Make the node, once the arguments are known."""
    values = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    files = [str(shipped.find(name.strip())) for name in values['params_file'].split(',')]
    # What is not given is left to the files.
    own = {n: values[n].lower() in TRUE for n in ('use_sim_time', 'autostart') if values[n]}
    own |= {name: values[name] for name in ('soil_file', 'record_arrival') if values[name]}
    return [
        Node(
            package='wheel_terra_estimator',
            executable='estimator_node',
            name='wheel_terra_estimator',
            namespace=values['namespace'],
            parameters=[*files, *([own] if own else [])],
            arguments=['--ros-args', '--log-level', values['log_level']],
            output='screen',
        )
    ]


def generate_launch_description():
    """Declare the arguments and start the node."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
