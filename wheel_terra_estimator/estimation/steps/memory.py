# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Everything of the estimator that changes, except filter, classifier and warning."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.speed_process import Attitude, InertialWindow
from wheel_terra_estimator.estimation.stuck_warning import StuckAssessment

_NAN = math.nan


@dataclass
class Memory:
    """Everything that changes, except the filter, the classifier and the warning."""

    origin: int = 0  # [ns]
    stamp: int = 0
    time: float = 0.0  # [s] since origin
    cycle_time: float | None = None
    inertial_time: float | None = None
    odometry_time: float | None = None
    torque_time: float | None = None
    reference_time: float | None = None
    reference_gap: float = 10.0  # [s] between fixes, smoothed
    still_since: float | None = None
    sliding_until: float = -1.0
    rims_at_cycle: list[float] = field(default_factory=list)  # without the turning; [] = no cycle
    rim_speed: list[float] = field(default_factory=list)  # nan = unknown
    rate_time: list[float] = field(default_factory=list)
    torque_sum: list[float] = field(default_factory=list)
    torque_count: list[int] = field(default_factory=list)
    torque_held: list[float] = field(default_factory=list)
    torque_now: list[float] = field(default_factory=list)  # smoothed, by sensor or model
    sinkage_sum: list[float] = field(default_factory=list)
    sinkage_count: list[int] = field(default_factory=list)
    sinkage_rejected: list[int] = field(default_factory=list)
    sinkage_time: list[float] = field(default_factory=list)  # [s], -inf = none yet
    leaving_angle: list[float] = field(default_factory=list)
    leaving_time: list[float] = field(default_factory=list)
    rest_since: list[float] = field(default_factory=list)  # nan = not at rest
    resting: list[bool] = field(default_factory=list)
    slip: list[float] = field(default_factory=list)
    slip_std: list[float] = field(default_factory=list)
    wheel_class: list[int] = field(default_factory=list)
    window: InertialWindow = field(default_factory=InertialWindow)
    attitude: Attitude = field(default_factory=Attitude)
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)  # specific force of the last window
    force_known: bool = False
    yaw_rate: float = 0.0
    turned_up: float = 0.0  # nose-up rotation over the last rover length [rad]
    side_slow: float = 0.0
    renewal: float = 0.0  # how far turning has changed while the contacts form anew
    unrest: float = 0.0  # change of speed that contacts under change may bring [m/s]
    side_motion: float = 0.0  # of the outer wheels over the fastest rim speed
    turned_over: float = 0.0  # and the travel that it took [m]
    yaw_bias: float = 0.0  # zeros of the gyro, learned at rest [rad/s]
    pitch_bias: float = 0.0
    gyro_bias_weight: float = 0.0
    demand: float = _NAN  # of the ground, as a share of the load, over the last second
    unrest_time: float = -math.inf  # when the contacts last changed [s]
    ratio: float = 0.95  # remembered v / rim speed
    ratio_std: float = 0.3
    ratio_walk: float = 0.13  # of v / rim speed [1/sqrt(m)]
    drive_direction: float = 0.0
    starting: bool = True
    fresh_travel: float = 0.0  # [m] since the start or the last change of direction
    load: list[float] = field(default_factory=list)
    torque_excess: list[float] = field(default_factory=list)  # reading less model, smoothed
    # Smoothed derivatives of each wheel: of torque and pull as in `WheelForces`, of the bearing law
    # (ln load) by v/(r w) and by n1.
    torque_slopes: list[tuple[float, ...] | None] = field(default_factory=list)
    pull_slopes: list[tuple[float, ...] | None] = field(default_factory=list)
    bearing_slopes: list[tuple[float, ...] | None] = field(default_factory=list)
    pull: list[float] = field(default_factory=list)
    model_pull: list[float] = field(default_factory=list)  # without the sum's correction
    pull_std: list[float] = field(default_factory=list)
    sinkage_rate: list[float] = field(default_factory=list)
    sinkage_rate_std: list[float] = field(default_factory=list)
    pull_margin: list[float] = field(default_factory=list)
    margin_time: float = -10.0
    rejected: dict[str, int] = field(default_factory=dict)
    reference_rejected: int = 0  # in a row
    reference_doubt: float = 0.0  # residual of the last rejected fix [m/s]
    effort: list[float] = field(
        default_factory=lambda: [_NAN, _NAN]
    )  # torque over load, fast and slow
    unloaded_since: list[float] = field(default_factory=list)  # nan = carries its load
    unloaded: list[bool] = field(default_factory=list)
    steepness: float = 0.0
    effort_time: float = 0.0
    stand_pull: list[float] = field(default_factory=list)
    nis: dict[str, float] = field(default_factory=dict)
    assessment: StuckAssessment | None = None

    def copy(self) -> Memory:
        """Return a copy whose lists are its own."""
        values: dict[str, Any] = {}
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, (list, dict, InertialWindow, Attitude)):
                value = value.copy()
            values[entry.name] = value
        return Memory(**values)

    @classmethod
    def fresh(cls, n: int) -> Memory:
        """Return the memory of a rover with `n` wheels of which nothing is known."""
        return cls(
            rim_speed=[_NAN] * n,
            rate_time=[-1e9] * n,
            torque_sum=[0.0] * n,
            torque_count=[0] * n,
            torque_held=[_NAN] * n,
            torque_now=[0.0] * n,
            sinkage_sum=[0.0] * n,
            sinkage_count=[0] * n,
            sinkage_rejected=[0] * n,
            sinkage_time=[-math.inf] * n,
            leaving_angle=[_NAN] * n,
            leaving_time=[-1e9] * n,
            rest_since=[_NAN] * n,
            resting=[False] * n,
            unloaded_since=[_NAN] * n,
            unloaded=[False] * n,
            stand_pull=[_NAN] * n,
            slip=[0.0] * n,
            slip_std=[1.0] * n,
            wheel_class=[int(SlipClass.UNKNOWN)] * n,
            pull=[0.0] * n,
            model_pull=[0.0] * n,
            torque_excess=[0.0] * n,
            torque_slopes=[None] * n,
            pull_slopes=[None] * n,
            bearing_slopes=[None] * n,
            sinkage_rate=[0.0] * n,
            sinkage_rate_std=[1.0] * n,
            pull_margin=[0.0] * n,
            rejected={'reference': 0, 'sinkage': 0},
        )
