# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What each special treatment of the estimator is worth: each switched off by itself.

    python -m wheel_terra_lab.studies.ablation run ablation.jsonl --measured ../shared/measured
    python -m wheel_terra_lab.studies.ablation show ablation.jsonl -o ablation.md

``run`` goes through simulated drives of simulators A and B (``ablations/drives.py``) and the
recorded ones; on each it runs the estimator as it is and with each treatment of
``ablations/treatments.py`` off that can act there. It adds to the file line by line and skips
what is there: stop it at any time, start it again. ``show`` makes the table of what is there.
"""

from __future__ import annotations

import argparse
import itertools
import subprocess
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_lab.evaluation.kinds import TEST_SEEDS
from wheel_terra_lab.evaluation.runner import Record, record, run_estimator
from wheel_terra_lab.evaluation.scores import FEWEST_DRIVES
from wheel_terra_lab.evaluation.tables import table
from wheel_terra_lab.jobs import ResultFile
from wheel_terra_lab.studies.ablations.drives import (
    PLANS,
    WHOLE_PLANS,
    Case,
    Drive,
    recorded,
    simulated,
)
from wheel_terra_lab.studies.ablations.treatments import TREATMENTS, Treatment
from wheel_terra_lab.studies.ablations.warnings import Told, listening

AS_IT_IS = 'as it is'
ALLOWED = 0.02
"""Loss of slip, pull or sinkage RMSE that a treatment must save, beyond two standard errors, to
stay; or the share of classes told wrong or too high."""
UNCOVERED, UNCOVERED_DRIVE = 0.01, 0.05
"""Share of errors outside their 95 % interval, beyond those that may be, that it must save: over
all drives; of one drive, to be open."""
MAY_BE_OUTSIDE = 0.05
LATER = 0.05
"""By so much a warning may come later [s] without that anybody asks why."""
FIRST_SEED = TEST_SEEDS.start + 500  # seeds of no other study
_SEEDS_OF_A_ROUND = len(PLANS) + len(WHOLE_PLANS)
_RESAMPLES = 1000
_SIMULATORS = ('A', 'B', 'recorded')
_ESTIMATOR = 'wheel_terra_estimator/estimation'

_HEAD = """# What each special treatment of the estimator is worth

    python -m wheel_terra_lab.studies.ablation run ablation.jsonl --measured ../shared/measured
    python -m wheel_terra_lab.studies.ablation show ablation.jsonl -o ablation.md

Each treatment is switched off by itself (`ablations/treatments.py` says how) and the
estimator run again over those of the drives on which it can act: drives of
simulators A and B (docs/laboratory/simulators.md), with and without a reference, torque or sinkage,
each with a seed of its own, and recorded ones (`ablations/drives.py`).
A loss is the price of doing without; a
negative one says that the treatment did harm. Guards and signs of the stuck warning are also tried
on drives at full length.
"""

Figures = dict[str, dict[str, Any]]  # drive -> figures
Rows = dict[str, Figures]  # treatment -> drive -> figures


def run(arguments: argparse.Namespace) -> None:
    """Run what is not there yet."""
    rows = _rows(arguments.file)
    chosen = [t for t in TREATMENTS if any(word in t.name for word in arguments.treatments)]
    if arguments.special:
        chosen = [t for t in chosen if t.special]
    if arguments.undecided:
        chosen = [t for t in chosen if _verdict_of(t, rows) != 'yes']
    commit = _commit()
    results = ResultFile(arguments.file)
    for drive in _drives(arguments):
        if not drive.tags.issuperset(arguments.tags):
            continue
        missing = [t for t in chosen if t.acts_in(drive) and drive.name not in rows[t.name]]
        if not missing:
            continue
        for name, figures in _tried(drive, missing, known=drive.name in rows[AS_IT_IS]):
            row = {'treatment': name, 'drive': drive.name, 'simulator': drive.simulator, **figures}
            if name == AS_IT_IS:
                row |= {'seed': drive.seed, 'whole': drive.warning_only, 'commit': commit}
            results.add(row)


def _drives(arguments: argparse.Namespace) -> Iterator[Drive]:
    for number in range(arguments.rounds):
        seed = arguments.seed + number * _SEEDS_OF_A_ROUND
        yield from itertools.islice(simulated(PLANS, seed), arguments.drives)
        if arguments.measured and not number:
            yield from recorded(arguments.measured)
        whole = simulated(WHOLE_PLANS, seed + len(PLANS), whole=True)
        yield from itertools.islice(whole, arguments.drives)


def _tried(
    drive: Drive, missing: Sequence[Treatment], *, known: bool
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the figures of a drive as it is, unless `known`, and with each treatment off."""
    case = drive.make()
    if not known or any(t.warning_only for t in missing):
        with listening() as told:
            kept = _run(case)
        yield AS_IT_IS, case.figures(kept)
    for treatment in missing:
        with treatment.off():
            if treatment.warning_only:
                yield treatment.name, case.figures(_with_warning(case, told, kept))
            else:
                yield treatment.name, case.figures(_run(case))


