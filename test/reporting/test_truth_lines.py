# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the terminal says of warnings, right and wrong."""

from types import SimpleNamespace

import pytest

from wheel_terra_estimator.estimation.judgement.entrapment import Outcome, Verdict
from wheel_terra_estimator.reporting.drive_summary import DriveSummary, WarningSpan
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
    ('high', 'stuck', 'tone'), [(0.0, 0.0, 'good'), (2.0, 0.0, 'warn'), (0.0, 5.0, 'warn')]
)
def test_a_drive_with_high_slip_or_stuck_wheels_is_shown_as_a_warning(high, stuck, tone):
    wheels = [SimpleNamespace(seconds={'high': high, 'stuck': stuck})]
    assert _tone(SimpleNamespace(wheels=wheels)) == tone


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
