# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady rows out of drives whose truth is known."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wheel_terra_estimator.bags.reader import parse_remaps
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.drives import windows
from wheel_terra_estimator.discrepancy.drives.series import Channel, SpeedSmoother, collect
from wheel_terra_estimator.discrepancy.drives.windows import (
    GOOD,
    SMOOTHED,
    DriveRows,
    block_moments,
    pooled_correlation,
    rows_from_bag,
    rows_from_measurements,
)
from wheel_terra_estimator.discrepancy.fitting.coordinates import soil_coordinates
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.selection.search import search
from wheel_terra_estimator.discrepancy.selection.verdict import choose
from wheel_terra_estimator.discrepancy.selection.weights import default_floors
from wheel_terra_estimator.discrepancy.tables.steady_table import operating_points
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.simulation import drive, scenario
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.model import WheelSoilModel

GRAVITY = 9.80665
RADIUS, LUG = 0.12, 0.01
SETTINGS = {
    'rover.mass': 40.0,
    'wheels.names': ['fl', 'fr', 'rl', 'rr'],
    'wheels.radius': [RADIUS] * 4,
    'wheels.width': [0.1] * 4,
    'wheels.lug_height': [LUG] * 4,
    'wheels.lug_count': [20] * 4,
    'wheels.x': [0.4, 0.4, -0.4, -0.4],
    'wheels.y': [0.3, -0.3, 0.3, -0.3],
    'wheels.passes': [1, 1, 2, 2],
    'rover.centre_of_gravity': [0.0, 0.0, 0.2],
    'sensors.torque_zero_std': 0.0,
    'sensors.torque_gain_std': 0.0,
    'sensors.sinkage_zero_std': 0.0,
    'sensors.specific_force_bias_std': 0.0,
}


def settings(**changes):
    return reader.from_parameters({**SETTINGS, **changes})


class Drive:
    """Sections of constant slip, slope and rate, with noise that lasts longer than a sample."""

    def __init__(self, sections, seed=0, persistence=0.8):
        self.sections = sections
        rng = np.random.default_rng(seed)
        self.measurements = []
        time = 0.0
        noise = np.zeros(5)
        for section in sections:
            end = time + section.get('duration', 40.0)
            while time < end - 1e-9:
                stamp = round(time * 1e9)
                noise = persistence * noise + np.sqrt(1 - persistence**2) * rng.standard_normal(5)
                self._emit(stamp, section, noise, rng)
                time += 0.1
        self.duration = time

    def _emit(self, stamp, section, noise, rng):
        slip, slope = section['slip'], section['slope']
        rate, yaw = section.get('rate', 0.5), section.get('yaw', 0.0)
        speed = (1 - slip) * rate * (RADIUS + LUG)
        torque = 3.0 + 10 * slip + 0.3 * noise[0]
        z = section.get('sinkage', [0.02] * 4) + 0.001 * noise[1]
        # Deeper behind tips the chassis nose-up; the accelerometer feels gravity alone.
        tilt = (np.mean(z[2:]) - np.mean(z[:2])) / 0.8
        pitch = slope + tilt
        force = GRAVITY * np.array([np.sin(pitch), 0.0, np.cos(pitch)])
        force[0] += 0.03 * noise[2]
        self.measurements += [
            WheelOdometry(stamp, np.full(4, rate), torque + 0.02 * rng.standard_normal(4)),
            InertialReading(stamp, force, np.array([0.0, 0.0, yaw]), None),
            SinkageReading(stamp, z),
        ]
        if stamp % 1_000_000_000 < 50_000_000:
            reading = speed + 0.002 * rng.standard_normal()
            self.measurements.append(ReferenceVelocity(stamp, reading, 0.002**2))


STAIRS = [
    {'slip': 0.1, 'slope': 0.0},
    {'slip': 0.2, 'slope': 0.07},
    {'slip': 0.35, 'slope': 0.14, 'sinkage': np.array([0.02, 0.02, 0.03, 0.03])},
]


