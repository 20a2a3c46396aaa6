# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull left over: the top of the traction curve less what the ground asks."""

import math

import numpy as np
import pytest
from parts import SAND, Parts

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelStates
from wheel_terra_estimator.estimation.judgement.pull_margin import PullMargin

LOADS = (250.0,) * 5 + (0.0,)


@pytest.fixture(scope='module')
def parts():
    return Parts(reader.load(SAND))


def margin(parts, slope, direction=1.0):
    found = PullMargin(len(LOADS), parts.models)
    sinkages = parts.filter().mean[parts.layout.sinkage]
    wheels = WheelStates(1.0, sinkages, np.array(LOADS), mound=0.05)
    found.update(0.0, wheels, direction * math.tan(slope))
    return found.state.margin


def test_the_margin_is_the_greatest_pull_less_what_the_slope_asks(parts):
    sinkage = parts.filter().mean[parts.layout.sinkage]
    ratio = 1.0 - np.linspace(0.2, 0.95, 40)[:, None]
    _, pulls = parts.models.torque_and_pull(WheelStates(ratio, sinkage, 250.0, mound=0.05))
    level = margin(parts, 0.0)
    assert level[0] == pytest.approx(pulls[:, 0].max(), abs=0.02 * 250.0)
    assert level[5] == 0.0  # in the air
    uphill = margin(parts, 0.2)
    assert level[0] - uphill[0] == pytest.approx(250.0 * math.tan(0.2))
    # Backwards up the same ground is downhill.
    assert margin(parts, 0.2, direction=-1.0)[0] > level[0]
