# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How the body and its wheels slide sideways: on cross slopes, in turns, with steered wheels.

The accelerometer measures the sum of the lateral forces of the soil: mass times specific force
along y, which holds gravity across the slope and the centripetal force. Each wheel resists lateral
motion as its soil is sheared, along and across on one friction circle (Janosi and Hanamoto, with
the displacement at one place of the contact; Ishigami et al. 2007, doi 10.1002/rob.20187). The
lateral speed of the body is the one at which these forces add up to the measured sum. A measured
lateral speed corrects this model; without one the deviation is that of the model, which is large.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, Floats
from wheel_terra_estimator.estimation.component import Component
from wheel_terra_estimator.estimation.contacts.loads import LEAST_LOAD
from wheel_terra_estimator.estimation.contacts.wheel_models import LEAST_SINKAGE
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.scalars import TINY

_LEAST_STD = 1e-3  # of a lateral force [N]
_STEP = 0.02  # step for the stiffness, over the greatest speed [-]
_PLACES = np.array([0.1 * u + 0.9 * u**3 for u in np.linspace(-1.0, 1.0, 49)])
"""Lateral speeds at which forces are computed, over the greatest [-]: closest where forces change
most. Linear interpolation between them errs by 0.003 of the speed."""
UNKNOWN_ANGLE_STD = math.pi / math.sqrt(3.0)
"""Deviation of an unknown slip angle, uniform over the whole turn [rad]."""


# Errors of the model; the law was chosen on cross slopes of simulator A.
_CONTACT_SHARE = 0.6
"""Place in the contact, as a share of the entrance angle behind the entry, whose shear
displacement stands for all of it."""
_SOIL_SHARE = 0.4  # error of the lateral speed by shear modulus and contact length, relative
_STRENGTH_SHARE = 0.25  # error of the lateral force by strength and flank, relative
_FORCE_SHARE = 0.3  # error of the lateral force of one wheel in their sum, relative
_LOAD_SHARE = 0.03  # forces of ruts, stones and toe angle, over the weight [-]
_SPEED_SHARE = 0.02  # unmodelled lateral speed, over the speed [-]
_MEMORY = 5.0  # travel over which a correction by a reference decays [m]
_SMOOTHING = 0.5  # time constant of the lateral specific force, against vibration [s]
_BLIND_FORCE = 2.0  # deviation of the lateral specific force without an accelerometer [m/s^2]


class SidewaysInputs(NamedTuple):
    """State of the rover at a stamp; tuples have one entry per wheel."""

    speed: float  # of the body along x [m/s]
    speed_std: float
    yaw_rate: float  # [rad/s]
    yaw_rate_std: float
    rims: Floats  # [m/s], nan = unknown
    steering: Floats  # positive left [rad]
    loads: Floats  # [N]
    pulls: Floats  # along the wheels [N]
    sinkage: Floats  # [m]
    lateral_force: float  # mean specific force along y of the body [m/s^2], nan = unknown
    lateral_force_std: float
    cohesion: float  # [Pa]
    tan_friction: float
    shear_modulus: float  # [m]


@dataclass(frozen=True)
class Sideways:
    """Slip angles, lateral forces and lateral speed; tuples have one entry per wheel."""

    angle: Floats  # [rad]
    angle_std: Floats
    force: Floats  # of the soil on the wheel, positive left [N]
    force_std: Floats
    velocity: float  # of the body along y [m/s]
    velocity_variance: float

    @classmethod
    def unknown(cls, loads: Sequence[float] | FloatArray) -> Sideways:
        """Return the estimate for wheels under these loads [N] of which nothing is known."""
        zero = (0.0,) * len(loads)
        angle_std = (UNKNOWN_ANGLE_STD,) * len(loads)
        return cls(zero, angle_std, zero, _floats(np.maximum(loads, 1.0)), 0.0, 1.0)

    @property
    def finite(self) -> bool:
        """Whether every number is finite."""
        wheels = self.angle, self.angle_std, self.force, self.force_std
        return all(map(math.isfinite, (*map(sum, wheels), self.velocity, self.velocity_variance)))

    def with_unknown_std(self, loads: Sequence[float] | FloatArray) -> Sideways:
        """Return the same values with the deviations of an unknown motion."""
        return replace(
            Sideways.unknown(loads), angle=self.angle, force=self.force, velocity=self.velocity
        )


class SidewaysState(NamedTuple):
    """Memory: correction of the model by references, and the last estimate."""

    time: float = math.nan  # [s]
    error: float = 0.0  # of the model's lateral speed over the rover's speed [-]
    variance_share: float = 1.0  # variance after the correction over that of the model [-]
    fastest: float = 0.0  # fastest of rims and hubs [m/s]
    lateral_force: float = math.nan  # smoothed specific force along y [m/s^2]
    model_variance: float = 0.0  # of the model's lateral speed alone [(m/s)^2]; 0 at rest
    latest: Sideways | None = None