def _run(case: Case) -> Record:
    return record(*run_estimator(case.configuration, case.measurements))


def _with_warning(case: Case, told: Told, kept: Record) -> Record:
    """Return the record with the warning of another monitor that is told the same.

    What the checks of the inputs held back stays held back.
    """
    held_back = told.said & ~kept.stuck
    return replace(kept, stuck=told.played(case.configuration) & ~held_back)


def _commit() -> str:
    """Return the last commit that changed the estimator."""
    git = ['git', '-C', str(Path(__file__).parents[2]), 'log', '-1', '--format=%h', '--']
    return subprocess.run(
        [*git, _ESTIMATOR], capture_output=True, text=True, check=True
    ).stdout.strip()


def show(arguments: argparse.Namespace) -> None:
    """Write the table."""
    rows = _rows(arguments.file)
    text = '\n'.join([_HEAD, _of_this_run(rows[AS_IT_IS]), *filter(None, [arguments.note])])
    text = f'{text}\n\n{report(rows)}'
    print(text)
    if arguments.output:
        arguments.output.write_text(text + '\n', encoding='utf-8')


def _of_this_run(base: Figures) -> str:
    """Say in words which drives were run, with which filter."""
    commits = ', '.join(sorted({str(row['commit']) for row in base.values()}))
    seeds = sorted({row['seed'] for row in base.values() if row['seed']})
    whole = sum(row.get('whole', False) for row in base.values())
    count = Counter(row['simulator'] for row in base.values() if not row.get('whole'))
    drives = ', '.join(f'{count[w]} {w}' for w in _SIMULATORS)
    return (
        f'Filter of commit {commits}; {len(seeds)} seeds, {seeds[0]} to {seeds[-1]}; drives: '
        f'{drives}, and {whole} at full length for the warning alone.\n'
    )


def report(rows: Rows) -> str:
    """Return the table of all treatments, strongest first, and what is worth nothing."""
    base = rows[AS_IT_IS]
    lines = []
    by_verdict: dict[str, list[str]] = defaultdict(list)
    for treatment in TREATMENTS:
        found = rows.get(treatment.name, {})
        names = [drive for drive in found if drive in base]
        if not names:
            by_verdict['not run'].append(treatment.name)
            continue
        loss = _losses(base, found, names)
        verdict = _verdict(base, found, names)
        by_verdict[verdict].append(treatment.name)
        acted = sum(not _same(base[n], found[n]) for n in names)
        cells = [f'{acted} of {len(names)}', *(_percent(*pair) for pair in loss.values())]
        for key, over in _SHARES:
            more = 100.0 * _more_share(base, found, names, key, over)
            cells.append('-' if np.isnan(more) else f'{more:+.1f}')
        cells += [f'{_more(base, found, names, key):+.0f}' for key in ('false', 'missed')]
        later = _later(base, found, names)
        cells.append(f'{-later.mean():+.1f}' if len(later) else '-')
        worst, name = _worst(base, found, names)
        cells.append(f'{name} {100 * worst:+.0f} %' if name else '-')
        lines.append((worst, (treatment.group, treatment.name, *cells, verdict)))
    lines.sort(key=lambda pair: -pair[0])
    head = (
        *('kind', 'treatment', 'acted on', 'slip [%]', *(f'{w} [%]' for w in _SIMULATORS)),
        *('pull [%]', 'sinkage [%]'),
        *('coverage of slip [points]', 'of pull', 'classes wrong [points]', 'too high'),
        *('false warnings', 'missed', 'lead [s]', 'slip of the drive hit most', 'earns its place'),
    )
    lists = '\n'.join(
        f'- {words}: {"; ".join(by_verdict[verdict]) or "none"}.'
        for verdict, words in _VERDICTS.items()
        if verdict != 'not run' or by_verdict[verdict]
    )
    return (
        'Change of the root mean square errors when the treatment is off, with one standard error '
        f'(whole drives drawn anew; not known of fewer than {FEWEST_DRIVES}).\n\n'
        f'{table(head, (cells for _, cells in lines))}\n\n{lists}'
    )


