# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Scenario files: all shipped ones load, bad ones are refused in one line."""

import numpy as np
import pytest

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.simulation import scenario as scenarios


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'drive.foward': [0.1]}, ['unknown key', 'drive.foward', 'drive.forward']),
        ({'duration': -1.0}, ['duration', 'above 0']),
        ({'duration': 'long'}, ['duration', 'not a number']),
        ({'drive.time': [0.0, 5.0, 3.0]}, ['drive.time', 'decrease']),
        ({'drive.time': [0.0, 1.0], 'drive.forward': [0.1, 0.1, 0.2]}, ['drive.forward', '3']),
        ({'slope.position': [1.0, 0.0], 'slope.angle_deg': [0.0]}, ['slope.position']),
        ({'slope.angle_deg': [80.0]}, ['slope.angle_deg', '60']),
        ({'patches.start': [1.0]}, ['patches.end', 'missing']),
        ({'patches.start': [1.0, 2.0], 'patches.end': [1.0, 2.0, 3.0]}, ['patches.end']),
        ({'faults.kind': ['exploded']}, ['faults.kind', 'exploded']),
        ({'faults.kind': ['locked']}, ['faults.start', 'missing']),
        (
            {
                'faults.kind': ['locked'],
                'faults.wheel': ['fifth'],
                'faults.start': [0.0],
                'faults.end': [1.0],
            },
            ['fifth', 'front_left'],
        ),
        ({'configuration': ['no_such_rover']}, ['no_such_rover']),
        ({'truth': ['soil.cohesoin:=1.0']}, ['soil.cohesoin', 'soil.cohesion']),
    ],
)
def test_bad_scenarios_are_refused(changes, words):
    with pytest.raises(UserError) as caught:
        scenarios.load(changes)
    message = str(caught.value)
    assert '\n' not in message
    for word in words:
        assert word in message


def test_a_file_that_is_not_a_scenario_is_named(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('/**:\n  ros__parameters:\n    duraton: 3.0\n')
    with pytest.raises(UserError, match=r'mine\.yaml.*duraton.*duration'):
        scenarios.load(path)
    with pytest.raises(UserError, match='no such file'):
        scenarios.load(tmp_path / 'missing.yaml')


def test_changes_and_parameters_win_over_the_file_and_degrees_become_radians():
    scenario = scenarios.load(
        'firm_drive', parameters=['rover.mass:=99.0'], sensors__reference=False, duration=5.0
    )
    assert scenario.configuration.rover.mass == scenario.truth.rover.mass == 99.0
    assert scenario.duration == 5.0
    assert not scenario.sensors.reference
    scenario = scenarios.load({'slope.angle_deg': [10.0]})
    np.testing.assert_allclose(scenario.slope.angle, np.radians([10.0]))


def test_another_rover_in_a_shipped_scenario():
    stalled = scenarios.load('stalled_wheel', rover='frostyboy')
    assert stalled.configuration.wheels.count == 4
    assert stalled.configuration.rover.mass == 90.0
    own = scenarios.load('stalled_wheel')
    assert stalled.configuration.soil == own.configuration.soil
    assert all(fault.wheel is None or fault.wheel < 4 for fault in stalled.faults)
    assert len(stalled.faults) == len(own.faults)
