# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From the rows of a study to the table of targets and its break-downs."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .scoring import FIELDS, Record

TEXT = (
    'group',
    'design',
    'hidden',
    'size',
    'spice',
    'verdict',
    'effects',
    'confounded_with',
    'error',
)
BINS = (2.0, 3.0, 5.0, 8.0, 13.0, 20.0, 35.0, 70.0)


def read(path: str | Path) -> list[Record]:
    """Return the records of a study file."""
    with Path(path).open(newline='', encoding='utf-8') as stream:
        return [
            {key: row[key] if key in TEXT else float(row[key] or 'nan') for key in FIELDS}
            for row in csv.DictReader(stream)
        ]


@dataclass(frozen=True)
class Share:
    """A share with its number of cases and 95 % Wilson interval."""

    hits: int
    cases: int

    @property
    def value(self) -> float:
        """Hits over cases, nan where there is none."""
        return self.hits / self.cases if self.cases else float('nan')

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Wilson interval."""
        n, z = self.cases, 1.96
        if not n:
            return 0.0, 1.0
        centre = (self.value + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * np.sqrt(self.value * (1 - self.value) / n + (z / n) ** 2 / 4)
        return max(centre - half, 0.0), min(centre + half, 1.0)

    def __str__(self) -> str:
        if not self.cases:
            return '-'
        low, high = self.interval
        return f'{100 * self.value:.1f} % ({100 * low:.0f} to {100 * high:.0f}, n {self.cases})'


def share(records: Iterable[Record], hit: Callable[[Record], bool]) -> Share:
    """Count the records for which ``hit`` holds."""
    chosen = list(records)
    return Share(sum(bool(hit(record)) for record in chosen), len(chosen))


def first(record: Record) -> bool:
    """The truth was named first."""
    return record['first'] == 1


def in_set(record: Record) -> bool:
    """The truth is the name or one that it is said to be confounded with."""
    return record['in_set'] == 1


def alarm(record: Record) -> bool:
    """Something was claimed."""
    return record['verdict'] != 'agrees'


@dataclass(frozen=True)
class Target:
    """One figure of the issue's table: what was reached and what was asked."""

    figure: str
    reached: str
    asked: str
    met: bool | None


