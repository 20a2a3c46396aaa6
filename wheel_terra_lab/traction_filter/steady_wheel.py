# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A wheel that drives steadily on the configured soil: torque, pull and sinkage over slip.

The closed form (Ding et al. 2015) is evaluated once, for the mean wheel under its load on level
ground, on a grid of slips and of soil stiffnesses. Load over stiffness is what the bearing law
asks, so another load is read as another stiffness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, least_squares

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelModels, WheelState
from wheel_terra_estimator.estimation.rover import Rover

FloatArray = NDArray[np.float64]

_SKIDDING = (-1.0, -0.6, -0.4, -0.25, -0.15, -0.1, -0.05)
_DRIVING = (0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0)
_SLIPS = np.array((*_SKIDDING, *_DRIVING))
"""Slips at which the closed form is evaluated [-], close together where the curve is steep."""
_STIFFNESS = np.linspace(-2.4, 2.4, 9)
"""Logarithms of the factor on the bearing moduli [-]."""
_STEPS = 400  # of the even grid over slips -1 to 1, read linearly
_EVEN = np.linspace(-1.0, 1.0, _STEPS + 1)
_LARGEST_RATIO = 3.0  # v/(r w) of a wheel that is dragged
_SINKAGE_RANGE = (1e-5, 0.9)  # of the radius, within which the load is carried
_FITTED = _SLIPS >= -0.15  # slips over which a curve of another soil is fitted
_LEAST_SLOPE = 1e-3  # of the torque coefficient over the slip [-]


@dataclass(frozen=True)
class CurveShift:
    """What turns the torque coefficient u0(s) of the soil file into that of another soil.

    u(s) = exp(log_strength) u0((s - offset) / exp(log_scale)): three numbers, as the shear law of
    Janosi and Hanamoto (1961) has: greatest coefficient, slip that mobilises it, and an offset for
    what resists.
    """

    offset: float = 0.0  # [-]
    log_scale: float = 0.0
    log_strength: float = 0.0


