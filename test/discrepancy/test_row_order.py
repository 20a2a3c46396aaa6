# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of the order of rows: read as they come, and residuals tested along them."""

import numpy as np
import pytest
from test_workflow import make, run

from wheel_terra_estimator.discrepancy.assessment import along as order
from wheel_terra_estimator.discrepancy.assessment.along import changes_along_rows
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.discrepancy.workflow import Options


def columns(count, seed=1):
    rng = np.random.default_rng(seed)
    return rng, {
        'slip': rng.permutation(np.linspace(0.05, 0.8, count)),
        'normal_load': np.where(np.arange(count) % 2, 40.0, 90.0),
        'drawbar_pull': rng.normal(20.0, 1.0, count),
        'row_order': np.arange(count, dtype=float),
    }


def changes(values):
    table = check_table('t.csv', values)
    predicted = np.full((len(table), 3), 20.0)
    return changes_along_rows(table, predicted, np.ones((len(table), 3)))


def test_noise_alone_does_not_change_along_the_rows():
    alarms = sum(bool(changes(columns(40, seed)[1])) for seed in range(60))
    assert alarms <= 3  # one in a hundred is what the chance allows


def test_a_reading_that_drifts_is_found_and_says_along_what():
    _, values = columns(40)
    values['drawbar_pull'] = values['drawbar_pull'] + np.linspace(-2.5, 2.5, 40)
    (change,) = changes(values)
    assert (change.column, change.quantity) == ('row_order', 'drawbar_pull')
    assert change.p_value < 0.01
    assert 'drawbar pull change along row order' in change.text
    # Two quantities, each tried twice along an order and once between groups: six chances.
    rng, _ = columns(40, 7)
    more = {'torque': rng.normal(20.0, 1.0, 40), 'trial': rng.permutation(np.arange(40.0) % 4)}
    (same,) = changes(values | more)
    assert same.p_value == pytest.approx(3.0 * change.p_value)


def test_a_drift_over_few_rows_is_found_where_its_neighbours_scatter():
    _, values = columns(18, 5)
    drift = np.linspace(-2.0, 2.0, 18)
    values['drawbar_pull'] = values['drawbar_pull'] - drift
    (change,) = changes(values)
    truth = np.corrcoef(values['drawbar_pull'], np.arange(18))[0, 1]
    assert change.drift and change.strength == pytest.approx(truth, abs=0.02)
    assert 'a drift' in change.text


def test_the_share_between_groups_is_that_of_an_analysis_of_variance():
    residuals, key = np.array([[0.0, 2.0, 3.0, 5.0]]) - 1.0, np.array([4.0, 4.0, 7.0, 7.0])
    assert order._between(residuals, key) == pytest.approx([1.0 - 4.0 / 13.0])


def test_an_order_that_is_that_of_the_slips_says_nothing():
    """A misfit of the model over slip would look the same."""
    _, values = columns(40)
    values['slip'] = np.sort(values['slip'])
    values['drawbar_pull'] = values['drawbar_pull'] + np.linspace(-2.5, 2.5, 40)
    assert changes(values) == []


def test_sweeps_up_and_down_that_differ_are_found():
    rng, values = columns(40)
    values['direction'] = rng.permutation(np.repeat([0.0, 1.0], 20))
    values['drawbar_pull'] = values['drawbar_pull'] + 2.5 * values['direction']
    assert 'direction' in {change.column for change in changes(values)}


def test_texts_and_dates_are_read(tmp_path):
    path = tmp_path / 't.csv'
    rows = [
        f'{0.1 * k:.1f},{60 + 30 * (k % 2)},{5 + 3 * k},'
        f'{"up" if k % 2 else "down"},2026-11-{20 + k},b{k % 3}'
        for k in range(1, 9)
    ]
    path.write_text('slip,normal_load,drawbar_pull,direction,date,trial\n' + '\n'.join(rows) + '\n')
    table = read_table(path)
    assert table.columns['direction'].tolist() == [0.0, 1.0] * 4
    assert np.diff(table.columns['date']) == pytest.approx(np.ones(7))
    assert len(np.unique(table.columns['trial'])) == 3


def test_a_diagnosis_says_along_which_column_its_residuals_change(unproposed):
    table, values, *_ = make('sweep40')
    rng = np.random.default_rng(3)
    order = rng.permutation(len(table['slip'])).astype(float)
    drift = 6.0 * table['torque_std'] * (order / order.max() - 0.5)
    drifting = table | {'row_order': order, 'torque': table['torque'] + drift}
    found = run(drifting, values, options=Options(effects=('cohesion',)))
    assert [(c.column, c.quantity) for c in found.along_rows] == [('row_order', 'torque')]
    assert any('change along row order' in note for note in found.notes)
    assert found.to_dict()['along_rows'][0]['column'] == 'row_order'
