# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the terminal says of warnings, right and wrong."""

import dataclasses
from types import SimpleNamespace

import pytest

from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.entrapment import Outcome, Verdict
from wheel_terra_estimator.reporting.drive_summary import DriveSummary, WarningSpan, WheelSummary
from wheel_terra_estimator.reporting.replay_report import _error_row, _tone
from wheel_terra_estimator.reporting.truth_scores import QuantityError, TruthErrors, as_lines


def test_a_warning_without_its_slip_is_said():
    warnings = (
        (3.0, Verdict(Outcome.ENTRAPPED, 12.5)),
        (16.0, Verdict(Outcome.ENTRAPPED, -0.5)),
        (40.0, Verdict(Outcome.NEAR_MISS)),
        (80.0, Verdict(Outcome.FALSE)),
    )
    lines = as_lines(TruthErrors('test', (), None, warnings, 15.5, 12.5))
    assert 'warning at 3.0 s: right, 12.5 s before the rover was entrapped' in lines[-4]
    assert 'at 16.0 s: late, 0.5 s after the rover was entrapped' in lines[-3]
    assert 'at 40.0 s: a near miss, the median slip passed 0.75, no entrapment' in lines[-2]
    assert 'at 80.0 s: false, the median slip did not pass 0.75 within 20 s' in lines[-1]


@pytest.mark.parametrize(
    ('high', 'stuck', 'slip', 'tone'),
    [
        (0.0, 0.0, (0.0, 0.2), 'good'),
        (2.0, 0.0, (0.0, 0.7), 'warn'),
        (0.0, 5.0, (0.0, 1.0), 'warn'),
        (0.0, 0.0, None, 'warn'),
    ],
)
def test_a_drive_with_high_slip_stuck_wheels_or_nothing_known_is_shown_as_a_warning(
    high, stuck, slip, tone
):
    wheels = [SimpleNamespace(seconds={'high': high, 'stuck': stuck}, slip=slip)]
    assert _tone(SimpleNamespace(wheels=wheels)) == tone


def test_a_drive_of_which_no_slip_is_known_is_not_called_a_good_one():
    seconds = {c.name.lower(): 0.0 for c in SlipClass}
    wheel = WheelSummary('a', seconds, seconds, None, None, None, 0, 0, 0, None, None, None)
    verdict = DriveSummary('drive', 0.0, 1, (wheel,), (), (), ()).verdict
    assert 'no slip was known' in verdict
    known = dataclasses.replace(wheel, slip=(0.0, 0.1), max_slip=0.1)
    verdict = DriveSummary('drive', 0.0, 1, (wheel, known), (), (), ()).verdict
    assert verdict == 'No stuck warning, no wheel in the classes high or stuck.'


def test_errors_in_the_report_are_in_millimetres_degrees_and_per_cent():
    row = _error_row(QuantityError('slip_angle', 'rad', 0.1, -0.05, 0.2, 0.961))
    assert list(row.values()) == ['slip angle [deg]', '5.73', '-2.9', '11.5', '96 %']
    row = _error_row(QuantityError('sinkage', 'm', 0.0012, 0.0005, 0.004, 0.5))
    assert list(row.values()) == ['sinkage [mm]', '1.2', '+0.5', '4', '50 %']


@pytest.mark.parametrize(('count', 'more'), [(5, '4.0 s: digs'), (7, '4.0 s and 2 more: digs')])
def test_a_verdict_names_five_warnings_and_counts_the_rest(count, more):
    warnings = tuple(WarningSpan(float(k), None, 'digs') for k in range(count))
    verdict = DriveSummary('drive', 60.0, 600, (), warnings, (), ()).verdict
    assert verdict == f'Stuck warnings at 0.0 s, 1.0 s, 2.0 s, 3.0 s, {more}.'
