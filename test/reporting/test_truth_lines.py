# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What the terminal says of warnings, right and wrong."""

from __future__ import annotations

from wheel_terra_estimator.reporting.truth_scores import TruthErrors, WarningScore, as_lines


def test_a_warning_without_its_slip_is_said() -> None:
    warnings = (WarningScore(3.0, True, 12.5), WarningScore(40.0, False, None))
    lines = as_lines(TruthErrors('test', (), None, warnings, None))
    assert 'warning at 3.0 s: borne out, 12.5 s before the median slip passed 0.75' in lines[-2]
    assert 'at 40.0 s: not borne out, the median slip did not pass 0.75 within 20 s' in lines[-1]
