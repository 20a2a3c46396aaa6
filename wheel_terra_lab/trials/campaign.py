# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One campaign: a table with something (or nothing) hidden in it, and what the truth was."""

from __future__ import annotations

import csv
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from wheel_terra_estimator.arrays import BoolArray
from wheel_terra_estimator.discrepancy.tables.steady_table import INPUT_COLUMNS
from wheel_terra_lab.trials.designs import random_rows, random_soil
from wheel_terra_lab.trials.detectability import Ruler, listed_kinds, size_for
from wheel_terra_lab.trials.forms import FORMS
from wheel_terra_lab.trials.hidden import LISTED, OTHER, OUTSIDE, SmoothError
from wheel_terra_lab.trials.other_worlds import WORLDS
from wheel_terra_lab.trials.strangers import SCORED
from wheel_terra_lab.trials.truth import (
    OUTPUTS,
    SOIL_SD,
    Hidden,
    Rows,
    TrueSoil,
    moved_soil,
    solve,
)

INPUTS = tuple(name for name in INPUT_COLUMNS if name != 'slip_angle')  # wheels that run straight
SLIP_STD = 0.02  # of a window of a drive


@dataclass(frozen=True)
class Plan:
    """What kind of campaign to make."""

    hide: str = 'one'  # ``none``, ``one``, ``two`` or ``outside``
    soil_error: float = 1.0  # deviations of the soil's error; 2.5: worse than stated
    other_formula: bool = False  # hide the same claims written with other formulas
    structure: float = 0.0  # smooth structural error, share of each output's range
    noise: str = 'gauss'  # ``gauss``, ``t`` (Student, 4 degrees of freedom) or ``mixed`` (drawn)
    outliers: float = 0.0  # share of the cells that are off by 6 to 12 standard deviations
    missing: float = 0.0  # share of the cells that are empty
    drop: str = ''  # output that was not measured at all; empty = none
    noise_given: bool = True  # whether the table has the columns ``*_std``
    # Rows as from a drive: slip follows from the slope and is uncertain, pull is only known as the
    # mean over the wheels
    drive: bool = False
    # Hide these instead of some drawn by lot (``distance_left`` is then not measured)
    names: tuple[str, ...] = ()
    # Below: no part of the seed. Least d' that is asked for; 0: 2.5 for one effect, 4 for each of
    # two
    least: float = field(default=0.0, repr=False)
    # Draw from all forms of all effects, not from the first form of some
    forms: bool = field(default=False, repr=False)
    # One of ``other_worlds.WORLDS``: a truth that shares no closure with the package; empty = the
    # independent quadrature
    world: str = field(default='', repr=False)


