# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of many jobs: whole after a kill, gone on with, never run twice."""

import json
import os
import subprocess
import sys

import pytest

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.jobs import ResultFile, run_jobs


def squared(number):
    if number < 0:
        raise UserError('negative')
    return {'number': number, 'square': number * number}


def twice(number):
    return [{'number': number, 'part': part} for part in (1, 2)]


def number_of(row):
    return int(row['number'])


@pytest.mark.parametrize('name', ['rows.jsonl', 'rows.csv'])
def test_a_second_run_does_what_is_missing(tmp_path, name):
    path, told = tmp_path / name, []
    run_jobs(squared, {2: 2, 3: 3}, ResultFile(path), number_of)
    first = path.read_bytes()
    results = ResultFile(path)
    run_jobs(
        squared, {2: 2, 5: 5, 3: 3}, results, number_of, jobs=2, tell=lambda *t: told.append(t)
    )
    assert path.read_bytes().startswith(first)
    assert {number_of(r): int(r['square']) for r in ResultFile(path).rows} == {2: 4, 3: 9, 5: 25}
    assert told == [(1, 1, {'number': 5, 'square': 25})]


def test_a_task_may_give_several_rows(tmp_path):
    run_jobs(twice, {7: 7}, ResultFile(tmp_path / 'a.jsonl'), number_of)
    assert [row['part'] for row in ResultFile(tmp_path / 'a.jsonl').rows] == [1, 2]


def test_what_was_done_stays_when_a_task_fails(tmp_path):
    results = ResultFile(tmp_path / 'a.jsonl')
    with pytest.raises(UserError, match='negative'):
        run_jobs(squared, {1: 1, -1: -1, 2: 2}, results, number_of)
    assert ResultFile(tmp_path / 'a.jsonl').rows == [{'number': 1, 'square': 1}]


@pytest.mark.parametrize(('name', 'half'), [('a.jsonl', '{"number": 3, "squ'), ('a.csv', '3,')])
def test_half_a_row_does_not_count_and_goes(tmp_path, name, half):
    path = tmp_path / name
    run_jobs(squared, {2: 2}, ResultFile(path), number_of)
    with path.open('a') as stream:
        stream.write(half)
    left = path.read_text()
    assert [number_of(row) for row in ResultFile(path).rows] == [2]
    assert path.read_text() == left, 'who only reads changes nothing'
    run_jobs(squared, {2: 2, 3: 3}, ResultFile(path), number_of)
    assert [int(row['square']) for row in ResultFile(path).rows] == [4, 9]


def test_a_new_column_of_a_table_leaves_the_old_rows_empty(tmp_path):
    results = ResultFile(tmp_path / 'a.csv')
    results.add({'number': 1})
    results.add({'number': 2, 'words': 'two, "lines"\nof it'})
    assert ResultFile(tmp_path / 'a.csv').rows == [
        {'number': '1', 'words': ''},
        {'number': '2', 'words': 'two, "lines"\nof it'},
    ]


def test_a_row_is_in_the_file_when_the_program_is_killed(tmp_path):
    program = (
        'import os, signal, sys, pathlib\n'
        'from wheel_terra_lab.jobs import ResultFile\n'
        'ResultFile(pathlib.Path(sys.argv[1])).add({"number": 1})\n'
        'os.kill(os.getpid(), signal.SIGKILL)\n'
    )
    subprocess.run([sys.executable, '-c', program, str(tmp_path / 'a.jsonl')], env=os.environ)
    assert json.loads((tmp_path / 'a.jsonl').read_text()) == {'number': 1}


def test_a_line_that_is_no_row_is_named(tmp_path):
    (tmp_path / 'a.jsonl').write_text('{"number": 1}\nnonsense\n')
    with pytest.raises(UserError, match=r'a\.jsonl: line 2 is no result'):
        ResultFile(tmp_path / 'a.jsonl')
