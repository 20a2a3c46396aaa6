# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The IMU by itself: units, gravity, placeholders, mounting, zeros, noise.

Convention: specific force, +g on z at rest (REP 145), in a frame that the rover file's mounting
turns into ``base_link``.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import (
    EVEN_GROUND_STD,
    LEAST_YAW,
    YAW_SIGMAS,
    Evidence,
    accelerometer_signs,
    mounting_yaw,
)
from wheel_terra_estimator.checks.finding import (
    STANDARD_GRAVITY,
    Finding,
    Outcome,
    found,
    listed,
    not_checked,
)
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import ImuSeries, Recording, rows_of
from wheel_terra_estimator.checks.statistics import (
    UNIFORM_STD,
    Estimate,
    block_fit,
    block_fits,
    confidence,
    correlation,
    moving_mean,
    probability,
    robust_std,
    runs,
    spike_height,
    spread,
    step_of,
)
from wheel_terra_estimator.checks.turning import (
    against_reference,
    gyro_unit_known,
    ordinary_track,
    track_ratio,
    turns_upright,
)
from wheel_terra_estimator.estimation.timing.input_checks import OUTLIER_FORCE, OUTLIER_RATE

GRAVITY_TOLERANCE = 0.1  # of the mean specific force (slopes, bias, vibration) [-]
SLOPES = 0.035  # the same by slopes and bias alone [-]
GRAVITY_BIAS = 0.3  # the same as an acceleration: biases [m/s^2]
GRAVITIES = {'the Moon': 1.62, 'Mars': 3.71, 'the Earth': 9.81}  # [m/s^2]
UPRIGHT_SHARE = 0.5  # share of the mean specific force along z that gravity has on a rover [-]
UPSIDE_TILT = math.radians(35.0)  # mean tilt that no rover drives at [rad]
STEEPEST_MEAN = math.radians(20.0)  # mean slope of a drive, at most [rad]
LEAST_SHOWN = 0.01  # change of an angle that a remedy states, at least [deg]
LEAST_MOUNTING = math.radians(1.5)  # mounting errors below this [rad] are left to calibration
LONGEST_GAP = 1.0  # time without IMU in which a turn may pass unseen [s]
LEAST_TURN = 4.5  # heading that a drive has to cover to separate the mounting from a slope [rad]
FLAT_TURN_STD = math.radians(0.1)  # unevenness of the ground leaves open [rad]
TURNED_ROUND = 0.75  # probability that an IMU is turned round, not its x axis reversed [-]
ROLL_STD = math.radians(0.5)  # of a body in turns, which is no mounting where both ways are driven
YAW_MODEL_STD = math.radians(1.0)  # pitch and roll in starts and turns leave open [rad]
LEAST_QUARTER = math.radians(45.0)  # least yaw of a quarter turn [rad]
ALONG_AXIS = math.cos(math.radians(25.0))  # cosine within which an axis is meant [-]
SMOOTHING = 1.0  # over which vibration averages out, and slopes do not [s]
BENT = 0.75  # lean of bent ground over how slopes differ in a turn, one deviation [-]
"""Seen on hills, and in circles on next to even ground (46 drives of another simulator)."""
EVEN = 0.6  # mean direction of the headings in turns, 0 where all occur alike, at most [-]
NOISE_FACTOR = 4.0  # noise above so many times the stated one is a finding
BIAS_FACTOR = 6.0  # A bias above so many stated deviations is a finding
LEAST_GYRO_BIAS = 0.004  # [rad/s]
LEAST_STANDSTILL = 3.0  # [s]
BIAS_SIGMAS = 5.0
TILT_IS_MOUNTING = 0.7  # probability that a tilt in circles is the mounting, not a zero [-]
CROSS_AXIS = 0.01  # gyro against accelerometer in one housing [rad]; data sheets of MEMS
UNTURNED = 0.85  # probability that it is upside down, not its accelerometer reversed [-]
OR_REVERSED = ', or linear_acceleration has the wrong sign'
CLEAR_AGREEMENT = 0.8  # correlation of gyro and wheels in turns that are the same way round [-]
LEAST_OUTLIERS = 3
OUTLIER_SIGMAS = 10.0  # of the usual change of a reading, which another unit makes large
MOST_OUTLIERS = 0.2  # greatest share of samples that are single outliers [-]
LEAST_MESSAGES = 20
UNIT_TOLERANCE = 0.12  # share by which the mean specific force may lie off gravity in another unit
AGAINST = -0.7  # correlation of two ups of which one leans the wrong way, at most [-]
SLOPE_TIME = 3.0  # over which accelerations average out, and slopes do not [s]
LEAST_LEAN = math.radians(1.0)  # deviation of slopes that tell it [rad]
UP_DIFFERENCE = math.radians(25.0)  # that no acceleration makes [rad]
MOST_COMPARED = 5000  # messages
FROZEN_SHARE = 0.3  # share of messages that repeat the one before
MOUNTING = tuple(f'sensors.imu_mounting_{axis}_deg' for axis in ('roll', 'pitch', 'yaw'))
"""Parameters of the mounting."""
FROZEN_TIME = 1.0  # time that no number of a running IMU stays the same [s]