class SidewaysMotion(Component[SidewaysState]):
    """Estimates the lateral motion of the rover."""

    def __init__(self, rover: Rover) -> None:
        super().__init__(SidewaysState())
        self._rover = rover

    def update(self, time: float, given: SidewaysInputs) -> Sideways:
        """Return slip angles, lateral forces and lateral speed at a time [s]."""
        state = self.state
        fastest = _fastest(self._rover, given)
        since = 0.0 if isnan(state.time) else max(time - state.time, 0.0)
        travel = fastest * since
        lateral_force, before = given.lateral_force, state.lateral_force
        if not (isnan(before) or isnan(lateral_force)):
            lateral_force = before + (lateral_force - before) * since / (_SMOOTHING + since)
        given = given._replace(lateral_force=lateral_force)
        fading = math.exp(-travel / _MEMORY)
        error = state.error * fading
        share = 1.0 + (state.variance_share - 1.0) * fading * fading
        if fastest < self._rover.rest_speed or sum(given.loads) <= LEAST_LOAD:
            latest = self._at_rest(given)
            self.state = SidewaysState(time, error, share, fastest, lateral_force, 0.0, latest)
            return latest
        contacts = _contacts(self._rover, given)
        model, model_variance = model_speed(self._rover, given, contacts)
        latest = self._estimated(given, contacts, model + error * fastest, share * model_variance)
        self.state = SidewaysState(
            time, error, share, fastest, lateral_force, model_variance, latest
        )
        return latest

    def correct(self, lateral: float, variance: float) -> None:
        """Take the lateral speed of the body from a slip-free reference [m/s], [(m/s)^2]."""
        state = self.state
        if state.latest is None or not state.model_variance:
            return
        prior = state.variance_share * state.model_variance
        gain = prior / (prior + variance)
        error = state.error + gain * (lateral - state.latest.velocity) / state.fastest
        self.state = state._replace(error=error, variance_share=(1.0 - gain) * state.variance_share)

    def _at_rest(self, given: SidewaysInputs) -> Sideways:
        """Return the estimate for wheels that stand: angles held, forces in proportion to load."""
        loads = np.array(given.loads)
        last = self.state.latest or Sideways.unknown(given.loads)
        total, std = _measured_force(self._rover, given)
        share = loads / max(float(loads.sum()), TINY)
        force_std = np.hypot(np.abs(total * share), std * share) + _LOAD_SHARE * loads
        return Sideways(
            last.angle,
            (UNKNOWN_ANGLE_STD,) * len(loads),
            _floats(total * share),
            _floats(np.maximum(force_std, _LEAST_STD)),
            0.0,
            (0.5 * self._rover.rest_speed) ** 2,
        )

    def _estimated(
        self, given: SidewaysInputs, contacts: _Contacts, velocity: float, variance: float
    ) -> Sideways:
        rover = self._rover
        x, y = np.array(rover.longitudinal), np.array(rover.lateral)
        sine, cosine, forward, turning = contacts[:4]
        sideward = velocity + turning
        along, across = forward * cosine + sideward * sine, sideward * cosine - forward * sine
        angle, none = np.arctan2(across, along), np.zeros(len(x))
        # Errors of speed, lateral speed and yaw rate: what they add forward and aside at the hubs.
        ahead = np.array([none + given.speed_std, none, -given.yaw_rate_std * y])
        aside = np.array([none, none + math.sqrt(variance), given.yaw_rate_std * x])
        angle_std = _angle_std(forward, sideward, ahead, aside)
        forces = _wheel_forces(contacts, velocity, rover.rest_speed, given.shear_modulus)
        _, std = _measured_force(rover, given)
        # The sum is measured; of what turning would change, the wheels have opposite parts.
        turned = velocity + given.yaw_rate_std * np.outer((1.0, -1.0), x)
        changes = _wheel_forces(contacts, turned, rover.rest_speed, given.shear_modulus) - forces
        by_turning = 0.5 * np.square(changes).sum(axis=0)
        loads = np.array(given.loads)
        shared = std * loads / max(float(loads.sum()), TINY)
        force_std = np.sqrt((_FORCE_SHARE * forces) ** 2 + shared**2 + by_turning)
        return Sideways(
            _floats(angle),
            _floats(np.minimum(angle_std, UNKNOWN_ANGLE_STD)),
            _floats(forces),
            _floats(np.maximum(force_std, _LEAST_STD)),
            float(velocity),
            max(variance, TINY),
        )


def _angle_std(
    forward: FloatArray, sideward: FloatArray, ahead: FloatArray, aside: FloatArray
) -> FloatArray:
    """Return the deviation of the direction of two speeds (n,) by errors of both (errors, n).

    One deviation to either side of each: derivatives at the mean would be too small where it is as
    large as the speed.
    """
    there = np.arctan2(
        sideward + np.concatenate([aside, -aside]), forward + np.concatenate([ahead, -ahead])
    )
    differences = (there - np.arctan2(sideward, forward) + np.pi) % (2.0 * np.pi) - np.pi
    return np.sqrt(0.5 * np.square(differences).sum(axis=0))


