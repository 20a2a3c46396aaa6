# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Motion of a rover over the land: rigid body on the slope, drives, suspension, contacts.

Speeds of body and wheels are advanced by one linearly implicit step for all of them, so that stiff
ground (a rubber tyre on asphalt) needs no shorter steps than sand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_c.contact import Contacts, Forces
from wheel_terra_lab.evaluation.simulator_c.ground import Land
from wheel_terra_lab.evaluation.simulator_c.rover import Rover, Suspension

FloatArray = NDArray[np.float64]

STEP = 0.01
"""Of the integration [s]."""
SETTLING_TIME = 1.5  # at rest before a drive begins [s]
_STEERING_RATE = 0.5  # [rad/s]
_TRAIL = 1.5  # cells behind the hub at which a rut is kept [-]
_LUG_RIPPLE = 0.06  # of the friction from lug to lug [-]


@dataclass
class Command:
    """What the drives are told: wheel rates [rad/s], steering angles [rad], locked wheels."""

    rate: FloatArray
    steering: FloatArray
    locked: NDArray[np.bool_]


@dataclass
class State:
    """The rover at an instant. Arrays (n,) over wheels, speeds in the body frame."""

    time: float
    x: float  # in the world, horizontal [m]
    y: float
    yaw: float
    velocity: FloatArray  # (3,) forward, left [m/s] and yaw rate [rad/s]
    acceleration: FloatArray  # (2,) of the body frame's origin, forward and left [m/s^2]
    pitch: float  # [rad], nose up
    roll: float  # [rad], left side up
    rate: FloatArray  # of the wheels [rad/s]
    steering: FloatArray  # [rad], positive left
    speed: FloatArray  # of each hub along its wheel [m/s]
    pull: FloatArray  # [N]
    side: FloatArray  # [N]
    normal: FloatArray  # [N]
    torque: FloatArray  # ground on wheel [N m]
    motor: FloatArray  # of the drive, at the wheel [N m]
    sinkage: FloatArray  # [m]


Operator = Callable[[State], Command | None]


@dataclass(frozen=True)
class Course:
    """States of a drive, stacked: (k,) and (k, n)."""

    time: FloatArray
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    pitch: FloatArray
    roll: FloatArray
    rate: FloatArray
    steering: FloatArray
    speed: FloatArray
    pull: FloatArray
    side: FloatArray
    normal: FloatArray
    torque: FloatArray
    motor: FloatArray
    sinkage: FloatArray


