# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Geometry of a rigid cylindrical wheel, or of several at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics.checks import check_range


@dataclass(frozen=True)
class Wheel:
    """A rigid wheel with straight lugs across its width.

    Every field is a float, or an (n,) array for n wheels (or table rows); ``api.Model`` and
    ``api.Soil.fit`` take one wheel.

    Attributes
    ----------
    radius : float or numpy.ndarray
        Rim radius r, lugs not counted [m].
    width : float or numpy.ndarray
        Rim width b [m].
    lug_height : float or numpy.ndarray
        Height h of the lugs above the rim [m]; 0 for a smooth wheel.
    lug_count : float or numpy.ndarray
        Number of lugs on the circumference [-].
    lug_thickness : float or numpy.ndarray
        Thickness of a lug along the circumference [m].
    """

    radius: Quantity
    width: Quantity
    lug_height: Quantity = 0.0
    lug_count: Quantity = 0
    lug_thickness: Quantity = 0.0

    def __post_init__(self) -> None:
        check_range('wheel radius', self.radius, 0.0, unit='m', open_lower=True)
        check_range('wheel width', self.width, 0.0, unit='m', open_lower=True)
        check_range('lug height', self.lug_height, 0.0, unit='m')
        check_range('lug count', self.lug_count, 0.0)
        check_range('lug thickness', self.lug_thickness, 0.0, unit='m')

    @property
    def tip_radius(self) -> Quantity:
        """Radius of the lug tips, r + h [m]."""
        return self.radius + self.lug_height

    def map(self, function: Callable[[Any], Any]) -> Wheel:
        """Return the wheel whose fields are a function of these."""
        return Wheel(*(function(getattr(self, f.name)) for f in fields(self)))
