# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A user's own effect, registered from a file, takes part like the built-in ones."""

import json
from pathlib import Path

import numpy as np
import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.terramechanics import effects
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.campaigns import Plan, make_campaign

EXAMPLE = Path(__file__).parents[2] / 'docs' / 'discrepancy' / 'examples' / 'side_drag.py'

FEW = [
    f'--only={name}' for name in ('bulldozing', 'drivetrain_friction', 'pull_zero', 'pitch_bias')
]


@pytest.fixture(autouse=True)
def _clean_catalogue(monkeypatch):
    monkeypatch.setattr(effects, '_registered', dict(effects._registered))


def rubbing_table(folder):
    """A table with side drag in it, made without the package."""
    for seed in range(50):
        campaign = make_campaign(seed, 'sweep40', Plan(hide='outside', names=('side_drag',)))
        if 20 < campaign.distances[0] < 60:
            campaign.write_csv(folder / 'rig.csv')
            rig = reader.from_parameters(campaign.settings(), complete=False)
            rig.write(folder / 'rig.yaml')
            return campaign
    raise AssertionError('no campaign of this size')


def diagnose(folder, name, *more):
    arguments = ['diagnose', str(folder / 'rig.csv'), '--config', str(folder / 'rig.yaml')]
    assert main([*arguments, '-o', str(folder / name), '--no-pictures', *FEW, *more]) == 0
    return json.loads((folder / name / 'report.json').read_text())


def test_it_is_named_with_its_size_and_the_model_file_works(tmp_path, unproposed):
    campaign = rubbing_table(tmp_path)
    without = diagnose(tmp_path, 'without')
    report = diagnose(tmp_path, 'with', '--effects', str(EXAMPLE), '--only=side_drag')
    best, mine = (max(c['log_evidence'] for c in r['candidates']) for r in (without, report))
    assert mine > best + 5
    assert report['verdict'] == 'named'
    assert report['effects'][0]['name'] == 'side_drag'
    gain = report['effects'][0]['parameters']['gain']
    assert gain['value'] == pytest.approx(campaign.sizes[0], rel=0.35)
    for quantity in ('drawbar_pull', 'torque'):
        gap = report['gap'][quantity]
        assert gap['after'] <= gap['refit'] * 1.05
    # The corrected model is a configuration like any other, also where nobody knows the effect.
    effects._registered.clear()
    files = [tmp_path / 'rig.yaml', tmp_path / 'with' / 'model.yaml']
    model = reader.load(files, complete=False, allow_effect_files=True)
    assert model.effects['side_drag']['gain'] == pytest.approx(gain['value'], rel=1e-6)


def test_the_term_is_the_formula_in_its_symbol():
    """The example's own arithmetic, against a plain evaluation."""
    effects.load_file(EXAMPLE)
    soil = reader.from_parameters({}, complete=False).soil
    points = OperatingPoints(
        slip=np.array([0.1, 0.5]), normal_load=80.0, wheel=Wheel(radius=0.157, width=0.165)
    )
    plain = WheelSoilModel(soil, {}).steady_state(points)
    rubbing = WheelSoilModel(soil, {'side_drag': {'gain': 10.0}}).steady_state(points)
    z = plain.sinkage
    drag = 10 * soil.density * 9.80665 * np.tan(soil.friction_angle) * z**2 * np.sqrt(2 * 0.157 * z)
    assert plain.drawbar_pull - rubbing.drawbar_pull == pytest.approx(drag, rel=1e-6)
    assert rubbing.torque - plain.torque == pytest.approx(0.157 * drag, rel=1e-6)
    assert rubbing.sinkage == pytest.approx(plain.sinkage, rel=1e-9)
