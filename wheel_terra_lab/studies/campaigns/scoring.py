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
    """Return what was hidden, what was found, and what is right of it."""
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
        'distance': distances[0],
        'distance_second': distances[1],
        'distance_left': campaign.distance_left,
        'verdict': diagnosis.verdict,
        'effects': '+'.join(names),
        'confidence': best.confidence if best else math.nan,
        'remainder': int(any(effect.remainder for effect in diagnosis.effects)),
        'first': int(best is not None and best.name in hidden),
        'in_set': int(in_set),
        'value': math.nan,
        'std': math.nan,
    }
    if best and best.name == '+'.join(hidden):
        first = next(iter(best.parameters.values()))
        record['value'], record['std'] = first.value, first.std
    record.update(_held_out(campaign, diagnosis))
    return record


def _held_out(campaign: Campaign, diagnosis: Any) -> Record:
    """Gap to the noise-free truth on rows that the fits did not see, in noise deviations.

    The truth is known here, so no noise has to be subtracted: what is counted is what is left of
    the effect (and of structural error) after the soil refit and after the effect was added.
    ``worse_z``: standard errors by which adding the effect made the held-out squared error of the
    measured cells smaller (negative: larger).
    """
    kept = diagnosis.table.lines - 2  # the header is line 1
    truth = np.stack([campaign.noise_free[key] for key in OUTPUTS], 1)[kept]
    std = np.stack([campaign.std[key] for key in OUTPUTS], 1)[kept]
    nothing = np.full(len(campaign.rows['slip']), np.nan)
    measured = np.stack([campaign.table.get(key, nothing) for key in OUTPUTS], 1)[kept]
    curves = diagnosis.curves
    n = len(OUTPUTS)  # the lateral force is not drawn
    refit, added = curves.held_out_refit[:, :n], curves.held_out_after[:, :n]
    inside = np.isfinite(std) & np.isfinite(measured)

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
        'worse_z': float(np.mean(gain) / spread) if spread > 0 else 0.0,
    }


def calibration_error(p: np.ndarray, right: np.ndarray) -> float:
    """Return the mean distance of stated and found frequency over ten bins of equal width."""
    place = np.minimum((p * 10).astype(int), 9)
    return float(
        sum(
            np.abs(p[place == b].mean() - right[place == b].mean()) * np.mean(place == b)
            for b in np.unique(place)
        )
    )
