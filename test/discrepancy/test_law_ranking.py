# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Contact laws beside a diagnosis: the law that made a table wins on it."""

import json
from pathlib import Path

from wheel_terra_estimator.cli.main import main

ROVER = ('--config', 'hit_wh3', '--config', 'hit_lss1')
FEW = ('--only', 'cohesion', '--only', 'bulldozing')  # effects: what they leave is a law's
POINTS = ('--slip', '0.05:0.8:6', '--load', '50,110')


def table(path: Path, law: str, *more: str) -> str:
    noise = ('--noise', '0.0003,0.5,0.05', '--seed', '3')
    assert main(['predict', *ROVER, *POINTS, '--law', law, *noise, *more, '-o', str(path)]) == 0
    return str(path)


def test_diagnose_says_what_another_law_leaves(tmp_path, capsys, undrawn):
    path = table(tmp_path / 'rows.csv', 'resistive_force')
    assert main(['diagnose', path, *ROVER, *FEW, '-o', str(tmp_path / 'out')]) == 0
    said = capsys.readouterr().out
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert report['verdict'] != 'agrees'
    found = report['contact_laws']
    assert list(found) == ['wong_reece', 'resistive_force']
    # The rows are those of the law; the others, with all their numbers free, come not as near.
    assert found['resistive_force']['misfit'] < 0.7 * min(1.0, found['wong_reece']['misfit'])
    assert found['resistive_force']['log_evidence'] > 5.0
    line = next(row for row in said.splitlines() if 'Contact law' in row).strip()
    assert f'resistive_force leaves {found["resistive_force"]["misfit"]:.2f}' in line
    assert line in (tmp_path / 'out' / 'report.html').read_text()
    # On rows of the model itself nothing is missing, and no law is told.
    path = table(tmp_path / 'own.csv', 'bekker_wong_janosi')
    assert main(['diagnose', path, *ROVER, '--no-pictures', '-o', str(tmp_path / 'own')]) == 0
    assert 'Contact law' not in capsys.readouterr().out
    assert json.loads((tmp_path / 'own' / 'report.json').read_text())['contact_laws'] == {}
