# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What slopes would cost, as the drive ended: a table and a figure."""

from __future__ import annotations

from pathlib import Path

from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import SLOPES, SlipOnSlope
from wheel_terra_estimator.reporting.style import LINE_COLOURS, WARNING_COLOUR
from wheel_terra_estimator.reporting.time_figure import Panel, Switch, TimeFigure

WITHIN = 1.96
"""Deviations that hold 95 % of a Gaussian."""
_HEAD = ('slope [deg]', 'slip [-]', 'slip_std [-]', 'entrapment_probability [-]')


def check_slopes(path: Path) -> None:
    """Refuse, before anything is computed, a table that cannot be written."""
    if path.suffix != '.csv':
        raise UserError(f'{path}: the table of slip on slopes ends in .csv')


def write_slopes(found: SlipOnSlope, path: Path) -> None:
    """Write a row for each slope as CSV."""
    rows = zip(SLOPES, *found, strict=True)
    write_csv(path, _HEAD, ([f'{value:.6g}' for value in row] for row in rows))


def slopes_figure(found: SlipOnSlope) -> TimeFigure:
    """Return slip over slope uphill with its band of 95 %, and the probability of entrapment."""
    uphill = SLOPES >= 0.0
    slopes, half = SLOPES[uphill], WITHIN * found.std[uphill]
    panels = Panel('slip ratio [-]', 0.25, (-0.05, 1.05)), Panel('entrapment [-]', 0.12, (0.0, 1.0))
    switches = (Switch('band', 'band of 95 %'),)
    figure = TimeFigure(panels, switches, float(slopes[-1]), 'slope, uphill [deg]')
    slip = found.slip[uphill]
    figure.band(0, slopes, slip, half, LINE_COLOURS[0])
    figure.line(0, slopes, slip, 'slip expected', LINE_COLOURS[0])
    figure.line(1, slopes, found.entrapment[uphill], 'probability', WARNING_COLOUR)
    return figure
