# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""No input is lost without a word, whatever holds the node up; an orderly life is quiet."""

import re
import signal
import time

from test_estimator_node import ROVER

from wheel_terra_estimator.configuration import reader

RATES = {'joint_states': 20.0, 'imu/data': 20.0, 'sinkage': 2.0, 'reference_odom': 2.0}
"""What the middleware keeps while the process stands [Hz]."""


def lasts(seconds):
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def test_a_process_that_stood_and_lost_nothing_is_behind_and_no_topic_silent(
    executor, start, parameters
):
    """Before and after, its life is quiet: inputs are there, or come within a second."""
    from wheel_terra_lab.studies.live_rover import Rover

    rover = Rover(reader.load(['pathfinder']).wheels.names, RATES, context=executor.context)
    executor.add_node(rover)

    def until(condition):
        end = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < end, f'not in time; the node says: {rover.said}'
            due = rover.publish_due()
            executor.spin_once(timeout_sec=max(due - time.monotonic(), 0.0))

    process = start('estimator_node', *ROVER, parameters)
    until(lambda: rover.sets > 20)
    until(lambda: rover.said == 'running')
    until(lasts(1.5))  # the first second of a process may be late
    orderly = process.said()
    assert 'OK: ' in orderly
    process.send_signal(signal.SIGSTOP)
    until(lasts(1.5))
    process.send_signal(signal.SIGCONT)
    sets, said = rover.sets, set()
    until(lambda: re.search(r'inputs: read [1-9]\d*\.\d s late', rover.said))
    over = lasts(2.5)  # seconds in which each status is looked at
    until(lambda: said.add(rover.said) or over())
    slow = any('left out' in words for words in said)  # of a machine too busy for the node
    lost = any(key.endswith('_lost') and int(count) for key, count in rover.values.items())
    if not lost and not slow:  # the middleware may keep nothing for a process that stands
        assert not [words for words in said if re.search('silent|lost|ahead|older', words)]
    assert rover.sets > sets
    behind = process.said()
    status, ending = process.stop(signal.SIGINT)
    assert status == 0
    for words in (orderly, ending[len(behind) :]):
        assert not re.search(r'WARN|ERROR|FATAL|Traceback', words), words
