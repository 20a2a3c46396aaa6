# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra effects``."""

from __future__ import annotations

import argparse

from wheel_terra_estimator.errors import UserError

SUMMARY = 'list the physical and instrument effects that can be named'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    raise UserError('this command is not in this version yet')
