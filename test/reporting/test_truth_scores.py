# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors against a truth that was written down by hand."""

import csv
import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.bags.history import WHEEL_FIELDS, EstimateHistory, StuckWarning
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.judgement.entrapment import Outcome, Verdict
from wheel_terra_estimator.reporting.comparison import as_text, compare
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.drive_summary import (
    DriveSummary,
    MessageRow,
    WarningSpan,
    WheelSummary,
)
from wheel_terra_estimator.reporting.estimates_table import write_table
from wheel_terra_estimator.reporting.replay_report import _error_row
from wheel_terra_estimator.reporting.truth_scores import (
    QuantityError,
    TruthErrors,
    as_lines,
    seen_later,
    truth_errors,
)

STAMP = 10**12 + np.arange(100, dtype=np.int64) * 100_000_000
THRESHOLDS = np.array([0.3, 0.6, 0.9])


def history(slip, classes=0, warnings=()):
    values = {name: np.zeros((100, 2)) for name in WHEEL_FIELDS}
    values['slip'] = np.asarray(slip, float)
    values['slip_std'] = np.full((100, 2), 0.05)
    return EstimateHistory(
        ('left', 'right'),
        STAMP,
        values,
        np.broadcast_to(np.asarray(classes, np.uint8), (100, 2)),
        np.full(100, 0.1),
        np.full(100, 0.01),
        warnings,
    )


def truth(slip):
    still = WheelTruth(STAMP, np.full((100, 1), 0.1))
    return Truth('/ground_truth', still, WheelTruth(STAMP, np.asarray(slip, float)), None, None)


def test_errors_and_classes():
    true = np.tile(np.linspace(0.0, 0.99, 100)[:, None], (1, 2))
    seen = true + np.array([0.08, -0.12])
    errors = truth_errors(history(seen), truth(true), THRESHOLDS)
    slip = errors.quantities[0]
    assert slip.name == 'slip'
    assert slip.rms == pytest.approx(np.sqrt((0.08**2 + 0.12**2) / 2))
    assert slip.bias == pytest.approx(-0.02)
    assert slip.worst == pytest.approx(0.12)
    assert slip.within_two_std == pytest.approx(0.5)
    # All was called low; truth has 31 sets up to 0.3 (bound included), then 30, 30 and 9.
    assert errors.class_matrix[:, 0] == pytest.approx([0.31, 0.30, 0.30, 0.09])
    assert errors.class_matrix[:, 1:].sum() == 0.0


def test_an_angle_is_wrong_by_the_shorter_way():
    seen = history(np.zeros((100, 2)))
    seen.values['slip_angle'] = np.full((100, 2), 3.1)
    true = WheelTruth(STAMP, np.full((100, 2), -3.1))
    beyond = dataclasses.replace(truth(np.zeros((100, 2))), slip_angle=true)
    angle = truth_errors(seen, beyond, THRESHOLDS).quantities[-1]
    assert (angle.name, angle.worst) == ('slip_angle', pytest.approx(2.0 * np.pi - 6.2))


def test_lead_of_a_warning_and_one_that_was_wrong():
    true = np.zeros((100, 2))
    true[60:] = 0.95
    right = StuckWarning(int(STAMP[40]), None, '')
    errors = truth_errors(history(true, warnings=(right,)), truth(true), THRESHOLDS)
    assert errors.warnings[0][1].lead == errors.lead == pytest.approx(3.0)
    assert errors.entrapped == pytest.approx(7.0)
    calm = truth_errors(history(true, warnings=(right,)), truth(0.0 * true), THRESHOLDS)
    assert calm.warnings[0][1].outcome is Outcome.FALSE and calm.entrapped is None
    assert 'stayed below' in as_lines(calm)[-1]
    assert '3.0 s before the rover was entrapped' in as_lines(errors)[-1]
    unseen = truth_errors(history(true), truth(true), THRESHOLDS)
    assert as_lines(unseen)[-1].endswith('no warning, though the rover was entrapped at 7.0 s')
    nothing = truth_errors(history(0.0 * true), truth(0.0 * true), THRESHOLDS)
    assert not any('warning' in line for line in as_lines(nothing))


@pytest.mark.parametrize(
    ('unknown_from', 'said'), [(99, 'false, the median slip'), (45, 'is unknown')]
)
def test_a_warning_before_slip_without_a_class_is_not_judged(unknown_from, said):
    """Inputs that are found wrong after it: what the filter makes of them says nothing."""
    classes = np.where(np.arange(100) >= unknown_from, SlipClass.UNKNOWN, SlipClass.LOW)
    drive = history(np.zeros((100, 2)), classes[:, None], (StuckWarning(int(STAMP[40]), None, ''),))
    (verdict,) = seen_later(drive, Border(0.25, np.inf))
    assert said in verdict


