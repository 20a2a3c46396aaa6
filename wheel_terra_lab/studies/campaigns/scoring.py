# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Diagnose a campaign with the package and score the answer against the truth behind it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wheel_terra_lab.trials.campaign import Campaign
from wheel_terra_lab.trials.truth import OUTPUTS

Record = dict[str, Any]

# Columns of the study's CSV file.
FIELDS = (
    'group',
    'design',
    'seed',
    'hidden',
    'size',
    'spice',
    'distance',
    'distance_second',
    'distance_left',
    'distance_beside',
    'rows',
    'verdict',
    'effects',
    'confidence',
    'confidence_of_set',
    'confounded_with',
    'remainder',
    'first',
    'in_set',
    'both',
    'excess_refit',
    'excess_after',
    'measured_refit',
    'measured_after',
    'worse_z',
    'value',
    'std',
    'remainder_amplitude',
    'floor',
    'gap_p_value',
    'seconds',
    'processor_seconds',
    'error',
)


def diagnose(campaign: Campaign, without: tuple[str, ...] = ()) -> Any:
    """Return the package's diagnosis of the campaign's table, ``without`` some effects to name."""
    from wheel_terra_estimator.configuration import reader
    from wheel_terra_estimator.discrepancy.tables.checks import check_table
    from wheel_terra_estimator.discrepancy.workflow import Options
    from wheel_terra_estimator.discrepancy.workflow import diagnose as run
    from wheel_terra_estimator.terramechanics.effects import catalogue

    configuration = reader.from_parameters(campaign.settings(), complete=False)
    table = check_table(f'campaign {campaign.seed}', campaign.table)
    if not without:
        return run(table, configuration)
    known = catalogue()
    names = tuple(n for n, e in known.items() if e.candidate and n not in without)
    return run(table, configuration, options=Options(effects=names))


def score(group: str, campaign: Campaign, diagnosis: Any) -> Record:
    """Return one row of the study."""
    names = [effect.name for effect in diagnosis.effects]
    best = diagnosis.effects[0] if names else None
    hidden = campaign.hidden
    in_set = best is not None and any(h in (best.name, *best.confounded_with) for h in hidden)
    distances = [*campaign.distances, math.nan, math.nan][:2]
    record = {
        'group': group,
        'design': campaign.design,
        'seed': campaign.seed,
        'hidden': '+'.join(hidden),
        'size': '+'.join(f'{x:.4g}' for x in campaign.sizes),
        'spice': '+'.join(f'{x:.3f}' for x in campaign.spice),
        'distance': distances[0],
        'distance_second': distances[1],
        'distance_left': campaign.distance_left,
        'distance_beside': campaign.distance_beside,
        'rows': len(campaign.rows['slip']),
        'verdict': diagnosis.verdict,
        'effects': '+'.join(names),
        'confidence': best.confidence if best else math.nan,
        'confidence_of_set': best.confidence_of_set if best else math.nan,
        'confounded_with': '+'.join(best.confounded_with) if best else '',
        'remainder': int(any(effect.remainder for effect in diagnosis.effects)),
        'first': int(best is not None and best.name in hidden),
        'in_set': int(in_set),
        'both': int(len(hidden) == 2 and set(hidden) <= set(names)),
        'value': math.nan,
        'std': math.nan,
        'remainder_amplitude': diagnosis.remainder_amplitude,
        'floor': diagnosis.floor,
        'gap_p_value': diagnosis.gap_p_value,
        'seconds': diagnosis.seconds,
        'processor_seconds': math.nan,
        'error': '',
    }
    if best and best.name == '+'.join(hidden):
        first = next(iter(best.parameters.values()))
        record['value'], record['std'] = first.value, first.std
    record.update(_held_out(campaign, diagnosis))
    return record


def failure(group: str, design: str, seed: int, error: Exception) -> Record:
    """Return the row of a campaign that the package could not diagnose."""
    record: Record = dict.fromkeys(FIELDS, math.nan)
    record.update(group=group, design=design, seed=seed, error=f'{type(error).__name__}: {error}')
    for key in ('hidden', 'size', 'spice', 'verdict', 'effects', 'confounded_with'):
        record[key] = ''
    return record


def _held_out(campaign: Campaign, diagnosis: Any) -> Record:
    """Gap to the noise-free truth on rows that the fits did not see, in noise deviations.

    The truth is known here, so no noise has to be subtracted: what is counted is what is left of
    the effect (and of structural error) after the soil refit and after the effect was added.
    ``measured_*`` are the same figures as a user can have them: from the measured cells, with the
    squares of noise and floor subtracted. ``worse_z``: standard errors by which adding the effect
    made the held-out squared error of the measured cells smaller (negative: larger).
    """
    kept = diagnosis.table.lines - 2  # the header is line 1
    truth = np.stack([campaign.noise_free[key] for key in OUTPUTS], 1)[kept]
    std = np.stack([campaign.std[key] for key in OUTPUTS], 1)[kept]
    nothing = np.full(len(campaign.rows['slip']), np.nan)
    measured = np.stack([campaign.table.get(key, nothing) for key in OUTPUTS], 1)[kept]
    curves = diagnosis.curves
    n = len(OUTPUTS)  # the lateral force is not drawn
    band, refit, added = (
        values[:, :n] for values in (curves.band, curves.held_out_refit, curves.held_out_after)
    )
    inside = np.isfinite(std) & np.isfinite(measured)

    def beyond(predicted: np.ndarray) -> float:
        squares = (((predicted - measured) / np.maximum(band, std))[inside]) ** 2
        return float(np.sqrt(max(np.mean(squares) - 1.0, 0.0)))

    def excess(predicted: np.ndarray) -> float:
        return float(np.sqrt(np.mean((((predicted - truth) / std)[inside]) ** 2)))

    before = ((refit - measured) / std)[inside] ** 2
    after = ((added - measured) / std)[inside] ** 2
    # Far-off cells (outliers) must not decide: compare robustly.
    gain = np.minimum(before, 16.0) - np.minimum(after, 16.0)
    spread = np.std(gain) / np.sqrt(gain.size)
    return {
        'excess_refit': excess(refit),
        'excess_after': excess(added),
        'measured_refit': beyond(refit),
        'measured_after': beyond(added),
        'worse_z': float(np.mean(gain) / spread) if spread > 0 else 0.0,
    }
