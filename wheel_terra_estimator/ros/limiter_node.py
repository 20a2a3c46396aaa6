# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scales velocity commands by what the soil still gives, as the estimator sees it.

Stands between whoever drives and the base: ``cmd_vel_in`` to ``cmd_vel_out``, as
geometry_msgs/Twist or geometry_msgs/TwistStamped (parameter ``stamped``). It hears ``slip``,
``slip_class``, ``mobility`` and ``stuck`` below the name of the estimator; the states stand in
``limiter_states``. It says what it does on ``~/scale``, on ``/diagnostics`` and in the log.
"""

from __future__ import annotations

import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, UInt8MultiArray

from wheel_terra_estimator.estimation.traction_law import TractionLimits
from wheel_terra_estimator.messages.diagnostics import NODE, OK, STALE
from wheel_terra_estimator.ros.limiter_states import Decision, LimiterStates, LimiterTuning
from wheel_terra_estimator.ros.qos import input_profile, output_profile

LIMITS = {
    'comfortable_slip': 'median slip up to which the command passes unchanged [-]',
    'critical_slip': 'median slip at which only creep_scale of the command is left [-]',
    'creep_scale': 'least share of the command while moving on, and share while backing out [-]',
    'stop_rim_travel': 'stop when less rim travel than this is left before entrapment [m]',
    'slow_rim_travel': 'the share falls below this rim travel left [m]',
}
TUNING = {
    'stale_after': 'an estimate older than this is not trusted [s]',
    'stale_scale': 'share of the command that passes without a fresh estimate [-]',
    'max_acceleration': 'greatest change of the forward speed that goes out [m/s^2]',
    'max_angular_acceleration': 'greatest change of the yaw rate that goes out [rad/s^2]',
}
AT_MOST_ONE = ('creep_scale', 'stale_scale', 'comfortable_slip', 'critical_slip')

DIAGNOSTICS_PERIOD = 1.0  # [s]
COMMAND_MEMORY = 2.0  # [s] after which a command is no longer spoken of


class TractionLimiter(Node):
    """Velocity commands in, velocity commands that the soil can bear out."""

    def __init__(self, **options: Any) -> None:
        super().__init__('traction_limiter', **options)
        limits, tuning = TractionLimits(), LimiterTuning()
        self._states = LimiterStates(
            TractionLimits(
                **{n: self._number(n, getattr(limits, n), m) for n, m in LIMITS.items()}
            ),
            LimiterTuning(**{n: self._number(n, getattr(tuning, n), m) for n, m in TUNING.items()}),
        )
        stamped = self.declare_parameter(
            'stamped', True, ParameterDescriptor(description='TwistStamped rather than Twist')
        ).value
        kind = TwistStamped if stamped else Twist
        self._stamped = bool(stamped)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._last: Decision | None = None
        self._command_at = float('-inf')
        self._output = self.create_publisher(kind, 'cmd_vel_out', QoSProfile(depth=1))
        self._scale = self.create_publisher(Float64, '~/scale', output_profile())
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', output_profile())
        self.create_subscription(kind, 'cmd_vel_in', self._command, QoSProfile(depth=1))
        for message_kind, topic, callback, profile in (
            (JointState, 'slip', self._on_slip, input_profile()),
            (UInt8MultiArray, 'slip_class', self._on_class, input_profile()),
            (JointState, 'mobility', self._on_mobility, input_profile()),
            (Bool, 'stuck', self._on_stuck, output_profile(latched=True)),
        ):
            self.create_subscription(message_kind, f'{NODE}/{topic}', callback, profile)
        self.create_timer(DIAGNOSTICS_PERIOD, self._say, clock=self._steady)

    def _command(self, message: Any) -> None:
        now = self._seconds()
        twist = message.twist if self._stamped else message
        forward, turning = twist.linear.x, twist.angular.z
        if not (math.isfinite(forward) and math.isfinite(turning)):
            forward = turning = 0.0
        decision = self._states.decide(now, forward, turning)
        out = self._states.limited(now, decision, forward, turning)
        twist.linear.x, twist.angular.z = out
        for vector, axes in ((twist.linear, 'yz'), (twist.angular, 'xy')):
            for axis in axes:
                value = decision.scale * getattr(vector, axis)
                setattr(vector, axis, value if math.isfinite(value) else 0.0)
        self._output.publish(message)
        self._scale.publish(Float64(data=float(decision.scale)))
        before, self._last, self._command_at = self._last, decision, now
        if before is None or before.state != decision.state:
            self.get_logger().info(decision.reason)
        if before is None or before.level != decision.level:
            self._say()

    def _say(self) -> None:
        """Publish diagnostics."""
        now = self._seconds()
        name = self.get_fully_qualified_name().lstrip('/')
        last = self._last
        fresh = last is not None and now - self._command_at < COMMAND_MEMORY
        words = last.reason if last is not None and fresh else 'no commands'
        level = last.level if last is not None and fresh else STALE if last is not None else OK
        age = self._states.age(now)
        values = {
            'scale': f'{last.scale:.3f}' if last is not None else '',
            'state': last.state if last is not None else 'no command yet',
            'estimate_age_s': f'{age:.2f}' if math.isfinite(age) else 'never heard',
        }
        status = DiagnosticStatus(
            level=bytes([level]),
            name=f'{name}: limiter',
            message=words,
            hardware_id=name,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def _on_slip(self, message: JointState) -> None:
        self._states.hear_slip(self._seconds(), message.position, message.velocity)

    def _on_class(self, message: UInt8MultiArray) -> None:
        self._states.hear_classes(self._seconds(), message.data)

    def _on_mobility(self, message: JointState) -> None:
        self._states.hear_mobility(self._seconds(), message.position)

    def _on_stuck(self, message: Bool) -> None:
        self._states.hear_stuck(message.data)

    def _number(self, name: str, default: float, meaning: str) -> float:
        """Declare a number that is read at start; an integer will do."""
        most = 1.0 if name in AT_MOST_ONE else 10.0
        descriptor = ParameterDescriptor(
            description=meaning,
            read_only=True,
            dynamic_typing=True,
            floating_point_range=[FloatingPointRange(from_value=0.0, to_value=most, step=0.0)],
        )
        return float(self.declare_parameter(name, default, descriptor).value)

    def _seconds(self) -> float:
        return float(self._steady.now().nanoseconds) * 1e-9
