# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The stuck warning beside a soil file: whatever stands there, it is read or refused in words."""

import json

import pytest

from wheel_terra_estimator.configuration import soil_file
from wheel_terra_estimator.configuration.soil_file import StuckState
from wheel_terra_estimator.errors import UserError


def read(folder, text):
    path = folder / f'soil.yaml{soil_file.STATE}'
    path.write_text(text)
    return soil_file.read_state(path)


@pytest.mark.parametrize('direction', ['1', 'Infinity', '7', '{}', None])
def test_a_warning_stands_though_its_stamp_or_direction_is_none(tmp_path, direction):
    more = '' if direction is None else f', "direction": {direction}'
    expected = StuckState(True, 'digs in', 0, 1 if direction == '1' else 0)
    for stamp in ('Infinity', '-Infinity', 'NaN', '1e999', '1e30', '-1', '[]', '""'):
        text = f'{{"stuck": true, "reason": "digs in", "stamp": {stamp}{more}}}'
        assert read(tmp_path, text) == expected, stamp


@pytest.mark.parametrize(
    'text',
    [
        '',
        '{',
        '[]',
        'null',
        '{}',
        '[' * 100_000,
        json.dumps({'stuck': 'no', 'reason': '', 'stamp': 1}),
    ],
)
def test_what_is_no_state_is_refused_with_the_cure(tmp_path, text):
    with pytest.raises(UserError, match='remove'):
        read(tmp_path, text)
