# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Lines keep their peaks, names lose what they share, pages hold what they show."""

from __future__ import annotations

import numpy as np

from wheel_terra_estimator.reporting.drive_summary import short_names
from wheel_terra_estimator.reporting.html import picture, render
from wheel_terra_estimator.reporting.style import picture_style, thin


def test_a_thinned_line_keeps_ends_and_extremes() -> None:
    x = np.linspace(0.0, 100.0, 50_000)
    y = np.sin(x)
    y[31_234], y[7_777] = 9.0, -9.0
    few_x, few_y = thin(x, y, 1000)
    assert few_x.size < 1100
    assert (few_x[0], few_x[-1]) == (x[0], x[-1])
    assert (np.diff(few_x) > 0.0).all()
    assert (few_y.max(), few_y.min()) == (9.0, -9.0)
    np.testing.assert_array_equal(few_y, y[np.searchsorted(x, few_x)])


def test_short_lines_and_gaps_are_left_alone() -> None:
    x, y = np.arange(10.0), np.full(10, np.nan)
    assert thin(x, y)[1] is y
    x, y = np.arange(10_000.0), np.full(10_000, np.nan)
    y[5000] = 1.0
    assert np.nanmax(thin(x, y, 100)[1]) == 1.0


def test_short_names() -> None:
    assert short_names(['front_left_wheel_joint', 'rear_right_wheel_joint']) == [
        'front_left',
        'rear_right',
    ]
    assert short_names(['wheel_1', 'wheel_2']) == ['wheel_1', 'wheel_2']
    assert short_names(['wheel', 'wheel']) == ['wheel', 'wheel']
    assert short_names(['only_wheel']) == ['only_wheel']


def test_the_same_picture_is_the_same_text_and_no_setting_stays() -> None:
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


def test_text_of_others_is_escaped(tmp_path: object) -> None:
    from pathlib import Path

    folder = Path(str(tmp_path))
    (folder / 'page.html').write_text(
        "{% extends 'base.html' %}{% block title %}{{ name }}{% endblock %}"
    )
    page = render('page.html', folder, name='<script>alert(1)</script>')
    assert '<script>' not in page
