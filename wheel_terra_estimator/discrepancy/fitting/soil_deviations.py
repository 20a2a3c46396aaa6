# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How well each soil number is known: as stated, as the user says, or by the class of its source.

A soil that somebody measured beside the wheel is known better than one out of a table of another
laboratory, and that better than a proxy. The deviations of the classes of published numbers are the
scatter between such numbers and the soils of ``config/soils/*_fit.yaml``, which were fitted to
wheels (docs/diagnose.md); few fits, so that they are rounded and shared by
numbers of one kind of test.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

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
