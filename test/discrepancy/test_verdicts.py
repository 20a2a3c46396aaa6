# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""No agreement beside a misfit, no competitor that is none, no effect passed over in silence."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_workflow import FEW, make, noisy, run

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy import decision, workflow
from wheel_terra_estimator.discrepancy.assessment import held_out
from wheel_terra_estimator.discrepancy.report import words
from wheel_terra_estimator.discrepancy.selection import readings
from wheel_terra_estimator.discrepancy.selection.readings import Columns, units_apart
from wheel_terra_estimator.discrepancy.tables.averaging import together
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.discrepancy.tables.steady_table import concatenated, operating_points
from wheel_terra_estimator.discrepancy.workflow import Options, diagnose
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_lab.studies.campaigns.scoring import diagnose as diagnose_campaign
from wheel_terra_lab.trials.campaign import Plan, make_campaign
from wheel_terra_lab.trials.forms import FORMS
from wheel_terra_lab.trials.truth import OUTPUTS, solve

TWO = Options(effects=('bulldozing', 'cohesion'))
"""Where what is found is no effect: a sixth of the time of all."""


@pytest.fixture
def few_known(monkeypatch):
    """All effects, where other readings of the columns compete with all, are no more than these."""
    few = {'bulldozing', 'drivetrain_friction', 'lug_shear_radius', 'torque_gain'}
    to_try = workflow._effects_to_try

    def fewer(*given):
        effects, not_tried = to_try(*given)
        return {name: one for name, one in effects.items() if name in few}, not_tried

    monkeypatch.setattr(workflow, '_effects_to_try', fewer)


def with_effect(design, seed, name, **parameters):
    """Return a table to which the catalogue's own effect was added, and the settings."""
    table, values, soil, _ = make(design, seed=seed)
    configuration = reader.from_parameters(values, complete=False)
    points = operating_points(check_table('t.csv', table).columns, configuration, 't')
    true_soil = reader.from_parameters(
        {
            f'soil.{key}': getattr(soil, key)
            for key in ('frictional_modulus', 'cohesive_modulus', 'sinkage_exponent', 'cohesion')
        },
        complete=False,
    ).soil
    plain = WheelSoilModel(true_soil, {}).steady_state(points)
    changed = WheelSoilModel(true_soil, {name: parameters}).steady_state(points)
    for key in ('sinkage', 'drawbar_pull', 'torque'):
        table[key] = table[key] + getattr(changed, key) - getattr(plain, key)
    return table, values


@pytest.mark.parametrize(
    'effects', [('grouser_thrust', *FEW.effects), pytest.param(None, marks=pytest.mark.slow)]
)
def test_thrust_of_grousers_at_its_usual_share_is_named(effects):
    table, values = with_effect('lugs48', 6, 'grouser_thrust')
    found = run(table, values, options=Options(effects))
    assert [effect.name for effect in found.effects] == ['grouser_thrust']
    competitors = found.effects[0].confounded_with
    by_name = {candidate.names: candidate for candidate in found.candidates}
    for competitor in competitors:
        # What is no better than the soil alone is no competitor.
        assert by_name[(competitor,)].log_evidence > 1.0


def test_every_effect_is_named_tried_or_said_not_to_be(unproposed):
    table, values, *_ = make('basic16')
    values |= {'effects.lug_shear_radius.enabled': True}
    found = run(table, values, options=TWO)
    assert set(found.not_tried) == set(catalogue()) - {'cohesion', 'bulldozing'}
    assert 'on' in found.not_tried['lug_shear_radius']
    found = run(table, values)
    assert 'lug_shear_radius' in found.not_tried['grouser_thrust']
    said = set(found.not_tried) | set(found.not_visible) | set(found.smallest_visible)
    assert set(catalogue()) <= said


@pytest.mark.parametrize(
    ('seed', 'allowed', 'off'), [(5, 0.02, ('torque',)), (4, 0.0, ('torque',)), (4, 0.02, ())]
)
def test_a_channel_that_is_off_on_unseen_rows_does_not_agree(unproposed, seed, allowed, off):
    """A floor of 4 % takes the misfit in; no effect accounts for it."""
    table, values, *_ = make('basic16', structure=0.05, seed=seed)
    found = run(table, values, options=Options(TWO.effects, allowed_error=allowed))
    assert tuple(name for name, gap in found.gap.items() if gap.after > gap.limit) == off
    assert found.verdict == ('undecided' if off else 'agrees')
    said = re.findall(r'(\w+) is off by [\d.]+ N m on unseen rows', found.sentence)
    assert tuple(said) == off


