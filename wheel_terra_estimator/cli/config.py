# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra config``: the files that come with the package."""

from __future__ import annotations

import argparse
import re

from wheel_terra_estimator.configuration import shipped
from wheel_terra_estimator.errors import UserError

EXAMPLES = ('wheel-terra config list rovers', 'wheel-terra config show frostyboy')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    actions = parser.add_subparsers(dest='action', required=True, metavar='list|show|path')
    listing = actions.add_parser('list', help='names of the shipped files')
    listing.add_argument(
        'name', nargs='?', default='', metavar='FOLDER', help='rovers, soils or scenarios'
    )
    show = actions.add_parser('show', help='print a shipped file')
    show.add_argument('name', metavar='NAME', help='bare name, such as frostyboy')
    path = actions.add_parser('path', help='print where the shipped files are, or one of them')
    path.add_argument('name', nargs='?', default='', metavar='NAME', help='bare name')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    if arguments.action == 'show':
        print(shipped.find(arguments.name).read_text(encoding='utf-8'), end='')
    elif arguments.action == 'path':
        print(shipped.find(arguments.name) if arguments.name else shipped.configuration_folder())
    else:
        _list(arguments.name.rstrip('/'))
    return 0


def _list(folder: str) -> None:
    files = shipped.files()
    folders = sorted({name.split('/')[0] for name in files})
    if folder and folder not in folders:
        raise UserError(f'no shipped folder {folder}; there are: {", ".join(folders)}')
    for name, path in files.items():
        if not folder or name.split('/')[0] == folder:
            print(f'{name:36s} {_headline(path.read_text(encoding="utf-8"))}')


def _headline(text: str) -> str:
    """Return the first words of the comment on top."""
    lines = []
    for line in text.splitlines():
        if not line.startswith('#') or not line.strip('# '):
            break
        lines.append(line.strip('# '))
    sentence, *_ = re.split(r'\. (?=[A-Z])', ' '.join(lines), maxsplit=1)  # no end: et al. 2025
    return sentence.rstrip('.')
