# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates against the truth of a recording: errors, classes, lead of the warnings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.entrapment import (
    FORESIGHT,
    NEAR_MISS_SLIP,
    Outcome,
    Span,
    Verdict,
    entrapments,
    lead_of,
    verdicts,
)
from wheel_terra_estimator.reporting.drive_style import Border, known

LONGEST_BRIDGE = 0.5
"""Truth further away than this [s] is not compared."""
TRUE_CLASSES = (SlipClass.LOW, SlipClass.MODERATE, SlipClass.HIGH, SlipClass.STUCK)
CLASSES = (*TRUE_CLASSES, SlipClass.UNKNOWN)
LEAST_KNOWN = 0.5  # share of the time after a warning in which slip must be known to judge it [-]
COMPARED = (
    ('slip', 'slip', '-'),
    ('sinkage', 'sinkage', 'm'),
    ('drawbar_pull', 'drawbar_pull', 'N'),
    ('velocity', 'forward_velocity', 'm/s'),
    ('slip_angle', 'slip_angle', 'rad'),
    ('lateral_force', 'lateral_force', 'N'),
)
"""Field of a `Truth`, name of the quantity, unit."""


@dataclass(frozen=True)
class QuantityError:
    """Error of one quantity over all wheels and sets."""

    name: str
    unit: str
    rms: float
    bias: float
    worst: float
    within_two_std: float  # share of errors below two stated deviations; nan where none is stated


@dataclass(frozen=True)
class TruthErrors:
    """Scores against a truth; ``class_matrix`` (true, estimated) in shares of time."""

    source: str
    quantities: tuple[QuantityError, ...]
    class_matrix: FloatArray | None  # (4, 5)
    warnings: tuple[tuple[float, Verdict], ...]  # when each rose [s], what came of it
    entrapped: float | None  # when the rover was entrapped first [s]
    lead: float | None  # of the warning that stood then [s]


def truth_errors(
    history: EstimateHistory, truth: Truth, thresholds: FloatArray
) -> TruthErrors | None:
    """Compare estimates with the truth.

    ``truth``: what the recording knows. ``thresholds``: (3,) upper bounds of the classes low,
    moderate and high.
    """
    if not history.stamp.size:
        return None
    quantities = []
    values = {
        **history.values,
        'velocity': history.forward_velocity[:, None],
        'velocity_std': history.forward_velocity_std[:, None],
    }
    classed = history.slip_class != SlipClass.UNKNOWN
    for field, name, unit in COMPARED:
        true, seen, std = getattr(truth, field), values[field], values[f'{field}_std']
        if true is None or not true.stamp.size:
            continue
        there = at_stamps(true, history.stamp)
        rows = np.isfinite(there) & (classed if name in ('slip', 'slip_angle') else True)
        error = seen - there
        if unit == 'rad':
            error = (error + np.pi) % (2.0 * np.pi) - np.pi
        if rows.any():
            quantities.append(_error(name, unit, error[rows], std[rows]))
    slip = None if truth.slip is None else at_stamps(truth.slip, history.stamp)
    begins = None if slip is None else entrapments(history.seconds, slip).entrapped
    entrapped = float(history.seconds[begins[0]]) if begins is not None and begins.size else None
    return TruthErrors(
        source=truth.source,
        quantities=tuple(quantities),
        class_matrix=None if slip is None else _matrix(slip, history.slip_class, thresholds),
        warnings=() if slip is None else _warnings(history, slip),
        entrapped=entrapped,
        lead=None if entrapped is None else lead_of(entrapped, _spans(history)),
    )


def judged(
    history: EstimateHistory,
    truth: Truth | None,
    heard: Mapping[str, str],
    configuration: Configuration,
) -> TruthErrors | None:
    """Compare estimates with a truth, unless its topic is an input (``heard``)."""
    if truth is None or truth.source in heard.values():
        return None
    return truth_errors(history, truth, configuration.filter.class_thresholds)


def at_stamps(truth: WheelTruth, stamps: IntArray) -> FloatArray:
    """Return the truth (k, n) at stamps [ns], linear between its own; nan where it is silent."""
    time, at = truth.stamp * 1e-9, stamps * 1e-9
    columns = [np.interp(at, time, column) for column in truth.value.T]
    nearest = np.clip(np.searchsorted(time, at), 1, max(time.size - 1, 1))
    if time.size == 1:
        gap = np.abs(at - time[0])
    else:
        gap = np.minimum(np.abs(at - time[nearest - 1]), np.abs(at - time[nearest]))
    return np.where(gap[:, None] <= LONGEST_BRIDGE, np.column_stack(columns), np.nan)


