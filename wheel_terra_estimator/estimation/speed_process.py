# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How body speed goes on between fixes: with the wheels, and with the accelerometer.

Two predictions of the change of speed over a step, each with its own variance, are combined by
their inverse variances:

* with the wheels: v / rim speed changes only with the terrain, a random walk per rim travel. Exact
  through ramps, stops and restarts of a slow rover; poor where a fast rover's wheels spin up.
* with the accelerometer: dv = (f_x - g_x - bias) dt. Good for fractions of a second; its error per
  second is nothing to 1 m/s and everything to 5 cm/s.

So the accelerometer's role follows from its noise and the speed; no switch is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wheel_terra_estimator.estimation.measurements import InertialReading

_LONGEST_GAP = 0.25  # [s] over which one IMU reading is held


def median(values: Sequence[float]) -> float:
    """Return the median of a short list (faster than numpy's)."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])


@dataclass
class InertialWindow:
    """Sums over the IMU readings since the last filter cycle."""

    count: int = 0
    force_x: float = 0.0  # sum of specific force [m/s^2]
    force_y: float = 0.0
    force_z: float = 0.0
    yaw_rate: float = 0.0
    pitch_rate: float = 0.0
    speed_change: float = 0.0  # integral of f_x - g_x [m/s]
    duration: float = 0.0  # [s] covered by that integral

    def copy(self) -> InertialWindow:
        """Return a copy."""
        return replace(self)


@dataclass
class Attitude:
    """Gravity's x component in the body, from the orientation or else from gyro and specific force.

    Without an orientation the estimate follows the gyro and leans to the specific force with a time
    constant of seconds: right on average, since a rover's mean acceleration is nothing.
    """

    sine_up: float = 0.0  # g_x / g: sine of the body's slope, nose up positive
    known: bool = False
    reported: bool = False

    def copy(self) -> Attitude:
        """Return a copy."""
        return replace(self)

    def update(self, reading: InertialReading, dt: float, gravity: float) -> None:
        """Take one IMU reading that came `dt` seconds after the last one."""
        if reading.orientation is not None:
            x, y, z, w = (float(q) for q in reading.orientation)
            # The third row of the rotation matrix is the vertical in the body.
            self.sine_up = 2.0 * (x * z - w * y)
            self.known = self.reported = True
            return
        self.reported = False
        force = float(reading.specific_force[0]) / gravity
        if not self.known:
            self.sine_up, self.known = max(min(force, 1.0), -1.0), True
            return
        # Nose up is a negative rotation about y.
        turned = self.sine_up - float(reading.angular_rate[1]) * dt
        lean = dt / (5.0 + dt)
        self.sine_up = max(min(turned + lean * (force - turned), 1.0), -1.0)


def take_inertial(
    window: InertialWindow,
    attitude: Attitude,
    reading: InertialReading,
    dt: float,
    gravity: float,
    yaw_bias: float,
    pitch_bias: float,
) -> None:
    """Add an IMU reading to the window; `dt` is the time since the reading before it [s]."""
    attitude.update(reading, dt, gravity)
    force_x = float(reading.specific_force[0])
    window.count += 1
    window.force_x += force_x
    window.force_y += float(reading.specific_force[1])
    window.force_z += float(reading.specific_force[2])
    window.yaw_rate += float(reading.angular_rate[2]) - yaw_bias
    window.pitch_rate += float(reading.angular_rate[1]) - pitch_bias
    if 0.0 < dt <= _LONGEST_GAP:
        window.speed_change += (force_x - gravity * attitude.sine_up) * dt
        window.duration += dt


@dataclass(frozen=True)
class SpeedStep:
    """Linear prediction v' = a v + b bias + c with variance q."""

    speed_gain: float
    bias_gain: float
    constant: float
    variance: float


def speed_step(
    *,
    dt: float,
    rim_before: float | None,
    rim_now: float | None,
    ratio: float,
    ratio_std: float,
    low_rim: float,
    ratio_walk: float,
    unrest: float,
    window: InertialWindow,
    acceleration_noise: float,
    discord: float = 0.0,
) -> SpeedStep:
    """Return the combined prediction of body speed over a step.

    Parameters
    ----------
    dt : float
        Length of the step [s].
    rim_before, rim_now : float or None
        Representative rim speed at its ends [m/s]; None = unknown.
    ratio, ratio_std : float
        Remembered v / rim speed, for rim speeds below `low_rim` [-].
    low_rim : float
        Rim speed below which the present ratio says nothing [m/s].
    ratio_walk : float
        Random walk of v / rim speed [1/sqrt(m of rim travel)].
    unrest : float
        Change of speed that contacts under change may bring within half a second [m/s].
    window : InertialWindow
        Accelerometer over the step.
    acceleration_noise : float
        Its white noise density [m/s^2 sqrt(s)].
    discord : float
        By how much the wheels disagree on the change of rim speed [m/s].
    """
    if rim_before is None or rim_now is None:
        # No wheels: hold the speed, open at the rate at which a rover may brake.
        gain, constant, variance = 1.0, 0.0, (0.05 * dt) ** 2 + (0.02**2) * dt
    else:
        change = rim_now - rim_before
        mean = 0.5 * (abs(rim_before) + abs(rim_now))
        variance = mean * mean * ratio_walk**2 * mean * dt + (0.2 * change) ** 2 + 1e-8 * dt
        variance += 2.0 * unrest * unrest * dt + discord * discord
        if abs(rim_before) > low_rim:
            gain, constant = rim_now / rim_before, 0.0
        else:
            gain, constant = 1.0, ratio * change
            variance += ratio_std**2 * max(rim_now * rim_now - rim_before * rim_before, 0.0)
    covered = window.duration
    if covered < 0.5 * dt or dt <= 0.0:
        return SpeedStep(gain, 0.0, constant, variance)
    # A stretch that the IMU left out is filled with its mean.
    accelerated = window.speed_change * dt / covered
    noise = acceleration_noise**2 * dt
    weight = noise / (noise + variance)  # of the wheels
    return SpeedStep(
        speed_gain=weight * gain + (1.0 - weight),
        bias_gain=-(1.0 - weight) * dt,
        constant=weight * constant + (1.0 - weight) * accelerated,
        variance=variance * noise / (variance + noise),
    )
