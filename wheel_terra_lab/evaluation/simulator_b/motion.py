# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Motion of the rover: implicit steps of its speeds, wheels that sink and dig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_b.ground import Ground, RandomField
from wheel_terra_lab.evaluation.simulator_b.vehicle import ChassisForce, Vehicle, wheel_loads
from wheel_terra_lab.evaluation.simulator_b.wheel_soil import (
    ContactLaws,
    Motion,
    SoilForces,
    SoilHere,
    settled_depth,
    sinking_step,
    slip_ratio,
    soil_forces,
)

FloatArray = NDArray[np.float64]

STEP = 0.025
"""Time step [s]."""

_MOTOR_TIME = 0.15  # [s], in which a wheel follows its command
_MOTOR_DROOP = 0.03  # loss of rate at the greatest torque
_FREE_WHEEL_TIME = 0.1  # [s], in which a wheel without drive follows the ground
_STEERING_RATE = 0.5  # [rad/s], at which a wheel turns to where it is told to head
_NEWTON_ROUNDS = 25
_BACK = 0.3  # what is kept of a step that made the residual larger
_SMALLEST_CHANGE = 1e-9  # [m/s]
_BALANCED = 2e-4  # residual force over the weight
_PROBE = 2e-6  # [m/s] and [rad/s times m], steps of the numerical derivative
_REST_SINKING_TIME = 0.5  # [s], in which a standing wheel comes to rest in the soil
_DIGGING_SHARE = 0.3
"""Share of the slip travel that counts as travel when a wheel comes to its depth."""


@dataclass(frozen=True)
class DigSettings:
    """Soil carried away by slipping wheels, which falls back over new ground (mass balance).

    The rim throws out `rate` of the soil that its lugs and a few grains' depth sweep per slip
    travel; over a travel of `length` contact lengths the wheel leaves its pit.
    """

    rate: float = 0.1  # [-]
    grain_depth: float = 0.002  # [m], swept by a smooth rim
    length: float = 1.0  # [-]


@dataclass(frozen=True)
class World:
    """What does not change during a drive."""

    vehicle: Vehicle
    ground: Ground
    soil: SoilHere  # nominal of the place, (n,) or numbers
    laws: ContactLaws
    digging: DigSettings
    torque_limit: float  # [N m]
    rut_stiffening: float  # of the soil per wheel that ran there before
    load_errors: tuple[RandomField, ...]  # per wheel, share of the load


@dataclass
class State:
    """What changes; `depth` is that of contact, `pit` what was dug out besides (n,)."""

    time: float
    x: float
    y: float
    heading: float
    speed: FloatArray  # forward, left [m/s], yaw rate [rad/s]
    rate: FloatArray  # (n,) wheel rates [rad/s]
    depth: FloatArray  # (n,) [m]
    pit: FloatArray  # (n,) [m]
    load: FloatArray  # (n,) [N]
    force: ChassisForce
    slopes: tuple[float, float]  # ahead, to the left [rad]
    forces: SoilForces
    steering: FloatArray  # (n,) headings of the wheels, positive left [rad]

    @property
    def sinkage(self) -> FloatArray:
        """Depth of the rims below the untouched surface (n,) [m]."""
        return self.depth + self.pit


@dataclass(frozen=True)
class WheelCommand:
    """What the drives are told for a step; a locked wheel stands, a free one is not driven."""

    rate: FloatArray  # (n,) [rad/s]
    locked: NDArray[np.bool_]
    free: NDArray[np.bool_]
    steering: FloatArray  # (n,) asked headings, positive left [rad]


