# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The IMU by itself: units, gravity, placeholders, mounting, zeros, noise.

Convention: specific force, +g on z at rest (REP 145), in a frame that the rover file's mounting
turns into ``base_link``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.faults import STANDARD_GRAVITY, found, listed
from wheel_terra_estimator.checks.felt_motion import (
    LEAST_YAW,
    YAW_SIGMAS,
    felt_motion,
    yaw_of_motion,
)
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import ImuSeries, Recording
from wheel_terra_estimator.checks.statistics import (
    Estimate,
    block_fit,
    confidence,
    correlation,
    moving_mean,
    robust_std,
)
from wheel_terra_estimator.checks.torque import heading_of_torque
from wheel_terra_estimator.checks.trial import Trial, halves

FloatArray = NDArray[np.float64]

GRAVITY_TOLERANCE = 0.1
"""Share by which the mean specific force may differ from gravity (slopes, bias, vibration)."""
GRAVITIES = {'the Moon': 1.62, 'Mars': 3.71, 'the Earth': 9.81}  # [m/s^2]
UPRIGHT_SHARE = 0.5
"""Share of the mean specific force along z that gravity has on a rover [-]."""
UPSIDE_TILT = math.radians(35.0)
"""Mean tilt that no rover drives at [rad]: the mounting is wrong, whatever the slope."""
LEAST_SHOWN = 0.01
"""Change of an angle [deg] below which a cure leaves it out."""
LEAST_MOUNTING = math.radians(1.5)
"""Mounting errors below this [rad] are left to calibration."""
LEAST_TURN = 4.5
"""Heading that a drive has to cover for the mounting to be told from a slope [rad]."""
FLAT_TURN_STD = math.radians(0.1)
"""Part of the mounting that unevenness of the ground leaves open [rad]."""
EVEN_GROUND_STD = math.radians(0.8)
"""Deviation of a tilt [rad] above which the ground was no plane."""
NOISE_FACTOR = 4.0
"""Noise above so many times the stated one is a finding."""
DEGREES = (0.4, 4.0)
"""Noise of a gyro over the one stated, if it were in degrees per second, that tells it is [-]."""
BIAS_FACTOR = 6.0
"""A bias above so many stated deviations is a finding."""
LEAST_GYRO_BIAS = 0.004  # [rad/s]
FROZEN_SHARE = 0.3
"""Share of messages that repeat the one before."""
IMU_ARRAYS = ('stamp', 'log_time', 'force', 'rate', 'orientation')
FROZEN_TIME = 1.0
"""Time that no number of a running IMU stays the same [s]."""


@dataclass(frozen=True)
class ImuState:
    """The IMU after what was found has been mended: what the later checks use."""

    recording: Recording
    rotation: FloatArray
    usable_force: bool = True
    usable_gyro: bool = True


def check_imu(
    recording: Recording, facts: RoverFacts, rotation: FloatArray, figures: dict[str, Any]
) -> tuple[list[Outcome], ImuState]:
    """Return what the IMU says against itself, and the recording with that mended."""
    imu = recording.imu
    state = ImuState(recording, rotation)
    if imu is None or imu.stamp.size < 20:
        return [
            NotChecked(kind, 'no IMU in the recording') for kind in ('mounting', 'gravity')
        ], replace(state, usable_force=False, usable_gyro=False)
    outcomes: list[Outcome] = []
    placeholders, state = _placeholders(imu, state)
    outcomes += placeholders
    frozen, state = _frozen(imu, state)
    outcomes += frozen
    if state.usable_force:
        told, state = _gravity(facts, state, figures)
        outcomes += told
    imu = state.recording.imu
    assert imu is not None
    if state.usable_gyro:
        told, state = _against_orientation(imu, state, figures)
        outcomes += told
    return outcomes, state