def targets(records: Sequence[Record]) -> list[Target]:
    """Return every row of the target table."""

    def group(
        name: str, low: float = 0.0, high: float = np.inf, key: str = 'distance'
    ) -> list[Record]:
        chosen = [r for r in records if r['group'] == name and not r['error']]
        if low > 0 or high < np.inf:
            chosen = [r for r in chosen if low < r[key] <= high]
        return chosen

    rows: list[Target] = []

    def add(
        figure: str, value: Share | float, asked: float, at_most: bool = False, unit: str = '%'
    ) -> None:
        number = value.value if isinstance(value, Share) else value
        text = str(value) if isinstance(value, Share) else f'{value:.3g}'
        met = None if np.isnan(number) else (number <= asked if at_most else number >= asked)
        sign = 'at most' if at_most else 'at least'
        wanted = (
            f'{100 * asked:g} %' if isinstance(value, Share) or unit == '%' else f'{asked:g} {unit}'
        )
        rows.append(Target(figure, text, f'{sign} {wanted}', met))

    one = group('one', 5.0)
    add("same physics, d' > 5: named first", share(one, first), 0.95)
    add(
        '  where lugs vary',
        share((r for r in one if r['design'] in ('lugs48', 'full56')), first),
        0.98,
    )
    add('  truth in name or confounded_with', share(one, in_set), 0.99)
    named = [r for r in one if r['verdict'] == 'named']
    sizes = [len(r['confounded_with'].split('+')) if r['confounded_with'] else 0 for r in named]
    add(
        '  mean size of confounded_with',
        float(np.mean(sizes)) if sizes else np.nan,
        0.6,
        True,
        'names',
    )
    any_named = [r for r in group('one') if r['verdict'] == 'named']
    add('  of all named: truth in the set', share(any_named, in_set), 0.95)
    middle = group('one', 3.0, 5.0)
    add("d' 3 to 5: named first", share(middle, first), 0.70)
    add(
        '  wrong name with confidence above 0.9',
        share(middle, lambda r: r['verdict'] == 'named' and not first(r) and r['confidence'] > 0.9),
        0.01,
        True,
    )
    add('false alarms, nothing hidden', share(group('none'), alarm), 0.01, True)
    add('  soil 2.5 times worse than stated', share(group('none, soil 2.5x'), alarm), 0.03, True)
    other = group('other formula', 5.0)
    add("other formulas, 2 % structure, d' > 5: first", share(other, first), 0.80)
    add('  in the set', share(other, in_set), 0.90)
    beside = [r for r in other if r['distance_beside'] > 5.0]
    add("  the same, d' > 5 beside noise and structure: first", share(beside, first), 0.80)
    add('  in the set', share(beside, in_set), 0.90)
    add('  false alarms', share(group('other formula, none'), alarm), 0.03, True)
    add("3 % outliers, d' > 5: first", share(group('outliers', 5.0), first), 0.90)
    add('  false alarms', share(group('outliers, none'), alarm), 0.03, True)
    add("noise not given, d' > 5: first", share(group('noise not given', 5.0), first), 0.92)
    add('  false alarms', share(group('noise not given, none'), alarm), 0.04, True)

    def owned_up(r: Record) -> bool:
        return r['verdict'] == 'unexplained' or (r['verdict'] == 'named' and r['remainder'] == 1)

    far = group('outside', 13.0, key='distance_left')
    add("not in the catalogue, d' left > 13: unexplained or remainder", share(far, owned_up), 0.95)
    near = group('outside', 8.0, 13.0, key='distance_left')
    add('  8 to 13', share(near, owned_up), 0.70)
    two = [r for r in group('two') if min(r['distance'], r['distance_second']) > 5.0]
    add("two effects, each d' > 5 beyond the other: one of them first", share(two, first), 0.95)
    add('  both found', share(two, lambda r: r['both'] == 1), 0.75)
    lugs = [r for r in two if r['design'] in ('lugs48', 'full56')]
    add('  both found where lugs vary', share(lugs, lambda r: r['both'] == 1), 0.85)
    right = [r for r in one if first(r)]
    shrink = [
        1 - r['measured_after'] / r['measured_refit'] for r in right if r['measured_refit'] > 0.5
    ]
    closer = [1 - r['excess_after'] / r['excess_refit'] for r in right if r['excess_refit'] > 0.5]
    add('held-out excess gap, median shrink', float(np.median(shrink)) if shrink else np.nan, 0.90)
    truth = float(np.median(closer)) if closer else np.nan
    add('  the same against the noise-free truth', truth, 0.80)
    acted = [r for r in records if r['verdict'] == 'named' and not r['error']]
    add(
        '  significantly worse (below -3 standard errors)',
        share(acted, lambda r: r['worse_z'] < -3),
        0.0,
        True,
    )
    error, sure = calibration(acted)
    add('confidence: calibration error', error, 0.03, True)
    add('  right among those above 0.9', sure, 0.95)
    drive = [r for r in group('drive', 5.0) if r['verdict'] == 'named']
    add("drive rows, d' > 5: in the set when named", share(drive, in_set), 0.95)
    add('  false alarms', share(group('drive, none'), alarm), 0.05, True)
    seconds = [r['processor_seconds'] for r in records if not r['error'] and 50 <= r['rows'] <= 60]
    add(
        'processor time, 50 to 60 rows, median [s]',
        float(np.median(seconds)) if seconds else np.nan,
        0.5,
        True,
        's',
    )
    return rows


def calibration(named: Sequence[Record], bins: int = 10) -> tuple[float, Share]:
    """Return the expected calibration error of the confidence and the hits above 0.9."""
    if not named:
        return float('nan'), Share(0, 0)
    stated = np.array([r['confidence'] for r in named])
    hit = np.array([first(r) for r in named], float)
    index = np.minimum((stated * bins).astype(int), bins - 1)
    error = sum(
        abs(stated[index == i].mean() - hit[index == i].mean()) * np.mean(index == i)
        for i in np.unique(index)
    )
    return float(error), share((r for r in named if r['confidence'] > 0.9), first)


