# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tests of a mutant run on the mutated copy, not on what the study itself has imported."""

from __future__ import annotations

from pathlib import Path

import pytest

from wheel_terra_lab.studies.mutation import PACKAGE, Mutant, verdict

TEXT = 'HALF = 1 / 2\n'


@pytest.mark.parametrize(('asked', 'said'), [('== 0.5', 'caught'), ('> 0.0', 'survived')])
def test_a_mutant_is_caught_by_a_test_that_fails_on_it(
    tmp_path: Path, asked: str, said: str
) -> None:
    file = tmp_path / PACKAGE / 'errors.py'  # a module that the study has loaded itself
    file.parent.mkdir()
    (file.parent / '__init__.py').write_text('')
    file.write_text(TEXT)
    test = f'from {PACKAGE}.errors import HALF\n\n\ndef test_half():\n    assert HALF {asked}\n'
    (tmp_path / 'test_half.py').write_text(test)
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    at = TEXT.index('/')
    mutant = Mutant(f'{PACKAGE}/errors.py', 1, 'sign', at, at + 1, '/', '*')
    assert verdict(mutant, tmp_path, ['test_half.py']) == said
    assert file.read_text() == TEXT
