# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimator over a recording: as fast as it goes, no ROS, no wall clock."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from wheel_terra_estimator.bags.history import MOST_ROWS, EstimateHistory, HistoryRecorder
from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.storage import Bag
from wheel_terra_estimator.bags.track import Track, TrackRecorder
from wheel_terra_estimator.bags.writer import EstimateBagWriter
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.end_signals import handled, terminations
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother
from wheel_terra_estimator.estimation.taught import Taught
from wheel_terra_estimator.input_file import read_text
from wheel_terra_estimator.messages.convert import ODOMETRY
from wheel_terra_estimator.messages.diagnostics import Diagnostics, Status
from wheel_terra_estimator.messages.pipeline import RESET, TUNE, Pipeline

LONG_DRIVE = 3_000  # number of messages from which a progress bar is shown: ten seconds

LARGEST_ARRIVAL_LOG = 256 * 2**20  # size [byte] of an arrival log of ten hours

_MOST_MISSING = 0.1  # share of a log that the bag may lack: recorder and node start apart
TRUTH_TOPICS = ('/ground_truth/', '/truth/')
"""Topics that are compared with the estimates, never used as inputs."""

SMOOTHED = 'smoothed: each estimate uses the whole drive; warnings are those given live'


class Event(NamedTuple):
    """A set at its log time [ns]; without one, a start or a reset: no warning runs."""

    log_time: int
    estimates: EstimateSet | None = None
    statuses: list[Status] | None = None  # its diagnostics; None: not yet computed


@dataclass(frozen=True)
class Replay:
    """Result of a replay: estimates, numbers of used and rejected messages, and notes."""

    history: EstimateHistory
    topics: dict[str, str]  # input topic of the estimator -> topic in the bag
    heard: Counter[str]
    rejected: Counter[tuple[str, str]]  # (input topic, reason)
    notes: tuple[str, ...]
    interrupted: bool = False
    # Configuration key -> value, see `EstimatorCore.learned`
    learned: dict[str, Any] = field(default_factory=dict)
    track: Track | None = None
    taught: tuple[Taught, ...] = ()
    smoothed: bool = False


@dataclass(frozen=True)
class Options:
    """Choices of a replay."""

    overwrite: bool = False
    # Log of a live node (parameter ``record_arrival``): hear the messages in that order
    arrival: Path | None = None
    # Whether the history holds every set of a long drive, whatever memory that takes
    every_set: bool = False
    progress: bool = True
    smooth: bool = False  # whether the estimates are those of the fixed-interval smoother


DEFAULT = Options()


def replay(
    bag: Bag,
    configuration: Configuration,
    remaps: Mapping[str, str],
    output: Path | None = None,
    options: Options = DEFAULT,
) -> Replay:
    """Run the estimator over an open bag.

    ``remaps``: estimator's topic to the bag's. ``output``: folder of the bag that gets the
    estimates; closed and readable whatever happens. Raises UserError for input that cannot be used
    and for an output path that is taken.
    """
    arrival, smooth = options.arrival, options.smooth
    reader = MeasurementReader(bag, remaps, configuration)
    tracker = TrackRecorder(configuration)
    smoother = DriveSmoother(configuration) if smooth else None
    pipeline = Pipeline(configuration, estimator=smoother.estimator if smoother else None)
    pipeline.on_measurement = tracker.hear
    most = None if options.every_set else MOST_ROWS
    of_order: list[str] = []
    messages = _in_order_of(arrival, reader, of_order, smooth) if arrival else reader.messages()
    if options.progress and reader.message_count >= LONG_DRIVE and sys.stderr.isatty():
        from tqdm import tqdm

        messages = tqdm(messages, total=reader.message_count, unit=' messages', unit_scale=True)
    with ExitStack() as stack:
        writer = None
        if output is not None:
            writer = stack.enter_context(
                EstimateBagWriter(output, pipeline.names, options.overwrite, pipeline.diagnostics)
            )
            writer.state_origin(configuration, bag.path.resolve().name)
        interrupted = stack.enter_context(_until_interrupted())
        heard = events(messages, pipeline, interrupted)
        if smoother is not None:
            heard = smoothed(heard, smoother, pipeline.diagnostics)
        recorder = HistoryRecorder(pipeline.names, most)
        for event in heard:
            if event.estimates is not None:
                recorder.add(event.estimates)
                tracker.add(event.estimates)
            if writer is None:
                continue
            if event.estimates is None:
                writer.write_stuck(False, 0, event.log_time)
            else:
                writer.add(event.estimates, event.log_time, event.statuses)
    history, core = recorder.history(), pipeline.core
    return Replay(
        history=history,
        topics=reader.topics,
        heard=pipeline.received,
        rejected=reader.rejected + pipeline.rejected,
        notes=(
            *([SMOOTHED] if smooth else []),
            *of_order,
            *_notes(bag, reader, pipeline, history, interrupted.is_set()),
        ),
        interrupted=interrupted.is_set(),
        learned=core.learned(),
        taught=core.taught(),
        smoothed=smooth,
        track=tracker.track(),
    )


