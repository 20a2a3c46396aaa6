# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the estimator needs of the configuration, as plain floats (fast in scalar code)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.load_distribution import (
    LoadDistribution,
    load_distribution,
)

_LEAST_LOW_RIM = 0.005
"""Rim speed [m/s] below which v / rim speed is lost in the noise of encoders."""
_LOW_RIM_OVER_REST = 3.0
_SKID_LENGTH = 0.3
"""Wheelbase over track above which a rover without steering must skid to turn [-]."""
_SAME_AXLE = 1e-3  # [m]
_CONTACT_SHARE = 0.5
"""Contact length over the rim radius: an entrance angle of 30 degrees, as of rovers in sand."""


@dataclass(frozen=True)
class Rover:
    """Constants of one rover; tuples have one entry per wheel."""

    wheel_count: int
    slip_radius: tuple[float, ...]  # [m]
    rim_radius: tuple[float, ...]
    shear_radius: tuple[float, ...]  # to the lug tips
    lateral: tuple[float, ...]  # y in base_link [m]
    longitudinal: tuple[float, ...]  # x [m]
    centre_of_gravity: tuple[float, ...]  # x, y, z [m]
    torque_limit: tuple[float, ...]  # [N m], 0 = not stated
    mass: float
    gravity: float
    load: LoadDistribution
    load_std: float  # relative
    indeterminate_load_std: float
    """Statically indeterminate part of the loads, relative. Not in the filter, where the error of
    each wheel's shear model absorbs it."""
    rut_tilt: tuple[float, ...]
    """Body pitch up per metre of sinkage of each wheel [rad/m]."""
    rest_speed: float  # [m/s]
    rest_time: float  # [s]
    silence: float  # [s]
    period: float
    """Least time between two cycles of the filter [s]."""
    low_rim: float
    """Rim speed below which v / rim speed is lost in noise [m/s]."""
    contact_length: float
    """Travel after which a contact is entirely new, and its shear that of the steady model [m]."""
    skids: bool
    """Whether it has to skid to turn: wheels in several rows, none of which steers."""
    width: tuple[float, ...]  # [m]
    leader: tuple[int | None, ...]
    """Next wheel ahead of each in the same rut, None = none."""
    leader_in_reverse: tuple[int | None, ...]
    curvature_length: float
    """Half the distance between the first and the last axle [m]."""

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> Rover:
        """Collect and derive the constants."""
        wheels, rover, tuning = configuration.wheels, configuration.rover, configuration.filter
        x = np.asarray(wheels.x, dtype=float)
        spread = x - x.mean()
        tilt = -spread / max(float(spread @ spread), 1e-9) if np.ptp(x) > 1e-6 else 0.0 * x
        rest_speed = configuration.rest_speed
        shares = np.asarray(rover.load_shares, dtype=float)
        return cls(
            wheel_count=wheels.count,
            slip_radius=_floats(wheels.slip_radius),
            rim_radius=_floats(wheels.radius),
            shear_radius=_floats(wheels.radius + wheels.lug_height),
            lateral=_floats(wheels.y),
            longitudinal=_floats(x),
            centre_of_gravity=_floats(rover.centre_of_gravity),
            torque_limit=_floats(wheels.torque_limit),
            mass=float(rover.mass),
            gravity=float(rover.gravity),
            load=load_distribution(
                mass=float(rover.mass),
                position=np.column_stack([wheels.x, wheels.y]).astype(float),
                centre_of_gravity=_floats(rover.centre_of_gravity),
                contact_height=float(np.mean(np.asarray(wheels.z) - np.asarray(wheels.radius))),
                suspension=rover.suspension,
                shares=shares if shares.any() else np.ones(wheels.count),
                rocker_pivot=rover.rocker_pivot,
                bogie_pivot=rover.bogie_pivot,
                bogie_wheels=rover.bogie_wheels,
            ),
            load_std=_load_std(configuration),
            indeterminate_load_std=_indeterminate_load_std(configuration),
            rut_tilt=_floats(tilt),
            rest_speed=rest_speed,
            rest_time=float(tuning.rest_time),
            silence=float(tuning.silence),
            period=float(tuning.period),
            low_rim=max(_LOW_RIM_OVER_REST * rest_speed, _LEAST_LOW_RIM),
            contact_length=_CONTACT_SHARE * min(_floats(wheels.radius)),
            skids=not any(wheels.steered) and np.ptp(x) > _SKID_LENGTH * np.ptp(wheels.y),
            width=_floats(wheels.width),
            leader=_leaders(x, wheels.y, wheels.width),
            leader_in_reverse=_leaders(-x, wheels.y, wheels.width),
            curvature_length=0.5 * (max(_floats(x)) - min(_floats(x))),
        )


