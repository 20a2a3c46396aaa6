# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/laboratory/papers: what is not reproduced of three papers, and their figures.

python tools/document_papers.py
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from wheel_terra_estimator.cli.main import main

FOLDER = Path(__file__).resolve().parents[1] / 'docs' / 'laboratory' / 'papers'
PAGE = 'reproduction.md'
_HELD = '| where | what | paper | ours |'
_TEXT = {
    '# Three papers, statement by statement': '# Three papers beside ours',
    '`wheel-terra reproduce all -o DIR` writes this page from installed code and shipped data.': (
        '`wheel-terra reproduce all -o DIR` lists every statement, from installed code and shipped '
        'data. Below: what is not reproduced, and the tables of nine wheels.'
    ),
    (
        '*no test*: an input, a definition, a picture, or an accuracy that the paper does not '
        'state.\n'
    ): '',
}
_NOT = ' | **not**'


def shortened(page: str) -> str:
    """Return the page of the command with what is not reproduced, and rows of several wheels."""
    for words, others in _TEXT.items():
        page = page.replace(words, others)
    blocks: list[str] = []
    for block in page.split('\n\n'):
        head, *rows = block.splitlines()
        if not head.startswith('| where'):
            blocks.append(block)
            continue
        kept = [row for row in rows[1:] if _NOT in row or ' | wheels ' in row]
        if head == _HELD:
            ending = ', among them:' if kept else '. Not:'
            blocks[-1] = blocks[-1].replace(' reproduced:', f' reproduced{ending}')
        if kept:
            blocks.append('\n'.join([head, rows[0], *kept]))
    return '\n\n'.join(blocks).rstrip() + '\n'


if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / 'papers'
        main(['reproduce', 'all', '-o', str(found)])
        for picture in found.glob('*.svg'):
            shutil.copy(picture, FOLDER)
        text = (found / PAGE).read_text(encoding='utf-8')
    (FOLDER / PAGE).write_text(shortened(text), encoding='utf-8')
