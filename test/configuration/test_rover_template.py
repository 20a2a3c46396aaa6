# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a rover file is begun with."""

import pytest

from wheel_terra_estimator.configuration.rover_template import passes
from wheel_terra_estimator.configuration.urdf import read_urdf


def test_a_wheel_runs_in_the_rut_of_those_before_it_on_its_own_side():
    assert passes([0.4, 0.4, 0.0, 0.0, -0.4, -0.4], [0.3, -0.3] * 3) == [1, 1, 2, 2, 3, 3]
    assert passes([0.4, -0.4, -0.4], [0.3, 0.3, -0.3]) == [1, 2, 1]  # no wheel before the right one
    assert passes([0.4, -0.4, -0.4], [0.0, 0.3, -0.3]) == [1, 1, 1]


JOINT = (
    '<link name="{0}"><collision><geometry><cylinder radius="0.1" length="0.1"/></geometry>'
    '</collision></link><joint name="{0}_joint" type="{1}"><parent link="base_footprint"/>'
    '<child link="{0}"/><origin xyz="{2}" rpy="{3}"/><axis xyz="0 1 0"/></joint>'
)
WHEELS = {'left_wheel': '0.2 0.3 0.1', 'right_wheel': '0.2 -0.3 0.1'}


def test_wheels_and_base_that_hang_side_by_side_on_one_root(tmp_path):
    """Base turned to the left by a quarter and 0.1 m up: x of the root is its -y."""
    joints = [JOINT.format(name, 'continuous', at, '0 0 0') for name, at in WHEELS.items()]
    joints.append(JOINT.format('base_link', 'fixed', '0.2 0 0.1', '0 0 1.5707963267948966'))
    file = tmp_path / 'r.urdf'
    file.write_text(f'<robot name="r"><link name="base_footprint"/>{"".join(joints)}</robot>')
    sketch = read_urdf(file, [f'{name}_joint' for name in WHEELS])
    assert sketch.x == pytest.approx([0.3, -0.3])
    assert sketch.y == pytest.approx([0.0, 0.0], abs=1e-5)
    assert sketch.z == pytest.approx([0.0, 0.0], abs=1e-5)
    # Without masses the centre of gravity is guessed: 1.4 radii above the ground, hubs one.
    assert sketch.centre_of_gravity == pytest.approx([0.0, 0.0, 0.04])
