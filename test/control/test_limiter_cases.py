# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the limiter lets pass: named cases. Which way is closed and which is open after any
sequence of warnings, stops, restarts and releases: test_limiter_sequences."""

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheel_terra_estimator.control.traction_law import LimiterTuning, traction_scale
from wheel_terra_estimator.control.traction_limiter import (
    INTERLOCK,
    ZERO,
    Estimates,
    Event,
    Interlock,
    LimiterState,
    after_command,
    after_direction,
    after_estimates,
    after_release,
    after_stuck,
    decide,
)
from wheel_terra_estimator.errors import UserError

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'limiter.md'
UNKNOWN = 255
STEP = 0.05  # [s] between two commands and two sets


class Rover:
    """A limiter over time: commands and sets of four wheels at 20 Hz."""

    def __init__(self, now=100.0, **tuning):
        self.tuning = LimiterTuning(**tuning)
        self.now = now
        self.state = LimiterState(still_since=now)
        self.sent = []

    def estimate(self, slip=0.1, slip_class=0, travel=10.0, rim=0.1, age=0.02):
        """Take a set of wheels that all turn at `rim` [m/s]."""
        sets = Estimates(age, [slip] * 4, [slip * rim] * 4, [slip_class] * 4, [travel] * 4)
        self.state = after_estimates(self.state, self.now, sets, self.tuning)

    def rest(self):
        """Take a set of a rover at rest."""
        self.estimate(slip=0.7, slip_class=UNKNOWN, rim=0.0)

    def command(self, forward=0.0, turn=0.0):
        """Send a command; return what was decided."""
        self.now += STEP
        wanted = (forward, 0.0, 0.0, 0.0, 0.0, turn)
        self.state, decision = after_command(self.state, self.now, wanted, self.tuning)
        self.sent.append(self.state.sent)
        return decision

    def drive(self, seconds, forward=0.0, turn=0.0, **estimate):
        """Send a command again and again, with a set before each; return the last decision."""
        for _ in range(round(seconds / STEP)):
            self.estimate(**estimate)
            decision = self.command(forward, turn)
        return decision

    def stuck(self, stuck=True, direction=1, change=True):
        """Take what an estimator publishes."""
        self.state = after_direction(self.state, direction if stuck else 0)
        self.state = after_stuck(self.state, stuck, change=change)

    def scale(self, forward=0.0, turn=0.0):
        """Return what would pass of a command that comes now."""
        return decide(self.state, self.now, (forward, 0.0, 0.0, 0.0, 0.0, turn), self.tuning).scale


# -- Stop -----------------------------------------------------------------------------------------


def test_release_of_a_warning_or_a_stop_opens_a_crawl_then_what_is_known_decides_anew():
    near = {'slip': 0.7, 'slip_class': 2, 'travel': 0.3}
    warned, stopped = Rover(), Rover()
    warned.stuck()
    stopped.drive(1.0, 0.1, **near)
    warned.state, words = after_release(warned.state, warned.now)
    assert words.startswith('still stuck') and '10 s' in words
    assert warned.command(0.1).reason.endswith('0.30 for another 10 s')
    stopped.state, _ = after_release(stopped.state, stopped.now)
    for rover, state in ((warned, 'stuck'), (stopped, 'stopped')):
        assert rover.drive(9.9, 0.1, **near)[:2] == (0.3, 'released')
        assert rover.drive(0.2, 0.1, **near)[:2] == (0.0, state)
    stopped.state, _ = after_release(stopped.state, stopped.now)
    assert stopped.drive(9.9, 0.1).scale == 0.3
    assert stopped.drive(0.2, 0.1).scale == 1.0


def test_a_wheel_that_lost_its_rate_in_motion_does_not_move_a_rover_at_rest():
    """Its slip velocity is held at 0.02 m/s; the others stand, and the next start passes whole."""
    rover = Rover()

    def take(turning, slip_class):
        velocity = [0.02 * turning] * 3 + [0.02]
        given = Estimates(0.02, [0.1] * 4, velocity, [*[slip_class] * 3, UNKNOWN], [10.0] * 4)
        rover.state = after_estimates(rover.state, rover.now, given, rover.tuning)

    rover.drive(1.0, 0.2)
    for forward, turning, slip_class in ((0.2, 1.0, 0), (0.0, 0.0, UNKNOWN)):
        for _ in range(100):
            take(turning, slip_class)
            rover.command(forward)
    assert rover.scale(0.2) == 1.0


def test_a_limiter_restarted_in_motion_takes_unknown_slips_for_no_start():
    rover = Rover()
    rover.now += 1.0
    rover.drive(0.5, 0.1, slip=0.2, slip_class=UNKNOWN)
    assert rover.scale(0.1) == rover.tuning.stale_scale


def test_the_table_is_that_of_the_page():
    rows = [line.strip('|\n ').split(' | ') for line in PAGE.open() if line.startswith('| ')]
    states = [cell.strip('`') for cell in next(row for row in rows if row[0] == 'event')[1:]]
    written = {
        Event(row[0]): {
            Interlock(state): Interlock(cell.strip('`'))
            for state, cell in zip(states, row[1:], strict=True)
        }
        for row in rows
        if row[0] in {event.value for event in Event}
    }
    assert written == dict(INTERLOCK)
    assert set(INTERLOCK) == set(Event)
    assert all(set(row) == set(Interlock) for row in INTERLOCK.values())


# -- What is not known ----------------------------------------------------------------------------


def test_pulses_from_rest_pass_whole_only_once_until_a_class_is_known():
    rover = Rover()
    pulses = []
    for _ in range(5):
        for _ in range(20):
            rover.rest()
            rover.command()
        pulses.append(rover.drive(0.5, 0.1, slip_class=UNKNOWN).scale)
    assert pulses == [1.0, 0.3, 0.3, 0.3, 0.3]
    rover.drive(0.5, 0.1)
    for _ in range(20):
        rover.rest()
        rover.command()
    assert rover.drive(0.5, 0.1, slip_class=UNKNOWN).scale == 1.0


def test_doubt_lets_the_last_known_class_count_on_then_the_cautious_one():
    rover = Rover()
    before, state, _ = rover.drive(1.0, 0.1, slip=0.45, slip_class=1)
    assert (before, state) == (pytest.approx(0.65), 'slowed')
    found = [rover.drive(STEP, 0.1, slip=0.0, slip_class=UNKNOWN).scale for _ in range(40)]
    assert found[:19] == [before] * 19 and found[-19:] == [0.3] * 19


def test_some_wheels_in_doubt_never_raise_the_scale():
    rover = Rover()

    def estimate(classes, slips):
        rates = [0.1 * s for s in slips]
        sets = Estimates(0.0, slips, rates, classes, [10.0] * 4)
        rover.state = after_estimates(rover.state, rover.now, sets, rover.tuning)
        return rover.command(0.1).scale

    before = estimate([1, 1, 0, 0], [0.55, 0.55, 0.2, 0.2])
    later = [estimate([UNKNOWN, UNKNOWN, 0, 0], [0.0, 0.0, 0.2, 0.2]) for _ in range(100)]
    assert before == pytest.approx(0.825)
    assert later[0] == before and later[-1] == pytest.approx(1.0 - 0.7 / 3.0)
    assert all(b <= a for a, b in pairwise(later))


def some_known(rover, classes, travel, age=0.0):
    sets = Estimates(age, [0.2] * 4, [0.02] * 4, classes, [travel] * 4)
    rover.state = after_estimates(rover.state, rover.now, sets, rover.tuning)
    return rover.state.interlock


def test_wheels_of_which_nothing_is_known_do_not_outvote_those_that_are():
    """A limiter that was restarted, and one wheel that is not in doubt."""
    rover = Rover()
    rover.command(0.1)
    assert some_known(rover, [UNKNOWN] * 3 + [0], 0.3) is Interlock.STOPPED


def test_rim_travel_that_came_late_is_the_last_known_one():
    rover = Rover()
    some_known(rover, [0] * 4, 0.3)
    rover.stuck(False)
    some_known(rover, [0] * 4, 1.0, age=2.8)
    assert some_known(rover, [0, UNKNOWN, UNKNOWN, 0], 1.0, age=2.8) is Interlock.FREE
    some_known(rover, [0] * 4, 0.3, age=2.8)
    rover.stuck(False)
    assert some_known(rover, [0, UNKNOWN, UNKNOWN, UNKNOWN], 1.0) is Interlock.STOPPED


def test_estimates_are_fresh_by_their_stamp_and_grow_old_where_none_follows():
    for age in (1.2, 2.8, 59.0):
        decision = Rover().drive(3.0, 0.1, age=age)
        assert decision[:2] == (0.3, 'no estimate') and f'{age:.1f} s old' in decision.reason
    rover = Rover()
    rover.drive(3.0, 0.1, age=0.5)
    assert rover.scale(0.1) == 1.0
    rover.now += 0.6
    assert rover.scale(0.1) == 0.3


@pytest.mark.parametrize('offset', [-3600.0, -5.0, 1.7e9])
def test_where_the_clocks_disagree_age_is_by_how_much_later_than_the_quickest_a_set_comes(offset):
    rover = Rover()
    assert rover.drive(1.0, 0.1, age=offset).scale == 1.0
    late = [rover.drive(STEP, 0.1, age=offset + 0.9 * STEP * i).scale for i in range(60)]
    assert late == sorted(late, reverse=True) and late[-1] == 0.3, 'a node that starves'
    assert rover.drive(STEP, 0.1, age=offset).scale == 1.0
    for step in (20.0, -20.0, 1e4):
        offset += step  # of either clock
        assert rover.drive(0.5, 0.1, age=offset - 1e4).scale == 1.0, step


def test_a_topic_that_ended_is_no_clock_that_disagrees():
    """Its sets go on with those of the others, and grow old as time goes by."""
    rover = Rover()
    rover.drive(1.0, 0.1)
    late = [rover.drive(STEP, 0.1, age=STEP * i).scale for i in range(round(90.0 / STEP))]
    assert late == sorted(late, reverse=True) and late[-1] == 0.3


@pytest.mark.parametrize('slip', [0.0, 0.5])
def test_late_news_counts_only_where_it_is_bad(slip):
    rover = Rover(stale_scale=1.0)
    rover.drive(1.0, 0.1, slip=0.45, slip_class=1)
    rover.estimate(slip=slip, slip_class=1, age=5.0)
    expected = {0.0: 0.65, 0.5: 1.0 - 0.7 * 2.0 / 3.0}[slip]
    assert rover.scale(0.1) == pytest.approx(expected)
    rover.estimate(slip=0.7, slip_class=2, travel=0.1, age=5.0)
    assert rover.scale(0.1) == 0.0


# -- The way up, and down -------------------------------------------------------------------------


def test_a_curve_stays_the_same_curve_on_the_way_up():
    rover = Rover()
    rover.drive(1.0, 0.4, turn=0.2)
    assert all(s[5] == pytest.approx(0.5 * s[0]) for s in rover.sent[-20:])


@pytest.mark.parametrize('wrong', [{'critical_slip': 0.3}, {'stop_rim_travel': 2.0}])
def test_bounds_that_cross_are_refused(wrong):
    with pytest.raises(UserError, match='must be below'):
        LimiterTuning(**wrong)


WILD = (math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 0.0, -0.0, 0.5, -3.0, 0.95, 1e9)


def wild(size):
    return st.lists(st.sampled_from(WILD), min_size=size, max_size=size)


@st.composite
def wild_estimates(draw):
    sizes = draw(st.sampled_from(((2, 2, 2, 2), (1, 1, 1, 1), (0, 0, 0, 0), (2, 0, 3, 1))))
    slip, velocity, classes, travel = (draw(wild(size)) for size in sizes)
    classes = tuple(draw(st.sampled_from((0, 1, 2, 3, 4, 200, 255))) for _ in classes)
    delay = draw(st.floats(-1e11, 1e11))
    return Estimates(delay, slip, velocity, classes, travel)


EVENTS = st.one_of(
    wild_estimates(),
    wild(6).map(tuple),
    st.integers(-128, 127),
    st.tuples(st.booleans(), st.booleans()),
    st.none(),
)


@pytest.mark.hypothesis
@given(st.lists(st.tuples(st.sampled_from((0.0, 0.05, 1.5)), EVENTS), max_size=14))
def test_wild_numbers_open_no_way_and_never_reach_the_base(events):
    """Other publishers than the estimator: any number in any field, any direction of one byte."""
    tuning, now, state = LimiterTuning(), 1000.0, LimiterState(still_since=1000.0)
    for gap, event in events:
        now += gap
        if isinstance(event, Estimates):
            state = after_estimates(state, now, event, tuning)
        elif isinstance(event, int):
            state = after_direction(state, event)
        elif event is None:
            state = after_release(state, now)[0]
        elif len(event) == 2:
            state = after_stuck(state, event[0], change=event[1])
        else:
            state, decision = after_command(state, now, event, tuning)
            assert 0.0 <= decision.scale <= 1.0
            asked = event if all(map(math.isfinite, event)) else ZERO
            for out, component in zip(state.sent, asked, strict=True):
                assert abs(out) <= abs(component) and out * component >= 0.0
            if state.interlock is Interlock.STUCK and now >= state.released_until:
                assert state.direction * state.sent[0] <= 0.0
    assert state.direction in (-1, 0, 1)


# -- The law --------------------------------------------------------------------------------------


FREE = [10.0] * 6
SLIPS = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4)
TRAVELS = st.lists(st.floats(0.0, 10.0), min_size=4, max_size=4)


def scale(slip, travel, **limits):
    return traction_scale(slip, travel, LimiterTuning(**limits))[0]


@pytest.mark.parametrize(
    ('slip', 'travel', 'passes'),
    [
        ([0.1] * 6, FREE, 1.0),
        ([0.7] * 6, [0.1] * 6, 0.0),
        ([0.1] * 5 + [0.99], [10.0] * 5 + [0.0], 1.0),  # one spinning wheel stops no rover
        ([-0.1] * 5 + [0.99], FREE, 1.0),  # nor where the others brake
        ([-0.5] * 6, FREE, 1.0),  # braking downhill
        ([0.1] * 6, [1.0] * 2 + [10.0] * 4, 0.5),  # half way from 1.4 to 0.6 m of rim travel
        ([0.55] * 6, [1.0] * 6, 0.3 + 0.7 / 6.0),  # the lower of both
        ([0.1] * 6, [0.61] * 6, 0.3),
    ],
)
def test_what_passes_of_a_command(slip, travel, passes):
    assert scale(slip, travel) == pytest.approx(passes)


@given(SLIPS, SLIPS, TRAVELS, TRAVELS)
def test_more_slip_and_less_travel_of_any_wheel_never_speed_up(a, b, c, d):
    high, low = map(max, a, b), map(min, a, b)
    far, near = list(map(max, c, d)), list(map(min, c, d))
    high, low = list(high), list(low)
    assert 0.0 <= scale(high, near) <= scale(low, far) <= 1.0


def test_limits_are_the_callers():
    limits = {'comfortable_slip': 0.1, 'critical_slip': 0.2, 'creep_scale': 0.1}
    assert scale([0.3] * 4, FREE[:4], **limits) == pytest.approx(0.1)
