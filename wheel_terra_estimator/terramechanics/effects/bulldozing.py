# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil that the wheel pushes ahead, or aside with its flank, resists."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect, Form, magnitude
from wheel_terra_estimator.terramechanics.stresses import gauss_rule, mobilised_share

_LEAST_FRICTION = 0.02  # tan(phi); Terzaghi's factors divide by it


def wedge_resistance(contact: Contact, depth: Quantity) -> Quantity:
    """Passive resistance of soil to an upright wall, per width [N/m] (Hegedus 1960, no DOI).

    D1 (c h + D2 rho g h^2/2) at the depth h [m] of its foot.
    """
    friction = np.arctan(contact.soil_friction)
    wedge = 0.25 * np.pi - 0.5 * friction  # angle of the failure plane, Xc
    cot = 1.0 / np.tan(wedge)
    d1 = cot + np.tan(wedge + friction)
    d2 = cot + cot * cot * contact.soil_friction
    weight = contact.density * contact.gravity
    return d1 * (contact.cohesion * depth + 0.5 * d2 * weight * depth**2)


def _blade(contact: Contact) -> Quantity:
    """Width of the wheel as a plate across its motion, its share along the wheel [m].

    b without sideways motion, none at a slip angle of 90 degrees.
    """
    cosine, sine = contact.heading()
    return (contact.width * cosine + 2.0 * contact.rim_radius * np.abs(sine)) * cosine


def _push(contact: Contact, p: SimpleNamespace) -> None:
    depth = contact.radius * (1.0 - np.cos(contact.entrance_angle))
    resistance = _blade(contact) * wedge_resistance(contact, depth)
    contact.drawbar_pull = contact.drawbar_pull - contact.direction * p.kb * resistance


def _earth_pressure(contact: Contact, p: SimpleNamespace) -> None:
    friction = np.arctan(np.maximum(contact.soil_friction, _LEAST_FRICTION))
    tan, cos = np.tan(friction), np.cos(friction)
    half = 0.25 * np.pi + 0.5 * friction
    turn = np.exp(2.0 * (0.75 * np.pi - 0.5 * friction) * tan)
    n_q = 0.5 * turn / np.cos(half) ** 2
    n_c = (n_q - 1.0) / tan
    n_gamma = 2.0 * (n_q + 1.0) * tan / (1.0 + 0.4 * np.sin(4.0 * friction))
    k_c = (n_c - tan) * cos * cos
    k_gamma = (2.0 * n_gamma / tan + 1.0) * cos * cos
    approach = contact.entrance_angle  # arccos(1 - 2 z/D)
    depth = contact.radius * (1.0 - np.cos(approach))
    weight = contact.density * contact.gravity
    # z sin(a + phi) / (2 sin a cos phi), which also holds at a = 0
    front = 0.5 * (depth + contact.radius * np.tan(0.5 * approach) * np.cos(approach) * tan)
    pressure = 2.0 * contact.cohesion * k_c + weight * depth * k_gamma
    resistance = _blade(contact) * front * pressure
    contact.drawbar_pull = contact.drawbar_pull - contact.direction * p.kb * resistance


_KB = magnitude('kb', '-', 0.5, 0.0, 5.0, 0.5, 'share of the full passive resistance')

BULLDOZING = Effect(
    name='bulldozing',
    claim='soil is pushed ahead of the wheel',
    form='wedge',
    symbol='F -= kb b D1 (c z + D2 rho g z^2/2), D1 = cot X + tan(X + phi), '
    'D2 = cot X + cot^2 X tan(phi), X = pi/4 - phi/2',
    parameters=(_KB,),
    touches=frozenset({'drawbar_pull'}),
    confounded_with={'pitch_bias': 'three times the load or another wheel; a level check'},
    validity='sinkage below half the radius; the wedge is as wide as rim and flank are across the '
    'motion',
    source='Hegedus 1960 (report, no DOI) in the form of Ishigami et al. 2007 '
    '(doi 10.1002/rob.20187; side force turned to the front)',
    on_outputs=_push,
    other_forms=(
        Form(
            name='terzaghi',
            claim='soil is pushed ahead of the wheel, after Terzaghi and Bekker',
            symbol='F -= kb b sin(a + phi)/(2 sin a cos phi) z (2 c Kc + rho g z Kg), '
            'Kc = (Nc - tan phi) cos^2 phi, Kg = (2 Ng/tan phi + 1) cos^2 phi, '
            'a = t_1 = arccos(1 - 2 z/D)',
            parameters=(_KB,),
            validity='friction angle 10 to 45 degrees; sinkage below half the radius',
            source="Terzaghi's bearing factors in the resistance of Bekker 1969 (book, no DOI), as "
            'in Li and Bingham 2022 (NASA report 20220010732); Ng by the usual approximation',
            on_outputs=_earth_pressure,
        ),
    ),
)


