# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A law for what no listed effect explains: found, judged on rows left out, usable as a file."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from test_model_file import assert_errors, predicted
from test_workflow import FEW, make, run

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy import proposal as proposals
from wheel_terra_estimator.discrepancy.report.model_file import write_model
from wheel_terra_estimator.discrepancy.report.words import in_words
from wheel_terra_estimator.discrepancy.result import LeftOut, as_json
from wheel_terra_estimator.discrepancy.workflow import Options
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.conditioned import ConditionedForces, ConditionedInputs
from wheel_terra_estimator.terramechanics.effects import learned_closure
from wheel_terra_estimator.terramechanics.effects.learned_closure import (
    EFFECT,
    REFERENCE_SPEED,
    TARGETS,
    coefficients_of,
)
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.campaigns.scoring import diagnose as diagnose_campaign
from wheel_terra_lab.trials.campaign import Plan, make_campaign
from wheel_terra_lab.trials.truth import solve

QUANTITIES = ('sinkage', 'drawbar_pull', 'torque')
SHARE = 0.06  # of load times radius per decade of rim speed


def with_decades(factor):
    """A table with torque over load times radius, by its rows' factor per decade of rim speed."""
    table, values, *_ = make('full56')
    decades = np.log10(table['angular_velocity'] * table['wheel_radius'] / REFERENCE_SPEED)
    lever = table['normal_load'] * table['wheel_radius']
    table['torque'] = table['torque'] + factor(table) * lever * decades
    return table, values, run(table, values, options=FEW)


@pytest.fixture(scope='module')
def speedy():
    """Torque that grows with the logarithm of rim speed: in no entry of the catalogue."""
    return with_decades(lambda table: SHARE)


def test_the_law_is_found_and_said_in_words(speedy):
    _, _, found = speedy
    assert found.verdict in ('unexplained', 'undecided')
    assert not found.effects
    proposal = found.proposal
    at = list(zip(proposal.targets, proposal.features, strict=True)).index(('torque', 'rim_speed'))
    assert proposal.coefficients[at] == pytest.approx(SHARE, rel=0.25)
    assert abs(proposal.coefficients[at] - SHARE) < 4.0 * proposal.coefficients_std[at]
    assert any('use proposal.yaml' in text for text in in_words(found)['next'])
    assert 'Torque grows by' in proposal.words
    assert 'per decade of rim speed' in proposal.words
    assert any('angular_velocity outside' in text for text in proposal.not_trusted)
    gap = proposal.gap['torque']
    assert gap.after < 0.6 * gap.refit
    for quantities in proposal.left_out.values():
        assert quantities['torque'].law < quantities['torque'].refit


@pytest.mark.slow
def test_what_acts_only_where_two_things_meet_is_a_product():
    """Torque that grows with slip, the faster the more: one term, where single ones need three."""
    *_, found = with_decades(lambda table: 0.2 * np.abs(table['slip']))
    assert found.verdict in ('unexplained', 'undecided')
    proposal = found.proposal
    pairs = list(zip(proposal.targets, proposal.features, strict=True))
    at = pairs.index(('torque', 'slip_times_rim_speed'))
    assert abs(proposal.coefficients[at] - 0.2) < 4.0 * proposal.coefficients_std[at]
    assert 'per 0.1 of slip times decade of rim speed' in proposal.words
    assert proposal.gap['torque'].after < 0.6 * proposal.gap['torque'].refit


