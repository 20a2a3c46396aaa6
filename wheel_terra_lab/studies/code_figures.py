# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Size and complexity of a folder of the package, at one revision beside another.

    python -m wheel_terra_lab.studies.code_figures wheel_terra_estimator/estimation REVISION HEAD

Complexity of a function: branches, loops, handlers, conditions and boolean operators in its syntax
tree, plus one. Mutable fields: those of dataclasses that are not frozen, and the attributes that
methods other than ``__init__`` assign to ``self``.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass

_BRANCHES = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp, ast.comprehension)
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
MOST = 15
"""Complexity above which a function needs a reason."""


@dataclass(frozen=True)
class Function:
    """What is counted of one function."""

    place: str
    lines: int
    complexity: int


def sources(folder: str, revision: str) -> Iterator[tuple[str, str]]:
    """Yield path and text of the Python files of a folder at a revision."""
    git = ['git', 'ls-tree', '-r', '--name-only', revision, '--', folder]
    for path in subprocess.run(git, capture_output=True, text=True, check=True).stdout.split():
        if path.endswith('.py'):
            show = ['git', 'show', f'{revision}:{path}']
            yield path, subprocess.run(show, capture_output=True, text=True, check=True).stdout


def complexity(function: ast.AST) -> int:
    """Return the complexity of a function, functions within it left out."""
    found, waiting = 1, list(ast.iter_child_nodes(function))
    while waiting:
        node = waiting.pop()
        if isinstance(node, _FUNCTIONS):
            continue
        found += isinstance(node, _BRANCHES)
        if isinstance(node, ast.BoolOp):
            found += len(node.values) - 1
        waiting += ast.iter_child_nodes(node)
    return found


def mutable_fields(tree: ast.Module) -> int:
    """Return the number of fields that change after they were made."""
    found = 0
    for node in ast.walk(tree):
        if not isinstance(node, ast.ClassDef):
            continue
        decorators = [ast.unparse(d) for d in node.decorator_list]
        if any(d.startswith('dataclass') and 'frozen=True' not in d for d in decorators):
            found += sum(isinstance(item, ast.AnnAssign) for item in node.body)
            continue
        methods = [m for m in node.body if isinstance(m, _FUNCTIONS) and m.name != '__init__']
        found += len(
            {
                target.attr
                for method in methods
                for item in ast.walk(method)
                if isinstance(item, (ast.Assign, ast.AugAssign))
                for whole in (item.targets if isinstance(item, ast.Assign) else [item.target])
                for target in (whole.elts if isinstance(whole, ast.Tuple) else [whole])
                if isinstance(target, ast.Attribute) and ast.unparse(target.value) == 'self'
            }
        )
    return found


def figures(folder: str, revision: str) -> dict[str, str]:
    """Return the rows of the table for one revision."""
    files = dict(sources(folder, revision))
    trees = {path: ast.parse(text) for path, text in files.items()}
    functions = [
        Function(f'{path}:{n.name}', (n.end_lineno or n.lineno) - n.lineno + 1, complexity(n))
        for path, tree in trees.items()
        for n in ast.walk(tree)
        if isinstance(n, _FUNCTIONS)
    ]
    worst = max(functions, key=lambda f: f.complexity)
    longest = max(functions, key=lambda f: f.lines)
    return {
        'files': str(len(files)),
        'lines that are not blank': str(
            sum(bool(line.strip()) for text in files.values() for line in text.splitlines())
        ),
        'functions': str(len(functions)),
        'longest function [lines]': f'{longest.lines} (`{longest.place.rpartition("/")[2]}`)',
        'greatest complexity': f'{worst.complexity} (`{worst.place.rpartition("/")[2]}`)',
        f'functions above {MOST}': str(sum(f.complexity > MOST for f in functions)),
        'mutable fields': str(sum(map(mutable_fields, trees.values()))),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder')
    parser.add_argument('revisions', nargs='+')
    arguments = parser.parse_args()
    columns = [figures(arguments.folder, revision) for revision in arguments.revisions]
    print(f'| `{arguments.folder}` | ' + ' | '.join(arguments.revisions) + ' |')
    print('|---' * (1 + len(columns)) + '|')
    for name in columns[0]:
        print(f'| {name} | ' + ' | '.join(column[name] for column in columns) + ' |')


if __name__ == '__main__':
    main()
