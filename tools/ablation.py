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
from collections import defaultdict
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
"""Loss of slip or pull RMSE that a treatment must save, beyond two standard errors, to stay."""
FIRST_SEED = TEST_SEEDS.start + 500  # seeds of no other study
OWN_OVER_RIVAL = 1.7
"""Duration of the drives of the own world, which are cut, over those of the rival's, which are
compressed."""
_RESAMPLES = 1000
_WORLDS = ('own', 'rival', 'recorded')

Rows = dict[str, dict[str, dict[str, float]]]  # treatment -> drive -> figures


def run(arguments: argparse.Namespace) -> None:
    """Run what is not there yet."""
    done = {(row['treatment'], row['drive']) for row in _read(arguments.file)}
    duration = {'rival': arguments.duration, 'own': OWN_OVER_RIVAL * arguments.duration}
    drives: Iterable[Drive] = simulated(arguments.drives, arguments.seed, duration)
    if arguments.measured:
        drives = itertools.chain(drives, recorded(arguments.measured))
    with arguments.file.open('a', encoding='utf-8') as stream:
        for drive in drives:
            for name, treatment in [(AS_IT_IS, None), *((t.name, t) for t in TREATMENTS)]:
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
    text = report(rows)
    print(text)
    if arguments.output:
        arguments.output.write_text(text + '\n', encoding='utf-8')


def report(rows: Rows) -> str:
    """Return the table of all treatments, strongest first, and what is worth nothing."""
    base = rows[AS_IT_IS]
    lines, idle = [], []
    for treatment in TREATMENTS:
        found = rows.get(treatment.name, {})
        names = [drive for drive in found if drive in base]
        if not names:
            continue
        cells, needed, most = [], False, 0.0
        value, error = _change(base, found, names, 'slip')
        cells.append(_percent(value, error))
        needed |= value > ALLOWED + 2.0 * error
        for world in _WORLDS:
            own = [n for n in names if base[n]['world'] == world]
            value, error = _change(base, found, own, 'slip')
            cells.append(_percent(value, error))
            needed |= value > ALLOWED + 2.0 * error
            most = max(most, value if np.isfinite(value) else 0.0)
        value, error = _change(base, found, names, 'pull')
        needed |= value > ALLOWED + 2.0 * error
        cells.append(_percent(value, error))
        cells.append(f'{100 * (_coverage(found, names) - _coverage(base, names)):+.1f}')
        false, missed = (_sum(found, names, k) - _sum(base, names, k) for k in ('false', 'missed'))
        cells += [f'{false:+.0f}', f'{missed:+.0f}']
        cells.append(_worst(base, found, names))
        needed |= false > 0 or missed > 0
        if not needed:
            idle.append(treatment.name)
        lines.append((most, (treatment.group, treatment.name, *cells, 'yes' if needed else '')))
    lines.sort(key=lambda pair: -pair[0])
    head = (
        *('kind', 'treatment', 'slip, all [%]', *(f'slip, {w} [%]' for w in _WORLDS), 'pull [%]'),
        *('coverage [points]', 'false warnings', 'missed', 'drive hit most', 'earns its place'),
    )
    count = defaultdict(int)
    for row in base.values():
        count[row['world']] += 1
    drives = ', '.join(f'{count[w]} {w}' for w in _WORLDS)
    return (
        f'Drives: {drives}. Change of the root mean square error when the treatment is off, with '
        'one standard error (paired drives, drawn anew). A treatment earns its place where a loss '
        f'exceeds {ALLOWED:.0%} plus two standard errors in one of the columns, or a warning gets '
        f'worse.\n\n{table(head, (cells for _, cells in lines))}\n\n'
        f'Worth no more than {ALLOWED:.0%} plus two standard errors anywhere here: '
        f'{"; ".join(idle) or "none"}.'
    )


def _change(
    base: dict[str, dict[str, float]],
    found: dict[str, dict[str, float]],
    names: Sequence[str],
    what: str,
) -> tuple[float, float]:
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


def _coverage(rows: dict[str, dict[str, float]], names: Sequence[str]) -> float:
    counted = [n for n in names if rows[n].get('slip_count', 0.0) > 0.0]
    total = sum(rows[n]['slip_count'] for n in counted)
    return sum(rows[n]['covered'] for n in counted) / total if total else float('nan')


def _sum(rows: dict[str, dict[str, float]], names: Sequence[str], key: str) -> float:
    return sum(rows[n].get(key, 0.0) for n in names)


def _worst(
    base: dict[str, dict[str, float]], found: dict[str, dict[str, float]], names: Sequence[str]
) -> str:
    changes = {n: _change(base, found, [n], 'slip')[0] for n in names}
    known = {n: c for n, c in changes.items() if np.isfinite(c)}
    if not known:
        return '-'
    name = max(known, key=lambda n: known[n])
    return f'{name} {100 * known[name]:+.0f} %'


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
    runs.add_argument('--measured', type=Path, help='folder of the recorded drives')
    runs.set_defaults(command=run)
    shows = commands.add_parser('show', help='make the table')
    shows.add_argument('file', type=Path)
    shows.add_argument('-o', dest='output', type=Path)
    shows.set_defaults(command=show)
    arguments = parser.parse_args()
    arguments.command(arguments)


if __name__ == '__main__':
    main()