def _line(cells: Sequence[object]) -> str:
    return '| ' + ' | '.join(str(cell) for cell in cells) + ' |'


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    return '\n'.join([_line(header), _line(['---'] * len(header)), *(_line(row) for row in rows)])


def _percent(value: Share) -> str:
    return f'{100 * value.value:.0f} ({value.cases})' if value.cases else '-'


def markdown(records: Sequence[Record]) -> str:
    """Return all tables of the study as Markdown."""
    good = [r for r in records if not r['error']]
    word = {True: 'yes', False: '**no**', None: '-'}
    parts = [
        f'{len(records)} campaigns, {len(records) - len(good)} of them refused or failed.',
        '### Targets',
        _table(
            ('figure', 'reached (95 % interval, cases)', 'asked', 'met'),
            (
                (t.figure.replace('  ', '&nbsp;&nbsp;'), t.reached, t.asked, word[t.met])
                for t in targets(good)
            ),
        ),
    ]
    groups = list(dict.fromkeys(r['group'] for r in good if r['hidden']))
    parts += ["### Named first, in percent (cases), over d'", _over_distance(good, groups, first)]
    parts += [
        "### Truth in the set, in percent (cases), over d'",
        _over_distance(good, groups, in_set),
    ]
    designs = list(dict.fromkeys(r['design'] for r in good))
    rows = []
    for design in designs:
        one = [r for r in good if r['design'] == design and r['group'] in ('one', 'drive')]
        none = [r for r in good if r['design'] == design and r['group'] in ('none', 'drive, none')]
        far = [r for r in one if r['distance'] > 5]
        rows.append(
            (
                design,
                _percent(share((r for r in one if 3 < r['distance'] <= 5), first)),
                _percent(share(far, first)),
                _percent(share(far, in_set)),
                _percent(share(none, alarm)),
                f'{np.median([r["processor_seconds"] for r in good if r["design"] == design]):.2f}',
            )
        )
    header = (
        'design',
        "first, d' 3 to 5",
        "first, d' > 5",
        "in set, d' > 5",
        'false alarms',
        'processor, median s',
    )
    parts += [
        '### By design (group "one")',
        _table(header, rows),
        '### By effect',
        _by_effect(good),
    ]
    parts += ['### Not in the catalogue', _outside(good), '### Confidence', _confidence(good)]
    return '\n\n'.join(parts) + '\n'


def _over_distance(
    records: Sequence[Record], groups: Sequence[str], hit: Callable[[Record], bool]
) -> str:
    edges = (0.0, *BINS, np.inf)
    header = ['group', *(f'{a:g} to {b:g}' for a, b in itertools.pairwise(edges))]
    rows = []
    for name in groups:
        if name == 'outside':
            continue
        chosen = [r for r in records if r['group'] == name]
        rows.append(
            [
                name,
                *(
                    _percent(share((r for r in chosen if a < r['distance'] <= b), hit))
                    for a, b in itertools.pairwise(edges)
                ),
            ]
        )
    return _table(header, rows)


def _by_effect(records: Sequence[Record]) -> str:
    chosen = [r for r in records if r['group'] == 'one']
    rows = []
    for name in sorted({r['hidden'] for r in chosen}):
        own = [r for r in chosen if r['hidden'] == name and r['distance'] > 5]
        middle = [r for r in chosen if r['hidden'] == name and 3 < r['distance'] <= 5]
        wrong: dict[str, int] = {}
        for r in own:
            if not first(r):
                label = r['effects'] or r['verdict']
                wrong[label] = wrong.get(label, 0) + 1
        text = ', '.join(f'{k} {v}' for k, v in sorted(wrong.items(), key=lambda item: -item[1]))
        rows.append(
            (
                name,
                _percent(share(middle, first)),
                _percent(share(own, first)),
                _percent(share(own, in_set)),
                text,
            )
        )
    return _table(('hidden', "first, d' 3 to 5", "first, d' > 5", 'in set', 'taken for'), rows)


