# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The simulated rover: body, drives and suspension on wheel-soil contacts with memory.

Unknowns of a step are the body's forward, lateral and turning speed and the wheel rates. The soil
is stiff in them (a rover stops within milliseconds of its drives), so the step is implicit Euler,
solved by Newton's method with the wheel rates eliminated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.simulation.contact import SoilForces, SunkWheels, contact_of
from wheel_terra_estimator.simulation.contact_memory import ContactMemory, Shear
from wheel_terra_estimator.simulation.drives import Command, Drives, SteeringDrives
from wheel_terra_estimator.simulation.suspension import Suspension
from wheel_terra_estimator.simulation.terrain import Terrain
from wheel_terra_estimator.simulation.truth import Truth
from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

LONGEST_STEP = 0.05  # [s]
LOAD_TIME = 0.1  # [s]; the suspension settles
TINY = 1e-6  # [m/s]; step of the numerical derivatives
TOLERANCE = 1e-4  # [m/s]; a smaller step of Newton's method is the last: the model is linear there
MOST_ITERATIONS = 40  # most steps take one or two
FARTHEST = 0.1
"""Bound of a move of Newton's method [m/s]; above a speed of 1 m/s, over it [-]."""


@dataclass
class WheelFaults:
    """What is wrong with single wheels; may be changed between steps."""

    # (n,) factor on the commanded rate: above 1 a drive that runs away, 0 a locked one
    rate_factor: FloatArray
    torque_factor: FloatArray  # (n,) factor on the torque limit: 0 a wheel that coasts
    load_factor: FloatArray  # (n,) factor on the load: near 0 a wheel that is lifted off


class WheelForces(NamedTuple):
    """Forces and torques at hub speeds, shape (..., n), body frame."""

    pull: FloatArray
    side_force: FloatArray
    torque: FloatArray
    soil: SoilForces


