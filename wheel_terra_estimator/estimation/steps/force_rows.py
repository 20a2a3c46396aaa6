# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the update from wheel-soil forces: torque of each wheel, balance of the rover."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter import chi_square_gate
from wheel_terra_estimator.estimation.filter_state import (
    CENTROID,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SPEED,
)
from wheel_terra_estimator.estimation.measurement_models import WheelForces
from wheel_terra_estimator.estimation.steps.context import (
    Context,
    bears_and_turns,
    distrusted,
    leaving_angle_of,
    note_nis,
    slope_share,
    smoothed,
)
from wheel_terra_estimator.estimation.steps.turning_and_loads import ground_curvature

FloatArray = NDArray[np.float64]
_NAN = math.nan
_NEW_CONTACT = 0.15  # change of a torque, of load times radius, that is no noise of the state
# Errors of the models are the same over about this travel [m].
_SAME_GROUND, _MOST_REPETITIONS = 0.15, 100.0
_BALANCE_STD = 0.005  # of the weight: what curvature, ruts and mass leave open


def model_rows(
    c: Context,
    dt: float,
    rims: list[float],
    torque: list[float],
    residuals: list[float],
    variances: list[float],
    rows: list[FloatArray],
) -> None:
    """Append the rows of the torques and of the balance of forces to an update."""
    run, s, layout = c.run, c.settings, c.layout
    x, P = c.filter.mean, c.filter.covariance
    size = layout.size

    def add(channel: str, residual: float, row: FloatArray, variance: float) -> None:
        total = float(row @ P @ row) + variance
        note_nis(c, channel, residual * residual / total)
        # A soil change looks like an outlier: weaken it, do not lock it out.
        variance = distrusted(c, channel, variance)
        residuals.append(residual)
        variances.append(variance + chi_square_gate(residual, total, float(s.filter.gate)))
        rows.append(row)

    repeats = repetitions(rims, dt)
    balance = np.zeros(size)
    balance_sum = 0.0
    open_variance = 0.0
    jacobian, jacobian_torque = np.zeros((2, s.wheel_count, size))
    pulls, torques = np.zeros((2, s.wheel_count))
    # After a start the shear builds up over the contact length.
    fresh = 2.5 * math.exp(-2.0 * (run.fresh_travel / c.contact_length - 1.0))
    for i, rim in enumerate(rims):
        load = run.load[i]
        run.stand_pull[i] = _NAN
        if not bears_and_turns(c, i, rim):
            stands = rim == rim and load >= 1e-3
            pull = dragged_pull(c, i, torque[i], load) if stands else _NAN
            if pull == pull:
                run.stand_pull[i] = pull
                # In turns it is pushed sideways, too.
                unsure = 0.1 + float(s.sensors.torque_gain_std) + min(run.side_motion, 1.0)
            else:
                # Standing, lifted or unknown: it may carry its share of the slope, or nothing.
                pull, unsure = load * slope_share(c), 0.3
            balance_sum += pull
            open_variance += (unsure * load) ** 2
            continue
        direction = 1.0 if rim > 0.0 else -1.0
        pull, torque_model, row_pull, row_torque = wheel_rows(c, i, rim, direction)
        jacobian[i], jacobian_torque[i] = row_pull, row_torque
        pulls[i], torques[i] = pull, torque_model
        # Turning shears the soil sideways too, which the model does not know: ten cycles of
        # it are one piece of information.
        side = abs(run.yaw_rate) * c.curvature_length / abs(rim)
        scrub = 10.0 * min(side + run.renewal, 1.0) ** 2 + fresh
        open_variance += scrub * (0.1 * load) ** 2
        balance += row_pull
        balance_sum += pull
        reading = torque[i]
        if reading == reading:
            noise = float(s.sensors.torque_std) ** 2 + (s.load_std * torque_model) ** 2 + 1e-6
            variance = repeats * noise + scrub * torque_model**2
            add('torque', reading - torque_model, row_torque, variance)
    c.pull_jacobian = jacobian
    c.linear = (x.copy(), pulls, jacobian_torque, torques)
    c.pull_sum = None
    set_ratio_walk(c, jacobian, rims)
    if run.force_known and run.window.count:
        weight = s.mass * run.force[2]
        tilt = 0.0
        for i, gain in enumerate(s.rut_tilt):
            zi = layout.sinkage.start + i
            tilt += gain * float(x[zi])
            # Specific force along the ground: f_x - f_z * tilt (body pitched up by the ruts).
            balance[zi] += weight * gain
        # On curved ground the wheels' own slopes differ from the body's.
        uphill = ground_curvature(c) * sum(
            w * x_i for w, x_i in zip(run.load, s.longitudinal, strict=True)
        )
        residual = s.mass * run.force[0] - (balance_sum + weight * tilt - uphill)
        noise = float(s.sensors.specific_force_std) ** 2 / run.window.count
        known = s.mass**2 * (noise + float(s.sensors.specific_force_bias_std) ** 2)
        known += (_BALANCE_STD * weight) ** 2
        add('balance', residual, balance, repeats * known + open_variance)
        c.pull_sum = (s.mass * run.force[0] + uphill, weight, known)


def repetitions(rims: list[float], dt: float) -> float:
    """Return how many cycles see the same ground, and so the same errors of the models.

    Together they are one piece of information. Taken as many, each linearised anew at its own noisy
    state, they leave T(s) = const no ridge: strength, K and slip run along it to anywhere.
    """
    travel = dt * max((abs(rim) for rim in rims if rim == rim), default=0.0)
    return min(max(_SAME_GROUND / max(travel, 1e-9), 1.0), _MOST_REPETITIONS)


