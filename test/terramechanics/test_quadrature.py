# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The reference model against a second model, limit cases, symmetry and scaling; slip ratios."""

import math
from dataclasses import replace

import numpy as np
import pytest
from terra_tools import SAND, WHEEL, points, state

from wheel_terra_estimator.terramechanics.kinematics import (
    slip_of_speed_ratio,
    slip_ratio,
    speed_ratio,
)
from wheel_terra_estimator.terramechanics.model import OUTSIDE_VALIDITY, OVERLOADED, WheelSoilModel


def test_frictionless_soil_gives_minus_the_compaction_resistance():
    # c1 = c3 = 0: stress at the bottom only rises towards it, and pull is the work of the rut.
    soil = replace(
        SAND, cohesion=0.0, friction_angle=0.0, peak_stress_ratio=0.0, leaving_angle_ratio=0.0
    )
    answer = state([0.3], soil=soil)
    modulus, _ = soil.bearing(WHEEL.width, 9.81)
    power = soil.sinkage_exponent + 1.0  # Bekker 1969: b k z^(n+1)/(n+1)
    resistance = WHEEL.width * modulus * answer.sinkage**power / power
    assert answer.torque == pytest.approx(0.0, abs=1e-12)
    assert answer.drawbar_pull == pytest.approx(-resistance, rel=2e-3)


def test_reverse_mirrors_pull_and_torque():
    forward = state([0.3, -0.2], effects={'bulldozing': {}, 'drivetrain_friction': {}},
                    angular_velocity=1.0)  # fmt: skip
    back = state([0.3, -0.2], effects={'bulldozing': {}, 'drivetrain_friction': {}},
                 angular_velocity=-1.0)  # fmt: skip
    assert back.sinkage == pytest.approx(forward.sinkage)
    assert back.drawbar_pull == pytest.approx(-forward.drawbar_pull)
    assert back.torque == pytest.approx(-forward.torque)


def test_seed_1_s_printed_shear_is_the_shear_slip_radius():
    # With R = r + h/2 and slip referred to R, v/w = (1 - s) R: equation 14 as printed.
    effects = {'lug_shear_radius': {'lam': 0.5}}
    printed = state([0.2], effects=effects, slip_radius='shear')
    lug_tip_slip = 1.0 - (1.0 - 0.2) * (WHEEL.radius + 0.005) / WHEEL.tip_radius
    contract = state([lug_tip_slip], effects=effects)
    assert printed.outputs() == pytest.approx(contract.outputs(), rel=1e-9)


def test_reece_law_equals_bekker_s_at_one_width_and_gravity():
    # (c kc' + rho g b kphi') (z/b)^n = k z^n with k = (...) b^-n.
    reece = replace(SAND, pressure_law='reece', cohesive_modulus=30.0, frictional_modulus=600.0)
    b = WHEEL.width
    pressure = 250.0 * 30.0 + 1605.0 * 9.80665 * b * 600.0
    bekker = replace(SAND, cohesive_modulus=0.0, frictional_modulus=pressure * b**-1.1)
    assert state([0.3], soil=reece).outputs() == pytest.approx(
        state([0.3], soil=bekker).outputs(), rel=1e-9
    )
    low_gravity = state([0.3], soil=reece, gravity=1.62)
    assert low_gravity.sinkage > 1.5 * state([0.3], soil=reece).sinkage


def test_load_that_the_soil_cannot_carry():
    clamped = WheelSoilModel(SAND).steady_state(points([0.1, 0.97], [1e6, 80.0]))
    assert clamped.flags.tolist() == [OVERLOADED, OUTSIDE_VALIDITY]
    assert np.isfinite(clamped.outputs()).all()
    assert clamped.sinkage[0] == pytest.approx(WHEEL.radius)


def test_measured_leaving_angle_overrides_the_law():
    answer = state([0.8, 0.8], effects={'soil_mound': {}}, leaving_angle=[math.nan, -0.35])
    assert answer.leaving_angle[1] == pytest.approx(-0.35)
    assert answer.leaving_angle[0] != pytest.approx(-0.35)
    assert answer.drawbar_pull[0] != pytest.approx(answer.drawbar_pull[1])


# Slip ratio and the shear displacement that follows from it.


@pytest.mark.parametrize(
    ('speed', 'rim', 'slip'),
    [
        (0.10, 0.10, 0.0),
        (0.07, 0.10, 0.3),
        (0.0, 0.10, 1.0),
        (0.10, 0.05, -0.5),
        (-0.07, -0.10, 0.3),  # reverse is symmetric
        (-0.10, -0.05, -0.5),
        (-0.02, 0.10, 1.0),  # slides back while driving
        (0.10, 0.0, -1.0),  # held still, dragged along
        (0.10, -0.001, -1.0),  # below rest speed counts as held
        (-0.001, 0.10, 1.0),
    ],
)
def test_slip_ratio_of_driving_and_braking(speed, rim, slip):
    assert slip_ratio(speed, rim) == pytest.approx(slip)


def test_slip_is_not_known_at_rest_and_always_in_range():
    assert np.isnan(slip_ratio(0.001, -0.001))
    speeds = np.linspace(-0.3, 0.3, 61)
    grid = slip_ratio(speeds[:, None], speeds[None, :])
    known = grid[np.isfinite(grid)]
    assert known.min() >= -1.0 and known.max() <= 1.0


def test_speed_ratio_is_the_inverse():
    slip = np.linspace(-0.99, 1.0, 50)
    assert slip_of_speed_ratio(speed_ratio(slip)) == pytest.approx(slip)
    # Opposed, standing, driving, rolling, braking.
    found = slip_of_speed_ratio(np.array([-1.0, -0.0, 0.3, 1.0, 2.5]))
    assert found == pytest.approx([1.0, 1.0, 0.7, 0.0, -0.6])