@dataclass(frozen=True)
class Campaign:
    """A table and the truth behind it.

    ``rows`` are the inputs as recorded, ``table`` the columns of the CSV file, ``std`` and
    ``noise_free`` the noise and the true outputs of the same rows, ``believed`` the
    soil in the configuration, ``soil`` the true one, ``hidden`` what was hidden, ``distances`` its
    d' (each beyond the other when two), ``distance_left`` what the best listed effect leaves
    (strangers only), ``true_outputs`` the noise-free truth of any rows.
    """

    seed: int
    design: str
    plan: Plan
    rows: Rows
    table: Rows
    std: Rows
    believed: TrueSoil
    soil: TrueSoil
    hidden: tuple[str, ...]
    sizes: tuple[float, ...]
    effects: tuple[Hidden, ...]
    distances: tuple[float, ...]
    distance_left: float
    noise_free: Rows = field(default_factory=dict)
    soil_deviations_stated: bool = True
    true_outputs: Callable[[Rows], Rows] | None = None

    def settings(self) -> dict[str, object]:
        """Return the engineer's configuration of a one-wheel rig, key by key."""
        soil = self.believed
        slope = np.sin(soil.friction_angle) * np.cos(soil.friction_angle)  # d(phi)/d(ln tan phi)
        deviations: dict[str, object] = {
            'soil.frictional_modulus_std': 0.10 * soil.frictional_modulus,
            'soil.cohesive_modulus_std': 0.10 * soil.cohesive_modulus,
            'soil.sinkage_exponent_std': 0.05,
            'soil.friction_angle_std_deg': float(np.degrees(0.05 * slope)),
            'soil.shear_modulus_std': 0.10 * soil.shear_modulus,
            'soil.cohesion_std': 0.20 * soil.cohesion,
            'soil.peak_stress_ratio_std': 0.03,
            'soil.leaving_angle_ratio_std': 0.03,
        }
        return {
            'rover.mass': float(np.median(self.rows['normal_load'])) / 9.81,
            'wheels.names': ['wheel'],
            'wheels.radius': [float(np.median(self.rows['wheel_radius']))],
            'wheels.width': [float(np.median(self.rows['wheel_width']))],
            'wheels.lug_height': [float(np.max(self.rows['lug_height']))],
            'soil.frictional_modulus': soil.frictional_modulus,
            'soil.cohesive_modulus': soil.cohesive_modulus,
            'soil.sinkage_exponent': soil.sinkage_exponent,
            'soil.cohesion': soil.cohesion,
            'soil.friction_angle_deg': float(np.degrees(soil.friction_angle)),
            'soil.shear_modulus': soil.shear_modulus,
            'soil.peak_stress_ratio': soil.peak_stress_ratio,
            'soil.leaving_angle_ratio': soil.leaving_angle_ratio,
            'soil.density': soil.density,
            **(deviations if self.soil_deviations_stated else {}),
        }

    def write_csv(self, path: str | Path) -> None:
        """Write the table; cells that were not measured stay empty."""
        names = list(self.table)
        with Path(path).open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            writer.writerow(names)
            for row in zip(*(self.table[name] for name in names), strict=True):
                writer.writerow(['' if np.isnan(value) else f'{value:.8g}' for value in row])


def make_campaign(seed: int, design: str, plan: Plan) -> Campaign:
    """Return the campaign of this seed: the same arguments give the same numbers."""
    # The text goes into the seed, so that the same seed in two designs shares no draw.
    rng = np.random.default_rng([seed, zlib.crc32(f'{design} {plan}'.encode())])
    for _ in range(60):
        try:
            return _attempt(seed, design, plan, rng)
        except _UnusableError:
            continue
    raise RuntimeError(f'no usable campaign for seed {seed}, {design}, {plan}')


class _UnusableError(Exception):
    """The draw makes no table that a laboratory would keep."""


def _attempt(seed: int, design: str, plan: Plan, rng: np.random.Generator) -> Campaign:
    if plan.world:
        return _of_world(seed, design, plan, rng)
    believed = random_soil(rng)
    soil, stated = _true_soil(believed, plan.soil_error, rng)
    rows = random_rows('basic16' if plan.drive else design, rng, believed)
    if plan.drive:
        rows = _drive_rows(rows, soil, rng)
    base = solve(rows, soil)
    if not np.all(np.isfinite(base['sinkage'])):
        raise _UnusableError
    std = _noise_level(rows, rng)
    measured = {key: std[key].copy() for key in OUTPUTS}
    if plan.drop:
        measured[plan.drop][:] = np.nan
    if plan.drive:
        measured['drawbar_pull'][rows['_whole_rover'] == 0] = np.nan
        for key in ('sinkage', 'torque'):
            measured[key][rows['_whole_rover'] == 1] = np.nan
    ruler = Ruler(rows, soil, _with_slip_error(rows, soil, measured) if plan.drive else measured)
    names, sizes, effects = _hide(plan, rows, soil, ruler, measured, rng)
    distances, left = _sizes_seen(plan, rows, ruler, names, effects)
    if any(not np.isfinite(d) for d in distances):
        raise _UnusableError

    structure: tuple[Hidden, ...] = ()
    if plan.structure:
        structure = (SmoothError(plan.structure, rows, base, rng),)
    truth = _outputs(rows, soil, (*effects, *structure), plan)
    if not all(np.all(np.isfinite(truth[key])) for key in OUTPUTS):
        raise _UnusableError
    if (
        np.max(truth['sinkage']) > 0.6 * np.min(rows['wheel_radius'])
        or np.min(truth['sinkage']) < 0
    ):
        raise _UnusableError
    table, kept = _measure(plan, rows, truth, measured, rng)
    return Campaign(
        seed,
        design,
        plan,
        {key: table[key] for key in INPUTS},
        table,
        {key: measured[key][kept] for key in OUTPUTS},
        believed,
        soil,
        names,
        sizes,
        effects,
        distances,
        left,
        {key: truth[key][kept] for key in OUTPUTS},
        stated,
        lambda rows: solve(rows, soil, effects),
    )