def _placeholders(imu: ImuSeries, state: ImuState) -> tuple[list[Outcome], ImuState]:
    outcomes: list[Outcome] = []
    words = {'force': 'linear_acceleration', 'rate': 'angular_velocity'}
    for name, field in words.items():
        values = getattr(imu, name)
        if not np.isfinite(values).any():  # its covariance says that there is none
            blind = 'usable_force' if name == 'force' else 'usable_gyro'
            state = replace(state, **{blind: False})  # type: ignore[arg-type]
        elif not np.any(np.nan_to_num(values)):
            outcomes.append(found('force_zero', imu.topic, 0.999, field=field))
            blind = 'usable_force' if name == 'force' else 'usable_gyro'
            state = replace(state, **{blind: False})  # type: ignore[arg-type]
    orientation = imu.orientation[np.isfinite(imu.orientation).all(axis=1)]
    if orientation.shape[0] > 20:
        moved = np.ptp(orientation, axis=0).max()
        norm = np.linalg.norm(orientation, axis=1)
        if np.median(norm) < 0.5 or (moved == 0.0 and np.ptp(imu.rate, axis=0).max() > 0.0):
            shown = ', '.join(f'{value:g}' for value in orientation[0])
            outcomes.append(found('orientation_placeholder', imu.topic, 0.999, shown=shown))
            blank = np.full_like(imu.orientation, np.nan)
            state = replace(
                state, recording=replace(state.recording, imu=replace(imu, orientation=blank))
            )
    return outcomes, state


def _frozen(imu: ImuSeries, state: ImuState) -> tuple[list[Outcome], ImuState]:
    rows = np.hstack([imu.force, imu.rate])
    same = (np.diff(rows, axis=0) == 0.0).all(axis=1)
    if not state.usable_force or not state.usable_gyro:
        return [], state
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    longest = max((imu.seconds[b] - imu.seconds[a] for a, b in edges.reshape(-1, 2)), default=0.0)
    if np.mean(same) > FROZEN_SHARE:
        how = f'{100 * np.mean(same):.0f} % of the messages repeat the one before'
    elif longest > FROZEN_TIME:
        how = f'all six numbers stay the same for up to {longest:.1f} s'
        alive = ~np.concatenate([[False], same])
        measured = [getattr(imu, name)[alive] for name in IMU_ARRAYS]
        imu = replace(imu, **dict(zip(IMU_ARRAYS, measured, strict=True)))
        state = replace(state, recording=replace(state.recording, imu=imu))
    else:
        return [], state
    return [found('sensor_frozen', imu.topic, 0.99, how=how)], state


def _gravity(
    facts: RoverFacts, state: ImuState, figures: dict[str, Any]
) -> tuple[list[Outcome], ImuState]:
    imu = state.recording.imu
    assert imu is not None
    middle = np.median(imu.force, axis=0)
    size = float(np.linalg.norm(middle))
    upright = abs(float((state.rotation @ middle)[2])) > UPRIGHT_SHARE * size
    figures['imu.mean_specific_force_m_s2'] = round(size, 4)
    gravity = facts.gravity
    if abs(size / gravity - 1.0) <= GRAVITY_TOLERANCE:
        return [], state

    def told(key: str, value: float, **figures: Any) -> Outcome:
        return found(key, imu.topic, 0.98, value=value, size=size, gravity=gravity, **figures)

    in_g = abs(size - 1.0) <= 0.12 and upright  # what a slope leaves may have the same size
    if size < 0.3 * min(gravity, STANDARD_GRAVITY) and not in_g:
        outcome = told('gravity_off', gravity)
        return [outcome], replace(state, usable_force=False)
    for unit, factor in (('g', STANDARD_GRAVITY), ('mg', STANDARD_GRAVITY / 1000.0)):
        if abs(size * factor / gravity - 1.0) <= 0.12:
            outcome = told('force_unit', factor, unit=unit)
            mended = replace(imu, force=imu.force * factor)
            return [outcome], replace(state, recording=replace(state.recording, imu=mended))
    for place, there in GRAVITIES.items():
        if abs(size / there - 1.0) <= GRAVITY_TOLERANCE:
            outcome = told('planet', there, place=place)
            return [outcome], state
    gain = gravity / size
    outcome = told('force_scale', gain)
    mended = replace(imu, force=imu.force * gain)
    return [outcome], replace(state, recording=replace(state.recording, imu=mended))