_SHARES = (
    ('slip_covered', 'slip_count'),
    ('pull_covered', 'pull_count'),
    ('class_wrong', 'slip_count'),
    ('class_too_high', 'slip_count'),
)
"""Counts, and what they are shares of."""
_VERDICTS = {
    'yes': f'Earns its place (a loss above {ALLOWED:.0%} plus two standard errors in slip, pull or '
    f'sinkage, over all drives or those of a simulator; {ALLOWED:.0%} of the classes, '
    f'{UNCOVERED:.0%} more errors outside their interval; a warning that gets worse)',
    'open': f'Open (within that, but some drive loses more than {ALLOWED:.0%}, has '
    f'{UNCOVERED_DRIVE:.0%} more errors outside, or is warned later: more drives needed)',
    'no': f'Worth nothing on these drives (no drive loses more than {ALLOWED:.0%})',
    'seldom': f'Lost nothing, but acted on fewer than {FEWEST_DRIVES} drives: more needed',
    'did not act': 'Changed nothing at all, so nothing is known',
    'not run': 'Not run',
}


def _verdict_of(treatment: Treatment, rows: Rows) -> str:
    base, found = rows[AS_IT_IS], rows[treatment.name]
    names = [drive for drive in found if drive in base]
    return _verdict(base, found, names) if names else 'not run'


def _verdict(base: Figures, found: Figures, names: Sequence[str]) -> str:
    if all(_same(base[n], found[n]) for n in names):
        return 'did not act'
    if any(_more(base, found, names, key) > 0 for key in ('false', 'missed')):
        return 'yes'
    if any(value > ALLOWED + 2.0 * error for value, error in _losses(base, found, names).values()):
        return 'yes'
    if len(names) >= FEWEST_DRIVES and _judged_worse(base, found, names):
        return 'yes'
    if any(_later(base, found, names) > LATER) or any(_loses(base, found, n) for n in names):
        return 'open'
    acted = sum(not _same(base[n], found[n]) for n in names)
    return 'no' if acted >= FEWEST_DRIVES else 'seldom'


def _judged_worse(base: Figures, found: Figures, names: Sequence[str]) -> bool:
    """Return whether classes, intervals or warnings get worse by more than is allowed."""
    if any(_more_share(base, found, names, *pair) > ALLOWED for pair in _SHARES[2:]):
        return True
    if any(_more_outside(base, found, names, *pair) > UNCOVERED for pair in _SHARES[:2]):
        return True
    later = _later(base, found, names)
    if len(later) < FEWEST_DRIVES:
        return False
    error = later.std(ddof=1) / np.sqrt(len(later))
    return bool(later.mean() > LATER + 2.0 * error)


def _loses(base: Figures, found: Figures, name: str) -> bool:
    """Return whether a drive is worse by more than is allowed."""
    if any(_change(base, found, [name], what)[0] > ALLOWED for what in ('slip', 'pull', 'sinkage')):
        return True
    return any(_more_outside(base, found, [name], *pair) > UNCOVERED_DRIVE for pair in _SHARES[:2])


