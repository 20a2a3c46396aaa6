# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""README's figures of the estimator: drives of ten soils, scored once, written into the pages.

    python -m wheel_terra_lab.studies.readme_figures run --jobs 2   # goes on where it was ended
    python -m wheel_terra_lab.studies.readme_figures write   # README, worth.md, figures.yaml

Simulators A and B on ten seeds: on each every second kind of drive, so that each kind is driven on
half of the seeds, with and without a reference velocity. A seed is one soil in A (in B each drive
has its own, and its own rover), so intervals are those of soils drawn anew. Each row of
``docs/figures.csv`` names the last commit that changed the code; rows of two are refused. 165
drives: 20 to 25 minutes on two cores. Take seeds that nobody has looked at: ``--first-seed``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.evaluation import scores
from wheel_terra_lab.evaluation.bench import DriveScore, score_drive
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.jobs import ResultFile, run_jobs

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / 'docs' / 'figures.csv'
FIGURES = ROOT / 'docs' / 'figures.yaml'
README = ROOT / 'README.md'
WORTH = ROOT / 'docs' / 'worth.md'
BEGIN, END = '<!-- readme_figures: begin -->\n', '<!-- readme_figures: end -->\n'
COMMAND = 'python -m wheel_terra_lab.studies.readme_figures run'
WHAT = 'the estimator on simulated drives'
REPLACED = (WHAT, 'slip without a reference velocity', 'with a reference velocity')
"""Beginnings of entries of `FIGURES` in whose place the new one comes."""
MEASURED = ('wheel_terra_estimator', 'wheel_terra_lab', 'config')
"""Folders whose change makes other figures."""
DRIVEN = ('A', 'B')
MODES = ('no_reference', 'reference')
FIRST_SEED, SOILS = 8500, 10
FILTERS = ('torque', 'pitch', 'curve')
QUANTITIES = ('slip', 'sinkage', 'pull', *(f'{name}_filter' for name in FILTERS))
WORST_KINDS = 5
"""Of each simulator in the table of kinds."""
DRAWS = 2000
"""Of the soils, for the 95 % intervals."""
Row = Mapping[str, Any]


def rows_of(task: tuple[str, str, int], commit: str) -> list[dict[str, Any]]:
    """Simulate and score one drive; return a row for each mode."""
    return [_row(score, commit) for score in score_drive(*task, MODES)]


def _row(score: DriveScore, commit: str) -> dict[str, Any]:
    samples, warned = score.samples, score.warnings
    errors = {name: getattr(samples, f'{name}_error') for name in QUANTITIES}
    there = {name: error[~np.isnan(error)] for name, error in errors.items()}
    within = np.abs(samples.slip_error) <= scores.WITHIN * samples.slip_std
    return {
        'simulator': score.simulator,
        'kind': score.kind,
        'seed': score.seed,
        'mode': score.mode,
        'commit': commit,
        **{f'{name}_samples': error.size for name, error in there.items()},
        **{f'{name}_squares': f'{float(error @ error):.6g}' for name, error in there.items()},
        'slip_within': int(within.sum()),
        'entrapped': int(warned.entrapped is not None),
        'warned': int(warned.entrapped is not None and warned.lead_time is not None),
        'false': warned.false_alarms,
        'hours': f'{warned.duration / 3600.0:.5f}',
    }


def run(results: ResultFile, first_seed: int, soils: int, jobs: int) -> None:
    """Score the drives that are not in the file yet."""
    commit = current_commit()
    _one_commit([*results.rows, {'commit': commit}])
    run_jobs(
        partial(rows_of, commit=commit),
        {(*drive[:2], str(drive[2])): drive for drive in drives(first_seed, soils)},
        results,
        lambda row: (row['simulator'], row['kind'], str(row['seed'])),
        jobs=jobs,
        tell=lambda number, count, row: print(
            f'{number} of {count}: {row["simulator"]} {row["kind"]} {row["seed"]}', flush=True
        ),
    )


def drives(first_seed: int, soils: int) -> list[tuple[str, str, int]]:
    """Return simulator, kind and seed of each drive: on a seed, every second kind."""
    return [
        (simulator, kind, seed)
        for seed in range(first_seed, first_seed + soils)
        for simulator in DRIVEN
        for kind in SIMULATORS[simulator].kinds[seed % 2 :: 2]
    ]


