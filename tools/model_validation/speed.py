# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Speed as ratios within one run: closed forms and quadrature against adaptive integration."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
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


def shortest(calls: Sequence[tuple[Callable[[], object], int]], rounds: int = 12) -> list[float]:
    """Return the shortest processor time of each call [us], all taken in turn, round by round."""
    times = [math.inf] * len(calls)
    for _ in range(rounds):
        for k, (call, repeats) in enumerate(calls):
            start = time.process_time()
            for _ in range(repeats):
                call()
            times[k] = min(times[k], (time.process_time() - start) / repeats)
    return [1e6 * value for value in times]


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

    def closed_balance() -> object:
        return WheelSoilModel(SOIL, method='closed_form').steady_state(many)

    names = ['soil.sinkage_exponent', 'soil.cohesion', 'soil.friction_angle', 'soil.shear_modulus']
    methods: list[tuple[str, Callable[[], object], int, int, str]] = [
        ('adaptive quad with brentq', adaptive, 2, 1, ''),
        (
            'closed form, floats: three forces at given angles',
            lambda: closed_form.forces(scalar, terms, ScalarMaths),
            200,
            1,
            '1000',
        ),
        (
            'closed form, floats: soil and load to sinkage, pull, torque',
            lambda: steady.state(0, 1.0 - SLIP, LOAD),
            100,
            1,
            '1000',
        ),
        (
            'closed form, floats: torque and pull at a given sinkage, seven derivatives each',
            lambda: rover.forces(0, 1.0 - SLIP, depth, LOAD, 250.0, friction, 0.0114),
            100,
            1,
            '',
        ),
        (
            f'closed form, arrays of {BATCH}: three forces at given angles',
            lambda: closed_form.forces(contact, terms),
            3,
            BATCH,
            '15,000',
        ),
        (f'closed form, arrays of {BATCH}: with the load balance', closed_balance, 1, BATCH, ''),
        (
            f'quadrature, arrays of {BATCH}: three forces at given angles',
            lambda: quadrature.forces(contact, terms),
            1,
            BATCH,
            '',
        ),
        (
            f'quadrature, arrays of {BATCH}: with the load balance (error {100 * error:.4f} %)',
            lambda: model.steady_state(many),
            1,
            BATCH,
            '100',
        ),
        ('quadrature, 16 rows: with the load balance', lambda: model.steady_state(few), 10, 16, ''),
        (
            'quadrature, 16 rows: with the load balance and a Jacobian by 4 parameters',
            lambda: model.jacobian(few, names),
            5,
            16,
            '',
        ),
        ('', six_wheels, 30, 1, ''),
    ]
    times = shortest([(call, repeats) for _, call, repeats, _, _ in methods])
    slow, six = times[0], times[-1]
    lines = [
        f'| {label} | {spent / count:.3g} | {slow * count / spent:,.0f} | {target} |'
        for (label, _, _, count, target), spent in zip(methods[:-1], times[:-1], strict=True)
    ]
    return '\n'.join(
        [
            '## Speed',
            '',
            'Processor time of one core, all methods in turn, shortest of several rounds. Absolute '
            'times depend on the machine, the ratios much less. Adaptive: scipy quad at its '
            'default tolerance inside brentq, as one would write it.',
            '',
            '| method | us per wheel | times faster than adaptive | target |',
            '|---|---|---|---|',
            *lines,
            '',
            f'Six wheels as the filter needs them (torque, pull and seven derivatives each): '
            f'{six:.0f} us a call, 1/{slow / six:.0f} of one adaptive solve. The target of 100 us '
            'was set on a machine where that solve takes 6980 us, a ratio of 1/70.',
        ]
    )