class Plant:
    """The rover on its ground."""

    def __init__(self, world: World) -> None:
        self.world = world
        vehicle = world.vehicle
        n = vehicle.count
        slopes = world.ground.slopes(0.0, 0.0, 0.0)
        force = _standing(vehicle.gravity, slopes)
        load = wheel_loads(
            vehicle, force, np.full(n, vehicle.mass * force.forward / n), np.zeros(n)
        )
        self._ahead = np.stack([np.ones(n), np.zeros(n), -vehicle.y])
        self._aside = np.stack([np.zeros(n), np.ones(n), vehicle.x])
        self._lever, self._lateral_lever = self._ahead, self._aside
        behind = (vehicle.x[:, None] < vehicle.x) & (vehicle.y[:, None] * vehicle.y > 0.0)
        self._wheels_before = behind.sum(axis=1)
        self._inertia = np.array([vehicle.mass, vehicle.mass, vehicle.yaw_inertia])
        standing = Motion(np.zeros(n), np.zeros(n), np.zeros(n))
        soil = self._soil(0.0, 0.0, 0.0)
        depth, forces = settled_depth(vehicle.shape, soil, world.laws, standing, load)
        self.state = State(
            time=0.0,
            x=0.0,
            y=0.0,
            heading=0.0,
            speed=np.zeros(3),
            rate=np.zeros(n),
            depth=depth,
            pit=np.zeros(n),
            load=load,
            force=force,
            slopes=slopes,
            forces=forces,
            steering=np.zeros(n),
        )

    def step(self, command: WheelCommand) -> State:
        """Go on by one step; return the state after it (the same object)."""
        s, world = self.state, self.world
        vehicle = world.vehicle
        self._steer(command.steering)
        s.rate = self._wheel_rates(command)
        s.slopes = world.ground.slopes(s.x, s.y, s.heading)
        soil = self._soil(s.x, s.y, s.heading)
        s.load = self._loads()
        before = s.speed
        s.speed, s.forces = self._solve(soil)
        change = (s.speed - before) / STEP
        gravity = _standing(vehicle.gravity, s.slopes)
        s.force = ChassisForce(change[0] + gravity.forward, change[1] + gravity.left, gravity.up)
        self._sink(soil)
        cosine, sine = np.cos(s.heading), np.sin(s.heading)
        s.x += STEP * (s.speed[0] * cosine - s.speed[1] * sine)
        s.y += STEP * (s.speed[0] * sine + s.speed[1] * cosine)
        s.heading += STEP * s.speed[2]
        s.time += STEP
        return s

    def slip(self) -> FloatArray:
        """Return the slip ratios (n,), of the radius with lugs."""
        s = self.state
        return slip_ratio(s.speed @ self._lever, s.rate * self.world.vehicle.shape.tip_radius)

    def _steer(self, asked: FloatArray) -> None:
        """Turn the wheels towards the headings that are asked for (n,) [rad]."""
        s, most = self.state, _STEERING_RATE * STEP
        s.steering = s.steering + np.clip(asked - s.steering, -most, most)
        cosine, sine = np.cos(s.steering), np.sin(s.steering)
        self._lever = cosine * self._ahead + sine * self._aside
        self._lateral_lever = cosine * self._aside - sine * self._ahead

    def _wheel_rates(self, command: WheelCommand) -> FloatArray:
        s, limit = self.state, self.world.torque_limit
        torque = s.forces.torque
        loaded = np.clip(np.abs(torque) / limit, 0.0, 1.0)
        target = command.rate * (1.0 - _MOTOR_DROOP * loaded)
        stalled = np.abs(torque) > limit
        target = np.where(stalled, s.rate * limit / np.maximum(np.abs(torque), limit), target)
        rate = s.rate + STEP / _MOTOR_TIME * (target - s.rate)
        # Without drive the rate goes to where the soil turns the wheel without torque.
        ground = (s.speed @ self._lever) / self.world.vehicle.shape.radius
        slope = np.maximum(s.load * self.world.vehicle.shape.radius, 1e-6) * 3.0
        turning = ground * 0.9 - torque / slope * np.maximum(np.abs(ground), 1e-3)
        coasting = s.rate + STEP / _FREE_WHEEL_TIME * (
            np.where(np.abs(ground) > 1e-4, 0.5 * turning + 0.5 * s.rate, 0.0) - s.rate
        )
        rate = np.where(command.free, coasting, rate)
        return np.where(command.locked, 0.0, rate)

    def _soil(self, x: float, y: float, heading: float) -> SoilHere:
        world, vehicle = self.world, self.world.vehicle
        cosine, sine = np.cos(heading), np.sin(heading)
        factors = world.ground.soil(
            x + vehicle.x * cosine - vehicle.y * sine, y + vehicle.x * sine + vehicle.y * cosine
        )
        stiffness = factors.stiffness * (1.0 + world.rut_stiffening * self._wheels_before)
        return SoilHere(
            stiffness=world.soil.stiffness * stiffness,
            exponent=world.soil.exponent,
            cohesion=world.soil.cohesion * factors.cohesion,
            tan_friction=world.soil.tan_friction * factors.friction,
            shear_modulus=world.soil.shear_modulus,
            unit_weight=world.soil.unit_weight,
        )

    def _loads(self) -> FloatArray:
        s, world = self.state, self.world
        forward = s.forces.pull * np.cos(s.steering) - s.forces.side * np.sin(s.steering)
        lead = (s.forces.torque - s.forces.pull * world.vehicle.shape.radius) * np.cos(s.steering)
        loads = wheel_loads(world.vehicle, s.force, forward, lead)
        place = np.asarray(s.x), np.asarray(s.y)
        errors = np.array([float(e.at(*place)) for e in world.load_errors])
        changed = loads * (1.0 + errors)
        return np.asarray(changed * loads.sum() / changed.sum())

    def _solve(self, soil: SoilHere) -> tuple[FloatArray, SoilForces]:
        """Solve inertia times change of speed = forces for the speeds after the step."""
        s, vehicle = self.state, self.world.vehicle
        gravity = _standing(vehicle.gravity, s.slopes)
        weight = vehicle.mass * np.array([gravity.forward, gravity.left, 0.0])
        reach = float(np.max(np.hypot(vehicle.x, vehicle.y)))
        probe = np.vstack([np.zeros(3), np.diag([_PROBE, _PROBE, _PROBE / reach])])
        unit = np.array([1.0, 1.0, reach])
        speed, step, best = s.speed.copy(), np.zeros(3), np.inf
        for _ in range(_NEWTON_ROUNDS):
            found = self._forces(soil, speed + step + probe)
            # Forward force, left force and yaw moment (..., 3).
            total = found.pull @ self._lever.T + found.side @ self._lateral_lever.T - weight
            residual = self._inertia * (speed + step + probe - s.speed) / STEP - total
            error = float(np.abs(residual[0] / unit).max())
            if error > best and np.abs(step * unit).max() > _SMALLEST_CHANGE:
                step = _BACK * step
                continue
            speed, best = speed + step, error
            if error < _BALANCED * vehicle.weight:
                break
            slope = (residual[1:] - residual[0]).T / np.diag(probe[1:])
            fastest = float(np.max(np.abs(s.rate))) * vehicle.shape.tip_radius.max() + 0.02
            change = -np.linalg.solve(slope, residual[0])
            step = np.clip(change, -0.5 * fastest / unit, 0.5 * fastest / unit)
        return speed, SoilForces(found.pull[0], found.side[0], found.torque[0], found.scale[0])

    def _forces(self, soil: SoilHere, speeds: FloatArray) -> SoilForces:
        s, world = self.state, self.world
        motion = Motion(speeds @ self._lever, speeds @ self._lateral_lever, s.rate)
        return soil_forces(
            world.vehicle.shape, soil, world.laws, motion, s.depth, s.sinkage, s.load
        )

    def _sink(self, soil: SoilHere) -> None:
        s, world = self.state, self.world
        shape, dig = world.vehicle.shape, world.digging
        forward = s.speed @ self._lever
        travel = np.abs(forward) * STEP
        slipping = np.abs(s.rate * shape.tip_radius - forward) * STEP
        contact = np.sqrt(2.0 * shape.radius * np.maximum(s.depth, 1e-4))
        sinking = s.forces.scale > 1.0
        way = travel + np.where(
            sinking, _DIGGING_SHARE * slipping + contact * STEP / _REST_SINKING_TIME, 0.0
        )
        share = 1.0 - np.exp(-2.0 * way / contact)
        s.depth = np.clip(
            s.depth * sinking_step(s.forces.scale, soil.exponent) ** share,
            1e-5,
            0.6 * shape.radius,
        )
        swept = (shape.lug_height + dig.grain_depth) * shape.lug_count
        per_travel = dig.rate * swept / (2.0 * np.pi * shape.tip_radius)
        s.pit = s.pit + per_travel * slipping
        s.pit = s.pit * np.exp(-travel / (dig.length * contact))
        s.pit = np.minimum(s.pit, 0.9 * shape.radius - s.depth)


def _standing(gravity: float, slopes: tuple[float, float]) -> ChassisForce:
    """Return the specific force of a rover that stands on a slope."""
    ahead, left = np.sin(slopes[0]), np.sin(slopes[1])
    return ChassisForce(
        gravity * ahead, gravity * left, gravity * np.sqrt(max(1.0 - ahead**2 - left**2, 0.01))
    )
