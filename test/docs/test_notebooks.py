# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The notebooks run from top to bottom, and are kept without output."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib as mpl
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / 'docs' / 'notebooks').glob('*.ipynb'))


def test_there_are_four():
    assert len(NOTEBOOKS) == 4


@pytest.mark.slow
@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path):
    mpl.use('agg')
    from matplotlib import pyplot

    cells = json.loads(path.read_text(encoding='utf-8'))['cells']
    names = {'__name__': '__main__'}
    code = [cell for cell in cells if cell['cell_type'] == 'code']
    assert code
    for number, cell in enumerate(code):
        assert cell['outputs'] == [], 'clear the outputs before committing'
        source = ''.join(cell['source'])
        exec(compile(source, f'{path.name}, code cell {number}', 'exec'), names)
    pyplot.close('all')
