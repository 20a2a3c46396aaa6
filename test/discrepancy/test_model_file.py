# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The written model is the fitted one, whatever the verdict; a second pass goes on from it."""

from __future__ import annotations

import csv

import campaign_tools  # noqa: F401
import numpy as np
import pytest
from test_workflow import make

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.report.model_file import write_model
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.workflow import diagnose

QUANTITIES = ('sinkage', 'drawbar_pull', 'torque')


def predicted(table, configuration, tmp_path, *files):
    """Return the (N, 3) values that ``predict --points`` gives for the rows of a table."""
    points, out = tmp_path / 'points.csv', tmp_path / 'out.csv'
    inputs = [name for name in table if name not in QUANTITIES and not name.endswith('_std')]
    with points.open('w', newline='') as stream:
        writer = csv.writer(stream)
        writer.writerow(inputs)
        writer.writerows(zip(*(table[name] for name in inputs), strict=True))
    configuration.write(tmp_path / 'base.yaml')
    configs = [part for file in ('base.yaml', *files) for part in ('--config', tmp_path / file)]
    arguments = ['predict', *configs, '--points', points, '-o', out, '--overwrite']
    assert main([str(part) for part in arguments]) == 0
    with out.open() as stream:
        rows = list(csv.DictReader(stream))
    return np.array([[float(row[name]) for name in QUANTITIES] for row in rows])


@pytest.mark.parametrize(
    ('hidden', 'design'),
    [
        (('slip_sinkage_exponent',), 'sweep40'),
        (('slip_sinkage_exponent', 'drivetrain_friction'), 'sweep40'),
        ((), 'lugs48'),
    ],
)
def test_predict_with_the_written_model_gives_the_reported_error(hidden, design, tmp_path):
    """An effect that was on, 15 % off, is refitted: the file must hold its new value."""
    table, values, *_ = make(design, hidden, 1.5)
    if hidden:
        values |= {
            'effects.slip_sinkage_exponent.enabled': True,
            'effects.slip_sinkage_exponent.n1': 1.0,
            'effects.slip_sinkage_exponent.n1_std': 0.5,
        }
    configuration = reader.from_parameters(values, complete=False)
    found = diagnose(check_table('t.csv', table), configuration)
    write_model(found, tmp_path / 'model.yaml')
    rows = predicted(table, configuration, tmp_path, 'model.yaml')
    for q, quantity in enumerate(QUANTITIES):
        error = np.sqrt(np.mean((rows[:, q] - table[quantity]) ** 2))
        assert error == pytest.approx(found.gap[quantity].fitted, rel=2e-3)
        assert error == pytest.approx(found.gap[quantity].after, rel=0.3)
    again = reader.load([tmp_path / 'base.yaml', tmp_path / 'model.yaml'], complete=False)
    assert diagnose(check_table('t.csv', table), again).verdict == 'agrees'
