# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil and sensor parameters learned in a drive, as configuration for the next one."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.demand import Climbed
from wheel_terra_estimator.estimation.contacts.equilibrium_slip import steady_pull
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels
from wheel_terra_estimator.estimation.filter.initial_state import OWN_STIFFNESS_SHARE
from wheel_terra_estimator.estimation.filter.state import (
    GRAVITY_BIAS,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    StateLayout,
)
from wheel_terra_estimator.estimation.inputs.inertial import GyroZero
from wheel_terra_estimator.estimation.rover import Rover

_LEVEL = Climbed()
NamedSoil = Callable[[FloatArray, FloatArray], tuple[tuple[str, ...], FloatArray, FloatArray]]


# Variation of soil from place to place, standard deviation of the logarithm [-]. Mean coefficients
# of variation of sand within a site (Phoon and Kulhawy 1999, Canadian Geotechnical Journal 36,
# tables 1 and 3): friction angle 9 %, that is 12 % of the tangent at 37.6 degrees, and cone
# resistance 38 %, taken for the stiffness and, in lack of a source, for the shear modulus.
_STRENGTH_SPREAD = 0.12
_STIFFNESS_SPREAD = 0.38


class Learned:
    """Converts the state of the filter into parameters of the configuration of the drive.

    `start` is the covariance of the filter at the start of a run; `named_soil` returns keys, values
    and deviations of the soil for mean and covariance of the filter.
    """

    _BISECTIONS = 12  # of the strength: to a ten-thousandth

    def __init__(
        self,
        configuration: Configuration,
        layout: StateLayout,
        start: FloatArray,
        named_soil: NamedSoil,
    ) -> None:
        self._configuration, self._layout = configuration, layout
        self._start, self._named_soil = start.copy(), named_soil

    def values(
        self, mean: FloatArray, covariance: FloatArray, zero: GyroZero, climbed: Climbed = _LEVEL
    ) -> dict[str, Any]:
        """Return configuration key -> value, with the deviations ``_std``.

        Soil: the values of ``~/soil``, with deviations that include the variation from place to
        place. Biases: those stated plus the learned ones. Torques and sinkages: as stated, since
        their zeros cannot be separated from the soil. Deviations of sensors: as stated, since a new
        start may bring another bias of the same kind.

        The filter estimates model errors beside the strength. Without these the learned strength
        may be too low for the steepest climb of the drive; then it is the least one that gives that
        pull at the slip observed there.
        """
        found: dict[str, Any] = {}
        mean = mean.copy()
        mean[SHEAR_STRENGTH] = self._strength_that_carried(mean, climbed)
        names, soil, stds = self._named_soil(mean, self._widened(covariance))
        for key, value, std in zip(names, soil.tolist(), stds.tolist(), strict=True):
            name = key.removesuffix('_deg')
            found[key] = value
            found[f'{name}_std{key.removeprefix(name)}'] = std
        sensors = self._configuration.sensors
        force = sensors.specific_force_bias + np.array([self._force_bias(mean), 0.0, 0.0])
        rate = sensors.angular_rate_bias + np.array([0.0, zero.pitch, zero.yaw])
        for name, values in (
            ('torque_zero', sensors.torque_zero),
            ('torque_gain', sensors.torque_gain),
            ('sinkage_zero', sensors.sinkage_zero),
            ('specific_force_bias', force),
            ('angular_rate_bias', rate),
        ):
            found[f'sensors.{name}'] = values.tolist()
            found[f'sensors.{name}_std'] = float(getattr(sensors, f'{name}_std'))
        return found

    def _strength_that_carried(self, mean: FloatArray, climbed: Climbed) -> float:
        """Return the learned strength, or the least one for the steepest climb, if greater."""
        learned = float(mean[SHEAR_STRENGTH])
        stated = 0.0  # of the configured soil
        if not climbed.slip > 0.0 or learned >= stated:
            return learned
        models, rover = self._models

        def lacks(strength: float) -> bool:
            pull = steady_pull(
                models,
                rover,
                np.array([min(climbed.slip, 1.0)]),
                strength=strength,
                shear_modulus=float(mean[SHEAR_MODULUS]),
                stiffness=float(mean[self._layout.stiffness].mean()),
            )
            return float(pull[0]) < climbed.demand

        if not lacks(learned):
            return learned
        low, high = learned, stated
        for _ in range(self._BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if lacks(middle) else (low, middle)
        return high

    @cached_property
    def _models(self) -> tuple[WheelModels, Rover]:
        return contact_models(self._configuration), Rover.from_configuration(self._configuration)

    def _force_bias(self, mean: FloatArray) -> float:
        """Return the part of the state's bias that is the accelerometer's [m/s^2].

        The rest is gravity by attitude errors; both have shares in proportion to their variances.
        """
        own = float(self._configuration.sensors.specific_force_bias_std) ** 2
        both = float(self._start[GRAVITY_BIAS, GRAVITY_BIAS])
        return float(mean[GRAVITY_BIAS]) * own / both if both > 0.0 else 0.0

    def _widened(self, covariance: FloatArray) -> FloatArray:
        """Return the covariance with the variation of the soil from place to place added.

        Not beyond that at the start of the drive, so that restarts in one place do not add up.
        """
        wide, stiffness = covariance.copy(), self._layout.stiffness
        for entry, spread in (
            ((SHEAR_STRENGTH, SHEAR_STRENGTH), _STRENGTH_SPREAD),
            ((SHEAR_MODULUS, SHEAR_MODULUS), _STIFFNESS_SPREAD),
            ((stiffness, stiffness), _STIFFNESS_SPREAD),
        ):
            learned, before = float(covariance[entry].mean()), float(self._start[entry].mean())
            wide[entry] = max(learned, min(learned + spread**2, before))
        # The start of the next run adds the wheels' own part again.
        wide[stiffness, stiffness] /= 1.0 + OWN_STIFFNESS_SHARE**2 / self._layout.wheel_count
        return wide
