# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of the readings: gains, zeros, attitude, lost torque, a misread slip, a weight as load."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import (
    Effect,
    Form,
    magnitude,
    shape,
    signed,
)
from wheel_terra_estimator.terramechanics.kinematics import slip_of_speed_ratio, speed_ratio


def _gain(quantity: str, contact: Contact, p: SimpleNamespace) -> None:
    setattr(contact, quantity, getattr(contact, quantity) * (1.0 + p.gain))


def _offset(quantity: str, contact: Contact, p: SimpleNamespace) -> None:
    setattr(contact, quantity, getattr(contact, quantity) + p.offset)


def _tilt(contact: Contact, p: SimpleNamespace) -> None:
    contact.drawbar_pull = contact.drawbar_pull + contact.stated_load * np.sin(p.bias)


def _gain_of(
    reading: str, quantity: str, symbol: str, confounded_with: dict[str, str], validity: str
) -> Effect:
    return Effect(
        name=f'{reading}_gain',
        claim=f'gain error of the {reading} reading; positive: it reads too much',
        symbol=f'{symbol} *= 1 + gain',
        parameters=(signed('gain', '-', 0.1, -0.8, 2.0, 0.1, 'gain of the reading less one'),),
        touches=frozenset({quantity}),
        instrument=True,
        confounded_with=confounded_with,
        validity=validity,
        source='instrument model',
        on_outputs=partial(_gain, quantity),
    )


EFFECTS = (
    _gain_of(
        'pull',
        'drawbar_pull',
        'F',
        {
            'lug_shear_radius': 'torque: a gain of the pull leaves it alone',
            'bulldozing': 'pull at slip near zero, where a gain does little; the known weight',
        },
        'acts before a zero error',
    ),
    _gain_of(
        'sinkage',
        'sinkage',
        'z',
        {
            'sinkage_offset': 'shallow rows, or a known step under the sensor',
            'slip_sinkage_exponent': 'pull and torque, which a gain leaves alone; a known step',
        },
        'acts before a zero error',
    ),
    _gain_of(
        'torque',
        'torque',
        'T',
        {
            'drivetrain_friction': 'torque near zero; a known moment at the wheel',
            'lug_shear_radius': 'pull; a known moment at the wheel',
        },
        'acts on what the drive loses as well',
    ),
    Effect(
        name='pull_zero',
        claim='zero error of the pull reading; positive: it reads too much',
        symbol='F += offset',
        parameters=(signed('offset', 'N', 2.0, -1e4, 1e4, 3.0, 'zero error', by_load=True),),
        touches=frozenset({'drawbar_pull'}),
        instrument=True,
        confounded_with={
            'pitch_bias': 'a load series: an attitude error grows with the load',
            'bulldozing': 'a load series; the reading of the unloaded cell',
        },
        validity='does not change sign in reverse',
        source='instrument model',
        on_outputs=partial(_offset, 'drawbar_pull'),
    ),
    Effect(
        name='sinkage_offset',
        claim='zero error of the sinkage sensor; positive: it reads too deep',
        symbol='z += offset',
        parameters=(signed('offset', 'm', 0.002, -0.05, 0.05, 0.002, 'zero error'),),
        touches=frozenset({'sinkage'}),
        instrument=True,
        confounded_with={
            'lug_support': 'a smooth wheel; the zero reading on a hard floor',
            'hard_layer': 'a load series',
        },
        validity='constant over the table',
        source='instrument model',
        on_outputs=partial(_offset, 'sinkage'),
    ),
    Effect(
        name='pitch_bias',
        claim='attitude error; positive: it reads too nose-up, pull reads W sin(bias) too high',
        symbol='F += W sin(bias)',
        parameters=(signed('bias', 'rad', 0.02, -0.3, 0.3, 0.03, 'attitude error'),),
        touches=frozenset({'drawbar_pull'}),
        instrument=True,
        confounded_with={
            'slope_gravity': 'level rows, or the same slope driven both ways',
            'bulldozing': 'three times the load or another wheel; a level check',
        },
        validity='does not change sign in reverse',
        source='statics',
        on_outputs=_tilt,
    ),
)


def _friction(contact: Contact, p: SimpleNamespace) -> None:
    contact.torque = contact.torque + contact.direction * p.torque


def _in_proportion(contact: Contact, p: SimpleNamespace) -> None:
    lost = p.share * np.abs(contact.torque)
    contact.torque = contact.torque + contact.direction * lost


def _viscous(contact: Contact, p: SimpleNamespace) -> None:
    known = contact.rim_speed > 0.0  # not where it is nan
    rate = np.where(known, contact.rim_speed, 0.0) / contact.rim_radius
    contact.torque = contact.torque + contact.direction * p.damping * rate


