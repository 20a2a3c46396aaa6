# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From contacts to the paper's figures: H, R_r, torque, angles of contact, averages of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wheel_terra_lab.soilbin.case import Case

STATE = 'facts.json'
"""File of a state from which an interrupted run goes on."""
SERIES = (
    'time',  # [s] since the wheel began to turn
    'position',  # [m] of the axle along the slope
    'height',  # [m] of the axle above the floor
    'gross_traction',  # H [N], sum of the contacts' forces along +x
    'motion_resistance',  # R_r [N], sum of the contacts' forces along -x, positive
    'normal_force',  # [N], sum of the contacts' forces along y
    'torque',  # [N m], driving torque that balances the contacts' moment
    'entrance_angle',  # [rad] of the foremost contact, from the inward normal, forward positive
    'leaving_angle',  # [rad] of the rearmost contact
    'contacts',  # number of contacts of the wheel
    'body_torque',  # [N m], the engine's own sum on the rigid wheel, as driving torque
)


@dataclass(frozen=True)
class WheelContacts:
    """Forces of the soil on the wheel, one row per contact: points about the axle."""

    point: np.ndarray  # (n, 2) [m]
    force: np.ndarray  # (n, 2) [N]


def sums(contacts: WheelContacts) -> dict[str, float]:
    """Return H, R_r, normal force, torque and contact angles of one instant.

    H and R_r are contact-wise sums of the positive and the negative components along the
    slope (Nakashima et al. 2010, section 3.2).
    """
    if contacts.force.shape[0] == 0:
        zero = dict.fromkeys(SERIES[3:-1], 0.0)
        return zero | {'entrance_angle': math.nan, 'leaving_angle': math.nan}
    along, normal = contacts.force.T
    x, y = contacts.point.T
    loaded = np.hypot(along, normal) > 0
    angles = np.arctan2(x, -y)[loaded]
    return {
        'gross_traction': float(along[along > 0].sum()),
        'motion_resistance': float(-along[along < 0].sum()),
        'normal_force': float(normal.sum()),
        # Forward rolling turns clockwise: the soil's counter-clockwise moment is the drive torque.
        'torque': float((x * normal - y * along).sum()),
        'entrance_angle': float(angles.max()) if angles.size else math.nan,
        'leaving_angle': float(angles.min()) if angles.size else math.nan,
        'contacts': float(loaded.sum()),
    }


def summary(case: Case, series: np.ndarray, facts: dict, stopped: str) -> dict[str, object]:
    """Return the paper's figures, averaged from the end of the pull's ramp on.

    Parameters: the case, the time series (n, len(SERIES)), what the engine process found out, and
    why the run stopped early ('' if it did not).
    """
    operation, wheel = case.operation, case.wheel
    column = {name: series[:, k] for k, name in enumerate(SERIES)}
    time, position = column['time'], column['position']
    ramp = operation.pull_ramp / (operation.speed_factor * operation.tip_speed)
    window = time >= ramp
    if window.sum() < 2:
        window = np.ones_like(time, dtype=bool)
    rim_speed = case.rim_rate * wheel.tip_radius

    def mean(name: str) -> float:
        values = column[name][window]
        values = values[np.isfinite(values)]
        return float(values.mean()) if values.size else math.nan

    def slip(part: np.ndarray) -> float:
        t, x = time[part], position[part]
        return 1 - float((x[-1] - x[0]) / (t[-1] - t[0])) / rim_speed

    weight = operation.vertical_load
    half = time >= 0.5 * (time[0] + time[-1])
    measured_slip = slip(window)
    traction, resistance = mean('gross_traction'), mean('motion_resistance')
    torque = traction * wheel.tip_radius
    body_torque = mean('body_torque')
    sunk = facts['surface'] - (column['height'] - wheel.rim_radius)
    static = facts['surface'] - (facts['start_y'] - wheel.rim_radius)
    travelled = 1 - measured_slip
    imposed = not math.isnan(operation.imposed_slip)
    demanded = math.nan if imposed else weight * math.sin(operation.slope) + operation.hitch_pull

    def power_number(value: float) -> float:
        # T omega / (W V_a); no such number for a wheel that does not advance
        return value / (weight * wheel.tip_radius * travelled) if travelled > 0 else math.nan

    return {
        'slip': measured_slip,
        'slip_second_half': slip(half),
        'slip_whole': 1 - (position[-1] - facts['start_x']) / (time[-1] * rim_speed),
        'gross_traction': traction,
        'motion_resistance': resistance,
        'net_traction': traction - resistance,
        'demanded_pull': demanded,
        'normal_force': mean('normal_force'),
        'torque_gross': torque,
        'torque_body': body_torque,
        'torque_coefficient': traction / weight,
        'pull_coefficient': (traction - resistance) / weight,
        'power_number': power_number(torque),
        'power_number_body': power_number(body_torque),
        'sinkage_average': float(np.mean((facts['start_y'] - column['height'])[window])),
        'sinkage_static': float(static),
        'slid_before': float(operation.start - facts['start_x']),
        'sinkage': float(np.mean(sunk[window])),
        'entrance_angle': mean('entrance_angle'),
        'leaving_angle': mean('leaving_angle'),
        'solid_fraction': facts['solid_fraction'],
        'time_step': facts['time_step'],
        'discs': facts['discs'],
        'particle_steps_per_second': facts['discs']
        * facts['travel_steps']
        / max(1e-9, facts['travel_seconds']),
        'wall_seconds': facts['preparation_seconds'] + facts['travel_seconds'],
        'travelled': float(position[-1] - facts['start_x']),
        'stopped': stopped,
    }
