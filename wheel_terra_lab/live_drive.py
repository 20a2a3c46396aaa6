# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Plays a recording to the real node over DDS, records what it publishes, writes the report.

The live counterpart of ``wheel-terra replay``, for demonstrations and for the test that both give
the same numbers::

    python -m wheel_terra_lab.live_drive BAG -o OUT --report report.html --config ROVER

The node runs in a process of its own, with reliable inputs and deep queues, so that the recording
is heard in full however loaded the machine is.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from std_msgs.msg import Bool, Int8

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.history import read_estimates
from wheel_terra_estimator.bags.reader import MeasurementReader, parse_remaps
from wheel_terra_estimator.bags.replay import Replay
from wheel_terra_estimator.bags.salvage import RawMessage
from wheel_terra_estimator.bags.storage import Bag, open_bag
from wheel_terra_estimator.bags.truth import read_truth
from wheel_terra_estimator.bags.writer import (
    DIAGNOSTICS,
    LATCHED,
    NAMESPACE,
    STUCK,
    STUCK_DIRECTION,
    TOPICS,
)
from wheel_terra_estimator.cli.terminal import termination_as_interrupt
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.fleet.drive import check_before, findings_as_lines, summed_up
from wheel_terra_estimator.messages.unpack import JOINT_STATE, unpack
from wheel_terra_estimator.output_folder import check_file, check_folder
from wheel_terra_estimator.ros.lifecycle_node import MESSAGE_TYPES
from wheel_terra_estimator.ros.outputs import SET_MESSAGES

QUEUE = 5000
PATIENCE = 5.0  # [s] until the next message is sent though the node has not heard the last one
DISCOVERY_TIMEOUT = 60.0  # [s]
NOT_FOUND, INTERRUPTED = 4, 130  # exit statuses
QUIET, PAUSE = 2.0, 0.2  # [s] without an output, looked for so often: the node is done

OUTPUT_MESSAGES = {
    **{f'{NAMESPACE}/{topic}': kind for topic, kind in SET_MESSAGES.items()},
    STUCK: Bool,
    STUCK_DIRECTION: Int8,
    DIAGNOSTICS: DiagnosticArray,  # the last: `_Player.wait_for_partners` relies on it
}


class NodeNotFoundError(UserError):
    """Player and node did not find each other: DDS has no way here."""


class Heard(NamedTuple):
    """An output of the node: when it was published [ns], topic, CDR bytes."""

    published: int
    topic: str
    data: bytes


def drive(
    bag: Bag,
    configuration: Configuration,
    remaps: Mapping[str, str],
    rate: float = 0.0,
    arrival: Path | None = None,
) -> list[Heard]:
    """Play a bag to a node and return what it published.

    ``rate``: speed, 1 = as recorded, 0 = as fast as the node takes it. ``arrival``: where the node
    logs its order of arrival. At speed 0 that is the order of the bag: the node takes its topics in
    turn, so a queue would let rare messages overtake frequent ones. Raises UserError where the node
    did not come up, or ended on its own.
    """
    topics = MeasurementReader(bag, remaps, configuration).topics
    with TemporaryDirectory() as folder, _context():
        parameters = Path(folder) / 'parameters.yaml'
        configuration.write(parameters)
        arrival = arrival or Path(folder) / 'arrival.txt'
        node = _node_arguments(parameters, topics, arrival)
        if rate <= 0.0:  # above its pace a clock on the wall sees silence that is none
            node += ['--log-level', 'wheel_terra_estimator:=ERROR']
        with _running_node(node) as process:
            player = _Player(topics)
            try:
                player.wait_for_partners(process)
                names = {topic: name for name, topic in topics.items()}
                with arrival.open('rb') as log:
                    messages = bag.messages(tuple(names))
                    player.play(messages, names, rate, _Arrivals(log, process))
                player.wait_for_end()
                _must_run(process)
            finally:
                player.destroy_node()
        # The executor goes by topics; the order of publication is that of the node.
        return sorted(player.heard, key=lambda heard: heard.published)


