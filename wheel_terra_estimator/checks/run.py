# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All checks of a recording, in the order in which one rests on the other.

What an earlier check found is mended before the later ones look, so that one fault gives one
finding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wheel_terra_estimator.checks import (
    alignment,
    geometry,
    imu,
    names,
    rate_noise,
    reference,
    rover_facts,
    sinkage,
    sinkage_order,
    torque,
    transport,
    wheel_rates,
)
from wheel_terra_estimator.checks.evidence import LEAST_MOVING_ROWS, Evidence, gather
from wheel_terra_estimator.checks.finding import CheckReport, Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.configuration.configuration import Configuration


def check_recording(
    recording: Recording,
    configuration: Configuration | None,
    remapped: Sequence[str] = (),
) -> CheckReport:
    """Run all checks.

    Parameters
    ----------
    recording : Recording
        The channels.
    configuration : Configuration or None
        The rover file; without one the names of the joints say what there is.
    remapped : sequence of str
        Topics of the estimator that the user has named himself.
    """
    with np.errstate(all='ignore'):  # damaged recordings hold anything
        report, _ = examine(recording, configuration, remapped)
    return report


def examine(
    recording: Recording,
    configuration: Configuration | None,
    remapped: Sequence[str] = (),
) -> tuple[CheckReport, Evidence | None]:
    """Run all checks and return the evidence with everything mended that was found."""
    report = CheckReport()
    figures = report.figures
    joints = recording.joints.names if recording.joints is not None else ()
    facts = (
        rover_facts.from_configuration(configuration)
        if configuration is not None
        else rover_facts.from_names(joints)
    )
    report.take(names.check_topics(recording, remapped))
    report.take(names.check_wheel_names(recording, facts))
    facts = _with_names_in(facts, report)
    report.take(transport.check_transport(recording, figures))
    recording = _whole_rows(recording)
    rotation = configured_mounting(configuration)
    outcomes, state = imu.check_imu(recording, facts, rotation, figures)
    report.take(outcomes)
    evidence = gather(state.recording, facts, state.rotation)
    if evidence is None or evidence.time.size < LEAST_MOVING_ROWS:
        report.not_checked.append(NotChecked('sign', 'no wheel rates to compare with'))
        return report, None
    if not state.usable_force:
        evidence = replace(evidence, force=None)
    if not state.usable_gyro:
        evidence = replace(evidence, gyro=None)
    evidence = _tilt(evidence, report)
    evidence = _wheels(evidence, report)
    return report, _rest(evidence, report)


def _whole_rows(recording: Recording) -> Recording:
    """Leave out IMU and reference messages with values that are no numbers."""
    measured, velocity = recording.imu, recording.reference
    if measured is not None:
        keep = np.isfinite(measured.force).all(axis=1) & np.isfinite(measured.rate).all(axis=1)
        measured = replace(
            measured,
            stamp=measured.stamp[keep],
            log_time=measured.log_time[keep],
            force=measured.force[keep],
            rate=measured.rate[keep],
            orientation=measured.orientation[keep],
        )
    if velocity is not None:
        keep = np.isfinite(velocity.velocity).all(axis=1)
        velocity = replace(
            velocity,
            stamp=velocity.stamp[keep],
            log_time=velocity.log_time[keep],
            velocity=velocity.velocity[keep],
            yaw_rate=velocity.yaw_rate[keep],
            variance=velocity.variance[keep],
        )
    return replace(recording, imu=measured, reference=velocity)


def configured_mounting(configuration: Configuration | None) -> np.ndarray:
    """Return the (3, 3) rotation that the rover file states for the IMU."""
    if configuration is None:
        return np.eye(3)
    sensors = configuration.sensors
    roll, pitch, yaw = (
        getattr(sensors, f'imu_mounting_{axis}') for axis in ('roll', 'pitch', 'yaw')
    )
    cosine, sine = math.cos(yaw), math.sin(yaw)
    about_z = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ imu.tilt_rotation(roll, pitch))


def _with_names_in(facts: RoverFacts, report: CheckReport) -> RoverFacts:
    """Go on with the names that the recording has."""
    renamed = [f for f in report.findings if f.kind == 'unknown_name' and f.wheel in facts.names]
    if not renamed or not facts.known:
        return facts
    listed = renamed[0].cure.partition('[')[2].rstrip(']')
    return replace(facts, names=tuple(name.strip() for name in listed.split(',')))


def _tilt(evidence: Evidence, report: CheckReport) -> Evidence:
    outcomes, rotation = imu.check_mounting(evidence, report.figures)
    report.take(outcomes)
    return turned(evidence, rotation)


def turned(evidence: Evidence, rotation: np.ndarray) -> Evidence:
    """Return the evidence with another mounting of the IMU."""
    change = rotation @ evidence.rotation.T
    return replace(
        evidence,
        rotation=rotation,
        force=None if evidence.force is None else evidence.force @ change.T,
        gyro=None if evidence.gyro is None else evidence.gyro @ change.T,
    )


def _wheels(evidence: Evidence, report: CheckReport) -> Evidence:
    figures = report.figures
    outcomes, evidence = wheel_rates.check_dead_wheels(evidence)
    report.take(outcomes)
    outcomes, evidence = _gyro_unit(evidence)
    report.take(outcomes)
    unit, evidence = wheel_rates.check_unit(evidence, figures)
    outcomes, evidence = wheel_rates.check_signs(evidence)
    report.take(outcomes)
    if any(isinstance(outcome, NotChecked) for outcome in unit):
        # Wheels that count against each other hide the speed as well.
        unit, evidence = wheel_rates.check_unit(evidence, figures)
    report.take(unit)
    report.take(rate_noise.check_noise(evidence, figures))
    return evidence


def _gyro_unit(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Judge the unit of the gyro; wheels that count backwards hide the turns from it."""
    outcomes, judged = alignment.check_gyro_unit(evidence)
    if not any(isinstance(outcome, NotChecked) for outcome in outcomes):
        return outcomes, judged
    _, mended = wheel_rates.check_signs(evidence)
    again, judged = alignment.check_gyro_unit(mended)
    if not any(isinstance(outcome, Finding) for outcome in again):
        return outcomes, evidence
    recording = replace(evidence.recording, imu=judged.recording.imu)
    return again, replace(evidence, recording=recording, gyro=judged.gyro)


def _rest(evidence: Evidence, report: CheckReport) -> Evidence:
    figures = report.figures
    outcomes, evidence = reference.check_reference(evidence, figures)
    report.take(outcomes)
    outcomes, evidence = torque.check_torque(evidence, figures)
    report.take(outcomes)
    outcomes, rotation = alignment.check_yaw(evidence, figures)
    report.take(outcomes)
    evidence = turned(evidence, rotation)
    report.take(alignment.check_clock(evidence, figures))
    report.take(imu.check_noise_and_zero(evidence, figures))
    report.take(sinkage.check_sinkage(evidence, figures))
    report.take(sinkage_order.check_order(evidence, figures))
    report.take(geometry.check_radius(evidence, figures))
    report.take(geometry.check_track(evidence, figures))
    return evidence
