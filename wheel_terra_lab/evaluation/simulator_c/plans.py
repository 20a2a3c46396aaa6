# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What is driven: kinds of drives, and the operator who follows their phases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_lab.evaluation.simulator_c.dynamics import STEP, Command, State
from wheel_terra_lab.evaluation.simulator_c.rover import Rover

FloatArray = NDArray[np.float64]

_RAMP_TIME = 1.0  # to the usual speed [s]
_HEADING_GAIN = 0.4  # [1/s]
_GREATEST_STEERING = 0.6  # [rad]
TRAPPED_SLIP = 0.9
TRAPPED_TIME = 1.0
"""An entrapment: the median slip is above `TRAPPED_SLIP` for this long [s]."""


@dataclass(frozen=True)
class Phase:
    """A stretch of a drive; speed and yaw rate as shares of what the rover usually does."""

    seconds: float
    speed: float = 1.0
    turn: float = 0.0  # length of the wheelbase over the radius of the turn, positive left
    spin: float = 0.0  # turning on the spot, share of the usual rim speed
    until_trapped: bool = False  # ends early, some seconds after an entrapment


_DRIVE = (Phase(2.0, 0.0), Phase(300.0))
_TRAP = (Phase(2.0, 0.0), Phase(300.0, until_trapped=True))
_BACK_OUT = (Phase(2.0, 0.0), Phase(300.0, until_trapped=True), Phase(2.0, 0.0), Phase(20.0, -1.0))
_STOP_AND_GO = (
    Phase(2.0, 0.0),
    *(Phase(7.0), Phase(3.0, 0.0), Phase(4.0, 0.5), Phase(1.5, 0.0)) * 6,
)
_REVERSAL = (Phase(2.0, 0.0), *(Phase(9.0), Phase(1.0, 0.0), Phase(8.0, -1.0), Phase(2.0, 0.0)) * 4)
_TURNS = (
    Phase(2.0, 0.0),
    *(Phase(5.0), Phase(8.0, 0.8, 0.35), Phase(4.0), Phase(8.0, 0.8, -0.35), Phase(5.0, 1.0, 0.15))
    * 3,
)
_SPOT_TURNS = (
    Phase(2.0, 0.0),
    *(Phase(6.0), Phase(1.0, 0.0), Phase(6.0, 0.0, 0.0, 0.8), Phase(1.0, 0.0)) * 2,
    *(Phase(6.0), Phase(1.0, 0.0), Phase(6.0, 0.0, 0.0, -0.8), Phase(1.0, 0.0)) * 3,
)
_DOWNHILL = (Phase(2.0, 0.0), *(Phase(12.0), Phase(4.0, 0.3), Phase(1.5, 0.0)) * 5)

MIXED = (
    'four_skid',
    'four_front',
    'four_all',
    'six_rocker',
    'six_rocker_skid',
    'six_skid',
    'eight_skid',
)
LIGHT = ('six_light', 'eight_light')
ON_THE_SPOT = ('four_skid', 'four_all', 'six_rocker', 'six_rocker_skid', 'six_skid', 'eight_skid')


@dataclass(frozen=True)
class Kind:
    """A kind of drives; what it leaves open is drawn for each seed.

    ``slip`` is the slip at which the soil just bears the slope, which follows from it; ``degrees``
    states the slope itself. ``patch`` names how the soft patch is made: ``cross`` (passable),
    ``near_miss``, ``fast`` or ``slow`` (entrapments). ``file`` names what the rover file states:
    ``lines`` (geometry and mass), ``no_soil``; empty: drawn.
    """

    families: tuple[str, ...] = MIXED
    phases: tuple[Phase, ...] = _DRIVE
    duration: float = 60.0
    gravity: tuple[float, ...] = (9.80665, 9.80665, 9.80665, 9.80665, 3.71, 1.62)
    slip: tuple[float, float] | None = None
    degrees: tuple[float, float] = (0.0, 0.0)
    cross_degrees: tuple[float, float] = (-1.0, 1.0)
    patch: str = ''
    firm: bool = False
    soft: bool = False  # soft soil everywhere, as far as it bears the rover
    stone: bool = False
    dragged: bool = False
    file: str = ''
    reference_period: float | None = None  # [s], 0 = none; None: drawn
    odometry_rate: float | None = None  # [Hz]
    sinkage: bool = True
    torque: bool = True
    wild: bool = False


