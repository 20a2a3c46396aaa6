# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Next measurement: row blocks, ranked by how well they separate open hypotheses (d')."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.numbers import joined
from wheel_terra_estimator.discrepancy.result import NextMeasurement
from wheel_terra_estimator.discrepancy.selection.weights import Setting
from wheel_terra_estimator.terramechanics.effects.base import effect_of
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

_SLIPS = np.array([0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.7, 0.8])
_KEPT = 3
_WORTH = 2.0  # d' that a measurement must promise, and ...
_MORE = 1.5  # ... least gain over the present distance of a proposed measurement
_DEEPEST = 0.6  # of the radius: blocks in which a competitor sinks deeper are not proposed
# A proportional loss vanishes at zero torque; lifting and lowering differ by friction alone.
_KNOWN_TORQUE = (
    'read the torque while the wheel lifts, then lowers, a known weight on a cord round it'
)
# A zero check costs minutes and settles an instrument's error for good.
ZERO_CHECKS = {
    'sinkage_offset': 'read the sinkage sensor with the wheel on a hard, level floor (should be 0)',
    'drivetrain_friction': 'read the torque with the wheel turning in the air',
    'drivetrain_friction:proportional': _KNOWN_TORQUE,
    'wheel_radius_bias': 'roll the wheel out on a hard floor: distance over 10 turns',
    'pull_zero': 'read the pull with the wheel lifted off the soil (should be 0)',
    'pull_gain': 'load the pull sensor with a known weight on a cord',
    'torque_gain': _KNOWN_TORQUE,
    'sinkage_gain': 'lift the sinkage sensor by a step of known height',
    'pitch_bias': 'read attitude and pull with the rig at rest, then turned by 180 degrees',
}


def propose(
    setting: Setting, chosen: Fit, competitors: Sequence[Fit], std: FloatArray
) -> tuple[NextMeasurement, ...]:
    """Rank measurements by how far they would part the chosen explanation from its competitors.

    ``chosen``, ``competitors``: the best explanation, and those that the rows cannot exclude, most
    probable first. ``std``: (4,) noise of a new row.
    """
    found: list[NextMeasurement] = []
    where = '' if setting.forward.active is None else ' (for the table, not its reference)'
    competitors = competitors[:2]
    menu = _menu(setting) if competitors else []
    predicted = _predicted(setting, [chosen, *competitors], menu)
    for place, competitor in enumerate(competitors, 1):
        names = (joined(chosen.names), joined(competitor.names))
        if names[0] == names[1]:  # two forms of the same
            names = (' + '.join(chosen.names), ' + '.join(competitor.names))
        now = _distance(setting, chosen, competitor)
        ours, theirs = ({effect_of(key) for key in f.names} for f in (chosen, competitor))
        checks = (
            ZERO_CHECKS.get(key, ZERO_CHECKS.get(effect_of(key)))
            for key in (*chosen.names, *competitor.names)
            if effect_of(key) in ours ^ theirs
        )
        found += [
            NextMeasurement(check, names, now, np.inf) for check in dict.fromkeys(checks) if check
        ]
        blocks = []
        for (what, rows), (values, sensitivity) in zip(menu, predicted, strict=True):
            outputs = values[[0, place]]
            new = (outputs[0] - outputs[1]) / std, sensitivity[place] / std[None, :, None]
            then = _distance(setting, chosen, competitor, new)
            depth = outputs[..., 0].max()
            worth = np.isfinite(then) and then > max(_WORTH, _MORE * now)
            if worth and depth < _DEEPEST * rows['wheel_radius'][0]:
                stated = {key: column for key, column in rows.items() if np.isfinite(column).all()}
                blocks.append(NextMeasurement(what + where, names, now, then, stated))
        blocks.sort(key=lambda block: -block.distance_then)
        found.extend(blocks[:_KEPT])
    return tuple(found)