def on_patches(table, soil, rows, patch, shares):
    """Return the table with rows of each patch on soil of a share of the stiffness."""
    plain, table = solve(rows, soil), dict(table)
    for one, share in zip(np.unique(patch), shares, strict=True):
        change = solve(rows, replace(soil, frictional_modulus=share * soil.frictional_modulus))
        for key in OUTPUTS:
            table[key] = table[key] + np.where(patch == one, change[key] - plain[key], 0.0)
    return table


def on_five_beds():
    """Return a table of which each load rolls on a bed of its own, and the settings."""
    table, values, soil, rows = make('sweep40')
    shares = 0.8, 1.1, 1.25, 0.9, 1.05
    return on_patches(table, soil, rows, rows['normal_load'], shares), values


def test_beds_that_differ_are_said_beside_an_effect_that_is_on_for_nothing():
    """The law that would be proposed for what beds do is none."""
    table, values = on_five_beds()
    values |= {'effects.slip_sinkage_exponent.enabled': True}
    found = run(table, values, options=Options(('cohesion', 'drivetrain_friction')))
    assert (found.verdict, found.effects, found.proposal) == ('unexplained', (), None)
    assert 'slip_sinkage_exponent is on, and these rows fit better without it' in found.notes[0]
    assert any('beds differ from sweep to sweep' in note for note in found.notes)
    assert 'fresh bed' in found.next_measurement[0].what


@pytest.mark.parametrize('options', [FEW, pytest.param(None, marks=pytest.mark.slow)])
def test_beds_that_differ_from_sweep_to_sweep_are_no_effect(unproposed, options):
    table, values = on_five_beds()
    found = run(table, values, options=options)
    assert (found.verdict, found.effects) == ('agrees', ())
    assert 'fresh bed' in found.next_measurement[0].what
    assert any('beds differ' in note for note in found.notes)
    # Two trials at the same points: what another bed adds is no noise.
    first, values, soil, rows = make('basic16', stds=False, seed=5)
    stiff = solve(rows, replace(soil, frictional_modulus=1.25 * soil.frictional_modulus))
    second = noisy(rows, solve(rows, soil), stiff, np.random.default_rng(9))
    trials = {key: np.r_[column, second[key]] for key, column in first.items()}
    found = run({**trials, 'trial': np.repeat([1.0, 2.0], 16)}, values, options=options)
    assert found.verdict == 'agrees'
    assert found.noise.std[0, 0] == pytest.approx(second['sinkage_std'][0], rel=0.4)
    repeated = SimpleNamespace(columns={'trial': rows['slip']}, varying=lambda: ('normal_load',))
    beds = SimpleNamespace(beds_differ=0.5, ground='sweep')
    _, (again,) = words.own_beds(beds, repeated)
    assert again.what.startswith('the sweeps of least and greatest normal load again')
    trials_alone = SimpleNamespace(columns={'trial': rows['slip']}, varying=lambda: ('slip',))
    (said,), (again,) = words.own_beds(beds, trials_alone)
    assert again.what == 'the sweep again on three more fresh beds'
    assert said.startswith('that the beds differ')


BY_SLIP = Options(effects=('slip_sinkage_exponent', 'stress_peak_shift'))


def rising(hidden=(), drift=0.0):
    """Return rows that were taken at rising slips, on soil that softens from row to row."""
    table, values, soil, rows = make('sweep40', hidden)
    order = np.argsort(rows['slip'], kind='stable')
    place = np.argsort(order)
    table = on_patches(table, soil, rows, place, np.exp(-drift * np.linspace(-0.5, 0.5, 40)))
    return {key: column[order] for key, column in table.items()}, values


