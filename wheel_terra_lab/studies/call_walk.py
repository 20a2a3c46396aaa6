# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Functions and files of the package that an input passes on its way to the outputs.

::

    python -m wheel_terra_lab.studies.call_walk           # one message of wheel rates
    python -m wheel_terra_lab.studies.call_walk diagnose  # the shipped blind table
    python -m wheel_terra_lab.studies.call_walk convert   # two rows of the example of `convert`
    python -m wheel_terra_lab.studies.call_walk replay    # the bag that `convert` made of them
    # --list: each function in the order of its first call, with calls and lines

Counted is every function of the package that runs, properties too; comprehensions, lambdas and what
the standard library and numpy call are not. A message: what runs while it makes a set of estimates
with a cycle of the filter, and the fields of all topics are taken out of that set; the rover has
driven for five seconds with IMU, sinkage and references before. A command: all that runs from the
command line on, with report and table; all modules are imported before, and what is kept of an
earlier call (caches) is empty.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import pkgutil
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import wheel_terra_estimator
from wheel_terra_estimator.bags.table_to_bag import EXAMPLE
from wheel_terra_estimator.cli.main import main as wheel_terra
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_estimator.messages.pack import pack
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.messages.unpack import Message

PACKAGE = Path(wheel_terra_estimator.__file__).resolve().parent
STEP = 20_000_000  # [ns] between two messages of the IMU; every fifth time the wheels, too
WARM = 250  # steps
ROVER = ('generic_six_wheel', 'test_sand')
COMMANDS = ('diagnose', 'convert', 'replay')
COLUMNS = 'time,rpm_fl,torque_fl,rpm_fr,torque_fr,ax,ay,az,gx,gy,gz,sinkage_fl,gps_speed'
ROWS = 'T,20,5,-20,-5,0,0,1,0,0,0,8,0.25'  # T: time [s]
TWO_WHEELS = (
    'wheels.names:=[front_left,front_right]',
    'wheels.x:=[0.0,0.0]',
    'wheels.y:=[0.3,-0.3]',
    'wheels.radius:=[0.15,0.15]',
    'wheels.width:=[0.1,0.1]',
    'rover.mass:=20.0',
)


class Walk:
    """Notes the functions of the package that are called, in the order of their first call."""

    def __init__(self) -> None:
        self.calls: Counter[tuple[str, str]] = Counter()
        self.lines: dict[tuple[str, str], int] = {}

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        """Note a call; for ``sys.setprofile``."""
        code = frame.f_code
        if event != 'call' or code.co_name.startswith('<'):
            return
        path = Path(code.co_filename)
        if path.suffix == '.py' and path.is_relative_to(PACKAGE):
            name = getattr(code, 'co_qualname', code.co_name)
            key = path.relative_to(PACKAGE).as_posix(), name
            self.calls[key] += 1
            self.lines.setdefault(key, _length(code))

    @contextlib.contextmanager
    def noting(self) -> Iterator[None]:
        """Note what is called within the block, in threads that it starts, too."""
        threading.setprofile(self)
        sys.setprofile(self)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)


def _length(code: CodeType) -> int:
    return max(line for *_, line in code.co_lines() if line) - code.co_firstlineno + 1


def walk_of_message() -> Walk:
    """Drive, and note what the last message of wheel rates calls."""
    configuration = reader.load(list(ROVER))
    pipeline = Pipeline(configuration)
    names, none = configuration.wheels.names, np.zeros(0)
    noted = Walk()
    for step in range(WARM + 1):
        stamp = 1_700_000_000_000_000_000 + step * STEP
        imu = np.zeros(37)
        imu[[3, 27]] = 1.0, 9.80665  # level
        pipeline.hear('imu/data', Message(stamp, (), (imu,)))
        if step % 50 == 10:
            twist = np.zeros(42)
            twist[[0, 6]] = 0.05, 1e-4
            pipeline.hear('reference_odom', Message(stamp, (), (twist, np.zeros(3))))
        if step % 10 == 5:
            depths = np.full(len(names), 0.02), none, none
            pipeline.hear('sinkage', Message(stamp, names, depths))
        if step % 5 == 0:
            count = len(names)
            rates = Message(stamp, names, (none, np.full(count, 0.5), np.full(count, 3.0)))
            last = step == WARM
            with noted.noting() if last else contextlib.nullcontext():
                sets = pipeline.hear('joint_states', rates)
                for estimates in sets:
                    list(pack(estimates, names))
            assert not last or sets
    return noted


def walk_of_command(command: str) -> Walk:
    """Note what a command line calls."""
    for module in pkgutil.walk_packages([str(PACKAGE)], f'{PACKAGE.name}.'):
        if not module.name.startswith(f'{PACKAGE.name}.ros.'):
            importlib.import_module(module.name)
    noted = Walk()
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, 'output')
        if command == 'diagnose':
            trial = demo_recording('trial')
            table, rig = str(trial / 'blind.csv'), str(trial / 'rig.yaml')
            words = ['diagnose', table, '--config', rig, '-o', str(output)]
        else:
            words = _converted(Path(folder))
            if command == 'replay':
                _run(words)
                words = ['replay', words[-1], '-o', str(output)]
                words += ['--table', f'{folder}/t.csv', '--report', f'{folder}/r.html']
                words += [word for entry in TWO_WHEELS for word in ('-p', entry)]
        with noted.noting():
            _run(words)
    return noted


def _converted(folder: Path) -> list[str]:
    """Write a log and its map of columns; return the command that makes a bag of it."""
    rows = [ROWS.replace('T', f'{0.1 * step:.1f}') for step in range(100)]
    log, columns = folder / 'log.csv', folder / 'columns.yaml'
    log.write_text('\n'.join([COLUMNS, *rows]), encoding='utf-8')
    columns.write_text(EXAMPLE, encoding='utf-8')
    return ['convert', str(log), '--columns', str(columns), '-o', str(folder / 'drive')]


def _run(words: list[str]) -> None:
    with contextlib.redirect_stdout(io.StringIO()):
        status = wheel_terra(words)
    assert status == 0, words


def main() -> None:
    """Print the counts, and by folder."""
    command = next((word for word in sys.argv[1:] if word in COMMANDS), '')
    noted = walk_of_command(command) if command else walk_of_message()
    by_folder = Counter(path.rpartition('/')[0] for path, _ in noted.calls)
    files = len({path for path, _ in noted.calls})
    print(f'{len(noted.calls)} functions in {files} files, {noted.calls.total()} calls')
    for folder, count in sorted(by_folder.items()):
        print(f'  {folder:30} {count}')
    if '--list' in sys.argv:
        print('   calls lines')
        for (path, name), count in noted.calls.items():
            print(f'{count:8} {noted.lines[path, name]:5} {path}:{name}')


if __name__ == '__main__':
    main()
