# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Life cycle, services, live parameters, what is kept over a restart, and signals."""

import itertools
import json
import math
import os
import signal
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest
import ros_types as ros
from test_estimator_node import NODE, ROVER, hear, latched, wheel_message

from wheel_terra_estimator.configuration import reader

STALE = b'\x03'


@pytest.fixture
def call(listener):
    """Return a function that calls a service of the node and returns the answer."""
    node, until = listener
    kinds = {
        'change_state': ros.ChangeState,
        'get_state': ros.GetState,
        'reset': ros.Trigger,
        'save_soil': ros.Trigger,
        'set_enabled': ros.SetBool,
        'set_parameters': ros.SetParameters,
    }
    # The node hears of the clients in this order, and an answer to a client of which it has not
    # heard yet is lost; to get the state may be asked again.
    made = {
        name: node.create_client(kind, f'{NODE}/{name}')
        for name, kind in sorted(kinds.items(), key=lambda item: item[0] == 'get_state')
    }
    asked, turns = [], itertools.count()

    def hears_all():
        ready = all(client.service_is_ready() for client in made.values())
        if ready and next(turns) % 20 == 0:
            asked.append(made['get_state'].call_async(ros.GetState.Request()))
        return any(future.done() for future in asked)

    def answer(name, **request):
        if not asked:
            until(hears_all)
        future = made[name].call_async(kinds[name].Request(**request))
        until(future.done)
        return future.result()

    return answer


def test_life_cycle_services_and_live_parameters(start, parameters, listener, call, tmp_path, soon):
    names = reader.load(['pathfinder']).wheels.names
    node, until = listener
    soil = tmp_path / 'soil.yaml'
    options = ['-p', 'autostart:=false', '-p', f'soil_file:={soil}']
    process = start('estimator_node', *ROVER, parameters, *options, **soon)
    slip = hear(node, ros.JointState, f'{NODE}/slip')
    stuck = hear(node, ros.Bool, f'{NODE}/stuck', latched())
    said = hear(node, ros.DiagnosticArray, '/diagnostics')
    wheels = node.create_publisher(ros.JointState, 'joint_states', 10)
    sent = 0

    def change(transition):
        wanted = ros.Transition(id=transition)
        return call('change_state', transition=wanted).success

    def state():
        return call('get_state').current_state.label

    def drive(condition):
        def step():
            nonlocal sent
            wheels.publish(wheel_message(names, 100.0 + 0.05 * sent))
            sent += 1
            return condition()

        until(step)

    def rate_is_two():
        """Whether the last sets are half a second apart, by their own stamps."""
        stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in slip[-4:]]
        return min(b - a for a, b in pairwise(stamps)) > 0.45

    def set_parameter(name, value):
        kind = ros.ParameterValue(type=ros.ParameterType.PARAMETER_DOUBLE, double_value=value)
        wanted = [ros.Parameter(name=name, value=kind)]
        return call('set_parameters', parameters=wanted).results[0]

    assert state() == 'unconfigured'
    assert not call('reset').success
    for transition in (ros.Transition.TRANSITION_ACTIVATE, ros.Transition.TRANSITION_CLEANUP, 250):
        assert not change(transition)
    assert state() == 'unconfigured'
    refused = set_parameter('rover.mass', -5.0)
    assert not refused.successful and 'rover.mass' in refused.reason
    assert set_parameter('rover.mass', 120.0).successful
    assert change(ros.Transition.TRANSITION_CONFIGURE)
    until(lambda: wheels.get_subscription_count() and stuck)
    drive(lambda: said and said[-1].status[0].message.startswith('inactive'))
    assert all(s.level == STALE for s in said[-1].status)
    assert not slip, 'configured, not active: the filter goes on, nothing is published'
    assert change(ros.Transition.TRANSITION_ACTIVATE)
    # As a manager does that knows no autostart.
    assert not change(ros.Transition.TRANSITION_CONFIGURE)
    drive(lambda: len(slip) > 2)
    # The filter had gone on: stamps do not begin anew.
    assert slip[0].header.stamp.sec + 1e-9 * slip[0].header.stamp.nanosec > 100.0

    assert call('set_enabled', data=False).success
    drive(lambda: said[-1].status[0].message.startswith('disabled'))
    count = len(slip)
    drive(lambda: sent % 10 == 0)
    assert len(slip) == count
    assert call('set_enabled', data=True).success
    drive(lambda: len(slip) > count + 2)

    refused = set_parameter('rover.mass', 1.0)
    assert not refused.successful and 'read-only' in refused.reason
    refused = set_parameter('output_rate', -5.0)
    assert not refused.successful and 'output_rate' in refused.reason
    assert set_parameter('output_rate', 2.0).successful
    assert not rate_is_two()
    drive(rate_is_two)

    answer = call('save_soil')
    assert answer.success and answer.message == str(soil)
    again = reader.load([parameters, soil])
    assert again.soil.cohesion > 0.0 and 'soil.cohesion' in again.stated
    assert json.loads(soil.with_name('soil.yaml.state.json').read_text())['stuck'] is False

    assert call('set_enabled', data=False).success
    assert change(ros.Transition.TRANSITION_DEACTIVATE)
    assert change(ros.Transition.TRANSITION_CLEANUP)
    assert state() == 'unconfigured'
    until(lambda: not wheels.get_subscription_count())
    assert change(ros.Transition.TRANSITION_CONFIGURE)
    assert change(ros.Transition.TRANSITION_ACTIVATE)
    count = len(slip)
    drive(lambda: len(slip) > count + 2)
    status, words = process.stop(signal.SIGTERM)
    assert status == 0 and 'Traceback' not in words, words
    assert 'no transition 1 from active\n' in words