def _of_world(seed: int, design: str, plan: Plan, rng: np.random.Generator) -> Campaign:
    """Return a campaign whose truth is another model; its soil tests state no deviations."""
    world = WORLDS[plan.world]
    believed, true_soil = world.soil(rng)
    rows = random_rows(design, rng, believed)
    truth = world.solve(rows, true_soil)
    sunk = truth['sinkage'] / rows['wheel_radius']
    if not np.all(np.isfinite(sunk)) or np.max(sunk) > 0.6:
        raise _UnusableError
    std = _noise_level(rows, rng)
    table, kept = _measure(plan, rows, truth, {key: std[key].copy() for key in OUTPUTS}, rng)
    return Campaign(
        seed,
        design,
        plan,
        {key: table[key] for key in INPUTS},
        table,
        {key: std[key][kept] for key in OUTPUTS},
        believed,
        believed,
        (plan.world,),
        (1.0,),
        (),
        (Ruler(rows, believed, std).distance_of(truth),),
        float('nan'),
        noise_free={key: truth[key][kept] for key in OUTPUTS},
        soil_deviations_stated=False,
        true_outputs=lambda rows: world.solve(rows, true_soil),
    )


def _outputs(rows: Rows, soil: TrueSoil, effects: tuple[Hidden, ...], plan: Plan) -> Rows:
    """Noise-free outputs; on a drive the pull of a whole-rover row is the mean of its wheels."""
    out = solve(rows, soil, effects)
    if plan.drive:
        group, whole = rows['_window'], rows['_whole_rover'] == 1
        for row in np.flatnonzero(whole):
            wheels = (group == group[row]) & ~whole
            out['drawbar_pull'][row] = np.mean(out['drawbar_pull'][wheels])
    return out


def _true_soil(believed: TrueSoil, error: float, rng: np.random.Generator) -> tuple[TrueSoil, bool]:
    """Soil in the field: off by the stated deviations, or (half of the cases) by 5 to 10 %.

    In the second case the configuration states no deviations.
    """
    n = len(SOIL_SD)
    if error <= 1 and rng.random() < 0.5:
        off = 1 + rng.choice([-1.0, 1.0], n) * rng.uniform(0.05, 0.10, n)
        changed = {key: getattr(believed, key) * f for key, f in zip(SOIL_SD, off, strict=True)}
        changed['friction_angle'] = believed.friction_angle * (1 + (off[2] - 1) / 2)
        changed['sinkage_exponent'] = believed.sinkage_exponent * (1 + (off[1] - 1) / 2)
        return replace(believed, **changed), False
    return moved_soil(believed, error * np.clip(rng.standard_normal(n), -2, 2)), True


def _with_slip_error(rows: Rows, soil: TrueSoil, std: Rows) -> Rows:
    """Noise of each output with what an uncertain slip adds to it, for an honest d'."""
    moved = {**rows, 'slip': rows['slip'] + 0.01}
    low, high = solve(rows, soil), solve(moved, soil)
    return {
        key: np.hypot(std[key], SLIP_STD / 0.01 * np.abs(high[key] - low[key])) for key in OUTPUTS
    }


