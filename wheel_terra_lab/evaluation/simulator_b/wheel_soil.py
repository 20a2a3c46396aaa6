# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Forces of loose soil on rolling, skidding and sideways sliding wheels, by Simpson's rule.

The stresses are those of Wong and Reece (1967) with the shear law of Janosi and Hanamoto (1961);
the sideways motion shares the shear strength with the longitudinal one (Ishigami et al. 2007).
Angles count from the downward normal of the ground, positive towards travel.

The normal stress is scaled so that the wheel always carries its load. Where the scale is 1 the
depth of contact is that of the steady state; elsewhere the wheel is still on its way to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

INTERVALS = 10
"""Intervals of Simpson's rule on each side of the peak of the normal stress; even."""

_CREEP_SPEED = 5e-4
"""Speed [m/s] below which a wheel counts as standing: keeps v/w finite, lets the soil creep."""

_LEAST_DEPTH = 2e-5  # [m]
_SCALE_RANGE = (0.02, 50.0)
_WIDEST_ENTRANCE = 1.4  # [rad]; beyond it the rim angle loses its meaning


@dataclass(frozen=True)
class WheelShape:
    """Wheels; every entry (n,) or a number, in SI units."""

    radius: FloatArray
    width: FloatArray
    lug_height: FloatArray
    lug_count: FloatArray

    @property
    def tip_radius(self) -> FloatArray:
        """Radius with the lugs [m]."""
        return self.radius + self.lug_height


@dataclass(frozen=True)
class SoilHere:
    """Soil under each wheel; every entry broadcasts against (n,)."""

    stiffness: FloatArray  # kc/b + kphi [N/m^(n+2)]
    exponent: FloatArray  # n0 [-]
    cohesion: FloatArray  # [Pa]
    tan_friction: FloatArray  # [-]
    shear_modulus: FloatArray  # Janosi's K [m]
    unit_weight: FloatArray  # density times gravity [N/m^3]


@dataclass(frozen=True)
class ContactLaws:
    """What the soil does beyond its parameters; neutral as it stands."""

    # Angle of greatest stress over entrance angle: peak_ratio + peak_shift s (Wong, Reece 1967)
    peak_ratio: float = 0.4
    peak_shift: float = 0.0
    leaving_ratio: float = 0.0  # leaving angle over entrance angle, zero or negative
    # Share of the lug height by which the shearing radius exceeds the rim (Ding et al. 2010)
    lug_share: float = 0.0
    exponent_slope: float = 0.0  # n1 of the exponent n0 + n1 abs(s) (Ding et al. 2010)
    # Sinkage grows as (1 + s)/(1 - s/2) (Lyasko 2010), by softer ground
    proportional_sinkage: bool = False
    # K grows with the mean pressure to this power, from its reference on
    shear_pressure_exponent: float = 0.0
    shear_pressure: float = 5000.0  # [Pa]
    bulldozing: float = 0.0  # share of the passive earth pressure on the front (Hegedus 1960)
    lug_thrust: float = 0.0  # share of the passive failure before engaged lugs (Bekker 1969)


@dataclass(frozen=True)
class Motion:
    """Motion of the hubs; every entry broadcasts against (n,)."""

    forward: FloatArray  # ground speed along the wheel [m/s]
    sideways: FloatArray  # to the left [m/s]
    rate: FloatArray  # [rad/s]


@dataclass(frozen=True)
class SoilForces:
    """Forces on the wheels, body axes: pull forward [N], side to the left [N], torque [N m].

    `scale` is the factor on the normal stress with which the load is carried; above 1 the wheel
    has yet to sink.
    """

    pull: FloatArray
    side: FloatArray
    torque: FloatArray
    scale: FloatArray


def slip_ratio(forward: FloatArray, rim_speed: FloatArray, least_speed: float = 1e-9) -> FloatArray:
    """Return the slip ratio in [-1, 1]: 1 - v/rw driving, rw/v - 1 braking, 1 if v opposes rw.

    Where both speeds are below `least_speed` [m/s] the ratio fades to 0.
    """
    larger = np.maximum(np.abs(forward), np.abs(rim_speed))
    safe = np.maximum(larger, least_speed)
    opposed = (forward * rim_speed < 0.0) & (np.abs(rim_speed) > least_speed)
    slip = (np.abs(rim_speed) - np.abs(forward)) / safe
    return np.asarray(np.where(opposed, 1.0, slip))