def _losses(base: Figures, found: Figures, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the change and its standard error of slip, slip by simulator, pull and sinkage."""
    losses = {'slip': _change(base, found, names, 'slip')}
    for simulator in _SIMULATORS:
        here = [n for n in names if base[n]['simulator'] == simulator]
        losses[simulator] = _change(base, found, here, 'slip')
    for what in ('pull', 'sinkage'):
        losses[what] = _change(base, found, names, what)
    return losses


def _same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    common = [key for key in _COMPARED if key in one and key in other]
    return all(np.isclose(one[key], other[key], rtol=1e-9) for key in common)


_COMPARED = (
    *(
        f'{what}_{sum_}'
        for what in ('slip', 'pull', 'sinkage')
        for sum_ in ('square', 'covered', 'std')
    ),
    *('class_wrong', 'class_too_high', 'false', 'missed', 'lead'),
)


def _later(base: Figures, found: Figures, names: Sequence[str]) -> Any:
    """Return by how much each warning that both gave came later [s]."""
    both = [n for n in names if base[n].get('lead') and found[n].get('lead')]
    return np.array([base[n]['lead'] - found[n]['lead'] for n in both])


def _more(base: Figures, found: Figures, names: Sequence[str], key: str) -> float:
    return sum(found[n].get(key, 0.0) - base[n].get(key, 0.0) for n in names)


def _change(base: Figures, found: Figures, names: Sequence[str], what: str) -> tuple[float, float]:
    """Return the relative change of a root mean square and its standard error; nan for none.

    The error of fewer than three drives is not known: infinite.
    """
    count = f'{what}_count'
    names = [n for n in names if base[n].get(count, 0.0) > 0.0 and count in found[n]]
    if not names:
        return float('nan'), float('nan')
    # Each drive by its mean square, so that the long and the wild do not decide alone.
    before, after = (
        np.array([rows[n][f'{what}_square'] / rows[n][f'{what}_count'] for n in names])
        for rows in (base, found)
    )
    value = float(np.sqrt(after.sum() / before.sum()) - 1.0)
    if len(names) < FEWEST_DRIVES:
        return value, float('inf')
    draws = np.random.default_rng(0).integers(0, len(names), (_RESAMPLES, len(names)))
    drawn = np.sqrt(after[draws].sum(axis=1) / before[draws].sum(axis=1))
    return value, float(np.std(drawn))


def _percent(value: float, error: float) -> str:
    if np.isnan(value):
        return '-'
    return f'{100 * value:+.1f}' + (f' ± {100 * error:.1f}' if np.isfinite(error) else ' (few)')


def _more_share(base: Figures, found: Figures, names: Sequence[str], key: str, over: str) -> float:
    """Return by how much a share of all samples grows; nan where there are none."""
    before, after = (_share(rows, names, key, over) for rows in (base, found))
    return after - before


def _more_outside(
    base: Figures, found: Figures, names: Sequence[str], key: str, over: str
) -> float:
    """Return by how much the share outside the intervals grows, beyond what may be outside."""
    before, after = (
        max(1.0 - _share(rows, names, key, over) - MAY_BE_OUTSIDE, 0.0) for rows in (base, found)
    )
    return after - before


def _share(rows: Figures, names: Sequence[str], key: str, over: str) -> float:
    counted = [n for n in names if rows[n].get(over, 0.0) > 0.0 and key in rows[n]]
    total = sum(rows[n][over] for n in counted)
    return sum(rows[n][key] for n in counted) / total if total else float('nan')


def _worst(base: Figures, found: Figures, names: Sequence[str]) -> tuple[float, str]:
    """Return the greatest loss of slip on a single drive, and which."""
    changes = {n: _change(base, found, [n], 'slip')[0] for n in names}
    known = {n: c for n, c in changes.items() if np.isfinite(c)}
    if not known:
        return float('-inf'), ''
    name = max(known, key=lambda n: known[n])
    return known[name], name


def _rows(path: Path) -> Rows:
    rows: Rows = defaultdict(dict)
    for row in ResultFile(path).rows:
        rows[row['treatment']][row['drive']] = row
    return rows


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    runs = commands.add_parser('run', help='run what is not in the file yet')
    runs.add_argument('file', type=Path)
    runs.add_argument('--seed', type=int, default=FIRST_SEED, help='the first one')
    runs.add_argument('--rounds', type=int, default=1, help='over all drives (default 1)')
    runs.add_argument('--drives', type=int, help='of each list, in each round; default: all')
    runs.add_argument('--special', action='store_true', help='those that act on some drives alone')
    runs.add_argument('--treatments', nargs='+', default=[''], help='words in their names')
    runs.add_argument('--tags', nargs='+', default=[], help='drives that have them all')
    runs.add_argument('--undecided', action='store_true', help='none that earned its place so far')
    runs.add_argument('--measured', type=Path, help='folder of the recorded drives')
    runs.set_defaults(command=run)
    shows = commands.add_parser('show', help='make the table')
    shows.add_argument('file', type=Path)
    shows.add_argument('-o', dest='output', type=Path)
    shows.add_argument('--note', default='', help='a paragraph about this run, above the table')
    shows.set_defaults(command=show)
    arguments = parser.parse_args()
    arguments.command(arguments)


if __name__ == '__main__':
    main()