def _noise_level(rows: Rows, rng: np.random.Generator) -> Rows:
    """Noise between a good and a poor rig (0.3 to 1 mm, 0.8 to 2.5 N at 80 N, 0.08 to 0.25 N m)."""
    radius, load = float(np.mean(rows['wheel_radius'])), float(np.mean(rows['normal_load']))
    poor = np.exp(rng.uniform(np.log(1.0), np.log(3.2)))
    n = len(rows['slip'])
    return {
        'sinkage': np.full(n, 0.3e-3 * poor * max(radius / 0.157, 0.5)),
        'drawbar_pull': np.full(n, 0.01 * poor * load),
        'torque': np.full(n, 0.0064 * poor * load * radius),
    }


def _hide(
    plan: Plan, rows: Rows, soil: TrueSoil, ruler: Ruler, measured: Rows, rng: np.random.Generator
) -> tuple[tuple[str, ...], tuple[float, ...], tuple[Hidden, ...]]:
    if plan.hide == 'none':
        return (), (), ()
    if plan.hide == 'outside':
        catalogue = {**OUTSIDE, **SCORED}
        names = [*plan.names] or [str(rng.choice(sorted(OUTSIDE)))]
    else:
        catalogue = OTHER if plan.other_formula else {**LISTED, **FORMS}
        drawn_from = {**LISTED, **FORMS} if plan.forms else LISTED
        possible = [
            name
            for name, kind in listed_kinds(rows, drawn_from).items()
            if not kind.requires or np.any(np.isfinite(measured[kind.requires]))
        ]
        count = 2 if plan.hide == 'two' else 1
        drawn = rng.choice(sorted(possible), count, replace=False)
        names = [*plan.names] or [str(name) for name in drawn]
    sizes, effects = [], []
    for name in names:
        low = plan.least or (4.0 if plan.hide == 'two' else 2.5)
        wanted = float(np.exp(rng.uniform(np.log(low), np.log(60.0))))
        if plan.hide == 'outside':
            wanted *= 1.5
        kind = catalogue[name]
        sign = float(rng.choice([-1.0, 1.0])) if kind.signed else 1.0
        secondary = float(rng.random())
        try:
            size, effect, _ = size_for(kind, wanted, secondary, sign, ruler)
        except ValueError as error:
            raise _UnusableError from error
        sizes.append(size)
        effects.append(effect)
    return (
        tuple(name.partition(':')[0] for name in names),
        tuple(sizes),
        tuple(effects),
    )


def _sizes_seen(
    plan: Plan, rows: Rows, ruler: Ruler, names: tuple[str, ...], effects: tuple[Hidden, ...]
) -> tuple[tuple[float, ...], float]:
    if plan.hide == 'two':
        kinds = OTHER if plan.other_formula else LISTED
        return (
            ruler.distance(effects, (kinds[names[1]],)),
            ruler.distance(effects, (kinds[names[0]],)),
        ), float('nan')
    distances = tuple(ruler.distance((effect,)) for effect in effects)
    left = float('nan')
    if plan.hide == 'outside' and not plan.names:
        left = ruler.distance(effects, tuple(listed_kinds(rows).values()))
    return distances, left


