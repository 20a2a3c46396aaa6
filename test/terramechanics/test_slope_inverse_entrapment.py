# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slope locomotion, the inverse model, entrapment and the longitudinal construction."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from terra_tools import EFFECTS, SAND, WHEEL, points, state

from wheel_terra_estimator.terramechanics.entrapment import (
    digging_per_turn,
    digging_rate,
    digging_share,
    rim_travel_to_depth,
)
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.slope_locomotion import SlopeLocomotion, rover_climb
from wheel_terra_lab.terramechanics.inverse import (
    PeakStresses,
    centroid_angle,
    entrance_angle,
    equivalent_soil,
    peak_stresses,
)
from wheel_terra_lab.terramechanics.longitudinal_sinkage import longitudinal_slip_sinkage

SMOOTH = replace(WHEEL, lug_height=0.0)


def climber(load: str = 'weight') -> SlopeLocomotion:
    return SlopeLocomotion(WheelSoilModel(SAND), WHEEL, 80.0, load)


@pytest.mark.parametrize('load', ['weight', 'constant'])
def test_the_climb_balances(load: str) -> None:
    slopes = np.radians([-10.0, 0.0, 5.0, 12.0])
    climb = climber(load).climb(slopes)
    assert climb.drawbar_pull == pytest.approx(80.0 * np.sin(slopes), abs=1e-6)
    carried = 80.0 * (np.cos(slopes) if load == 'weight' else np.ones(4))
    again = state(climb.slip, carried)
    assert climb.sinkage == pytest.approx(again.sinkage)
    assert np.all(np.diff(climb.slip) > 0.0)


def test_the_climb_is_the_effect_slope_gravity_at_zero_hitch_pull() -> None:
    slope = 0.15
    slip = climber().climb([slope]).slip
    hitch = state(slip, slope=slope, effects={'slope_gravity': {}}).drawbar_pull
    assert hitch == pytest.approx(0.0, abs=1e-6)


def test_coefficients_of_nakashima_2010() -> None:
    climb = climber().climb([0.15])
    assert climb.pull_coefficient == pytest.approx(math.sin(0.15))
    torque = climb.torque / (80.0 * WHEEL.tip_radius)
    assert climb.torque_coefficient == pytest.approx(torque)
    # PN = T w/(W v): power over weight and distance.
    rate = 1.0
    speed = (1.0 - climb.slip) * WHEEL.tip_radius * rate
    assert climb.power_number == pytest.approx(climb.torque * rate / (80.0 * speed))


def test_too_steep_is_nan_and_the_greatest_slope_is_the_border() -> None:
    wheel = climber()
    steepest = wheel.greatest_slope()
    climb = wheel.climb([steepest - 0.01, steepest + 0.01])
    assert np.isfinite(climb.slip[0]) and np.isnan(climb.slip[1])
    at_20 = wheel.slope_at_slip(0.2)
    assert wheel.climb(at_20).slip == pytest.approx(0.2, abs=1e-3)
    rolling = wheel.self_propelled()
    assert rolling.drawbar_pull == pytest.approx(0.0, abs=1e-6) and rolling.slip > 0.0


def test_a_rover_of_equal_wheels_climbs_like_one_of_them() -> None:
    slopes = np.radians([-5.0, 0.0, 8.0, 14.0])
    one = climber().climb(slopes)
    rover = rover_climb(WheelSoilModel(SAND), WHEEL, [80.0] * 4, slopes)
    assert rover.slip == pytest.approx(one.slip, abs=1e-9)
    assert rover.sinkage == pytest.approx(np.tile(one.sinkage[:, None], 4))
    assert rover.power_number == pytest.approx(one.power_number)
    assert np.isnan(rover_climb(WheelSoilModel(SAND), WHEEL, [80.0] * 4, [0.9]).slip).all()


def test_a_rover_s_wheels_pull_the_weight_together() -> None:
    """Unequal loads and wheels that run in ruts: the sum is W sin a, none of them by itself."""
    slopes = np.radians([0.0, 10.0])
    level = np.array([60.0, 90.0, 90.0])
    model = WheelSoilModel(SAND, {'multipass': {'stiffening': 0.6}})
    loads = level * np.cos(slopes)[:, None] + np.outer(np.tan(slopes), [-30.0, 0.0, 30.0])
    rover = rover_climb(model, WHEEL, loads, slopes, [1, 2, 3])
    assert rover.drawbar_pull.sum(axis=1) == pytest.approx(240.0 * np.sin(slopes), abs=1e-6)
    assert np.ptp(rover.drawbar_pull[1]) > 2.0
    again = model.steady_state(
        points([rover.slip[1]] * 3, loads[1], slope=slopes[1], pass_number=[1, 2, 3])
    )
    assert rover.drawbar_pull[1] == pytest.approx(again.drawbar_pull)
    virgin, compacted = (rover_climb(model, WHEEL, level, slopes, n).sinkage for n in (1, 3))
    assert (compacted < virgin).all()


