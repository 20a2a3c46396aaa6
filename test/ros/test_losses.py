# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""No input is lost without a word, whatever holds the node up; an orderly life is quiet."""

import re
import signal
import time

import pytest
from test_estimator_node import ROVER

from wheel_terra_estimator.configuration import reader

RATES = {'joint_states': 100.0, 'imu/data': 100.0, 'sinkage': 10.0, 'reference_odom': 5.0}


@pytest.fixture
def drive(executor, start, parameters):
    """A rover that publishes all inputs, and what turns it and starts a node."""
    from wheel_terra_lab.studies.live_rover import Rover

    names = reader.load(['pathfinder']).wheels.names
    rover = Rover(names, RATES, context=executor.context)
    executor.add_node(rover)

    def until(condition):
        end = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < end, f'not in time; the node says: {rover.said}'
            due = rover.publish_due()
            executor.spin_once(timeout_sec=max(due - time.monotonic(), 0.0))

    yield rover, until, lambda: start('estimator_node', *ROVER, parameters)
    executor.remove_node(rover)
    rover.destroy_node()


def lasts(seconds):
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def lost(rover):
    return {
        key.removesuffix('_lost'): int(count)
        for key, count in rover.values.items()
        if key.endswith('_lost') and int(count)
    }


def test_a_process_that_stood_and_lost_nothing_is_behind_and_no_topic_silent(drive):
    """Before and after, its life is quiet: inputs are there, or come within a second."""
    rover, until, start = drive
    for topic in RATES:  # what the middleware keeps while the process stands
        rover.publish_at(topic, 20.0 if topic in ('joint_states', 'imu/data') else 2.0)
    process = start()
    until(lambda: rover.sets > 20)
    until(lambda: rover.said == 'running')
    until(lasts(1.5))  # the first second of a process may be late
    orderly = process.said()
    assert 'OK: ' in orderly
    process.send_signal(signal.SIGSTOP)
    until(lasts(1.5))
    process.send_signal(signal.SIGCONT)
    sets, said = rover.sets, set()
    until(lambda: re.search(r'inputs: taken [1-9]\d*\.\d s late', rover.said))
    over = lasts(2.5)  # seconds in which each status is looked at
    until(lambda: said.add(rover.said) or over())
    slow = any('left out' in words for words in said)  # of a machine too busy for the node
    if not lost(rover) and not slow:  # the middleware may keep nothing for a process that stands
        assert not [words for words in said if re.search('silent|lost|ahead|older', words)]
    assert rover.sets > sets
    behind = process.said()
    status, said = process.stop(signal.SIGINT)
    assert status == 0
    for words in (orderly, said[len(behind) :]):
        assert not re.search(r'WARN|ERROR|FATAL|Traceback', words), words
