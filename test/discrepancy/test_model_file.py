# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The written model is the fitted one, whatever the verdict; a second pass goes on from it."""

from dataclasses import replace

import numpy as np
import pytest
from test_workflow import FEW, make, noisy, run

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy import workflow
from wheel_terra_estimator.discrepancy.report.model_file import (
    _sensor_keys,
    corrected,
    write_model,
)
from wheel_terra_estimator.discrepancy.result import Proposal
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.workflow import Options, diagnose
from wheel_terra_lab.trials.forms import FORMS
from wheel_terra_lab.trials.hidden import LISTED, SmoothError
from wheel_terra_lab.trials.truth import solve

QUANTITIES = ('sinkage', 'drawbar_pull', 'torque')


def predicted(table, configuration, tmp_path, *files):
    """Return the (N, 3) values that ``predict --points`` gives for the rows of a table."""
    points, out = tmp_path / 'points.csv', tmp_path / 'out.csv'
    inputs = [name for name in table if name not in QUANTITIES and not name.endswith('_std')]
    rows = np.column_stack([table[name] for name in inputs])
    np.savetxt(points, rows, '%.17g', ',', header=','.join(inputs), comments='')
    configuration.write(tmp_path / 'base.yaml')
    configs = [part for file in ('base.yaml', *files) for part in ('--config', tmp_path / file)]
    arguments = ['predict', *configs, '--points', points, '-o', out, '--overwrite']
    assert main([str(part) for part in arguments]) == 0
    found = np.genfromtxt(out, delimiter=',', names=True)
    return np.column_stack([found[name] for name in QUANTITIES])


def assert_errors(rows, table, gaps, which='fitted', near=2e-3):
    """The errors of what ``predict`` gives are those that the diagnosis states."""
    for q, quantity in enumerate(QUANTITIES):
        error = np.sqrt(np.nanmean((rows[:, q] - table[quantity]) ** 2))
        assert error == pytest.approx(getattr(gaps[quantity], which), rel=near)


def written(table, values, folder, **options):
    """Return the diagnosis of a table; its model file gives the errors that it states."""
    found = run(table, values, **options)
    write_model(found, folder / 'model.yaml')
    rows = predicted(table, found.configuration, folder, 'model.yaml')
    assert_errors(rows, table, found.gap)
    return found


@pytest.mark.parametrize(
    ('hidden', 'known', 'design'),
    [
        (('slip_sinkage_exponent', 'drivetrain_friction'), True, 'sweep40'),
        (('slip_sinkage_exponent',), False, 'lugs48'),
    ],
)
def test_predict_with_the_written_model_gives_the_reported_error(hidden, known, design, tmp_path):
    """An effect that was on, 15 % off, is refitted: the file must hold its new value.

    One that was not is named, and on in the file: nobody is told of it a second time. A friction
    of a wheel that turns one way is no effect there but a zero of the torque reading.
    """
    table, values, soil, true_rows = make(design, hidden, 1.5)
    if known:
        values |= {
            'effects.slip_sinkage_exponent.enabled': True,
            'effects.slip_sinkage_exponent.n1': 1.0,
            'effects.slip_sinkage_exponent.n1_std': 0.5,
        }
    few = Options(effects=('slip_sinkage_exponent', 'drivetrain_friction', 'lug_digging'))
    found = written(table, values, tmp_path, options=few)
    for gap in found.gap.values():
        assert gap.fitted == pytest.approx(gap.after, rel=0.3)
    both = reader.load([tmp_path / 'base.yaml', tmp_path / 'model.yaml'], complete=False)
    assert both.effects_std['slip_sinkage_exponent']['n1'] > 0.0
    assert known or 'slip_sinkage_exponent' in both.provenance
    again = diagnose(check_table('t.csv', table), both, options=few)
    assert again.verdict == 'agrees'
    assert set(again.base_effects) == {'slip_sinkage_exponent'}
    friction = 1.5 * LISTED['drivetrain_friction'].typical(true_rows, soil)
    zero, std = both.sensors.torque_zero[0], both.sensors.torque_zero_std
    there = friction if 'drivetrain_friction' in hidden else 0.0
    assert zero == pytest.approx(there, abs=4.0 * std)


