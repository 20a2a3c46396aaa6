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
from wheel_terra_estimator.terramechanics.terms import Terms, build_contact, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.terramechanics.steady_sinkage import SteadySinkage

SOIL = Soil(15.6e3, 2407.4e3, 1.1, 250.0, math.radians(31.9), 0.0114, 0.5, -0.2, 1605.0)
WHEEL = Wheel(0.15735, 0.165, 0.01, 30)
LOAD, SLIP, BATCH = 80.0, 0.3, 6000
# Operating points for one wheel at a time; batches draw theirs from the same ranges.
SLIPS = np.linspace(0.0, 0.9, 10).tolist()
SIX_EFFECTS = {
    'slip_sinkage_exponent': {'n1': 0.3},
    'stress_peak_shift': {'c2': 0.15},
    'lug_shear_radius': {'lam': 0.5},
    'lug_digging': {'kd': 1.0},
    'lug_support': {'dz4': 0.0015},
    'cohesion': {'delta': 100.0},
}


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


def adaptive(slip: float = SLIP, relative: float = 1.49e-8) -> tuple[float, float, float]:
    """Solve one wheel with scipy's quad and brentq, written out anew: z, F, T."""
    s, r, b = SOIL, WHEEL.radius, WHEEL.width
    k = s.cohesive_modulus / b + s.frictional_modulus
    ratio = (1.0 - slip) * WHEEL.tip_radius

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
    closed = WheelSoilModel(SOIL, method='closed_form')
    error = np.max(np.abs(model.steady_state(points).outputs()[0] / reference - 1.0))
    random = np.random.default_rng(5)
    many = OperatingPoints(
        random.uniform(0.0, 0.9, BATCH), random.uniform(0.5, 1.5, BATCH) * LOAD, WHEEL
    )
    few = OperatingPoints(np.linspace(0.0, 0.9, 16), LOAD, WHEEL)
    steady = SteadySinkage(WHEEL, SOIL)
    steady_effects = SteadySinkage(WHEEL, SOIL, SIX_EFFECTS)
    terms = Terms({})
    contact = build_contact(many, model._soil, 'bekker', terms)
    set_angles(contact, model.steady_state(many).entrance_angle, None, terms)
    scalar = scalar_contacts(WHEEL, SOIL, 'lug_tip', 9.81)[0][0]
    for name in type(contact).__dataclass_fields__:
        setattr(scalar, name, float(np.atleast_1d(getattr(contact, name)).flat[0]))
    six = Wheel(np.full(6, 0.15735), 0.165, 0.01, 30)
    rover, rover_effects = ConditionedForces(six, SOIL), ConditionedForces(six, SOIL, SIX_EFFECTS)
    depth = float(reference[0])
    friction = math.tan(SOIL.friction_angle)

    def six_wheels(rover: ConditionedForces) -> None:
        for wheel in range(6):
            rover.forces(wheel, 1.0 - SLIP, depth, LOAD, 250.0, friction, 0.0114, 0.01)

    def at_all_slips(call: Callable[[float], object]) -> Callable[[], None]:
        def run() -> None:
            for slip in SLIPS:
                call(slip)

        return run

    names = ['soil.sinkage_exponent', 'soil.cohesion', 'soil.friction_angle', 'soil.shear_modulus']
    methods: list[tuple[str, Callable[[], object], int, int, str]] = [
        ('adaptive quad with brentq', at_all_slips(adaptive), 1, len(SLIPS), ''),
        (
            'closed form, floats: three forces at given angles',
            lambda: closed_form.forces(scalar, terms, ScalarMaths),
            200,
            1,
            '',
        ),
        (
            'closed form, floats: soil and load to sinkage, pull, torque',
            at_all_slips(lambda slip: steady.state(0, 1.0 - slip, LOAD)),
            20,
            len(SLIPS),
            '1000',
        ),
        (
            'the same with six effects',
            at_all_slips(lambda slip: steady_effects.state(0, 1.0 - slip, LOAD)),
            10,
            len(SLIPS),
            '',
        ),
        (
            'closed form, floats: torque and pull at a given sinkage, seven derivatives each',
            lambda: rover.forces(0, 1.0 - SLIP, depth, LOAD, 250.0, friction, 0.0114, 0.01),
            100,
            1,
            '',
        ),
        (
            f'closed form, arrays of {BATCH}: three forces at given angles',
            lambda: closed_form.forces(contact, terms),
            3,
            BATCH,
            '',
        ),
        (
            f'closed form, arrays of {BATCH}: soil and load to sinkage, pull, torque',
            lambda: closed.steady_state(many),
            2,
            BATCH,
            '15,000',
        ),
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
        ('', lambda: six_wheels(rover), 30, 1, ''),
        ('', lambda: six_wheels(rover_effects), 20, 1, ''),
    ]
    times = shortest([(call, repeats) for _, call, repeats, _, _ in methods])
    slow, bare, full = times[0] / len(SLIPS), times[-2], times[-1]
    lines = [
        f'| {label} | {spent / count:.3g} | {slow * count / spent:,.0f} | {target} |'
        for (label, _, _, count, target), spent in zip(methods[:-2], times[:-2], strict=True)
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
            'Six wheels as the filter needs them (torque, pull and seven derivatives each): '
            f'{bare:.0f} us a call, 1/{slow / bare:.0f} of one adaptive solve; with six effects on '
            f'{full:.0f} us, 1/{slow / full:.0f}. The target of 100 us was set on a machine where '
            f'that solve takes 6980 us, a ratio of 1/70: there these are {6980 * bare / slow:.0f} '
            f'and {6980 * full / slow:.0f} us.',
            '',
            'Slip runs over 0 to 0.9 in all rows that solve a balance, in the batches drawn at '
            'random together with loads of half to one and a half times 80 N. Arrays lose more '
            'than floats where all cores are busy.',
        ]
    )
