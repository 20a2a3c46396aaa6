# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Refit the map from posterior weights to confidence (discrepancy/selection/confidence_map.json).

    python -m wheel_terra_lab.studies.fit_confidence run names.jsonl --jobs 2  # resumable
    python -m wheel_terra_lab.studies.fit_confidence fit names.jsonl  # writes the map

Campaigns of all groups of the slow study, on seeds of their own. The calibration error is that of
predictions for a design which the fit did not see.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.special import expit

from wheel_terra_estimator.discrepancy.selection import verdict
from wheel_terra_estimator.scheduler import add_jobs_argument
from wheel_terra_lab.jobs import ResultFile, run_jobs
from wheel_terra_lab.studies.campaigns import make_campaign, scoring
from wheel_terra_lab.studies.campaigns.groups import GROUPS

FIRST_SEED = 50_000  # below 100,000: not for scoring
LEFT_OUT = ', kind left out'
KINDS_LEFT_OUT = ('one', 'other formula')
RIDGE = 1.0  # prior precision of the coefficients
MAP = Path(verdict.__file__).with_name('confidence_map.json')


def names_of(task: tuple[str, str, int]) -> list[dict[str, object]]:
    """Return one record per name that the workflow gives to a campaign."""
    group, design, seed = task
    key = f'{group} {design} {seed}'
    name, mark, _ = group.partition(LEFT_OUT)
    try:
        campaign = make_campaign(seed, design, GROUPS[name].plan)
        # The kind of the truth taken out of the catalogue: every name is wrong.
        without = campaign.hidden if mark else ()
        diagnosis = scoring.diagnose(campaign, without)
    except Exception as error:
        return [{'key': key, 'error': str(error)}]
    return [
        {
            'key': key,
            'design': design,
            'left_out': bool(without),
            'features': dict(effect.features),
            'right': effect.name in campaign.hidden and not without,
            'in_set': not without
            and bool({effect.name, *effect.confounded_with} & set(campaign.hidden)),
        }
        for effect in diagnosis.effects
    ] or [{'key': key}]


def run(file: Path, per_group: int, jobs: int) -> None:
    """Diagnose campaigns and append their names to the file."""
    tasks = {
        f'{group} {design} {FIRST_SEED + i}': (group, design, FIRST_SEED + i)
        for i in range(per_group)
        for group in (*GROUPS, *(f'{name}{LEFT_OUT}' for name in KINDS_LEFT_OUT))
        for design in GROUPS[group.partition(LEFT_OUT)[0]].designs
    }
    run_jobs(names_of, tasks, ResultFile(file), lambda row: row['key'], jobs=jobs)


def logistic(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return logistic coefficients with a ridge around zero (Newton, steps halved)."""

    def loss(weights: np.ndarray) -> float:
        margin = features @ weights
        misfit = np.logaddexp(0.0, margin) - right * margin
        return float(misfit.sum() + 0.5 * RIDGE * (weights**2).sum())

    weights = np.zeros(features.shape[1])
    for _ in range(60):
        p = expit(features @ weights)
        gradient = features.T @ (right - p) - RIDGE * weights
        hessian = (features * (p * (1.0 - p))[:, None]).T @ features
        step = np.linalg.solve(hessian + RIDGE * np.eye(len(weights)), gradient)
        while loss(weights + step) > loss(weights) and np.abs(step).max() > 1e-9:
            step *= 0.5
        weights = weights + step
        if np.abs(step).max() < 1e-8:
            break
    return weights


def fit(file: Path) -> None:
    """Fit the map, print its errors on designs left out, write it."""
    records = ResultFile(file).rows
    # Where an effect that looks like the name was left out, its share is taken off by rule.
    records = [r for r in records if 'features' in r and not r['features'].get('alike', 0.0)]
    x = np.array([[record['features'][name] for name in verdict.FEATURES] for record in records])
    design = np.array([record['design'] for record in records])
    result: dict[str, object] = {'features': list(verdict.FEATURES), 'names': len(records)}
    for key, target in (('name', 'right'), ('set', 'in_set')):
        right = np.array([float(record[target]) for record in records])
        left_out = np.empty(len(right))
        for one in np.unique(design):
            mine = design == one
            left_out[mine] = 1.0 / (1.0 + np.exp(-x[mine] @ logistic(x[~mine], right[~mine])))
        sure = left_out > 0.9
        print(
            f'{key}: {len(right)} names, {right.mean():.3f} right; calibration error '
            f'{scoring.calibration_error(left_out, right):.3f}; said above 0.9: {sure.mean():.2f}, '
            f'of these right: {right[sure].mean():.3f}'
        )
        out = np.array([record['left_out'] for record in records])
        if key == 'name' and out.any():
            print(
                f'  kind left out: {out.sum()} names, {np.mean(left_out[out] > 0.8):.3f} said '
                f'above 0.8, {np.mean(left_out[out] > 0.9):.3f} above 0.9'
            )
        result[key] = [round(float(w), 4) for w in logistic(x, right)]
    MAP.write_text(json.dumps(result, indent=1) + '\n')


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest='command', required=True)
    runner = commands.add_parser('run')
    runner.add_argument('file', type=Path)
    runner.add_argument('--per-group', type=int, default=20, help='campaigns per group and design')
    add_jobs_argument(runner, words='campaigns at a time')
    fitter = commands.add_parser('fit')
    fitter.add_argument('file', type=Path)
    arguments = parser.parse_args()
    if arguments.command == 'run':
        run(arguments.file, arguments.per_group, arguments.jobs)
    else:
        fit(arguments.file)


if __name__ == '__main__':
    main()
