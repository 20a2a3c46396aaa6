# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Options of all commands that read a recording: ``--remap``, and what is held in memory."""

from __future__ import annotations

import argparse
import re

from wheel_terra_estimator.bags.salvage.limits import LIMITS, UNITS, Limits, in_words

_SIZE = re.compile(r'([0-9]{1,12}) *([KMG]?B?)', re.IGNORECASE)


def add_arguments(parser: argparse.ArgumentParser, condition: str = '') -> None:
    """Declare all of them; ``condition`` says when ``--remap`` counts, such as 'for a bag: '."""
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='FROM:=TO',
        help=f"{condition}the estimator's topic, then the bag's "
        '(reference_odom:=/truth/odometry); may be given several times',
    )
    add_limits(parser)


def add_limits(parser: argparse.ArgumentParser) -> None:
    """Declare ``--largest-message`` and ``--most-held``."""
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


def limits_of(arguments: argparse.Namespace) -> Limits:
    """Return the limits that were asked for."""
    largest: int = arguments.largest_message
    return Limits(chunk=largest, held=arguments.most_held, message=min(largest, Limits.message))


def _size(text: str) -> int:
    """Return the bytes of a size such as ``256MB``."""
    found = _SIZE.fullmatch(text.strip())
    if not found or not int(found[1]):
        raise argparse.ArgumentTypeError(f"'{text[:40]}' is no size; give one such as 256MB")
    unit = found[2].upper()
    return int(found[1]) * UNITS[unit if unit in UNITS else f'{unit}B']
