# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Self-contained HTML pages: pictures and style are in the file, nothing is loaded from elsewhere.

A report has a template that extends ``base.html`` and fills its blocks ``title``, ``headline`` and
``content``; own templates may lie in any folder, ``base.html`` is found from there.
"""

from __future__ import annotations

import base64
import functools
import re
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wheel_terra_estimator import __version__
from wheel_terra_estimator.glossary import used_in
from wheel_terra_estimator.output_folder import new_file

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure

TEMPLATES = Path(__file__).parent / 'templates'
_MARKUP = re.compile(r'<(script|style)\b.*?</\1>|<[^>]*>', re.DOTALL)


def render(template: str, folder: Path = TEMPLATES, **context: Any) -> str:
    """Return the page of a template with a context.

    ``folder``: where it lies; templates of this package are found as well. ``**context``: values
    for the template; ``version`` is added, and what the words on the page mean.
    """
    environment = _environment(folder)
    page = environment.get_template(template).render(version=__version__, **context)
    words = used_in(_MARKUP.sub(' ', page))
    explained = environment.get_template('words.html').render(words=words)
    return page.replace('<footer>', explained + '<footer>')


@functools.cache
def _environment(folder: Path) -> Environment:
    """Return what renders the templates of a folder; each is compiled once."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    from wheel_terra_estimator.reporting.style import DARK
    from wheel_terra_estimator.reporting.time_figure import nice

    made = Environment(
        loader=FileSystemLoader([folder, TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals.update(nice=nice, dark=lambda colour: DARK.get(colour, colour))
    return made


def write_page(path: Path, page: str, overwrite: bool) -> None:
    """Write a page, whole or not at all."""
    with new_file(path, overwrite) as fresh:
        fresh.write_text(page, encoding='utf-8')


def picture(figure: Figure) -> str:
    """Return a figure as the address of an image that lies in the page itself.

    The image is an SVG; its colours follow the light or dark mode of the reader.
    """
    from wheel_terra_estimator.reporting.style import for_dark_pages, picture_style

    buffer = StringIO()
    with picture_style():  # text as text, and the same bytes for the same picture
        figure.savefig(buffer, format='svg', metadata={'Date': None})
    image = for_dark_pages(buffer.getvalue()).encode()
    return 'data:image/svg+xml;base64,' + base64.b64encode(image).decode()
