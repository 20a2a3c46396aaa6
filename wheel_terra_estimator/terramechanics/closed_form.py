# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed form of the contact: the stress on each side of its peak as one force at its centroid.

Area and centroid of the normal stress follow from its exponent, the mobilised share of the shear
strength from the shear displacement at that centroid, that of cohesion from the one at the middle
of the side (docs/models). Nothing is fitted; over the validation family its error is some ten times
smaller than that of triangular stresses (coefficients A, B, C).

Where the rim skids the shear displacement reverses inside the contact, and where the wheel slides
sideways its direction changes along it, so that one place does not represent a side: there four
nodes on each side replace the centroid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics import stresses
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.terms import PEAK_MARGIN, Terms

# Skid beyond pure rolling, v/(w R) - 1, at which the nodes begin to replace the centroid, and over
# which they do [-]; below the first, one place per side is within 1.3 % of the load.
_BLEND_FROM, _BLEND = 0.07, 0.1
_SIDEWAYS_BLEND = 0.03  # lateral speed v_y/(w R) over which they do [-]
_NO_DISPLACEMENT = 1e-300  # over K [-]; keeps the direction of none finite
_RULE = stresses.gauss_rule(4)
# Nodes and weights on (0, 1), squared towards 0, where the stress starts like v^N.
_NODES = tuple((place * place, 2.0 * weight * place) for place, weight in _RULE)


def branch_moments(exponent: Quantity, skew: Quantity) -> tuple[Quantity, Quantity, Quantity]:
    """Area, centroid and spread of the stress on one side of its peak, as shares.

    For small angles the stress is [v (1 + q (1 - v))]^N of its peak, with v = 0 at the edge of the
    contact, 1 at the peak, and the skew q = (t1 - tm)/(t1 + tm). Its integral over v, the mean of v
    (2/3 for a triangle) as series in q (exact for N = 1), and the variance of v without skew.
    """
    n, q = exponent, skew
    area = (1.0 + n * q / (n + 2.0) * (1.0 + (n - 1.0) * q / (n + 3.0))) / (n + 1.0)
    first = (1.0 + n * q / (n + 3.0) * (1.0 + (n - 1.0) * q / (n + 4.0))) / (n + 2.0)
    second = n + 2.0
    return area, first / area, (n + 1.0) / (second * second * (n + 3.0))


