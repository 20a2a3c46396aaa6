# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What is told besides slip, sinkage and pull: margin, slopes, sideways motion, rate of sinkage."""

from __future__ import annotations

import math
from math import isnan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.inputs.seen_noise import SeenNoise
from wheel_terra_estimator.estimation.judgement.pull_margin import PullMargin
from wheel_terra_estimator.estimation.judgement.slip import BodyMotion, WheelSlip
from wheel_terra_estimator.estimation.judgement.slip_on_slope import Instant as SlopeInstant
from wheel_terra_estimator.estimation.judgement.slip_on_slope import SlopeCurve
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, gain_of, median
from wheel_terra_estimator.estimation.sideways import (
    SidewaysInputs,
    SidewaysMotion,
    SidewaysRover,
)
from wheel_terra_lab.traction_filter.soil import SHEAR_MODULUS, STRENGTH, SoilLogs

FloatArray = NDArray[np.float64]
_RATE_TIME = 0.5  # low-pass of the rate of sinkage [s]
SHARP_TURN = 0.3  # lateral motion above which slip says nothing of a slope


def seen_noise(configuration: Configuration, sensors: SensorFigures) -> SeenNoise:
    """Return what learns the noise of the sensors."""
    figures = configuration.sensors
    rates = {
        'accelerometer': figures.imu_rate,
        'gyro': figures.imu_rate,
        'wheel_rate': figures.wheel_odometry_rate,
        'torque': figures.wheel_odometry_rate,
        'sinkage': figures.sinkage_rate,
    }
    return SeenNoise(sensors, rates, given=configuration.stated)


class Scene(NamedTuple):
    """What is known of the rover after a cycle; one entry per wheel where there are several."""

    time: float  # [s]
    body: BodyMotion
    rims: tuple[float, ...]  # [m/s], nan = unknown
    steering: tuple[float, ...]  # [rad]
    slips: tuple[WheelSlip, ...]
    loads: LoadState
    force_told: bool  # of late
    pull: FloatArray  # [N]
    sinkage: FloatArray  # [m]
    wheel_strength: FloatArray  # ln, against the others
    soil: SoilLogs
    direction: float  # of the drive, 1 or -1
    settled: bool  # the contacts are new no more


class _Depths(NamedTuple):
    time: float = NAN  # [s]
    sinkage: FloatArray | None = None  # (n,) [m]
    rate: FloatArray | None = None  # (n,) [m/s]


class Companions:
    """Parts that ask the estimator and are not asked by it.

    Parameters
    ----------
    configuration, rover, sensors
        Constants.
    """

    def __init__(self, configuration: Configuration, rover: Rover, sensors: SensorFigures) -> None:
        self._rover, self._sensors, self._soil = rover, sensors, configuration.soil
        self.margin = PullMargin(rover.wheel_count, WheelModels(configuration))
        self.slopes = SlopeCurve()
        self.sideways = SidewaysMotion(SidewaysRover.of(configuration))
        self._depths: Component[_Depths] = Component(_Depths())
        self._parts: tuple[Component[Any], ...] = (
            self.margin,
            self.slopes,
            self.sideways,
            self._depths,
        )

    def reset(self) -> None:
        """Go back to the start of a run."""
        for part in self._parts:
            part.reset()

    def snapshot(self) -> tuple[Any, ...]:
        """Return the memory."""
        return tuple([part.snapshot() for part in self._parts])

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        for part, state in zip(self._parts, snapshot, strict=True):
            part.restore(state)

    @property
    def sinkage_rate(self) -> FloatArray:
        """Rate of sinkage (n,) [m/s]."""
        rate = self._depths.state.rate
        return np.zeros(self._rover.wheel_count) if rate is None else rate

    def due(self, time: float) -> bool:
        """Return whether a cycle has passed at a time [s]."""
        before = self._depths.state.time
        return isnan(before) or time - before >= self._rover.period - 1e-4

    def follow(self, scene: Scene) -> None:
        """Take what is known after a cycle."""
        before = self._depths.state
        dt = 0.0 if isnan(before.time) else scene.time - before.time
        self._follow_depths(scene, dt)
        if self.margin.due(scene.time):
            demand = scene.direction * scene.loads.slope_share
            self.margin.update(scene.time, _wheels(scene), demand)
        self._learn_slopes(scene, dt)
        self._follow_sideways(scene)

    def _follow_depths(self, scene: Scene, dt: float) -> None:
        before, depth = self._depths.state, scene.sinkage.copy()
        rate = np.zeros(len(depth)) if before.rate is None else before.rate
        if dt > 0.0 and before.sinkage is not None:
            rate = rate + gain_of(dt, _RATE_TIME) * ((depth - before.sinkage) / dt - rate)
        self._depths.state = _Depths(scene.time, depth, rate)

    def _learn_slopes(self, scene: Scene, dt: float) -> None:
        """Learn what slopes cost, from the wheels that turn straight on settled contacts."""
        turning = [
            (wheel, abs(rim))
            for wheel, rim in zip(scene.slips, scene.rims, strict=True)
            if wheel.judged and abs(rim) > self._rover.low_rim
        ]
        steady = scene.settled and scene.body.lateral_motion <= SHARP_TURN and bool(turning)
        self.slopes.update(
            SlopeInstant(
                scene.time,
                scene.direction * scene.loads.slope_share if scene.force_told else NAN,
                median([wheel.slip for wheel, _ in turning]) if steady else 0.0,
                median([wheel.std for wheel, _ in turning]) if steady else 1.0,
                median([rim for _, rim in turning]) * dt if steady else 0.0,
                scene.direction,
            )
        )

    def _follow_sideways(self, scene: Scene) -> None:
        loads, body, soil = scene.loads, scene.body, self._soil
        strength = math.exp(float(scene.soil.mean[STRENGTH]))
        self.sideways.update(
            scene.time,
            SidewaysInputs(
                speed=body.speed,
                speed_std=body.speed_std,
                yaw_rate=body.yaw_rate,
                yaw_rate_std=body.yaw_rate_std,
                rims=scene.rims,
                steering=scene.steering,
                loads=loads.load,
                pulls=tuple(scene.pull.tolist()),
                sinkage=tuple(scene.sinkage.tolist()),
                lateral_force=loads.force[1] if loads.force_known else NAN,
                lateral_force_std=self._sensors.specific_force_bias_std,
                cohesion=float(soil.cohesion) * strength,
                tan_friction=math.tan(float(soil.friction_angle)) * strength,
                shear_modulus=float(soil.shear_modulus)
                * math.exp(float(scene.soil.mean[SHEAR_MODULUS])),
            ),
        )


def _wheels(scene: Scene) -> list[WheelState]:
    """Return the wheels on the soil that was learned, as the models take them."""
    strength, modulus, _ = scene.soil.mean.tolist()
    own = (scene.wheel_strength - scene.wheel_strength.mean()).tolist()
    return [
        WheelState(1.0, sinkage, load, strength + extra, modulus)
        for sinkage, load, extra in zip(scene.sinkage.tolist(), scene.loads.load, own, strict=True)
    ]
