# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A reference with late stamps is told while driving, and slip is judged all the same."""

import functools

import numpy as np
import pytest
from estimate_sets import some_estimates

from wheel_terra_estimator.checks.input_judge import InputJudge
from wheel_terra_estimator.checks.online import OnlineChecks
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.measurements import (
    ReferenceVelocity,
    StepInputs,
    WheelOdometry,
)

ROVER = reader.load(['generic_six_wheel'])
STEP = 50_000_000  # [ns]
SECONDS = 60.0
SPEED = 0.1  # [m/s]


def forward(time):
    """Starts and stops every few seconds, each within 0.4 s."""
    knots = np.arange(2.0, SECONDS + 10.0, 5.0)
    moving = np.arange(knots.size) % 2 == 0
    at = np.sort(np.concatenate([knots, knots + 0.4]))
    level = np.repeat(moving, 2).astype(float)
    return SPEED * np.interp(time, at, np.concatenate([[0.0], level[:-1]]))


def steps(late, rate=5.0, noise=0.003, slip=0.1, changes=True, end=SECONDS):
    """Steps of wheels at 20 Hz and a reference stamped ``late`` seconds after its moment."""
    random = np.random.default_rng(2)
    every = round(1.0 / rate / 0.05)
    for k in range(round(end / 0.05)):
        time, stamp = 0.05 * k, 1_000_000_000 + k * STEP
        speed = forward(time) if changes else SPEED
        wheels = WheelOdometry(
            stamp,
            speed / ROVER.wheels.slip_radius + 0.002 * random.standard_normal(6),
            np.full(6, np.nan),
        )
        reference = None
        if k % every == 0:
            seen = forward(max(time - late, 0.0)) if changes else SPEED
            reading = (1.0 - slip) * seen + noise * random.standard_normal()
            reference = ReferenceVelocity(stamp, float(reading), noise**2)
        yield stamp, StepInputs(wheel_odometry=wheels, reference=reference)


@functools.cache
def after(**what):
    checks = OnlineChecks(ROVER)
    for stamp, inputs in steps(**what):
        checks.step(stamp, inputs)
    return checks


@pytest.mark.parametrize('late', [pytest.param(0.6, marks=pytest.mark.slow), 1.6])
def test_late_stamps_are_told_with_the_delay(late):
    checks = after(late=late)
    (remark,) = checks.standing('beside')
    assert (remark.kind, remark.topic) == ('delay', 'reference_odom')
    assert remark.value == pytest.approx(late, abs=0.15)
    assert remark.cure.startswith(f'sensors.reference_stamp_offset: {remark.value:.3f}')
    assert not checks.standing('slip') and not checks.undecided


@pytest.mark.parametrize(
    'what',
    [
        pytest.param({'late': 0.1}, marks=pytest.mark.slow),
        {'slip': 0.6},
        pytest.param({'noise': 0.03}, marks=pytest.mark.slow),
        {'late': 0.6, 'rate': 1.0},
    ],
)
def test_honest_stamps_are_not(what):
    """Nor what may lie between a few slow references: wheels that follow these do so late."""
    assert not after(**{'late': 0.0, **what}).standing('beside')


def test_without_starts_and_stops_nothing_is_told():
    assert not after(late=1.0, changes=False).standing('beside')


def test_slip_is_judged_beside_it():
    judge = InputJudge(ROVER)
    for stamp, inputs in steps(late=1.6):
        judge.step(stamp, inputs)
    estimates = judge.judged(some_estimates(6), {})
    assert 'late' in estimates.faults['check of reference_odom']
    np.testing.assert_array_equal(estimates.slip_class, some_estimates(6).slip_class)


def test_a_kept_state_gives_the_same_verdict():
    checks, plain = OnlineChecks(ROVER), after(late=1.6)
    everything = list(steps(late=1.6))
    for k, (stamp, inputs) in enumerate(everything):
        if k % 100 == 50:  # what came between leaves no trace
            kept = checks.snapshot()
            for later, wrong in everything[k : k + 30]:
                checks.step(later, StepInputs(reference=wrong.reference))
            checks.restore(kept)
        checks.step(stamp, inputs)
    assert plain.standing('beside') and checks.standing('beside') == plain.standing('beside')


def test_a_pause_begins_anew():
    checks = after(late=0.0, end=10.0)
    kept = checks.window().joints.stamp.size
    stamp = 10**12
    for k in range(6):
        rates = WheelOdometry(stamp + k * STEP, np.ones(6), np.full(6, np.nan))
        checks.step(rates.stamp, StepInputs(wheel_odometry=rates))
    assert kept > 90 and checks.window().joints.stamp.size == 2