def test_what_is_stated_is_the_same_after_a_cleanup(listener, parameters):
    """Declaring a parameter states no value: of a default the estimator is less sure."""
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    estimator = EstimatorNode(context=listener[0].context, cli_args=[*ROVER, parameters])
    try:
        before = estimator._pipeline.configuration
        estimator.trigger_deactivate()
        estimator.trigger_cleanup()
        estimator._watch()  # the events executor still calls a timer that was due before
        estimator._watch_names()
        estimator.trigger_configure()
        after = estimator._pipeline.configuration
        assert after.stated == before.stated
        assert (after.soil_stated, after.soil_std) == (before.soil_stated, before.soil_std)
    finally:
        estimator.destroy_node()


def test_a_warning_and_the_soil_stand_over_a_restart(start, parameters, listener, call, tmp_path):
    from wheel_terra_estimator.configuration.soil_file import write_values

    node, until = listener
    soil = tmp_path / 'soil.yaml'
    write_values(soil, {'soil.cohesion': 432.1})
    state = tmp_path / 'soil.yaml.state.json'
    kept = {'stuck': True, 'reason': 'wheels dig in', 'stamp': math.inf, 'direction': -1}
    state.write_text(json.dumps(kept))
    stuck = hear(node, ros.Bool, f'{NODE}/stuck', latched())
    direction = hear(node, ros.Int8, f'{NODE}/stuck_direction', latched())
    said = hear(node, ros.DiagnosticArray, '/diagnostics')
    wheels = node.create_publisher(ros.JointState, 'joint_states', 10)
    process = start('estimator_node', *ROVER, parameters, '-p', f'soil_file:={soil}')
    until(lambda: stuck and direction and wheels.get_subscription_count())
    assert stuck[-1].data and direction[-1].data == -1
    names = reader.load(['pathfinder']).wheels.names
    sent = 0

    def told():
        nonlocal sent
        wheels.publish(wheel_message(names, 100.0 + 0.05 * sent, rate=0.0))
        sent += 1
        reasons = [
            value.value
            for message in said
            for value in message.status[-1].values
            if value.key == 'reason'
        ]
        return any('before a restart: wheels dig in' in reason for reason in reasons)

    until(told)
    assert said[-1].status[0].message.startswith('stuck: warned before a restart: wheels dig in')
    assert len(stuck) == 1, 'rest does not clear it'
    assert call('reset').success
    until(lambda: not stuck[-1].data and direction[-1].data == 0)
    assert not state.exists()
    until(lambda: told() and sent % 20 == 0)
    assert not call('save_soil').message.endswith('empty')
    written = reader.load([parameters, soil]).soil.cohesion
    assert written == pytest.approx(432.1, rel=0.2)
    status, words = process.stop(signal.SIGINT)
    assert status == 0 and 'Traceback' not in words, words
    (error,) = [line for line in words.splitlines() if '[ERROR]' in line]
    assert error.endswith('stuck before the restart: wheels dig in')


