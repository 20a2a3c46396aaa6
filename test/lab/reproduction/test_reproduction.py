# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra reproduce``: pages from installed code and shipped data, verdicts that can fail."""

from __future__ import annotations

import re

import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_lab.reproduction import ding, guo, nakashima
from wheel_terra_lab.reproduction.statement import belongs_to


def test_all_papers_stand_on_one_page_with_a_verdict_each(tmp_path, capsys):
    folder = tmp_path / 'papers'
    assert main(['reproduce', 'all', '--points', '400', '-o', str(folder)]) == 0
    page = (folder / 'reproduction.md').read_text(encoding='utf-8')
    assert page == capsys.readouterr().out
    rows = [line for line in page.splitlines() if line.startswith('| ') and 'verdict' not in line]
    assert len(rows) > 80
    for row in rows:
        verdict = row.split(' | ')[-1]
        assert verdict.startswith(('reproduced', '**not**: ', 'no test')), row  # each not says why
    assert 'kept results' in page
    stated = [int(held) for held in re.findall(r'^(\d+) of \d+ statements', page, re.MULTILINE)]
    assert sum(stated) == sum(row.split(' | ')[-1].startswith('reproduced') for row in rows)
    assert {path.name for path in folder.glob('*.svg')} == {'ding.svg', 'nakashima.svg'}


def test_one_figure_alone_and_one_that_is_not_there(tmp_path, capsys, undrawn):
    assert main(['reproduce', 'nakashima', '--figure', '12', '-o', str(tmp_path / 'a')]) == 0
    page = capsys.readouterr().out
    assert 'figure 12(a)' in page and 'figure 12(b)' in page and 'table 7' not in page
    assert main(['reproduce', 'ding', '--figure', '99', '-o', str(tmp_path / 'b')]) == 2
    assert not (tmp_path / 'b').exists()
    assert main(['reproduce', 'guo', '--run', '-o', str(tmp_path / 'c')]) == 2


def test_known_misses_are_told_and_other_rows_change_the_verdict():
    missed = [s.what for s in ding.statements(0) if s.holds is False]
    assert len(missed) == 3 and any('h = 15 mm' in what for what in missed)
    assert any(s.holds is False and '242 %' in s.ours for s in guo.statements())
    rows = nakashima.kept()
    held = sum(s.holds is True for s in nakashima.statements(rows))
    assert held > 45
    other = {'1': '8', '8': '1'}
    swapped = [row | {'wheel': other.get(row['wheel'], row['wheel'])} for row in rows]
    assert sum(s.holds is True for s in nakashima.statements(swapped)) < held - 3
    figures = [s for s in nakashima.statements(rows) if belongs_to(s, 'figure 13')]
    assert {s.place for s in figures} == {'figure 13(a)', 'figure 13(b)'}


@pytest.mark.parametrize('name', ['driving', 'skidding'])
def test_the_reference_is_settled_driving_and_skidding(name):
    settled = [s for s in ding.numerics(1000) if s.holds is not None and name in s.what]
    assert [s.holds for s in settled] == [True]
