# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The option of all commands that read the inputs of a recording: ``--remap``."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser, condition: str = '') -> None:
    """Declare it; ``condition`` says when it counts, such as 'for a bag: '."""
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='FROM:=TO',
        help=f"{condition}the estimator's topic, then the bag's "
        '(reference_odom:=/truth/odometry); may be given several times',
    )