class BranchForces:
    """Forces of a contact whose peak and leaving angle are fixed shares of the entrance angle.

    All that does not depend on the entrance angle is computed once, so that a load balance costs
    little more than sines. Angles below pi/2 are assumed: cosines are computed from sines,
    cos tm - cos t1 = 2 sin((t1 + tm)/2) sin((t1 - tm)/2).

    ``contact``: arrays of one shape, or shapes that broadcast; its angles are not read.
    ``peak_share``, ``leaving_share``: tm/t1 and t2/t1 [-].
    """

    __slots__ = (
        '_arc_front', '_arc_rear', '_bearing_modulus', '_cohesion_front', '_cohesion_rear',
        '_drift', '_edge_front', '_edge_rear', '_exponent', '_friction_front', '_friction_rear',
        '_further', '_half', '_middle_front', '_middle_rear', '_modulus', '_nearer',
        '_normal_front', '_normal_rear', '_place_front', '_place_rear', '_rim_front', '_rim_rear',
        '_roll', '_shape', '_share', '_shear_radius', '_sideways', '_skid', '_skidding', '_turn',
        '_turns_back', '_width',
    )  # fmt: skip

    def __init__(self, contact: Contact, peak_share: Quantity, leaving_share: Quantity) -> None:
        self._exponent = n = contact.sinkage_exponent
        front, rear = 1.0 - peak_share, peak_share - leaving_share
        area, centroid, spread = branch_moments(n, front / (1.0 + peak_share))
        self._place_front = place_front = 1.0 - front * centroid
        self._place_rear = place_rear = leaving_share + rear * centroid
        self._middle_front = 0.5 * (1.0 + peak_share)
        self._middle_rear = 0.5 * (peak_share + leaving_share)
        self._half = 0.5 * front
        r, R = contact.radius, contact.shear_radius
        self._modulus = contact.shear_modulus
        self._shear_radius, self._width = R, contact.width
        self._sideways = not contact.straight
        self._drift = contact.lateral_ratio / self._modulus
        self._roll = contact.velocity_ratio / self._modulus
        self._turn = turn = R / self._modulus
        skid = contact.velocity_ratio / R - 1.0
        self._turns_back = np.count_nonzero(skid > 0.0) > 0
        # Weight of the nodes against the centroids.
        share = np.maximum((skid - _BLEND_FROM) / _BLEND, 0.0)
        if self._sideways:
            share = share + np.abs(contact.lateral_ratio / R) / _SIDEWAYS_BLEND
        share = np.minimum(share, 1.0)
        self._skidding = np.count_nonzero(share > 0.0) > 0
        self._skid = share * share * (3.0 - 2.0 * share)
        self._rim_front, self._rim_rear = turn * (1.0 - place_front), turn * (1.0 - place_rear)
        square_front, square_rear = front * front, rear * rear
        # On an arc the resultant is a little smaller than the sum of the stresses.
        half_spread = 0.5 * spread
        self._arc_front, self._arc_rear = half_spread * square_front, half_spread * square_rear
        self._edge_front, self._edge_rear = square_front / 24.0, square_rear / 24.0
        # The strength by cohesion is uniform, with its centroid at the middle of the side. Factors
        # from the displacement at the centroid of the normal stress to the one there.
        self._nearer = 0.125 / centroid
        self._further = (place_rear - self._middle_rear) / (1.0 - place_rear)
        self._bearing_modulus = contact.bearing_modulus
        self._shape = (2.0 * r / contact.reference_depth) ** n  # of the stress, per bearing modulus
        self._share = area * self._shape
        self._normal_front, self._normal_rear = r * front, r * rear
        friction, cohesion = R * contact.tan_friction, R * contact.cohesion
        self._friction_front, self._friction_rear = friction * front, friction * rear
        self._cohesion_front, self._cohesion_rear = cohesion * front, cohesion * rear

    @property
    def exponent(self) -> Quantity:
        """Exponent N of the normal stress [-]; the load grows with about 2 N + 1."""
        return self._exponent

    def forces(self, angle: Quantity) -> tuple[Quantity, Quantity, Quantity]:
        """Load [N], pull [N] and torque [N m] at an entrance angle."""
        stressed, sticking = self._parts(angle)
        modulus = self._bearing_modulus
        load, pull, torque = (modulus * s + c for s, c in zip(stressed, sticking, strict=True))
        return load, pull, torque

    def balanced(
        self, angle: Quantity, load: Quantity, shift: Quantity = 0.0
    ) -> tuple[Quantity, Quantity]:
        """Pull [N] and torque [N m] at an entrance angle under a normal load [N].

        The bearing modulus is the one that carries the load, not that of the contact. `shift`
        rotates all stresses about the hub, towards the front [rad].
        """
        (lift, push, turn), (lift_c, push_c, turn_c) = self._parts(angle)
        cosine, sine = np.cos(shift), np.sin(shift)
        modulus = (load - lift_c * cosine - push_c * sine) / (lift * cosine + push * sine)
        pull = modulus * (push * cosine - lift * sine) + push_c * cosine - lift_c * sine
        return pull, modulus * turn + turn_c

    def lateral_force(self, angle: Quantity) -> Quantity:
        """Force of the soil under the rim at an entrance angle, positive left [N]."""
        stressed, sticking = self._node_parts(angle)
        return self._bearing_modulus * stressed[3] + sticking[3]

    def _parts(self, angle: Quantity) -> tuple[Sequence[Quantity], Sequence[Quantity]]:
        """Load, pull, torque per bearing modulus of stress and friction; those of cohesion."""
        sin, sqrt, square = np.sin, np.sqrt, angle * angle
        top, front, rear = sin(angle), sin(self._place_front * angle), sin(self._place_rear * angle)
        cos_front, cos_rear = sqrt(1.0 - front * front), sqrt(1.0 - rear * rear)
        share_front, share_rear, even_front, even_rear = self._mobilised(
            angle, top, front, rear, cos_rear
        )
        middle, mean = sin(self._middle_front * angle), sin(self._middle_rear * angle)
        size = self._width * angle
        peak = size * self._share * (middle * sin(self._half * angle)) ** self._exponent
        arc_front = peak * (1.0 - self._arc_front * square)
        arc_rear = peak * (1.0 - self._arc_rear * square)
        rub_front, rub_rear = self._friction_front * share_front, self._friction_rear * share_rear
        normal_front, normal_rear = self._normal_front * arc_front, self._normal_rear * arc_rear
        friction_front, friction_rear = rub_front * arc_front, rub_rear * arc_rear
        stressed = (
            normal_front * cos_front
            + normal_rear * cos_rear
            + friction_front * front
            + friction_rear * rear,
            friction_front * cos_front
            + friction_rear * cos_rear
            - normal_front * front
            - normal_rear * rear,
            self._shear_radius * peak * (rub_front + rub_rear),
        )
        stick_front = size * self._cohesion_front * even_front
        stick_rear = size * self._cohesion_rear * even_rear
        edge_front = stick_front * (1.0 - self._edge_front * square)
        edge_rear = stick_rear * (1.0 - self._edge_rear * square)
        sticking = (
            edge_front * middle + edge_rear * mean,
            edge_front * sqrt(1.0 - middle * middle) + edge_rear * sqrt(1.0 - mean * mean),
            self._shear_radius * (stick_front + stick_rear),
        )
        if not self._skidding:
            return stressed, sticking
        by_nodes = self._node_parts(angle)
        return (
            [s + self._skid * (n - s) for s, n in zip(stressed, by_nodes[0], strict=False)],
            [c + self._skid * (n - c) for c, n in zip(sticking, by_nodes[1], strict=False)],
        )

    def _mobilised(
        self, angle: Quantity, top: Quantity, front: Quantity, rear: Quantity, cos_rear: Quantity
    ) -> tuple[Quantity, Quantity, Quantity, Quantity]:
        """Return mean mobilised shares [-]: friction in front and behind, cohesion likewise.

        `top`, `front`, `rear`: sines of the entrance angle and of the angles of both centroids.
        """
        roll, square = self._roll, angle * angle
        # Mean shares of strength: 1 minus the mean of exp(-j/K) over the side. In front, where j
        # spreads from 0, that is (1 + x/8)^-8, the mean over a gamma distribution whose variance
        # is that of the stress-weighted j; behind, where it spreads less, P = b^16 with
        # b = 1/(1 + y/16), corrected by `wide`, half the variance that j/K really has there: the
        # mean grows by P b/2 per variance. Cohesion: (1 + x/4)^-4 at the middle in front (x from
        # 0, evenly), a step from the centroid to the middle behind.
        x = self._rim_front * angle - roll * (top - front)  # j/K in front, y behind
        y = self._rim_rear * angle - roll * (top - rear)
        pace = self._turn - roll * cos_rear
        wide = self._arc_rear * square * pace * pace
        if self._turns_back:
            sign_front, sign_rear = np.copysign(1.0, x), np.copysign(1.0, y)
            x, y = x * sign_front, y * sign_rear
            wide = np.minimum(wide, 0.25 * y * y)
        base = 1.0 / (1.0 + 0.125 * x)
        base *= base
        base *= base
        share_front = 1.0 - base * base
        base = 1.0 / (1.0 + self._nearer * x)
        base *= base
        even_front = 1.0 - base * base
        base = 1.0 / (1.0 + 0.0625 * y)
        rest = base * base
        rest *= rest
        rest *= rest
        rest *= rest
        rest += rest * base * (wide - 0.03125 * y * y)
        share_rear = 1.0 - rest
        even_rear = 1.0 - rest * (1.0 - self._further * base * y)
        if self._turns_back:
            share_front, even_front = share_front * sign_front, even_front * sign_front
            share_rear, even_rear = share_rear * sign_rear, even_rear * sign_rear
        return share_front, share_rear, even_front, even_rear

    def _node_parts(self, angle: Quantity) -> tuple[Sequence[Quantity], Sequence[Quantity]]:
        """`_parts`, and the lateral force [N], from nodes on either side of the peak."""
        sin = np.sin
        R, roll = self._shear_radius, self._roll
        front, top = 2.0 * self._half, sin(angle)
        leaving = 2.0 * self._middle_rear - (1.0 - front)
        rear = 1.0 - front - leaving
        stressed: list[Quantity] = [0.0] * 4
        sticking: list[Quantity] = [0.0] * 4
        for place, weight in _NODES:
            ahead = 1.0 - front * place
            depth = sin(0.5 * (1.0 + ahead) * angle) * sin(0.5 * front * place * angle)
            stress = self._shape * depth**self._exponent
            for at, normal, friction, cohesion in (
                (ahead, self._normal_front, self._friction_front, self._cohesion_front),
                (
                    leaving + rear * place,
                    self._normal_rear,
                    self._friction_rear,
                    self._cohesion_rear,
                ),
            ):
                sine = sin(at * angle)
                cosine = np.sqrt(1.0 - sine * sine)
                x = R / self._modulus * (1.0 - at) * angle - roll * (top - sine)
                along, across = self._node_shares(x, self._drift * (1.0 - at) * angle)
                pressed = weight * normal * stress
                for sums, strength in (
                    (stressed, weight * friction * stress),
                    (sticking, weight * cohesion),
                ):
                    sheared = strength * along
                    sums[0] = sums[0] + sheared * sine
                    sums[1] = sums[1] + sheared * cosine
                    sums[2] = sums[2] + sheared
                    sums[3] = sums[3] - strength * across
                stressed[0] = stressed[0] + pressed * cosine
                stressed[1] = stressed[1] - pressed * sine
        size = self._width * angle
        factors = size, size, size * R, size
        return (
            [factor * part for factor, part in zip(factors, stressed, strict=True)],
            [factor * part for factor, part in zip(factors, sticking, strict=True)],
        )

    def _node_shares(self, x: Quantity, y: Quantity) -> tuple[Quantity, Quantity]:
        """Mobilised shares along and across the rim [-], for displacements over K."""
        if not self._sideways:
            return np.copysign(-np.expm1(-np.abs(x)), x), 0.0
        length = np.maximum(np.sqrt(x * x + y * y), _NO_DISPLACEMENT)
        share = -np.expm1(-length) / length
        return share * x, share * y

    def small_angle(self, load: Quantity) -> Quantity:
        """Entrance angle at which the normal stress alone carries a load, for small angles [rad].

        A first guess, 1 to 5 % from the balance.
        """
        n, span = self._exponent, self._normal_front + self._normal_rear
        stress = self._bearing_modulus * self._share
        unit = self._width * span * stress * (self._middle_front * self._half) ** n
        return (load / unit) ** (1.0 / (2.0 * n + 1.0))


