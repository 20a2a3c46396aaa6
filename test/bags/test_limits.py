# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What is unpacked of a recording is bounded, and said in words."""

from __future__ import annotations

from typing import Any

import pytest

from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.salvage import limits
from wheel_terra_estimator.bags.salvage import mcap_records as mcap
from wheel_terra_estimator.bags.storage import open_bag


def test_sizes_in_words() -> None:
    sizes = (300, 5000, 2**28, 3 * 2**29)
    assert [limits.in_words(size) for size in sizes] == ['300 B', '4.88 kB', '256 MB', '1.5 GB']


def test_a_message_that_is_heard_has_a_limit_of_its_own(
    make_bag: Any, rover: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, 'MESSAGE', 200)
    with open_bag(make_bag()) as bag:
        reader = MeasurementReader(bag, {}, rover)
        heard = list(reader.measurements())
    assert heard
    assert reader.rejected['imu/data', 'above 200 B']


def test_empty_records_in_a_chunk_are_not_held() -> None:
    schemas = (bytes([mcap.SCHEMA]) + bytes(8)) * 1000
    possible = mcap.Possible((mcap.SCHEMA, mcap.CHANNEL, mcap.MESSAGE))
    assert list(mcap.straight_records(schemas, possible)) == [mcap.Gap(0, len(schemas))]
