# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Free parameters in coordinates whose prior is a standard normal.

Soil parameters move under a prior that is wide on purpose: a soil number which is wrong by more
than stated must not come out as a missing effect.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.terramechanics.effects import by_variant
from wheel_terra_estimator.terramechanics.effects.base import Effect, EffectParameter
from wheel_terra_estimator.terramechanics.soil import Soil

FloatArray = NDArray[np.float64]

# Standard deviations of the soil parameters where the configuration states none.
STIFFNESS_STD = 0.10  # of ln k
EXPONENT_STD = 0.05
FRICTION_STD = 0.05  # of ln tan(phi)
SHEAR_MODULUS_STD = 0.10  # of ln K
COHESION_STD = 0.20  # of c, plus COHESION_FLOOR
COHESION_FLOOR = 10.0  # [Pa]
PEAK_RATIO_STD = 0.03
LEAVING_RATIO_STD = 0.03
# Stated uncertainties are often optimistic: the coordinates are this many times wider, and the
# evidence weighs both widths.
WIDENING = 2.5
WORSE_SHARE = 0.15  # prior probability of the wider one
# (width in units of the coordinates, prior probability): as stated, and worse.
SOIL_WIDTHS = ((1.0 / WIDENING, 1.0 - WORSE_SHARE), (1.0, WORSE_SHARE))
AS_THEY_ARE = ((1.0, 1.0),)  # of coordinates that are held on purpose
# The same for the strength of an effect: small, large and very large ones (the catalogue cannot
# know the size of the machine) are weighed against each other, with these shares.
EFFECT_SCALES = (0.3, 2.0, 10.0)
EFFECT_SHARES = (0.45, 0.45, 0.10)
# During fits the strength is held loosely, so that a strong effect is not pulled back.
LOOSE = 6.0


@dataclass(frozen=True)
class Coordinate:
    """One free parameter; value = transform(centre + scale u) with u ~ N(0, 1) in [lower, upper].

    Attributes
    ----------
    owner : str
        ``soil``, or the name of an effect.
    name : str
        Field of ``Soil`` (``stiffness`` = both bearing moduli), or parameter of the effect.
    centre, scale : float
        In the space of the transform.
    lower, upper : float
        Bounds of u.
    role : str
        ``soil``, ``strength`` (first of an effect, or without effect at its centre) or ``shape``.
    logarithmic : bool
        The transform is the exponential.
    neutral : float
        Value of an effect's parameter at which the term vanishes.
    unit, meaning : str
        For people.
    """

    owner: str
    name: str
    centre: float
    scale: float
    lower: float = -math.inf
    upper: float = math.inf
    logarithmic: bool = False
    role: str = 'soil'
    neutral: float = 0.0
    unit: str = '-'
    meaning: str = ''

    @property
    def key(self) -> str:
        """Unique name."""
        return f'{self.owner}.{self.name}'

    def value(self, u: FloatArray | float) -> FloatArray:
        """Return the parameter's value [its unit]."""
        raw = self.centre + self.scale * np.asarray(u, dtype=float)
        return np.exp(raw) if self.logarithmic else raw

    def deviation(self, u: float, std: float) -> float:
        """Return the standard deviation of the value for one of u."""
        slope = float(self.value(u)) if self.logarithmic else 1.0
        return abs(slope * self.scale * std)

    def coordinate(self, value: float) -> float:
        """Return u for a value."""
        return ((math.log(value) if self.logarithmic else value) - self.centre) / self.scale


