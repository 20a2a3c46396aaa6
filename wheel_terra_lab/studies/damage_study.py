# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Share of the messages of damaged recordings that are recovered, of those whose bytes are intact.

    python -m wheel_terra_lab.studies.damage_study --files 400 --seed 0

Each file is made, damaged by one to three pieces (overwritten, zeroed, missing within the file or
at its end; one in three where a record, chunk or page begins), read, and given to ``wheel-terra
check``. A message is intact if none of the bytes of its own row or record differs, and a copy of
the description of its topic is intact; nothing else of the file counts. File number N follows from
the seed alone: ``--only N`` reads it again.
"""

from __future__ import annotations

import argparse
import io
import random
import re
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.studies.fuzzing import sqlite_maker
from wheel_terra_lab.studies.fuzzing.damage import touches
from wheel_terra_lab.studies.fuzzing.mcap_maker import Layout, Sample, make

TYPES = {
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/imu/data': 'sensor_msgs/msg/Imu',
    '/camera': 'sensor_msgs/msg/CompressedImage',
}
START = 1_700_000_000_000_000_000  # [ns]
MESSAGES = 600
PICTURE = (2_000, 30_000)  # least and greatest size of a picture [byte]
LAYOUTS = tuple(
    Layout(size, codec, checksums, summary, closed=closed)
    for size, codec, checksums, summary, closed in product(
        (0, 60_000, 2**20), ('', '', 'zstd', 'lz4'), (True, False), (True, False), (True, False)
    )
    if size or not codec
)
WRONG_WORDS = re.compile(
    r'was the recorder stopped|[GTPE]B|e\+\d\d|stamp each message|internal error|Traceback|nan\b'
)
"""What may not be said of a damaged file."""

Places = list[tuple[int, int]]


@dataclass
class Made:
    """A whole file: the bytes of each message in it, and those of each copy of the topics."""

    content: bytes
    messages: list[tuple[Places, Sample]]
    topics: list[Places]
    heads: list[int]  # where records, chunks or pages begin


@dataclass
class Score:
    """What was found in all files of a kind."""

    files: int = 0
    without_topics: int = 0  # files of which no description of the topics is left
    intact: int = 0
    recovered: int = 0
    altered: int = 0  # messages given whose bytes are not those of any recorded one
    unsaid: int = 0  # of them, in files of which nothing was said: no checksum covers them
    faults: list[str] = field(default_factory=list)

    def line(self, kind: str) -> str:
        """Return the figures as a row of a table."""
        share = 100.0 * self.recovered / max(self.intact, 1)
        return (
            f'| {kind} | {self.files} | {self.without_topics} | {self.intact} | {share:.2f} % | '
            f'{self.altered} | {self.unsaid} | {len(self.faults)} |'
        )


HEAD = (
    '| storage | files | no topics left | messages intact | recovered | altered | of them unsaid | '
    'faults |\n|---|---|---|---|---|---|---|---|'
)


def main() -> int:
    """Damage and read the files that were asked for; status 1 if something was lost in silence."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--files', type=int, default=400, metavar='N', help='of each kind')
    parser.add_argument('--seed', type=int, default=0, metavar='S', help='number of the first')
    parser.add_argument('--only', type=int, metavar='N', help='this file alone')
    parser.add_argument('--kind', choices=MAKERS)
    arguments = parser.parse_args()
    numbers = range(arguments.seed, arguments.seed + arguments.files)
    if arguments.only is not None:
        numbers = range(arguments.only, arguments.only + 1)
    scores = {kind: study(kind, numbers) for kind in MAKERS if arguments.kind in (None, kind)}
    print(HEAD)
    for kind, score in scores.items():
        print(score.line(kind))
    return 1 if any(score.faults for score in scores.values()) else 0


def study(kind: str, numbers: range) -> Score:
    """Make, damage, read and judge the files of a kind."""
    score = Score()
    with TemporaryDirectory() as folder:
        for number in numbers:
            dice = random.Random(f'{kind} {number}')
            made = MAKERS[kind](dice, Path(folder))
            content, touched = damaged(made, dice)
            path = Path(folder) / f'drive.{kind}'
            path.write_bytes(content)
            for fault in judge(path, made, touched, score):
                score.faults.append(f'{kind} {number}: {fault}')
                print(score.faults[-1], file=sys.stderr, flush=True)
    return score


def judge(path: Path, made: Made, touched: Places, score: Score) -> list[str]:
    """Add what is found in a file to the score; return what is wrong with it."""

    def whole(places: Places) -> bool:
        return not any(touches(touched, *place) for place in places)

    described = any(whole(places) for places in made.topics)
    intact = Counter(
        tuple(sample) for places, sample in made.messages if described and whole(places)
    )
    recorded = Counter(tuple(sample) for _, sample in made.messages)
    found, notes = read(path)
    missing, altered = intact - found, found - recorded
    score.files += 1
    score.without_topics += not described
    score.intact += intact.total()
    score.recovered += (intact & found).total()
    score.altered += altered.total()
    score.unsaid += 0 if notes else altered.total()
    faults = []
    if found.total() < recorded.total() and not notes:
        faults.append(f'{recorded.total() - found.total()} messages lost in silence')
    # Packed bytes that are damaged may unpack to a second copy of a message: it counts as altered.
    if found.total() > recorded.total() or (path.suffix == '.db3' and twice(found, recorded)):
        faults.append('messages that were never recorded')
    if missing.total() > 0.1 * intact.total():
        faults.append(f'{missing.total()} of {intact.total()} intact messages lost ({notes})')
    said = ' '.join(notes) + checked(path)
    if wrong := WRONG_WORDS.search(said):
        faults.append(f'says: {said[max(0, wrong.start() - 80) : wrong.end() + 40]}')
    return faults


