# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The core around the timeline: guard of the outputs, counters, words."""

import math
from dataclasses import replace

import numpy as np
import pytest
from estimate_sets import assert_sound
from fake_estimator import (
    FakeEstimator,
    configuration,
    essence,
    imu,
    make_core,
    odometry,
    play,
    sinkage,
    stamp_at,
)

from wheel_terra_estimator.configuration.soil_file import StuckState
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.stuck.memory import StuckMemory


class Failing(FakeEstimator):
    """Fails in the way of `how` when the wheel rate is 9."""

    def __init__(self, config, how):
        super().__init__(config)
        self.how = how
        self.poisoned = False

    def step(self, stamp, inputs):
        super().step(stamp, inputs)
        if inputs.wheel_odometry is not None and inputs.wheel_odometry.rate[0] == 9.0:
            if self.how == 'raise':
                raise np.linalg.LinAlgError('singular matrix')
            self.poisoned = True

    def begin_run(self, stamp, keep_soil):
        super().begin_run(stamp, keep_soil)
        self.poisoned = False

    def estimates(self):
        estimates = replace(super().estimates(), slip=np.full(2, 0.25), slip_std=np.full(2, 0.1))
        if self.poisoned and self.how == 'nan':
            estimates = replace(
                estimates, slip=np.array([math.nan, 0.5]), forward_velocity=math.nan
            )
        if self.poisoned and self.how == 'inf':
            estimates = replace(
                estimates,
                time_to_stuck=np.array([math.inf, 1.0]),
                soil_names=('soil.cohesion', 'soil.density'),
                soil=np.array([1.0, math.inf]),
                soil_std=np.array([1.0, 1.0]),
            )
        return estimates

    def snapshot(self):
        return super().snapshot(), self.poisoned

    def restore(self, snapshot):
        super().restore(snapshot[0])
        self.poisoned = snapshot[1]


@pytest.mark.filter_fails
@pytest.mark.parametrize('how', ['raise', 'nan', 'inf'])
def test_a_failing_filter_is_held_said_and_started_anew(how):
    config = configuration()
    core = EstimatorCore(config, Failing(config, how))
    good = core.add(odometry(0.0)) + core.add(odometry(0.1))
    (held,) = core.add(odometry(0.2, rate=9.0))
    assert held.stamp == stamp_at(0.2)
    assert (held.slip_class == SlipClass.UNKNOWN).all()
    assert 'restarted' in held.faults['filter']
    np.testing.assert_array_equal(held.slip_std, 1.0)
    np.testing.assert_array_equal(held.sinkage_std, config.wheels.radius)
    assert held.slip[0] == good[-1].slip[0] == 0.25
    assert_sound(held)
    if how == 'nan':
        assert held.slip[1] == 0.5  # what was a number is passed on
        assert held.forward_velocity == good[-1].forward_velocity
    if how == 'inf':
        assert held.soil_names == ('soil.cohesion',)
    # It goes on, from a fresh state.
    again = core.add(odometry(0.3)) + core.add(odometry(0.4))
    fresh = play(make_core()[0], [odometry(0.3), odometry(0.4)])
    assert essence(again) == essence(fresh)
    assert core.health()['filter_restarts'] == 1


class Digging(Failing):
    """Stuck from a wheel rate of 5 on, forward, as long as its run lasts."""

    def begin_run(self, stamp, keep_soil):
        super().begin_run(stamp, keep_soil)
        self.rate, self.digs = 0.0, False

    def step(self, stamp, inputs):
        super().step(stamp, inputs)
        self.rate = float(inputs.wheel_odometry.rate[0])
        self.digs |= self.rate == 5.0

    def estimates(self):
        slip = np.full(2, 0.1 if self.rate > 0.0 else 0.97)
        reasons = ('digs; rover: digs in',) * 2 if self.digs else ('slip',) * 2
        warning = {'stuck': self.digs, 'stuck_direction': int(self.digs), 'reasons': reasons}
        return replace(super().estimates(), slip=slip, **warning)


def digging_core():
    config = configuration(output_rate=0.0, max_lag=0.0)
    return EstimatorCore(config, Digging(config, 'raise'))


@pytest.mark.parametrize(
    'how',
    ['clock steps back', pytest.param('filter fails', marks=pytest.mark.filter_fails)],
)
def test_a_warning_and_its_direction_stand_over_a_new_beginning(how):
    core = digging_core()
    play(core, [odometry(10.0 + 0.1 * i, rate=5.0) for i in range(5)], flush=False)
    start = 0.0
    if how == 'filter fails':
        core.add(odometry(10.5, rate=9.0))
        start = 10.6
    standing = play(core, [odometry(start + 0.1 * i, rate=-1.0) for i in range(60)], flush=False)
    assert len(standing) > 50
    assert all(s.stuck and s.stuck_direction == 1 for s in standing)
    assert 'digs in' in standing[-1].reasons[0]
    free = play(core, [odometry(start + 6.0 + 0.1 * i) for i in range(40)], flush=False)
    cleared = next(i for i, s in enumerate(free) if not s.stuck)
    assert cleared == 30 and free[-1].stuck_direction == 0
    assert core.health()['filter_restarts'] + core.health()['clock_steps_back'] == 1


