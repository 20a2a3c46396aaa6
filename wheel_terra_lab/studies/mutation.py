# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Mutants of the package: whether tests notice a changed sign, comparison, constant, statement.

    python -m wheel_terra_lab.studies.mutation map calls.jsonl  # which test calls what; 5 minutes
    python -m wheel_terra_lab.studies.mutation run mutants.jsonl --map calls.jsonl --count 240
    python -m wheel_terra_lab.studies.mutation show mutants.jsonl  # share caught, and the survivors

Each mutant is made in a copy of the package, and on the copy run those tests that call the mutated
function (any function of the file, where it stands outside of one), the cheapest first, until one
fails or `TESTS_LIMIT` seconds of tests are spent. Mutants are spread over the files by their number
of places; the same seed gives the same ones. Caught is what makes a test fail that passes without
it, or hangs; what ends the run otherwise (an import that breaks, a fixture, a test that is gone)
is an error, counted apart. `again` judges all but the caught once more, after tests were added
(make a new map before).
"""

from __future__ import annotations

import argparse
import ast
import compileall
import importlib
import os
import py_compile
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pytest

from wheel_terra_lab.jobs import ResultFile

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = 'wheel_terra_estimator'
OURS = (PACKAGE, 'wheel_terra_lab')
FOLDERS = ('terramechanics', 'estimation', 'discrepancy')
LEFT_OUT = ('discrepancy/report/pictures.py',)  # places and sizes in pictures are looked at
TESTS_LIMIT = 8.0  # [s] of tests, as the map has them, that one mutant is shown
TIME_LIMIT = 60  # [s] of processor time for one mutant; what hangs counts as caught
NICENESS = 10
LIBRARIES = (  # loaded once for all mutants
    'numpy',
    'scipy.optimize',
    'scipy.special',
    'scipy.stats',
    'filterpy.kalman',
    'hypothesis',
    'rosbags.rosbag2',
    'rosbags.typesys.stores.ros2_jazzy',
    'matplotlib.figure',
    'jinja2',
    'yaml',
)
PYTEST = (sys.executable, '-m', 'pytest', '-q', '-n', '0')

_COMPARISONS = {'<': '>=', '<=': '>', '>': '<=', '>=': '<', '==': '!=', '!=': '=='}
_SIGNS = {'+': '-', '-': '+', '*': '/', '/': '*', '**': '*'}
_LOGIC = {'and': 'or', 'or': 'and'}
_CAUGHT, _SURVIVED, _ERROR = 'caught', 'survived', 'error'
_KEY = ('file', 'start', 'new', 'test')


@dataclass(frozen=True)
class Mutant:
    """A place in a file, as offsets into its text, and what stands there instead."""

    file: str
    line: int
    kind: str
    start: int
    end: int
    old: str
    new: str
    function: int = 0
    """First line of the function around it; 0 outside of functions."""

    @property
    def key(self) -> tuple[str, int, str]:
        """What tells it from the others while the file stays as it is."""
        return self.file, self.start, self.new


class _Places(ast.NodeVisitor):
    """Finds all places of a file that can be mutated."""

    def __init__(self, file: str, text: str) -> None:
        self._file, self._text = file, text
        self._lines = [0]
        for line in text.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))
        self._raw = text.splitlines(keepends=True)
        self.found: list[Mutant] = []
        self._function = 0

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        outer = self._function
        self._function = min([node.lineno, *(d.lineno for d in node.decorator_list)])
        for part in node.body:
            self.visit(part)
        self._function = outer

    def _offset(self, line: int, column: int) -> int:
        """Return the offset of a place; columns of ast count bytes."""
        before = self._raw[line - 1].encode()[:column].decode()
        return self._lines[line - 1] + len(before)

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return (
            self._offset(node.lineno, node.col_offset),
            self._offset(node.end_lineno, node.end_col_offset),
        )

    def _add(self, kind: str, line: int, start: int, end: int, new: str) -> None:
        old = self._text[start:end]
        self.found.append(Mutant(self._file, line, kind, start, end, old, new, self._function))

    def _between(self, kind: str, left: ast.expr, right: ast.expr, swaps: dict[str, str]) -> None:
        start, end = self._span(left)[1], self._span(right)[0]
        operator = self._text[start:end].strip(' ()\n\\')
        if operator in swaps:
            place = start + self._text[start:end].index(operator)
            self._add(kind, left.lineno, place, place + len(operator), swaps[operator])

    def visit_Compare(self, node: ast.Compare) -> None:
        self._between('comparison', node.left, node.comparators[0], _COMPARISONS)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self._between('sign', node.left, node.right, _SIGNS)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        self._between('logic', node.values[0], node.values[1], _LOGIC)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, (ast.USub, ast.Not)):
            start, end = self._span(node)[0], self._span(node.operand)[0]
            self._add('sign', node.lineno, start, end, '')
        self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for part in node.body:  # its decorators change nothing that a correct program does
            self.visit(part)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg != 'strict':  # of zip: nothing, where the lengths agree
            self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add('constant', node.lineno, *self._span(node), str(not value))
        elif isinstance(value, (int, float)):
            self._add('constant', node.lineno, *self._span(node), repr(_another(value)))

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._add('statement', node.lineno, *self._span(node), 'pass')
        if not isinstance(node.value, ast.Constant):  # a docstring is none
            self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._add('statement', node.lineno, *self._span(node), 'pass')
        self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Leave the words of errors alone."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)  # annotations are not run


def _another(value: float) -> float:
    """Return the number plus one, as mutmut and cosmic-ray do, or twice a large one."""
    return 2 * value if isinstance(value, float) and abs(value) > 1.0 else value + 1


def places(file: Path) -> list[Mutant]:
    """Return all mutants of a file."""
    text = file.read_text(encoding='utf-8')
    finder = _Places(file.relative_to(ROOT).as_posix(), text)
    finder.visit(ast.parse(text))
    return finder.found


def chosen(folders: list[str], count: int, seed: int) -> list[Mutant]:
    """Return mutants spread over the files by their number of places, in random order."""
    files = [f for folder in folders for f in sorted((ROOT / PACKAGE / folder).rglob('*.py'))]
    found = {file: places(file) for file in files if not file.as_posix().endswith(LEFT_OUT)}
    total = sum(map(len, found.values()))
    generator = random.Random(seed)
    picked = []
    for mutants in found.values():
        share = count * len(mutants) / max(total, 1)
        number = int(share) + (generator.random() < share - int(share))
        picked += generator.sample(mutants, min(number, len(mutants)))
    generator.shuffle(picked)
    return picked


class CallMap:
    """Which tests call which function, and what they cost."""

    def __init__(self, path: Path) -> None:
        self._rows = sorted(_read(path), key=lambda row: row['seconds'])
        self._calls = [set(row['functions']) for row in self._rows]
        self._files = [{call.rpartition(':')[0] for call in calls} for calls in self._calls]

    def tests(self, mutant: Mutant) -> list[str]:
        """Return the tests that reach a mutant, cheapest first, within the limit."""
        key = f'{mutant.file}:{mutant.function}'
        chosen, spent = [], 0.0
        for row, calls, files in zip(self._rows, self._calls, self._files, strict=True):
            if key in calls if mutant.function else mutant.file in files:
                spent += row['seconds']
                if spent > TESTS_LIMIT:
                    break
                chosen.append(row['test'])
        return chosen


def make_map(arguments: argparse.Namespace) -> None:
    """Run the tests of the folders once and note what each of them calls."""
    arguments.file.unlink(missing_ok=True)
    subprocess.run(
        [
            *PYTEST,
            '-m',
            'not slow',
            '-p',
            'wheel_terra_lab.studies.call_map',
            *(f'test/{f}' for f in arguments.folders),
        ],
        cwd=ROOT,
        env={
            **os.environ,
            'PYTHONPATH': str(ROOT),
            'CALL_MAP': str(arguments.file.resolve()),
        },
        preexec_fn=lambda: os.nice(NICENESS),
        check=True,
    )


def verdict(mutant: Mutant, copy: Path, tests: list[str]) -> str:
    """Make a mutant in the copy, run its tests there, mend the copy."""
    if not tests:
        return _SURVIVED
    target = copy / mutant.file
    text = target.read_text(encoding='utf-8')  # of the copy: ROOT may be edited meanwhile
    target.write_text(text[: mutant.start] + mutant.new + text[mutant.end :], encoding='utf-8')
    try:
        status, failed = _forked(copy, tests)
    finally:
        target.write_text(text, encoding='utf-8')
    if status == -signal.SIGXCPU:
        return _CAUGHT
    if status == pytest.ExitCode.OK:
        return _SURVIVED
    sound = status == pytest.ExitCode.TESTS_FAILED and failed
    return _CAUGHT if sound and _forked(copy, [failed])[0] == pytest.ExitCode.OK else _ERROR


def _forked(copy: Path, tests: list[str]) -> tuple[int, str]:
    """Run tests on the copy: status of pytest (or minus a signal), and the test that failed."""
    note = copy / 'failed_test'
    note.unlink(missing_ok=True)
    child = os.fork()  # the libraries are there already
    if child == 0:
        _run_tests(copy, tests, note)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return status, note.read_text(encoding='utf-8') if note.exists() else ''


class _Failure:
    """Plugin of pytest: notes the test whose own lines failed, not its fixtures."""

    def __init__(self, note: Path) -> None:
        self._note = note

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and report.when == 'call':
            self._note.write_text(report.nodeid, encoding='utf-8')


def _run_tests(copy: Path, tests: list[str], note: Path) -> None:
    """Run tests on the copy and end the process with their status."""
    status = int(pytest.ExitCode.INTERNAL_ERROR)
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (TIME_LIMIT, TIME_LIMIT + 1))
        os.chdir(copy)
        sys.dont_write_bytecode = True  # of a mutant: it could be taken for the mended file
        sys.path.insert(0, str(copy))
        for name in [n for n in sys.modules if n.partition('.')[0] in OURS]:
            del sys.modules[name]  # what this study needs of them: the tests take the copy's
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        words = ['-q', '-x', '-p', 'no:cacheprovider', *tests]
        status = int(pytest.main(words, plugins=[_Failure(note)]))
    finally:
        os._exit(status)


def run(arguments: argparse.Namespace) -> None:
    """Judge the mutants that are not in the file yet."""
    done = {(row['file'], row['start'], row['new']) for row in _read(arguments.file)}
    mutants = chosen(arguments.folders, arguments.count, arguments.seed)
    judge([m for m in mutants if m.key not in done], arguments)


def again(arguments: argparse.Namespace) -> None:
    """Judge what a file has not as caught once more; the later verdict counts."""
    rows = list(_read(arguments.file))
    fields = Mutant.__dataclass_fields__
    survivors = [
        Mutant(**{key: row[key] for key in fields}) for row in rows if row['verdict'] != _CAUGHT
    ]
    for mutant in survivors:
        text = (ROOT / mutant.file).read_text(encoding='utf-8')
        if text[mutant.start : mutant.end] != mutant.old:
            sys.exit(f'{mutant.file} has changed since; run it anew')
    judge(survivors, arguments)


def judge(mutants: list[Mutant], arguments: argparse.Namespace) -> None:
    """Judge mutants one after the other and write each verdict at once."""
    os.nice(NICENESS)
    for library in LIBRARIES:
        importlib.import_module(library)
    call_map = CallMap(arguments.map)
    results = ResultFile(arguments.file)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / ROOT.name
        os.environ['PYTHONPATH'] = str(copy)  # for processes that tests start
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns('.git', '__pycache__', 'site'))
        _link_neighbours(Path(folder))
        # By content, not by time: a mutant is written and mended within a second.
        mode = py_compile.PycInvalidationMode.CHECKED_HASH
        for package in OURS:
            compileall.compile_dir(copy / package, quiet=1, invalidation_mode=mode)
        for number, mutant in enumerate(mutants, 1):
            row = {**asdict(mutant), 'verdict': verdict(mutant, copy, call_map.tests(mutant))}
            results.add(row)
            print(f'{number}/{len(mutants)} {row["verdict"]}: {_words(row)}', flush=True)


def _link_neighbours(folder: Path) -> None:
    """Let tests find what lies beside the repository (``../shared``)."""
    shared = ROOT.parent / 'shared'
    if shared.is_dir():
        (folder / 'shared').symlink_to(shared)


def show(arguments: argparse.Namespace) -> None:
    """Print the share caught by folder and kind, the survivors, the errors."""
    everything = list(_read(arguments.file))
    rows = [row for row in everything if row['verdict'] != _ERROR]
    for name, key in (
        ('folder', lambda r: Path(r['file']).parts[1]),
        ('kind', lambda r: r['kind']),
    ):
        all_of = Counter(key(row) for row in rows)
        caught = Counter(key(row) for row in rows if row['verdict'] == _CAUGHT)
        print(f'{name}: ' + ', '.join(f'{k} {caught[k]}/{n}' for k, n in sorted(all_of.items())))
    survivors = [row for row in rows if row['verdict'] == _SURVIVED]
    share = 1.0 - len(survivors) / max(len(rows), 1)
    print(f'caught: {share:.0%} of {len(rows)}; survivors:')
    _list(survivors)
    print(f'errors, not counted: {len(everything) - len(rows)}')
    _list([row for row in everything if row['verdict'] == _ERROR])


def _list(rows: list[dict[str, Any]]) -> None:
    for row in sorted(rows, key=lambda r: (r['file'], r['line'])):
        print(f'  {_words(row)}')


def _words(row: dict[str, Any]) -> str:
    old, new = (' '.join(str(row[key]).split())[:60] for key in ('old', 'new'))
    return f'{row["file"]}:{row["line"]} {row["kind"]}: {old!r} -> {new!r}'


def _read(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a file; of several about one mutant the last."""
    rows = ResultFile(path).rows
    yield from {tuple(row.get(key) for key in _KEY): row for row in rows}.values()


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    maps = commands.add_parser('map', help='note which test calls which function')
    maps.set_defaults(command=make_map)
    runs = commands.add_parser('run', help='judge mutants that are not in the file yet')
    runs.add_argument('--count', type=int, default=240)
    runs.add_argument('--seed', type=int, default=1)
    runs.set_defaults(command=run)
    repeats = commands.add_parser('again', help='judge what is not caught once more')
    repeats.set_defaults(command=again)
    for command in (maps, runs, repeats):
        command.add_argument('file', type=Path)
        command.add_argument('--folders', nargs='+', default=list(FOLDERS))
    for command in (runs, repeats):
        command.add_argument('--map', type=Path, required=True, help='file that `map` wrote')
    shows = commands.add_parser('show', help='share caught, survivors, errors')
    shows.add_argument('file', type=Path)
    shows.set_defaults(command=show)
    arguments = parser.parse_args()
    arguments.command(arguments)


if __name__ == '__main__':
    main()
