# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Free parameters in coordinates whose prior is a standard normal.

Priors of the soil are wide on purpose: one that is wrong by more than stated must not come out as a
missing effect. Where their widths come from: docs/diagnose.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.terramechanics.effects import by_variant
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.soil import Soil


class _Number(NamedTuple):
    """A soil number that a diagnosis refits, and its deviation where none is stated.

    Deviations are in the space of the coordinate: of logarithms, else absolute (of cohesion a share
    of its value, beside a part that does not vanish with it).
    """

    field: str  # of ``Soil``
    logarithmic: bool
    lower: float
    upper: float
    unit: str
    found_by: str  # of published numbers
    by_tests: float  # beside the wheel
    published: float
    proxy: float  # another soil


_NUMBERS = {
    'stiffness': _Number('frictional_modulus', True, 0.05, 20.0, '-', 'plate', 0.10, 0.40, 0.60),
    'sinkage_exponent': _Number(
        'sinkage_exponent', False, 0.15, 3.0, '-', 'plate', 0.05, 0.20, 0.40
    ),
    'tan_friction': _Number('friction_angle', True, 0.05, 1.7, '-', 'shear box', 0.05, 0.25, 0.25),
    'shear_modulus': _Number('shear_modulus', True, 1e-4, 0.5, 'm', 'shear box', 0.10, 0.80, 1.0),
    'cohesion': _Number('cohesion', False, 0.0, math.inf, 'Pa', 'shear box', 0.20, 0.50, 0.50),
    'peak_stress_ratio': _Number(
        'peak_stress_ratio', False, 0.02, 0.95, '-', 'assumed', 0.03, 0.10, 0.10
    ),
    'leaving_angle_ratio': _Number(
        'leaving_angle_ratio', False, -1.2, 0.0, '-', 'assumed', 0.03, 0.25, 0.25
    ),
}
"""Name of the coordinate -> the number; ``stiffness`` is a factor on both bearing moduli."""
_COHESION_FLOOR = {'': 10.0, 'published': 50.0, 'proxy': 50.0}  # [Pa], beside the share
_LEAST_RATIO = 0.03  # deviation of an angle ratio that is nought, where all are known to a share
_OF_PROXIES = ('stiffness', 'sinkage_exponent', 'shear_modulus')  # known worse than published ones

# Stated uncertainties are often optimistic: the coordinates are this many times wider, and the
# evidence weighs both widths.
WIDENING = 2.5
WORSE_SHARE = 0.15  # prior probability of the wider one
# (width in units of the coordinates, prior probability): as stated, and worse.
BELIEVED_WIDTHS = ((1.0 / WIDENING, 1.0 - WORSE_SHARE), (1.0, WORSE_SHARE))
# The same for the strength of an effect: small, large and very large ones (the catalogue cannot
# know the size of the machine) are weighed against each other, with these shares.
EFFECT_SCALES = (0.3, 2.0, 10.0)
EFFECT_SHARES = (0.45, 0.45, 0.10)
# During fits the strength is held loosely, so that a strong effect is not pulled back.
LOOSE = 6.0
# By which prepared beds differ, shares of the soil numbers: forces of repeated plates and wheels on
# CMU's bed (measured/cmu_single_wheel) scatter by 2 to 17 %, 8 % pooled; of the friction assumed.
BED_SCATTER = {'stiffness': 0.10, 'tan_friction': 0.03}
# By which a soil differs from day to day, with moisture and density: shares, cohesion in Pa;
# assumed, published loams of two moistures differ by more.
DAY_SCATTER = {'stiffness': 0.30, 'tan_friction': 0.10, 'cohesion': 500.0}
# From one to the next, and from the first row to the last.
SCATTER = {'row': BED_SCATTER, 'sweep': BED_SCATTER, 'day': DAY_SCATTER, 'drift': DAY_SCATTER}
BED = 'bed'  # owner of what the bed of the rows under diagnosis has in excess of a reference's
_FARTHEST_BED = 8.0  # deviations by which it may differ


@dataclass(frozen=True)
class Coordinate:
    """One free parameter: transform(centre + scale u) with u ~ N(0, 1) in [lower, upper]."""

    owner: str  # ``soil``, ``bed``, or the name of an effect
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
    # Stated deviations in one unit of the coordinate [-]. An effect that is on is held by 0.4 of
    # its deviation: wider it takes what is missing (CMU's smooth wheel with its own fit, HIT's lugs
    # against the smooth twin).
    stated: float = 1.0

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


def soil_coordinates(
    soil: Soil, stated: Mapping[str, float], source: str = '', known_to: float | None = None
) -> tuple[Coordinate, ...]:
    """Return the soil numbers that a diagnosis refits, centred on the configured soil.

    ``stated``: field of ``Soil`` -> deviation that the configuration states [SI]; ``source``: class
    of the source of the rest (``soil.source``). ``known_to``, the share of its value to which every
    number is known (``--soil-known-to``), goes before all.
    """
    found = []
    for name, n in _NUMBERS.items():
        value = float(getattr(soil, n.field))
        if known_to is not None:
            deviation, said = known_to, 'as said: --soil-known-to'
            if not n.logarithmic:
                deviation = known_to * abs(value)
            if name == 'cohesion':
                deviation += _COHESION_FLOOR['']
            elif n.found_by == 'assumed':
                deviation = max(deviation, _LEAST_RATIO)
        elif n.field in stated:
            deviation, said = stated[n.field], 'stated'
            if name == 'tan_friction':
                deviation = deviation * (1.0 / math.cos(value) ** 2) / math.tan(value)
            elif n.logarithmic:
                deviation /= max(value, 1e-9)
        else:
            deviation = {'': n.by_tests, 'published': n.published, 'proxy': n.proxy}[source]
            if name == 'cohesion':
                deviation = deviation * value + _COHESION_FLOOR[source]
            kind = 'proxy' if source == 'proxy' and name in _OF_PROXIES else n.found_by
            said = f'class of source: {kind if source else "soil tests"}'
        centre = {'stiffness': 1.0, 'tan_friction': math.tan(value)}.get(name, value)
        least, most = min(n.lower, centre), max(n.upper, centre)
        if n.logarithmic:
            centre, least, most = map(math.log, (centre, least, most))
        scale = WIDENING * deviation
        found.append(
            Coordinate(
                'soil', name, centre, scale, (least - centre) / scale, (most - centre) / scale,
                n.logarithmic, unit=n.unit, source=said, stated=WIDENING,
            )
        )  # fmt: skip
    return tuple(found)


def bed_coordinates() -> tuple[Coordinate, ...]:
    """Return the factors by which the bed under diagnosis differs from that of a reference."""
    farthest = _FARTHEST_BED / WIDENING
    return tuple(
        Coordinate(BED, name, 0.0, WIDENING * std, -farthest, farthest, True, stated=WIDENING)
        for name, std in BED_SCATTER.items()
    )


def narrowed(coordinates: Sequence[Coordinate], factor: float) -> tuple[Coordinate, ...]:
    """Return the coordinates with the priors of configured numbers so many times narrower."""
    return tuple(
        replace(
            c,
            scale=c.scale / factor,
            lower=factor * c.lower,
            upper=factor * c.upper,
            stated=c.stated / factor,
        )
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
