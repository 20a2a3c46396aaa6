# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The converter makes of a table what the recording of the same event holds."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wheel_terra_estimator.bags.reader import read
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.measurements import InertialReading, WheelOdometry

TOOL = Path(__file__).resolve().parents[2] / 'tools' / 'frostyboy_csv_to_bag.py'


def converter() -> Any:
    spec = importlib.util.spec_from_file_location('frostyboy_csv_to_bag', TOOL)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.shared
@pytest.mark.parametrize('event', ['1_4', '1_6'])
def test_table_and_recording_of_the_same_event_agree(
    shared: Path, tmp_path: Path, event: str
) -> None:
    converter().convert(shared / 'frostyboy_snow' / f'event_{event}.csv', tmp_path / 'made')
    configuration = reader.load(['frostyboy'])
    remaps = {'reference_odom': '/truth/odometry'}
    given_bag = shared / 'bags' / f'frostyboy_event_{event}_mcap'
    given = [m for _, m in read(given_bag, remaps, configuration)]
    made = [m for _, m in read(tmp_path / 'made', remaps, configuration)]
    kinds = {type(m) for m in given}
    assert len(kinds) == 3
    for kind in kinds:
        pairs = zip(
            [m for m in given if type(m) is kind],
            [m for m in made if type(m) is kind],
            strict=True,
        )
        for one, other in pairs:
            assert abs(one.stamp - other.stamp) < 1000
            if isinstance(one, WheelOdometry):
                np.testing.assert_allclose(other.rate, one.rate, atol=1e-8)
                np.testing.assert_allclose(other.torque, one.torque, atol=1e-6)
            elif isinstance(one, InertialReading):
                np.testing.assert_allclose(other.specific_force, one.specific_force, atol=1e-9)
                np.testing.assert_allclose(other.angular_rate, one.angular_rate, atol=1e-9)
                np.testing.assert_allclose(other.orientation, one.orientation, atol=1e-9)
            else:
                assert other.forward == pytest.approx(one.forward, abs=1e-9)
                assert other.variance == one.variance
