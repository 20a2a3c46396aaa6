# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entrance angle at which the soil carries the load, all points at once.

Load grows nearly like a power of the angle, so everything runs on logarithms: ``balance`` by
interpolation for the closed form, ``solve_entrance_angle`` by bracketed Newton for any model.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, Quantity
from wheel_terra_estimator.terramechanics.closed_form import BranchForces
from wheel_terra_estimator.terramechanics.contact import Contact

# Sinkage equal to the radius: the stress laws end here.
LARGEST_ANGLE = np.pi / 2
SMALLEST_ANGLE = 1e-5
_FIRST_GUESSES = 1e-3, 1.4  # least and greatest first guess [rad]
_START = 0.3  # first guess where there is no other [rad]
_STEP = 1e-6  # relative step of the finite difference
_TOLERANCE = 1e-10  # of the load
_NEAR = 1e-5  # error over the load from which one Newton step reaches the tolerance
_LEAST_EXPONENT = 0.2  # of the load over the angle, for a Newton step
_NEWTON_STEPS, _BISECTIONS, _SCANNED = 40, 60, 80


def explicit_entrance_angle(contact: Contact) -> FloatArray:
    """First guess from the normal stress alone, small angles, triangular stress (10 to 20 %)."""
    n = contact.sinkage_exponent
    rise = 0.5 * contact.radius * np.maximum(1.0 - contact.peak_ratio**2, 0.05)
    area = 0.5 * contact.width * contact.radius * (1.0 - contact.leaving_ratio)
    modulus = contact.bearing_modulus * (rise / contact.reference_depth) ** n
    guess = (contact.normal_load / (area * modulus)) ** (1.0 / (2.0 * n + 1.0))
    return np.clip(guess, *_FIRST_GUESSES)


def balance(
    form: BranchForces, load: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Solve the closed form's load balance: entrance angle [rad], pull [N], torque [N m].

    The forces at three angles (small angles, a step with the exponent 2 N + 1, the secant) give
    angle, pull and torque as parabolas of the load's logarithm, read off at the load. No iteration;
    the few points with a larger error than 1e-10 of the load go to the bracketed solver. Returns
    (N,) angle, pull, torque, and True where the soil carries the load; `LARGEST_ANGLE` elsewhere.
    """
    with np.errstate(all='ignore'):
        power = 2.0 * form.exponent + 1.0
        x0 = np.log(np.minimum(form.small_angle(load), 0.5 * LARGEST_ANGLE))
        w0, f0, t0 = form.forces(np.exp(x0))
        y0 = np.log(w0 / load)
        x1 = x0 - y0 / power
        w1, f1, t1 = form.forces(np.exp(x1))
        y1 = np.log(w1 / load)
        first = _inverse(y1 - y0)
        x2 = x1 - y1 * ((x1 - x0) * first)
        w2, f2, t2 = form.forces(np.exp(x2))
        y2 = np.log(w2 / load)
        second, third = _inverse(y2 - y1), _inverse(y2 - y0)

        def at_load(v0: Quantity, v1: Quantity, v2: Quantity) -> FloatArray:
            slope = (v2 - v1) * second
            return np.asarray(v2 - y2 * (slope - y1 * (slope - (v1 - v0) * first) * third))

        angle = np.exp(at_load(x0, x1, x2))
        pull, torque = at_load(f0, f1, f2), at_load(t0, t1, t2)
        # The next term of the series is some tenth of this.
        settled = (np.abs(y0 * y1 * y2) < _TOLERANCE) & (angle < LARGEST_ANGLE)
    if settled.all():
        return angle, pull, torque, settled
    start = np.clip(np.where(np.isfinite(angle), angle, _START), *_FIRST_GUESSES)
    found, carries = solve_entrance_angle(
        lambda angles: np.asarray(form.forces(angles)[0]), load, start
    )
    angle = np.where(settled, angle, found)
    _, by_pull, by_torque = form.forces(angle)
    pull, torque = np.where(settled, pull, by_pull), np.where(settled, torque, by_torque)
    return angle, pull, torque, settled | carries


def _inverse(step: FloatArray) -> FloatArray:
    """Reciprocal of a step of the load's logarithm; 0 where two angles give the same load."""
    return np.where(step == 0.0, 0.0, 1.0 / step)


def solve_entrance_angle(
    carried: Callable[[FloatArray], FloatArray], load: FloatArray, start: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Solve carried(t1) = load for each point.

    Load grows nearly like a power of the angle, so Newton runs on logarithms; a bracket catches
    the rest. Points where it fails are scanned for their first crossing.

    ``carried``: (2, N) angles -> (2, N) vertical force [N]. ``load``, ``start``: (N,) load [N] and
    first guess [rad]. Returns (N,) entrance angle [rad], `LARGEST_ANGLE` where the soil cannot
    carry the load, and whether it can.
    """
    load = np.asarray(load, float)
    angle = np.broadcast_to(np.asarray(start, float), load.shape).copy()
    low, high = np.full_like(angle, SMALLEST_ANGLE), np.full_like(angle, LARGEST_ANGLE)
    pair = np.empty((2, *angle.shape))
    done = np.zeros(angle.shape, bool)
    for _ in range(_NEWTON_STEPS):
        pair[0], pair[1] = angle, angle * (1.0 + _STEP)
        force, next_force = carried(pair)
        error = np.abs(force - load)
        done = error <= _TOLERANCE * load
        if done.all():
            return angle, done
        low = np.where(force < load, angle, low)
        high = np.where(force >= load, angle, high)
        with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
            exponent = (next_force / force - 1.0) / _STEP
            proposal = angle * (load / force) ** (1.0 / exponent)
        good = (proposal > low) & (proposal < high) & (exponent > _LEAST_EXPONENT)
        step = np.where(good, proposal, np.sqrt(low * high))
        angle = np.where(done, angle, step)
        if np.all(done | (good & (error < _NEAR * load))):
            return angle, np.ones_like(done)
        if np.all(done | (high - low < 1e-13)):
            break
    return _first_crossing(carried, load, angle, done)


def _first_crossing(
    carried: Callable[[FloatArray], FloatArray],
    load: FloatArray,
    angle: FloatArray,
    done: BoolArray,
) -> tuple[FloatArray, BoolArray]:
    """Scan all points coarsely, then bisect those not done; the smallest crossing counts."""
    grid = np.geomspace(_FIRST_GUESSES[0], LARGEST_ANGLE, _SCANNED)
    force = np.concatenate(
        [carried(np.stack([np.full_like(load, a), np.full_like(load, b)]))
         for a, b in zip(grid[::2], grid[1::2], strict=True)]
    )  # fmt: skip
    above = force >= load
    carries = above.any(axis=0)
    first = np.argmax(above, axis=0)
    high = grid[first]
    low = np.where(first > 0, grid[np.maximum(first - 1, 0)], SMALLEST_ANGLE)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        enough = carried(np.stack([middle, middle]))[0] >= load
        high, low = np.where(enough, middle, high), np.where(enough, low, middle)
    angle = np.where(done, angle, np.where(carries, high, LARGEST_ANGLE))
    return angle, done | carries
