# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The closed form of the contact: each side of the peak stress as one force at its centroid.

Area and centroid of the normal stress follow from its exponent, the mobilised share of the shear
strength from the shear displacement at that centroid, that of cohesion from the one at the middle
of the side (docs/models). Nothing is fitted.

Where the rim skids, shear displacement turns back inside the contact and no one place stands for
a side: there four nodes on each side take the place of the centroid, and where the wheel slides
sideways, where the displacement turns its direction.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.maths import Maths, Quantity

# Skid beyond pure rolling, v/(w R) - 1, from which and over which the nodes take over from the
# centroid; below the first, one place per side is within 1.3 % of the load.
_TAKE_OVER_AT, _TAKE_OVER = 0.07, 0.1
# Lateral speed v_y/(w R) over which they do where the wheel slides sideways.
_SIDEWAYS_TAKE_OVER = 0.03
_NO_DISPLACEMENT = 1e-300  # over K [-]; keeps the direction of none finite
# Gauss-Legendre nodes and weights on (0, 1), squared towards 0, where the stress starts like v^N.
_NODES = tuple(
    (0.25 * (x + 1.0) ** 2, 0.5 * w * (x + 1.0))
    for x, w in zip(*(part.tolist() for part in np.polynomial.legendre.leggauss(4)), strict=True)
)


def branch_moments(exponent: Quantity, skew: Quantity) -> tuple[Any, Any]:
    """Area and centroid of the stress on one side of its peak, both as shares.

    For small angles the stress is [v (1 + q (1 - v))]^N of its peak, with v = 0 at the edge of
    the contact, 1 at the peak, and q = (t1 - tm)/(t1 + tm); its moments, as a series in q
    (exact for N = 1).

    Parameters
    ----------
    exponent, skew : float or array_like
        N and q.

    Returns
    -------
    area : float or numpy.ndarray
        Integral over v.
    centroid : float or numpy.ndarray
        Mean v; 2/3 for a triangle.
    """
    n, q = exponent, skew
    area = (1.0 + n * q / (n + 2.0) * (1.0 + (n - 1.0) * q / (n + 3.0))) / (n + 1.0)
    first = (1.0 + n * q / (n + 3.0) * (1.0 + (n - 1.0) * q / (n + 4.0))) / (n + 2.0)
    return area, first / area


def moment_spread(exponent: Quantity) -> Any:
    """Variance of v under the stress v^N: (N + 1)/((N + 2)^2 (N + 3))."""
    second = exponent + 2.0
    return (exponent + 1.0) / (second * second * (exponent + 3.0))