KINDS = {
    'cruise': Kind(),
    'climb': Kind(slip=(0.1, 0.5)),
    'climb_soft_patch': Kind(slip=(0.06, 0.2), patch='cross'),
    'soft_patch': Kind(patch='cross'),
    'entrapment_slow': Kind(slip=(0.1, 0.25), patch='slow', phases=_TRAP, duration=110.0),
    'entrapment_fast': Kind(slip=(0.05, 0.2), patch='fast', phases=_TRAP),
    'near_miss': Kind(slip=(0.08, 0.2), patch='near_miss', duration=75.0),
    'stop_and_go': Kind(slip=(0.05, 0.3), phases=_STOP_AND_GO),
    'reversal': Kind(slip=(0.02, 0.1), phases=_REVERSAL),
    'back_out': Kind(slip=(0.05, 0.15), patch='fast', phases=_BACK_OUT, duration=80.0),
    'turns': Kind(phases=_TURNS),
    'spot_turns': Kind(families=ON_THE_SPOT, phases=_SPOT_TURNS),
    'cross_slope': Kind(cross_degrees=(7.0, 15.0)),
    'stone': Kind(stone=True),
    'dragged_wheel': Kind(dragged=True),
    'downhill': Kind(degrees=(-16.0, -6.0), phases=_DOWNHILL),
    'low_gravity': Kind(gravity=(1.62, 3.71), slip=(0.05, 0.35)),
    'light': Kind(families=LIGHT, slip=(0.05, 0.3), file='lines'),
    'heavy': Kind(families=('four_heavy', 'six_heavy'), slip=(0.05, 0.3), file='lines'),
    'slow_odometry': Kind(slip=(0.05, 0.35), odometry_rate=5.0),
    'rare_references': Kind(slip=(0.05, 0.35), reference_period=20.0, duration=80.0),
    'no_references': Kind(slip=(0.05, 0.35), reference_period=0.0),
    'no_soil': Kind(slip=(0.05, 0.35), file='lines'),
    'firm': Kind(
        families=('four_tyres',),
        gravity=(9.80665,),
        degrees=(-5.0, 5.0),
        firm=True,
        file='lines',
        sinkage=False,
    ),
    'turns_in_sand': Kind(phases=_TURNS, soft=True),
    'wild_imu': Kind(slip=(0.05, 0.35), wild=True),
    'no_sinkage': Kind(slip=(0.05, 0.35), sinkage=False),
    'no_torque': Kind(slip=(0.05, 0.35), torque=False),
}  # fmt: skip
ENTRAPMENTS = ('entrapment_slow', 'entrapment_fast', 'back_out')


