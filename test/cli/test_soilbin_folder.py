# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra soilbin run`` replaces only what it wrote itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from wheel_terra_estimator.cli.soilbin import prepare_folder
from wheel_terra_estimator.errors import UserError


def test_overwrite_never_deletes_what_is_no_run(tmp_path: Path) -> None:
    home = tmp_path / 'home'
    home.mkdir()
    thesis = home / 'thesis.tex'
    thesis.write_text('years of work')
    for path in (home, thesis):
        with pytest.raises(UserError, match='is no folder of a run'):
            prepare_folder(path, overwrite=True, resume=False)
    assert thesis.read_text() == 'years of work'


@pytest.mark.parametrize('left', ['summary.json', '.work'])
def test_a_run_finished_or_not_is_replaced_when_told_so(tmp_path: Path, left: str) -> None:
    (tmp_path / 'run').mkdir()
    (tmp_path / 'run' / left).write_text('')
    with pytest.raises(UserError, match='exists already'):
        prepare_folder(tmp_path / 'run', overwrite=False, resume=False)
    prepare_folder(tmp_path / 'run', overwrite=True, resume=False)
    assert not any((tmp_path / 'run').iterdir())