@functools.cache
def up_the_stairs():
    return tuple(Drive(STAIRS).measurements)


def test_rows_are_what_was_driven():
    rows = rows_from_measurements(up_the_stairs(), settings())
    columns = rows.columns
    whole = np.isfinite(columns['drawbar_pull'])
    assert 0 < whole.sum() < len(whole)
    # Neither pull on a wheel's row nor torque on the mean wheel's: no cell is used twice.
    assert np.isnan(columns['torque'][whole]).all() and np.isnan(columns['sinkage'][whole]).all()
    for section in STAIRS:
        near = np.abs(columns['slope'] - section['slope']) < 0.01
        assert near.sum() >= 5
        for name, truth, tolerance in (
            ('slip', section['slip'], 0.02),
            ('torque', 3.0 + 10 * section['slip'], 0.6),
            ('drawbar_pull', 10.0 * GRAVITY * np.sin(section['slope']), 0.3),
            ('normal_load', 10.0 * GRAVITY * np.cos(section['slope']), None),
        ):
            values = columns[name][near & (whole if name == 'drawbar_pull' else ~whole)]
            if tolerance is None:  # loads move to the rear; their sum is the weight
                assert np.mean(values) == pytest.approx(truth, rel=0.003)
                assert values.std() > 0 or section['slope'] == 0
            else:
                assert values == pytest.approx(truth, abs=tolerance), name
    assert set(columns['pass_number'][~whole]) == {1.0, 2.0}
    assert rows.seconds[GOOD] == pytest.approx(sum(w.end - w.start for w in rows.windows))
    table = rows.table()
    assert len(table) == len(columns['slip'])
    assert any('steady windows' in note for note in table.notes)
    # Windows hold whole lug passages.
    period = 2 * np.pi / (20 * 0.5)
    for window in rows.windows:
        assert window.passages >= 10
        assert (window.end - window.start) == pytest.approx(window.passages * period, rel=1e-9)


def test_deviations_cover_the_truth():
    """Noise that lasts half a second: naive standard errors would be far too small."""
    deviations = []
    for seed in range(5):
        drive = Drive([{'slip': 0.2, 'slope': 0.05, 'duration': 150.0}], seed)
        rows = rows_from_measurements(drive.measurements, settings())
        pull = 10.0 * GRAVITY * np.sin(0.05)
        for window in rows.windows:
            deviations.append(
                [
                    (window.slip[0] - 0.2) / window.std['slip'][0],
                    (window.torque[0] - 5.0) / window.std['torque'][0],
                    (window.sinkage[0] - 0.02) / window.std['sinkage'][0],
                    (window.pull - pull) / window.std['pull'][0],
                ]
            )
    covered = np.mean(np.abs(deviations) < 2, axis=0)
    assert len(deviations) > 40
    assert np.all(covered > 0.85), covered
    assert np.all(np.std(deviations, axis=0) > 0.7), 'deviations are uselessly wide'


def test_shared_instrument_errors_do_not_average_out():
    """The rows together must not know a common shift better than the instrument does."""
    measurements = Drive([{'slip': 0.2, 'slope': 0.05, 'duration': 120.0}]).measurements
    exact = rows_from_measurements(measurements, settings())
    stated = rows_from_measurements(measurements, settings(**{'sensors.torque_zero_std': 0.2}))
    for rows, least in ((exact, 0.0), (stated, 0.2)):
        one_wheel = np.arange(len(rows.columns['slip'])) % 5 == 0
        std = rows.columns['torque_std'][one_wheel]
        together = 1 / np.sqrt(np.sum(std**-2.0))
        assert together > least
    assert together < 0.3


