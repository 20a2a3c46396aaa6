# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scales velocity commands by what the soil still gives, as the estimator sees it.

Stands between whoever drives and the base: ``cmd_vel_in`` to ``cmd_vel_out``, as
geometry_msgs/Twist or geometry_msgs/TwistStamped (parameter ``stamped``). It hears ``slip``,
``slip_class``, ``mobility`` and ``stuck`` below the name of the estimator. The law is
`traction_law.traction_decision`; this node adds what to do without knowledge: while no estimate is
fresh, commands are cut to the share ``stale_scale`` (0.3 by default; 0 stops, 1 lets them pass),
said on the log and on ``~/scale``. A command of zero always passes at once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, UInt8MultiArray

from wheel_terra_estimator.estimation.traction_law import (
    TractionDecision,
    TractionLimits,
    traction_decision,
)
from wheel_terra_estimator.messages.diagnostics import NODE
from wheel_terra_estimator.ros.process import run_node
from wheel_terra_estimator.ros.qos import input_profile, output_profile

LIMITS = {
    'comfortable_slip': 'median slip up to which the command passes unchanged [-]',
    'critical_slip': 'median slip at which only creep_scale of the command is left [-]',
    'creep_scale': 'least share of the command while moving on [-]',
    'stop_rim_travel': 'stop when less rim travel than this is left before entrapment [m]',
    'slow_rim_travel': 'the share falls below this rim travel left [m]',
}


class TractionLimiter(Node):
    """Velocity commands in, velocity commands that the soil can bear out."""

    def __init__(self, **options: Any) -> None:
        super().__init__('traction_limiter', **options)
        defaults = TractionLimits()
        self._limits = TractionLimits(
            **{
                name: self._number(name, getattr(defaults, name), meaning)
                for name, meaning in LIMITS.items()
            }
        )
        self._stale_after = self._number(
            'stale_after', 1.0, 'an estimate older than this is not trusted [s]'
        )
        self._stale_scale = self._number(
            'stale_scale', 0.3, 'share of the command that passes without a fresh estimate [-]', 1.0
        )
        stamped = self.declare_parameter(
            'stamped', True, ParameterDescriptor(description='TwistStamped rather than Twist')
        ).value
        kind = TwistStamped if stamped else Twist
        self._stamped = bool(stamped)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._heard_at = float('-inf')
        self._slip: Sequence[float] = ()
        self._classes: Sequence[int] = ()
        self._travel: Sequence[float] = ()
        self._stuck = False
        self._reason = ''
        self._output = self.create_publisher(kind, 'cmd_vel_out', QoSProfile(depth=1))
        self._scale = self.create_publisher(Float64, '~/scale', output_profile())
        self.create_subscription(kind, 'cmd_vel_in', self._command, QoSProfile(depth=1))
        self.create_subscription(JointState, f'{NODE}/slip', self._on_slip, input_profile())
        self.create_subscription(
            UInt8MultiArray, f'{NODE}/slip_class', self._on_class, input_profile()
        )
        self.create_subscription(JointState, f'{NODE}/mobility', self._on_mobility, input_profile())
        self.create_subscription(
            Bool, f'{NODE}/stuck', self._on_stuck, output_profile(latched=True)
        )

    def decision(self) -> TractionDecision:
        """Return what to do with a command that comes now."""
        if self._seconds() - self._heard_at > self._stale_after:
            words = f'no fresh estimate: commands cut to {self._stale_scale:.2f}'
            return TractionDecision(self._stale_scale, self._stale_scale == 0.0, words)
        if not len(self._slip) == len(self._classes) == len(self._travel):
            return TractionDecision(self._stale_scale, False, 'first estimates are on their way')
        return traction_decision(self._slip, self._classes, self._travel, self._stuck, self._limits)

    def _command(self, message: Any) -> None:
        decision = self.decision()
        twist = message.twist if self._stamped else message
        for vector in (twist.linear, twist.angular):
            for axis in ('x', 'y', 'z'):
                setattr(vector, axis, decision.scale * getattr(vector, axis))
        self._output.publish(message)
        self._scale.publish(Float64(data=float(decision.scale)))
        # The numbers in the words change all the time: only their kind is news.
        kind = decision.reason.partition(':')[0]
        if kind != self._reason:
            self._reason = kind
            self.get_logger().info(decision.reason)

    def _on_slip(self, message: JointState) -> None:
        self._slip = message.position
        self._heard_at = self._seconds()

    def _on_class(self, message: UInt8MultiArray) -> None:
        self._classes = message.data

    def _on_mobility(self, message: JointState) -> None:
        self._travel = message.position

    def _on_stuck(self, message: Bool) -> None:
        self._stuck = message.data

    def _number(self, name: str, default: float, meaning: str, most: float = 10.0) -> float:
        """Declare a number that is read at start; an integer will do."""
        descriptor = ParameterDescriptor(
            description=meaning,
            read_only=True,
            dynamic_typing=True,
            floating_point_range=[FloatingPointRange(from_value=0.0, to_value=most, step=0.0)],
        )
        return float(self.declare_parameter(name, default, descriptor).value)

    def _seconds(self) -> float:
        return float(self._steady.now().nanoseconds) * 1e-9


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node(lambda: TractionLimiter, args)


if __name__ == '__main__':
    sys.exit(main())
