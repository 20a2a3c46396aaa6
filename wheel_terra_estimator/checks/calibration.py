# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a recording tells of a rover's figures: each with its deviation and where it was seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wheel_terra_estimator.checks import geometry, imu, torque
from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import CheckReport, Finding, NotChecked
from wheel_terra_estimator.checks.run import examine
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.errors import UserError

WORTH_CHANGING = 0.2
"""Relative change of a noise or a rate below which the rover file keeps its number [-]."""
NOISE_STD = 0.1
"""Relative deviation of a noise that a drive tells [-]."""
LEAST_SURE = 0.8
"""Confidence from which a cure is written [-]."""
BLUNT_REFERENCE = 0.005
"""Deviation of the radius by the noise of the reference alone, as a share, that is told [-]."""

NO_CENTRE_OF_GRAVITY = NotChecked(
    'mass',
    'centre of gravity: a drive does not tell it (ruts shift the torques as much as the slope '
    'does); weigh the axles on the level and on a ramp',
)


@dataclass(frozen=True)
class Change:
    """A parameter before and after, in the unit of the file, and where it was seen."""

    key: str
    before: Value | None
    after: Value
    std: float | None
    source: str


@dataclass(frozen=True)
class Calibration:
    """What changes, what was not seen and why, and the findings that cannot be calibrated away."""

    changes: tuple[Change, ...]
    not_seen: tuple[NotChecked, ...]
    findings: tuple[Finding, ...]
    figures: dict[str, Any]


def calibrate(
    recording: Recording, configuration: Configuration, remapped: Sequence[str] = ()
) -> Calibration:
    """Return what a recording tells of the rover file; see `check_recording`.

    Raises
    ------
    UserError
        The recording has no usable wheel rates.
    """
    report, evidence = examine(recording, configuration, remapped)
    if evidence is None:
        raise UserError(f'{recording.name}: no wheel rates in it to calibrate with')
    changes = [
        *_directions(report, configuration),
        *_offsets(report, configuration),
        *_mounting(evidence, report),
        *_biases(evidence),
        *_noises(report, configuration),
        *_rates(report, configuration),
    ]
    radius, evidence = _radius(evidence, report)
    changes += radius
    changes += _torques(evidence, report)
    changes += _friction(evidence, report)
    changes += _track(evidence)
    report.not_checked.append(NO_CENTRE_OF_GRAVITY)
    mended = {change.key for change in changes}
    left = [f for f in report.findings if f.parameter not in mended and f.kind != 'mass']
    return Calibration(tuple(changes), tuple(report.not_checked), tuple(left), report.figures)


def _directions(report: CheckReport, configuration: Configuration) -> list[Change]:
    told = next((f for f in _sure(report) if f.fault == 'backwards' and f.wheel), None)
    if told is None:
        return []
    wrong = str(told.wheel).split(', ')
    wheels = configuration.wheels
    after = [
        int(-d) if name in wrong else int(d)
        for name, d in zip(wheels.names, wheels.direction, strict=True)
    ]
    source = f'{told.wheel}: {told.words}'
    return [
        Change('wheels.direction', _before(configuration, 'wheels.direction'), after, None, source)
    ]


def _sure(report: CheckReport) -> list[Finding]:
    """Return the findings whose cure stood its trial and has no rival."""
    return [finding for finding in report.findings if finding.confidence > LEAST_SURE]


def _offsets(report: CheckReport, configuration: Configuration) -> list[Change]:
    return [
        Change(f.parameter, _before(configuration, f.parameter), f.value, f.std, f.words)
        for f in _sure(report)
        if f.parameter is not None and f.value is not None and f.parameter.endswith('_stamp_offset')
    ]


def _before(configuration: Configuration, key: str) -> Value | None:
    return configuration.flat().get(key)


def _mounting(evidence: Evidence, report: CheckReport) -> list[Change]:
    configuration = evidence.facts.configuration
    assert configuration is not None
    rotation, std, source = evidence.rotation, None, 'mean specific force'
    tilt = imu.small_tilt(evidence)
    if tilt is not None and max(tilt.roll.std, tilt.pitch.std) < imu.EVEN_GROUND_STD:
        seen = max(tilt.roll.sigmas_from(0.0), tilt.pitch.sigmas_from(0.0)) > 1.0
        if seen:
            rotation = imu.tilt_rotation(tilt.roll.value, tilt.pitch.value) @ rotation
        std = math.degrees(max(tilt.roll.std, tilt.pitch.std))
        source = f'specific force over {tilt.turn:.0f} rad of turning, slope taken off'
    before = [_before(configuration, f'sensors.imu_mounting_{a}_deg') for a in _AXES]
    changes = []
    for axis, old, new in zip(_AXES, before, imu.mounting_angles(rotation), strict=True):
        assert isinstance(old, (int, float))
        apart = abs((new - old + 180.0) % 360.0 - 180.0)
        if apart > 0.01:
            key = f'sensors.imu_mounting_{axis}_deg'
            changes.append(Change(key, old, round(new, 3), std, source))
    return changes