class Driver:
    """Follows the phases of a kind; keeps the heading while driving straight."""

    def __init__(
        self,
        rover: Rover,
        phases: Sequence[Phase],
        patience: float,
        locked: int | None = None,
        gives_up: bool = False,
        until: float = np.inf,
    ) -> None:
        self._rover, self._phases = rover, list(phases)
        self._patience = patience  # after an entrapment [s]
        self._locked = locked
        self._gives_up = gives_up  # ends the drive with an entrapment
        self._until = until  # place along the way at which the drive ends [m]
        self._phase_start = self._speed = self._spin = self._yaw = 0.0
        self._above = 0.0  # how long the median slip has been above `TRAPPED_SLIP` [s]
        self._turned = False
        self._drag_from = 8.0

    def __call__(self, state: State) -> Command | None:
        """Return what the drives are told now; None ends the drive."""
        phase = self._phase(state)
        if phase is None or state.x > self._until:
            return None
        most = STEP / _RAMP_TIME
        self._speed += np.clip(phase.speed - self._speed, -most, most)
        self._spin += np.clip(phase.spin - self._spin, -most, most)
        if phase.turn or phase.spin:
            self._turned = True
        elif self._turned or not abs(self._speed) > 0.0:
            self._yaw, self._turned = state.yaw, False
        return self._command(state, phase)

    def _phase(self, state: State) -> Phase | None:
        slip = slip_ratio(state.rate * self._rover.rims.shear_radius, state.speed)
        trapped = np.median(slip) > TRAPPED_SLIP and abs(self._speed) > 0.1
        self._above = self._above + STEP if trapped else 0.0
        while self._phases:
            phase = self._phases[0]
            if self._gives_up and self._above > TRAPPED_TIME + 0.5:
                return None
            lost = phase.until_trapped and self._above > TRAPPED_TIME + self._patience
            if not lost and state.time - self._phase_start < phase.seconds:
                return phase
            self._phase_start = state.time
            self._phases.pop(0)
        return None

    def _command(self, state: State, phase: Phase) -> Command:
        rover = self._rover
        usual, length = rover.speed, 0.5 * (rover.x.max() - rover.x.min())
        curvature = phase.turn / (2.0 * length)
        if not (phase.turn or phase.spin) and self._speed:
            error = (self._yaw - state.yaw) * np.sign(self._speed)
            curvature = np.clip(_HEADING_GAIN * error / usual, -0.15 / length, 0.15 / length)
        locked = np.zeros(rover.count, dtype=bool)
        if self._locked is not None and state.time > self._drag_from:
            locked[self._locked] = True
        forward = usual * self._speed
        if rover.family.steering == 'skid':
            spin = usual * self._spin / np.abs(rover.y).max()
            rim = forward * (1.0 - curvature * rover.y) - spin * rover.y
            return Command(rim / rover.rims.shear_radius, np.zeros(rover.count), locked)
        rim, steering = self._steered(forward, curvature)
        if phase.spin or self._spin:
            steering = _spot_angles(rover)
            away = np.abs(state.steering - steering).max() > 0.05
            rim = 0.0 if away else -np.sign(rover.y) * usual * self._spin
        return Command(rim * np.ones(rover.count) / rover.rims.shear_radius, steering, locked)

    def _steered(self, forward: float, curvature: float) -> tuple[FloatArray, FloatArray]:
        """Return rim speeds and angles that turn all wheels about one centre (Ackermann)."""
        rover = self._rover
        centre = rover.x.min() if rover.family.steering == 'front' else 0.0
        side, along = 1.0 - curvature * rover.y, curvature * (rover.x - centre)
        steering = np.clip(np.arctan2(along, side), -_GREATEST_STEERING, _GREATEST_STEERING)
        return forward * np.hypot(side, along), np.where(rover.steered, steering, 0.0)


def _spot_angles(rover: Rover) -> FloatArray:
    """Return the angles at which steered wheels turn the rover about its centre."""
    return np.where(rover.steered, -np.sign(rover.y) * np.arctan2(rover.x, np.abs(rover.y)), 0.0)


def slip_ratio(rim: FloatArray, speed: FloatArray, rest: float = 0.002) -> FloatArray:
    """Return slip ratios of rim and ground speeds [m/s], as the estimator defines them.

    Up to a rim speed of `rest` a wheel is held still.
    """
    greater = np.maximum(np.abs(rim), np.abs(speed))
    ratio = (np.abs(rim) - np.abs(speed)) / np.maximum(greater, 1e-12)
    held = np.abs(rim) <= rest
    against = ~held & (rim * speed < 0.0)
    return np.where(against, 1.0, np.where(held & (np.abs(speed) > rest), -1.0, ratio))
