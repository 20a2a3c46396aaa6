# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull of each wheel after the update."""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_estimator.estimation.filter_state import SPEED
from wheel_terra_estimator.estimation.steps.context import Context, bears_and_turns, slope_share

_LEAST_SLIP_STD, _LEAST_TURNING_STD = 0.02, 0.04
_PILED_STD = 0.05  # of the load, at slip 1


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
        spread = np.einsum('ij,jk,ik->i', c.pull_jacobian, P, c.pull_jacobian)
    for i, rim in enumerate(rims):
        load = run.load[i]
        if not bears_and_turns(c, i, rim):
            # Static friction carries the slope, or it is dragged along.
            pull = run.stand_pull[i]
            run.pull[i] = pull if pull == pull else load * share
            run.torque_now[i] = run.pull[i] * s.rim_radius[i]
            run.pull_std[i] = (0.1 * load if run.force_known else load) + 1e-3
            continue
        if linear is None:
            # The contact is fresh after a start: the load's share is the best guess.
            run.pull[i] = load * share
            run.pull_std[i] = 0.1 * load + 1e-3
            continue
        # First order from far away overshoots: no soil gives more than the load.
        radius = s.shear_radius[i]
        run.pull[i] = min(max(float(pulls[i]), -load), load)
        most = 1.2 * load * radius
        run.torque_now[i] = min(max(float(torques[i]), -most), most)
        run.pull_std[i] = math.sqrt(
            max(float(spread[i]), 0.0)
            + (s.load_std * run.pull[i]) ** 2
            + (zero / radius) ** 2
            + (0.5 * gain * run.torque_now[i] / radius) ** 2
            + (0.01 * load) ** 2
            # Soil piled up by a wheel that hardly moves is in no model.
            + (_PILED_STD * max(run.slip[i] - 0.6, 0.0) / 0.4 * load) ** 2
        )