def coefficients(
    entrance_angle: Quantity, peak_angle: Quantity, leaving_angle: Quantity
) -> tuple[Quantity, Quantity, Quantity]:
    """Integrals A, B, C of a unit triangle times cos t, sin t and 1 over the contact.

    A = (cos tm - cos t2)/(tm - t2) + (cos tm - cos t1)/(t1 - tm), B the same with sines,
    C = (t1 - t2)/2; by parts, exact.
    """
    front, rear = entrance_angle - peak_angle, peak_angle - leaving_angle
    cos_m, sin_m = np.cos(peak_angle), np.sin(peak_angle)
    a = (cos_m - np.cos(leaving_angle)) / rear + (cos_m - np.cos(entrance_angle)) / front
    b = (sin_m - np.sin(leaving_angle)) / rear + (sin_m - np.sin(entrance_angle)) / front
    return a, b, 0.5 * (entrance_angle - leaving_angle)


def peak_stresses(contact: Contact, terms: Terms) -> tuple[Quantity, Quantity]:
    """Normal and shear stress at the peak angle, effects included [Pa]."""
    peak = contact.peak_angle
    contact.angle = peak
    contact.normal_stress = stresses.front_stress(contact, peak)
    terms.apply('on_normal_stress', contact)
    sigma = contact.normal_stress
    return sigma, stresses.shear_stress(contact, peak, sigma)


