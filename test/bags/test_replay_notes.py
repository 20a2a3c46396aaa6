# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a replay says of stamps that stand still and of a filter that fails."""

import re
from typing import Any

import pytest
from recordings import beginning

from wheel_terra_estimator.bags.replay import replay
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.cli.demo import DRIVES
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator


def test_stamps_that_stand_still_are_counted(make_bag, factory, rover, tmp_path, capsys):
    header = factory.header(1_700_000_000_000_000_000)
    rows = [
        ('/joint_states', factory.joint_state(header, ('left', 'right'), velocity=(2.0, -2.0)), i)
        for i in range(50)
    ]
    rover.write(tmp_path / 'rover.yaml')
    bag = make_bag(messages=rows)
    assert main(['replay', str(bag), '--config', str(tmp_path / 'rover.yaml')]) == 0
    assert re.search(r'joint_states +50 +49 x stamp repeated, merged', capsys.readouterr().out)


@pytest.mark.filter_fails
def test_a_failing_filter_is_said_in_summary_and_diagnostics(
    make_bag, rover, monkeypatch, tmp_path
):
    usual, calls = WheelSoilEstimator.estimates, []

    def failing(self: Any) -> Any:
        calls.append(1)
        if len(calls) == 10:
            raise ZeroDivisionError
        return usual(self)

    with open_bag(make_bag()) as bag:
        result = replay(bag, rover, {})
        assert not any('started anew' in note for note in result.notes)
        monkeypatch.setattr(WheelSoilEstimator, 'estimates', failing)
        result = replay(bag, rover, {}, tmp_path / 'out')
    assert any('filter failed and was started anew once' in note for note in result.notes)
    assert b'filter_restarts' in next((tmp_path / 'out').glob('*.mcap')).read_bytes()


def test_odometry_that_might_be_the_reference_is_named(tmp_path):
    """On a measured drive, on which the filter never restarts."""
    drive = next(drive for drive in DRIVES if drive.name == 'pathfinder')
    recording = beginning(shipped.demo_recording(drive.name), tmp_path / 'drive', 6.0)
    with open_bag(recording) as bag:
        result = replay(bag, reader.load(['pathfinder']), {})
        (said,) = [note for note in result.notes if 'reference_odom:=' in note]
        assert '/wheel/odometry: one that does not come from the wheels' in said
        used = dict(remap.split(':=') for remap in drive.remaps)
        assert set(used) == {'reference_odom'}
        with_reference = replay(bag, reader.load(drive.configuration), used)
    assert not [note for note in with_reference.notes if 'reference_odom:=' in note]
    assert 'started anew' not in ' '.join((*with_reference.notes, *result.notes))
