# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How much of a recording is held in memory; a recording as a whole may have any size.

Larger data are left out and reported, never unpacked.
"""

from __future__ import annotations

MEGABYTE = 2**20
CHUNK = 256 * MEGABYTE
"""One chunk, or one message of the storage, unpacked [byte]. Recorders close chunks at 1 to 4 MB.
"""
HELD = 1024 * MEGABYTE
"""All messages that are held at once to bring them into the order of their log times [byte]."""
MESSAGE = 16 * MEGABYTE
"""One message that is unpacked into its fields, which take several times its size [byte]."""
PACKED_SHARE = 100
"""Greatest ratio of unpacked to packed size (sensor data: 2 to 20): of a chunk above `MESSAGE`, of
a whole file above `HELD`."""


def unpacked(packed: int) -> int:
    """Return the most that a chunk of so many packed bytes may unpack to [byte]."""
    return min(CHUNK, max(MESSAGE, PACKED_SHARE * packed))


def work(packed: int) -> int:
    """Return the most that is unpacked in one pass over a file of some size [byte]."""
    return max(HELD, PACKED_SHARE * packed)


def in_words(size: float) -> str:
    """Return a size as it is written in messages: ``256 MB``."""
    for unit, factor in (('GB', 2**30), ('MB', MEGABYTE), ('kB', 2**10)):
        if size >= factor:
            return f'{size / factor:.3g} {unit}'
    return f'{size:.0f} B'
