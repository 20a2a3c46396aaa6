# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Options of several commands: paths that are written, never over inputs, and ``--remap``.

An option that names an output has ``action=Output``; one that names an input has
``type=Path``, or ``type=FileName`` where the bare name of a shipped file will do.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import refuse_inputs


class Output(argparse.Action):
    """An option that names a file or folder to be written."""

    def __init__(self, *names: Any, **settings: Any) -> None:
        super().__init__(*names, **{'type': Path, **settings})

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Keep the path, and that it is an output."""
        setattr(namespace, self.dest, values)
        namespace.outputs = {**getattr(namespace, 'outputs', {}), self.dest: values}


def add_output(
    parser: argparse.ArgumentParser, words: str, metavar: str = 'DIR', **settings: Any
) -> None:
    """Declare ``-o``, the file or folder that the command is run for, and ``--overwrite``."""
    parser.add_argument('-o', '--output', action=Output, metavar=metavar, help=words, **settings)
    parser.add_argument('--overwrite', action='store_true', help='replace an earlier output')


def check(arguments: argparse.Namespace) -> None:
    """Refuse outputs that are, or hold, or lie in what the command reads, and those named twice.

    Raises UserError where an output is one of these, or a parameter file cannot be read.
    """
    outputs: dict[str, Path] = getattr(arguments, 'outputs', {})
    if not outputs:
        return
    inputs = list(_inputs(arguments, outputs))
    for path in outputs.values():
        refuse_inputs(path, inputs)
    for one, other in combinations(outputs.values(), 2):
        if one.absolute() == other.absolute():
            raise UserError(f'{one}: given for two outputs; give each its own path')


def file_or_entry(text: str) -> Path | str:
    """Return the value of an option ``FILE|NAME=VALUE``: a path counts as an input."""
    return text if '=' in text else Path(text)


def _inputs(arguments: argparse.Namespace, outputs: dict[str, Path]) -> Iterator[Path]:
    # Imports numpy, which must not come before `main` has set its threads.
    from wheel_terra_estimator.configuration import reader, shipped

    for name, value in vars(arguments).items():
        if name in outputs:
            continue
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, shipped.FileName):
                yield from reader.files_behind(item)
            elif isinstance(item, Path):
                yield item


def add_remaps(parser: argparse.ArgumentParser, condition: str = '') -> None:
    """Declare ``--remap``; ``condition`` states when it applies, such as 'for a bag: '."""
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='FROM:=TO',
        help=f"{condition}the estimator's topic, then the bag's "
        '(reference_odom:=/truth/odometry); may be given several times',
    )
