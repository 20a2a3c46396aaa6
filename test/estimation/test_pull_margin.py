# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pull left over: the top of the traction curve less what the ground asks."""

import math

import numpy as np
import pytest
from parts import SAND, Parts

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelState
from wheel_terra_estimator.estimation.judgement.pull_margin import PullMargin

LOADS = (250.0,) * 5 + (0.0,)


@pytest.fixture(scope='module')
def parts():
    return Parts(reader.load(SAND))


def margin(parts, slope, direction=1.0):
    found = PullMargin(len(LOADS), parts.models)
    sinkages = parts.filter().mean[parts.layout.sinkage]
    wheels = [
        WheelState(1.0, z, load, 0.0, 0.0, mound=0.05)
        for z, load in zip(sinkages.tolist(), LOADS, strict=True)
    ]
    found.update(0.0, wheels, direction * math.tan(slope))
    return found.state.margin


def test_the_margin_is_the_greatest_pull_less_what_the_slope_asks(parts):
    x = parts.filter().mean
    pulls = [
        parts.models.forces(
            0,
            WheelState(1.0 - s, float(x[parts.layout.sinkage.start]), 250.0, 0.0, 0.0, mound=0.05),
        ).pull
        for s in np.linspace(0.2, 0.95, 40)
    ]
    level = margin(parts, 0.0)
    assert level[0] == pytest.approx(max(pulls), abs=0.02 * 250.0)
    assert level[5] == 0.0  # in the air
    uphill = margin(parts, 0.2)
    assert level[0] - uphill[0] == pytest.approx(250.0 * math.tan(0.2))
    # Backwards up the same ground is downhill.
    assert margin(parts, 0.2, direction=-1.0)[0] > level[0]