DRIVETRAIN_FRICTION = Effect(
    name='drivetrain_friction',
    claim='the torque reading is off by a constant: friction before the wheel, or its zero',
    form='constant',
    symbol='T += torque sgn(w)',
    parameters=(
        signed(
            'torque',
            'N m',
            0.3,
            -1e4,
            1e4,
            0.5,
            'friction torque of the drive; below 0: a zero error of the reading',
            by_load=True,
        ),
    ),
    touches=frozenset({'torque'}),
    instrument=True,
    confounded_with={'lug_shear_radius': 'torque of the wheel in the air; pull'},
    validity='a turning wheel',
    source='Coulomb friction of a drive',
    on_outputs=_friction,
    other_forms=(
        Form(
            name='proportional',
            claim='torque is lost before the wheel in proportion to what the wheel takes',
            symbol='T += share |T| sgn(w)',
            parameters=(
                magnitude('share', '-', 0.1, 0.0, 2.0, 0.15, 'torque lost over torque used'),
            ),
            validity='a turning wheel; one gear stage loses a few per cent, a worm drive half',
            source='efficiency of a gear, 1/(1 + share)',
            on_outputs=_in_proportion,
        ),
        Form(
            name='viscous',
            claim='torque is lost before the wheel in proportion to its rate',
            symbol='T += damping w',
            parameters=(
                magnitude(
                    'damping', 'N m s/rad', 0.5, 0.0, 1e4, 0.5, 'viscous friction', by_load=True
                ),
            ),
            needs=('angular_velocity',),
            validity='a turning wheel',
            source='bearings and grease',
            on_outputs=_viscous,
        ),
    ),
)


_BIAS = signed('bias', '-', 0.03, -0.3, 0.3, 0.04, 'effective over configured radius, minus one')


def _bias(contact: Contact, p: SimpleNamespace) -> None:
    scale = 1.0 + p.bias
    contact.scale_speed(1.0 / scale)
    ratio = speed_ratio(contact.slip) / scale
    contact.slip = slip_of_speed_ratio(ratio)


def _other_rim(contact: Contact, p: SimpleNamespace) -> None:
    # The slip was reckoned with the configured radius, so that v/w is as measured.
    contact.shear_radius = contact.shear_radius + p.bias * contact.radius
    contact.radius = contact.radius * (1.0 + p.bias)
    contact.slip = slip_of_speed_ratio(speed_ratio(contact.slip) / (1.0 + p.bias))


WHEEL_RADIUS_BIAS = Effect(
    name='wheel_radius_bias',
    form='slip',
    claim='the effective rolling radius differs from the configured one, so slip is misread',
    symbol='1 - s_true = (1 - s_recorded)/(1 + bias)',
    parameters=(_BIAS,),
    instrument=True,
    needs=('slip',),
    confounded_with={'lug_shear_radius': 'rows with other lugs or none; roll-out on a hard floor'},
    validity='biases of up to some 10 %; the contact geometry keeps the configured radius',
    source='Ding et al. 2010 eq. 1 leaves the radius open',
    on_inputs=_bias,
    other_forms=(
        Form(
            name='rim',
            claim='the rim has another radius than configured',
            symbol='r, R += bias r; v/w as recorded',
            parameters=(_BIAS,),
            validity='biases of up to some 10 %',
            source='geometry of the wheel',
            on_inputs=_other_rim,
        ),
    ),
)


def _load(contact: Contact, p: SimpleNamespace) -> None:
    lost = contact.stated_load * (1.0 - np.cos(contact.slope))
    contact.normal_load = contact.normal_load - p.share * lost


def _pull(contact: Contact, p: SimpleNamespace) -> None:
    down_hill = contact.stated_load * np.sin(contact.slope)
    contact.drawbar_pull = contact.drawbar_pull - p.share * down_hill


SLOPE_GRAVITY = Effect(
    name='slope_gravity',
    claim='the stated load is a weight: on a slope the soil carries W cos(slope) and the pull '
    'left at the hitch is smaller by W sin(slope)',
    symbol='W_n = W - share W (1 - cos a);  F -= share W sin a',
    parameters=(
        shape(
            'share',
            '-',
            1.0,
            0.0,
            1.5,
            0.15,
            'share of the weight that tilts with the slope (1: all of it)',
        ),
    ),
    needs=('slope',),
    confounded_with={'pitch_bias': 'level rows, or the same slope driven both ways'},
    validity='any slope that the soil holds',
    source='statics; Nakashima et al. 2010 (slope runs with Px/W = sin a)',
    on_inputs=_load,
    on_outputs=_pull,
)
