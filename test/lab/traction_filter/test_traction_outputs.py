# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the traction filter tells besides slip, sinkage and pull."""

from dataclasses import fields

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.filter.initial_state import SoilPriors
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.traction_filter.estimator import TractionEstimator
from wheel_terra_lab.traction_filter.smoother import DriveSmoother
from wheel_terra_lab.traction_filter.soil import SoilPosterior, soil_shifts
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel


@pytest.fixture(scope='module')
def driven():
    """Return core and sets of a climb."""
    drive = SIMULATORS['A'].simulate('climb', 1005, 45.0, None)
    core = EstimatorCore(drive.configuration, TractionEstimator(drive.configuration))
    sets = []
    for arrival in drive.arrivals:
        sets += core.add(arrival.measurement)
    return drive, core, [*sets, *core.flush()]


def test_a_soil_that_is_another_is_found_in_the_shift_that_it_makes():
    configuration = reader.load(['generic_six_wheel', 'hit_lss1'])
    rover = Rover.from_configuration(configuration)
    steady, priors = (
        SteadyWheel(configuration, rover),
        SoilPriors.from_configuration(configuration),
    )
    shifts = soil_shifts(steady, priors)
    start = np.diag([1e-6] * 3 + [1e-6] * 6)  # the curve knows nothing but this soil
    start[:3, :3] += shifts @ shifts.T
    posterior = SoilPosterior(shifts, start, priors)
    nothing = posterior.logs(np.zeros(9), start, (0.0, 9.0))
    np.testing.assert_allclose(nothing.std, posterior.prior_std, rtol=1e-6)
    np.testing.assert_array_equal(nothing.mean, 0.0)
    shift = steady.shift_to(strength=0.5 * priors.strength_std)
    x = np.array([shift.offset, shift.log_scale, shift.log_strength, *[0.0] * 6])
    known = posterior.logs(x, 1e-8 * np.eye(9), (0.1, 0.2))
    assert known.mean[0] == pytest.approx(0.5 * priors.strength_std, rel=0.15)
    assert abs(known.mean[1]) < 0.15 * priors.shear_modulus_std
    assert np.all(known.std[:2] < 0.1 * posterior.prior_std[:2])
    assert (known.mean[2], known.std[2]) == (0.1, 0.2)


def test_every_field_is_filled_and_finite(driven):
    _, _, sets = driven
    for estimates in sets[:: max(len(sets) // 40, 1)]:
        for field in fields(estimates):
            value = getattr(estimates, field.name)
            if isinstance(value, (float, np.ndarray)):
                assert np.isfinite(value).all(), field.name
    last = sets[-1]
    shares = [estimates.soil_std[1:] / estimates.soil[1:] for estimates in (sets[0], last)]
    assert np.all(shares[1] <= shares[0] * 1.001)
    assert np.all(shares[1][:2] < 0.9 * shares[0][:2])  # something was learned
    assert last.pull_margin.std() > 0.0
    assert np.abs(last.sideways.force).max() > 0.0
    told = [s.slip_on_slope for s in sets if s.slip_on_slope is not None]
    assert len(told) == pytest.approx(45, abs=2)
    assert told[-1].slip[-1] > told[-1].slip[4] + 0.2
    assert not last.faults
    assert 'slip' in last.reasons[0]


def test_the_rate_of_sinkage_is_that_of_the_sinkage(driven):
    _, _, sets = driven
    depth = np.array([s.sinkage for s in sets])
    rate = np.array([s.sinkage_rate for s in sets])
    time = np.array([s.stamp for s in sets]) * 1e-9
    sunk = np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time)[:, None], axis=0)
    np.testing.assert_allclose(sunk, depth[-1] - depth[0], atol=2e-3)


def test_what_was_learned_is_a_configuration_that_the_next_drive_takes(driven):
    drive, core, sets = driven
    learned = core.learned()
    last = dict(zip(sets[-1].soil_names, sets[-1].soil, strict=True))
    assert {key: learned[key] for key in last} == pytest.approx(last)
    std = learned['soil.shear_modulus_std']
    assert last['soil.shear_modulus'] * 0.2 < std < last['soil.shear_modulus']
    again = EstimatorCore(drive.configuration.replace(learned))
    assert again.learned() == {}
    begun = TractionEstimator(drive.configuration.replace(learned)).estimates()
    np.testing.assert_allclose(begun.soil[:3], sets[-1].soil[:3], rtol=1e-6)
    health = core.health()
    assert {'nis_torque', 'nis_balance', 'nis_sinkage', 'nis_reference'} <= health.keys()


def test_the_smoother_changes_nothing_of_the_filter_and_is_nearer_to_the_truth(driven):
    drive, _, sets = driven
    smoother = DriveSmoother(drive.configuration)
    core = EstimatorCore(drive.configuration, smoother.estimator)
    taped = []
    for arrival in drive.arrivals:  # references come late: the tape is wound back
        taped += core.add(arrival.measurement)
    taped += core.flush()
    for estimates, plain in zip(taped, sets, strict=True):
        np.testing.assert_array_equal(estimates.slip, plain.slip)
        smoother.keep(estimates, 'beside')
    found = list(smoother.sets())
    assert [kept.companion for kept in found] == ['beside'] * len(sets)
    rows = {stamp: i for i, stamp in enumerate(drive.truth.stamp.tolist())}
    errors, live_errors, stds = [], [], []
    for live, (smoothed, _) in zip(sets, found, strict=True):
        assert smoothed.stamp == live.stamp
        assert smoothed.stuck == live.stuck
        row = rows.get(live.stamp)
        if row is not None and row > len(rows) // 4:
            errors.append(smoothed.slip - drive.truth.slip[row])
            live_errors.append(live.slip - drive.truth.slip[row])
            stds.append(smoothed.slip_std)
    rmse = [np.sqrt(np.nanmean(np.square(e))) for e in (errors, live_errors)]
    assert rmse[0] < 0.95 * rmse[1]
    inside = np.abs(errors) < 1.96 * np.array(stds)
    assert inside[~np.isnan(errors)].mean() > 0.93
