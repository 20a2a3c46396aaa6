# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Sets at a rate of their own: which stamps they carry, what is merged, what late inputs cost."""

import math
from itertools import pairwise

import numpy as np
import pytest
from fake_estimator import (
    FakeEstimator,
    arriving,
    by_arrival,
    configuration,
    essence,
    every,
    imu,
    make_core,
    odometry,
    play,
    reference,
    sinkage,
    stamp_at,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st

from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import WheelOdometry

DEFAULT = {'output_rate': 20.0, 'max_lag': -1.0}


def by_the_letter(stamps, rate):
    """Stamps of the sets by the words of the topics page, one multiple after the other.

    Multiples are in whole nanoseconds: a source of 30 Hz cannot stamp a third of one.
    """
    first, found = min(stamps), []
    for k in range(math.ceil((max(stamps) - first) * rate / 1e9) + 1):
        due = [s for s in stamps if s >= first + k * 10**9 // int(rate)]
        if due and (not found or min(due) > found[-1]):
            found.append(min(due))
    return found


class Recording(FakeEstimator):
    """Keeps the inputs of each step."""

    def __init__(self, config):
        super().__init__(config)
        self.inputs = []

    def step(self, stamp, inputs):
        super().step(stamp, inputs)
        self.inputs.append((stamp, inputs))


def recording_core(**changes):
    config = configuration(**{**DEFAULT, **changes})
    fake = Recording(config)
    return EstimatorCore(config, fake), fake


@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@example([1, 9_999_998], 100.0)  # a nanosecond early
@example([33_333_333, 33_333_334, 33_333_333], 30.0)
@given(
    st.lists(st.integers(1, 90_000_000), min_size=1, max_size=150),
    st.sampled_from([20.0, 10.0, 7.0, 30.0, 100.0]),
)
def test_a_set_at_the_first_odometry_at_or_after_each_multiple(gaps, rate):
    stamps = np.cumsum([stamp_at(0.0), *gaps]).tolist()
    core, _ = make_core(**{**DEFAULT, 'output_rate': rate})
    nan = np.full(2, math.nan)
    sets = play(core, [WheelOdometry(stamp, np.ones(2), nan) for stamp in stamps])
    assert [s.stamp for s in sets] == by_the_letter(stamps, rate)


def test_rates_are_averaged_over_the_interval_that_each_stands_for():
    core, fake = recording_core()
    nan = math.nan
    stamps = (0.0, 0.01, 0.04, 0.05)
    rates = ([1.0, 1.0], [4.0, nan], [2.0, 8.0], [nan, 6.0])
    torques = ([1.0, 1.0], [2.0, nan], [4.0, nan], [6.0, nan])
    angles = ([0.0, 0.0], [0.2, nan], [nan, 0.3], [nan, nan])  # the newest of each wheel counts
    for t, *columns in zip(stamps, rates, torques, angles, strict=True):
        core.add(WheelOdometry(stamp_at(t), *map(np.array, columns)))
    _, (stamp, inputs) = fake.inputs
    assert stamp == stamp_at(0.05) == inputs.wheel_odometry.stamp
    left = (4.0 * 0.01 + 2.0 * 0.03) / 0.04
    right = (8.0 * 0.04 + 6.0 * 0.01) / 0.05
    np.testing.assert_allclose(inputs.wheel_odometry.rate, [left, right])
    np.testing.assert_allclose(inputs.wheel_odometry.torque, [4.0, nan])
    np.testing.assert_allclose(inputs.wheel_odometry.steering, [0.2, 0.3])


def test_imu_and_sinkage_are_averaged_and_references_stay_at_their_stamps():
    core, fake = recording_core()
    stream = [odometry(0.0), imu(0.01, 1.0), imu(0.02, 3.0), sinkage(0.02, 0.01)]
    stream += [reference(0.03, 0.5), imu(0.04, 7.0), sinkage(0.045, 0.03), odometry(0.05)]
    play(core, stream)
    _, (at_reference, first), (at_set, second) = fake.inputs
    assert at_reference == stamp_at(0.03) and at_set == stamp_at(0.05)
    assert first.inertial.specific_force[0] == pytest.approx(2.0)
    assert first.sinkage.sinkage[0] == 0.01 and first.reference.forward == 0.5
    assert second.inertial.specific_force[0] == 7.0 and second.reference is None
    assert second.sinkage.sinkage[0] == 0.03


def test_a_slow_odometry_does_not_merge_the_imu_over_seconds():
    core, fake = recording_core()
    play(core, by_arrival(every(1.0, odometry, 4), every(0.02, imu, 150, start=0.001)))
    assert max(b - a for a, b in pairwise([s for s, _ in fake.inputs])) <= 0.15e9


def test_a_rate_that_changes_on_the_way_counts_from_then_on():
    core = EstimatorCore(configuration(**DEFAULT))
    stream = [odometry(0.01 * i) for i in range(200)]
    before = play(core, stream[:100], flush=False)
    core.retune(configuration(**{**DEFAULT, 'output_rate': 5.0}))
    after = play(core, stream[100:], flush=False)
    assert np.diff([s.stamp for s in before]).tolist() == [50_000_000] * (len(before) - 1)
    assert np.diff([s.stamp for s in after])[1:].tolist() == [200_000_000] * (len(after) - 2)
    assert len(after) >= 5 and after[0].stamp > before[-1].stamp
    assert after[0].forward_velocity == pytest.approx(before[-1].forward_velocity, rel=0.2)


@pytest.mark.parametrize(('clock_step', 'steps'), [(1.0, 1), (5.0, 0)])
def test_a_clock_step_that_is_set_on_the_way_counts_from_then_on(clock_step, steps):
    settings = {**DEFAULT, 'history': 5.0}
    core = EstimatorCore(configuration(**settings, filter__clock_step=6.0 - clock_step))
    play(core, [odometry(0.1 * i) for i in range(45)], flush=False)
    core.retune(configuration(**settings, filter__clock_step=clock_step))
    play(core, [odometry(0.9 + 0.1 * i) for i in range(15)])
    assert core.health()['clock_steps_back'] == steps


def test_inputs_before_what_a_shorter_history_kept_are_too_old():
    core = EstimatorCore(configuration(**{**DEFAULT, 'history': 0.0}))
    play(core, [odometry(0.01 * i) for i in range(300)], flush=False)
    core.retune(configuration(**{**DEFAULT, 'history': 2.0}))
    stream = [reference(1.5, 0.1), odometry(3.0), reference(2.995, 0.1), odometry(3.1)]
    assert len(play(core, stream, flush=False)) >= 2
    assert core.rejected == {
        ('reference_odom', 'stamp older than `history` (raise it, or set its clock)'): 1
    }


def test_numbers_do_not_depend_on_how_often_they_are_asked_for():
    stream = [odometry(0.01 * i, 1.0 + 0.01 * i) for i in range(300)]
    stream += [imu(0.02 * i, 0.1 * i) for i in range(150)]
    stream = sorted(stream, key=lambda m: m.stamp)
    often = {s.stamp: essence([s]) for s in play(make_core(**DEFAULT)[0], stream)}
    for rate in (10.0, 5.0, 1.0):
        sets = play(make_core(**{**DEFAULT, 'output_rate': rate})[0], stream)
        assert len(sets) == math.ceil(3 * rate)
        assert all(often[s.stamp] == essence([s]) for s in sets)


def drive(duration):
    stream = [odometry(0.01 * i, rate=1.0 + 0.01 * i) for i in range(round(100 * duration))]
    stream += [imu(0.008 * i + 0.001, force=0.1 * i) for i in range(round(125 * duration))]
    stream += [sinkage(0.1 * i + 0.013, depth=0.001 * i) for i in range(round(10 * duration))]
    stream += [reference(0.5 * i + 0.007, forward=0.01 * i) for i in range(round(2 * duration))]
    return sorted(stream, key=lambda m: m.stamp)


# -- Lag ----------------------------------------------------------------------------------------


def late(stream, kind, delay, jitter=0.2, seed=0):
    """Delay the messages of a kind; a topic's messages never overtake one another."""
    rng = np.random.default_rng(seed)
    delays, newest = [], 0.0
    for m in stream:
        wait = delay * (1.0 + rng.uniform(-jitter, jitter)) if type(m) is kind else 0.0
        if wait:
            newest = max(newest + 1e-6, m.stamp * 1e-9 + wait)
            wait = newest - m.stamp * 1e-9
        delays.append(wait)
    return arriving(stream, delays)


@pytest.mark.parametrize(
    ('who', 'delay', 'jitter'), [(odometry, 0.41, 0.2), (odometry, 0.5, 0.0), (imu, 0.41, 0.2)]
)
def test_what_lags_for_good_is_waited_for_and_no_set_is_lost(who, delay, jitter):
    stream = drive(6.0)
    punctual_core, punctual = make_core(**DEFAULT)
    expected = play(punctual_core, stream)
    core, fake = make_core(**DEFAULT)
    sets = play(core, late(stream, type(who(0.0)), delay, jitter))
    assert len(sets) == len(expected) == 120
    assert fake.steps < 1.5 * punctual.steps
    assert not any('silent' in str(s.faults) for s in sets)


def test_punctual_inputs_are_not_held_back():
    core, _ = make_core(**DEFAULT)
    jitter = np.random.default_rng(0).exponential(0.002, 235 * 5)
    for m in arriving(drive(5.0)[: len(jitter)], jitter):
        sets = core.add(m)
        assert m.stamp < stamp_at(0.3) or core.health()['held_back_s'] == 0.0
        for estimates in sets:
            assert m.stamp - estimates.stamp <= 0.1e9


@pytest.mark.parametrize('who', [reference, sinkage])
@pytest.mark.parametrize('ahead', [0.3, 0.8, 1.9])
def test_a_camera_whose_clock_is_ahead_takes_no_set_away(who, ahead):
    """Two computers, no NTP: the sets are due, and known, as the wheels' stamps say."""
    core, _ = make_core(**DEFAULT)
    cameras = every(0.5, who, 18, late=-ahead, start=1.002 + ahead)
    others = every(0.05, odometry, 200), every(0.02, imu, 500, start=0.001)
    sets = play(core, by_arrival(*others, cameras), flush=False)
    assert [s.stamp for s in sets] == [stamp_at(0.05 * i) for i in range(200)]
    assert not any('wheel_odometry' in s.faults for s in sets)


def test_a_reference_is_never_waited_for():
    core, _ = make_core(**DEFAULT)
    stream = by_arrival(every(0.05, odometry, 200), every(0.5, reference, 18, late=0.4))
    sets = play(core, stream, flush=False)
    assert [s.stamp for s in sets] == [stamp_at(0.05 * i) for i in range(200)]


def test_what_is_later_than_can_be_run_again_is_bounded_counted_and_told():
    """An IMU 1.1 s behind would need twelve steps again for each of its messages."""
    stream = drive(10.0)
    core, fake = make_core(**DEFAULT)
    sets = play(core, late(stream, type(imu(0.0)), 1.1))
    assert len(sets) == 200
    health = core.health()
    assert health['late_inputs_deferred'] > 50
    assert fake.steps < 10 * (20 + 2 + 60) + 2 * 60 + 100
    told = [s for s in sets if 'late inputs' in s.faults]
    assert len(told) > 100, 'about each second one, also where those between are in time'
    assert health['late_inputs_dropped'] == 0


def test_what_waits_is_fused_at_its_own_stamp_before_the_history_ends():
    """One step a second may be run again; readings in the history count all the same."""
    stream = [odometry(0.1 * i) for i in range(61)]
    found = []
    for rate in (1.0, 0.0):
        bound = {**DEFAULT, 'max_lag': 0.0, 'filter__rerun_rate': rate, 'history': 2.0}
        core, _ = make_core(**bound)
        play(core, stream[:40], flush=False)
        for late in (2.5, 2.7):  # the state is at 3.9
            core.add(sinkage(late))
        found.append(essence(play(core, stream[40:], flush=False)))  # at 4.6 the first would go
        core.add(sinkage(4.5))
        health = core.health()
        assert health['late_inputs_deferred'] == (3 if rate else 0)
        assert health['late_inputs_dropped'] == 0
    bounded, unbounded = found
    assert bounded[0] != unbounded[0], 'they wait'
    assert bounded[7:] == unbounded[7:], 'they are fused'
