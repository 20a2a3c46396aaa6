# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entrapments and what came of warnings, on courses of slip whose answers are written down."""

import numpy as np
import pytest

from wheel_terra_estimator.estimation.judgement.entrapment import (
    Outcome,
    Span,
    entrapments,
    lead_of,
    verdicts,
)

TIME = np.arange(1000) * 0.1


def course(*stretches, wheels=3):
    """Slip 0.2 but for stretches (first row, last row, slip)."""
    slip = np.full((TIME.size, wheels), 0.2)
    for first, last, value in stretches:
        slip[first:last] = value
    return slip


def test_only_what_lasts_a_second_is_an_entrapment():
    slip = course((20, 30, 0.95), (40, 60, 0.95), (80, 91, 0.95))
    slip[70:90, :1] = 1.0  # one wheel of three
    slip[95:] = np.nan
    found = entrapments(TIME, slip)
    assert found.begins.tolist() == [40, 80]
    assert found.entrapped.tolist() == [50, 90]
    assert np.flatnonzero(found.under_way).tolist() == [*range(40, 60), *range(80, 91)]


@pytest.mark.parametrize('value', [-1.0, 0.9, np.nan])
def test_skidding_the_border_and_rest_are_none(value):
    found = entrapments(TIME, np.full((TIME.size, 2), value))
    assert not found.entrapped.size and not found.under_way.any()


def test_a_warning_was_right_a_near_miss_false_or_late():
    slip = course((300, 400, 0.95), (700, 705, -0.8))
    starts = [9.9, 10.1, 30.5, 35.0, 49.95, 50.05, 95.0]  # it passes 0.75 at 70.0 s
    told = verdicts(TIME, slip, [Span(start, start + 1.0) for start in starts])
    outcomes = [Outcome.FALSE] + [Outcome.ENTRAPPED] * 3 + [Outcome.FALSE, Outcome.NEAR_MISS]
    assert [v.outcome for v in told] == [*outcomes, Outcome.FALSE]
    assert [v.lead for v in told[1:4]] == pytest.approx([20.9, 0.5, -4.0])
    assert told[0].lead is None
    # Above 0.9 for less than a second it is a near miss.
    (told,) = verdicts(TIME, course((300, 309, 1.0)), [Span(20.0)])
    assert told == (Outcome.NEAR_MISS, None)


def test_a_warning_that_stands_until_it_comes_was_right():
    early, taken_back = verdicts(TIME, course((600, 700, 0.95)), [Span(10.0), Span(10.0, 59.0)])
    assert early.outcome is Outcome.ENTRAPPED and early.lead == pytest.approx(51.0)
    assert taken_back.outcome is Outcome.FALSE


def test_the_lead_is_that_of_the_warning_that_stood():
    assert lead_of(31.0, [Span(5.0, 9.0), Span(20.0, 40.0)]) == pytest.approx(11.0)
    assert lead_of(31.0, [Span(20.0)]) == pytest.approx(11.0)
    assert lead_of(31.0, [Span(5.0, 30.0), Span(31.5)]) is None
