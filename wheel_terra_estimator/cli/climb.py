# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Slip against slope: a wheel or a whole rover that climbs by itself (``predict --climb``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.readings import Readings
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.slope_locomotion import rover_climb

if TYPE_CHECKING:
    from wheel_terra_estimator.configuration.configuration import Configuration

WHO = ('wheel', 'rover')
STEEPEST = np.radians(60.0)  # [rad]


def climb(
    configuration: Configuration,
    # ``wheel``: one wheel under ``weight``; ``rover``: all wheels, their loads moved by the slope
    # as the suspension does it; one row per slope and wheel, in the order of ``wheels.names``
    who: str,
    wheel: int,
    # Weight on the wheel, W [N]: the soil carries W cos(slope), the pull is W sin(slope)
    weight: float,
    slopes: FloatArray,  # (N,) positive uphill [rad]
    method: str,
) -> dict[str, FloatArray]:
    """Return the steady state of free travel on each slope; nan where the slope is too steep.

    Raises UserError for a slope beyond 60 degrees. Raises ValueError for an effect that makes the
    balance already.
    """
    if np.abs(slopes).max() > STEEPEST:
        raise UserError('--slope: slopes of --climb are at most 1.05 rad (60 degrees)')
    model = WheelSoilModel(configuration.soil, configuration.effects, method, strict=False)
    wheels = configuration.wheels
    chosen = list(range(wheels.count)) if who == 'rover' else [wheel]
    loads: list[float] | list[FloatArray] = [weight]
    if who == 'rover':
        from wheel_terra_estimator.estimation.rover import Rover

        rover = Rover.from_configuration(configuration)
        along, down = rover.gravity * np.sin(slopes), rover.gravity * np.cos(slopes)
        loads = [rover.load.loads((x, 0.0, z)) for x, z in zip(along, down, strict=True)]
    state = rover_climb(
        model,
        wheels.wheel.map(lambda values: values[chosen]),
        loads,
        slopes,
        np.asarray(wheels.passes, dtype=float)[chosen],
        configuration.slip_radius,
        float(configuration.rover.gravity),
    )
    count = len(chosen)
    result = {
        'slope': np.repeat(state.slope, count),
        'slip': np.repeat(state.slip, count),
        'normal_load': state.normal_load.ravel(),
    }
    if who == 'rover':
        result['pass_number'] = np.tile(np.asarray(wheels.passes, dtype=float), len(slopes))
    read = [Readings.of(configuration, index) for index in chosen]
    true = np.stack([getattr(state, name) for name in OUTPUTS], axis=-1)  # (slopes, wheels, 3)
    readings = np.stack([one.read(true[:, k]) for k, one in enumerate(read)], axis=1)
    result |= dict(zip(OUTPUTS, readings.reshape(-1, len(OUTPUTS)).T, strict=True))
    return result
