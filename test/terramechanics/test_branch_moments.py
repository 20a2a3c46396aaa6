# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Moments of the stress on one side of its peak against integrals."""

import pytest
from scipy.integrate import quad

from wheel_terra_estimator.terramechanics.closed_form import branch_moments


def moment(exponent, skew, power):
    return quad(lambda v: v**power * (v * (1.0 + skew * (1.0 - v))) ** exponent, 0.0, 1.0)[0]


@pytest.mark.parametrize('skew', [-0.3, 0.0, 0.4])
@pytest.mark.parametrize(('exponent', 'tolerance'), [(1.0, 1e-10), (2.0, 1e-10), (1.3, 2e-3)])
def test_area_and_centroid_are_those_of_the_integral(exponent, tolerance, skew):
    """The series in the skew ends after its square for whole exponents up to two."""
    area, centroid, _ = branch_moments(exponent, skew)
    assert area == pytest.approx(moment(exponent, skew, 0), rel=tolerance)
    first = moment(exponent, skew, 1)
    assert area * centroid == pytest.approx(first, rel=tolerance)


@pytest.mark.parametrize('exponent', [0.5, 1.0, 1.7])
def test_spread_is_the_variance_under_the_stress(exponent):
    area, first, second = (moment(exponent, 0.0, power) for power in range(3))
    expected = second / area - (first / area) ** 2
    assert branch_moments(exponent, 0.0)[2] == pytest.approx(expected)
