# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip of a wheel that begins to turn; classes: borders, hysteresis, dwell, unknown."""

from dataclasses import replace

import numpy as np
import pytest
from fake_estimator import SECOND, configuration
from hypothesis import given, settings
from hypothesis import strategies as st
from parts import straight_headings

from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.classes import (
    ClassState,
    PublishedClasses,
    SlipClassifier,
    instantaneous_class,
)
from wheel_terra_estimator.estimation.judgement.slip import (
    BodyMotion,
    SlipJudge,
    slip_and_deviation,
)
from wheel_terra_estimator.estimation.output_guard import blank_estimates

BORDERS = (0.3, 0.6, 0.9)
HYSTERESIS, DWELL, CLASS_STD = 0.02, 0.3, 0.25
UNKNOWN = SlipClass.UNKNOWN


def sets_of(slips, stds=0.01, dt=0.1, judged=True, config=None):
    """Sets as the estimator gives them, before they get classes."""
    blank = blank_estimates(config or configuration())
    slips = np.asarray(slips, dtype=float)
    stds, judged = np.broadcast_to(stds, slips.shape), np.broadcast_to(judged, slips.shape)
    return [
        replace(
            blank,
            stamp=round((1.0 + i * dt) * SECOND),
            slip=np.full(2, slip),
            slip_std=np.full(2, std),
            slip_class=np.full(2, 0 if told else UNKNOWN, dtype=np.uint8),
        )
        for i, (slip, std, told) in enumerate(zip(slips, stds, judged, strict=True))
    ]


def run(slips, stds=0.01, dt=0.1, judged=True, **changes):
    config = configuration(**changes)
    classes = PublishedClasses(config)
    given_sets = sets_of(slips, stds, dt, judged, config)
    return [int(classes.follow(given_set).slip_class[1]) for given_set in given_sets]


def contradictions(sets, judged):
    """What of published sets breaks the contract's rule, from their slips and stamps alone.

    Unknown where the deviation says so or the wheel is not judged, and before a first class 3 for
    the dwell. A class may stand as long as |s| has been within half the hysteresis of it at some
    time within the dwell.
    """
    found = []
    half = 0.5 * HYSTERESIS + 1e-12
    lower, upper = (0.0, *BORDERS), (*BORDERS, 1.0)
    for wheel in range(len(sets[0].slip)):
        within = None  # stamp at which the present class last agreed with |s|
        waits = None  # stamp since which a first class 3 waits for the dwell
        for i, e in enumerate(sets):
            kind, slip = int(e.slip_class[wheel]), abs(float(e.slip[wheel]))
            if e.slip_std[wheel] > CLASS_STD or not judged[i]:
                if kind != UNKNOWN:
                    found.append((i, wheel, 'told of what is not known'))
                within = waits = None
                continue
            if kind == UNKNOWN:
                waits = e.stamp if waits is None else waits
                top = slip > BORDERS[-1] and (e.stamp - waits) * 1e-9 < DWELL
                if not top:
                    found.append((i, wheel, 'unknown though known'))
                within = None
                continue
            waits = None
            before = int(sets[i - 1].slip_class[wheel]) if i else int(UNKNOWN)
            if lower[kind] - half <= slip <= upper[kind] + half:
                within = e.stamp
            elif kind != before or within is None:
                found.append((i, wheel, 'not the class of the slip'))
            elif (e.stamp - within) * 1e-9 > DWELL + (e.stamp - sets[i - 1].stamp) * 1e-9 + 1e-6:
                found.append((i, wheel, 'held beyond the dwell'))
    return found


def test_a_slip_is_known_to_a_thousandth_at_best_and_to_one_at_worst(parts):
    judge = SlipJudge(parts.rover)
    for speed_std, std in ((1e-9, 1e-3), (5.0, 1.0)):
        headings = straight_headings(parts.rover)
        body = BodyMotion(0.04, speed_std, 0.0, 0.0, headings, 0.0, False, (0.0,) * 6)
        assert {wheel.std for wheel in judge.update(1.0, (0.05,) * 6, body)} == {std}


@pytest.mark.parametrize(
    ('slip', 'expected'),
    [(0.0, 0), (0.3, 0), (0.301, 1), (-0.6, 1), (0.9, 2), (0.901, 3), (-1.0, 3)],
)
def test_upper_bound_belongs_to_the_class_below(slip, expected):
    assert instantaneous_class(slip, BORDERS) == expected


