# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a recording tells of a rover's figures: each with its deviation and where it was seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from wheel_terra_estimator.checks import geometry, imu, torque, turning
from wheel_terra_estimator.checks.evidence import EVEN_GROUND_STD, Evidence
from wheel_terra_estimator.checks.finding import CheckReport, Finding, NotChecked, not_checked
from wheel_terra_estimator.checks.run import examine
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.ros_yaml import Value, as_text, format_value
from wheel_terra_estimator.errors import UserError

WORTH_CHANGING = 0.2  # relative change of a rate that is written, at least [-]
NOISIER = 3.0  # noise over the one stated that is written, at least [-]: less may be motion
LIVED_WITH = ('noise', 'covariance', 'jumps', 'drop_outs')  # kinds beside which noise is written
NOISE_STD = 0.1  # relative deviation of a noise that a drive tells [-]
LEAST_SURE = 0.8  # confidence from which a cure is written [-]
CLEAR = 2.0  # deviations by which a number is off, from which another is written [-]
CLEAR_ZERO = 2.5  # the same of the largest torque zero, over the largest of their deviations [-]


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


def calibrate(
    recording: Recording, configuration: Configuration, remapped: Sequence[str] = ()
) -> Calibration:
    """Return what a recording tells of the rover file; without wheel rates a `UserError`."""
    report, evidence = examine(recording, configuration, remapped)
    if evidence is None:
        raise UserError(f'{recording.name}: hardly any wheel rates; record a longer drive')
    changes = _Changes(configuration.flat())
    _directions(changes, report, configuration)
    for finding in _sure(report):
        read_off = finding.fault.endswith('_offset') or finding.fault == 'planet'
        if read_off and finding.parameter and finding.value is not None:
            changes.add(finding.parameter, finding.value, finding.std, finding.words)
    _biases(changes, _mounting(changes, evidence, report), report)
    _radius(changes, evidence, report)
    if np.isfinite(evidence.torque).any(axis=0).all():
        _torques(changes, evidence)
    _track(changes, evidence)
    _noises_and_rates(changes, report, configuration)
    report.not_checked.append(not_checked('mass', 'centre'))
    left = (f for f in report.findings if f.parameter not in changes and f.fault != 'mass')
    return Calibration(tuple(changes.values()), tuple(report.not_checked), tuple(left))


class _Changes(dict[str, Change]):
    """The changes so far, by key; ``before``: the values of the rover file."""

    def __init__(self, before: Mapping[str, Any]) -> None:
        self.before = before

    def add(self, key: str, after: Value, std: float | None, source: str) -> None:
        """Note a change."""
        self[key] = Change(key, self.before.get(key), after, std, source)


def _sure(report: CheckReport) -> list[Finding]:
    """Return the findings whose cure stood its trial and has no alternative."""
    return [finding for finding in report.findings if finding.confidence > LEAST_SURE]


def _directions(changes: _Changes, report: CheckReport, configuration: Configuration) -> None:
    finding = next((f for f in _sure(report) if f.fault == 'backwards' and f.wheel), None)
    if finding is None:
        return
    wheels, wrong = configuration.wheels, str(finding.wheel).split(', ')
    after = [
        int(-d) if name in wrong else int(d)
        for name, d in zip(wheels.names, wheels.direction, strict=True)
    ]
    changes.add('wheels.direction', after, None, f'{finding.wheel}: {finding.words}')


