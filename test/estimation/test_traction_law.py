# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Traction limiter's law."""

from hypothesis import given
from hypothesis import strategies as st

from wheel_terra_estimator.estimation.traction_law import LimiterTuning, traction_scale

FREE = [10.0] * 6
SLIPS = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4)
TRAVELS = st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4)


def scale(slip, travel, **limits):
    return traction_scale(slip, travel, LimiterTuning(**limits))[0]


def test_low_slip_passes():
    assert scale([0.1] * 6, FREE) == 1.0


def test_stops_when_no_travel_is_left():
    assert scale([0.7] * 6, [0.1] * 6) == 0.0


def test_one_spinning_wheel_does_not_stop_the_rover():
    assert scale([0.1] * 5 + [0.99], [10.0] * 5 + [0.0]) == 1.0
    assert scale([-0.1] * 5 + [0.99], FREE) == 1.0, 'nor where the others brake'


def test_braking_downhill_is_not_slowed():
    assert scale([-0.5] * 6, FREE) == 1.0


@given(SLIPS, SLIPS, TRAVELS, TRAVELS)
def test_more_slip_and_less_travel_of_any_wheel_never_speed_up(a, b, c, d):
    high, low = map(max, a, b), map(min, a, b)
    far, near = list(map(max, c, d)), list(map(min, c, d))
    high, low = list(high), list(low)
    assert 0.0 <= scale(high, near) <= scale(low, far) <= 1.0


def test_limits_are_the_callers():
    limits = {'comfortable_slip': 0.1, 'critical_slip': 0.2, 'creep_scale': 0.1}
    assert abs(scale([0.3] * 4, FREE[:4], **limits) - 0.1) < 1e-12