def test_slope_gravity_in_the_model_would_count_twice() -> None:
    with pytest.raises(ValueError, match='slope_gravity is on'):
        SlopeLocomotion(WheelSoilModel(SAND, {'slope_gravity': {}}), WHEEL, 80.0)


def measured(method: str = 'triangles'):
    slip = np.tile([0.1, 0.2, 0.4, 0.7], 4)
    load = np.repeat([30.0, 60.0, 100.0, 160.0], 4)
    return slip, load, state(slip, load, wheel=SMOOTH, method=method)


def test_inverse_finds_the_soil_of_its_own_model() -> None:
    slip, load, answer = measured()
    t1 = entrance_angle(answer.sinkage, SMOOTH.radius)
    assert t1 == pytest.approx(answer.entrance_angle)
    angles = (t1, 0.5 * t1, -0.2 * t1)
    r = SMOOTH.radius
    stresses = peak_stresses(answer.torque, load, angles, r, r, SMOOTH.width)
    soil = equivalent_soil(stresses, angles, (1.0 - slip) * r, r, r)
    assert soil.separable
    assert soil.cohesion == pytest.approx(SAND.cohesion, rel=0.1)
    assert soil.tan_friction == pytest.approx(math.tan(SAND.friction_angle), rel=0.01)
    assert soil.shear_modulus == pytest.approx(SAND.shear_modulus, rel=0.03)
    assert soil.sinkage_exponent == pytest.approx(SAND.sinkage_exponent, rel=0.01)
    modulus = SAND.cohesive_modulus / SMOOTH.width + SAND.frictional_modulus
    assert soil.bearing_modulus == pytest.approx(modulus, rel=0.05)


def test_inverse_of_the_quadrature_is_an_equivalent_soil() -> None:
    slip, load, answer = measured('quadrature')
    angles = (answer.entrance_angle, answer.peak_stress_angle, answer.leaving_angle)
    r = SMOOTH.radius
    stresses = peak_stresses(answer.torque, load, angles, r, r, SMOOTH.width)
    soil = equivalent_soil(stresses, angles, (1.0 - slip) * r, r, r)
    # Not the same numbers, but the strength at the working stress is.
    strength = soil.cohesion + soil.tan_friction * 10e3
    assert strength == pytest.approx(250.0 + math.tan(SAND.friction_angle) * 10e3, rel=0.12)


def test_derivatives_of_the_peak_stresses() -> None:
    angles = (0.4, 0.2, -0.08)
    base = peak_stresses(3.0, 80.0, angles, 0.157, 0.162, 0.165)
    more = peak_stresses(3.001, 80.0, angles, 0.157, 0.162, 0.165)
    heavier = peak_stresses(3.0, 80.01, angles, 0.157, 0.162, 0.165)
    assert (more.normal - base.normal) / 0.001 == pytest.approx(base.by_torque[0], rel=1e-5)
    assert (more.shear - base.shear) / 0.001 == pytest.approx(base.by_torque[1], rel=1e-5)
    assert (heavier.normal - base.normal) / 0.01 == pytest.approx(base.by_load[0], rel=1e-5)
    assert base.by_load[1] == 0.0


def test_one_load_cannot_part_cohesion_from_friction() -> None:
    answer = state([0.2, 0.4], wheel=SMOOTH)
    angles = (answer.entrance_angle, answer.peak_stress_angle, answer.leaving_angle)
    r = SMOOTH.radius
    stresses = peak_stresses(answer.torque, 80.0, angles, r, r, SMOOTH.width)
    soil = equivalent_soil(stresses, angles, np.array([0.8, 0.6]) * r, r, r)
    assert not soil.separable and soil.cohesion == 0.0


