# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Units of a table's columns against those of scipy."""

import pytest
from scipy import constants

from wheel_terra_estimator.configuration.column_map import UNITS

TURN = 2.0 * constants.pi
KNOWN = {
    ('s', 'ms'): constants.milli,
    ('m', 'in'): constants.inch,
    ('m', 'ft'): constants.foot,
    ('m/s', 'km/h'): constants.kmh,
    ('m/s^2', 'g'): constants.g,
    ('N', 'lbf'): constants.lbf,
    ('N m', 'lbf ft'): constants.lbf * constants.foot,
    ('N m', 'N mm'): constants.milli,
    ('rad', 'deg'): constants.degree,
    ('rad/s', 'rpm'): TURN / constants.minute,
    ('rad/s', 'rev/s'): TURN,
    ('rad/s', 'deg/s'): constants.degree,
}


@pytest.mark.parametrize(('quantity', 'unit'), KNOWN)
def test_a_unit_is_that_of_the_tables(quantity, unit):
    assert UNITS[quantity][unit] == pytest.approx(KNOWN[quantity, unit], rel=1e-12)


def test_the_unit_of_a_quantity_is_one_and_all_are_positive():
    for quantity, units in UNITS.items():
        if quantity in units:
            assert units[quantity] == 1.0
        assert min(units.values()) > 0.0