def test_the_file_of_the_law_gives_the_reported_gap(speedy, tmp_path):
    table, values, found = speedy
    configuration = reader.from_parameters(values, complete=False)
    write_model(found, tmp_path / 'proposal.yaml', found.proposal)
    rows = predicted(table, configuration, tmp_path, 'proposal.yaml')
    assert_errors(rows, table, found.proposal.gap)
    for gap in found.proposal.gap.values():
        assert gap.fitted == pytest.approx(gap.after, rel=0.3)
    law = reader.load([tmp_path / 'proposal.yaml'], complete=False)
    assert set(law.effects['learned_closure']) == set(
        coefficients_of(
            found.proposal.targets, found.proposal.features, found.proposal.coefficients
        )
    )
    # It stands in the proposal alone, never among what was named.
    report = found.to_dict()
    assert report['effects'] == []
    assert 'learned_closure' in report['not_tried']
    assert report['proposal']['targets'] == list(found.proposal.targets)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('seed', 'design', 'name'), [(500, 'sweep40', 'hump'), (504, 'slope48', 'friction_softening')]
)
def test_strangers_of_another_hand_shrink_on_loads_and_lugs_left_out(seed, design, name):
    plan = Plan(hide='outside', names=(name,), noise='mixed')
    found = diagnose_campaign(make_campaign(seed, design, plan))
    assert found.verdict != 'agrees'
    noise = {quantity: gap.noise for quantity, gap in found.gap.items()}
    items = [
        (quantity, item)
        for quantities in found.proposal.left_out.values()
        for quantity, item in quantities.items()
    ]
    refit, law = (
        sum(max((getattr(item, key) / noise[q]) ** 2 - 1.0, 0.0) for q, item in items)
        for key in ('refit', 'law')
    )
    assert np.sqrt(law / refit) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ('seed', 'design', 'name'), [(507, 'full56', 'side_drag'), (509, 'slope48', 'crosstalk')]
)
def test_strangers_that_listed_effects_imitate_are_not_named_with_confidence(seed, design, name):
    """A drag as a bulldozing with another radius, a crosstalk as a gain: said, but as a guess."""
    plan = Plan(hide='outside', names=(name,), noise='mixed')
    found = diagnose_campaign(make_campaign(seed, design, plan))
    assert found.verdict != 'agrees'
    assert all(effect.confidence <= 0.8 for effect in found.effects)


def test_where_only_an_unbelievable_soil_fits_the_law_leaves_one_that_can_be_believed(tmp_path):
    """A cohesion of 650 Pa more that may not be named: a soil 14 deviations off fits, too far."""
    campaign = make_campaign(1070, 'lugs48', Plan(noise='mixed', missing=0.03, forms=True))
    assert campaign.hidden == ('cohesion',)
    few = Options(effects=('bulldozing', 'lug_digging', 'multipass', 'soil_mound'))
    found = run(campaign.table, campaign.settings(), options=few)
    assert found.verdict == 'unexplained'
    assert 'too far from the configured one' in found.sentence
    law = found.proposal
    assert law.soil_held
    assert as_json(law)['soil_held']
    assert not any('use proposal.yaml' in text for text in in_words(found)['next'])
    far, near = (sum(shift.z_score**2 for shift in soil) for soil in (found.soil, law.soil))
    assert near < 0.2 * far
    for quantity in ('drawbar_pull', 'torque'):
        gap = law.gap[quantity]
        assert gap.noise < gap.refit
        assert gap.after < 0.9 * gap.refit
        assert gap.after < 1.6 * gap.noise
    configuration = reader.from_parameters(campaign.settings(), complete=False)
    write_model(found, tmp_path / 'proposal.yaml', law)
    rows = predicted(found.table.columns, configuration, tmp_path, 'proposal.yaml')
    measured = dict(zip(QUANTITIES, found.table.measured.T, strict=False))
    assert_errors(rows, measured, law.gap, near=2e-2)


def test_a_torque_sensor_that_bends_is_a_law_of_its_own_reading():
    """Second-order sensor: T' = T - a T |T|, whatever the load, as a calibration curve has it."""
    points = _points(slip=np.array([-0.3, 0.3, 0.6]), normal_load=np.array([40.0, 80.0, 60.0]))
    lever = points.normal_load * points.wheel.radius
    plain = WheelSoilModel(SOIL, {}).steady_state(points).torque
    law = {'learned_closure': {'torque_by_torque_squared': -0.2}}
    bent = WheelSoilModel(SOIL, law).steady_state(points).torque
    soil = SOIL.density * points.gravity * 0.15 * 0.15**3  # rho g b r^3 [N m]
    x = -0.2 * plain * np.abs(plain) / (lever * soil)
    bound = TARGETS['torque'].bound
    assert bent == pytest.approx(plain + lever * bound * x / (bound + np.abs(x)), rel=1e-9)


