# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil numbers that are a thousand times off are questioned, those of the literature are not."""

import warnings

import numpy as np
import pytest
from scipy import constants

from wheel_terra_estimator import api
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.configuration.column_map import UNITS
from wheel_terra_estimator.errors import ConfigurationWarning

SOILS = [name for name in shipped.files() if name.startswith('soils/')]
WHEEL = api.Wheel(radius=0.13, width=0.16)


@pytest.mark.parametrize('name', SOILS)
def test_soils_of_the_literature_are_not_doubted_and_a_thousandth_of_them_is(name):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        soil = api.Soil.load(name)
    values = {f'soil.{key}': getattr(soil, key) / 1000.0 for key in ('cohesion', 'density')}
    expected = {'soil.cohesion', 'soil.density'}
    if soil.pressure_law == 'bekker':  # whatever kc is, that of the default too
        values['soil.frictional_modulus'] = soil.frictional_modulus / 1000.0
        expected.add('soil.frictional_modulus')
    values['soil.pressure_law'] = soil.pressure_law
    if soil.shear_modulus > 1e-3:
        values['soil.shear_modulus'] = min(1000.0 * soil.shear_modulus, 1.0)
        expected.add('soil.shear_modulus')
    values['soil.friction_angle_deg'] = soil.friction_angle
    expected.add('soil.friction_angle_deg')
    with pytest.warns(ConfigurationWarning) as caught:
        reader.from_parameters(values, source='mine', complete=False)
    found = {str(warning.message).split()[1] for warning in caught}
    assert found == expected


def test_a_fitted_number_is_not_doubted(recwarn):
    fitted = {
        'soil.cohesion': 3.2,
        'soil.cohesion_std': 400.0,
        'provenance': 'wheel-terra diagnose',
    }
    reader.from_parameters(fitted, complete=False)
    assert not recwarn.list


def test_the_words_name_the_place_and_the_cure(capsys):
    soft = ['-p', 'soil.cohesion:=0.3', '-p', 'soil.frictional_modulus:=180.0']
    base = ['predict', '--config', 'hit_wh3', '--config', 'dlr_mss', '--load', '0.1']
    assert main([*base, '--slip', '0.2', *soft]) == 0
    said = capsys.readouterr().err.splitlines()
    assert said[0] == (
        'wheel-terra predict: warning: -p soil.cohesion:=0.3: soil.cohesion is 0.3 Pa; in kPa? '
        'then times 1000'
    )
    with pytest.warns(ConfigurationWarning, match='in kPa'):
        api.Model(WHEEL, api.Soil(5790.0, 180e3, 1.1, 0.3, 0.3, 0.01))


def test_a_model_takes_the_name_of_a_soil_and_says_what_it_cannot_take():
    named = api.Model(WHEEL, 'dlr_mss').curve([0.3], 60.0)
    assert named.sinkage == api.Model(WHEEL, api.Soil.load('dlr_mss')).curve([0.3], 60.0).sinkage
    for arguments in (('hit_wh3', 'dlr_mss'), (WHEEL, {'cohesion': 3.0}), (WHEEL, None)):
        with pytest.raises(api.UserError, match='use Model'):
            api.Model(*arguments)
    with pytest.raises(api.UserError, match="did you mean 'dlr_mss'"):
        api.Model(WHEEL, 'dlr_msss')
    assert np.isfinite(named.torque).all()


# Units of a table's columns against those of scipy.


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
