# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The message types of ROS 2 Jazzy, as rosbags ships them."""

from __future__ import annotations

from functools import cache
from typing import Any

from wheel_terra_estimator.messages.cdr import TopicMessages


@cache
def jazzy_types() -> Any:
    """Return the types, which nobody changes: their (de)serialisers are compiled once a process."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def topic_messages(kind: str) -> TopicMessages:
    """Return what unpacks the messages of a topic; rosbags where it is not done quickly."""
    return TopicMessages(kind, lambda data: jazzy_types().deserialize_cdr(data, kind))
