# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A self-propelled wheel on a slope: slip from the balance, coefficients (Nakashima 2010)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.model import OVERLOADED, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import (
    STANDARD_GRAVITY,
    OperatingPoints,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel

FloatArray = NDArray[np.float64]
# ``weight``: the weight W is given, the soil carries W cos a. ``constant``: the soil carries W on
# every slope, as in the model and rig of Nakashima et al. 2010, which turn the load with the bed.
LOAD_CONVENTIONS = ('weight', 'constant')
LARGEST_SLIP = 0.98


@dataclass(frozen=True)
class SlopeState:
    """A wheel that climbs steadily, one entry per slope.

    Attributes
    ----------
    slope : numpy.ndarray
        [rad].
    slip : numpy.ndarray
        [-]; nan where the soil cannot give the pull.
    sinkage, drawbar_pull, torque : numpy.ndarray
        [m], [N], [N m].
    pull_coefficient : numpy.ndarray
        Pull over weight [-].
    torque_coefficient : numpy.ndarray
        T/(W r_slip) [-].
    power_coefficient : numpy.ndarray
        Power over weight times rim speed, the same number as the torque coefficient [-].
    power_number : numpy.ndarray
        Energy per weight and distance, T w/(W v) = torque coefficient/(1 - s) [-].
    """

    slope: FloatArray
    slip: FloatArray
    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray
    pull_coefficient: FloatArray
    torque_coefficient: FloatArray
    power_coefficient: FloatArray
    power_number: FloatArray


class SlopeLocomotion:
    """Slope questions to one wheel in one soil.

    Parameters
    ----------
    model : WheelSoilModel
        Without the effect that tilts the load: the balance is made here.
    wheel : Wheel
        Floats.
    weight : float
        W [N].
    load : str
        ``weight`` or ``constant``.
    slip_radius, gravity
        As in ``OperatingPoints``.
    """

    def __init__(
        self,
        model: WheelSoilModel,
        wheel: Wheel,
        weight: float,
        load: str = 'weight',
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
    ) -> None:
        if load not in LOAD_CONVENTIONS:
            raise ValueError(f'load is {load!r}; allowed is one of {LOAD_CONVENTIONS}')
        check_range('weight', weight, 0.0, unit='N', open_lower=True)
        if 'slope_gravity' in model.effects:
            raise ValueError(
                'slope_gravity is on in the model; the balance is made here: leave off'
            )
        self.model = WheelSoilModel(
            model.soil, model.effects, model.method, strict=False, nodes=model.nodes
        )
        self.wheel, self.weight, self.load = wheel, weight, load
        self.slip_radius, self.gravity = slip_radius, gravity

    def carried(self, slope: ArrayLike) -> FloatArray:
        """Load that the soil carries on a slope [N]."""
        slope = np.asarray(slope, float)
        share = np.cos(slope) if self.load == 'weight' else np.ones_like(slope)
        return self.weight * share

    def climb(self, slopes: ArrayLike) -> SlopeState:
        """Steady climb: the pull equals W sin a; the smallest slip that gives it counts.

        Parameters
        ----------
        slopes : array_like
            (N,) positive uphill [rad].
        """
        check_range('slope', slopes, -0.5 * np.pi, 0.5 * np.pi, 'rad')
        slopes = np.atleast_1d(np.asarray(slopes, float))
        need = self.weight * np.sin(slopes)
        grid = np.concatenate([np.linspace(-0.9, 0.9, 73), np.linspace(0.9, LARGEST_SLIP, 9)[1:]])
        pull = np.stack([self._pull(np.full_like(slopes, s), slopes) for s in grid])
        enough = pull >= need
        reachable = enough.any(axis=0)
        first = np.argmax(enough, axis=0)
        high, low = grid[first], grid[np.maximum(first - 1, 0)]
        for _ in range(40):
            middle = 0.5 * (low + high)
            done = self._pull(middle, slopes) >= need
            high, low = np.where(done, middle, high), np.where(done, low, middle)
        return self._state(slopes, np.where(reachable, high, np.nan))

    def self_propelled(self) -> SlopeState:
        """Level ground without a load on the hitch: pull zero."""
        return self.climb([0.0])

    def greatest_slope(self) -> float:
        """Steepest slope that the wheel climbs at any slip up to 0.98 [rad]; nan if none."""
        slips = np.linspace(0.0, LARGEST_SLIP, 50)
        return float(np.nanmax(self.slope_at_slip(slips)))

    def slope_at_slip(self, slip: ArrayLike = 0.2) -> FloatArray:
        """Slope that is climbed at a given slip (20 % is the figure of merit of the paper) [rad].

        Solves F(s, load(a)) = W sin a for the slope a by fixed-point steps (the load moves with
        the cosine only).
        """
        check_range('slip', slip, -1.0, 1.0)
        slip = np.atleast_1d(np.asarray(slip, float))
        slope = np.zeros_like(slip)
        for _ in range(60):
            sine = np.clip(self._pull(slip, slope) / self.weight, -1.0, 1.0)
            slope = 0.5 * (slope + np.arcsin(sine))
        return slope

    def _points(self, slip: FloatArray, slope: FloatArray) -> OperatingPoints:
        return OperatingPoints(
            slip,
            self.carried(slope),
            self.wheel,
            slope=slope,
            slip_radius=self.slip_radius,
            gravity=self.gravity,
        )

    def _pull(self, slip: FloatArray, slope: FloatArray) -> FloatArray:
        state = self.model.steady_state(self._points(slip, slope))
        # Where the wheel sinks in beyond the model, it does not pull.
        return np.where(state.flags & OVERLOADED, -np.inf, state.drawbar_pull)

    def _state(self, slopes: FloatArray, slip: FloatArray) -> SlopeState:
        known = np.isfinite(slip)
        state = self.model.steady_state(self._points(np.where(known, slip, 0.0), slopes))
        columns: dict[str, Any] = {
            name: np.where(known, getattr(state, name), np.nan)
            for name in ('sinkage', 'drawbar_pull', 'torque')
        }
        radius = self.wheel.tip_radius if self.slip_radius == 'lug_tip' else self.wheel.radius
        torque = columns['torque'] / (self.weight * radius)
        speed = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))
        return SlopeState(
            slopes,
            slip,
            columns['sinkage'],
            columns['drawbar_pull'],
            columns['torque'],
            columns['drawbar_pull'] / self.weight,
            torque,
            torque,
            torque / speed,
        )
