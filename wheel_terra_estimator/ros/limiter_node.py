# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scales velocity commands by what the soil still gives, as the estimator sees it.

The transport of `traction_limiter`, between whoever drives (``cmd_vel_in``) and the base
(``cmd_vel_out``).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int8, UInt8MultiArray
from std_srvs.srv import Trigger

from wheel_terra_estimator.configuration import soil_file
from wheel_terra_estimator.configuration.parameters import (
    Parameter,
    by_spelling,
    declared,
    nearest,
)
from wheel_terra_estimator.configuration.reader import STANDARD_PREFIXES, checked_value
from wheel_terra_estimator.control import traction_limiter as limiter
from wheel_terra_estimator.control.traction_law import LimiterTuning
from wheel_terra_estimator.control.traction_limiter import Interlock, LimiterState, Velocity
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.messages.convert import stamp_of
from wheel_terra_estimator.messages.diagnostics import ERROR, NODE, OK, STALE, WARN, Status
from wheel_terra_estimator.messages.pack import diagnostic_array
from wheel_terra_estimator.output_folder import check_file
from wheel_terra_estimator.ros import parameters, qos

DIAGNOSTICS_PERIOD = 1.0  # [s]
AS_THE_SOIL_GIVES = {'slowed', 'command passes'}
"""States that come and go as the rover drives: no line in the log for each."""
UNLIMITED = ('zero', 'starting', 'command passes')  # states of which nothing is to be said
_SECOND = 1e-9


