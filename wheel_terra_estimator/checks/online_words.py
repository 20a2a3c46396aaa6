# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What is said of a fault that was found while driving, and what mends it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from wheel_terra_estimator.checks.finding import Finding
from wheel_terra_estimator.configuration.configuration import Configuration

STANDARD_GRAVITY = 9.80665  # [m/s^2]
GRAVITY_SHARE = 0.2
"""Share by which the mean specific force may differ from gravity."""
GRAVITY_OFF = 0.3
"""Specific force over gravity below which gravity was taken off."""
RATE_UNITS = {
    'revolutions per minute': 30.0 / math.pi,
    'degrees per second': 180.0 / math.pi,
    'thousandths of rad/s': 1000.0,
}
"""Wheel rates in another unit: how many times too fast they read."""
UNIT_BAND = (0.85, 1.5)
"""Rim speed over reference speed of a rolling wheel, slip included."""
UPSIDE_DOWN = 150.0
"""Angle [deg] between gravity and straight down above which an IMU lies on its back."""


def rate_unit(ratio: float) -> str | None:
    """Return the unit in which wheels read so many times too fast; None: none."""
    for unit, factor in RATE_UNITS.items():
        if UNIT_BAND[0] < ratio / factor < UNIT_BAND[1]:
            return unit
    return None


class Seen(NamedTuple):
    """What the last window that spoke for a fault showed.

    ``figure`` is what its rule measures, ``wheel`` the index of the wheel concerned (-1: all),
    ``backwards`` all wheels that count backwards.
    """

    figure: float
    wheel: int
    backwards: tuple[int, ...]


