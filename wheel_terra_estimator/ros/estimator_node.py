# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node: hears the rover's topics, publishes slip, sinkage, pull, classes and warnings.

It is an adapter of `Pipeline`; what it adds is transport: quality of service, parameters,
``~/reset``, and diagnostics when nothing is heard. Estimation is driven by messages and their
stamps alone; the only timer runs on the steady clock and watches over silence.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import rclpy
from nav_msgs.msg import Odometry
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages.convert import INPUT_TYPES, stamp_of
from wheel_terra_estimator.messages.diagnostics import NODE, stale_statuses
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.ros.outputs import EstimatePublisher, time_message
from wheel_terra_estimator.ros.parameters import declare_parameters
from wheel_terra_estimator.ros.qos import OVERRIDABLE, input_profile

MESSAGE_TYPES = {
    'joint_states': JointState,
    'odom': Odometry,
    'imu/data': Imu,
    'sinkage': JointState,
    'leaving_angle': JointState,
    'reference_odom': Odometry,
}

WATCH_PERIOD = 0.25  # [s]
DIAGNOSTICS_PERIOD = 1.0  # [s] of the steady clock, while nothing is heard
SILENCE = 1.5  # [s] of the steady clock without a set


class EstimatorNode(Node):
    """ROS 2 node around the estimator.

    Raises
    ------
    UserError
        If a parameter is unknown or its value cannot be used.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NODE, automatically_declare_parameters_from_overrides=True, **options)
        self.pipeline = Pipeline(declare_parameters(self))
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._started = self._seconds()
        self._heard_at: dict[str, float] = {}
        self._set_at = self._diagnostics_at = float('-inf')
        self._latest: EstimateSet | None = None
        self._arrival = self._open_arrival_log()
        self._publisher = EstimatePublisher(self, self.pipeline.names)
        self._publisher.publish_stuck(False)
        self.create_service(Trigger, '~/reset', self._reset)
        self._listen()
        self.create_timer(WATCH_PERIOD, self._watch, clock=self._steady)
        self.get_logger().info(
            f'ready: {len(self.pipeline.names)} wheels, '
            f'listening to {", ".join(self.pipeline.converter.layout.topics)}'
        )

    def destroy_node(self) -> None:
        """Close what was opened."""
        if self._arrival is not None:
            self._arrival.close()
        super().destroy_node()

    def _listen(self) -> None:
        for topic in self.pipeline.converter.layout.topics:
            self.create_subscription(
                MESSAGE_TYPES[topic],
                topic,
                partial(self._hear, topic),
                input_profile(),
                event_callbacks=SubscriptionEventCallbacks(
                    incompatible_qos=partial(self._on_incompatible_qos, topic),
                    message_lost=partial(self._on_message_lost, topic),
                    use_default_callbacks=False,
                ),
                qos_overriding_options=OVERRIDABLE,
            )

    def _hear(self, topic: str, message: Any) -> None:
        if self._arrival is not None:
            self._arrival.write(f'{topic} {stamp_of(message)}\n')
        self._heard_at[topic] = self._seconds()
        self.pipeline.transport_faults.pop(topic, None)
        for estimates in self.pipeline.hear(topic, message):
            self._publisher.publish(estimates)
            self._latest = estimates
            self._set_at = self._heard_at[topic]
            if statuses := self.pipeline.diagnostics.due(estimates):
                self._publisher.publish_diagnostics(time_message(estimates.stamp), statuses)
                self._diagnostics_at = self._set_at

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._arrival is not None:
            self._arrival.write('reset\n')
        self.pipeline.reset()
        self._latest = None
        self._publisher.publish_stuck(False)
        response.success = True
        response.message = 'state forgotten, parameters kept'
        self.get_logger().info('reset')
        return response

    def _watch(self) -> None:
        """Keep diagnostics going when stamps do not: silence, or a slowly played bag."""
        now = self._seconds()
        silent = now - self._set_at > SILENCE
        # While sets flow they bring their own diagnostics; leave them the first word.
        if now - self._diagnostics_at < DIAGNOSTICS_PERIOD + (0.0 if silent else WATCH_PERIOD):
            return
        self._diagnostics_at = now
        stamp = self.get_clock().now().to_msg()
        if silent or self._latest is None:
            statuses = stale_statuses(
                self.pipeline.names,
                self._silence_in_words(now),
                self.pipeline.counters(),
                self._latest,
            )
        else:
            statuses = self.pipeline.diagnostics.now(self._latest)
        self._publisher.publish_diagnostics(stamp, statuses)

    def _silence_in_words(self, now: float) -> str:
        words = []
        for topic in self.pipeline.converter.layout.topics:
            name = self.resolve_topic_name(topic)
            if topic in self.pipeline.transport_faults:
                words.append(f'{name}: {self.pipeline.transport_faults[topic]}')
            elif topic not in self._heard_at:
                words.append(f'{name}: never heard ({self._publishers_in_words(topic)})')
            elif now - self._heard_at[topic] > SILENCE:
                words.append(f'{name}: silent for {now - self._heard_at[topic]:.0f} s')
        for (topic, reason), count in self.pipeline.rejected.items():
            reason = self.pipeline.converter.in_words(topic, reason)
            words.append(f'{self.resolve_topic_name(topic)}: {reason} ({count} messages)')
        seconds = now - max(self._set_at, self._started)
        return '; '.join([f'no estimates for {seconds:.0f} s', *words])

    def _publishers_in_words(self, topic: str) -> str:
        types = [p.topic_type for p in self.get_publishers_info_by_topic(topic)]
        others = sorted(set(types) - {INPUT_TYPES[topic]})
        if others:
            return f'{", ".join(others)} comes there, needed is {INPUT_TYPES[topic]}'
        return f'{len(types) or "no"} publishers'

    def _on_incompatible_qos(self, topic: str, event: Any) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        name = self.resolve_topic_name(topic)
        words = (
            f'a publisher offers another {policy} than asked for, so nothing comes from it; '
            f'set qos_overrides.{name}.subscription.* to what it offers'
        )
        self.pipeline.transport_faults[topic] = words
        self.get_logger().warning(f'{name}: {words}')

    def _on_message_lost(self, topic: str, event: Any) -> None:
        self.pipeline.transport_counters[f'{topic}_lost'] = event.total_count

    def _open_arrival_log(self) -> TextIO | None:
        name = self.get_parameter('record_arrival').value
        if not name:
            return None
        try:
            return Path(name).expanduser().open('w', encoding='utf-8', buffering=1)
        except OSError as error:
            raise UserError(
                f'record_arrival: {name} cannot be written ({error.strerror})'
            ) from None

    def _seconds(self) -> float:
        return float(self._steady.now().nanoseconds) * 1e-9


def spin(node: Node) -> None:
    """Serve a node until the context ends."""
    if node.has_parameter('executor') and node.get_parameter('executor').value == 'events':
        from rclpy.experimental import EventsExecutor

        executor = EventsExecutor()
        executor.add_node(node)
        # Its spin() and spin_once() without a timeout run hot in Jazzy and serve nothing.
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.1)
        return
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


def run_node(make: Callable[[], Node], args: list[str] | None = None) -> int:
    """Make a node and serve it until it is told to stop; return the exit status."""
    rclpy.init(args=args)
    node = None
    try:
        node = make()
        gc.collect()
        gc.freeze()  # what lives as long as the node needs no more looking at
        spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except UserError as error:
        get_logger(NODE).fatal(str(error))
        return 2
    except RuntimeError:
        # Told to stop while the wait set was being made, rclpy finds its context gone (RCLError).
        if rclpy.ok():
            raise
    finally:
        if node is not None:
            node.destroy_node()
        try_shutdown()
    return 0


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