class TorqueCurves:
    """Torque over load and radius of each wheel over its slip, (n, m) on an even grid.

    Attributes
    ----------
    at_zero : numpy.ndarray
        (n,) of wheels that roll without slip [-].
    """

    def __init__(self, torque: FloatArray, slope: FloatArray) -> None:
        self._torque, self._slope = torque, slope
        self._wheels = np.arange(len(torque))
        self.at_zero = torque[:, _STEPS // 2]

    def at(self, slip: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return torque coefficient and its slope over the slip, (n,) each; held beyond +-1."""
        column = np.clip((slip + 1.0) * (_STEPS / 2), 0.0, _STEPS - 1e-9)
        j = column.astype(np.intp)
        b, wheels = column - j, self._wheels
        torque = self._torque[wheels, j] * (1.0 - b) + self._torque[wheels, j + 1] * b
        slope = self._slope[wheels, j] * (1.0 - b) + self._slope[wheels, j + 1] * b
        return torque, np.where(np.abs(slip) < 1.0, slope, _LEAST_SLOPE)


class SteadyWheel:
    """Tables of one rover on its configured soil.

    Parameters
    ----------
    configuration : Configuration
        Soil, wheels, effects.
    rover : Rover
        Its constants.

    Attributes
    ----------
    load : float
        Mean load of a wheel on level ground, for which the tables hold [N].
    """

    def __init__(self, configuration: Configuration, rover: Rover) -> None:
        self._models = WheelModels(configuration)
        self._rover = rover
        self.load = rover.mass * rover.gravity / rover.wheel_count
        rows = [self._row(float(k)) for k in _STIFFNESS]
        torque, pull, sinkage = (np.array(columns) for columns in zip(*rows, strict=True))
        curves = [PchipInterpolator(_SLIPS, _increasing(row)) for row in torque]
        self._torque = np.array([curve(_EVEN) for curve in curves])
        self._slope = np.array(
            [np.maximum(curve.derivative()(_EVEN), _LEAST_SLOPE) for curve in curves]
        )
        self._pull = np.array([PchipInterpolator(_SLIPS, row)(_EVEN) for row in pull])
        self._log_sinkage = np.array(
            [PchipInterpolator(_SLIPS, np.log(row))(_EVEN) for row in sinkage]
        )

    def torques(self, stiffness: FloatArray) -> TorqueCurves:
        """Return the torque curves of wheels on soils of some stiffness.

        Parameters
        ----------
        stiffness : numpy.ndarray
            (n,) logarithm of stiffness over load, against soil file and mean load.
        """
        i, _, a, _ = _place(np.zeros(len(stiffness)), stiffness)
        a = a[:, None]
        torque, slope = (t[i] * (1.0 - a) + t[i + 1] * a for t in (self._torque, self._slope))
        return TorqueCurves(torque, slope)

    def reach(self, slip: float, stiffness: float, change: float) -> tuple[float, float]:
        """Return by how much the slip falls and rises as the torque coefficient does by `change`.

        Infinite where the curve ends before: on its plateau the torque tells little.
        """
        i, j, a, b = _place(np.array([slip]), np.array([stiffness]))
        row = self._torque[i[0]] * (1.0 - a[0]) + self._torque[i[0] + 1] * a[0]
        here = row[j[0]] * (1.0 - b[0]) + row[j[0] + 1] * b[0]
        low, high = np.interp(
            [here - change, here + change], row, _EVEN, left=-math.inf, right=math.inf
        )
        at = min(max(slip, -1.0), 1.0)
        return at - float(low), float(high) - at

    def torque_for_pull(self, share: float, stiffness: float) -> float:
        """Return torque / (load x radius) at the slip that gives a pull, a share of the load."""
        i, _, a, _ = _place(np.zeros(1), np.array([stiffness]))
        rows = [
            table[i[0]] * (1.0 - a[0]) + table[i[0] + 1] * a[0]
            for table in (self._torque, self._pull)
        ]
        slip = np.interp(share, np.maximum.accumulate(rows[1]), _EVEN)
        return float(np.interp(slip, _EVEN, rows[0]))

    def pull(self, slip: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Return the drawbar pull over the load (n,) [-]; stiffness as of `torques`."""
        return _read(self._pull, _place(slip, stiffness))

    def sinkage(self, slip: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Return the steady sinkage (n,) [m]; (n,) arrays, stiffness as of `torques`."""
        return np.exp(_read(self._log_sinkage, _place(slip, stiffness)))

    def shift_to(self, *, strength: float = 0.0, shear_modulus: float = 0.0) -> CurveShift:
        """Return the shift of the curve to a soil with other logarithmic factors.

        Parameters
        ----------
        strength, shear_modulus : float
            Logarithms of the factors on c and tan(phi), and on K.
        """
        wanted = np.array(self._row(0.0, strength, shear_modulus)[0])[_FITTED]
        curves = self.torques(np.zeros(np.count_nonzero(_FITTED)))

        def misfit(x: FloatArray) -> FloatArray:
            torque, _ = curves.at((_SLIPS[_FITTED] - x[0]) * math.exp(-x[1]))
            return math.exp(x[2]) * torque - wanted

        found = least_squares(misfit, np.zeros(3), bounds=([-0.5, -3.0, -3.0], [0.5, 3.0, 3.0]))
        return CurveShift(*found.x.tolist())

    def _row(
        self, stiffness: float, strength: float = 0.0, shear_modulus: float = 0.0
    ) -> tuple[list[float], list[float], list[float]]:
        """Return torque coefficient, pull over load and sinkage [m] at each slip of the grid."""
        torques, pulls, sinkages = [], [], []
        radius = self._rover.rim_radius[0]
        for slip in _SLIPS.tolist():
            ratio = 1.0 - slip if slip >= 0.0 else 1.0 / max(1.0 + slip, 1.0 / _LARGEST_RATIO)
            wheel = WheelState(ratio, 0.0, self.load, strength, shear_modulus, stiffness=stiffness)
            sinkage = self._sinkage_of(wheel, radius)
            forces = self._models.forces(0, wheel._replace(sinkage=sinkage))
            torques.append(forces.torque / (self.load * self._rover.slip_radius[0]))
            pulls.append(forces.pull / self.load)
            sinkages.append(sinkage)
        return torques, pulls, sinkages

    def _sinkage_of(self, wheel: WheelState, radius: float) -> float:
        """Return the sinkage at which the bearing law carries the load [m]."""

        def lacking(log_sinkage: float) -> float:
            at = wheel._replace(sinkage=math.exp(log_sinkage))
            return math.log(self._models.bearing(0, at).load / wheel.load)

        low, high = (math.log(share * radius) for share in _SINKAGE_RANGE)
        if lacking(low) >= 0.0:
            return math.exp(low)
        if lacking(high) <= 0.0:
            return math.exp(high)
        return math.exp(float(brentq(lacking, low, high, xtol=1e-3)))


def _increasing(torques: list[float]) -> FloatArray:
    """Return the torques, held where they would fall: a curve that can be read backwards."""
    return np.maximum.accumulate(np.array(torques)) + 1e-6 * np.arange(len(torques))


def _place(slip: FloatArray, stiffness: FloatArray) -> tuple[Any, ...]:
    """Return row, column and the shares of their successors on the even grids."""
    column = np.clip((slip + 1.0) * (_STEPS / 2), 0.0, _STEPS - 1e-9)
    step = _STIFFNESS[1] - _STIFFNESS[0]
    row = np.clip((stiffness - _STIFFNESS[0]) / step, 0.0, len(_STIFFNESS) - 1 - 1e-9)
    i, j = row.astype(np.intp), column.astype(np.intp)
    return i, j, row - i, column - j


def _read(table: FloatArray, place: tuple[Any, ...]) -> FloatArray:
    """Return a table read linearly between its rows and columns."""
    i, j, a, b = place
    low = table[i, j] * (1.0 - b) + table[i, j + 1] * b
    high = table[i + 1, j] * (1.0 - b) + table[i + 1, j + 1] * b
    return np.asarray(low * (1.0 - a) + high * a)