def catches_signals(process):
    """Whether the handlers of the process stand, by the kernel's account."""
    status = Path(f'/proc/{process.pid}/status').read_text()
    mask = int(next(x for x in status.splitlines() if x.startswith('SigCgt')).split()[1], 16)
    return bool(mask >> (signal.SIGTERM - 1) & 1)


@pytest.mark.skipif(not Path('/proc/self/status').exists(), reason='asks the kernel of Linux')
@pytest.mark.parametrize('delay', [0.0, 0.7])
def test_signals_end_it_while_it_starts_also_twice(start_interpreter, parameters, delay):
    processes = {
        signal.SIGINT: start_interpreter('estimator_node', *ROVER, parameters),
        signal.SIGTERM: start_interpreter('traction_limiter_node'),
    }
    for process in processes.values():
        while not catches_signals(process):
            time.sleep(0.01)
    time.sleep(delay)
    for number, process in processes.items():
        status, words = process.stop(number, number)
        assert status == 0 and 'Traceback' not in words, words


def test_signals_until_the_very_end_leave_its_status(start_interpreter, listener):
    """Ctrl-C of `ros2 launch` comes twice, the second one while the interpreter ends."""
    node, until = listener
    process = start_interpreter('traction_limiter_node')
    until(lambda: node.count_publishers('cmd_vel_out'))
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.002)
    status, words = process.stop()
    assert status == 0 and 'Traceback' not in words, words


def test_a_closing_that_hangs_is_cut_short(monkeypatch):
    from wheel_terra_estimator.ros import process

    assert process.LONGEST_END <= 1.0
    monkeypatch.setattr(process, 'LONGEST_END', 0.05)
    ended, status = threading.Event(), []
    monkeypatch.setattr(process.os, '_exit', lambda number: (status.append(number), ended.set()))
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        signals = process._Signals()
        signals.serving = True
        for number in before:
            os.kill(os.getpid(), number)
        assert signals.stopped, 'it is asked to end'
        assert ended.wait(60.0)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert status == [0]


def test_wrong_parameters_end_it_with_one_line(start, parameters, tmp_path):
    """Which are wrong is tested where they are read, in configuration."""
    path = tmp_path / 'broken.yaml'
    path.write_text('/**:\n  ros__parameters:\n    rover.mass: [1, "a"\n')
    wrong = {
        'rover.mass': (parameters, '-p', 'rover.mas:=20.0'),
        'broken.yaml': (str(path),),
        'missing.yaml': (str(tmp_path / 'missing.yaml'),),
    }
    started = {name: start('estimator_node', *ROVER, *given) for name, given in wrong.items()}
    for name, process in started.items():
        status, words = process.stop()
        assert status == 2 and name in words
        assert 'Traceback' not in words
        assert len(words.strip().splitlines()) <= 2, words


@pytest.mark.parametrize('home', [None, '/proc'])
def test_where_no_log_can_be_written_the_first_line_names_the_cure(start, monkeypatch, home):
    for name in ('HOME', 'ROS_HOME', 'ROS_LOG_DIR'):
        monkeypatch.delenv(name, raising=False)
    if home:
        monkeypatch.setenv('HOME', home)
    _, said = start('traction_limiter_node').stop()
    assert 'set ROS_LOG_DIR' in said.splitlines()[0]