def forces(contact: Contact, terms: Terms) -> tuple[Quantity, Quantity, Quantity]:
    """Load [N], pull [N] and torque [N m] from branch moments, angles given."""
    t1 = contact.entrance_angle
    form = BranchForces(contact, contact.peak_angle / t1, contact.leaving_angle / t1)
    load, pull, torque = form.forces(t1)
    if terms.stages['on_normal_stress']:
        added = _added_stress_forces(contact, terms)
        load, pull, torque = load + added[0], pull + added[1], torque + added[2]
    return load, pull, torque


def lateral_force(contact: Contact, terms: Terms) -> Quantity:
    """Force of the soil under the rim on the wheel, positive left [N], angles given."""
    t1 = contact.entrance_angle
    if contact.straight:
        return 0.0 * t1
    form = BranchForces(contact, contact.peak_angle / t1, contact.leaving_angle / t1)
    force = form.lateral_force(t1)
    if terms.stages['on_normal_stress']:
        force = force + _added_stress_forces(contact, terms)[3]
    return force


def proportional_forces(contact: Contact) -> BranchForces:
    """Forces for all entrance angles at once, peak and leaving angle in proportion to them.

    They are where no effect moves the angles or adds stress.
    """
    leaving = contact.leaving_ratio
    margin = PEAK_MARGIN * (1.0 - leaving)
    peak = np.minimum(np.maximum(contact.peak_ratio, leaving + margin), 1.0 - margin)
    return BranchForces(contact, peak, leaving)


