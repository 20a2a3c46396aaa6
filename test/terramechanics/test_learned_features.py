# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Features of the learned closure, by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from wheel_terra_estimator.terramechanics.effects.learned_closure import FEATURES, TARGETS

LOAD = 10.0 * 1600.0 * 9.8 * 0.1 * 0.2**2  # ten times rho g b r^2
CONTACT = {
    'slip': -0.5,
    'stated_load': LOAD,
    'direction': -1.0,
    'torque': 0.3 * LOAD * 0.2,
    'drawbar_pull': -0.2 * LOAD,
    'density': 1600.0,
    'gravity': 9.8,
    'width': 0.1,
    'radius': 0.2,
    'lug_height': 0.01,
    'rim_speed': 0.5,
    'pass_number': 3.0,
    'slope': 0.1,
    'entrance_angle': math.acos(0.75),
}
BY_HAND = {
    'one': 1.0,
    'slip': 0.5,
    'slip_squared': 0.25,
    'slip_over_02': 0.3,
    'slip_over_04': 0.1,
    'slip_over_06': 0.0,
    'slip_near_02': 0.0,  # 0.3 away, beyond the foot at 0.25
    'slip_near_04': 0.7056,  # (1 - 0.4^2)^2
    'slip_near_06': 0.7056,
    'load': 1.0,  # a decade
    'lug': 0.05,
    'width': 0.5,
    'rim_speed': 1.0,  # a decade above 0.05 m/s
    'pass': 2.0,  # earlier ones
    'slope': 0.1,
    'depth': 0.25,  # z/r = 1 - cos(t1)
    'slip_times_load': 0.5,
    'slip_times_lug': 0.025,
    'slip_times_width': 0.25,
    'slip_times_rim_speed': 0.5,
    'slip_times_pass': 1.0,
    'load_times_lug': 0.05,
    'load_times_rim_speed': 1.0,
    'load_times_pass': 2.0,
    'torque_squared': -0.9,  # against the way: 0.3^2 of W r, ten times as heavy as rho g b r^2
}


def test_a_feature_is_what_it_says():
    contact = SimpleNamespace(**CONTACT)
    arrays = SimpleNamespace(**{key: np.array([value]) for key, value in CONTACT.items()})
    for name, feature in FEATURES.items():
        assert feature.value(contact) == pytest.approx(BY_HAND[name], abs=1e-12), name
        assert feature.value(arrays) == pytest.approx([BY_HAND[name]], abs=1e-12), name


def test_a_rim_speed_that_was_not_recorded_is_the_usual_one():
    contact = SimpleNamespace(**{**CONTACT, 'rim_speed': math.nan})
    assert FEATURES['rim_speed'].value(contact) == 0.0


def test_a_correction_of_the_usual_size_is_far_from_its_bound():
    """Three prior deviations: a bound that is nearer would be the prior."""
    for name, target in TARGETS.items():
        assert target.bound >= 3.0 * target.usual, name
