# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The set of estimates of a stamp."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.loads import LoadState
from wheel_terra_estimator.estimation.contacts.pulls import PullState
from wheel_terra_estimator.estimation.estimates import (
    NO_ENTRAPMENT_IN_SIGHT,
    EstimateSet,
    SlipClass,
    SlipOnSlope,
)
from wheel_terra_estimator.estimation.filter.sinkage_process import SinkageState
from wheel_terra_estimator.estimation.filter.state import SHEAR_MODULUS, SHEAR_STRENGTH, StateLayout
from wheel_terra_estimator.estimation.judgement.slip import WheelSlip
from wheel_terra_estimator.estimation.judgement.stuck.forecast import LONGEST_TIME, WheelForecast
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckAssessment
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import TINY
from wheel_terra_estimator.estimation.sideways import Sideways
from wheel_terra_estimator.estimation.taught import with_model_errors
from wheel_terra_estimator.estimation.words import reasons_in_words

_LEAST_LOAD_SHARE = 0.1
"""Sum of the loads over the rover's weight below which the rover is not on its wheels [-]."""
_LEAST_FORCE_STD = 1e-4
"""Least deviation of a load or a pull, over a wheel's share of the weight."""
_NOTHING_AHEAD = WheelForecast(0.0, LONGEST_TIME, NO_ENTRAPMENT_IN_SIGHT)


_LEARNED = (
    'soil.friction_angle_deg',
    'soil.cohesion',
    'soil.shear_modulus',
    'soil.frictional_modulus',
    'soil.cohesive_modulus',
)
"""Configuration keys of the learned soil parameters, in the order of the values."""


class Sources(NamedTuple):
    """Quantities from which the outputs of a stamp are computed."""

    stamp: int  # [ns]
    mean: FloatArray  # (size,) of the filter
    covariance: FloatArray  # (size, size)
    speed: float  # [m/s]
    speed_variance: float
    yaw_rate: float  # [rad/s]
    yaw_rate_std: float
    rims: Floats  # [m/s], nan = unknown
    slips: tuple[WheelSlip, ...]
    loads: LoadState
    pulls: PullState
    sinkage: SinkageState
    margin: Floats  # [N]
    assessment: StuckAssessment
    slip_on_slope: SlipOnSlope | None
    sideways: Sideways | None = None


