# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The filter on the traction curve: tables, derivatives, solution, and a drive."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.contacts.steering import straight_headings
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_lab.evaluation.runner import record, run_candidate
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.traction_filter.curve import WheelSpeeds, coefficients
from wheel_terra_lab.traction_filter.references import HeldSlip, mixed
from wheel_terra_lab.traction_filter.speed import SolverTuning, TorqueBalance, rims_at
from wheel_terra_lab.traction_filter.steady_wheel import SteadyWheel


@pytest.fixture(scope='module')
def configuration():
    return reader.load(['generic_six_wheel', 'hit_lss1'])


@pytest.fixture(scope='module')
def rover(configuration):
    return Rover.from_configuration(configuration)


@pytest.fixture(scope='module')
def steady(configuration, rover):
    return SteadyWheel(configuration, rover)


@pytest.mark.parametrize('slip', [0.05, 0.2, 0.4, 0.65])
def test_tables_hold_what_the_model_of_steady_wheels_says(configuration, rover, steady, slip):
    wheels = configuration.wheels.wheel
    one = replace(wheels, **{k: np.atleast_1d(v)[:1] for k, v in vars(wheels).items()})
    points = OperatingPoints(
        slip=np.array([slip]),
        normal_load=np.array([steady.load]),
        wheel=one,
        gravity=np.array([rover.gravity]),
    )
    model = WheelSoilModel(configuration.soil, configuration.effects, method='closed_form')
    state = model.steady_state(points)
    at = np.array([slip]), np.zeros(1)
    radius = rover.slip_radius[0]
    # The bearing law of the filter has a triangle of stress, which carries up to 8 % less.
    assert steady.sinkage(*at)[0] == pytest.approx(state.sinkage[0], rel=0.08)
    assert steady.torques(at[1]).at(at[0])[0][0] == pytest.approx(
        state.torque[0] / (steady.load * radius), rel=0.07
    )
    assert steady.pull(*at)[0] == pytest.approx(state.drawbar_pull[0] / steady.load, abs=0.02)


speeds = st.floats(-0.3, 0.3).filter(lambda v: abs(v) > 0.02)


