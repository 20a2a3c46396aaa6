# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The state of one wheel-soil contact, on which the terms of the effects act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from wheel_terra_estimator.arrays import Quantity

Q = TypeVar('Q')


@dataclass(slots=True)
class Contact(Generic[Q]):
    """Quantities of a contact, in the order in which they come to be known.

    Each is a float or an array of a common shape; in the quadrature, `angle` and `normal_stress`
    have one more axis in front (the nodes), so that terms need no index.

    Stage ``on_inputs`` may change the first three blocks, ``on_contact`` the peak and leaving
    angles, ``on_normal_stress`` the normal stress, ``on_outputs`` the last block.
    """

    # Motion and load as recorded.
    slip: Q  # s [-]
    velocity_ratio: Q  # v/w [m]
    normal_load: Q  # load that the soil has to carry [N]
    stated_load: Q  # load as recorded [N]
    slope: Q  # [rad]
    gravity: Q  # [m/s^2]
    rim_speed: Q  # |r w| [m/s], nan when not recorded
    direction: Q  # +1 forward, -1 reverse
    pass_number: Q  # 1, 2, ...
    # Wheel.
    radius: Q  # r [m]
    width: Q  # b [m]
    lug_height: Q  # h [m]
    lug_count: Q
    lug_thickness: Q  # [m]
    shear_radius: Q  # R [m]
    # Soil.
    bearing_modulus: Q  # pressure at the reference depth [Pa]
    reference_depth: Q  # 1 m (Bekker) or the width (Reece) [m]
    sinkage_exponent: Q  # N [-]
    cohesion: Q  # c [Pa]
    tan_friction: Q  # tan(phi) [-]
    shear_modulus: Q  # K [m]
    peak_ratio: Q  # peak angle over entrance angle [-]
    leaving_ratio: Q  # leaving angle over entrance angle [-]
    density: Q  # [kg/m^3]
    # Contact.
    entrance_angle: Q | float = 0.0  # t1 [rad]
    peak_angle: Q | float = 0.0  # tm [rad]
    leaving_angle: Q | float = 0.0  # t2 [rad]
    # Stress at one or more angles.
    angle: Q | float = 0.0  # t [rad]
    normal_stress: Q | float = 0.0  # sigma [Pa]
    # Outputs, as an instrument would read them.
    sinkage: Q | float = 0.0  # [m]
    drawbar_pull: Q | float = 0.0  # [N]
    lateral_force: Q | float = 0.0  # [N], positive left
    torque: Q | float = 0.0  # [N m]
    # Wheel as built, whatever the effects make of `radius`: resets and arms refer to it.
    rim_radius: Q | float = 0.0  # [m]
    rim_share: Q | float = 1.0  # friction of soil on the rim over that of soil on soil [-]
    # Sideways motion; the float 0.0 where no wheel slides sideways.
    lateral_ratio: Q | float = 0.0  # v_y/w [m], positive left

    def __copy__(self) -> Contact[Q]:
        """Return a contact with the same quantities: terms change the copy alone."""
        return Contact(*map(self.__getattribute__, Contact.__slots__))

    @property
    def soil_friction(self) -> Quantity:
        """Friction of soil on soil, tan(phi) [-]: where `tan_friction` is that of the rim."""
        on_rim: Any = self.tan_friction
        return on_rim / self.rim_share

    @property
    def straight(self) -> bool:
        """Whether no wheel slides sideways: lateral force is zero and need not be worked out."""
        return isinstance(self.lateral_ratio, float) and self.lateral_ratio == 0.0

    def scale_speed(self, factor: Any) -> None:
        """Multiply v/w, along the wheel and across it: the slip angle stays."""
        self.velocity_ratio = self.velocity_ratio * factor
        if not self.straight:
            self.lateral_ratio = self.lateral_ratio * factor

    def heading(self) -> tuple[Quantity, Quantity]:
        """Cosine and sine (positive left) of the slip angle, from the two speeds of the hub [-]."""
        if self.straight:
            return 1.0, 0.0
        forward: Any = self.velocity_ratio
        aside: Any = self.lateral_ratio
        speed = np.maximum(np.sqrt(forward * forward + aside * aside), 1e-300)
        return forward / speed, aside / speed
