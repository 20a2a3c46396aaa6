# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A wheel or a rover that climbs by itself: slip from the balance of forces along the slope.

Coefficients as in Nakashima et al. 2010 (torque, pull, power number).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.model import OVERLOADED, SteadyState, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import (
    STANDARD_GRAVITY,
    OperatingPoints,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel

FloatArray = NDArray[np.float64]
# ``weight``: the weight W is given, the soil carries W cos a. ``constant``: the soil carries W on
# every slope, as the rig of Nakashima et al. 2010 does, which turns the load with the bed (their
# nomenclature has W cos a for the same quantity; their tables fit W).
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
        slip = _smallest_slip(lambda s: self._pull(s, slopes), need)
        return self._state(slopes, slip)

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


@dataclass(frozen=True)
class RoverSlopeState:
    """A rover that climbs steadily, one row per slope, one column per wheel.

    Attributes
    ----------
    slope, slip : numpy.ndarray
        (N,) [rad], [-]; the slip is nan where the soil cannot give the pull.
    normal_load, sinkage, drawbar_pull, torque : numpy.ndarray
        (N, n) [N], [m], [N], [N m].
    power_number : numpy.ndarray
        (N,) energy per weight and distance, sum of T w over W v [-].
    """

    slope: FloatArray
    slip: FloatArray
    normal_load: FloatArray
    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray
    power_number: FloatArray


def rover_climb(
    model: WheelSoilModel,
    wheels: Wheel,
    normal_loads: ArrayLike,
    slopes: ArrayLike,
    pass_numbers: ArrayLike = 1.0,
    slip_radius: str = 'lug_tip',
    gravity: float = STANDARD_GRAVITY,
) -> RoverSlopeState:
    """Free travel of a rover straight up a slope: the wheels together pull W sin a.

    All rims run at one speed and the wheels share the rover's ground speed, so they share the slip
    ratio; what each gives follows from its own load and from how often its track was run over.

    Parameters
    ----------
    model : WheelSoilModel
        Without the effect that tilts the load: the balance is made here.
    wheels : Wheel
        (n,) arrays, or floats for n equal wheels.
    normal_loads : array_like
        (N, n) load on each wheel on each slope, terrain normal, load transfer included [N]; or (n,)
        loads on level ground, which then fall with the cosine of the slope.
    slopes : array_like
        (N,) positive uphill [rad].
    pass_numbers : array_like
        (n,) 1 for a wheel on virgin soil, 2 for the next one in its track, and so on.

    Raises
    ------
    ValueError
        If ``slope_gravity`` is on, or shapes do not fit.
    """
    if 'slope_gravity' in model.effects:
        raise ValueError('slope_gravity is on in the model; the balance is made here: leave off')
    check_range('slope', slopes, -0.5 * np.pi, 0.5 * np.pi, 'rad')
    slopes = np.atleast_1d(np.asarray(slopes, float))
    loads = np.asarray(normal_loads, float)
    if loads.ndim < 2:
        loads = np.atleast_1d(loads) * np.cos(slopes)[:, None]
    if loads.shape[0] != slopes.size:
        raise ValueError(f'normal loads have {loads.shape[0]} rows, there are {slopes.size} slopes')
    # The soil carries W cos a in all, whichever way the wheels share it.
    weight = loads.sum(axis=1) / np.cos(slopes)
    free = WheelSoilModel(model.soil, model.effects, model.method, strict=False, nodes=model.nodes)
    count = loads.shape[1]

    def per_wheel(value: Any) -> FloatArray:
        return np.broadcast_to(np.asarray(value, float), loads.shape).ravel()

    each = Wheel(
        *(
            per_wheel(getattr(wheels, name))
            for name in ('radius', 'width', 'lug_height', 'lug_count', 'lug_thickness')
        )
    )

    def solve(slip: FloatArray) -> SteadyState:
        return free.steady_state(
            OperatingPoints(
                np.repeat(slip, count),
                loads.ravel(),
                each,
                slope=np.repeat(slopes, count),
                slip_radius=slip_radius,
                gravity=gravity,
                pass_number=per_wheel(pass_numbers),
            )
        )

    def pull(slip: FloatArray) -> FloatArray:
        state = solve(slip)
        given = np.where(state.flags & OVERLOADED, -np.inf, state.drawbar_pull)
        return given.reshape(loads.shape).sum(axis=1)

    slip = _smallest_slip(pull, weight * np.sin(slopes))
    known = np.isfinite(slip)
    state = solve(np.where(known, slip, 0.0))
    sinkage, drawbar_pull, torque = (
        np.where(known[:, None], column.reshape(loads.shape), np.nan)
        for column in (state.sinkage, state.drawbar_pull, state.torque)
    )
    radius = (each.tip_radius if slip_radius == 'lug_tip' else each.radius).reshape(loads.shape)
    ratio = np.where(slip >= 0.0, 1.0 - slip, 1.0 / (1.0 + slip))  # v/(r w)
    power = (torque / radius).sum(axis=1) / (weight * ratio)
    return RoverSlopeState(slopes, slip, loads, sinkage, drawbar_pull, torque, power)


def _smallest_slip(pull: Callable[[FloatArray], FloatArray], need: FloatArray) -> FloatArray:
    """Smallest slip at which a pull is reached, for each of N points; nan where none is enough."""
    grid = np.concatenate([np.linspace(-0.9, 0.9, 73), np.linspace(0.9, LARGEST_SLIP, 9)[1:]])
    enough = np.stack([pull(np.full_like(need, s)) for s in grid]) >= need
    first = np.argmax(enough, axis=0)
    high, low = grid[first], grid[np.maximum(first - 1, 0)]
    for _ in range(40):
        middle = 0.5 * (low + high)
        done = pull(middle) >= need
        high, low = np.where(done, middle, high), np.where(done, low, middle)
    return np.where(enough.any(axis=0), high, np.nan)
