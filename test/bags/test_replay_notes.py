# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a replay says of silent wheels and a filter that fails; figures, and the truth beside."""

import csv
import json
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from estimate_sets import STAMP, some_estimates
from estimate_sets import some_estimates as estimate_set
from recordings import beginning

from wheel_terra_estimator.bags.history import HistoryRecorder, ThinnedRows, read_estimates
from wheel_terra_estimator.bags.reader import MeasurementReader
from wheel_terra_estimator.bags.replay import Options, Replay, replay
from wheel_terra_estimator.bags.storage import open_bag
from wheel_terra_estimator.bags.truth import read_truth
from wheel_terra_estimator.cli.demo import DRIVES
from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.sideways import Sideways
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.drive_summary import summarise


@pytest.mark.parametrize(('period', 'said'), [(1, True), (0.5, False)])
def test_wheel_odometry_that_counts_as_silent_most_of_the_time_is_told(
    make_bag, factory, config, printed, period, said
):
    rows = []
    for i in range(80):
        header = factory.header(1_700_000_000_000_000_000 + i * 50_000_000)
        rows.append(('/imu/data', factory.imu(header, (0.0, 0.0, 9.81), (0.0,) * 3, None), i))
        if i % round(20 * period) == 0:
            state = factory.joint_state(header, ('left', 'right'), velocity=(2.0, -2.0))
            rows.append(('/joint_states', state, i))
    words = (
        'note: joint_states is so infrequent that wheels are mostly unknown: '
        'raise filter.silence (0.5 s)'
    )
    assert (words in printed(['replay', str(make_bag(messages=rows)), *config])) is said


@pytest.mark.filter_fails
def test_a_failing_filter_is_said_in_summary_and_diagnostics(
    make_bag, drive, rover, monkeypatch, tmp_path
):
    usual, calls = WheelSoilEstimator.estimates, []

    def failing(self: Any) -> Any:
        calls.append(1)
        if len(calls) == 10:
            raise ZeroDivisionError
        return usual(self)

    monkeypatch.setattr(WheelSoilEstimator, 'estimates', failing)
    with open_bag(make_bag(drive[:35])) as bag:
        result = replay(bag, rover, {}, tmp_path / 'out')
    assert any('filter failed and restarted once' in note for note in result.notes)
    assert b'filter_restarts' in next((tmp_path / 'out').glob('*.mcap')).read_bytes()


def test_odometry_that_might_be_the_reference_is_named(tmp_path):
    """On a measured drive, on which the filter never restarts."""
    drive = next(drive for drive in DRIVES if drive.name == 'pathfinder')
    recording = beginning(shipped.demo_recording(drive.name), tmp_path / 'drive', 2.0)
    with open_bag(recording) as bag:
        result = replay(bag, reader.load(['pathfinder']), {})
        (said,) = [note for note in result.notes if 'reference_odom:=' in note]
        assert '/wheel/odometry: if one does not come from the wheels' in said
        used = dict(remap.split(':=') for remap in drive.remaps)
        assert set(used) == {'reference_odom'}
        with_reference = replay(bag, reader.load(drive.configuration), used)
    assert not [note for note in with_reference.notes if 'reference_odom:=' in note]
    assert 'restarted' not in ' '.join((*with_reference.notes, *result.notes))


def test_a_log_of_arrivals_holds_parameters_and_may_know_more_than_the_bag(tmp_path):
    """The node hears messages before the recorder does; what a log of another bag is, is told."""
    recording = beginning(shipped.demo_recording('entrapment'), tmp_path / 'drive', 1.4)
    rover, log = reader.load(['generic_six_wheel', 'test_sand']), tmp_path / 'order.txt'
    tuned = {'filter.gate': 6.0, 'filter.class_thresholds': [0.2, 0.5, 0.8]}
    with open_bag(recording) as bag:
        messages = list(MeasurementReader(bag, {}, rover).messages())
        half, pipeline, expected = len(messages) // 2, Pipeline(rover), []
        for i, (_, name, message) in enumerate(messages):
            if i == half:
                pipeline.retune(rover.replace(tuned))
            expected += pipeline.hear(name, message)
        expected += pipeline.flush()
        lines = [f'{name} {message.stamp}' for _, name, message in messages]
        early = ['imu/data 999']
        log.write_text(
            '\n'.join([*early, *lines[:half], f'set {json.dumps(tuned)}', *lines[half:]])
        )
        result = replay(bag, rover, {}, options=Options(arrival=log, every_set=True))
        assert any('order.txt: 1 of its messages are not in the bag' in n for n in result.notes)
        slip = np.array([estimates.slip for estimates in expected])
        np.testing.assert_array_equal(result.history.values['slip'], slip)
        with pytest.raises(UserError, match='tuning changes in it'):
            replay(bag, rover, {}, options=Options(arrival=log, smooth=True))
        log.write_text('\n'.join([*lines, 'set {"filter.ga']))
        with pytest.raises(UserError, match='remove the line'):
            replay(bag, rover, {}, options=Options(arrival=log))
        log.write_text('\n'.join(early * len(lines) + lines))
        with pytest.raises(UserError, match='line 1: no message "imu/data 999"'):
            replay(bag, rover, {}, options=Options(arrival=log))


