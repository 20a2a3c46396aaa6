# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rival contact laws: published maps, limits known by hand, where the laws must agree."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wheel_terra_estimator.estimation.contacts.contact_models import rim_forces
from wheel_terra_estimator.terramechanics.contact_law import (
    ResistiveForce,
    contact_law,
    plate_scale,
    stress_maps,
)
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.model import OUTSIDE_VALIDITY, OVERLOADED, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

SAND = Soil(1e3, 8e5, 1.1, 100.0, math.radians(31.0), 0.01, 0.4, -0.1)
WHEEL = Wheel(0.15, 0.1)
SLIPS = np.array([-0.5, -0.2, 0.05, 0.2, 0.5, 0.9])
# Li, Zhang and Goldman 2013, supplement, generic medium: (m, n) -> coefficient.
A = {(0, 0): 0.206, (1, 0): 0.169}
B = {(1, 1): 0.212, (0, 1): 0.358, (-1, 1): 0.055}
C = {(1, 1): -0.124, (0, 1): 0.253, (-1, 1): 0.007}
D = {(1, 0): 0.088}


def published(beta: float, gamma: float) -> tuple[float, float]:
    """The double sum as the paper prints it, for motion towards +x."""

    def phase(mn: tuple[int, int]) -> float:
        return 2.0 * math.pi * (mn[0] * beta / math.pi + mn[1] * gamma / (2.0 * math.pi))

    up = sum(a * math.cos(phase(k)) for k, a in A.items())
    up += sum(b * math.sin(phase(k)) for k, b in B.items())
    along = sum(c * math.cos(phase(k)) for k, c in C.items())
    return up, along + sum(d * math.sin(phase(k)) for k, d in D.items())


def test_the_maps_are_the_published_sum():
    for beta in np.linspace(-1.5, 1.5, 7):
        for gamma in np.linspace(-1.5, 1.5, 7):
            assert stress_maps(beta, gamma) == pytest.approx(published(beta, gamma), abs=1e-12)


def test_plates_that_the_paper_pushes():
    # Down, a flat plate: 1.000 N/cm^3, by the sum of five coefficients; up: a quarter of it.
    assert stress_maps(0.0, math.pi / 2) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert stress_maps(0.0, -math.pi / 2) == pytest.approx((-0.25, 0.0), abs=1e-12)
    # A standing plate pushed ahead, and back: the same resistance.
    assert stress_maps(math.pi / 2, 0.0)[1] == pytest.approx(0.370, abs=1e-12)
    assert stress_maps(math.pi / 2, math.pi)[1] == pytest.approx(-0.370, abs=1e-12)
    # Mirror images of tilt and motion.
    tilt, direction = np.meshgrid(np.linspace(-1.57, 1.57, 9), np.linspace(-1.57, 1.57, 9))
    up, along = stress_maps(tilt, direction)
    mirrored = stress_maps(-tilt, np.pi - direction)
    assert mirrored[0] == pytest.approx(up) and mirrored[1] == pytest.approx(-along)


def test_a_wheel_is_the_sum_of_its_plates():
    state = ResistiveForce(2.0).steady_state(OperatingPoints(SLIPS, 60.0, WHEEL))
    for k, slip in enumerate(SLIPS):
        hub = 0.15 * (1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip))
        edges = np.linspace(0.0, state.entrance_angle[k], 10001)
        load = pull = torque = 0.0
        for a in 0.5 * (edges[1:] + edges[:-1])[::10]:
            x, y = 0.15 * math.sin(a), -0.15 * math.cos(a)
            along, down = hub + y, x  # velocity over the wheel rate: rolling towards +x
            up, against = stress_maps(a, math.atan2(down, along))
            area = 0.1 * 0.15 * 10 * (edges[1] - edges[0])
            stress = 2e6 * (0.15 * math.cos(a) - 0.15 * math.cos(state.entrance_angle[k])) * area
            load += up * stress
            pull -= against * stress
            torque += x * up * stress + y * against * stress
        assert load == pytest.approx(60.0, rel=2e-3)
        assert state.drawbar_pull[k] == pytest.approx(pull, rel=2e-3, abs=0.02)
        assert state.torque[k] == pytest.approx(torque, rel=2e-3, abs=0.005)
    back = OperatingPoints(SLIPS, 60.0, WHEEL, angular_velocity=-1.0)
    assert ResistiveForce(2.0).steady_state(back).torque == pytest.approx(-state.torque)