def test_an_effect_that_is_on_in_the_wrong_form_is_opened_again(tmp_path, unproposed):
    """Slip multiplies the sinkage (Lyasko); the engineer has an exponent that grows with slip."""
    _, values, soil, rows = make('basic16')
    law = FORMS['slip_sinkage_exponent:lyasko'].make(1.5, 0.5, rows, soil)
    exact = solve(rows, soil, (law,))
    table = noisy(rows, exact, exact, np.random.default_rng(9))
    prefix = 'effects.slip_sinkage_exponent'
    values |= {f'{prefix}.enabled': True, f'{prefix}.n1': 0.3}
    few = Options(effects=('slip_sinkage_exponent', 'bulldozing', 'cohesion'))
    found = written(table, values, tmp_path, options=few)
    assert [(e.name, e.form) for e in found.effects] == [('slip_sinkage_exponent', 'lyasko')]
    gain = found.effects[0].parameters['gain']
    assert abs(gain.value - 1.5) < 4.0 * gain.std
    assert 'the form named here takes its place' in found.notes[0]
    assert 'other forms, in its place, were tried' in found.not_tried['slip_sinkage_exponent']
    assert_errors(predicted(table, found.configuration, tmp_path), table, found.gap, 'before')


def test_an_effect_that_is_on_for_nothing_gets_no_other_name(unproposed):
    """Nothing is missing from these rows; the engineer believes that wheels stiffen the soil."""
    table, values, *_ = make('full56')
    values |= {'effects.multipass.enabled': True, 'effects.multipass.stiffening': 0.25}
    few = Options(effects=('hard_layer', 'rate_dependence', 'bulldozing', 'sinkage_offset'))
    found = run(table, values, options=few)
    assert (found.verdict, found.effects) == ('unexplained', ())
    assert 'multipass is on, and these rows fit better without it' in found.notes[0]


def test_the_written_soil_is_that_of_the_table_where_a_reference_has_another_bed(tmp_path):
    table, values, soil, rows = make('sweep40')
    softer = replace(
        soil,
        frictional_modulus=0.87 * soil.frictional_modulus,
        cohesive_modulus=0.87 * soil.cohesive_modulus,
        friction_angle=np.arctan(0.96 * np.tan(soil.friction_angle)),
    )
    again = noisy(rows, solve(rows, soil), solve(rows, softer), np.random.default_rng(3))
    both = {'reference': check_table('a.csv', table), 'options': FEW}
    found = written(again, values, tmp_path, **both)
    assert (found.verdict, found.effects) == ('agrees', ())
    assert any('0.87' in note and 'of that of the reference' in note for note in found.notes)
    assert any('beds differ so' in note for note in found.notes)
    assert 'reference again on a fresh bed' in found.next_measurement[0].what
    stiffness, friction = found.bed
    assert stiffness.after / stiffness.before == pytest.approx(0.87, abs=0.02)
    assert friction.after / friction.before == pytest.approx(0.96, abs=0.01)
    # The table alone tells its bed about as well as both tables do.
    alone = run(again, values, options=FEW).soil[0]
    assert stiffness.after_std == pytest.approx(alone.after_std, rel=0.5)
    assert 'the soil is that of the bed of these rows' in corrected(found)[0].provenance
    assert not any('is in no file' in note for note in found.notes)
    law = {'words': 'a law', 'targets': ('friction',), 'features': ('slip',)}
    law |= {'coefficients': (0.1,), 'coefficients_std': (0.1,), 'resembles': (), 'not_trusted': ()}
    proposal = Proposal(**law, gap={}, left_out={}, soil=found.soil, bed=found.bed)
    assert corrected(found, proposal)[0].soil == corrected(found)[0].soil


def test_the_error_that_a_reference_shares_is_not_in_the_errors_of_the_written_model(tmp_path):
    _, values, soil, rows = make('sweep40')
    rng = np.random.default_rng(8)
    clean = solve(rows, soil)
    both = solve(rows, soil, (SmoothError(0.08, rows, clean, rng),))
    reference, table = (noisy(rows, clean, both, rng) for _ in range(2))
    few = Options(effects=('bulldozing', 'cohesion'))
    given = {'reference': check_table('a.csv', reference), 'options': few}
    found = written(table, values, tmp_path, **given)
    assert max(gap.fitted / gap.after for gap in found.gap.values()) > 2.0
    assert sum('is in no file: model.yaml alone errs' in note for note in found.notes) == 1


