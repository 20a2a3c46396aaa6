# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Traction limiter's law."""

from hypothesis import given
from hypothesis import strategies as st

from wheel_terra_estimator.estimation.traction_law import TractionLimits, traction_decision

FREE = [10.0] * 6


def test_low_slip_passes():
    decision = traction_decision([0.1] * 6, [0] * 6, FREE, False)
    assert decision.scale == 1.0
    assert not decision.stop


def test_stops_when_stuck_or_when_no_travel_is_left():
    assert traction_decision([0.1] * 6, [0] * 6, FREE, True).stop
    assert traction_decision([0.7] * 6, [2] * 6, [0.1] * 6, False).stop


def test_one_spinning_wheel_does_not_stop_the_rover():
    slip, classes = [0.1] * 5 + [0.99], [0] * 5 + [3]
    decision = traction_decision(slip, classes, [10.0] * 5 + [0.0], False)
    assert decision.scale == 1.0


def test_braking_downhill_is_not_slowed():
    assert traction_decision([-0.5] * 6, [1] * 6, FREE, False).scale == 1.0


def test_nothing_known_passes():
    assert traction_decision([0.9] * 6, [255] * 6, FREE, False).scale == 1.0


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_more_slip_and_less_travel_never_speed_up(a, b, near, far):
    def scale(slip, travel):
        return traction_decision([slip] * 4, [0] * 4, [travel] * 4, False).scale

    assert 0.0 <= scale(a, near) <= 1.0
    assert scale(max(a, b), near) <= scale(min(a, b), near)
    assert scale(a, min(near, far)) <= scale(a, max(near, far))


def test_limits_are_the_callers():
    limits = TractionLimits(comfortable_slip=0.1, critical_slip=0.2, creep_scale=0.1)
    assert abs(traction_decision([0.3] * 4, [0] * 4, FREE[:4], False, limits).scale - 0.1) < 1e-12
