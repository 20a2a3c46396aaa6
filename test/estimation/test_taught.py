# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Bits and verdicts against the posterior of linear measurements, worked out by hand."""

import numpy as np
import pytest
from parts import SAND

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.filter.state import SHEAR_STRENGTH, StateLayout
from wheel_terra_estimator.estimation.taught import (
    ASSUMED,
    CONFOUNDED,
    LEARNED,
    Parameter,
    Teaching,
    with_model_errors,
)
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator


def taught(rows, noise=0.1):
    """Judge three parameters of unit variance after measurements of sums of them."""
    names = ['a', 'b', 'c']
    start = np.eye(3)
    parameters = [Parameter(n, '-', row) for n, row in zip(names, start, strict=True)]
    H = np.array(rows, dtype=float).reshape(-1, 3)
    after = np.linalg.inv(start + H.T @ H / noise**2)
    return {row.name: row for row in Teaching(parameters, start).judged(after)}


def test_a_measured_parameter_is_learned_by_the_bits_of_its_deviation():
    found = taught([[1, 0, 0]])
    assert found['a'].verdict == LEARNED
    assert found['a'].std == pytest.approx(0.1 / np.sqrt(1.01))
    assert found['a'].bits == pytest.approx(0.5 * np.log2(101.0))  # capacity of a Gaussian channel
    assert found['b'].verdict == ASSUMED and found['b'].bits == 0.0
    assert found['b'].in_words() == 'assumed, not learned'


def test_a_sum_tells_none_of_its_parts():
    found = taught([[1, 1, 0]])
    for name, other in (('a', 'b'), ('b', 'a')):
        assert found[name].verdict == CONFOUNDED
        assert found[name].confounded_with == other
        assert found[name].std == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert found['c'].verdict == ASSUMED
    both = taught([[1, 1, 0], [1, -1, 0]])
    assert both['a'].verdict == both['b'].verdict == LEARNED


def test_a_deviation_that_grew_has_gained_nothing():
    row = Teaching([Parameter('a', '-', np.ones(1))], np.eye(1)).judged(np.array([[4.0]]))[0]
    assert (row.verdict, row.bits, row.std) == (ASSUMED, 0.0, 2.0)


def test_the_estimator_has_learned_nothing_before_it_drives():
    rows = {row.name: row for row in WheelSoilEstimator(reader.load(SAND)).taught()}
    assert all(row.verdict != LEARNED and row.bits == 0.0 for row in rows.values())
    assert rows['soil.cohesion'].confounded_with == 'soil.friction_angle_deg'
    assert rows['soil.cohesive_modulus'].confounded_with == 'soil.frictional_modulus'


def test_what_no_drive_tells_apart_is_never_learned():
    parameters = [Parameter('a', '-', np.ones(1), like='b')]
    row = Teaching(parameters, np.eye(1)).judged(np.array([[0.01]]))[0]
    assert (row.verdict, row.bits, row.std, row.confounded_with) == (CONFOUNDED, 0.0, 1.0, 'b')
    rows = {row.name: row for row in WheelSoilEstimator(reader.load(SAND)).taught()}
    assert rows['torque zeros'].confounded_with == 'soil.friction_angle_deg'


def test_a_number_that_was_moved_far_is_believed_less():
    layout = StateLayout(2)
    mean, known = np.zeros(layout.size), np.zeros((layout.size, layout.size))
    near = with_model_errors(mean, known, layout)
    mean[SHEAR_STRENGTH], mean[layout.stiffness] = -0.5, (1.0, 0.0)
    far = with_model_errors(mean, known, layout)
    assert near[SHEAR_STRENGTH, SHEAR_STRENGTH] == pytest.approx(0.05**2)
    assert far[SHEAR_STRENGTH, SHEAR_STRENGTH] == pytest.approx(0.05**2 + 0.2**2)
    average = np.full(2, 0.5)  # moved by 0.5: 0.2 of error, common to both wheels
    for P, error in ((near, 0.0), (far, 0.2)):
        variance = average @ P[layout.stiffness, layout.stiffness] @ average
        assert variance == pytest.approx(0.25**2 + error**2)
