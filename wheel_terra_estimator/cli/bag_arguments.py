# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Options of all commands that read a recording."""

from __future__ import annotations

import argparse

from wheel_terra_estimator.bags import limits


def add_arguments(parser: argparse.ArgumentParser, condition: str = '') -> None:
    """Declare ``--remap`` and the limits of what is held in memory.

    Parameters
    ----------
    condition : str
        When ``--remap`` counts, such as ``'for a bag: '``.
    """
    parser.add_argument(
        '--remap',
        action='append',
        default=[],
        metavar='FROM:=TO',
        help=f"{condition}the estimator's topic, then the bag's "
        '(reference_odom:=/truth/odometry); may be given several times',
    )
    limits.add_arguments(parser)