@pytest.mark.parametrize(
    ('section', 'quality'),
    [
        ({'slip': 0.2, 'slope': 0.0, 'yaw': 0.1}, 'turning'),
        ({'slip': 0.0, 'slope': 0.0, 'rate': 0.0}, 'standing'),
    ],
)
def test_what_is_not_steady_is_not_used_and_is_said(section, quality):
    drive = Drive([{'slip': 0.1, 'slope': 0.0, 'duration': 40.0}, {**section, 'duration': 40.0}])
    rows = rows_from_measurements(drive.measurements, settings())
    assert rows.seconds[quality] > 25.0
    assert all(window.end < 45.0 for window in rows.windows)
    assert any(quality in note for note in rows.notes)
    assert sum(rows.seconds.values()) == pytest.approx(drive.duration, abs=1.0)


@pytest.mark.parametrize(('rim_speed', 'stands'), [(0.0055, 12.0), (0.0065, 0.0)])
def test_a_rover_at_three_times_the_rest_speed_stands(rim_speed, stands):
    crawl = [{'slip': 0.1, 'slope': 0.0, 'rate': rim_speed / (RADIUS + LUG), 'duration': 12.0}]
    configuration = settings(rest_speed=0.002)
    series = collect(Drive(crawl).measurements, 4, 'a crawl')
    finder = windows._WindowFinder(series, configuration)
    finder.search()
    assert finder.seconds.get('standing', 0.0) == pytest.approx(stands, abs=0.5)
    settled = 0.0 if stands else 0.5 * RADIUS / rim_speed  # half a radius of rim travel
    assert finder.seconds.get('settling', 0.0) == pytest.approx(settled)


def test_digging_in_is_no_steady_row():
    drive = Drive([{'slip': 0.5, 'slope': 0.0, 'duration': 60.0}])
    sinking = [
        SinkageReading(m.stamp, m.sinkage + 2e-12 * m.stamp) if isinstance(m, SinkageReading) else m
        for m in drive.measurements
    ]
    with pytest.raises(UserError, match='digging in'):
        rows_from_measurements(sinking, settings())


@pytest.mark.parametrize(
    ('depth', 'rate', 'digs'),
    [(0.006, 15e-5, False), (0.006, 3e-4, True), (0.06, 6e-4, False), (0.06, 1e-3, True)],
)
def test_in_a_window_a_wheel_may_sink_by_a_tenth_and_by_two_hundredths_of_its_radius(
    depth, rate, digs
):
    """From half to half of a window of 6.3 s."""
    sinking = []
    for m in Drive([{'slip': 0.2, 'slope': 0.0, 'duration': 9.0}]).measurements:
        if isinstance(m, SinkageReading):
            m = SinkageReading(m.stamp, np.full(4, depth + rate * m.stamp * 1e-9))
        elif isinstance(m, ReferenceVelocity):
            m = replace(m, forward=0.8 * 0.5 * (RADIUS + LUG))
        elif isinstance(m, InertialReading):
            m = replace(m, specific_force=np.array([0.0, 0.0, GRAVITY]))
        sinking.append(m)
    finder = windows._WindowFinder(collect(sinking, 4, 'a drive'), settings())
    finder.search()
    assert ('digging in' in finder.seconds) == digs
    assert (GOOD in finder.seconds) != digs


def test_wheels_that_differ_have_no_mean_wheel():
    rows = rows_from_measurements(
        up_the_stairs(), settings(**{'wheels.radius': [0.12, 0.12, 0.115, 0.115]})
    )
    assert 'drawbar_pull' not in rows.columns
    assert any('no pull' in note for note in rows.notes)


def test_without_torque_and_sinkage_there_is_still_pull():
    kept = [
        WheelOdometry(m.stamp, m.rate, np.full(4, np.nan)) if isinstance(m, WheelOdometry) else m
        for m in up_the_stairs()
        if not isinstance(m, SinkageReading)
    ]
    rows = rows_from_measurements(kept, settings())
    assert 'torque' not in rows.columns and 'sinkage' not in rows.columns
    assert np.isfinite(rows.columns['drawbar_pull']).all()


