# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Summary of a drive for an operator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.bags.history import DriveFigures, EstimateHistory
from wheel_terra_estimator.bags.replay import Replay
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.taught import LEARNED, Taught
from wheel_terra_estimator.reporting import truth_scores
from wheel_terra_estimator.reporting.drive_style import NOT_KNOWN, Border, known

PERCENTILES = (5.0, 95.0)
LEAST_TRAVEL = 0.01
"""What the rates of a wheel that stands add up to is no slip to be named for [m]; assumed."""


@dataclass(frozen=True)
class WarningSpan:
    """A stuck warning in seconds since the first set; ``end`` None: until the end.

    ``later`` states whether the slip estimated afterwards confirms it.
    """

    start: float
    end: float | None
    reason: str
    later: str = ''


@dataclass(frozen=True)
class WheelSummary:
    """Figures of one wheel; ``seconds`` and ``shares`` by name of the slip class.

    ``slip`` (of |slip|), ``sinkage`` [m] and ``slip_angle`` [rad] are percentiles 5 and 95, of a
    long drive over the sets that were kept; ``sinkage_std`` and ``slip_angle_std`` are median
    deviations. They and the extremes are None where slip or sinkage was never known.
    ``slip_travel`` is how far it slipped in the classes high and stuck [m].
    """

    name: str
    seconds: dict[str, float]
    shares: dict[str, float]
    max_slip: float | None
    max_sinkage: float | None
    max_sinkage_std: float | None
    mean_pull: float
    least_margin: float
    max_lateral_force: float
    slip: tuple[float, float] | None = field(default=None, compare=False)
    sinkage: tuple[float, float] | None = field(default=None, compare=False)
    sinkage_std: float | None = field(default=None, compare=False)
    slip_angle: tuple[float, float] | None = field(default=None, compare=False)
    slip_angle_std: float | None = field(default=None, compare=False)
    slip_travel: float = 0.0


@dataclass(frozen=True)
class MessageRow:
    """An input: number of used messages, and rejected ones as text."""

    name: str
    topic: str
    count: int
    rejected: str


@dataclass(frozen=True)
class DriveSummary:
    """Content of the summary on the terminal and in the report."""

    title: str
    duration: float  # [s]
    sets: int
    wheels: tuple[WheelSummary, ...]
    warnings: tuple[WarningSpan, ...]
    messages: tuple[MessageRow, ...]
    notes: tuple[str, ...]
    taught: tuple[Taught, ...] = ()
    """What the drive has taught of soil and sensors, where it was replayed."""

    @property
    def extent(self) -> str:
        """How much was estimated, in words."""
        wheels = '1 wheel' if len(self.wheels) == 1 else f'{len(self.wheels)} wheels'
        return f'{self.duration:.1f} s, {wheels}, {self.sets} estimates'

    @property
    def verdict(self) -> str:
        """The drive in a sentence."""
        if not self.sets:
            return 'No estimate: no usable wheel odometry was received.'
        if self.warnings:
            times = ', '.join(f'{w.start:.1f} s' for w in self.warnings[:5])
            more = f' and {len(self.warnings) - 5} more' if len(self.warnings) > 5 else ''
            kind = 'A stuck warning' if len(self.warnings) == 1 else 'Stuck warnings'
            return f'{kind} at {times}{more}: {self.warnings[0].reason or "no reason given"}.'
        if all(wheel.slip is None for wheel in self.wheels):
            return 'No stuck warning, but slip was never known: nothing can be concluded.'
        high = [wheel.seconds['high'] + wheel.seconds['stuck'] for wheel in self.wheels]
        far = [wheel.slip_travel for wheel in self.wheels]
        worst = far.index(max(far))
        if far[worst] < LEAST_TRAVEL:
            some = ' for more than a centimetre' if any(high) else ''
            heard = {row.name for row in self.messages if row.count}
            unseen = heard and 'reference_odom' not in heard
            cost = ' Without a reference velocity, slip may have gone unnoticed.' if unseen else ''
            return f'No stuck warning, no wheel in the classes high or stuck{some}.{cost}'
        name, far_in_cm = self.wheels[worst].name, 100.0 * far[worst]
        return (
            f'No stuck warning. {name} slipped most: {far_in_cm:.0f} cm in {high[worst]:.1f} s of '
            'the classes high and stuck.'
        )

    @property
    def tone(self) -> str:
        """Colour of the drive on a page: bad, warn or good."""
        if self.warnings or not self.sets:
            return 'bad'
        high = any(wheel.seconds['high'] + wheel.seconds['stuck'] > 0.0 for wheel in self.wheels)
        return 'warn' if high or all(wheel.slip is None for wheel in self.wheels) else 'good'