def _mounting(changes: _Changes, evidence: Evidence, report: CheckReport) -> Evidence:
    """Note the mounting; return the evidence in the frame of the file that is written."""
    findings = [f for f in report.findings if f.parameter in imu.MOUNTING]
    if any(f.confidence <= imu.UNTURNED for f in findings):  # an alternative may be it
        evidence, findings = evidence.turned(evidence.facts.mounting), []
    finding = findings[0] if findings else None
    rotation, std = evidence.rotation, finding.std if finding is not None else None
    source = finding.words if finding is not None else 'mean specific force'
    tilt = imu.small_tilt(evidence)
    if tilt is not None and tilt.std < EVEN_GROUND_STD:
        if tilt.sigmas > CLEAR and tilt.sure > LEAST_SURE:
            rotation = tilt.taken_off(rotation)
        std = math.degrees(tilt.std)
        source = f'specific force over {tilt.turn:.0f} rad of turning, slope removed'
    for key, new in zip(imu.MOUNTING, imu.mounting_angles(rotation), strict=True):
        if abs(math.remainder(new - changes.before[key], 360.0)) > imu.LEAST_SHOWN:
            changes.add(key, round(new, 3), std, source)
    return evidence


def _biases(changes: _Changes, evidence: Evidence, report: CheckReport) -> None:
    finding = next((f for f in _sure(report) if f.fault == 'force_bias'), None)
    if finding is not None:
        off = report.figures['imu.specific_force_bias']
        changes.add(str(finding.parameter), off, finding.std, finding.words)
    seen = imu.gyro_bias(evidence)
    if seen is not None and not turning.gyro_unit_known(evidence):
        report.not_checked.append(not_checked('zero', 'gyro_unit'))
    elif seen is not None:
        whole = (seen[0] + evidence.facts.sensors.angular_rate_bias).round(6).tolist()
        source = 'mean of the gyro at rest'
        changes.add('sensors.angular_rate_bias', whole, float(np.max(seen[1])), source)


SEEN = {
    'sensors.specific_force_std': 'imu.specific_force_std',
    'sensors.angular_rate_std': 'imu.angular_rate_std',
    'sensors.wheel_rate_std': 'wheels.rate_noise_rad_s',
    'sensors.sinkage_std': 'sinkage.noise_m',
    'sensors.wheel_odometry_rate': 'joints.rate_hz',
    'sensors.imu_rate': 'imu.rate_hz',
    'sensors.sinkage_rate': 'sinkage.rate_hz',
    'sensors.reference_rate': 'reference.rate_hz',
}
"""Noises and rates of the sensors -> the figure that a recording has of them."""
NOISES_OF_IMU = {'sensors.specific_force_std', 'sensors.angular_rate_std'}


def _noises_and_rates(changes: _Changes, report: CheckReport, configuration: Configuration) -> None:
    """Note rates, and noises unless something else stays wrong, which they would weigh more.

    The rate of the IMU makes a density of its noise: a default of both stays as it is.
    """
    figures = dict(SEEN)
    if report.figures.get('reference.stated_std_m_s') == 0.0:  # the messages state none
        figures['sensors.reference_std'] = 'reference.noise_m_s'
    told = {f.parameter for f in report.findings}
    doubtful = told - {f.parameter for f in _sure(report)}
    wrong = any(f.parameter not in changes and f.kind not in LIVED_WITH for f in report.findings)
    if wrong:
        report.not_checked.append(not_checked('noise', 'others'))
    for key, figure in figures.items():
        if key in doubtful:
            continue
        seen, stated = report.figures.get(figure), changes.before[key]
        if not seen or not math.isfinite(seen):
            continue
        if key.endswith('_std'):
            clear = seen > NOISIER * stated or key in told
            if wrong or not clear:  # biases do not jump from message to message
                continue
            source = 'changes from message to message on the move'
            changes.add(key, float(f'{seen:.3g}'), NOISE_STD * seen, source)
        elif key == 'sensors.imu_rate' and not NOISES_OF_IMU & {*configuration.stated, *changes}:
            continue
        elif abs(math.log(seen / stated)) > WORTH_CHANGING:
            changes.add(key, round(seen, 2), None, 'median period of the stamps')


