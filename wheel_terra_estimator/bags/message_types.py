# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The message types of ROS 2 Jazzy, as rosbags ships them, and messages of a bag unpacked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from wheel_terra_estimator.messages.unpack import TYPES, DamagedMessageError, unpack

if TYPE_CHECKING:
    from wheel_terra_estimator.bags.storage import Bag


@cache
def jazzy_types() -> Any:
    """Return the types, which nobody changes: their (de)serialisers are compiled once a process."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def messages_of(bag: Bag, types: Mapping[str, str]) -> Iterator[tuple[int, str, Any]]:
    """Yield log time [ns], topic and message of topics with their types; damaged ones left out.

    A message is a `Message`, of types that the estimator does not hear one of rosbags.
    """
    for log_time, topic, data in bag.messages(tuple(types)):
        try:
            message = _message(types[topic], data)
        except DamagedMessageError:
            continue
        yield log_time, topic, message


def _message(kind: str, data: bytes) -> Any:
    if kind in TYPES:
        return unpack(kind, data)
    try:
        return jazzy_types().deserialize_cdr(data, kind)
    except Exception as error:  # the library lets many kinds through on damaged bytes
        raise DamagedMessageError(str(error)) from None
