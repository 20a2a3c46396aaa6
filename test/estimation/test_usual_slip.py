# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The usual slip on a slope against the steady state of the reference quadrature."""

import numpy as np
import pytest
from parts import SAND, Parts

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.usual_slip import UsualSlip
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints


@pytest.fixture(scope='module')
def parts():
    return Parts(reader.load(SAND))


@pytest.fixture(scope='module')
def usual(parts):
    return UsualSlip(parts.configuration, parts.rover)


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


@pytest.mark.parametrize('slip', [0.05, 0.15, 0.3])
@pytest.mark.parametrize('stated', [False, True])
def test_lugs_of_which_no_file_says_it_shear_half_way_up(slip, stated):
    """Lugs of a tenth of the radius: sheared at the rim they would take 0.05 to 0.2 more."""
    keys = ['wheels.lug_height:=[0.015, 0.015, 0.015, 0.015, 0.015, 0.015]']
    keys += ['effects.lug_shear_radius.enabled:=true'] * stated
    lugged = Parts(reader.load(SAND, keys))
    demand = pull_share(lugged, slip)
    found = UsualSlip(lugged.configuration, lugged.rover).at(demand, beyond=0.8)
    assert found == pytest.approx(slip, abs=0.02)
