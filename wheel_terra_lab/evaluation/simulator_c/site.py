# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The land of a drive: slopes and patches chosen by what the drawn soil bears."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_c.contact import Contacts, Rims
from wheel_terra_lab.evaluation.simulator_c.ground import (
    Ground,
    Land,
    Patch,
    Stone,
    draw_soft_soil,
    draw_soil,
)
from wheel_terra_lab.evaluation.simulator_c.plans import Kind
from wheel_terra_lab.evaluation.simulator_c.rover import Rover

FloatArray = NDArray[np.float64]

SLIPS = np.array([0.02, 0.08, 0.18, 0.3, 0.45, 0.6, 0.72, 0.84, 0.94])
AMOUNTS = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.5])
"""Slips and shares of the soft soil at which the pull of a single wheel is tabulated."""
_LEAST_PULL = 0.2  # of a base soil, over the load [-]
_RUN_OUT = 12.0  # [s]
_ENDLESS = 1e3  # [m]
_OF_BEST_PULL = 0.8  # that a slope asks for at most
_STEEPEST = np.sin(np.radians(26.0))
_BENCH_STEP, _BENCH_STEPS = 0.04, 320  # [s] at one radian per second


def pull_table(rover: Rover, base: Ground, soft: Ground, amounts: FloatArray) -> FloatArray:
    """Return (amounts, slips) pull over load of one wheel at its mean load, at steady slip."""
    share, slip = (a.ravel() for a in np.meshgrid(amounts, SLIPS, indexing='ij'))
    n = len(share)
    base_log, soft_log = base.logarithms()[:, None], soft.logarithms()[:, None]
    ground = Ground.from_logarithms(base_log + share * (soft_log - base_log))
    rims = Rims(*(np.full(n, getattr(rover.rims, name)[0]) for name in Rims.__dataclass_fields__))
    contacts = Contacts(rims, rover.gravity, nodes=20)
    rate = np.ones(n)
    speed = (1.0 - slip) * (rims.radius + rims.lug_height)
    load, zero = np.full(n, rover.mean_load), np.zeros(n)
    total, rows = np.zeros(n), _BENCH_STEPS // 5
    for i in range(_BENCH_STEPS):
        contacts.travel(ground, _BENCH_STEP, rate, speed, zero)
        forces, shear = contacts.step(ground, _BENCH_STEP, rate, speed, zero)
        contacts.keep(shear, rate, speed, zero)
        contacts.settle(load, forces.normal, 0.0)
        if i >= _BENCH_STEPS - rows:
            total += forces.pull / rows
    return np.asarray((total / load).reshape(len(amounts), len(SLIPS)))


@dataclass
class Site:
    """What a land is made of; kept so that it can be made again with another patch."""

    base: Ground
    soft: Ground
    settings: dict[str, Any]
    patch: Patch | None
    seed: int
    table: FloatArray

    def land(self) -> Land:
        """Return the land, untouched."""
        rng = np.random.default_rng(self.seed)
        return Land(self.base, self.soft, rng, patch=self.patch, **self.settings)

    def change(self, factor: float) -> bool:
        """Make the drive harder (above 1) or easier, by patch or slope; return whether it is."""
        if self.patch is not None and self.patch.length < _ENDLESS:
            self.patch = replace(self.patch, length=self.patch.length * factor)
        elif self.patch is not None:
            self.patch = replace(self.patch, amount=self.patch.amount * factor)
        else:
            self.settings['slope'] *= factor
            self.settings['cross_slope'] *= factor
            return bool(self.settings['slope'])
        return True

    def end(self, rover: Rover) -> float:
        """Return where a drive over a patch ends, well behind it [m]."""
        if self.patch is None:
            return np.inf
        behind = (self.patch.start + self.patch.length) / np.cos(self.patch.angle)
        return float(behind + 3.0 * rover.x.max() + _RUN_OUT * rover.speed)


def draw_site(rng: np.random.Generator, kind: Kind, rover: Rover) -> Site:
    """Return the land for a kind of drive."""
    base, soft, table = _soils(rng, rover)
    if kind.soft:
        base, soft, table = _softest(rover, base, soft, table)
    sine = _slope(rng, kind, table[0])
    settings: dict[str, Any] = {
        'slope': float(np.tan(np.arcsin(sine))),
        'slope_start': float(rover.speed * rng.uniform(3.0, 6.0)),
        'slope_ramp': float(2.0 * rover.x.max() * rng.uniform(0.8, 2.0)),
        'cross_slope': float(np.tan(np.radians(rng.uniform(*kind.cross_degrees)))
                             * (rng.choice([-1.0, 1.0]) if kind.cross_degrees[0] > 0.0 else 1.0)),
        'roughness': float(rover.rims.radius[0] * rng.uniform(0.005, 0.04)),
        'variation': float(rng.uniform(0.03, 0.06 if kind.patch == 'slow' else 0.18)),
        'hard': kind.firm,
        'cell': float(0.5 * rover.rims.width[0]),
    }  # fmt: skip
    if kind.degrees[1] < 0.0:
        settings['slope_start'] = -20.0
    if kind.stone:
        settings['stones'] = _stones(rng, rover)
    patch = _patch(rng, kind, rover, table, sine)
    return Site(base, soft, settings, patch, int(rng.integers(2**31)), table)