def test_a_level_drive_hardly_pulls_and_is_a_table_all_the_same():
    level = [{'slip': 0.1, 'slope': 0.0, 'rate': rate} for rate in (0.4, 0.5, 0.6)]
    rows = rows_from_measurements(Drive(level).measurements, settings(), 'level')
    pulls, load = rows.columns['drawbar_pull'], rows.columns['normal_load']
    # Pulls that a measured table would be refused for: as if in kN, and far below their deviation.
    for share in (1e-3, 1e-6):
        small = share * np.nanmean(load) * pulls / np.nanmax(np.abs(pulls))
        table = replace(rows, columns={**rows.columns, 'drawbar_pull': small}).table()
        assert np.isfinite(table.measured[:, 1]).sum() == np.isfinite(pulls).sum()


def test_many_windows_are_merged_and_know_more():
    rows = rows_from_measurements(
        Drive([{**section, 'duration': 180.0} for section in STAIRS]).measurements, settings()
    )
    table = rows.table()
    assert len(table) <= 120 < 4 * len(rows.windows)
    single = np.median([w.std['torque'][0] for w in rows.windows])
    assert np.nanmedian(table.stated_std[:, 2]) < 0.8 * single


@functools.cache
def simulated():
    stairs = scenario.load(
        {
            'configuration': ['generic_six_wheel'],
            'duration': 36.0,
            'drive.time': [0.0],
            'drive.forward': [0.08],
            'slope.position': [0.0, 1.0, 1.2],
            'slope.angle_deg': [0.0, 0.0, 6.0],
        }
    )
    return drive.simulate(stairs, seed=2)


def true_slip(window):
    truth = simulated().truth
    time = (truth.stamp - truth.stamp[0]) * 1e-9
    inside = (time >= window.start) & (time < window.end)
    return np.nanmean(truth.slip[inside], axis=0)


def test_simulated_rover():
    """Slip, loads and pull of the simulator's own truth."""
    driven = simulated()
    rows = rows_from_measurements([a.measurement for a in driven.arrivals], driven.configuration)
    truth, time = driven.truth, (driven.truth.stamp - driven.truth.stamp[0]) * 1e-9
    assert len(rows.windows) >= 3
    for window in rows.windows:
        inside = (time >= window.start) & (time < window.end)
        assert np.all(np.abs(window.slip - true_slip(window)) < 4 * window.std['slip'])
        assert window.normal_load == pytest.approx(
            truth.normal_load[inside].mean(0), rel=0.12, abs=5
        )
        load = truth.normal_load[inside].mean()
        assert window.pull == pytest.approx(truth.drawbar_pull[inside].mean(), abs=0.012 * load)


@pytest.mark.slow
def test_smoothed_slip_is_nearer_the_truth():
    driven = simulated()
    heard = [a.measurement for a in driven.arrivals]
    plain = rows_from_measurements(heard, driven.configuration)
    smooth = rows_from_measurements(heard, driven.configuration, smooth=True)
    assert SMOOTHED in smooth.notes and SMOOTHED not in plain.notes
    errors = [
        np.sqrt(np.mean([(w.slip - true_slip(w)) ** 2 for w in rows.windows]))
        for rows in (plain, smooth)
    ]
    assert errors[1] < errors[0]
    for window in smooth.windows:
        assert np.all(np.abs(window.slip - true_slip(window)) < 2 * window.std['slip'])


def test_the_smoothed_speed_owes_nothing_to_torque_and_sinkage():
    def speed(measurements):
        smoother = SpeedSmoother(settings())
        passed_on = list(smoother.hear(measurements))
        assert all(a is b for a, b in zip(passed_on, measurements, strict=True))
        return smoother.speed()

    heard = list(up_the_stairs()[:70])
    other = [
        replace(m, torque=2.0 * m.torque) if isinstance(m, WheelOdometry) else m
        for m in heard
        if not isinstance(m, SinkageReading)
    ]
    before, after = speed(heard), speed(other)
    assert len(before.time) > 15 and before.time.tolist() == after.time.tolist()
    assert before.values.tolist() == after.values.tolist()