def test_what_one_channel_picks_up_of_another_is_a_law_and_no_gain():
    """A torque reading that holds F r/4 beside its own."""
    table, values, soil, rows = make('full56')
    pull = solve(rows, soil)['drawbar_pull']
    table['torque'] = table['torque'] + 0.25 * pull * rows['wheel_radius']
    gains = Options(effects=('torque_gain', 'pull_gain', 'drivetrain_friction'))
    found = run(table, values, options=gains)
    law = found.proposal
    assert (found.verdict, found.effects) == ('unexplained', ())
    assert (law.targets, law.features) == (('torque',), ('pull',))
    pulls = law.coefficients[0] * pull / rows['normal_load']
    bound = TARGETS['torque'].bound
    change = bound * pulls / (bound + np.abs(pulls))
    assert change == pytest.approx(
        0.25 * pull / rows['normal_load'], abs=0.025
    )  # it bends towards its bound


def test_a_law_is_offered_only_where_it_beats_the_refit_that_is_reported(monkeypatch):
    reported = {'torque': SimpleNamespace(noise=1.0, refit=3.0)}

    def is_closed(after):
        law = SimpleNamespace(gap={'torque': SimpleNamespace(after=after)})
        return proposals.Gap(None, None, reported, None).is_closed_by(law)

    assert is_closed(2.5) and not is_closed(2.7)  # 19 and 11 %
    monkeypatch.setattr(proposals.Gap, 'is_closed_by', lambda *_: False)
    *_, found = with_decades(lambda table: SHARE)
    assert (found.verdict, found.proposal) == ('unexplained', None)


def _points(**changes):
    wheel = Wheel(0.15, 0.15, 0.01, 20)
    given = {'slip': np.array([0.1, 0.3, 0.6]), 'normal_load': np.full(3, 80.0), 'wheel': wheel}
    return OperatingPoints(**{**given, 'angular_velocity': np.full(3, 1.0), **changes})


SOIL = Soil(1e4, 2e6, 1.0, 300.0, 0.56, 0.012, 0.42, -0.2, 1600.0)
LAW = {
    'friction_by_slip': -0.3,
    'exponent_by_slip': 0.2,
    'torque_by_rim_speed': 0.03,
    'drawbar_pull_by_depth': -0.4,
    'torque_by_torque_squared': -0.2,
    'torque_by_pull': 0.1,
    'drawbar_pull_by_torque': -0.1,
}


def test_quadrature_closed_form_and_filter_honour_the_law():
    points = _points()
    plain = WheelSoilModel(SOIL, {}).steady_state(points)
    exact = WheelSoilModel(SOIL, {'learned_closure': LAW}).steady_state(points)
    closed = WheelSoilModel(SOIL, {'learned_closure': LAW}, 'closed_form').steady_state(points)
    for key in QUANTITIES:
        changed = np.abs(getattr(exact, key) - getattr(plain, key)).max()
        assert np.abs(getattr(closed, key) - getattr(exact, key)).max() < 0.25 * changed
    forces = ConditionedForces(points.wheel, SOIL, {'learned_closure': LAW}, 'lug_tip', 9.81)
    soil = 300.0, np.tan(0.56), 0.012
    torque, _ = forces.forces(
        ConditionedInputs(1.0 - points.slip, exact.sinkage, 80.0, *soil, rim_speed=0.15)
    )
    assert torque == pytest.approx(exact.torque, rel=0.03)