def twice(found: Counter[Any], recorded: Counter[Any]) -> bool:
    """Whether a recorded message was given more often than it was recorded."""
    return any(count > recorded[message] for message, count in found.items() if message in recorded)


def read(path: Path) -> tuple[Counter[Any], list[str]]:
    """Return the messages of a file and what is said of it."""
    try:
        with open_bag(path) as bag:
            found = Counter((m.log_time, m.topic, m.data) for m in bag.messages(tuple(bag.topics)))
            return found, bag.notes
    except UserError as error:
        return Counter(), [str(error)]


def checked(path: Path) -> str:
    """Return what ``wheel-terra check`` says of a file."""
    from wheel_terra_estimator.cli.main import main as command

    said = io.StringIO()
    with redirect_stderr(said), redirect_stdout(said):
        status = command(['check', str(path)])
    return said.getvalue() + ('internal error' if status > 2 else '')


def damaged(made: Made, dice: random.Random) -> tuple[bytes, Places]:
    """Damage a file in one to three places.

    Returns
    -------
    content : bytes
        The damaged file.
    touched : list of (int, int)
        Begin and end of what differs or is missing, in places of the whole file. What only stands
        elsewhere, behind bytes that are missing, is not among it.
    """
    content = made.content
    new, touched, gone = bytearray(content), [], []
    for _ in range(dice.choice((1, 1, 2, 3))):
        size = min(dice.choice((1, 8, 64, 512, 4096, 8192, len(content) // 10)), len(content))
        at = dice.randrange(len(content) - size + 1)
        if dice.random() < 0.3:
            at = dice.choice(made.heads) + dice.randrange(16)
        elif dice.random() < 0.5 and size >= 512:  # sectors of a disk
            at = at // 512 * 512
        end = min(at + size, len(content))
        kind = dice.choice(('bytes', 'zeros', 'missing', 'cut'))
        if kind == 'cut':
            at, end = dice.randrange(len(content) // 10, len(content)), len(content)
        if kind in ('missing', 'cut'):
            gone.append((at, end))
        else:
            new[at:end] = bytes(end - at) if kind == 'zeros' else dice.randbytes(end - at)
    touched = [(at, at + 1) for at in range(len(content)) if new[at] != content[at]]
    kept, at = bytearray(), 0
    for begin, end in _joined(gone):
        kept += new[at:begin]
        at = end
    return bytes(kept + new[at:]), _joined([*touched, *gone])


def _joined(places: Places) -> Places:
    joined: Places = []
    for begin, end in sorted(places):
        if joined and begin <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((begin, end))
    return joined


def _mcap(dice: random.Random, folder: Path) -> Made:
    layout = dice.choice(LAYOUTS)
    made = make(_samples(dice), TYPES, layout)
    topics = [[place] for place in made.definitions]
    messages = [([(begin, end)], sample) for begin, end, sample in made.messages]
    heads = [begin for begin, _, _ in (*made.parts, *made.messages)]
    return Made(made.content, messages, topics, heads)


def _sqlite(dice: random.Random, folder: Path) -> Made:
    samples = _samples(dice)
    path = folder / 'whole.db3'
    sqlite_maker.write(path, samples, TYPES)
    content = path.read_bytes()
    places = sqlite_maker.message_places(content, samples, TYPES)
    topics = sqlite_maker.topic_places(content, TYPES)
    heads = [*range(0, len(content), sqlite_maker.PAGE)]
    return Made(content, list(zip(places, samples, strict=True)), [topics], heads)


MAKERS: dict[str, Callable[[random.Random, Path], Made]] = {'mcap': _mcap, 'db3': _sqlite}


def _samples(dice: random.Random) -> list[Sample]:
    """Return messages as a driving rover's; a file in three has pictures among them."""
    factory, time = MessageFactory(), START
    pictures = dice.random() < 0.3
    found = []
    for number in range(MESSAGES):
        time += dice.randrange(9_000_000, 11_000_000)
        header = factory.header(time - 2_000_000)
        rate = dice.gauss(2.0, 0.02)
        if pictures and number % 20 == 10:
            data = b'\0\1\0\0' + dice.randbytes(dice.randrange(*PICTURE))
            found.append(Sample(time, '/camera', data))
            continue
        message: Any
        if number % 2:
            names = ('left', 'right')
            message = factory.joint_state(header, names, velocity=(rate, rate), effort=(3.0, rate))
        else:
            noise = [dice.gauss(0.0, 0.02) for _ in range(6)]
            force = (noise[0], noise[1], 9.81 + noise[2])
            message = factory.imu(header, force, tuple(noise[3:]), (0.0, 0.0, 0.0, 1.0))
        kind = message.__msgtype__
        data = bytes(factory.store.serialize_cdr(message, kind))
        found.append(Sample(time, list(TYPES)[1 - number % 2], data))
    return found


if __name__ == '__main__':
    sys.exit(main())
