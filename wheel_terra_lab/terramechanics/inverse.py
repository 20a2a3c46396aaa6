# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From measurements back to stresses and equivalent soil parameters, closed form.

The decoupled form needs no soil parameter; with its stresses, shear strength and bearing follow
from straight lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.closed_form import coefficients
from wheel_terra_estimator.terramechanics.kinematics import shear_displacement

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PeakStresses:
    """Peak stresses of linearised (triangular) stress, one entry per measurement.

    Attributes
    ----------
    normal, shear : numpy.ndarray
        (N,) sigma_m, tau_m [Pa].
    by_torque, by_load : tuple of numpy.ndarray
        Derivatives of (normal, shear) by torque [Pa/(N m)] and by load [Pa/N].
    valid : numpy.ndarray
        (N,) False where a stress came out negative: the angles do not fit the measurement.
    """

    normal: FloatArray
    shear: FloatArray
    by_torque: tuple[FloatArray, FloatArray]
    by_load: tuple[FloatArray, FloatArray]
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class EquivalentSoil:
    """Soil parameters that reproduce the peak stresses.

    Attributes
    ----------
    cohesion, tan_friction, shear_modulus : float
        c [Pa], tan(phi) [-], K [m].
    bearing_modulus, sinkage_exponent : float
        k = kc/b + kphi [Pa/m^N] and N [-]; nan where the depths hardly differ.
    shear_residual : float
        Root mean square of the shear fit [Pa].
    separable : bool
        False where the normal stress hardly varies: then cohesion was kept at zero and only
        tau/sigma is known.
    """

    cohesion: float
    tan_friction: float
    shear_modulus: float
    bearing_modulus: float
    sinkage_exponent: float
    shear_residual: float
    separable: bool


def entrance_angle(sinkage: Any, radius: Any, lug_sinkage: Any = 0.0) -> FloatArray:
    """Entrance angle arccos(1 - (z - dz)/r), dz the part that lugs dig or carry [rad].

    Raises
    ------
    ValueError
        If the sinkage is negative or above the radius (nan stays nan: not measured). What is left
        below zero after the lugs' part counts as a touch.
    """
    check_range('radius', radius, 0.0, unit='m', open_lower=True)
    check_range('sinkage', sinkage, 0.0, float(np.min(radius)), 'm', allow_nan=True)
    depth = np.asarray(sinkage, float) - lug_sinkage
    check_range('sinkage less lugs', depth, upper=float(np.min(radius)), unit='m', allow_nan=True)
    return np.arccos(1.0 - np.maximum(depth, 1e-6 * np.asarray(radius)) / radius)


def peak_stresses(
    torque: ArrayLike,
    normal_load: ArrayLike,
    angles: tuple[Any, Any, Any],
    radius: Any,
    shear_radius: Any,
    width: Any,
) -> PeakStresses:
    """Solve torque and load for the two peak stresses.

    tau_m = T/(b R^2 C), sigma_m = (W - b R B tau_m)/(b r A).

    Parameters
    ----------
    torque, normal_load : array_like
        (N,) [N m], [N].
    angles : tuple
        Entrance, peak, leaving angle, (N,) each [rad].
    radius, shear_radius, width : float or array_like
        [m].
    """
    check_range('torque', torque, unit='N m', allow_nan=True)
    check_range('normal load', normal_load, 0.0, unit='N', open_lower=True, allow_nan=True)
    for name, length in (('radius', radius), ('shear radius', shear_radius), ('width', width)):
        check_range(name, length, 0.0, unit='m', open_lower=True)
    entrance, peak, leaving = (np.asarray(angle, float) for angle in angles)
    check_range('entrance minus peak angle', entrance - peak, 0.0, unit='rad', open_lower=True)
    check_range('peak minus leaving angle', peak - leaving, 0.0, unit='rad', open_lower=True)
    torque, load = np.asarray(torque, float), np.asarray(normal_load, float)
    a, b, c = coefficients(*angles)
    shear_by_torque = 1.0 / (width * shear_radius**2 * c)
    normal_by_load = 1.0 / (width * radius * a)
    normal_by_torque = -shear_radius * b * shear_by_torque / (radius * a)
    shear = shear_by_torque * torque
    normal = normal_by_load * load + normal_by_torque * torque
    zero = np.zeros_like(shear)
    return PeakStresses(
        normal,
        shear,
        (normal_by_torque + zero, shear_by_torque + zero),
        (normal_by_load + zero, zero),
        normal > 0.0,
    )


