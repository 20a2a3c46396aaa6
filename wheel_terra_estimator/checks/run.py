# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All checks of a recording, in the order in which one rests on the other.

What an earlier check found is mended before the later ones look, so that one fault gives one
finding. Each check runs apart: one that fails leaves what it was given as it was.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wheel_terra_estimator.checks import (
    clocks,
    geometry,
    imu,
    names,
    reference,
    rover_facts,
    sinkage,
    sinkage_order,
    torque,
    transport,
    turning,
    wheel_rates,
)
from wheel_terra_estimator.checks.evidence import LEAST_MOVING_ROWS, Evidence, gather
from wheel_terra_estimator.checks.faults import RANK
from wheel_terra_estimator.checks.finding import (
    INTERNAL_ERROR,
    CheckReport,
    NotChecked,
    Outcome,
)
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import ImuSeries, Recording, VelocitySeries
from wheel_terra_estimator.configuration.configuration import Configuration

_LOGGER = logging.getLogger(__name__)
Result = TypeVar('Result')
Series = TypeVar('Series', ImuSeries, VelocitySeries)


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
    return examine(recording, configuration, remapped)[0]


def examine(
    recording: Recording,
    configuration: Configuration | None,
    remapped: Sequence[str] = (),
) -> tuple[CheckReport, Evidence | None]:
    """Run all checks and return the evidence with everything mended that was found."""
    report = CheckReport()
    with np.errstate(all='ignore'), warnings.catch_warnings():  # damaged recordings hold anything
        warnings.simplefilter('ignore', RuntimeWarning)
        evidence = run_apart(
            report, 'sign', None, lambda: _examined(recording, configuration, remapped, report)
        )
    report.findings.sort(key=lambda finding: RANK[finding.fault])
    return report, evidence


def run_apart(
    report: CheckReport, kind: str, otherwise: Result, check: Callable[[], Result]
) -> Result:
    """Return what a check returns; if it fails, say that it did and return what was given."""
    try:
        return check()
    except Exception:
        _LOGGER.debug('check for %s', kind, exc_info=True)
        report.not_checked.append(NotChecked(kind, INTERNAL_ERROR))
        return otherwise


def _examined(
    recording: Recording,
    configuration: Configuration | None,
    remapped: Sequence[str],
    report: CheckReport,
) -> Evidence | None:
    recording = clocks.corrected(recording, configuration)
    figures = report.figures
    joints = recording.joints.names if recording.joints is not None else ()
    facts = (
        rover_facts.from_configuration(configuration)
        if configuration is not None
        else rover_facts.from_names(joints)
    )

    def take(kind: str, check: Callable[[], list[Outcome]]) -> None:
        report.take(run_apart(report, kind, [], check))

    take('drop_outs', lambda: names.check_required(recording, configuration))
    take('unknown_name', lambda: names.check_topics(recording, remapped))
    take('missing_wheel', lambda: names.check_wheel_names(recording, facts))
    facts = _with_names_in(facts, report)
    unread: tuple[list[Outcome], float] = [], 0.0
    told, offset = run_apart(
        report,
        'order',
        unread,
        lambda: transport.check_transport(recording, configuration, figures),
    )
    report.take(told)
    recording = _whole_rows(recording)
    if offset and recording.imu is not None:
        recording = replace(recording, imu=clocks.shifted(recording.imu, round(offset * 1e9)))
    rotation = configured_mounting(configuration)
    unjudged: tuple[list[Outcome], imu.ImuState] = [], imu.ImuState(recording, rotation)
    outcomes, state = run_apart(
        report,
        'gravity',
        unjudged,
        lambda: imu.check_imu(recording, facts, rotation, figures),
    )
    report.take(outcomes)
    evidence = gather(state.recording, facts, state.rotation)
    if evidence is None or evidence.time.size < LEAST_MOVING_ROWS:
        report.not_checked.append(NotChecked('sign', 'no wheel rates to compare with'))
        return None
    if not state.usable_force:
        evidence = replace(evidence, force=None)
    if not state.usable_gyro:
        evidence = replace(evidence, gyro=None)
    return _against_each_other(evidence, report)