def test_soil_that_drifts_while_slip_rises_is_no_effect_of_slip(unproposed):
    table, values = rising(drift=0.5)
    found = run(table, values, options=BY_SLIP)
    assert (found.verdict, found.effects) == ('agrees', ())
    assert 'only if the soil drifts from row to row' in found.sentence
    assert any('differ from the first row to the last' in note for note in found.notes)
    assert found.next_measurement[0].what == 'the first rows again, after the last'
    # Taken in this order, whatever the order in the file; and no drift in that of the file.
    mixed = np.random.default_rng(3).permutation(40)
    again = {key: column[mixed] for key, column in {**table, 'row_order': np.arange(40.0)}.items()}
    assert run(again, values, options=BY_SLIP).verdict == 'agrees'
    del again['row_order']
    assert run(again, values, options=BY_SLIP).verdict == 'unexplained'


def test_soil_that_drifts_beside_a_reference_is_no_effect():
    (table, values), (reference, _) = rising(drift=0.5), rising()
    found = run(table, values, options=BY_SLIP, reference=check_table('a.csv', reference))
    assert (found.verdict, found.effects) == ('agrees', ())
    assert found.sentence.startswith('Rows and reference agree only if the soil drifts')


def test_an_effect_of_slip_is_told_from_a_drift_while_slip_rises():
    table, values = rising(('slip_sinkage_exponent',))
    (named,) = run(table, values, options=BY_SLIP).effects
    backwards = {key: column[::-1] for key, column in table.items()}
    mixed = {**backwards, 'row_order': np.random.default_rng(3).permutation(40)}
    (unordered,) = run(mixed, values, options=BY_SLIP).effects
    assert named.name == unordered.name == 'slip_sinkage_exponent'
    assert named.confidence == pytest.approx(unordered.confidence, abs=0.01)


def test_a_drift_is_no_more_frequent_than_an_effect():
    """At the odds of beds it would be told beside this weak one."""
    table, values, _, rows = make('basic16', ('stress_peak_shift',), 0.3)
    order = np.argsort(rows['slip'], kind='stable')
    found = run({key: column[order] for key, column in table.items()}, values, options=BY_SLIP)
    assert [effect.name for effect in found.effects] == ['stress_peak_shift']
    assert not any('first row to the last' in note for note in found.notes)


def test_beds_that_differ_give_no_name_that_the_rows_do_not_give_without_them():
    accounted_for = SimpleNamespace(left=SimpleNamespace(accounted_for=True))
    ours = SimpleNamespace(effects=(), verdict=accounted_for)
    beside = SimpleNamespace(effects=('soil_mound',), verdict=accounted_for)
    assert decision.Decision.unless(ours, beside, 0.9, 'drift') is ours


def test_soil_that_differs_from_day_to_day_is_no_effect(unproposed):
    table, values, soil, rows = make('sweep40')
    cohesive = soil.cohesion + 700.0
    wet = replace(soil, frictional_modulus=1.4 * soil.frictional_modulus, cohesion=cohesive)
    second = np.arange(40) % 2 == 1  # each sweep was taken on both days
    plain, change = solve(rows, soil), solve(rows, wet)
    for key in ('sinkage', 'drawbar_pull', 'torque'):
        table[key] = table[key] + np.where(second, change[key] - plain[key], 0.0)
    assert run(table, values, options=TWO).verdict != 'agrees'
    found = run({**table, 'date': 20573.3 + second}, values, options=TWO)
    assert (found.verdict, found.effects) == ('agrees', ())
    assert any('differ from day to day' in note for note in found.notes)
    assert found.next_measurement[0].what.endswith('all on one day')


def test_a_drive_whose_wheels_roll_on_different_patches_has_no_effect(unproposed):
    table, values, soil, rows = make('basic16')
    patch = np.random.default_rng(2).integers(0, 4, 16)
    table = on_patches(table, soil, rows, patch, (0.85, 1.1, 0.95, 1.2))
    drive = replace(check_table('t.csv', table), true_rows=np.ones(16, dtype=bool))
    found = diagnose(drive, reader.from_parameters(values, complete=False), options=TWO)
    assert (found.verdict, found.effects) == ('agrees', ())
    assert any('differ from row to row' in note for note in found.notes)


