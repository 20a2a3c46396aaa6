# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Play a recording to the live node with its own clock, and record what the node says.

``ros2 launch wheel_terra_estimator replay.launch.py bag:=DRIVE params_file:=frostyboy``

Needs ros2bag. Without ROS, and faster than the clock: ``wheel-terra replay``.
"""

from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchDescription
from wheel_terra_estimator.messages.convert import INPUT_TYPES

ARGUMENTS = {
    'bag': (None, 'recording to play'),
    'params_file': ('generic_six_wheel', 'as for estimator.launch.py'),
    'rate': ('1.0', 'speed of the playback'),
    'remap': ('', "FROM:=TO of the playback, separated by blanks (the bag's topic first)"),
    'output': ('', 'folder for a bag of the estimates; empty: none'),
}

DELAY = '4.0'  # [s] until the node listens


def played(remaps):
    """Return the bag's topics that are inputs: outputs and commands of the drive stay silent."""
    heard_as = {topic: topic for topic in INPUT_TYPES}
    for remap in remaps:
        source, _, topic = remap.partition(':=')
        heard_as[source.lstrip('/')] = topic.lstrip('/')
    return [f'/{source}' for source, topic in heard_as.items() if topic in INPUT_TYPES]


def start(context):
    """Make the processes, once the arguments are known."""
    values = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    play = ['ros2', 'bag', 'play', values['bag'], '--clock', '100', '--rate', values['rate']]
    play += ['--delay', DELAY, '--topics', *played(values['remap'].split())]
    if values['remap']:
        play += ['--remap', *values['remap'].split()]
    player = ExecuteProcess(cmd=play, output='screen')
    node = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(Path(__file__).with_name('estimator.launch.py'))),
        launch_arguments={
            'params_file': values['params_file'],
            'use_sim_time': 'true',
            'autostart': 'true',
        }.items(),
    )
    actions = [
        node,
        player,
        RegisterEventHandler(OnProcessExit(target_action=player, on_exit=[Shutdown()])),
    ]
    if values['output']:
        record = ['ros2', 'bag', 'record', '-s', 'mcap', '-o', values['output'], '--regex']
        record.append('/wheel_terra_estimator/.*|/diagnostics')
        actions.insert(0, ExecuteProcess(cmd=record, output='screen'))
    return actions


def generate_launch_description():
    """Declare the arguments and start the processes."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
