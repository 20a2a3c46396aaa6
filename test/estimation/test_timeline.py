# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rules of stamps, order and lateness, on an estimator that notices every lapse."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from fake_estimator import (
    SECOND,
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
    with_runs_in_order,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from wheel_terra_estimator.estimation import core as core_module
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.timing.clock_watch import ClockWatch
from wheel_terra_estimator.estimation.timing.input_checks import (
    CHANNELS,
    INERTIAL,
    REFERENCE,
    WHEEL_ODOMETRY,
)
from wheel_terra_estimator.estimation.timing.lag import LagLearner
from wheel_terra_estimator.estimation.timing.merging import same


def times(sets):
    return [round((s.stamp - stamp_at(0.0)) / SECOND, 6) for s in sets]


def drive(duration=2.0):
    """Odometry at 10 Hz, IMU at 50 Hz (some stamps shared), sinkage and reference at 5 and 2 Hz."""
    stream = [odometry(0.1 * i, rate=1.0 + 0.01 * i) for i in range(round(10 * duration))]
    stream += [imu(0.02 * i + 0.0, force=0.1 * i) for i in range(round(50 * duration))]
    stream += [sinkage(0.2 * i + 0.013, depth=0.001 * i) for i in range(round(5 * duration))]
    stream += [reference(0.5 * i + 0.007, forward=0.01 * i) for i in range(round(2 * duration))]
    return sorted(stream, key=lambda m: m.stamp)


# -- Sets ---------------------------------------------------------------------------------------


def test_a_set_comes_at_once_and_holds_all_inputs_up_to_its_stamp():
    core, _ = make_core()
    assert core.add(imu(0.0, force=2.0)) == []
    assert core.add(imu(0.05, force=3.0)) == []
    (estimates,) = core.add(odometry(0.1, rate=1.0))
    expected = (2.0 * 1.3 * math.exp(-0.05) + 3.0 * 1.3) * math.exp(-0.05) + 2.2
    assert math.isclose(estimates.forward_velocity, expected, rel_tol=1e-12)
    assert core.health()['reruns'] == 0


def test_a_reading_with_other_numbers_is_another_one():
    speed = ReferenceVelocity(5, 0.1, 1e-6)
    assert same(speed, replace(speed)) and not same(speed, replace(speed, forward=0.2))
    felt = InertialReading(5, np.full(3, np.nan), np.zeros(3), None)
    assert same(felt, replace(felt, specific_force=np.full(3, np.nan)))
    assert not same(felt, replace(felt, angular_rate=np.ones(3)))
    assert not same(felt, replace(felt, orientation=np.zeros(4)))


def test_a_stamp_that_comes_again_with_other_numbers_is_said():
    core, _ = make_core(max_lag=0.0)
    play(core, [odometry(0.0), odometry(0.1), odometry(0.1), odometry(0.1, 2.0)])
    assert core.repeated == {'joint_states': 2}
    said = {reason: n for (_, reason), n in core.rejected.items()}
    assert said == {'stamp repeated with other numbers (the newer ones count)': 1}


def test_messages_that_hold_some_of_the_wheels_complete_one_another():
    core, _ = make_core(max_lag=0.2)
    nan = math.nan
    left = WheelOdometry(stamp_at(0.0), np.array([3.0, nan]), np.array([nan, nan]))
    right = WheelOdometry(stamp_at(0.0), np.array([nan, 5.0]), np.array([nan, 2.0]))
    sets = play(core, [left, right])
    assert len(sets) == 1
    assert math.isclose(sets[0].forward_velocity, 8.0 * 1.1)
    assert 'joint_states_stamp_repeated' not in core.health()


