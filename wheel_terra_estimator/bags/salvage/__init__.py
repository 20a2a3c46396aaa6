# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of one MCAP or SQLite recording, whole or damaged, and what is missing in it.

Independent of rovers: of the package it imports its error class alone.
"""

from __future__ import annotations

from typing import NamedTuple


class RawMessage(NamedTuple):
    """A message as it lies in the bag; ``log_time`` in ns, ``data`` in CDR."""

    log_time: int
    topic: str
    data: bytes


class Topic(NamedTuple):
    """A topic of the bag, ``type`` as in ``sensor_msgs/msg/Imu``."""

    name: str
    type: str
    message_count: int
