# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Each treatment of the ablation study can be switched off, and is on again afterwards."""

import importlib
import inspect

import numpy as np
import pytest

from wheel_terra_lab.studies import ablation
from wheel_terra_lab.studies.ablations.drives import PLANS, WHOLE_PLANS, Plan, simulated
from wheel_terra_lab.studies.ablations.switches import ROOT, both, patched, tuned, without_sign
from wheel_terra_lab.studies.ablations.treatments import SIGNS, TREATMENTS
from wheel_terra_lab.studies.ablations.warnings import listening

SEEN = ('slip', 'slip_std', 'drawbar_pull', 'drawbar_pull_std', 'sinkage', 'slip_class', 'stuck')


def module(name):
    return importlib.import_module(ROOT + name)


@pytest.mark.parametrize('treatment', TREATMENTS, ids=lambda t: t.name)
def test_there_is_what_is_switched_off(treatment):
    with treatment.off():
        pass


def test_every_stuck_sign_is_tried():
    assert set(SIGNS) == {sign.name for sign in module('judgement.stuck.signs').SIGNS}


def test_tuning_is_changed_where_components_take_it_and_comes_back():
    process = module('filter.speed_process')
    defaults = process.SpeedProcess.__init__.__defaults__
    with tuned('filter.speed_process:SpeedTuning', rim_change=0.0)():
        changed = [d for d in process.SpeedProcess.__init__.__defaults__ if d is not None]
        assert [d.rim_change for d in changed if hasattr(d, 'rim_change')] == [0.0]
    assert process.SpeedProcess.__init__.__defaults__ == defaults
    with pytest.raises(TypeError), tuned('filter.speed_process:SpeedTuning', no_such=0.0)():
        pass


def test_sign_is_gone_for_the_monitor_and_comes_back():
    signs, monitor = module('judgement.stuck.signs'), module('judgement.stuck.monitor')
    with without_sign('standing')():
        assert 'standing' not in {sign.name for sign in monitor.SIGNS}
        taken = inspect.signature(monitor.StuckMonitor).parameters['signs'].default
        assert 'standing' not in {sign.name for sign in taken}
    assert monitor.SIGNS is signs.SIGNS
    with pytest.raises(LookupError), without_sign('no_such')():
        pass


def test_patch_wants_what_is_there():
    with pytest.raises(AttributeError), patched('filter.torque:ForceRows.no_such', None)():
        pass


def short(simulator, kind, seconds, **more):
    """Return a short drive of a tuning seed."""
    return next(simulated([Plan(simulator, kind, seconds=seconds, **more)], 1000))


def differ(one, other):
    return any(
        not np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in SEEN
    )


def test_estimator_runs_with_everything_switched_off():
    case = short('A', 'climb', 8.0).make()
    kept = ablation._run(case)
    with both(*(t.off for t in TREATMENTS))():
        bare = ablation._run(case)
    assert np.isfinite(bare.slip).all()
    assert differ(bare, kept)
    assert not differ(ablation._run(case), kept)


def test_warning_told_again_is_the_same_and_feels_its_own_switches():
    # Late references: steps are made again, from kept states.
    case = short('B', 'climb', 10.0).make()
    always = both(
        tuned('judgement.stuck.settings:StuckSettings', threshold=-1.0),
        tuned('judgement.stuck.situation:SituationTuning', settling_travel=0.0),
    )
    with always(), listening() as told:
        kept = ablation._run(case)
        assert kept.health['steps_repeated'] > 0
        assert 0 < kept.stuck.sum() < told.said.sum() < len(kept.stuck)  # checks hold it back
    with always():
        assert (told.played(case.configuration) == told.said).all()
        assert (ablation._with_warning(case, told, kept).stuck == kept.stuck).all()
    assert not told.played(case.configuration).any()


def row(treatment, drive, simulator, slip, **more):
    figures = {'slip_square': 100.0 * slip**2, 'slip_count': 100.0, 'slip_covered': 95.0, **more}
    return {'treatment': treatment, 'drive': drive, 'simulator': simulator, **figures}