def current_commit() -> str:
    """Return the last commit that changed what is measured, which has to be as committed."""
    if changed := _git('status', '--porcelain', '--untracked-files=no'):
        raise UserError(f'commit first, figures name their commit: {changed.split()[1]} is changed')
    return _git('log', '-1', '--abbrev=7', '--format=%h')


def _git(*words: str) -> str:
    """Return what git says of the code and the shipped files."""
    command = ['git', '-C', str(ROOT), *words, '--', *MEASURED]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def _one_commit(rows: Sequence[Row]) -> str:
    commits = sorted({row['commit'] for row in rows})
    if len(commits) != 1:
        raise UserError(f'rows of {", ".join(commits)}: delete {RESULTS.name} and begin anew')
    return str(commits[0])


def table(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Return the rows of README's table: name -> cells, one per simulator."""
    found: dict[str, list[str]] = {}
    for mode, words in zip(MODES, ('without a reference', 'with one'), strict=True):
        for name, cell in CELLS.items():
            if mode == 'no_reference' and name in ONLY_WITH:
                continue
            found[f'{words}: {name}'] = [
                cell([r for r in rows if r['mode'] == mode and r['simulator'] == simulator])
                for simulator in DRIVEN
            ]
    return found


def rms(rows: Sequence[Row], quantity: str) -> float:
    """Return the root mean square error over all samples of some drives."""
    return (
        total(rows, f'{quantity}_squares') / max(total(rows, f'{quantity}_samples'), 1.0)
    ) ** 0.5


def total(rows: Sequence[Row], column: str) -> float:
    """Return the sum of a column."""
    return sum(float(row[column]) for row in rows)


def interval(rows: Sequence[Row], figure: Callable[[Sequence[Row]], float]) -> tuple[float, float]:
    """Return the 95 % interval of a figure over soils drawn anew."""
    soils = list(by_soil(rows).values())
    random = np.random.default_rng(1)
    draws = random.integers(0, len(soils), (DRAWS, len(soils)))
    values = [figure([row for i in draw for row in soils[i]]) for draw in draws]
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)