def _node_arguments(parameters: Path, topics: Mapping[str, str], arrival: Path) -> list[str]:
    settings: dict[str, Any] = {'record_arrival': str(arrival)}
    settings |= {
        f'qos_overrides./{name}.subscription.{policy}': value
        for name in topics
        for policy, value in (('reliability', 'reliable'), ('depth', QUEUE))
    }
    settings.update(
        (f'qos_overrides.{topic}.publisher.depth', QUEUE)
        for topic in OUTPUT_MESSAGES
        if topic not in LATCHED
    )
    arguments = ['--ros-args', '--params-file', str(parameters)]
    for name, value in settings.items():
        arguments += ['-p', f'{name}:={value}']
    return arguments


@contextmanager
def _context() -> Iterator[None]:
    # The arguments are our own, not those of ROS, and Ctrl-C is an interrupt as elsewhere.
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield
    finally:
        try_shutdown()


def start_node(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start the node in a process of its own."""
    return subprocess.Popen(
        [sys.executable, '-m', 'wheel_terra_estimator.ros.estimator_node', *arguments]
    )


@contextmanager
def _running_node(arguments: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """Run the node; it is stopped as by Ctrl-C."""
    process = start_node(arguments)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class _Player(Node):
    """Publishes the inputs as they lie in the bag and keeps the outputs."""

    def __init__(self, topics: Mapping[str, str]) -> None:
        super().__init__('wheel_terra_drive_player')
        self.heard: list[Heard] = []
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        self._inputs = {
            name: self.create_publisher(MESSAGE_TYPES[name], name, QoSProfile(depth=QUEUE))
            for name in topics
        }
        for topic, kind in OUTPUT_MESSAGES.items():
            profile = QoSProfile(depth=QUEUE)
            if topic in LATCHED:
                profile.durability = profile.durability.TRANSIENT_LOCAL
            self.create_subscription(kind, topic, self._keeper(topic), profile, raw=True)

    def wait_for_partners(self, process: subprocess.Popen[bytes]) -> None:
        """Wait until every topic has its partner on both sides.

        The node finds its listeners on its own, a little later, and in the order in which they
        were made; what it sends before is lost. The diagnostics, which it sends while it hears
        nothing, have the last listener: once they come, it knows all.
        """

        def ready() -> bool:
            _must_run(process)
            return all(p.get_subscription_count() for p in self._inputs.values()) and any(
                heard.topic == DIAGNOSTICS for heard in self.heard
            )

        if not self._spin_until(ready, DISCOVERY_TIMEOUT):
            raise NodeNotFoundError(f'the node was not found within {DISCOVERY_TIMEOUT:.0f} s')

    def play(
        self,
        messages: Iterator[RawMessage],
        names: Mapping[str, str],
        rate: float,
        arrivals: _Arrivals,
    ) -> None:
        """Publish messages at their pace; in between take what the node publishes."""
        begin = None
        for message in messages:
            if begin is None:
                begin = message.log_time, time.monotonic()
            if rate > 0.0:
                due = begin[1] + (message.log_time - begin[0]) * 1e-9 / rate
                self._spin_until(lambda: False, due - time.monotonic())
            self._inputs[names[message.topic]].publish(message.data)
            arrivals.expect()
            if rate <= 0.0:
                self._spin_until(arrivals.complete, PATIENCE, pause=0.0002)
                arrivals.forgive()

    def wait_for_end(self) -> None:
        """Wait until the node says nothing new."""
        count, quiet = len(self.heard), 0
        while quiet * PAUSE < QUIET:
            self._spin_until(lambda: False, PAUSE)
            # Diagnostics go on for ever.
            said = any(heard.topic != DIAGNOSTICS for heard in self.heard[count:])
            count, quiet = len(self.heard), 0 if said else quiet + 1

    def _keeper(self, topic: str) -> Any:
        def keep(data: bytes, info: Mapping[str, int]) -> None:
            self.heard.append(Heard(info['source_timestamp'], topic, bytes(data)))

        return keep

    def _spin_until(
        self, condition: Callable[[], bool], seconds: float, pause: float = 0.05
    ) -> bool:
        end = time.monotonic() + seconds
        while not condition():
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, pause))
        return True


class _Arrivals:
    """What the node has heard of what was sent, by its log of arrivals."""

    def __init__(self, log: BinaryIO, process: subprocess.Popen[bytes]) -> None:
        self._log = log
        self._process = process
        self._missing = 0

    def expect(self) -> None:
        """Count a message that was sent."""
        self._missing += 1

    def complete(self) -> bool:
        """Whether the node has heard all that was sent."""
        _must_run(self._process)
        self._missing -= self._log.read().count(b'\n')
        return self._missing <= 0

    def forgive(self) -> None:
        """Wait no longer for what has not come."""
        self._missing = 0


def _must_run(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is not None:
        raise UserError('the node ended by itself; its message stands above')


def record(heard: Sequence[Heard], path: Path, start: int, overwrite: bool = False) -> None:
    """Write outputs of the node to a bag; log times are the stamps of the sets.

    ``start``: log time of what came before the first set [ns].
    """
    log_time = start
    with BagFile(path, TOPICS, latched=LATCHED, overwrite=overwrite) as file:
        for _, topic, data in heard:
            if topic == f'{NAMESPACE}/slip':
                log_time = max(log_time, unpack(JOINT_STATE, data).stamp)
            file.write(topic, data, log_time)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the program."""
    parser = argparse.ArgumentParser(description='Play a recording to the real node.')
    parser.add_argument('bag', type=Path, metavar='BAG')
    parser.add_argument('-o', dest='output', type=Path, required=True, metavar='DIR')
    parser.add_argument('--report', type=Path, metavar='F.html')
    parser.add_argument('--remap', action='append', default=[], metavar='FROM:=TO')
    parser.add_argument(
        '--rate', type=float, default=0.0, help='1 = as recorded; 0 = as fast as it goes (default)'
    )
    parser.add_argument('--arrival', type=Path, metavar='F', help='log of the order of arrival')
    parser.add_argument('--overwrite', action='store_true')
    configuration_reader.add_arguments(parser)
    arguments = parser.parse_args(argv)
    try:
        with termination_as_interrupt():
            _run(arguments)
    except UserError as error:
        print(f'live_drive: {error}', file=sys.stderr)
        return NOT_FOUND if isinstance(error, NodeNotFoundError) else 2
    except KeyboardInterrupt:
        print('live_drive: interrupted', file=sys.stderr)
        return INTERRUPTED
    return 0


def _run(arguments: argparse.Namespace) -> None:
    configuration = configuration_reader.from_arguments(arguments)
    remaps = parse_remaps(arguments.remap)
    inputs = [arguments.bag]
    for name in arguments.config:
        inputs += configuration_reader.files_behind(name)
    if arguments.report:
        check_file(arguments.report, arguments.overwrite, inputs)
    check_folder(arguments.output, arguments.overwrite, inputs)
    with open_bag(arguments.bag) as bag:
        reader = MeasurementReader(bag, remaps, configuration)
        checked = check_before(bag, configuration, remaps)
        for line in findings_as_lines(checked):
            print(line, flush=True)
        heard = drive(bag, configuration, remaps, arguments.rate, arguments.arrival)
        start = next(bag.messages(tuple(reader.topics.values()))).log_time
        record(heard, arguments.output, start, arguments.overwrite)
        truth = read_truth(bag, remaps, configuration)
    with open_bag(arguments.output) as estimates:
        history = read_estimates(estimates)
    heard_of = {name: bag.topics[topic].message_count for name, topic in reader.topics.items()}
    result = Replay(history, reader.topics, Counter(heard_of), Counter(), tuple(reader.notes))
    told = summed_up(f'{arguments.bag.resolve().name}, live', configuration, checked, result, truth)
    print(told.as_text)
    print(f'estimates: {arguments.output}')
    if arguments.report:
        told.write({'report': arguments.report}, arguments.overwrite)
        print(f'report: {arguments.report}')


if __name__ == '__main__':
    sys.exit(main())