def test_silent_references_give_no_window_to_the_smoother_either():
    heard = [
        m
        for m in Drive([{'slip': 0.1, 'slope': 0.0, 'rate': 0.8, 'duration': 11.0}], 1).measurements
        if not (isinstance(m, ReferenceVelocity) and m.stamp > 5.1e9)
    ]
    smooth = rows_from_measurements(heard, settings(), smooth=True)
    assert smooth.seconds['no reference'] > 2.0
    assert [w.end < 5.1 for w in smooth.windows] == [True]


@pytest.mark.shared
def test_pathfinder_recording_skids_by_its_radius_error():
    bag = Path(__file__).parents[3] / 'shared/measured/bags/wvu_pathfinder_test17_mcap'
    if not bag.exists():
        pytest.skip(f'{bag} is not here')
    rows = rows_from_bag(
        bag, reader.load(['pathfinder']), parse_remaps(['reference_odom:=/truth/odometry'])
    )
    # The stated radius is 6 % too small: wheels that roll seem to skid by that much.
    assert -0.12 < np.mean(rows.columns['slip']) < -0.03
    assert len(rows.windows) >= 5


def first_order_blocks(correlation, lengths, seed):
    """Blocks of one first-order process each, with steps of its stationary variance."""
    rng = np.random.default_rng(seed)
    found = []
    for length in lengths:
        values = np.empty((length, 1))
        values[0] = rng.standard_normal()
        for k in range(1, length):
            step = np.sqrt(1.0 - correlation**2) * rng.standard_normal()
            values[k] = correlation * values[k - 1] + step
        found.append(values)
    return found


@pytest.mark.parametrize('correlation', [0.2, 0.5, 0.8])
def test_pooled_correlation_does_not_hang_on_the_order_of_blocks(correlation):
    blocks = first_order_blocks(correlation, [6, 9, 30] * 200, seed=4)
    found = pooled_correlation(blocks)
    assert found == pytest.approx(correlation, abs=0.04)
    shuffled = [blocks[k] for k in np.random.default_rng(1).permutation(len(blocks))]
    assert pooled_correlation(shuffled) == pytest.approx(found, abs=1e-6)
    assert pooled_correlation(blocks[::-1]) == pytest.approx(found, abs=1e-6)


@pytest.mark.parametrize('length', [4, 12])
def test_variance_of_the_mean_of_a_block(length):
    """Against the scatter of the means of many blocks."""
    blocks = first_order_blocks(0.6, [length] * 4000, seed=7)
    means = np.var([block.mean() for block in blocks])
    neighbours, squares, of_mean = block_moments(length, 0.6)
    assert of_mean == pytest.approx(means, rel=0.08)
    left = [block - block.mean() for block in blocks]
    assert np.mean([(d * d).sum() for d in left]) == pytest.approx(squares, rel=0.05)
    assert np.mean([(d[1:] * d[:-1]).sum() for d in left]) == pytest.approx(
        neighbours, abs=0.05 * squares
    )


def test_two_readings_of_each_sensor_are_a_drive_and_one_is_none():
    zero = np.zeros(4)
    drive = [
        m
        for t in (10**9, 2 * 10**9)
        for m in (
            WheelOdometry(t, zero + 0.4, zero),
            InertialReading(t, np.array([0.0, 0.0, 9.8]), np.zeros(3), None),
            ReferenceVelocity(t, 0.1, 1e-4),
        )
    ]
    found = collect(drive, 4, 'a drive')
    assert found.rate.time.tolist() == [0.0, 1.0]
    for kind, topic in (
        (WheelOdometry, 'wheel odometry'),
        (InertialReading, 'imu/data'),
        (ReferenceVelocity, 'reference_odom'),
    ):
        first, second = (m for m in drive if isinstance(m, kind))
        for lost in ((first,), (first, second)):
            with pytest.raises(UserError, match=f'drive.mcap: no {topic}'):
                collect([m for m in drive if all(m is not one for one in lost)], 4, 'drive.mcap')
    # Two of four references state a variance: their errors are apart, the smoother's are one.
    values = np.array([[0.1, 4e-4], [0.1, 0.0], [0.1, 4e-4], [0.1, np.nan]])
    stated = replace(found, reference=Channel(np.arange(4.0), values))
    assert stated.speed_std(0.0, 9.0) == pytest.approx(0.02 / np.sqrt(2.0))
    assert replace(stated, smoothed=stated.reference).speed_std(0.0, 9.0) == pytest.approx(0.02)
    assert stated.speed_std(1.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ('step', 'at', 'told'), [(0.0, 40, False), (0.05, 60, True), (-0.05, 60, True), (0.5, 79, True)]
)
def test_a_drift_is_a_mean_that_changes(step, at, told):
    """Noise of 0.01 about 0.3, with a step: in the middle, or only in the last value."""
    values = 0.3 + 0.01 * np.random.default_rng(5).standard_normal(80)
    values[at:] += step
    assert windows._drifts(values, 0.03) == told