def test_a_factor_is_bounded_and_no_law_is_the_plain_model():
    points = _points()
    plain = WheelSoilModel(SOIL, {}).steady_state(points)
    none = WheelSoilModel(SOIL, {'learned_closure': {'friction_by_slip': 0.0}})
    np.testing.assert_allclose(none.steady_state(points).torque, plain.torque, rtol=1e-12)
    scale = EFFECT.parameter('friction_by_slip').prior_scale
    wild = WheelSoilModel(SOIL, {'learned_closure': {'friction_by_slip': 40.0 * scale}})
    assert np.all(wild.steady_state(points).torque < 2.0 * plain.torque)


@pytest.mark.parametrize(
    ('lists', 'part'),
    [
        ((['torque'], ['slip', 'load'], [0.1]), '1 targets, 2 features'),
        ((['torque', 'sinkage'], ['slip'], [0.1]), '2 targets, 1 features'),
        ((['sinkage'], ['depth'], [0.1]), 'cannot change sinkage by depth'),
        ((['torque', 'torque'], ['slip', 'slip'], [0.1, 0.2]), 'twice'),
        ((['thrust'], ['slip'], [0.1]), 'nearest is'),
    ],
)
def test_lists_that_make_no_law(lists, part):
    keys = ('targets', 'features', 'coefficients')
    law = {f'effects.learned_closure.{key}': value for key, value in zip(keys, lists, strict=True)}
    with pytest.raises(UserError, match=part):
        reader.from_parameters({'effects.learned_closure.enabled': True, **law}, complete=False)


def test_a_change_is_stated_for_the_step_that_its_words_name():
    steps = {
        'everywhere alike': 1.0,
        'per doubling of the load': math.log10(2.0),
        'per decade of rim speed': 1.0,
        'per earlier pass': 1.0,
        'per 10 degrees of slope': math.radians(10.0),
        'with the square of slip, at 1': 1.0,
    }
    for name, (words, step) in proposals._PER.items():
        if band := re.match('in a band of slip around (.*)', words):
            assert learned_closure._SINGLE[name].value(SimpleNamespace(slip=float(band[1]))) == step
        elif name == 'torque_squared':
            assert f'is {step} W r' in words
        else:
            share = re.match(r'per (0\.\d+) ', words)
            assert step == (float(share[1]) if share else steps[words])


def test_a_change_is_said_in_the_units_of_the_rows():
    """A tenth of load, load times radius, radius: two wheels of 0.2 m, 100 and 300 N."""
    rows = np.tile([0.02, 37.0, 20.0], (2, 1))
    table = type('Table', (), {'measured': rows, '__len__': lambda self: len(rows)})()
    at = OperatingPoints(np.array([0.1, 0.2]), np.array([100.0, 300.0]), Wheel(0.2, 0.1))
    assert proposals._size('drawbar_pull', 0.1, table, at) == '20 N (54 % of its mean)'
    assert proposals._size('torque', 0.1, table, at) == '4 N m (20 % of its mean)'
    assert proposals._size('sinkage', 0.1, table, at) == '20 mm (100 % of its mean)'
    rows[:, 2] = 0.0  # a placeholder: no share of its mean
    assert proposals._size('torque', 0.1, table, at) == '4 N m'


@pytest.mark.parametrize(('lost', 'closed'), [(1.6, 1.0 - np.sqrt(7.6 / 15.0)), (1.9, 0.0)])
def test_a_law_that_worsens_a_quantity_has_to_gain_five_times_that(lost, closed):
    """In squared noise: pull goes from 10 to 1, sinkage from 7 by what is lost."""
    gap = {name: SimpleNamespace(noise=2.0) for name in ('drawbar_pull', 'sinkage')}
    left = {
        'drawbar_pull': LeftOut(2.0 * np.sqrt(10.0), 2.0),
        'sinkage': LeftOut(2.0 * np.sqrt(7.0), 2.0 * np.sqrt(7.0 + lost)),
    }
    assert proposals.Gap(None, None, gap, None).closed({'load': left}) == pytest.approx(closed)
