# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A second wheel-soil model, adaptive and scalar, and random contacts."""

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


def second_model(slip: float, load: float, soil: Soil, wheel: Wheel, n1=0.0, c2=0.0, lam=0.0):
    """Sinkage, pull, torque by scipy's quad and brentq, written from the equations alone."""
    r, b, R = wheel.radius, wheel.width, wheel.radius + lam * wheel.lug_height
    k = soil.cohesive_modulus / b + soil.frictional_modulus
    n = soil.sinkage_exponent + n1 * abs(slip)
    tip = wheel.radius + wheel.lug_height
    ratio = tip * (1.0 - slip) if slip >= 0.0 else tip / (1.0 + slip)

    def stress(t: float, t1: float) -> tuple[float, float]:
        tm, t2 = (soil.peak_stress_ratio + c2 * slip) * t1, soil.leaving_angle_ratio * t1
        mirrored = t if t >= tm else t1 - (t - t2) / (tm - t2) * (t1 - tm)
        sigma = k * (r * max(0.0, math.cos(mirrored) - math.cos(t1))) ** n
        j = R * (t1 - t) - ratio * (math.sin(t1) - math.sin(t))
        grip = math.copysign(1.0 - math.exp(-abs(j) / soil.shear_modulus), j)
        return sigma, (soil.cohesion + sigma * math.tan(soil.friction_angle)) * grip

    def total(integrand, t1: float) -> float:
        tm, t2 = (soil.peak_stress_ratio + c2 * slip) * t1, soil.leaving_angle_ratio * t1
        parts = ((t2, tm), (tm, t1))
        return sum(quad(lambda t: integrand(t, *stress(t, t1)), *p, epsrel=1e-10)[0] for p in parts)

    def balance(t1: float) -> float:
        return b * total(lambda t, s, q: r * s * math.cos(t) + R * q * math.sin(t), t1) - load

    t1 = brentq(balance, 0.01, 1.5, xtol=1e-13)
    pull = b * total(lambda t, s, q: R * q * math.cos(t) - r * s * math.sin(t), t1)
    return r * (1.0 - math.cos(t1)), pull, b * R * R * total(lambda t, s, q: q, t1)


def random_cases(count: int, seed: int) -> list[tuple[Soil, dict, OperatingPoints]]:
    """Random soils, wheels and loads that a soil can carry."""
    random = np.random.default_rng(seed)
    cases = []
    while len(cases) < count:
        soil = Soil(
            random.uniform(0, 2e4),
            10 ** random.uniform(5.6, 6.7),
            random.uniform(0.6, 1.3),
            random.uniform(0, 2000),
            random.uniform(0.3, 0.8),
            random.uniform(0.003, 0.03),
            random.uniform(0.3, 0.6),
            random.uniform(-0.4, 0.0),
        )
        r = random.uniform(0.05, 0.3)
        wheel = Wheel(r, r * random.uniform(0.5, 1.5), r * random.uniform(0, 0.15), 20)
        load = random.uniform(1e3, 8e3) * wheel.radius * wheel.width
        effects = {
            'slip_sinkage_exponent': {'n1': random.uniform(0, 0.5)},
            'stress_peak_shift': {'c2': random.uniform(0, 0.3)},
            'lug_shear_radius': {'lam': random.uniform(0, 1)},
            'soil_mound': {'kappa': random.uniform(0, 2), 'onset': random.uniform(0.2, 0.6)},
        }
        row = points(random.uniform(-0.6, 0.9, 4), load, wheel)
        if not WheelSoilModel(soil, effects, strict=False).steady_state(row).flags.any():
            cases.append((soil, effects, row))
    return cases