_AXES = ('roll', 'pitch', 'yaw')


def _biases(evidence: Evidence) -> list[Change]:
    configuration = evidence.facts.configuration
    if evidence.gyro is None or configuration is None:
        return []
    bias, std, where = imu.gyro_bias(evidence)
    if not np.isfinite(std).all():
        return []
    key = 'sensors.angular_rate_bias'
    worst = float(np.max(std))
    whole = bias + configuration.sensors.angular_rate_bias
    after = [round(float(value), 6) for value in whole]
    return [Change(key, _before(configuration, key), after, worst, f'mean of the gyro {where}')]


_NOISES = {
    'sensors.specific_force_std': 'imu.specific_force_std_m/s^2',
    'sensors.angular_rate_std': 'imu.angular_rate_std_rad/s',
    'sensors.wheel_rate_std': 'wheels.rate_noise_rad_s',
    'sensors.sinkage_std': 'sinkage.noise_m',
}


def _noises(report: CheckReport, configuration: Configuration) -> list[Change]:
    source = 'changes from message to message on the move'
    changes = [
        Change(key, stated, float(f'{seen:.3g}'), NOISE_STD * seen, source)
        for key, stated, seen in _worth_changing(_NOISES, report, configuration)
    ]
    if report.figures.get('reference.stated_std_m_s') == 0.0:
        key, seen = 'sensors.reference_std', report.figures['reference.noise_m_s']
        source = 'changes from message to message; the messages state none'
        changes.append(Change(key, _before(configuration, key), seen, NOISE_STD * seen, source))
    return changes


_RATES = {
    'sensors.wheel_odometry_rate': 'joint_states.rate_hz',
    'sensors.imu_rate': 'imu.rate_hz',
    'sensors.sinkage_rate': 'sinkage.rate_hz',
    'sensors.reference_rate': 'reference.rate_hz',
}


def _rates(report: CheckReport, configuration: Configuration) -> list[Change]:
    return [
        Change(key, stated, round(seen, 2), None, 'median period of the stamps')
        for key, stated, seen in _worth_changing(_RATES, report, configuration)
    ]


def _worth_changing(
    figures: Mapping[str, str], report: CheckReport, configuration: Configuration
) -> Iterator[tuple[str, float, float]]:
    """Yield key, stated and seen value of the parameters that are seen to be others."""
    for key, figure in figures.items():
        seen, stated = report.figures.get(figure), _before(configuration, key)
        assert isinstance(stated, (int, float))
        if seen and (not stated or abs(math.log(seen / stated)) > WORTH_CHANGING):
            yield key, stated, seen


def _radius(evidence: Evidence, report: CheckReport) -> tuple[list[Change], Evidence]:
    configuration = evidence.facts.configuration
    assert configuration is not None
    ratio = geometry.radius_ratio(evidence, report.figures)
    told = {finding.fault for finding in report.findings}
    rival = 'reference_scale' in told and 'radius' not in told
    found = not np.allclose(evidence.facts.radius, configuration.wheels.slip_radius)
    if isinstance(ratio, NotChecked) or rival or (ratio.sigmas_from(1.0) < 1.0 and not found):
        return [], evidence
    rolling = evidence.facts.radius * ratio.value
    lugs = configuration.wheels.slip_radius - configuration.wheels.radius
    after = [round(float(value), 5) for value in rolling - lugs]
    std = float(np.mean(evidence.facts.radius)) * ratio.std
    reference = evidence.reference()
    assert reference is not None
    source = f'straight, steady, firm stretches against {reference.topic}'
    if 'reference_scale' in told:
        source += ' (or its scale is off: slip is the same)'
    bound = report.figures['rover.radius_bound_by_reference_m']
    if bound > BLUNT_REFERENCE * float(np.mean(evidence.facts.radius)):
        source += f' (its noise alone allows no better than +- {bound:.2g}: drive faster or longer)'
    change = Change('wheels.radius', _before(configuration, 'wheels.radius'), after, std, source)
    return [change], replace(evidence, facts=replace(evidence.facts, radius=rolling))


