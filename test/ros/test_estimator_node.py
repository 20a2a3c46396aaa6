# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node as other nodes see it."""

import re
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import ros_types as ros

from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.messages.pack import JOINT_OUTPUTS
from wheel_terra_estimator.ros import process

ROVER = ['--ros-args', '--params-file']
NODE = '/wheel_terra_estimator'


def latched():
    return ros.QoSProfile(
        depth=1,
        reliability=ros.ReliabilityPolicy.RELIABLE,
        durability=ros.DurabilityPolicy.TRANSIENT_LOCAL,
    )


def wheel_message(names, seconds, rate=1.0):
    message = ros.JointState(name=list(names), velocity=[rate] * len(names))
    message.header.stamp.sec = int(seconds)
    message.header.stamp.nanosec = round((seconds % 1.0) * 1e9)
    return message


def hear(node, kind, topic, profile=10):
    heard = []
    node.create_subscription(kind, topic, heard.append, profile)
    return heard


def test_tools_are_told_the_range_of_each_bounded_parameter():
    from wheel_terra_estimator.configuration.parameters import declared
    from wheel_terra_estimator.ros.parameters import descriptor

    told = {key: descriptor(parameter) for key, parameter in declared().items()}
    ranges = {
        key: [(r.from_value, r.to_value) for r in (*d.floating_point_range, *d.integer_range)]
        for key, d in told.items()
    }
    assert sum(map(bool, ranges.values())) > 5
    for key, parameter in declared().items():
        bounds = (parameter.lower, parameter.at_most)
        assert ranges[key] in ([], [bounds]), key
        if not np.isfinite(bounds).all():
            assert ranges[key] == []


@pytest.mark.parametrize(
    ('policy', 'good', 'bad'), [('reliability', 'reliable', 'reliabel'), ('depth', 7, '7')]
)
def test_a_quality_of_service_that_cannot_be_is_named(policy, good, bad):
    from wheel_terra_estimator.errors import UserError
    from wheel_terra_estimator.ros.qos import check_overrides

    def node(value):
        return SimpleNamespace(
            get_parameters_by_prefix=lambda prefix: [f'/joint_states.subscription.{policy}'],
            get_parameter=lambda name: SimpleNamespace(value=value),
        )

    check_overrides(node(good))
    with pytest.raises(UserError, match=rf'subscription\.{policy}: {bad!r}; allowed: '):
        check_overrides(node(bad))


def test_an_empty_list_is_refused_by_its_name(executor):
    from wheel_terra_estimator.errors import UserError
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    arguments = [*ROVER[:1], '-p', 'sensors.imu_position:=[]']
    with pytest.raises(UserError, match=r'sensors\.imu_position is an empty list'):
        EstimatorNode(context=executor.context, cli_args=arguments)


def test_a_failure_while_it_is_configured_is_logged():
    """By a lifecycle manager it is told nothing but that it failed."""
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    def fails():
        raise ZeroDivisionError('of no weight')

    log = Mock()
    node = SimpleNamespace(_pipeline=None, _configure=fails, get_logger=lambda: log)
    with pytest.raises(ZeroDivisionError):
        EstimatorNode.on_configure(node, None)
    assert 'ZeroDivisionError: of no weight' in log.error.call_args.args[0]


def test_a_silence_is_put_down_to_what_is_refused_in_it():
    from wheel_terra_estimator.messages.pipeline import Pipeline
    from wheel_terra_estimator.ros.input_watch import InputWatch
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    pipeline = Pipeline(reader.load(['pathfinder']))
    pipeline.refuse('imu/data', 'damaged')
    node = SimpleNamespace(
        _pipeline=pipeline,
        _rejected=pipeline.rejected,  # an hour ago, while estimates flowed
        _latest=None,
        _started=0.0,
        _set_at=0.0,
        _watch_inputs=InputWatch(),
        _publishers_in_words=lambda topic: 'no publishers',
        resolve_topic_name=lambda topic: f'/{topic}',
    )
    assert 'rejected' not in EstimatorNode._silence_in_words(node, 10.0)
    pipeline.refuse('joint_states', 'damaged')
    words = EstimatorNode._silence_in_words(node, 10.0)
    assert words.endswith('/joint_states: rejected: damaged (1 messages)')


