# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A recording over DDS through the real node gives the numbers of a replay, to the bit."""

import signal
import time
from pathlib import Path

import numpy as np
import pytest
from node_server import ForkedProcess
from recordings import beginning

from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.cli.main import main

SECONDS = 4.0
"""Of a recording that is played."""
NODE = 'estimator_node'
DEMO = Path(__file__).resolve().parents[2] / 'data' / 'demo'


def numbers(folder):
    """Return (topic, stamp or index) -> all fields of the message, of a bag of estimates."""
    from wheel_terra_estimator.bags.storage import jazzy_types

    store = jazzy_types()
    found = {}
    with open_bag(folder) as bag:
        # Diagnostics also run on the clock of the wall while nothing is heard.
        topics = [t for t in bag.topics if t != '/diagnostics']
        for raw in bag.messages(topics):
            message = store.deserialize_cdr(raw.data, bag.topics[raw.topic].type)
            found.setdefault(raw.topic, []).append(fields(message))
    return found


def fields(message):
    if hasattr(message, '__dataclass_fields__'):
        names = [n for n in message.__dataclass_fields__ if not n.startswith('_')]
        return tuple(fields(getattr(message, n)) for n in names)
    if isinstance(message, np.ndarray):
        return message.tobytes()
    if isinstance(message, list):
        return tuple(fields(m) for m in message)
    return message.hex() if isinstance(message, float) else message


REPLAY = {
    'pathfinder': ['--config', 'pathfinder', '--remap', 'reference_odom:=/truth/odometry'],
    'entrapment': [
        *('--config', 'generic_six_wheel', '--config', 'test_sand'),
        *('-p', 'output_rate:=0', '-p', 'max_lag:=0'),
    ],
}


def run_live(source, live, *options):
    from wheel_terra_lab import live_drive

    assert live_drive.main([str(source), '-o', str(live), *options]) == 0


def assert_same_bits(live, again, least):
    ours, theirs = numbers(live), numbers(again)
    assert ours.keys() == theirs.keys()
    slip = ours['/wheel_terra_estimator/slip']
    assert len(slip) >= least
    assert len(set(slip)) == len(slip), 'stamps and numbers move on'
    for topic, messages in theirs.items():
        assert ours[topic] == messages, topic


@pytest.fixture
def forked_node(monkeypatch):
    """The player of a recording gets its node from the server, and waits less for its last word."""
    from wheel_terra_lab import live_drive

    monkeypatch.setattr(live_drive, 'QUIET', 1.0)
    monkeypatch.setattr(live_drive, 'start_node', lambda given: ForkedProcess(NODE, *given))


@pytest.mark.usefixtures('forked_node')
@pytest.mark.parametrize('bag', ['entrapment', pytest.param('pathfinder', marks=pytest.mark.slow)])
def test_live_and_replayed_numbers_are_the_same_bits(bag, tmp_path):
    """Above its pace a recording gets out of order; the log of arrivals knows how.

    How many sets a busy machine gives is not the point: what comes must be the same.
    """
    live, again, arrival = tmp_path / 'live', tmp_path / 'again', tmp_path / 'arrival.txt'
    source = beginning(DEMO / bag, tmp_path / 'source', SECONDS)
    logged = ['--arrival', str(arrival), *REPLAY[bag]]
    run_live(source, live, '--rate', '4', *logged)
    assert main(['replay', str(source), '-o', str(again), *logged]) == 0
    assert_same_bits(live, again, least=8)


@pytest.mark.usefixtures('forked_node')
def test_as_fast_as_it_goes_is_in_the_order_of_the_bag(tmp_path):
    """A frequent topic does not fall behind the others, so no log of arrivals is needed."""
    live, again = tmp_path / 'live', tmp_path / 'again'
    source = beginning(DEMO / 'pathfinder', tmp_path / 'source', SECONDS)
    run_live(source, live, *REPLAY['pathfinder'])
    assert main(['replay', str(source), '-o', str(again), *REPLAY['pathfinder']]) == 0
    assert_same_bits(live, again, least=30)


def test_ctrl_c_ends_a_live_drive_without_a_traceback(start, tmp_path):
    arguments = [str(DEMO / 'pathfinder'), '--config', 'pathfinder', '--rate', '0.1']
    arguments += ['-o', str(tmp_path / 'out'), '--arrival', str(tmp_path / 'arrival.txt')]
    process = start('live_drive', *arguments, package='wheel_terra_lab')
    until = time.monotonic() + 60.0
    while not (tmp_path / 'arrival.txt').is_file() and time.monotonic() < until:
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert 'Traceback' not in said and said.endswith('live_drive: interrupted\n')
    assert not (tmp_path / 'out').exists()
