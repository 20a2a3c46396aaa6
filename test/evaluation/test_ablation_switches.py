# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Each treatment of the ablation study can be switched off, and is on again afterwards."""

import importlib
import inspect
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'tools'))

import ablation
from ablations.drives import SIMULATED, simulated
from ablations.switches import ROOT, patched, tuned, without_sign
from ablations.treatments import SIGNS, TREATMENTS


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
    with without_sign('stall')():
        assert 'stall' not in {sign.name for sign in monitor.SIGNS}
        taken = inspect.signature(monitor.StuckMonitor).parameters['signs'].default
        assert 'stall' not in {sign.name for sign in taken}
    assert monitor.SIGNS is signs.SIGNS
    with pytest.raises(LookupError), without_sign('no_such')():
        pass


def test_patch_wants_what_is_there():
    with pytest.raises(AttributeError), patched('filter.torque:ForceRows.no_such', None)():
        pass


def row(treatment, drive, world, slip, **more):
    figures = {'slip_square': 100.0 * slip**2, 'slip_count': 100.0, 'covered': 95.0, **more}
    return {'treatment': treatment, 'drive': drive, 'world': world, **figures}


def test_table_says_what_earns_its_place():
    useful, idle = TREATMENTS[0].name, TREATMENTS[1].name
    rows = {ablation.AS_IT_IS: {}, useful: {}, idle: {}}
    for i, base in enumerate((0.02, 0.03, 0.05, 0.04)):
        for world in ('own', 'rival'):
            name = f'{world} {i}'
            rows[ablation.AS_IT_IS][name] = row('', name, world, base)
            rows[useful][name] = row('', name, world, base * (1.5 if world == 'rival' else 1.0))
            rows[idle][name] = row('', name, world, base * 1.001)
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
    rows[doubtful] = {**base, 'own 2': row('', 'own 2', 'own', 0.055)}
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
    rows[silent]['own 1'] = {**base['own 1'], 'missed': 1.0}
    assert f'{silent}.' not in ablation.report(rows).splitlines()[-1]


def test_drives_of_both_worlds_are_made():
    durations = {'rival': 1.0, 'own': 1.0}
    for drive, (world, kind, _) in zip(simulated(2, 1000, durations), SIMULATED, strict=False):
        assert drive.name.startswith(f'{world} {kind} 1000')
        assert drive.run()['slip_count'] >= 0.0