def test_estimates_that_come_back_to_a_stuck_rover_are_logged():
    from wheel_terra_estimator.messages.diagnostics import ERROR, STALE
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    log = Mock()
    node = SimpleNamespace(
        _publisher=Mock(),
        _pipeline=SimpleNamespace(diagnostics=SimpleNamespace(new_faults=['imu: lost'])),
        _logged_level=(-1, False),
        get_logger=lambda: log,
    )

    def say(level, words):
        EstimatorNode._publish_diagnostics(
            node, 0, [SimpleNamespace(level=level, message=words)], 0.0
        )

    say(ERROR, 'stuck: wheels dig in')  # was logged when the warning rose
    log.error.assert_not_called()
    log.warning.assert_called_once_with('imu: lost')
    say(STALE, '/joint_states: silent')
    say(ERROR, 'stuck: wheels dig in')
    say(ERROR, 'stuck: wheels dig in')
    log.error.assert_called_once_with('ERROR: stuck: wheels dig in')


class TestOneNode:
    """One node for all, in this order: each has heard what the tests before it sent."""

    def test_silence_is_said_in_diagnostics_and_log(self, running_estimator):
        process, node, until = running_estimator
        diagnostics = hear(node, ros.DiagnosticArray, '/diagnostics')
        until(lambda: diagnostics and 'never received' in diagnostics[-1].status[0].message)
        statuses = diagnostics[-1].status
        assert len(statuses) == 5, 'one per wheel and one for the node'
        assert all(s.level == ros.DiagnosticStatus.STALE for s in statuses)
        until(lambda: '[WARN]' in process.said())
        waits, _, warns = process.said().partition('[WARN]')
        assert 'waiting for /drive/joints, /imu/data' in waits
        assert 'listening to /drive/joints, /imu/data' in waits
        assert 'never received' in warns

    def test_topics_types_and_stuck_for_those_who_come_late(self, running_estimator):
        _, node, until = running_estimator
        expected = {
            **dict.fromkeys(JOINT_OUTPUTS, 'sensor_msgs/msg/JointState'),  # listed in test_pack
            'slip_class': 'std_msgs/msg/UInt8MultiArray',
            'twist': 'geometry_msgs/msg/TwistWithCovarianceStamped',
            'stuck': 'std_msgs/msg/Bool',
            'stuck_direction': 'std_msgs/msg/Int8',
        }

        def offered():
            return {name: types[0] for name, types in node.get_topic_names_and_types()}

        until(lambda: all(f'{NODE}/{t}' in offered() for t in expected))
        for topic, kind in expected.items():
            assert offered()[f'{NODE}/{topic}'] == kind
            (info,) = node.get_publishers_info_by_topic(f'{NODE}/{topic}')
            assert info.qos_profile.reliability.name == 'RELIABLE'
        for topic in ('/drive/joints', '/imu/data'):
            (info,) = node.get_subscriptions_info_by_topic(topic)
            assert info.qos_profile.reliability.name == 'BEST_EFFORT', topic
        stuck = hear(node, ros.Bool, f'{NODE}/stuck', latched())
        direction = hear(node, ros.Int8, f'{NODE}/stuck_direction', latched())
        until(lambda: stuck and direction)
        assert [m.data for m in (*stuck, *direction)] == [False, 0]

    def test_a_proposed_law_is_a_further_file_and_an_integer_may_stand_for_a_number(
        self, running_estimator
    ):
        _, node, until = running_estimator
        get = node.create_client(ros.GetParameters, f'{NODE}/get_parameters')
        until(get.service_is_ready)
        law = 'effects.learned_closure'
        names = [f'{law}.enabled', f'{law}.targets', f'{law}.coefficients', 'rover.contact_law']
        future = get.call_async(ros.GetParameters.Request(names=[*names, 'rover.mass']))
        until(future.done)
        enabled, targets, coefficients, contact_law, mass = future.result().values
        assert enabled.bool_value
        assert list(targets.string_array_value) == ['torque', 'exponent']
        assert list(coefficients.double_array_value) == [0.05, 0.4]
        assert contact_law.string_value == 'wong_reece'
        assert mass.double_value == 20.0

    def test_what_nobody_sends_or_cannot_be_heard_is_named(self, running_estimator):
        _, node, until = running_estimator
        diagnostics = hear(node, ros.DiagnosticArray, '/diagnostics')
        imu = node.create_publisher(ros.Imu, 'imu/data', 10)
        message = ros.Imu()
        message.linear_acceleration.z = 9.81

        def said(*words):
            message.header.stamp.sec += 1
            imu.publish(message)
            return any(all(w in m.status[0].message for w in words) for m in diagnostics)

        until(lambda: said('wheel rates unknown', '/drive/joints: never received (no publishers)'))
        other = node.create_publisher(ros.Twist, '/drive/joints', 10)
        offered = ros.QoSProfile(depth=10, reliability=ros.ReliabilityPolicy.BEST_EFFORT)
        node.create_publisher(ros.Odometry, 'reference_odom', offered)
        until(lambda: said('geometry_msgs/msg/Twist is published there, sensor_msgs/msg/Joint'))
        until(lambda: said('/reference_odom: nothing comes from /listener: best effort publisher'))
        node.destroy_publisher(other)  # a participant has one type on a topic

    def test_messages_that_give_no_estimate_are_explained(self, running_estimator):
        _, node, until = running_estimator
        diagnostics = hear(node, ros.DiagnosticArray, '/diagnostics')
        wheels = node.create_publisher(ros.JointState, '/drive/joints', 10)

        def said_after(message, words):
            wheels.publish(message)
            return any(words in m.status[0].message for m in diagnostics)

        mast = wheel_message(['mast'], 100.0)
        until(lambda: said_after(mast, 'wheels, but mast; wheels.names: front_left_wheel_joint'))
        until(lambda: said_after(wheel_message(['front_left_wheel_joint'], 0.0), 'stamp is zero'))


