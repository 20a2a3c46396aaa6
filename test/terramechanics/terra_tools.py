# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A second wheel-soil model, adaptive and scalar, and random contacts."""

import functools
import math
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

SAND = Soil(15.6e3, 2407.4e3, 1.1, 250.0, math.radians(31.9), 0.0114, 0.5, -0.2, 1605.0)
WHEEL = Wheel(0.1574, 0.165, 0.010, 30)
EFFECTS = {
    'slip_sinkage_exponent': {'n1': 0.3},
    'stress_peak_shift': {'c2': 0.15},
    'lug_shear_radius': {'lam': 0.5},
    'lug_digging': {'kd': 1.0},
    'lug_support': {'dz4': 0.0015},
}


def points(slip: Any, load: Any = 80.0, wheel: Wheel = WHEEL, **others: Any) -> OperatingPoints:
    return OperatingPoints(slip, load, wheel, **others)


def state(slip: Any, load: Any = 80.0, effects: Any = None, soil: Soil = SAND, **others: Any):
    wheel = others.pop('wheel', WHEEL)
    method = others.pop('method', 'quadrature')
    return WheelSoilModel(soil, effects, method).steady_state(points(slip, load, wheel, **others))


def second_model(
    slip: float, load: float, n1=0.0, c2=0.0, lam=0.0, beta=0.0, ks=0.0
) -> tuple[float, ...]:
    """Sinkage, pull, torque, lateral force of `WHEEL` on `SAND`, from the equations alone.

    By scipy's quad and brentq; ``beta``: slip angle, ``ks``: share of the wedge at the flank.
    """
    soil, r, b, mu = SAND, WHEEL.radius, WHEEL.width, math.tan(SAND.friction_angle)
    R, tip = r + lam * WHEEL.lug_height, r + WHEEL.lug_height
    k = soil.cohesive_modulus / b + soil.frictional_modulus
    n = soil.sinkage_exponent + n1 * abs(slip)
    ratio = tip * (1.0 - slip) if slip >= 0.0 else tip / (1.0 + slip)
    x = math.pi / 4 - soil.friction_angle / 2
    d1 = 1 / math.tan(x) + math.tan(x + soil.friction_angle)
    d2 = 1 / math.tan(x) + mu / math.tan(x) ** 2

    def edges(t1: float) -> tuple[float, float]:
        return soil.leaving_angle_ratio * t1, (soil.peak_stress_ratio + c2 * slip) * t1

    def stresses(t: float, t1: float) -> np.ndarray:
        t2, tm = edges(t1)
        mirrored = t if t >= tm else t1 - (t - t2) / (tm - t2) * (t1 - tm)
        sigma = k * (r * max(0.0, math.cos(mirrored) - math.cos(t1))) ** n
        j = np.array([R * (t1 - t) - ratio * (math.sin(t1) - math.sin(t)),
                      ratio * math.tan(beta) * (t1 - t)])  # fmt: skip
        size = float(np.hypot(*j))
        tau = (soil.cohesion + sigma * mu) * -math.expm1(-size / soil.shear_modulus)
        return np.array([sigma, *(tau * j / max(size, 1e-300))])

    def total(weights, t1: float) -> float:
        t2, tm = edges(t1)
        return b * sum(
            quad(lambda t: float(weights(t) @ stresses(t, t1)), *part, epsrel=1e-10)[0]
            for part in ((t2, tm), (tm, t1))
        )

    def carried(t1: float) -> float:
        return total(lambda t: np.array([r * math.cos(t), R * math.sin(t), 0.0]), t1)

    t1 = brentq(lambda a: carried(a) - load, 0.01, 1.5, xtol=1e-13)

    def flank(t: float) -> float:
        h = r * (math.cos(t) - math.cos(t1))
        moved = -math.expm1(-ratio * math.tan(beta) * (t1 - t) / soil.shear_modulus)
        wedge = soil.cohesion * h + d2 * soil.density * 9.80665 * h**2 / 2
        return moved * d1 * wedge * (r - h * math.cos(t))

    lateral = total(lambda t: np.array([0.0, 0.0, R]), t1)
    return (
        r * (1.0 - math.cos(t1)),
        total(lambda t: np.array([-r * math.sin(t), R * math.cos(t), 0.0]), t1),
        total(lambda t: np.array([0.0, R * R, 0.0]), t1),
        -lateral - ks * quad(flank, edges(t1)[0], t1, epsrel=1e-10)[0],
    )


@functools.cache
def random_cases(count: int, seed: int, rows: int = 40) -> list[tuple[Soil, dict, OperatingPoints]]:
    """Random effects, and under each of them soils, wheels and loads that a soil can carry."""
    random, cases = np.random.default_rng(seed), []
    low = (0.0, 5.6, 0.6, 0.0, 0.3, 0.003, 0.3, -0.4, 0.05, 0.5, 0.0, 1e3, -0.6)
    high = (2e4, 6.7, 1.3, 2e3, 0.8, 0.03, 0.6, 0.0, 0.3, 1.5, 0.15, 8e3, 0.9)
    for _ in range(count):
        n1, c2, lam, kappa, onset = random.uniform((0, 0, 0, 0, 0.2), (0.5, 0.3, 1, 2, 0.6))
        effects = {
            'slip_sinkage_exponent': {'n1': n1},
            'stress_peak_shift': {'c2': c2},
            'lug_shear_radius': {'lam': lam},
            'soil_mound': {'kappa': kappa, 'onset': onset},
        }
        drawn = random.uniform(low, high, (rows, len(low)))
        for _ in range(2):  # all, then those that are carried
            kc, kphi, *soil, r, width, lugs, pressure, slip = drawn.T
            wheel = Wheel(r, r * width, r * lugs, 20)
            case = Soil(kc, 10.0**kphi, *soil), points(slip, pressure * r * wheel.width, wheel)
            flags = WheelSoilModel(case[0], effects).steady_state(case[1]).flags
            drawn = drawn[flags == 0]
        cases.append((case[0], effects, case[1]))
    return cases