OF_SENSORS = 'torque_gain', 'sinkage_gain', 'sinkage_offset', 'drivetrain_friction'
SENSORS = Options(effects=(*OF_SENSORS, 'slip_sinkage_exponent', 'cohesion'))


def with_errors(table, factors, zeros):
    """Return the table as sensors of this gain and zero read it."""
    read = {key: table[key] * factors.get(key, 1.0) + zeros.get(key, 0.0) for key in QUANTITIES}
    return {**table, **read}


def test_stated_errors_are_those_at_the_slips_that_were_read(tmp_path):
    """Where slips are uncertain the fit moves along curves that a tangent does not follow."""
    table, values, _, _ = make('sweep40', ('slip_sinkage_exponent',), 1.5)
    count = len(table['slip'])
    wrong = 0.015 * np.random.default_rng(5).standard_normal(count)
    table |= {'slip': np.clip(table['slip'] + wrong, 0.0, 0.9), 'slip_std': np.full(count, 0.015)}
    few = Options(effects=('slip_sinkage_exponent', 'lug_digging'))
    found = written(table, values, tmp_path, options=few)
    assert found.outliers == ()
    assert_errors(predicted(table, found.configuration, tmp_path), table, found.gap, 'before')


@pytest.mark.parametrize(
    ('factors', 'zeros', 'keys'),
    [
        pytest.param({'sinkage': 0.7}, {}, {'sinkage_gain': 0.7}, marks=pytest.mark.slow),
        pytest.param({}, {'sinkage': 0.004}, {'sinkage_zero': 0.004}, marks=pytest.mark.slow),
        pytest.param({}, {'torque': 0.6}, {'torque_zero': 0.6}, marks=pytest.mark.slow),
        pytest.param(
            {'torque': 1.3},
            {'sinkage': -0.003},
            {'torque_gain': 1.3, 'sinkage_zero': -0.003},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_errors_of_readings_are_written_once_where_the_node_takes_them_off(
    factors, zeros, keys, tmp_path
):
    table, values, *_ = make('full56', seed=7)
    table = with_errors(table, factors, zeros)
    # One of two wheels states errors already: what is found comes on top.
    before = {'sensors.torque_gain': [1.0], 'sensors.sinkage_zero': [0.0]}
    found = written(table, {**values, **before}, tmp_path, options=SENSORS)
    model = reader.load([tmp_path / 'model.yaml'], complete=False)
    for key, value in keys.items():
        std = {'torque_gain': 0.06, 'sinkage_gain': 0.06, 'torque_zero': 0.15, 'sinkage_zero': 1e-3}
        assert getattr(model.sensors, key)[0] == pytest.approx(value, abs=std[key])
    assert not set(model.effects) & set(OF_SENSORS)
    again = reader.load([tmp_path / 'base.yaml', tmp_path / 'model.yaml'], complete=False)
    second = diagnose(check_table('t.csv', table), again, options=SENSORS)
    assert second.verdict == 'agrees'
    for quantity in QUANTITIES:
        assert second.gap[quantity].before == pytest.approx(found.gap[quantity].fitted, rel=2e-3)


def test_an_error_of_a_reading_that_was_an_effect_moves_to_the_sensors(tmp_path):
    """Stated errors of the sensors and an effect on top: the written keys hold both, once."""
    table, values, *_ = make('full56', seed=7)
    table = with_errors(table, {'torque': 1.1 * 1.2}, {'torque': 0.3})
    values |= {
        'sensors.torque_gain': [1.1],
        'sensors.torque_zero': [0.3],
        'effects.torque_gain.enabled': True,
        'effects.torque_gain.gain': 0.15,
        'effects.torque_gain.gain_std': 0.1,
    }
    written(table, values, tmp_path, options=SENSORS)
    both = reader.load([tmp_path / 'base.yaml', tmp_path / 'model.yaml'], complete=False)
    assert 'torque_gain' not in both.effects
    assert both.sensors.torque_gain[0] == pytest.approx(1.1 * 1.2, rel=0.05)


@pytest.mark.parametrize('turning', [1.0, -1.0, 0.0])
def test_a_reading_is_the_same_by_effects_and_by_errors_of_the_sensors(turning):
    """The motor gives T and the friction; the effect's gain, then the sensor's, read both."""
    prefix = 'effects.drivetrain_friction'
    values = {
        'sensors.torque_gain': [1.2],
        'sensors.torque_zero': [0.1],
        'effects.torque_gain.enabled': True,
        'effects.torque_gain.gain': 0.25,
        f'{prefix}.enabled': True,
        f'{prefix}.torque': 0.4,
        f'{prefix}.torque_std': 0.2,
    }
    keys, moved = _sensor_keys(reader.from_parameters(values, complete=False), turning)
    (gain,) = keys['sensors.torque_gain']
    (zero,) = keys.get('sensors.torque_zero', [0.1])
    friction = 0.4 if turning else 0.0  # of rows that turn both ways it stays an effect
    assert ('drivetrain_friction' in moved) == bool(turning)
    for torque in (-3.0, 2.0):
        read = 1.2 * 1.25 * (torque + friction * turning) + 0.1
        assert gain * torque + zero == pytest.approx(read)
    std = keys.get('sensors.torque_zero_std', 0.0)  # as the zero that it belongs to
    assert std == pytest.approx(1.2 * 1.25 * 0.2 if turning else 0.0)


@pytest.mark.slow
def test_a_friction_of_rows_that_turn_both_ways_stays_a_friction():
    table, values, *_ = make('full56', ('drivetrain_friction',), 2.0)
    back = np.arange(len(table['slip'])) % 2 == 1
    sign = np.where(back, -1.0, 1.0)
    for key in ('angular_velocity', 'drawbar_pull', 'torque'):
        table[key] = sign * table[key]
    model, _ = corrected(run(table, values))
    assert model.effects['drivetrain_friction']['torque'] > 0.0
    assert not model.sensors.torque_zero.any()


def test_a_friction_of_rows_that_turn_backwards_is_a_zero_below_0():
    """The drive adds to the size of a torque, and a zero is added with its sign."""
    table, values, *_ = make('basic16', ('drivetrain_friction',), 2.0)
    for key in ('angular_velocity', 'drawbar_pull', 'torque'):
        table[key] = -table[key]
    found = run(table, values, options=Options(effects=('drivetrain_friction', 'bulldozing')))
    size = found.effects[0].parameters['torque'].value
    model, _ = corrected(found)
    assert 'drivetrain_friction' not in model.effects and size > 0.0
    assert model.sensors.torque_zero.tolist() == pytest.approx([-size])


def test_curves_of_uncertain_slips_stand_where_the_slip_was_read(tmp_path, monkeypatch):
    """The fit stands at more probable slips, which are nearer to the truth than those read."""
    table, values, *_ = make('sweep40')
    true, rng = table['slip'], np.random.default_rng(3)
    read = np.clip(true + 0.03 * rng.standard_normal(true.size), -0.9, 0.9)
    search, kept = workflow.search, []
    monkeypatch.setattr(workflow, 'search', lambda *given: kept.append(search(*given)) or kept[0])
    uncertain = {**table, 'slip': read, 'slip_std': np.full(true.size, 0.03)}
    few = Options(effects=('bulldozing', 'cohesion'))
    found = run(uncertain, values, options=few)
    assert found.verdict == 'agrees'
    np.testing.assert_allclose(found.curves.refit, found.curves.after)
    probable = kept[0].setting.forward.points.slip
    assert np.std(probable - true) < 0.8 * np.std(read - true)
    write_model(found, tmp_path / 'model.yaml')
    there, here = (
        predicted({**table, 'slip': slip}, found.configuration, tmp_path, 'model.yaml')
        for slip in (read, probable)
    )
    for q in range(1, len(QUANTITIES)):  # pull and torque, which bend little over an error
        moved = np.std(here[:, q] - there[:, q])
        assert np.std(found.curves.after[:, q] - there[:, q]) < 0.5 * moved
