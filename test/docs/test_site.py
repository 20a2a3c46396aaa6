# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The built site: two clicks to every page, nothing cut or from elsewhere, a search that leads."""

import html
import importlib.util
import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NEEDED = ('mkdocs', 'material', 'mkdocstrings', 'latex2mathml')
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        any(importlib.util.find_spec(name) is None for name in NEEDED),
        reason='no MkDocs here (requirements/docs.txt)',
    ),
]

BROWSER = next((p for name in ('chromium', 'chromium-browser') if (p := shutil.which(name))), None)
with_a_browser = pytest.mark.skipif(BROWSER is None, reason='no Chromium')

WIDTH, PHONE = 1280, 390  # [px]
STUDIES = 'laboratory/soilbin/'
"""Pages with tables of measurements that scroll sideways."""
VISIT = """<!DOCTYPE html><body><iframe style="width:%(width)dpx;height:900px"></iframe><pre></pre>
<script>
const frame = document.querySelector('iframe');
const pages = %(pages)s;
const found = {};
function next() {
  if (!pages.length) {
    document.querySelector('pre').textContent = 'RESULT' + JSON.stringify(found) + 'END';
    return;
  }
  const page = pages.shift();
  frame.onload = () => {
    const inside = frame.contentDocument;
    const column = inside.querySelector('.md-content__inner').getBoundingClientRect().right + 2;
    const cut = [...inside.querySelectorAll('.md-content pre > code')]
      .filter((e) => e.scrollWidth > e.clientWidth + 2);
    const all = '.md-content math, .md-content img, .md-content table';
    const wide = [...inside.querySelectorAll(all)]
      .filter((e) => e.getBoundingClientRect().right > column);
    found[page] = [...cut, ...wide].map((e) => e.tagName + ': ' + e.textContent.slice(0, 60));
    const across = inside.documentElement.scrollWidth - %(width)d;
    if (across > 0) found[page].push('PAGE: ' + across + ' px beyond the screen');
    next();
  };
  frame.src = page;
}
next();
</script></body>"""


def dumped(address: str) -> str:
    """Return what a page has become after its scripts."""
    options = ('--headless', '--no-sandbox', '--disable-gpu', '--allow-file-access-from-files')
    command = [str(BROWSER), *options, '--virtual-time-budget=60000', '--dump-dom', address]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=300).stdout


def build(root: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """Build as ``make docs`` does."""
    command = [sys.executable, '-m', 'mkdocs', 'build', '--strict', '-d', str(site)]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)


class Page(HTMLParser):
    """What a page links to, and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        named = {key: value or '' for key, value in attributes}
        if tag == 'a' and 'href' in named:
            self.links.append(named['href'])
        if tag in ('script', 'img', 'iframe') and 'src' in named:
            self.loads.append(named['src'])
        if tag == 'link' and named.get('rel') in ('stylesheet', 'preload', 'icon'):
            self.loads.append(named['href'])


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp('site')
    made = build(ROOT, folder)
    assert made.returncode == 0, made.stdout + made.stderr
    return folder


def test_pages_need_nothing_from_elsewhere(site):
    for path in site.rglob('*.html'):
        for address in Page(path.read_text(encoding='utf-8')).loads:
            assert not re.match(r'(https?:)?//', address), f'{path.name}: {address}'


def test_formulas_are_mathematics(site):
    text = (site / 'models' / 'models.html').read_text(encoding='utf-8')
    assert text.count('<math') > 40
    for path in site.rglob('*.html'):
        page = path.read_text(encoding='utf-8')
        assert 'class="arithmatex"' not in page, f'{path.name}: a formula is left as TeX'


def test_notebooks_are_shown_with_what_they_print_and_draw(site):
    for source in (ROOT / 'docs' / 'notebooks').glob('*.ipynb'):
        page = (site / 'notebooks' / f'{source.stem}.html').read_text(encoding='utf-8')
        assert page.count('data:image/svg+xml') >= 1, source.stem
        assert 'run while the site was built' in page, source.stem


def cut(site: Path, width: int) -> dict[str, list[str]]:
    """Return page -> what is cut on it at a width; code, formulas, pictures, tables, the page."""
    pages = sorted(path.relative_to(site).as_posix() for path in site.rglob('*.html'))
    pages = [page for page in pages if page != '404.html']
    visit = site / 'visit_all.html'
    visit.write_text(VISIT % {'width': width, 'pages': json.dumps(pages)}, encoding='utf-8')
    text = dumped(visit.as_uri())
    visit.unlink()
    found: dict[str, list[str]] = json.loads(
        html.unescape(re.search(r'RESULT(\{.*?\})END', text, re.S)[1])
    )
    assert set(found) == set(pages)
    return {page: what for page, what in found.items() if what}


@with_a_browser
def test_nothing_is_cut_on_a_wide_screen(site):
    assert not [page for page in cut(site, WIDTH) if not page.startswith(STUDIES)]


@with_a_browser
def test_no_page_runs_off_a_phone(site):
    """Code, formulas and tables scroll by themselves, the page does not."""
    found = cut(site, PHONE)
    assert not {page: what for page, what in found.items() if what[-1].startswith('PAGE')}


@with_a_browser
@pytest.mark.parametrize(
    ('words', 'page'),
    [
        ('fit soil', 'tutorials/diagnose_table.html'),
        ('stuck warning', 'topics.html'),
        ('how to tune', 'own_rover.html'),
        ('install', 'install.html'),
    ],
)
def test_a_search_leads_to_the_page_of_the_task(site, words, page):
    text = dumped(f'{(site / "index.html").as_uri()}?q={words.replace(" ", "+")}')
    first = re.search(r'<a href="([^"]*)" class="md-search-result__link', text)
    assert first[1].partition('?')[0] == (site / page).as_uri()
