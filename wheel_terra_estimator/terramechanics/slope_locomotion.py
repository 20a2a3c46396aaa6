# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover that climbs by itself: slip from the balance of forces along the slope."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.model import OVERLOADED, SteadyState, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import (
    STANDARD_GRAVITY,
    OperatingPoints,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel

LARGEST_SLIP = 0.98


@dataclass(frozen=True)
class RoverSlopeState:
    """A rover that climbs steadily, one row per slope, one column per wheel."""

    # ``slope``, ``slip``: (N,) [rad], [-]; the slip is nan where the soil cannot give the pull
    slope: FloatArray
    slip: FloatArray
    # ``normal_load``, ``sinkage``, ``drawbar_pull``, ``torque``: (N, n) [N], [m], [N], [N m]
    normal_load: FloatArray
    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray


def rover_climb(
    model: WheelSoilModel,  # without the effect that tilts the load: the balance is made here
    wheels: Wheel,  # (n,) arrays, or floats for n equal wheels
    # (N, n) load on each wheel on each slope, terrain normal, load transfer included [N]; or (n,)
    # loads on level ground, which then fall with the cosine of the slope
    normal_loads: ArrayLike,
    slopes: ArrayLike,  # (N,) positive uphill [rad]
    # (n,) 1 for a wheel on virgin soil, 2 for the next one in its track, and so on
    pass_numbers: ArrayLike = 1.0,
    slip_radius: str = 'lug_tip',
    gravity: float = STANDARD_GRAVITY,
) -> RoverSlopeState:
    """Free travel of a rover straight up a slope: the wheels together pull W sin a.

    All rims run at one speed and the wheels share the rover's ground speed, so they share the slip
    ratio; what each gives follows from its own load and from how often its track was run over.
    Raises ValueError if ``slope_gravity`` is on, or shapes do not fit.
    """
    if 'slope_gravity' in model.effects:
        raise ValueError('effects.slope_gravity is on; the balance is made here: leave it off')
    check_range('slope', slopes, -0.5 * np.pi, 0.5 * np.pi, 'rad')
    slopes = np.atleast_1d(np.asarray(slopes, float))
    loads = np.asarray(normal_loads, float)
    if loads.ndim < 2:
        loads = np.atleast_1d(loads) * np.cos(slopes)[:, None]
    if loads.shape[0] != slopes.size:
        raise ValueError(f'normal loads have {loads.shape[0]} rows, there are {slopes.size} slopes')
    # The soil carries W cos a in all, whichever way the wheels share it.
    weight = loads.sum(axis=1) / np.cos(slopes)
    free = WheelSoilModel(model.soil, model.effects, model.method, strict=False, nodes=model.nodes)
    count = loads.shape[1]

    def per_wheel(value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, float), loads.shape).ravel()

    each = wheels.map(per_wheel)

    def solve(slip: FloatArray) -> SteadyState:
        return free.steady_state(
            OperatingPoints(
                np.repeat(slip, count),
                loads.ravel(),
                each,
                slope=np.repeat(slopes, count),
                slip_radius=slip_radius,
                gravity=gravity,
                pass_number=per_wheel(pass_numbers),
            )
        )

    def pull(slip: FloatArray) -> FloatArray:
        state = solve(slip)
        given = np.where(state.flags & OVERLOADED, -np.inf, state.drawbar_pull)
        return given.reshape(loads.shape).sum(axis=1)

    slip = _smallest_slip(pull, weight * np.sin(slopes))
    known = np.isfinite(slip)
    state = solve(np.where(known, slip, 0.0))
    sinkage, drawbar_pull, torque = (
        np.where(known[:, None], column.reshape(loads.shape), np.nan)
        for column in (state.sinkage, state.drawbar_pull, state.torque)
    )
    return RoverSlopeState(slopes, slip, loads, sinkage, drawbar_pull, torque)


def _smallest_slip(pull: Callable[[FloatArray], FloatArray], need: FloatArray) -> FloatArray:
    """Smallest slip at which a pull is reached, for each of N points; nan where none is enough."""
    grid = np.concatenate([np.linspace(-0.9, 0.9, 73), np.linspace(0.9, LARGEST_SLIP, 9)[1:]])
    enough = np.stack([pull(np.full_like(need, s)) for s in grid]) >= need
    first = np.argmax(enough, axis=0)
    high, low = grid[first], grid[np.maximum(first - 1, 0)]
    for _ in range(40):
        middle = 0.5 * (low + high)
        done = pull(middle) >= need
        high, low = np.where(done, middle, high), np.where(done, low, middle)
    return np.where(enough.any(axis=0), high, np.nan)
