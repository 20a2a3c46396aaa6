# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The state of one wheel-soil contact, on which the terms of the effects act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(slots=True)
class Contact:
    """Quantities of a contact, in the order in which they come to be known.

    Each is a float or an array of a common shape; in the quadrature, `angle` and `normal_stress`
    have one more axis in front (the nodes), so that terms need no index.

    Stage ``on_inputs`` may change the first three blocks, ``on_contact`` the peak and leaving
    angles, ``on_normal_stress`` the normal stress, ``on_outputs`` the last block.
    """

    # Motion and load as recorded.
    slip: Any  # s [-]
    velocity_ratio: Any  # v/w [m]
    normal_load: Any  # load that the soil has to carry [N]
    stated_load: Any  # load as recorded [N]
    slope: Any  # [rad]
    gravity: Any  # [m/s^2]
    rim_speed: Any  # |r w| [m/s], nan when not recorded
    direction: Any  # +1 forward, -1 reverse
    pass_number: Any  # 1, 2, ...
    # Wheel.
    radius: Any  # r [m]
    width: Any  # b [m]
    lug_height: Any  # h [m]
    lug_count: Any
    lug_thickness: Any  # [m]
    shear_radius: Any  # R [m]
    # Soil.
    bearing_modulus: Any  # pressure at the reference depth [Pa]
    reference_depth: Any  # 1 m (Bekker) or the width (Reece) [m]
    sinkage_exponent: Any  # N [-]
    cohesion: Any  # c [Pa]
    tan_friction: Any  # tan(phi) [-]
    shear_modulus: Any  # K [m]
    peak_ratio: Any  # peak angle over entrance angle [-]
    leaving_ratio: Any  # leaving angle over entrance angle [-]
    density: Any  # [kg/m^3]
    # Contact.
    entrance_angle: Any = 0.0  # t1 [rad]
    peak_angle: Any = 0.0  # tm [rad]
    leaving_angle: Any = 0.0  # t2 [rad]
    # Stress at one or more angles.
    angle: Any = 0.0  # t [rad]
    normal_stress: Any = 0.0  # sigma [Pa]
    # Outputs, as an instrument would read them.
    sinkage: Any = 0.0  # [m]
    drawbar_pull: Any = 0.0  # [N]
    lateral_force: Any = 0.0  # [N], positive left
    torque: Any = 0.0  # [N m]
    # Wheel as built, whatever the effects make of `radius`: resets and arms refer to it.
    rim_radius: Any = 0.0  # [m]
    # Sideways motion; the float 0.0 where no wheel slides sideways.
    lateral_ratio: Any = 0.0  # v_y/w [m], positive left

    @property
    def straight(self) -> bool:
        """Whether no wheel slides sideways: lateral force is zero and need not be worked out."""
        return isinstance(self.lateral_ratio, float) and self.lateral_ratio == 0.0

    def heading(self, maths: Any) -> tuple[Any, Any]:
        """Cosine and sine (positive left) of the slip angle, from the two speeds of the hub [-]."""
        if self.straight:
            return 1.0, 0.0
        forward, aside = self.velocity_ratio, self.lateral_ratio
        speed = maths.maximum(maths.sqrt(forward * forward + aside * aside), 1e-300)
        return forward / speed, aside / speed
