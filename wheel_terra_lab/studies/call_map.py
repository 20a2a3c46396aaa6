# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""pytest plugin: which functions of the package each test calls, and what it costs.

    python -m pytest -n 0 -p wheel_terra_lab.studies.call_map test/estimation

writes a line of JSON a test to the file that `CALL_MAP` names: its id, its processor time [s] and
the functions as `file:first line`. What a fixture of a whole session calls counts for the test
that makes it.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Generator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = str(ROOT / 'wheel_terra_estimator') + os.sep

_called: set[CodeType] = set()


def _note_call(frame: FrameType, event: str, argument: Any) -> None:
    """Note the function that is entered; its lines are not followed."""
    _called.add(frame.f_code)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Follow one test with its fixtures."""
    _called.clear()
    start = time.process_time()
    threading.settrace(_note_call)
    sys.settrace(_note_call)
    try:
        return (yield)
    finally:
        sys.settrace(None)
        threading.settrace(None)  # type: ignore[arg-type]
        functions = sorted(
            f'{Path(code.co_filename).relative_to(ROOT).as_posix()}:{code.co_firstlineno}'
            for code in tuple(_called)  # threads may still be running
            if code.co_filename.startswith(PACKAGE)
        )
        row = {
            'test': item.nodeid,
            'seconds': round(time.process_time() - start, 4),
            'functions': functions,
        }
        with Path(os.environ['CALL_MAP']).open('a', encoding='utf-8') as stream:
            stream.write(json.dumps(row) + '\n')