def test_table_says_what_earns_its_place():
    useful, idle = TREATMENTS[0].name, TREATMENTS[1].name
    rows = {ablation.AS_IT_IS: {}, useful: {}, idle: {}}
    for i, base in enumerate((0.02, 0.03, 0.05, 0.04)):
        for simulator in ('A', 'B'):
            name = f'{simulator} {i}'
            rows[ablation.AS_IT_IS][name] = row('', name, simulator, base)
            rows[useful][name] = row('', name, simulator, base * (1.5 if simulator == 'B' else 1.0))
            rows[idle][name] = row('', name, simulator, base * 1.001)
    text = ablation.report(rows)
    lines = {line.split('|')[2].strip(): line for line in text.splitlines() if line.count('|') > 5}
    assert '+50.0 ± 0.0' in lines[useful]
    assert lines[useful].endswith('| yes |')
    assert '+0.1 ± 0.0' in lines[idle]
    assert lines[idle].endswith('| no |')
    # What moved nothing tells nothing; one drive that loses leaves it open.
    base = rows[ablation.AS_IT_IS]
    silent, doubtful = TREATMENTS[2].name, TREATMENTS[3].name
    rows[silent] = dict(base)
    rows[doubtful] = {**base, 'A 2': row('', 'A 2', 'A', 0.055)}
    text = ablation.report(rows)
    lines = {line.split('|')[2].strip(): line for line in text.splitlines() if line.count('|') > 5}
    assert lines[silent].endswith('| did not act |')
    assert lines[doubtful].endswith('| open |')
    for name in base:
        base[name]['class_too_high'] = 2.0
    rows[silent] = {name: {**figures, 'class_too_high': 5.0} for name, figures in base.items()}
    text = ablation.report(rows)
    assert '+3.0' in text
    assert f'{silent}.' not in text.splitlines()[-1]
    rows[silent] = dict(base)
    rows[silent]['A 1'] = {**base['A 1'], 'missed': 1.0}
    assert f'{silent}.' not in ablation.report(rows).splitlines()[-1]


def test_deviation_that_is_too_small_without_a_treatment_earns_its_place():
    wide, narrow = TREATMENTS[0].name, TREATMENTS[1].name
    base = {f'A {i}': row('', f'A {i}', 'A', 0.03) for i in range(4)}
    rows = {
        ablation.AS_IT_IS: base,
        wide: {name: {**figures, 'slip_covered': 92.0} for name, figures in base.items()},
        # More within their intervals than need be: no loss.
        narrow: {name: {**figures, 'slip_covered': 99.0} for name, figures in base.items()},
    }
    assert ablation._verdict(base, rows[wide], list(base)) == 'yes'
    assert ablation._verdict(base, rows[narrow], list(base)) == 'no'


def test_warning_that_comes_later_earns_its_place():
    base = {f'A {i}': {**row('', f'A {i}', 'A', 0.03), 'lead': 10.0 + i} for i in range(4)}
    later = {name: {**figures, 'lead': figures['lead'] - 2.0} for name, figures in base.items()}
    once = {**base, 'A 1': {**base['A 1'], 'lead': 10.8}}
    seldom = {**base, 'A 1': {**base['A 1'], 'lead': 11.01}}
    assert ablation._verdict(base, later, list(base)) == 'yes'
    assert ablation._verdict(base, once, list(base)) == 'open'
    assert ablation._verdict(base, seldom, list(base)) == 'seldom'
    assert ablation._verdict(base, base, list(base)) == 'did not act'


def test_treatment_is_tried_where_it_can_act():
    by_name = {t.name: t for t in TREATMENTS}
    blind = next(simulated([Plan('A', 'climb', mode='no_reference')], 1000))
    seeing = next(simulated([Plan('A', 'climb')], 1000))
    usual = by_name['return to the usual slip']
    assert usual.acts_in(blind)
    assert not usual.acts_in(seeing)
    whole = next(simulated(WHOLE_PLANS, 1000, whole=True))
    assert by_name['sign standing'].acts_in(whole)
    assert not by_name['own stiffness of each wheel'].acts_in(whole)
    # Each has drives of the study on which it is tried, if only recorded ones.
    drives = [*simulated(PLANS, 1000), *simulated(WHOLE_PLANS, 1000, whole=True)]
    untried = {t.needs for t in TREATMENTS if not any(map(t.acts_in, drives))}
    assert untried == {'imu_covariance'}


@pytest.mark.parametrize(
    'plan',
    [
        Plan('B', 'spin', mode='no_torque_no_reference'),
        Plan('A', 'wild_stops'),
    ],
    ids=lambda p: p.kind,
)
def test_drives_of_both_simulators_are_made(plan):
    drive = short(plan.simulator, plan.kind, 1.0, mode=plan.mode)
    assert drive.name.startswith(f'{plan.simulator} {plan.kind} 1000')
    case = drive.make()
    references = [m for m in case.measurements if hasattr(m, 'forward')]
    assert bool(references) == ('no_reference' not in plan.mode)
    assert ablation._tried(drive, [], known=False).__next__()[1]['slip_count'] >= 0.0


def test_towed_rover_moves_on_standing_wheels():
    drive = short('A', 'towed', 22.0)
    case = drive.make()
    kept = ablation._run(case)
    late = kept.stamp[0] + 20_000_000_000
    pulled = [m.forward for m in case.measurements if hasattr(m, 'forward') and m.stamp > late]
    assert np.median(pulled) == pytest.approx(0.04, abs=0.005)
    towed = kept.stamp > late
    assert np.median(kept.speed[towed]) == pytest.approx(0.04, abs=0.01)
    assert case.figures(kept)['slip_count'] > 0.0
