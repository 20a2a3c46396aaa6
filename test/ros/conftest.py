# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The real rclpy over loopback, in a domain of its own; skipped visibly where there is none."""

import fcntl
import gc
import importlib.util
import os
import random
import signal
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from node_server import ForkedProcess, InterpretedProcess

ATTEMPTS = 3
"""A test over DDS fails when it fails this often: where processes share few cores, the machine
alone can hold one up or lose its messages, and that says nothing about the node."""

FIRST_PORT, PORTS = 7400, 250  # of domain 0, of each domain (DDSI-RTPS 2.5, 9.6.2)
LOOK = 0.02
"""Between two looks at a condition [s]: one that publishes keeps nobody busy."""
SOON = {
    'wheel_terra_estimator.messages.diagnostics:MEMORY': 3 * 10**8,
    'wheel_terra_estimator.messages.diagnostics:PERIOD': 10**8,
    'wheel_terra_estimator.ros.lifecycle_node:DISCOVERY': 1.5,
    # Before that, but as late as it can be: on a loaded machine a process is late.
    'wheel_terra_estimator.ros.lifecycle_node:START': 1.4,
    'wheel_terra_estimator.ros.lifecycle_node:DIAGNOSTICS_PERIOD': 0.1,
    'wheel_terra_estimator.ros.lifecycle_node:NAMES_PERIOD': 0.2,
    'wheel_terra_estimator.ros.limiter_node:DIAGNOSTICS_PERIOD': 0.1,
}
"""Constants of a node that looks and tells more often than each second, and waits less before it
does: how long faults are told is tested in messages."""
HAS_ROS = importlib.util.find_spec('rclpy') is not None


def pytest_collection_modifyitems(items):
    for item in items:
        if '/test/ros/' in item.path.as_posix():
            item.add_marker(pytest.mark.ros)
            item.add_marker(pytest.mark.flaky(reruns=ATTEMPTS - 1))
            if not HAS_ROS:
                item.add_marker(pytest.mark.skip(reason='no rclpy here (extra ros, or a Jazzy)'))


@pytest.fixture(scope='session', autouse=True)
def own_domain():
    """Keep apart from other robots and from other test runs on this machine."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    domains = random.SystemRandom().sample(range(1, 101), 100)
    for domain in filter(_is_empty, domains):
        # A lock keeps parallel workers and runs out of each other's domain.
        path = Path(tempfile.gettempdir()) / f'wheel_terra_test_domain_{domain}.lock'
        with path.open('w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            os.environ['ROS_DOMAIN_ID'] = str(domain)
            yield
            return
    pytest.fail('all 100 ROS domains are taken by other test runs')


def _is_empty(domain):
    """Whether no program of this machine is in a domain, by the ports of UDP that it would hold."""
    lines = Path('/proc/net/udp').read_text().splitlines()[1:]
    ports = {int(line.split()[1].rpartition(':')[2], 16) for line in lines}
    first = FIRST_PORT + PORTS * domain
    return ports.isdisjoint(range(first, first + PORTS))


@pytest.fixture(autouse=True)
def no_node_is_left():
    """Managed nodes of this process lie in cycles: the next test would hear of another node.

    Before each test: pytest holds what a test was given until after its teardown.
    """
    gc.collect()


def _starter(make):
    running = []

    def start(module, *arguments, **more):
        running.append(make(module, *arguments, **more))
        return running[-1]

    yield start
    for process in running:
        if process.poll() is None:
            process.stop(signal.SIGKILL)


@pytest.fixture
def soon():
    """Constants for `start`."""
    return {'constants': SOON}


@pytest.fixture
def start():
    """Start nodes that do not outlive the test, imports done (a second less for each)."""
    yield from _starter(ForkedProcess)


@pytest.fixture
def start_interpreter():
    """Start nodes that do not outlive the test, from nothing: for what happens at the start."""
    yield from _starter(InterpretedProcess)


@pytest.fixture
def parameters(tmp_path):
    """The file of a rover."""
    from wheel_terra_estimator.configuration import reader

    path = tmp_path / 'rover.yaml'
    reader.load(['pathfinder']).write(path)
    return str(path)


@pytest.fixture
def executor():
    """What turns nodes of this process, in a context of its own."""
    with _executor() as made:
        yield made


@pytest.fixture
def listener(executor):
    """Return a node in this process and a function that spins until a condition holds."""
    with _listener(executor) as made:
        yield made


@pytest.fixture(scope='class')
def running_estimator(tmp_path_factory, proposed_law):
    """For the tests of a class, in their order: a node with most of what a user can set, a listener
    as of `listener`.
    """
    from wheel_terra_estimator.configuration import reader

    path = tmp_path_factory.mktemp('estimator') / 'rover.yaml'
    reader.load(['pathfinder']).write(path)
    arguments = ['--ros-args', '--params-file', str(path), '--params-file', str(proposed_law)]
    reliable = 'qos_overrides./reference_odom.subscription.reliability:=reliable'
    for value in ('rover.mass:=20', 'rover.contact_law:=wong_reece', reliable):
        arguments += ['-p', value]
    arguments += ['-r', 'joint_states:=/drive/joints']
    with _executor() as executor, _listener(executor) as listener:
        process = ForkedProcess('estimator_node', *arguments, constants=SOON)
        yield process, *listener
        process.stop(signal.SIGKILL)


@contextmanager
def _executor():
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor

    context = Context()
    rclpy.init(args=[], context=context)
    made = SingleThreadedExecutor(context=context)
    yield made
    made.shutdown()
    rclpy.shutdown(context=context)


@contextmanager
def _listener(executor):
    from rclpy.node import Node

    node = Node('listener', context=executor.context)
    executor.add_node(node)

    def until(condition, seconds=60.0):
        end = time.monotonic() + seconds
        while not condition():
            look = time.monotonic() + LOOK
            assert look < end, 'did not happen in time'
            while (left := look - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=left)

    yield node, until
    executor.remove_node(node)
    node.destroy_node()
