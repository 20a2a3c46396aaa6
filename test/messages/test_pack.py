# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Estimates to messages."""

from typing import Any

import numpy as np
from estimate_sets import some_estimates

from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipOnSlope
from wheel_terra_estimator.estimation.sideways import Sideways
from wheel_terra_estimator.messages.pack import JOINT_OUTPUTS, pack
from wheel_terra_estimator.messages.unpack import JOINT_STATE, TWIST, Message, unpack

NAMES = ('left', 'right')


def joint_states(estimates: EstimateSet) -> dict[str, Message]:
    sent = pack(estimates, NAMES, JOINT_OUTPUTS)
    return {topic: unpack(JOINT_STATE, data) for topic, data in sent}


def twist(estimates: EstimateSet) -> tuple[Any, Any]:
    ((_, data),) = pack(estimates, NAMES, ('twist',))
    (numbers,) = unpack(TWIST, data).numbers
    return numbers[:6], numbers[6:].reshape(6, 6)


def test_every_output_field_is_where_the_contract_wants_it():
    aside = Sideways(*((k, k + 0.5) for k in range(4)), 0.02, 1e-4)
    e = some_estimates(sideways=aside)
    found = joint_states(e)
    table = {
        'slip': (e.slip, e.slip_velocity, e.drawbar_pull),
        'sinkage': (e.sinkage, e.sinkage_rate, e.normal_load),
        'slip_stddev': (e.slip_std, e.slip_velocity_std, e.drawbar_pull_std),
        'sinkage_stddev': (e.sinkage_std, e.sinkage_rate_std, e.normal_load_std),
        'mobility': (e.rim_travel_left, [], e.pull_margin),
        'soil': (e.soil, [], e.soil_std),
        'slip_angle': (e.sideways.angle, [], e.sideways.force),
        'slip_angle_stddev': (e.sideways.angle_std, [], e.sideways.force_std),
    }
    assert list(found) == list(table)
    for topic, columns in table.items():
        assert found[topic].names == (NAMES if topic != 'soil' else e.soil_names)
        assert [list(n) for n in found[topic].numbers] == [list(c) for c in columns]


def test_slips_on_slopes_go_out_where_a_set_has_them():
    slopes = SlipOnSlope(*np.arange(33.0).reshape(3, 11))
    found = joint_states(some_estimates(slip_on_slope=slopes))['slip_on_slope']
    assert found.names == tuple(f'slope_{d}deg' for d in range(-20, 31, 5))
    assert [list(n) for n in found.numbers] == [
        list(n) for n in (slopes.slip, slopes.entrapment, slopes.std)
    ]


def test_twist_covariance_is_row_major_and_positive():
    velocity, matrix = twist(some_estimates())
    assert velocity[1] == 0.0 and matrix[1, 1] == 1.0
    e = some_estimates(sideways=Sideways(*((0.0, 0.0),) * 4, 0.02, 1e-4))
    velocity, matrix = twist(e)
    assert velocity.tolist() == [e.forward_velocity, 0.02, 0.0, 0.0, 0.0, e.yaw_rate]
    assert matrix[1, 1] == 1e-4
    assert matrix[0, 0] == e.forward_velocity_variance
    assert matrix[5, 5] == e.yaw_rate_variance
    assert (np.diag(matrix) > 0.0).all()
    assert np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0
