# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Some hundred damaged inputs; any number: ``python -m wheel_terra_lab.studies.fuzz_files``."""

import random
from typing import Any

from rosbags.rosbag2 import Reader

from wheel_terra_estimator.bags.salvage.mcap_file import McapFile
from wheel_terra_lab.studies.fuzz_files import fuzz
from wheel_terra_lab.studies.fuzzing import cases
from wheel_terra_lab.studies.fuzzing.mcap_maker import Layout, make


def test_damaged_inputs_of_all_kinds():
    done, faults = fuzz(0, 150)
    assert not faults
    assert set(done) == set(cases.CASES)


def test_a_message_that_lost_bytes_hides_no_chunk_behind_it():
    """5,000 bytes left out: by its length a message takes the next chunk's head with it."""
    done, faults = fuzz(75084681, 1)
    assert set(done) == {'mcap'}
    assert not faults


def test_the_judgement_can_fail(tmp_path, monkeypatch):
    """A reader that drops one message is found out."""
    honest = McapFile.messages

    def careless(self: Any, topics: Any) -> Any:
        found = list(honest(self, topics))
        yield from found[: len(found) // 2]
        yield from found[len(found) // 2 + 1 :]

    monkeypatch.setattr(McapFile, 'messages', careless)
    said = [cases.run('mcap', random.Random(number), tmp_path) for number in range(10)]
    assert any('intact messages missing' in words for words in said)


def test_the_maker_is_read_by_another_reader(tmp_path):
    dice = random.Random(5)
    samples = cases._samples(dice)
    for codec in ('', 'zstd', 'lz4'):
        path = tmp_path / f'drive_{codec}.mcap'
        path.write_bytes(make(samples, cases.TYPES, Layout(codec=codec)).content)
        with Reader(path) as reader:
            found = [(time, c.topic, bytes(data)) for c, time, data in reader.messages()]
        assert found == [tuple(sample) for sample in samples]
