# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What each special treatment of the estimator is worth: each switched off by itself.

    python tools/ablation.py run ablation.jsonl --drives 14 --measured ../shared/measured
    python tools/ablation.py show ablation.jsonl -o docs/development/ablation.md

``run`` goes through the drives of both worlds (``tools/ablations/drives.py``) and the recorded
ones; on each it runs the estimator as it is and with each treatment of
``tools/ablations/treatments.py`` off. It adds to the file line by line and skips what is there:
stop it at any time, start it again. ``show`` makes the table of what is there.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path

for _name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np  # noqa: E402
from ablations.drives import Drive, recorded, simulated  # noqa: E402
from ablations.treatments import TREATMENTS, Treatment  # noqa: E402

from wheel_terra_estimator.evaluation.kinds import TEST_SEEDS  # noqa: E402
from wheel_terra_estimator.evaluation.scores import FEWEST_DRIVES  # noqa: E402
from wheel_terra_estimator.evaluation.tables import table  # noqa: E402

AS_IT_IS = 'as it is'
ALLOWED = 0.02
"""Loss of slip or pull RMSE that a treatment must save, beyond two standard errors, to stay; or
the share of classes told too high."""
LATER = 0.05
"""By so much a warning may come later [s] without that anybody asks why."""
FIRST_SEED = TEST_SEEDS.start + 500  # seeds of no other study
OWN_OVER_RIVAL = 1.7
"""Duration of the drives of the own world, which are cut, over those of the rival's, which are
compressed."""
_RESAMPLES = 1000
_WORLDS = ('own', 'rival', 'recorded')

_HEAD = """# What each special treatment of the estimator is worth

    python tools/ablation.py run ablation.jsonl --measured ../shared/measured   # or goes on
    python tools/ablation.py show ablation.jsonl -o docs/development/ablation.md

Each treatment is switched off by itself (`tools/ablations/treatments.py` says how) and the
estimator run again over drives of [both worlds](worlds.md) and recorded ones, some without a
reference. A loss is the price of doing without; a negative one says that the treatment did harm.
"""

Figures = dict[str, dict[str, float]]  # drive -> figures
Rows = dict[str, Figures]  # treatment -> drive -> figures


def run(arguments: argparse.Namespace) -> None:
    """Run what is not there yet."""
    done = {(row['treatment'], row['drive']) for row in _read(arguments.file)}
    duration = {'rival': arguments.duration, 'own': OWN_OVER_RIVAL * arguments.duration}
    drives: Iterable[Drive] = simulated(arguments.drives, arguments.seed, duration)
    if arguments.measured:
        drives = itertools.chain(drives, recorded(arguments.measured))
    chosen = [t for t in TREATMENTS if not arguments.groups or t.group in arguments.groups]
    with arguments.file.open('a', encoding='utf-8') as stream:
        for drive in drives:
            for name, treatment in [(AS_IT_IS, None), *((t.name, t) for t in chosen)]:
                if (name, drive.name) in done or _without_effect(treatment, drive):
                    continue
                with nullcontext() if treatment is None else treatment.off():
                    figures = drive.run()
                row = {'treatment': name, 'drive': drive.name, 'world': drive.world, **figures}
                stream.write(json.dumps(row) + '\n')
                stream.flush()


def _without_effect(treatment: Treatment | None, drive: Drive) -> bool:
    return treatment is not None and treatment.warnings_only and not drive.entraps


def show(arguments: argparse.Namespace) -> None:
    """Write the table."""
    rows: Rows = defaultdict(dict)
    for row in _read(arguments.file):
        rows[str(row['treatment'])][str(row['drive'])] = row
    text = '\n'.join([_HEAD, *filter(None, [arguments.note]), '', report(rows)])
    print(text)
    if arguments.output:
        arguments.output.write_text(text + '\n', encoding='utf-8')


def report(rows: Rows) -> str:
    """Return the table of all treatments, strongest first, and what is worth nothing."""
    base = rows[AS_IT_IS]
    lines = []
    by_verdict: dict[str, list[str]] = defaultdict(list)
    for treatment in TREATMENTS:
        found = rows.get(treatment.name, {})
        names = [drive for drive in found if drive in base]
        if not names:
            continue
        loss = _losses(base, found, names)
        verdict = _verdict(base, found, names, loss)
        by_verdict[verdict].append(treatment.name)
        cells = [_percent(*pair) for pair in loss.values()]
        cells.append(f'{100 * (_coverage(found, names) - _coverage(base, names)):+.1f}')
        cells.append(f'{100 * (_too_high(found, names) - _too_high(base, names)):+.1f}')
        cells += [f'{_more(base, found, names, key):+.0f}' for key in ('false', 'missed')]
        warned = [n for n in names if base[n].get('lead') and found[n].get('lead')]
        sooner = _more(base, found, warned, 'lead') / len(warned) if warned else float('nan')
        cells.append('-' if np.isnan(sooner) else f'{sooner:+.1f}')
        worst, name = _worst(base, found, names)
        cells.append(f'{name} {100 * worst:+.0f} %' if name else '-')
        lines.append((worst, (treatment.group, treatment.name, *cells, verdict)))
    lines.sort(key=lambda pair: -pair[0])
    head = (
        *('kind', 'treatment', 'slip [%]', *(f'{w} [%]' for w in _WORLDS), 'pull [%]'),
        *(
            'coverage [points]',
            'classes too high [points]',
            'false warnings',
            'missed',
            'lead [s]',
            'slip of the drive hit most',
        ),
        'earns its place',
    )
    count = Counter(row['world'] for row in base.values())
    drives = ', '.join(f'{count[w]} {w}' for w in _WORLDS)
    lists = '\n'.join(
        f'- {words}: {"; ".join(by_verdict[verdict]) or "none"}.'
        for verdict, words in _VERDICTS.items()
    )
    return (
        f'Drives: {drives}. Change of the root mean square errors when the treatment is off, with '
        'one standard error (whole drives drawn anew; not known of fewer than '
        f'{FEWEST_DRIVES}).\n\n{table(head, (cells for _, cells in lines))}\n\n{lists}'
    )