def test_a_name_that_shrinks_no_gap_is_not_given(monkeypatch, unproposed):
    table, values, *_ = make('lugs48', ('lug_support',), 1.5)
    few = Options(effects=('lug_support',))
    assert run(table, values, options=few).verdict == 'named'

    real = decision.gaps

    def none_shrinks(*arguments):
        return {name: replace(gap, after=gap.refit) for name, gap in real(*arguments).items()}

    monkeypatch.setattr(decision, 'gaps', none_shrinks)
    assert run(table, values, options=few).verdict == 'unexplained'


def test_a_bed_of_a_reference_may_be_far_and_have_trials():
    table, values, soil, rows = make('basic16')
    half = replace(soil, frictional_modulus=0.4 * soil.frictional_modulus)
    far = noisy(rows, solve(rows, soil), solve(rows, half), np.random.default_rng(3))
    loose = run(far, values, reference=check_table('a.csv', table), options=TWO)
    assert any('more than beds usually differ' in note for note in loose.notes)
    assert any(note.startswith('stiffness of the bed stands at') for note in loose.notes)
    assert not any('bed.' in note for note in loose.notes)
    again = noisy(rows, solve(rows, soil), solve(rows, soil), np.random.default_rng(3))
    each_counts_anew = {'trial': np.ones(16)}
    reference = check_table('a.csv', {**table, **each_counts_anew})
    same = run({**again, **each_counts_anew}, values, reference=reference, options=FEW)
    assert (same.verdict, same.effects) == ('agrees', ())


def test_rows_of_two_soils_in_turn_are_called_scattered_where_no_noise_is_stated():
    table, values, soil, rows = make('sweep40', stds=False)
    stiff = solve(rows, replace(soil, frictional_modulus=5.0 * soil.frictional_modulus))
    every_second = np.arange(40) % 2 == 1
    mixed = {k: np.where(every_second, stiff[k], v) if k in stiff else v for k, v in table.items()}
    found = run(mixed, values, options=FEW)
    assert found.verdict == 'agrees'
    assert re.search('too scattered.* [23]. % of the range of the sinkage', found.sentence)


def test_pulls_of_the_other_sign_are_refused_with_the_cure():
    table, values, *_ = make('lugs48')
    table['drawbar_pull'] = -table['drawbar_pull']
    with pytest.raises(UserError, match=r'drawbar_pull: .* multiply the column by -1'):
        run(table, values)


def test_an_uncertain_leaving_angle_counts_as_noise(unproposed):
    """Angles 2 degrees off: a finding where they are called exact, none where they are not."""
    table, values, *_ = make('lugs48')
    configuration = reader.from_parameters(values, complete=False)
    points = operating_points(check_table('t.csv', table).columns, configuration, 't')
    state = WheelSoilModel(configuration.soil, {}).steady_state(points)
    angle, rng = state.leaving_angle, np.random.default_rng(3)
    for key in ('sinkage', 'drawbar_pull', 'torque'):
        table[key] = getattr(state, key) + table[f'{key}_std'] * rng.standard_normal(len(angle))
    table['leaving_angle'] = np.minimum(angle + 0.03 * rng.standard_normal(len(angle)), 0.0)
    few = Options(effects=('soil_mound', 'stress_peak_shift'))
    exact = run(table, values, options=few)
    table['leaving_angle_std'] = np.full(len(angle), 0.03)
    honest = run(table, values, options=few)
    assert exact.gap_p_value < 1e-3 < honest.gap_p_value
    assert honest.verdict == 'agrees'
    assert honest.gap['torque'].noise > exact.gap['torque'].noise


def test_the_models_own_rows_without_noise_agree(tmp_path):
    """Beside next to no noise an evidence that cancels large numbers named a hard layer."""
    rig, path = ['hit_wh1_lug10', 'hit_lss1'], tmp_path / 'own.csv'
    told = [f'--config={name}' for name in rig]
    sweep = ['--slip', '0.05:0.6:8', '--load', '35,70,105', '-o', str(path)]
    assert main(['predict', *told, *sweep]) == 0
    found = diagnose(read_table(path), reader.load(rig, complete=False))
    assert (found.verdict, found.effects) == ('agrees', ())


