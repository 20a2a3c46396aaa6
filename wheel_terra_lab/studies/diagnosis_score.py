# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Score the diagnosis on forms, kinds left out, strangers and several effects.

    python -m wheel_terra_lab.studies.diagnosis_score run score.jsonl --first-seed 2200 --rounds 12
    python -m wheel_terra_lab.studies.diagnosis_score show score.jsonl
    python -m wheel_terra_lab.studies.diagnosis_score judge score.jsonl  # what the same data allow

Campaigns of all five designs by the independent quadrature; every form of every effect is drawn.
``kind left out``: the truth is taken out of the effects that may be named, so that any name is
wrong. The run can be ended at any time: rounds go through all groups.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from wheel_terra_estimator.terramechanics.effects.base import effect_of
from wheel_terra_lab.jobs import ResultFile
from wheel_terra_lab.studies.campaigns import make_campaign, scoring
from wheel_terra_lab.studies.campaigns.groups import GROUPS
from wheel_terra_lab.trials.campaign import Campaign
from wheel_terra_lab.trials.designs import DESIGNS
from wheel_terra_lab.trials.detectability import Ruler, listed_kinds
from wheel_terra_lab.trials.forms import FORMS
from wheel_terra_lab.trials.hidden import LISTED
from wheel_terra_lab.trials.trial import interval
from wheel_terra_lab.trials.truth import SOIL_SD

LEFT_OUT = 'kind left out'
OPEN = ('unexplained', 'undecided')
_SEED, _DRAWS = 1, 1000  # of names that are right exactly as often as stated
_SOIL_STEP = 0.2  # stated deviations
_TELLABLE = 3.5  # d' from which the evidence pays the prior of a further effect (some six nats)
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


def campaign_of(group: str, design: str, seed: int) -> Campaign:
    """Return the campaign of a group, design and seed."""
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
    return make_campaign(seed, design, plan)


def record(group: str, design: str, seed: int) -> Record:
    """Diagnose a campaign and return what is scored."""
    campaign = campaign_of(group, design, seed)
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
        'competitors': [list(effect.confounded_with) for effect in found.effects],
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
    results = ResultFile(file)
    done = {tuple(row['key']) for row in results.rows}
    for seed in range(first, first + rounds):
        for key in ((g, d, seed) for g in PLANS for d in DESIGNS):
            if key not in done:
                results.add({'key': key, **record(*key)})


def nearest_competitor(campaign: Campaign) -> tuple[float, str]:
    """Return d' between a hidden effect and the nearest other one, refitted, and its name.

    By the campaigns' own model, soil under its stated deviations, no noise.
    """
    ruler = Ruler(campaign.rows, campaign.soil, campaign.std)
    kinds = listed_kinds(campaign.rows, {**LISTED, **FORMS})
    found = [
        (ruler.distance(campaign.effects, (kind,)), effect_of(name))
        for name, kind in kinds.items()
        if effect_of(name) not in campaign.hidden
    ]
    return min(found)


def beyond_the_others(campaign: Campaign) -> list[float]:
    """Return d' of each hidden effect beyond soil and sizes of the others (linear in these)."""
    ruler = Ruler(campaign.rows, campaign.soil, campaign.std)
    zero = np.zeros(len(SOIL_SD))
    everything = ruler.whitened(zero, campaign.effects)
    # The change by leaving an effect out stands for its direction: sizes enter nearly linearly.
    changes = [
        everything - ruler.whitened(zero, campaign.effects[:k] + campaign.effects[k + 1 :])
        for k in range(len(campaign.effects))
    ]
    soil = [
        (ruler.whitened(_SOIL_STEP * unit, campaign.effects) - everything) / _SOIL_STEP
        for unit in np.eye(len(SOIL_SD))
    ]
    found = []
    for k, change in enumerate(changes):
        others = np.column_stack([*soil, *changes[:k], *changes[k + 1 :]])
        prior = np.diag([1.0] * len(soil) + [0.0] * (len(changes) - 1))
        fitted = np.linalg.solve(others.T @ others + prior + 1e-9 * np.eye(len(prior)), others.T)
        found.append(float(np.sqrt(max(change @ (change - others @ (fitted @ change)), 0.0))))
    return found


def judge(file: Path) -> None:
    """Print what anybody could find in the same campaigns, who knows noise and soil deviations.

    One effect: the likelihood of the truth exceeds that of a competitor at a distance d' with the
    probability Phi(d'/2). Several: an effect that stands less than `_TELLABLE` beyond soil and the
    others does not pay the price of a further effect.
    """
    everything = ResultFile(file).rows
    shares, misses, distances = [], [], []
    for r in everything:
        if r['group'] == 'one' and r['distances'][0] > 5.0:
            distance, competitor = nearest_competitor(campaign_of(*r['key']))
            shares.append(float(ndtr(0.5 * distance)))
            if not set(r['names'][:1]) & set(r['hidden']):
                misses.append(
                    f'{r["hidden"][0]} as {r["names"][:1]}: {competitor} at {distance:.1f}'
                )
        elif r['group'] == 'several':
            distances += beyond_the_others(campaign_of(*r['key']))
    if shares:
        print(f'one effect: {100 * np.mean(shares):.0f} % allowed at most (n {len(shares)})')
        print('\n'.join(f"  {text} (nearest effect, d')" for text in misses))
    far = sum(d > _TELLABLE for d in distances)
    print(f"three to five: {_share(far, len(distances))} stand d' > {_TELLABLE} beyond the others")


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
    error = scoring.calibration_error(sure, right)
    rng = np.random.default_rng(_SEED)
    drawn = [scoring.calibration_error(sure, rng.random(sure.size) < sure) for _ in range(_DRAWS)]
    beyond = math.sqrt(max(error**2 - float(np.mean(np.square(drawn))), 0.0))
    return (
        f'{error:.3f} (n {sure.size}; stated {sure.mean():.2f}, right {right.mean():.2f}; names '
        f'that are right as often as stated: {np.mean(drawn):.3f}, up to '
        f'{np.quantile(drawn, 0.95):.3f}; beyond that scatter {beyond:.3f})'
    )


def show(file: Path) -> None:
    """Print the figures, each with its 95 % interval."""
    everything = ResultFile(file).rows

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
        bool(r['names']) and bool({r['names'][0], *r['competitors'][0]} & set(r['hidden']))
        for r in one
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
    for name in ('show', 'judge'):
        commands.add_parser(name).add_argument('file', type=Path)
    arguments = parser.parse_args()
    if arguments.command == 'run':
        run(arguments.file, arguments.first_seed, arguments.rounds)
    elif arguments.command == 'judge':
        judge(arguments.file)
    else:
        show(arguments.file)


if __name__ == '__main__':
    main()
