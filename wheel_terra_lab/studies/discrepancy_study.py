# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The slow study of the discrepancy workflow: campaigns with something hidden, scored.

    python -m wheel_terra_lab.studies.discrepancy_study run study.csv  # about 2,000 campaigns
    python -m wheel_terra_lab.studies.discrepancy_study run study.csv --jobs 3  # same, faster
    python -m wheel_terra_lab.studies.discrepancy_study show study.csv  # tables on the terminal
    python -m wheel_terra_lab.studies.discrepancy_study show study.csv -o study_tables

``run`` adds to the CSV file row by row and skips what is already there: stop it at any time, start
it again. ``--groups one none``, ``--designs lugs48``, ``--share 0.1`` (a tenth of the campaigns)
and ``--first-seed`` narrow it. Seeds below 100,000 are for choosing thresholds; the figures
that the documentation quotes come from the default seeds (11,000,000 and up), which no threshold
has seen.
Groups and counts: ``campaigns/groups.py``; scores: ``campaigns/scoring.py``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

from wheel_terra_estimator.scheduler import add_jobs_argument
from wheel_terra_lab.jobs import ResultFile, run_jobs
from wheel_terra_lab.studies.campaigns import make_campaign, scoring, summary
from wheel_terra_lab.studies.campaigns.groups import GROUPS

SCORING_SEEDS = 11_000_000
Task = tuple[str, str, int]


def one(task: Task) -> dict[str, object]:
    """Make, diagnose and score one campaign."""
    group, design, seed = task
    campaign = make_campaign(seed, design, GROUPS[group].plan)
    try:
        started = time.process_time()
        diagnosis = scoring.diagnose(campaign)
        seconds = time.process_time() - started
        record = {**scoring.score(group, campaign, diagnosis), 'processor_seconds': seconds}
    except Exception as error:
        record = scoring.failure(group, design, seed, error)
    return {name: record.get(name, '') for name in scoring.FIELDS}


def tasks(arguments: argparse.Namespace) -> Iterator[Task]:
    """Yield the campaigns in an order in which any head of the list is a fair sample."""
    queues = []
    for name in arguments.groups or GROUPS:
        group = GROUPS[name]
        count = max(1, round(group.count * arguments.share))
        seeds = range(arguments.first_seed, arguments.first_seed + count)
        chosen = [d for d in group.designs if not arguments.designs or d in arguments.designs]
        queues.append([(name, design, seed) for seed in seeds for design in chosen])
    # Every group is spread evenly over the whole list.
    keyed = ((i / len(q), task) for q in queues for i, task in enumerate(q))
    return (task for _, task in sorted(keyed, key=lambda item: item[0]))


def run(arguments: argparse.Namespace) -> None:
    """Score the campaigns that the file does not hold yet."""
    results = ResultFile(arguments.file)
    wanted = {tuple(map(str, task)): task for task in tasks(arguments)}
    print(f'{len(results.rows)} campaigns in {arguments.file}', flush=True)

    def tell(number: int, count: int, row: object) -> None:
        if number % 100 == 0:
            print(f'{number} of {count}', flush=True)

    run_jobs(one, wanted, results, _key, jobs=arguments.jobs, tell=tell)


def _key(row: Mapping[str, object]) -> tuple[str, ...]:
    return tuple(str(row[name]) for name in ('group', 'design', 'seed'))


def show(arguments: argparse.Namespace) -> None:
    """Print the tables; with an output folder also write them and the pictures."""
    records = summary.read(arguments.file)
    text = summary.markdown(records)
    print(text)
    for record in [r for r in records if r['error']][:10]:
        print(f'{record["group"]}, {record["design"]}, {record["seed"]:.0f}: {record["error"]}')
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / 'study_tables.md').write_text(text, encoding='utf-8')
        summary.pictures(records, arguments.output)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True, metavar='COMMAND')
    runner = commands.add_parser('run', help='score campaigns into a CSV file')
    runner.add_argument('file', type=Path)
    add_jobs_argument(runner, '--processes', words='campaigns at a time')
    runner.add_argument('--first-seed', type=int, default=SCORING_SEEDS)
    runner.add_argument('--share', type=float, default=1.0, help='share of the campaigns per group')
    runner.add_argument('--groups', nargs='*', choices=list(GROUPS), metavar='GROUP')
    runner.add_argument('--designs', nargs='*', metavar='DESIGN')
    runner.set_defaults(action=run)
    shower = commands.add_parser('show', help='print the tables of a CSV file')
    shower.add_argument('file', type=Path)
    shower.add_argument('-o', '--output', type=Path)
    shower.set_defaults(action=show)
    arguments = parser.parse_args()
    arguments.action(arguments)


if __name__ == '__main__':
    main()