def centroid_angle(
    torque: ArrayLike,
    normal_load: ArrayLike,
    drawbar_pull: ArrayLike,
    shear_radius: Any,
    spread: Any = 1.0,
) -> FloatArray:
    """Angle of the stress centroid from measured load, pull and torque, without any soil [rad].

    F cos psi + W sin psi = rho T/R; `spread` is rho = sqrt(A^2 + B^2)/C, slightly below 1. Then
    peak plus leaving angle is 3 psi - t1: the cleanest probe for missing physics.
    """
    check_range('normal load', normal_load, 0.0, unit='N', open_lower=True, allow_nan=True)
    check_range('shear radius', shear_radius, 0.0, unit='m', open_lower=True)
    load, pull = np.asarray(normal_load, float), np.asarray(drawbar_pull, float)
    share = spread * np.asarray(torque, float) / shear_radius / np.hypot(load, pull)
    return np.arcsin(np.clip(share, -1.0, 1.0)) - np.arctan2(pull, load)


def equivalent_soil(
    stresses: PeakStresses,
    angles: tuple[Any, Any, Any],
    velocity_ratio: Any,
    radius: Any,
    shear_radius: Any,
    shear_moduli: ArrayLike | None = None,
) -> EquivalentSoil:
    """Fit c, tan(phi), K and k, N to peak stresses of several operating points.

    For each K of a scan, tau_m/E = c + sigma_m tan(phi) is a straight line; the K of the smallest
    misfit counts. ln sigma_m = ln k + N ln[r (cos tm - cos t1)] is another line.

    Parameters
    ----------
    stresses, angles
        As from ``peak_stresses``; at least two valid points.
    velocity_ratio : array_like
        (N,) v/w [m].
    shear_moduli : array_like, optional
        K to try [m]; default 1 to 60 mm.
    """
    good = stresses.valid
    if good.sum() < 2:
        raise ValueError(f'valid operating points are {int(good.sum())}; allowed is 2 or more')
    t1, tm, _ = (np.broadcast_to(np.asarray(x, float), good.shape)[good] for x in angles)
    ratio = np.broadcast_to(np.asarray(velocity_ratio, float), good.shape)[good]
    R = np.broadcast_to(np.asarray(shear_radius, float), good.shape)[good]
    r = np.broadcast_to(np.asarray(radius, float), good.shape)[good]
    sigma, tau = stresses.normal[good], stresses.shear[good]
    moduli = np.geomspace(1e-3, 0.06, 200) if shear_moduli is None else np.asarray(shear_moduli)
    if moduli.size == 0:
        raise ValueError('shear moduli are none; allowed is 1 or more')
    check_range('shear moduli', moduli, 0.0, unit='m', open_lower=True)
    j = shear_displacement(tm, t1, R, ratio)
    share = np.sign(j)[:, None] * -np.expm1(-np.abs(j)[:, None] / moduli)  # (N, K)
    separable = bool(np.ptp(sigma) > 0.2 * np.mean(sigma) and sigma.size > 2)
    best: tuple[float, float, float, float] | None = None
    for k, modulus in enumerate(moduli):
        columns = [share[:, k] * sigma] + ([share[:, k]] if separable else [])
        matrix = np.stack(columns, axis=1)
        solution = np.linalg.lstsq(matrix, tau, rcond=None)[0]
        if separable and solution[1] < 0.0:
            solution = np.array([float(matrix[:, 0] @ tau / (matrix[:, 0] @ matrix[:, 0])), 0.0])
        misfit = float(np.sqrt(np.mean((matrix @ solution[: matrix.shape[1]] - tau) ** 2)))
        cohesion = float(solution[1]) if separable else 0.0
        if best is None or misfit < best[0]:
            best = (misfit, float(modulus), float(solution[0]), cohesion)
    assert best is not None
    depth = r * (np.cos(tm) - np.cos(t1))
    bearing, exponent = np.nan, np.nan
    if np.ptp(np.log(depth)) > 0.2:
        exponent, level = np.polyfit(np.log(depth), np.log(sigma), 1)
        bearing = float(np.exp(level))
    return EquivalentSoil(
        best[3], best[2], best[1], float(bearing), float(exponent), best[0], separable
    )