_UNSTATED_LOAD_STD = 0.2
"""Deviation of a wheel's load over the mean load where the suspension of more than four wheels is
not stated (the axles of a rocker-bogie may carry 1.28, 0.83 and 0.91 of the loads of a rigid
chassis), and under a rigid chassis on natural ground (rms 0.09 in simulator B, 0.2 in C)."""
_FEW_WHEELS = 4  # number up to which the suspension hardly matters


def _load_std(configuration: Configuration) -> float:
    """Return the deviation of the load of a wheel, over the mean load."""
    given = not {'rover.load_std', 'rover.suspension'}.isdisjoint(configuration.stated)
    if given or configuration.wheels.count <= _FEW_WHEELS:
        return float(configuration.rover.load_std)
    return _UNSTATED_LOAD_STD


_SUPPORTED = 3  # wheels whose loads follow from the balances


def _indeterminate_load_std(configuration: Configuration) -> float:
    """Return the deviation of the statically indeterminate part of a load, over the mean load."""
    indeterminate = (
        configuration.rover.suspension == 'rigid' and configuration.wheels.count > _SUPPORTED
    )
    stated = 'rover.load_std' in configuration.stated
    return _UNSTATED_LOAD_STD if indeterminate and not stated else 0.0


_UNSTATED_TORQUE = {'torque_std': 0.015, 'torque_zero_std': 0.02}
"""Deviations of a torque measured by the motor's current, over mean load times radius [-], where
they are not stated: no default in N m fits rovers of 2 kg and of 900 kg."""


@dataclass(frozen=True)
class SensorFigures:
    """Standard deviations and rates of the sensors, as in the keys ``sensors.*``."""

    wheel_odometry_rate: float  # [Hz]
    wheel_rate_std: float  # [rad/s]
    torque_std: float  # [N m]
    torque_zero_std: float
    torque_gain_std: float  # [-]
    imu_rate: float  # [Hz]
    specific_force_std: float  # [m/s^2], per message
    specific_force_bias_std: float
    angular_rate_std: float  # [rad/s], per message
    angular_rate_bias_std: float
    orientation_std: float  # [rad]
    sinkage_rate: float  # [Hz]
    sinkage_std: float  # [m]
    sinkage_zero_std: float
    leaving_angle_std: float  # [rad]
    reference_std: float  # [m/s]
    reference_std_floor: float
    reference_wander_std: float  # of the error that lasts from reading to reading [m/s]
    reference_wander_time: float  # [s]

    @classmethod
    def from_configuration(cls, configuration: Configuration) -> SensorFigures:
        """Take the figures of a configuration; torque noise not stated scales with the rover."""
        sensors = configuration.sensors
        figures = {name: float(getattr(sensors, name)) for name in cls.__annotations__}
        wheels, rover = configuration.wheels, configuration.rover
        load = float(rover.mass) * float(rover.gravity) / wheels.count
        moment = load * float(np.mean(wheels.slip_radius))
        for name, share in _UNSTATED_TORQUE.items():
            if f'sensors.{name}' not in configuration.stated:
                figures[name] = share * moment
        return cls(**figures)


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _leaders(x: np.ndarray, y: np.ndarray, width: np.ndarray) -> tuple[int | None, ...]:
    """Return for each wheel the next one ahead whose rut it meets, driving towards +x."""
    found: list[int | None] = []
    for i, half in enumerate(0.5 * width):
        before = np.flatnonzero((x > x[i] + _SAME_AXLE) & (np.abs(y - y[i]) < half))
        found.append(int(before[np.argmin(x[before])]) if len(before) else None)
    return tuple(found)
