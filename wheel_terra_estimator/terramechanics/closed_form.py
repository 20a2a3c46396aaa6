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
from copy import copy

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics import quadrature, stresses
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.terms import PEAK_MARGIN, Terms

# Skid beyond pure rolling, v/(w R) - 1, at which the nodes begin to replace the centroid, and over
# which they do [-]; below the first, one place per side is within 1.3 % of the load.
_BLEND_FROM, _BLEND = 0.07, 0.1
_SIDEWAYS_BLEND = 0.03  # lateral speed v_y/(w R) over which they do [-]
_NODES = 4  # of the quadrature, on each side of the peak
_NO_TERMS = Terms({})


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
        '_contact', '_edge_front', '_edge_rear', '_exponent', '_friction_front', '_friction_rear',
        '_further', '_half', '_leaving_share', '_middle_front', '_middle_rear', '_nearer',
        '_normal_front', '_normal_rear', '_place_front', '_place_rear', '_rim_front', '_rim_rear',
        '_roll', '_share', '_shear_radius', '_skid', '_skidding', '_turn', '_turns_back', '_width',
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
        self._leaving_share = leaving_share
        r, R = contact.radius, contact.shear_radius
        self._shear_radius, self._width = R, contact.width
        self._roll = contact.velocity_ratio / contact.shear_modulus
        self._turn = turn = R / contact.shear_modulus
        skid = contact.velocity_ratio / R - 1.0
        self._turns_back = np.count_nonzero(skid > 0.0) > 0
        # Weight of the nodes against the centroids.
        share = np.maximum((skid - _BLEND_FROM) / _BLEND, 0.0)
        if not contact.straight:
            share = share + np.abs(contact.lateral_ratio / R) / _SIDEWAYS_BLEND
        share = np.minimum(share, 1.0)
        self._skidding = np.count_nonzero(share > 0.0) > 0
        self._skid = share * share * (3.0 - 2.0 * share)
        if self._skidding:
            self._contact = copy(contact)  # for the nodes, per bearing modulus
            self._contact.bearing_modulus = 1.0
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
        self._share = area * (2.0 * r / contact.reference_depth) ** n  # per bearing modulus
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
        """`_parts` from nodes on either side of the peak, those of the quadrature."""
        contact = copy(self._contact)
        contact.entrance_angle = angle
        contact.peak_angle = (1.0 - 2.0 * self._half) * angle
        contact.leaving_angle = self._leaving_share * angle
        weight, cosine, sine = quadrature.stressed(contact, _NO_TERMS, _NODES)
        weight = self._width * weight
        mobilised, _ = stresses.mobilised_shares(contact, sine)
        mobilised = weight * contact.shear_radius * mobilised
        pressed = weight * contact.radius * contact.normal_stress
        rubbed = mobilised * contact.tan_friction * contact.normal_stress
        stuck = mobilised * contact.cohesion
        total = np.add.reduce
        return (
            (
                total(pressed * cosine + rubbed * sine),
                total(rubbed * cosine - pressed * sine),
                contact.shear_radius * total(rubbed),
            ),
            (total(stuck * sine), total(stuck * cosine), contact.shear_radius * total(stuck)),
        )

    def small_angle(self, load: Quantity) -> Quantity:
        """Entrance angle at which the normal stress alone carries a load, for small angles [rad].

        A first guess, 1 to 5 % from the balance.
        """
        n, span = self._exponent, self._normal_front + self._normal_rear
        stress = self._bearing_modulus * self._share
        unit = self._width * span * stress * (self._middle_front * self._half) ** n
        return (load / unit) ** (1.0 / (2.0 * n + 1.0))


def forces(contact: Contact, terms: Terms) -> tuple[Quantity, Quantity, Quantity]:
    """Load [N], pull [N] and torque [N m] from branch moments, angles given.

    What effects add to the normal stress is that of the quadrature.
    """
    t1 = contact.entrance_angle
    load, pull, torque = BranchForces(
        contact, contact.peak_angle / t1, contact.leaving_angle / t1
    ).forces(t1)
    if terms.stages['on_normal_stress']:
        plain, with_them = (quadrature.forces(contact, t) for t in (_NO_TERMS, terms))
        load, pull, torque = (
            own + (more - less)
            for own, more, less in zip((load, pull, torque), with_them, plain, strict=True)
        )
    return load, pull, torque


def lateral_force(contact: Contact, terms: Terms) -> Quantity:
    """Force of the soil under the rim on the wheel, positive left [N], angles given."""
    nodes = None if terms.stages['on_normal_stress'] else _NODES
    return quadrature.lateral_force(contact, terms, nodes)


def proportional_forces(contact: Contact) -> BranchForces:
    """Forces for all entrance angles at once, peak and leaving angle in proportion to them.

    They are where no effect moves the angles or adds stress.
    """
    leaving = contact.leaving_ratio
    margin = PEAK_MARGIN * (1.0 - leaving)
    peak = np.minimum(np.maximum(contact.peak_ratio, leaving + margin), 1.0 - margin)
    return BranchForces(contact, peak, leaving)
