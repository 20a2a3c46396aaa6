# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wiring of the limiter over DDS; what passes is tested in estimation/test_limiter_cases."""

import json
import re
import signal
import time
from pathlib import Path

import pytest
import ros_types as ros
from test_estimator_node import ROVER, wheel_message

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.errors import UserError

STUCK = 'wheel_terra_estimator/stuck'


class Operator:
    """Commands, and wheel odometry of the present time, as long as a condition does not hold."""

    def __init__(self, listener, names=()):
        self.node, self.until = listener
        self.names = names
        self.out = []
        self.node.create_subscription(ros.TwistStamped, 'cmd_vel_out', self.out.append, 10)
        self.commands = self.node.create_publisher(ros.TwistStamped, 'cmd_vel_in', 10)
        self.wheels = self.node.create_publisher(ros.JointState, 'joint_states', 10)
        self.command = ros.TwistStamped()
        self.command.header.stamp.sec = 7
        self._sent = 0.0

    def drive(self, condition, forward=0.0, turn=0.0, rate=1.0):
        self.command.twist.linear.x, self.command.twist.angular.z = forward, turn

        def step():
            if time.monotonic() - self._sent > 0.02:  # fifty a second are enough
                self._sent = time.monotonic()
                if self.names:
                    self.wheels.publish(wheel_message(self.names, time.time(), rate))
                self.commands.publish(self.command)
            return condition()

        self.until(step)

    def comes_to(self, share, forward=0.0, turn=0.0, **more):
        expected = pytest.approx([share * forward, share * turn], abs=1e-6)
        del self.out[:]
        self.drive(lambda: self.out and self._last() == expected, forward, turn, **more)
        assert self.out[-1].header.stamp.sec == 7

    def _last(self):
        return [self.out[-1].twist.linear.x, self.out[-1].twist.angular.z]

    def call(self, service):
        client = self.node.create_client(ros.Trigger, service)
        self.until(client.service_is_ready)
        future = client.call_async(ros.Trigger.Request())
        self.until(future.done)
        return future.result()


def test_estimator_and_limiter_restarted_while_stuck_release_and_reset(
    start, parameters, listener, tmp_path
):
    soil = tmp_path / 'soil.yaml'
    kept = {'stuck': True, 'reason': 'digs in', 'stamp': time.time_ns(), 'direction': 1}
    soil.with_name('soil.yaml.state.json').write_text(json.dumps(kept))
    limiter = start('traction_limiter_node', '--ros-args', '-p', 'stale_scale:=0.25')
    operator = Operator(listener, reader.load(['pathfinder']).wheels.names)
    said = []
    operator.node.create_subscription(ros.DiagnosticArray, '/diagnostics', said.append, 10)
    operator.comes_to(0.25, 0.1)
    estimator = [
        *ROVER,
        parameters,
        '-p',
        f'soil_file:={soil}',
        '-p',
        'filter.stuck_clear_time:=99',
        '-p',
        'filter.class_std:=0.4',  # slip without a reference is known so well at once
    ]
    start('estimator_node', *estimator)
    operator.comes_to(0.0, 0.1, rate=0.0)
    operator.comes_to(0.3, -0.1, rate=0.0)
    operator.comes_to(0.3, turn=0.1, rate=0.0)
    limiter.stop(signal.SIGTERM)  # DDS finds who follows a killed node 3 s later only
    released_for = {'wheel_terra_estimator.control.traction_limiter:RELEASE_TIME': 2.0}
    start('traction_limiter_node', constants=released_for)
    operator.comes_to(0.3, -0.1, rate=0.0)
    operator.comes_to(0.0, 0.1, rate=0.0)
    released = operator.call('traction_limiter/release')
    assert released.success and released.message.startswith('still stuck')
    operator.comes_to(0.3, 0.1, rate=0.0)
    assert operator.call('wheel_terra_estimator/reset').success
    operator.comes_to(1.0, 0.05)
    states = {'no estimate', 'stuck', 'backing out', 'released', 'command passes'}

    def told():
        own = (s for m in said for s in m.status if s.name == 'traction_limiter: limiter')
        return states <= {v.value for status in own for v in status.values if v.key == 'state'}

    operator.until(told)


def test_a_stop_by_its_topics_outlives_the_limiter(start, listener, tmp_path):
    operator = Operator(listener)
    scales = []
    operator.node.create_subscription(ros.Float64, 'traction_limiter/scale', scales.append, 10)
    slip, mobility = (
        operator.node.create_publisher(ros.JointState, f'wheel_terra_estimator/{name}', 10)
        for name in ('slip', 'mobility')
    )
    classes = operator.node.create_publisher(
        ros.UInt8MultiArray, 'wheel_terra_estimator/slip_class', 10
    )

    def comes_to(share, forward, travel=10.0, age=0.0, **more):
        def published():
            stamped = wheel_message(['a', 'b'], time.time() - age)
            values = ros.JointState(header=stamped.header, name=['a', 'b'])
            values.position, values.velocity = [0.2, 0.2], [0.02, 0.02]
            slip.publish(values)
            classes.publish(ros.UInt8MultiArray(data=[0, 0]))
            values.position, values.velocity = [travel, travel], []
            mobility.publish(values)
            return scales and scales[-1].data == pytest.approx(share)

        del scales[:]
        operator.drive(published, forward)

    keeps = ['--ros-args', '-p', f'state_file:={tmp_path / "limiter.json"}']
    limiter = start('traction_limiter_node', *keeps)
    comes_to(1.0, 0.1)
    comes_to(0.3, 0.1, age=2.0)
    comes_to(0.0, 0.1, travel=0.2)
    comes_to(0.3, -0.1, travel=0.2)
    limiter.stop(signal.SIGKILL)
    limiter = start('traction_limiter_node', *keeps)
    comes_to(0.3, -0.1)
    comes_to(0.0, 0.1)
    assert operator.call('traction_limiter/release').message.startswith('released')
    comes_to(0.3, 0.1)
    status, words = limiter.stop(signal.SIGTERM)
    assert status == 0 and 'Traceback' not in words, words


