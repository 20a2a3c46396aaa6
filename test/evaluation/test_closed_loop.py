# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The traction limiter in a closed loop with the simulated rover, the same soft patch twice."""

from wheel_terra_estimator.evaluation.closed_loop import Comparison, closed_loop, report
from wheel_terra_estimator.evaluation.kinds import LIMITER
from wheel_terra_estimator.simulation.scenario import load


def test_without_it_the_rover_digs_in_with_it_it_stops_in_time():
    scenario = load({**LIMITER, 'duration': 60.0})
    radius = scenario.configuration.wheels.radius[0]
    free = closed_loop(scenario, 0, limited=False)
    limited = closed_loop(scenario, 0, limited=True)
    assert free.sinkage.max() > 0.5 * radius
    assert limited.stopped is not None
    assert limited.sinkage.max() < 0.25 * radius
    assert limited.position[-1] > 1.0  # it did not stop on the good ground before the patch
    row = report([Comparison(0, radius, free, limited)]).splitlines()[-1].split('|')
    good, with_limiter, without = (float(cell) for cell in row[2:5])
    assert good <= with_limiter
    assert with_limiter == round(float(limited.sinkage.max()) / radius, 2)
    assert without == round(float(free.sinkage.max()) / radius, 2)
