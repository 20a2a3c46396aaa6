# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The backward pass against the least-squares solution of a linear system; drives smoothed."""

from __future__ import annotations

import warnings
from itertools import takewhile
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.smoothing.history_buffer import (
    DiskBuffer,
    Gaussian,
    HistoryBuffer,
    smoothed_states,
)
from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother
from wheel_terra_estimator.estimation.smoothing.window import Moment, centred
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load

SIZE, STEPS = 3, 30
WIDENED_AT, WIDENING, NOISE = 15, 0.7, 0.3


def whitened(covariance):
    return np.linalg.inv(np.linalg.cholesky(covariance))


def test_a_linear_drive_smoothed_is_its_least_squares_solution():
    rng = np.random.default_rng(1)
    bound = np.full(SIZE, 1e6)
    start, spread = np.array([0.3, -0.2, 1.0]), np.diag([1.0, 2.0, 0.5])
    F = np.array([[1.0, 0.1, 0.0], [0.0, 0.95, 0.05], [0.0, 0.0, 1.0]])
    Q = np.diag([0.01, 0.02, 0.005])
    ekf = GatedFilter(start, spread, -bound, bound)
    ekf.buffer = buffer = HistoryBuffer()
    buffer.mark(0, Gaussian(ekf.x, ekf.P))
    rows, values = [], []

    def add(step, matrix, value, before=None):
        row = np.zeros((len(matrix), SIZE * (STEPS + 1)))
        row[:, SIZE * step : SIZE * (step + 1)] = matrix
        if before is not None:
            row[:, SIZE * (step - 1) : SIZE * step] = before
        rows.append(row)
        values.append(value)

    add(0, whitened(spread), whitened(spread) @ start)
    for step in range(1, STEPS + 1):
        noise = Q.copy()
        ekf.predict(F @ ekf.x, F, Q)
        if step == WIDENED_AT:
            ekf.inflate(1, WIDENING)
            noise[1, 1] += WIDENING
        add(step, whitened(noise), np.zeros(SIZE), -whitened(noise) @ F)
        H, z = rng.normal(size=(1, SIZE)), rng.normal(size=1)
        if step % 3:
            ekf.update(z - H @ ekf.x, H, np.array([NOISE]))
            add(step, H / np.sqrt(NOISE), z / np.sqrt(NOISE))
        buffer.mark(step, Gaussian(ekf.x, ekf.P))
    system = np.vstack(rows)
    covariance = np.linalg.inv(system.T @ system)
    solution = covariance @ system.T @ np.concatenate(values)
    states = list(smoothed_states(buffer, -bound, bound))[::-1]
    assert len(states) == len(buffer) + 1
    for index in range(len(buffer.marks)):
        step, state = buffer.marks[index].content, states[buffer.marks[index].position]
        part = slice(SIZE * step, SIZE * (step + 1))
        np.testing.assert_allclose(state.mean, solution[part], atol=1e-10)
        np.testing.assert_allclose(state.covariance, covariance[part, part], atol=1e-10)


# -- A simulated drive ----------------------------------------------------------------------------


def run(drive, measurements):
    smoother = DriveSmoother(drive.configuration)
    core = EstimatorCore(drive.configuration, smoother.estimator)
    for measurement in measurements:
        for estimates in core.add(measurement):
            smoother.keep(estimates, estimates)
    for estimates in core.flush():
        smoother.keep(estimates, estimates)
    return [(kept.estimates, kept.companion) for kept in smoother.sets()]