def _error(name: str, unit: str, error: FloatArray, std: FloatArray) -> QuantityError:
    return QuantityError(
        name=name,
        unit=unit,
        rms=float(np.sqrt(np.mean(error**2))),
        bias=float(np.mean(error)),
        worst=float(np.max(np.abs(error))),
        within_two_std=float(np.mean(np.abs(error) <= 2.0 * std)),
    )


def _matrix(slip: FloatArray, seen: NDArray[np.uint8], thresholds: FloatArray) -> FloatArray:
    """Return shares of the wheel time by true class (rows) and estimated class (columns)."""
    rows = np.isfinite(slip)
    true = np.searchsorted(thresholds, np.abs(slip[rows]), side='left')
    estimated = seen[rows]
    counts = np.array(
        [[np.sum((true == t) & (estimated == e)) for e in CLASSES] for t in TRUE_CLASSES], float
    )
    return np.asarray(counts / max(counts.sum(), 1.0))


def _spans(history: EstimateHistory) -> list[Span]:
    return [Span(start, np.inf if end is None else end) for start, end in history.warning_times]


def _warnings(history: EstimateHistory, slip: FloatArray) -> tuple[tuple[float, Verdict], ...]:
    spans = _spans(history)
    found = verdicts(history.seconds, slip, spans)
    return tuple((span.start, verdict) for span, verdict in zip(spans, found, strict=True))


def seen_later(history: EstimateHistory, border: Border) -> tuple[str, ...]:
    """Return for each warning whether the slip estimated after it confirms it, as a sentence."""
    slip = known(history, 'slip', border)
    there = np.asarray(np.isfinite(slip).any(axis=1))
    if not history.warnings:
        return ()
    found = []
    for start, verdict in _warnings(history, slip):
        after = (history.seconds >= start) & (history.seconds <= start + FORESIGHT)
        if not after.any() or np.mean(there[after]) < LEAST_KNOWN:
            found.append('Whether it was right is unknown, as is the slip after it.')
        else:
            found.append(f'By the estimates: {_in_words(verdict)}.')
    return tuple(found)


def outcomes(errors: TruthErrors) -> tuple[str, ...]:
    """Return what came of each warning by the truth, in words."""
    return tuple(_in_words(verdict) for _, verdict in errors.warnings)


def _in_words(verdict: Verdict) -> str:
    if verdict.lead is not None:
        early = verdict.lead >= 0.0
        word, when = ('right', 'before') if early else ('late', 'after')
        return f'{word}, {abs(verdict.lead):.1f} s {when} the rover was entrapped'
    within = f'within {FORESIGHT:g} s'
    if verdict.outcome is Outcome.NEAR_MISS:
        return f'a near miss, median slip above {NEAR_MISS_SLIP:g}, no entrapment {within}'
    return f'false, the median slip stayed below {NEAR_MISS_SLIP:g} for {FORESIGHT:g} s'


def as_lines(errors: TruthErrors) -> list[str]:
    """Return the lines that the terminal shows."""
    lines = [f'  against the truth ({errors.source})']
    lines.append(f'    {"":18}{"rms":>10}{"bias":>10}{"worst":>10}   within two std')
    for q in errors.quantities:
        label = f'{q.name} [{q.unit}]'
        share = f'{100 * q.within_two_std:.0f} %'
        lines.append(f'    {label:22}{q.rms:>8.3g}{q.bias:>10.2g}{q.worst:>10.3g}{share:>12}')
    if errors.class_matrix is not None:
        names = [c.name.lower() for c in CLASSES]
        lines.append(f'    {"true / estimated":18}' + ''.join(f'{name:>10}' for name in names))
        for name, row in zip(names, errors.class_matrix, strict=False):
            shares = ''.join(f'{100 * share:9.1f}%' for share in row)
            lines.append(f'    {name:18}{shares}')
    for (start, _), words in zip(errors.warnings, outcomes(errors), strict=True):
        lines.append(f'    warning at {start:.1f} s: {words}')
    if errors.entrapped is not None and not errors.warnings:
        lines.append(f'    no warning, though the rover was entrapped at {errors.entrapped:.1f} s')
    return lines


def as_dict(errors: TruthErrors) -> dict[str, Any]:
    """Return the errors for JSON."""
    return {
        'source': errors.source,
        'quantities': {
            q.name: {key: value for key, value in vars(q).items() if key != 'name'}
            for q in errors.quantities
        },
        'classes': [c.name.lower() for c in CLASSES],
        'class_matrix': None if errors.class_matrix is None else errors.class_matrix.tolist(),
        'warnings': [
            {'start': start, 'outcome': verdict.outcome.value, 'lead': verdict.lead}
            for start, verdict in errors.warnings
        ],
        'entrapped': errors.entrapped,
    }
