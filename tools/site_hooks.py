# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What MkDocs does beside its own: notebooks run, formulas become MathML, links leave ``docs/``."""

from __future__ import annotations

import functools
import html
import re
import sys
from pathlib import Path, PurePosixPath
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File

sys.path.insert(0, str(Path(__file__).parent))
from formulas import as_tex
from notebook_pages import page as notebook_page

SHIM = 'https://unpkg.com/iframe-worker/shim'
EFFECTS = 'effects.md'
"""Page whose formulas are written as the terminal shows them, in indented lines."""
CONTRIBUTING = 'development/contributing.md'
"""Page that shows ``CONTRIBUTING.md`` of the repository."""
WORTH, FIGURES = 'worth.md', '<!-- readme_figures: begin -->\n'
"""Page that shows the table of figures in ``README.md``, and the line before both their figures."""

BOOSTS = {
    'laboratory/': 0.2,
    'development/': 0.2,
    'estimation/design': 0.3,
    'models/validation': 0.2,
}
"""Beginning of a page's address -> its weight in the search: tasks come before studies."""

_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
_EFFECT = re.compile(r'^    (\S.*)$', re.MULTILINE)
_ASSIGN = re.compile(r'<mo>(&#x0002B;|&#x02212;|&#x000D7;)</mo><mo>&#x0003D;</mo>')
"""An operator like +=, which is one."""
_OUTSIDE = re.compile(r'\[([^\]]+)\]\((?!docs/|https?:)([^)\s]+)\)')
_LINK = re.compile(r'(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]+)(#[^)\s]*)?\)')


def on_config(config: Any, **_: Any) -> Any:
    """State the version of the package at the foot of each page."""
    source = Path(config.config_file_path).parent / 'wheel_terra_estimator' / '__init__.py'
    version = re.search(r"__version__ = '([^']+)'", source.read_text(encoding='utf-8'))
    config.copyright = f'version {version[1]}' if version else None
    return config


@functools.cache
def _run(path: Path, _written: float) -> str:
    return notebook_page(path)


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Put a page with output and pictures in the place of each notebook."""
    for file in [file for file in files if file.src_uri.endswith('.ipynb')]:
        path = Path(file.abs_src_path)
        files.remove(file)
        content = _run(path, path.stat().st_mtime)
        address = file.src_uri.replace('.ipynb', '.md')
        files.append(File.generated(config, address, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Turn links that leave ``docs/`` into the path of the file in the repository."""
    if page.file.src_uri == CONTRIBUTING:
        root = Path(page.file.abs_src_path).parents[2]
        markdown = (root / 'CONTRIBUTING.md').read_text(encoding='utf-8')
        markdown = _OUTSIDE.sub(r'\1 (`\2`)', markdown).replace('](docs/', '](../')
    if page.file.src_uri == WORTH:
        readme = (Path(page.file.abs_src_path).parents[1] / 'README.md').read_text(encoding='utf-8')
        table = readme.partition(FIGURES)[2].partition('<!--')[0]
        markdown = markdown.replace(FIGURES, f'{table}\n')
    for start, boost in BOOSTS.items():
        if page.file.src_uri.startswith(start):
            page.meta.setdefault('search', {'boost': boost})
    markdown = markdown.replace('.ipynb)', '.md)')
    if page.file.src_uri == EFFECTS:
        markdown = _EFFECT.sub(
            lambda found: '\n\n'.join(f'$$\n{tex}\n$$' for tex in as_tex(found[1])), markdown
        )
    depth = len(PurePosixPath(page.file.src_uri).parts) - 1

    def plain(match: re.Match[str]) -> str:
        words, target, _ = match.groups()
        if target.count('../') <= depth:
            return match[0]
        path = target.replace('../', '')
        name = words if words.strip('`') == path else f'{words} (`{path}`)'
        return name

    return _LINK.sub(plain, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn formulas into MathML, which browsers draw without a script."""

    def drawn(match: re.Match[str]) -> str:
        display = 'block' if match[1] == 'div' else 'inline'
        drawing = str(convert(html.unescape(match[2]), display=display))
        return _ASSIGN.sub(r'<mo>\1&#x0003D;</mo>', drawing)

    return _FORMULA.sub(drawn, content)


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Load the library behind the search from the site itself, so that it works offline."""
    depth = len(PurePosixPath(page.url).parts) - 1
    return output.replace(SHIM, '../' * depth + 'assets/iframe-worker.js')


def on_post_template(output: str, template_name: str, **_: Any) -> str:
    """Do the same for the page of what is not found, which stands at the root."""
    return (
        output.replace(SHIM, '/assets/iframe-worker.js') if template_name == '404.html' else output
    )
