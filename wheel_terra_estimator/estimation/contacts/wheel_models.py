# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel-soil models as the filter uses them, all wheels at once, in the direction of rolling.

* Torque and pull: ``terramechanics.conditioned``. With the sinkage measured, the load balance fixes
  the stresses; slip, load and shear strength are enough, and no bearing parameter enters. It holds
  in soil of unknown stiffness and while the wheel is still sinking.
* Sinkage: the bearing law says which load the soil would carry at the present sinkage; where that
  is less than the wheel's load, it sinks on.
"""

from __future__ import annotations

import math
from typing import NamedTuple, cast

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Quantity
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.terramechanics.conditioned import (
    Bearing,
    ConditionedForces,
    ConditionedInputs,
)
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio
from wheel_terra_estimator.terramechanics.soil import Soil

# Effects of a table or of an instrument that the filter must not apply: loads are terrain-normal
# already, and the pull comes from specific force, not from an attitude.
_NOT_IN_FILTER = frozenset({'slope_gravity', 'pitch_bias', 'pull_zero', 'pull_gain'})
LEAST_BEARING = 0.05
"""Least vertical force, over the wheel's load or over that of the normal stress alone [-]."""
MOST_RATIO = 3.0
"""v/(r w) beyond which the shear is saturated, so that torque and pull stay the same [-]."""
LEAST_SINKAGE = 1e-4  # [m]
_USUAL_MOUND = 0.05
"""Rearward shift of the stresses at slip 1 by soil that piles up behind a wheel, where no effect
states it, over the entrance angle [-]; tuned on simulated drives, seeds 1000 to 1019."""


class WheelStates(NamedTuple):
    """State of n turning wheels as the models take it, seen in the direction of rolling.

    Each entry is a number, or an array that broadcasts to (..., n).
    """

    speed_ratio: Quantity  # v/(r w) [-]
    sinkage: Quantity  # [m]
    load: Quantity  # [N]
    strength: Quantity = 0.0  # ln of the factor on c and tan(phi)
    shear_modulus: Quantity = 0.0  # ln of the factor on K
    centroid: Quantity = 0.0
    """Shift of the stress centroid over the entrance angle, at all slips [-]."""
    rim_speed: Quantity = math.nan  # |r w| [m/s], nan = not known
    leaving_angle: Quantity | None = None
    """Measured [rad], nan = not measured; None = no wheel's is."""
    stiffness: Quantity = 0.0  # ln of the factor on the bearing modulus
    slip_sinkage: Quantity = 0.0  # added to n1


STEPPED = ('speed_ratio', 'sinkage', 'strength', 'shear_modulus', 'centroid')
"""Entries of `WheelStates` by which torque and pull are differentiated."""
_STEP = 1e-7
"""Finite step of each, in its own unit: errors by curvature and rounding are far below 1e-4."""
_STEPS = _STEP * np.eye(len(STEPPED), len(STEPPED) + 1, 1)[:, :, None]


class WheelForces(NamedTuple):
    """Torque and pull of n wheels with their derivatives by the filter's quantities."""

    torque: FloatArray  # (n,) [N m]
    pull: FloatArray  # (n,) [N]
    d_torque: FloatArray  # (5, n)
    d_pull: FloatArray
    """(5, n): by v/(r w), sinkage, ln shear strength, ln K, centroid."""


STRENGTH = STEPPED.index('strength')
"""Row of the strength in the derivatives."""


class WheelModels:
    """Contact models of all wheels of a rover on a soil, with the effects of `contact_models`."""

    def __init__(self, configuration: Configuration, soil: Soil, effects: EffectSettings) -> None:
        wheels = configuration.wheels
        effects = {k: v for k, v in effects.items() if k not in _NOT_IN_FILTER}
        gravity = float(configuration.rover.gravity)
        self._forces = ConditionedForces(
            wheels.wheel, soil, effects, configuration.slip_radius, gravity
        )
        self._cohesion = float(soil.cohesion)
        self._tan_friction = math.tan(float(soil.friction_angle))
        self._shear_modulus = float(soil.shear_modulus)
        onset = cast('float', configuration.flat()['effects.soil_mound.onset'])
        self._mound_span = 1.0 - onset
        self._mound = 0.0 if 'soil_mound' in configuration.effects else _USUAL_MOUND
        self._passes = np.array(wheels.passes, float)
        self._slip_radius = np.array(wheels.slip_radius, float)
        self._radius = np.array(wheels.radius, float)

    def forces(self, states: WheelStates) -> WheelForces:
        """Return torque and pull of all wheels with their derivatives, at states of (n,) entries.

        Stiffness and slip-sinkage have no part in it. Where the speed opposes the rim the shear is
        saturated: the forces are those of slip 1 at any such speed.
        """
        values = np.empty((len(STEPPED), len(STEPPED) + 1, len(self._radius)))
        for stepped, name in zip(values, STEPPED, strict=True):
            stepped[:] = getattr(states, name)
        values += _STEPS
        torque, pull = self.torque_and_pull(
            states._replace(**dict(zip(STEPPED, values, strict=True)))
        )
        return WheelForces(
            torque[0], pull[0], (torque[1:] - torque[0]) / _STEP, (pull[1:] - pull[0]) / _STEP
        )

    def torque_and_pull(self, states: WheelStates) -> tuple[FloatArray, FloatArray]:
        """Return torques [N m] and pulls [N] alone, (..., n) each."""
        ratio = np.minimum(np.maximum(states.speed_ratio, 0.0), MOST_RATIO)
        return self._forces.forces(self._inputs(states, self._shift(states, ratio)))

    def _inputs(self, states: WheelStates, shift: Quantity) -> ConditionedInputs:
        """Return what the models take; `shift` is that of the stress centroid [rad]."""
        factor = np.exp(states.strength)
        return ConditionedInputs(
            np.minimum(states.speed_ratio, MOST_RATIO),
            states.sinkage,
            states.load,
            self._cohesion * factor,
            self._tan_friction * factor,
            self._shear_modulus * np.exp(states.shear_modulus),
            shift,
            leaving_angle=states.leaving_angle,
            rim_speed=states.rim_speed,
            pass_number=self._passes,
        )

    def _shift(self, states: WheelStates, ratio: FloatArray) -> FloatArray:
        """Return the rotation of the stresses by centroid and mound [rad]."""
        high = np.maximum(self._mound_span - ratio, 0.0) / self._mound_span
        shift = states.centroid - self._mound * high * high
        return np.asarray(shift * self._entrance_angle(states.sinkage))

    def _entrance_angle(self, sinkage: Quantity) -> FloatArray:
        """Return the entrance angles at sinkages, brought into their bounds [rad]."""
        depth = np.minimum(np.maximum(sinkage, LEAST_SINKAGE), self._radius)
        return np.asarray(np.arccos(1.0 - depth / self._radius))

    def bearing(self, states: WheelStates) -> Bearing:
        """Return the load that the bearing law carries at the sinkage of each wheel.

        Centroid and rim speed have no part in it.
        """
        slip = slip_of_speed_ratio(states.speed_ratio)
        bearing = self._forces.bearing(
            self._inputs(states._replace(rim_speed=math.nan), shift=0.0),
            np.exp(states.stiffness),
            states.slip_sinkage * np.abs(slip),
        )
        return bearing._replace(load=np.maximum(bearing.load, LEAST_BEARING * states.load))
