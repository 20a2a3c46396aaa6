# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Further forms of the effects, and further effects, written for the independent quadrature.

Keys are those of the catalogue: ``effect:form``, or the effect's name alone where ``hidden.LISTED``
does not have it. Sources stand with the effects of the package (``docs/effects.md``).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wheel_terra_lab.trials.hidden import (
    Change,
    Kind,
    adding,
    fixed,
    layer_depth,
    mean_load,
    mean_radius,
    stiffness_near,
)
from wheel_terra_lab.trials.truth import FloatArray, Hidden, Rows, Setup, TrueSoil

REFERENCE_PRESSURE = 3e3  # W/(b r) at which laws of the load are neutral [Pa]
FREE_HEIGHT = 0.005  # lugs up to this height carry nothing [m]
RING_HEIGHT = 0.003  # lugs of this height begin to hold a ring of soil [m]


def _pressure(rows: Rows) -> FloatArray:
    area = rows['wheel_width'] * rows['wheel_radius']
    return np.asarray(rows['normal_load'] / area / REFERENCE_PRESSURE)


def _driving(rows: Rows) -> FloatArray:
    return np.clip(rows['slip'], 0.0, 1.0)


def _lyasko(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        s = np.abs(rows['slip'])
        deeper = 1 + size * ((1 + s) / (1 - s / 2) - 1)
        setup.stiffness = setup.stiffness / deeper ** (setup.exponent + 0.5)

    return Change('slip_sinkage_exponent', prepare)


def _exponent_by_load(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.exponent = setup.exponent + size * np.log(_pressure(rows))

    return Change('slip_sinkage_exponent', prepare, n1=0.0)


def _saturating(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    span = 0.1 + 0.4 * secondary

    def dug(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return np.asarray(size * rows['lug_height'] * (1 - np.exp(-_driving(rows) / span)))

    return adding('lug_digging', 'sinkage', dug, range=span)


def _by_height(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def saved(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return np.asarray(-size * np.clip(rows['lug_height'] - FREE_HEIGHT, 0.0, None))

    return adding('lug_support', 'sinkage', saved, free_height=FREE_HEIGHT)


def _terzaghi(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """Terzaghi's bearing factors in Bekker's resistance, angle of approach t1."""

    def drag(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        z, phi = out['geometric_sinkage'], np.arctan(setup.tan_phi)
        turn = np.exp((1.5 * np.pi - phi) * np.tan(phi))
        nq = turn / (2 * np.cos(np.pi / 4 + phi / 2) ** 2)
        nc = (nq - 1) / np.tan(phi)
        ng = 2 * (nq + 1) * np.tan(phi) / (1 + 0.4 * np.sin(4 * phi))
        kc = (nc - np.tan(phi)) * np.cos(phi) ** 2
        kg = (2 * ng / np.tan(phi) + 1) * np.cos(phi) ** 2
        plate = out['entrance_angle']
        edge = np.sin(plate + phi) / (2 * np.sin(plate) * np.cos(phi))
        weight = setup.density * rows['gravity'] * z
        return np.asarray(-size * setup.width * edge * z * (2 * setup.cohesion * kc + weight * kg))

    return adding('bulldozing', 'drawbar_pull', drag)


def _rut(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def depth(rows: Rows) -> FloatArray:
        return np.asarray(size * 2 * (1 - 0.5 ** (rows['pass_number'] - 1)))

    def prepare(setup: Setup, rows: Rows) -> None:
        setup.rut = setup.rut + depth(rows)

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        out['sinkage'] = out['sinkage'] + depth(rows)

    return Change('multipass', prepare, finish)


def _bearing_layer(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    depth = layer_depth(secondary, rows, soil)

    def prepare(setup: Setup, rows: Rows) -> None:
        setup.extra_bearing.append(lambda equivalent: size * np.maximum(equivalent - depth, 0.0))

    return Change('hard_layer', prepare, depth=depth)


def _backward(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.peak_ratio = setup.peak_ratio - size * rows['slip']

    return Change('stress_peak_shift', prepare)


def _proportional(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def lost(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return np.asarray(size * np.abs(out['torque']) * np.sign(rows['angular_velocity']))

    return adding('drivetrain_friction', 'torque', lost)


def _viscous(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def lost(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return np.asarray(size * rows['angular_velocity'])

    return adding('drivetrain_friction', 'torque', lost)


def _thrust(textbook: bool) -> Callable[[float, float, Rows, TrueSoil], Hidden]:
    def make(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
        def finish(out: Rows, setup: Setup, rows: Rows) -> None:
            s, h = _driving(rows), rows['lug_height']
            span = out['entrance_angle'] * (1 - setup.leaving_ratio)
            passive = np.tan(np.pi / 4 + np.arctan(setup.tan_phi) / 2) ** 2
            blades = rows['lug_count'] * span / (2 * np.pi)
            surcharge = setup.load / (setup.width * setup.radius * span)
            wall = setup.density * rows['gravity'] * h**2 / 2 * passive
            wall = wall + surcharge * h * (passive if textbook else (passive - 1) * s)
            wall = wall + 2 * setup.cohesion * h * np.sqrt(passive)
            grip = 1 - np.exp(-s * setup.radius * span / setup.shear_modulus)
            push = size * setup.width * blades * wall * grip
            out['drawbar_pull'] = out['drawbar_pull'] + push
            out['torque'] = out['torque'] + push * (setup.radius + h / 2)

        return Change('grouser_thrust', None, finish)

    return make


def _smooth_rim(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        bare = np.exp(-rows['lug_height'] / RING_HEIGHT)
        setup.tan_phi = setup.tan_phi * (1 - size * bare)

    return Change('rim_friction', prepare, ring_height=RING_HEIGHT)


def _flexible(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        n = setup.exponent
        stiff = (3 - n) * setup.width * setup.stiffness * np.sqrt(2 * setup.radius)
        rolling = (3 * setup.load / stiff) ** (2 / (2 * n + 1))
        flatter = 1 + size * setup.load / rolling
        setup.radius = setup.radius * flatter
        setup.shear_radius = setup.shear_radius * flatter
        setup.advance = setup.advance * flatter

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        out['torque'] = out['torque'] * rows['wheel_radius'] / setup.radius

    return Change('wheel_flexibility', prepare, finish)


def _coat(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.radius = setup.radius + size
        setup.shear_radius = setup.shear_radius + size

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        out['sinkage'] = out['sinkage'] - size

    return Change('soil_adhesion', prepare, finish)


def _tension(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.extra_by_angle.append(lambda t, t2: -size * np.clip(t / t2, 0.0, None))

    return Change('soil_adhesion', prepare)


def _carried(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        layer = size * rows['lug_height'] * _driving(rows)
        out['sinkage'] = out['sinkage'] + layer
        per_travel = setup.density * rows['gravity'] * setup.width * layer
        out['torque'] = out['torque'] + per_travel * 2 * rows['wheel_radius'] ** 2

    return Change('soil_transport', None, finish)


def _shear_by_pressure(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.shear_modulus = setup.shear_modulus * _pressure(rows) ** size

    return Change('shear_deformation', prepare)


def _shear_by_slip(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        setup.shear_modulus = setup.shear_modulus * np.exp(size * np.abs(rows['slip']))

    return Change('shear_deformation', prepare)


def _friction_unit(rows: Rows, soil: TrueSoil) -> float:
    """Damping that takes 4 % of load times radius at the mean rate."""
    return 0.04 * mean_load(rows) * mean_radius(rows) / float(np.mean(rows['angular_velocity']))


def _flexible_unit(rows: Rows, soil: TrueSoil) -> float:
    """Compliance that flattens the wheel by a tenth of a sinkage of 5 % of the radius."""
    return 0.1 * 0.05 * mean_radius(rows) / mean_load(rows)


FORMS = {
    'slip_sinkage_exponent:lyasko': Kind(_lyasko, fixed(0.7), 6),
    'slip_sinkage_exponent:load': Kind(
        _exponent_by_load, fixed(0.05), 5, signed=True, needs=('normal_load',)
    ),
    'lug_digging:saturating': Kind(
        _saturating,
        fixed(0.4),
        5,
        needs=('lug_height',),
        requires='sinkage',
    ),
    'lug_support:by_height': Kind(
        _by_height, fixed(0.3), 5, needs=('lug_height', 'tall_lugs'), requires='sinkage'
    ),
    'bulldozing:terzaghi': Kind(_terzaghi, fixed(0.3), 6, requires='drawbar_pull'),
    'multipass:rut': Kind(_rut, lambda r, s: 0.02 * mean_radius(r), 5, needs=('pass_number',)),
    'hard_layer:bearing': Kind(_bearing_layer, stiffness_near, 20),
    'stress_peak_shift:backward': Kind(_backward, fixed(0.1), 2.5),
    'drivetrain_friction:proportional': Kind(_proportional, fixed(0.08), 6, requires='torque'),
    'drivetrain_friction:viscous': Kind(
        _viscous, _friction_unit, 5, needs=('angular_velocity',), requires='torque'
    ),
    'grouser_thrust': Kind(_thrust(textbook=False), fixed(0.15), 6, needs=('lug_height',)),
    'grouser_thrust:textbook': Kind(_thrust(textbook=True), fixed(0.1), 6, needs=('lug_height',)),
    'rim_friction': Kind(_smooth_rim, fixed(0.2), 4, needs=('bare_rim',)),
    'wheel_flexibility': Kind(_flexible, _flexible_unit, 8),
    'soil_adhesion': Kind(_coat, lambda r, s: 0.015 * mean_radius(r), 5),
    'soil_adhesion:tension': Kind(_tension, fixed(500.0), 10),
    'soil_transport': Kind(
        _carried, fixed(0.4), 4, needs=('lug_height', 'slip'), requires='sinkage'
    ),
    'shear_deformation:pressure': Kind(
        _shear_by_pressure, fixed(0.4), 3.5, signed=True, needs=('normal_load',)
    ),
    'shear_deformation:slip': Kind(_shear_by_slip, fixed(1.0), 4, signed=True),
}
