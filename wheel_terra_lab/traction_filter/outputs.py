# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The set of estimates of a stamp."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.steering import Headings
from wheel_terra_estimator.estimation.estimates import (
    NO_ENTRAPMENT_IN_SIGHT,
    EstimateSet,
    SlipClass,
    SlipOnSlope,
)
from wheel_terra_estimator.estimation.judgement.slip import WheelSlip
from wheel_terra_estimator.estimation.judgement.stuck.forecast import LONGEST_TIME, WheelForecast
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.sideways import Sideways
from wheel_terra_estimator.estimation.words import (
    MissingInputs,
    faults_in_words,
    reasons_in_words,
)
from wheel_terra_lab.traction_filter.soil import NamedSoil

FloatArray = NDArray[np.float64]
_LEAST_VARIANCE = 1e-12  # of a speed [(m/s)^2]
_UNKNOWN_STD = 1.0  # of a slip velocity [m/s]
_UNLOADED_STD = 1.0  # of the pull of a wheel in the air [N]
_BELIEVED_LOAD = 0.1
"""Sum of the loads over the rover's weight below which the specific force is none of a rover on
its wheels."""
_LEAST_FORCE_STD = 1e-4
"""Least deviation of a load or a pull, over a wheel's share of the weight."""
_NOTHING_AHEAD = WheelForecast(0.0, LONGEST_TIME, NO_ENTRAPMENT_IN_SIGHT)


class Sources(NamedTuple):
    """What the estimator knows at a stamp; arrays are (n,)."""

    stamp: int  # [ns]
    speed: float  # [m/s]
    speed_variance: float
    yaw_rate: float  # [rad/s]
    yaw_rate_std: float
    headings: Headings
    rims: tuple[float, ...]  # [m/s], nan = unknown
    slips: tuple[WheelSlip, ...]
    loads: LoadState
    pull: FloatArray  # [N]
    pull_std: FloatArray
    sinkage: FloatArray  # [m]
    sinkage_std: FloatArray
    sinkage_rate: FloatArray  # [m/s]
    soil: NamedSoil
    assessment: StuckAssessment
    margin: tuple[float, ...]  # [N]
    slip_on_slope: SlipOnSlope | None
    sideways: Sideways | None


def estimate_set(
    rover: Rover, sensors: SensorFigures, given: Sources, missing: MissingInputs
) -> EstimateSet:
    """Return the outputs of a stamp."""
    ahead = given.assessment.wheels or (_NOTHING_AHEAD,) * rover.wheel_count
    velocity, velocity_std = _slip_velocity(rover, sensors, given)
    load_std, pull_std = _force_deviations(rover, given)
    sinkage_std = np.hypot(given.sinkage_std, sensors.sinkage_zero_std)
    return EstimateSet(
        stamp=given.stamp,
        slip=np.array([wheel.slip for wheel in given.slips]),
        slip_std=np.array([wheel.std for wheel in given.slips]),
        slip_velocity=velocity,
        slip_velocity_std=velocity_std,
        drawbar_pull=given.pull,
        drawbar_pull_std=pull_std,
        sinkage=given.sinkage.copy(),
        sinkage_std=np.minimum(sinkage_std, rover.rim_radius),
        sinkage_rate=given.sinkage_rate,
        sinkage_rate_std=np.sqrt(2.0) * given.sinkage_std,
        normal_load=np.array(given.loads.load),
        normal_load_std=load_std,
        slip_class=np.array(
            [SlipClass.LOW if wheel.judged else SlipClass.UNKNOWN for wheel in given.slips],
            dtype=np.uint8,
        ),
        rim_travel_left=np.array([wheel.travel for wheel in ahead]),
        pull_margin=np.array(given.margin),
        soil_names=given.soil.names,
        soil=given.soil.soil,
        soil_std=given.soil.std,
        forward_velocity=float(given.speed),
        forward_velocity_variance=max(float(given.speed_variance), _LEAST_VARIANCE),
        yaw_rate=given.yaw_rate,
        yaw_rate_variance=given.yaw_rate_std**2,
        stuck=given.assessment.stuck,
        stuck_probability=np.array([wheel.probability for wheel in ahead]),
        time_to_stuck=np.array([wheel.time for wheel in ahead]),
        stuck_direction=given.assessment.direction,
        stuck_confirmed=given.assessment.confirmed,
        reasons=reasons_in_words(given.rims, given.slips, given.assessment),
        faults=faults_in_words(missing),
        slip_on_slope=given.slip_on_slope,
        sideways=given.sideways,
    )


def _slip_velocity(
    rover: Rover, sensors: SensorFigures, given: Sources
) -> tuple[FloatArray, FloatArray]:
    """Return r w - v of each wheel and its deviation [m/s]."""
    rims, headings = np.array(given.rims), given.headings
    told = ~np.isnan(rims)
    by_speed, by_yaw_rate = np.array(headings.by_speed), np.array(headings.by_yaw_rate)
    ground = by_speed * given.speed + by_yaw_rate * given.yaw_rate
    variance = by_speed**2 * given.speed_variance + (given.yaw_rate_std * by_yaw_rate) ** 2
    rim_std = sensors.wheel_rate_std * np.array(rover.slip_radius)
    std = np.sqrt(variance + rim_std**2)
    return np.where(told, rims - ground, 0.0), np.where(told, std, _UNKNOWN_STD)


def _force_deviations(rover: Rover, given: Sources) -> tuple[FloatArray, FloatArray]:
    """Return the deviations of load and pull of each wheel [N], never 0."""
    load = np.array(given.loads.load)
    share = rover.mass * rover.gravity / len(load)
    if load.sum() < _BELIEVED_LOAD * rover.mass * rover.gravity:
        # Upside down, in free fall or wrongly mounted: nothing is known.
        return np.full(len(load), share), np.full(len(load), share)
    known = rover.load_std * float(load.mean())
    loads = np.full(len(load), known) if given.loads.force_known else load
    pulls = np.minimum(given.pull_std, np.where(load > 0.0, load, _UNLOADED_STD))
    least = _LEAST_FORCE_STD * share
    return np.maximum(loads, least), np.maximum(pulls, least)