def soil_coordinates(soil: Soil, stated: Mapping[str, float]) -> tuple[Coordinate, ...]:
    """Return the free soil parameters, centred on the configured soil.

    Parameters
    ----------
    stated : mapping
        Field of ``Soil`` -> standard deviation that the configuration states explicitly [SI].
    """

    def width(field: str, usual: float, relative_to: float = 1.0) -> float:
        return WIDENING * (stated[field] / relative_to if field in stated else usual)

    def logarithm(field: str, value: float, usual: float) -> Coordinate:
        unit = {'shear_modulus': 'm'}.get(field, '-')
        scale = width(field, usual, value)
        return Coordinate('soil', field, math.log(value), scale, -6.0, 6.0, True, unit=unit)

    def shifted(
        field: str, value: float, scale: float, low: float, high: float, unit: str = '-'
    ) -> Coordinate:
        low, high = min(low, value), max(high, value)
        return Coordinate(
            'soil', field, value, scale, (low - value) / scale, (high - value) / scale, unit=unit
        )

    tan_friction = math.tan(float(soil.friction_angle))
    slope = 1.0 / math.cos(float(soil.friction_angle)) ** 2
    friction = width('friction_angle', FRICTION_STD, tan_friction / slope)
    cohesion = float(soil.cohesion)
    return (
        Coordinate(
            'soil',
            'stiffness',
            0.0,
            width('frictional_modulus', STIFFNESS_STD, max(float(soil.frictional_modulus), 1e-9)),
            -8.0,
            8.0,
            True,
            meaning='factor on both bearing moduli',
        ),
        shifted(
            'sinkage_exponent',
            float(soil.sinkage_exponent),
            width('sinkage_exponent', EXPONENT_STD),
            0.15,
            3.0,
        ),
        Coordinate(
            'soil',
            'tan_friction',
            math.log(tan_friction),
            friction,
            math.log(0.05 / tan_friction) / friction,
            math.log(1.7 / tan_friction) / friction,
            True,
        ),
        logarithm('shear_modulus', float(soil.shear_modulus), SHEAR_MODULUS_STD),
        shifted(
            'cohesion',
            cohesion,
            width('cohesion', COHESION_STD * cohesion + COHESION_FLOOR),
            0.0,
            math.inf,
            'Pa',
        ),
        shifted(
            'peak_stress_ratio',
            float(soil.peak_stress_ratio),
            width('peak_stress_ratio', PEAK_RATIO_STD),
            0.02,
            0.95,
        ),
        shifted(
            'leaving_angle_ratio',
            float(soil.leaving_angle_ratio),
            width('leaving_angle_ratio', LEAVING_RATIO_STD),
            -1.2,
            0.0,
        ),
    )


def narrowed(coordinates: Sequence[Coordinate], factor: float) -> tuple[Coordinate, ...]:
    """Return the coordinates with the soil's prior so many times narrower."""
    return tuple(
        replace(c, scale=c.scale / factor, lower=factor * c.lower, upper=factor * c.upper)
        if c.owner == 'soil'
        else c
        for c in coordinates
    )


def effect_coordinates(effect: Effect) -> tuple[Coordinate, ...]:
    """Return the free parameters of an effect with the priors of the catalogue."""
    return tuple(_of_parameter(effect, p) for p in effect.parameters if p.free)


def _of_parameter(effect: Effect, p: EffectParameter) -> Coordinate:
    lower, upper = (
        (p.lower - p.prior_mean) / p.prior_scale,
        (p.upper - p.prior_mean) / p.prior_scale,
    )
    if p.prior == 'half_normal':
        lower, upper = (
            (max(lower, 0.0), upper) if p.default >= p.prior_mean else (lower, min(upper, 0.0))
        )
    return Coordinate(
        effect.name,
        p.name,
        p.prior_mean,
        p.prior_scale,
        lower,
        upper,
        role='strength' if p.neutral == p.prior_mean or p is effect.parameters[0] else 'shape',
        neutral=p.neutral,
        unit=p.unit,
        meaning=p.meaning,
    )


def base_coordinates(
    settings: Mapping[str, Mapping[str, float]],
    stated: Mapping[str, Mapping[str, float]],
    catalogue: Mapping[str, Effect],
) -> tuple[Coordinate, ...]:
    """Return the parameters of effects that are on already and whose deviation is stated."""
    found = []
    for name, values in by_variant(settings).items():
        if catalogue[name].sparse:
            continue  # a law stays as it was proposed
        for p in catalogue[name].parameters:
            std = stated.get(catalogue[name].base_name, {}).get(p.name, 0.0)
            if std > 0.0:
                centre = values[p.name]
                found.append(
                    Coordinate(
                        name,
                        p.name,
                        centre,
                        std,
                        (p.lower - centre) / std,
                        (p.upper - centre) / std,
                        neutral=p.neutral,
                        unit=p.unit,
                        meaning=p.meaning,
                    )
                )
    return tuple(found)


def loose_precision(coordinates: Sequence[Coordinate]) -> FloatArray:
    """Return the (P,) prior precision of u during fits."""
    return np.array([LOOSE**-2 if c.role == 'strength' else 1.0 for c in coordinates])


def bounds(coordinates: Sequence[Coordinate]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bounds of u as arrays."""
    return (
        np.array([c.lower for c in coordinates]),
        np.array([c.upper for c in coordinates]),
    )
