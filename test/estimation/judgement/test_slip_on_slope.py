# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip on slopes: the learned curve against the one that made the slips, and when it is told."""

import functools
import math

import numpy as np
import pytest
from fake_estimator import make_core, odometry, play

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.estimates import SLOPES, SlipOnSlope
from wheel_terra_estimator.estimation.judgement import slip_on_slope
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.slip_on_slope import (
    CurveState,
    Instant,
    SlopeCurve,
    slips_at,
)
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

RIM, PERIOD = 0.05, 0.1  # [m/s], [s]


def slip_of(demand, offset=0.03, scale=0.35, greatest=0.5):
    """Janosi's law turned round, for driving uphill."""
    return offset - scale * math.log(1.0 - demand / greatest)


@functools.cache
def learned(slopes_deg, seconds=120.0, std=0.03, noise=0.02, seed=1):
    """A curve that saw a climb through some slopes."""
    rng = np.random.default_rng(seed)
    curve = SlopeCurve()
    for i in range(int(seconds / PERIOD)):
        demand = math.tan(
            math.radians(np.interp(i * PERIOD / seconds, np.linspace(0, 1, 3), slopes_deg))
        )
        slip = slip_of(demand) + rng.normal(0.0, noise)
        curve.update(Instant(i * PERIOD, demand, slip, std, RIM * PERIOD, 1.0))
    return curve


def at(found: SlipOnSlope, slope):
    place = SLOPES.tolist().index(slope)
    return tuple(float(column[place]) for column in found)


@pytest.mark.parametrize('seed', range(2))
def test_a_climb_tells_what_steeper_ground_costs(seed):
    found = learned((0.0, 6.0, 12.0), seed=seed).state.latest
    for slope in (5.0, 10.0, 15.0):
        slip, std, entrapment = at(found, slope)
        true = slip_of(math.tan(math.radians(slope)))
        assert abs(slip - true) < 1.96 * std
        assert entrapment < 0.05
    assert abs(at(found, 10.0)[0] - slip_of(math.tan(math.radians(10.0)))) < 0.03
    # At 30 degrees more is asked than this soil gives.
    assert math.tan(math.radians(30.0)) > 0.5
    assert at(found, 30.0)[2] > 0.5


@pytest.mark.parametrize('soil', ['dry_sand_ding2015', 'lunar_soil_ding2015'])
def test_a_climb_tells_what_going_down_costs(soil):
    """A wheel on the quadrature: downhill its rolling resistance still asks for thrust."""
    rover = reader.load(['generic_six_wheel', soil])
    one = rover.wheels.wheel
    wheel = Wheel(*(float(getattr(one, name)[0]) for name in ('radius', 'width', 'lug_height')))
    slips = np.linspace(-0.5, 0.6, 111)
    found = WheelSoilModel(rover.soil).steady_state(OperatingPoints(slips, 100.0, wheel))
    pulls = found.drawbar_pull / 100.0
    assert (np.diff(pulls) > 0.0).all()
    curve = SlopeCurve()
    for i, demand in enumerate(np.linspace(0.0, 0.6 * pulls.max(), 1200)):
        slip = float(np.interp(demand, pulls, slips))
        curve.update(Instant(i * PERIOD, float(demand), slip, 0.02, RIM * PERIOD, 1.0))
    for slope, most in ((-15.0, 0.25), (-10.0, 0.1), (-5.0, 0.05)):
        slip, std, _ = at(curve.state.latest, slope)
        true = float(np.interp(math.tan(math.radians(slope)), pulls, slips))
        assert abs(slip - true) < min(most, 1.96 * std), slope


def test_how_well_the_soil_brakes_is_unknown_to_who_never_drove_downhill():
    up, both = learned((0.0, 5.0, 10.0)).state, learned((-10.0, 0.0, 10.0)).state
    assert at(up.latest, -15.0)[1] > 1.5 * at(both.latest, -15.0)[1]


def test_ground_far_beyond_the_soil_leaves_finite_numbers():
    curve = SlopeCurve()
    for i in range(200):
        demand = -5.0 if i % 2 else 5.0
        curve.update(Instant(i * PERIOD, demand, 0.2, 0.02, RIM * PERIOD, 1.0))
    assert np.isfinite(curve.state.mean).all() and np.isfinite(curve.state.latest).all()


