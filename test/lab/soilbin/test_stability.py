# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The time-step criterion against the eigenvalues of the integrator itself."""

import math

import numpy as np
import pytest

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin import files
from wheel_terra_lab.soilbin.stability import largest_time_step, stable_time_step, time_step


def growth(a, b, step):
    """Largest eigenvalue of one step of velocity Verlet with a dashpot half a step late."""
    matrix = np.array([[1 - a * step**2, step * (1 - b * step)], [-a * step, 1 - b * step]])
    return np.abs(np.linalg.eigvals(matrix)).max()


@pytest.mark.parametrize('ratio', [0.0, 0.05, 0.15, 0.5, 1.0, 2.0])
def test_limit_is_where_the_integrator_starts_to_grow(ratio):
    stiffness, mass = 1e4, 1e-3
    damping = ratio * 2 * math.sqrt(stiffness * mass)
    limit = largest_time_step(stiffness, damping, mass, 1.0)
    a, b = stiffness / mass, damping / mass
    assert growth(a, b, 0.999 * limit) <= 1 + 1e-12
    assert growth(a, b, 1.001 * limit) > 1
    if ratio == 0:
        assert limit == pytest.approx(2 / math.sqrt(a))


def test_published_step_is_beyond_the_limit_and_the_message_gives_the_largest():
    case = files.load(['published', 'wheel_2'], ['numerics.time_step:=5.0e-5'])
    limit = stable_time_step(case)
    assert 3e-5 < limit < 5e-5
    with pytest.raises(UserError, match=f'largest stable one is {limit:.3g} s'):
        time_step(case)
    assert time_step(case.replace(numerics__time_step=0.0)) == pytest.approx(0.85 * limit)


def test_limit_scales_as_the_square_root_of_mass():
    # B = 50 mm: half the mass, half of m_e, so dt / sqrt 2; discs x2: four times the mass.
    case = files.load(['calibrated', 'wheel_2'])
    narrow = files.load(['calibrated', 'wheel_1'])
    assert stable_time_step(narrow) == pytest.approx(
        stable_time_step(case) / math.sqrt(2), rel=1e-6
    )
    coarse = case.replace(bed__grain_scale=2.0)
    assert stable_time_step(coarse) == pytest.approx(2 * stable_time_step(case), rel=0.02)