def summarise(
    title: str, result: Replay, border: Border, notes: Sequence[str] = ()
) -> DriveSummary:
    """Sum a drive up; ``notes`` are said after those of the replay."""
    history = result.history
    rejected = result.rejected.most_common()
    figures = history.figures()
    return DriveSummary(
        title=title,
        duration=figures.duration,
        sets=figures.sets,
        wheels=_wheels(history, figures, border) if figures.sets else (),
        warnings=tuple(
            WarningSpan(*times, warning.reason, later)
            for times, warning, later in zip(
                history.warning_times,
                history.warnings,
                truth_scores.seen_later(history, border),
                strict=True,
            )
        ),
        messages=tuple(
            MessageRow(
                name,
                topic,
                result.heard[name],
                ', '.join(f'{n} x {why}' for (t, why), n in rejected if t == name),
            )
            for name, topic in result.topics.items()
        ),
        notes=(*result.notes, *notes),
        taught=result.taught,
    )


def short_names(names: Sequence[str]) -> list[str]:
    """Return wheel names without what they all end in (``front_left_wheel_joint``: front_left)."""
    parts = [name.split('_') for name in names]
    while len(parts) > 1 and all(len(p) > 1 and p[-1] == parts[0][-1] for p in parts):
        parts = [p[:-1] for p in parts]
    return ['_'.join(p) for p in parts]


def _wheels(
    history: EstimateHistory, figures: DriveFigures, border: Border
) -> tuple[WheelSummary, ...]:
    times = figures.seconds_in_class
    total = np.maximum(sum(times.values()), 1e-9)
    slips = np.abs(known(history, 'slip', border))
    sinkages = known(history, 'sinkage', border)
    angles = np.where(np.isnan(slips), np.nan, history.values['slip_angle'])
    limits = np.broadcast_to(border.sinkage, len(history.names))
    result = []
    for i, name in enumerate(short_names(history.names)):
        seconds = {c.name.lower(): float(times[c][i]) for c in SlipClass}
        slip, sinkage = _percentiles(slips[:, i]), _percentiles(sinkages[:, i])
        deepest, std = float(figures.max_sinkage[i]), float(figures.max_sinkage_std[i])
        if sinkage and std > limits[i]:  # known elsewhere, or only at rest
            row = int(np.nanargmax(sinkages[:, i]))
            deepest = float(sinkages[row, i])
            std = float(history.values['sinkage_std'][row, i])
        result.append(
            WheelSummary(
                name=name,
                seconds=seconds,
                shares={key: value / float(total[i]) for key, value in seconds.items()},
                max_slip=float(figures.max_slip[i]) if slip else None,
                max_sinkage=deepest if sinkage else None,
                max_sinkage_std=std if sinkage else None,
                mean_pull=float(figures.mean_pull[i]),
                least_margin=float(figures.least_margin[i]),
                max_lateral_force=float(figures.max_lateral_force[i]),
                slip=slip,
                sinkage=sinkage,
                sinkage_std=_median_std(history, 'sinkage', sinkages, i),
                slip_angle=_percentiles(angles[:, i]),
                slip_angle_std=_median_std(history, 'slip_angle', angles, i),
                slip_travel=float(figures.slip_travel[i]),
            )
        )
    return tuple(result)


def _median_std(
    history: EstimateHistory, quantity: str, values: FloatArray, wheel: int
) -> float | None:
    there = history.values[f'{quantity}_std'][np.isfinite(values[:, wheel]), wheel]
    return float(np.median(there)) if there.size else None


