# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Classes: borders, hysteresis, dwell, unknown."""

import pytest

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.classes import (
    ClassState,
    SlipClassifier,
    exceedance_probability,
    instantaneous_class,
)

BORDERS = (0.3, 0.6, 0.9)


def run(slips, std=0.01, dt=0.1, sliding_back=False, hysteresis=0.02):
    classifier, state, found = SlipClassifier(BORDERS, hysteresis, 0.3), ClassState(), []
    for i, slip in enumerate(slips):
        state = classifier.update(state, i * dt, slip, std, sliding_back)
        found.append(state.current)
    return found


@pytest.mark.parametrize(
    ('slip', 'expected'),
    [(0.0, 0), (0.3, 0), (0.301, 1), (-0.6, 1), (0.9, 2), (0.901, 3), (-1.0, 3)],
)
def test_upper_bound_belongs_to_the_class_below(slip, expected):
    assert instantaneous_class(slip, BORDERS) == expected


def test_change_comes_after_the_dwell_and_not_before():
    classes = run([0.1] * 5 + [0.5] * 10)
    assert classes[:8] == [0] * 8
    assert classes[8:] == [1] * 7


def test_short_excursion_changes_nothing():
    assert set(run([0.1] * 5 + [0.5] * 2 + [0.1] * 5)) == {0}


def test_flicker_inside_the_band_changes_nothing():
    assert set(run([0.29] * 5 + [0.309, 0.291] * 20)) == {0}


def test_run_through_several_classes_is_one_run():
    classes = run([0.1] * 5 + [0.4, 0.7, 0.95, 0.95, 0.95])
    assert classes[-1] == 3
    assert 1 not in classes  # it never stayed there


def test_badly_known_slip_needs_a_larger_excess():
    assert run([0.1] * 5 + [0.34] * 10)[-1] == 1
    assert run([0.1] * 5 + [0.34] * 10, std=0.3)[-1] == 0


def test_a_guess_is_no_high_slip():
    assert run([0.1] * 5 + [1.0] * 10, std=0.45)[-1] == 1
    assert run([0.1] * 5 + [0.9] * 10, std=0.3)[-1] == 2


def test_sliding_back_is_stuck():
    assert run([1.0] * 5, sliding_back=True)[-1] == 3


def test_the_hysteresis_is_what_keeps_a_flicker_out():
    flicker = [0.29] * 5 + [0.309, 0.309, 0.309, 0.309, 0.291, 0.291, 0.291, 0.291] * 5
    assert set(run(flicker)) == {0}
    assert set(run(flicker, hysteresis=0.0)) == {0, 1}


def test_probability_of_a_gaussian():
    assert exceedance_probability(0.8, 0.1, 0.8) == pytest.approx(0.5)
    assert exceedance_probability(0.8, 0.1, 0.8 + 0.1) == pytest.approx(0.158655, abs=1e-5)


@pytest.mark.parametrize('start', [0.0, 0.1, 0.4, 0.7])
def test_a_first_class_of_stuck_comes_at_the_dwell_whatever_the_stamps_round_to(start):
    """0.7 - 0.4 is a little less than 0.3 in floating point, 0.4 - 0.1 a little more."""
    classifier, state, found = SlipClassifier(BORDERS, 0.02, 0.3), ClassState(), []
    for i in range(5):
        state = classifier.update(state, start + 0.1 * i, 0.95, 0.01, False)
        found.append(state.current)
    assert found == [SlipClass.UNKNOWN] * 3 + [3] * 2
