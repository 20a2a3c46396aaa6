# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a laboratory would measure: the rows of each design, and a random wheel and soil."""

from __future__ import annotations

import numpy as np

from wheel_terra_lab.trials.truth import Rows, TrueSoil, solve

DESIGNS = ('basic16', 'sweep40', 'slope48', 'lugs48', 'full56')
_SLIPS = np.array([0.03, 0.08, 0.15, 0.25, 0.36, 0.5, 0.65, 0.8])


def random_soil(rng: np.random.Generator) -> TrueSoil:
    """Draw the soil that the engineer believes in."""
    return TrueSoil(
        frictional_modulus=float(np.exp(rng.uniform(np.log(6e5), np.log(3.5e6)))),
        sinkage_exponent=float(rng.uniform(0.8, 1.15)),
        friction_angle=float(np.radians(rng.uniform(28, 40))),
        shear_modulus=float(np.exp(rng.uniform(np.log(0.007), np.log(0.025)))),
        cohesion=float(np.exp(rng.uniform(np.log(150), np.log(1200)))),
        peak_stress_ratio=float(rng.uniform(0.33, 0.5)),
        leaving_angle_ratio=float(rng.uniform(-0.35, -0.12)),
        cohesive_modulus=float(np.exp(rng.uniform(np.log(1e3), np.log(2e4)))),
        density=float(rng.uniform(1400, 1750)),
    )


def _constant(n: int, wheel: dict[str, float]) -> Rows:
    return {key: np.full(n, float(value)) for key, value in wheel.items()}


def random_rows(design: str, rng: np.random.Generator, soil: TrueSoil) -> Rows:
    """Return the inputs of one table: a random wheel, loads that sink it 3 to 10 % of r."""
    radius = float(np.exp(rng.uniform(np.log(0.08), np.log(0.2))))
    wheel = {
        'wheel_radius': radius,
        'wheel_width': radius * rng.uniform(0.7, 1.3),
        'lug_height': radius * rng.uniform(0.05, 0.1),
        'lug_count': float(rng.integers(12, 31)),
        'gravity': 9.81,
        'angular_velocity': 0.1,
        'pass_number': 1.0,
        'slope': 0.0,
        'slip': 0.2,
        'normal_load': 50.0,
    }
    # The load that gives the wanted sinkage at 20 % slip.
    target = rng.uniform(0.03, 0.08) * radius
    trial = _constant(40, wheel)
    trial['normal_load'] = np.geomspace(2.0, 3000.0, 40)
    sinkage = solve(trial, soil)['sinkage']
    good = np.isfinite(sinkage)
    load = float(np.exp(np.interp(target, sinkage[good], np.log(trial['normal_load'][good]))))
    slips = np.clip(_SLIPS + rng.uniform(-0.015, 0.015, 8), 0.01, 0.85)

    if design == 'basic16':
        loads = np.array([0.7, 1.3]) * load
        rows = _grid(wheel, slips, loads)
    elif design == 'sweep40':
        rows = _grid(wheel, slips, np.linspace(0.5, 1.6, 5) * load)
    elif design == 'slope48':
        rows = _grid(wheel, slips, np.array([0.7, 1.3]) * load, slope=np.radians([0, 8, 16]))
    elif design == 'lugs48':
        heights = wheel['lug_height'] * np.array([0.0, 0.6, 1.2])
        rows = _grid(wheel, slips, np.array([0.7, 1.3]) * load, lug_height=heights)
    elif design == 'full56':
        n = 56
        rows = _constant(n, wheel)
        rows['slip'] = rng.permutation(np.linspace(0.02, 0.82, n))
        rows['normal_load'] = load * rng.uniform(0.5, 1.6, n)
        rows['slope'] = np.radians(rng.choice([0.0, 5.0, 10.0, 15.0], n))
        rows['lug_height'] = wheel['lug_height'] * rng.choice([0.0, 0.6, 1.2], n)
        rows['wheel_radius'] = radius * rng.choice([0.85, 1.0, 1.15], n)
        rows['wheel_width'] = wheel['wheel_width'] * rng.choice([0.8, 1.0, 1.2], n)
        rows['angular_velocity'] = rng.choice([0.05, 0.1, 0.3, 0.6], n)
        rows['pass_number'] = rng.choice([1.0, 2.0, 3.0], n)
    else:
        raise ValueError(design)
    return rows


def _grid(wheel: dict[str, float], slips: np.ndarray, loads: np.ndarray, **third: object) -> Rows:
    ((name, values),) = third.items() if third else (('slip', None),)
    axes = [slips, loads] + ([np.asarray(values)] if values is not None else [])
    mesh = [axis.ravel() for axis in np.meshgrid(*axes, indexing='ij')]
    rows = _constant(mesh[0].size, wheel)
    rows['slip'], rows['normal_load'] = mesh[0], mesh[1]
    if values is not None:
        rows[name] = mesh[2]
    return rows
