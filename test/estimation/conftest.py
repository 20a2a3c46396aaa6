# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lets the tests of this folder import its helpers; the drive that several of them look at."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope='session')
def climb():
    """A simulated climb of 8 degrees; nobody changes it."""
    from parts import drive

    return drive(12.0, **{'slope.angle_deg': [8.0]})
