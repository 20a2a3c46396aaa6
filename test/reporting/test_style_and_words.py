# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lines keep their peaks, names lose what they share, pages hold what they show."""

import re
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS, Border, known
from wheel_terra_estimator.reporting.drive_summary import (
    DriveSummary,
    MessageRow,
    WheelSummary,
    as_text,
    short_names,
)
from wheel_terra_estimator.reporting.html import picture, render
from wheel_terra_estimator.reporting.style import DARK, INK, for_dark_pages, picture_style, thin


def test_a_thinned_line_keeps_ends_and_extremes():
    x = np.linspace(0.0, 100.0, 50_000)
    y = np.sin(x)
    y[31_234], y[7_777] = 9.0, -9.0
    few_x, few_y = thin(x, y, 1000)
    assert few_x.size < 1100
    assert (few_x[0], few_x[-1]) == (x[0], x[-1])
    assert (np.diff(few_x) > 0.0).all()
    assert (few_y.max(), few_y.min()) == (9.0, -9.0)
    np.testing.assert_array_equal(few_y, y[np.searchsorted(x, few_x)])
    # Short lines and gaps are left alone.
    x, y = np.arange(10.0), np.full(10, np.nan)
    assert thin(x, y)[1] is y
    x, y = np.arange(10_000.0), np.full(10_000, np.nan)
    y[5000] = 1.0
    assert np.nanmax(thin(x, y, 100)[1]) == 1.0


def test_short_names():
    assert short_names(['front_left_wheel_joint', 'rear_right_wheel_joint']) == [
        'front_left',
        'rear_right',
    ]
    assert short_names(['wheel_1', 'wheel_2']) == ['wheel_1', 'wheel_2']
    assert short_names(['wheel', 'wheel']) == ['wheel', 'wheel']
    assert short_names(['only_wheel']) == ['only_wheel']


def test_figures_of_any_size_stand_apart():
    seconds = {c.name.lower(): 86400.0 for c in SlipClass}
    wheel = WheelSummary(
        'a', seconds, seconds, 0.95, 0.19, 0.13, 0, 0, 0, (0.4, 0.6), (0.1, 0.16), 0.09
    )
    heard = MessageRow('odom', '/odom', 5, '')
    lines = as_text(DriveSummary('', 86400.0, 1, (wheel,), (), (heard,), ())).splitlines()
    titles, row = (line for line in lines if line.startswith(('  time in', '  a ')))
    cells = re.split(' {3,}', row.strip())
    assert cells[1:] == ['86400.0'] * 5 + ['0.40 to 0.60', '0.95', '100 to 160 +- 90', '190 +- 130']
    assert len(re.split(' {3,}', titles.strip())) == len(cells)
    assert len(titles) == len(row)
    assert any(line.split() == ['messages', 'received', 'rejected'] for line in lines)


def test_the_same_picture_is_the_same_text_and_no_setting_stays():
    import matplotlib as mpl
    from matplotlib.figure import Figure

    before = dict(mpl.rcParams)
    made = []
    for _ in range(2):
        with picture_style():
            figure = Figure()
            figure.subplots().plot([0, 1], [0, 1])
        made.append(picture(figure))
    assert made[0] == made[1]
    assert dict(mpl.rcParams) == before


def test_text_of_others_is_escaped(tmp_path):
    folder = Path(str(tmp_path))
    (folder / 'page.html').write_text(
        "{% extends 'base.html' %}{% block title %}{{ name }}{% endblock %}"
    )
    page = render('page.html', folder, name='<script>alert(1)</script>')
    assert '<script>' not in page


def lightness(colour: str) -> float:
    """Return CIE L* of an sRGB colour (IEC 61966-2-1, CIE 1976)."""
    channels = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    luminance = float(np.dot(linear, (0.2126, 0.7152, 0.0722)))
    return 116.0 * luminance ** (1.0 / 3.0) - 16.0


def test_classes_differ_in_grey_and_darker_is_worse():
    ranked = [SlipClass.LOW, SlipClass.MODERATE, SlipClass.HIGH, SlipClass.STUCK]
    levels = [lightness(CLASS_COLOURS[c]) for c in ranked]
    assert (-np.diff(levels) > 12.0).all(), levels
    dark = [lightness(DARK[CLASS_COLOURS[c]]) for c in ranked]
    assert (np.diff(dark) > 12.0).all(), dark


def test_what_is_beyond_the_border_is_not_known():
    values = {
        'slip': np.array([[1.0], [0.2], [0.3]]),
        'slip_std': np.array([[0.1], [0.25], [0.26]]),
        'sinkage': np.array([[0.05], [0.02], [0.01]]),
        'sinkage_std': np.array([[0.137], [0.06], [0.01]]),
    }
    history = SimpleNamespace(values=values, slip_class=np.array([[255], [0], [0]], dtype=np.uint8))
    border = Border(slip=0.25, sinkage=0.5 * np.array([0.13]))
    np.testing.assert_array_equal(known(history, 'slip', border)[:, 0], [np.nan, 0.2, np.nan])
    np.testing.assert_array_equal(known(history, 'sinkage', border)[:, 0], [np.nan, 0.02, 0.01])


def test_pictures_follow_the_dark_mode_of_the_reader():
    """Every dark ink of a picture has a rule that makes it light; nothing else is touched."""
    from matplotlib.figure import Figure

    with picture_style():
        figure = Figure(figsize=(3, 2))
        axis = figure.subplots()
        axis.plot([0, 1], [0, 1], color=INK, label='a line')
        axis.set(title='title', xlabel='x', ylabel='y')
        axis.legend()
        buffer = StringIO()
        figure.savefig(buffer, format='svg')
    drawn = buffer.getvalue()
    used = set(re.findall(r'(?:fill|stroke): (#[0-9a-f]{6})', drawn))
    dark = {colour for colour in used if lightness(colour) < 45.0}
    assert INK in dark
    sheet = re.search(r'<style>(@media screen.*?)</style>', for_dark_pages(drawn))[1]
    rules = dict(re.findall(r'"fill: (#[0-9a-f]{6})"\]\{fill:(#[0-9a-f]{6})', sheet))
    assert dark <= set(rules)
    assert all(lightness(rules[colour]) > 60.0 for colour in dark)
    texts = re.findall(r'<text style="([^"]*)"', drawn)
    assert texts
    assert all('fill: ' in style for style in texts)  # black by default would vanish