@pytest.fixture(scope='module')
def pairs(climb):
    """(smoothed, of the filter) set by set."""
    return run(climb, [a.measurement for a in climb.arrivals[: 2 * len(climb.arrivals) // 3]])


def test_the_tape_changes_nothing_of_the_filter(climbed, pairs):
    for plain, (_, live) in zip(climbed[1], pairs[:-5], strict=False):  # the last are flushed
        np.testing.assert_array_equal(plain.slip, live.slip)
        np.testing.assert_array_equal(plain.drawbar_pull, live.drawbar_pull)


def test_the_smoother_is_nearer_to_the_truth_and_says_how_near(climb, pairs):
    truth = climb.truth
    rows = {stamp: i for i, stamp in enumerate(truth.stamp.tolist())}
    found = [(s, f, rows[f.stamp]) for s, f in pairs if f.stamp in rows]
    late = found[len(found) // 3 :]  # the first seconds stand

    def errors(which, field):
        wanted = getattr(truth, field)
        off = np.array([getattr(p[which], field) - wanted[p[2]] for p in late])
        return off[~np.isnan(off).any(axis=1)]

    for field in ('slip', 'drawbar_pull'):
        smoothed, live = errors(0, field), errors(1, field)
        assert np.sqrt(np.mean(smoothed**2)) < 0.95 * np.sqrt(np.mean(live**2)), field
    std = np.array([p[0].slip_std for p in late if not np.isnan(truth.slip[p[2]]).any()])
    assert (np.abs(errors(0, 'slip')) <= 1.96 * std).mean() > 0.93
    narrower = np.median([np.median(s.slip_std) / np.median(f.slip_std) for s, f, _ in late])
    assert narrower < 1.0


def test_what_was_not_judged_live_is_not_judged_later(pairs):
    for smoothed, live in pairs:
        unjudged = (live.slip_class == SlipClass.UNKNOWN) & (live.slip_std <= 0.25)
        assert (smoothed.slip_class[unjudged] == SlipClass.UNKNOWN).all()


def test_a_late_reference_is_smoothed_at_its_own_stamp(climb):
    """However late references come, within the history, the smoothed drive is nearly the same."""
    early = [a for a in climb.arrivals if a.measurement.stamp < climb.truth.stamp[0] + 4e9]

    def delayed(seconds):
        def arrival(a):
            late = isinstance(a.measurement, ReferenceVelocity)
            return a.measurement.stamp + (round(seconds * 1e9) if late else 0)

        return [a.measurement for a in sorted(early, key=arrival)]

    one, other = run(climb, delayed(0.0)), run(climb, delayed(1.5))
    assert len(one) == len(other)
    assert any((a[1].slip != b[1].slip).any() for a, b in zip(one, other, strict=True))
    settled = [i for i, (s, _) in enumerate(one) if s.stamp < one[-1][0].stamp - 2e9]
    for i in settled:
        # The pull takes half of what the filter said live.
        assert (abs(one[i][0].slip - other[i][0].slip) < 0.35 * one[i][0].slip_std).all()
        np.testing.assert_allclose(one[i][0].sinkage, other[i][0].sinkage, atol=1e-4)


def test_the_way_before_a_reversal_knows_nothing_of_the_way_back():
    """Soil learned downhill says nothing of the climb, which is smoothed as if the drive ended."""
    scenario = load(
        {
            'configuration': ['generic_six_wheel', 'hit_lss1'],
            'duration': 5.0,
            'slope.angle_deg': [6.0],
            'drive.time': [0.0, 3.5, 4.5],
            'drive.forward': [0.05, 0.05, -0.05],
        }
    )
    drive = simulate(scenario, 1)
    turned = drive.truth.stamp[0] + round(4.1e9)  # the commands cross zero at 4 s

    def slips(until):
        heard = (a.measurement for a in drive.arrivals)
        sets = run(drive, takewhile(lambda m: m.stamp <= until, heard))
        return {s.stamp: s.slip for s, _ in sets if s.stamp < turned - round(2e9)}

    whole, climb = slips(drive.truth.stamp[-1]), slips(turned)
    assert len(whole) > 15
    for stamp, slip in climb.items():
        np.testing.assert_allclose(whole[stamp], slip, atol=0.004)


def test_a_spool_forgets_what_is_wound_back():
    disk_buffer = DiskBuffer()
    for item in range(10):
        disk_buffer.append((item, np.full(item, item)))
    disk_buffer.truncate(4)
    assert len(disk_buffer) == 4 and disk_buffer[3][0] == 3
    disk_buffer.append('next')
    found = [disk_buffer[i] if i > 3 else disk_buffer[i][0] for i in range(5)]
    assert found == [0, 1, 2, 3, 'next']
    with pytest.raises(IndexError):
        disk_buffer[5]
    with warnings.catch_warnings(record=True) as told:  # that a file was not closed
        warnings.simplefilter('always')
        del disk_buffer
    assert not told


def moment(time, value, rim=0.1):
    sources = SimpleNamespace(loads=SimpleNamespace(load=(20.0, 40.0)))
    instant = SimpleNamespace(time=time, sources=sources)
    return Moment(instant, None, np.array([rim, 0.1]), value, 0.0, 0.01, np.array([1.0, 2.0]))


def test_a_window_delays_no_ramp_and_ends_where_a_wheel_stops():
    times = np.arange(0.0, 4.0, 0.05)
    ramp = [(i, moment(t, 0.1 * t, 0.1 if t < 2.0 else 0.0)) for i, t in enumerate(times)]
    ramp.insert(60, ('hole', None))
    averaged = list(centred(iter(ramp)))
    assert [companion for companion, _ in averaged] == [companion for companion, _ in ramp]
    for (_, before), (_, after) in zip(ramp, averaged, strict=True):
        if before is not None:
            assert after.speed == pytest.approx(before.speed, abs=1e-12)
            assert after.rims[0] in (pytest.approx(0.1), 0.0), 'not mixed with the wheel at rest'
            np.testing.assert_allclose(after.pull, [1.0, 2.0])
    noise = np.random.default_rng(2).normal(size=400)
    noisy = [(i, moment(0.05 * i, v)) for i, v in enumerate(noise)]
    calmer = np.array([m.speed for _, m in centred(iter(noisy))])
    # 21 of them in a window of a second.
    assert calmer[20:-20].std() == pytest.approx(1.0 / np.sqrt(21), rel=0.25)
