# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Errors against the truth, on estimates whose error is known."""

from __future__ import annotations

import numpy as np
import pytest

from wheel_terra_estimator.bags.history import WHEEL_FIELDS, EstimateHistory
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.reporting.truth_errors import truth_errors


def test_a_known_error_is_found_after_the_first_seconds() -> None:
    count, names = 400, ('left', 'right')
    stamp = (np.arange(count) * 1e8).astype(np.int64) + 7
    zero = np.zeros((count, 2))
    values = {name: zero.copy() for name in WHEEL_FIELDS}
    values['slip'][:] = (0.3, 0.4)  # errors +0.1 and -0.2 below
    values['slip'][:90] = 9.0  # the first nine seconds do not count
    values['slip_std'][:] = 0.06  # 95 %: 0.118
    history = EstimateHistory(
        names, stamp, values, zero.astype(np.uint8), zero[:, 0], zero[:, 0], ()
    )
    known = WheelTruth(stamp, np.tile((0.2, 0.6), (count, 1)))
    velocity = WheelTruth(stamp, zero[:, :1])
    (error,) = truth_errors(history, Truth('test', velocity, known, None, None))
    assert error.rms == pytest.approx(np.sqrt((0.1**2 + 0.2**2) / 2.0))
    assert (error.worst_wheel, error.worst) == ('right', pytest.approx(0.2))
    assert error.coverage == pytest.approx(0.5)
    assert truth_errors(history, None) == ()
