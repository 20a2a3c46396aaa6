# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How much of a recording is held in memory; a recording as a whole may have any size."""

from __future__ import annotations

from dataclasses import dataclass

MEGABYTE = 2**20


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
        One message of a topic that the estimator hears (the largest have a few kB): its fields
        take several times its size when they are unpacked.
    packed_share : int
        Greatest ratio of unpacked to packed size of a whole file (sensor data: 2 to 20), asked
        beyond `held`.
    """

    chunk: int = 256 * MEGABYTE
    held: int = 1024 * MEGABYTE
    message: int = 16 * MEGABYTE
    packed_share: int = 200


LIMITS = Limits()