def _measure(
    plan: Plan, rows: Rows, truth: Rows, std: Rows, rng: np.random.Generator
) -> tuple[Rows, BoolArray]:
    """Add noise, outliers and gaps; return the columns of the table and which rows stayed."""
    n = len(rows['slip'])
    table: Rows = {key: rows[key].copy() for key in INPUTS}
    if plan.drive:
        slip_std = np.full(n, SLIP_STD)
        slip_error = SLIP_STD * rng.standard_normal(int(rows['_window'].max()) + 1)
        table['slip'] = np.clip(table['slip'] + slip_error[rows['_window'].astype(int)], -0.9, 0.98)
        table['slip_std'] = slip_std
    kind = plan.noise if plan.noise != 'mixed' else str(rng.choice(['gauss', 't']))
    for key in OUTPUTS:
        # Student's t with 4 degrees of freedom has the variance 2.
        noise = rng.standard_t(4, n) / 2**0.5 if kind == 't' else rng.standard_normal(n)
        wild = rng.random(n) < plan.outliers
        noise = np.where(wild, rng.choice([-1, 1], n) * rng.uniform(6, 12, n), noise)
        values = truth[key] + std[key] * noise
        values[rng.random(n) < plan.missing] = np.nan
        if np.all(np.isnan(values)):
            continue
        table[key] = values
        if plan.noise_given:
            table[f'{key}_std'] = np.where(np.isnan(values), np.nan, std[key])
    present = [key for key in OUTPUTS if key in table]
    empty = np.all([np.isnan(table[key]) for key in present], axis=0)
    return {key: value[~empty] for key, value in table.items()}, ~empty


def _drive_rows(rows: Rows, soil: TrueSoil, rng: np.random.Generator) -> Rows:
    """Rows of a four-wheel rover on slopes: slip settles where the pulls carry W sin(slope).

    Every window gives a row per axle (sinkage, torque) and one for the whole rover (pull: only
    the sum over the wheels is known). Rear wheels run in the tracks of the front ones.
    """
    load, radius = float(np.median(rows['normal_load'])), float(np.median(rows['wheel_radius']))
    width, lug = float(np.median(rows['wheel_width'])), float(np.max(rows['lug_height']))
    windows = 28
    slope = np.radians(rng.uniform(-6, 20, windows))
    grid = np.concatenate([np.linspace(-0.25, 0.0, 8)[:-1], np.linspace(0.0, 0.85, 24)])
    columns: dict[str, list[float]] = {key: [] for key in (*INPUTS, '_window', '_whole_rover')}

    def add(**values: float) -> None:
        for key, column in columns.items():
            column.append(values[key])

    for window, angle in enumerate(slope):
        transfer = float(np.clip(0.3 * np.tan(angle), -0.3, 0.3))
        loads = load * np.cos(angle) * np.array([1 - transfer, 1 + transfer])
        trial = {
            key: np.full(2 * grid.size, value)
            for key, value in {
                'wheel_radius': radius,
                'wheel_width': width,
                'lug_height': lug,
                'gravity': 9.81,
                'slope': 0.0,
                'lug_count': 20.0,
                'angular_velocity': 0.2,
                'pass_number': 1.0,
            }.items()
        }
        trial['slip'] = np.tile(grid, 2)
        trial['normal_load'] = np.repeat(loads, grid.size)
        pull = solve(trial, soil)['drawbar_pull'].reshape(2, -1).sum(0)
        need = 2 * load * np.sin(angle)
        able = np.isfinite(pull)
        if not able.any() or need > np.max(pull[able]) or need < np.min(pull[able]):
            continue
        slip = float(np.interp(need, np.maximum.accumulate(pull[able]), grid[able]))
        if slip > 0.85:
            continue
        common = {
            'slip': slip,
            'slope': 0.0,
            'wheel_radius': radius,
            'wheel_width': width,
            'lug_height': lug,
            'lug_count': 20.0,
            'gravity': 9.81,
            'angular_velocity': 0.2,
            '_window': float(window),
        }
        add(**common, normal_load=loads[0], pass_number=1.0, _whole_rover=0.0)
        add(**common, normal_load=loads[1], pass_number=2.0, _whole_rover=0.0)
        add(**common, normal_load=float(loads.mean()), pass_number=1.5, _whole_rover=1.0)
    if len(columns['slip']) < 45:
        raise _UnusableError
    return {key: np.array(value) for key, value in columns.items()}
