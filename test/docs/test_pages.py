# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The pages: all within two clicks, links that lead somewhere, words that readers can follow."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

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