def soil_forces(
    wheel: WheelShape,
    soil: SoilHere,
    laws: ContactLaws,
    motion: Motion,
    depth: FloatArray,  # of contact [m]: what gives the entrance angle
    sinkage: FloatArray,  # of the rim [m], with what the wheel dug out: what it must push
    load: FloatArray,  # normal to the ground [N]
) -> SoilForces:
    """Return the forces of the soil on the wheels."""
    direction = np.where(
        np.abs(motion.rate) * wheel.radius > _CREEP_SPEED,
        np.sign(motion.rate),
        np.where(motion.forward < 0.0, -1.0, 1.0),
    )
    forward, rate = direction * motion.forward, direction * motion.rate
    slip = slip_ratio(forward, rate * wheel.tip_radius, _CREEP_SPEED)
    stiffness, exponent = _bearing(soil, laws, slip)
    cosine_in = 1.0 - np.maximum(depth, _LEAST_DEPTH) / wheel.radius
    entrance = np.minimum(np.arccos(np.maximum(cosine_in, -1.0)), _WIDEST_ENTRANCE)
    peak = np.clip(laws.peak_ratio + laws.peak_shift * slip, 0.05, 0.95) * entrance
    leaving = laws.leaving_ratio * entrance

    # Both sides of the peak by the distance from the edge, 0 at the edge and 1 at the peak.
    y, weight = _simpson(np.ndim(slip + entrance))
    front, rear = entrance - peak, peak - leaving
    angle = np.concatenate([entrance - y * front, leaving + y * rear])
    weight = np.concatenate([weight * front, weight * rear])
    rise = np.maximum(np.cos(angle[: len(y)]) - np.cos(entrance), 0.0)
    normal = np.tile(stiffness * (wheel.radius * rise) ** exponent, (2, *(1,) * (y.ndim - 1)))

    shear_radius = wheel.radius + laws.lug_share * wheel.lug_height
    sine, cosine, swept = np.sin(angle), np.cos(angle), entrance - angle
    turning = np.sqrt(rate**2 + (_CREEP_SPEED / wheel.radius) ** 2)
    along = (shear_radius * rate * swept - forward * (np.sin(entrance) - sine)) / turning
    across = motion.sideways * swept / turning
    j = np.sqrt(along**2 + across**2) + 1e-12
    mobilised = -np.expm1(-j / _shear_modulus(wheel, soil, laws, entrance, load)) / j
    forth = mobilised * along  # share of the strength that pushes the wheel forward
    aside = -mobilised * across

    # Two parts of each sum: what scales with the normal stress, and the cohesion.
    pressing = weight * wheel.radius * wheel.width * normal
    rubbing = weight * shear_radius * wheel.width * normal * soil.tan_friction
    sticking = weight * shear_radius * wheel.width * soil.cohesion
    carried = np.sum(pressing * cosine + rubbing * forth * sine, axis=0)
    stuck_load = np.sum(sticking * forth * sine, axis=0)
    scale = np.clip((load - stuck_load) / np.maximum(carried, 1e-9), *_SCALE_RANGE)
    shear = scale * rubbing + sticking
    rolling = np.tanh((np.abs(forward) + np.abs(rate) * wheel.radius) / _CREEP_SPEED)
    resistance = rolling * scale * np.sum(pressing * sine, axis=0)
    pull = np.sum(shear * forth * cosine, axis=0) - resistance
    torque = shear_radius * np.sum(shear * forth, axis=0)
    side = np.sum(shear * aside, axis=0)

    if laws.bulldozing:
        push = np.tanh(forward / _CREEP_SPEED) * bulldozing_force(wheel, soil, sinkage)
        pull = pull - laws.bulldozing * push
    if laws.lug_thrust:
        lead = np.sum(weight * forth, axis=0) / (entrance - leaving)
        thrust = laws.lug_thrust * lead * _lug_force(wheel, soil, entrance, leaving, load, slip)
        pull, torque = pull + thrust, torque + thrust * shear_radius
    return SoilForces(direction * pull, side, direction * torque, scale)


