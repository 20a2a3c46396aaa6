# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The traction limiter in a closed loop with the simulated rover, the same soft patch twice."""

import pytest

from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_lab.evaluation.closed_loop import Comparison, closed_loop, report
from wheel_terra_lab.evaluation.kinds import LIMITER


@pytest.fixture(scope='module')
def limited():
    return closed_loop(load({**LIMITER, 'duration': 40.0}), 0, limited=True)


@pytest.fixture(scope='module')
def radius():
    return load(LIMITER).configuration.wheels.radius[0]


@pytest.mark.slow
def test_with_it_the_rover_stops_in_time(limited, radius):
    assert limited.stopped is not None
    assert limited.sinkage.max() < 0.25 * radius
    assert limited.position[-1] > 1.0  # it did not stop on the good ground before the patch


@pytest.mark.slow
def test_without_it_the_rover_digs_in(limited, radius):
    free = closed_loop(load({**LIMITER, 'duration': 52.0}), 0, limited=False)
    assert free.sinkage.max() > 0.5 * radius
    row = report([Comparison(0, radius, free, limited)]).splitlines()[-1].split('|')
    good, with_limiter, without = (float(cell) for cell in row[2:5])
    assert good <= with_limiter
    assert with_limiter == round(float(limited.sinkage.max()) / radius, 2)
    assert without == round(float(free.sinkage.max()) / radius, 2)
