# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A run says what it tried again, and fails above three retries."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('pytest_rerunfailures')

FLAKY = """import pytest

tried = set()


@pytest.mark.flaky(reruns=2)
@pytest.mark.parametrize('case', range({count}))
def test_second_time(case):
    first = case not in tried
    tried.add(case)
    assert not first, 'lost message'
"""


@pytest.mark.parametrize(('count', 'status'), [(3, 0), (4, 1)])
def test_retries_are_named_and_bounded(tmp_path, count, status):
    (tmp_path / 'test_flaky.py').write_text(FLAKY.format(count=count))
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    run = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'retries', '-p', 'no:cacheprovider', '.'],
        cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': str(Path(__file__).parent)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == status, run.stdout
    assert run.stdout.count('tried again: test_flaky.py::test_second_time') == count
    assert ('the run fails' in run.stdout) == bool(status)
