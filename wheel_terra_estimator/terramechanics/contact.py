# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The state of one wheel-soil contact, on which the terms of the effects act."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import Quantity

_NO_SPEED = 1e-300  # v/w [m]; keeps the direction of a wheel at rest finite


@dataclass(slots=True)
class Contact:
    """Quantities of a contact, in the order in which they are determined.

    Each is a float or an array of a common shape; in the quadrature, `angle` and `normal_stress`
    have one more axis in front (the nodes), so that terms need no index.

    Stage ``on_inputs`` may change the first three blocks, ``on_contact`` the peak and leaving
    angles, ``on_normal_stress`` the normal stress, ``on_outputs`` the last block.
    """

    # Motion and load as recorded.
    slip: Quantity  # s [-]
    velocity_ratio: Quantity  # v/w [m]
    normal_load: Quantity  # load that the soil has to carry [N]
    stated_load: Quantity  # load as recorded [N]
    slope: Quantity  # [rad]
    gravity: Quantity  # [m/s^2]
    rim_speed: Quantity  # |r w| [m/s], nan when not recorded
    direction: Quantity  # +1 forward, -1 reverse
    pass_number: Quantity  # 1, 2, ...
    # Wheel.
    radius: Quantity  # r [m]
    width: Quantity  # b [m]
    lug_height: Quantity  # h [m]
    lug_count: Quantity
    lug_thickness: Quantity  # [m]
    shear_radius: Quantity  # R [m]
    # Soil.
    bearing_modulus: Quantity  # pressure at the reference depth [Pa]
    reference_depth: Quantity  # 1 m (Bekker) or the width (Reece) [m]
    sinkage_exponent: Quantity  # N [-]
    cohesion: Quantity  # c [Pa]
    tan_friction: Quantity  # tan(phi) [-]
    shear_modulus: Quantity  # K [m]
    peak_ratio: Quantity  # peak angle over entrance angle [-]
    leaving_ratio: Quantity  # leaving angle over entrance angle [-]
    density: Quantity  # [kg/m^3]
    # Contact.
    entrance_angle: Quantity = 0.0  # t1 [rad]
    peak_angle: Quantity = 0.0  # tm [rad]
    leaving_angle: Quantity = 0.0  # t2 [rad]
    # Stress at one or more angles.
    angle: Quantity = 0.0  # t [rad]
    normal_stress: Quantity = 0.0  # sigma [Pa]
    # Outputs, as an instrument would read them.
    sinkage: Quantity = 0.0  # [m]
    drawbar_pull: Quantity = 0.0  # [N]
    lateral_force: Quantity = 0.0  # [N], positive left
    torque: Quantity = 0.0  # [N m]
    # Wheel as built; effects may change `radius`.
    rim_radius: Quantity = 0.0  # [m]
    rim_share: Quantity = 1.0  # friction of soil on the rim over that of soil on soil [-]
    # Sideways motion; the float 0.0 where no wheel slides sideways.
    lateral_ratio: Quantity = 0.0  # v_y/w [m], positive left

    def __copy__(self) -> Contact:
        """Return a contact with the same quantities: terms change the copy alone."""
        return Contact(*map(self.__getattribute__, Contact.__slots__))

    @property
    def soil_friction(self) -> Quantity:
        """Friction of soil on soil, tan(phi) [-]: where `tan_friction` is that of the rim."""
        return self.tan_friction / self.rim_share

    @property
    def straight(self) -> bool:
        """Whether no wheel slides sideways, so that the lateral force is zero."""
        return isinstance(self.lateral_ratio, float) and self.lateral_ratio == 0.0

    def scale_speed(self, factor: Quantity) -> None:
        """Multiply v/w, along the wheel and across it: the slip angle stays."""
        self.velocity_ratio = self.velocity_ratio * factor
        if not self.straight:
            self.lateral_ratio = self.lateral_ratio * factor

    def heading(self) -> tuple[Quantity, Quantity]:
        """Cosine and sine (positive left) of the slip angle, from the two speeds of the hub [-]."""
        if self.straight:
            return 1.0, 0.0
        forward, lateral = self.velocity_ratio, self.lateral_ratio
        speed = np.maximum(np.sqrt(forward * forward + lateral * lateral), _NO_SPEED)
        return forward / speed, lateral / speed
