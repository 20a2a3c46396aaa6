# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Speed of the body: the one at which the traction curve gives the torques that are measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.scalars import median
from wheel_terra_lab.traction_filter.curve import (
    LOG_SCALE,
    LOG_STRENGTH,
    OFFSET,
    WHEELS,
    Coefficients,
    WheelSpeeds,
    coefficients,
)
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class SolverTuning:
    """Numbers of the solution."""

    most_slip: float = 0.97  # of the body [-]
    least_slope: float = 0.1
    """Of the torque coefficient over the slip [-]: on the plateau torque tells little."""
    agreement: float = 0.1
    """Torque coefficient within which wheels agree [-]; what is far beyond loses its weight."""
    agreement_share: float = 0.15  # of the median coefficient, besides
    freedom: float = 2.0  # of that heavy tail
    scale_share: float = 0.5  # of the fastest rim, where wheels turn against one another
    tolerance: float = 1e-4  # of the slip
    iterations: int = 8


class Rims(NamedTuple):
    """Wheels at a stamp."""

    speed: FloatArray  # (n,) [m/s], 0 where unknown
    turning: NDArray[np.bool_]  # (n,) whether the models hold: it turns, faster than noise
    body: float  # speed of the body if no wheel slipped [m/s]
    scale: float  # signed speed that the body's slip is a share of [m/s]


class BodySlip(NamedTuple):
    """Solution: the body moves at ``rims.body - slip * rims.scale``."""

    slip: float
    gradient: FloatArray  # (3 + n,) by the state
    slope: float  # of the mean torque coefficient over the slip [-]
    expected: FloatArray  # (n,) torque coefficients there
    weight: FloatArray  # (n,) of the wheels in it


def rims_at(
    speeds: tuple[float, ...],
    headings: Headings,
    yaw_rate: float,
    low_rim: float,
    tuning: SolverTuning = SolverTuning(),
) -> Rims:
    """Return what is needed of rim speeds (n,) [m/s], nan = unknown."""
    rim = np.nan_to_num(np.array(speeds))
    bodies = [
        headings.body_speed(i, speed, yaw_rate) for i, speed in enumerate(speeds) if speed == speed
    ]
    body = median(bodies) if bodies else 0.0
    size = max(abs(body), tuning.scale_share * float(np.abs(rim).max(initial=0.0)))
    return Rims(rim, np.abs(rim) > low_rim, body, size if body >= 0.0 else -size)


def solved(
    steady: SteadyWheel,
    state: FloatArray,
    rims: Rims,
    headings: Headings,
    yaw_rate: float,
    *,
    demand: FloatArray,
    load: FloatArray,
    stiffness: FloatArray,
    start: float,
    tuning: SolverTuning = SolverTuning(),
) -> BodySlip:
    """Return the slip at which the curve gives the demand, and its gradient by the state.

    Newton's method with bisection on sum(W weight (demand - u)) = 0, three times: each time wheels
    that disagree with the others lose weight. The gradient follows from the
    implicit function theorem.

    Parameters
    ----------
    demand : numpy.ndarray
        (n,) measured torque over load and radius [-].
    load : numpy.ndarray
        (n,) [N].
    stiffness : numpy.ndarray
        (n,) see `coefficients`.
    start : float
        A slip near the solution.
    """
    by_speed, by_yaw = np.array(headings.by_speed), np.array(headings.by_yaw_rate)
    side_by_speed, side_by_yaw = (
        np.array(headings.side_by_speed),
        np.array(headings.side_by_yaw_rate),
    )
    direction = 1.0 if rims.scale >= 0.0 else -1.0
    size = abs(rims.scale)
    carried = load * rims.turning

    def at(slip: float) -> Coefficients:
        body = rims.body - slip * rims.scale
        ground = by_speed * body + by_yaw * yaw_rate
        sideways = side_by_speed * body + side_by_yaw * yaw_rate
        return coefficients(steady, state, WheelSpeeds(rims.speed, ground, sideways), stiffness)

    slip, weight = start, carried / carried.sum()
    for last in (False, False, True):
        low, high = -tuning.most_slip, tuning.most_slip
        for _ in range(tuning.iterations):
            u = at(slip)
            lacking = float(weight @ (demand - u.value)) * direction
            low, high = (slip, high) if lacking > 0.0 else (low, slip)
            slope = -float(weight @ (u.by_ground_speed * by_speed)) * size
            ahead = slip + lacking / max(slope, tuning.least_slope)
            ahead = ahead if low <= ahead <= high else 0.5 * (low + high)
            done = abs(ahead - slip) < tuning.tolerance
            slip = ahead
            if done:
                break
        u = at(slip)
        if not last:
            residual = demand - u.value
            usual = tuning.agreement + tuning.agreement_share * float(
                np.median(np.abs(demand[rims.turning]))
            )
            weight = carried / (1.0 + (residual / usual) ** 2 / tuning.freedom) ** 2
            weight = weight / weight.sum()
    slope = max(-float(weight @ (u.by_ground_speed * by_speed)) * size, tuning.least_slope)
    gradient = np.empty(len(state))
    gradient[OFFSET] = weight @ u.by_offset
    gradient[LOG_SCALE] = weight @ u.by_log_scale
    gradient[LOG_STRENGTH] = weight @ u.value
    gradient[WHEELS:] = weight * u.value
    return BodySlip(slip, -direction * gradient / slope, slope, u.value, weight)
