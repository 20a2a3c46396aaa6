# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What curves of traction tell: slip on a slope and slip of a torque, pull that is left over."""

import math

import numpy as np
import pytest
from parts import Parts, on_sand
from scipy.optimize import brentq

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import EquilibriumSlip
from wheel_terra_estimator.estimation.contacts.measured_wheels import (
    Opinion,
    SpeedAndVariance,
    pooled,
    slip_of_torque,
    torque_of_slip,
)
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelStates
from wheel_terra_estimator.estimation.judgement.pull_margin import PullMargin
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints


@pytest.fixture(scope='module')
def usual(parts):
    return EquilibriumSlip(parts.configuration, parts.rover)


def pull_share(parts, slip):
    """Return pull over load of the whole rover in steady driving at a slip.

    Its soil shears half way up the lugs.
    """
    configuration = parts.configuration
    wheels, n = configuration.wheels, configuration.wheels.count
    loads = np.asarray(parts.rover.load.loads((0.0, 0.0, parts.rover.gravity)))
    points = OperatingPoints(
        slip=np.full(n, slip),
        normal_load=loads,
        wheel=wheels.wheel,
        slip_radius=configuration.slip_radius,
        gravity=float(configuration.rover.gravity),
        pass_number=np.asarray(wheels.passes, dtype=float),
    )
    effects = configuration.effects | {'lug_shear_radius': {'lam': 0.5}}
    steady = WheelSoilModel(configuration.soil, effects).steady_state(points)
    return float(steady.drawbar_pull.sum() / loads.sum())


@pytest.mark.parametrize('slip', [0.08, 0.17, 0.35])
def test_a_slope_that_a_slip_climbs_takes_that_slip(parts, usual, slip):
    demand = pull_share(parts, slip)
    assert usual.at(demand, beyond=0.8) == pytest.approx(slip, abs=0.03)


def test_steeper_takes_more_and_no_soil_gives_all(usual):
    slips = [usual.at(demand, beyond=0.8) for demand in np.linspace(-0.3, 0.6, 40)]
    assert slips == sorted(slips)
    assert slips[0] < 0.0
    assert usual.at(2.0, beyond=0.8) == 0.8
    assert usual.at(-2.0, beyond=0.8) == -0.5


def test_sand_that_nobody_stated_holds_no_rover_on_the_level():
    """Thirty kilograms on two wheels of 26 mm would be buried in it; on the level it rolls."""
    tiny = {
        'wheels.names': ['left', 'right'],
        'wheels.radius': [0.026, 0.026],
        'wheels.width': [0.05, 0.05],
        'wheels.y': [0.25, -0.25],
        'rover.mass': 30.0,
    }
    slips = {}
    for stated in ({}, {'soil.cohesion': 170.0}):
        configuration = reader.from_parameters(tiny | stated)
        parts = Parts(configuration)
        slips[bool(stated)] = EquilibriumSlip(configuration, parts.rover).at(0.0, beyond=0.8)
    assert slips[False] < 0.1
    assert slips[True] == 0.8  # that of the file


@pytest.mark.parametrize('slip', [0.05, 0.15, 0.3])
@pytest.mark.parametrize('stated', [False, True])
def test_lugs_of_which_no_file_says_it_shear_half_way_up(slip, stated):
    """Lugs of a tenth of the radius: sheared at the rim they would take 0.05 to 0.2 more."""
    keys = ['wheels.lug_height:=[0.015, 0.015, 0.015, 0.015, 0.015, 0.015]']
    keys += ['effects.lug_shear_radius.enabled:=true'] * stated
    lugged = on_sand(*keys)
    demand = pull_share(lugged, slip)
    found = EquilibriumSlip(lugged.configuration, lugged.rover).at(demand, beyond=0.8)
    assert found == pytest.approx(slip, abs=0.02)


# -- Slip of a torque, beside wheels that were measured -------------------------------------------


HIT_SMOOTH = ((0.1, 0.238), (0.2, 0.334), (0.3, 0.381))  # Ding et al. 2011, figure 9
HIT_LUGS = ((0.1, 0.278), (0.2, 0.397), (0.3, 0.461))
KLS1_SMOOTH = ((0.1, 0.26), (0.2, 0.31), (0.3, 0.38))  # Wang and Han 2016
"""Slip and torque over load times radius, as digitised in shared/measured."""


@pytest.mark.parametrize('wheel', [HIT_SMOOTH, HIT_LUGS, KLS1_SMOOTH])
def test_measured_wheels_lie_within_the_stated_interval(wheel):
    for slip, coefficient in wheel:
        usual = slip_of_torque(coefficient)
        assert abs(usual.slip - slip) < 1.96 * usual.std


