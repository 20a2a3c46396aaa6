# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Runs a notebook and returns it as a page of the site, with what it prints and draws."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any


def page(path: Path) -> str:
    """Run the cells of a notebook from top to bottom; return Markdown with output and pictures."""
    import matplotlib as mpl

    mpl.use('agg')
    names: dict[str, Any] = {'__name__': '__main__'}
    parts = []
    for number, cell in enumerate(json.loads(path.read_text(encoding='utf-8'))['cells']):
        source = ''.join(cell['source'])
        if cell['cell_type'] == 'markdown':
            parts.append(source)
            continue
        said = StringIO()
        with redirect_stdout(said):
            exec(compile(source, f'{path.name}, cell {number}', 'exec'), names)
        parts.append(f'```python\n{source}\n```')
        if said.getvalue():
            parts.append(f'```text\n{said.getvalue().rstrip()}\n```')
        parts += _pictures(f'{path.stem}, cell {number}')
    parts.append(f'This page is `docs/notebooks/{path.name}`, run while the site was built.')
    return '\n\n'.join(parts) + '\n'


def _pictures(name: str) -> list[str]:
    """Return the open figures as images, and close them."""
    from matplotlib import pyplot

    from wheel_terra_estimator.reporting.html import picture

    figures = [pyplot.figure(number) for number in pyplot.get_fignums()]
    images = [f'<img alt="{name}" src="{picture(figure)}">' for figure in figures]
    pyplot.close('all')
    return images
