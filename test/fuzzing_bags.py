# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings that are bombs."""

import struct
from collections.abc import Iterator

from wheel_terra_lab.studies.fuzzing import mcap_maker as maker

TYPES = {'/joint_states': 'sensor_msgs/msg/JointState'}


def bombs(size: int) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of what unpacks to so many bytes, one chunk to a quarter of them."""
    try:
        from compression import zstd
    except ImportError:
        from backports import zstd
    count = size // 2**24
    frames = count * zstd.compress(bytes(2**24))
    frame = zstd.ZstdCompressor()
    parts = [frame.compress(bytes(2**24)) for _ in range(count)] + [frame.flush()]
    one_frame = b''.join(parts)
    for name, packed, stated in (
        ('frames.mcap', frames, size),
        ('frame.mcap', one_frame, size),
        ('liar.mcap', one_frame, 1000),
        ('zeros.mcap', one_frame, size // 4),
    ):
        head = struct.pack('<QQQI', 1, 2, stated, 0) + struct.pack('<I', 4) + b'zstd'
        content = head + struct.pack('<Q', len(packed)) + packed
        yield name, maker.MAGIC + struct.pack('<BQ', 6, len(content)) + content
    yield 'file.mcap.zstd', one_frame
    yield 'file.db3.zstd', one_frame