def test_the_table_gives_the_forces_of_the_integrals():
    rng = np.random.default_rng(11)
    slip, angle = rng.uniform(-0.66, 1.0, 2000), rng.uniform(0.02, 1.5, 2000)
    points = OperatingPoints(slip, 1.0, WHEEL)
    load, pull, torque = ResistiveForce(1.0).forces(points, angle)
    found = rim_forces(speed_ratio(slip), angle)
    errors = np.array(
        [
            found.lift * 1e6 * WHEEL.width * WHEEL.radius**2 / load - 1.0,
            found.pull - pull / load,
            found.torque - torque / (load * WHEEL.radius),
        ]
    )
    assert np.abs(errors).max() < 0.01
    assert (np.sqrt(np.mean(errors**2, axis=1)) < 1e-3).all()


def test_what_resistive_force_refuses():
    law = ResistiveForce(1.0)
    with pytest.raises(ValueError, match='plane of the wheel'):
        law.steady_state(OperatingPoints(0.2, 20.0, WHEEL, slip_angle=0.1))
    buried = law.steady_state(OperatingPoints(0.2, 1e6, WHEEL))
    assert buried.flags[0] == OVERLOADED
    assert buried.sinkage[0] == pytest.approx(WHEEL.radius)
    lugged = law.steady_state(OperatingPoints(0.2, 20.0, replace(WHEEL, lug_height=0.01)))
    assert lugged.flags[0] == OUTSIDE_VALIDITY


def test_laws_agree_where_their_assumptions_do():
    points = OperatingPoints(SLIPS, 60.0, WHEEL)
    shift = {'stress_peak_shift': {'c2': 0.32}}
    bekker = contact_law('bekker_wong_janosi', SAND, shift, 0.1).steady_state(points)
    reece = contact_law('wong_reece', SAND, {}, 0.1).steady_state(points)
    # One width, one shift of the peak: what is left is the closed form's error.
    assert reece.sinkage == pytest.approx(bekker.sinkage, rel=0.01)
    assert reece.drawbar_pull == pytest.approx(bekker.drawbar_pull, abs=0.01 * 60.0)
    exact = WheelSoilModel(SAND, shift).steady_state(points)
    assert reece.outputs() == pytest.approx(exact.outputs(), rel=1e-9)
    # Twice the width: pressure in z/b falls by 2^(1 - n), and not at all where n is 1.
    wide = OperatingPoints(SLIPS, 60.0, Wheel(0.15, 0.2))
    frictional = replace(SAND, cohesive_modulus=0.0)
    for exponent, factor in ((1.1, 2.0**-0.1), (1.0, 1.0)):
        soil = replace(frictional, sinkage_exponent=exponent)
        same = replace(soil, frictional_modulus=soil.frictional_modulus * factor)
        expected = WheelSoilModel(same, shift).steady_state(wide)
        found = contact_law('wong_reece', soil, {}, 0.1).steady_state(wide)
        assert found.outputs() == pytest.approx(expected.outputs(), rel=1e-9)
    # A plate at 2 cm carries the same under Bekker's pressure as under the resistive stress.
    pressure = (1e3 / 0.1 + 8e5) * 0.02**1.1
    assert plate_scale(SAND, 0.1) * 1e6 * 0.02 == pytest.approx(pressure)
    with pytest.raises(ValueError, match='contact law'):
        contact_law('coulomb', SAND, {}, 0.1)


def test_a_learned_law_is_on_top_of_the_stress_laws():
    points = OperatingPoints(SLIPS, 60.0, WHEEL)
    learned = {'learned_closure': {'drawbar_pull_by_slip': -0.05}}
    for name in ('bekker_wong_janosi', 'wong_reece'):
        without = contact_law(name, SAND, {}, 0.1).steady_state(points)
        state = contact_law(name, SAND, learned, 0.1).steady_state(points)
        assert (state.drawbar_pull[2:] < without.drawbar_pull[2:]).all()
        assert state.torque == pytest.approx(without.torque)
