# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Bad input ends in a ValueError that names the quantity, its value and the allowed range."""

from __future__ import annotations

from dataclasses import replace

import pytest
from terra_tools import SAND, WHEEL, points

from wheel_terra_estimator.terramechanics.inverse import entrance_angle
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
        (lambda: points(0.1, -5.0), r'normal load is -5 N; allowed is \(0, inf\) N'),
        (lambda: points(0.1, slope=2.0), r'slope is 2 rad'),
        (lambda: points(0.1, pass_number=0), r'pass number is 0'),
        (lambda: points(0.1, slip_radius='hub'), r"slip radius is 'hub'"),
        (lambda: replace(SAND, cohesion=-1.0), r'cohesion is -1 Pa; allowed is \[0, inf\) Pa'),
        (lambda: replace(SAND, shear_modulus=0.0), r'shear modulus is 0 m'),
        (lambda: replace(SAND, leaving_angle_ratio=0.3), r'leaving angle ratio is 0\.3'),
        (lambda: replace(SAND, pressure_law='clay'), r"pressure law is 'clay'"),
        (lambda: WheelSoilModel(SAND, method='guess'), r"method is 'guess'"),
        (lambda: entrance_angle(0.2, 0.1), r'sinkage is 0\.2 m; allowed is \[0, 0\.1\] m'),
        (
            lambda: WheelSoilModel(replace(SAND, cohesive_modulus=-1e6)).steady_state(points(0.1)),
            r'bearing modulus kc/b \+ kphi is -3\.65',
        ),
    ],
)
def test_the_complaint_names_quantity_value_and_range(make, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()


def test_a_wheel_may_be_smooth() -> None:
    assert Wheel(0.1, 0.1).tip_radius == 0.1
    assert WHEEL.tip_radius == pytest.approx(0.1674)
