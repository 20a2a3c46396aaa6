# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What defines one run of the virtual soil bin: wheel, grains, bin, operation."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wheel_terra_estimator.errors import UserError

EARTH_GRAVITY = 9.80665


@dataclass(frozen=True)
class BinWheel:
    """A rigid wheel with straight lugs (Nakashima et al. 2010, Table 1). Lengths in [m]."""

    rim_diameter: float = 0.2
    width: float = 0.1
    lug_height: float = 0.01
    lug_thickness: float = 0.005
    lug_count: int = 18
    mass: float = 0.5  # [kg], the wheel alone; the load is applied on top

    @property
    def rim_radius(self) -> float:
        """Radius of the rim [m]."""
        return 0.5 * self.rim_diameter

    @property
    def tip_radius(self) -> float:
        """Rolling radius r_w = D/2 of the paper: the lug tips [m]."""
        return self.rim_radius + self.lug_height

    @property
    def inertia(self) -> float:
        """Moment of inertia about the axle [kg m^2] (a uniform disc; the rate is imposed)."""
        return 0.5 * self.mass * self.rim_radius**2


@dataclass(frozen=True)
class Grains:
    """Contact law and grain sizes (Table 5), and what the paper does not state."""

    diameters: tuple[float, ...] = (0.0028, 0.0032, 0.0036, 0.0040)  # [m], equally frequent
    normal_stiffness: float = 10_000.0  # K_n [N/m]
    tangential_stiffness: float = 500.0  # K_t [N/m]
    soil_friction: float = 0.75
    wall_friction: float = 0.75
    wheel_friction: float = 0.5
    damping_ratio: float = 1.0  # C_n = ratio * 2 sqrt(m_e K_n), C_t likewise
    damping_density: float = 1550.0  # [kg/m^3], of m_e
    density: float = 0.0  # [kg/m^3]; 0: by depth, equation (6) of the paper
    rolling_friction: float = 0.0  # mu_r, not in the paper
    rolling_stiffness: float = 2000.0  # k_r [N/m]
    rotation: str = 'free'  # or 'locked': grains do not turn


@dataclass(frozen=True)
class Bed:
    """The bin and how it is filled."""

    length: float = 1.0  # [m]
    rows: int = 28  # staggered rows at grain scale 1
    pitch: float = 0.004  # [m] within a row at grain scale 1
    grain_scale: float = 1.0  # discs (and pitch) larger by this factor, rows fewer
    arrangement: str = 'staggered'  # or 'random'
    preparation_friction: float = -1.0  # friction while settling; negative: as afterwards
    seed: int = 1
    settling_time: float = 1.5  # [s] first consolidation
    settled_speed: float = 0.01  # [m/s] largest rms grain speed of a bed at rest


@dataclass(frozen=True)
class Operation:
    """What is done with the wheel."""

    slope: float = 0.0  # [rad], uphill
    gravity: float = EARTH_GRAVITY  # [m/s^2]
    vertical_load: float = 19.6  # W [N], along gravity, weight of the wheel included
    hitch_pull: float = 0.0  # [N] along the slope, on top of W sin(slope)
    tip_speed: float = 0.01518  # [m/s], r_w omega
    speed_factor: float = 1.0  # the tip speed is this much higher, the duration shorter
    duration: float = 40.0  # [s] of travel at speed_factor 1
    imposed_slip: float = math.nan  # travel speed held at (1 - slip) r_w omega; nan: free travel
    turning_time: float = 1.0  # [s]
    loading_time: float = 1.0  # [s] the load grows during free sinkage
    resting_time: float = 0.5  # [s] free sinkage under full load
    pull_ramp: float = 0.06  # [m] of rim travel over which the pull is raised
    start: float = 0.26  # [m] axle from the low end
    # While it sinks before it turns, the locked wheel is 'held' along the slope, or 'standing':
    # it carries the share of its weight along the slope as well and may slide until it holds.
    free_sinkage: str = 'held'
    drop_height: float = 0.0  # [m] above its first contact from which the wheel falls


@dataclass(frozen=True)
class Numerics:
    """Time step and bookkeeping."""

    time_step: float = 0.0  # [s]; 0: 0.85 of the largest stable one
    samples: int = 400  # contact-wise samples over the travel
    frames: int = 40  # pictures kept for the film


@dataclass(frozen=True)
class Case:
    """One run."""

    name: str = 'case'
    wheel: BinWheel = field(default_factory=BinWheel)
    grains: Grains = field(default_factory=Grains)
    bed: Bed = field(default_factory=Bed)
    operation: Operation = field(default_factory=Operation)
    numerics: Numerics = field(default_factory=Numerics)

    @property
    def rim_rate(self) -> float:
        """Angular velocity of the run [rad/s], speed factor included."""
        return self.operation.speed_factor * self.operation.tip_speed / self.wheel.tip_radius

    @property
    def travel_time(self) -> float:
        """Simulated time of the travel stage [s]."""
        return self.operation.duration / self.operation.speed_factor

    @property
    def grain_diameters(self) -> np.ndarray:
        """Diameters at this grain scale [m]."""
        return np.asarray(self.grains.diameters) * self.bed.grain_scale

    def replace(self, **changes: object) -> Case:
        """Return a copy; names are group_field pairs such as ``operation__slope=0.1``."""
        groups: dict[str, dict[str, object]] = {}
        top: dict[str, object] = {}
        for name, value in changes.items():
            group, _, key = name.partition('__')
            if key:
                groups.setdefault(group, {})[key] = value
            else:
                top[group] = value
        for group, values in groups.items():
            top[group] = dataclasses.replace(getattr(self, group), **values)
        return dataclasses.replace(self, **top)  # type: ignore[arg-type]