class Outputs:
    """Composes the sets of estimates of one rover."""

    def __init__(
        self,
        configuration: Configuration,
        rover: Rover,
        sensors: SensorFigures,
        layout: StateLayout,
    ) -> None:
        soil = configuration.soil
        self._tan_friction = math.tan(float(soil.friction_angle))
        self._cohesion, self._modulus = float(soil.cohesion), float(soil.shear_modulus)
        self._frictional = float(soil.frictional_modulus)
        self._cohesive = float(soil.cohesive_modulus)
        self._rover, self._layout = rover, layout
        self._sinkage_zero = sensors.sinkage_zero_std

    def estimate_set(self, given: Sources, faults: dict[str, str]) -> EstimateSet:
        """Return the outputs of a stamp; `faults` are those of the inputs, in words."""
        layout, rover, n = self._layout, self._rover, self._rover.wheel_count
        variance = np.diagonal(given.covariance)[layout.sinkage]
        added_variance = self._sinkage_zero**2 + given.sinkage.unmodelled_std**2
        sinkage_std = np.sqrt(np.maximum(variance, 0.0) + added_variance)
        soil_covariance = with_model_errors(given.mean, given.covariance, layout)
        names, soil, soil_std = self.learned_soil(given.mean, soil_covariance)
        load_std, pull_std = self._force_deviations(given)
        ahead = given.assessment.wheels or (_NOTHING_AHEAD,) * n
        per_wheel = {
            'slip': [wheel.slip for wheel in given.slips],
            'slip_std': [wheel.std for wheel in given.slips],
            'slip_velocity': [wheel.velocity for wheel in given.slips],
            'slip_velocity_std': [wheel.velocity_std for wheel in given.slips],
            'drawbar_pull': given.pulls.pull,
            'drawbar_pull_std': pull_std,
            'sinkage_rate': given.sinkage.rate,
            'sinkage_rate_std': given.sinkage.rate_std,
            'normal_load': given.loads.load,
            'normal_load_std': load_std,
            'rim_travel_left': [wheel.travel for wheel in ahead],
            'pull_margin': given.margin,
            'stuck_probability': [wheel.probability for wheel in ahead],
            'time_to_stuck': [wheel.time for wheel in ahead],
        }
        # One array is faster than fourteen small ones.
        rows = np.array(list(per_wheel.values()))
        return EstimateSet(
            stamp=given.stamp,
            sinkage=given.mean[layout.sinkage].copy(),
            sinkage_std=np.minimum(sinkage_std, rover.rim_radius),
            slip_class=np.array(
                [SlipClass.LOW if wheel.judged else SlipClass.UNKNOWN for wheel in given.slips],
                dtype=np.uint8,
            ),
            soil_names=names,
            soil=soil,
            soil_std=soil_std,
            forward_velocity=given.speed,
            forward_velocity_variance=max(given.speed_variance, TINY),
            yaw_rate=given.yaw_rate,
            yaw_rate_variance=given.yaw_rate_std**2,
            stuck=given.assessment.stuck,
            stuck_direction=given.assessment.direction,
            stuck_confirmed=given.assessment.confirmed,
            stuck_clears=given.assessment.clears,
            reasons=reasons_in_words(given.rims, given.slips, given.assessment),
            faults=faults,
            slip_on_slope=given.slip_on_slope,
            sideways=given.sideways,
            **dict(zip(per_wheel, rows, strict=True)),
        )

    def learned_soil(
        self, mean: FloatArray, covariance: FloatArray
    ) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
        """Return names, values and standard deviations of the learned soil parameters."""
        k = self._layout.stiffness
        strength = math.exp(float(mean[SHEAR_STRENGTH]))
        strength_std = math.sqrt(float(covariance[SHEAR_STRENGTH, SHEAR_STRENGTH]))
        tangent = self._tan_friction * strength
        angle = math.degrees(math.atan(tangent))
        angle_std = math.degrees(tangent * strength_std / (1.0 + tangent * tangent))
        cohesion = self._cohesion * strength
        modulus = self._modulus * math.exp(float(mean[SHEAR_MODULUS]))
        modulus_std = math.sqrt(float(covariance[SHEAR_MODULUS, SHEAR_MODULUS]))
        count = self._layout.wheel_count
        stiffness = math.exp(float(np.add.reduce(mean[k])) / count)
        spread = float(np.add.reduce(covariance[k, k], axis=None)) / (count * count)
        stiffness_std = math.sqrt(max(spread, 0.0))
        frictional, cohesive = self._frictional * stiffness, self._cohesive * stiffness
        values = angle, cohesion, modulus, frictional, cohesive
        deviations = (
            angle_std,
            cohesion * strength_std,
            modulus * modulus_std,
            frictional * stiffness_std,
            abs(cohesive) * stiffness_std,
        )
        return _LEARNED, np.array(values), np.array(deviations)

    def _force_deviations(self, given: Sources) -> tuple[list[float], list[float]]:
        """Return the deviations of load and pull of each wheel [N], never 0."""
        rover, load = self._rover, given.loads.load
        share = rover.mass * rover.gravity / rover.wheel_count
        if sum(load) < _LEAST_LOAD_SHARE * rover.mass * rover.gravity:
            # Upside down, in free fall or wrongly mounted: nothing is known.
            return [share] * len(load), [share] * len(load)
        mean_load_std = (
            math.hypot(rover.load_std, rover.indeterminate_load_std) * sum(load) / len(load)
        )
        loads = [mean_load_std if given.loads.force_known else w for w in load]
        pulls = [
            min(std, w + w_std) for std, w, w_std in zip(given.pulls.std, load, loads, strict=True)
        ]
        least = _LEAST_FORCE_STD * share
        return [max(std, least) for std in loads], [max(std, least) for std in pulls]