_NODES = gauss_rule(8)  # over the flank in the soil
_CENTRE = 2.0 / 3.0  # distance from the hub at which soil rubs on the flank, share of the radius


def _push_aside(contact: Contact, p: SimpleNamespace) -> None:
    if contact.straight:
        return
    t1, r = contact.entrance_angle, contact.radius
    span, edge = t1 - contact.leaving_angle, np.cos(t1)
    force: Quantity = 0.0
    for place, weight in _NODES:
        behind_entry = place * span
        cosine = np.cos(t1 - behind_entry)
        depth = np.maximum(r * (cosine - edge), 0.0)
        moved = mobilised_share(contact.lateral_ratio * behind_entry, contact.shear_modulus)
        force = force + weight * moved * wedge_resistance(contact, depth) * (r - depth * cosine)
    contact.lateral_force = contact.lateral_force - p.ks * span * force


def _plate(contact: Contact, p: SimpleNamespace) -> None:
    if contact.straight:
        return
    t1, t2, r = contact.entrance_angle, contact.leaving_angle, contact.radius
    cosine, sine = contact.heading()
    along = np.maximum(cosine, 1e-9)
    span = t1 - t2
    # Soil surface along the flank: straight from where the rim goes in to where it leaves.
    fall = (np.cos(t2) - np.cos(t1)) / (np.sin(t1) - np.sin(t2))
    force: Quantity = 0.0
    for place, weight in _NODES:
        angle = t1 - place * span
        behind = r * (np.sin(t1) - np.sin(angle))
        depth = np.maximum(r * (np.cos(angle) - np.cos(t1)) - fall * behind, 0.0)
        moved = mobilised_share(behind * sine, contact.shear_modulus * along)
        width = r * np.cos(angle)
        force = force + weight * width * moved * wedge_resistance(contact, depth)
    push = p.ks * span * force
    contact.lateral_force = contact.lateral_force - push
    # The flank slides past the wedge: backwards as the wheel turns, down as the wedge rises.
    back = _CENTRE * r - contact.velocity_ratio
    wedge = 0.25 * np.pi - 0.5 * np.arctan(contact.soil_friction)
    rise = np.tan(wedge) * contact.lateral_ratio
    slide = np.maximum(np.sqrt(back * back + rise * rise), 1e-12)
    rub = contact.tan_friction * np.abs(push) * back / slide
    contact.drawbar_pull = contact.drawbar_pull + contact.direction * rub
    contact.torque = contact.torque + contact.direction * _CENTRE * r * rub


_KS = magnitude('ks', '-', 1.0, 0.0, 5.0, 0.5, 'share of the full passive resistance')

SIDE_BULLDOZING = Effect(
    name='side_bulldozing',
    form='ishigami',
    claim='a wheel that slides sideways pushes soil aside with its flank',
    symbol='F_y -= ks Int D1 (c h + D2 rho g h^2/2) (1 - exp(-|j_y|/K)) (r - h cos t) dt, '
    'h = r (cos t - cos t_1), j_y = (v_y/w)(t_1 - t); D1, D2 as in bulldozing',
    parameters=(_KS,),
    touches=frozenset({'lateral_force'}),
    needs=('slip_angle',),
    validity='flank smooth and upright, sinkage below half the radius; mobilised like shear',
    source='Ishigami et al. 2007 eq. 9 and 11 (doi 10.1002/rob.20187), resistance of '
    'Hegedus 1960 (report, no DOI)',
    on_outputs=_push_aside,
    other_forms=(
        Form(
            name='plate',
            claim='the flank is a plate pushed sideways, and soil rubs along it',
            symbol='F_y -= P, P = ks Int D1 (c h + D2 rho g h^2/2) (1 - exp(-|j_f|/K)) r cos t dt, '
            'h below the line from entry to exit, j_f = (v_y/v) r (sin t_1 - sin t); '
            'F += P tan(phi) u/|(u, v_y tan X)|, T += 2/3 r times that, u = 2/3 r w - v',
            parameters=(_KS,),
            touches=frozenset({'lateral_force', 'drawbar_pull', 'torque'}),
            validity='slip angles to 90 degrees, sinkage below one radius; what friction on '
            'the flank carries of the load is left out',
            source='own form: resistance of Hegedus 1960 (report, no DOI) on the outline of the '
            'flank, and its friction (docs/models/sideways.md)',
            on_outputs=_plate,
        ),
    ),
)
