# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The invariants of docs/limiter.md over any sequence of events.

The world of the test is an operator, an estimator that may or may not keep its warning over a
restart, a clock that may be wrong, and a limiter that keeps a stop over a restart. What must be
closed is worked out from the words of the invariants, not from the limiter's table. A long run:
``LIMITER_SEQUENCES=200000 python -m pytest -n 0 -m 'not slow' -k no_sequence --timeout 0
--hypothesis-profile random test/estimation/test_limiter_sequences.py``.
"""

import os
from itertools import product

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from wheel_terra_estimator.control import traction_limiter as limiter
from wheel_terra_estimator.control.traction_law import LimiterTuning
from wheel_terra_estimator.control.traction_limiter import (
    Estimates,
    Event,
    Interlock,
    LimiterState,
)

SEQUENCES = int(os.environ.get('LIMITER_SEQUENCES', '200'))
UNKNOWN = 255
WHEELS = 4
PERIOD = 0.2  # [s] of sets and commands
TUNINGS = (
    LimiterTuning(creep_scale=0.2),
    LimiterTuning(stale_scale=0.0, creep_scale=0.5),
    LimiterTuning(stale_scale=1.0, creep_scale=0.1),
)
TIMES = (1, 4, 18)
# slip, class, rim travel left: of a good drive, of one that slips, of one that must stop
KNOWN = ((0.05, 0, 10.0), (0.45, 1, 10.0), (0.8, 2, 10.0), (0.2, 0, 1.0), (0.95, 3, 0.3))
LATE = 2.8  # [s]
SKEWS = (0.0, 0.0, -3600.0, 3600.0, LATE)  # [s] by which stamps are behind the clock


def one_of(*choices):
    """Draw one of each at once, which hypothesis does quickest."""
    return st.sampled_from(list(product(*choices)))


EITHER = st.sampled_from((False, True))


def linear(forward, turn=0.0):
    return (forward, 0.0, 0.0, 0.0, 0.0, turn)


class World(RuleBasedStateMachine):
    """Operator, estimator, limiter and clock."""

    @initialize(drawn=one_of(TUNINGS, (False, True)))
    def begin(self, drawn):
        self.tuning, self.estimator_keeps = drawn
        self.now, self.skew = 1000.0, 0.0
        self.state = LimiterState(still_since=self.now)
        self.stuck, self.stuck_direction = False, 0  # of the estimator
        self.age, self.received_at = 0.0, 0.0  # of the last set
        self.way, self.moved_at = 0, 0.0  # what last went out forward or backward, and when
        self.last = None  # what the last set said of each wheel that was known
        self.doubted = set()  # wheels that have become unknown since
        # What the invariants say: which way led in, None = none does; since when the rover moves
        # out, and until when the operator has released it.
        self.led, self.by_estimator = None, False
        self.out, self.released_until = None, 0.0

    # -- What happens ---------------------------------------------------------------------------

    @rule(drawn=one_of((0.0, 0.1, -0.1, 0.6, -0.6), (0.0, 0.3), TIMES, (0.05, 0.2, 1.0, 3.0)))
    def command(self, drawn):
        forward, turn, times, gap = drawn
        for _ in range(times):
            self.now += gap
            self.send(forward, turn)

    @rule(drawn=one_of(KNOWN, (1, -1), TIMES, (0.1, -0.1, None)))
    def drive(self, drawn):
        """Sets of a rover that moves so, and commands in between or none."""
        known, ahead, times, forward = drawn
        for _ in range(times):
            self.now += PERIOD
            self.last = [known] * WHEELS
            self.doubted = set()
            self.receive(self.last, rim=0.1 * ahead)
            if forward is not None:
                self.send(forward)

    @precondition(lambda self: self.last)
    @rule(drawn=one_of(({0}, {1, 2}, {0, 1, 2, 3}), TIMES, (0.05, 1.0), (0.1, -0.1, None)))
    def doubt(self, drawn):
        """The class of wheels becomes unknown while the rover moves on."""
        wheels, times, slip, forward = drawn
        for _ in range(times):
            self.now += PERIOD
            loses = limiter.is_fresh(self.state, self.now, self.tuning)
            before = self.scales()
            self.doubted |= wheels
            rows = [
                (slip, UNKNOWN, 10.0) if i in self.doubted else row
                for i, row in enumerate(self.last)
            ]
            self.receive(rows, rim=0.1)
            if loses:
                self.no_raise(before)
            if forward is not None:
                self.send(forward)

    @rule(times=st.sampled_from(TIMES))
    def rest(self, times):
        """Sets of a rover at rest, and commands of zero."""
        for _ in range(times):
            self.now += PERIOD
            self.receive([(0.5, UNKNOWN, 10.0)] * WHEELS, rim=0.0)
            self.send(0.0)
            self.last = None

    @rule(wait=st.sampled_from((0.1, 0.9, 1.2, 5.0, 3600.0)))
    def silence(self, wait):
        """No set comes: an input is lost, or the estimator is dead."""
        before = self.scales()
        self.now += wait
        self.no_raise(before)

    @rule()
    def unusable(self):
        """A set whose parts do not fit."""
        before = self.scales()
        self.state = limiter.after_estimates(
            self.state, self.now, Estimates(0.0, [0.0] * 3, [0.0] * 3, [0] * 4, [10.0] * 4),
            self.tuning)  # fmt: skip
        self.no_raise(before)

    @rule(skew=st.sampled_from(SKEWS))
    def clock_steps(self, skew):
        self.skew = skew

    @precondition(lambda self: not self.stuck)
    @rule(drawn=one_of((1, -1, 0), (False, True)))
    def warning_rises(self, drawn):
        direction, direction_first = drawn
        self.stuck, self.stuck_direction = True, direction
        self.tell(change=True, direction_first=direction_first)
        self.led = direction or self.led or 0
        self.by_estimator, self.out, self.released_until = True, None, 0.0

    @rule(direction_first=EITHER)
    def warning_falls_or_is_reset(self, direction_first):
        self.stuck, self.stuck_direction = False, 0
        self.tell(change=True, direction_first=direction_first)
        self.led, self.by_estimator = None, False

    @rule(direction_first=EITHER)
    def estimator_restarts(self, direction_first):
        if not self.estimator_keeps:
            self.stuck, self.stuck_direction = False, 0
        self.tell(change=False, direction_first=direction_first)
        self.by_estimator = self.stuck
        if self.stuck:
            self.out = None

    @rule(direction_first=EITHER)
    def limiter_restarts(self, direction_first):
        before, self.state = self.state, LimiterState(still_since=self.now)
        if before.interlock is not Interlock.FREE:  # as its file says
            kept = before.direction, before.reason
            self.state = limiter.after_event(self.state, Event.STOP, *kept)
        self.tell(change=False, direction_first=direction_first)
        self.released_until, self.out, self.way = 0.0, None, 0

    @rule()
    def release(self):
        self.state, _ = limiter.after_release(self.state, self.now)
        if self.led is not None:
            self.released_until = self.now + 10.0
        if not self.by_estimator:
            self.led = None

    # -- How it reaches the limiter, and what follows ---------------------------------------------

    def receive(self, rows, rim):
        self.age = LATE if self.skew == LATE else 0.0
        self.received_at = self.now
        slips, classes, travels = zip(*rows, strict=True)
        sets = Estimates(0.02 + self.skew, slips, [slip * rim for slip in slips], classes, travels)
        self.state = limiter.after_estimates(self.state, self.now, sets, self.tuning)
        known = [row for row in rows if row[1] != UNKNOWN]
        late, ahead = self.age > 0.0, (rim > 0.0) - (rim < 0.0)
        typical = sorted(slip for slip, _, _ in known)[len(known) // 2] if known else 1.0
        # Two wheels with too little travel left, known or last known, are a stop.
        near = sum(travel <= self.tuning.stop_rim_travel for _, _, travel in self.last or ())
        if known and near >= 2:
            self.out = None
            if self.led is None and self.now >= self.released_until:
                self.led = ahead
            return
        if late or not known or typical >= self.tuning.critical_slip or ahead == (self.led or 0):
            self.out = None if not late else self.out
            return
        if self.out is None or self.now - self.out[1] > self.tuning.stale_after:
            self.out = self.now, self.now
        self.out = self.out[0], self.now
        if self.now - self.out[0] >= 3.0 and not self.by_estimator and self.led is not None:
            self.led = self.out = None

    def tell(self, change, direction_first):
        """Publish the warning and its direction, in either order."""

        def direct(state):
            return limiter.after_direction(state, self.stuck_direction)

        def warn(state):
            return limiter.after_stuck(state, self.stuck, change=change)

        for step in (direct, warn) if direction_first else (warn, direct):
            self.state = step(self.state)

    def send(self, forward, turn=0.0):
        """Send a command; what goes out keeps to the ramp."""
        before, at, wanted = self.state.sent, self.state.sent_at, linear(forward, turn)
        self.state, decision = limiter.after_command(self.state, self.now, wanted, self.tuning)
        silent = self.now - at > limiter.COMMAND_TIMEOUT
        elapsed = 0.0 if silent else min(self.now - at, limiter.LONGEST_STEP)
        for i, (old, new) in enumerate(zip(before, self.state.sent, strict=True)):
            target = decision.scale * wanted[i]
            limit = self.tuning.max_acceleration if i < 3 else self.tuning.max_angular_acceleration
            assert abs(new) <= abs(target) + 1e-12 and new * target >= 0.0, 'beyond the command'
            gone = abs(old) if old * new > 0.0 and not silent else 0.0
            assert abs(new) - gone <= limit * elapsed + 1e-12, 'an increase without the ramp'
        if self.state.sent[0] != 0.0:
            self.way, self.moved_at = forward, self.now
        if self.is_closed() and forward * self.led > 0.0:
            assert self.state.sent == limiter.ZERO

    # -- What must hold -------------------------------------------------------------------------

    def is_closed(self):
        return self.led is not None and self.now >= self.released_until

    def scale(self, forward, turn=0.0):
        return limiter.decide(self.state, self.now, linear(forward, turn), self.tuning).scale

    def scales(self):
        self.was_released, self.was_led = self.now < self.released_until, self.led
        return [self.scale(0.1), self.scale(-0.1), self.scale(0.0, 0.3)]

    def no_raise(self, before):
        """Whatever was lost, no more passes than before."""
        if self.led == 0 or self.was_released or self.led != self.was_led:
            return  # standing opens the other way; a release ends; the rover has moved out
        after = self.scales()
        assert all(b <= a + 1e-12 for a, b in zip(before, after, strict=True)), (before, after)

    @invariant()
    def what_led_in_is_closed_and_the_way_out_is_open(self):
        crawl = self.tuning.creep_scale
        assert self.scale(0.0) == 1.0, 'a command of zero passes'
        if self.now < self.released_until:
            assert max(self.scale(0.1), self.scale(-0.1)) <= crawl
            return
        if not self.is_closed():
            assert self.state.interlock is Interlock.FREE
            assert min(self.scales()) > 0.0 or self.tuning.stale_scale == 0.0
            if self.now - self.received_at + self.age > self.tuning.stale_after + 0.02:
                assert max(self.scale(0.1), self.scale(-0.1)) <= self.tuning.stale_scale
            return
        assert self.scale(0.0, 0.3) == crawl, 'turning on the spot'
        if self.led:
            assert self.scale(0.1 * self.led) == self.scale(0.1 * self.led, 0.3) == 0.0
            assert self.scale(-0.1 * self.led) == crawl
        else:
            assert crawl in (self.scale(0.1), self.scale(-0.1))
            if self.way and self.now - self.moved_at < 1.0:
                assert self.scale(-self.way) == 0.0, 'one way at a time'
            assert set(self.scales()) <= {0.0, crawl}


@pytest.mark.hypothesis
@pytest.mark.parametrize(
    'sequences', [SEQUENCES, pytest.param(50 * SEQUENCES, marks=pytest.mark.slow)]
)
def test_no_sequence_of_events_breaks_an_invariant(sequences):
    calm = {'stateful_step_count': 10, 'suppress_health_check': list(HealthCheck)}
    run_state_machine_as_test(World, settings=settings(max_examples=sequences, **calm))