def _radius(changes: _Changes, evidence: Evidence, report: CheckReport) -> None:
    stated, rolling = evidence.facts.configuration.wheels, evidence.facts.radius
    radius = next((finding for finding in _sure(report) if finding.fault == 'radius'), None)
    source = 'straight stretches against the other wheels'
    if radius is not None and evidence.recording.reference is not None:
        source = f'straight, steady, firm stretches against {evidence.recording.reference.topic}'
    if not np.allclose(rolling, stated.slip_radius):
        lugs, std = stated.slip_radius - stated.radius, radius.std if radius is not None else None
        changes.add('wheels.radius', (rolling - lugs).round(5).tolist(), std, source)


def _torques(changes: _Changes, evidence: Evidence) -> None:
    if evidence.force is None:
        return
    zeros = torque.torque_zeros(evidence)
    if zeros is None or torque.like_a_pitch(evidence, zeros):
        return
    # Loads that slopes shift look like zeros of single wheels, whose own deviations are small.
    largest_std = max(zero.std for zero in zeros)
    if max(abs(zero.value) for zero in zeros) > CLEAR_ZERO * largest_std:
        zeros = torque.whole_zeros(evidence, zeros)
        after, std = [round(zero.value, 3) for zero in zeros], max(zero.std for zero in zeros)
        source = 'straight stretches driven both ways'
        key = 'sensors.torque_zero'
        changes.add(key, after, std, source)
        changes.add(f'{key}_std', float(f'{std:.3g}'), None, f'deviation of {key}')


def _track(changes: _Changes, evidence: Evidence) -> None:
    track = None if turning.skids(evidence) else geometry.rolling_track(evidence)
    sure = isinstance(track, geometry.TriedRatio) and track.alone
    if isinstance(track, geometry.TriedRatio) and sure and track.ratio.sigmas_from(1.0) > CLEAR:
        lateral = evidence.facts.configuration.wheels.y  # in which no side is swapped
        std = float(np.abs(lateral).max()) * track.ratio.std
        source = 'gyro against the difference of the sides in turns'
        changes.add('wheels.y', (lateral * track.ratio.value).round(4).tolist(), std, source)


def as_file(
    calibration: Calibration,
    configuration: Configuration,
    recording: str,
    guessed: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Return the rover file as text; ``guessed``: what marks the keys that init guessed."""
    changes = {change.key: change for change in calibration.changes}
    values = configuration.flat()
    keys = [key for key in values if key in configuration.stated or key in changes]
    keys += [key for key in changes if key not in values]
    lines = [f'Calibrated from the recording {recording}.', '']
    lines += ['Could not be determined from it, left unchanged:'] if calibration.not_seen else []
    lines += [f'  {entry.kind}: {entry.reason}' for entry in calibration.not_seen]
    lines += ['Still wrong:'] if calibration.findings else []
    lines += [f'  {finding}' for finding in calibration.findings]
    after = {key: changes[key].after if key in changes else values[key] for key in keys}
    declared = {key: _as_declared(value, values.get(key)) for key, value in after.items()}
    notes = {**guessed, **{key: _in_words(change) for key, change in changes.items()}}
    return as_text(declared, '\n'.join(lines), notes)


def _as_declared(value: Value, before: Value | None) -> Value:
    """Return a value with the number type that the rover file had."""
    if isinstance(value, list) and isinstance(before, list) and isinstance(before[0], float):
        return [float(item) for item in value]
    return float(value) if isinstance(before, float) and isinstance(value, int) else value


def _in_words(change: Change) -> str:
    before = 'not stated' if change.before is None else format_value(change.before)
    std = '' if change.std is None else f' +- {change.std:.2g}'
    return f'was {before}, now {format_value(change.after)}{std}: {change.source}'


def summary(calibration: Calibration) -> list[str]:
    """Return lines for the terminal."""
    lines = [f'  {change.key}: {_in_words(change)}' for change in calibration.changes]
    lines += [f'  not determined: {entry.kind}: {entry.reason}' for entry in calibration.not_seen]
    return lines + [f'  still wrong: {finding}' for finding in calibration.findings]
