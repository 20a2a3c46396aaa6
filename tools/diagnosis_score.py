# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Score the diagnosis on forms, kinds left out, strangers and several effects.

    python tools/diagnosis_score.py run score.jsonl --first-seed 2200 --rounds 12
    python tools/diagnosis_score.py show score.jsonl

Campaigns of all five designs by the independent quadrature; every form of every effect is drawn.
``kind left out``: the truth is taken out of the effects that may be named, so that any name is
wrong. The run can be ended at any time: rounds go through all groups.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

for _name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'):
    os.environ.setdefault(_name, '1')

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np  # noqa: E402
from campaigns import make_campaign, scoring  # noqa: E402
from campaigns.groups import GROUPS  # noqa: E402

from wheel_terra_estimator.trials.designs import DESIGNS  # noqa: E402
from wheel_terra_estimator.trials.hidden import LISTED  # noqa: E402
from wheel_terra_estimator.trials.trial import interval  # noqa: E402

LEFT_OUT = 'kind left out'
OPEN = ('unexplained', 'undecided')
Record = dict[str, Any]
_ONE = replace(GROUPS['one'].plan, forms=True)
PLANS = {
    'one': _ONE,
    LEFT_OUT: _ONE,
    'none': GROUPS['none'].plan,
    'structure, none': GROUPS['other formula, none'].plan,
    'soil 2.5x, none': GROUPS['none, soil 2.5x'].plan,
    'strangers': GROUPS['outside'].plan,
    'two': GROUPS['two'].plan,
    'several': GROUPS['one'].plan,
}


def record(group: str, design: str, seed: int) -> Record:
    """Diagnose a campaign and return what is scored."""
    plan = PLANS[group]
    if group == 'several':
        rng = np.random.default_rng([seed, 77])
        count = int(rng.integers(3, 6))
        pool = [
            name
            for name, kind in LISTED.items()
            if not kind.needs or kind.needs == ('lug_height',) or design == 'full56'
        ]
        names = tuple(str(name) for name in rng.choice(pool, count, replace=False))
        plan = replace(plan, names=names, least=6.0)
    campaign = make_campaign(seed, design, plan)
    started = time.process_time()
    found = scoring.diagnose(campaign, campaign.hidden if group == LEFT_OUT else ())
    proposal = found.proposal
    return {
        'group': group,
        'design': design,
        'seed': seed,
        'hidden': list(campaign.hidden),
        'distances': list(campaign.distances),
        'left': campaign.distance_left,
        'verdict': found.verdict,
        'names': [effect.name for effect in found.effects],
        'confidence': [effect.confidence for effect in found.effects],
        'rivals': [list(effect.confounded_with) for effect in found.effects],
        'closed': None if proposal is None else _closed(found),
        'seconds': time.process_time() - started,
    }


def _closed(found: Any) -> float:
    """Share of the gap that the law closes on whole levels left out, all quantities together."""
    refit = law = 0.0
    for quantities in found.proposal.left_out.values():
        for name, item in quantities.items():
            noise = found.gap[name].noise or 1e-9
            refit += max((item.refit / noise) ** 2 - 1.0, 0.0)
            law += max((item.law / noise) ** 2 - 1.0, 0.0)
    return 1.0 - math.sqrt(law / refit) if refit else 0.0


def run(file: Path, first: int, rounds: int) -> None:
    """Append campaigns to the file, those that are in it aside."""
    done = set()
    if file.exists():
        done = {tuple(json.loads(line)['key']) for line in file.read_text().splitlines()}
    with file.open('a', encoding='utf-8') as stream:
        for seed in range(first, first + rounds):
            for key in ((g, d, seed) for g in PLANS for d in DESIGNS):
                if key not in done:
                    stream.write(json.dumps({'key': key, **record(*key)}) + '\n')
                    stream.flush()


def _share(right: int, count: int) -> str:
    low, high = interval(right, count)
    if not count:
        return '-'
    return f'{100 * right / count:.0f} % ({100 * low:.0f} to {100 * high:.0f}, n {count})'


def _of(records: list[Record], test: Any) -> str:
    return _share(sum(bool(test(r)) for r in records), len(records))


