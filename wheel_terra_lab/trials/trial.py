# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One blind trial: hide, withhold the truth, diagnose, compare."""

from __future__ import annotations

import csv
import difflib
import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.result import OPEN, Diagnosis
from wheel_terra_estimator.discrepancy.tables.parsing import read_table
from wheel_terra_estimator.discrepancy.workflow import diagnose
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.trials.campaign import Campaign, Plan, make_campaign
from wheel_terra_lab.trials.hidden import LISTED, OUTSIDE

NONE, STRANGER = 'none', 'stranger'
TABLE, RIG, SEAL = 'blind.csv', 'rig.yaml', 'sealed.json'
DESIGNS = ('sweep40', 'lugs48', 'full56')
LEAST = 8.0  # d' of what is hidden, at least: smaller effects nobody can see
# Lots: nothing hidden, a stranger, else one effect of the catalogue.
_SHARE_NONE, _SHARE_STRANGER = 0.15, 0.15


@dataclass(frozen=True)
class Outcome:
    """What was hidden, what was said, and whether that is right.

    ``gap`` quantity -> (noise, before, refitted, after), root mean squares on unseen rows [SI];
    ``distance`` is d' of what was hidden: noise deviations beyond the best refit of the soil.
    """

    seed: int
    design: str
    hidden: str
    distance: float
    verdict: str
    said: tuple[str, ...]
    confidence: float
    right: bool
    words: str
    proposal: str
    seconds: float
    gap: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


def names() -> tuple[str, ...]:
    """Return what can be hidden."""
    return (NONE, STRANGER, *sorted(LISTED))


def draw(seed: int, effect: str | None) -> Campaign:
    """Return the campaign of a seed; without an effect it is drawn by lot as well.

    Raises UserError for an effect that cannot be hidden.
    """
    rng = np.random.default_rng([seed, 19])
    lot = float(rng.random())
    if effect is None:
        if lot < _SHARE_NONE:
            effect = NONE
        elif lot < _SHARE_NONE + _SHARE_STRANGER:
            effect = STRANGER
    if effect is not None and effect not in names():
        close = difflib.get_close_matches(effect, names(), n=1, cutoff=0.0)[0]
        raise UserError(
            f"--effect {effect}: cannot be hidden, nearest is '{close}'; there are: "
            f'{", ".join(names())}'
        )
    design = str(rng.choice(DESIGNS))
    if effect == NONE:
        plan = Plan(hide='none', noise='mixed')
    elif effect == STRANGER:
        plan = Plan(hide='outside', noise='mixed', names=(str(rng.choice(sorted(OUTSIDE))),))
    elif effect is None:
        plan = Plan(noise='mixed')
    else:
        # Some effects need inputs that only the fullest design varies.
        design = 'full56' if LISTED[effect].needs else design
        plan = Plan(noise='mixed', names=(effect,))
    plan = replace(plan, least=LEAST)
    try:
        return make_campaign(seed, design, plan)
    except RuntimeError as error:
        raise UserError(f'--seed {seed}: {error}; take another seed') from None


def hide(campaign: Campaign, folder: Path) -> str:
    """Write blind table, rig file and withheld truth; return its SHA-256."""
    campaign.write_csv(folder / TABLE)
    configuration = reader.from_parameters(campaign.settings(), complete=False)
    configuration.write(folder / RIG, comment='the model that the engineer believes in')
    truth = {
        'seed': campaign.seed,
        'design': campaign.design,
        'hidden': list(campaign.hidden),
        'sizes': list(campaign.sizes),
        'distances': list(campaign.distances),
        'soil': asdict(campaign.soil),
        'believed': asdict(campaign.believed),
    }
    text = json.dumps(truth, indent=1) + '\n'
    (folder / SEAL).write_text(text, encoding='utf-8')
    return hashlib.sha256(text.encode()).hexdigest()


def solve_blind(folder: Path) -> Diagnosis:
    """Diagnose the blind table; nothing but table and rig file is read."""
    configuration = reader.load([folder / RIG], complete=False)
    return diagnose(read_table(folder / TABLE), configuration)


def compare(folder: Path, diagnosis: Diagnosis) -> Outcome:
    """Reveal the truth and compare."""
    truth = json.loads((folder / SEAL).read_text(encoding='utf-8'))
    hidden = tuple(truth['hidden'])
    said = tuple(effect.name for effect in diagnosis.effects)
    sure = diagnosis.effects[0].confidence if diagnosis.effects else math.nan
    if not hidden:
        right = diagnosis.verdict == 'agrees'
        wanted = 'nothing was hidden'
    elif set(hidden) <= set(LISTED):
        right = bool(said) and said[0] in hidden
        wanted = f'{" + ".join(hidden)} was hidden'
    else:
        # Owned up to: neither a name, however doubtful, nor an agreement.
        right = diagnosis.verdict in OPEN
        wanted = f'an effect outside the catalogue was hidden ({hidden[0]})'
    answer = f'{" + ".join(said)} ({sure:.2f})' if said else diagnosis.verdict
    return Outcome(
        truth['seed'],
        truth['design'],
        ' + '.join(hidden) or NONE,
        max(truth['distances'], default=0.0),
        diagnosis.verdict,
        said,
        sure,
        right,
        f'{wanted}; said: {answer}: {"right" if right else "wrong"}',
        diagnosis.proposal.words if diagnosis.proposal else '',
        diagnosis.seconds,
        {
            quantity: (gap.noise, gap.before, gap.refit, gap.after)
            for quantity, gap in diagnosis.gap.items()
        },
    )


def write_scores(outcomes: Sequence[Outcome], path: Path) -> None:
    """Write one row per trial."""
    keys = ('seed', 'design', 'hidden', 'distance', 'verdict', 'said', 'confidence', 'right')
    with path.open('w', encoding='utf-8', newline='') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(keys)
        for outcome in outcomes:
            row = [getattr(outcome, key) for key in keys]
            row[5] = ' + '.join(outcome.said)
            writer.writerow([f'{v:.4g}' if isinstance(v, float) else v for v in row])


def interval(right: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson 1927, doi 10.1080/01621459.1927.10502953)."""
    if count == 0:
        return 0.0, 1.0
    z = 1.96
    share = right / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    half /= 1 + z * z / count
    return max(middle - half, 0.0), min(middle + half, 1.0)


def score(outcomes: Sequence[Outcome]) -> list[tuple[str, int, int, float, float]]:
    """Return (kind, right, count, low, high): effects, strangers, nothing hidden, all."""
    kinds = {
        'listed effects': [o for o in outcomes if o.hidden in LISTED],
        'strangers': [o for o in outcomes if o.hidden in OUTSIDE],
        'nothing hidden': [o for o in outcomes if o.hidden == NONE],
        'all': list(outcomes),
    }
    rows = []
    for kind, mine in kinds.items():
        right = sum(o.right for o in mine)
        rows.append((kind, right, len(mine), *interval(right, len(mine))))
    return rows