@pytest.mark.parametrize('others', [(), ('--params-file', str(shipped.find('pathfinder')))])
def test_a_file_whose_section_is_for_another_name_is_told(executor, tmp_path, others, capfd):
    """ROS drops the section without a word: the node is in a namespace, or renamed."""
    from wheel_terra_estimator.errors import UserError
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    path = tmp_path / 'named.yaml'
    path.write_text('wheel_terra_estimator:\n  ros__parameters:\n    output_rate: 5.0\n')
    arguments = [*ROVER, str(path), '-r', '__ns:=/rover1', *others]
    words = f"{path}: sections there: 'wheel_terra_estimator:'; none applies to node /rover1{NODE}"
    if others:
        EstimatorNode(context=executor.context, cli_args=arguments).destroy_node()
        assert words in capfd.readouterr().err
    else:
        with pytest.raises(UserError, match=re.escape(words)):
            EstimatorNode(context=executor.context, cli_args=arguments)
        path.write_text(path.read_text().replace('estimator:', 'estimater:'))
        with pytest.raises(UserError, match="sections there: 'wheel_terra_estimater:'; none"):
            EstimatorNode(context=executor.context, cli_args=arguments)


def test_a_file_that_only_the_commands_accept_is_told_from_one_for_ros(tmp_path, capfd):
    (tmp_path / 'bare.yaml').write_text('rover: {mass: 5.0}\n')
    arguments = [*ROVER, str(tmp_path / 'bare.yaml')]
    with ThreadPoolExecutor() as elsewhere:  # where it takes no signals
        ended = elsewhere.submit(process.run_node, 'lifecycle_node', 'EstimatorNode', arguments)
    assert ended.result() == 2
    assert 'ROS needs the lines "/**:" and "  ros__parameters:"' in capfd.readouterr().err


@pytest.mark.parametrize('section', ['', 'other', '/**', '/*', '/a/*', '/a/**', '/**/it', 'a/it'])
@pytest.mark.parametrize('namespace', ['', '/a', '/a/b'])
def test_a_file_is_told_where_ros_leaves_out_all_of_it(executor, tmp_path, section, namespace):
    from rclpy.node import Node

    from wheel_terra_estimator.ros import parameters

    path = tmp_path / 'named.yaml'
    path.write_text(f'{section}:\n  ros__parameters:\n    mass: 5.0\n' if section else '# none')
    node = Node(
        'it',
        namespace=namespace,
        context=executor.context,
        cli_args=[*ROVER, str(path)],
        automatically_declare_parameters_from_overrides=True,
    )
    given = node.has_parameter('mass')
    assert bool(parameters.unread([path], node)) is not given
    node.destroy_node()
