# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How much of a recording is held in memory; a recording as a whole may have any size.

Every command that reads recordings takes ``--largest-message`` and ``--most-held``.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass

MEGABYTE = 2**20
_UNITS = {  # [byte]
    '': 1,
    'B': 1,
    'KB': 2**10,
    'MB': MEGABYTE,
    'GB': 2**30,
}
_SIZE = re.compile(r'([0-9]{1,12}) *([KMG]?B?)', re.IGNORECASE)


@dataclass(frozen=True)
class Limits:
    """Greatest sizes [byte]; what is larger is left out and said, never unpacked.

    Attributes
    ----------
    chunk : int
        One chunk, or one message of the storage, unpacked. Recorders close a chunk at 1 to 4 MB.
    held : int
        All messages that are held at once to bring them into the order of their log times.
    message : int
        One message that is unpacked into its fields, which take several times its size. The
        largest that the estimator hears have a few kB.
    packed_share : int
        Greatest ratio of unpacked to packed size of a whole file (sensor data: 2 to 20), asked
        beyond `held`.
    """

    chunk: int = 256 * MEGABYTE
    held: int = 1024 * MEGABYTE
    message: int = 16 * MEGABYTE
    packed_share: int = 200


LIMITS = Limits()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of all commands that read recordings."""
    for option, value, words in (
        ('--largest-message', LIMITS.chunk, 'largest message or chunk that is unpacked'),
        ('--most-held', LIMITS.held, 'most that is held at once to bring messages into order'),
    ):
        parser.add_argument(
            option,
            type=_size,
            default=value,
            metavar='SIZE',
            help=f'{words} (kB, MB, GB; default {in_words(value)})',
        )


def from_arguments(arguments: argparse.Namespace) -> Limits:
    """Return the limits that the options of `add_arguments` ask for."""
    largest: int = arguments.largest_message
    return Limits(chunk=largest, held=arguments.most_held, message=min(largest, Limits.message))


def in_words(size: float) -> str:
    """Return a size as it is written in messages: ``256 MB``."""
    for unit in ('GB', 'MB', 'kB'):
        if size >= _UNITS[unit.upper()]:
            return f'{size / _UNITS[unit.upper()]:.3g} {unit}'
    return f'{size:.0f} B'


def _size(text: str) -> int:
    """Return the bytes of a size such as ``256MB``."""
    found = _SIZE.fullmatch(text.strip())
    if not found or not int(found[1]):
        raise argparse.ArgumentTypeError(f"'{text[:40]}' is no size; give one such as 256MB")
    unit = found[2].upper()
    return int(found[1]) * _UNITS[unit if unit in _UNITS else f'{unit}B']
