# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A sparse law in the closures of the model, found from rows that no listed effect explains.

A closure (a target) is changed by a sum of coefficients times dimensionless features of the row::

    x = sum of coefficient * feature        x' = L x / (L + |x|)   (bounded by L)

Factors are multiplied by exp(x'), offsets are increased by x'. Each pair of target and feature is
one parameter here (``torque_by_rim_speed``); a feature may be the product of two
(``torque_by_slip_times_load``). Configuration files state them as flat lists.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS, Effect, EffectParameter

NAME = 'learned_closure'
REFERENCE_SPEED = 0.05  # rim speed at which the feature rim_speed is 0 [m/s]
_BY = '_by_'
_LEAST = 1e-9  # keeps logarithms finite
_BAND = 0.25  # half width of a band of slip, at its foot [-]
_AFTER_CONTACT = ('torque', 'drawbar_pull')  # may depend on the sinkage
_TIMES = '_times_'  # between the features of a product
_OF_PRODUCTS = ('bearing_pressure', 'exponent', 'friction', *_AFTER_CONTACT, 'sinkage')
# Soil that peaks at some shear displacement and then softens, or a reading that is off there.
_IN_A_BAND = ('friction', 'torque', 'drawbar_pull', 'sinkage')


@dataclass(frozen=True)
class Target:
    """A closure that a law may change."""

    factor: bool  # True: multiplied by exp(x); False: x is added, in ``unit``
    bound: float  # L, the greatest change of the logarithm, or in ``unit``
    usual: float  # size of a change that would not surprise: scale of the prior
    unit: str
    meaning: str


@dataclass(frozen=True)
class Feature:
    """A dimensionless feature of a row."""

    value: Callable[[Contact], Quantity]  # (contact) -> feature
    # Range over which it usually varies; the prior of a coefficient is in proportion to 1/spread
    spread: float
    columns: tuple[str, ...]  # columns of a table of which one must vary; none: always available
    meaning: str
    targets: tuple[str, ...] = ()  # closures that may use it; none: all
    factors: tuple[str, ...] = ()  # names of the two features that a product multiplies


TARGETS: Mapping[str, Target] = {
    'bearing_pressure': Target(True, 0.9, 0.2, '-', 'pressure under the wheel'),
    'exponent': Target(False, 0.6, 0.15, '-', 'sinkage exponent N'),
    'peak_angle': Target(False, 0.25, 0.08, 't1', 'angle of greatest stress'),
    'leaving_angle': Target(False, 0.3, 0.08, 't1', 'leaving angle'),
    'friction': Target(True, 0.5, 0.1, '-', 'tan(phi)'),
    'cohesion': Target(True, 2.0, 0.5, '-', 'cohesion'),
    'shear_modulus': Target(True, 1.5, 0.4, '-', 'shear deformation modulus K'),
    'shear_radius': Target(True, 0.15, 0.03, '-', 'radius at which the soil shears'),
    'torque': Target(False, 0.3, 0.03, 'W r', 'torque'),
    'drawbar_pull': Target(False, 0.3, 0.05, 'W', 'drawbar pull'),
    'sinkage': Target(False, 0.1, 0.01, 'r', 'sinkage'),
}


def _over(onset: float) -> Callable[[Contact], Quantity]:
    def excess(contact: Contact) -> Quantity:
        return np.maximum(np.abs(contact.slip) - onset, 0.0)

    return excess


def _near(middle: float) -> Callable[[Contact], Quantity]:
    def band(contact: Contact) -> Quantity:
        away = (np.abs(contact.slip) - middle) / _BAND
        inside = np.maximum(1.0 - away * away, 0.0)
        return inside * inside

    return band


def _weight(contact: Contact) -> Quantity:
    """Weight of soil of the wheel's size, rho g b r^2 [N]: what loads are compared with."""
    return contact.density * contact.gravity * contact.width * contact.radius * contact.radius


def _load(contact: Contact) -> Quantity:
    share = contact.stated_load / _weight(contact)
    return np.log(np.maximum(share, _LEAST)) / np.log(10.0)


def _rim_speed(contact: Contact) -> Quantity:
    speed = np.maximum(contact.rim_speed / REFERENCE_SPEED, 1e-3)
    decades = np.log(speed) / np.log(10.0)
    return np.where(np.isnan(contact.rim_speed), 0.0, decades)


def _torque_squared(contact: Contact) -> Quantity:
    lever = np.maximum(contact.stated_load * contact.radius, _LEAST)
    square = contact.torque * np.abs(contact.torque) * contact.direction
    return square / (lever * _weight(contact) * contact.radius)


_SINGLE: Mapping[str, Feature] = {
    'one': Feature(lambda c: 1.0 + 0.0 * c.slip, 1.0, (), 'everywhere alike'),
    'slip': Feature(lambda c: np.abs(c.slip), 0.5, ('slip',), '|s|'),
    'slip_squared': Feature(lambda c: c.slip * c.slip, 0.4, ('slip',), 's^2'),
    'slip_over_02': Feature(_over(0.2), 0.35, ('slip',), '|s| beyond 0.2'),
    'slip_over_04': Feature(_over(0.4), 0.25, ('slip',), '|s| beyond 0.4'),
    'slip_over_06': Feature(_over(0.6), 0.15, ('slip',), '|s| beyond 0.6'),
    'slip_near_02': Feature(_near(0.2), 0.5, ('slip',), 'a band of |s| around 0.2', _IN_A_BAND),
    'slip_near_04': Feature(_near(0.4), 0.5, ('slip',), 'a band of |s| around 0.4', _IN_A_BAND),
    'slip_near_06': Feature(_near(0.6), 0.5, ('slip',), 'a band of |s| around 0.6', _IN_A_BAND),
    'load': Feature(_load, 0.3, ('normal_load',), 'log10 of W/(rho g b r^2)'),
    'lug': Feature(lambda c: c.lug_height / c.radius, 0.06, ('lug_height',), 'h/r'),
    'width': Feature(lambda c: c.width / c.radius, 0.3, ('wheel_width', 'wheel_radius'), 'b/r'),
    'rim_speed': Feature(
        _rim_speed, 0.5, ('angular_velocity',), 'decades of rim speed over 0.05 m/s'
    ),
    'pass': Feature(lambda c: c.pass_number - 1.0, 1.0, ('pass_number',), 'earlier passes'),
    'slope': Feature(lambda c: c.slope + 0.0 * c.slip, 0.2, ('slope',), 'slope [rad]'),
    'depth': Feature(
        lambda c: 1.0 - np.cos(c.entrance_angle),
        0.08,
        ('slip', 'normal_load'),
        'z/r',
        _AFTER_CONTACT,
    ),
    # The curve of a torque sensor that bends: the first term beyond a gain (the reading changes
    # with its square, whatever the load), odd so that both ways are alike.
    'torque_squared': Feature(
        _torque_squared, 0.15, ('slip', 'normal_load'), 'T |T| / (W r * rho g b r^3)', ('torque',)
    ),
    # What one channel of a load cell picks up of another.
    'pull': Feature(
        lambda c: c.drawbar_pull * c.direction / np.maximum(c.stated_load, _LEAST),
        0.3,
        ('slip', 'normal_load'),
        'F/W',
        ('torque',),
    ),
    'torque': Feature(
        lambda c: c.torque * c.direction / np.maximum(c.stated_load * c.radius, _LEAST),
        0.4,
        ('slip', 'normal_load'),
        'T/(W r)',
        ('drawbar_pull',),
    ),
}


def _product(first: str, second: str) -> Feature:
    """Return a feature for what acts only where two others do."""
    one, other = _SINGLE[first], _SINGLE[second]
    return Feature(
        lambda c: one.value(c) * other.value(c),
        one.spread * other.spread,
        (*one.columns, *other.columns),
        f'{one.meaning} times {other.meaning}',
        _OF_PRODUCTS,
        (first, second),
    )


PRODUCTS: Mapping[str, Feature] = {
    f'{first}{_TIMES}{second}': _product(first, second)
    for first, second in (
        ('slip', 'load'),
        ('slip', 'lug'),
        ('slip', 'width'),
        ('slip', 'rim_speed'),
        ('slip', 'pass'),
        ('load', 'lug'),
        ('load', 'rim_speed'),
        ('load', 'pass'),
    )
}
FEATURES: Mapping[str, Feature] = {**_SINGLE, **PRODUCTS}


def allowed(target: str, feature: str) -> bool:
    """Whether the feature is known where the target is needed, and means something there."""
    # A constant change of a soil number is another soil, not a law.
    constant = feature == 'one' and target not in OUTPUTS
    return not constant and target in (FEATURES[feature].targets or TARGETS)


def term_name(target: str, feature: str) -> str:
    """Return the name of the parameter that holds the coefficient."""
    return f'{target}{_BY}{feature}'


def pair_of(name: str) -> tuple[str, str]:
    """Return target and feature of a parameter."""
    target, _, feature = name.partition(_BY)
    return target, feature


def coefficients_of(
    targets: Sequence[str], features: Sequence[str], coefficients: Sequence[float]
) -> dict[str, float]:
    """Return parameter -> coefficient of a law given as flat lists.

    Raises ValueError for lists of unequal length, a pair that is not allowed, or one that is given
    twice.
    """
    if not len(targets) == len(features) == len(coefficients):
        raise ValueError(
            f'has {len(targets)} targets, {len(features)} features and {len(coefficients)} '
            'coefficients; state as many of each'
        )
    found: dict[str, float] = {}
    for target, feature, value in zip(targets, features, coefficients, strict=True):
        if target not in TARGETS or feature not in FEATURES or not allowed(target, feature):
            raise ValueError(f'cannot change {target} by {feature}; see the list of laws in docs')
        name = term_name(target, feature)
        if name in found:
            raise ValueError(f'changes {target} by {feature} twice')
        found[name] = float(value)
    return found


def changes(contact: Contact, p: SimpleNamespace, targets: Iterable[str]) -> dict[str, Quantity]:
    """Return target -> bounded change x' for those targets that the law has."""
    total: dict[str, Quantity] = {}
    for name, coefficient in vars(p).items():
        target, feature = pair_of(name)
        if target in targets:
            part = coefficient * FEATURES[feature].value(contact)
            total[target] = total[target] + part if target in total else part
    return {
        target: TARGETS[target].bound * x / (TARGETS[target].bound + np.abs(x))
        for target, x in total.items()
    }


_BEFORE = tuple(name for name in TARGETS if name not in OUTPUTS)
_IN_CONTACT = {'bearing_pressure': 'bearing_modulus', 'friction': 'tan_friction'}


def _change_closures(contact: Contact, p: SimpleNamespace) -> None:
    for target, x in changes(contact, p, _BEFORE).items():
        if target == 'exponent':
            contact.sinkage_exponent = np.maximum(contact.sinkage_exponent + x, 0.1)
        elif target == 'peak_angle':
            contact.peak_ratio = contact.peak_ratio + x
        elif target == 'leaving_angle':
            contact.leaving_ratio = np.minimum(contact.leaving_ratio + x, 0.0)
        else:
            name = _IN_CONTACT.get(target, target)
            setattr(contact, name, getattr(contact, name) * np.exp(x))


def _change_outputs(contact: Contact, p: SimpleNamespace) -> None:
    for target, x in changes(contact, p, OUTPUTS).items():
        if target == 'sinkage':
            contact.sinkage = contact.sinkage + x * contact.radius
        elif target == 'drawbar_pull':
            added = contact.direction * x * contact.stated_load
            contact.drawbar_pull = contact.drawbar_pull + added
        else:
            added = contact.direction * x * contact.stated_load * contact.radius
            contact.torque = contact.torque + added


def _parameter(target: str, feature: str) -> EffectParameter:
    scale = TARGETS[target].usual / FEATURES[feature].spread
    return EffectParameter(
        term_name(target, feature),
        TARGETS[target].unit,
        0.0,
        -40.0 * scale,
        40.0 * scale,
        scale,
        'normal',
        f'change of {TARGETS[target].meaning} with {FEATURES[feature].meaning}',
    )


EFFECT = Effect(
    name=NAME,
    claim='a law found from rows that no listed effect explains',
    symbol="target *= exp(x') or target += x', x = sum of coefficient * feature",
    parameters=tuple(
        _parameter(target, feature)
        for target in TARGETS
        for feature in FEATURES
        if allowed(target, feature)
    ),
    validity='inside the range of the rows that it was found from, for the same wheel and soil',
    source='sparse terms in the closures of a known model, after the idea of Brunton, Proctor and '
    'Kutz 2016 (doi 10.1073/pnas.1517384113); chosen by evidence instead of thresholds',
    candidate=False,
    sparse=True,
    on_inputs=_change_closures,
    on_outputs=_change_outputs,
)
