# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip of single wheels and its deviation."""

from parts import SAND, Parts

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.steering import straight_headings
from wheel_terra_estimator.estimation.judgement.slip import BodyMotion, SlipJudge


def test_a_wheel_that_begins_to_turn_is_not_sure_to_spin():
    """A rate just above rest, before the filter knows that the rover has begun to move."""
    parts = Parts(reader.load(SAND))
    rest, n = parts.rover.rest_speed, parts.rover.wheel_count
    headings = straight_headings(parts.rover)
    body = BodyMotion(0.7 * rest, 0.3 * rest, 0.0, 0.0, headings, 0.0, stopped=True)
    rims = (1.05 * rest,) + (0.5 * rest,) * (n - 1)
    turning, *standing = SlipJudge(parts.rover, parts.sensors).update(0.0, rims, body)
    assert turning.std > 0.25
    assert abs(turning.slip - (1.0 - 0.7 / 1.05)) < 2.0 * turning.std
    assert not any(wheel.judged for wheel in standing)