def _floats(values: FloatArray) -> Floats:
    return tuple(values.tolist())


class _Contacts(NamedTuple):
    """Wheels, their motion without the lateral speed of the body, and their soil, (n,) each."""

    sine: FloatArray  # of the steering angle
    cosine: FloatArray
    forward: FloatArray  # speed of the hub along x of the body [m/s]
    turning: FloatArray  # its speed along y by the yaw rate [m/s]
    rim: FloatArray  # [m/s], nan = unknown
    radius: FloatArray  # [m]
    swept: FloatArray  # angle by which the rim has turned since it met the soil [rad]
    covered: FloatArray  # distance that the hub has covered meanwhile, over the radius [-]
    strength: FloatArray  # greatest shear force [N]


def _contacts(rover: Rover, given: SidewaysInputs) -> _Contacts:
    radius = np.array(rover.rim_radius)
    entry = np.arccos(1.0 - np.minimum(np.maximum(given.sinkage, LEAST_SINKAGE) / radius, 1.0))
    swept = _CONTACT_SHARE * entry
    strength = given.tan_friction * np.array(given.loads)
    return _Contacts(
        np.sin(given.steering),
        np.cos(given.steering),
        given.speed - given.yaw_rate * np.array(rover.lateral),
        given.yaw_rate * np.array(rover.longitudinal),
        np.array(given.rims),
        radius,
        swept,
        np.sin(entry) - np.sin(entry - swept),
        strength + given.cohesion * np.array(rover.width) * radius * entry,
    )


def _wheel_forces(
    contacts: _Contacts, lateral: FloatArray | float, rest_speed: float, shear_modulus: float
) -> FloatArray:
    """Return the lateral force of each wheel, positive left [N], at lateral speeds [m/s].

    `lateral` broadcasts against (n,).
    """
    sine, cosine, forward, turning, rim, radius, swept, covered, strength = contacts
    sideward = lateral + turning
    along, across = forward * cosine + sideward * sine, sideward * cosine - forward * sine
    turned = np.where(np.isnan(rim), along, rim)
    fastest = np.maximum(np.maximum(np.abs(turned), np.hypot(along, across)), rest_speed)
    scale = radius / fastest
    back, side = scale * (turned * swept - along * covered), scale * across * swept
    displacement = np.maximum(np.hypot(back, side), TINY)
    share = -np.expm1(-displacement / shear_modulus)
    return np.asarray(-strength * share * side / displacement)


def model_speed(rover: Rover, given: SidewaysInputs, contacts: _Contacts) -> tuple[float, float]:
    """Return the lateral speed of the body by forces alone [m/s], and its variance."""
    fastest = _fastest(rover, given)
    total, total_std = _measured_force(rover, given)
    reach = 2.0 * fastest + abs(given.yaw_rate) * max(abs(x) for x in rover.longitudinal)
    speeds = reach * _PLACES
    forces = _wheel_forces(contacts, speeds[:, None], rover.rest_speed, given.shear_modulus)
    against = -(forces @ contacts.cosine)  # grows with the speed
    free = float(np.interp(0.0, against, speeds))
    if not against[0] < -total < against[-1]:
        # More than this soil can give: the rover slides, at any speed up to the bound.
        lateral = 0.5 * math.copysign(reach, -total)
        return lateral, lateral**2
    lateral = float(np.interp(-total, against, speeds))
    step = _STEP * fastest
    ends = np.interp((lateral - step, lateral + step), speeds, against)
    stiffness = float(ends[1] - ends[0]) / (2.0 * step)
    # The stiffness falls towards the limit of the strength, where a force hardly shows a speed.
    error = math.hypot(total_std, _STRENGTH_SHARE * total)
    std = min(error / max(stiffness, TINY), reach)
    variance = std**2 + (_SOIL_SHARE * (lateral - free)) ** 2
    return lateral, variance + (_SPEED_SHARE * fastest) ** 2


def _fastest(rover: Rover, given: SidewaysInputs) -> float:
    turning = abs(given.yaw_rate) * max(abs(y) for y in rover.lateral)
    rims = [abs(rim) for rim in given.rims if not isnan(rim)]
    return max(abs(given.speed) + turning, *rims) if rims else abs(given.speed) + turning


def _measured_force(rover: Rover, given: SidewaysInputs) -> tuple[float, float]:
    """Return the sum of the lateral forces along y by the accelerometer, and its deviation [N]."""
    weight = sum(given.loads)
    pulled = sum(f * math.sin(d) for f, d in zip(given.pulls, given.steering, strict=True))
    if isnan(given.lateral_force):
        return -pulled, rover.mass * _BLIND_FORCE
    total = rover.mass * given.lateral_force - pulled
    return total, math.hypot(rover.mass * given.lateral_force_std, _LOAD_SHARE * weight)