def test_two_tables_with_other_lugs_share_one_soil_and_tell_more():
    """What one lug height cannot tell, two tables can: what both share is one soil."""
    table, values, *_ = make('lugs48', ('lug_support',), 1.5)
    bare = table['lug_height'] == 0.0
    parts = [
        check_table(name, {key: column[rows] for key, column in table.items()})
        for name, rows in (('bare.csv', bare), ('lugs.csv', ~bare))
    ]
    configuration = reader.from_parameters(values, complete=False)
    both = together(parts)
    assert len(both) == len(table['slip'])
    few = Options(effects=('lug_support', 'sinkage_offset', 'cohesion'))
    found = diagnose(both, configuration, options=few)
    whole = run(table, values, options=few)
    assert [e.name for e in found.effects] == [e.name for e in whole.effects] == ['lug_support']
    assert found.gap['sinkage'].after == pytest.approx(whole.gap['sinkage'].after, rel=0.05)
    assert any('2 tables share one soil' in note for note in found.notes)
    assert together(parts[:1]) is parts[0]
    copied = together([*parts, parts[0]])
    assert len(copied) == len(both) and any('add nothing' in note for note in copied.notes)


def test_a_name_leaves_room_for_an_effect_that_looks_like_it_and_was_not_tried():
    table, values, *_ = make('slope48', ('pitch_bias',), 3.0)
    few = ('pitch_bias', 'slope_gravity', 'pull_zero', 'bulldozing', 'drivetrain_friction')
    free = run(table, values, options=Options(effects=few))
    narrow = run(table, values, options=Options(effects=('pitch_bias',)))
    assert free.effects[0].name == narrow.effects[0].name == 'pitch_bias'
    assert narrow.effects[0].confidence <= 0.5
    assert 'bulldozing' in narrow.sentence and 'would look alike' in narrow.sentence
    assert 'would look alike' not in free.sentence


@pytest.mark.slow
def test_three_names_are_given_where_they_predict_levels_that_they_did_not_see(monkeypatch):
    few = ('lug_digging', 'drivetrain_friction', 'bulldozing')
    table, values, *_ = make('lugs48', few, 3.0)
    options = Options(effects=few)
    found = run(table, values, options=options).effects
    assert {e.name for e in found} == set(few) and max(e.confidence for e in found) < 0.76
    monkeypatch.setattr(held_out, 'TOO_FAR', 0.5)
    assert len(run(table, values, options=options).effects) < 3


@pytest.mark.slow
def test_a_patchwork_of_doubtful_names_is_not_given(monkeypatch):
    """Digging that may not be named: the pair that patches it is less likely right than not."""
    monkeypatch.delitem(FORMS, 'shear_deformation:slip')  # the lot of seed 1070 lacks it
    campaign = make_campaign(1070, 'basic16', Plan(noise='mixed', missing=0.03, forms=True))
    assert campaign.hidden == ('lug_digging',)
    found = diagnose_campaign(campaign, campaign.hidden)
    assert found.verdict == 'unexplained'
    assert not found.effects
    assert found.nearest
    monkeypatch.setattr(decision, '_LIKELY', 0.0)
    monkeypatch.setattr(decision, '_BEYOND_DOUBT', 0.0)
    patched = diagnose_campaign(campaign, campaign.hidden)
    assert len(patched.effects) > 1
    assert min(effect.confidence_of_set for effect in patched.effects) < 0.5


LBF, KGF = 4.4482216, 9.80665
KNOWN_NOISE = (
    # Few effects may be named: powers of ten are asked for alone.
    ({'sinkage': 10.0}, 'mm in place of cm', TWO),
    ({'torque': 0.1}, 'kgf m in place of N m', TWO),
    ({'drawbar_pull': 1.0 / KGF}, 'kgf in place of N', None),
    ({'normal_load': 2.0}, 'of one wheel or of a pair?', None),
)
UNKNOWN_NOISE = (
    ({'sinkage': 10.0, 'torque': 0.1}, 'and the unit of', TWO),
    ({'drawbar_pull': 1.0 / KGF, 'torque': 1.0 / KGF}, 'and the unit of', None),
    # Without a column of the pull
    ({'normal_load': 1.0 / KGF, 'torque': 1.0 / KGF}, 'and the unit of', None),
    (
        {'normal_load': 1.0 / KGF, 'drawbar_pull': 1.0 / KGF, 'torque': 1.0 / KGF},
        'and the unit of',
        None,
    ),
    ({'normal_load': 1.0 / LBF}, 'lbf in place of N', None),
)


