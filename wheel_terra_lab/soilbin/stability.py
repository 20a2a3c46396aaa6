# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Largest stable time step of the engine's integrator for damped linear contacts."""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin.case import Case
from wheel_terra_lab.soilbin.geometry import bed_discs

# Densest mode of a frictional bed. On settled beds the highest eigenvalue of M^-1 K of the real
# contact network (normal, tangential and turning motion) is 3.3 K_n / m of the lightest grain;
# 4 is the value of a square lattice (four contacts each).
PACKING_MODES = 4.0


def damping_coefficient(case: Case) -> float:
    """Return C_n [N s/m] = ratio * 2 sqrt(m_e K_n), m_e from the largest disc (Table 5)."""
    grains = case.grains
    mass = grains.damping_density * case.wheel.width * math.pi / 4 * case.grain_diameters.max() ** 2
    return grains.damping_ratio * 2 * math.sqrt(mass * grains.normal_stiffness)


def largest_time_step(stiffness: float, damping: float, mass: float, modes: float) -> float:
    """Return the largest stable time step [s] of one mode.

    The engine integrates with velocity Verlet and evaluates the dashpot with the velocity of the
    half step before: with a = modes K / m and b = modes C / m

        v' = (1 - b dt) v - a dt x,   x' = x + dt v'.

    The characteristic polynomial has the trace 2 - a dt^2 - b dt and the determinant 1 - b dt;
    Jury's conditions leave a dt^2 + 2 b dt < 4, that is dt < (sqrt(b^2 + 4 a) - b) / a. Without
    damping this is the familiar 2 / omega; with a critically damped mode it is 0.83 / omega.
    """
    a, b = modes * stiffness / mass, modes * damping / mass
    return (math.sqrt(b * b + 4 * a) - b) / a


def stable_time_step(case: Case) -> float:
    """Return the largest stable time step [s] of a bed of the case's lightest grains.

    The least of three kinds of motion of a packing: normal; spinning against the tangential
    springs (grains of inertia m r^2 / 2 that all turn alike: four times K_t per contact); rolling
    against the rolling springs (arm r / 2, neighbours turning against each other).
    """
    grains = case.grains
    damping = damping_coefficient(case)
    mass = float(np.min(bed_discs(case)[2]))  # of the lightest grain [kg]
    kinds = [(grains.normal_stiffness, 1.0)]
    if grains.rotation == 'free':
        kinds.append((grains.tangential_stiffness, 4.0))
        if grains.rolling_friction > 0:
            kinds.append((grains.rolling_stiffness, 1.0))
    return min(
        largest_time_step(
            stiffness,
            damping * math.sqrt(stiffness / grains.normal_stiffness),
            mass,
            PACKING_MODES * factor,
        )
        for stiffness, factor in kinds
    )


def time_step(case: Case) -> float:
    """Return the time step of the run [s]; refuse one that is not stable."""
    limit = stable_time_step(case)
    wanted = case.numerics.time_step
    if wanted == 0:
        return 0.85 * limit
    if not 0 < wanted <= limit:
        raise UserError(
            f'{case.name}: soilbin.numerics.time_step {wanted:g} s is not stable for this '
            f'stiffness, damping and lightest grain: the largest stable one is {limit:.3g} s '
            '(0 chooses one; a smaller soilbin.grains.damping_ratio or a larger '
            'soilbin.bed.grain_scale allows a larger one)'
        )
    return wanted
