# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A second, independent implementation of the reference quadrature, for hiding effects in.

It shares no line with ``wheel_terra_estimator.terramechanics``: the integrals use the
tanh-sinh rule (the package: Gauss-Legendre), the load balance is solved by Chandrupatla's
bracketing method (the package: Newton), and effects are free-form changes of a `Setup` instead
of terms of a catalogue. Where both describe the same wheel they must agree; a test says so.

Equations: Wong-Reece normal stress and Janosi shear in the form of Ding et al. 2010 (eqs 13-19),
kinematics from v/w (shear displacement ``j = R (t1 - t) - (v/w)(sin t1 - sin t)``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

Rows = dict[str, FloatArray]

OUTPUTS = ('sinkage', 'drawbar_pull', 'torque')


@dataclass(frozen=True)
class TrueSoil:
    """Soil of the hidden world [SI, rad]; the first seven but kc are free in a soil refit."""

    frictional_modulus: float = 2.0e6
    sinkage_exponent: float = 1.0
    friction_angle: float = 0.56
    shear_modulus: float = 0.012
    cohesion: float = 300.0
    peak_stress_ratio: float = 0.42
    leaving_angle_ratio: float = -0.2
    cohesive_modulus: float = 1.0e4
    density: float = 1600.0


# The soil parameters that a laboratory knows only so well, in refit coordinates: how far
# (one standard deviation) each is off in the field. Logarithm where the error is relative.
SOIL_SD = {
    'frictional_modulus': ('log', 0.10),
    'sinkage_exponent': ('add', 0.05),
    'friction_angle': ('logtan', 0.05),
    'shear_modulus': ('log', 0.10),
    'cohesion': ('log', 0.20),
    'peak_stress_ratio': ('add', 0.03),
    'leaving_angle_ratio': ('add', 0.03),
}


def moved_soil(soil: TrueSoil, units: FloatArray) -> TrueSoil:
    """Return the soil moved by ``units`` standard deviations of `SOIL_SD`, entry by entry."""
    values = {}
    for (name, (kind, sd)), u in zip(SOIL_SD.items(), units, strict=True):
        old = getattr(soil, name)
        if kind == 'log':
            values[name] = old * np.exp(sd * u)
        elif kind == 'logtan':
            values[name] = float(np.arctan(np.tan(old) * np.exp(sd * u)))
        else:
            values[name] = old + sd * u
    values['leaving_angle_ratio'] = min(values['leaving_angle_ratio'], 0.0)
    values['peak_stress_ratio'] = max(values['peak_stress_ratio'], 0.05)
    return replace(soil, **values)


@dataclass
class Setup:
    """What the contact of every row needs, (N,) arrays; effects change it before the solution."""

    load: FloatArray  # [N]
    stiffness: FloatArray  # kc/b + kphi [N/m^(N+2)]
    exponent: FloatArray
    cohesion: FloatArray  # [Pa]
    tan_phi: FloatArray
    shear_modulus: FloatArray  # [m]
    peak_ratio: FloatArray
    leaving_ratio: FloatArray
    radius: FloatArray  # rim [m]
    shear_radius: FloatArray  # [m]
    width: FloatArray  # [m]
    advance: FloatArray  # v/w [m]
    density: float
    rut: FloatArray  # depth that earlier passes left [m]
    leaving: list[Callable[[FloatArray, FloatArray], FloatArray]] = field(default_factory=list)
    extra_normal: list[Callable[[FloatArray], FloatArray]] = field(default_factory=list)
    extra_bearing: list[Callable[[FloatArray], FloatArray]] = field(default_factory=list)
    extra_by_angle: list[Callable[[FloatArray, FloatArray], FloatArray]] = field(
        default_factory=list
    )


class Hidden:
    """An effect of the hidden world: changes of the set-up, then of the outcome."""

    name = 'nothing'
    second: Mapping[str, float] = MappingProxyType({})

    def prepare(self, setup: Setup, rows: Rows) -> None:
        """Change the set-up in place."""

    def finish(self, out: Rows, setup: Setup, rows: Rows) -> None:
        """Change the outcome (`OUTPUTS` and ``geometric_sinkage``) in place."""


def _tanh_sinh() -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of the double-exponential rule on [0, 1]."""
    step, reach = 0.14, 2.94
    t = np.arange(-reach, reach + step / 2, step)
    inner = np.pi / 2 * np.sinh(t)
    nodes = 1.0 / (1.0 + np.exp(-2 * inner))
    weights = step * np.pi / 4 * np.cosh(t) / np.cosh(inner) ** 2
    return nodes, weights / weights.sum()


_NODES, _WEIGHTS = _tanh_sinh()


def v_over_w(slip: FloatArray, slip_radius: FloatArray) -> FloatArray:
    """Ground speed per wheel rate [m] of the recorded slip (driving and braking branch)."""
    braking = slip_radius / np.maximum(1.0 + np.minimum(slip, 0.0), 1e-3)
    return np.where(slip >= 0, (1.0 - slip) * slip_radius, braking)


def _setup(rows: Rows, soil: TrueSoil) -> Setup:
    one = np.ones_like(rows['slip'])
    tip = rows['wheel_radius'] + rows['lug_height']
    return Setup(
        load=rows['normal_load'].copy(),
        stiffness=soil.cohesive_modulus / rows['wheel_width'] + soil.frictional_modulus,
        exponent=soil.sinkage_exponent * one,
        cohesion=soil.cohesion * one,
        tan_phi=np.tan(soil.friction_angle) * one,
        shear_modulus=soil.shear_modulus * one,
        peak_ratio=soil.peak_stress_ratio * one,
        leaving_ratio=soil.leaving_angle_ratio * one,
        radius=rows['wheel_radius'].copy(),
        shear_radius=rows['wheel_radius'].copy(),
        width=rows['wheel_width'].copy(),
        advance=v_over_w(rows['slip'], tip),
        density=soil.density,
        rut=0.0 * one,
    )


def _integrals(setup: Setup, t1: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return load, pull, torque of the contact with entrance angle t1, Ding 2010 eq. 19."""
    col = lambda a: a[:, None]  # noqa: E731
    t2 = setup.leaving_ratio * t1
    for law in setup.leaving:
        t2 = law(t1, t2)
    tm = np.minimum(setup.peak_ratio, 0.95) * t1
    # u runs from 0 at the free edge to 1 at the peak, on both branches.
    u = _NODES[None, :]
    below = u * col(t1 - tm)  # t1 - equivalent angle
    drop = 2 * np.sin(col(t1) - below / 2) * np.sin(below / 2)  # cos te - cos t1
    depth = col(setup.radius) * drop  # at the equivalent angle
    sigma = col(setup.stiffness) * (depth + col(setup.rut)) ** col(setup.exponent)
    if setup.extra_bearing:
        sigma = sigma + sum(law(depth) for law in setup.extra_bearing)
    load = np.zeros_like(t1)
    pull = np.zeros_like(t1)
    torque = np.zeros_like(t1)
    for edge, span in ((t1, tm - t1), (t2, tm - t2)):
        theta = col(edge) + u * col(span)
        normal = sigma
        if setup.extra_normal:
            depth = col(setup.radius) * (np.cos(theta) - np.cos(col(t1)))
            normal = sigma + sum(law(depth) for law in setup.extra_normal)
        if setup.extra_by_angle:
            normal = normal + sum(law(theta, col(t2)) for law in setup.extra_by_angle)
        j = col(setup.shear_radius) * (col(t1) - theta) - col(setup.advance) * (
            np.sin(col(t1)) - np.sin(theta)
        )
        tau = (
            (col(setup.cohesion) + normal * col(setup.tan_phi))
            * -np.expm1(-np.abs(j) / col(setup.shear_modulus))
            * np.sign(j)
        )
        w = _WEIGHTS[None, :] * col(np.abs(span) * setup.width)
        r, R = col(setup.radius), col(setup.shear_radius)
        load += (w * (r * normal * np.cos(theta) + R * tau * np.sin(theta))).sum(1)
        pull += (w * (R * tau * np.cos(theta) - r * normal * np.sin(theta))).sum(1)
        torque += (w * R**2 * tau).sum(1)
    return load, pull, torque


def _entrance_angle(setup: Setup) -> FloatArray:
    """Solve the load balance by Chandrupatla's method, all rows at once; nan if it sinks in."""
    f = lambda t1: _integrals(setup, t1)[0] / setup.load - 1.0  # noqa: E731
    n = len(setup.load)
    b, fb = np.full(n, 1e-4), np.full(n, -1.0)
    a = np.full(n, 0.45)
    fa = f(a)
    for _ in range(5):  # widen where the wheel sinks deeper
        short = fa < 0
        if not short.any():
            break
        b, fb = np.where(short, a, b), np.where(short, fa, fb)
        a = np.where(short, np.minimum(a * 1.3, 1.5), a)
        fa = f(a)
    sunk = fa < 0
    t = np.full(n, 0.5)
    c, fc = a, fa
    for _ in range(40):
        x = a + t * (b - a)
        fx = f(x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        if np.all((np.minimum(np.abs(fa), np.abs(fb)) < 1e-9) | sunk):
            break
        with np.errstate(all='ignore'):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            quadratic = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
            inverse = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (
                fc - fb
            )
        tol = 1e-12 / np.maximum(np.abs(b - a), 1e-15)
        t = np.clip(np.where(quadratic, inverse, 0.5), tol, 1 - tol)
    return np.where(sunk, np.nan, best)


def solve(rows: Rows, soil: TrueSoil, hidden: Sequence[Hidden] = ()) -> Rows:
    """Return sinkage [m], drawbar pull [N] and torque [N m] of every row, nan where it sinks in."""
    setup = _setup(rows, soil)
    for effect in hidden:
        effect.prepare(setup, rows)
    t1 = _entrance_angle(setup)
    good = np.isfinite(t1)
    _, pull, torque = _integrals(setup, np.where(good, t1, 0.3))
    z = setup.radius * (1 - np.cos(t1))
    out: Rows = {
        'sinkage': z.copy(),
        'drawbar_pull': np.where(good, pull, np.nan),
        'torque': np.where(good, torque, np.nan),
        'geometric_sinkage': z,
        'entrance_angle': t1,
    }
    for effect in hidden:
        effect.finish(out, setup, rows)
    return out