def _names(records: list[Record]) -> tuple[np.ndarray, np.ndarray]:
    """Return confidence of each name, and whether it is right."""
    pairs = [
        (sure, name in r['hidden'] and r['group'] != LEFT_OUT)
        for r in records
        for name, sure in zip(r['names'], r['confidence'], strict=True)
    ]
    both = np.array(pairs, dtype=float).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _calibration(records: list[Record]) -> str:
    sure, right = _names(records)
    if not sure.size:
        return '-'
    place = np.minimum((sure * 10).astype(int), 9)
    error = sum(
        abs(sure[place == k].mean() - right[place == k].mean()) * np.mean(place == k)
        for k in np.unique(place)
    )
    return f'{error:.3f} (n {sure.size}; stated {sure.mean():.2f}, right {right.mean():.2f})'


def show(file: Path) -> None:
    """Print the figures, each with its 95 % interval."""
    everything = [json.loads(line) for line in file.read_text().splitlines()]

    def of(*groups: str) -> list[Record]:
        return [r for r in everything if r['group'] in groups]

    def quiet(r: Record) -> bool:
        return not r['confidence'] or max(r['confidence']) <= 0.8

    one = [r for r in of('one') if r['distances'][0] > 5.0]
    far = [r for r in of(LEFT_OUT) if r['distances'][0] > 13.0]
    strange = [r for r in of('strangers') if r['left'] > 13.0]
    two = [r for r in of('two') if min(r['distances']) > 5.0]
    several = of('several')
    hidden = sum(len(r['hidden']) for r in several)
    found = sum(len(set(r['hidden']) & set(r['names'])) for r in several)
    said = sum(len(r['names']) for r in several)
    nothing = of('none', 'structure, none', 'soil 2.5x, none')
    laws = [r['closed'] for r in of(LEFT_OUT, 'strangers') if r['closed'] is not None]
    opened = [r for r in of(LEFT_OUT, 'strangers') if r['verdict'] in OPEN]
    sure, right = _names(everything)
    covered = sum(
        bool(r['names']) and bool({r['names'][0], *r['rivals'][0]} & set(r['hidden'])) for r in one
    )
    lines = {
        "one effect in any form, d' > 5: first": _of(
            one, lambda r: set(r['names'][:1]) & set(r['hidden'])
        ),
        '  in the set': _share(covered, len(one)),
        'nothing hidden: not `agrees`': _of(of('none'), lambda r: r['verdict'] != 'agrees'),
        '  soil 2.5 times worse': _of(of('soil 2.5x, none'), lambda r: r['verdict'] != 'agrees'),
        '  2 % structure': _of(of('structure, none'), lambda r: r['verdict'] != 'agrees'),
        "kind left out, d' > 13: not named above 0.8": _of(far, quiet),
        "strangers, d' left > 13: not named above 0.8": _of(strange, quiet),
        'open verdicts with a law': _share(len(laws), len(opened)),
        '  gap closed on levels left out, median': f'{np.median(laws):.2f}' if laws else '-',
        '  worse than the refit': _share(sum(c < 0.0 for c in laws), len(laws)),
        'laws where nothing is hidden': _of(nothing, lambda r: r['closed'] is not None),
        "two effects, each d' > 5 beyond the other: both": _of(
            two, lambda r: set(r['hidden']) <= set(r['names'])
        ),
        'three to five effects: found': _share(found, hidden),
        '  false names': _share(said - found, said),
        'names above 0.9 that are right': _share(
            int(right[sure > 0.9].sum()), int(sum(sure > 0.9))
        ),
        'calibration error, kinds present': _calibration(
            [r for r in everything if r['group'] != LEFT_OUT]
        ),
        '  with the campaigns whose kind is left out': _calibration(everything),
        'processor time, one or no effect, median': (
            f'{np.median([r["seconds"] for r in of("one", "none")]):.2f} s'
        ),
    }
    print(f'{len(everything)} campaigns')
    for key, text in lines.items():
        print(f'| {key} | {text} |')


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest='command', required=True)
    runner = commands.add_parser('run')
    runner.add_argument('file', type=Path)
    runner.add_argument('--first-seed', type=int, default=2300)
    runner.add_argument('--rounds', type=int, default=12, help='of all groups and designs')
    commands.add_parser('show').add_argument('file', type=Path)
    arguments = parser.parse_args()
    if arguments.command == 'run':
        run(arguments.file, arguments.first_seed, arguments.rounds)
    else:
        show(arguments.file)


if __name__ == '__main__':
    main()
