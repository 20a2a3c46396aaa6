# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Torque and pull of a wheel whose sinkage is known: what the on-board filter evaluates.

With the sinkage given, the load balance fixes the peak stresses, and no bearing parameter is
needed; this holds also while the sinkage still settles. Plain floats: for six wheels several
times faster than numpy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import (
    EffectSettings,
    catalogue,
    check_settings,
)
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import Terms, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel

# Columns of the derivatives that ``ConditionedForces`` returns.
INPUTS = (
    'speed_ratio',
    'sinkage',
    'normal_load',
    'cohesion',
    'tan_friction',
    'shear_modulus',
    'centroid_shift',
)
SMALLEST_ANGLE = 2e-3  # [rad]; below, the wheel hardly touches and angles lose their meaning
_STEP = 1e-6


class Forces(NamedTuple):
    """Answer of ``ConditionedForces``.

    Attributes
    ----------
    torque, drawbar_pull : float
        [N m], [N].
    d_torque, d_pull : tuple of float
        Derivatives by ``INPUTS``.
    clamped : bool
        True where an input was outside the model (sinkage below zero or above the radius) and
        was clamped.
    """

    torque: float
    drawbar_pull: float
    d_torque: tuple[float, ...]
    d_pull: tuple[float, ...]
    clamped: bool


class ConditionedForces:
    """Torque and pull given slip, sinkage and load, with analytic derivatives.

    Parameters
    ----------
    wheel : Wheel
        Floats, or (n,) arrays for n wheels.
    soil : Soil
        Floats; cohesion, friction and shear modulus are given anew with each call.
    effects : mapping
        Switched-on effects.
    slip_radius : str
        ``lug_tip`` or ``rim``: radius of the rim speed in ``speed_ratio``.
    gravity : float
        [m/s^2].
    """

    def __init__(
        self,
        wheel: Wheel,
        soil: Soil,
        effects: EffectSettings | None = None,
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        settings = check_settings(effects or {})
        known = catalogue()
        self._inputs = Terms(settings).stages['on_inputs']
        self._terms = Terms(settings)
        outputs = {name: values for name, values in settings.items() if known[name].on_outputs}
        self._on_sinkage = Terms(
            {n: v for n, v in outputs.items() if 'sinkage' in known[n].touches}
        ).stages['on_outputs']
        self._on_forces = Terms(
            {n: v for n, v in outputs.items() if known[n].touches - {'sinkage'}}
        ).stages['on_outputs']
        self._soil = soil
        self._gravity = gravity
        columns = np.broadcast_arrays(
            *(
                np.atleast_1d(np.asarray(v, float))
                for v in (wheel.radius, wheel.width, wheel.lug_height, wheel.lug_count)
            )
        )
        self._wheels = list(zip(*(c.tolist() for c in columns), strict=True))
        self._tip = slip_radius == 'lug_tip'

    def __len__(self) -> int:
        return len(self._wheels)

    def forces(
        self,
        index: int,
        speed_ratio: float,
        sinkage: float,
        normal_load: float,
        cohesion: float,
        tan_friction: float,
        shear_modulus: float,
        centroid_shift: float = 0.0,
        *,
        leaving_angle: float = math.nan,
        rim_speed: float = math.nan,
        pass_number: float = 1.0,
        slope: float = 0.0,
        direction: float = 1.0,
    ) -> Forces:
        """Torque and pull of wheel `index`, in the direction of travel times `direction`.

        Parameters
        ----------
        speed_ratio : float
            u = v/(r w) >= 0: 1 pure rolling, 0 spinning on the spot, above 1 skidding [-].
        sinkage : float
            As measured, digging and support of the lugs included [m].
        normal_load : float
            [N].
        cohesion, tan_friction, shear_modulus : float
            c [Pa], tan(phi) [-], K [m].
        centroid_shift : float
            Rotation of the stress centroid, positive towards the front [rad].
        """
        raise NotImplementedError
