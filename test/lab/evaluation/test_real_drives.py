# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The estimator on real drives (data beside the project; skipped where absent)."""

from pathlib import Path

import numpy as np
import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.evaluation import real_drives
from wheel_terra_lab.evaluation.runner import run_estimator

HUSKY_PLACES = ('front_left', 'front_right', 'rear_left', 'rear_right')
MEASURED = Path(__file__).parents[3].parent / 'shared' / 'measured'
pytestmark = [
    pytest.mark.shared,
    pytest.mark.skipif(not MEASURED.is_dir(), reason='no measured data in ../shared'),
]


ALL = pytest.param((), 15, 2, id='all', marks=pytest.mark.slow)
"""Events looked at; runs of high slip in them, of which so many may be found late."""


def scores(names, rate):
    return [
        real_drives.score_snow_event(event, rate)[0]
        for event in real_drives.snow_events(MEASURED / 'frostyboy_snow')
        if event.name in names or not names
    ]


@pytest.mark.parametrize(('names', 'least', 'most_late'), [(('event_1_4',), 2, 0), ALL])
def test_snow_events_are_warned_with_the_reference_not_later_than_by_the_author(
    names, least, most_late
):
    found = scores(names, 1.0)
    assert len(found) == (len(names) or 9)
    assert all(s.lead is not None for s in found)
    assert np.mean([s.lead for s in found]) >= 0.0
    late, runs = sum(s.late_classes for s in found), sum(s.high_slip_runs for s in found)
    assert runs >= least
    assert late <= most_late


@pytest.mark.slow
def test_snow_events_are_warned_without_any_speed():
    found = scores((), 0.0)
    assert len(found) == 9
    assert all(s.lead is not None for s in found)
    assert np.mean([s.lead for s in found]) >= -1.1


@pytest.mark.slow
@pytest.mark.parametrize('rate', [1.0, 0.0])
def test_firm_ground_raises_no_warning(rate):
    bag = MEASURED / 'bags' / 'wvu_pathfinder_test17_mcap'
    assert not real_drives.pathfinder_record(bag, rate).stuck.any()


HUSKY = {
    'rover.mass': 50.0,
    'wheels.names': [f'{place}_wheel' for place in HUSKY_PLACES],
    'wheels.radius': [0.1651] * 4,
    'wheels.width': [0.125] * 4,
    'wheels.x': [0.256, 0.256, -0.256, -0.256],
    'wheels.y': [0.2854, -0.2854, 0.2854, -0.2854],
}


def test_a_shaking_husky_on_firm_ground_is_not_stuck():
    """Wheel rates and an IMU of 1 m/s^2 of vibration are all that tells: no slip is told."""
    configuration = reader.from_parameters(HUSKY)
    bag = MEASURED / 'bags' / 'boreal_husky_flooring_00_mcap'
    measurements = list(real_drives.measurements_of(bag, {}, configuration))
    end = measurements[0].stamp + 20 * 10**9
    sets, _ = run_estimator(configuration, [m for m in measurements if m.stamp < end])
    assert len(sets) > 120
    assert not any(s.stuck for s in sets)
    high = np.isin(np.array([s.slip_class for s in sets]), (2, 3))
    assert high.mean() < 0.01