def _against_orientation(
    imu: ImuSeries, state: ImuState, figures: dict[str, Any]
) -> tuple[list[Outcome], ImuState]:
    """Compare the gyro with the turning of the orientation, axis by axis."""
    time, q = imu.stamp * 1e-9, imu.orientation
    if not np.isfinite(q).all(axis=1).mean() > 0.9 or imu.stamp.size < 200:
        return [], state
    step = max(round(0.5 / max(float(np.median(np.diff(time))), 1e-3)), 1)
    before, after = q[:-step], q[step:]
    dt = time[step:] - time[:-step]
    good = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1) & (dt > 0.0)
    good &= (np.linalg.norm(before, axis=1) > 0.0) & (np.linalg.norm(after, axis=1) > 0.0)
    if not good.any():
        return [], state
    turned = _rotation_between(before[good], after[good]) / dt[good, None]
    total = np.vstack([np.zeros(3), np.cumsum(imu.rate, axis=0)])
    mean = ((total[step:] - total[:-step]) / step)[: good.size][good]
    outcomes: list[Outcome] = []
    rate = imu.rate.copy()
    for axis, name in enumerate('xyz'):
        seen, told = turned[:, axis], mean[:, axis] - np.median(mean[:, axis])
        fit = correlation(seen - np.median(seen), told)
        size = robust_std(seen) if robust_std(seen) > 0 else float(np.std(seen))
        if abs(fit) < 0.6 or float(np.std(seen)) < 0.01 or size == 0.0:
            continue
        gain = float(np.sum(told * seen) / np.sum(seen * seen))
        figures[f'imu.gyro_over_orientation_{name}'] = round(gain, 3)
        if fit < 0.0:
            rate[:, axis] *= -1.0
            outcomes.append(
                found(
                    'gyro_reversed',
                    imu.topic,
                    confidence(6.0 * abs(fit)),
                    value=-1.0,
                    axis=name,
                    against='the orientation',
                )
            )
        if 30.0 < abs(gain) < 110.0:
            rate[:, axis] *= math.pi / 180.0
            if not any(o.kind == 'unit' for o in outcomes):
                outcomes.append(
                    found(
                        'gyro_degrees',
                        imu.topic,
                        0.99,
                        value=math.pi / 180.0,
                        times=abs(gain),
                        how='turning of the orientation',
                    )
                )
    if not outcomes:
        return [], state
    in_degrees = any(o.kind == 'unit' for o in outcomes)
    if in_degrees and not any(o.kind == 'sign' for o in outcomes):
        rate = np.radians(imu.rate)
    mended = replace(imu, rate=rate)
    return outcomes, replace(state, recording=replace(state.recording, imu=mended))