_VERDICTS = {
    'yes': f'Earns its place (a loss above {ALLOWED:.0%} plus two standard errors in slip or pull, '
    'that share of classes told too high, or a warning that gets worse)',
    'open': f'Open (within that, but some drive loses more than {ALLOWED:.0%} or is warned '
    'later: more drives needed)',
    'no': f'Worth nothing on these drives (no drive loses more than {ALLOWED:.0%})',
    'did not act': 'Changed nothing at all, so nothing is known',
}


def _losses(base: Figures, found: Figures, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the change and its standard error of slip, slip by world, and pull."""
    losses = {'slip': _change(base, found, names, 'slip')}
    for world in _WORLDS:
        here = [n for n in names if base[n]['world'] == world]
        losses[world] = _change(base, found, here, 'slip')
    losses['pull'] = _change(base, found, names, 'pull')
    return losses


def _verdict(
    base: Figures, found: Figures, names: Sequence[str], loss: dict[str, tuple[float, float]]
) -> str:
    if any(_more(base, found, names, key) > 0 for key in ('false', 'missed')):
        return 'yes'
    if any(value > ALLOWED + 2.0 * error for value, error in loss.values()):
        return 'yes'
    if _too_high(found, names) - _too_high(base, names) > ALLOWED:
        return 'yes'
    if all(_same(base[n], found[n]) for n in names):
        return 'did not act'
    if any(found[n].get('lead', 0.0) < base[n].get('lead', 0.0) - LATER for n in names):
        return 'open'
    each = [_change(base, found, [n], what)[0] for n in names for what in ('slip', 'pull')]
    return 'open' if any(value > ALLOWED for value in each) else 'no'


def _same(one: dict[str, float], other: dict[str, float]) -> bool:
    keys = ('slip_square', 'pull_square', 'covered', 'class_too_high', 'false', 'missed', 'lead')
    return all(np.isclose(one.get(k, 0.0), other.get(k, 0.0), rtol=1e-9) for k in keys)


def _more(base: Figures, found: Figures, names: Sequence[str], key: str) -> float:
    return sum(found[n].get(key, 0.0) - base[n].get(key, 0.0) for n in names)


def _change(base: Figures, found: Figures, names: Sequence[str], what: str) -> tuple[float, float]:
    """Return the relative change of a root mean square and its standard error; nan for none.

    The error of fewer than three drives is not known: infinite.
    """
    names = [n for n in names if base[n].get(f'{what}_count', 0.0) > 0.0]
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


def _coverage(rows: Figures, names: Sequence[str]) -> float:
    return _share(rows, names, 'covered')


def _too_high(rows: Figures, names: Sequence[str]) -> float:
    return _share(rows, names, 'class_too_high')


def _share(rows: Figures, names: Sequence[str], key: str) -> float:
    counted = [n for n in names if rows[n].get('slip_count', 0.0) > 0.0 and key in rows[n]]
    total = sum(rows[n]['slip_count'] for n in counted)
    return sum(rows[n][key] for n in counted) / total if total else float('nan')


def _worst(base: Figures, found: Figures, names: Sequence[str]) -> tuple[float, str]:
    """Return the greatest loss of slip on a single drive, and which."""
    changes = {n: _change(base, found, [n], 'slip')[0] for n in names}
    known = {n: c for n, c in changes.items() if np.isfinite(c)}
    if not known:
        return float('-inf'), ''
    name = max(known, key=lambda n: known[n])
    return known[name], name


def _read(path: Path) -> list[dict[str, float]]:
    if not path.is_file():
        return []
    return [json.loads(line) for line in path.read_text(encoding='utf-8').splitlines() if line]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    runs = commands.add_parser('run', help='run what is not in the file yet')
    runs.add_argument('file', type=Path)
    runs.add_argument('--drives', type=int, default=14, help='simulated drives (default 14)')
    runs.add_argument('--seed', type=int, default=FIRST_SEED)
    runs.add_argument(
        '--duration', type=float, default=35.0, help='of a rival drive [s] (default 35)'
    )
    runs.add_argument('--groups', nargs='+', choices=sorted({t.group for t in TREATMENTS}))
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