def test_sets_wait_for_the_second_part_of_a_stamp():
    def halves(t):
        return [
            WheelOdometry(stamp_at(t), np.array(rate), np.full(2, math.nan))
            for rate in ([3.0, math.nan], [math.nan, 2.0])
        ]

    times = [0.1 * i for i in range(6)]
    core, _ = make_core(max_lag=-1.0)
    sets = play(core, [part for t in times for part in halves(t)])
    whole, _ = make_core()
    both = [WheelOdometry(stamp_at(t), np.array([3.0, 2.0]), np.full(2, math.nan)) for t in times]
    assert essence(sets)[1:] == essence(play(whole, both))[1:]  # the first one comes at once


def test_max_lag_holds_back_until_the_newest_stamp_passes():
    core, _ = make_core(max_lag=0.2)
    assert core.add(odometry(0.0)) == []
    assert core.add(odometry(0.1)) == []
    assert times(core.add(imu(0.2))) == [0.0]
    assert times(core.add(odometry(0.35))) == [0.1]
    assert times(core.flush()) == [0.35]


# -- Order of arrival -----------------------------------------------------------------------------


@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(st.data())
def test_with_a_large_max_lag_the_order_of_arrival_is_nothing(data):
    stream = drive(1.0)
    core, _ = make_core(max_lag=1.0, history=1.0)
    expected = essence(play(core, stream))
    delays = data.draw(st.lists(st.floats(0.0, 0.99), min_size=len(stream), max_size=len(stream)))
    shuffled = arriving(stream, delays)
    core, _ = make_core(max_lag=1.0, history=1.0)
    assert essence(play(core, shuffled)) == expected


@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(st.data())
def test_each_set_is_what_a_run_in_order_through_the_inputs_so_far_gives(data):
    """The definition itself: laziness, kept states, forgetting and merged steps must not show.

    Late odometry moves the ends of merged steps; where it is silent, sets come in their midst.
    """
    rate, silent = data.draw(st.sampled_from([0.0, 4.0])), data.draw(st.booleans())
    end = stamp_at(0.9) if silent else 0
    stream = [
        m
        for m in drive(1.2)
        if not isinstance(m, WheelOdometry) or not stamp_at(0.2) < m.stamp < end
    ]
    delays = [data.draw(st.sampled_from([0.0, 0.0, 0.004, 0.03, 0.25, 0.7])) for _ in stream]
    unbounded = {'output_rate': rate, 'filter__rerun_rate': 0.0}
    for estimates, expected in with_runs_in_order(stream, delays, **unbounded):
        # A late odometry may have taken the place of this one: then it ends no step there.
        if expected.stamp == estimates.stamp or not (rate or silent):
            assert essence([estimates]) == essence([expected])


@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(st.data())
def test_steps_made_before_a_set_asks_for_them_change_no_number(data):
    """Nor what is kept where tuning changes or the clock goes back: the drive comes twice."""
    stream = drive(1.5)
    chosen = {
        'output_rate': data.draw(st.sampled_from([0.0, 4.0, 20.0])),
        'filter__rerun_rate': data.draw(st.sampled_from([5.0, 500.0])),  # 5: some are deferred
        'max_lag': data.draw(st.sampled_from([0.0, -1.0])),
    }
    delays = [data.draw(st.sampled_from([0.0, 0.0, 0.004, 0.03, 0.25, 0.7])) for _ in stream]
    messages = 2 * list(arriving(stream, delays))
    settled = [data.draw(st.booleans()) for _ in messages]
    retuned = data.draw(st.integers(0, len(messages) - 1))
    rarer = {'output_rate': min(chosen['output_rate'], 1.0), 'reference_odom_max_rate': 1.0}
    other = configuration(**{**chosen, **rarer})
    told = []
    for settles in ([False] * len(messages), settled):
        core, fake = make_core(**chosen)
        sets = []
        for i, (measurement, settle) in enumerate(zip(messages, settles, strict=True)):
            if i == retuned:
                with pytest.MonkeyPatch.context() as patch:
                    patch.setattr(core_module, '_estimator', lambda _, fake=fake: fake)
                    core.retune(other)
            sets += core.add(measurement)
            if settle:
                core.process_pending()
        told.append(essence(sets + core.flush()))
    assert told[0] == told[1]
    assert core.health()['clock_steps_back'] >= 1