def events(
    messages: Iterator[tuple[int, str, Any]], pipeline: Pipeline, interrupted: threading.Event
) -> Iterator[Event]:
    """Yield the sets of a drive, and where the node publishes that there is no warning."""
    log_time = 0
    for count, (log_time, name, message) in enumerate(messages):
        if count == 0:
            yield Event(log_time)
        if name == RESET:
            pipeline.reset()
            yield Event(log_time)
            continue
        if name == TUNE:
            pipeline.retune(pipeline.configuration.replace(message))
            continue
        for estimates in pipeline.hear(name, message):
            yield Event(log_time, estimates)
        if interrupted.is_set():
            return
    for estimates in pipeline.flush():
        yield Event(log_time, estimates)


def smoothed(
    events: Iterator[Event],  # of the forward pass, whose estimator is that of the smoother
    smoother: DriveSmoother,
    diagnostics: Diagnostics,  # asked set by set, as the live node asks it
) -> Iterator[Event]:
    """Yield the events of a drive with the sets of its smoother, once all have come."""
    starts: list[Event] = []
    for event in events:
        if event.estimates is None:
            starts.append(event)
            continue
        statuses = diagnostics.due(event.estimates)
        smoother.keep(event.estimates, (tuple(starts), event.log_time, statuses))
        starts = []
    for estimates, (before, log_time, statuses) in smoother.sets():
        yield from before
        yield Event(log_time, estimates, statuses)
    yield from starts


def _notes(
    bag: Bag,
    reader: MeasurementReader,
    pipeline: Pipeline,
    history: EstimateHistory,
    interrupted: bool,
) -> Iterator[str]:
    if interrupted:
        yield 'interrupted: this is the drive up to there'
    yield from bag.notes
    counters = pipeline.counters()
    if restarts := counters.get('filter_restarts', 0):
        yield f'the filter failed and restarted {_times(restarts)}; please report this drive'
    if steps := counters.get('clock_steps_back', 0):
        yield f'the clock stepped back {_times(steps)}; the estimates restart there'
    yield from reader.notes
    used = set(reader.topics.values())
    unknown = [
        t
        for t in bag.topics.values()
        if t.message_count and t.name not in used and not t.name.startswith(TRUTH_TOPICS)
    ]
    odometry = [t.name for t in unknown if t.type == ODOMETRY]
    if 'reference_odom' in reader.absent and odometry:
        yield (
            f'no reference velocity; there is odometry on {", ".join(odometry)}: if one does not '
            'come from the wheels, use it with --remap reference_odom:=TOPIC'
        )
    if unknown:
        count = sum(topic.message_count for topic in unknown)
        yield f'{count} messages not used, on {", ".join(topic.name for topic in unknown)}'
    wheels = pipeline.converter.wheel_odometry
    if history.whole and history.whole.sets > 2 * pipeline.received[wheels] > 0:
        yield (
            f'{wheels} is so infrequent that wheels are mostly unknown: raise filter.silence '
            f'({pipeline.configuration.filter.silence:g} s) to twice the period of its messages'
        )


def _times(count: int) -> str:
    return 'once' if count == 1 else f'{count} times'


def _in_order_of(
    arrival: Path, reader: MeasurementReader, notes: list[str], smooth: bool
) -> Iterator[tuple[int, str, Any]]:
    """Yield the messages of a bag in the order in which a live node received them."""
    lines = read_text(arrival, LARGEST_ARRIVAL_LOG).splitlines()
    if smooth and any(line.startswith(TUNE) for line in lines):
        raise UserError(f'{arrival}: tuning changes in it, which a smoother cannot follow')
    stored: dict[str, deque[tuple[int, str, Any]]] = defaultdict(deque)
    for log_time, name, message in reader.messages():
        stored[f'{name} {message.stamp}'].append((log_time, name, message))
    wanted = Counter(line for line in lines if line.partition(' ')[0] not in (RESET, TUNE))
    missing = wanted - Counter({line: len(those) for line, those in stored.items()})
    if missing.total() > _MOST_MISSING * wanted.total():
        number, line = next((n, x) for n, x in enumerate(lines, start=1) if x in missing)
        raise UserError(
            f'{arrival}: line {number}: no message "{line}" in {reader.bag.path}; '
            'the log belongs to another bag'
        )
    if missing:
        notes.append(f'{arrival}: {missing.total()} of its messages are not in the bag: skipped')
    log_time = 0
    for line in lines:
        if line == RESET:
            yield log_time, RESET, None
        elif line.startswith(TUNE):
            yield log_time, TUNE, _tuning(line, arrival)
        elif stored[line]:
            logged, name, message = stored[line].popleft()
            # Time of arrival does not go back, so estimates lie in the order of their publication.
            log_time = max(log_time, logged)
            yield log_time, name, message


def _tuning(line: str, arrival: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(line.removeprefix(TUNE)))
    except (ValueError, TypeError):  # cut off where the node was killed
        raise UserError(f'{arrival}: no parameters in "{line}": remove the line') from None


@contextmanager
def _until_interrupted() -> Iterator[threading.Event]:
    """Turn the first Ctrl-C or termination into a flag, so that no message is written by half."""
    flag = threading.Event()

    def on_signal(number: int, frame: FrameType | None) -> None:
        if flag.is_set():
            raise KeyboardInterrupt
        flag.set()

    with handled([signal.SIGINT, *terminations()], on_signal):
        yield flag
