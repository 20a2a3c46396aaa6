# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The loop: what a table taught the model makes the onboard estimates of another drive better."""

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.report.model_file import write_model
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.workflow import diagnose
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import SinkageReading
from wheel_terra_estimator.simulation import drive, scenario
from wheel_terra_lab.evaluation.runner import inputs_of_mode
from wheel_terra_lab.trials.hidden import LISTED
from wheel_terra_lab.trials.truth import OUTPUTS, TrueSoil, solve

FILES = ['generic_six_wheel', 'hit_lss1']
LUGS = 'wheels.lug_height:=[0.015, 0.015, 0.015, 0.015, 0.015, 0.015]'
N1 = 0.4  # of the slip-sinkage in both, which the model lacks
NOISE = {'sinkage': 0.8e-3, 'drawbar_pull': 3.0, 'torque': 0.3}


def rig_table(soil):
    """Steady rows of this wheel with the effect in them, from the campaigns' own quadrature."""
    slip, load = (
        axis.ravel()
        for axis in np.meshgrid(
            [0.03, 0.08, 0.15, 0.25, 0.36, 0.5, 0.65, 0.8], [150.0, 250.0, 350.0, 450.0]
        )
    )
    fixed = {
        'wheel_radius': 0.12,
        'wheel_width': 0.16,
        'lug_height': 0.015,
        'lug_count': 24.0,
        'gravity': 9.80665,
        'angular_velocity': 0.4,
        'pass_number': 1.0,
        'slope': 0.0,
    }
    rows = {key: np.full(slip.size, value) for key, value in fixed.items()}
    rows |= {'slip': slip, 'normal_load': load}
    true = TrueSoil(**{name: float(getattr(soil, name)) for name in TrueSoil.__dataclass_fields__})
    hidden = LISTED['slip_sinkage_exponent'].make(N1, 0.5, rows, true)
    out = solve(rows, true, (hidden,))
    rng = np.random.default_rng(0)
    for key in OUTPUTS:
        rows[key] = out[key] + NOISE[key] * rng.standard_normal(slip.size)
        rows[f'{key}_std'] = np.full(slip.size, NOISE[key])
    return check_table('rig.csv', rows)


def drive_uphill(seed):
    """Another drive, uphill, in soil with the same effect: the soil's numbers are off as well."""
    others = ('lug_digging', 'soil_mound', 'stress_peak_shift')
    off = [f'effects.{name}.enabled:=false' for name in (*others, 'multipass', 'bulldozing')]
    on = [
        'effects.slip_sinkage_exponent.enabled:=true',
        f'effects.slip_sinkage_exponent.n1:={N1}',
        'effects.lug_shear_radius.enabled:=true',
        'effects.lug_shear_radius.lam:=0.5',  # as the estimator assumes
    ]
    planned = scenario.load(
        {
            'configuration': FILES,
            'parameters': [LUGS],
            'truth': [*off, *on],
            'duration': 48.0,
            'drive.time': [0.0],
            'drive.forward': [0.06],
            'slope.position': [0.0, 0.5, 1.0, 1.6, 2.2],
            'slope.angle_deg': [0.0, 0.0, 7.0, 12.0, 14.0],
            'sensors.noise': 0.3,
        }
    )
    return drive.simulate(planned, seed=seed)


def errors(configuration, driven):
    """Squared errors of the estimates after the first ten seconds.

    The rover has no torque and no sinkage sensor: what it says of them rests on the model.
    """
    core = EstimatorCore(configuration)
    inputs = [
        m for m in inputs_of_mode(driven.arrivals, 'no_torque') if not isinstance(m, SinkageReading)
    ]
    sets = [item for measurement in inputs for item in core.add(measurement)]
    sets += core.flush()
    truth = driven.truth
    row = {int(stamp): i for i, stamp in enumerate(truth.stamp)}
    late = [s for s in sets if s.stamp in row and s.stamp > truth.stamp[0] + 10_000_000_000]
    assert len(late) > 350
    return {
        key: np.array([(getattr(s, key) - getattr(truth, key)[row[s.stamp]]) ** 2 for s in late])
        for key in ('sinkage', 'drawbar_pull')
    }


@pytest.fixture(scope='module')
def corrected(tmp_path_factory):
    """The base model, and what a rig's table made of it."""
    base = reader.load(FILES, [LUGS])
    diagnosis = diagnose(rig_table(base.soil), base)
    assert [effect.name for effect in diagnosis.effects] == ['slip_sinkage_exponent']
    path = tmp_path_factory.mktemp('loop') / 'model.yaml'
    write_model(diagnosis, path)
    found = reader.load([*FILES, path], [LUGS])
    assert found.effects['slip_sinkage_exponent']['n1'] == pytest.approx(N1, abs=0.05)
    return base, found


@pytest.mark.timeout(1800)
@pytest.mark.slow
@pytest.mark.parametrize('seeds', [(3,), range(4, 8)])
def test_a_drive_is_estimated_better_with_the_corrected_model(corrected, seeds):
    base, better = corrected
    drives = [drive_uphill(seed) for seed in seeds]
    before, after = (
        {
            key: float(np.sqrt(np.nanmean(np.concatenate([found[key] for found in squares]))))
            for key in ('sinkage', 'drawbar_pull')
        }
        for squares in ([errors(model, driven) for driven in drives] for model in (base, better))
    )
    print(f'{seeds}: {before} -> {after}')
    assert after['sinkage'] < 0.35 * before['sinkage'], (before, after)
    assert after['drawbar_pull'] < before['drawbar_pull'], (before, after)