# Figures of a whole drive, and the truth beside it.


SECOND = 1_000_000_000


def test_time_in_class_counts_no_pauses():
    recorder = HistoryRecorder(('left', 'right'))
    stamps = [0.0, 0.5, 1.0, 1.5, 60.0, 60.5, 20.0]  # a pause of a minute, a step back
    classes = [0, 0, 3, 3, 2, 2, 2]
    for time, value in zip(stamps, classes, strict=True):
        recorder.add(
            some_estimates(
                stamp=STAMP + round(time * SECOND),
                slip_class=np.array([value, 255], dtype=np.uint8),
                slip_velocity=np.array([-0.02, 0.5]),
            )
        )
    figures = recorder.history().figures()
    assert figures.slip_travel == pytest.approx([0.02, 0.0])
    times = figures.seconds_in_class
    assert [times[c][0] for c in SlipClass] == pytest.approx([1.0, 0.0, 0.5, 0.5, 0.0])
    assert times[SlipClass.UNKNOWN][1] == pytest.approx(2.0)


def test_history_of_nothing():
    history = HistoryRecorder(('left',)).history()
    assert history.seconds.size == 0
    assert history.values['slip'].shape == (0, 1)


def test_bag_without_estimates_is_refused(make_bag):
    with open_bag(make_bag()) as bag, pytest.raises(UserError, match='no estimates'):
        read_estimates(bag)


def truth_of(bag, rover):
    with open_bag(bag) as opened:
        truth = read_truth(opened, {}, rover)
    assert truth is not None and truth.slip is not None
    return truth


def test_true_slip_from_a_true_velocity(make_bag, rover, drive):
    """Rim speed 2 rad/s x 0.21 m = 0.42 m/s, velocity 0.36 m/s: slip 1/7."""
    moved = [(t.replace('/reference_odom', '/truth/odometry'), m, time) for t, m, time in drive]
    truth = truth_of(make_bag(moved), rover)
    assert truth.velocity.value.shape == (4, 1)
    np.testing.assert_allclose(truth.slip.value, np.full((40, 2), 1 / 7), atol=1e-12)


def test_true_slip_of_steered_wheels_is_along_their_headings(make_bag, rover, drive, factory):
    """Both wheels head 0.3 rad to the left: the rover moves along them with 0.36 / cos 0.3."""
    moved = []
    for topic, message, time in drive:
        if topic == '/joint_states':
            message = factory.joint_state(
                message.header,
                (*message.name, 'steer'),
                position=[*[np.nan] * len(message.name), 0.3],
                velocity=[*message.velocity, 0.0],
            )
        moved.append((topic.replace('/reference_odom', '/truth/odometry'), message, time))
    steered = rover.replace({'wheels.steering_joints': ['steer', 'steer']})
    truth = truth_of(make_bag(moved), steered)
    expected = 1.0 - 0.36 / np.cos(0.3) / 0.42
    np.testing.assert_allclose(truth.slip.value, np.full((40, 2), expected), atol=1e-12)


