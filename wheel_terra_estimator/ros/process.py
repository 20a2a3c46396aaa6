# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The process of a node: it ends in order at Ctrl-C and terminations, at any moment, also twice.

Imports nothing heavy, so that the handlers stand before rclpy and numpy are loaded.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Callable
from importlib import import_module
from types import FrameType
from typing import Any

from wheel_terra_estimator.end_signals import terminations

LONGEST_END = 0.8  # [s] for saving and closing, then the process ends anyway
LOOK_UP = 0.1  # [s] between two looks at the signals

HOMES = ('HOME', 'ROS_HOME', 'ROS_LOG_DIR')
LOG_CURE = 'set ROS_LOG_DIR (or ROS_HOME) to a folder that can be written'
HEAD_CURE = (
    'unlike the commands, ROS needs the lines "/**:" and "  ros__parameters:" above the keys'
)
CURES = {'logging': LOG_CURE, 'ros__parameters': HEAD_CURE}
"""By a word of the message of rcl."""


class _Signals:
    """Before the node is served, exit at once; afterwards request the end."""

    def __init__(self) -> None:
        self.stopped = False
        self.serving = False
        self._numbers = signal.SIGINT, *terminations()
        for number in self._numbers:
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if not self.serving:
            os._exit(0)  # nothing has been opened yet
        for each in self._numbers:  # the end of the interpreter restores handlers, this it leaves
            signal.signal(each, signal.SIG_IGN)
        self.stopped = True
        end = threading.Timer(LONGEST_END, os._exit, (0,))
        end.daemon = True
        end.start()


def run_node(module: str, name: str, args: list[str] | None) -> int:
    """Make the node of a class in a module of `ros` and serve it until it is asked to stop."""
    gc.disable()  # until the node stands: what is made so far lives as long as it does
    signals = _Signals() if threading.current_thread() is threading.main_thread() else None
    factory = getattr(import_module(f'{__package__}.{module}'), name)
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.executors import ExternalShutdownException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import try_shutdown

    from wheel_terra_estimator.errors import UserError

    node: Any = None
    status = 0
    if not any(map(os.environ.get, HOMES)):
        print(f'there is no folder for logs: {LOG_CURE}', file=sys.stderr)  # before rcutils says so
    try:
        try:
            rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        except Exception as error:  # rcl's: a parameter file or argument that cannot be read
            # Return the error of rcl without its source locations.
            words = str(error).splitlines()[0].partition(', at ')[0]
            words = f'unknown: {words}' if words.startswith('[') else words
            cures = [cure for word, cure in CURES.items() if word in words]
            print('; '.join([words, *cures]), file=sys.stderr)
            return 2
        if signals is not None:
            signals.serving = True
        node = factory()
        gc.freeze()
        gc.enable()
        _spin(node, lambda: signals is not None and signals.stopped)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (UserError, ParameterException) as error:
        print(f'[FATAL] {error}', file=sys.stderr)
        status = 2
    finally:
        gc.enable()
        if node is not None:
            node.destroy_node()
        try_shutdown()
    return status


def _spin(node: Any, stopped: Callable[[], bool]) -> None:
    import rclpy
    from rclpy.executors import Executor, SingleThreadedExecutor

    executor: Executor
    if node.has_parameter('executor') and node.get_parameter('executor').value == 'events':
        from rclpy.experimental import EventsExecutor

        executor = EventsExecutor()
    else:
        executor = SingleThreadedExecutor()
    executor.add_node(node)
    # The events executor's spin(), and its spin_once() without a timeout, run hot in Jazzy.
    while rclpy.ok() and not stopped():
        executor.spin_once(timeout_sec=LOOK_UP)