def _soils(rng: np.random.Generator, rover: Rover) -> tuple[Ground, Ground, FloatArray]:
    """Return a base soil that bears the rover on a slope, a soft one, and the pull in both."""
    while True:
        base = draw_soil(rng)
        if pull_table(rover, base, base, AMOUNTS[:1]).max() > _LEAST_PULL:
            break
    soft = draw_soft_soil(rng, base)
    return base, soft, pull_table(rover, base, soft, AMOUNTS)


def _softest(
    rover: Rover, base: Ground, soft: Ground, table: FloatArray
) -> tuple[Ground, Ground, FloatArray]:
    """Return soils of which the base is as soft as still drives on the sine with some room."""
    best = table.max(axis=1)
    amount = float(np.interp(-0.15, -best, AMOUNTS)) if best[0] > 0.15 else 0.0
    base_log, soft_log = base.logarithms(), soft.logarithms()
    base = Ground.from_logarithms(base_log + amount * (soft_log - base_log))
    return base, soft, pull_table(rover, base, soft, AMOUNTS)


def _slope(rng: np.random.Generator, kind: Kind, pull: FloatArray) -> float:
    """Return the sine of the slope on which the base soil gives the slip that is wanted."""
    if kind.slip is None:
        return float(np.sin(np.radians(rng.uniform(*kind.degrees))))
    slip = rng.uniform(*kind.slip)
    rising = np.maximum.accumulate(pull)
    wanted = min(np.interp(slip, SLIPS, rising), _OF_BEST_PULL * rising[-1])
    return float(np.clip(wanted, 0.0, _STEEPEST))


def _stones(rng: np.random.Generator, rover: Rover) -> tuple[Stone, ...]:
    """Return stones and a hole on the ways of single wheels."""
    radius, stones = rover.rims.radius[0], []
    for i in range(6):
        wheel = int(rng.integers(rover.count))
        hole = rng.uniform() < 0.3
        height = radius * (-rng.uniform(0.3, 0.8) if hole else rng.uniform(0.2, 0.5))
        along = rover.x.max() + rover.speed * (6.0 + 8.0 * (i + rng.uniform(0.0, 0.5)))
        across = rover.y[wheel] + rng.uniform(-0.2, 0.2) * rover.rims.width[0]
        stones.append(Stone(along, across, height, radius * rng.uniform(1.2, 2.5)))
    return tuple(stones)


def _patch(
    rng: np.random.Generator, kind: Kind, rover: Rover, table: FloatArray, sine: float
) -> Patch | None:
    """Return a patch in which the soil gives as much too little, or too much, as is wanted."""
    if not kind.patch:
        return None
    length = 2.0 * rover.x.max()
    start = rover.x.max() + rover.speed * rng.uniform(10.0, 18.0)
    angle = rng.choice([-1.0, 1.0]) * rng.uniform(np.radians(12.0), np.radians(45.0))
    ramp, size = 0.03, _ENDLESS
    best = table.max(axis=1)
    if kind.patch == 'cross':
        slip = rng.uniform(0.25, 0.5)
        available = np.array([np.interp(slip, SLIPS, row) for row in table])
        amount, size = _where(available, sine), rng.uniform(2.0, 4.0) * length
    elif kind.patch == 'near_miss':
        amount, size = _where(best, sine - 0.03), rng.uniform(0.5, 1.2) * length
    elif kind.patch == 'slow':
        amount, ramp = _where(best, sine - 0.05), rover.speed * rng.uniform(20.0, 45.0)
        start = rover.x.max() + rover.speed * rng.uniform(6.0, 12.0)
    else:
        amount = _where(best, sine - rng.uniform(0.06, 0.15))
    return Patch(float(start), float(size), float(angle), float(ramp), amount)


def _where(pull: FloatArray, wanted: float) -> float:
    """Return the amount of soft soil at which the pull (falling with it) is what is wanted."""
    falling = np.minimum.accumulate(pull)
    return float(np.interp(-wanted, -falling, AMOUNTS))
