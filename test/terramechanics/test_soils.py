# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Shipped soils: each loads, says where every value comes from, and carries a rover wheel."""

import pytest
from terra_tools import WHEEL, points

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import configuration_folder
from wheel_terra_estimator.terramechanics.model import WheelSoilModel

FILES = sorted((configuration_folder() / 'soils').glob('*.yaml'))


def test_there_are_soils():
    assert len(FILES) >= 25


@pytest.mark.parametrize('path', FILES, ids=lambda p: p.stem)
def test_soil_file(path):
    text = path.read_text(encoding='utf-8').splitlines()
    values = [line for line in text if ':' in line and not line.lstrip().startswith('#')]
    bare = [
        line.strip() for line in values
        if '#' not in line and not line.rstrip().endswith(':')
        and not any(key in line for key in ('name:', 'source:', 'enabled:'))
    ]  # fmt: skip
    assert not bare, 'values without a source: put "# <source>" or "# assumed" behind each'
    configuration = reader.load([path], complete=False)
    model = WheelSoilModel(configuration.soil, configuration.effects)
    answer = model.steady_state(points([0.0, 0.3, 0.6], 40.0, WHEEL, slip_radius='shear'))
    assert (answer.sinkage > -0.004).all() and (answer.sinkage < WHEEL.radius).all()
    assert answer.torque[2] > answer.torque[0]
