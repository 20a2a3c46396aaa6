# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The live tutorials do what they say: their own commands, one estimator and one limiter."""

import re
import shlex
from pathlib import Path

import pytest
import ros_types as ros
import yaml
from test_estimator_node import NODE, latched, wheel_message

from wheel_terra_estimator.configuration import reader

TUTORIALS = Path(__file__).resolve().parents[2] / 'docs' / 'tutorials'
BASH = re.compile(r'^```bash\n(.*?)^```', re.M | re.S)
TYPES = {
    'slip': 'JointState',
    'mobility': 'JointState',
    'slip_class': 'UInt8MultiArray',
    'stuck': 'Bool',
}
STEP = 0.05  # [s] between two messages of the wheels


def commands(page):
    """Return the commands of the bash blocks of a tutorial, continued lines joined."""
    text = (TUTORIALS / f'{page}.md').read_text(encoding='utf-8')
    lines = ''.join(BASH.findall(text)).replace('\\\n', ' ').splitlines()
    return [shlex.split(line) for line in lines]


def runs(page):
    """Return executable -> arguments of the `ros2 run` lines of a tutorial."""
    return {words[3]: words[4:] for words in commands(page) if words[:2] == ['ros2', 'run']}


def named_in_table(page, below):
    """Return (topic, field) of the table below a heading."""
    text = (TUTORIALS / f'{page}.md').read_text(encoding='utf-8').partition(below)[2]
    return re.findall(r'^\| `~/(\w+)` \| `(\w+)` \|', text, re.M)


def test_the_live_tutorials_in_one_drive(start, parameters, listener):
    """Drive on firm ground; every topic of the controller's table comes, the command passes."""
    wheels_of = reader.load(['pathfinder']).wheels
    found = runs('node')
    assert set(found) == {'estimator_node', 'traction_limiter_node'}
    for executable, arguments in found.items():
        start(executable, *(parameters if a == 'my_rover.yaml' else a for a in arguments))

    node, until = listener
    table = named_in_table('node', '## Feeding a controller')
    assert {topic for topic, _ in table} == set(TYPES)
    heard = {topic: [] for topic in (*TYPES, 'twist', 'command')}
    for topic, name in TYPES.items():
        profile, kind = latched() if topic == 'stuck' else 10, getattr(ros, name)
        node.create_subscription(kind, f'{NODE}/{topic}', heard[topic].append, profile)
    text = (TUTORIALS / 'nav2.md').read_text(encoding='utf-8')
    block = yaml.safe_load(re.search(r'^```yaml\n(.*?)^```', text, re.M | re.S)[1])
    twist = block['ekf_filter_node']['ros__parameters']['twist0']
    node.create_subscription(ros.TwistWithCovarianceStamped, twist, heard['twist'].append, 10)
    node.create_subscription(ros.TwistStamped, '/cmd_vel', heard['command'].append, 10)
    wheels = node.create_publisher(ros.JointState, 'joint_states', 10)
    # The command remaps the reference; a remap that failed would leave this without a listener.
    reference = node.create_publisher(ros.Odometry, '/visual_odometry', 10)
    wanted = node.create_publisher(ros.TwistStamped, '/cmd_vel_raw', 10)
    until(
        lambda: (
            all(p.get_subscription_count() for p in (wheels, reference, wanted))
            and all(node.count_publishers(f'{NODE}/{topic}') for topic in TYPES)
        )
    )

    names, rate, clock = wheels_of.names, 1.0, 100.0
    speed = rate * float(wheels_of.slip_radius[0])
    command = ros.TwistStamped()
    command.twist.linear.x = speed

    def passes():
        nonlocal clock
        clock += STEP
        message = wheel_message(names, clock, rate)
        odometry = ros.Odometry(header=message.header)
        odometry.twist.twist.linear.x, odometry.twist.covariance[0] = speed, 1e-4
        wheels.publish(message)
        reference.publish(odometry)
        wanted.publish(command)
        return all(heard.values()) and heard['command'][-1].twist.linear.x == pytest.approx(speed)

    until(passes)
    for topic, field in table:
        value = getattr(heard[topic][-1], field)
        assert value is False if topic == 'stuck' else len(value) == len(names)
    assert list(heard['slip'][-1].name) == list(names)
    assert max(abs(slip) for slip in heard['slip'][-1].position) < 0.2
    last = heard['twist'][-1].twist
    flags = block['ekf_filter_node']['ros__parameters']['twist0_config']
    assert len(flags) == 15 and not any(flags[:6] + flags[12:])
    for axis, fused in enumerate(flags[6:12]):
        assert (last.covariance[7 * axis] < 1e6) == fused, 'what is not estimated is not fused'
    assert last.twist.linear.x == pytest.approx(speed, rel=0.2)


def test_launch_line_of_the_tutorial_names_files_and_arguments_that_are_there():
    (line,) = [words for words in commands('node') if words[:2] == ['ros2', 'launch']]
    launch = Path(__file__).resolve().parents[2] / 'launch' / line[3]
    declared = launch.read_text(encoding='utf-8')
    for argument in line[4:]:
        name, _, value = argument.partition(':=')
        assert f"'{name}': (" in declared
        assert reader.load(value.split(',')).wheels.names


def test_nav2_page_puts_the_limiter_between_the_collision_monitor_and_the_base():
    """Else nav2 of Jazzy sends its commands past it."""
    text = (TUTORIALS / 'nav2.md').read_text(encoding='utf-8')
    _, nav2 = re.findall(r'^```yaml\n(.*?)^```', text, re.M | re.S)
    monitor = yaml.safe_load(nav2)['collision_monitor']['ros__parameters']
    assert '`stamped:=false`' in text
    remaps = dict(re.findall(r'`(\w+):=(/\w+)`', text))
    before = f'/{monitor["cmd_vel_out_topic"]}'
    assert remaps == {'cmd_vel_in': before, 'cmd_vel_out': '/cmd_vel'}
    (line,) = [w for w in commands('node') if 'traction_limiter_node' in w]
    assert {w.partition(':=')[0] for w in line if ':=' in w} == set(remaps)
