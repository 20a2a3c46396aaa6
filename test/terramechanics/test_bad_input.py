# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Bad input ends in a ValueError that names the quantity, its value and the allowed range."""

from dataclasses import replace

import numpy as np
import pytest
from terra_tools import SAND, WHEEL, points

from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.wheel import Wheel


@pytest.mark.parametrize(
    ('make', 'words'),
    [
        (lambda: Wheel(-0.1, 0.1), r'wheel radius is -0\.1 m; allowed is \(0, inf\) m'),
        (lambda: Wheel(0.1, 0.0), r'wheel width is 0 m; allowed is \(0, inf\) m'),
        (lambda: Wheel(0.1, 0.1, -0.01), r'lug height is -0\.01 m'),
        (lambda: points(1.2), r'slip is 1\.2; allowed is \[-1, 1\]'),
        (lambda: points([0.1, float('nan')]), r'slip is nan \(entry 1\)'),
        (lambda: points(0.1, -5.0), r'normal load is -5 N; allowed is \(0, inf\) N$'),
        (lambda: points(12.0), r'slip is 12; .*; from per cent: 12 / 100$'),
        (lambda: points(0.1, slope=2.0), r'slope is 2 rad; .*; from degrees: math\.radians\(2\)$'),
        (lambda: points(0.1, pass_number=0), r'pass number is 0'),
        (lambda: points(0.1, slip_radius='hub'), r"slip radius is 'hub'"),
        (lambda: replace(SAND, cohesion=-1.0), r'cohesion is -1 Pa; allowed is \[0, inf\) Pa'),
        (lambda: replace(SAND, shear_modulus=0.0), r'shear deformation modulus is 0 m'),
        (
            lambda: replace(SAND, leaving_angle_ratio=0.3),
            r'leaving angle ratio is 0\.3; allowed is \[-1\.5, 0\]',
        ),
        (lambda: replace(SAND, friction_angle=1.1), r'friction angle is 1\.1 rad; .*\[0, 1\.047'),
        (lambda: replace(SAND, peak_stress_ratio=1.2), r'ratio is 1\.2; allowed is \[0, 1\]'),
        (lambda: replace(SAND, pressure_law='clay'), r"pressure law is 'clay'"),
        (lambda: WheelSoilModel(SAND, method='guess'), r"method is 'guess'"),
        (lambda: Wheel('wide', 0.1), r"wheel radius is 'wide'; allowed is a number"),
        (lambda: points(1.0000001), r'slip is 1\.0000001; allowed is \[-1, 1\]'),
        (lambda: points([0.1, 0.2], [1.0, 2.0, 3.0]), r'normal load has 3 entries, slip has 2'),
        (lambda: points([[0.1, 0.2]]), r'slip has shape \(1, 2\); allowed is a number or one axis'),
        (
            lambda: points([0.1, 0.2, 0.3], wheel=Wheel([0.1, 0.2], 0.1)),
            r'radius has 2 entries, slip has 3',
        ),
        (
            lambda: WheelSoilModel(replace(SAND, cohesive_modulus=-1e6)).steady_state(points(0.1)),
            r'bearing modulus kc/b \+ kphi is -3\.65',
        ),
    ],
)
def test_the_complaint_names_quantity_value_and_range(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_a_wheel_may_be_smooth():
    assert Wheel(0.1, 0.1).tip_radius == 0.1
    assert WHEEL.tip_radius == pytest.approx(0.1674)


def test_what_effects_leave_of_the_soil_is_flagged():
    model = WheelSoilModel(SAND, {'cohesion': {'delta': -3000.0}})
    assert model.steady_state(points([0.1, 0.2])).flags.tolist() == [2, 2]
    assert WheelSoilModel(SAND).steady_state(points(np.zeros(0))).sinkage.shape == (0,)


def test_a_great_many_points_at_once():
    state = WheelSoilModel(SAND, method='closed_form').steady_state(
        points(np.linspace(-1.0, 1.0, 5_001))
    )
    assert np.isfinite(state.outputs()).all()