def test_half_of_the_greatest_torque_takes_the_scale_times_ln_2_whichever_way():
    usual, braking = slip_of_torque(0.275), slip_of_torque(-0.275)
    assert usual.slip == pytest.approx(0.17 * math.log(2.0)) == -braking.slip
    assert braking.std == usual.std
    there_and_back = torque_of_slip(np.array([usual.slip, -usual.slip]))
    assert there_and_back == pytest.approx([0.275, -0.275])


def test_torque_tells_nothing_on_the_plateau_or_where_there_is_none():
    """HIT's lugged wheel has the torque of 0.5 at a slip of 0.4 and of 0.57 at 0.6."""
    assert math.isnan(slip_of_torque(0.5).slip)
    assert math.isnan(slip_of_torque(math.nan).slip)


@pytest.mark.parametrize('share', [1.0, 0.3, 0.0])
def test_pooled_estimates_have_the_moments_of_their_mixture(share):
    """By Monte Carlo: each of the two is right as often as inverse variance and share say."""
    rng = np.random.default_rng(6)
    first = rng.random(400_000) < 1.0 - 0.1 * share
    drawn = np.where(first, rng.normal(0.2, 0.1, first.size), rng.normal(0.6, 0.3, first.size))
    told = pooled(SpeedAndVariance(0.2, 0.01), Opinion(0.6, 0.09, share, 0.2))
    assert told.speed == pytest.approx(drawn.mean(), rel=0.01)
    assert told.variance == pytest.approx(drawn.var(), rel=0.01)


@pytest.mark.parametrize('sense', [1.0, -1.0])
@pytest.mark.parametrize(
    ('slip', 'std'), [(0.0, 0.06), (0.05, 0.06), (0.25, 0.05), (0.4, 0.13), (0.5, 0.15)]
)
def test_a_weaker_soil_takes_more_slip_than_the_tangent_says(sense, slip, std):
    """The slips at which the scaled curve gives the same torque, by root search, at most 1."""
    given = SpeedAndVariance((1.0 - sense * slip) * 0.05, (0.05 * std) ** 2)
    told = pooled(given, Opinion(*given[:2], 1.0, 0.05))
    torque, at_one = (float(torque_of_slip(np.array([s]))[0]) for s in (slip, 1.0))
    slope = (float(torque_of_slip(np.array([slip + 1e-6]))[0]) - torque) / 1e-6
    off = math.exp(min(std * slope / max(torque, 1e-9), 0.17))
    low, high = (
        brentq(lambda s, t=t: float(torque_of_slip(np.array([s]))[0]) - t, 0.0, 1.0)
        for t in (torque / off, min(torque * off, at_one))
    )
    assert math.sqrt(told.variance) / 0.05 == pytest.approx(max(0.5 * (high - low), std), rel=0.01)
    assert (math.sqrt(told.variance) > 1.1 * 0.05 * std) == (std > 0.1)


def test_what_a_reference_has_shown_is_not_doubted_for_the_curve():
    given = SpeedAndVariance(0.025, (0.15 * 0.05) ** 2)
    kept, lost = (pooled(given, Opinion(*given[:2], share, 0.05)).variance for share in (0.0, 1.0))
    assert kept == pytest.approx(given.variance)
    assert lost > 1.5 * given.variance


# -- Pull left over: the top of the curve less what the ground asks --------------------------------


LOADS = (250.0,) * 5 + (0.0,)


def margin(parts, slope, direction=1.0):
    found = PullMargin(len(LOADS), parts.models)
    sinkages = parts.filter().x[parts.layout.sinkage]
    wheels = WheelStates(1.0, sinkages, np.array(LOADS))
    found.update(wheels, direction * math.tan(slope))
    return found.state


def test_the_margin_is_the_greatest_pull_less_what_the_slope_asks(parts):
    sinkage = parts.filter().x[parts.layout.sinkage]
    ratio = 1.0 - np.linspace(0.2, 0.95, 40)[:, None]
    _, pulls = parts.models.torque_and_pull(WheelStates(ratio, sinkage, 250.0))
    level = margin(parts, 0.0)
    assert level[0] == pytest.approx(pulls[:, 0].max(), abs=0.02 * 250.0)
    assert level[5] == 0.0  # in the air
    uphill = margin(parts, 0.2)
    assert level[0] - uphill[0] == pytest.approx(250.0 * math.tan(0.2))
    # Backwards up the same ground is downhill.
    assert margin(parts, 0.2, direction=-1.0)[0] > level[0]