class Motion:
    """Advances a rover over a land."""

    def __init__(self, rover: Rover, land: Land) -> None:
        n = rover.count
        self.rover, self.land = rover, land
        self.contacts = Contacts(rover.rims, rover.gravity)
        self._suspension = Suspension(rover)
        self._integral = np.zeros(n)
        self._angle = np.linspace(0.0, 1.0, n)  # of the wheels, for the passing of the lugs
        self._forward = np.ones(n)
        self._ripple = np.where(rover.rims.lug_height > 0.0, _LUG_RIPPLE, 0.0)
        self._level: tuple[float, float] = (0.0, 0.0)  # sines of pitch and roll
        self._bogie_pull = np.zeros(2)
        zero = np.zeros(n)
        full = np.full(n, rover.mean_load)
        self.state = State(
            0.0, 0.0, 0.0, 0.0, np.zeros(3), np.zeros(2), 0.0, 0.0,
            zero, zero.copy(), zero.copy(), zero.copy(), zero.copy(), full, zero.copy(),
            zero.copy(), self.contacts.sinkage.copy(),
        )  # fmt: skip
        self._start_level()

    def _start_level(self) -> None:
        """Let the wheels sink in at rest, all motion frozen at first."""
        zero = np.zeros(self.rover.count)
        rest = Command(zero, zero, zero == 0.0)
        for _ in range(round(SETTLING_TIME / STEP)):
            self.step(rest)
        self.state.time = 0.0

    def step(self, command: Command) -> State:
        """Advance by one step and return the new state."""
        rover, contacts, state = self.rover, self.contacts, self.state
        self._steer(command.steering)
        along, across = self._directions(state.steering)
        speed, side_speed = along @ state.velocity, across @ state.velocity
        place = self._places(along)
        gravity = self._gravity()
        force = rover.mass * np.append(gravity[:2] - state.acceleration, gravity[2])
        heights = self.land.height(*place)
        n = rover.count
        loads, self._level = self._suspension.loads(
            heights[:n] - contacts.sinkage,
            force,
            self._bogie_pull,
            along[:, 0] * (state.torque - state.pull * rover.rims.radius),
        )
        x, y = place[0][:n], place[1][:n]
        lead, heading = contacts.lead(), state.yaw + state.steering
        rut = self.land.rut(x + lead * np.cos(heading), y + lead * np.sin(heading))
        ground = self.land.at(x, y)
        contacts.lug_ripple = 1.0 + self._ripple * np.sin(rover.lug_count * self._angle)
        contacts.travel(ground, STEP, state.rate, speed, rut)
        forces, shear = contacts.step(ground, STEP, state.rate, speed, side_speed)
        rise = np.clip((heights[n : 2 * n] - heights[2 * n :]) / rover.rims.radius, -0.9, 0.9)
        chassis = along[:, 0] * self._level[0] + along[:, 1] * self._level[1]  # sine of its slope
        tilt = np.arcsin(rise) - np.arcsin(np.clip(chassis, -0.9, 0.9))
        new = self._advance(command, along, across, forces, tilt, gravity)
        contacts.keep(shear, new.rate, new.speed, across @ new.velocity)
        contacts.settle(loads, forces.normal, rover.spring)
        self._leave_ruts(x, y, heading)
        new.sinkage = contacts.sinkage.copy()
        self.state = new
        return new

    def _leave_ruts(self, x: FloatArray, y: FloatArray, heading: FloatArray) -> None:
        """Keep the ruts behind the wheels; a wheel that turns round meets its own at once."""
        forward, cell = np.sign(self.contacts.heading), self.land.cell
        behind = -_TRAIL * cell * forward
        c, s, depth = np.cos(heading), np.sin(heading), self.contacts.bottom
        self.land.leave_rut(x + behind * c, y + behind * s, depth)
        turned = forward != self._forward
        for cells in (0.0, 1.0, _TRAIL) if turned.any() else ():
            back = (cells * cell * forward)[turned]
            at = x[turned] + back * c[turned], y[turned] + back * s[turned]
            self.land.leave_rut(*at, depth[turned])
        self._forward = forward

    def _steer(self, target: FloatArray) -> None:
        most = _STEERING_RATE * STEP
        self.state.steering = self.state.steering + np.clip(
            target - self.state.steering, -most, most
        )

    def _directions(self, steering: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (n, 3): what the body's speeds give along and across each wheel."""
        c, s, x, y = np.cos(steering), np.sin(steering), self.rover.x, self.rover.y
        return np.stack([c, s, x * s - y * c], axis=1), np.stack([-s, c, x * c + y * s], axis=1)

    def _places(self, along: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (3n,) places of the hubs, and half a radius ahead of and behind them."""
        state, half = self.state, 0.5 * self.rover.rims.radius
        cos_pitch, cos_roll = np.cos(state.pitch), np.cos(state.roll)
        ahead = half * along[:, 0], half * along[:, 1]
        bx = cos_pitch * np.concatenate(
            [self.rover.x, self.rover.x + ahead[0], self.rover.x - ahead[0]]
        )
        by = cos_roll * np.concatenate(
            [self.rover.y, self.rover.y + ahead[1], self.rover.y - ahead[1]]
        )
        c, s = np.cos(state.yaw), np.sin(state.yaw)
        return state.x + bx * c - by * s, state.y + bx * s + by * c

    def _gravity(self) -> FloatArray:
        """Return gravity in the body frame: forward, left, down [m/s^2]."""
        state, g = self.state, self.rover.gravity
        return np.array(
            [
                -g * np.sin(state.pitch),
                -g * np.sin(state.roll) * np.cos(state.pitch),
                g * np.cos(state.pitch) * np.cos(state.roll),
            ]
        )

    def _advance(
        self,
        command: Command,
        along: FloatArray,
        across: FloatArray,
        forces: Forces,
        tilt: FloatArray,
        gravity: FloatArray,
    ) -> State:
        """Return the state after the step: speeds of body and wheels solved together."""
        rover, state = self.rover, self.state
        vx, vy, yaw_rate = state.velocity
        motor, motor_gain = self._motors(command.rate)
        lever, inertia = rover.rims.shear_radius, rover.motors.inertia / STEP
        g = forces.traction_rate
        # Wheels: inertia dw = motor - torque - g lever (lever dw - dv), dw = own + share dv.
        whole = inertia + motor_gain + g * lever**2
        own, share = (motor - forces.torque) / whole, g * lever / whole
        own = np.where(command.locked, -state.rate, own)
        share = np.where(command.locked, 0.0, share)
        pull = forces.pull * np.cos(tilt) - forces.normal * np.sin(tilt) + g * lever * own
        mass = np.array([rover.mass, rover.mass, rover.yaw_inertia])
        push = along.T @ pull + across.T @ forces.side
        push[:2] += rover.mass * (gravity[:2] + yaw_rate * np.array([vy, -vx]))
        resisting = (along * (g * (1.0 - lever * share))[:, None]).T @ along
        resisting += (across * forces.side_rate[:, None]).T @ across
        change = np.linalg.solve(np.diag(mass / STEP) + resisting, push)
        hub, sideways = along @ change, across @ change
        turned = own + share * hub
        sliding = g * (lever * turned - hub)
        velocity = state.velocity + change
        rate = state.rate + turned
        self._integrate_control(command.rate, rate)
        self._angle += rate * STEP
        pulls = forces.pull + sliding
        if rover.family.suspension == 'rocker_bogie':
            self._bogie_pull = np.array([pulls[2] + pulls[4], pulls[3] + pulls[5]])
        c, s = np.cos(state.yaw), np.sin(state.yaw)
        flat = np.cos(state.pitch), np.cos(state.roll)
        return State(
            time=state.time + STEP,
            x=state.x + STEP * (velocity[0] * c * flat[0] - velocity[1] * s * flat[1]),
            y=state.y + STEP * (velocity[0] * s * flat[0] + velocity[1] * c * flat[1]),
            yaw=state.yaw + STEP * velocity[2],
            velocity=velocity,
            acceleration=change[:2] / STEP - yaw_rate * np.array([vy, -vx]),
            pitch=float(np.arcsin(np.clip(self._level[0], -0.9, 0.9))),
            roll=float(np.arcsin(np.clip(self._level[1], -0.9, 0.9))),
            rate=rate,
            steering=state.steering,
            speed=along @ velocity,
            pull=pulls,
            side=forces.side - forces.side_rate * sideways,
            normal=forces.normal,
            torque=forces.torque + sliding * lever,
            motor=np.where(command.locked, forces.torque, motor - motor_gain * turned),
            sinkage=self.contacts.sinkage,
        )

    def _motors(self, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return torques of the drives and how they fall with the rate (0 at the limit)."""
        motors, rate = self.rover.motors, self.state.rate
        torque = motors.gain * (wanted - rate) + motors.integral * self._integral
        limit = motors.limit * np.clip(1.0 - np.abs(rate) / motors.no_load_rate, 0.05, 1.0)
        free = np.abs(torque) < limit
        return np.clip(torque, -limit, limit), np.where(free, motors.gain, 0.0)

    def _integrate_control(self, wanted: FloatArray, rate: FloatArray) -> None:
        motors = self.rover.motors
        most = motors.limit / motors.integral
        self._integral = np.clip(self._integral + (wanted - rate) * STEP, -most, most)


def drive(motion: Motion, operator: Operator, duration: float) -> Course:
    """Let an operator drive until he ends it, or for a time [s]."""
    states: list[State] = [motion.state]
    for _ in range(round(duration / STEP)):
        command = operator(motion.state)
        if command is None:
            break
        states.append(motion.step(command))
    return Course(
        **{f.name: np.array([getattr(s, f.name) for s in states]) for f in fields(Course)}
    )