@pytest.mark.shared
def test_true_slip_of_a_measured_drive_is_that_of_its_table(shared):
    """The table has wheel speeds and the speed of each side, of the author's own making."""
    recording = shared / 'bags' / 'frostyboy_event_1_6_mcap'
    truth = truth_of(recording, reader.load(['frostyboy']))
    with (shared / 'frostyboy_snow' / 'event_1_6.csv').open() as file:
        rows = list(csv.DictReader(file))
    speed = np.array([[float(r['v_X'])] for r in rows])
    yaw = -np.array([[float(r['angAccel_Z'])] for r in rows])  # z counts clockwise
    rim = 0.265 * np.array([[float(r[f'w{w}']) for w in ('fl', 'fr', 'rl', 'rr')] for r in rows])
    ground = speed - yaw * np.array([0.571, -0.571, 0.571, -0.571])
    driving = (rim > 0.3) & (ground > 0.0) & (ground < rim)
    assert driving.sum() > 1000
    expected = 1.0 - ground / np.where(driving, rim, 1.0)
    found = truth.slip.value
    assert found.shape == expected.shape
    np.testing.assert_allclose(found[driving], expected[driving], atol=2e-6)


@pytest.mark.parametrize('count', [1, 7, 8, 9, 16, 17, 100, 1000, 1023])
def test_rows_stay_in_order_evenly_spread_and_few(count):
    rows = ThinnedRows(8)
    for stamp in range(count):
        rows.add(stamp, [float(stamp)])
    stamps = rows.stamps()
    assert min(count, 4) <= stamps.size <= 8
    np.testing.assert_array_equal(rows.values(1)[:, 0], stamps)
    steps = np.diff(stamps)
    assert stamps[0] == 0
    assert (steps == steps[:1]).all()
    assert count - stamps[-1] <= max(steps, default=1)


def sets(count: int):
    dice = np.random.default_rng(3)
    first = estimate_set()
    for i in range(count):
        yield replace(
            first,
            stamp=first.stamp + i * 50_000_000,
            slip=dice.uniform(-1.0, 1.0, first.slip.shape),
            sinkage=dice.uniform(0.0, 0.1, first.slip.shape),
            drawbar_pull=dice.uniform(-50.0, 50.0, first.slip.shape),
            pull_margin=dice.uniform(0.0, 90.0, first.slip.shape),
            sideways=Sideways(*dice.uniform(-0.9, 0.9, (4, *first.slip.shape)), 0.0, 0.0),
            slip_velocity=dice.uniform(-0.3, 0.3, first.slip.shape),
            slip_class=dice.choice([0, 1, 2, 3, 255], first.slip.shape).astype(np.uint8),
        )


def test_figures_of_a_thinned_drive_are_those_of_all_sets():
    names = tuple(f'w{i}' for i in range(estimate_set().slip.size))
    whole, thinned = HistoryRecorder(names), HistoryRecorder(names, 50)
    everything = list(sets(300))
    everything[0] = replace(
        everything[0],
        sinkage=np.full_like(everything[0].sinkage, 0.2),
        slip_class=np.full_like(everything[0].slip_class, 255),
    )
    for each in everything:
        whole.add(each)
        thinned.add(each)
    long, short = whole.history(), thinned.history()
    assert long.stamp.size == 300
    assert short.stamp.size <= 50
    border = Border(0.25, np.inf)
    summary, same = (
        summarise('', Replay(h, {}, Counter(), Counter(), ()), border) for h in (short, long)
    )
    assert summary == same
    assert summary.sets == 300
    classes, every = long.slip_class, {k: np.abs(v) for k, v in long.values.items()}
    for i, wheel in zip(range(classes.shape[1]), summary.wheels, strict=True):
        known = classes[:, i] != 255
        assert wheel.max_slip == every['slip'][known, i].max()
        since = int(np.argmax(known))  # not what is assumed before the first motion
        assert wheel.max_sinkage == every['sinkage'][since:, i].max()
        assert wheel.mean_pull == pytest.approx(long.values['drawbar_pull'][known, i].mean())
        assert wheel.least_margin == every['pull_margin'][:, i].min()
        assert wheel.max_lateral_force == every['lateral_force'][known, i].max()
        angles = np.percentile(long.values['slip_angle'][known, i], (5, 95))
        assert same.wheels[i].slip_angle == pytest.approx(angles)
        assert wheel.seconds['high'] == pytest.approx(0.05 * (classes[:-1, i] == 2).sum())
        assert wheel.shares['high'] == pytest.approx((classes[:-1, i] == 2).mean())
        slipping = np.isin(classes[:-1, i], (2, 3))
        assert wheel.slip_travel == pytest.approx(
            0.05 * every['slip_velocity'][:-1, i][slipping].sum()
        )