@settings(max_examples=60, deadline=None)
@given(
    rim=speeds,
    ground=speeds,
    sideways=st.floats(-0.1, 0.1),
    shift=st.tuples(st.floats(-0.2, 0.2), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_derivatives_of_the_coefficients(steady, rim, ground, sideways, shift):
    if abs(abs(rim) - abs(ground)) < 0.01:
        return  # driving and skidding meet there
    slip = (rim - ground) / max(abs(rim), abs(ground)) * np.sign(rim)
    if abs(np.clip(slip, -1.0, 1.0) - shift[0]) < 0.03:
        return  # so do shear forward and backward
    start = np.array([*shift, 0.1])

    def along(t, name):
        state = start + t * {'by_offset': np.eye(4)[0], 'by_log_scale': np.eye(4)[1]}.get(name, 0.0)
        moved = ground + (t if name == 'by_ground_speed' else 0.0)
        one = WheelSpeeds(np.array([rim]), np.array([moved]), np.array([sideways]))
        return coefficients(steady.torques(np.zeros(1)), state, one)

    for name, length in (('by_ground_speed', 2e-3), ('by_offset', 0.02), ('by_log_scale', 0.02)):
        t = np.linspace(0.0, length, 41)
        values = np.array([along(step, name).value[0] for step in t])
        slopes = np.array([getattr(along(step, name), name)[0] for step in t])
        # Integrated, since the table is linear between its slips.
        assert float(np.sum(0.5 * (slopes[1:] + slopes[:-1]) * np.diff(t))) == pytest.approx(
            values[-1] - values[0], abs=2e-3, rel=0.1
        )


def drive_of(steady, rover, slip, *, yaw_rate=0.0, state=None):
    """Return rims, headings and the demand of wheels that slip as told."""
    headings = straight_headings(rover)
    body = (1.0 - slip) * 0.1
    ground = np.array(headings.by_speed) * body + np.array(headings.by_yaw_rate) * yaw_rate
    rim = ground / (1.0 - slip)
    rims = rims_at(tuple(rim), headings, yaw_rate, 0.006)
    state = np.zeros(3 + rover.wheel_count) if state is None else state
    sideways = np.array(headings.side_by_yaw_rate) * yaw_rate
    level = np.zeros(rover.wheel_count)
    u = coefficients(steady.torques(level), state, WheelSpeeds(rim, ground, sideways))
    return rims, headings, u.value, body


@pytest.mark.parametrize('slip', [-0.1, 0.05, 0.3, 0.6])
@pytest.mark.parametrize('yaw_rate', [0.0, 0.03])
def test_the_speed_is_the_one_that_gives_the_torques(steady, rover, slip, yaw_rate):
    rims, headings, demand, body = drive_of(steady, rover, slip, yaw_rate=yaw_rate)
    load, level = np.ones(6) * steady.load, np.zeros(6)

    def found(state, demand=demand, **tuning):
        balance = TorqueBalance(
            *(steady, rims, headings, yaw_rate),
            demand=demand,
            load=load,
            stiffness=level,
            tuning=SolverTuning(**tuning),
        )
        return balance.solved(state, 0.1, 1e-4, 1e-4 * np.eye(9))

    at = found(np.zeros(9))
    assert rims.body - at.slip * rims.scale == pytest.approx(body, abs=2e-4)
    odd = demand.copy()
    odd[2] = 0.0  # a wheel in the air turns without a torque
    # It counts less than the others where they pull, though it is not left out.
    most = 0.9 if slip >= 0.3 else 1.01
    plain = found(np.zeros(9), odd, agreement=1e3).slip
    assert abs(found(np.zeros(9), odd).slip - at.slip) < most * abs(plain - at.slip)
    for k in (0, 1, 2, 5):
        step = 5e-3 * np.eye(9)[k]
        true = (found(step).slip - found(-step).slip) / 1e-2
        assert -at.mean.gradient[k] / at.mean.slope == pytest.approx(true, abs=0.05, rel=0.1)


def test_before_the_first_reference_a_smoothed_slip_changes_no_mixture():
    assert mixed((0.2, 0.01), HeldSlip(0.3, 0.02)) == (0.2, 0.01)


def test_a_softer_soil_sinks_deeper_and_another_soil_is_a_shift(steady):
    level = np.zeros(3)
    slips = np.array([0.1, 0.3, 0.6])
    assert np.all(steady.sinkage(slips, level - 0.5) > 1.1 * steady.sinkage(slips, level))
    stronger = steady.shift_to(strength=0.2)
    assert stronger.log_strength == pytest.approx(0.2, abs=0.06)
    longer = steady.shift_to(shear_modulus=0.3)
    assert longer.log_scale == pytest.approx(0.3, abs=0.1)


@pytest.mark.parametrize('name', ['A', 'B'])
def test_a_drive_is_known_better_than_by_no_slip_at_all_and_states_its_error(name):
    drive = SIMULATORS[name].simulate('cruise', 1003, 40.0, None)
    measurements = [a.measurement for a in drive.arrivals]
    sets, health = run_candidate(drive.configuration, measurements)
    assert health['filter_restarts'] == 0
    kept = record(sets, {})
    position = np.clip(np.searchsorted(kept.stamp, drive.truth.stamp), 0, len(kept.stamp) - 1)
    late = drive.truth.stamp > drive.truth.stamp[0] + 15e9
    rolling = late[:, None] & ~np.isnan(drive.truth.slip)
    error = (kept.slip[position] - drive.truth.slip)[rolling]
    std = kept.slip_std[position][rolling]
    assert np.sqrt(np.mean(error**2)) < 0.04
    assert np.mean(np.abs(error) < 1.96 * std) > 0.85
    sinkage = (kept.sinkage[position] - drive.truth.sinkage)[rolling]
    assert np.sqrt(np.mean(sinkage**2)) < 3e-3


def test_the_order_of_arrival_does_not_matter():
    drive = SIMULATORS['A'].simulate('cruise', 1004, 20.0, None)
    end = max(a.measurement.stamp for a in drive.arrivals)
    late = [  # what would come after the last set cannot be in it
        a.measurement
        for a in drive.arrivals
        if not (isinstance(a.measurement, ReferenceVelocity) and a.measurement.stamp > end - 3e9)
    ]
    by_stamp = sorted(late, key=lambda m: (m.stamp, isinstance(m, ReferenceVelocity)))
    runs = [run_candidate(drive.configuration, order)[0][-1] for order in (late, by_stamp)]
    assert runs[0].stamp == runs[1].stamp
    np.testing.assert_array_equal(runs[0].slip, runs[1].slip)
    np.testing.assert_array_equal(runs[0].drawbar_pull, runs[1].drawbar_pull)