def to_dict(case: Case) -> dict:
    """Return the case as plain numbers and strings (JSON)."""
    return dataclasses.asdict(case)


def from_dict(data: dict) -> Case:
    """Undo `to_dict`."""
    grains = dict(data['grains'])
    grains['diameters'] = tuple(grains['diameters'])
    return Case(
        name=data['name'],
        wheel=BinWheel(**data['wheel']),
        grains=Grains(**grains),
        bed=Bed(**data['bed']),
        operation=Operation(**data['operation']),
        numerics=Numerics(**data['numerics']),
    )


# Fields that must be above 0, and those that may be 0; all are finite.
POSITIVE = (
    'wheel.rim_diameter', 'wheel.width', 'wheel.mass', 'grains.normal_stiffness',
    'grains.tangential_stiffness', 'grains.rolling_stiffness', 'grains.damping_density',
    'bed.length', 'bed.rows', 'bed.pitch', 'bed.grain_scale', 'bed.settling_time',
    'bed.settled_speed', 'operation.gravity', 'operation.vertical_load', 'operation.tip_speed',
    'operation.speed_factor', 'operation.duration', 'operation.loading_time', 'numerics.samples',
)  # fmt: skip
NOT_NEGATIVE = (
    'wheel.lug_height', 'wheel.lug_thickness', 'wheel.lug_count', 'grains.soil_friction',
    'grains.wall_friction', 'grains.wheel_friction', 'grains.damping_ratio', 'grains.density',
    'grains.rolling_friction', 'bed.seed', 'operation.turning_time', 'operation.resting_time',
    'operation.pull_ramp', 'operation.start', 'operation.drop_height', 'numerics.time_step',
    'numerics.frames',
)  # fmt: skip
WORDS = {
    'grains.rotation': ('free', 'locked'),
    'bed.arrangement': ('staggered', 'random'),
    'operation.free_sinkage': ('held', 'standing'),
}
FEWEST_GRAINS = 20  # across the bin: fewer are no soil


def check(case: Case) -> None:
    """Raise `UserError` where the case cannot be run."""

    def refuse(name: str, words: str) -> None:
        raise UserError(f'{case.name}: soilbin.{name} = {_field(case, name)} {words}')

    for name in (*POSITIVE, *NOT_NEGATIVE):
        value = _field(case, name)
        if not (math.isfinite(value) and (value > 0 or (value == 0 and name in NOT_NEGATIVE))):
            refuse(name, 'must be above 0' if name in POSITIVE else 'must not be below 0')
    for name, words in WORDS.items():
        if _field(case, name) not in words:
            refuse(name, f'must be {" or ".join(words)}')
    wheel, bed, operation, grains = case.wheel, case.bed, case.operation, case.grains
    if not 0 <= math.degrees(operation.slope) <= 60:
        raise UserError(f'{case.name}: soilbin.operation.slope_deg must be within 0 and 60')
    if operation.imposed_slip < -1 or operation.imposed_slip > 1:  # nan: free travel
        refuse('operation.imposed_slip', 'must be within -1 and 1')
    if not math.isfinite(operation.hitch_pull):
        refuse('operation.hitch_pull', 'must be a finite number')
    if not grains.diameters or min(grains.diameters) <= 0:
        refuse('grains.diameters', 'must all be above 0')
    if max(grains.diameters) > bed.pitch * (1 + 1e-9):
        raise UserError(
            f'{case.name}: soilbin.grains.diameters reach {max(grains.diameters)} m, more than '
            f'soilbin.bed.pitch {bed.pitch} m: raise the pitch'
        )
    if bed.length < FEWEST_GRAINS * bed.pitch * bed.grain_scale:
        raise UserError(
            f'{case.name}: a bin of {bed.length} m holds fewer than {FEWEST_GRAINS} grains side by '
            'side: lower soilbin.bed.grain_scale or raise soilbin.bed.length'
        )
    if wheel.lug_count * wheel.lug_thickness > 2 * math.pi * wheel.rim_radius:
        refuse('wheel.lug_count', 'lugs of this thickness do not fit around the rim')
    reach = wheel.tip_radius
    if 2 * reach > bed.length:
        raise UserError(
            f'{case.name}: a wheel of {2 * reach:.3f} m does not fit the bin of {bed.length} m: '
            'raise soilbin.bed.length'
        )
    if operation.start - reach < 0 or operation.start + reach > bed.length:
        raise UserError(
            f'{case.name}: a wheel of {2 * reach:.3f} m with its axle at soilbin.operation.start '
            f'{operation.start} m does not fit the bin of {bed.length} m: choose a start between '
            f'{reach:.3f} and {bed.length - reach:.3f} m or a longer soilbin.bed.length'
        )


def _field(case: Case, name: str) -> Any:
    group, _, field_name = name.partition('.')
    return getattr(getattr(case, group), field_name)