def test_change_comes_after_the_dwell_and_not_before():
    assert run([0.1] * 5 + [0.5] * 10) == [0] * 8 + [1] * 7
    assert set(run([0.1] * 5 + [0.5] * 2 + [0.1] * 5)) == {0}
    through = run([0.1] * 5 + [0.4, 0.7, 0.95, 0.95, 0.95])
    assert through[-1] == 3
    assert 1 not in through  # it never stayed there


def test_beyond_its_limit_the_class_is_unknown_and_what_it_was_is_forgotten():
    classes = run([0.1, 0.1, 0.1, 0.85, 0.85], [0.1, 0.26, 1.0, 0.25, 0.25])
    assert classes == [0, 255, 255, 2, 2]
    assert run([0.1] * 2, 0.3, filter__class_std=0.31) == [0, 0]


def test_the_hysteresis_is_what_keeps_a_flicker_out():
    flicker = [0.29] * 5 + [0.309, 0.309, 0.309, 0.309, 0.291, 0.291, 0.291, 0.291] * 5
    assert set(run(flicker)) == {0}
    assert set(run(flicker, filter__class_hysteresis=0.0)) == {0, 1}
    # Half of it on each side of a border.
    assert run([0.25] * 5 + [0.308] * 10)[-1] == 0 and run([0.25] * 5 + [0.312] * 10)[-1] == 1
    assert run([0.35] * 5 + [0.292] * 10)[-1] == 1 and run([0.35] * 5 + [0.288] * 10)[-1] == 0


@pytest.mark.parametrize('start', [0.0, 0.1, 0.4, 0.7])
def test_a_first_class_3_comes_at_the_dwell_whatever_the_stamps_round_to(start):
    """0.7 - 0.4 is a little less than 0.3 in floating point, 0.4 - 0.1 a little more."""
    classifier, state, found = SlipClassifier(BORDERS, 0.02, 0.3), ClassState(), []
    for i in range(5):
        state = classifier.update(state, start + 0.1 * i, 0.95)
        found.append(state.current)
    assert found == [UNKNOWN] * 3 + [3] * 2


@given(
    st.lists(
        st.tuples(
            st.floats(-1.0, 1.0) | st.sampled_from((0.295, 0.305, 0.312, 0.589, 0.905, -0.915)),
            st.floats(0.0, 1.0) | st.just(0.05),
            st.integers(1, 8),
            st.integers(0, 9),
        ),
        min_size=1,
        max_size=30,
    ),
    st.sampled_from((0.02, 0.05, 0.1, 0.2, 0.5)),
)
@settings(max_examples=30, deadline=None)
def test_the_class_is_that_of_the_published_slip(stretches, dt):
    """Any slips, deviations and rests, in stretches of some sets."""
    rows = [(slip, std, rest > 0) for slip, std, count, rest in stretches for _ in range(count)]
    slips, stds, judged = zip(*rows, strict=True)
    given_sets = sets_of(slips, stds, dt, judged)
    classes = PublishedClasses(configuration())
    assert contradictions([classes.follow(e) for e in given_sets], judged) == []


@pytest.mark.parametrize(('slip', 'left'), [(0.95, 0.0), (0.85, 3.0), (-0.95, 3.0)])
def test_a_driving_wheel_that_is_stuck_has_no_travel_left(slip, left):
    classes = PublishedClasses(configuration())
    for estimates in sets_of([slip] * 10):
        ahead = replace(estimates, rim_travel_left=np.full(2, 3.0), time_to_stuck=np.full(2, 3.0))
        published = classes.follow(ahead)
    assert published.rim_travel_left == pytest.approx([left] * 2)
    assert published.time_to_stuck == pytest.approx([left] * 2)


def test_what_lies_ahead_is_held_where_it_cannot_be_told():
    """At rest, where the inputs are not judged, and under a warning where the slip is in doubt."""
    classes = PublishedClasses(configuration())
    near, far = ({'rim_travel_left': np.full(2, left)} for left in (0.5, 10.0))
    unknown = {'slip_class': np.full(2, SlipClass.UNKNOWN, dtype=np.uint8)}
    doubtful = {'slip_std': np.full(2, 0.5)}
    (given,) = sets_of([0.5])
    for said, left in (
        (near, 0.5),
        (far | unknown, 0.5),
        (far | doubtful | {'stuck': True}, 0.5),
        (far | doubtful, 10.0),
        (near | unknown, 10.0),
        (near | unknown | {'stuck_probability': np.ones(2)}, 0.5),  # stalled: it tells
    ):
        assert classes.follow(replace(given, **said)).rim_travel_left == pytest.approx([left] * 2)