def _rotation_between(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the rotation vectors (k, 3) from one attitude to the next, in the body's frame."""
    turn = Rotation.from_quat(before).inv() * Rotation.from_quat(after)
    return np.asarray(turn.as_rotvec())


# With the wheels ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mounting:
    """What is left of the mounting: small tilt about x and y [rad], each with its deviation."""

    roll: Estimate
    pitch: Estimate
    turn: float  # heading covered [rad]


def gross_tilt(evidence: Evidence) -> FloatArray | None:
    """Return the rotation that brings the mean specific force upright, if it is far from it."""
    if evidence.force is None:
        return None
    up = np.median(evidence.force, axis=0)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    if math.acos(float(np.clip(up[2], -1.0, 1.0))) < UPSIDE_TILT:
        return None
    return _upright(up)


def _upright(up: FloatArray) -> FloatArray:
    """Return a rotation that turns ``up`` into z; half a turn is one about x."""
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine < 0.15 and up[2] < 0.0:
        return np.diag([1.0, -1.0, -1.0])
    angle = math.atan2(sine, float(up[2]))
    return np.asarray(Rotation.from_rotvec(angle * axis / max(sine, 1e-9)).as_matrix())


def gyro_bias(evidence: Evidence) -> tuple[FloatArray, FloatArray, str]:
    """Return the gyro's bias (3,) [rad/s], its deviation, and where it was seen."""
    assert evidence.gyro is not None
    rest = evidence.at_rest
    rows = evidence.gyro[rest]
    if rest.sum() * evidence.period >= 3.0:
        spread = np.array([robust_std(column) for column in rows.T])
        return np.median(rows, axis=0), spread / math.sqrt(max(rest.sum() / 4.0, 1.0)), 'at rest'
    nothing = np.full(3, np.nan)
    return np.zeros(3), nothing, 'nowhere: no standstill'


def small_tilt(evidence: Evidence) -> Mounting | None:
    """Return the tilt of the IMU against the chassis from full turns; None where there are none.

    On a plane the specific force at low speed is ``g (m + R(-psi) s)``: the mounting m stays with
    the rover, the slope s turns with the heading psi.
    """
    if evidence.force is None or evidence.gyro is None:
        return None
    bias, _, _ = gyro_bias(evidence)
    yaw = evidence.gyro[:, 2] - bias[2]
    step = np.diff(evidence.time, prepend=evidence.time[0])
    heading = np.cumsum(yaw * np.minimum(step, 1.0))
    width = max(round(2.0 / evidence.period), 1)
    smooth = moving_mean(yaw, width)
    turning = np.abs(smooth) > 0.5 * float(np.quantile(np.abs(smooth), 0.97))
    covered = float(np.sum(np.abs(yaw[turning]) * np.minimum(step[turning], 1.0)))
    if covered < LEAST_TURN or turning.sum() < 100 or _evenness(heading[turning]) > 0.6:
        return None
    psi, force = heading[turning], evidence.force[turning]
    zero, one = np.zeros(psi.size), np.ones(psi.size)
    design = np.empty((2 * psi.size, 4))
    design[0::2] = np.column_stack([one, zero, np.cos(psi), np.sin(psi)])
    design[1::2] = np.column_stack([zero, one, -np.sin(psi), np.cos(psi)])
    upright = float(np.median(force[:, 2]))
    target = np.empty(2 * psi.size)
    target[0::2] = force[:, 0] / upright
    target[1::2] = force[:, 1] / upright
    along, across = block_fit(design, target)[:2]
    floor = FLAT_TURN_STD
    if evidence.facts.configuration is not None:
        sensors = evidence.facts.configuration.sensors
        floor = math.hypot(floor, sensors.specific_force_bias_std / evidence.facts.gravity)
    # A sensor whose x axis points up by p reads +g sin p on x; one rolled by q reads -g sin q on y.
    return Mounting(
        roll=Estimate(across.value, math.hypot(across.std, floor)),
        pitch=Estimate(-along.value, math.hypot(along.std, floor)),
        turn=covered,
    )


def _evenness(heading: FloatArray) -> float:
    """Return the length of the mean direction: 0 where all headings occur alike."""
    return float(np.hypot(np.cos(heading).mean(), np.sin(heading).mean()))


def yaw_of_imu(evidence: Evidence) -> tuple[Estimate, Trial] | None:
    """Return the yaw of the IMU in ``base_link`` [rad] and its trial, angles off by half."""
    felt = felt_motion(evidence)
    by_motion = yaw_of_motion(*felt) if felt is not None else None
    by_torque = heading_of_torque(evidence)
    told = [e for e in (by_motion, by_torque) if e is not None]
    if not told:
        return None
    best = min(told, key=lambda estimate: estimate.std)
    other = next((e for e in told if e is not best), None)
    if best is by_motion and felt is not None:
        first, second = (complex(felt[0][half].sum()) for half in halves(np.ones(felt[0].size)))
        a, b = float(np.angle(first)), float(np.angle(second))
    else:
        a = b = best.value
    if other is not None:
        b = other.value  # slopes and starts are each other's trial
        a = best.value
    apart = abs(math.remainder(a - b, 2.0 * math.pi))
    return best, Trial(abs(math.remainder(b, 2.0 * math.pi)), apart)


def check_yaw(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], FloatArray]:
    """Return an IMU whose x axis does not point forward, and the rotation that puts it right."""
    told = yaw_of_imu(evidence)
    if told is None:
        reason = 'yaw of the IMU: neither lively starts and stops nor slopes in it'
        return [NotChecked('mounting', reason)], evidence.rotation
    seen, trial = told
    figures['imu.yaw_deg'] = round(math.degrees(seen.value), 2)
    figures['imu.yaw_std_deg'] = round(math.degrees(seen.std), 2)
    if abs(seen.value) < LEAST_YAW or seen.sigmas_from(0.0) < YAW_SIGMAS:
        return [], evidence.rotation
    if not trial.falls:
        reason = 'yaw of the IMU: both halves of the drive say another'
        return [NotChecked('mounting', reason)], evidence.rotation
    rotation = without_yaw(seen) @ evidence.rotation
    std = math.degrees(seen.std)
    finding = mounting_finding(
        'imu_yaw',
        evidence,
        rotation,
        std,
        0.97,
        angle=math.degrees(seen.value),
        off=std,
        trial=Trial(*(math.degrees(angle) for angle in trial[:2])).words('off by', 'degrees'),
    )
    return [finding], rotation