Judged = tuple[list[Outcome], ImuSeries]


def check_imu(recording: Recording, facts: RoverFacts) -> tuple[list[Outcome], Recording]:
    """Return contradictions within the IMU readings, and the recording with them corrected."""
    imu = recording.imu
    if imu is None or imu.stamp.size < LEAST_MESSAGES:
        none: list[Outcome] = [not_checked(kind, 'no_imu') for kind in ('mounting', 'gravity')]
        return none, replace(recording, imu=None)
    outcomes, imu = _placeholders(imu)
    for check, *needed in (
        (_frozen, 'force', 'rate'),
        (_gravity, 'force'),
        (_outliers, 'force', 'rate'),
        (_up_by_orientation, 'force'),
    ):
        if all(_has(imu, name) for name in needed):
            findings, imu = check(imu, facts)
            outcomes += findings
    return outcomes, replace(recording, imu=imu)


def _has(imu: ImuSeries, name: str) -> bool:
    """Return whether there is a force or a rate that means something."""
    return bool(np.isfinite(getattr(imu, name)).any())


def _without(imu: ImuSeries, *names: str) -> ImuSeries:
    """Return the messages without force, rate or orientation, where these are faulty."""
    nothing = {name: np.full_like(getattr(imu, name), np.nan) for name in names}
    return replace(imu, **nothing)


