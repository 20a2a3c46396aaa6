# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""README quotes no figure that the results file (docs/figures.yaml) does not hold."""

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
RESULTS: list[dict[str, Any]] = yaml.safe_load(
    (ROOT / 'docs' / 'figures.yaml').read_text(encoding='utf-8')
)
README = (ROOT / 'README.md').read_text(encoding='utf-8')
SECTION = README.partition('## How good, how fast')[2].partition('\n## ')[0]
ROWS = {name: cells for result in RESULTS for name, cells in result.get('rows', {}).items()}
NUMBER = re.compile(r'(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\.\w)')


def tables() -> list[list[str]]:
    """Return the rows of the section's tables without heads, cells stripped."""
    lines = [line for line in SECTION.splitlines() if line.startswith('|')]
    rows = [[cell.strip() for cell in line.strip('|').split('|')] for line in lines]
    rules = [i for i, row in enumerate(rows) if set(row[0]) <= {'-'} and row[0]]
    heads = {i - 1 for i in rules} | set(rules)
    return [row for i, row in enumerate(rows) if i not in heads]


def test_every_row_of_the_readme_is_a_result():
    rows = tables()
    assert {row[0]: row[1:-1] for row in rows} == ROWS
    assert len(rows) == len(ROWS)


def test_every_number_of_the_text_is_a_result():
    text = '\n'.join(line for line in SECTION.splitlines() if not line.startswith('|'))
    quoted = [words for result in RESULTS for words in result.get('text', [])]
    for words in quoted:
        assert words in SECTION, words
        text = text.replace(words, '')
    # What the intervals are meant to hold is no result.
    assert NUMBER.findall(text.replace('95 % intervals', '')) == []


@pytest.mark.parametrize('result', RESULTS, ids=lambda result: result['what'])
def test_a_result_says_where_it_comes_from(result):
    assert result['command'] and result['seeds']
    commits = result['commit'] if isinstance(result['commit'], list) else [result['commit']]
    assert commits and all(re.fullmatch(r'[0-9a-f]{7,40}', commit) for commit in commits)
    git = ['git', '-C', str(ROOT)]
    whole = subprocess.run(
        [*git, 'rev-parse', '--is-shallow-repository'], capture_output=True, text=True
    )
    if whole.stdout.strip() == 'false':  # with its history, not an unpacked archive
        for commit in commits:
            known = subprocess.run([*git, 'cat-file', '-e', f'{commit}^{{commit}}'])
            assert known.returncode == 0, f'{commit} is no commit of this repository'
