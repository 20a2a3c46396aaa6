# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The message types of ROS 2 Jazzy, as rosbags ships them."""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def jazzy_types() -> Any:
    """Return the types, which nobody changes: their (de)serialisers are compiled once a process."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)