def test_three_loads_part_cohesion_from_friction() -> None:
    """As many points as there are numbers: the stresses follow c + sigma tan(phi) exactly."""
    cohesion, tangent, modulus = 300.0, 0.6, 0.02
    radius = 0.2
    angles = (np.array([0.3, 0.4, 0.5]), np.array([0.15, 0.2, 0.25]), np.zeros(3))
    ratio = np.array([0.9, 0.7, 0.4]) * radius
    normal = np.array([4e3, 9e3, 15e3])
    j = radius * (angles[0] - angles[1]) - ratio * (np.sin(angles[0]) - np.sin(angles[1]))
    shear = (cohesion + tangent * normal) * (1.0 - np.exp(-j / modulus))
    unused = (np.zeros(3), np.zeros(3))
    stresses = PeakStresses(normal, shear, unused, unused, np.ones(3, dtype=bool))
    soil = equivalent_soil(stresses, angles, ratio, radius, radius, [modulus])
    assert soil.separable
    assert soil.cohesion == pytest.approx(cohesion, rel=1e-6)
    assert soil.tan_friction == pytest.approx(tangent, rel=1e-6)


def test_centroid_angle_is_the_centroid_of_the_stress() -> None:
    answer = state([0.2, 0.5, 0.8], wheel=SMOOTH)
    psi = centroid_angle(answer.torque, 80.0, answer.drawbar_pull, SMOOTH.radius, spread=0.99)
    mean = (answer.entrance_angle + answer.peak_stress_angle + answer.leaving_angle) / 3.0
    assert psi == pytest.approx(mean, abs=0.02)


def test_digging_starts_near_stuck_and_grows_with_the_lugs() -> None:
    assert digging_share(0.85) == 0.0 and digging_share(1.0) == 1.0
    assert digging_share(0.925) == pytest.approx(0.5)
    assert digging_rate(-0.98, WHEEL, 1.0) == 0.0
    low, high = (digging_rate(0.98, replace(WHEEL, lug_height=h), 1.0) for h in (0.005, 0.015))
    assert high == pytest.approx(3.0 * low)
    assert digging_rate(0.98, SMOOTH, 1.0) > 0.0
    assert digging_rate(0.98, WHEEL, -2.0) == pytest.approx(2.0 * digging_rate(0.98, WHEEL, 1.0))


def test_a_spinning_wheel_throws_out_the_layer_of_its_lugs_once_per_lug() -> None:
    """Thirty lugs of 10 mm pass in a turn; with all of it thrown out it is 300 mm deeper."""
    assert digging_per_turn(WHEEL, efficiency=1.0) == pytest.approx(0.300)
    turn = 2.0 * math.pi * WHEEL.radius
    deeper = digging_per_turn(WHEEL)
    assert rim_travel_to_depth(0.02, 0.02 + 2.0 * deeper, 1.0, WHEEL) == pytest.approx(2.0 * turn)
    assert rim_travel_to_depth(0.02, 0.06, 0.5, WHEEL) == math.inf
    assert rim_travel_to_depth(0.07, 0.06, 0.97, WHEEL) == 0.0


def test_longitudinal_construction_of_ding_2010() -> None:
    # Static entrance angle 14.5 deg, (c1, c2) = (0.18, 0.32).
    static = math.acos(1.0 - 0.005 / 0.15735)
    got = []
    for slip in (0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0):
        peak = (0.18 + 0.32 * slip) * static
        depth = longitudinal_slip_sinkage(slip, 0.15735, peak, -0.2 * static, math.radians(31.9))
        got.append(1e3 * depth)
    assert got[0] == 0.0
    assert got[1:] == pytest.approx([0.5, 1.2, 2.5, 5.1, 7.4, 9.5, 11.0], abs=0.5)
    assert np.all(np.diff(got) > 0.0)
    with pytest.raises(ValueError, match=r'slip is -0\.1'):
        longitudinal_slip_sinkage(-0.1, 0.15, 0.2, 0.0, 0.5)


def test_wong_reece_alone_stays_below_5_mm() -> None:
    # Ding et al. 2010 section 4.2; without exponent and digging terms.
    effects = {'stress_peak_shift': EFFECTS['stress_peak_shift']}
    z = state([0.0, 0.6], effects=effects, wheel=SMOOTH).sinkage
    assert 0.0 < z[1] - z[0] < 0.005
    grown = WheelSoilModel(SAND, {'slip_sinkage_exponent': {'n1': 0.3}})
    assert np.diff(grown.steady_state(points([0.0, 0.6])).sinkage) > 0.005