def _torques(evidence: Evidence, report: CheckReport) -> list[Change]:
    configuration = evidence.facts.configuration
    assert configuration is not None
    if evidence.force is None or not np.isfinite(evidence.torque).any(axis=0).all():
        return []
    changes = []
    gain = torque.torque_gain(evidence, report.figures)
    if not isinstance(gain, NotChecked) and gain.value > 0.0 and gain.sigmas_from(1.0) > 1.0:
        whole = torque.whole_gain(evidence, gain.value)
        std = float(np.max(whole)) * gain.std / gain.value
        source = 'sum of T/r against mass times specific force on slopes; the mass taken as stated'
        after = [round(float(one), 4) for one in whole]
        changes += _with_deviation(configuration, 'sensors.torque_gain', after, std, source)
    zeros = torque.torque_zeros(evidence)
    if zeros is not None:
        zeros = torque.whole_zeros(evidence, zeros)
        after = [round(zero.value, 3) for zero in zeros]
        std = max(zero.std for zero in zeros)
        source = 'straight stretches driven both ways'
        changes += _with_deviation(configuration, 'sensors.torque_zero', after, std, source)
    return changes


def _friction(evidence: Evidence, report: CheckReport) -> list[Change]:
    configuration = evidence.facts.configuration
    assert configuration is not None
    if not np.isfinite(evidence.torque).any(axis=0).all():
        return []
    friction = torque.drive_friction(evidence)
    if isinstance(friction, NotChecked):
        report.not_checked.append(friction)
        return []
    report.figures['torque.friction_N_m'] = round(friction.value, 4)
    if friction.value < 2.0 * friction.std:
        return []
    keys = {'enabled': True, 'torque': round(friction.value, 4)}
    source = 'torque of the wheels in the air (the reference says that the rover stands)'
    return [
        Change(
            f'effects.drivetrain_friction.{key}',
            _before(configuration, f'effects.drivetrain_friction.{key}'),
            after,
            friction.std if key == 'torque' else None,
            source,
        )
        for key, after in keys.items()
    ]


def _with_deviation(
    configuration: Configuration, key: str, after: Value, std: float, source: str
) -> list[Change]:
    """Return a change and that of its deviation, which the estimator goes by."""
    stated, told = f'{key}_std', float(f'{std:.3g}')
    return [
        Change(key, _before(configuration, key), after, std, source),
        Change(stated, _before(configuration, stated), told, None, f'deviation of {key}'),
    ]


def _track(evidence: Evidence) -> list[Change]:
    configuration = evidence.facts.configuration
    assert configuration is not None
    if geometry.skids(evidence):
        return []
    ratio = geometry.track_ratio(evidence)
    if isinstance(ratio, NotChecked) or ratio.sigmas_from(1.0) < 1.0:
        return []
    after = [round(float(y) * ratio.value, 4) for y in evidence.facts.lateral]
    std = float(np.abs(evidence.facts.lateral).max()) * ratio.std
    source = 'gyro against the difference of the sides in turns'
    return [Change('wheels.y', _before(configuration, 'wheels.y'), after, std, source)]


def as_file(calibration: Calibration, configuration: Configuration, recording: str) -> str:
    """Return the rover file as text."""
    from wheel_terra_estimator.configuration import ros_yaml

    changes = {change.key: change for change in calibration.changes}
    values = configuration.flat()
    keys = [key for key in values if key in configuration.stated or key in changes]
    keys += [key for key in changes if key not in values]
    lines = [f'# Calibrated from the recording {recording}.', '#']
    lines += ['# Not seen in it, and left as it was:'] if calibration.not_seen else []
    lines += [f'#   {entry.kind}: {entry.reason}' for entry in calibration.not_seen]
    lines += ['/**:', '  ros__parameters:']
    for key in keys:
        told = changes.get(key)
        value = told.after if told is not None else values[key]
        if told is not None:
            lines.append(f'    # {_in_words(told)}')
        lines.append(f'    {key}: {ros_yaml.format_value(_as_declared(value, values.get(key)))}')
    return '\n'.join(lines) + '\n'


def _as_declared(value: Value, before: Value | None) -> Value:
    """Return a value with the number type that the rover file had."""
    if isinstance(value, list) and isinstance(before, list) and isinstance(before[0], float):
        return [float(item) for item in value]
    return (
        float(value) if isinstance(before, float) and not isinstance(value, (str, list)) else value
    )


def _in_words(change: Change) -> str:
    from wheel_terra_estimator.configuration.ros_yaml import format_value

    before = 'not stated' if change.before is None else format_value(change.before)
    std = '' if change.std is None else f' +- {change.std:.2g}'
    return f'before {before}, now {format_value(change.after)}{std}: {change.source}'


def summary(calibration: Calibration) -> list[str]:
    """Return lines for the terminal."""
    lines = [f'  {change.key}: {_in_words(change)}' for change in calibration.changes]
    lines += [f'  not seen: {entry.kind}: {entry.reason}' for entry in calibration.not_seen]
    return lines + [f'  still wrong: {finding}' for finding in calibration.findings]
