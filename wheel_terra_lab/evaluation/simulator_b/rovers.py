# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rovers and soils drawn for a drive: the true ones, and what a team's file says of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_lab.evaluation.simulator_b.motion import DigSettings
from wheel_terra_lab.evaluation.simulator_b.vehicle import RockerBogie, Vehicle
from wheel_terra_lab.evaluation.simulator_b.wheel_soil import (
    ContactLaws,
    Motion,
    SoilHere,
    WheelShape,
    settled_depth,
)

FloatArray = NDArray[np.float64]

SOILS = (
    'hit_lss1',
    'dry_sand_ding2015',
    'lunar_soil_ding2015',
    'grc1',
    'grc3',
    'mars_sand_marssim',
    'fjs1_ishigami',
)
"""Shipped soil files that a team may have chosen."""

EARTH, MARS, MOON = 9.80665, 3.71, 1.62
_WHEELBASE = {4: (4.5, 6.5), 6: (8.0, 10.5), 8: (9.0, 12.0)}  # in wheel radii
_ROCKER_BOGIE_SHARE = 0.6  # of the rovers with six wheels
_LEAST_PULL, _LEVEL_SLIP = 0.2, 0.15
"""A rover makes no test drive where its pull over its load nowhere exceeds the first, or where it
slips more than the second on level ground."""
_SLIPS = np.concatenate([-np.linspace(0.9, 0.05, 18), np.linspace(0.0, 0.95, 39)])
_FIRM_SHEAR_MODULUS = 0.003  # [m]
_REFERENCE_DEPTH = 0.02  # [m], at which a change of the exponent leaves the pressure as it is


@dataclass(frozen=True)
class RoverClass:
    """From what a rover is drawn."""

    mass: tuple[float, float] = (20.0, 200.0)  # [kg]
    wheels: tuple[int, ...] = (4, 6)
    speed: tuple[float, float] = (0.03, 0.1)  # [m/s]
    gravity: tuple[float, ...] = (EARTH,)
    track: tuple[float, float] = (0.7, 0.95)  # over the wheelbase
    steered: bool = False  # the wheels of the first and the last axle


@dataclass(frozen=True)
class SoilErrors:
    """Scatter of the true soil about the file's: deviations of logarithms, or absolute."""

    stiffness: float = 0.2
    cohesion: float = 0.25
    friction: float = 0.06  # of tan phi
    shear_modulus: float = 0.25
    exponent: float = 0.03  # absolute
    peak_ratio: float = 0.05  # absolute


@dataclass(frozen=True)
class FileErrors:
    """Deviations of what a team's file says of the rover."""

    radius: float = 0.01
    mass: float = 0.03
    centre: float = 0.02  # of the wheelbase


@dataclass(frozen=True)
class TrueSoil:
    """Soil of a drive with its laws."""

    stiffness: float
    cohesive_modulus: float
    exponent: float
    cohesion: float
    tan_friction: float
    shear_modulus: float
    density: float
    laws: ContactLaws
    digging: DigSettings

    def under(self, width: FloatArray | float, gravity: float) -> SoilHere:
        """Return the soil as the wheels of a width [m] meet it."""
        number = np.asarray
        return SoilHere(
            stiffness=number(self.cohesive_modulus / width + self.stiffness),
            exponent=number(self.exponent),
            cohesion=number(self.cohesion),
            tan_friction=number(self.tan_friction),
            shear_modulus=number(self.shear_modulus),
            unit_weight=number(self.density * gravity),
        )


@dataclass(frozen=True)
class Draw:
    """A drive's rover and soil, true and as the file has them."""

    vehicle: Vehicle
    soil: TrueSoil
    file: dict[str, object]  # keys of the rover and the soil
    speed: float  # nominal [m/s]
    torque_limit: float  # [N m]
    steered: NDArray[np.bool_]  # (n,) wheels that steer

    @property
    def track(self) -> float:
        """Distance of left and right wheels [m]."""
        return float(np.ptp(self.vehicle.y))

    def configuration(self, more: dict[str, object]) -> Configuration:
        """Return what the estimator is told, with further keys."""
        return reader.from_parameters({**self.file, **more})


