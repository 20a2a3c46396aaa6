# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings made of recordings, messages made of those of rosbags."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from message_factory import serialised

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.salvage import RawMessage
from wheel_terra_estimator.bags.storage import jazzy_types, open_bag
from wheel_terra_estimator.messages.convert import INPUT_TYPES, InputConverter
from wheel_terra_estimator.messages.unpack import Message, unpack


def contents(path: Path) -> tuple[list[RawMessage], list[str]]:
    """Return all messages of a recording, and what is said of its state."""
    with open_bag(path) as bag:
        return list(bag.messages(tuple(bag.topics))), bag.notes


def beginning(source: Path, target: Path, seconds: float) -> Path:
    """Write the beginning of a recording as a bag of its own."""
    with open_bag(source) as bag:
        topics = {topic.name: topic.type for topic in bag.topics.values()}
        with BagFile(target, topics) as file:
            first = None
            for log_time, topic, data in bag.messages(tuple(topics)):
                first = log_time if first is None else first
                if log_time - first < seconds * 1e9:
                    file.write(topic, data, log_time)
    return target


def changed(source: Path, target: Path, change: Callable[[str, Any], Any]) -> Path:
    """Write a recording once more, each message as `change` returns it; None leaves it out."""
    store = jazzy_types()
    with open_bag(source) as bag:
        topics = {topic.name: topic.type for topic in bag.topics.values()}
        with BagFile(target, topics) as file:
            for log_time, topic, data in bag.messages(tuple(topics)):
                message = change(topic, store.deserialize_cdr(data, topics[topic]))
                if message is not None:
                    file.write(topic, serialised(message), log_time)
    return target


def unpacked(kind: str, message: Any) -> Message:
    """Return a message of rosbags as node and replay get it: out of its bytes."""
    return unpack(kind, serialised(message))


class Converter(InputConverter):
    """Converts messages of rosbags."""

    def convert(self, topic: str, message: Any) -> Any:
        return super().convert(topic, unpacked(INPUT_TYPES[topic], message))
