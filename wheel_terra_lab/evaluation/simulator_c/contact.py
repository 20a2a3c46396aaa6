# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Forces between wheels and ground, integrated over the nodes of each contact.

Angles are measured at the hub from the normal of the ground, positive towards +x. Each node carries
how far the shear strength is mobilised, along and across (Dahl's elastoplastic law, which gives
Janosi's curve in steady sliding), and the length that it has slid; the wheel carries both through
the contact as it turns. Arrays are (n,) over wheels, (n, m) over nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_c.ground import Ground, bearing_terms, pressure

FloatArray = NDArray[np.float64]

NODES = 32
SMALL = 1e-9
_DEEPEST = 0.9  # sinkage over radius at which the hull would lie on the ground [-]
_FIRM_DEPTH = 0.5  # over the radius, at which the subsoil doubles the bearing pressure [-]
_LEAST_PENETRATION = 2e-5  # over the radius [-]
_TOUCH = 100.0  # pressure at which cohesion acts in full [Pa]
_DIG_BAND = 0.03  # soil that a smooth rim carries off, over its radius [-]
_DEEPEST_DIG = 0.45  # over the radius: then as much slides back as is thrown out [-]
_LOOSE = 0.4  # bearing strength of thrown-up soil over that of the ground [-]
_APPROACH = 0.6  # share of the way to the sinkage that bears the load, per step [-]
_FASTEST = 0.02  # greatest change of sinkage per step, over the radius [-]


@dataclass(frozen=True)
class Rims:
    """Geometry of the wheels, (n,) each."""

    radius: FloatArray  # [m]
    width: FloatArray  # [m]
    lug_height: FloatArray  # [m]
    shear_radius: FloatArray  # at which the soil shears, between rim and tips [m]
    grip: FloatArray  # friction of soil on the rim over that of soil on soil [-]


@dataclass(frozen=True)
class Forces:
    """Of the ground on the wheels, (n,) each; and how they change with the speed of sliding."""

    pull: FloatArray  # along the wheel, positive forward [N]
    side: FloatArray  # positive left [N]
    normal: FloatArray  # [N]
    torque: FloatArray  # that the ground takes from the drive [N m]
    traction_rate: FloatArray  # growth of pull with the speed of sliding [N s/m]
    side_rate: FloatArray


class Contacts:
    """State of the contacts of all wheels."""

    def __init__(self, rims: Rims, gravity: float, nodes: int = NODES) -> None:
        n = len(rims.radius)
        self.rims, self.gravity = rims, gravity
        self.along = np.zeros((n, nodes))  # mobilised share of the strength, along x
        self.across = np.zeros((n, nodes))
        self.slid = np.zeros((n, nodes))  # [m]
        self.sinkage = 0.02 * rims.radius
        self.rut = np.zeros(n)  # depth of the surface that the wheel meets [m]
        self.dug = np.zeros(n)  # soil thrown out from below the wheel [m]
        self.heap = np.zeros(n)  # height of the soil heaped up behind [m]
        self.heading = np.ones(n)  # 1 forward, -1 backward; in between while it turns round
        self.lug_ripple = np.ones(n)  # of the friction, as lugs come and go [-]
        self._place = (np.arange(nodes) + 0.5) / nodes
        self._front = np.arccos(1.0 - self.sinkage / rims.radius)
        self._low, self._high = np.zeros(n), self._front
        self._length = rims.radius * self._front  # of the contact [m]
        self._rebound = np.zeros(n)

    @property
    def bottom(self) -> FloatArray:
        """Depth of the rut that the wheels leave behind [m]."""
        return self.sinkage - self._rebound

    def lead(self) -> FloatArray:
        """Return how far ahead of the hub the wheel meets the ground [m], negative in reverse."""
        return np.asarray(self.heading * self.rims.radius * np.sin(self._front))

    def travel(
        self, ground: Ground, dt: float, rate: FloatArray, speed: FloatArray, rut_ahead: FloatArray
    ) -> None:
        """Let ruts, excavation and heap follow rim and ground speed over a step."""
        rims = self.rims
        rim_speed = rims.shear_radius * rate
        moved = np.abs(speed) * dt / self._length
        total = (np.abs(speed) + np.abs(rim_speed)) * dt / self._length
        towards = np.clip((speed + rim_speed) / 1e-3, -1.0, 1.0)
        self.heading += -np.expm1(-0.5 * total) * (towards - self.heading)
        self.rut += -np.expm1(-moved) * (rut_ahead - self.rut)
        self.rut = np.minimum(self.rut, self.sinkage)
        carried = (rims.lug_height + _DIG_BAND * rims.radius) * (
            np.abs(rim_speed - speed) * dt / self._length
        )
        most = _DEEPEST_DIG * rims.radius
        self.dug = (self.dug + ground.digging * carried) / (
            1.0 + moved + ground.digging * carried / most
        )
        most = np.maximum(self.sinkage, SMALL)
        self.heap = (self.heap + ground.heave * carried) / (
            1.0 + moved + ground.heave * carried / most
        )

    def step(
        self,
        ground: Ground,
        dt: float,
        rate: FloatArray,
        speed: FloatArray,
        side_speed: FloatArray,
    ) -> tuple[Forces, _Shear]:
        """Return the forces at these speeds; the shear state of the step is kept by `keep`."""
        theta, width_of_node = self._nodes(ground)
        sigma = self._normal_stress(ground, theta)
        shear = self._carried(ground, theta, dt, rate, speed)
        strength = self._strength(ground, sigma, shear.slid)
        return self._integrate(ground, theta, width_of_node, sigma, strength, shear, side_speed)

    def keep(self, shear: _Shear, rate: FloatArray, speed: FloatArray, side: FloatArray) -> None:
        """Take the speeds that the step ended with into the shear state."""
        slide = self.rims.shear_radius * rate
        slide_x = slide[:, None] - speed[:, None] * shear.cosine
        self.along, self.across = shear.mobilised(slide_x, -side[:, None])
        self.slid = shear.slid + np.hypot(slide_x, side[:, None]) * shear.time

    def settle(self, load: FloatArray, normal: FloatArray, spring: FloatArray | float) -> None:
        """Move the wheels towards the depth at which the ground bears their loads."""
        radius = self.rims.radius
        # The front of the contact bears also where the bottom has been dug away.
        penetration = np.maximum(self.sinkage - self.rut - 0.6 * self.dug, 1e-3 * radius)
        stiffness = 1.5 * np.maximum(normal, 0.1 * load) / penetration + spring + SMALL
        change = _APPROACH * (load - normal) / stiffness
        most = _FASTEST * radius
        self.sinkage = np.clip(
            self.sinkage + np.clip(change, -most, most), self.rut - 0.1 * radius, _DEEPEST * radius
        )

    def _nodes(self, ground: Ground) -> tuple[FloatArray, FloatArray]:
        """Set the ends of the contact; return the angles of the nodes and their spacing."""
        radius = self.rims.radius
        least = _LEAST_PENETRATION * radius
        penetration = np.maximum(self.sinkage - self.rut, least)
        self._front = np.arccos(1.0 - np.minimum(penetration / radius, 1.0))
        self._rebound = np.maximum(penetration - self.dug, least) / ground.rebound
        behind = self._rebound + self.heap
        back = np.arccos(1.0 - np.minimum(behind / radius, 1.0))
        ahead = 0.5 * (1.0 + self.heading)
        high = ahead * self._front + (1.0 - ahead) * back
        low = -(ahead * back + (1.0 - ahead) * self._front)
        self._low, self._high = low, high
        self._length = radius * (high - low)
        spacing = (high - low) / len(self._place)
        return low[:, None] + (high - low)[:, None] * self._place, spacing

    def _normal_stress(self, ground: Ground, theta: FloatArray) -> FloatArray:
        """Return the radial pressure at the nodes, before shear takes from it."""
        radius = self.rims.radius[:, None]
        surface, growth, settling = bearing_terms(ground, self.rims.width, self.gravity)
        terms = surface[:, None], growth[:, None], settling[:, None]
        rut, dug = self.rut[:, None], self.dug[:, None]
        raised = radius * (1.0 - np.cos(theta))  # of the node above the bottom
        depth = self.sinkage[:, None] - rut
        deepest = np.maximum(depth - dug, 0.0)
        used = np.maximum(rut, 0.1 * terms[2])

        def virgin(depth: FloatArray) -> FloatArray:
            return pressure(terms, depth) * (1.0 + (depth / (_FIRM_DEPTH * radius)) ** 3)

        def loaded(penetration: FloatArray) -> FloatArray:
            return np.minimum(reload * penetration, virgin(rut + penetration))

        reload = np.asarray(ground.rebound)[:, None] * virgin(used) / used

        cut = np.clip(1.0 - np.abs(theta) / np.maximum(self._front, SMALL)[:, None], 0.0, 1.0)
        front = loaded(np.maximum(depth - raised - dug * cut, 0.0))
        bottom = loaded(deepest)
        rebound = self._rebound[:, None]
        back = bottom * np.maximum(1.0 - raised / rebound, 0.0)
        heaped = np.clip(rebound + self.heap[:, None] - raised, 0.0, np.minimum(raised, deepest))
        back = back + _LOOSE * terms[1] * heaped
        ahead = 0.5 * (1.0 + self.heading[:, None] * np.sign(theta))
        return np.asarray(ahead * front + (1.0 - ahead) * back)

    def _carried(
        self, ground: Ground, theta: FloatArray, dt: float, rate: FloatArray, speed: FloatArray
    ) -> _Shear:
        """Return the shear state after the wheel has carried it through the contact."""
        count = theta.shape[1]
        span = np.maximum(self._high - self._low, SMALL)
        shift = rate * dt / span * count  # in nodes; material comes from higher angles
        source = np.arange(count) + shift[:, None]
        inside = np.clip(source, 0.0, count - 1.0)
        lower = np.minimum(inside.astype(int), count - 2)
        part = inside - lower
        # Beyond the ends the soil is fresh, half a node from the last one.
        fresh = np.clip(np.where(source > inside, source - inside, inside - source) * 2.0, 0.0, 1.0)
        rows = np.arange(len(theta))[:, None]

        def moved(values: FloatArray) -> FloatArray:
            found = values[rows, lower] * (1.0 - part) + values[rows, lower + 1] * part
            return np.asarray(found * (1.0 - fresh))

        entry = np.where(rate >= 0.0, self._high, self._low)[:, None]
        since_entry = np.abs(entry - theta) / np.maximum(np.abs(rate), SMALL)[:, None]
        return _Shear(
            moved(self.along),
            moved(self.across),
            moved(self.slid),
            np.minimum(dt, since_entry),
            np.asarray(ground.shear_length)[:, None],
            np.cos(theta),
            (self.rims.shear_radius * rate)[:, None] - speed[:, None] * np.cos(theta),
        )

    def _strength(self, ground: Ground, sigma: FloatArray, slid: FloatArray) -> FloatArray:
        """Return the shear strength at the nodes; `sigma` loses what shear takes from bearing."""
        length = np.asarray(ground.shear_length)[:, None]
        lost = -np.asarray(ground.softening)[:, None] * np.expm1(-slid / (3.0 * length))
        sigma *= 1.0 - lost
        friction = (np.asarray(ground.friction) * self.rims.grip * self.lug_ripple)[:, None]
        full = np.asarray(ground.cohesion)[:, None] * sigma / (sigma + _TOUCH) + friction * sigma
        far = slid / (3.0 * length)
        residual = np.asarray(ground.residual)[:, None]
        return np.asarray(full * (residual + (1.0 - residual) * (1.0 + far) * np.exp(-far)))

    def _integrate(
        self,
        ground: Ground,
        theta: FloatArray,
        spacing: FloatArray,
        sigma: FloatArray,
        strength: FloatArray,
        shear: _Shear,
        side_speed: FloatArray,
    ) -> tuple[Forces, _Shear]:
        rims = self.rims
        slide_y = np.broadcast_to(-side_speed[:, None], theta.shape)
        along, across = shear.mobilised(shear.slide, slide_y)
        area = rims.width * spacing
        sine, cosine = np.sin(theta), shear.cosine
        tau = strength * along
        lever = rims.shear_radius
        pull = area * (lever * (tau * cosine).sum(1) - rims.radius * (sigma * sine).sum(1))
        normal = area * (rims.radius * (sigma * cosine).sum(1) + lever * (tau * sine).sum(1))
        growth = shear.time / (shear.length + shear.time * np.hypot(shear.slide, slide_y))
        rate_x = strength * growth * np.maximum(1.0 - along * np.sign(shear.slide), 0.0)
        rate_y = strength * growth * np.maximum(1.0 - across * np.sign(slide_y), 0.0)
        ploughed, side = self._ploughing(ground, side_speed)
        return (
            Forces(
                pull=pull - ploughed,
                side=area * lever * (strength * across).sum(1) + side,
                normal=normal,
                torque=area * lever**2 * tau.sum(1),
                traction_rate=area * lever * rate_x.sum(1),
                side_rate=area * lever * rate_y.sum(1),
            ),
            shear,
        )

    def _ploughing(self, ground: Ground, side_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the passive earth pressure that is ploughed: ahead, and beside the wheel."""
        tangent = np.asarray(ground.friction)
        passive = (tangent + np.hypot(1.0, tangent)) ** 2  # tan^2(pi/4 + phi/2)
        depth = np.maximum(self.sinkage - self.rut, 0.0)
        per_width = 0.5 * np.asarray(ground.density) * self.gravity * passive * depth**2
        per_width = per_width + 2.0 * np.asarray(ground.cohesion) * np.sqrt(passive) * depth
        per_width = np.asarray(ground.ploughing) * per_width
        share = np.clip(depth / (0.1 * self.rims.radius), 0.0, 1.0) * self.heading
        side = -per_width * self._length * np.tanh(side_speed / 0.005)
        return per_width * self.rims.width * share, side


@dataclass(frozen=True)
class _Shear:
    """Shear state of a step before its own sliding, (n, m)."""

    along: FloatArray
    across: FloatArray
    slid: FloatArray
    time: FloatArray  # that the node slid within the step [s]
    length: FloatArray  # K [m]
    cosine: FloatArray
    slide: FloatArray  # speed of the rim over the soil along x [m/s]

    def mobilised(self, slide_x: FloatArray, slide_y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mobilised shares after the step, along and across (implicit in the step)."""
        share = self.time / self.length
        whole = 1.0 + share * np.hypot(slide_x, slide_y)
        return (self.along + share * slide_x) / whole, (self.across + share * slide_y) / whole
