# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The angle at which the soil carries a load, against laws with a known inverse."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from terra_tools import SAND, state

from wheel_terra_estimator.terramechanics.load_balance import balance, solve_entrance_angle


@pytest.mark.parametrize('load', [1e-6, 1.0, 1e6])
def test_a_load_is_met_to_a_share_of_itself(load):
    """However light: the force is a power of the angle, 0.3 rad at the load."""
    angle, carries = solve_entrance_angle(
        lambda t: load * (t / 0.3) ** 2.2, np.array([load]), np.array([0.5])
    )
    assert carries.all()
    assert angle == pytest.approx(0.3, rel=1e-9)


def test_what_three_angles_do_not_settle_goes_to_the_bracketed_solver():
    """A force that is no power of the angle: W = exp(20 t) - 1, so that t = ln(1 + W) / 20."""

    def form(count: int) -> Any:
        def forces(t: Any) -> tuple[Any, Any, Any]:
            return np.expm1(20.0 * t), 2.0 * t, 3.0 * t

        return SimpleNamespace(
            exponent=np.full(count, 1.0),
            small_angle=lambda load: np.full(len(load), 0.02),
            forces=forces,
            take=lambda rest: form(int(rest.sum())),
        )

    load = np.array([0.5, 50.0, 1e6])
    angle, pull, torque, carries = balance(form(3), load)
    expected = np.log1p(load) / 20.0
    assert carries.all()
    np.testing.assert_allclose(angle, expected, rtol=1e-8)
    np.testing.assert_allclose(pull, 2.0 * expected, rtol=1e-8)
    np.testing.assert_allclose(torque, 3.0 * expected, rtol=1e-8)


def test_soil_without_weight_does_not_bulldoze():
    light = replace(SAND, density=0.0, cohesion=0.0)
    plain, pushed = (
        state(0.3, soil=light, effects=effects) for effects in (None, {'bulldozing': {'kb': 1.0}})
    )
    assert plain.drawbar_pull == pytest.approx(pushed.drawbar_pull)