def _against_each_other(evidence: Evidence, report: CheckReport) -> Evidence:
    """Run the checks that hold one channel against another; return the evidence mended."""
    figures = report.figures

    def mend(kind: str, check: Callable[[Evidence], tuple[list[Outcome], Evidence]]) -> None:
        nonlocal evidence
        unchanged: tuple[list[Outcome], Evidence] = [], evidence
        outcomes, evidence = run_apart(report, kind, unchanged, lambda: check(evidence))
        report.take(outcomes)

    def look(kind: str, check: Callable[..., list[Outcome]]) -> None:
        report.take(run_apart(report, kind, [], lambda: check(evidence, figures)))

    mend('mounting', lambda e: _tilt(e, figures))
    mend('missing_wheel', wheel_rates.check_dead_wheels)
    mend('sign', turning.check_signs)
    mend('unit', turning.check_gyro_unit)
    mend('unit', lambda e: wheel_rates.check_unit(e, figures))
    look('noise', wheel_rates.check_noise)
    mend('mounting', reference.check_frame)
    mend('gain', lambda e: torque.check_torque(e, figures))
    mend('mounting', lambda e: _yaw(e, figures))
    mend('delay', lambda e: clocks.check_clocks(e, figures))
    look('covariance', reference.check_quality)
    look('zero', imu.check_noise_and_zero)
    look('zero', sinkage.check_sinkage)
    look('exchanged_wheels', sinkage_order.check_order)
    mend('radius', lambda e: geometry.check_radius(e, figures))
    look('track', geometry.check_track)
    return evidence


def _whole_rows(recording: Recording) -> Recording:
    """Leave out IMU and reference messages with values that are no numbers."""
    imu, velocity = recording.imu, recording.reference
    if imu is not None:
        both = np.hstack([imu.force, imu.rate])
        there = np.isfinite(both).any(axis=0)  # a field may say that it is not there
        imu = _rows(imu, np.isfinite(both[:, there]))
    if velocity is not None:
        velocity = _rows(velocity, np.isfinite(velocity.velocity))
    return replace(recording, imu=imu, reference=velocity)


def _rows(series: Series, known: NDArray[np.bool_]) -> Series | None:
    """Return the rows of a channel in which all is known; None for none."""
    kept = known.all(axis=1)
    arrays = {f.name: getattr(series, f.name) for f in fields(series) if f.name != 'topic'}
    rows = {name: values[kept] for name, values in arrays.items()}
    return replace(series, **rows) if kept.any() else None


def configured_mounting(configuration: Configuration | None) -> np.ndarray:
    """Return the (3, 3) rotation that the rover file states for the IMU."""
    if configuration is None:
        return np.eye(3)
    sensors = configuration.sensors
    roll, pitch, yaw = (
        getattr(sensors, f'imu_mounting_{axis}') for axis in ('roll', 'pitch', 'yaw')
    )
    return np.asarray(Rotation.from_euler('xyz', [roll, pitch, yaw]).as_matrix())


def _with_names_in(facts: RoverFacts, report: CheckReport) -> RoverFacts:
    """Go on with the names that the recording has."""
    renamed = [f for f in report.findings if f.kind == 'unknown_name' and f.wheel in facts.names]
    if not renamed or not facts.known:
        return facts
    listed = renamed[0].cure.partition('[')[2].rstrip(']')
    return replace(facts, names=tuple(name.strip() for name in listed.split(',')))


def _tilt(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    outcomes, rotation = imu.check_mounting(evidence, figures)
    return outcomes, turned(evidence, rotation)


def _yaw(evidence: Evidence, figures: dict[str, Any]) -> tuple[list[Outcome], Evidence]:
    outcomes, rotation = imu.check_yaw(evidence, figures)
    return outcomes, turned(evidence, rotation)


def turned(evidence: Evidence, rotation: np.ndarray) -> Evidence:
    """Return the evidence with another mounting of the IMU."""
    change = rotation @ evidence.rotation.T
    return replace(
        evidence,
        rotation=rotation,
        force=None if evidence.force is None else evidence.force @ change.T,
        gyro=None if evidence.gyro is None else evidence.gyro @ change.T,
    )