def _added_stress_forces(contact: Contact, terms: Terms) -> tuple[Quantity, ...]:
    """Load, pull, torque, lateral force of what effects add to the normal stress, friction too."""
    t1, tm, t2 = contact.entrance_angle, contact.peak_angle, contact.leaving_angle
    R = contact.shear_radius
    load: Quantity = 0.0
    pull: Quantity = 0.0
    torque: Quantity = 0.0
    lateral: Quantity = 0.0
    for low, high, behind in ((tm, t1, False), (t2, tm, True)):
        for point, weight in _RULE:
            angle = low + (high - low) * point
            mirror = t1 - (t1 - tm) * (point if behind else 1.0 - point)
            stress = stresses.front_stress(contact, mirror)
            contact.angle, contact.normal_stress = angle, stress
            terms.apply('on_normal_stress', contact)
            normal = (contact.normal_stress - stress) * weight * (high - low)
            along, across = stresses.mobilised_shares(contact, angle)
            friction = normal * contact.tan_friction * R
            shear = friction * along
            normal = normal * contact.radius
            cosine, sine = np.cos(angle), np.sin(angle)
            load = load + normal * cosine + shear * sine
            pull = pull + shear * cosine - normal * sine
            torque = torque + shear
            lateral = lateral + friction * across
    width = contact.width
    return width * load, width * pull, width * R * torque, width * lateral