def test_a_file_of_another_node_does_not_tune_it_without_a_word(executor, tmp_path, capfd):
    from wheel_terra_estimator.ros.limiter_node import TractionLimiter

    path = tmp_path / 'limiter.yaml'
    path.write_text('traction_limitr:\n  ros__parameters:\n    creep_scale: 0.1\n')
    node = TractionLimiter(context=executor.context, cli_args=[*ROVER, str(path)])
    assert node.get_parameter('creep_scale').value == 0.3
    node.destroy_node()
    words = f"{path}: sections there: 'traction_limitr:'; none applies to node /traction_limiter"
    assert words in capfd.readouterr().err


def test_a_stop_waits_for_no_disk(listener, tmp_path, monkeypatch):
    """The state is kept with a sync of the disk."""
    from rclpy.parameter import Parameter

    from wheel_terra_estimator.configuration import soil_file
    from wheel_terra_estimator.control.traction_limiter import Event, after_event
    from wheel_terra_estimator.ros.limiter_node import TractionLimiter

    sent, kept = [], []
    where = Parameter('state_file', value=str(tmp_path / 'limiter.json'))
    node = TractionLimiter(context=listener[0].context, parameter_overrides=[where])
    monkeypatch.setattr(node._output, 'publish', lambda m: sent.append(m.twist.linear.x))
    monkeypatch.setattr(
        soil_file, 'write_state', lambda path, state: kept.append((state.stuck, sent[-1]))
    )
    command = ros.TwistStamped()
    for _ in range(20):
        command.twist.linear.x = 0.1
        node._on_command(command)
        time.sleep(0.01)
    assert sent[-1] > 0.0
    node._follow(after_event(node._state, Event.STOP, 1, 'stop'))
    assert kept == [(True, 0.0)]
    node.destroy_node()


def test_publishers_that_bypass_it_or_are_not_heard_are_told_in_diagnostics_and_log(
    start, listener, soon
):
    """Of a limiter of plain Twist."""
    node, until = listener
    said = []
    node.create_subscription(
        ros.DiagnosticArray, '/diagnostics', lambda m: said.append(m.status[0]), 10
    )
    wiring = ['cmd_vel_in:=/cmd_vel_checked', 'cmd_vel_out:=/cmd_vel', f'{STUCK}:=/est/stuck']
    arguments = ['--ros-args', '-p', 'stamped:=false', *(w for r in wiring for w in ('-r', r))]
    process = start('traction_limiter_node', *arguments, **soon)
    until(lambda: said)
    assert said[-1].level == b'\x00', said[-1].message
    best_effort = ros.QoSProfile(depth=1, reliability=ros.ReliabilityPolicy.BEST_EFFORT)
    checked = '/cmd_vel_checked'

    def told(*faults):
        words = said[-1].message
        return said[-1].level == b'\x01' and all(fault in words for fault in faults)

    other_type = f'{checked}: geometry_msgs/msg/TwistStamped is published there'
    other = node.create_publisher(ros.TwistStamped, checked, 1)
    until(lambda: told(other_type))
    node.destroy_publisher(other)  # a participant has one type on a topic
    until(lambda: said[-1].level == b'\x00')
    for kind, topic, quality in (
        (ros.Twist, checked, best_effort),
        (ros.Twist, '/cmd_vel', 1),
        (ros.Bool, '/est/stuck', 1),
        (ros.Bool, '/est/stuck', 1),
    ):
        node.create_publisher(kind, topic, quality)
    faults = (
        f'{checked}: nothing comes from /listener: best effort publisher',
        '/cmd_vel: /listener publishes too',
        '2 publishers of ~/stuck',
    )
    until(lambda: told(*faults))
    passed, command = [], ros.Twist()
    node.create_subscription(ros.Twist, '/cmd_vel', passed.append, 10)
    commands = node.create_publisher(ros.Twist, checked, 10)
    command.linear.x, a_part = 0.1, pytest.approx(0.03)
    until(lambda: (commands.publish(command), passed and passed[-1].linear.x == a_part)[1])
    status, log = process.stop(signal.SIGTERM)
    assert status == 0, log
    assert [log.count(fault) for fault in (other_type, *faults)] == [1, 1, 1, 1], log


@pytest.mark.parametrize(
    ('parameter', 'said'),
    [
        ('state_file:={rover}', 'remove it'),
        ('state_file:={rover}.state.json', 'give the limiter another one'),
        ('critical_slip:=0.1', 'must be below'),
        ('creep_scale:=.nan', 'parameters: creep_scale: nan is not finite; allowed: number (at le'),
        ('critical_slip:=high', "parameters: critical_slip: 'high' is not a number; allowed: "),
        ('stamped:=7', 'parameters: stamped: 7 is not true or false'),
        ('creep:=0.5', "'creep_scale'"),
    ],
)
def test_what_cannot_be_used_is_refused_at_the_start(listener, parameters, parameter, said):
    """With an error of which `run_node` makes one line and an exit status."""
    from wheel_terra_estimator.ros.limiter_node import TractionLimiter

    before = Path(parameters).read_text()
    arguments = ['--ros-args', '-p', parameter.format(rover=parameters)]
    with pytest.raises(UserError, match=re.escape(said)):
        TractionLimiter(context=listener[0].context, cli_args=arguments)
    assert Path(parameters).read_text() == before