@pytest.mark.parametrize(
    ('stds', 'factors', 'said', 'options'),
    [(True, *case) for case in KNOWN_NOISE] + [(False, *case) for case in UNKNOWN_NOISE],
)
def test_a_wrong_unit_is_said_before_any_effect(few_known, stds, factors, said, options):
    table, values, *_ = make('basic16', stds=stds)
    if {'normal_load', 'torque'} == set(factors):
        del table['drawbar_pull']
    elif said == 'lbf in place of N':  # the soil is not known either
        values['soil.frictional_modulus'] *= 3.0
        assert 'normal_load' not in run(table, values).misread
    for column, factor in factors.items():
        for name in {column, f'{column}_std'} & table.keys():
            table[name] = factor * table[name]
    found = run(table, values, options=options)
    assert (found.verdict, found.effects, found.proposal) == ('unexplained', (), None)
    assert found.misread == {column: pytest.approx(1.0 / f) for column, f in factors.items()}
    assert said in found.sentence and 'looks wrong' in found.sentence


def test_a_wrong_unit_is_asked_for_beside_an_effect_as_well(few_known):
    table, values, *_ = make('sweep40', ('bulldozing',), 3.0)
    for name in ('torque', 'torque_std'):
        table[name] = table[name] / KGF
    found = run(table, values)
    assert (found.misread, found.effects) == ({'torque': pytest.approx(KGF)}, ())


@pytest.mark.parametrize(
    ('gain', 'unit'), [(0.73, 'lbf ft in place of N m'), (0.78, ''), (0.6, '')]
)
def test_a_gain_that_a_unit_explains_as_well_is_no_surer_than_that(
    unproposed, few_known, gain, unit
):
    table, values, *_ = make('sweep40')
    found = run({**table, 'torque': gain * table['torque']}, values)
    (effect,) = found.effects
    assert effect.name == 'torque_gain'
    assert effect.parameters['gain'].value == pytest.approx(gain - 1.0, abs=0.03)
    rare = gain < 0.7  # three deviations of 0.1
    assert (effect.confidence <= 0.5) == (bool(unit) or rare)
    assert ('so large a gain is rare' in found.sentence) == rare
    said = f'unless it is another unit of the column ({unit}), which would look alike'
    assert (said in found.sentence) == bool(unit)


def test_effects_compete_in_another_unit_only_where_the_soil_is_likelier_in_it(monkeypatch):
    """Half a decade off the size that a poorly known soil gives is no sign of another unit."""
    table, values, *_ = make('sweep40')
    values['soil.friction_angle_deg'] *= 0.45
    few = Options(('cohesion', 'drivetrain_friction'), soil_known_to=1.0)
    monkeypatch.setattr(readings, 'search', None)
    assert run(table, values, options=few).verdict == 'agrees'


def test_a_unit_is_alike_within_the_deviation_of_a_gain():
    assert not units_apart('torque', 1.41)
    assert units_apart('torque', 1.41, 0.03) == 'lbf ft in place of N m'
    assert not units_apart('torque', 1.6, 0.5)


@pytest.mark.parametrize(
    ('wrong', 'times', 'options'),
    [(('a.csv',), 10.0, TWO), (('b.csv',), 10.0, TWO), (('a.csv', 'b.csv'), 9.80665, Options())],
)
def test_a_unit_of_one_or_both_of_two_tables_is_asked_for(few_known, wrong, times, options):
    table, values, soil, rows = make('basic16')
    again = noisy(rows, solve(rows, soil), solve(rows, soil), np.random.default_rng(3))
    tables = {'a.csv': table, 'b.csv': again}
    tables |= {name: {**tables[name], 'torque': tables[name]['torque'] / times} for name in wrong}
    reference, table = (check_table(name, rows) for name, rows in tables.items())
    configuration = reader.from_parameters(values, complete=False)
    found = diagnose(table, configuration, reference, options)
    assert found.misread == {'torque': pytest.approx(times)}
    assert found.sentence.startswith(f'{" and ".join(wrong)}: The unit of torque looks wrong')
    assert not found.effects