def test_a_set_is_stuck_while_a_warning_stands():
    over = StuckWarning(int(STAMP[20]), int(STAMP[30]), '')
    standing = StuckWarning(int(STAMP[90]), None, '')
    found = history(np.zeros((100, 2)), warnings=(over, standing))
    assert np.flatnonzero(found.stuck).tolist() == [*range(20, 30), *range(90, 100)]
    assert found.seconds == pytest.approx(0.1 * np.arange(100))
    assert found.warning_times == [(pytest.approx(2.0), pytest.approx(3.0)), (9.0, None)]


def test_comparison():
    first, second = history(np.zeros((100, 2))), history(np.zeros((100, 2)))
    second.values['sinkage'][7, 1] = 0.25
    second = EstimateHistory(**{**vars(second), 'stamp': STAMP[5] - STAMP[0] + STAMP})
    told = {d.name: d for d in compare(first, second, ('a', 'b'), None).differences}
    assert told['sinkage'].greatest == 0.25
    assert told['sinkage'].where == 'right at 1.2 s'
    assert told['slip'].rms == 0.0
    apart = EstimateHistory(**{**vars(second), 'stamp': STAMP + 10**15})
    with pytest.raises(UserError, match='no stamp in common'):
        compare(first, apart, ('a', 'b'), None)


def test_warnings_of_both_are_told():
    warned = StuckWarning(int(STAMP[40]), None, '')
    told = as_text(compare(history(np.zeros((100, 2)), warnings=(warned,)), history(
        np.zeros((100, 2))), ('a', 'b'), None))  # fmt: skip
    assert 'stuck warnings of A: 4.0 s\n' in told and 'stuck warnings of B: none\n' in told


def test_table(tmp_path):
    path = tmp_path / 'table.csv'
    write_table(history(np.full((100, 2), 0.5), 1), path)
    rows = list(csv.DictReader(path.open()))
    assert len(rows) == 200
    assert rows[1]['wheel'] == 'right' and rows[1]['stamp [ns]'] == str(STAMP[0])
    assert float(rows[1]['slip [-]']) == 0.5 and rows[1]['slip_class'] == '1'


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
    assert 'at 40.0 s: a near miss, median slip above 0.75, no entrapment' in lines[-2]
    assert 'at 80.0 s: false, the median slip stayed below 0.75 for 20 s' in lines[-1]


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
    wheels = (SimpleNamespace(seconds={'high': high, 'stuck': stuck}, slip=slip),)
    drive = DriveSummary('drive', 0.0, 9, wheels, (), (), ())
    assert drive.tone == tone
    for bad in ({'sets': 0}, {'warnings': (WarningSpan(0.0, None, ''),)}):
        assert dataclasses.replace(drive, **bad).tone == 'bad'


def test_a_drive_is_called_good_where_slip_is_known_and_no_wheel_travelled_by_it():
    seconds = {c.name.lower(): 0.0 for c in SlipClass}
    wheel = WheelSummary('a', seconds, seconds, None, None, None, 0, 0, 0, None, None, None)
    verdict = DriveSummary('drive', 0.0, 1, (wheel,), (), (), ()).verdict
    assert 'slip was never known' in verdict
    known = dataclasses.replace(wheel, slip=(0.0, 0.1), max_slip=0.1)
    verdict = DriveSummary('drive', 0.0, 1, (wheel, known), (), (), ()).verdict
    assert verdict == 'No stuck warning, no wheel in the classes high or stuck.'
    row = MessageRow('joint_states', '/joint_states', 9, 'none')
    alone = DriveSummary('drive', 0.0, 1, (known,), (), (row,), ()).verdict
    assert alone == f'{verdict} Without a reference velocity, slip may have gone unnoticed.'
    both = (row, dataclasses.replace(row, name='reference_odom'))
    assert DriveSummary('drive', 0.0, 1, (known,), (), both, ()).verdict == verdict
    noisy = dataclasses.replace(known, seconds={**seconds, 'stuck': 2.2}, slip_travel=0.004)
    verdict = DriveSummary('drive', 0.0, 1, (wheel, noisy), (), (), ()).verdict
    assert verdict.endswith('no wheel in the classes high or stuck for more than a centimetre.')
    slid = dataclasses.replace(noisy, name='b', seconds={**seconds, 'high': 0.5}, slip_travel=0.2)
    verdict = DriveSummary('drive', 0.0, 1, (noisy, slid), (), (), ()).verdict
    assert 'b slipped most: 20 cm in 0.5 s of the classes' in verdict


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
