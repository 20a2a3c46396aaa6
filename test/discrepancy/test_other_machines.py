# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Effects on machines of other sizes and in other formulas, on tables of the independent truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_workflow import noisy, run, settings

from wheel_terra_estimator.discrepancy.assessment.next_measurement import ZERO_CHECKS
from wheel_terra_estimator.discrepancy.proposal import like
from wheel_terra_estimator.discrepancy.report.model_file import corrected
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_lab.trials.designs import random_rows, random_soil
from wheel_terra_lab.trials.hidden import Change, adding
from wheel_terra_lab.trials.truth import solve


def table_of(hidden, design='sweep40', times=1.0, seed=4, **varied):
    """Return a table with an effect hidden in it, on a wheel so many times as large.

    ``varied``: column -> values at each of which all rows are repeated.
    """
    rng = np.random.default_rng(seed)
    soil = random_soil(rng)
    rows = random_rows(design, rng, soil)
    for key, values in varied.items():
        count = len(rows['slip'])
        rows = {name: np.tile(column, len(values)) for name, column in rows.items()}
        rows[key] = np.repeat(values, count)
    for key in ('wheel_radius', 'wheel_width', 'lug_height'):
        rows[key] = rows[key] * times
    rows['normal_load'] = rows['normal_load'] * times ** (2.0 + soil.sinkage_exponent)
    soil = replace(soil, shear_modulus=soil.shear_modulus * times)
    table = noisy(rows, solve(rows, soil), solve(rows, soil, (hidden,)), rng)
    return table, settings(soil, rows)


def by_speed(setup, rows):
    ratio = rows['angular_velocity'] * rows['wheel_radius'] / 0.05
    setup.tan_phi = setup.tan_phi * ratio**0.08


def by_pass(setup, rows):
    earlier = np.sqrt(rows['pass_number'] - 1.0)
    setup.stiffness = setup.stiffness * (1.0 + 0.3 * earlier)
    setup.tan_phi = setup.tan_phi * (1.0 + 0.03 * earlier)


@pytest.mark.parametrize(
    ('change', 'column', 'levels', 'name'),
    [
        (by_speed, 'angular_velocity', (0.1, 0.4, 1.5), 'rate_dependence'),
        (by_pass, 'pass_number', (1.0, 2.0, 3.0), 'multipass'),
    ],
)
@pytest.mark.parametrize('seed', [4, 5, 6])
def test_a_law_that_says_the_same_in_other_words_does_not_take_the_name_away(
    change, column, levels, name, seed
):
    """Whichever closure changes with speed or pass."""
    found = run(*table_of(Change('strength', change), 'basic16', seed=seed, **{column: levels}))
    assert [effect.name for effect in found.effects] == [name]


def test_soil_that_changes_with_speed_or_pass_is_like_one_effect_and_a_reading_is_not():
    assert like('friction_by_rim_speed') == like('exponent_by_slip_times_rim_speed')
    assert like('exponent_by_slip_times_rim_speed') == 'rate_dependence'
    assert like('bearing_pressure_by_load_times_pass') == like('cohesion_by_pass') == 'multipass'
    assert like('torque_by_rim_speed') == like('friction_by_load') == ''
    assert like('torque_by_one') == 'drivetrain_friction'
    assert like('exponent_by_slip_over_02') == like('exponent_by_slip') == 'slip_sinkage_exponent'
    assert like('sinkage_by_slip_squared') == 'lug_digging'
    assert like('friction_by_slip') == like('sinkage_by_slip_near_02') == ''


@pytest.mark.parametrize('times', [0.4, 1.0, 5.0])
@pytest.mark.parametrize('share', [0.05, -0.05])
def test_a_torque_that_is_off_by_a_constant_is_named_on_any_machine_in_either_direction(
    times, share
):
    def more(out, setup, rows):
        return share * np.mean(rows['normal_load'] * rows['wheel_radius'])

    table, values = table_of(adding('torque', 'torque', more), times=times)
    size = share * float(np.mean(table['normal_load'] * table['wheel_radius']))
    found = run(table, values)
    (effect,) = found.effects
    assert effect.name == 'drivetrain_friction' and effect.confidence > 0.8
    (value,) = effect.parameters.values()
    assert value.value == pytest.approx(size, abs=4.0 * value.std)
    model, _ = corrected(found)
    assert model.sensors.torque_zero.tolist() == pytest.approx([value.value])
    assert 'drivetrain_friction' not in model.effects


def test_a_pull_sensor_that_is_not_zeroed_is_named_on_a_large_machine():
    def more(out, setup, rows):
        return 0.06 * np.mean(rows['normal_load'])

    found = run(*table_of(adding('pull', 'drawbar_pull', more), times=5.0))
    assert found.effects[0].name == 'pull_zero' and found.effects[0].confidence > 0.8


@pytest.mark.parametrize(('share', 'seed'), [(0.08, 4), (-0.08, 4), (0.08, 7)])
def test_a_rim_of_another_radius_is_told_from_lugs_that_shear(share, seed):
    def larger(setup, rows):
        setup.shear_radius = setup.shear_radius + share * setup.radius
        setup.radius = (1.0 + share) * setup.radius

    found = run(*table_of(Change('rim', larger), seed=seed))
    (effect,) = found.effects
    assert effect.name == 'wheel_radius_bias' and effect.form == 'rim'
    assert effect.parameters['bias'].value == pytest.approx(share, abs=0.02)


def test_priors_of_forces_and_torques_grow_with_the_machine():
    zero, friction, cohesion = (
        catalogue()[name].sized(800.0, 0.314).parameters[0].prior_scale
        for name in ('pull_zero', 'drivetrain_friction', 'cohesion')
    )
    # Ten times the load of the wheel to which the catalogue refers, on twice its radius.
    assert (zero, friction, cohesion) == pytest.approx((30.0, 10.0, 500.0))
    damping = catalogue()['drivetrain_friction'].sized(800.0, 0.314).in_form('viscous')
    assert damping.parameters[0].prior_scale == pytest.approx(10.0)


def test_each_error_of_an_instrument_has_a_check_of_the_rig():
    assert {name for name, effect in catalogue().items() if effect.instrument} <= {*ZERO_CHECKS}