class TractionLimiter(Node):
    """Velocity commands in, velocity commands that the soil can bear out."""

    def __init__(self, **options: Any) -> None:
        super().__init__('traction_limiter', **options)
        self._tuning = LimiterTuning(**{f.name: self._number(f) for f in fields(LimiterTuning)})
        self._stamped = self._take(Parameter('stamped', 'flag', True, 'TwistStamped, not Twist'))
        words = 'file that keeps a stop across a restart of this node; empty: none'
        name = self._take(Parameter('state_file', 'text', '', words))
        self._refuse_unknown()
        if unread := parameters.unread(parameters.files(options.get('cli_args')), self):
            self.get_logger().warning(unread)
        self._file = Path(name).expanduser() if name else None
        self._unkept = ''  # why the state is not in its file
        self._logged_faults: list[str] = []  # faults of the wiring that stand in the log
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._state = self._start()
        self._decision: limiter.Decision | None = None
        self._message: Any = None  # the last command
        self._command: Velocity = limiter.ZERO
        self._slip: JointState | None = None
        self._classes: tuple[float, tuple[int, ...]] = -math.inf, ()  # when, what
        self._stuck_number: int | None = None  # a publisher that begins counts from 1 again
        kind = TwistStamped if self._stamped else Twist
        self._output = self.create_publisher(kind, 'cmd_vel_out', QoSProfile(depth=1))
        self._scale = self.create_publisher(Float64, '~/scale', qos.output_profile())
        self._diagnostics = self.create_publisher(
            DiagnosticArray, '/diagnostics', qos.output_profile()
        )
        self._input = self.create_subscription(
            kind, 'cmd_vel_in', self._on_command, QoSProfile(depth=1)
        )
        latched = qos.output_profile(latched=True)
        # The direction before the warning: in this order they are taken where both are there.
        topics: tuple[tuple[type, str, Any, QoSProfile], ...] = (
            (JointState, 'slip', self._on_slip, qos.input_profile()),
            (UInt8MultiArray, 'slip_class', self._on_classes, qos.input_profile()),
            (JointState, 'mobility', self._on_mobility, qos.input_profile()),
            (Int8, 'stuck_direction', self._on_direction, latched),
            (Bool, 'stuck', self._on_stuck, latched),
        )
        for message_kind, topic, callback, profile in topics:
            self.create_subscription(message_kind, f'{NODE}/{topic}', callback, profile)
        self.create_service(Trigger, '~/release', self._release)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_diagnostics, clock=self._steady)

    # -- What is received -----------------------------------------------------------------------

    def _on_command(self, message: Any) -> None:
        twist = message.twist if self._stamped else message
        parts = (twist.linear, twist.angular)
        self._message, self._command = message, tuple(v for p in parts for v in (p.x, p.y, p.z))
        self._send(*limiter.after_command(self._state, self._now(), self._command, self._tuning))

    def _on_slip(self, message: JointState) -> None:
        self._slip = message

    def _on_classes(self, message: UInt8MultiArray) -> None:
        self._classes = self._now(), tuple(message.data)

    def _on_mobility(self, message: JointState) -> None:
        """Take the last message of a set."""
        now, clock = self._now(), self.get_clock().now().nanoseconds
        received, classes = self._classes
        if self._slip is None or now - received > self._tuning.stale_after:
            return
        estimates = limiter.Estimates(
            (clock - min(stamp_of(self._slip), stamp_of(message))) * _SECOND,
            self._slip.position,
            self._slip.velocity,
            classes,
            message.position,
        )
        self._follow(limiter.after_estimates(self._state, now, estimates, self._tuning))

    def _on_direction(self, message: Int8) -> None:
        self._follow(limiter.after_direction(self._state, message.data))

    def _on_stuck(self, message: Bool, info: dict[str, Any]) -> None:
        number, before = int(info['publication_sequence_number']), self._stuck_number
        self._stuck_number = number
        change = before is not None and (number > before or number == qos.NOT_NUMBERED)
        self._follow(limiter.after_stuck(self._state, message.data, change=change))

    def _release(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        state, response.message = limiter.after_release(self._state, self._now())
        response.success = True
        self.get_logger().warning(f'~/release: {response.message}')
        self._follow(state)
        return response

    # -- What goes out --------------------------------------------------------------------------

    def _follow(self, state: LimiterState) -> None:
        """Take over a state; what it takes off the last command does not wait for the next.

        Nor for the disk, to which the state goes last.
        """
        before, self._state = self._state, state
        now = self._now()
        if self._decision is not None and now - state.sent_at <= limiter.COMMAND_TIMEOUT:
            lessened, decision = limiter.after_command(state, now, self._command, self._tuning)
            if decision.scale < self._decision.scale:
                self._send(lessened, decision)
        if (state.interlock, state.direction) != (before.interlock, before.direction):
            self._keep()
            why = f': {state.reason}' if state.reason else ''
            self.get_logger().info(f'interlock {state.interlock.value}{why}')
            self._publish_diagnostics()
        if (state.clock_offset is None) != (before.clock_offset is None):
            self.get_logger().warning(
                f'stamps of the estimates and the local clock differ by {state.delay:.1f} s: their '
                'age is by how much later than the quickest they come'
                if before.clock_offset is None
                else 'stamps of the estimates and the local clock agree again'
            )

    def _send(self, state: LimiterState, decision: limiter.Decision) -> None:
        """Publish what is to go out, in the message of the command."""
        self._state = state
        before, self._decision = self._decision, decision
        twist = self._message.twist if self._stamped else self._message
        twist.linear.x, twist.linear.y, twist.linear.z = state.sent[:3]
        twist.angular.x, twist.angular.y, twist.angular.z = state.sent[3:]
        self._output.publish(self._message)
        self._scale.publish(Float64(data=decision.scale))
        if before is None or before.state != decision.state:
            if before is None or {before.state, decision.state} != AS_THE_SOIL_GIVES:
                self.get_logger().info(decision.reason)
            self._publish_diagnostics()

    def _publish_diagnostics(self) -> None:
        """Publish diagnostics."""
        if self._unkept:
            self._keep()
        now, state, decision = self._now(), self._state, self._decision
        name = self.get_fully_qualified_name().lstrip('/')
        words, level = 'no commands', OK if decision is None else STALE
        if decision is not None and now - state.sent_at < limiter.COMMAND_TIMEOUT:
            words, level = decision.reason, OK if decision.state in UNLIMITED else WARN
        if state.interlock is not Interlock.FREE:
            level = ERROR
            words = words if state.reason in words else f'{state.reason}; {words}'
        faults = self._faults_of_wiring()
        for fault in set(faults) - set(self._logged_faults):
            self.get_logger().warning(fault)
        self._logged_faults = faults
        faults = [*faults, f'state_file: {self._unkept}'] if self._unkept else faults
        if faults:
            level, words = max(level, WARN), '; '.join([words, *faults])
        age = limiter.estimate_age(state, now)
        values = {
            'scale': f'{decision.scale:.3f}' if decision is not None else '',
            'state': decision.state if decision is not None else 'no command yet',
            'interlock': state.interlock.value,
            'direction': str(state.direction),
            'estimate_age_s': f'{age:.2f}' if math.isfinite(age) else 'never received',
            'clock_offset_s': f'{state.clock_offset or 0.0:.2f}',
        }
        status = Status(level, f'{name}: limiter', words, name, list(values.items()))
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, [status]))

    def _faults_of_wiring(self) -> list[str]:
        """Return what is wrong with the publishers of commands and of the warning."""
        faults = []
        if (count := len(self.get_publishers_info_by_topic(f'{NODE}/stuck'))) > 1:
            faults.append(f'{count} publishers of ~/stuck: stop all but one')
        drivers = self.get_publishers_info_by_topic('cmd_vel_in')
        kind = 'TwistStamped' if self._stamped else 'Twist'
        if words := qos.other_type(drivers, f'geometry_msgs/msg/{kind}'):
            faults.append(f'{self._input.topic_name}: {words} (parameter stamped)')
        elif words := qos.other_quality(drivers, self._input.qos_profile):
            faults.append(f'{self._input.topic_name}: {words}')
        others = sorted(map(qos.name_of, self.get_publishers_info_by_topic('cmd_vel_out')))
        with suppress(ValueError):
            others.remove(self.get_fully_qualified_name())
        if others:
            past = 'its commands bypass this node'
            faults.append(f'{self._output.topic_name}: {", ".join(others)} publishes too: {past}')
        return faults

    # -- What is kept over a restart ------------------------------------------------------------

    def _start(self) -> LimiterState:
        """Return the state at the start, stopped where the file says so."""
        state = LimiterState(still_since=self._now())
        if self._file is None:
            return state
        if self._file.name.endswith(soil_file.STATE):
            raise UserError(
                f'state_file: {self._file}: an estimator keeps its warning in files of that name '
                f'(<soil_file>{soil_file.STATE}); give the limiter another one'
            )
        kept = soil_file.read_state(self._file)
        if kept.stuck:
            self.get_logger().error(f'stopped before the restart: {kept.reason}')
            state = limiter.after_event(state, limiter.Event.STOP, kept.direction, kept.reason)
        check_file(self._file, overwrite=True)  # says at once where it cannot be written
        self._keep(kept)
        return state

    def _keep(self, kept: soil_file.StuckState | None = None) -> None:
        """Write the present state (or the one that was found) to the file of this node."""
        if self._file is None:
            return
        if kept is None:
            stopped = self._state.interlock is not Interlock.FREE
            stamp = self.get_clock().now().nanoseconds
            kept = soil_file.StuckState(stopped, self._state.reason, stamp, self._state.direction)
        try:
            soil_file.write_state(self._file, kept)
            self._unkept = ''
        except UserError as error:
            if str(error) != self._unkept:
                self.get_logger().error(f'state_file: {error}')
            self._unkept = str(error)

    # -- Parameters and time --------------------------------------------------------------------

    def _take(self, declared: Parameter) -> Any:
        """Return a parameter, checked as those of the estimator are; it is read at the start."""
        given = self._parameter_overrides.get(declared.key)  # private in rclpy
        stated = {} if given is None else {declared.key: (given.value, 'parameters')}
        value = checked_value(declared, stated, 0)
        described = parameters.descriptor(declared)
        described.read_only = True
        self.declare_parameter(declared.key, value, described, ignore_override=True)
        return value

    def _refuse_unknown(self) -> None:
        """Refuse what neither this node nor the estimator has: a file may hold both under /**."""
        # What nobody declares is kept nowhere else.
        unknown = set(self._parameter_overrides) - set(self.get_parameters_by_prefix(''))
        if not unknown:
            return
        for key in sorted(unknown - set(by_spelling(declared()))):
            if key.startswith(STANDARD_PREFIXES):
                continue
            raise UserError(
                f"unknown parameter '{key}'; the nearest known one is "
                f"'{nearest(key, self.get_parameters_by_prefix(''))}'"
            )

    def _number(self, field: Field[float]) -> float:
        """Return a number of the tuning."""
        given, default = field.metadata, float(field.default)  # type: ignore[arg-type]
        bounds = {'at_least': given['lower'], 'at_most': given['upper']}
        return float(
            self._take(Parameter(field.name, 'number', default, given['meaning'], **bounds))
        )

    def _now(self) -> float:
        return float(self._steady.now().nanoseconds) * _SECOND
