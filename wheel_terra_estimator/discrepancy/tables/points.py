# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Columns of a table as operating points of the model; what they do not state is the model's."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

WHEEL = {
    'wheel_radius': 'radius',
    'wheel_width': 'width',
    'lug_height': 'lug_height',
    'lug_count': 'lug_count',
}
"""Column -> the field of `Wheel`."""
_USUAL = {
    'slope': 0.0,
    'angular_velocity': np.nan,
    'pass_number': 1.0,
    'leaving_angle': np.nan,
    'slip_angle': 0.0,
}


def operating_points(
    columns: Mapping[str, FloatArray], configuration: Configuration, source: str, wheel: int = 0
) -> OperatingPoints:
    """Return rows as operating points.

    ``columns``: input column -> (N,) values [SI], nan = not stated; slip and normal load at least.
    Wheel (number ``wheel`` of the rover) and gravity that they do not state are those of the
    configuration. Raises UserError if neither states the wheel, or a value is out of range; it
    names ``source``.
    """
    count, wheels = len(columns['slip']), configuration.wheels

    def filled(name: str, default: float) -> FloatArray:
        given = columns.get(name, np.full(count, np.nan))
        return np.where(np.isnan(given), default, given)

    sizes = {}
    for name, field in WHEEL.items():
        needed = field in ('radius', 'width') and f'wheels.{field}' not in configuration.stated
        if needed and np.isnan(columns.get(name, np.full(1, np.nan))).any():
            raise UserError(
                f'{source}: no column {name}, and no wheel in the configuration (--config); '
                f'add the column, or -p wheels.{field}:=[0.15] with your number [m]'
            )
        own = getattr(wheels, field)
        sizes[field] = filled(name, float(own[wheel]) if len(own) else np.nan)
    thickness = float(wheels.lug_thickness[wheel]) if len(wheels.lug_thickness) else 0.0
    try:
        return OperatingPoints(
            slip=columns['slip'],
            normal_load=columns['normal_load'],
            wheel=Wheel(**sizes, lug_thickness=thickness),
            slip_radius=configuration.slip_radius,
            gravity=filled('gravity', float(configuration.rover.gravity)),
            **{name: filled(name, value) for name, value in _USUAL.items()},
        )
    except ValueError as error:
        raise UserError(f'{source}: {error}') from None