def test_wheels_that_spin_on_the_spot_make_no_window():
    """Their slip is 1, or by the noise of the reference beyond: no row of a table."""
    spins = {'slip': 1.0, 'slope': 0.14}
    rows = rows_from_measurements(Drive([*STAIRS, spins]).measurements, settings())
    assert rows.seconds['no way made'] > 30.0
    assert rows.table().columns['slip'].max() < 0.5


def test_wheels_of_a_moment_share_the_error_of_the_speed():
    """All wheels of a window tell its speed together, beside loads that err."""
    configuration = settings(**{'soil.source': ''})
    rng = np.random.default_rng(4)
    count = 12
    moment = np.repeat(np.arange(count), 4)
    slip = np.linspace(0.05, 0.6, count)[moment] + 0.01 * rng.standard_normal(4 * count)
    columns = {
        'time': 10.0 * moment,
        'slip': slip,
        'normal_load': np.tile([85.0, 95.0, 100.0, 110.0], count),
    }
    points = operating_points(columns, configuration, 'drive')
    state = WheelSoilModel(configuration.soil, {}).steady_state(points)
    columns['normal_load'] = columns['normal_load'] * (1.0 + 0.01 * rng.standard_normal(slip.size))
    columns['slip'] = slip + (0.04 * rng.standard_normal(count))[moment]
    columns['slip_std'] = np.full(slip.size, 0.04)
    for name, values, noise in (('sinkage', state.sinkage, 1e-3), ('torque', state.torque, 0.2)):
        columns[name] = values + noise * rng.standard_normal(slip.size)
        columns[f'{name}_std'] = np.full(slip.size, noise)
    table = DriveRows('drive', columns, (), {}, ()).table()
    soil = soil_coordinates(configuration.soil, {})
    forward = Forward(
        operating_points(table.columns, configuration, 'drive'), configuration.soil, {}, catalogue()
    )
    findings = search(table, forward, soil, {}, default_floors())
    told = findings.setting.forward.points.slip
    off = (told - table.columns['slip']).reshape(count, 4)
    assert np.ptp(off, axis=1).max() < 0.02
    assert np.std(told - slip) < 0.8 * np.std(table.columns['slip'] - slip)
    assert choose(findings.selection, findings.setting.problem).status == 'agrees'
    # Torques of the first and the last wheel of a moment differ by noise, own slip and 1 % of load.
    heavier = replace(points, normal_load=1.01 * points.normal_load)
    by_load = WheelSoilModel(configuration.soil, {}).steady_state(heavier).torque - state.torque
    pair = [np.flatnonzero(moment == count // 2)[k] for k in (0, -1)]
    problem = findings.setting.problem
    a, b = (np.flatnonzero((problem.row == k) & (problem.quantity == 2))[0] for k in pair)
    known = problem.covariance(1.0)
    apart = (
        known[a, a] + known[b, b] - 2.0 * known[a, b] - problem.std[a] ** 2 - problem.std[b] ** 2
    )
    assert apart > 0.8 * (by_load[pair] ** 2).sum()