def _up_by_orientation(imu: ImuSeries, facts: RoverFacts) -> Judged:
    """Return an orientation that has up elsewhere than the specific force, both in its frame."""
    norm = np.linalg.norm(imu.orientation, axis=1)
    known = np.flatnonzero((norm > 0.5) & (norm < 2.0))
    if known.size < LEAST_MESSAGES:
        return [], imu
    some = known[:: max(known.size // MOST_COMPARED, 1)]
    world, force = Rotation.from_quat(imu.orientation[some]), imu.force[some]
    up = world.apply(force)[:, 2]
    size = np.linalg.norm(np.median(force, axis=0))  # without noise and vibration
    difference = math.acos(float(np.clip(np.median(up) / size, -1.0, 1.0)))
    upright = float((facts.mounting @ np.median(imu.force, axis=0))[2]) > 0.0
    turned_round = difference > math.pi - UP_DIFFERENCE and not upright  # see `check_upside`
    how = ''
    if difference >= UP_DIFFERENCE:
        how = f'its up and that of linear_acceleration lie {math.degrees(difference):.0f} degrees'
        how += ' apart'
    elif _against(size * world.inv().as_matrix()[:, :, 2], force, imu.seconds[some]) < AGAINST:
        how = 'where its up leans one way, that of linear_acceleration leans the other'
    if turned_round or not how:
        return [], imu
    return [found('orientation', imu.topic, 0.97, how=how)], _without(imu, 'orientation')


def _against(up: FloatArray, force: FloatArray, time: FloatArray) -> float:
    """Return the correlation of how two ups (k, 3) [m/s^2] lean over a drive; 0: hardly."""
    width = round(SLOPE_TIME / max(float(np.median(np.diff(time))), 1e-3))
    leans = [
        np.concatenate([moving_mean(one - one.mean(), width) for one in values.T])
        for values in (up, force)
    ]
    clear = np.std(leans[0]) > LEAST_LEAN * np.linalg.norm(up[0])
    return correlation(*leans) if clear else 0.0


def _placeholders(imu: ImuSeries) -> Judged:
    outcomes: list[Outcome] = []
    for name, field, of, tells in (
        ('force', 'linear_acceleration', 'gravity', 'slope and load'),
        ('rate', 'angular_velocity', 'sign', 'turns'),
    ):
        if not _has(imu, name):
            outcomes.append(not_checked(of, f'{name}_missing', field=field, tells=tells))
        elif not np.nan_to_num(getattr(imu, name)).any():
            outcomes.append(found('force_zero', imu.topic, 0.999, field=field))
            imu = _without(imu, name)
    known = np.isfinite(imu.orientation).all(axis=1)
    orientation = imu.orientation[known]
    if known.sum() > LEAST_MESSAGES:
        still = np.ptp(orientation, axis=0).max() == 0.0 and np.ptp(imu.rate, axis=0).max() > 0.0
        if still or np.median(np.linalg.norm(orientation, axis=1)) < 0.5:
            shown = ', '.join(f'{value:g}' for value in orientation[0])
            outcomes.append(found('orientation_placeholder', imu.topic, 0.999, shown=shown))
            imu = _without(imu, 'orientation')
    return outcomes, imu


def _frozen(imu: ImuSeries, _: RoverFacts) -> Judged:
    same = (np.diff(np.hstack([imu.force, imu.rate]), axis=0) == 0.0).all(axis=1)
    longest = max((imu.seconds[b] - imu.seconds[a] for a, b in runs(same)), default=0.0)
    if np.mean(same) > FROZEN_SHARE:
        how = f'{100 * np.mean(same):.0f} % of the messages repeat the one before'
    elif longest > FROZEN_TIME:
        how = f'all six numbers stay identical for up to {longest:.1f} s'
    else:
        return [], imu
    alive = ~np.concatenate([[False], same])
    left = rows_of(imu, alive) if alive.sum() >= LEAST_MESSAGES else _without(imu, 'force', 'rate')
    return [found('sensor_frozen', imu.topic, 0.99, how=how)], left


def _outliers(imu: ImuSeries, _: RoverFacts) -> Judged:
    """Leave out single samples that no body can make; the node does so by the same limits."""
    outcomes, kept = list[Outcome](), np.ones(imu.stamp.size, dtype=bool)
    for values, limit, unit in (
        (imu.force, OUTLIER_FORCE, 'm/s^2'),
        (imu.rate, OUTLIER_RATE, 'rad/s'),
    ):
        off = spike_height(values)
        if (off > limit).sum() < LEAST_OUTLIERS:
            continue
        noise = np.array([robust_std(column) for column in np.diff(values, axis=0).T])
        single = (off > np.maximum(limit, OUTLIER_SIGMAS * noise)).any(axis=1)  # or in another unit
        if LEAST_OUTLIERS <= single.sum() <= MOST_OUTLIERS * single.size:
            details = {'count': int(single.sum()), 'share': 100.0 * np.mean(single), 'unit': unit}
            details['most'] = float(off.max())
            outcomes.append(found('imu_wild', imu.topic, 0.97, **details))
            kept &= ~single
    return outcomes, rows_of(imu, kept) if outcomes else imu


def _gravity(imu: ImuSeries, facts: RoverFacts) -> Judged:
    gravity = facts.gravity
    middle = np.median(imu.force, axis=0)
    # Second by second: vibration goes, and a slope is the same while a rover turns on it.
    seconds = max(int(np.ptp(imu.stamp) * 1e-9), 1)
    parts = np.array_split(imu.force, min(seconds, len(imu.force)))
    size = float(np.median([np.linalg.norm(np.median(part, axis=0)) for part in parts]))
    off = abs(size - gravity)

    def told(key: str, value: float, sure: float = 0.98, **figures: Any) -> list[Outcome]:
        figures |= {'value': value, 'size': size, 'gravity': gravity}
        return [found(key, imu.topic, sure, **figures)]

    if not off > max(SLOPES * gravity, GRAVITY_BIAS):  # nan: an axis without a number
        return [], imu
    upright = abs(float((facts.mounting @ middle)[2])) > UPRIGHT_SHARE * size
    # What a slope leaves may have the size of gravity in g.
    in_g = abs(size * STANDARD_GRAVITY / gravity - 1.0) <= UNIT_TOLERANCE and upright
    places = GRAVITIES.items()
    place = next((p for p, there in places if abs(size / there - 1.0) <= GRAVITY_TOLERANCE), '')
    elsewhere = bool(place) and upright  # a slope leaves as much, but along the ground
    if size < 0.3 * min(gravity, STANDARD_GRAVITY) and not in_g and not elsewhere:
        return told('gravity_off', gravity), _without(imu, 'force')
    for unit, factor in (('g', STANDARD_GRAVITY), ('mg', STANDARD_GRAVITY / 1000.0)):
        if abs(size * factor / gravity - 1.0) <= UNIT_TOLERANCE:
            mended = replace(imu, force=imu.force * factor)
            return told('force_unit', factor, unit=unit), mended
    if place and off > GRAVITY_TOLERANCE * gravity:
        return told('planet', GRAVITIES[place], place=place), imu
    return told('force_scale', round(gravity / size, 4), 0.9), imu


# With the wheels ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mounting:
    """Remaining tilt of the mounting: small angles about x and y and their deviation [rad]."""

    roll: float
    pitch: float
    std: float
    ground: float  # part of it that uneven ground leaves [rad]
    turn: float  # heading covered [rad]
    sure: float  # probability that it is no zero of the accelerometer

    @property
    def sigmas(self) -> float:
        """Tilt over its deviation."""
        return max(abs(self.roll), abs(self.pitch)) / self.std

    def taken_off(self, rotation: FloatArray) -> FloatArray:
        """Return a rotation into ``base_link`` without the tilt: about x, then y."""
        tilt = Rotation.from_euler('xy', [self.roll, self.pitch])
        return np.asarray(tilt.as_matrix() @ rotation)


def gross_tilt(evidence: Evidence) -> FloatArray | None:
    """Return the rotation that brings the mean specific force upright, if it is far from it.

    By whole quarter turns where a slope explains the rest; else all of it is the mounting.
    """
    if evidence.force is None:
        return None
    up = np.median(evidence.force, axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    if math.acos(float(np.clip(up[2], -1.0, 1.0))) < UPSIDE_TILT:
        return None
    nearest = np.zeros(3)
    nearest[np.argmax(np.abs(up))] = np.sign(up[np.argmax(np.abs(up))])
    if math.acos(float(np.clip(up @ nearest, -1.0, 1.0))) < STEEPEST_MEAN:
        up = nearest
    if up[2] == -1.0:
        return np.diag([1.0, -1.0, -1.0])  # about x: about y the slope would turn round as well
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    turn = math.atan2(sine, float(up[2])) * axis / max(sine, 1e-9)
    return np.asarray(Rotation.from_rotvec(turn).as_matrix())


def gyro_bias(evidence: Evidence) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return the gyro's bias at rest (3,) [rad/s], its deviation, and what of that is noise.

    The rest is what the bias changes by. None without a standstill.
    """
    gyro, rest = evidence.gyro, evidence.at_rest
    if gyro is None or rest.sum() * evidence.period < LEAST_STANDSTILL:
        return None
    spread = np.array([robust_std(column) for column in gyro[rest].T])
    noise = spread / math.sqrt(max(rest.sum() / 4.0, 1.0))
    first, second = (np.median(part, axis=0) for part in np.array_split(gyro[rest], 2))
    return np.median(gyro[rest], axis=0), np.hypot(noise, 0.5 * (second - first)), noise


def small_tilt(evidence: Evidence) -> Mounting | None:
    """Return the tilt of the IMU against the chassis from full turns; None where there are none.

    On a plane the specific force less that of the motion is ``g (m + R(-psi) s)``: the mounting m
    stays with the rover, the slope s turns with the heading psi. Ground that bends leans the rover
    alike all along a turn, by about as much as slopes differ in it.
    """
    imu = evidence.recording.imu
    if imu is None or evidence.force is None or evidence.gyro is None:
        return None
    if np.diff(evidence.seconds(imu)).max(initial=0.0) > LONGEST_GAP:
        return None  # in which the heading is lost
    track = track_ratio(evidence)
    if track is None or (evidence.facts.known and not ordinary_track(track)):
        return None  # the wheels see no such turns: a bias, or another unit
    seen = gyro_bias(evidence)
    if seen is not None:
        bias = float(seen[0][2])
    else:  # by the wheels, which see no turn where there is none
        turns = np.column_stack([evidence.side_difference, np.ones(evidence.time.size)])
        bias = block_fit(turns, evidence.gyro[:, 2])[1].value
    yaw = evidence.gyro[:, 2] - bias
    turned = yaw * np.minimum(np.diff(evidence.time, prepend=evidence.time[0]), 1.0)
    smooth = np.abs(moving_mean(yaw, evidence.rows_in(2.0)))
    turning = smooth > 0.5 * float(np.quantile(smooth, 0.97))
    covered = float(np.sum(np.abs(turned[turning])))
    motion = np.column_stack([np.gradient(evidence.rim, evidence.time), evidence.rim * yaw])
    psi, force = np.cumsum(turned)[turning], (evidence.force[:, :2] - motion)[turning]
    if covered < LEAST_TURN or turning.sum() < 100 or abs(np.exp(1j * psi).mean()) > EVEN:
        return None
    zero, one, cos, sin = np.zeros(psi.size), np.ones(psi.size), np.cos(psi), np.sin(psi)
    # Rows of x and y in turn, so that blocks of rows are blocks of time.
    design = np.stack([[one, zero, cos, sin], [zero, one, -sin, cos]]).transpose(2, 0, 1)
    target = force / float(np.median(evidence.force[turning, 2]))
    fit = block_fit(design.reshape(-1, 4), target.ravel())
    value, std = np.array(fit).T
    left = (target - design @ value).T
    smooth = [moving_mean(column, evidence.rows_in(SMOOTHING)) for column in left]
    ground = float(np.max([*std[:2], BENT * np.sqrt(np.mean(np.square(smooth)))]))
    facts = evidence.facts
    open_bias = facts.sensors.specific_force_bias_std if facts.known else 0.0
    one_way = abs(float(np.sign(yaw * evidence.rim)[turning].mean()))
    floor = math.hypot(FLAT_TURN_STD, ROLL_STD * one_way, open_bias / facts.gravity)
    turns = np.column_stack([yaw, np.ones(yaw.size)])[turning, : 2 if seen is None else 1]
    along, across = tilt = value[:2]
    # A sensor whose x axis points up by p reads +g sin p on x; one rolled by q reads -g sin q on y.
    return Mounting(
        sure=_is_mounting(tilt, floor, turns, evidence.gyro[turning, :2]),
        roll=float(across),
        pitch=-float(along),
        std=math.hypot(ground, floor),
        ground=ground,
        turn=covered,
    )


def _is_mounting(tilt: FloatArray, floor: float, turns: FloatArray, gyro: FloatArray) -> float:
    """Return the probability that what circles show is the mounting, no zero [-].

    A body that turns on a plane turns about its own axis: of an IMU that is tilted (2,) [rad] the
    gyro (k, 2) has as much of the turns (k, 1) on x and y, apart from zeros none of them.
    """
    fits = [fit[0] for fit in block_fits(turns, gyro)]
    var = max(fit.std for fit in fits) ** 2 + CROSS_AXIS**2 + floor**2
    seen = np.array([fit.value for fit in fits])
    odds = float(tilt @ (seen - 0.5 * tilt)) / var
    return probability(math.log(TILT_IS_MOUNTING / (1.0 - TILT_IS_MOUNTING)) + odds)


def check_yaw(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return an IMU whose x axis does not point forward, and the evidence with that mended."""
    starts, curves = accelerometer_signs(evidence)
    if starts * curves < 0 and turns_upright(evidence) > CLEAR_AGREEMENT:
        return [evidence.found('force_axes', 0.95)], replace(evidence, force=None)
    seen = mounting_yaw(evidence)
    if seen is None:
        return [not_checked('mounting', 'no_starts')], evidence
    seen = Estimate(seen.value, math.hypot(seen.std, YAW_MODEL_STD))
    evidence.figures['imu.yaw_deg'] = round(math.degrees(seen.value), 2)
    if abs(seen.value) < LEAST_YAW or seen.sigmas_from(0.0) < YAW_SIGMAS:
        unclear = not_checked('mounting', 'yaw_open', least=math.degrees(YAW_SIGMAS * seen.std))
        return [unclear] if YAW_SIGMAS * seen.std > LEAST_YAW else [], evidence
    mended = evidence.turned(without_yaw(seen) @ evidence.rotation)
    words: dict[str, Any] = {'angle': -math.degrees(seen.value), 'off': math.degrees(seen.std)}
    sure, aside = 0.97, math.sin(seen.value)
    curves = accelerometer_signs(mended)[1]  # turned round or exchanged, starts feel the same
    exchanged = abs(aside) > ALONG_AXIS and curves < 0
    if exchanged and turns_upright(evidence) > CLEAR_AGREEMENT:
        return [evidence.found('force_axes', 0.95)], replace(evidence, force=None)
    if (curves == 0 or exchanged) and max(abs(aside), -math.cos(seen.value)) > ALONG_AXIS:
        alternative = ' and y are exchanged' if abs(aside) > ALONG_AXIS else ' has the wrong sign'
        words['alternative'] = f', or linear_acceleration.x{alternative}: drive circles'
        sure = TURNED_ROUND
    return [mounting_finding('imu_yaw', evidence, mended, words['off'], sure, **words)], mended


def without_yaw(seen: Estimate) -> FloatArray:
    """Return the rotation that takes a yaw off; right angles are meant where they fit."""
    angle, difference = seen.value, math.remainder(seen.value, math.pi / 2.0)
    if abs(difference) < 2.5 * max(seen.std, math.radians(4.0)) and abs(angle) > LEAST_QUARTER:
        angle = round(angle / (math.pi / 2.0)) * math.pi / 2.0
    return np.asarray(Rotation.from_rotvec([0.0, 0.0, -angle]).as_matrix())


def check_upside(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return an IMU that lies on its back or side, and the evidence with it turned upright."""
    fix = gross_tilt(evidence)
    if fix is None or evidence.force is None:
        return [], evidence
    mended, up = evidence.turned(fix @ evidence.rotation), np.median(evidence.force, axis=0)
    force = f'mean specific force ({up[0]:.2f}, {up[1]:.2f}, {up[2]:.2f}) m/s^2'
    sure, alternative, starts = 0.999, '', mounting_yaw(mended)
    std = math.degrees(STEEPEST_MEAN) / 3.0
    if np.allclose(np.diag(fix), [1.0, -1.0, -1.0]):
        if against_reference(evidence):  # of either pair of faults both have the other's turns
            words = {'force': force, 'alternative': f'{OR_REVERSED}: look at the IMU'}
            told = mounting_finding('imu_upside', evidence, mended, std, 0.5, **words)
            return [told], replace(evidence, force=None, gyro=None)
        upright = turns_upright(evidence)
        if upright > CLEAR_AGREEMENT:
            reversed_force = replace(evidence, force=-evidence.force)
            forward = mounting_yaw(reversed_force)
            # Measured backward then it lies on its back, and the sides are swapped.
            if forward is None or abs(forward.value) <= 0.5 * math.pi:
                return [evidence.found('force_reversed', 0.97, force=force)], reversed_force
        if upright > -CLEAR_AGREEMENT:
            sure, alternative = UNTURNED, f'{OR_REVERSED}: drive circles'
        elif starts is not None and abs(starts.value) > 0.5 * math.pi:  # all as in a mirror
            sides = ', and left and right wheels are swapped: look at the IMU'
            sure, alternative = UNTURNED, f'{OR_REVERSED}{sides}'
    if starts is None:  # about another axis it would be upright as well
        sure = 0.5
        alternative += '; which way its x axis points is open: drive brisk starts'
    words = {'force': force, 'alternative': alternative}
    return [mounting_finding('imu_upside', evidence, mended, std, sure, **words)], mended


def check_tilt(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return small wrong mounting angles, and the evidence with the IMU turned as it should be."""
    if evidence.force is None:
        return [], evidence
    tilt = small_tilt(evidence)
    if tilt is None:
        return [not_checked('mounting', 'no_circle')], evidence
    std = math.degrees(tilt.std)
    evidence.figures['imu.tilt_roll_deg'] = round(math.degrees(tilt.roll), 3)
    evidence.figures['imu.tilt_pitch_deg'] = round(math.degrees(tilt.pitch), 3)
    evidence.figures['imu.tilt_std_deg'] = round(std, 3)
    if not tilt.ground <= EVEN_GROUND_STD:  # nan: an axis without a number
        return [not_checked('mounting', 'uneven')], evidence
    size = math.hypot(tilt.roll, tilt.pitch)
    if size < LEAST_MOUNTING or tilt.sigmas < 4.0:
        if tilt.std > EVEN_GROUND_STD:
            return [not_checked('mounting', 'zero_open', least=4.0 * std)], evidence
        return [], evidence
    gravity, biases = evidence.facts.gravity, evidence.facts.sensors.specific_force_bias
    off = gravity * np.array([-tilt.pitch, tilt.roll, 0.0])
    zero = f'sensors.specific_force_bias: [{listed(biases + off, ".2f")}]'
    words = {'size': math.degrees(size), 'zero': math.sin(size) * gravity, 'biases': zero}
    sure = confidence(tilt.sigmas) * max(tilt.sure, 1.0 - tilt.sure)
    if tilt.sure < 0.5:
        words['alternative'] = ', or its axes are tilted'
        worst = int(np.argmax(np.abs(off)))
        evidence.figures['imu.specific_force_bias'] = (biases + off).round(3).tolist()
        words |= {'value': round(float((biases + off)[worst]), 3), 'std': gravity * tilt.std}
        bias = evidence.found('force_bias', sure, **words)
        return [bias], replace(evidence, force=evidence.force - off)
    words['alternative'] = f' (or its accelerometer is off by {words["zero"]:.2g} m/s^2)'
    mended = evidence.turned(tilt.taken_off(evidence.rotation))
    return [mounting_finding('imu_tilt', evidence, mended, std, sure, **words)], mended


def mounting_angles(rotation: FloatArray) -> list[float]:
    """Return roll, pitch, yaw [deg] of a rotation (fixed axes x, then y, then z, as in URDF)."""
    with warnings.catch_warnings():  # of an IMU on its side yaw is left at 0
        warnings.simplefilter('ignore', UserWarning)
        angles: list[float] = Rotation.from_matrix(rotation).as_euler('xyz', degrees=True).tolist()
    return angles


def mounting_finding(
    key: str, evidence: Evidence, mended: Evidence, std: float, sure: float, **figures: Any
) -> Finding:
    """Return the finding that proposes a rotation; its parameter is the angle that changes most."""
    new, old = mounting_angles(mended.rotation), mounting_angles(evidence.rotation)
    change = [abs(math.remainder(a - b, 360.0)) for a, b in zip(new, old, strict=True)]
    most = int(np.argmax(change))
    angles = '  '.join(
        f'{name}: {angle:.2f}'
        for name, angle, difference in zip(MOUNTING, new, change, strict=True)
        if difference >= LEAST_SHOWN
    )
    details = {'value': round(new[most], 3), 'std': std, 'parameter': MOUNTING[most]}
    return evidence.found(key, sure, angles=angles, **details, **figures)


def check_noise_and_zero(evidence: Evidence) -> list[Outcome]:
    """Compare noise and bias with what the rover file states."""
    imu, facts = evidence.recording.imu, evidence.facts
    if imu is None or not facts.known or evidence.gyro is None or evidence.force is None:
        return []
    outcomes, sensors, known = list[Outcome](), facts.sensors, gyro_unit_known(evidence)
    for values, key, unit in (
        (imu.force, 'specific_force_std', 'm/s^2'),
        (imu.rate, 'angular_rate_std', 'rad/s'),
    ):
        change = np.diff(values, axis=0) / math.sqrt(2.0)
        # Vibration comes and goes with driving: the root mean square of the livelier half counts.
        step = max(step_of(column) for column in values.T)
        noise = float(np.median(_upper_rms(change)))
        noise = math.hypot(noise, UNIFORM_STD * step)
        stated = getattr(sensors, key)
        evidence.figures[f'imu.{key}'] = float(f'{noise:.3g}')
        if noise > NOISE_FACTOR * stated:
            details: dict[str, Any] = {'noise': noise, 'stated': stated, 'unit': unit}
            details |= {'value': float(f'{noise:.2g}'), 'parameter': f'sensors.{key}'}
            sure = confidence(noise / stated) * (1.0 if known or values is imu.force else 0.5)
            outcomes.append(evidence.found('imu_noise', sure, **details))
    seen = gyro_bias(evidence)
    if seen is None:
        return [*outcomes, not_checked('zero', 'no_rest', least=LEAST_STANDSTILL)]
    bias, std, noise_std = seen
    evidence.figures['imu.gyro_bias_rad_s'] = [float(f'{b:.3g}') for b in bias]
    worst = int(np.argmax(np.abs(bias)))
    least = max(BIAS_FACTOR * sensors.angular_rate_bias_std, LEAST_GYRO_BIAS)
    # One that changes evenly keeps its sign where it is more than two such deviations.
    if abs(bias[worst]) > max(least, BIAS_SIGMAS * noise_std[worst], 2.0 * std[worst]):
        whole = bias + sensors.angular_rate_bias
        details = {'axis': 'xyz'[worst], 'bias': float(bias[worst]), 'biases': listed(whole, '.5f')}
        details |= {'value': float(f'{whole[worst]:.4g}'), 'std': float(std[worst])}
        details['alternative'] = '' if known else ', or it is in degrees per second: drive a circle'
        outcomes.append(evidence.found('gyro_bias', 0.99 if known else 0.5, **details))
    return outcomes


def _upper_rms(values: FloatArray) -> FloatArray:
    """Return the noise (p,) of the livelier half of the blocks of (k, p) changes."""
    count = min(max(len(values) // 50, 1), 200)
    noise = [spread(part) for part in np.array_split(values, count)]
    return np.median(np.sort(noise, axis=0)[count // 2 :], axis=0)