def test_a_reset_clears_the_warning():
    core = digging_core()
    play(core, [odometry(10.0 + 0.1 * i, rate=5.0) for i in range(5)], flush=False)
    assert play(core, [odometry(0.1 * i) for i in range(5)])[-1].stuck, 'held over the clock step'
    core.reset()
    assert not core.warning.state.stuck
    assert not play(core, [odometry(1.0 + 0.1 * i) for i in range(5)])[-1].stuck


def test_a_gap_between_two_sets_is_no_time_driven_free():
    core = digging_core()
    core.warning.restore(StuckState(True, 'digs in', stamp_at(-10.0), -1))
    apart = play(core, [odometry(2.0 * i) for i in range(10)])
    assert all(s.stuck and s.stuck_direction == -1 for s in apart)
    assert 'warned 10 s ago' in apart[0].reasons[0]


def test_a_late_input_does_not_take_a_published_warning_back():
    """The steps run again know nothing of the warning; it clears by its own rule."""
    config = configuration()
    memory = StuckMemory(config)
    blank = EstimatorCore(config, Digging(config, 'raise')).add(odometry(0.0))[0]
    free = replace(blank, slip_class=np.zeros_like(blank.slip_class))

    def at(seconds, stuck, **how):
        return memory.follow(replace(free, stamp=stamp_at(seconds), stuck=stuck), **how)

    assert at(0.0, True).stuck
    held = at(0.1, False, run_again=True)
    assert held.stuck and 'before a late input' in held.reasons[0]
    times = np.arange(0.2, 5.0, 0.1)
    stuck = [at(time, False).stuck for time in times]
    assert times[stuck.index(False)] == pytest.approx(0.1 + 3.0, abs=0.06)
    assert at(6.0, True).stuck and not at(6.1, False).stuck, 'else the estimator clears'


@pytest.mark.parametrize(('clears', 'held'), [(29, False), (5, True)])
def test_a_late_input_does_not_prolong_a_warning_that_clears(clears, held):
    """Ten sets a second, each after a late input; no sign is left in the last of them."""
    config = configuration()
    memory = StuckMemory(config)
    blank = EstimatorCore(config, Digging(config, 'raise')).add(odometry(0.0))[0]
    free = replace(blank, slip_class=np.zeros_like(blank.slip_class))
    for i in range(40):
        now = replace(free, stamp=stamp_at(0.1 * i), stuck=True, stuck_clears=i >= 40 - clears)
        assert memory.follow(now, run_again=True).stuck
    assert memory.follow(replace(free, stamp=stamp_at(4.0)), run_again=True).stuck is held


@pytest.mark.filter_fails
def test_a_step_that_fails_before_its_set_is_told_with_the_set():
    told = []
    for settled in (False, True):
        config = configuration(output_rate=2.0)
        core = EstimatorCore(config, Failing(config, 'raise'))
        sets = []
        for i in range(21):
            sets += core.add(odometry(0.1 * i, rate=9.0 if i == 7 else 1.0))
            if settled:
                core.process_pending()
        assert core.health()['filter_restarts'] == 1
        told.append(
            [(*found, sorted(s.faults)) for found, s in zip(essence(sets), sets, strict=True)]
        )
    assert told[0] == told[1]
    assert any('filter' in faults for *_, faults in told[0])


@pytest.mark.filter_fails
def test_a_filter_that_fails_at_once_gives_the_blank_set():
    config = configuration()
    core = EstimatorCore(config, Failing(config, 'raise'))
    (held,) = core.add(odometry(0.0, rate=9.0))
    assert (held.slip == 0.0).all() and (held.slip_std == 1.0).all()
    np.testing.assert_allclose(held.normal_load, 10.0 * 9.80665 / 2)


def test_health_names_topic_and_reason():
    core, _ = make_core(wheel_odometry='odom')
    play(core, [odometry(0.0), imu(0.05, force=math.nan), odometry(0.1), sinkage(0.15, 0.5)])
    health = core.health()
    assert health['odom_used'] == 2
    assert health['imu/data_used'] == 1, 'its angular rate is good'
    assert health['imu/data_rejected: specific force not finite or implausible'] == 1
    assert health['sinkage_rejected: sinkage infinite or larger than the wheel radius'] == 1
    assert health['fake_steps'] >= 2
