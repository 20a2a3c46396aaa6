# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Maps of drives against ways that are known in closed form."""

import csv
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from estimate_sets import some_estimates

from wheel_terra_estimator.bags.track import COLUMNS, TrackRecorder
from wheel_terra_estimator.estimation.measurements import InertialReading
from wheel_terra_estimator.reporting.drive_figure import way_figure
from wheel_terra_estimator.reporting.estimates_table import write_track

SPEED, YAW_RATE, STEP = 0.1, 0.05, 50_000_000
START = 1_000_000_000


def drive(rover, count, yaw_rate=YAW_RATE, **fields):
    """Sets at a constant speed and yaw rate."""
    soil = rover.soil
    stated = (math.degrees(soil.friction_angle), float(soil.frictional_modulus))
    base = replace(
        some_estimates(),
        stamp=START,
        forward_velocity=SPEED,
        yaw_rate=yaw_rate,
        soil_names=('soil.friction_angle_deg', 'soil.frictional_modulus', 'soil.cohesive_modulus'),
        soil=np.array([*stated, float(soil.cohesive_modulus)]),
        soil_std=np.ones(3),
        **fields,
    )
    return [replace(base, stamp=START + i * STEP) for i in range(count)]


def recorded(rover, sets, attitudes=()):
    recorder = TrackRecorder(rover)
    for reading in attitudes:
        recorder.hear(reading)
    for estimates in sets:
        recorder.add(estimates)
    return recorder


def test_a_circle_closes(rover):
    whole = round(2.0 * math.pi / YAW_RATE / (STEP * 1e-9))
    values = recorded(rover, drive(rover, whole + 1)).track().values
    radius = SPEED / YAW_RATE
    assert np.hypot(values['x'][-1], values['y'][-1]) < 0.03
    assert values['distance'][-1] == pytest.approx(2.0 * math.pi * radius, rel=2e-3)
    assert values['y'].max() == pytest.approx(2.0 * radius, rel=5e-3), 'a left turn'
    np.testing.assert_allclose(values['soil_strength'], 1.0)
    np.testing.assert_allclose(values['soil_stiffness'], 1.0)


def test_orientation_gives_heading_and_height(rover):
    """Nose up by 0.2 rad (a negative pitch, REP 103), heading north."""
    heading, pitch = math.pi / 2.0, -0.2
    cy, sy, cp, sp = (f(a / 2.0) for a in (heading, pitch) for f in (math.cos, math.sin))
    q = np.array([-sy * sp, cy * sp, sy * cp, cy * cp])
    attitudes = [InertialReading(START + i * STEP, np.zeros(3), np.zeros(3), q) for i in range(201)]
    values = recorded(rover, drive(rover, 201, yaw_rate=0.7), attitudes).track().values
    way = SPEED * 200 * STEP * 1e-9
    end = [values[name][-1] for name in 'xyz']
    np.testing.assert_allclose(end, [0.0, way * math.cos(0.2), way * math.sin(0.2)], atol=0.01)


def test_nothing_is_reckoned_over_a_pause_or_a_step_of_the_clock(rover):
    sets = drive(rover, 100, yaw_rate=0.0)
    later = [replace(s, stamp=s.stamp + 60_000_000_000) for s in sets]
    values = recorded(rover, [*sets, *later, *sets]).track().values
    assert values['x'][-1] == pytest.approx(3 * 99 * SPEED * STEP * 1e-9, abs=0.03)


def test_a_point_stands_every_two_centimetres_and_every_second_of_standing(rover):
    driven = drive(rover, 41, yaw_rate=0.0)  # 5 mm from set to set
    standing = drive(rover, 60, yaw_rate=0.0)
    standing = [replace(s, stamp=s.stamp + 41 * STEP, forward_velocity=0.0) for s in standing]
    values = recorded(rover, [*driven, *standing]).track().values
    way, time = np.diff(values['distance']), np.diff(values['time'])
    assert way[:7] == pytest.approx(0.02, abs=0.0051) and (way[:7] > 0.0199).all()
    assert (way[-2:] == 0.0).all()
    assert time[-2:] == pytest.approx(1.0)


def test_table_and_strip(rover, tmp_path):
    sets = drive(rover, 400, yaw_rate=0.0)
    sets[200:300] = [replace(s, slip_class=np.array([0, 2], dtype=np.uint8)) for s in sets[200:300]]
    sets[280:] = [replace(s, stuck=True) for s in sets[280:]]
    track = recorded(rover, sets).track()
    write_track(track, tmp_path / 'way.csv')
    with (tmp_path / 'way.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        'stamp [ns]',
        *(f'{name} [{unit}]' if unit else name for name, unit in COLUMNS.items()),
    ]
    assert float(rows[-1]['x [m]']) == pytest.approx(track.values['x'][-1], rel=1e-5)
    assert {row['slip_class'] for row in rows} == {'0', '2'}
    strip = way_figure(track).drawn()[0].curves
    high = next(curve.path for curve in strip if curve.name == 'high')
    begin, end = (float(v) for v in re.match(r'M([\d.]+) [\d.]+H([\d.]+)', high).groups())
    way = track.values['distance'][track.values['slip_class'] == 2]
    assert (begin, end) == (pytest.approx(way[0], rel=1e-4), pytest.approx(way[-1], abs=0.05))