def test_a_new_run_begins_without_a_class():
    config = configuration()
    core = EstimatorCore(config)
    classes = core._classes
    first = sets_of([0.1] * 3, config=config)
    assert [int(classes.follow(e).slip_class[0]) for e in first] == [0, 0, 0]
    core.reset()
    assert int(classes.follow(sets_of([0.5], config=config)[0]).slip_class[0]) == 1


def test_a_wheel_that_begins_to_turn_is_not_sure_to_spin(parts):
    """A rate just above rest, before the filter knows that the rover has begun to move."""
    rest, n = parts.rover.rest_speed, parts.rover.wheel_count
    headings = straight_headings(parts.rover)
    noise = parts.sensors.wheel_rate_std * parts.rover.slip_radius[0]
    body = BodyMotion(0.7 * rest, 0.3 * rest, 0.0, 0.0, headings, 0.0, True, (noise,) * n)
    rims = (1.05 * rest,) + (0.5 * rest,) * (n - 1)
    turning, *standing = SlipJudge(parts.rover).update(0.0, rims, body)
    assert turning.std > 0.25
    assert abs(turning.slip - (1.0 - 0.7 / 1.05)) < 2.0 * turning.std
    assert not any(wheel.judged for wheel in standing)
    lost = SlipJudge(parts.rover).update(0.0, rims, body._replace(speed_std=9.0))[0]
    assert lost.std == 1.0, 'no slip is further off'


@pytest.mark.parametrize(
    ('rim', 'v', 'slip', 'known'),
    [
        (0.0025, 0.0005, 0.8, False),  # noise of a rover that stands
        (0.0025, -0.0005, 1.0, False),
        (0.0015, 0.004, -1.0, False),
        (0.05, 0.0005, 0.99, True),  # a spin
        (0.0025, 0.0025, 0.0, False),
        (0.03, -0.045, 1.0, True),
    ],
)
def test_noise_of_the_rates_is_no_sure_spin_of_wheels_that_stand(rim, v, slip, known):
    """Rates are known to 1 mm/s, 2.5 times of which is more than rest."""
    found, std = slip_and_deviation(rim, v, 0.0005, 0.001, 0.002)
    assert found == pytest.approx(slip)
    assert (std < 0.25) is known


@pytest.mark.parametrize(('rim', 'v'), [(0.05, 0.03), (0.05, 0.08), (-0.05, -0.03), (-0.05, -0.08)])
def test_the_deviation_of_a_slip_is_that_of_its_two_speeds(rim, v):
    def slip(rim, v):
        return slip_and_deviation(rim, v, 0.004, 0.003, 0.002)[0]

    step = 1e-6
    by_rim = (slip(rim + step, v) - slip(rim - step, v)) / (2.0 * step)
    by_v = (slip(rim, v + step) - slip(rim, v - step)) / (2.0 * step)
    expected = np.hypot(by_v * 0.004, by_rim * 0.003)
    assert slip_and_deviation(rim, v, 0.004, 0.003, 0.002)[1] == pytest.approx(expected)


def test_slip_and_slip_velocity_are_held_while_no_rate_is_known(parts):
    judge = SlipJudge(parts.rover)
    headings = straight_headings(parts.rover)
    body = BodyMotion(0.04, 0.001, 0.0, 0.0, headings, 0.0, False, (0.0005,) * 6)
    assert {wheel.velocity for wheel in judge.update(0.9, (float('nan'),) * 6, body)} == {0.0}
    known = judge.update(1.0, (0.05,) * 6, body)
    unknown = judge.update(1.1, (float('nan'),) * 6, body._replace(speed=0.01))
    assert [(w.slip, w.velocity) for w in unknown] == [(w.slip, w.velocity) for w in known]
    assert known[0].velocity == pytest.approx(0.01)
    assert known[0].velocity_std == pytest.approx(np.hypot(0.001, 0.0005))
    assert {wheel.velocity_std for wheel in unknown} == {1.0}
    standing = judge.update(1.2, (0.0,) * 6, body._replace(speed=0.0))
    assert {wheel.velocity for wheel in standing} == {0.0}