def bulldozing_force(wheel: WheelShape, soil: SoilHere, sinkage: FloatArray) -> FloatArray:
    """Return the passive earth pressure on the front of the rim [N] (Hegedus 1960).

    F = b D1 (c z + D2 gamma z^2/2), D1 = cot X + tan(X + phi), D2 = cot X + cot^2 X tan phi,
    X = pi/4 - phi/2.
    """
    friction = np.arctan(soil.tan_friction)
    rupture = 0.25 * np.pi - 0.5 * friction
    cot = 1.0 / np.tan(rupture)
    d1 = cot + np.tan(rupture + friction)
    d2 = cot + cot**2 * soil.tan_friction
    z = np.maximum(sinkage, 0.0)
    return wheel.width * d1 * (soil.cohesion * z + 0.5 * d2 * soil.unit_weight * z**2)


def _lug_force(
    wheel: WheelShape,
    soil: SoilHere,
    entrance: FloatArray,
    leaving: FloatArray,
    load: FloatArray,
    slip: FloatArray,
) -> FloatArray:
    """Return the passive failure in front of the engaged lugs [N] (Bekker 1969)."""
    friction = np.arctan(soil.tan_friction)
    flow = np.tan(0.25 * np.pi + 0.5 * friction) ** 2
    engaged = wheel.lug_count * (entrance - leaving) / (2.0 * np.pi)
    pressure = load / (wheel.width * wheel.radius * np.sin(entrance))
    h = wheel.lug_height
    per_lug = wheel.width * (
        0.5 * soil.unit_weight * h**2 * flow
        + pressure * h * (flow - 1.0) * np.abs(slip)
        + 2.0 * soil.cohesion * h * np.sqrt(flow)
    )
    return np.asarray(engaged * per_lug)


def settled_depth(
    wheel: WheelShape,
    soil: SoilHere,
    laws: ContactLaws,
    motion: Motion,
    load: FloatArray,
) -> tuple[FloatArray, SoilForces]:
    """Return the depth [m] at which the soil carries the load in steady motion, and the forces."""
    depth = 0.05 * wheel.radius * np.ones(np.broadcast_shapes(np.shape(load), motion.rate.shape))
    for _ in range(_SETTLING_ROUNDS):
        found = soil_forces(wheel, soil, laws, motion, depth, depth, load)
        if np.all(np.abs(found.scale - 1.0) < _SETTLED):
            break
        depth = np.minimum(depth * sinking_step(found.scale, soil.exponent), 0.9 * wheel.radius)
    return depth, found


def sinking_step(scale: FloatArray, exponent: FloatArray) -> FloatArray:
    """Return the factor on the depth of contact that carries the load: W grows like z^(n + 1/2)."""
    return np.asarray(np.exp(np.clip(np.log(scale), -1.0, 1.0) / (exponent + 0.5)))


_SETTLING_ROUNDS, _SETTLED = 80, 1e-4


def _bearing(soil: SoilHere, laws: ContactLaws, slip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return stiffness and exponent under a slipping wheel."""
    magnitude = np.abs(slip)
    if laws.proportional_sinkage:
        growth = (1.0 + magnitude) / (1.0 - 0.5 * magnitude)
        return soil.stiffness * growth ** -(soil.exponent + 0.5), soil.exponent
    return soil.stiffness, soil.exponent + laws.exponent_slope * magnitude


def _shear_modulus(
    wheel: WheelShape, soil: SoilHere, laws: ContactLaws, entrance: FloatArray, load: FloatArray
) -> FloatArray:
    if not laws.shear_pressure_exponent:
        return soil.shear_modulus
    pressure = load / (wheel.width * wheel.radius * np.sin(entrance))
    relative = np.clip(pressure / laws.shear_pressure, 0.2, 5.0)
    return np.asarray(soil.shear_modulus * relative**laws.shear_pressure_exponent)


def _simpson(dimensions: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of Simpson's rule on (0, 1), shaped for leading-axis sums."""
    weight = np.ones(INTERVALS + 1)
    weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
    shape = (-1,) + (1,) * dimensions
    nodes = np.linspace(0.0, 1.0, INTERVALS + 1)
    return nodes.reshape(shape), (weight / (3.0 * INTERVALS)).reshape(shape)
