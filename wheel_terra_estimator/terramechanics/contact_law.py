# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rival laws of the wheel-soil contact: operating points in, sinkage and forces out."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.model import SteadyState, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY, OperatingPoints
from wheel_terra_estimator.terramechanics.resistive_force import ResistiveForce, stress_maps
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.stresses import bearing_law

BEKKER_WONG_JANOSI, WONG_REECE, RESISTIVE_FORCE = (
    'bekker_wong_janosi',
    'wong_reece',
    'resistive_force',
)
LAWS = (BEKKER_WONG_JANOSI, WONG_REECE, RESISTIVE_FORCE)
# Shift of the peak stress with slip where none is configured; loose sand: Wong and Reece 1967,
# J. Terramechanics 4(1), 81-98 (doi 10.1016/0022-4898(67)90105-X).
PEAK_SHIFT = 0.32
PLATE_DEPTH = 0.02  # at which the resistive stress is that of the soil's plate test [m]


class ContactLaw(Protocol):
    """A law of the contact; ``WheelSoilModel`` and ``ResistiveForce`` are two."""

    def steady_state(self, points: OperatingPoints) -> SteadyState:
        """Solve the load balance and return sinkage, drawbar pull, lateral force and torque."""


def contact_law(
    name: str,
    soil: Soil,  # floats
    # Switched-on effects, a ``learned_closure`` among them; ``resistive_force`` has none
    effects: EffectSettings,
    # Width at which the laws have the same pressure [m]: where ``wong_reece`` takes over Bekker's
    # moduli, and of the plate that ``resistive_force`` takes its scale from
    width: float,
    *,
    gravity: float = STANDARD_GRAVITY,  # at which the soil's numbers hold [m/s^2]
    strict: bool = True,
) -> ContactLaw:
    """Return a law for the soil as configured.

    Raises ValueError for an unknown name.
    """
    if name == BEKKER_WONG_JANOSI:
        return WheelSoilModel(soil, effects, 'closed_form', strict=strict)
    if name == WONG_REECE:
        reece = reece_soil(soil, width, gravity)
        return WheelSoilModel(reece, reece_effects(effects), 'quadrature', strict=strict)
    if name == RESISTIVE_FORCE:
        return ResistiveForce(plate_scale(soil, width, gravity), strict=strict)
    raise ValueError(f'contact law is {name!r}; allowed is one of {LAWS}')


def reece_effects(effects: EffectSettings) -> EffectSettings:
    """Return the effects with the shift of the peak stress on, Wong and Reece's where it is off."""
    if 'stress_peak_shift' in {key.partition(':')[0] for key in effects}:
        return effects
    return {**effects, 'stress_peak_shift': {'c2': PEAK_SHIFT, 'skid': 0.0}}


def reece_soil(soil: Soil, width: float, gravity: float = STANDARD_GRAVITY) -> Soil:
    """Return the soil with Reece's pressure c kc' + rho g b kphi', the same at this width [m]."""
    if soil.pressure_law == 'reece':
        return soil
    pressure = bearing_law('bekker', soil.cohesive_modulus, soil.frictional_modulus, width, 0, 0)[0]
    modulus = pressure * width**soil.sinkage_exponent / (soil.density * gravity * width)
    return replace(soil, cohesive_modulus=0.0, frictional_modulus=modulus, pressure_law='reece')


def plate_scale(soil: Soil, width: float, gravity: float = STANDARD_GRAVITY) -> float:
    """Scale of the resistive stress with which a flat plate meets the soil's pressure [-]."""
    modulus, depth = soil.bearing(width, gravity)
    pressure = modulus * (PLATE_DEPTH / depth) ** soil.sinkage_exponent
    generic = 1e6 * float(stress_maps(0.0, 0.5 * np.pi)[0]) * PLATE_DEPTH
    return float(pressure) / generic