@pytest.mark.parametrize('offset', [-0.1, 0.2])
@pytest.mark.parametrize('demand', [-0.4, -0.1, 0.2])
def test_a_slip_that_fits_the_curve_moves_nothing(offset, demand, monkeypatch):
    """Driving and braking, the curve that teaches is the one that is told."""
    mean = np.array([offset, math.log(0.4), math.log(0.6)])
    monkeypatch.setattr(slip_on_slope, 'WALK', 0.0)
    curve = SlopeCurve()
    curve.state = CurveState(mean, 1e-6 * np.eye(3))
    told = slips_at(mean, 1e-12 * np.eye(3), 1e-9).slip
    slip = float(np.interp(demand, np.tan(np.radians(SLOPES)), told))
    for i in range(100):
        curve.update(Instant(i * PERIOD, demand, slip, 0.01, RIM * PERIOD, 1.0))
    np.testing.assert_allclose(curve.state.mean, mean, atol=1e-4)


@pytest.mark.parametrize(
    ('strength', 'stds', 'beyond'),
    [(-0.7, (0.03, 0.2, 0.15), 0.0), (-0.5, (0.01, 0.05, 0.05), 0.4)],  # driven there, and beyond
)
def test_what_is_told_of_a_slope_is_that_of_drawn_curves(strength, stds, beyond):
    mean, count = np.array([0.05, -0.8, strength]), 200_000
    told = slips_at(mean, np.diag(stds) ** 2, 0.03, np.full(SLOPES.size, beyond))
    random = np.random.default_rng(3)
    offset, scale, greatest = random.normal(mean, stds, (count, 3)).T
    greatest = np.exp(greatest + random.normal(0.0, beyond, count))
    for place in (5, 7, 8, 9):
        share = np.minimum(math.tan(math.radians(SLOPES[place])) / greatest, 1.0 - 1e-12)
        slip = np.minimum(offset - np.exp(scale) * np.log1p(-share), 1.0)
        assert told.slip[place] == pytest.approx(slip.mean(), abs=0.015)
        assert told.std[place] == pytest.approx(math.hypot(slip.std(), 0.03), abs=0.025)
        trapped = slip + random.normal(0.0, 0.03, count) > ENTRAPPED_SLIP
        assert told.entrapment[place] == pytest.approx(trapped.mean(), abs=0.03)


def test_beyond_what_was_driven_the_greatest_pull_is_less_known():
    mean, covariance = np.array([0.05, -0.8, -0.5]), np.diag([0.01, 0.05, 0.05]) ** 2
    beyond = np.where(SLOPES > 10.0, 0.4, 0.0)
    sure, told = slips_at(mean, covariance, 0.03), slips_at(mean, covariance, 0.03, beyond)
    np.testing.assert_array_equal(told.std[SLOPES <= 10.0], sure.std[SLOPES <= 10.0])
    driven = learned((0.0, 5.0, 10.0)).state
    assert math.degrees(math.atan(driven.driven[1])) == pytest.approx(10.0, abs=0.5)
    plain = slips_at(driven.mean, driven.covariance, 0.03)
    assert at(driven.latest, 20.0)[1] > 1.05 * at(plain, 20.0)[1]
    assert at(driven.latest, 5.0)[1] == pytest.approx(at(plain, 5.0)[1], rel=0.02)


def test_the_demand_is_a_mean_over_four_tenths_of_a_second():
    curve = SlopeCurve()
    for i in range(5):  # 0.4 s after a step, exp(-1) of it is left
        curve.update(Instant(i * PERIOD, 0.2 * (i > 0), 0.2, 0.02, RIM * PERIOD, 1.0))
    assert curve.state.demand == pytest.approx(0.2 * (1.0 - math.exp(-1.0)))


def test_what_is_not_known_teaches_nothing():
    curve = SlopeCurve()
    before = curve.state
    curve.update(Instant(0.0, math.nan, 0.9, 0.05, 0.01, 1.0))  # demand not known
    curve.update(Instant(0.1, 0.2, 0.9, 1.0, 0.01, 1.0))  # slip not known
    curve.update(Instant(0.2, 0.2, 0.9, 0.05, 0.0, 1.0))  # no way made
    np.testing.assert_array_equal(curve.state.mean, before.mean)
    np.testing.assert_array_equal(curve.state.covariance, before.covariance)
    assert np.isfinite(curve.state.latest).all()


def test_sets_of_the_core_have_it_once_a_second():
    core, fake = make_core()
    told = SlipOnSlope(*np.zeros((3, 11)))
    plain = fake.estimates
    fake.estimates = lambda: plain().__class__(**{**vars(plain()), 'slip_on_slope': told})
    sets = play(core, [odometry(0.1 * i) for i in range(35)])
    assert [i for i, e in enumerate(sets) if e.slip_on_slope is not None] == [0, 10, 20, 30]
