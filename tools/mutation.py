# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Mutants of the package: whether tests notice a changed sign, comparison, constant, statement.

    python tools/mutation.py run mutants.jsonl --count 200     # some hours; stop and go on at will
    python tools/mutation.py run mutants.jsonl --folders terramechanics --count 30
    python tools/mutation.py show mutants.jsonl                # share caught, and the survivors

Each mutant is made in a copy of the package, and the tests of its folder run on the copy: first
the files that import the mutated module, then the rest of the folder, until one fails. Mutants are
spread over the files by their number of places; the same seed gives the same ones.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'wheel_terra_estimator'
FOLDERS = ('terramechanics', 'estimation', 'discrepancy')
TIME_LIMIT = 240.0  # [s] for the tests of one mutant; what hangs counts as caught

_COMPARISONS = {'<': '>=', '<=': '>', '>': '<=', '>=': '<', '==': '!=', '!=': '=='}
_SIGNS = {'+': '-', '-': '+', '*': '/', '/': '*', '**': '*'}
_LOGIC = {'and': 'or', 'or': 'and'}
_CAUGHT, _SURVIVED = 'caught', 'survived'


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
        self.found.append(Mutant(self._file, line, kind, start, end, old, new))

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

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add('constant', node.lineno, *self._span(node), str(not value))
        elif isinstance(value, (int, float)):
            other = 1 if value == 0 else (2 * value if isinstance(value, float) else value + 1)
            self._add('constant', node.lineno, *self._span(node), repr(other))

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


def places(file: Path) -> list[Mutant]:
    """Return all mutants of a file."""
    text = file.read_text(encoding='utf-8')
    finder = _Places(file.relative_to(ROOT).as_posix(), text)
    finder.visit(ast.parse(text))
    return finder.found


def chosen(folders: list[str], count: int, seed: int) -> list[Mutant]:
    """Return mutants spread over the files by their number of places, in random order."""
    files = [f for folder in folders for f in sorted((ROOT / PACKAGE / folder).rglob('*.py'))]
    found = {file: places(file) for file in files}
    total = sum(map(len, found.values()))
    generator = random.Random(seed)
    picked = []
    for mutants in found.values():
        share = count * len(mutants) / max(total, 1)
        number = int(share) + (generator.random() < share - int(share))
        picked += generator.sample(mutants, min(number, len(mutants)))
    generator.shuffle(picked)
    return picked


def tests_of(file: str) -> list[str]:
    """Return the tests of the folder of a file, those that name its module first."""
    folder = Path(file).parts[1]
    stem = Path(file).stem
    tests = sorted((ROOT / 'test' / folder).rglob('test_*.py'))
    near = [t for t in tests if stem in t.read_text(encoding='utf-8')]
    return [str(t.relative_to(ROOT)) for t in (*near, *(t for t in tests if t not in near))]


def verdict(mutant: Mutant, copy: Path) -> str:
    """Make a mutant in the copy, run its tests there, mend the copy."""
    target = copy / mutant.file
    text = (ROOT / mutant.file).read_text(encoding='utf-8')
    target.write_text(text[: mutant.start] + mutant.new + text[mutant.end :], encoding='utf-8')
    command = [sys.executable, '-m', 'pytest', '-q', '-x', '-n', '0', '-m', 'not slow']
    try:
        result = subprocess.run(
            [*command, '-p', 'no:cacheprovider', *tests_of(mutant.file)],
            cwd=copy,
            env={**os.environ, 'PYTHONPATH': str(copy), 'PYTHONDONTWRITEBYTECODE': '1'},
            capture_output=True,
            timeout=TIME_LIMIT,
            check=False,
        )
        return _SURVIVED if result.returncode == 0 else _CAUGHT
    except subprocess.TimeoutExpired:
        return _CAUGHT
    finally:
        target.write_text(text, encoding='utf-8')


def run(arguments: argparse.Namespace) -> None:
    """Judge the mutants that are not in the file yet."""
    done = {(row['file'], row['start'], row['new']) for row in _read(arguments.file)}
    mutants = chosen(arguments.folders, arguments.count, arguments.seed)
    with tempfile.TemporaryDirectory() as folder, arguments.file.open('a') as stream:
        copy = Path(folder) / ROOT.name
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns('.git', '__pycache__', 'site'))
        _link_neighbours(Path(folder))
        for number, mutant in enumerate(mutants, 1):
            if mutant.key in done:
                continue
            row = {**asdict(mutant), 'verdict': verdict(mutant, copy)}
            stream.write(json.dumps(row) + '\n')
            stream.flush()
            print(f'{number}/{len(mutants)} {row["verdict"]}: {_words(row)}', flush=True)


def _link_neighbours(folder: Path) -> None:
    """Let tests find what lies beside the repository (``../shared``)."""
    shared = ROOT.parent / 'shared'
    if shared.is_dir():
        (folder / 'shared').symlink_to(shared)


def show(arguments: argparse.Namespace) -> None:
    """Print the share caught by folder and kind, and the survivors."""
    rows = list(_read(arguments.file))
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
    for row in sorted(survivors, key=lambda r: (r['file'], r['line'])):
        print(f'  {_words(row)}')


def _words(row: dict[str, object]) -> str:
    old, new = (' '.join(str(row[key]).split())[:60] for key in ('old', 'new'))
    return f'{row["file"]}:{row["line"]} {row["kind"]}: {old!r} -> {new!r}'


def _read(path: Path) -> Iterator[dict[str, object]]:
    if path.is_file():
        for line in path.read_text(encoding='utf-8').splitlines():
            yield json.loads(line)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    runs = commands.add_parser('run', help='judge mutants that are not in the file yet')
    runs.add_argument('file', type=Path)
    runs.add_argument('--count', type=int, default=200)
    runs.add_argument('--seed', type=int, default=1)
    runs.add_argument('--folders', nargs='+', default=list(FOLDERS))
    runs.set_defaults(command=run)
    shows = commands.add_parser('show', help='share caught, and survivors')
    shows.add_argument('file', type=Path)
    shows.set_defaults(command=show)
    arguments = parser.parse_args()
    arguments.command(arguments)


if __name__ == '__main__':
    main()
