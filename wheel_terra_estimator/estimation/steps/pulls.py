# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull of each wheel after the update."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.estimation.filter_state import SHEAR_STRENGTH, SPEED
from wheel_terra_estimator.estimation.steps.context import Context, bears_and_turns, slope_share

FloatArray = NDArray[np.float64]
_LEAST_SLIP_STD, _LEAST_TURNING_STD = 0.02, 0.04
_PILED_STD = 0.05  # of the load, at slip 1
_EXCESS_GAIN = 0.2  # per cycle


def floor_speed_variance(c: Context, rims: list[float]) -> None:
    """Keep a least slip deviation: no set of soil models is better than that."""
    typical = sum(abs(r) for r in rims if r == r) / len(rims)
    least = (typical * (_LEAST_SLIP_STD + _LEAST_TURNING_STD * min(c.run.side_motion, 1.0))) ** 2
    lacking = least - float(c.filter.covariance[SPEED, SPEED])
    if lacking > 0.0:
        c.filter.widen(SPEED, lacking)


def work_out_pulls(c: Context, rims: list[float]) -> None:
    """Work out pulls and torques after the update, to first order from the last pass."""
    run, s = c.run, c.settings
    x, P = c.filter.mean, c.filter.covariance
    share = slope_share(c)
    zero = float(s.sensors.torque_zero_std)
    gain = float(s.sensors.torque_gain_std)
    linear, c.linear = c.linear, None
    if linear is not None:
        before, pulls, jacobian_torque, torques = linear
        moved = x - before
        pulls = pulls + c.pull_jacobian @ moved
        torques = torques + jacobian_torque @ moved
        joint = c.pull_jacobian @ P @ c.pull_jacobian.T
    own = np.zeros(s.wheel_count)  # variances that no other wheel shares
    for i, rim in enumerate(rims):
        load = run.load[i]
        if not bears_and_turns(c, i, rim):
            # Static friction carries the slope, or it is dragged along.
            pull = run.stand_pull[i]
            run.pull[i] = pull if pull == pull else load * share
            run.torque_now[i] = run.pull[i] * s.rim_radius[i]
            run.pull_std[i] = (0.1 * load if run.force_known else load) + 1e-3
            own[i] = run.pull_std[i] ** 2
            continue
        if linear is None:
            # The contact is fresh after a start: the load's share is the best guess.
            run.pull[i] = load * share
            run.pull_std[i] = 0.1 * load + 1e-3
            continue
        radius = s.shear_radius[i]
        excess = believed_excess(c, i, float(torques[i]))
        by_strength = float(jacobian_torque[i, SHEAR_STRENGTH])
        if excess and by_strength:
            torques[i] += excess
            pulls[i] += excess * c.pull_jacobian[i, SHEAR_STRENGTH] / by_strength
        # First order from far away overshoots: no soil gives more than the load.
        run.pull[i] = min(max(float(pulls[i]), -load), load)
        most = 1.2 * load * radius
        run.torque_now[i] = min(max(float(torques[i]), -most), most)
        own[i] = (
            (s.load_std * run.pull[i]) ** 2
            + (zero / radius) ** 2
            + (0.5 * gain * run.torque_now[i] / radius) ** 2
            + (0.01 * load) ** 2
            # Loads of level ground may be far off.
            + (0.0 if run.force_known else 0.2 * load) ** 2
            # Soil piled up by a wheel that hardly moves is in no model.
            + (_PILED_STD * max(run.slip[i] - 0.6, 0.0) / 0.4 * load) ** 2
        )
        run.pull_std[i] = math.sqrt(max(float(joint[i, i]), 0.0) + own[i])
    run.model_pull = list(run.pull)
    if linear is not None:
        share_the_rest(c, joint + np.diag(own))


def believed_excess(c: Context, i: int, torque: float) -> float:
    """Return what a wheel's torque says beyond its model and beyond the sensor's errors [N m].

    The filter takes torque for one piece of information per ground, so that slip and soil are not
    torn along T(s) = const. The pull may follow at once: it hangs on the torque alone, whatever the
    strength. Not in turns, which push the soil sideways, too.
    """
    run, s = c.run, c.settings
    reading = run.torque_held[i]
    if reading != reading:
        return 0.0
    sensors = s.sensors
    run.torque_excess[i] += _EXCESS_GAIN * (reading - torque - run.torque_excess[i])
    excess = run.torque_excess[i]
    noise = (
        _EXCESS_GAIN / 2.0 * float(sensors.torque_std) ** 2
        + float(sensors.torque_zero_std) ** 2
        + (float(sensors.torque_gain_std) * reading) ** 2
    )
    # Shrunk as James and Stein do: nothing below its noise, all of what is far above it.
    believed = max(1.0 - 2.0 * noise / max(excess * excess, 1e-12), 0.0)
    return excess * believed * max(1.0 - 5.0 * run.side_motion, 0.0)


def share_the_rest(c: Context, covariance: FloatArray) -> None:
    """Give the pulls what is left of their sum, which the specific force knows best.

    Shares go by the covariance of the pulls (n, n). The deviations stay: what parts the wheels from
    one another is not known better for it.
    """
    run, s = c.run, c.settings
    if c.pull_sum is None:
        return
    along, weight, variance = c.pull_sum
    tilt = sum(
        gain * float(z) for gain, z in zip(s.rut_tilt, c.filter.mean[c.layout.sinkage], strict=True)
    )
    # Pushed sideways, a wheel pulls as no model knows.
    scrub = (0.05 * run.side_motion * np.asarray(run.load)) ** 2
    shares = covariance.sum(axis=1) + scrub
    rest = along - weight * tilt - sum(run.pull)
    for i, share in enumerate(shares / (shares.sum() + variance)):
        load = run.load[i]
        run.pull[i] = min(max(run.pull[i] + float(share) * rest, -1.2 * load), load)