def by_soil(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return seed -> its rows."""
    found: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        found[str(row['seed'])].append(row)
    return dict(found)


def _coverage(rows: Sequence[Row]) -> float:
    return 100.0 * total(rows, 'slip_within') / max(total(rows, 'slip_samples'), 1.0)


def _with_interval(rows: Sequence[Row], figure: Callable[[Sequence[Row]], float], spec: str) -> str:
    low, high = interval(rows, figure)
    return f'{figure(rows):{spec}} ({low:{spec}} to {high:{spec}})'


def _slip(rows: Sequence[Row]) -> str:
    return _with_interval(rows, partial(rms, quantity='slip'), '.3f')


def _worst_soil(rows: Sequence[Row]) -> str:
    soils = by_soil(rows)
    worst = max(soils, key=lambda seed: rms(soils[seed], 'slip'))
    return f'{rms(soils[worst], "slip"):.3f}, seed {worst}'


def _baseline(rows: Sequence[Row]) -> str:
    return f'{min(rms(rows, f"{name}_filter") for name in FILTERS):.3f}'


def _held(rows: Sequence[Row]) -> str:
    worst = min(_coverage(part) for part in by_soil(rows).values())
    return f'{_coverage(rows):.0f} %; {worst:.0f} %'


def _pull(rows: Sequence[Row]) -> str:
    return f'{_with_interval(rows, lambda part: 100.0 * rms(part, "pull"), ".1f")} %'


def _sinkage(rows: Sequence[Row]) -> str:
    return f'{_with_interval(rows, lambda part: 1e3 * rms(part, "sinkage"), ".2f")} mm'


def _warnings(rows: Sequence[Row]) -> str:
    warned, entrapped, false = (int(total(rows, name)) for name in ('warned', 'entrapped', 'false'))
    return f'{warned} of {entrapped}; {false} in {total(rows, "hours"):.1f} h'


CELLS: dict[str, Callable[[Sequence[Row]], str]] = {
    'slip, rms error': _slip,
    'slip, worst soil': _worst_soil,
    'slip, best filter of two or three states': _baseline,
    '95 % intervals that hold the true slip; worst soil': _held,
    'drawbar pull, rms error over load': _pull,
    'sinkage, rms error': _sinkage,
    'entrapments warned before; false warnings': _warnings,
}
ONLY_WITH = ('drawbar pull, rms error over load', 'sinkage, rms error')


def markdown(rows: Sequence[Row]) -> str:
    """Return README's table with what it rests on."""
    soils = len(by_soil(rows))
    counts = [
        sum(row['simulator'] == name and row['mode'] == MODES[0] for row in rows) for name in DRIVEN
    ]
    head = [f'{soils} soils; intervals are over soils']
    head += [f'simulator {name}, {n} drives' for name, n in zip(DRIVEN, counts, strict=True)]
    lines = [f'| {" | ".join(head)} | command |', '|---' * (len(head) + 1) + '|']
    cells = table(rows)
    lines += [
        f'| {name} | {" | ".join(values)} | {"the same" if i else f"`{COMMAND}`"} |'
        for i, (name, values) in enumerate(cells.items())
    ]
    return '\n'.join(lines) + '\n'


def kinds(rows: Sequence[Row]) -> str:
    """Return a table of the kinds of drives with the largest errors without a reference."""
    lines = [
        '| worst kinds | without a reference: slip; in the 95 % intervals | with one |',
        '|---|---|---|',
    ]
    for simulator in DRIVEN:
        found: dict[str, list[Row]] = defaultdict(list)
        for row in rows:
            if row['simulator'] == simulator:
                found[row['kind']].append(row)
        cells = {
            kind: [[row for row in part if row['mode'] == mode] for mode in MODES]
            for kind, part in found.items()
        }
        worst = sorted(found, key=lambda kind: rms(cells[kind][0], 'slip'), reverse=True)
        lines += [
            f'| {simulator} {kind.replace("_", " ")} | '
            + ' | '.join(f'{rms(c, "slip"):.3f}; {_coverage(c):.0f} %' for c in cells[kind])
            + ' |'
            for kind in worst[:WORST_KINDS]
        ]
    return '\n'.join(lines) + '\n'


def page(rows: Sequence[Row]) -> str:
    """Return what stands in docs/worth.md: where the table is from, the worst kinds of drives."""
    seeds = sorted(int(seed) for seed in by_soil(rows))
    said = (
        f'Seeds {seeds[0]} to {seeds[-1]}, on each every second kind of drive, commit '
        f"{_one_commit(rows)}; the rover file's soil is off by 20 % and more. Drive by drive: "
        '`docs/figures.csv`.\n'
    )
    return f'{said}\n{kinds(rows)}'


def _put(page: Path, text: str) -> None:
    """Put a text between the two lines of a page that mark its place."""
    before, begin, rest = page.read_text(encoding='utf-8').partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise UserError(f'{page.name}: the lines {BEGIN.strip()} and {END.strip()} are missing')
    page.write_text(f'{before}{BEGIN}{text}{END}{after}', encoding='utf-8')


def write(rows: Sequence[Row]) -> None:
    """Put the tables into README and worth.md, README's cells into the file of all figures."""
    commit = _one_commit(rows)
    seeds = sorted(int(seed) for seed in by_soil(rows))
    _put(README, markdown(rows))
    _put(WORTH, page(rows))
    text = FIGURES.read_text(encoding='utf-8')
    comment = ''.join(line for line in text.splitlines(True) if line.startswith('#'))
    entry = {
        'what': WHAT,
        'command': COMMAND,
        'seeds': f'{seeds[0]} to {seeds[-1]}',
        'commit': commit,
        'rows': table(rows),
    }
    others = [e for e in yaml.safe_load(text) if not e['what'].startswith(REPLACED)]
    entries = yaml.safe_dump([entry, *others], sort_keys=False, allow_unicode=True, width=120)
    FIGURES.write_text(comment + entries, encoding='utf-8')


def main(argv: Sequence[str] | None = None) -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('what', choices=('run', 'show', 'write'))
    parser.add_argument('--results', type=Path, default=RESULTS, metavar='F.csv')
    parser.add_argument('--first-seed', type=int, default=FIRST_SEED)
    parser.add_argument('--soils', type=int, default=SOILS)
    parser.add_argument('--jobs', type=int, default=1)
    arguments = parser.parse_args(argv)
    try:
        results = ResultFile(arguments.results)
        if arguments.what == 'run':
            run(results, arguments.first_seed, arguments.soils, arguments.jobs)
        if not results.rows:
            raise UserError(f'{arguments.results}: no result in it; begin with: run')
        if arguments.what == 'write':
            write(results.rows)
        else:
            print(markdown(results.rows), end='')
    except UserError as error:
        print(f'readme_figures: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