def without_yaw(seen: Estimate) -> FloatArray:
    """Return the rotation that takes a yaw off; right angles are meant where they fit."""
    angle = -seen.value
    quarter = round(angle / (math.pi / 2.0)) * math.pi / 2.0
    if abs(angle - quarter) < 2.5 * max(seen.std, math.radians(4.0)):
        angle = quarter
    return np.asarray(Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix())


def check_mounting(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], FloatArray]:
    """Return wrong mounting angles and the rotation into ``base_link`` that they should give."""
    imu = evidence.recording.imu
    rotation = evidence.rotation
    if imu is None or evidence.force is None:
        return [], rotation
    fix = gross_tilt(evidence)
    if fix is not None:
        rotation = fix @ rotation
        told = {'force': _tilt_in_words(evidence)}
        return [mounting_finding('imu_upside', evidence, rotation, 0.3, 0.999, **told)], rotation
    tilt = small_tilt(evidence)
    if tilt is None:
        reason = 'no full circle in it: mounting not told from slope; drive a circle both ways'
        return [NotChecked('mounting', reason)], rotation
    figures['imu.tilt_roll_deg'] = round(math.degrees(tilt.roll.value), 3)
    figures['imu.tilt_pitch_deg'] = round(math.degrees(tilt.pitch.value), 3)
    figures['imu.tilt_std_deg'] = round(math.degrees(max(tilt.roll.std, tilt.pitch.std)), 3)
    if max(tilt.roll.std, tilt.pitch.std) > EVEN_GROUND_STD:
        reason = 'the circles lie on uneven ground or on the edge of a slope; drive them on a plane'
        return [NotChecked('mounting', reason)], rotation
    sigmas = max(tilt.roll.sigmas_from(0.0), tilt.pitch.sigmas_from(0.0))
    size = math.hypot(tilt.roll.value, tilt.pitch.value)
    if size < LEAST_MOUNTING or sigmas < 4.0:
        return [], rotation
    rotation = tilt_rotation(tilt.roll.value, tilt.pitch.value) @ rotation
    std = math.degrees(max(tilt.roll.std, tilt.pitch.std))
    finding = mounting_finding(
        'imu_tilt', evidence, rotation, std, confidence(sigmas), size=math.degrees(size)
    )
    return [finding], rotation


def tilt_rotation(roll: float, pitch: float) -> FloatArray:
    """Return the small rotation about x, then y, that takes a tilt off."""
    return np.asarray(Rotation.from_euler('xy', [roll, pitch]).as_matrix())


def _tilt_in_words(evidence: Evidence) -> str:
    assert evidence.force is not None
    up = np.median(evidence.force, axis=0)
    return f'mean specific force ({up[0]:.2f}, {up[1]:.2f}, {up[2]:.2f}) m/s^2'


