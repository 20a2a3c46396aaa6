# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The pages: within two clicks, with links that lead, commands that parse, figures that hold."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from wheel_terra_estimator.cli.main import sub_parsers

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / 'docs'
PAGES = sorted(DOCS.rglob('*.md'))
SITE = yaml.safe_load((ROOT / 'mkdocs.yml').read_text(encoding='utf-8'))
NAMES = [page.relative_to(DOCS).as_posix() for page in PAGES]
NOTEBOOKS = [p.relative_to(DOCS).with_suffix('.md').as_posix() for p in DOCS.rglob('*.ipynb')]


def entries(tree: Any, depth: int = 0) -> Iterator[tuple[str, int]]:
    """Yield the pages of a navigation with their depth."""
    if isinstance(tree, str):
        yield tree, depth
    elif isinstance(tree, list):
        for item in tree:
            yield from entries(item, depth)
    else:
        for item in tree.values():
            yield from entries(item, depth + 1)


def test_notebooks_are_kept_without_output():
    assert len(NOTEBOOKS) == 4
    for path in DOCS.rglob('*.ipynb'):
        cells = json.loads(path.read_text(encoding='utf-8'))['cells']
        assert not any(cell.get('outputs') for cell in cells), path.name


def test_every_page_is_within_two_clicks():
    reached = dict(entries(SITE['nav']))
    missing = {*NAMES, *NOTEBOOKS} - set(reached)
    assert not missing, f'add to nav in mkdocs.yml: {sorted(missing)}'
    assert set(reached) <= {*NAMES, *NOTEBOOKS}, 'nav names pages that are not there'
    # A tab opens on a page of its own; its other pages and sub-sections stand beside it.
    assert max(reached.values()) <= 3
    assert len(SITE['nav']) <= 7


def text_without_code(page: Path) -> str:
    """Return the words of a page, without blocks and spans of code."""
    text = re.sub(r'^```.*?^```', '', page.read_text(encoding='utf-8'), flags=re.M | re.S)
    return re.sub(r'`[^`\n]+`', '', text)


def test_links_lead_to_files():
    for page in (*PAGES, ROOT / 'README.md', ROOT / 'CONTRIBUTING.md'):
        for target in re.findall(r'\]\(([^)\s]+)\)', text_without_code(page)):
            path = target.partition('#')[0]
            if path and not re.match(r'[a-z]+:', path):
                assert (page.parent / path).exists(), f'{page.relative_to(ROOT)}: {target}'


CLOSED = (
    r'\bthe contract\b',
    r'\bin the interface\b',
    r'\b[Ss]eed [123] (eq|equation|section)',
    r'EQUATIONS\.md',
    r'INTERFACE\.md',
)
"""Sources that a reader cannot open."""
SOURCES = ('wheel_terra_estimator', 'wheel_terra_lab', 'config', 'launch', 'tools')


def test_no_source_that_readers_cannot_open():
    """Neither on the pages nor in the code and its files."""
    files = [file for folder in SOURCES for file in (ROOT / folder).rglob('*.*')]
    sources = [file for file in files if file.suffix in ('.py', '.yaml', '.md')]
    assert len(sources) > 300
    texts = {file: file.read_text(encoding='utf-8') for file in sources}
    for file, text in (texts | {page: text_without_code(page) for page in PAGES}).items():
        for words in CLOSED:
            assert not re.search(words, text), f'{file.relative_to(ROOT)}: {words}'


def test_the_map_of_the_code_is_short_and_leads_to_files():
    text = (DOCS / 'architecture.md').read_text(encoding='utf-8')
    assert len(text.split()) <= 1500
    files = [
        p.relative_to(ROOT).as_posix() for s in (*SOURCES, 'test') for p in (ROOT / s).rglob('*')
    ]
    named = re.findall(r'`(\w+/[\w/]*(?:\.py|\.yaml)?)`', re.sub(r'(?ms)^```.*?^```', '', text))
    assert len(named) > 40
    for name in named:
        ends = f'/{name.rstrip("/")}', f'/{name}.py'
        assert 'NAME' in name or any(f'/{f}'.endswith(ends) for f in files), name


def test_the_page_of_the_interface_has_every_name():
    from wheel_terra_estimator import api

    text = (DOCS / 'api.md').read_text(encoding='utf-8')
    shown = set(re.findall(r'^::: wheel_terra_estimator\.api\.(\w+)', text, re.M))
    missing = {name for name in api.__all__ if not name.startswith('_')} - shown
    assert not missing, f'add to docs/api.md: {sorted(missing)}'


def python_blocks(page: Path) -> list[str]:
    return re.findall(r'^```python\n(.*?)^```', page.read_text(encoding='utf-8'), re.M | re.S)


@pytest.mark.parametrize(
    'page',
    [p for p in (ROOT / 'README.md', *PAGES) if p.parent.name != 'tutorials' and python_blocks(p)],
    ids=lambda page: page.stem,
)
def test_python_of_a_page_runs(page, tmp_path, monkeypatch):
    """Tutorials are run elsewhere, with their commands."""
    mpl = pytest.importorskip('matplotlib')
    mpl.use('agg')
    from matplotlib import pyplot

    from wheel_terra_estimator.api import Model
    from wheel_terra_estimator.configuration import reader

    monkeypatch.chdir(tmp_path)
    reader.load(['hit_wh3', 'hit_fit'], complete=False).write('my_soil.yaml')
    rows = Model.load('my_soil.yaml').sweep([0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [60.0, 90.0])
    rows.iloc[:, :6].to_csv('DATA.csv', index=False)
    for block in python_blocks(page):
        exec(compile(block, page.name, 'exec'), {})
    pyplot.close('all')


WITH_COMMANDS = [
    *sorted((ROOT / 'docs').rglob('*.md')),
    ROOT / 'README.md',
    ROOT / 'CONTRIBUTING.md',
]
PROGRAMS = r'(?:wheel-terra|python3? -m wheel_terra\S+|python3? tools/\S+)'
BLOCKS = re.compile(r'^ *```(?:sh|bash|console)\n(.*?)^ *```|((?:^    \S.*\n)+)', re.M | re.S)
SHORTENED = re.compile(r'\.\.\.|…|COMMAND')


def commands(page: Path) -> list[str]:
    """Return the commands of ours in the blocks of a page, one line each."""
    text = page.read_text(encoding='utf-8')
    blocks = ''.join(a or b for a, b in BLOCKS.findall(text)).replace('\\\n', ' ')
    found = re.findall(rf'^ *({PROGRAMS} [^\n|>;&#`]*)', blocks, re.M)
    return [line for line in found if not SHORTENED.search(line)]


def test_commands_of_pages_are_understood():
    parsers = sub_parsers()
    told = {(page, line) for page in WITH_COMMANDS for line in commands(page)}
    assert len(told) > 60
    for page, line in told:
        words = shlex.split(re.sub(r'\$\w+', '1', line))
        if words[0] == 'wheel-terra':
            if words[1].startswith('-'):
                continue  # of the program itself: --version, --help
            try:
                parsers[words[1]].parse_args(words[2:])
            except SystemExit as end:
                assert end.code == 0, (page, line)
        elif words[1] == '-m':
            assert importlib.util.find_spec(words[2]) is not None, (page, line)
        else:
            assert (ROOT / words[1]).is_file(), (page, line)


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
