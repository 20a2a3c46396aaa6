# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Free parameters in coordinates whose prior is a standard normal.

Soil parameters move under a prior that is wide on purpose: a soil number which is wrong by more
than stated must not come out as a missing effect.

How well each soil number is known: as stated, as the user says, or by the class of its source.

A soil that somebody measured beside the wheel is known better than one out of a table of another
laboratory, and that better than a proxy. The deviations of the classes of published numbers are the
scatter between such numbers and the soils of ``config/soils/*_fit.yaml``, which were fitted to
wheels (docs/diagnose.md); few fits, so that they are rounded and shared by numbers of one kind of
test.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.terramechanics.effects import by_variant
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.soil import Soil

# Deviations in the space of the coordinates: of logarithms (stiffness, tan phi, K), else absolute;
# of cohesion a share of its value, beside a part that does not vanish with it.
_CLASSES = {  # soil tests, published
    'stiffness': (0.10, 0.40),
    'sinkage_exponent': (0.05, 0.20),
    'tan_friction': (0.05, 0.25),
    'shear_modulus': (0.10, 0.80),
    'cohesion': (0.20, 0.50),
    'peak_stress_ratio': (0.03, 0.10),
    'leaving_angle_ratio': (0.03, 0.25),
}
_TESTS, _PUBLISHED = ({key: both[k] for key, both in _CLASSES.items()} for k in (0, 1))
_PROXY = _PUBLISHED | {'stiffness': 0.60, 'sinkage_exponent': 0.40, 'shear_modulus': 1.0}
_COHESION_FLOOR = {'': 10.0, 'published': 50.0, 'proxy': 50.0}  # [Pa], beside the share
_BY_SOURCE = {'': _TESTS, 'published': _PUBLISHED, 'proxy': _PROXY}
_PLATE = ('stiffness', 'sinkage_exponent')
_ASSUMED = ('peak_stress_ratio', 'leaving_angle_ratio')
_LEAST_RATIO = 0.03  # deviation of an angle ratio that is nought, where all are known to a share
_STATED = {'stiffness': 'frictional_modulus', 'tan_friction': 'friction_angle'}


@dataclass(frozen=True)
class Deviation:
    """Standard deviation in the space of the coordinate, and where it comes from."""

    value: float
    source: str


def deviations(
    soil: Soil, stated: Mapping[str, float], source: str = '', known_to: float | None = None
) -> dict[str, Deviation]:
    """Return the deviation of each soil number that a diagnosis refits.

    ``stated``: field of ``Soil`` -> deviation that the configuration states [SI]; ``source``: class
    of the source of the rest (``soil.source``). ``known_to``, the share of its value to which every
    number is known (``--soil-known-to``), goes before all.
    """
    found = {}
    for name, usual in _BY_SOURCE[source].items():
        field = _STATED.get(name, name)
        if known_to is not None:
            found[name] = Deviation(_of_share(soil, name, known_to), 'as said: --soil-known-to')
        elif field in stated:
            found[name] = Deviation(_of_stated(soil, name, stated[field]), 'stated')
        else:
            part = usual * float(soil.cohesion) + _COHESION_FLOOR[source]
            value = part if name == 'cohesion' else usual
            found[name] = Deviation(value, f'class of source: {_class(name, source)}')
    return found


def _class(name: str, source: str) -> str:
    if not source:
        return 'soil tests'
    if name in _ASSUMED:
        return 'assumed'
    if source == 'proxy' and name in (*_PLATE, 'shear_modulus'):
        return 'proxy'
    return 'plate' if name in _PLATE else 'shear box'


def _of_stated(soil: Soil, name: str, std: float) -> float:
    if name == 'tan_friction':
        slope = 1.0 / math.cos(float(soil.friction_angle)) ** 2
        return std * slope / math.tan(float(soil.friction_angle))
    if name == 'stiffness':
        return std / max(float(soil.frictional_modulus), 1e-9)
    return std / float(soil.shear_modulus) if name == 'shear_modulus' else std


def _of_share(soil: Soil, name: str, share: float) -> float:
    if name in ('stiffness', 'tan_friction', 'shear_modulus'):
        return share
    value = share * abs(float(getattr(soil, name)))
    if name == 'cohesion':
        return value + _COHESION_FLOOR['']
    return max(value, _LEAST_RATIO) if name in _ASSUMED else value


# Stated uncertainties are often optimistic: the coordinates are this many times wider, and the
# evidence weighs both widths.
WIDENING = 2.5
WORSE_SHARE = 0.15  # prior probability of the wider one
# (width in units of the coordinates, prior probability): as stated, and worse.
BELIEVED_WIDTHS = ((1.0 / WIDENING, 1.0 - WORSE_SHARE), (1.0, WORSE_SHARE))
AS_THEY_ARE = ((1.0, 1.0),)  # of coordinates that are held on purpose
# The same for the strength of an effect: small, large and very large ones (the catalogue cannot
# know the size of the machine) are weighed against each other, with these shares.
EFFECT_SCALES = (0.3, 2.0, 10.0)
EFFECT_SHARES = (0.45, 0.45, 0.10)
# Bounds of the fits: factor on the bearing moduli, and shear deformation modulus [m].
_STIFFNESS = (0.05, 20.0)
_SHEAR_MODULUS = (1e-4, 0.5)
# During fits the strength is held loosely, so that a strong effect is not pulled back.
LOOSE = 6.0


@dataclass(frozen=True)
class Coordinate:
    """One free parameter: transform(centre + scale u) with u ~ N(0, 1) in [lower, upper]."""

    owner: str  # ``soil``, or the name of an effect
    # Field of ``Soil`` (``stiffness`` = both bearing moduli), or parameter of the effect
    name: str
    centre: float  # as ``scale``, in the space of the transform
    scale: float
    # Bounds of u
    lower: float = -math.inf
    upper: float = math.inf
    logarithmic: bool = False  # the transform is the exponential
    # ``believed`` (configured: soil, effects that are on), ``strength`` (first of a candidate, or
    # without effect at its centre) or ``shape``
    role: str = 'believed'
    neutral: float = 0.0  # value of an effect's parameter at which the term vanishes
    # For people
    unit: str = '-'
    meaning: str = ''
    source: str = ''  # where the deviation of a configured number comes from

    @property
    def stated(self) -> float:
        """Stated deviations in one unit of the coordinate [-].

        An effect that is on is held by 0.4 of its deviation: wider it takes what is missing (CMU's
        smooth wheel with its own fit, HIT's lugs against the smooth twin).
        """
        return WIDENING if self.owner == 'soil' else 1.0

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


def soil_coordinates(soil: Soil, known: Mapping[str, Deviation]) -> tuple[Coordinate, ...]:
    """Return the free soil parameters, centred on the configured soil.

    ``known``: name of the coordinate -> its deviation (``deviations``).
    """

    def make(
        name: str, centre: float, lower: float, upper: float, logarithmic: bool, unit: str = '-'
    ) -> Coordinate:
        scale = WIDENING * known[name].value
        return Coordinate(
            'soil', name, centre, scale, (lower - centre) / scale, (upper - centre) / scale,
            logarithmic, unit=unit, source=known[name].source,
        )  # fmt: skip

    def logarithm(name: str, value: float, lower: float, upper: float, unit: str) -> Coordinate:
        ends = math.log(min(lower, value)), math.log(max(upper, value))
        return make(name, math.log(value), *ends, True, unit)

    def shifted(name: str, lower: float, upper: float, unit: str = '-') -> Coordinate:
        value = float(getattr(soil, name))
        return make(name, value, min(lower, value), max(upper, value), False, unit)

    stiffness = logarithm('stiffness', 1.0, *_STIFFNESS, '-')
    return (
        replace(stiffness, meaning='factor on both bearing moduli'),
        shifted('sinkage_exponent', 0.15, 3.0),
        logarithm('tan_friction', math.tan(float(soil.friction_angle)), 0.05, 1.7, '-'),
        logarithm('shear_modulus', float(soil.shear_modulus), *_SHEAR_MODULUS, 'm'),
        shifted('cohesion', 0.0, math.inf, 'Pa'),
        shifted('peak_stress_ratio', 0.02, 0.95),
        shifted('leaving_angle_ratio', -1.2, 0.0),
    )


def narrowed(coordinates: Sequence[Coordinate], factor: float) -> tuple[Coordinate, ...]:
    """Return the coordinates with the priors of configured numbers so many times narrower."""
    return tuple(
        replace(c, scale=c.scale / factor, lower=factor * c.lower, upper=factor * c.upper)
        if c.role == 'believed'
        else c
        for c in coordinates
    )


def effect_coordinates(effect: Effect) -> tuple[Coordinate, ...]:
    """Return the free parameters of an effect with the priors of the catalogue."""
    found = []
    for p in effect.parameters:
        if not p.free:
            continue
        lower, upper = ((end - p.prior_mean) / p.prior_scale for end in (p.lower, p.upper))
        if p.prior == 'half_normal':
            up = p.default >= p.prior_mean
            lower, upper = (max(lower, 0.0), upper) if up else (lower, min(upper, 0.0))
        strength = p.neutral == p.prior_mean or p is effect.parameters[0]
        found.append(
            Coordinate(
                effect.name, p.name, p.prior_mean, p.prior_scale, lower, upper,
                role='strength' if strength else 'shape',
                neutral=p.neutral, unit=p.unit, meaning=p.meaning,
            )
        )  # fmt: skip
    return tuple(found)


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
                centre, scale = values[p.name], std
                found.append(
                    Coordinate(
                        name, p.name, centre, scale,
                        (p.lower - centre) / scale, (p.upper - centre) / scale,
                        neutral=p.neutral, unit=p.unit, meaning=p.meaning, source='stated',
                    )
                )  # fmt: skip
    return tuple(found)


def loose_precision(coordinates: Sequence[Coordinate]) -> FloatArray:
    """Return the (P,) prior precision of u during fits."""
    return np.array([LOOSE**-2 if c.role == 'strength' else 1.0 for c in coordinates])


def bounds(coordinates: Sequence[Coordinate]) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper bounds of u as arrays."""
    return (np.array([c.lower for c in coordinates]), np.array([c.upper for c in coordinates]))
