# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The traction limiter in a closed loop with the simulated rover, the same soft patch twice."""

from wheel_terra_estimator.evaluation.closed_loop import Comparison, closed_loop, report
from wheel_terra_estimator.evaluation.kinds import LIMITER
from wheel_terra_estimator.simulation.scenario import load


def test_without_it_the_rover_digs_in_with_it_it_stops_in_time():
    free, limited = (
        closed_loop(load({**LIMITER, 'duration': duration}), 0, limited=limited)
        for duration, limited in ((52.0, False), (40.0, True))
    )
    radius = load(LIMITER).configuration.wheels.radius[0]
    assert free.sinkage.max() > 0.5 * radius
    assert limited.stopped is not None
    assert limited.sinkage.max() < 0.25 * radius
    assert limited.position[-1] > 1.0  # it did not stop on the good ground before the patch
    row = report([Comparison(0, radius, free, limited)]).splitlines()[-1].split('|')
    good, with_limiter, without = (float(cell) for cell in row[2:5])
    assert good <= with_limiter
    assert with_limiter == round(float(limited.sinkage.max()) / radius, 2)
    assert without == round(float(free.sinkage.max()) / radius, 2)