def test_a_late_input_that_was_settled_costs_the_next_set_one_step():
    steps = []
    for settled in (False, True):
        core, fake = make_core(output_rate=10.0)
        play(core, [odometry(0.1 * i) for i in range(20)], flush=False)
        core.add(sinkage(1.87))
        core.add(reference(1.88))
        if settled:
            core.process_pending()
        before = fake.steps
        assert len(core.add(odometry(2.0))) == 1
        steps.append(fake.steps - before)
    assert steps[1] == 1 < steps[0]


def test_an_input_older_than_the_history_is_dropped_and_counted():
    core, _ = make_core(history=2.0)
    play(core, [odometry(0.1 * i) for i in range(40)], flush=False)
    before, _ = make_core(history=2.0)
    play(before, [odometry(0.1 * i) for i in range(40)], flush=False)
    core.add(sinkage(1.89))  # the state is at 3.9
    core.add(sinkage(1.91))
    before.add(sinkage(1.91))
    assert essence(core.add(odometry(4.0))) == essence(before.add(odometry(4.0)))
    health = core.health()
    assert health['sinkage_rejected: stamp older than `history` (raise it, or set its clock)'] == 1
    assert health['sinkage_late'] == 1


def test_many_inputs_that_are_dropped_as_too_old_are_a_fault_with_its_remedy():
    core, _ = make_core(history=2.0)
    told = dict[int, str | None]()
    for i in range(40, 220):
        late = 2.5 if 60 < i < 80 else 1.5  # [s]
        (made,) = core.add(odometry(0.1 * i))[-1:]
        told[i] = made.faults.get('sinkage')
        core.add(sinkage(0.1 * i - late))
    fault = 'many messages are more than 2 s late and dropped -> raise history, or set its clock'
    assert (told[60], told[79], told[219]) == (None, fault, None)


# -- Economy --------------------------------------------------------------------------------------


def test_slightly_late_imu_messages_cost_little():
    """250 Hz, each 6 ms later than the odometry of its time: batched, not one run each."""
    core, fake = make_core()
    stream = by_arrival(every(0.01, odometry, 200), every(0.004, imu, 500, late=0.006))
    play(core, stream, flush=False)
    assert fake.steps < 3.5 * len({m.stamp for m in stream})


def test_a_late_reference_costs_one_run_of_its_lateness():
    core, _ = make_core()
    wheels, references = every(0.1, odometry, 120), every(1.0, reference, 11, 0.5, start=0.25)
    play(core, by_arrival(wheels, every(0.02, imu, 600, 0.001), references), flush=False)
    health = core.health()
    assert health['reference_odom_late'] == 11
    assert health['clock_steps_back'] == 0
    # Half a second at 50 Hz from a kept state at most 0.1 s before, and one step for each IMU
    # message that has the stamp of the set just given.
    assert health['steps_repeated'] < 11 * 36 + 120 * 1.1


def test_a_driver_whose_stamp_stands_still_fills_nothing():
    core, _ = make_core()
    for i in range(1000):
        core.add(odometry(0.0, rate=0.1 * i))
    assert len(core._timeline._log.entries) == 1
    assert core.health()['joint_states_stamp_repeated'] == 999