class RoverPlant:
    """A rover on a terrain, driven by velocity commands.

    ``configuration``: true rover, true base soil and true effects. ``dig_efficiency``: share of the
    soil between passing lugs that a spinning wheel throws out [-].
    """

    def __init__(
        self,
        configuration: Configuration,
        terrain: Terrain,
        drives: Drives,
        dig_efficiency: float = 0.05,
    ) -> None:
        wheels, rover = configuration.wheels, configuration.rover
        self._wheels = wheels
        self._terrain = terrain
        self._drives = drives
        self._gravity, self._mass = rover.gravity, rover.mass
        self._rest_speed = configuration.rest_speed
        self._contact = contact_of(configuration)
        self._memory = ContactMemory(wheels.wheel, wheels.slip_radius, dig_efficiency)
        self._suspension = Suspension(configuration)
        length = float(np.ptp(wheels.x)) + 2.0 * float(wheels.radius.max())
        breadth = float(np.ptp(wheels.y)) + float(wheels.width.max())
        yaw_inertia = rover.mass * (length**2 + breadth**2) / 12.0
        self._inertias = np.array([rover.mass, rover.mass, yaw_inertia])
        n = wheels.count
        one, zero = np.ones(n), np.zeros(n)
        # Hub speed (forward, lateral) by body speed (forward, lateral, turning): (2, 3, n).
        self._body_lever = np.array([[one, zero, -wheels.y], [zero, one, wheels.x]])
        self._steering = SteeringDrives(configuration)
        self._lever = self._body_lever
        # A plane through the wheels gives the attitude of ground and chassis.
        self._plane = np.linalg.pinv(np.stack([wheels.x, wheels.y, one], axis=1))[:2]

        # How far each other wheel of the same track is ahead (n, n) [m].
        ahead = wheels.x[None, :] - wheels.x[:, None]
        apart = np.abs(wheels.y[None, :] - wheels.y[:, None])
        self._ahead = np.where(apart < wheels.width, ahead, 0.0)
        self._straight = 0.0  # way since the last turn [m]

        self.faults = WheelFaults(*np.ones((3, n)))
        self.time = 0.0  # since the start [s]
        self._speeds = np.zeros(3)
        self._rate = np.zeros(n)
        self._angle = np.zeros(n)
        self._position = np.zeros(3)
        self._load = np.full(n, rover.mass * rover.gravity / n)
        self._attitude = np.zeros(2)  # pitch (nose up) and roll (left up) of the chassis
        self._set_down()

    def step(self, command: Command, duration: float) -> Truth:
        """Drive for ``duration`` [s] under a command and return the truth at its end."""
        steps = max(int(np.ceil(duration / LONGEST_STEP - 1e-9)), 1)
        for _ in range(steps):
            self._advance(command, duration / steps)
        return self.truth()

    def truth(self) -> Truth:
        """Return what is true now."""
        wheels, memory, forces = self._wheels, self._memory, self._forces
        forward, lateral, turning = (float(speed) for speed in self._speeds)
        rim = self._rate * wheels.slip_radius
        along, across = (np.einsum('jn,j->n', lever, self._speeds) for lever in self._lever)
        return Truth(
            time=self.time,
            slip=np.asarray(slip_ratio(along, rim, self._rest_speed)),
            slip_velocity=rim - along,
            steering=self._steering.angle,
            drawbar_pull=forces.pull,
            lateral_force=forces.side_force,
            slip_angle=np.arctan2(across, along),
            normal_load=self._carried,
            sinkage=memory.sinkage,
            sinkage_rate=memory.sinkage_rate,
            torque=forces.torque,
            wheel_rate=self._rate,
            wheel_angle=self._angle,
            leaving_angle=forces.soil.leaving_angle,
            pass_number=self._passes,
            forward_velocity=forward,
            lateral_velocity=lateral,
            yaw_rate=turning,
            position=self._position,
            slope=float(np.arcsin(self._sine[0])),
            roll=float(self._attitude[1]),
            pitch=float(self._attitude[0]),
            specific_force=self._specific_force,
            angular_rate=self._angular_rate,
        )

    # Ground and soil ----------------------------------------------------------------------------

    def _look_at_ground(self) -> None:
        """Find height, slope and soil below the wheels."""
        x, y, heading = self._position
        cosine, sine = np.cos(heading), np.sin(heading)
        wheels, terrain = self._wheels, self._terrain
        wheel_x = x + cosine * wheels.x - sine * wheels.y
        wheel_y = y + sine * wheels.x + cosine * wheels.y
        self._surface = terrain.height(wheel_x, wheel_y)
        self._sine = self._plane @ self._surface  # of slope along and across the body
        along = terrain.sine_of_slope(wheel_x) * cosine + terrain.sine_of_side_slope * sine
        if not np.ptp(wheels.x):  # one axle: the third support runs on the same slope
            self._sine[0] = along.mean()
        self._local_slope = along
        self._tilt = along - self._sine[0]  # small angle between ground at the wheel and body
        self._factors = terrain.soil_factors(wheel_x, wheel_y)
        if abs(self._speeds[2]) * np.ptp(wheels.x) > 0.5 * abs(self._speeds[0]) * np.ptp(wheels.y):
            self._straight = 0.0  # wheels leave the ruts of those before them
        before = self._ahead if self._speeds[0] >= 0.0 else -self._ahead
        passes = 1.0 + ((before > 0.0) & (before <= self._straight)).sum(axis=1)
        self._passes = np.minimum(passes, wheels.passes.max())

    def _wheel_forces(self, hub_speed: FloatArray, rate: FloatArray, dt: float) -> WheelForces:
        """Return the forces at trial speeds of the hubs (2, ..., n) and wheel rates (..., n)."""
        _, shear = self._memory.trial_shear(hub_speed[0], hub_speed[1], rate, dt)
        sense = self._memory.sense
        if (np.abs(sense) > 0.99).all():
            sign = np.sign(sense)
            soil = self._soil_forces(shear, sign)
            return WheelForces(sign * soil.pull, soil.side_force, sign * soil.torque, soil)
        # Between two directions of travel: a mixture of both contacts.
        front = self._soil_forces(shear, np.ones_like(sense))
        back = self._soil_forces(shear, -np.ones_like(sense))
        ahead = 0.5 * (1.0 + sense)
        sides = zip(front, back, strict=True)
        mixed = SoilForces(*(ahead * f + (1.0 - ahead) * b for f, b in sides))
        return WheelForces(
            ahead * front.pull - (1.0 - ahead) * back.pull,
            mixed.side_force,
            ahead * front.torque - (1.0 - ahead) * back.torque,
            mixed,
        )

    def _soil_forces(self, shear: Shear, sense: FloatArray) -> SoilForces:
        """Return the soil's answer in the frame of a wheel that travels with ``sense``."""
        sunk = SunkWheels(
            self._factors,
            self._memory.depth,
            shear.slip * sense,
            shear.side_slip,
            self._load,
            np.abs(self._rate * self._wheels.radius),
            self._local_slope * sense,
            self._passes,
        )
        return self._contact.forces(sunk)

    # One step -----------------------------------------------------------------------------------

    def _advance(self, command: Command, dt: float) -> None:
        wheels = self._wheels
        self._look_at_ground()
        if self._steering.any:
            self._steering.follow(command, dt)
            self._lever = self._steering.along_wheels(self._body_lever)
        hubs = self._steering.commanded_hubs(command)
        commanded = self._steering.along_wheels(hubs)[0] / wheels.slip_radius
        self._drives.command(commanded * self.faults.rate_factor, self.faults.torque_factor, dt)
        speeds, rate = self._speeds, self._rate
        # Far from the solution the linear model is poor: a move is bounded, and more so after each
        # that goes back, else it could go to and fro across the steep part of a shear curve.
        farthest, before = FARTHEST, np.zeros(3 * len(rate))
        for _ in range(MOST_ITERATIONS):
            speeds, rate, forces, move = self._newton_step(speeds, rate, dt, farthest)
            if np.abs(move).max() < TOLERANCE:
                break
            if move @ before < 0.0:
                farthest *= 0.5
            before = move
        self._forces = forces
        hub_speed = np.einsum('ijn,j->in', self._lever, speeds)
        forward, lateral = hub_speed
        shear, _ = self._memory.trial_shear(forward, lateral, rate, dt)
        self._drives.finish(rate, dt)
        self._memory.advance(forward, lateral, rate, shear, forces.soil, dt)
        self._speeds, self._rate = speeds, rate
        self._move(dt)
        self._balance(dt)
        self.time += dt

    def _newton_step(
        self, speeds: FloatArray, rate: FloatArray, dt: float, farthest: float
    ) -> tuple[FloatArray, FloatArray, WheelForces, FloatArray]:
        """Return better speeds and rates for the end of the step, and forces there.

        Beside them, the changes of hub and rim speeds [m/s] that the linear model asks for; no
        further than ``farthest`` is gone.
        """
        radius = self._wheels.slip_radius
        hub_speed = np.einsum('ijn,j->in', self._lever, speeds)
        # The forces here, and with one more step in hub speed along, across, and wheel rate.
        hubs = np.repeat(hub_speed[:, None], 4, axis=1)
        hubs[0, 1] += TINY
        hubs[1, 2] += TINY
        rates = np.repeat(rate[None], 4, axis=0)
        rates[3] += TINY / radius
        forces = self._wheel_forces(hubs, rates, dt)
        force = np.stack([forces.pull, forces.side_force])  # (2, 4, n)
        by_hub = (force[:, 1:3] - force[:, :1]) / TINY
        by_rate = (force[:, 3] - force[:, 0]) * radius / TINY
        torque = forces.torque[0]
        torque_by_hub = (forces.torque[1:3] - torque) / TINY
        torque_by_rate = (forces.torque[3] - torque) * radius / TINY

        # Wheel rates: inertia and drive against the soil; then rate = free + follow . hub change.
        drive, drive_by_rate = self._drives.torque(rate)
        inertia = self._drives.inertia / dt
        stiffness = np.maximum(inertia - drive_by_rate + torque_by_rate, 0.1 * inertia)
        free = (drive - torque - inertia * (rate - self._rate)) / stiffness
        follow = -torque_by_hub / stiffness

        now = force[:, 0] + by_rate * free
        now[0] -= self._load * self._tilt
        weight = self._mass * self._gravity
        body = np.einsum('ijn,in->j', self._lever, now)
        body[:2] -= weight * self._sine
        forward, lateral, turning = speeds
        body[:2] -= self._mass * turning * np.array([-lateral, forward])
        slopes = by_hub + by_rate[:, None] * follow  # (2 forces, 2 hub speeds, n)
        by_speed = np.einsum('ijn,ikn,kln->jl', self._lever, slopes, self._lever)
        residual = self._inertias * (speeds - self._speeds) / dt - body
        change = np.linalg.solve(np.diag(self._inertias / dt) - by_speed, -residual)
        hub_change = np.einsum('ijn,j->in', self._lever, change)
        rate_change = free + (follow * hub_change).sum(axis=0)
        move = np.append(hub_change, rate_change * radius)
        bound = farthest * max(1.0, abs(float(forward)))
        part = min(1.0, bound / max(float(np.abs(move).max()), 1e-12))
        next_rate = self._drives.next_trial(rate, rate + part * rate_change)
        moved = np.concatenate([part * hub_change, (next_rate - rate)[None]])
        end = WheelForces(
            pull=force[0, 0] + (by_hub[0] * moved[:2]).sum(axis=0) + by_rate[0] * moved[2],
            side_force=force[1, 0] + (by_hub[1] * moved[:2]).sum(axis=0) + by_rate[1] * moved[2],
            torque=torque + (torque_by_hub * moved[:2]).sum(axis=0) + torque_by_rate * moved[2],
            soil=forces.soil.first(),
        )
        return speeds + part * change, next_rate, end, move

    def _move(self, dt: float) -> None:
        forward, lateral, turning = self._speeds
        heading = self._position[2] + 0.5 * turning * dt
        cosine, sine = np.cos(heading), np.sin(heading)
        self._position = self._position + dt * np.array(
            [forward * cosine - lateral * sine, forward * sine + lateral * cosine, turning]
        )
        self._angle = self._angle + self._rate * dt
        self._straight += abs(float(forward)) * dt

    def _balance(self, dt: float) -> None:
        """Bring specific force, attitude and wheel loads up to the forces of this step."""
        self._carried = self._load
        up = self._gravity * np.sqrt(max(1.0 - float(self._sine @ self._sine), 0.01))
        on_wheels = np.stack([self._forces.pull, self._forces.side_force])
        on_body = np.einsum('ijn,in->j', self._lever, on_wheels)
        push = on_body[0] - (self._load * self._tilt).sum()
        force = np.array([push / self._mass, on_body[1] / self._mass, up])  # along the ground
        loads = self._static_loads(force)
        self._load = self._load + (loads - self._load) * -np.expm1(-dt / LOAD_TIME)
        chassis = self._sine - self._plane @ self._memory.sinkage
        attitude = np.arcsin(np.clip(chassis, -0.9, 0.9))
        rates = (attitude - self._attitude) / dt
        self._angular_rate = np.array([rates[1], -rates[0], self._speeds[2]])
        self._attitude = attitude
        # Ruts of unequal depth tilt the chassis against the ground.
        pitch, roll = attitude - np.arcsin(self._sine)
        self._specific_force = force + np.array(
            [force[2] * pitch, force[2] * roll, -force[0] * pitch - force[1] * roll]
        )

    def _static_loads(self, force: FloatArray) -> FloatArray:
        cosine = self._lever[0, 0]  # of the steering angle
        moment = (self._forces.torque - self._forces.pull * self._wheels.radius) * cosine
        pull = self._forces.pull * cosine
        loads = self._suspension.normal_loads(self._mass, force, pull, moment)
        loads = loads * self.faults.load_factor
        return loads * self._mass * force[2] / loads.sum()

    def _set_down(self) -> None:
        """Put the rover down at rest, wheels sunk until they carry it, slope held by shear."""
        zero = np.zeros(self._wheels.count)
        self._look_at_ground()
        up = self._gravity * np.sqrt(1.0 - self._sine @ self._sine)
        force = np.array([*(self._gravity * self._sine), up])
        pull = np.full_like(zero, self._mass * force[0] / zero.size)
        self._load = self._suspension.normal_loads(self._mass, force, pull, zero)
        still = Shear(zero, zero)
        for _ in range(100):
            if self._memory.settle(self._soil_forces(still, zero + 1.0)) < 1e-7:
                break
        for _ in range(80):
            self._advance(Command(0.0), LONGEST_STEP)
            if (
                np.abs(self._speeds).max() < 1e-7
                and np.abs(self._load - self._carried).max() < 0.01
            ):
                break
        self.time = 0.0
        self._position = np.zeros(3)
        self._straight = 0.0
        self._angle = np.zeros_like(zero)
