# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The limiter passes, slows and stops commands, and is careful without estimates."""

import signal
import time
from itertools import pairwise

import pytest
from test_estimator_node import ROVER, latched, parameters, wheel_message

__all__ = ['parameters']
ESTIMATOR = '/wheel_terra_estimator'


# -- States, without ROS ------------------------------------------------------------------------


def states(**tuning):
    from wheel_terra_estimator.estimation.traction_law import TractionLimits
    from wheel_terra_estimator.ros.limiter_states import LimiterStates, LimiterTuning

    return LimiterStates(TractionLimits(), LimiterTuning(**tuning))


def estimate(limiter, now, slip=0.1, slip_class=0, travel=10.0, velocity=0.01):
    limiter.hear_slip(now, [slip] * 4, [velocity] * 4)
    limiter.hear_classes(now, [slip_class] * 4)
    limiter.hear_mobility(now, [travel] * 4)


def test_without_an_estimate_only_the_stale_share_passes_at_start_and_later():
    limiter = states()
    assert limiter.decide(0.0, 0.1, 0.0)[:2] == (0.3, 'no estimate')
    estimate(limiter, 1.0)
    assert limiter.decide(1.5, 0.1, 0.0).scale == 1.0
    assert limiter.decide(2.1, 0.1, 0.0)[:2] == (0.3, 'no estimate')


def test_unknown_slip_lets_a_rover_start_but_not_drive_on():
    limiter = states(stale_after=1.0)
    for now in (0.0, 0.5, 1.0, 1.1, 1.5):
        estimate(limiter, now, slip_class=255)
        expected = (1.0, 'starting') if now <= 1.0 else (0.3, 'unknown')
        assert limiter.decide(now, 0.1, 0.0)[:2] == expected
    assert limiter.decide(1.6, 0.0, 0.0).state == 'zero'
    assert limiter.decide(1.7, 0.1, 0.0).state == 'starting', 'zero restarts the clock'


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_out_of_stuck_only_the_way_back_also_when_the_estimator_is_dead(direction):
    limiter = states()
    estimate(limiter, 0.0)
    limiter.decide(0.0, 0.1 * direction, 0.0)
    limiter.hear_stuck(True)
    for now in (0.1, 100.0):
        assert limiter.decide(now, 0.1 * direction, 0.1)[:2] == (0.0, 'stuck')
        assert limiter.decide(now, 0.0, 0.1).scale == 0.0, 'no turning on the spot'
        assert limiter.decide(now, -0.1 * direction, 0.0)[:2] == (0.3, 'backing out')
    limiter.hear_stuck(False)
    estimate(limiter, 101.0)
    assert limiter.decide(101.0, 0.1 * direction, 0.0).scale == 1.0


def test_stuck_before_any_command_takes_the_direction_of_the_wheels_or_none():
    limiter = states()
    limiter.hear_stuck(True)
    assert [limiter.decide(0.0, v, 0.0).scale for v in (0.1, -0.1)] == [0.0, 0.0]
    limiter = states()
    estimate(limiter, 0.0, velocity=-0.05)
    limiter.hear_stuck(True)
    assert [limiter.decide(0.0, v, 0.0).scale for v in (0.1, -0.1)] == [0.3, 0.0]


def test_acceleration_is_limited_both_ways_and_zero_passes_at_once():
    limiter = states(max_acceleration=0.5, max_angular_acceleration=100.0)
    out = []
    for i in range(60):
        now = 10.0 + 0.05 * i
        estimate(limiter, now, slip=0.1 if i < 30 else 0.9, slip_class=0 if i < 30 else 2)
        decision = limiter.decide(now, 0.4, 0.2)
        out.append(limiter.limited(now, decision, 0.4, 0.2))
    steps = [abs(b[0] - a[0]) for a, b in pairwise(out[1:])]
    assert max(steps) <= 0.5 * 0.05 + 1e-12
    assert out[29] == pytest.approx((0.4, 0.2)) and out[59] == pytest.approx((0.12, 0.06))
    decision = limiter.decide(13.0, 0.0, 0.0)
    assert limiter.limited(13.0, decision, 0.0, 0.0) == (0.0, 0.0)


