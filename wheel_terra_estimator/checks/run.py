# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All checks of a recording, in the order in which one rests on the other.

What an earlier check found is mended before the later ones look, so that one fault gives one
finding. Each check runs apart: one that fails leaves what it was given as it was.
"""

from __future__ import annotations

import logging
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import ModuleType
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks import (
    clocks,
    geometry,
    imu,
    names,
    reference,
    repeats,
    rover_facts,
    sinkage,
    torque,
    turning,
    wheel_rates,
)
from wheel_terra_estimator.checks.evidence import LEAST_MOVING_ROWS, Evidence, gather
from wheel_terra_estimator.checks.finding import (
    INTERNAL_ERROR,
    RANK,
    CheckReport,
    Finding,
    NotChecked,
    Outcome,
    found,
    not_checked,
)
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import Recording, Series, rows_of
from wheel_terra_estimator.checks.statistics import moving_mean
from wheel_terra_estimator.configuration.configuration import Configuration

LEAST_LOST = 0.01  # share of messages that are lost, or with nan, that is told [-]
LEAST_RIM_SPEED = 0.005  # rim speed that no drive stays below [m/s]
LEAST_GOING = 0.02  # mean of half a minute that no wander of a satellite's position makes [m/s]
LEAST_TURNING = 0.05  # mean of a second that no gyro of a standing rover shows [rad/s]
_LOGGER = logging.getLogger(__name__)
Result = TypeVar('Result')
Given = TypeVar('Given')


def check_recording(
    recording: Recording, configuration: Configuration | None, remapped: Sequence[str] = ()
) -> CheckReport:
    """Run all checks of a recording.

    Without a rover file the names of the joints say what there is. Topics that the user has named
    himself are ``remapped``.
    """
    return examine(recording, configuration, remapped)[0]


def examine(
    recording: Recording, configuration: Configuration | None, remapped: Sequence[str] = ()
) -> tuple[CheckReport, Evidence | None]:
    """Run all checks and return the evidence with everything mended that was found."""
    report = CheckReport()
    with np.errstate(all='ignore'), warnings.catch_warnings():  # damaged recordings hold anything
        warnings.simplefilter('ignore', RuntimeWarning)
        evidence = run_apart(
            report, 'sign', None, lambda: _examined(recording, configuration, remapped, report)
        )
    report.findings = _without_following(report)
    report.findings.sort(key=lambda finding: RANK.get(finding.fault, 0))
    return report, evidence


def _without_following(report: CheckReport) -> list[Finding]:
    """Leave out a scale of the torques that is no other than that of the radius below them."""
    figures, findings = report.figures, report.findings
    apart = abs(figures.get('torque.gain', 0.0) - figures.get('rover.radius_ratio', math.inf))
    radius = any(finding.fault == 'radius' for finding in findings)
    if not radius or apart > 3.0 * figures.get('torque.gain_std', 0.0):
        return findings
    return [f for f in findings if f.fault not in ('torque_gain', 'mass')]


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
    if configuration is not None:
        facts = rover_facts.from_configuration(configuration)
    else:
        facts = rover_facts.from_names(recording.joints.names if recording.joints else ())
    recording = clocks.corrected(recording, facts)
    own = facts.configuration.wheel_odometry
    mended = Mended(report)
    topic = recording.joints.topic if recording.joints is not None else ''
    if recording.lost > LEAST_LOST:
        report.take([found('damaged', topic, 0.99, share=100.0 * recording.lost)])
    mended('drop_outs', recording, lambda given: names.check_required(given, facts))
    mended('unknown_name', recording, lambda given: names.check_topics(given, remapped, own))
    checks = AGAINST_EACH_OTHER
    if own == 'odom':  # in which radius and track are its publisher's
        recording = names.of_rims(recording, facts)
        checks = tuple(check for check in checks if check[1] is not geometry)
        report.not_checked += [not_checked('radius', 'odom'), not_checked('track', 'odom')]
    stated, read = facts, recording
    facts = mended('missing_wheel', stated, lambda given: names.check_wheel_names(read, given))
    recording = mended('unit', recording, clocks.check_time_unit)
    recording = mended('jumps', recording, clocks.check_publishers)
    recording = mended(
        'order', recording, lambda given: clocks.check_transport(given, stated, report.figures)
    )
    recording = mended('placeholder', recording, _whole_rows)
    evidence = against_each_other(recording, facts, checks, mended)
    if evidence is None:
        report.not_checked.append(not_checked('sign', 'no_rates'))
    if not report.findings:
        report.take(_standing(evidence) if evidence else [found('no_drive', topic, 0.99)])
    return evidence


def _standing(evidence: Evidence) -> list[Outcome]:
    """Return what to say where no wheel turns; by means over a second, since noise turns none."""
    width = evidence.rows_in(1.0)
    means = [np.abs(moving_mean(np.nan_to_num(speed), width)) for speed in evidence.speed.T]
    if np.quantile(np.max(means, axis=0), 0.99) >= LEAST_RIM_SPEED:
        return []
    velocity, gyro = evidence.recording.reference, evidence.gyro
    goes = turns = 0.0
    if velocity is not None and velocity.period > 0.0:
        forward = np.nan_to_num(velocity.velocity[:, 0])
        goes = float(np.abs(moving_mean(forward, round(30.0 / velocity.period))).max())
    if gyro is not None:
        yaw_rate = np.nan_to_num(gyro[:, 2])
        turns = float(np.quantile(np.abs(moving_mean(yaw_rate - np.median(yaw_rate), width)), 0.99))
    if goes > LEAST_GOING or turns > LEAST_TURNING:
        return [evidence.found('no_drive', 0.99)]
    return [not_checked('sign', 'hardly_moves')]


class Mended:
    """Takes what each check finds; gives back what it was given, with that mended."""

    def __init__(self, report: CheckReport) -> None:
        self.report = report
        self.by_check: dict[str, list[Outcome]] = {}  # name of each check that ran

    def __call__(
        self,
        kind: str,
        given: Given,
        check: Callable[[Given], list[Outcome] | tuple[list[Outcome], Given]],
        name: str = '',
    ) -> Given:
        """Run a check of a kind of fault on what is given, and note what it said by its name."""
        nothing: list[Outcome] | tuple[list[Outcome], Given] = []
        result = run_apart(self.report, kind, nothing, lambda: check(given))
        outcomes, given = result if isinstance(result, tuple) else (result, given)
        self.report.take(outcomes)
        self.by_check[name] = outcomes
        return given


def against_each_other(
    recording: Recording, facts: RoverFacts, checks: Sequence[Check], mended: Mended
) -> Evidence | None:
    """Hold one channel against another; None where hardly any wheel rates are."""
    recording = mended('gravity', recording, lambda given: imu.check_imu(given, facts), 'check_imu')
    planet = next((f.value for f in mended.report.findings if f.fault == 'planet'), None)
    facts = replace(facts, gravity=planet or facts.gravity)
    evidence = gather(recording, facts, mended.report.figures)
    if evidence is None or np.isfinite(evidence.rate).any(axis=1).sum() < LEAST_MOVING_ROWS:
        return None
    for kind, module, check, *_ in checks:
        evidence = mended(kind, evidence, getattr(module, check), check)
    return evidence


DRIVING = True  # half a minute can tell it
Check: TypeAlias = 'tuple[str, ModuleType, str] | tuple[str, ModuleType, str, bool]'
"""Kind of what it finds, module and name of a check; whether it also runs while driving."""
AGAINST_EACH_OTHER: tuple[Check, ...] = (
    ('mounting', imu, 'check_upside', DRIVING),
    ('jumps', wheel_rates, 'check_zeros'),
    ('jumps', wheel_rates, 'check_limits', DRIVING),
    ('frozen', repeats, 'check_repeats', DRIVING),
    ('missing_wheel', wheel_rates, 'check_dead_wheels', DRIVING),
    ('frozen', wheel_rates, 'check_copies', DRIVING),
    ('jumps', wheel_rates, 'check_wild'),
    ('unit', turning, 'check_steering_unit'),
    ('radius', wheel_rates, 'check_scales'),
    ('swapped_sides', turning, 'check_axes'),
    ('sign', reference, 'check_unsigned', DRIVING),
    ('sign', turning, 'check_signs', DRIVING),
    ('sign', reference, 'check_sense', DRIVING),
    ('sign', turning, 'check_steering'),
    ('placeholder', reference, 'check_source', DRIVING),
    ('unit', turning, 'check_gyro_unit', DRIVING),
    ('unit', wheel_rates, 'check_unit', DRIVING),
    ('noise', wheel_rates, 'check_noise'),
    ('mounting', imu, 'check_tilt'),
    ('mounting', reference, 'check_frame', DRIVING),
    ('unit', reference, 'check_reference_unit', DRIVING),
    ('mounting', imu, 'check_yaw', DRIVING),
    ('gain', torque, 'check_torque', DRIVING),
    ('jumps', reference, 'check_jumps', DRIVING),
    ('delay', clocks, 'check_clocks', DRIVING),
    ('covariance', reference, 'check_covariance'),
    ('gain', turning, 'check_gyro_scale'),
    ('zero', imu, 'check_noise_and_zero'),
    ('zero', sinkage, 'check_sinkage', DRIVING),
    ('radius', geometry, 'check_radius'),
    ('track', geometry, 'check_track'),
)
"""Checks that hold one channel against another, in order."""
WHILE_DRIVING = tuple(check for check in AGAINST_EACH_OTHER if check[3:])


def _whole_rows(recording: Recording) -> tuple[list[Outcome], Recording]:
    """Leave out IMU and reference messages with values that are no numbers."""
    imu, velocity, outcomes = recording.imu, recording.reference, list[Outcome]()
    if imu is not None:
        both = np.hstack([imu.force, imu.rate])
        known = np.isfinite(both)
        there = np.asarray(known.any(axis=0))
        absent = np.repeat([name in imu.absent for name in ('force', 'rate')], 3)
        lost = np.where(absent, 0.0, 1.0 - known.mean(axis=0))
        if lost.max() > LEAST_LOST:
            field = 'linear_acceleration' if lost[:3].max() > lost[3:].max() else 'angular_velocity'
            share = 100.0 * float(lost.max())
            outcomes.append(found('imu_nan', imu.topic, 0.99, share=share, field=field))
        imu = _known(imu, known[:, there])
    if velocity is not None:
        left = _known(velocity, np.isfinite(velocity.velocity))
        if left is None:
            outcomes.append(found('reference_nan', velocity.topic, 0.97))
        velocity = left
    return outcomes, replace(recording, imu=imu, reference=velocity)


def _known(series: Series, known: NDArray[np.bool_]) -> Series | None:
    """Return the rows of a channel in which all is known; None for none."""
    kept = np.asarray(known.all(axis=1))
    return rows_of(series, kept) if kept.any() else None