class Wording:
    """Words of one rover.

    Parameters
    ----------
    configuration : Configuration
        Names and signs for the cures.
    """

    def __init__(self, configuration: Configuration) -> None:
        wheels = configuration.wheels
        self._names = wheels.names
        self._odometry = configuration.wheel_odometry
        self._direction: list[float] = wheels.direction.tolist()
        self._lateral: list[float] = wheels.y.tolist()
        self._gravity = float(configuration.rover.gravity)

    def finding(self, rule: str, seen: Seen, sure: float) -> Finding:
        """Return the finding of a rule, with the probability that it is so."""
        said = _WORDS[rule](self, seen)
        return Finding(
            kind=said.kind,
            topic=said.topic,
            wheel=self._names[said.wheel] if said.wheel >= 0 else None,
            parameter=said.parameter,
            value=said.value,
            confidence=sure,
            words=said.words,
            cure=said.cure,
        )

    def _gravity_words(self, seen: Seen) -> _Said:
        share = seen.figure / self._gravity
        begin = f'specific force {seen.figure:.3g} m/s^2 along z where gravity is '
        begin += f'{self._gravity:.4g}: '
        for unit, factor in (('g', STANDARD_GRAVITY), ('mg', STANDARD_GRAVITY / 1000.0)):
            if abs(share * factor - 1.0) < GRAVITY_SHARE:
                return _Said(
                    'unit',
                    'imu/data',
                    f'{begin}linear_acceleration is in {unit}',
                    f'multiply linear_acceleration by {factor:.5g} in the driver (m/s^2)',
                    value=factor,
                )
        if share < GRAVITY_OFF:
            return _Said(
                'gravity',
                'imu/data',
                f'{begin}gravity was taken off',
                'publish the specific force with gravity (+g on z at rest, REP 145)',
            )
        return _Said(
            'gravity',
            'imu/data',
            f'{begin}another planet, or another scale',
            f'rover.gravity: {seen.figure:.3g}, or the right scale in the driver',
            parameter='rover.gravity',
            value=seen.figure,
        )

    def _mounting_words(self, seen: Seen) -> _Said:
        tilt = math.degrees(math.acos(max(-1.0, min(1.0, seen.figure))))
        roll = 'sensors.imu_mounting_roll_deg'
        return _Said(
            'mounting',
            'imu/data',
            f'gravity points {tilt:.0f} degrees off straight down',
            f'{roll}: 180.0'
            if tilt > UPSIDE_DOWN
            else 'state sensors.imu_mounting_*_deg (wheel-terra check has the angles)',
            parameter=roll,
        )

    def _gyro_unit_words(self, seen: Seen) -> _Said:
        return _Said(
            'unit',
            'imu/data',
            'angular_velocity.z is many times what the wheels allow: degrees per second',
            'multiply angular_velocity by 0.0174533 in the driver (rad/s, REP 103)',
            value=math.pi / 180.0,
        )

    def _sides_words(self, seen: Seen) -> _Said:
        mirrored = ', '.join(f'{-y:g}' for y in self._lateral)
        return _Said(
            'swapped_sides',
            self._odometry,
            'left and right wheels turn against the gyro: the sides are swapped, all wheels count '
            'backwards, or the gyro counts yaw to the right',
            f'exchange left and right in wheels.names, or wheels.y: [{mirrored}]; or negate '
            'angular_velocity.z in the driver',
            parameter='wheels.names',
        )

    def _directions(self, flipped: Iterable[int]) -> str:
        turned = set(flipped)
        listed = (int(-d if i in turned else d) for i, d in enumerate(self._direction))
        return f'[{", ".join(str(d) for d in listed)}]'

    def _backwards_words(self, seen: Seen) -> _Said:
        return _Said(
            'sign',
            self._odometry,
            'counts backwards when the rover drives forward',
            f'wheels.direction: {self._directions(seen.backwards)}',
            wheel=seen.wheel,
            parameter='wheels.direction',
            value=-self._direction[seen.wheel],
        )

    def _one_side_words(self, seen: Seen) -> _Said:
        left = self._directions(i for i, y in enumerate(self._lateral) if y > 0.0)
        right = self._directions(i for i, y in enumerate(self._lateral) if y < 0.0)
        return _Said(
            'sign',
            self._odometry,
            'left and right wheels turn against each other while the gyro sees no turn: one side '
            'counts backwards',
            f'wheels.direction: {left} if the left side is the one, {right} if the right',
            parameter='wheels.direction',
            value=-1.0,
        )

    def _reference_words(self, seen: Seen) -> _Said:
        return _Said(
            'sign',
            'reference_odom',
            'linear.x runs against the wheels',
            'negate twist.linear.x in its driver, or turn its frame into base_link; if all wheels '
            f'count backwards, wheels.direction: {self._directions(range(len(self._names)))}',
            value=-1.0,
        )

    def _delay_words(self, seen: Seen) -> _Said:
        return _Said(
            'delay',
            'reference_odom',
            f'velocity follows starts and stops of the wheels about {seen.figure:.1f} s late, by '
            'the stamps',
            f'take {seen.figure:.1f} s off its stamps: stamp the moment of the picture, not of the '
            'result (wheel-terra check has the exact figure)',
            value=round(seen.figure, 2),
        )

    def _rate_unit_words(self, seen: Seen) -> _Said:
        unit = rate_unit(seen.figure)
        assert unit is not None
        return self._in_unit(unit, f'rim speed {seen.figure:.3g} times the reference')

    def _turn_unit_words(self, seen: Seen) -> _Said:
        units = (unit for unit, factor in RATE_UNITS.items() if seen.figure < 3.0 * factor)
        unit = next(units, list(RATE_UNITS)[-1])
        return self._in_unit(unit, f'turns {seen.figure:.3g} times those of the gyro')

    def _in_unit(self, unit: str, how: str) -> _Said:
        factor = 1.0 / RATE_UNITS[unit]
        return _Said(
            'unit',
            self._odometry,
            f'velocity is in {unit} ({how})',
            f'multiply velocity by {factor:.6g} in the driver (rad/s, REP 103)',
            value=factor,
        )

    def _absurd_words(self, seen: Seen) -> _Said:
        return _Said(
            'unit',
            self._odometry,
            f'rim speed {seen.figure:.3g} m/s: velocity is not in rad/s',
            'publish rad/s (REP 103): revolutions per minute times 0.10472, degrees per second '
            'times 0.0174533',
        )

    def _frozen_words(self, seen: Seen) -> _Said:
        name = self._names[seen.wheel]
        return _Said(
            'frozen',
            self._odometry,
            f'rim speed stays at exactly {seen.figure:.4g} m/s while the other wheels change',
            f'mend the encoder or driver of {name}; until then leave it out of name',
            wheel=seen.wheel,
        )

    def _torque_words(self, seen: Seen) -> _Said:
        name = self._names[seen.wheel] if seen.wheel >= 0 else 'all wheels'
        return _Said(
            'sign',
            self._odometry,
            'torque brakes where the wheels drive on the level or uphill',
            f'negate effort of {name} in the driver (wheels.direction flips rate and torque '
            'together)',
            wheel=seen.wheel,
            value=-1.0,
        )

    def _torque_unit_words(self, seen: Seen) -> _Said:
        return _Said(
            'unit',
            self._odometry,
            f'sum of T/r is {seen.figure:.3g} times the weight: N mm, a current or a motor torque',
            'publish the torque at the wheel in N m (N mm times 0.001), or state its scale in '
            'sensors.torque_gain (wheel-terra calibrate)',
            parameter='sensors.torque_gain',
        )

    def _sinkage_words(self, seen: Seen) -> _Said:
        return _Said(
            'sign',
            'sinkage',
            f'the wheels seem to run {-1000.0 * seen.figure:.0f} mm above the surface: counted '
            'upwards, or the zero is off',
            'negate position in the driver (positive down), or state sensors.sinkage_zero [m]',
            parameter='sensors.sinkage_zero',
            value=-1.0,
        )


class _Said(NamedTuple):
    """A finding without its probability; ``wheel`` is an index, -1: none in particular."""

    kind: str
    topic: str
    words: str
    cure: str
    wheel: int = -1
    parameter: str | None = None
    value: float | None = None


_WORDS: dict[str, Callable[[Wording, Seen], _Said]] = {
    'gravity': Wording._gravity_words,
    'mounting': Wording._mounting_words,
    'gyro_unit': Wording._gyro_unit_words,
    'sides': Wording._sides_words,
    'backwards': Wording._backwards_words,
    'one_side_backwards': Wording._one_side_words,
    'reference_sign': Wording._reference_words,
    'reference_delay': Wording._delay_words,
    'rate_unit': Wording._rate_unit_words,
    'rate_unit_in_turns': Wording._turn_unit_words,
    'absurd_rate': Wording._absurd_words,
    'frozen': Wording._frozen_words,
    'torque': Wording._torque_words,
    'torque_of_wheel': Wording._torque_words,
    'torque_unit': Wording._torque_unit_words,
    'sinkage': Wording._sinkage_words,
}
