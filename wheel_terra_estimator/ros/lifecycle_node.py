# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The node: hears the rover's topics, publishes slip, sinkage, pull, classes and warnings.

It adds transport to `Pipeline`: life cycle, quality of service, parameters, services, what is kept
over a restart. Messages and their stamps alone drive the estimation; timers watch over silence.
"""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ROSClock
from rclpy.clock_type import ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import SetBool, Trigger

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.configuration.soil_file import KeptSoil, StuckState
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages.convert import DAMAGED, INPUT_TYPES
from wheel_terra_estimator.messages.diagnostics import ERROR, NODE, OK, STALE, Status
from wheel_terra_estimator.messages.pipeline import RESET, TUNE, Pipeline
from wheel_terra_estimator.messages.unpack import DamagedMessageError, unpack
from wheel_terra_estimator.ros import parameters, qos
from wheel_terra_estimator.ros.arrival_log import ArrivalLog
from wheel_terra_estimator.ros.input_watch import InputWatch
from wheel_terra_estimator.ros.outputs import EstimatePublisher, message_class

if TYPE_CHECKING:
    from wheel_terra_estimator.ros.live_views import LiveViews


MESSAGE_TYPES = {topic: message_class(name) for topic, name in INPUT_TYPES.items()}

WATCH_PERIOD = 0.25  # [s]
BEHIND = 500_000_000  # [ns] that a message waited, from which on this process is behind
OVERLOADED = 'dropped: this process cannot keep up'
DIAGNOSTICS_PERIOD = 1.0  # [s] of the steady clock, while nothing arrives
SILENCE = 1.5  # [s] of the steady clock without a set
START = 1.0  # [s] in which the node says what it waits for, and not what is missing
DISCOVERY = 5.0  # [s] in which publishers may not have been found yet: no warning in the log
SAVE_PERIOD = 10.0  # [s]
NAMES_PERIOD = 1.0  # [s] between two looks for a node of the same name

LEVELS = ('OK', 'WARN', 'ERROR', 'STALE')

_SECOND = 1_000_000_000

_Message = tuple[str, bytes, dict[str, Any]]
"""Topic, serialised message, what the middleware knows of it."""


class WithInfo:
    """A callback that takes a message and what the middleware knows of it.

    The single-threaded executor calls it with both, the events executor of Jazzy with a pair.
    """

    __signature__ = signature(lambda message, info: None)

    def __init__(self, callback: Callable[[Any, dict[str, Any]], None]) -> None:
        self._callback = callback

    def __call__(self, *given: Any) -> None:
        """Pass message and information on."""
        message, info = given if len(given) == 2 else given[0]
        self._callback(message, info)


class EstimatorNode(LifecycleNode):
    """Managed node around the estimator; with ``autostart`` it makes itself active.

    Raises UserError if ``autostart`` is on and a parameter is unknown or its value cannot be used.
    """

    def __init__(self, **options: Any) -> None:
        try:
            super().__init__(NODE, automatically_declare_parameters_from_overrides=True, **options)
        except ValueError:  # rclpy's, which names no parameter
            empty = [key for key, p in self._parameter_overrides.items() if p.value is None]
            if not empty:
                raise
            raise UserError(
                f'parameters: {empty[0]} is an empty list, which ROS parameters cannot hold; '
                'leave it out'
            ) from None
        self._given = parameters.overrides(self)
        self._files = parameters.files(options.get('cli_args'))
        self._known = declared()
        self._full_name = self.get_fully_qualified_name().lstrip('/')
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._pipeline: Pipeline | None = None
        self._publisher: EstimatePublisher | None = None
        self._views: LiveViews | None = None
        self._subscriptions_made: dict[str, Subscription] = {}
        self._timers_made: list[Timer] = []
        self._kept: KeptSoil | None = None
        self._active = self._declaring = False
        self._enabled = True
        # Level of the node that was logged last, and whether it was expected
        self._logged_level = -1, False
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(Trigger, '~/save_soil', self._save_soil)
        self.create_service(SetBool, '~/set_enabled', self._set_enabled)
        change = self._service_change_state
        change.callback = partial(self._change_state, change.callback)
        self.add_on_set_parameters_callback(self._on_parameters)
        if self._given.get('autostart', True) is not False:
            self._configure()
            self.trigger_configure()
            self.trigger_activate()

    # -- Life cycle -----------------------------------------------------------------------------

    def _change_state(self, usual: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Refuse a transition that the state does not have; rclpy lets it end the process."""
        try:
            return usual(request, response)
        except RuntimeError:  # rcl's own is one
            transition = request.transition
            _, state = self._state_machine.current_state
            alone = self._given.get('autostart', True) is not False
            remedy = '; with a lifecycle manager set autostart to false' if alone else ''
            self.get_logger().error(
                f'lifecycle: no transition {transition.label or transition.id} from {state}{remedy}'
            )
            response.success = False
            return response

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the parameters and begin to listen; refuse with the reason."""
        if self._pipeline is None:
            try:
                self._configure()
            except UserError as error:
                self.get_logger().error(str(error))
                return TransitionCallbackReturn.FAILURE
            except Exception as error:  # rclpy goes on without a word of it
                self.get_logger().error(f'error of the program ({type(error).__name__}: {error})')
                raise
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to publish estimates."""
        self._active = True
        self._publish_stuck()
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop publishing estimates; the filter goes on."""
        self._active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop listening and forget the state."""
        self._release()
        self._enabled = True
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Keep what was learned and close."""
        self._release()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Go back to the beginning."""
        self._release()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """Keep what was learned and close what was opened."""
        self._release()
        super().destroy_node()

    def _configure(self) -> None:
        """Read the parameters, make pipeline, publishers, subscriptions and timers.

        Raises UserError if a parameter is unknown or its value cannot be used.
        """
        qos.check_overrides(self)
        if unread := parameters.unread(self._files, self):
            if 'wheels.names' not in self._given:
                raise UserError(unread)
            self.get_logger().warning(unread)
        configuration = parameters.configuration(self._given, self.get_logger().warning)
        self._kept = self._kept_over_restart(configuration)
        kept = self._kept.values(configuration) if self._kept is not None else {}
        configuration = configuration.replace(kept) if kept else configuration
        self._declaring = True
        parameters.declare(self, configuration)
        self._declaring = False
        self._arrival = ArrivalLog(
            str(configuration.flat()['record_arrival']), self._files, self.get_logger().error
        )
        self._pipeline = Pipeline(configuration, self._full_name)
        self._pipeline.core.warning.restore(self._kept_warning())
        self._warned = self._pipeline.core.warning.state
        self._watch_inputs = InputWatch()
        self._latest: EstimateSet | None = None
        self._started = self._seconds()
        self._set_at = self._diagnostics_at = -math.inf
        self._saved_at = self._started
        self._overloaded = False
        self._rejected: Counter[tuple[str, str]] = Counter()  # while sets still flowed
        self._incompatible: dict[str, str] = {}
        self._numbered: set[str] = set()
        self._shared: set[str] = set()  # topics of several publishers
        self._same_name = self._ready_logged = False
        self._pipeline.transport_values = self._transport_values
        self._pipeline.transport_faults = self._transport_faults
        self._pipeline.diagnostics.clock = lambda stamp: time.monotonic_ns()
        self._publisher = EstimatePublisher(self, self._pipeline.names)
        self._publisher.publish_stuck(self._warned.stuck, self._warned.direction)
        self._views = self._live_views(configuration)
        self._listen()
        self._timers_made = [
            self.create_timer(period, callback, clock=self._steady)
            for period, callback in ((WATCH_PERIOD, self._watch), (NAMES_PERIOD, self._watch_names))
        ]

    def _log_ready(self) -> None:
        """Log what is listened to; not before the first sets, since rclpy's first line is slow."""
        if self._ready_logged or self._pipeline is None:
            return
        self._ready_logged = True
        topics = (self.resolve_topic_name(topic) for topic in self._subscriptions_made)
        self.get_logger().info(
            f'ready: {len(self._pipeline.names)} wheels, listening to {", ".join(topics)}'
        )

    def _release(self) -> None:
        if self._pipeline is None:
            return
        self._active = False
        self._save_quietly()
        for timer in self._timers_made:
            self.destroy_timer(timer)
        for subscription in self._subscriptions_made.values():
            self.destroy_subscription(subscription)
        self._timers_made, self._subscriptions_made = [], {}
        if self._publisher is not None:
            self._publisher.destroy()
        if self._views is not None:
            self._views.destroy()
        self._arrival.close()
        self._pipeline = self._publisher = self._views = None

    # -- Inputs ---------------------------------------------------------------------------------

    def _listen(self) -> None:
        assert self._pipeline is not None
        for topic in self._pipeline.converter.topics:
            self._subscriptions_made[topic] = self.create_subscription(
                MESSAGE_TYPES[topic],
                topic,
                WithInfo(partial(self._arrive, topic)),
                qos.input_profile(topic),
                event_callbacks=SubscriptionEventCallbacks(
                    message_lost=partial(self._on_message_lost, topic), use_default_callbacks=False
                ),
                qos_overriding_options=qos.OVERRIDABLE,
                raw=True,  # rclpy builds every field of a message, most of them for nothing
            )

    def _arrive(self, topic: str, data: bytes, info: dict[str, Any]) -> None:
        """Take a message; with all that waits where timers and shorter queues are behind."""
        came = info.get('received_timestamp')
        if came and time.time_ns() - came > BEHIND and self._pipeline is not None:
            self._watch((topic, data, info))
        else:
            self._process(topic, data, info)

    def _catch_up(self, *taken_before: _Message) -> None:
        """Take all that waits in the queues in the order in which it came: no topic runs ahead.

        A process that took longer for the last of it than it came in cannot keep up, and estimates
        of long ago help nobody: of the frequent topics it takes what came last.
        """
        taken = [(self._came(info), topic, data, info) for topic, data, info in taken_before]
        for topic, subscription in self._subscriptions_made.items():
            with subscription.handle:
                while found := subscription.handle.take_message(subscription.msg_type, True):
                    taken.append((self._came(found[1]), topic, *found))
        if not taken:
            return
        taken.sort(key=lambda each: each[0])
        begun, first, last = self._seconds(), taken[0][0], taken[-1][0]
        for came, topic, data, info in taken:
            left_out = self._overloaded and topic in qos.FREQUENT and came < last - BEHIND
            self._process(topic, data, info, OVERLOADED if left_out else '')
        span = last - first
        limit = min(span, BEHIND) if self._overloaded else span
        self._overloaded = span > BEHIND and (self._seconds() - begun) * _SECOND > limit

    @staticmethod
    def _came(info: dict[str, Any]) -> int:
        """Return when a message came here [ns], or where that is unknown when it was sent."""
        return int(info['received_timestamp'] or info['source_timestamp'])

    def _process(self, topic: str, data: bytes, info: dict[str, Any], refused: str = '') -> None:
        pipeline = self._pipeline
        if pipeline is None:
            return  # was in the queue when the node was cleaned up
        try:
            message = unpack(INPUT_TYPES[topic], data)
        except DamagedMessageError:
            pipeline.refuse(topic, DAMAGED)
            return
        now = self._seconds()
        number = info.get('publication_sequence_number')
        if topic in self._shared and number and number < qos.NOT_NUMBERED:
            values = message.numbers[topic == 'joint_states']  # nan: this one does not tell of it
            known = [name for name, v in zip(message.names, values, strict=False) if v == v]
            wheels = [name for name in known if name in pipeline.names] if message.names else ['']
            self._watch_inputs.mixed(topic, wheels, number)
        number = number if topic in self._numbered else None
        clock = self._nanoseconds()  # 0: none has come yet
        self._watch_inputs.received(
            topic, now, (clock - message.stamp) / _SECOND if clock else 0.0, number
        )
        if refused:
            pipeline.refuse(topic, refused)
            return
        self._arrival.write(f'{topic} {message.stamp}')
        for estimates in pipeline.hear(topic, message):
            self._take(estimates, now)
        if topic not in qos.FREQUENT:  # often late: run through now, the next set is there sooner
            pipeline.core.process_pending()

    def _take(self, estimates: EstimateSet, now: float) -> None:
        assert self._pipeline is not None and self._publisher is not None
        self._latest = estimates
        self._set_at = now
        if self._pipeline.core.warning.state is not self._warned:
            self._warned = self._pipeline.core.warning.state
            said = self.get_logger()
            if self._warned.stuck:
                said.error(f'stuck: {self._warned.reason}')
            else:
                said.info(f'no longer stuck: {self._warned.reason}')
            self._save_quietly(soil=False)
        if not (self._active and self._enabled):
            self._pipeline.diagnostics.follow(estimates)
            return
        self._publisher.publish(estimates)
        if self._views is not None:
            self._views.publish(estimates)
        if statuses := self._pipeline.diagnostics.due(estimates):
            self._publish_diagnostics(estimates.stamp, statuses, now)

    def _on_message_lost(self, topic: str, event: Any) -> None:
        if topic in self._numbered:
            return  # gaps in the publisher's own count say it at once, and exactly
        self._watch_inputs.lost(topic, event.total_count_change)

    # -- Services -------------------------------------------------------------------------------

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._pipeline is None or self._publisher is None:
            response.success, response.message = False, 'not configured: there is no state'
            return response
        self._arrival.write(RESET)
        self._pipeline.reset()
        self._latest = None
        self._started = self._seconds()
        self._warned = self._pipeline.core.warning.state
        if self._kept is not None:
            self._kept.forget_warning()
        self._publisher.publish_stuck(False, 0, again=True)  # so that listeners hear of the reset
        response.success = True
        response.message = 'state reset, parameters kept'
        self.get_logger().info('reset')
        return response

    def _save_soil(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._pipeline is None or self._kept is None:
            response.success = False
            response.message = 'parameter soil_file is empty: there is no file to write'
            if self._pipeline is None:
                response.message = 'not configured: nothing was learned'
            return response
        learned = self._pipeline.core.learned()
        response.success = bool(learned)
        response.message = str(self._kept.path) if learned else 'no estimates yet: nothing learned'
        try:
            self._kept.save(learned, self._warned)
        except UserError as error:
            response.success, response.message = False, str(error)
        return response

    def _set_enabled(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        self._enabled = bool(request.data)
        response.success = True
        response.message = (
            'estimates are published' if self._enabled else 'estimates are not published'
        )
        if not self._active:
            response.message += ' once the node is active'
        self.get_logger().info(response.message)
        self._publish_stuck()
        return response

    # -- What is kept over a restart ------------------------------------------------------------

    def _kept_over_restart(self, configuration: Configuration) -> KeptSoil | None:
        """Return what is kept in the soil file, if there is to be one.

        Raises UserError if that file may not be written to.
        """
        if not configuration.soil_file:
            return None
        effects = str(configuration.flat()['effect_file'])
        inputs = [*self._files, *([Path(effects)] if effects else [])]
        return KeptSoil(Path(configuration.soil_file).expanduser(), inputs)

    def _kept_warning(self) -> StuckState:
        state = self._kept.warning() if self._kept is not None else StuckState()
        if state.stuck:
            self.get_logger().error(f'stuck before the restart: {state.reason}')
        return state

    def _save_quietly(self, soil: bool = True) -> None:
        """Write what was learned, and the warning, or that alone."""
        if self._pipeline is not None and self._kept is not None:
            with suppress(UserError):  # stands in the diagnostics
                self._kept.save(self._pipeline.core.learned() if soil else {}, self._warned)

    # -- What the operator sees -----------------------------------------------------------------

    def _publish_stuck(self) -> None:
        if self._publisher is not None and self._active and self._enabled:
            self._publisher.publish_stuck(self._warned.stuck, self._warned.direction)

    def _publish_diagnostics(
        self, stamp: int, statuses: list[Status], now: float, *, expected: bool = False
    ) -> None:
        """Publish diagnostics; log a change of the node's level, and each fault when it is new.

        What is `expected` (there were no inputs yet, somebody stopped the node) is no warning.
        """
        assert self._publisher is not None and self._pipeline is not None
        self._diagnostics_at = now
        self._publisher.publish_diagnostics(stamp, statuses)
        level, message = statuses[0].level, statuses[0].message
        new_faults = '; '.join(self._pipeline.diagnostics.new_faults)
        log = self.get_logger()
        if (level, expected) != self._logged_level:
            after_silence = self._logged_level == (STALE, False)
            self._logged_level = level, expected
            words = f'{LEVELS[level]}: {message}'
            if level == OK or expected:
                log.info(words)
            elif level != ERROR:
                log.warning(words)
                return
            elif after_silence:  # else the stuck warning was just logged, with its reason
                log.error(words)
                return
        if new_faults:
            log.warning(new_faults)

    def _watch(self, *taken: _Message) -> None:
        """Keep diagnostics going when stamps do not: silence, or a slowly played bag.

        `taken` is what was taken already and not received.
        """
        if self._pipeline is None:
            return  # was due when the node was cleaned up
        self._log_ready()
        self._catch_up(*taken)  # what waits to be taken is not silent
        now = self._seconds()
        if self._latest is not None and now - self._saved_at >= SAVE_PERIOD:
            self._saved_at = now
            self._save_quietly()
        self._watch_inputs.looked(now, WATCH_PERIOD)
        diagnostics = self._pipeline.diagnostics
        diagnostics.look()
        silent = now - max(self._set_at, self._watch_inputs.awake) > SILENCE
        if not silent:
            self._rejected = self._pipeline.rejected
        stopped = self._stopped_in_words()
        # While sets flow they bring their own diagnostics; leave them the first word.
        flowing = not (silent or stopped)
        level_changes = (silent or bool(stopped)) and self._logged_level[0] != STALE
        wait = DIAGNOSTICS_PERIOD + (WATCH_PERIOD if flowing else 0.0)
        if now - self._diagnostics_at < wait and not level_changes:
            return
        stamp = self.get_clock().now().nanoseconds
        if not (silent or stopped) and self._latest is not None:
            self._publish_diagnostics(stamp, diagnostics.now(self._latest), now)
            return
        words = stopped or self._silence_in_words(now)
        expected = bool(stopped) or (self._latest is None and now - self._started < DISCOVERY)
        self._publish_diagnostics(
            stamp, diagnostics.stale(words, self._latest), now, expected=expected
        )

    def _stopped_in_words(self) -> str:
        if not self._active:
            return 'inactive: estimates continue but are not published'
        return '' if self._enabled else 'disabled by ~/set_enabled: estimates are not published'

    def _transport_faults(self) -> list[tuple[str, str]]:
        """Return what is wrong with the transport, and what was lost since this was last asked."""
        now = self._seconds()
        faults = [
            (self.resolve_topic_name(name) if name in MESSAGE_TYPES else name, words)
            for name, words in self._watch_inputs.faults(now)
        ]
        for topic, words in self._incompatible.items():
            name = self.resolve_topic_name(topic)
            cure = f'; set qos_overrides.{name}.subscription.* to what it offers'
            faults += [(name, words + cure)] if words else []
        wheels = self._pipeline.converter.wheel_odometry if self._pipeline else ''
        if wheels and self._watch_inputs.age(wheels, now) is None and self._latest is not None:
            words = f'never received ({self._publishers_in_words(wheels)})'
            faults.append((self.resolve_topic_name(wheels), words))
        if self._same_name:
            words = f'another node is also called /{self._full_name}: both publish estimates'
            faults.append(('name', words))
        if self._kept is not None and self._kept.fault:
            faults.append(('soil_file', self._kept.fault))
        simulated = bool(self.get_parameter('use_sim_time').value)
        no_clock = simulated and self.get_clock().now().nanoseconds == 0
        if no_clock and now - self._started > DISCOVERY:
            faults.append(('clock', 'use_sim_time is true, but nothing arrives on /clock'))
        return faults

    def _watch_names(self) -> None:
        """Look for a node of the same name, and for topics with more than one publisher."""
        if self._pipeline is None:
            return  # was due when the node was cleaned up
        namespaces = self.get_node_names_and_namespaces()
        names = [f'{space.rstrip("/")}/{name}' for name, space in namespaces]
        self._same_name = names.count(f'/{self._full_name}') > 1
        topics: Iterable[str] = self._pipeline.converter.topics
        found = {topic: self.get_publishers_info_by_topic(topic) for topic in topics}
        self._incompatible = {
            topic: qos.other_quality(publishers, self._subscriptions_made[topic].qos_profile)
            for topic, publishers in found.items()
        }
        # With several publishers the counts of their messages cannot be separated.
        single = {topic for topic, publishers in found.items() if len(publishers) == 1}
        self._watch_inputs.believe_gaps(self._numbered & single)
        self._numbered = single
        self._shared = {topic for topic, publishers in found.items() if len(publishers) > 1}

    def _transport_values(self) -> dict[str, Any]:
        return dict(self._watch_inputs.values(self._seconds()))

    def _silence_in_words(self, now: float) -> str:
        assert self._pipeline is not None
        topics = self._pipeline.converter.topics
        if self._latest is None and now - self._started < START:
            return f'waiting for {", ".join(map(self.resolve_topic_name, topics))}'
        words = []
        for topic in topics:
            name = self.resolve_topic_name(topic)
            age = self._watch_inputs.age(topic, now)
            if age is None:
                words.append(f'{name}: never received ({self._publishers_in_words(topic)})')
            elif age > SILENCE and not self._watch_inputs.is_silent(topic, now):  # a fault
                words.append(f'{name}: no message for {age:.0f} s')
        for (topic, reason), count in (self._pipeline.rejected - self._rejected).items():
            reason = self._pipeline.converter.in_words(topic, reason)
            words.append(f'{self.resolve_topic_name(topic)}: rejected: {reason} ({count} messages)')
        seconds = now - max(self._set_at, self._started)
        return '; '.join([f'no estimates for {seconds:.0f} s', *words])

    def _publishers_in_words(self, topic: str) -> str:
        found = self.get_publishers_info_by_topic(topic)
        count = '1 publisher' if len(found) == 1 else f'{len(found) or "no"} publishers'
        return qos.other_type(found, INPUT_TYPES[topic]) or count

    # -- Parameters -----------------------------------------------------------------------------

    def _on_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        """Take changes of tuning at once; all else only while the node is not configured."""
        values = {change.name: change.value for change in changes}
        if self._declaring:  # values of the node's own, which nobody has stated
            return SetParametersResult(successful=True)
        if self._pipeline is None:
            reason = parameters.why_refused(self._given, values)
            if not reason:
                self._given.update(values)
            return SetParametersResult(successful=not reason, reason=reason)
        values = {key: v for key, v in values.items() if key in self._known}
        fixed = [key for key in values if not parameters.is_tuning(key)]
        if fixed:
            reason = f'{fixed[0]} is read-only while the node is configured (clean it up first)'
            return SetParametersResult(successful=False, reason=reason)
        if values:
            try:
                self._pipeline.retune(self._pipeline.configuration.replace(values))
            except UserError as error:
                return SetParametersResult(successful=False, reason=str(error))
            self._arrival.write(f'{TUNE} {json.dumps(values, default=list)}')
            self._given.update(values)
        return SetParametersResult(successful=True)

    def _live_views(self, configuration: Configuration) -> LiveViews | None:
        """Return the outputs for looking at; imported where they are asked for only."""
        values = configuration.flat()
        if not values['publish_markers'] and not any(configuration.wheels.wrench_frame):
            return None
        from wheel_terra_estimator.ros.live_views import LiveViews

        return LiveViews(self, configuration)

    def _nanoseconds(self) -> int:
        """Return the time of the node's clock; the system's is asked without a detour by rcl."""
        clock = self.get_clock()
        simulated = isinstance(clock, ROSClock) and clock.ros_time_is_active
        return int(clock.now().nanoseconds) if simulated else time.time_ns()

    def _seconds(self) -> float:
        """Return the time of the steady clock [s]."""
        return time.monotonic()
