# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What moves the angles of the contact with slip: a mound behind it, the peak of the stress."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    Form,
    magnitude,
    shape,
    signed,
)

SMALLEST_ROOM = 1e-12
"""Height left below the hub over r [-]; contact that leaves above the hub has none."""


def _mound(contact: Contact, p: SimpleNamespace) -> None:
    """Raise the rear contact height by kappa z ((s - onset)+/(1 - onset))^2."""
    excess = np.maximum(contact.slip - p.onset, 0.0) / (1.0 - p.onset)
    _raise(contact, p.kappa * excess * excess * (1.0 - np.cos(contact.entrance_angle)))


def _conveyed(contact: Contact, p: SimpleNamespace) -> None:
    """Raise the rear contact height by kappa z (q/(q + z))^2, q conveyed per unit of advance."""
    depth = 1.0 - np.cos(contact.entrance_angle)  # over r
    slip = np.maximum(contact.slip, 0.0)
    carried = (contact.lug_height + p.band) / contact.rim_radius * slip
    room = np.maximum(carried + depth * (1.0 - slip), SMALLEST_ROOM)
    share = carried / room
    _raise(contact, p.kappa * share * share * depth)


def _raise(contact: Contact, rise: Quantity) -> None:
    """Raise the rear contact by a height over r, below the hub."""
    # 1 - cos is the contact height over r. The slope of a circle is steeper the higher one gets, so
    # the height saturates below the hub (1 - exp keeps it smooth).
    base = 1.0 - np.cos(contact.leaving_angle)
    room = np.maximum(1.0 - base, SMALLEST_ROOM)
    height = base + room * (1.0 - np.exp(-rise / room))
    raised = -np.arccos(np.maximum(1.0 - height, 0.0))
    contact.leaving_angle = np.where(rise > 0.0, raised, contact.leaving_angle)


_KAPPA = magnitude(
    'kappa', '-', 1.0, 0.0, 8.0, 1.0, 'height of the mound at s = 1 over the sinkage'
)

SOIL_MOUND = Effect(
    name='soil_mound',
    form='onset',
    claim='at high slip, soil piles up behind the wheel and moves the leaving angle back',
    symbol='1 - cos t_2 = b + (1 - b) [1 - exp(-kappa z x^2/(r (1 - b)))], b = 1 - cos(c_3 t_1), '
    'x = (s - onset)+/(1 - onset); about r (1 - cos t_2) += kappa z x^2 while small',
    parameters=(
        _KAPPA,
        shape('onset', '-', 0.4, 0.0, 0.9, 0.15, 'slip at which it starts'),
    ),
    needs=('slip',),
    confounded_with={'stress_peak_shift': 'a rear camera: measured leaving angle'},
    validity='slip up to 0.95; a measured leaving angle overrides it',
    source='Guo, Ding et al., high-slip contact modelling for grouser-wheeled rovers, Mech. Mach. '
    'Theory (a mound higher than the free surface); law reconstructed here',
    on_contact=_mound,
    other_forms=(
        Form(
            name='conveyed',
            claim='lugs carry soil back and pile it up behind the wheel: high ones the more',
            symbol='1 - cos t_2 = b + (1 - b) [1 - exp(-kappa z x^2/(r (1 - b)))], '
            'b = 1 - cos(c_3 t_1), x = q/(q + z), q = (h + band) s/(1 - s)',
            parameters=(
                _KAPPA,
                shape(
                    'band',
                    'm',
                    0.003,
                    0.0,
                    0.03,
                    0.003,
                    'layer that a smooth rim drags along',
                    free=False,
                ),
            ),
            needs=('slip', 'lug_height'),
            source='own form: volume carried back per unit of advance against that of the rut',
            candidate=False,
            why_aside='no table with two lug heights at slips above 0.6 has been seen',
            on_contact=_conveyed,
        ),
    ),
)


def _shift(contact: Contact, p: SimpleNamespace) -> None:
    skid = np.maximum(-contact.slip, 0.0)
    contact.peak_ratio = contact.peak_ratio + p.c2 * contact.slip + p.skid * skid


def _retreat(contact: Contact, p: SimpleNamespace) -> None:
    contact.peak_ratio = contact.peak_ratio - p.retreat * contact.slip


STRESS_PEAK_SHIFT = Effect(
    name='stress_peak_shift',
    claim='the angle of greatest stress moves forward with slip',
    form='forward',
    symbol='t_m = (c1 + c2 s) t_1 (+ skid |s| t_1 where s < 0)',
    parameters=(
        magnitude('c2', '-', 0.2, -0.5, 0.8, 0.2, 'shift at s = 1'),
        signed(
            'skid',
            '-',
            0.0,
            -1.0,
            1.0,
            0.2,
            'shift forward of a skidding wheel, beyond c2',
            free=False,
        ),
    ),
    needs=('slip',),
    confounded_with={
        'soil_mound': 'a rear camera: measured leaving angle',
        'slip_sinkage_exponent': 'high load, braking rows, slip near 0.9; stress cells in the rim',
    },
    validity='c1 + c2 s between 0 and 1; clamped inside the contact',
    source='Wong and Reece 1967 (doi 10.1016/0022-4898(67)90105-X); '
    'Ding et al. 2010 section 3.1.1 (doi 10.1007/s11771-010-0021-7); '
    'skid: measured rows of a single wheel that brakes (docs/models/validation.md)',
    on_inputs=_shift,
    other_forms=(
        Form(
            name='backward',
            claim='the angle of greatest stress moves backward with slip',
            symbol='t_m = (c1 - retreat s) t_1',
            parameters=(magnitude('retreat', '-', 0.1, 0.0, 0.8, 0.2, 'shift back at s = 1'),),
            validity='c1 - retreat s between 0 and 1; clamped inside the contact',
            source='the same law with the other sign, as fits to small wheels give it '
            '(docs/models/validation.md)',
            on_inputs=_retreat,
        ),
    ),
)
