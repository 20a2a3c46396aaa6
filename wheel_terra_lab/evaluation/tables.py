# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of the bench as Markdown."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from wheel_terra_lab.evaluation import scores
from wheel_terra_lab.evaluation.bench import DriveScore, Results
from wheel_terra_lab.evaluation.foresight import (
    Foresight,
    brier_interval,
    reliability,
    reliability_error,
)
from wheel_terra_lab.evaluation.runner import SMOOTHED
from wheel_terra_lab.evaluation.scores import Samples
from wheel_terra_lab.evaluation.simulators import SIMULATORS

_CLASSES = ('low', 'moderate', 'high', 'stuck')
_MODES = {
    'reference': 'With reference at 1 Hz',
    'no_reference': 'Without reference',
    'no_torque': 'Without torque',
    'no_sinkage': 'Without sinkage',
    'no_orientation': 'Without orientation',
    'reference_2s_late': 'Reference 2 s late',
    'smoothed': 'Smoother with reference at 1 Hz',
    'smoothed_no_reference': 'Smoother without reference',
}


def table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a Markdown table."""
    lines = ['| ' + ' | '.join(head) + ' |', '|' + '---|' * len(head)]
    lines += ['| ' + ' | '.join(row) + ' |' for row in rows]
    return '\n'.join(lines)


def report(results: Results, modes: Sequence[str]) -> str:
    """Return all tables of a run: the simulators side by side, then each by itself."""
    parts = []
    if len(results.simulators) > 1:
        parts += [_side_by_side(results, mode) for mode in modes]
    parts += _smoother_over_filter(results, modes)
    for mode, simulator in itertools.product(modes, results.simulators):
        by_kind = results.of_mode(mode, simulator)
        if not by_kind:
            continue
        joined = {k: Samples.joined(d.samples for d in drives) for k, drives in by_kind.items()}
        pooled = Samples.joined(joined.values())
        high = float((np.abs(pooled.true_slip) > 0.6).mean())
        count = sum(len(d) for d in by_kind.values())
        parts.append(f'## {_MODES[mode]}, simulator {simulator}\n')
        parts.append(
            f'{count} drives, {len(pooled)} scored wheel samples, {high:.0%} of them above '
            '|s| = 0.6.\n'
        )
        parts.append(_errors({**joined, '**pooled**': pooled}))
        parts.append('\nSlip against the two-state filters, and how honest its deviation is:\n')
        parts.append(_two_states(by_kind))
        parts.append('\nBy true slip:\n')
        parts.append(_errors(_by_slip(pooled)))
        parts.append('\nClasses (rows: truth, columns: estimate; share of the row):\n')
        parts.append(_confusion(pooled))
        parts.append('\nStuck warnings:\n')
        parts.append(_warnings(by_kind))
        parts += _foresight([d for drives in by_kind.values() for d in drives])
        parts.append('\nFilter, mean over the drives (NIS of a consistent filter: 1):\n')
        parts.append(_health(by_kind))
        parts.append('')
    return '\n'.join(parts)


def _two_states(by_kind: dict[str, list[DriveScore]]) -> str:
    """Return the table of the rule of the bench, and a line that says whether it is kept."""
    rows, broken = [], []
    pooled = [d for drives in by_kind.values() for d in drives]
    for kind, drives in (*by_kind.items(), ('**pooled**', pooled)):
        parts = [d.samples for d in drives]
        data = Samples.joined(parts)
        ratio = scores.ratio_to_better_baseline(parts)
        better, _ = scores.better_baseline(data)
        if ratio.keeps_the_rule is False and kind in by_kind:
            broken.append(kind)
        mean, median = scores.squared_over_variance(data.slip_error, data.slip_std)
        rows.append(
            {
                'drives': kind,
                'slip RMSE': f'{scores.rms(data.slip_error):.4f}',
                'two states, torque': f'{scores.rms(data.torque_filter_error):.4f}',
                'two states, pitch': f'{scores.rms(data.pitch_filter_error):.4f}',
                'three states': f'{scores.rms(data.curve_filter_error):.4f}',
                'best': better,
                'ratio (95 % interval)': _interval(ratio),
                'rule kept': _RULE[ratio.keeps_the_rule],
                'slow part (20 s means)': f'{scores.rms(data.slow_slip_error):.4f}',
                'coverage': f'{scores.coverage(data.slip_error, data.slip_std):.1%}',
                '30 s after a start': _coverage_after_start(data),
                'coverage of two states, torque': (
                    f'{scores.coverage(data.torque_filter_error, data.torque_filter_std):.1%}'
                ),
                'squared error over variance: mean, median': f'{mean:.2f}, {median:.2f}',
            }
        )
    judged = any(len(drives) >= scores.FEWEST_DRIVES for drives in by_kind.values())
    verdict = f'broken in {", ".join(broken)}' if broken else 'kept in every kind'
    if not judged:
        verdict = f'not judged with fewer than {scores.FEWEST_DRIVES} drives of a kind'
    written = table(tuple(rows[0]), (row.values() for row in rows))
    return (
        f'{written}\n\nThe rule of the bench (slip RMSE not above the best baseline '
        f'filter by more than 5 % plus two standard errors of the paired drives): {verdict}.'
    )


_RULE = {True: 'yes', False: '**no**', None: 'too few drives'}


def _coverage_after_start(data: scores.Samples) -> str:
    part = scores.after_start(data)
    return f'{scores.coverage(part.slip_error, part.slip_std):.1%}' if len(part) else '-'


def _interval(ratio: scores.Ratio) -> str:
    if np.isnan(ratio.error):
        return f'{ratio.value:.2f}'
    return f'{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})'


def _side_by_side(results: Results, mode: str) -> str:
    """Return the pooled figures of a mode, one column per simulator."""
    columns = {}
    for simulator in results.simulators:
        drives = [d for found in results.of_mode(mode, simulator).values() for d in found]
        columns[simulator] = _figures(drives)
    names = next(iter(columns.values()))
    rows = [(name, *(column[name] for column in columns.values())) for name in names]
    head = ('pooled', *(f'simulator {simulator}' for simulator in columns))
    return f'## {_MODES[mode]}: the simulators side by side\n\n{table(head, rows)}\n'


def _figures(drives: Sequence[DriveScore]) -> dict[str, str]:
    parts = [d.samples for d in drives]
    data = Samples.joined(parts)
    ratio = scores.ratio_to_better_baseline(parts)
    better, error = scores.better_baseline(data)
    mean, median = scores.squared_over_variance(data.slip_error, data.slip_std)
    by_kind = {d.kind: [e.samples for e in drives if e.kind == d.kind] for d in drives}
    worst = {kind: scores.rms(Samples.joined(p).slip_error) for kind, p in by_kind.items()}
    hardest = max(worst, key=lambda kind: worst[kind])
    found = [d.warnings for d in drives]
    trapped = [w for w in found if w.entrapped is not None]
    warned = sum(w.lead_time is not None for w in trapped)
    hours = sum(w.duration for w in found) / 3600.0
    return {
        'drives': str(len(drives)),
        'slip RMSE': f'{scores.rms(data.slip_error):.4f}',
        'worst kind': f'{worst[hardest]:.4f} ({hardest})',
        'best baseline filter': f'{scores.rms(error):.4f} ({better})',
        'ratio (95 % interval)': _interval(ratio),
        'last reference held': f'{scores.rms(data.held_error):.4f}',
        'dead reckoning': f'{scores.rms(data.dead_reckoned_error):.4f}',
        'slow part of the slip error': f'{scores.rms(data.slow_slip_error):.4f}',
        'coverage of slip': f'{scores.coverage(data.slip_error, data.slip_std):.1%}',
        'coverage of slip, first 30 s after a start': _coverage_after_start(data),
        'squared slip error over variance: mean, median': f'{mean:.2f}, {median:.2f}',
        'sinkage RMSE [mm]': f'{1e3 * scores.rms(data.sinkage_error):.2f}',
        'coverage of sinkage': f'{scores.coverage(data.sinkage_error, data.sinkage_std):.1%}',
        'pull RMSE [% load]': f'{100 * scores.rms(data.pull_error):.2f}',
        'coverage of pull': f'{scores.coverage(data.pull_error, data.pull_std):.1%}',
        'entrapments warned of before': f'{warned} of {len(trapped)}',
        'false warnings': f'{sum(w.false_alarms for w in found)} in {hours:.1f} h',
    }


def _by_slip(pooled: Samples) -> dict[str, Samples]:
    edges = ((-1.01, -0.02), (-0.02, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 1.01))
    names = ('braking', 'low', 'moderate', 'high', 'stuck')
    parts = {
        name: pooled.where((pooled.true_slip > low) & (pooled.true_slip <= high))
        for name, (low, high) in zip(names, edges, strict=True)
    }
    return {name: part for name, part in parts.items() if len(part)}


def _errors(rows: dict[str, Samples]) -> str:
    columns = {name: _error_row(data) for name, data in rows.items()}
    head = ('drives', *next(iter(columns.values())))
    return table(head, ((name, *row.values()) for name, row in columns.items()))


def _error_row(data: Samples) -> dict[str, str]:
    return {
        'slip RMSE': f'{scores.rms(data.slip_error):.3f}',
        'bias': f'{np.nanmean(data.slip_error):+.3f}',
        'coverage': f'{scores.coverage(data.slip_error, data.slip_std):.1%}',
        'held reference': f'{scores.rms(data.held_error):.3f}',
        'dead reckoning': f'{scores.rms(data.dead_reckoned_error):.3f}',
        'sinkage RMSE [mm]': f'{1e3 * scores.rms(data.sinkage_error):.2f}',
        'its coverage': f'{scores.coverage(data.sinkage_error, data.sinkage_std):.1%}',
        'pull RMSE [% load]': f'{100 * scores.rms(data.pull_error):.2f}',
        'coverage of pull': f'{scores.coverage(data.pull_error, data.pull_std):.1%}',
        'shared by load [%]': f'{100 * scores.rms(data.shared_pull_error):.2f}',
        '3 classes': _share(scores.accuracy(data)),
        '2 classes': _share(scores.accuracy(data, scores.TWO_CLASSES)),
        '3 near border': _share(scores.accuracy(data, near_border=True)),
    }


def _share(value: float) -> str:
    return '-' if np.isnan(value) else f'{value:.2%}'


def _confusion(pooled: Samples) -> str:
    counts = scores.confusion(pooled)
    rows = []
    for name, row in zip(_CLASSES, counts, strict=True):
        total = row.sum()
        rows.append((name, *(f'{v / total:.3f}' if total else '-' for v in row), str(total)))
    return table(('truth', *_CLASSES, 'unknown', 'samples'), rows)


def _warnings(by_kind: dict[str, list[DriveScore]]) -> str:
    rows = []
    for kind, drives in by_kind.items():
        found = [d.warnings for d in drives]
        trapped = [w for w in found if w.entrapped is not None]
        warned = [w for w in trapped if w.lead_time is not None]
        times = [w.lead_time for w in warned if w.lead_time is not None]
        travels = [w.lead_travel for w in warned if w.lead_travel is not None]
        hours = sum(w.duration for w in found) / 3600.0
        kilometres = sum(w.distance for w in found) / 1000.0
        near = sum(w.near_misses for w in found)
        false = sum(w.false_alarms for w in found)
        made_to = any(kind in SIMULATORS[d.simulator].entrapments for d in drives)
        rows.append(
            {
                'drives': f'{kind}{" (made to entrap)" if made_to else ""}',
                'entrapped': f'{len(trapped)} of {len(found)}',
                'warned before': f'{len(warned)} of {len(trapped)}' if trapped else '-',
                'lead [s], median (least)': (
                    f'{np.median(times):.1f} ({min(times):.1f})' if times else '-'
                ),
                'lead [m of rim travel]': (
                    f'{np.median(travels):.2f} ({min(travels):.2f})' if travels else '-'
                ),
                'near misses': str(near),
                'false alarms': str(false),
                'per hour': f'{false / hours:.2f}',
                'per km': f'{false / max(kilometres, 1e-9):.1f}',
            }
        )
    return table(tuple(rows[0]), (row.values() for row in rows))


def _foresight(drives: Sequence[DriveScore]) -> list[str]:
    """Return the reliability diagram of the stuck probability, and its Brier score."""
    parts = [d.foresight for d in drives if d.foresight is not None]
    data = Foresight.joined(parts) if parts else None
    if data is None or not data.came.size:
        return []
    found = brier_interval(parts)
    share = data.came.mean()
    rows = [
        (name, f'{value:.4f}', f'{low:.4f} to {high:.4f}')
        for name, (value, low, high) in found.items()
    ]
    climatology = share * (1.0 - share)
    rows.append(('the share of events, always', f'{climatology:.4f}', '-'))
    if climatology > 0.0:
        rows.append(('probability over that', f'{found["probability"][0] / climatology:.2f}', '-'))
    bins = [(f'{said:.2f}', f'{came:.2f}', str(count)) for count, said, came in reliability(data)]
    return [
        '\nProbability of an entrapment (median slip above 0.9 for a second, within horizon or '
        f'travel): {share:.1%} of {data.came.size} rows; reliability error '
        f'{reliability_error(data):.3f}.\n',
        table(('Brier score of', 'value', '95 % interval'), rows),
        '',
        table(('said', 'came', 'rows'), bins),
    ]


def _smoother_over_filter(results: Results, modes: Sequence[str]) -> list[str]:
    """Return the table of smoother over filter, for modes of which both were run."""
    rows = []
    for mode in (m for m in modes if m.startswith(SMOOTHED)):
        live = mode.removeprefix(SMOOTHED).removeprefix('_') or 'reference'
        for simulator in results.simulators:
            sides = [
                [d.samples for drives in results.of_mode(m, simulator).values() for d in drives]
                for m in (live, mode)
            ]
            if all(sides):
                before, after = (Samples.joined(side) for side in sides)
                rows.append((f'{_MODES[live]}, simulator {simulator}', *_ratios(before, after)))
    if not rows:
        return []
    head = ('drives', 'slip', 'coverage', 'sinkage', 'coverage', 'pull', 'coverage')
    return ['## Smoother over filter (RMSE)\n', table(head, rows), '']


def _ratios(live: Samples, smoothed: Samples) -> Iterable[str]:
    for name in ('slip', 'sinkage', 'pull'):
        error, std = getattr(smoothed, f'{name}_error'), getattr(smoothed, f'{name}_std')
        before = scores.rms(getattr(live, f'{name}_error'))
        yield f'{scores.rms(error) / before:.3f}'
        yield f'{scores.coverage(error, std):.1%}'


def _health(by_kind: dict[str, list[DriveScore]]) -> str:
    keys = ('nis_reference', 'nis_sinkage', 'nis_torque', 'nis_balance', 'filter_restarts')
    rows = []
    for kind, drives in by_kind.items():
        values = []
        for key in keys:
            known = [float(d.health[key]) for d in drives if key in d.health]
            values.append(f'{np.mean(known):.2f}' if known else '-')
        rows.append((kind, *values))
    return table(('drives', 'NIS reference', 'sinkage', 'torque', 'balance', 'restarts'), rows)