def draw_rover(
    generator: np.random.Generator, rover: RoverClass, soils: tuple[str, ...], firm: bool
) -> Draw:
    """Draw rover, soil and file of a drive."""
    nominal = reader.load([str(generator.choice(soils))], complete=False).soil
    if firm:
        nominal = replace(
            nominal,
            cohesive_modulus=1e3,
            frictional_modulus=2e7,
            sinkage_exponent=1.0,
            cohesion=1e3,
            friction_angle=np.radians(38.0),
            shear_modulus=_FIRM_SHEAR_MODULUS,
        )
    while True:
        soil = _true_soil(generator, nominal)
        vehicle = _vehicle(generator, rover, soil)
        pull = traction_curve(vehicle, soil, _SLIPS)
        if pull.max() > _LEAST_PULL and np.interp(_LEVEL_SLIP, _SLIPS, pull) > 0.0:
            break
    speed = float(np.exp(generator.uniform(*np.log(rover.speed))))
    limit = 1.2 * vehicle.weight / vehicle.count * float(vehicle.shape.tip_radius[0])
    file = {**_rover_keys(generator, vehicle, limit), **_soil_keys(generator, nominal)}
    steered = rover.steered & (np.abs(vehicle.x) == np.abs(vehicle.x).max())
    if rover.steered:
        names = [f'steering_{i + 1}' if turns else '' for i, turns in enumerate(steered)]
        file['wheels.steering_joints'] = names
    return Draw(vehicle, soil, file, speed, limit, steered)


def traction_curve(vehicle: Vehicle, soil: TrueSoil, slip: FloatArray) -> FloatArray:
    """Return pull over load in steady motion (k,) at slips (k,) of a wheel with the mean load."""
    shape = WheelShape(
        *(np.full(len(slip), float(part[0])) for part in vars(vehicle.shape).values())
    )
    rate = 0.05 / shape.tip_radius
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / np.maximum(1.0 + slip, 0.02))
    motion = Motion(ratio * 0.05, np.zeros(len(slip)), rate)
    load = np.full(len(slip), vehicle.weight / vehicle.count)
    here = soil.under(float(shape.width[0]), vehicle.gravity)
    _, forces = settled_depth(shape, here, soil.laws, motion, load)
    return np.asarray(forces.pull / load)


def slope_for_slip(vehicle: Vehicle, soil: TrueSoil, slip: float) -> float:
    """Return the slope [rad] on which the rover is expected to drive at a slip; 0 for 0."""
    if slip == 0.0:
        return 0.0
    curve = np.maximum.accumulate(traction_curve(vehicle, soil, _SLIPS))
    pull = float(np.interp(slip, _SLIPS, curve))
    if slip > 0.0:
        pull = max(pull, 0.0)
    return float(np.arctan(pull))


def steepest_slope(vehicle: Vehicle, soil: TrueSoil) -> float:
    """Return the steepest slope [rad] that the rover is expected to climb."""
    return float(np.arctan(traction_curve(vehicle, soil, _SLIPS).max()))


def _true_soil(generator: np.random.Generator, nominal: object) -> TrueSoil:
    errors = SoilErrors()

    def near(value: float, deviation: float) -> float:
        return float(value * np.exp(deviation * generator.standard_normal()))

    def field(name: str) -> float:
        return float(getattr(nominal, name))

    shift = errors.exponent * float(generator.standard_normal())
    softer = _REFERENCE_DEPTH**-shift
    law = generator.choice(['exponent', 'proportional', 'digging'])
    laws = ContactLaws(
        peak_ratio=field('peak_stress_ratio')
        + errors.peak_ratio * float(np.clip(generator.standard_normal(), -2.0, 2.0)),
        peak_shift=float(generator.uniform(0.0, 0.15)),
        leaving_ratio=-float(generator.uniform(0.02, 0.2)),
        lug_share=float(generator.uniform(0.3, 0.7)),
        exponent_slope=float(generator.uniform(0.1, 0.4)) if law == 'exponent' else 0.0,
        proportional_sinkage=bool(law == 'proportional'),
        shear_pressure_exponent=_sometimes(generator, 0.5, (-0.2, 0.3)),
        shear_pressure=8e3,
        bulldozing=_sometimes(generator, 0.6, (0.1, 0.4)),
        lug_thrust=_sometimes(generator, 0.4, (0.03, 0.12)),
    )
    return TrueSoil(
        stiffness=near(field('frictional_modulus'), errors.stiffness) * softer,
        cohesive_modulus=field('cohesive_modulus') * softer,
        exponent=field('sinkage_exponent') + shift,
        cohesion=near(field('cohesion'), errors.cohesion),
        tan_friction=near(float(np.tan(field('friction_angle'))), errors.friction),
        shear_modulus=near(field('shear_modulus'), errors.shear_modulus),
        density=field('density'),
        laws=laws,
        digging=DigSettings(rate=0.3 if law == 'digging' else 0.08),
    )


def _sometimes(
    generator: np.random.Generator, probability: float, bounds: tuple[float, float]
) -> float:
    value = float(generator.uniform(*bounds))
    return value if generator.uniform() < probability else 0.0


