# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a rover file is begun with."""

from wheel_terra_estimator.configuration.rover_template import passes


def test_a_wheel_runs_in_the_rut_of_those_before_it_on_its_own_side() -> None:
    assert passes([0.4, 0.4, 0.0, 0.0, -0.4, -0.4], [0.3, -0.3] * 3) == [1, 1, 2, 2, 3, 3]
    assert passes([0.4, -0.4, -0.4], [0.3, 0.3, -0.3]) == [1, 2, 1]  # no wheel before the right one
    assert passes([0.4, -0.4, -0.4], [0.0, 0.3, -0.3]) == [1, 1, 1]
