# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The drawing of a drive: paths are where the data are, words are beside them."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.reporting.drive_figure import drive_figure
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.html import render
from wheel_terra_estimator.reporting.time_figure import (
    HEIGHT,
    Panel,
    Switch,
    TimeFigure,
    limits,
    nice,
)

LEAST_APART = 14.0  # px between two lines of text of 12 px
PANELS = 800.0  # px of all panels together (templates/base.html)
NARROWEST = 230.0  # px of a panel on a phone


def a_figure() -> TimeFigure:
    panels = (Panel('slip [-]', 0.2, (-0.25, 1.0)), Panel('class', 0.12, strips=('a', 'b', 'c')))
    figure = TimeFigure(panels, (Switch('w', 'wheel'), Switch('band', 'band', on=False)), 50.0, 't')
    x = np.linspace(0.0, 50.0, 101)
    y = np.sin(x / 20.0)
    y[40:45] = np.nan
    figure.line(0, x, y, 'wheel', '#0083d3', 'w')
    figure.band(0, x, y, np.full(101, 0.1), '#0083d3', 'w')
    figure.strips(1, x, np.arange(101)[:, None] >= np.array([20, 50, 80]), 'high', '#c4552d')
    for start in (10.0, 10.5, 30.0, 49.9):
        figure.shade(start, start + 0.2)
    return figure


def test_a_path_is_where_the_data_are_and_broken_where_they_are_not():
    line = next(c for c in a_figure().drawn()[0].curves if 'line' in c.classes)
    assert line.path.count('M') == 2
    places = np.array(re.findall(r'[ML]([-\d.]+) ([-\d.]+)', line.path), dtype=float)
    assert len(places) == 96
    slip = 1.0 - places[:, 1] / HEIGHT * 1.25
    assert slip == pytest.approx(np.sin(places[:, 0] / 20.0), abs=2e-4)


def test_a_drive_is_drawn_in_the_units_of_its_panels():
    """Two wheels at 0.1 m/s; rims run 0.02 and 0.06 m/s faster, ruts are 12 mm deep."""
    both, seconds = np.ones((11, 2)), np.linspace(0.0, 10.0, 11)
    values = {'slip': 0.3, 'sinkage': 0.012, 'drawbar_pull': 40.0, 'slip_velocity': 0.0}
    deviations = {'slip_std': 0.05, 'sinkage_std': 0.002, 'drawbar_pull_std': 3.0}
    history = SimpleNamespace(
        names=('left_wheel', 'right_wheel'),
        seconds=seconds,
        forward_velocity=np.full(11, 0.1),
        values={name: value * both for name, value in (values | deviations).items()},
        slip_class=np.zeros((11, 2), dtype=int),
        warning_times=(),
    )
    history.values['slip_velocity'] = both * (0.02, 0.06)
    figure = drive_figure(history, None, Border(slip=0.3, sinkage=0.01))
    (deviations_drawn,) = re.findall(r'± (\S+) standard', figure.switches[-1].text)
    lines = {(line.panel, line.curve.name): line.y for line in figure._lines if line.y.ndim == 1}
    assert lines[0, 'mean rim speed'] == pytest.approx(0.14)
    assert lines[0, 'body'] == pytest.approx(0.1)
    bands = {line.panel: line.y for line in figure._lines if line.y.ndim == 2}
    for panel, value, std in ((1, 0.3, 0.05), (3, 12.0, 2.0), (4, 40.0, 3.0)):
        assert lines[panel, 'right'] == pytest.approx(value)
        half = float(deviations_drawn) * std
        low, high = bands[panel]
        assert low == pytest.approx(value - half) and high == pytest.approx(value + half)


def test_strips_begin_and_end_with_their_class():
    (strip,) = a_figure().drawn()[1].curves
    assert [float(v) for v in re.findall(r'M([\d.]+) ', strip.path)] == [10.0, 25.0, 40.0]
    tops = [float(v) for v in re.findall(r'M[\d.]+ ([\d.]+)H', strip.path)]
    rows = (np.array(tops) / HEIGHT * 3).astype(int)
    assert rows.tolist() == [0, 1, 2]


def test_no_two_words_meet_and_none_lies_in_a_drawing(tmp_path):
    figure = a_figure()
    for panel in figure.drawn():
        places = np.sort([tick.share for tick in panel.ticks])
        assert (places >= 0.0).all() and (places <= 1.0).all()
        assert (np.diff(places) * panel.share * PANELS > LEAST_APART).all(), panel.title
    marks = figure.marks()
    assert [mark.text for mark in marks] == ['1', '3', '4']  # 2 would stand on 1
    assert (np.diff([mark.share for mark in marks]) * NARROWEST > LEAST_APART).all()
    (tmp_path / 'page.html').write_text(
        "{% from 'time_figure.html' import time_figure %}{{ time_figure(figure, 'a', 'b') }}"
    )
    page = render('page.html', tmp_path, figure=figure)
    for drawing in re.findall(r'<svg.*?</svg>', page, re.S):
        assert not re.search(r'<(text|foreignObject|image)', drawing)
    assert '<script src' not in page


@pytest.mark.parametrize(
    ('low', 'high'), [(0.0, 1.0), (0.0, 0.4), (-0.05, 1.2), (-3e3, 7e3), (0.011, 0.0118)]
)
def test_round_numbers_within_limits(low, high):
    numbers = nice(low, high)
    assert 2 <= len(numbers) <= 6
    for value, text in numbers:
        assert low - 1e-9 <= value <= high + 1e-9
        assert float(text.replace('\u2212', '-')) == pytest.approx(value, abs=1e-12)
    digits = [text.partition('.')[2] for _, text in numbers]  # no more than tell them apart
    assert len({len(d) for d in digits}) == 1 and any(not d or d[-1] != '0' for d in digits)
    assert nice(1.0, 1.0) == []


def test_limits_leave_the_same_room_on_both_sides():
    low, high = limits(np.array([0.0, np.nan, 10.0]), within=(2.0, 3.0))
    assert 0.0 - low == pytest.approx(high - 10.0)
    assert 0.5 < high - 10.0 < 1.0