class BranchForces:
    """Forces of a contact whose peak and leaving angle are fixed shares of the entrance angle.

    All that does not depend on the entrance angle is prepared once, so that a load balance costs
    little more than sines. Angles below half a turn's quarter are assumed: cosines come from
    sines, cos tm - cos t1 = 2 sin((t1 + tm)/2) sin((t1 - tm)/2).

    Parameters
    ----------
    contact : Contact
        Floats, or arrays of one shape (or shapes that broadcast); its angles are not read.
    peak_share, leaving_share : float or numpy.ndarray
        tm/t1 and t2/t1 [-].
    maths : module or class
        numpy, or ``ScalarMaths`` for floats.
    """

    __slots__ = (
        '_abs', '_arc_front', '_arc_rear', '_cohesion_front', '_cohesion_rear', '_copysign',
        '_drift', '_edge_front', '_edge_rear', '_exponent', '_friction_front', '_friction_rear',
        '_further', '_half', '_maths', '_middle_front', '_middle_rear', '_minimum', '_modulus',
        '_nearer', '_normal_front', '_normal_rear', '_peak', '_place_front', '_place_rear',
        '_rim_front', '_rim_rear', '_roll', '_shear_radius', '_sin', '_skid', '_skidding', '_sqrt',
        '_stress', '_turn', '_turns_back', '_width',
    )  # fmt: skip

    def __init__(
        self,
        contact: Contact[Quantity],
        peak_share: Quantity,
        leaving_share: Quantity,
        maths: Maths = np,
    ) -> None:
        self._maths = maths
        self._sin, self._sqrt = maths.sin, maths.sqrt
        self._abs, self._copysign, self._minimum = maths.abs, maths.copysign, maths.minimum
        self._exponent = n = contact.sinkage_exponent
        front, rear = 1.0 - peak_share, peak_share - leaving_share
        area, centroid = branch_moments(n, front / (1.0 + peak_share))
        spread = 0.5 * moment_spread(n)
        self._place_front = place_front = 1.0 - front * centroid
        self._place_rear = place_rear = leaving_share + rear * centroid
        self._middle_front = 0.5 * (1.0 + peak_share)
        self._middle_rear = 0.5 * (peak_share + leaving_share)
        self._half = 0.5 * front
        r, R = contact.radius, contact.shear_radius
        self._modulus = contact.shear_modulus
        self._shear_radius, self._width = R, contact.width
        self._drift = 0.0 if contact.straight else contact.lateral_ratio / self._modulus
        self.set_speed(contact.velocity_ratio)
        self._turn = turn = R / self._modulus
        self._rim_front, self._rim_rear = turn * (1.0 - place_front), turn * (1.0 - place_rear)
        square_front, square_rear = front * front, rear * rear
        # A branch is an arc: its resultant is a little smaller than the sum of its stresses.
        self._arc_front, self._arc_rear = spread * square_front, spread * square_rear
        self._edge_front, self._edge_rear = square_front / 24.0, square_rear / 24.0
        # Cohesion is spread evenly: a quarter of its mean displacement in front, and by how much it
        # is larger behind, both per displacement at the stress's centroid.
        self._nearer = 0.125 / centroid
        self._further = (place_rear - self._middle_rear) / (1.0 - place_rear)
        self._stress = contact.bearing_modulus * (2.0 * r / contact.reference_depth) ** n
        self._peak = area * self._stress
        self._normal_front, self._normal_rear = r * front, r * rear
        grip, cling = R * contact.tan_friction, R * contact.cohesion
        self._friction_front, self._friction_rear = grip * front, grip * rear
        self._cohesion_front, self._cohesion_rear = cling * front, cling * rear

    def set_speed(self, velocity_ratio: Any) -> None:
        """Change v/w [m]; all else stays as it is."""
        self._roll = velocity_ratio / self._modulus
        skid = velocity_ratio / self._shear_radius - 1.0
        self._turns_back = bool(np.any(skid > 0.0)) if self._maths is np else skid > 0.0
        share = (skid - _TAKE_OVER_AT) / _TAKE_OVER
        if self._sideways:
            side = self._abs(self._drift) * self._modulus / self._shear_radius
            share = self._maths.maximum(share, 0.0) + side / _SIDEWAYS_TAKE_OVER
        if self._maths is np:
            share = np.minimum(np.maximum(share, 0.0), 1.0)
            self._skidding = bool(np.any(share > 0.0))
        else:
            share = 0.0 if share <= 0.0 else min(share, 1.0)
            self._skidding = share > 0.0
        self._skid = share * share * (3.0 - 2.0 * share)

    @property
    def _sideways(self) -> bool:
        return not (isinstance(self._drift, float) and self._drift == 0.0)

    @property
    def exponent(self) -> Any:
        """Exponent N of the normal stress [-]; the load grows with about 2 N + 1."""
        return self._exponent

    def take(self, rows: NDArray[np.bool_]) -> BranchForces:
        """Return the form of some of the points (arrays only)."""

        def chosen(value: Any) -> Any:
            return value[rows] if isinstance(value, np.ndarray) and value.size > 1 else value

        part = object.__new__(BranchForces)
        for name in self.__slots__:
            setattr(part, name, chosen(getattr(self, name)))
        return part

    def _mobilised(
        self, angle: Quantity, top: Quantity, front: Quantity, rear: Quantity, cos_rear: Quantity
    ) -> Any:
        """Return mean mobilised shares [-]: friction in front and behind, cohesion likewise.

        Given are the sines of the entrance angle and of the places of both centroids.
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
            sign_front, sign_rear = self._copysign(1.0, x), self._copysign(1.0, y)
            x, y = x * sign_front, y * sign_rear
            wide = self._minimum(wide, 0.25 * y * y)
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

    def load(self, angle: Quantity) -> Any:
        """Vertical force at an entrance angle [N]: as ``forces``, half as long."""
        if self._skidding:
            return self.forces(angle)[0]
        sin, sqrt, square = self._sin, self._sqrt, angle * angle
        top, front, rear = sin(angle), sin(self._place_front * angle), sin(self._place_rear * angle)
        cos_rear = sqrt(1.0 - rear * rear)
        share_front, share_rear, even_front, even_rear = self._mobilised(
            angle, top, front, rear, cos_rear
        )
        middle = sin(self._middle_front * angle)
        peak = self._peak * (middle * sin(self._half * angle)) ** self._exponent
        stressed = (1.0 - self._arc_front * square) * (
            self._normal_front * sqrt(1.0 - front * front)
            + self._friction_front * share_front * front
        ) + (1.0 - self._arc_rear * square) * (
            self._normal_rear * cos_rear + self._friction_rear * share_rear * rear
        )
        sticking = self._cohesion_front * even_front * (1.0 - self._edge_front * square) * middle
        sticking = sticking + self._cohesion_rear * even_rear * (
            1.0 - self._edge_rear * square
        ) * sin(self._middle_rear * angle)
        return self._width * angle * (peak * stressed + sticking)

    def forces(self, angle: Quantity) -> tuple[Any, Any, Any]:
        """Load [N], pull [N] and torque [N m] at an entrance angle."""
        sin, sqrt, square = self._sin, self._sqrt, angle * angle
        top, front, rear = sin(angle), sin(self._place_front * angle), sin(self._place_rear * angle)
        cos_rear = sqrt(1.0 - rear * rear)
        share_front, share_rear, even_front, even_rear = self._mobilised(
            angle, top, front, rear, cos_rear
        )
        middle, mean = sin(self._middle_front * angle), sin(self._middle_rear * angle)
        peak = self._peak * (middle * sin(self._half * angle)) ** self._exponent
        arc_front, arc_rear = 1.0 - self._arc_front * square, 1.0 - self._arc_rear * square
        normal_front = self._normal_front * peak * arc_front
        normal_rear = self._normal_rear * peak * arc_rear
        rub_front = self._friction_front * peak * share_front
        rub_rear = self._friction_rear * peak * share_rear
        friction_front, friction_rear = rub_front * arc_front, rub_rear * arc_rear
        stick_front = self._cohesion_front * even_front
        stick_rear = self._cohesion_rear * even_rear
        cohesion_front = stick_front * (1.0 - self._edge_front * square)
        cohesion_rear = stick_rear * (1.0 - self._edge_rear * square)
        size = self._width * angle
        load = size * (
            normal_front * (cos_front := sqrt(1.0 - front * front))
            + normal_rear * cos_rear
            + friction_front * front
            + friction_rear * rear
            + cohesion_front * middle
            + cohesion_rear * mean
        )
        pull = size * (
            friction_front * cos_front
            + friction_rear * cos_rear
            - normal_front * front
            - normal_rear * rear
            + cohesion_front * sqrt(1.0 - middle * middle)
            + cohesion_rear * sqrt(1.0 - mean * mean)
        )
        torque = size * self._shear_radius * (rub_front + rub_rear + stick_front + stick_rear)
        if self._skidding:
            return self._with_skid(angle, (load, pull, torque))
        return load, pull, torque

    def _with_skid(self, angle: Any, rolling: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
        """Load, pull and torque with the nodes' share where the rim skids."""
        skid = self._skid
        if np.ndim(skid) == 0 or np.shape(skid) != np.shape(angle):
            skidding = self._node_forces(angle)
            load, pull, torque = (
                r + skid * (s - r) for r, s in zip(rolling, skidding[:3], strict=True)
            )
            return load, pull, torque
        rows = skid > 0.0
        skidding = self.take(rows)._node_forces(angle[rows])
        for r, s in zip(rolling, skidding[:3], strict=True):
            r[rows] += skid[rows] * (s - r[rows])
        return rolling

    def lateral_force(self, angle: Quantity) -> Any:
        """Force of the soil under the rim at an entrance angle, positive left [N]."""
        return self._node_forces(angle)[3]

    def _node_forces(self, angle: Quantity) -> tuple[Any, Any, Any, Any]:
        """Load, pull, torque and lateral force from nodes on either side of the peak."""
        maths, sin, sqrt = self._maths, self._sin, self._sqrt
        R, roll = self._shear_radius, self._roll
        front, top = 2.0 * self._half, sin(angle)
        leaving = 2.0 * self._middle_rear - (1.0 - front)
        rear = 1.0 - front - leaving
        load = pull = torque = lateral = 0.0
        sideways = self._sideways
        for place, weight in _NODES:
            ahead = 1.0 - front * place
            depth = sin(0.5 * (1.0 + ahead) * angle) * sin(0.5 * front * place * angle)
            stress = self._stress * depth**self._exponent
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
                cosine = sqrt(1.0 - sine * sine)
                x = R / self._modulus * (1.0 - at) * angle - roll * (top - sine)
                pressed = weight * normal * stress
                strength = weight * (friction * stress + cohesion)
                if sideways:
                    y = self._drift * (1.0 - at) * angle
                    length = maths.maximum(sqrt(x * x + y * y), _NO_DISPLACEMENT)
                    share = -maths.expm1(-length) / length
                    lateral = lateral - strength * share * y
                    sheared = strength * share * x
                else:
                    sheared = strength * self._copysign(-maths.expm1(-self._abs(x)), x)
                load = load + pressed * cosine + sheared * sine
                pull = pull + sheared * cosine - pressed * sine
                torque = torque + sheared
        size = self._width * angle
        return size * load, size * pull, size * R * torque, size * lateral

    def small_angle(self, load: Quantity) -> Any:
        """Entrance angle at which the normal stress alone carries a load, for small angles.

        1 to 5 % from the balance: a start, not an answer.
        """
        n, span = self._exponent, self._normal_front + self._normal_rear
        unit = self._width * span * self._peak * (self._middle_front * self._half) ** n
        return (load / unit) ** (1.0 / (2.0 * n + 1.0))
