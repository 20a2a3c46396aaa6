# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Speed as ratios within one run: closed forms and quadrature against adaptive integration."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.conditioned import ConditionedForces
from wheel_terra_estimator.terramechanics.maths import ScalarMaths
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.scalar_wheels import scalar_contacts
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.steady_sinkage import SteadySinkage
from wheel_terra_estimator.terramechanics.terms import Terms, build_contact, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel

SOIL = Soil(15.6e3, 2407.4e3, 1.1, 250.0, math.radians(31.9), 0.0114, 0.5, -0.2, 1605.0)
WHEEL = Wheel(0.15735, 0.165, 0.01, 30)
LOAD, SLIP, BATCH = 80.0, 0.3, 6000


def best(call: Callable[[], object], repeats: int, rounds: int = 15) -> float:
    """Return the shortest time of a call [us]."""
    shortest = math.inf
    for _ in range(rounds):
        start = time.perf_counter()
        for _ in range(repeats):
            call()
        shortest = min(shortest, (time.perf_counter() - start) / repeats)
    return 1e6 * shortest


def adaptive(relative: float = 1.49e-8) -> tuple[float, float, float]:
    """Solve one wheel with scipy's quad and brentq, written out anew: z, F, T."""
    s, r, b = SOIL, WHEEL.radius, WHEEL.width
    k = s.cohesive_modulus / b + s.frictional_modulus
    ratio = (1.0 - SLIP) * WHEEL.tip_radius

    def stresses(t: float, t1: float) -> tuple[float, float]:
        tm, t2 = s.peak_stress_ratio * t1, s.leaving_angle_ratio * t1
        te = t if t >= tm else t1 - (t - t2) * (t1 - tm) / (tm - t2)
        sigma = k * (r * max(math.cos(te) - math.cos(t1), 0.0)) ** s.sinkage_exponent
        j = r * (t1 - t) - ratio * (math.sin(t1) - math.sin(t))
        share = math.copysign(-math.expm1(-abs(j) / s.shear_modulus), j)
        return sigma, (s.cohesion + sigma * math.tan(s.friction_angle)) * share

    def total(weight: Callable[[float, float, float], float], t1: float) -> float:
        tm, t2 = s.peak_stress_ratio * t1, s.leaving_angle_ratio * t1
        return sum(
            quad(lambda t: weight(t, *stresses(t, t1)), low, high, epsrel=relative)[0]
            for low, high in ((t2, tm), (tm, t1))
        )

    def load(t1: float) -> float:
        return b * r * total(lambda t, n, q: n * math.cos(t) + q * math.sin(t), t1) - LOAD

    t1 = brentq(load, 0.02, 1.4)
    pull = b * r * total(lambda t, n, q: q * math.cos(t) - n * math.sin(t), t1)
    torque = b * r * r * total(lambda t, n, q: q, t1)
    return r * (1.0 - math.cos(t1)), pull, torque


def section(shared: Path, figures: Path) -> str:
    """Return the section."""
    reference = np.array(adaptive())
    points = OperatingPoints(np.full(1, SLIP), LOAD, WHEEL)
    model = WheelSoilModel(SOIL)
    error = np.max(np.abs(model.steady_state(points).outputs()[0] / reference - 1.0))
    many = OperatingPoints(np.full(BATCH, SLIP), LOAD, WHEEL)
    few = OperatingPoints(np.full(16, SLIP), LOAD, WHEEL)
    steady = SteadySinkage(WHEEL, SOIL)
    terms = Terms({})
    contact = build_contact(many, model._soil, 'bekker', terms)
    angle = model.steady_state(many).entrance_angle
    set_angles(contact, angle, None, terms)
    scalar = scalar_contacts(WHEEL, SOIL, 'lug_tip', 9.81)[0][0]
    for name in type(contact).__dataclass_fields__:
        setattr(scalar, name, float(np.atleast_1d(getattr(contact, name)).flat[0]))
    rover = ConditionedForces(Wheel(np.full(6, 0.15735), 0.165, 0.01, 30), SOIL)
    depth = float(reference[0])
    friction = math.tan(SOIL.friction_angle)

    def six_wheels() -> None:
        for wheel in range(6):
            rover.forces(wheel, 1.0 - SLIP, depth, LOAD, 250.0, friction, 0.0114)

    slow = best(adaptive, 1, 8)
    rows = [
        ('adaptive quad with brentq', slow, 1, ''),
        (
            'closed form, floats: load to pull and torque at a given sinkage, with Jacobian',
            best(lambda: rover.forces(0, 1.0 - SLIP, depth, LOAD, 250.0, friction, 0.0114), 200),
            1,
            '1000',
        ),
        (
            'closed form, floats: three forces at given angles',
            best(lambda: closed_form.forces(scalar, terms, ScalarMaths), 500),
            1,
            '1000',
        ),
        (
            'closed form, floats: soil and load to sinkage, pull, torque',
            best(lambda: steady.state(0, 1.0 - SLIP, LOAD), 200),
            1,
            '1000',
        ),
        (
            f'closed form, arrays of {BATCH}: three forces at given angles',
            best(lambda: closed_form.forces(contact, terms), 3),
            BATCH,
            '15,000',
        ),
        (
            f'closed form, arrays of {BATCH}: with the load balance',
            best(lambda: WheelSoilModel(SOIL, method='closed_form').steady_state(many), 2, 6),
            BATCH,
            '',
        ),
        (
            f'quadrature, arrays of {BATCH}, error {100 * error:.4f} %: three forces',
            best(lambda: quadrature.forces(contact, terms), 2, 6),
            BATCH,
            '',
        ),
        (
            f'quadrature, arrays of {BATCH}: with the load balance',
            best(lambda: model.steady_state(many), 1, 5),
            BATCH,
            '100',
        ),
        (
            'quadrature, 16 rows: with the load balance',
            best(lambda: model.steady_state(few), 20),
            16,
            '',
        ),
    ]
    lines = [
        f'| {label} | {spent / count:.3g} | {slow * count / spent:,.0f} | {target} |'
        for label, spent, count, target in rows
    ]
    names = ['soil.sinkage_exponent', 'soil.cohesion', 'soil.friction_angle', 'soil.shear_modulus']
    jacobian = best(lambda: model.jacobian(few, names), 10)
    return '\n'.join(
        [
            '## Speed',
            '',
            'One core, shortest of several rounds, all in one run; absolute times depend on the '
            'machine and its load, the ratios hardly.',
            '',
            '| method | us per wheel | times faster than adaptive | target |',
            '|---|---|---|---|',
            *lines,
            '',
            f'Six wheels as the filter needs them (torque, pull and seven derivatives each): '
            f'{best(six_wheels, 50):.0f} us a call (target 100 us on the machine of the '
            f'performance notes, where adaptive quad with brentq takes 6980 us; here {slow:.0f}). '
            f'Steady state and Jacobian of 16 rows by 4 parameters: {1e-3 * jacobian:.2f} ms.',
        ]
    )