# -- Over DDS -----------------------------------------------------------------------------------


def test_states_over_dds_with_an_estimator_that_is_killed_and_restarted(
    start, parameters, listener
):
    """Start, drive, joint states lost, clock jump, estimator killed, restarted, stuck latched."""
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import TwistStamped
    from std_msgs.msg import Bool, Float64

    from wheel_terra_estimator.configuration import reader

    node, until = listener
    start('traction_limiter_node', '--ros-args', '-p', 'stale_after:=1', '-p', 'stale_scale:=0.25')
    estimator = start('estimator_node', *ROVER, parameters)
    heard, scales, said = [], [], []
    node.create_subscription(TwistStamped, 'cmd_vel_out', heard.append, 10)
    node.create_subscription(Float64, 'traction_limiter/scale', scales.append, 10)
    node.create_subscription(DiagnosticArray, '/diagnostics', said.append, 10)
    commands = node.create_publisher(TwistStamped, 'cmd_vel_in', 10)
    wheels = node.create_publisher(type(wheel_message([], 0.0)), 'joint_states', 10)
    names = reader.load(['pathfinder']).wheels.names
    until(lambda: commands.get_subscription_count())
    command = TwistStamped()
    command.twist.linear.x, command.twist.angular.z = 0.1, -0.2
    command.header.stamp.sec = 7
    clock, sent = 100.0, 0.0

    def comes_to(share, *, drive, back=False):
        """Send commands, and wheel odometry if `drive`, until this share comes out."""

        def arrived():
            nonlocal clock, sent
            if time.monotonic() - sent < 0.01:  # a hundred a second are enough
                return False
            sent = time.monotonic()
            clock += 0.05
            command.twist.linear.x = -0.1 if back else 0.1
            if drive:
                wheels.publish(wheel_message(names, clock))
            commands.publish(command)
            expected = command.twist.linear.x * share
            return heard and heard[-1].twist.linear.x == pytest.approx(expected, abs=1e-6)

        until(arrived)
        assert heard[-1].header.stamp.sec == 7

    def state():
        status = [s for m in said for s in m.status if s.name == 'traction_limiter: limiter'][-1]
        return next(v.value for v in status.values if v.key == 'state')

    comes_to(0.25, drive=False)
    until(lambda: wheels.get_subscription_count())
    comes_to(1.0, drive=True)
    comes_to(0.25, drive=False)  # joint states lost: old or unknown estimates
    comes_to(1.0, drive=True)
    clock = 20.0  # the clock steps back
    comes_to(1.0, drive=True)
    estimator.kill()
    comes_to(0.25, drive=False)
    until(lambda: commands.publish(command) or state() == 'no estimate')
    start('estimator_node', *ROVER, parameters)
    until(lambda: wheels.get_subscription_count())
    comes_to(1.0, drive=True)
    stuck = node.create_publisher(Bool, f'{ESTIMATOR}/stuck', latched())
    until(lambda: stuck.get_subscription_count())
    stuck.publish(Bool(data=True))
    comes_to(0.0, drive=False)
    comes_to(0.3, drive=False, back=True)
    assert scales[-1].data == pytest.approx(0.3)


def test_plain_twist(start, listener):
    from geometry_msgs.msg import Twist

    node, until = listener
    process = start('traction_limiter_node', '--ros-args', '-p', 'stamped:=false')
    heard = []
    node.create_subscription(Twist, 'cmd_vel_out', heard.append, 10)
    commands = node.create_publisher(Twist, 'cmd_vel_in', 10)
    command = Twist()
    command.linear.x = 0.1
    until(lambda: commands.publish(command) or (heard and heard[-1].linear.x > 0.0))
    assert heard[-1].linear.x == pytest.approx(0.03)
    status, words = process.stop(signal.SIGTERM)
    assert status == 0, words
