# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Information gained in a drive on each parameter: deviation before and after, and bits.

A Gaussian whose standard deviation falls from s0 to s loses log2(s0 / s) bits of entropy. Where it
hardly falls, either nothing was learned, or only a combination with another parameter: the two are
confounded if the deviation would fall with the other one known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    GRAVITY_BIAS,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_PER_DEMAND,
    SLIP_SINKAGE,
    StateLayout,
)

LEARNED, ASSUMED, CONFOUNDED = 'learned', 'assumed', 'confounded'
LEARNED_SHARE = 0.7
"""Deviation over the prior one below which a parameter counts as learned [-]: half a bit."""
RELATIVE = 'of its value'
"""Unit of the deviation of a logarithm."""

STRENGTH_ERROR, SHEAR_MODULUS_ERROR, STIFFNESS_ERROR = 0.05, 0.2, 0.25
"""Deviation of these factors by model errors that no length of drive averages out [ln] (simulator
A, whose soil follows the filter's laws)."""
MOVED_SHARE = 0.4
"""The same as a share of the change from the configured value [-], for soils that follow other laws
(set on simulators A, B and C, seeds 8500 to 8507)."""
_STRENGTH, _STIFFNESS = 'soil.friction_angle_deg', 'soil.frictional_modulus'
_COMMON = (
    (_STRENGTH, RELATIVE, SHEAR_STRENGTH),
    ('soil.shear_modulus', RELATIVE, SHEAR_MODULUS),
    ('effects.slip_sinkage_exponent.n1', '-', SLIP_SINKAGE),
    ('stress centroid', 'of the entrance angle', CENTROID),
    ('slip per traction coefficient', '-', SLIP_PER_DEMAND),
    ('share of a rut that stays', '-', RUT_SHARE),
    ('accelerometer bias', 'm/s^2', GRAVITY_BIAS),
)
"""Name, unit of the deviations, entry of the state; the friction angle by its tangent."""
_MODEL_ERRORS = (
    (SHEAR_STRENGTH, STRENGTH_ERROR),
    (SHEAR_MODULUS, SHEAR_MODULUS_ERROR),
    (SLIP_SINKAGE, 0.0),
)
_SAME_FACTOR = {'soil.cohesion': _STRENGTH, 'soil.cohesive_modulus': _STIFFNESS}
"""Parameters that the filter scales by one common factor, and so never separates."""


@dataclass(frozen=True)
class Taught:
    """Information gained on one parameter."""

    name: str
    unit: str
    prior_std: float
    std: float
    bits: float  # gained, not below 0
    verdict: str  # LEARNED, ASSUMED or CONFOUNDED
    confounded_with: str = ''

    def in_words(self) -> str:
        """Return the verdict for a reader."""
        if self.verdict == LEARNED:
            return f'learned, {self.bits:.1f} bits'
        if self.verdict == CONFOUNDED:
            return f'not distinguishable from {self.confounded_with}'
        return 'assumed, not learned'

    def with_unit(self, std: float) -> str:
        """Return a deviation for a reader."""
        if self.unit == RELATIVE:
            digits = 0 if std > 0.1 else 1
            return f'{100.0 * std:.{digits}f} %'
        return f'{std:.2g} {self.unit}'.rstrip(' -')


def with_model_errors(mean: FloatArray, covariance: FloatArray, layout: StateLayout) -> FloatArray:
    """Return the (size, size) covariance of the filter with the model errors of the soil added."""
    P, moved = covariance.copy(), MOVED_SHARE * mean
    for i, error in _MODEL_ERRORS:
        P[i, i] += error**2 + moved[i] ** 2
    k = layout.stiffness
    P[k, k] += STIFFNESS_ERROR**2 + np.outer(moved[k], moved[k])
    return P


class Parameter(NamedTuple):
    """A parameter as a linear function of the state."""

    name: str
    unit: str
    row: FloatArray  # (size,)
    like: str = ''
    """Parameter from which no drive separates it, whatever its variance in the filter."""


class Teaching:
    """Compares the covariance of the filter with that at its start, (size, size)."""

    def __init__(self, parameters: Sequence[Parameter], start: FloatArray) -> None:
        self._parameters = parameters
        self._rows = np.array([parameter.row for parameter in parameters])
        self._prior = _deviations(self._rows @ start @ self._rows.T)

    @classmethod
    def of_filter(cls, layout: StateLayout, start: FloatArray) -> Teaching:
        """Return the comparison for the parameters of the estimator's filter."""
        identity = np.eye(layout.size)
        parameters = [Parameter(name, unit, identity[i]) for name, unit, i in _COMMON]
        mean = identity[layout.stiffness].mean(axis=0)
        parameters.append(Parameter(_STIFFNESS, RELATIVE, mean))
        zeros = identity[layout.torque_zero]
        if len(zeros):
            # Model errors of a torque end in its zero (simulator B: 5 of 10 that counted as learned
            # were more than two deviations off).
            row = zeros.sum(axis=0) / math.sqrt(len(zeros))
            parameters.append(Parameter('torque zeros', 'N m', row, _STRENGTH))
        return cls(parameters, start)

    def judged(self, covariance: FloatArray) -> tuple[Taught, ...]:
        """Return the information gained, by the (size, size) covariance after a drive."""
        P = self._rows @ covariance @ self._rows.T
        std = _deviations(P)
        found: dict[str, Taught] = {}
        for i, parameter in enumerate(self._parameters):
            prior = float(self._prior[i])
            now = prior if parameter.like else float(std[i])
            learned = now < LEARNED_SHARE * prior
            other = parameter.like or ('' if learned else self._confounded_with(i, P, std))
            found[parameter.name] = Taught(
                parameter.name,
                parameter.unit,
                prior,
                now,
                max(math.log2(prior / now), 0.0) if prior > 0.0 and now > 0.0 else 0.0,
                LEARNED if learned else CONFOUNDED if other else ASSUMED,
                other,
            )
        for name, factor in _SAME_FACTOR.items():
            if factor in found:
                same = found[factor]
                found[name] = Taught(
                    name, same.unit, same.prior_std, same.prior_std, 0.0, CONFOUNDED, factor
                )
        return tuple(found.values())

    def _confounded_with(self, i: int, P: FloatArray, std: FloatArray) -> str:
        """Return the parameter that would have to be known for this one to be learned; '' = none.

        Given another one, the deviation is s sqrt(1 - rho^2).
        """
        scale = np.maximum(std[i] * std, np.finfo(float).tiny)
        correlation = np.abs(P[i] / scale)
        correlation[i] = 0.0
        other = int(np.argmax(correlation))
        rest = float(std[i]) * math.sqrt(max(1.0 - float(correlation[other]) ** 2, 0.0))
        known = rest < LEARNED_SHARE * float(self._prior[i])
        return self._parameters[other].name if known else ''


def _deviations(covariance: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
