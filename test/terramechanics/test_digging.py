# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Digging in above the slip of a steady state."""

import math
from dataclasses import replace

import pytest
from terra_tools import WHEEL

from wheel_terra_estimator.terramechanics.entrapment import (
    digging_per_turn,
    digging_rate,
    digging_share,
)

SMOOTH = replace(WHEEL, lug_height=0.0)


def test_digging_starts_near_stuck_and_grows_with_the_lugs():
    assert digging_share(0.85) == 0.0 and digging_share(1.0) == 1.0
    assert digging_share(0.925) == pytest.approx(0.5)
    assert digging_rate(-0.98, WHEEL, 1.0) == 0.0
    low, high = (digging_rate(0.98, replace(WHEEL, lug_height=h), 1.0) for h in (0.005, 0.015))
    assert high == pytest.approx(3.0 * low)
    assert digging_rate(0.98, SMOOTH, 1.0) > 0.0
    assert digging_rate(0.98, WHEEL, -2.0) == pytest.approx(2.0 * digging_rate(0.98, WHEEL, 1.0))


def test_a_spinning_wheel_throws_out_the_layer_of_its_lugs_once_per_lug():
    """Thirty lugs of 10 mm pass in a turn; with all of it thrown out it is 300 mm deeper."""
    assert digging_per_turn(WHEEL, efficiency=1.0) == pytest.approx(0.300)
    assert digging_rate(1.0, WHEEL, 2.0 * math.pi) == pytest.approx(digging_per_turn(WHEEL))