@pytest.mark.parametrize(
    ('late', 'clocks', 'told'),
    [
        ({}, {}, {}),
        ({reference: 0.4, odometry: 0.3, imu: 0.3}, {sinkage: 0.1}, {}),
        ({reference: 0.4}, {reference: 1.0}, {'reference_odom': '0.6 s ahead of wheels and IMU'}),
        ({}, {imu: 1.5}, {'joint_states': '1.5 s behind imu/data'}),
        ({imu: 0.8}, {}, {'imu/data': '0.8 s behind joint_states'}),
    ],
)
def test_stamps_that_are_apart_beyond_what_is_waited_for_are_told(late, clocks, told):
    arrivals = []
    for kind, rate in ((odometry, 20), (imu, 25), (sinkage, 10), (reference, 2)):
        for t in (n / rate for n in range(10 * rate)):
            arrivals.append((t + late.get(kind, 0.0), kind(t + clocks.get(kind, 0.0))))
    arrivals.sort(key=lambda each: each[0])
    heard = [m for t, m in arrivals if t < 9.0]
    last = play(make_core(max_lag=-1.0, output_rate=20.0)[0], heard, flush=False)[-1]
    found = {k: words for k, words in last.faults.items() if 'stamps' in words}
    assert found.keys() == told.keys()
    assert all(
        found[k].startswith(f'stamps {words}: late, or a clock') for k, words in told.items()
    )


# -- Silence --------------------------------------------------------------------------------------


def test_sets_go_on_at_five_hertz_while_the_wheel_odometry_is_silent():
    core, _ = make_core()
    wheels = every(0.1, odometry, 11) + every(0.1, odometry, 10, start=3.0)
    sets = play(core, by_arrival(every(0.02, imu, 200), wheels))
    silent = [s for s in sets if stamp_at(1.0) < s.stamp < stamp_at(3.0)]
    assert times(silent) == [1.5, 1.7, 1.9, 2.1, 2.3, 2.5, 2.7, 2.9]
    for estimates in silent:
        assert (estimates.slip_class == SlipClass.UNKNOWN).all()
        assert 'no usable message on joint_states' in estimates.faults['wheel_odometry']
    returned = [s for s in sets if s.stamp >= stamp_at(3.0)]
    assert times(returned) == [round(3.0 + 0.1 * i, 6) for i in range(10)]
    assert all((s.slip_class == 0).all() for s in returned)


@pytest.mark.parametrize('period', [0.5, 1.0])
def test_wheel_odometry_that_comes_slowly_is_told_with_what_lets_it_count(period):
    """Its class is unknown between, for at most 2.5 periods with the number that is named."""
    end = 20 * period
    stream = by_arrival(every(0.1, imu, round(1.5 * end / 0.1)), every(period, odometry, 20))
    sets = play(make_core(output_rate=20.0)[0], stream)
    told = [s.faults.get('wheel_odometry', '') for s in sets if period * 3 < s.stamp / SECOND - 100]
    assert told[0] == f'joint_states arrives every {period} s -> filter.silence: {2.5 * period:.1f}'
    assert told[-1] == 'no usable message on joint_states: wheel rates unknown', 'it has ended'
    cured = play(make_core(output_rate=20.0, filter__silence=2.5 * period)[0], stream)
    assert not any('wheel_odometry' in s.faults for s in cured if s.stamp < stamp_at(end))
    assert 'no usable message' in cured[-1].faults['wheel_odometry']


def test_sets_begin_without_any_wheel_odometry():
    core, _ = make_core()
    assert times(play(core, [imu(0.02 * i) for i in range(60)])) == [0.5, 0.7, 0.9, 1.1]


# -- Clock ----------------------------------------------------------------------------------------


def test_a_looped_bag_begins_a_new_run_that_keeps_the_soil():
    core, fake = make_core()
    once = drive(2.0)
    sets = play(core, once + once + once)
    assert times(sets) == [round(0.1 * i, 6) for i in range(20)] * 3
    assert core.health()['clock_steps_back'] == 2
    assert core.health()['runs'] == 3
    told = [(i, s.faults['clock']) for i, s in enumerate(sets) if 'clock' in s.faults]
    assert [i for i, _ in told] == [20, 40], 'with the first set of the new run'
    assert 'went back (2 so far): a new run' in told[1][1]
    kept = [keep for _, keep in fake.begun]
    assert kept[0] is False and kept == sorted(kept) and kept.count(True) >= 2


