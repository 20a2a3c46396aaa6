# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that are bombs."""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'tools'))

from fuzzing import mcap_maker as maker

TYPES = {'/joint_states': 'sensor_msgs/msg/JointState'}


def bombs(folder: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and content."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    gigabyte = 64 * zstd.compress(bytes(2**24))
    frame = zstd.ZstdCompressor()
    parts = [frame.compress(bytes(2**24)) for _ in range(64)] + [frame.flush()]
    one_frame = b''.join(parts)
    for name, packed, size in (
        ('frames.mcap', gigabyte, 2**30),
        ('frame.mcap', one_frame, 2**30),
        ('liar.mcap', one_frame, 1000),
        ('zeros.mcap', one_frame, 2**28),
    ):
        head = struct.pack('<QQQI', 1, 2, size, 0) + struct.pack('<I', 4) + b'zstd'
        content = head + struct.pack('<Q', len(packed)) + packed
        yield name, maker.MAGIC + struct.pack('<BQ', 6, len(content)) + content
    yield 'file.mcap.zstd', one_frame
    yield 'file.db3.zstd', one_frame