def _outside(records: Sequence[Record]) -> str:
    chosen = [r for r in records if r['group'] == 'outside']
    edges = (0.0, 5.0, 8.0, 13.0, 30.0, np.inf)
    rows = []
    for a, b in itertools.pairwise(edges):
        own = [r for r in chosen if a < r['distance_left'] <= b]
        rows.append(
            (
                f'{a:g} to {b:g}',
                len(own),
                *(
                    _percent(share(own, test))
                    for test in (
                        lambda r: r['verdict'] == 'agrees',
                        lambda r: r['verdict'] == 'unexplained',
                        lambda r: r['verdict'] == 'named' and r['remainder'] == 1,
                        lambda r: r['verdict'] == 'named' and r['remainder'] != 1,
                    )
                ),
            )
        )
    header = (
        "d' left by the best listed",
        'cases',
        'agrees',
        'unexplained',
        'named, remainder',
        'named',
    )
    return _table(header, rows)


def _confidence(records: Sequence[Record]) -> str:
    named = [r for r in records if r['verdict'] == 'named']
    edges = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0)
    rows = []
    for a, b in itertools.pairwise(edges):
        own = [r for r in named if a < r['confidence'] <= b]
        if own:
            stated = np.mean([r['confidence'] for r in own])
            rows.append(
                (f'{a:g} to {b:g}', len(own), f'{stated:.3f}', f'{share(own, first).value:.3f}')
            )
    return _table(('confidence', 'named', 'mean stated', 'right'), rows)


def pictures(records: Sequence[Record], folder: Path) -> list[Path]:
    """Draw the curves over d' (by group, by design) and the reliability of the confidence."""
    from matplotlib.figure import Figure

    from wheel_terra_estimator.reporting.style import INK, LINE_COLOURS, picture_style

    good = [r for r in records if not r['error']]

    def curve(axes, chosen: list[Record], label: str) -> None:
        # Few cases, wide bins.
        edges = np.array((1.0, *(BINS if len(chosen) >= 150 else (3.0, 5.0, 10.0, 25.0)), 150.0))
        centres = np.sqrt(edges[:-1] * edges[1:])
        shares = [
            share((r for r in chosen if a < r['distance'] <= b), first)
            for a, b in itertools.pairwise(edges)
        ]
        keep = [i for i, s in enumerate(shares) if s.cases >= 3]
        axes.plot(centres[keep], [shares[i].value for i in keep], 'o-', ms=3, label=label)

    with picture_style():
        figure = Figure(figsize=(13, 4))
        left, middle, right = figure.subplots(1, 3)
        for name in (
            'one',
            'other formula',
            'outliers',
            'noise not given',
            'one, soil 2.5x',
            'drive',
        ):
            curve(left, [r for r in good if r['group'] == name], name)
        for name in dict.fromkeys(r['design'] for r in good if r['design'] != 'drive'):
            curve(middle, [r for r in good if r['group'] == 'one' and r['design'] == name], name)
        for axes, title in ((left, 'by kind of campaign'), (middle, 'same physics, by design')):
            axes.set(xscale='log', ylim=(0, 1.03), xlabel="d' of the hidden effect", title=title)
            axes.set_ylabel('named first')
            axes.set_xticks([2, 5, 10, 20, 50, 100], ['2', '5', '10', '20', '50', '100'])
            axes.minorticks_off()
            axes.legend(fontsize=8)
        named = [r for r in good if r['verdict'] == 'named']
        order = sorted(named, key=lambda r: r['confidence'])
        for part in np.array_split(np.arange(len(order)), 10) if len(order) >= 50 else []:
            own = [order[i] for i in part]
            s = share(own, first)
            low, high = s.interval
            x = np.mean([r['confidence'] for r in own])
            error = [[max(s.value - low, 0.0)], [max(high - s.value, 0.0)]]  # rounding at 0 and 1
            right.errorbar(x, s.value, error, fmt='o', color=LINE_COLOURS[0], ms=4)
        right.plot([0, 1], [0, 1], color=INK, lw=0.8)
        right.set(
            xlabel='stated confidence',
            ylabel='right',
            title='confidence of the name',
            xlim=(0.3, 1.01),
        )
        right.set_ylim(0.3, 1.03)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / 'study_curves.png'
    figure.savefig(path, dpi=110)
    return [path]