def _vehicle(generator: np.random.Generator, rover: RoverClass, soil: TrueSoil) -> Vehicle:
    mass = float(np.exp(generator.uniform(*np.log(rover.mass))))
    gravity = float(generator.choice(rover.gravity))
    n = int(generator.choice(rover.wheels))
    radius = 0.03 * mass**0.28 * float(generator.uniform(0.9, 1.1))
    width_ratio, lug_ratio = generator.uniform(0.8, 1.3), generator.uniform(0.0, 0.08)
    lugs = float(generator.integers(16, 31))
    deepest = float(generator.uniform(0.05, 0.14))  # of the radius, at rest
    load = np.full(1, mass * gravity / n)
    standing = Motion(np.zeros(1), np.zeros(1), np.zeros(1))
    while True:
        shape = WheelShape(
            *(np.full(n, v) for v in (radius, width_ratio * radius, lug_ratio * radius, lugs))
        )
        one = WheelShape(*(part[:1] for part in vars(shape).values()))
        here = soil.under(float(one.width[0]), gravity)
        depth, _ = settled_depth(one, here, soil.laws, standing, load)
        if depth[0] < deepest * radius:
            break
        radius *= 1.04  # a team makes its wheels large enough for its soil
    wheelbase = radius * float(generator.uniform(*_WHEELBASE[n]))
    track = wheelbase * float(generator.uniform(*rover.track))
    axles = np.linspace(0.5, -0.5, n // 2) * wheelbase
    x, y = np.repeat(axles, 2), np.tile([0.5 * track, -0.5 * track], n // 2)
    suspension = None
    if n == 6 and generator.uniform() < _ROCKER_BOGIE_SHARE:
        suspension = RockerBogie((0.0, 2.5 * radius), (-0.25 * wheelbase, 1.8 * radius))
    centre = (
        0.03 * wheelbase * float(generator.standard_normal()),
        0.01 * track * float(generator.standard_normal()),
        radius * float(generator.uniform(2.2, 3.4)),
    )
    inertia = mass * (wheelbase**2 + track**2) / 12.0
    return Vehicle(mass, gravity, centre, shape, x, y, suspension, inertia)


def _rover_keys(
    generator: np.random.Generator, vehicle: Vehicle, torque_limit: float
) -> dict[str, object]:
    errors = FileErrors()
    n = vehicle.count
    sides = ('left', 'right')
    scale = 1.0 + errors.radius * float(generator.standard_normal())
    radius = float(vehicle.shape.radius[0]) * scale
    wheelbase = float(np.ptp(vehicle.x))
    x, _, z = vehicle.centre
    keys: dict[str, object] = {
        'wheels.names': [f'axle_{i // 2 + 1}_{sides[i % 2]}' for i in range(n)],
        'wheels.radius': [radius] * n,
        'wheels.width': vehicle.shape.width.tolist(),
        'wheels.lug_height': vehicle.shape.lug_height.tolist(),
        'wheels.lug_count': [int(c) for c in vehicle.shape.lug_count],
        'wheels.x': vehicle.x.tolist(),
        'wheels.y': vehicle.y.tolist(),
        'wheels.z': [radius] * n,
        'wheels.torque_limit': [torque_limit] * n,
        'wheels.passes': [i // 2 + 1 for i in range(n)],
        'rover.mass': vehicle.mass * (1.0 + errors.mass * float(generator.standard_normal())),
        'rover.gravity': vehicle.gravity,
        'rover.centre_of_gravity': [
            x + errors.centre * wheelbase * float(generator.standard_normal()),
            0.0,
            z + errors.centre * wheelbase * float(generator.standard_normal()),
        ],
        'rover.suspension': 'rigid',
    }
    if vehicle.suspension is not None:
        keys.update(
            {
                'rover.suspension': 'rocker_bogie',
                'rover.rocker_pivot': list(vehicle.suspension.rocker),
                'rover.bogie_pivot': list(vehicle.suspension.bogie),
                'rover.bogie_wheels': 'rear',
            }
        )
    return keys


def _soil_keys(generator: np.random.Generator, nominal: object) -> dict[str, object]:
    def field(name: str) -> float:
        return float(getattr(nominal, name))

    names = (
        'cohesive_modulus',
        'frictional_modulus',
        'sinkage_exponent',
        'cohesion',
        'shear_modulus',
        'peak_stress_ratio',
        'density',
    )
    return {
        **{f'soil.{name}': field(name) for name in names},
        'soil.friction_angle_deg': float(np.degrees(field('friction_angle'))),
        'soil.leaving_angle_ratio': -0.1,
        'soil.relative_std': float(generator.choice([0.1, 0.2])),
        'effects.slip_sinkage_exponent.enabled': True,
        'effects.slip_sinkage_exponent.n1': 0.2,
        'effects.lug_shear_radius.enabled': True,
    }