def _percentiles(values: FloatArray) -> tuple[float, float] | None:
    there = values[np.isfinite(values)]
    if not there.size:
        return None
    low, high = np.percentile(there, PERCENTILES)
    return float(low), float(high)


def shown(value: float | None, spec: str) -> str:
    """Return a figure in words; "not known" where there is none."""
    return NOT_KNOWN if value is None else format(value, spec)


def spread(ends: tuple[float, float] | None, spec: str, scale: float = 1.0) -> str:
    """Return percentiles in words, "0.02 to 0.31"; equal ones once."""
    if ends is None:
        return NOT_KNOWN
    low, high = (format(scale * end, spec) for end in ends)
    return low if low == high else f'{low} to {high}'


def sinkages(wheel: WheelSummary, plus_minus: str = '±') -> str:
    """Return the percentiles of the sinkage of a wheel with its median deviation [mm]."""
    ends = spread(wheel.sinkage, '.0f', 1e3)
    if wheel.sinkage_std is None:
        return ends
    return f'{ends} {plus_minus} {1e3 * wheel.sinkage_std:.0f}'


def slip_angles(wheel: WheelSummary) -> str:
    """Return the percentiles of the slip angle of a wheel with its median deviation [deg]."""
    if wheel.slip_angle_std is None:
        return NOT_KNOWN
    scale = 180.0 / np.pi
    return f'{spread(wheel.slip_angle, ".0f", scale)} ± {scale * wheel.slip_angle_std:.0f}'


def deepest(wheel: WheelSummary, plus_minus: str = '±') -> str:
    """Return the greatest sinkage of a wheel with its standard deviation [mm]."""
    if wheel.max_sinkage is None or wheel.max_sinkage_std is None:
        return NOT_KNOWN
    return f'{1e3 * wheel.max_sinkage:.0f} {plus_minus} {1e3 * wheel.max_sinkage_std:.0f}'


def as_text(summary: DriveSummary) -> str:
    """Return the summary for a terminal."""
    lines = [
        f'{summary.title}: {summary.extent}',
        '',
        f'  {summary.verdict}',
    ]
    for number, warning in enumerate(summary.warnings):
        end = 'the end' if warning.end is None else f'{warning.end:.1f} s'
        reason = f': {warning.reason or "-"}' if number else ''  # the first's stands above
        lines.append(f'  STUCK from {warning.start:.1f} s to {end}{reason}')
        lines += [f'    {warning.later}'] if warning.later else []
    if summary.wheels:
        classes = [c.name.lower() for c in SlipClass]
        table = [['time in class [s]', *classes, '|slip| 5 to 95 %', 'max', 'sinkage [mm]', 'max']]
        table += [
            [
                wheel.name,
                *(f'{wheel.seconds[c]:.1f}' for c in classes),
                spread(wheel.slip, '.2f'),
                shown(wheel.max_slip, '.2f'),
                sinkages(wheel, '+-'),
                deepest(wheel, '+-'),
            ]
            for wheel in summary.wheels
        ]
        first, *others = (max(map(len, column)) for column in zip(*table, strict=True))
        lines.append('')
        for name, *cells in table:
            right = (f'{c:>{width}}' for c, width in zip(cells, others, strict=True))
            lines.append('   '.join([f'  {name:{first}}', *right]))
    heard = [
        row.name if row.topic == f'/{row.name}' else f'{row.name} ({row.topic})'
        for row in summary.messages
    ]
    width = max(map(len, ('messages ', *heard)))
    lines += ['', f'  {"messages":{width}}{"received":>8}   rejected']
    for name, row in zip(heard, summary.messages, strict=True):
        lines.append(f'  {name:{width}}{row.count:8}   {row.rejected or "none"}')
    if summary.taught:
        learned = [
            f'{row.name} ({row.bits:.1f} bits)' for row in summary.taught if row.verdict == LEARNED
        ]
        lines += ['', f'  learned on this drive: {", ".join(learned) or "nothing"}']
    lines += [f'  note: {note}' for note in summary.notes]
    return '\n'.join(lines)


def as_dict(summary: DriveSummary) -> dict[str, Any]:
    """Return the summary for JSON."""
    return {**asdict(summary), 'verdict': summary.verdict}
