# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady operating points: one entry per wheel, table row or grid point."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.checks import check_range, common_length, numbers
from wheel_terra_estimator.terramechanics.wheel import Wheel

STANDARD_GRAVITY = 9.80665  # [m/s^2]
SLIP_RADII = ('lug_tip', 'rim', 'shear')


@dataclass(frozen=True)
class OperatingPoints:
    """What is known of N steady wheel-soil contacts before the soil answers."""

    slip: Quantity  # (N,) recorded slip ratio (``kinematics.slip_ratio``), in [-1, 1] [-]
    # (N,) load on the wheel as recorded (terrain normal, unless `slope_gravity` is on) [N]
    normal_load: Quantity
    wheel: Wheel  # floats, or arrays of shape (N,)
    slope: Quantity = 0.0  # (N,) slope, positive uphill [rad]
    # Radius to which `slip` refers: ``lug_tip`` (r + h), ``rim`` (r), or ``shear`` (the model's
    # shear radius: eq. 14 as Ding et al. 2010 print it).
    slip_radius: str = 'lug_tip'
    gravity: Quantity = STANDARD_GRAVITY  # (N,) [m/s^2]
    # (N,) wheel rate [rad/s], negative in reverse; nan = not recorded (taken as forward)
    angular_velocity: Quantity = np.nan
    # (N,) 1 on virgin soil, 2 for the second wheel in the same rut, and so on
    pass_number: Quantity = 1
    # (N,) measured leaving angle [rad], negative behind the hub; nan = not measured
    leaving_angle: Quantity = np.nan
    # (N,) angle from the wheel's forward axis to the motion of its hub, positive where it slides
    # left, in [-pi, pi] [rad]
    slip_angle: Quantity = 0.0
    # (N,) sideways over rim speed v_y/(r w), r as `slip_radius` says, positive left [-]; nan = from
    # slip and slip angle, (1 - s) tan(slip angle), which says nothing near 90 degrees
    lateral_speed_ratio: Quantity = np.nan

    def __post_init__(self) -> None:
        if self.slip_radius not in SLIP_RADII:
            raise ValueError(f'slip radius is {self.slip_radius!r}; allowed is one of {SLIP_RADII}')
        columns = {f.name: f.name.replace('_', ' ') for f in fields(self)}
        del columns['wheel'], columns['slip_radius']
        own = {words: numbers(words, getattr(self, name)) for name, words in columns.items()}
        wheel = {f.name.replace('_', ' '): getattr(self.wheel, f.name) for f in fields(self.wheel)}
        count = common_length({**own, **wheel})
        for name, words in columns.items():
            object.__setattr__(self, name, np.broadcast_to(own[words], (count,)))
        check_range('slip', self.slip, -1.0, 1.0)
        check_range('normal load', self.normal_load, 0.0, unit='N', open_lower=True)
        check_range('slope', self.slope, -np.pi / 2, np.pi / 2, unit='rad')
        check_range('gravity', self.gravity, 0.0, unit='m/s^2', open_lower=True)
        check_range('angular velocity', self.angular_velocity, unit='rad/s', allow_nan=True)
        check_range('pass number', self.pass_number, 1.0)
        check_range(
            'leaving angle', self.leaving_angle, -np.pi / 2, np.pi / 4, unit='rad', allow_nan=True
        )
        check_range('slip angle', self.slip_angle, -np.pi, np.pi, unit='rad')
        check_range('lateral speed ratio', self.lateral_speed_ratio, allow_nan=True)

    def __len__(self) -> int:
        return int(np.shape(self.slip)[0])