def test_no_unit_is_asked_for_that_cannot_be_beside_the_one_of_the_title(tmp_path):
    """What is said to be in mm may be in cm, m, in or ft: metres for feet are impossible."""
    rows = ''.join(f'{0.1 * i},60,{3 + i}\n' for i in range(7))
    path = tmp_path / 'rows.csv'
    path.write_text(f'slip,normal_load,sinkage [mm]\n{rows}', encoding='utf-8')
    lacked = Columns(read_table(path), None, (), {}, None, None)._lacked()
    factors = [said['sinkage'] for said in lacked if 'sinkage' in said]
    assert sorted(factors) == pytest.approx([10.0, 25.4, 304.8, 1000.0])


def test_tables_that_are_read_as_one_keep_the_units_that_they_share():
    table, *_ = make('basic16')
    units = {'sinkage': 1e-3, 'torque': 1e-2}, {'sinkage': 1e-3, 'torque': 1.0, 'slope': 1.0}
    parts = [replace(check_table('t.csv', table), units=said) for said in units]
    assert concatenated('both', parts, ()).units == {'sinkage': 1e-3, 'slope': 1.0}


@pytest.mark.parametrize(
    ('rule', 'read', 'said'),
    [
        ('r w/v - 1', lambda s, _: np.where(s > 0.0, s / (1.0 - s), s), 'i/(1 + i)'),
        ('1 - v/(r w)', lambda s, _: np.where(s < 0.0, s / (1.0 + s), s), '-i/(1 + i)'),
        ('rim', lambda s, tip_over_rim: 1.0 - (1.0 - s) * tip_over_rim, 'slip_radius: rim'),
    ],
)
def test_a_slip_by_another_rule_is_asked_for_and_no_effect(few_known, rule, read, said):
    first, values, soil, rows = make('lugs48')
    slip = np.where(rows['slip'] > 0.5, 0.3 * (0.5 - rows['slip']) - 0.05, rows['slip'])
    rows = {**rows, 'slip': slip}
    out = solve(rows, soil)
    table = noisy(rows, solve(first, soil), out, np.random.default_rng(3))
    ratio = 1.0 + rows['lug_height'] / rows['wheel_radius']
    if rule == 'rim':  # nor of sound rows
        assert not run(table, values).misread
    found = run({**table, 'slip': read(slip, ratio)}, values)
    assert found.misread == {'slip': rule}
    assert found.verdict == 'unexplained' and not found.effects
    assert said in found.sentence


@pytest.mark.parametrize(
    ('design', 'error', 'name'),
    [('sweep40', 0.03, 'wheel_radius_bias'), ('basic16', -0.02, 'lug_shear_radius')],
)
def test_slips_that_are_all_off_alike_are_not_surely_a_biased_radius(design, error, name):
    table, values, *_ = make(design, seed=1)
    few = Options(effects=('wheel_radius_bias', 'lug_shear_radius', 'soil_adhesion'))
    found = run({**table, 'slip': table['slip'] + error}, values, options=few)
    (effect,) = found.effects
    assert 'wheel_radius_bias' in (effect.name, *effect.confounded_with) and effect.name == name
    assert effect.confidence <= 2.0 / 3.0
    assert 'the same error of all slips' in found.sentence
    assert any('hard floor' in item.what for item in found.next_measurement)


def test_a_bias_of_the_radius_as_high_as_the_lugs_asks_for_the_radius_of_the_slip():
    table, values, _, rows = make('sweep40')
    ratio = 1.0 + rows['lug_height'] / rows['wheel_radius']
    assert np.ptp(ratio) == 0.0
    few = Options(effects=('wheel_radius_bias', 'drivetrain_friction'))
    for times, asked in ((ratio, 1), (1.0 - 0.5 * (ratio - 1.0), 0)):
        read = {**table, 'slip': 1.0 - (1.0 - table['slip']) * times}
        found = run(read, values, options=few)
        assert found.effects[0].name == 'wheel_radius_bias'
        assert found.sentence.count('(slip_radius: rim), which would look alike') == asked
        assert found.effects[0].confidence <= 1.0 / (3.0 + asked)  # two effects are not tried
