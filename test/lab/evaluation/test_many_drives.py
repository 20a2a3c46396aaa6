# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of some kinds for so many hours: which they are, going on, limit of a rate."""

import functools
import json
import math
from dataclasses import replace

import pytest

from wheel_terra_estimator.cli.main import INTERRUPTED, main
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.evaluation import many_drives, simulators
from wheel_terra_lab.evaluation.many_drives import drive_kinds_for_hours, most_per_hour
from wheel_terra_lab.evaluation.scores import coverage, rms

SEED = 1090
LENGTH = 12.0  # of a drive [s]; the first ten are not scored
HOURS = 2.5 * LENGTH / 3600.0
CHOSEN = [('A', 'cruise'), ('A', 'climb')]


OWN = simulators.SIMULATORS['A']


@functools.cache
def drive_of(kind, seed, rover):
    return OWN.simulate(kind, seed, LENGTH, rover)


@pytest.fixture
def short(monkeypatch):
    """Make every drive short, and once."""

    def simulate(kind, seed, duration, rover):
        return drive_of(kind, seed, rover)

    monkeypatch.setitem(simulators.SIMULATORS, 'A', replace(OWN, simulate=simulate))


def without_process(rows):
    return [{k: v for k, v in row.items() if k != 'processor_time'} for row in rows]


def test_seed_after_seed_until_the_hours_are_driven_and_gone_on_with(short, tmp_path, capsys):
    modes = ['reference']
    rows = drive_kinds_for_hours(tmp_path / 'whole', HOURS, CHOSEN, modes, SEED, progress=str)
    assert [(row['kind'], row['seed']) for row in rows] == [
        ('cruise', SEED),
        ('climb', SEED),
        ('cruise', SEED + 1),
    ]
    assert sum(row['hours'] for row in rows[:2]) < HOURS <= sum(row['hours'] for row in rows)
    assert all(row['slip_samples'] > 0 and row['metres'] > 0.0 for row in rows)

    # Killed while the last line was written.
    lines = (tmp_path / 'whole' / 'drives.jsonl').read_text().splitlines(keepends=True)
    broken = tmp_path / 'broken'
    drive_kinds_for_hours(broken, 1e-9, CHOSEN, modes, SEED, progress=str)
    (broken / 'drives.jsonl').write_text(''.join(lines[:2]) + lines[2][:40])
    told = []
    again = drive_kinds_for_hours(
        broken, HOURS, CHOSEN, modes, SEED, resume=True, progress=told.append
    )
    assert without_process(again) == without_process(rows) and len(told) == 1
    assert [json.loads(line) for line in (broken / 'drives.jsonl').open()] == again
    for other in (
        {'chosen': CHOSEN[:1]},
        {'modes': ['no_reference']},
        {'first_seed': SEED + 1},
    ):
        given = {'chosen': CHOSEN, 'modes': modes, 'first_seed': SEED, **other}
        with pytest.raises(UserError, match='of other kinds, modes or seeds'):
            drive_kinds_for_hours(broken, HOURS, **given, resume=True)


def test_the_sums_of_a_drive_are_those_of_the_bench(short):
    from wheel_terra_lab.evaluation.bench import score_drive

    (figures,) = many_drives._figures('A', 'climb', SEED, ['reference'])
    (score,) = score_drive('A', 'climb', SEED, ['reference'])
    assert figures.slip_samples == len(score.samples)
    assert math.sqrt(figures.slip_squared_error / figures.slip_samples) == pytest.approx(
        rms(score.samples.slip_error)
    )
    assert figures.slip_within / figures.slip_samples == pytest.approx(
        coverage(score.samples.slip_error, score.samples.slip_std)
    )


def test_the_table_sums_drives_and_gives_the_limit_of_the_rate():
    table = many_drives.report(
        [
            {
                'simulator': 'A',
                'kind': 'firm',
                'seed': seed,
                'mode': 'reference',
                'hours': 0.5,
                'metres': 90.0,
                'slip_samples': 100,
                'slip_squared_error': 0.04,
                'slip_within': 95,
                'entrapped': 12.0 if seed == 2 else None,
                'lead': 3.0 if seed == 2 else None,
                'warnings': seed,
                'false_warnings': seed - 1,
                'filter_restarts': 0,
                'processor_time': 1.0,
            }
            for seed in (1, 2)
        ]
    )
    row = [cell.strip() for cell in table.splitlines()[2].strip('|').split('|')]
    assert row[:5] == ['A firm', 'reference', '2', '1.00', '180']
    assert row[5:] == ['0.0200', '95.0%', '1', '1', '3', '1', '4.74']


@pytest.mark.parametrize(('count', 'limit'), [(0, 2.996), (1, 4.744), (4, 9.154)])
def test_the_limit_of_a_rate_is_that_of_tables_of_the_poisson_law(count, limit):
    """Upper limits of a count with 95 %, one-sided: published tables (Gehrels 1986, table 1)."""
    assert most_per_hour(count, 10.0) == pytest.approx(limit / 10.0, rel=1e-3)


def test_the_command_takes_kinds_and_hours_and_refuses_what_does_not_go(
    short, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / 'drives'
    command = ['evaluate', '--hours', '0.001', '--kinds', 'cruise', '--modes', 'reference']
    command += ['--tuning', '-o', str(folder)]
    with monkeypatch.context() as during:

        def interrupt(*arguments):
            raise KeyboardInterrupt

        during.setattr(many_drives, '_figures', interrupt)
        assert main(command) == INTERRUPTED
    assert 'the same command with --resume goes on' in capsys.readouterr().out
    assert main([*command, '--resume']) == 0
    assert '| A cruise | reference | 1 |' in capsys.readouterr().out
    earlier = (folder / 'drives.jsonl').read_bytes()
    with monkeypatch.context() as during:
        during.setattr(many_drives, '_figures', interrupt)
        assert main([*command, '--overwrite']) == INTERRUPTED
    assert (folder / 'drives.jsonl').read_bytes() == earlier
    for wrong, words in (
        (['--simulator', 'B'], 'needs --kinds'),
        (['--kinds', 'cruise', '--modes', 'smoothed'], 'mode smoothed'),
        (['--kinds', 'firm', '--limiter'], '--limiter'),
    ):
        assert main(['evaluate', '--hours', '1', '-o', str(tmp_path / 'x'), *wrong]) == 2
        assert words in capsys.readouterr().err
