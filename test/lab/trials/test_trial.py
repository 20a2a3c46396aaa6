# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A trial that anyone can run: hidden by another quadrature, sealed, diagnosed blind, opened."""

import csv
import hashlib
import json

import numpy as np
import pytest

from wheel_terra_estimator.cli.demo import SEAL_SHA256
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_lab.trials import trial


def run(folder, *arguments):
    return main(['trial', *map(str, arguments), '-o', str(folder), '--no-pictures'])


def test_one_trial_writes_table_seal_and_diagnosis(tmp_path, capsys):
    assert run(tmp_path / 'a', '--seed', 3, '--effect', 'slip_sinkage_exponent') == 0
    said = capsys.readouterr().out
    assert 'truth withheld (SHA-256' in said
    assert 'slip_sinkage_exponent was hidden; said: slip_sinkage_exponent' in said
    assert ': right' in said
    for word in ('as configured', 'refitted', 'after', 'noise'):
        assert word in said
    with (tmp_path / 'a' / trial.TABLE).open() as stream:
        header = next(csv.reader(stream))
    assert 'slip' in header and not {'hidden', 'effect'} & set(header)
    truth = json.loads((tmp_path / 'a' / trial.SEAL).read_text())
    assert truth['hidden'] == ['slip_sinkage_exponent']
    assert truth['distances'][0] > trial.LEAST * 0.9
    report = json.loads((tmp_path / 'a' / 'diagnosis' / 'report.json').read_text())
    assert report['effects'][0]['name'] == 'slip_sinkage_exponent'
    assert run(tmp_path / 'a', '--seed', 3) == 2, 'an output that exists is refused'


def test_the_diagnosis_reads_nothing_but_table_and_rig(tmp_path):
    campaign = trial.draw(5, 'none')
    digest = trial.hide(campaign, tmp_path)
    assert len(digest) == 64
    seal = (tmp_path / trial.SEAL).read_text()
    (tmp_path / trial.SEAL).unlink()
    diagnosis = trial.solve_blind(tmp_path)
    (tmp_path / trial.SEAL).write_text(seal)
    outcome = trial.compare(tmp_path, diagnosis)
    assert outcome.right == (diagnosis.verdict == 'agrees')
    assert outcome.hidden == 'none'


def test_the_shipped_trial_is_sealed_and_a_draw_of_its_seed(tmp_path):
    shipped = demo_recording('trial')
    seal = (shipped / trial.SEAL).read_bytes()
    assert hashlib.sha256(seal).hexdigest() == SEAL_SHA256, 'python tools/make_demo_bags.py'
    campaign = trial.draw(json.loads(seal)['seed'], None)
    trial.hide(campaign, tmp_path)
    assert list(campaign.hidden) == json.loads(seal)['hidden']
    tables = [np.genfromtxt(f / trial.TABLE, delimiter=',')[1:] for f in (shipped, tmp_path)]
    np.testing.assert_allclose(*tables, rtol=1e-6)


@pytest.mark.slow
def test_a_score_over_many_has_an_interval(tmp_path, capsys):
    assert run(tmp_path / 'many', '--seed', 20, '--many', 2, '--effect', 'none') == 0
    said = capsys.readouterr().out
    assert 'nothing hidden:' in said and 'of 2 right' in said
    with (tmp_path / 'many' / 'score.csv').open() as stream:
        assert [row['seed'] for row in csv.DictReader(stream)] == ['20', '21']
    # Wilson's interval, from the paper's formula at 8 of 10.
    low, high = trial.interval(8, 10)
    assert (low, high) == pytest.approx((0.4902, 0.9433), abs=5e-4)