def _menu(setting: Setting) -> list[tuple[str, dict[str, FloatArray]]]:
    """Return the blocks of rows that a laboratory could add: input column -> (8,) values."""
    old, wheel = setting.forward.points, setting.forward.points.wheel
    rate = np.asarray(old.angular_velocity, dtype=float)
    speed = float(np.nanmedian(rate)) if np.isfinite(rate).any() else np.nan
    load, lugs = float(np.median(old.normal_load)), float(np.max(wheel.lug_height))
    radius, width = float(np.median(wheel.radius)), float(np.median(wheel.width))
    passes = float(np.min(old.pass_number))
    base = {
        'slip': _SLIPS,
        'normal_load': load,
        'slope': 0.0,
        'wheel_radius': radius,
        'wheel_width': width,
        'lug_height': lugs,
        'angular_velocity': speed,
        'pass_number': passes,
    }
    changes: list[tuple[str, dict[str, Any]]] = [
        ('braking rows, slip -0.3 to -0.02', {'slip': -np.linspace(0.02, 0.3, len(_SLIPS))}),
        ('slip 0.82 to 0.94', {'slip': np.linspace(0.82, 0.94, len(_SLIPS))}),
        ('three times the load', {'normal_load': 3.0 * load}),
        ('a third of the load', {'normal_load': load / 3.0}),
        ('a wheel of 0.6 times the radius', {'wheel_radius': 0.6 * radius}),
        ('a wheel of twice the width', {'wheel_width': 2.0 * width}),
        ('a slope of 12 degrees', {'slope': np.radians(12.0)}),
        ('one more sweep at the usual load, slip 0.05 to 0.8', {}),
    ]
    if lugs > 0.0:
        changes.append(('the wheel without lugs', {'lug_height': 0.0}))
        changes.append(('lugs 1.6 times as high', {'lug_height': 1.6 * lugs}))
    if np.isfinite(speed):
        changes.append(('five times the speed', {'angular_velocity': 5.0 * speed}))
    changes.append(('a second pass in the same rut', {'pass_number': passes + 1.0}))
    return [
        (what, {key: np.full(len(_SLIPS), value) for key, value in {**base, **change}.items()})
        for what, change in changes
    ]


def _predicted(
    setting: Setting, fits: Sequence[Fit], menu: Sequence[tuple[str, Mapping[str, FloatArray]]]
) -> list[tuple[FloatArray, list[FloatArray]]]:
    """Return outputs (B, n, 4) and Jacobians of every block of rows, all solved at once."""
    if not menu:
        return []
    old = setting.forward.points
    columns = {key: np.concatenate([rows[key] for _, rows in menu]) for key in menu[0][1]}
    wheel = Wheel(
        *(columns.pop(key) for key in ('wheel_radius', 'wheel_width', 'lug_height')),
        *(float(np.median(part)) for part in (old.wheel.lug_count, old.wheel.lug_thickness)),
    )
    points = OperatingPoints(
        wheel=wheel, slip_radius=old.slip_radius, gravity=float(np.median(old.gravity)), **columns
    )
    elsewhere = replace(setting.forward, points=points, active=None, readings=None)
    state = elsewhere.solve(
        [f.coordinates for f in fits],
        [f.u for f in fits],
        by=[[], *(range(len(f.u)) for f in fits[1:])],
    )
    parts = [slice(k * len(_SLIPS), (k + 1) * len(_SLIPS)) for k in range(len(menu))]
    return [(state.outputs[:, part], [j[part] for j in state.jacobian]) for part in parts]


def _distance(
    setting: Setting, chosen: Fit, competitor: Fit, new: tuple[FloatArray, FloatArray] | None = None
) -> float:
    """Distance d' of the chosen prediction from the competitor's best refit to it (linear).

    ``new``: differences (n, 4) on new rows and their derivatives (n, 4, P), in noise deviations.
    """
    problem = setting.problem
    scale = 1.0 / np.sqrt(competitor.variance)
    difference = problem.rotation @ problem.flat(chosen.outputs - competitor.outputs) * scale
    jacobian = competitor.jacobian * scale[:, None]
    if new is not None:
        keep = np.isfinite(new[0])
        difference = np.concatenate([difference, new[0][keep]])
        jacobian = np.concatenate([jacobian, new[1][keep]])
    precision = jacobian.T @ jacobian + np.diag(competitor.prior)
    step = np.linalg.solve(precision, jacobian.T @ difference)
    return float(np.linalg.norm(difference - jacobian @ step))
