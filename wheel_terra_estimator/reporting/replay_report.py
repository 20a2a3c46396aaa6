# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a drive: one HTML file with pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.track import Track
from wheel_terra_estimator.bags.truth import Truth
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.output_folder import new_file
from wheel_terra_estimator.reporting import drive_pictures, track_picture
from wheel_terra_estimator.reporting.drive_figure import drive_figure
from wheel_terra_estimator.reporting.drive_style import BAND, CLASS_COLOURS
from wheel_terra_estimator.reporting.drive_summary import DriveSummary
from wheel_terra_estimator.reporting.html import picture, render, write_page
from wheel_terra_estimator.reporting.time_figure import plotly_script
from wheel_terra_estimator.reporting.truth_scores import QuantityError, TruthErrors


def write_replay_report(
    path: Path,
    summary: DriveSummary,
    history: EstimateHistory,
    truth: Truth | None,
    configuration: Configuration,
    overwrite: bool = False,
    findings: Sequence[Any] = (),
    errors: TruthErrors | None = None,
    filtered: EstimateHistory | None = None,
    filter_errors: TruthErrors | None = None,
    track: Track | None = None,
) -> None:
    """Write the report of a drive.

    Parameters
    ----------
    path : Path
        HTML file to be written.
    summary, history : DriveSummary, EstimateHistory
        What happened.
    truth : Truth or None
        Drawn beside the estimates where it is known.
    configuration : Configuration
        Listed at the end, with the sources of the effects in it.
    overwrite : bool
        Whether an earlier report is replaced.
    findings : sequence, optional
        What a check of the recording found (``words``, ``wheel``, ``cure``), shown at the top.
    errors : TruthErrors, optional
        How far the estimates are from a truth that may judge them.
    filtered, filter_errors : EstimateHistory, TruthErrors, optional
        What the filter said, where the estimates are those of the smoother: both are shown.
    track : Track, optional
        Where the rover was.
    """
    from wheel_terra_estimator.terramechanics.effects import catalogue

    effects = catalogue()
    values = configuration.flat()
    page = render(
        'replay.html',
        summary=summary,
        rover=configuration.rover.name or 'rover',
        tone='bad' if summary.warnings or not summary.sets else _tone(summary),
        cards=_cards(summary),
        classes=[
            {'key': c.name.lower(), 'name': c.name.lower(), 'colour': colour}
            for c, colour in CLASS_COLOURS.items()
        ],
        pictures=_pictures(history, truth) if summary.sets else [],
        figure=drive_figure(history, truth) if summary.sets else '',
        library=plotly_script() if summary.sets else '',
        findings=findings,
        errors=[_error_row(error) for error in errors.quantities] if errors else [],
        filter_errors=(
            [_error_row(error) for error in filter_errors.quantities] if filter_errors else []
        ),
        map=_map(track) if track and track_picture.has_map(track) else None,
        smoothed=_smoothed_pictures(history, filtered, truth) if summary.sets else [],
        truth_source=truth.source if truth else '',
        provenance=configuration.provenance,
        parameters=[(key, values[key]) for key in values if key in configuration.stated],
        sources=[(name, effects[name].source) for name in configuration.effects],
    )
    with new_file(path, overwrite) as fresh:
        write_page(fresh, page)


def _error_row(error: QuantityError) -> dict[str, str]:
    scale, unit = (1e3, 'mm') if error.unit == 'm' else (1.0, error.unit)
    return {
        'quantity': f'{error.name.replace("_", " ")} [{unit}]',
        'rms': f'{scale * error.rms:.3g}',
        'bias': f'{scale * error.bias:+.2g}',
        'worst': f'{scale * error.worst:.3g}',
        'within': f'{100 * error.within_two_std:.0f} %',
    }


def _tone(summary: DriveSummary) -> str:
    high = any(wheel.seconds['high'] + wheel.seconds['stuck'] > 0.0 for wheel in summary.wheels)
    return 'warn' if high else 'good'


def _cards(summary: DriveSummary) -> list[dict[str, str]]:
    if not summary.wheels:
        return []
    deepest = max(summary.wheels, key=lambda wheel: wheel.max_sinkage)
    slipping = max(wheel.max_slip for wheel in summary.wheels)
    stuck = max(wheel.seconds['stuck'] for wheel in summary.wheels)
    unknown = sum(wheel.shares[SlipClass.UNKNOWN.name.lower()] for wheel in summary.wheels)
    return [
        {'value': str(len(summary.warnings)), 'label': 'stuck warnings'},
        {'value': f'{slipping:.2f}', 'label': 'greatest |slip|'},
        {'value': f'{stuck:.1f} s', 'label': 'longest time of a wheel in class stuck'},
        {
            'value': f'{1000 * deepest.max_sinkage:.0f} ± {1000 * deepest.max_sinkage_std:.0f} mm',
            'label': f'greatest sinkage ({deepest.name})',
        },
        {
            'value': f'{100 * unknown / len(summary.wheels):.0f} %',
            'label': 'of the time at rest or unknown',
        },
    ]


def _map(track: Track) -> dict[str, str]:
    return {
        'source': picture(track_picture.map_of(track)),
        'caption': f'Position {track.source}; circle: start, cross: stuck warning. Strength: what '
        'was learned of cohesion and friction, over what the soil file states.',
    }


def _smoothed_pictures(
    history: EstimateHistory, filtered: EstimateHistory | None, truth: Truth | None
) -> list[dict[str, str]]:
    """Return pictures of smoother and filter; none where there is no smoother."""
    if filtered is None:
        return []
    dashed = ' The truth is dashed.' if truth else ''
    return [
        {
            'title': f'{title}: smoother and filter',
            'source': picture(drive_pictures.smoother_and_filter(history, filtered, name, truth)),
            'caption': f'Colour: smoother, with ± {BAND:g} standard deviations; grey: the filter '
            f'as it was live.{dashed}',
        }
        for title, name in (('Slip', 'slip'), ('Drawbar pull', 'drawbar_pull'))
    ]


def _pictures(history: EstimateHistory, truth: Truth | None) -> list[dict[str, str]]:
    beside = f' The truth ({truth.source}) is dashed.' if truth else ''
    band = f'Bands are ± {BAND:g} standard deviations.'
    red = ' Red: stuck warning.' if history.warnings else ''
    drawn = (
        (
            'The drive at a glance',
            drive_pictures.overview(history, truth),
            'Body velocity against the mean rim speed, then slip, class, sinkage and drawbar pull '
            f'of each wheel.{beside}{red}',
        ),
        (
            'Slip, wheel by wheel',
            drive_pictures.slip_by_wheel(history, truth),
            f'{band} The strip below each line has the colour of the slip class; grey lines are '
            f'the thresholds 0.3, 0.6 and 0.9.{beside if truth and truth.slip else ""}{red}',
        ),
        (
            'Sinkage, wheel by wheel',
            drive_pictures.sinkage_by_wheel(history, truth),
            f'{band}{beside if truth and truth.sinkage else ""}{red}',
        ),
        (
            'Drawbar pull, wheel by wheel',
            drive_pictures.pull_by_wheel(history, truth),
            'Net longitudinal force of the soil on the wheel, along the slope. '
            f'{band}{beside if truth and truth.drawbar_pull else ""}{red}',
        ),
    )
    return [
        {'title': title, 'source': picture(figure), 'caption': caption}
        for title, figure, caption in drawn
    ]
