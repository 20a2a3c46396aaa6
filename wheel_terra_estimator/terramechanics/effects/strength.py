# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Another shear strength than configured: of the soil, at a smooth rim, with speed or pressure."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    Form,
    magnitude,
    relative_pressure,
    shape,
    signed,
)


def _cohesion(contact: Contact, p: SimpleNamespace) -> None:
    contact.cohesion = contact.cohesion + p.delta


COHESION = Effect(
    name='cohesion',
    claim='more or less soil cohesion than configured',
    symbol='tau = (c + delta + sigma tan(phi)) (1 - exp(-j/K))',
    parameters=(
        signed('delta', 'Pa', 300.0, -5000.0, 10000.0, 500.0, 'cohesion added to soil.cohesion'),
    ),
    confounded_with={
        'bulldozing': 'a load series',
        'grouser_thrust': 'other lugs or none; a load series',
        'rim_friction': 'a load series; rows with higher lugs',
    },
    validity='c + delta not below zero',
    source='Mohr-Coulomb strength in Janosi and Hanamoto 1961 (proceedings, no DOI); '
    'Ding et al. 2010 eq. 18 (doi 10.1007/s11771-010-0021-7)',
    on_inputs=_cohesion,
)


REFERENCE_SPEED = 0.05  # [m/s]; rover speed, below which Ding et al. 2010 saw no influence


def _rate(contact: Contact, p: SimpleNamespace) -> None:
    known = contact.rim_speed > 1e-4
    speed = np.where(known, contact.rim_speed, REFERENCE_SPEED)
    decades = np.log(speed / REFERENCE_SPEED)
    contact.bearing_modulus = contact.bearing_modulus * np.exp(p.bearing * decades)
    shear = np.exp(p.shear * decades)
    contact.cohesion = contact.cohesion * shear
    contact.tan_friction = contact.tan_friction * shear


RATE_DEPENDENCE = Effect(
    name='rate_dependence',
    claim='bearing or shear strength depends on the rim speed',
    symbol='k *= (v_rim/0.05 m/s)^bearing;  c, tan(phi) *= (v_rim/0.05 m/s)^shear',
    parameters=(
        signed('bearing', '-', 0.1, -0.6, 0.6, 0.15, 'exponent of the bearing strength'),
        signed('shear', '-', 0.0, -0.4, 0.4, 0.05, 'exponent of the shear strength'),
    ),
    needs=('angular_velocity',),
    confounded_with={'multipass': 'the same speed on virgin soil and in the rut'},
    validity='rim speed 1 mm/s to 1 m/s; no influence where the speed is not recorded',
    source='own power law; Ding et al. 2010 (doi 10.1007/s11771-010-0021-7): none below 55 mm/s',
    on_inputs=_rate,
)


def _slide(contact: Contact, p: SimpleNamespace) -> None:
    bare = np.exp(-contact.lug_height / p.ring_height)
    contact.rim_share = 1.0 - p.loss * bare
    contact.tan_friction = contact.tan_friction * contact.rim_share


RIM_FRICTION = Effect(
    name='rim_friction',
    claim='soil slides on a smooth rim at less than its internal friction; lugs restore it',
    symbol='tan(phi) *= 1 - loss exp(-h/ring_height)',
    parameters=(
        magnitude('loss', '-', 0.25, 0.0, 0.9, 0.25, 'share of the friction lost at h = 0'),
        shape(
            'ring_height',
            'm',
            0.003,
            0.0005,
            0.05,
            0.002,
            'lug height at which a ring of soil begins to move with the wheel',
            free=False,
        ),
    ),
    needs=('lug_height',),
    confounded_with={'cohesion': 'a load series; a lugged wheel'},
    validity='metal rims in dry sand, with the friction of soil on soil as soil.friction_angle_deg',
    source='Ding et al. 2010 section 2.4 in words (doi 10.1007/s11771-010-0021-7; metal-soil '
    'friction is below soil friction); '
    'formula reconstructed',
    on_inputs=_slide,
)


def _factor(contact: Contact, p: SimpleNamespace) -> None:
    contact.shear_modulus = contact.shear_modulus * np.exp(p.log_factor)


def _with_pressure(contact: Contact, p: SimpleNamespace) -> None:
    growth = np.exp(p.growth * np.log(relative_pressure(contact)))
    contact.shear_modulus = contact.shear_modulus * growth


def _with_slip(contact: Contact, p: SimpleNamespace) -> None:
    contact.shear_modulus = contact.shear_modulus * np.exp(p.by_slip * np.abs(contact.slip))


SHEAR_DEFORMATION = Effect(
    name='shear_deformation',
    claim='more or less shear deformation modulus K than configured',
    form='constant',
    symbol='K *= exp(log_factor)',
    parameters=(signed('log_factor', '-', 0.3, -3.0, 3.0, 0.3, 'logarithm of the factor on K'),),
    needs=('slip',),
    confounded_with={
        'wheel_radius_bias': 'sinkage; visual odometry on hard ground',
        'cohesion': 'slip below 0.2, where K shows most',
    },
    validity='the same as another soil.shear_modulus',
    source='Janosi and Hanamoto 1961 (proceedings, no DOI)',
    candidate=False,
    why_aside='the refitted soil.shear_modulus stands for it',
    on_inputs=_factor,
    other_forms=(
        Form(
            name='pressure',
            claim='the shear deformation modulus K grows with the pressure under the wheel',
            symbol='K *= (W/(b r 3 kPa))^growth',
            parameters=(
                signed('growth', '-', 0.4, -1.5, 1.5, 0.4, 'exponent of the mean pressure'),
            ),
            needs=('normal_load',),
            candidate=True,
            validity='pressures W/(b r) of 0.5 to 20 kPa; invisible at one load',
            source='Wong, Theory of Ground Vehicles (book, no DOI): K of some soils rises with '
            'normal pressure; power law assumed',
            on_inputs=_with_pressure,
        ),
        Form(
            name='slip',
            claim='the shear deformation modulus K changes with slip',
            symbol='K *= exp(by_slip |s|)',
            parameters=(
                signed('by_slip', '-', 1.0, -4.0, 6.0, 1.0, 'growth of ln K with slip or skid'),
            ),
            candidate=True,
            validity='slip to 0.8',
            source='own form',
            on_inputs=_with_slip,
        ),
    ),
)
