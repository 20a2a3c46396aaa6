# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/commands.md from the parsers of the commands.

python tools/document_commands.py
"""

from __future__ import annotations

import argparse
import functools
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from wheel_terra_estimator.cli.main import LABORATORY, sub_parsers

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'commands.md'
_INTRODUCTION = """# Commands

Written by `python tools/document_commands.py` from the help of the commands; do not edit.

`wheel-terra COMMAND --help` says the same as this page. After colcon the commands are
`ros2 run wheel_terra_estimator wheel-terra COMMAND`. Every command takes
`--debug` (traceback of an error), every one that writes `--overwrite` (replace an earlier output).
Completion in bash and zsh comes with the package; in a virtual environment
`. wheel_terra_estimator/cli/completion/wheel-terra` turns it on.
[Exit status](exit_status.md).
"""
_LABORATORY = """## Of the laboratory

Options: `wheel-terra COMMAND --help`.
"""


def page() -> str:
    """Return the page as Markdown."""
    lines = [_INTRODUCTION, 'In many commands (see `--help`):\n']
    lines += [*_common().values(), '']
    others = []
    for name, parser in sub_parsers().items():
        if name in LABORATORY:
            others.append(f'- `wheel-terra {name}`: {parser.description}')
        else:
            lines += _section(parser, f'wheel-terra {name}', 2)
    lines += [_LABORATORY, *others]
    return '\n'.join(lines).rstrip() + '\n'


@functools.cache
def _common() -> dict[str, str]:
    """Return the rows that stand in three commands or more, by the name of the option."""
    rows = [
        row
        for name, parser in sub_parsers().items()
        if name not in LABORATORY
        for action in parser._actions
        if action.option_strings and (row := _row(action))
    ]
    return {_name(row): row for row, count in Counter(rows).items() if count > 2}


def _name(row: str) -> str:
    return row.partition(': ')[0]


def _section(parser: argparse.ArgumentParser, title: str, depth: int) -> Iterator[str]:
    yield f'{"#" * depth} `{title}`\n'
    yield f'{_sentence(parser.description or "")}\n'
    if parser.epilog:
        examples = [line.strip() for line in parser.epilog.splitlines()[1:]]
        yield '\n'.join(['```sh', *examples, '```\n'])
    rows = [_row(action) for action in parser._actions]
    if own := [row for row in rows if row and _name(row) not in _common()]:
        yield '\n'.join([*own, ''])
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or '' for choice in action._choices_actions}
            for name, sub in action.choices.items():
                sub.description = sub.description or helps.get(name, '')
                yield from _section(sub, f'{title} {name}', depth + 1)


def _row(action: argparse.Action) -> str:
    if isinstance(action, argparse._SubParsersAction | argparse._HelpAction):
        return ''
    if action.dest in ('debug', 'overwrite') or action.help == argparse.SUPPRESS:
        return ''
    value = ''
    if action.nargs != 0:
        value = action.metavar if isinstance(action.metavar, str) else ''
        if not value:
            value = '{' + ','.join(map(str, action.choices)) + '}' if action.choices else ''
        value = value or action.dest.upper()
        if action.nargs in ('+', '*'):
            value += ' ...'
    names = ', '.join(f'{option} {value}'.strip() for option in action.option_strings) or value
    words = (action.help or '').replace('%%', '%').replace('%(default)s', str(action.default))
    required = ' (required)' if action.option_strings and action.required else ''
    return f'- `{names}`{required}: {words}'


def _sentence(words: str) -> str:
    return f'{words[:1].upper()}{words[1:]}.' if words else ''


if __name__ == '__main__':
    PAGE.write_text(page(), encoding='utf-8')
