# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Options ``--largest-message`` and ``--most-held`` of every command that reads recordings."""

from __future__ import annotations

import argparse
import re

from wheel_terra_estimator.bags.salvage.limits import LIMITS, UNITS, Limits, in_words

_SIZE = re.compile(r'([0-9]{1,12}) *([KMG]?B?)', re.IGNORECASE)


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


def _size(text: str) -> int:
    """Return the bytes of a size such as ``256MB``."""
    found = _SIZE.fullmatch(text.strip())
    if not found or not int(found[1]):
        raise argparse.ArgumentTypeError(f"'{text[:40]}' is no size; give one such as 256MB")
    unit = found[2].upper()
    return int(found[1]) * UNITS[unit if unit in UNITS else f'{unit}B']
