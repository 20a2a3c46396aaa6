# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How much of a recording is held in memory; a recording as a whole may have any size."""

from __future__ import annotations

from dataclasses import dataclass

MEGABYTE = 2**20
UNITS = {  # [byte]
    '': 1,
    'B': 1,
    'KB': 2**10,
    'MB': MEGABYTE,
    'GB': 2**30,
}


@dataclass(frozen=True)
class Limits:
    """Greatest sizes [byte]; what is larger is left out and said, never unpacked."""

    # One chunk, or one message of the storage, unpacked. Recorders close a chunk at 1 to 4 MB.
    chunk: int = 256 * MEGABYTE
    # All messages that are held at once to bring them into the order of their log times
    held: int = 1024 * MEGABYTE
    # One message that is unpacked into its fields, which take several times its size. The largest
    # that the estimator hears have a few kB.
    message: int = 16 * MEGABYTE
    # Greatest ratio of unpacked to packed size (sensor data: 2 to 20): of a chunk above `message`,
    # of a whole file above `held`
    packed_share: int = 100

    def unpacked(self, packed: int) -> int:
        """Return the most that a chunk of so many packed bytes may unpack to [byte]."""
        return min(self.chunk, max(self.message, self.packed_share * packed))

    def work(self, packed: int) -> int:
        """Return the most that is unpacked in one pass over a file of some size [byte]."""
        return max(self.held, self.packed_share * packed)


LIMITS = Limits()


def in_words(size: float) -> str:
    """Return a size as it is written in messages: ``256 MB``."""
    for unit in ('GB', 'MB', 'kB'):
        if size >= UNITS[unit.upper()]:
            return f'{size / UNITS[unit.upper()]:.3g} {unit}'
    return f'{size:.0f} B'
