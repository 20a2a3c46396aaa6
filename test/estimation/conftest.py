# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lets the tests of this folder import its helpers; a drive at which several of them look."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope='session')
def climb():
    """A simulated climb of 8 degrees; nobody changes it."""
    from parts import drive

    return drive(12.0, **{'slope.angle_deg': [8.0]})


@pytest.fixture(scope='session')
def climbed(climb):
    """Core and estimator after the climb, and the sets; nobody changes them."""
    from fake_estimator import play

    from wheel_terra_estimator.estimation.core import EstimatorCore
    from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator

    estimator = WheelSoilEstimator(climb.configuration)
    core = EstimatorCore(climb.configuration, estimator)
    return core, play(core, (arrival.measurement for arrival in climb.arrivals)), estimator


@pytest.fixture(scope='session')
def parts():
    """A rover on sand in parts; nobody changes them."""
    from parts import on_sand

    return on_sand()
