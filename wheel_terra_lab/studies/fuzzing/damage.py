# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What happens to files: cut off, bits flipped, blocks lost, bytes overwritten or left out."""

from __future__ import annotations

import random
from typing import NamedTuple

BLOCK = 512
"""Sector of a disk [byte]."""


class Damaged(NamedTuple):
    """A damaged file and the places (begin, end) of the original that are not as they were.

    Behind ``moved`` the bytes stand, but at another place.
    """

    content: bytes
    places: list[tuple[int, int]]
    kind: str


def damage(content: bytes, dice: random.Random) -> Damaged:
    """Damage a file in one of the ways that happen."""
    kinds = (_cut, _flips, _zero_block, _random_bytes, _left_out, _put_in, _swapped_end)
    return dice.choice(kinds)(content, dice)


def touches(places: list[tuple[int, int]], begin: int, end: int) -> bool:
    """Whether one of the places lies in [begin, end)."""
    return any(first < end and begin < last for first, last in places)


def _cut(content: bytes, dice: random.Random) -> Damaged:
    at = dice.randrange(len(content))
    return Damaged(content[:at], [(at, len(content))], 'cut')


def _flips(content: bytes, dice: random.Random) -> Damaged:
    new = bytearray(content)
    places = []
    for _ in range(dice.choice((1, 1, 3, 20))):
        at = dice.randrange(len(content))
        new[at] ^= 1 << dice.randrange(8)
        places.append((at, at + 1))
    return Damaged(bytes(new), places, 'flips')


def _zero_block(content: bytes, dice: random.Random) -> Damaged:
    return _overwrite(content, dice, bytes(dice.choice((1, 4, 8)) * BLOCK), 'zero block')


def _random_bytes(content: bytes, dice: random.Random) -> Damaged:
    return _overwrite(content, dice, dice.randbytes(dice.choice((1, 8, 100, 3000))), 'random bytes')


def _overwrite(content: bytes, dice: random.Random, by: bytes, kind: str) -> Damaged:
    at = dice.randrange(len(content))
    by = by[: len(content) - at]
    return Damaged(content[:at] + by + content[at + len(by) :], [(at, at + len(by))], kind)


def _left_out(content: bytes, dice: random.Random) -> Damaged:
    at = dice.randrange(len(content))
    count = min(dice.choice((1, 7, BLOCK, 5000)), len(content) - at)
    return Damaged(content[:at] + content[at + count :], [(at, at + count)], 'bytes left out')


def _put_in(content: bytes, dice: random.Random) -> Damaged:
    at = dice.randrange(1, len(content))
    more = dice.randbytes(dice.choice((1, 7, 600)))
    return Damaged(content[:at] + more + content[at:], [(at - 1, at + 1)], 'bytes put in')


def _swapped_end(content: bytes, dice: random.Random) -> Damaged:
    """Put zeros behind a cut: a file system that had room set aside."""
    at = dice.randrange(len(content))
    return Damaged(content[:at] + bytes(len(content) - at), [(at, len(content))], 'zero end')