def mounting_angles(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch, yaw [deg] of a rotation (fixed axes x, then y, then z, as in URDF)."""
    roll, pitch, yaw = Rotation.from_matrix(rotation).as_euler('xyz', degrees=True)
    return float(roll), float(pitch), float(yaw)


def mounting_finding(
    key: str, evidence: Evidence, rotation: FloatArray, std: float, sure: float, **figures: Any
) -> Finding:
    """Return the finding that asks for a rotation; its parameter is the angle that changes most."""
    new, old = mounting_angles(rotation), mounting_angles(evidence.rotation)
    change = [abs((a - b + 180.0) % 360.0 - 180.0) for a, b in zip(new, old, strict=True)]
    most = int(np.argmax(change))
    names = [f'sensors.imu_mounting_{axis}_deg' for axis in ('roll', 'pitch', 'yaw')]
    imu = evidence.recording.imu
    assert imu is not None
    angles = '  '.join(
        f'{name}: {angle:.2f}'
        for name, angle, apart in zip(names, new, change, strict=True)
        if apart >= LEAST_SHOWN
    )
    return found(
        key,
        imu.topic,
        sure,
        value=round(new[most], 3),
        std=std,
        parameter=names[most],
        angles=angles,
        **figures,
    )


def check_noise_and_zero(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Compare noise and bias with what the rover file states."""
    imu, configuration = evidence.recording.imu, evidence.facts.configuration
    if imu is None or configuration is None or evidence.gyro is None or evidence.force is None:
        return []
    outcomes: list[Outcome] = []
    sensors = configuration.sensors
    for name, key, unit, stated in (
        ('force', 'specific_force_std', 'm/s^2', sensors.specific_force_std),
        ('rate', 'angular_rate_std', 'rad/s', sensors.angular_rate_std),
    ):
        change = np.diff(getattr(imu, name), axis=0) / math.sqrt(2.0)
        # Vibration comes and goes with driving: the root mean square of the livelier half counts.
        noise = float(np.median([_upper_rms(column) for column in change.T]))
        figures[f'imu.{key}_{unit}'] = float(f'{noise:.3g}')
        if key == 'angular_rate_std' and DEGREES[0] < math.radians(noise) / stated < DEGREES[1]:
            told = {'times': noise / stated, 'how': 'noise of a gyro'}
            value = math.pi / 180.0
            outcomes.append(found('gyro_degrees', imu.topic, 0.8, value=value, **told))
            return outcomes
        if noise > NOISE_FACTOR * stated:
            outcomes.append(
                found(
                    'imu_noise',
                    imu.topic,
                    confidence(noise / stated),
                    value=float(f'{noise:.2g}'),
                    parameter=f'sensors.{key}',
                    noise=noise,
                    stated=stated,
                    unit=unit,
                )
            )
    bias, std, where = gyro_bias(evidence)
    if not np.isfinite(std).all():
        outcomes.append(NotChecked('zero', 'IMU: no standstill of 3 s in it; stand still for 10 s'))
        return outcomes
    figures['imu.gyro_bias_rad_s'] = [float(f'{b:.3g}') for b in bias]
    limit = max(BIAS_FACTOR * sensors.angular_rate_bias_std, LEAST_GYRO_BIAS)
    worst = int(np.argmax(np.abs(bias)))
    if abs(bias[worst]) > limit:
        whole = bias + sensors.angular_rate_bias
        outcomes.append(
            found(
                'gyro_bias',
                imu.topic,
                0.99,
                value=float(f'{whole[worst]:.4g}'),
                std=float(std[worst]),
                axis='xyz'[worst],
                bias=float(bias[worst]),
                where=where,
                biases=listed(whole, '.5f'),
            )
        )
    return outcomes


def _upper_rms(values: FloatArray) -> float:
    blocks = [b for b in np.array_split(values, min(max(values.size // 50, 1), 200)) if b.size]
    deviations = np.array([robust_std(block) for block in blocks])
    return float(np.median(np.sort(deviations)[deviations.size // 2 :]))
