# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drawbar pull from torque, load and contact angles: both stresses eliminated from the balances."""

from __future__ import annotations

from typing import Any

from wheel_terra_estimator.terramechanics.closed_form import coefficients


def decoupled_pull(
    torque: Any,
    normal_load: Any,
    entrance_angle: Any,
    peak_angle: Any,
    leaving_angle: Any,
    shear_radius: Any,
) -> Any:
    """Drawbar pull from torque, load and contact angles: no soil parameter, no width [N].

    F = (A^2 + B^2)/(A C) T/R - (B/A) W: both peak stresses eliminated from the three balances.
    """
    a, b, c = coefficients(entrance_angle, peak_angle, leaving_angle)
    return (a * a + b * b) / (a * c) * torque / shear_radius - b / a * normal_load
