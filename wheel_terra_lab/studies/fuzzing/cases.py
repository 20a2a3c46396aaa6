# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One case of fuzzing for each kind of input: made, damaged, read, and judged.

A case is judged by what it raises: a `UserError` of one line is an answer, everything else a
fault. Of an MCAP file the reader has to give every message of every part that is not touched.
"""

from __future__ import annotations

import io
import random
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.configuration import reader as configuration_reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_lab.studies.fuzzing import sqlite_maker
from wheel_terra_lab.studies.fuzzing.damage import damage, touches
from wheel_terra_lab.studies.fuzzing.mcap_maker import Layout, Sample, make

TYPES = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/imu/data': 'sensor_msgs/msg/Imu',
    '/odom': 'nav_msgs/msg/Odometry',
}
START = 1_700_000_000_000_000_000  # [ns]

LAYOUTS = tuple(
    Layout(*choice)
    for choice in product((0, 1500, 4000), ('', 'zstd', 'lz4'), *((True, False),) * 5)
    # Packed only in chunks; schemas and channels have to stand somewhere.
    if (choice[0] or not choice[1]) and (choice[4] or (choice[3] and choice[6]))
)


class FaultError(AssertionError):
    """What must not happen."""


def mcap_case(dice: random.Random, folder: Path) -> None:
    """Damage an MCAP file; no message of an intact part may be missing."""
    layout = dice.choice(LAYOUTS)
    samples = _samples(dice)
    made = make(samples, TYPES, layout)
    damaged = damage(made.content, dice)
    path = folder / 'drive.mcap'
    path.write_bytes(damaged.content)
    described = any(not touches(damaged.places, *place) for place in made.definitions)
    intact = Counter(
        tuple(sample)
        for begin, end, part in made.parts
        if described and not touches(damaged.places, begin, end)
        for sample in part
    )
    found, notes = _read(path)
    missing = intact - found
    if missing and any('copies of channel' in note for note in notes):
        # Two copies, no checksum: the messages are there, and that their topic is in doubt is said.
        missing = Counter({m[::2]: n for m, n in missing.items()})
        missing -= Counter({m[::2]: n for m, n in found.items()})
    if missing:
        raise FaultError(f'{missing.total()} of {intact.total()} intact messages missing: {layout}')
    # A name damaged in its only copy, without a checksum, is another name: nothing is lost.
    if found.total() < len(samples) and not notes:
        raise FaultError(f'{len(samples) - found.total()} messages lost without a word: {layout}')


def sqlite_case(dice: random.Random, folder: Path) -> None:
    """Damage an SQLite file; no row that was not written comes, none is lost without a word."""
    samples = _samples(dice)
    path = folder / 'drive.db3'
    sqlite_maker.write(path, samples, TYPES)
    content = path.read_bytes()
    damaged = damage(content, dice)
    path.write_bytes(damaged.content)
    found, notes = _read(path)
    places = sqlite_maker.message_places(content, samples, TYPES)
    touched = sum(any(touches(damaged.places, *piece) for piece in pieces) for pieces in places)
    if (strange := found - Counter(map(tuple, samples))).total() > touched:
        raise FaultError(f'{strange.total()} rows that were not written, {touched} were touched')
    if found.total() < len(samples) and not notes:
        raise FaultError(f'{len(samples) - found.total()} rows lost without a word')


def folder_case(dice: random.Random, folder: Path) -> None:
    """Damage the metadata of a bag: its messages are all there."""
    bag = folder / 'bag'
    bag.mkdir(exist_ok=True)
    samples = _samples(dice)
    made = make(samples, TYPES, Layout())
    (bag / 'bag.mcap').write_bytes(made.content)
    text = _METADATA.format(count=len(samples)).encode()
    (bag / 'metadata.yaml').write_bytes(damage(text, dice).content)
    found, _ = _read(bag)
    if found != Counter(map(tuple, samples)):
        raise FaultError('metadata decided what is read')


def replay_case(dice: random.Random, folder: Path) -> None:
    """Read measurements out of a recording whose messages are damaged themselves."""
    data = [bytearray(d) for d in _real_messages()]
    for content in data:
        for _ in range(dice.choice((0, 0, 1, 3))):
            content[dice.randrange(len(content))] = dice.randrange(256)
    topics = list(TYPES)[:2]
    samples = [Sample(START + i * 10**7, topics[i % 2], bytes(d)) for i, d in enumerate(data)]
    path = folder / 'drive.mcap'
    path.write_bytes(make(samples, TYPES, Layout()).content)
    with open_bag(path) as bag:
        for _ in MeasurementReader(bag, {}, _rover()).measurements():
            pass


def yaml_case(dice: random.Random, folder: Path) -> None:
    """Damage a rover file, or replace lines of it by hostile ones."""
    path = folder / 'rover.yaml'
    text = _rover_text()
    if dice.random() < 0.5:
        path.write_bytes(damage(text.encode(), dice).content)
    else:
        lines = text.splitlines()
        for _ in range(dice.choice((1, 3))):
            at = dice.randrange(len(lines))
            key = lines[at].partition(':')[0]
            lines[at] = f'{key}: {dice.choice(_HOSTILE_VALUES)}'
        path.write_text('\n'.join(lines), encoding='utf-8')
    configuration_reader.load([path])


def csv_case(dice: random.Random, folder: Path) -> None:
    """Damage a table, or put hostile cells into it."""
    from wheel_terra_estimator.discrepancy.tables.parsing import read_table

    header = ['slip', 'normal_load', 'sinkage', 'drawbar_pull', 'torque']
    rows = [[f'{dice.uniform(0, 0.9):.3f}', '100', '0.02', '10', '3'] for _ in range(12)]
    if dice.random() < 0.6:
        for _ in range(dice.choice((1, 4))):
            dice.choice([header, *rows])[dice.randrange(5)] = dice.choice(_HOSTILE_CELLS)
    content = '\n'.join(','.join(row) for row in [header, *rows]).encode()
    if dice.random() < 0.6:
        content = damage(content, dice).content
    path = folder / 'table.csv'
    path.write_bytes(content)
    read_table(path)


def core_case(dice: random.Random, folder: Path) -> None:
    """Send measurements of any value and order to the core: finite sets, no filter that fails."""
    core = EstimatorCore(_rover())
    stamp = START
    sets = []
    for _ in range(dice.choice((20, 60))):
        stamp += dice.choice((0, 10**7, 10**8, 10**8, 10**9, -(10**8), -(10**10), 10**13))
        when = dice.choice((stamp, stamp, stamp, 0, -stamp, 2**63 - 1))
        sets += core.add(_measurement(dice, when))
        if dice.random() < 0.02:
            core.reset()
    sets += core.flush()
    for estimates in sets:
        for name in (
            'slip',
            'slip_std',
            'sinkage',
            'drawbar_pull',
            'normal_load',
            'forward_velocity',
        ):
            if not np.all(np.isfinite(getattr(estimates, name))):
                raise FaultError(f'{name} is not finite')
    if restarts := core.health()['filter_restarts']:
        raise FaultError(f'the filter was started anew {restarts} times')


def output_case(dice: random.Random, folder: Path) -> None:
    """Run the command itself over a damaged recording: status 0 or 2, one line."""
    from wheel_terra_estimator.cli.main import main

    samples = [
        Sample(START + i * 10**7, list(TYPES)[i % 2], data)
        for i, data in enumerate(_real_messages())
    ]
    path = folder / 'drive.mcap'
    path.write_bytes(damage(make(samples, TYPES, dice.choice(LAYOUTS)).content, dice).content)
    (folder / 'rover.yaml').write_text(_rover_text(), encoding='utf-8')
    said, out = io.StringIO(), io.StringIO()
    with redirect_stderr(said), redirect_stdout(out):
        status = main(['replay', str(path), '--config', str(folder / 'rover.yaml')])
    if status == 130:  # the command took the Ctrl-C that was for the fuzzing
        raise KeyboardInterrupt
    if status not in (0, 2) or (status == 2 and said.getvalue().count('\n') != 1):
        raise FaultError(f'status {status}: {said.getvalue()[:300]}')


CASES: dict[str, tuple[Callable[[random.Random, Path], None], int]] = {
    'mcap': (mcap_case, 60),
    'sqlite': (sqlite_case, 10),
    'folder': (folder_case, 8),
    'replay': (replay_case, 6),
    'yaml': (yaml_case, 6),
    'csv': (csv_case, 8),
    'core': (core_case, 1),
    'command': (output_case, 1),
}
"""Kind of input -> its case and how often it comes among a hundred."""


def run(kind: str, dice: random.Random, folder: Path) -> str:
    """Run a case; return what is wrong, empty if nothing is."""
    try:
        CASES[kind][0](dice, folder)
    except UserError as error:
        return 'an error of several lines' if '\n' in str(error) else ''
    except FaultError as fault:
        return str(fault)
    except Exception as error:
        return f'{type(error).__name__}: {error}'
    return ''


def _read(path: Path) -> tuple[Counter[Any], list[str]]:
    try:
        with open_bag(path) as bag:
            found = Counter((m.log_time, m.topic, m.data) for m in bag.messages(tuple(bag.topics)))
            return found, bag.notes
    except UserError as error:
        if '\n' in str(error):
            raise
        return Counter(), [str(error)]


def _samples(dice: random.Random) -> list[Sample]:
    """Make messages that differ, some of them easily compressed."""
    time, found = START, []
    for number in range(120):
        time += dice.randrange(1, 10**8)
        body = dice.choice((bytes(60), dice.randbytes(60), dice.randbytes(300)))
        data = b'\0\1\0\0' + number.to_bytes(4, 'little') + body
        found.append(Sample(time, dice.choice(list(TYPES)), data))
    return found


@cache
def _rover() -> Configuration:
    return configuration_reader.from_parameters(
        {
            'wheels.names': ['left', 'right'],
            'wheels.radius': [0.2, 0.2],
            'wheels.width': [0.15, 0.15],
            'wheels.y': [0.4, -0.4],
            'rover.mass': 40.0,
        }
    )


@cache
def _rover_text() -> str:
    return (
        '/**:\n  ros__parameters:\n'
        '    wheels.names: [left, right]\n    wheels.radius: [0.2, 0.2]\n'
        '    wheels.width: [0.15, 0.15]\n    wheels.y: [0.4, -0.4]\n'
        '    rover.mass: 40.0\n    output_rate: 20.0\n    slip_radius: lug_tip\n'
        '    filter.stuck_horizon: 15.0\n'
    )


@cache
def _real_messages() -> tuple[bytes, ...]:
    from wheel_terra_estimator.messages import pack

    found = []
    for step in range(60):
        stamp = START + step * 10**8
        names, rates, torques = ('left', 'right'), (2.0, 2.0), (3.0, 3.0)
        found.append(pack.joint_state(stamp, names, velocity=rates, effort=torques))
        found.append(pack.imu(stamp, (0.1, 0.0, 9.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    return tuple(found)


def _measurement(dice: random.Random, stamp: int) -> Any:
    def some(count: int, usual: float) -> Any:
        odd = (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 0.0)
        values = [dice.gauss(usual, 0.3 * abs(usual) + 0.1) for _ in range(count)]
        if dice.random() < 0.3:
            values[dice.randrange(count)] = dice.choice(odd)
        return np.array(values)

    kind = dice.randrange(4)
    if kind == 0:
        return WheelOdometry(stamp, some(2, 2.0), some(2, 3.0))
    if kind == 1:
        force = some(3, 0.0) + np.array([0.0, 0.0, 9.8])
        return InertialReading(stamp, force, some(3, 0.0), dice.choice((None, some(4, 0.5))))
    if kind == 2:
        return SinkageReading(stamp, some(2, 0.02))
    return ReferenceVelocity(stamp, float(some(1, 0.4)[0]), float(some(1, 1e-4)[0]))


_METADATA = """rosbag2_bagfile_information:
  version: 9
  storage_identifier: mcap
  relative_file_paths: [bag.mcap]
  duration: {{nanoseconds: 1}}
  starting_time: {{nanoseconds_since_epoch: 1}}
  message_count: {count}
  topics_with_message_count:
    - topic_metadata: {{name: /joint_states, type: sensor_msgs/msg/JointState}}
      message_count: {count}
  compression_format: ''
  compression_mode: ''
"""

_HOSTILE_VALUES = (
    '9' * 5000,
    '-' + '9' * 25,
    '0x' + 'f' * 5000,
    '[' * 200,
    '[]',
    '{}',
    'null',
    '*a',
    '&a [*a, *a]',
    '.nan',
    '-.inf',
    '1e400',
    '"\\x1b[31m"',
    '!!python/object/apply:os.system ["true"]',
    '[left, right, left]',
    '[0.2]',
    "'",
    '? [a]',
    '%',
)
_HOSTILE_CELLS = ('', 'nan', 'inf', '-1e999', '9' * 5000, '"', 'slip', '\x00', '1,5', '=1+1', '²')