def dragged_pull(c: Context, i: int, torque: float, load: float) -> float:
    """Return the pull of a wheel that stands while the rover moves, from its torque [N].

    A locked wheel slides: its shear is saturated, and torque gives the pull whatever the
    strength of the soil. Where its hub stands too, torque and pull balance about the hub. A torque
    that drives a wheel which is dragged is not the soil's: its drive is jammed.
    """
    run, s, layout = c.run, c.settings, c.layout
    x = c.filter.mean
    speed = float(x[SPEED]) - run.yaw_rate * s.lateral[i]
    if torque != torque:
        return _NAN
    if abs(speed) < s.rest_speed:
        return min(max(torque / s.shear_radius[i], -load), load)
    direction = 1.0 if speed > 0.0 else -1.0
    forces = c.models.forces(
        i,
        3.0,
        float(x[layout.sinkage.start + i]),
        load,
        float(x[SHEAR_STRENGTH]),
        float(x[SHEAR_MODULUS]),
        float(x[CENTROID]),
        0.0,
        _NAN,
        _NAN,
    )
    pull = forces.pull
    jammed = direction * torque > 0.0 and run.side_motion < 0.1
    if forces.d_torque[2] and not jammed:
        gain = forces.d_pull[2] / forces.d_torque[2]
        pull += gain * (direction * torque - forces.torque)
    return direction * min(max(pull, -1.2 * load), load)


def set_ratio_walk(c: Context, jacobian: FloatArray, rims: list[float]) -> None:
    """Let the slip walk as what the ground asks does, over the slope of the traction curve.

    Where the curve is steep, a change of demand changes the slip little; on the plateau the
    same change makes the rover dig in.
    """
    run, s = c.run, c.settings
    steepness = sum(
        float(jacobian[i, SPEED]) * abs(rim) for i, rim in enumerate(rims) if rim == rim
    ) / max(sum(run.load), 1e-3)
    least, most = float(s.filter.ratio_walk_least), float(s.filter.ratio_walk)
    run.steepness = max(-steepness, 1e-3)
    walk = float(s.filter.demand_walk) / run.steepness
    run.ratio_walk = min(max(walk, least), most)


def wheel_rows(
    c: Context, i: int, rim: float, direction: float
) -> tuple[float, float, FloatArray, FloatArray]:
    """Return pull, torque and their rows of the Jacobian, in the body's signs."""
    layout = c.layout
    zi, ei = layout.sinkage.start + i, layout.shear_error.start + i
    forces = present_forces(c, i, rim, direction)
    by_torque, by_pull = smooth_slopes(c, i, forces)
    row_pull, row_torque = np.zeros(layout.size), np.zeros(layout.size)
    for row, derivatives in ((row_pull, by_pull), (row_torque, by_torque)):
        by_ratio, by_sinkage, by_strength, by_modulus, by_centroid, by_mound = derivatives
        # The ratio is that of the direction of rolling: the two signs cancel.
        row[SPEED] = by_ratio / abs(rim)
        row[zi] = direction * by_sinkage
        row[SHEAR_STRENGTH] = row[ei] = direction * by_strength
        row[SHEAR_MODULUS] = direction * by_modulus
        row[CENTROID] = direction * by_centroid
        row[MOUND] = direction * by_mound
    return direction * forces.pull, direction * forces.torque, row_pull, row_torque


def smooth_slopes(
    c: Context, i: int, forces: WheelForces
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the derivatives of torque and pull, smoothed over about a second.

    The curves bend within the uncertainty of the state. A slope taken at the noisy estimate is
    correlated with its error, which pulls the slip to the flat side and lets strength and K run
    along T(s) = const to their bounds; a smoothed one is not.
    """
    run = c.run
    old_torque, old_pull = run.torque_slopes[i], run.pull_slopes[i]
    if old_torque is None or old_pull is None:
        # The first slopes after a start are taken where the slip is known least: begin flat.
        torque: tuple[float, ...] = (0.2 * forces.d_torque[0], *forces.d_torque[1:])
        pull: tuple[float, ...] = (0.2 * forces.d_pull[0], *forces.d_pull[1:])
    else:
        torque = smoothed(old_torque, forces.d_torque)
        pull = smoothed(old_pull, forces.d_pull)
        moment = run.load[i] * c.settings.shear_radius[i]
        if abs(forces.d_torque[2] - old_torque[2]) > _NEW_CONTACT * moment:
            # A wheel that comes free or locks is another contact at once.
            torque, pull = (torque[0], *forces.d_torque[1:]), (pull[0], *forces.d_pull[1:])
    run.torque_slopes[i], run.pull_slopes[i] = torque, pull
    return torque, pull


def present_forces(c: Context, i: int, rim: float, direction: float) -> WheelForces:
    """Return the forces of a turning wheel at the present state, in its own direction."""
    run, s, layout = c.run, c.settings, c.layout
    x = c.filter.mean
    v = direction * (float(x[SPEED]) - run.yaw_rate * s.lateral[i])
    return c.models.forces(
        i,
        v / abs(rim),
        float(x[layout.sinkage.start + i]),
        run.load[i],
        float(x[SHEAR_STRENGTH] + x[layout.shear_error.start + i]),
        float(x[SHEAR_MODULUS]),
        float(x[CENTROID]),
        float(x[MOUND]),
        abs(rim),
        leaving_angle_of(c, i),
    )
