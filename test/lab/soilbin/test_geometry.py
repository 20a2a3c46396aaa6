# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Counts and places of the discs against the paper and against brute force."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin import files, geometry
from wheel_terra_lab.soilbin.case import Bed, Case, check
from wheel_terra_lab.soilbin.stability import largest_time_step, stable_time_step, time_step

# Nakashima et al. 2010, Table 1: D, D0, B, L_H, L_T [mm], L_n, C_l [%].
TABLE1 = {
    1: (220, 200, 50, 10, 5, 18, 14.3),
    2: (220, 200, 100, 10, 5, 18, 14.3),
    3: (220, 200, 150, 10, 5, 18, 14.3),
    4: (170, 150, 100, 10, 5, 18, 19.1),
    5: (270, 250, 100, 10, 5, 18, 11.5),
    6: (210, 200, 100, 5, 5, 18, 14.3),
    7: (220, 200, 100, 10, 5, 36, 28.6),
    8: (240, 200, 100, 20, 5, 18, 14.3),
    9: (220, 200, 100, 10, 10, 18, 28.6),
}


@pytest.mark.parametrize(
    ('rows', 'length', 'count'), [(28, 1.0, 6986), (40, 1.0, 9980), (40, 1.6, 15980)]
)
def test_element_counts_are_the_papers(rows, length, count):
    bed = Bed(rows=rows, length=length)
    assert sum(geometry.row_counts(bed)) == count
    centres, diameters, masses = geometry.bed_discs(Case(bed=bed))
    assert len(centres) == len(diameters) == len(masses) == count


@pytest.mark.parametrize('arrangement', ['staggered', 'random'])
@pytest.mark.parametrize('scale', [1.0, 2.0])
def test_discs_start_apart_and_inside(arrangement, scale):
    case = Case(bed=Bed(length=0.3, rows=12, arrangement=arrangement, grain_scale=scale))
    centres, diameters, _ = geometry.bed_discs(case)
    pairs = cKDTree(centres).query_pairs(diameters.max(), output_type='ndarray')
    distance = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
    overlap = diameters[pairs].sum(axis=1) / 2 - distance
    # A random bed may start with a few touching discs; none deeply.
    assert overlap.max(initial=-1) < (1e-9 if arrangement == 'staggered' else 0.1 * diameters.max())
    assert (centres[:, 0] - diameters / 2).min() >= -1e-12
    assert (centres[:, 0] + diameters / 2).max() <= 0.3 + 1e-12
    assert set(np.round(diameters / scale, 6)) == {0.0028, 0.0032, 0.0036, 0.004}


def test_density_by_depth():
    # 1.89 (z + 1.69)/(z + 2.9): 1.10 g/cm3 at the surface, 1.72 at 10 cm.
    assert geometry.regolith_density(np.array([0.0, 0.1])) == pytest.approx(
        [1101.4, 1712.7], rel=1e-4
    )


@pytest.mark.parametrize('number', TABLE1)
def test_shipped_wheels_are_table_1(number):
    outer, rim, width, height, thickness, lugs, cover = TABLE1[number]
    wheel = files.load([f'wheel_{number}']).wheel
    assert 2000 * wheel.tip_radius == pytest.approx(outer)
    assert 1000 * wheel.rim_diameter == pytest.approx(rim)
    assert 1000 * wheel.width == pytest.approx(width)
    share = 100 * wheel.lug_count * wheel.lug_thickness / (math.pi * wheel.rim_diameter)
    assert share == pytest.approx(cover, abs=0.06)
    discs = geometry.lug_discs(wheel, 0.0)
    assert len(discs) == lugs * round(height / 2.5) * round(thickness / 2.5)
    reach = np.linalg.norm(discs, axis=1) + geometry.LUG_DISC / 2
    assert 1000 * reach.max() == pytest.approx(outer / 2, abs=0.25)  # corners of the block
    # Every lug is the first one turned: the centroid is the axle.
    assert np.allclose(discs.mean(axis=0), 0, atol=1e-12)


def test_wheel_is_put_down_without_overlap():
    random = np.random.default_rng(3)
    centres = random.uniform([0, 0], [0.5, 0.05], (400, 2))
    radii = random.uniform(0.001, 0.002, 400)
    wheel = files.load(['wheel_2']).wheel
    lugs = geometry.lug_discs(wheel, 0.3)
    height = geometry.touching_height(0.25, wheel.rim_radius, lugs, centres, radii)
    elements = np.array([0.25, height]) + np.vstack([[0.0, 0.0], lugs])
    sizes = np.r_[wheel.rim_radius, np.full(len(lugs), geometry.LUG_DISC / 2)]
    gaps = np.linalg.norm(elements[:, None] - centres[None], axis=2) - sizes[:, None] - radii
    assert gaps.min() == pytest.approx(0, abs=1e-12)


def test_surface_of_a_staircase():
    centres = np.array([[x, y] for x in np.arange(0.002, 0.2, 0.004) for y in (0.01, 0.03)])
    radii = np.full(len(centres), 0.002)
    assert geometry.surface_height(centres, radii, 0.05, 0.15) == pytest.approx(0.032)


def test_wheel_that_does_not_fit_is_refused_with_the_range():
    case = Case(bed=Bed(length=0.3))
    with pytest.raises(UserError, match=r'does not fit the bin of 0\.3 m.*0\.110 and 0\.190'):
        check(case)


# The time-step criterion against the eigenvalues of the integrator itself.


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
