# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a drive: one HTML file with pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wheel_terra_estimator.bags.replay import Replay
from wheel_terra_estimator.bags.truth import Truth
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting import truth_scores
from wheel_terra_estimator.reporting.drive_figure import (
    STRENGTHS,
    drive_figure,
    slopes_figure,
    way_figure,
)
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS, Border
from wheel_terra_estimator.reporting.drive_summary import (
    DriveSummary,
    deepest,
    shown,
    sinkages,
    slip_angles,
    spread,
)
from wheel_terra_estimator.reporting.html import render, write_page
from wheel_terra_estimator.reporting.truth_scores import QuantityError, TruthErrors


def write_replay_report(
    path: Path,
    summary: DriveSummary,
    result: Replay,
    truth: Truth | None,
    configuration: Configuration,
    *,
    findings: Sequence[Any] = (),
    errors: TruthErrors | None = None,
    overwrite: bool = False,
) -> None:
    """Write the report of a drive.

    ``errors`` are those against an independent truth.
    """
    from wheel_terra_estimator.terramechanics.effects import catalogue

    effects = catalogue()
    values = configuration.flat()
    history, track = result.history, result.track
    border = Border.of(configuration)
    page = render(
        'replay.html',
        summary=summary,
        rover=configuration.rover.name or 'rover',
        tone=summary.tone,
        cards=_cards(summary),
        classes=[(c.name.lower(), colour) for c, colour in CLASS_COLOURS.items()],
        wheels=[_wheel_row(wheel) for wheel in summary.wheels],
        figure=drive_figure(history, truth, border) if summary.sets else None,
        findings=findings,
        warnings=_warnings(summary, errors),
        errors=[_error_row(error) for error in errors.quantities] if errors else [],
        taught=summary.taught,
        slopes=slopes_figure(history.slip_on_slope) if history.slip_on_slope else None,
        way=way_figure(track) if track else None,
        strengths=[(words, colour) for words, _, _, colour in STRENGTHS],
        position=track.source if track else '',
        smoothed=result.smoothed,
        truth_source=truth.source if truth else '',
        provenance=configuration.provenance,
        parameters=[(key, values[key]) for key in values if key in configuration.stated],
        sources=[(name, effects[name].source) for name in configuration.effects],
    )
    write_page(path, page, overwrite)


def _error_row(error: QuantityError) -> dict[str, str]:
    scale, unit = {'m': (1e3, 'mm'), 'rad': (180.0 / math.pi, 'deg')}.get(
        error.unit, (1.0, error.unit)
    )
    return {
        'quantity': f'{error.name.replace("_", " ")} [{unit}]',
        'rms': f'{scale * error.rms:.3g}',
        'bias': f'{scale * error.bias:+.2g}',
        'worst': f'{scale * error.worst:.3g}',
        'within': f'{100 * error.within_two_std:.0f} %',
    }


def _cards(summary: DriveSummary) -> list[tuple[str, str]]:
    if not summary.wheels:
        return []
    slipping = max(summary.wheels, key=lambda w: w.slip[1] if w.slip else 0.0)
    deep = max(summary.wheels, key=lambda w: w.sinkage[1] if w.sinkage else 0.0)
    stuck = max(wheel.seconds['stuck'] for wheel in summary.wheels)
    unknown = sum(wheel.shares[SlipClass.UNKNOWN.name.lower()] for wheel in summary.wheels)
    unit = '' if deep.max_sinkage is None else ' mm'
    return [
        (str(len(summary.warnings)), f'stuck warning{"s" * (len(summary.warnings) != 1)}'),
        (
            spread(slipping.slip, '.2f'),
            f'|slip| of {slipping.name}, 5 to 95 % of the time; '
            f'at most {shown(slipping.max_slip, ".2f")}',
        ),
        (f'{stuck:.1f} s', 'longest time of a wheel in class stuck'),
        (
            f'{sinkages(deep)}{unit}'.replace(' ± ', '\u00a0±\u00a0').replace(' mm', '\u00a0mm'),
            f'sinkage of {deep.name}, 5 to 95 % of the time; at most {deepest(deep)}',
        ),
        (f'{100 * unknown / len(summary.wheels):.0f} %', 'of the time at rest or unknown'),
    ]


def _wheel_row(wheel: Any) -> dict[str, Any]:
    return {
        'name': wheel.name,
        'shares': wheel.shares,
        'seconds': {name: f'{seconds:.1f}' for name, seconds in wheel.seconds.items()},
        'figures': [
            ('|slip|', spread(wheel.slip, '.2f')),
            ('max', shown(wheel.max_slip, '.2f')),
            ('sinkage [mm]', sinkages(wheel)),
            ('max', deepest(wheel)),
            ('mean pull [N]', f'{wheel.mean_pull:.1f}'),
            ('least margin [N]', f'{wheel.least_margin:.1f}'),
            ('slip angle [deg]', slip_angles(wheel)),
            ('max lateral force [N]', f'{wheel.max_lateral_force:.0f}'),
        ],
    }


def _warnings(summary: DriveSummary, errors: TruthErrors | None) -> list[dict[str, str]]:
    """Return for each warning when, one sentence, what to do, and whether it was right."""
    rows = []
    for number, warning in enumerate(summary.warnings):
        reason, _, advice = warning.reason.partition('; ')
        end = 'to the end' if warning.end is None else f'to {warning.end:.1f} s'
        verdict = warning.later
        if errors and errors.warnings:
            verdict = f'By the truth: {truth_scores.outcomes(errors)[number]}.'
        rows.append(
            {
                'when': f'{warning.start:.1f} s {end}',
                'reason': f'{_capital(reason or "no reason given")}.',
                'advice': f'{_capital(advice)}.' if advice else '',
                'verdict': verdict,
            }
        )
    return rows


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