def test_a_step_back_of_less_than_a_second_goes_on_in_the_same_run():
    core, _ = make_core()
    stream = [odometry(0.1 * i) for i in range(30)] + [odometry(2.1 + 0.1 * i) for i in range(12)]
    sets = play(core, stream)
    assert core.health()['clock_steps_back'] == 0
    assert times(sets) == [round(0.1 * i, 6) for i in range(33)]


def test_one_stamp_from_the_future_does_no_harm():
    core, _ = make_core()
    stream = drive(2.0)
    spoilt = [*stream[:60], imu(5000.0), *stream[60:]]
    assert essence(play(core, spoilt)) == essence(play(make_core()[0], stream))
    assert core.health()['imu/data_rejected: stamp far ahead of all others (set its clock)'] == 1


def test_wheels_that_come_in_parts_are_waited_for_and_copies_are_not():
    for parts, whole, held in ((2, False, True), (2, True, False), (1, False, False)):
        lags = LagLearner(-1)
        for k in range(40):
            lags.note(WHEEL_ODOMETRY, stamp_at(0.1 * (k // parts)), whole=whole)
        assert bool(lags.hold()) is held


def test_a_pause_of_all_topics_is_no_new_run():
    core, _ = make_core()
    later = [odometry(60.0), imu(60.01), odometry(60.1)]
    sets = play(core, [imu(0.0), odometry(0.0), *later])
    assert times(sets) == [0.0, 60.0, 60.1]
    assert core.health()['runs'] == 1


def test_a_slow_lone_odometry_gets_its_sets_at_once():
    core, _ = make_core()
    assert [times(core.add(odometry(30.0 * i))) for i in range(4)] == [
        [0.0],
        [30.0],
        [60.0],
        [90.0],
    ]


def _always(offset):
    return lambda t: offset


@pytest.mark.parametrize(
    ('clocks', 'heard'),
    [
        ({odometry: _always(-3.0)}, lambda t: True),
        ({odometry: lambda t: -3.0 if t > 5.0 else 0.0}, lambda t: True),
        ({imu: lambda t: 40.0 if t > 4.0 else 0.0}, lambda t: not 5.0 < t < 11.0),
        ({odometry: lambda t: -40.0 if t > 4.0 else 0.0}, lambda t: not 5.0 < t < 11.0),
        ({imu: _always(40.0), sinkage: _always(80.0)}, lambda t: True),
    ],
)
def test_topics_of_other_clocks_never_carry_the_time_away_from_the_wheels(clocks, heard):
    """From two seconds behind the last event each wheel odometry makes its set."""
    rates = {odometry: 20, imu: 25, sinkage: 10, reference: 2}
    arrivals = sorted(
        (n / rate + 0.0003 * i, i)
        for i, rate in enumerate(rates.values())
        for n in range(16 * rate)
    )
    core, _ = make_core(max_lag=-1.0)
    sets = []
    for t, i in arrivals:
        kind = list(rates)[i]
        if kind is not odometry or heard(t):
            found = core.add(kind(t + clocks.get(kind, _always(0.0))(t)))
            sets += [s for s in found if t > 13.0 and 'wheel_odometry' not in s.faults]
    assert len(sets) == pytest.approx(3 * rates[odometry], abs=2)
    assert core.health()['runs'] <= 3


def test_a_lag_that_is_stated_ends_no_run():
    """It may be longer than the history."""
    core, _ = make_core(max_lag=5.0)
    sets = play(core, by_arrival(every(0.04, imu, 500), every(0.1, odometry, 200, late=3.0)))
    assert core.health()['runs'] == 1
    assert sum('wheel_odometry' not in s.faults for s in sets) == 200


def test_wheel_odometry_that_comes_late_in_a_burst_ends_no_run():
    """It stops coming at 8 s and comes at twice its rate from 16 s on."""
    core, _ = make_core(max_lag=-1.0)
    wheels = [(max(t, 16.0 + 0.01 * t) if t > 8.0 else t, m) for t, m in every(0.05, odometry, 400)]
    sets = play(core, by_arrival(every(0.04, imu, 500), wheels))
    assert core.health()['clock_steps_back'] == 0
    assert 'wheel_odometry' not in sets[-1].faults


# -- Reference ------------------------------------------------------------------------------------


def test_the_reference_is_thinned_by_stamps():
    core, _ = make_core(reference_odom_max_rate=1.0)
    stream = [odometry(0.1 * i) for i in range(101)]
    stream += [reference(0.1 * i + 0.001 * (-1) ** i + 0.05) for i in range(100)]
    sets = play(core, sorted(stream, key=lambda m: m.stamp))
    assert sets[-1].yaw_rate == 10.0  # the fake counts the references that it was given
    assert core.health()['reference_odom_used'] == 10


@settings(max_examples=settings.default.max_examples // 5, deadline=None)
@given(st.permutations(range(20)))
def test_thinning_does_not_depend_on_the_order_of_arrival(order):
    stream = [reference(0.05 * i + 0.003, forward=0.01 * i) for i in order]
    core, _ = make_core(reference_odom_max_rate=3.0)
    sets = play(core, [odometry(0.0), *stream, odometry(1.1)])
    ordered, _ = make_core(reference_odom_max_rate=3.0)
    stream.sort(key=lambda m: m.stamp)
    expected = play(ordered, [odometry(0.0), *stream, odometry(1.1)])
    assert essence(sets)[-1] == essence(expected)[-1]
    used = [each.health()['reference_odom_used'] for each in (core, ordered)]
    assert used == [sets[-1].yaw_rate] * 2  # whatever was run again


# -- Whatever comes -------------------------------------------------------------------------------


@settings(max_examples=settings.default.max_examples, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from([odometry, imu, sinkage, reference]),
            st.sampled_from([0.01, 0.1, 0.0, 0.5, 3.0, 100.0, -0.05, -0.9, -1.1, -2.5, -50.0]),
            st.booleans(),
        ),
        min_size=1,
        max_size=120,
    ),
    st.sampled_from([0.0, 0.15, 1.5]),
    st.sampled_from([0.0, 0.3, 2.0]),
)
def test_stamps_strictly_increase_within_a_run_whatever_comes(stream, max_lag, history):
    core, _ = make_core(max_lag=max_lag, history=history)
    clock, stamps = 60.0, []
    for kind, step, is_clock in stream:
        t = clock + step
        if is_clock:
            clock = t = max(t, 1.0)
        stamps += [s.stamp for s in core.add(kind(t))]
        backwards = sum(b <= a for a, b in pairwise(stamps))
        assert backwards <= core.health()['clock_steps_back']
    stamps += [s.stamp for s in core.flush()]
    assert sum(b <= a for a, b in pairwise(stamps)) <= core.health()['clock_steps_back']


@pytest.mark.parametrize(
    ('others', 'stepped'),
    [([reference(10.01)], False), ([reference(10.01), odometry(10.02)], True)],
)
def test_a_second_topic_bears_out_a_step_of_the_clock_with_the_wheels(others, stepped):
    watch = ClockWatch(channels=len(CHANNELS), clock_step=SECOND, max_lag=0, history=2 * SECOND)
    for channel, first in ((WHEEL_ODOMETRY, odometry(60.0)), (INERTIAL, imu(60.01))):
        assert watch.judge(channel, first, None).accepted
    assert watch.judge(REFERENCE, reference(60.02), stamp_at(60.0)).accepted
    assert watch.judge(INERTIAL, imu(10.0), stamp_at(60.0)).accepted == []  # maybe a stray
    for other in others:
        last = watch.judge(CHANNELS[type(other)], other, stamp_at(60.0))
    assert last.stepped_back is stepped
    known = [INERTIAL, REFERENCE, WHEEL_ODOMETRY] if stepped else []
    assert [channel for channel, _ in last.accepted] == known
