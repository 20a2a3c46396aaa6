# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover file that states little: the prior spans soils, torques scale, hard ground is no trap."""

from dataclasses import replace

import numpy as np
import pytest
from parts import step_inputs

from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.filter.initial_state import (
    LEAST_SHEAR_MODULUS_STD,
    SoilPriors,
    bounds,
    layout_of,
)
from wheel_terra_estimator.estimation.filter.state import SHEAR_MODULUS, SLIP_SINKAGE
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.wheel_soil_estimator import WheelSoilEstimator
from wheel_terra_lab.evaluation.runner import run_estimator
from wheel_terra_lab.evaluation.simulators import SIMULATORS

RADIUS, MASS, GRAVITY = 0.12, 40.0, 9.81
TEN_LINES = {
    'rover.mass': MASS,
    'wheels.names': ['fl', 'fr', 'ml', 'mr', 'rl', 'rr'],
    'wheels.radius': [RADIUS] * 6,
    'wheels.width': [0.1] * 6,
    'wheels.x': [0.4, 0.4, 0.0, 0.0, -0.4, -0.4],
    'wheels.y': [0.35, -0.35] * 3,
    'sensors.reference_rate': 0.5,
    'sensors.sinkage_std': 0.002,
    'sensors.torque_std': 0.1,
}
EFFECT = 'effects.slip_sinkage_exponent'
SLIP = 0.01  # of a wheel that rolls on hard ground
SPEED = 0.17  # [m/s]


def pressure(configuration, depth, width=0.1):
    """Plate pressure [Pa] by Bekker (1969) or Reece (1965)."""
    soil = configuration.soil
    if soil.pressure_law == 'bekker':
        modulus = soil.cohesive_modulus / width + soil.frictional_modulus
        return modulus * depth**soil.sinkage_exponent
    modulus = soil.cohesion * soil.cohesive_modulus
    modulus += soil.density * GRAVITY * width * soil.frictional_modulus
    return modulus * (depth / width) ** soil.sinkage_exponent


def test_the_prior_of_a_soil_that_nobody_states_is_the_spread_of_the_shipped_ones():
    found = []
    for path in sorted(shipped.find('soils/kls1_proxy').parent.glob('*.yaml')):
        configuration = reader.load(['generic_six_wheel', str(path)], [])
        assert configuration.soil_stated
        soil = configuration.soil
        found.append(
            (np.tan(soil.friction_angle), soil.shear_modulus, pressure(configuration, 0.01))
        )
    strength, modulus, stiffness = np.std(np.log(found), axis=0)
    priors = SoilPriors.from_configuration(reader.from_parameters(TEN_LINES))
    assert priors.strength_std == pytest.approx(strength, rel=0.1)
    assert priors.shear_modulus_std == pytest.approx(modulus, rel=0.1)
    assert priors.stiffness_std == pytest.approx(stiffness, rel=0.1)


def test_a_soil_that_somebody_states_is_known_as_well_as_he_says():
    stated = reader.from_parameters({**TEN_LINES, 'soil.shear_modulus': 0.02})
    prior = SoilPriors.from_configuration(stated).shear_modulus_std
    assert prior == pytest.approx(LEAST_SHEAR_MODULUS_STD)
    named = reader.from_parameters({**TEN_LINES, 'soil.name': 'beach'})
    assert not named.soil_stated


def bounds_of(**stated):
    """Return the bounds of the state, the configuration and the entries of stiffness."""
    configuration = reader.from_parameters({**TEN_LINES, **stated})
    rover = Rover.from_configuration(configuration)
    layout = layout_of(rover, SensorFigures.from_configuration(configuration))
    limits = bounds(rover, layout, SoilPriors.from_configuration(configuration))
    return limits, configuration, layout.stiffness


def test_hard_ground_may_be_stiffer_than_any_soil_but_no_ground_gives_way_by_decimetres():
    """Shear moduli of soils: 10 to 25 mm in sand, to 36 mm in the shipped ones but one."""
    limits, configuration, stiffness = bounds_of()
    factors = np.exp([limit[SHEAR_MODULUS] for limit in limits])
    low, high = configuration.soil.shear_modulus * factors
    assert low < 0.001
    assert 0.036 < high < 0.05
    # Three deviations of a soil that nobody states to either side.
    assert np.abs([limit[stiffness] for limit in limits]) == pytest.approx(np.full((2, 6), 3 * 1.3))


@pytest.mark.parametrize('n1', [0.0, 0.4])
def test_no_soil_lifts_a_wheel_that_slips(n1):
    """Every slip-sinkage law (Ding 2010, Lyasko 2010) has more sinkage at more slip."""
    (least, _), *_ = bounds_of(**({f'{EFFECT}.enabled': True, f'{EFFECT}.n1': n1} if n1 else {}))
    assert n1 + least[SLIP_SINKAGE] == pytest.approx(0.0)


@pytest.mark.parametrize('scale', [0.3, 3.0])
def test_torques_that_nobody_describes_scale_with_the_rover(scale):
    """A rover `scale` times as long of the same material: torques go with its fourth power."""
    bare = {key: value for key, value in TEN_LINES.items() if key != 'sensors.torque_std'}
    scaled = {
        **bare,
        'rover.mass': MASS * scale**3,
        'wheels.radius': [RADIUS * scale] * 6,
    }
    one, other = (
        SensorFigures.from_configuration(reader.from_parameters(values))
        for values in (bare, scaled)
    )
    for name in ('torque_std', 'torque_zero_std'):
        assert getattr(other, name) == pytest.approx(getattr(one, name) * scale**4)
    said = SensorFigures.from_configuration(reader.from_parameters(TEN_LINES))
    assert said.torque_std == TEN_LINES['sensors.torque_std']


def rolling(rng, seconds):
    """Measurements of a rover that rolls on hard, level ground, in order of their stamps."""
    load = MASS * GRAVITY / 6
    zero = rng.normal(0.0, 0.002, 6)  # of the sinkage sensors [m]
    for k in range(round(20 * seconds)):
        t = k / 20
        stamp = round(t * 1e9)
        rim = SPEED * min(max(t - 2.0, 0.0), 1.0)
        pushed = 0.03 * load * RADIUS * (rim > 0.0)  # rolling resistance
        yield WheelOdometry(
            stamp,
            rim / RADIUS + 0.005 * rng.standard_normal(6) * (rim > 0.0),
            pushed + 0.1 * rng.standard_normal(6),
        )
        force = np.array([0.03, 0.0, GRAVITY]) + 0.05 * rng.standard_normal(3)
        yield InertialReading(stamp, force, 0.003 * rng.standard_normal(3), None)
        if k % 2 == 0:
            yield SinkageReading(stamp, 5e-4 + zero + 0.002 * rng.standard_normal(6))
        if k % 40 == 20:
            speed = (1.0 - SLIP) * rim
            yield ReferenceVelocity(stamp, speed + 0.01 * rng.standard_normal(), 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize('seed', [1, 2])
def test_sinkage_readings_below_their_zero_stop_no_rover_on_hard_ground(seed):
    core = EstimatorCore(reader.from_parameters(TEN_LINES))
    sets = []
    for measurement in rolling(np.random.default_rng(seed), 20.0):
        sets += core.add(measurement)
    sets += core.flush()
    assert not any(s.stuck for s in sets)
    slip = np.array([s.slip for s in sets if s.stamp > 8e9])
    assert np.sqrt(np.mean((slip - SLIP) ** 2)) < 0.06


@pytest.mark.parametrize(
    ('stated', 'torque', 'known'),
    [({}, False, False), ({}, True, True), ({'soil.shear_modulus': 0.01}, False, True)],
)
def test_wheel_rates_and_imu_give_no_slip_on_a_soil_that_nobody_states(stated, torque, known):
    """The pull of level ground is 0 at a slip of 0 in dense sand, of 0.5 in loose snow."""
    configuration = reader.from_parameters({**TEN_LINES, **stated})
    seen = []
    for reading in rolling(np.random.default_rng(3), 20.0):
        if isinstance(reading, WheelOdometry) and not torque:
            reading = replace(reading, torque=np.full(6, np.nan))
        if not isinstance(reading, ReferenceVelocity):
            seen.append(reading)
    sets, _ = run_estimator(configuration, seen)
    assert (sets[-1].slip_std.max() < configuration.filter.class_std) == known


def test_the_loads_of_a_suspension_that_nobody_states_are_open():
    """Six wheels may hang on a bogie: hub loads by its levers, taken by hand."""
    unstated = Rover.from_configuration(reader.from_parameters(TEN_LINES))
    rigid = np.array(unstated.load.loads((0.0, 0.0, GRAVITY)))
    # Level, at rest: pivot of the bogie 0.04 m in front of the middle of its two wheels, centre of
    # gravity above the middle wheels.
    half, front, bogie = 0.5 * MASS * GRAVITY, 0.4, -0.16
    on_bogie = half * front / (front - bogie)
    middle = on_bogie * (bogie + 0.4) / 0.4
    hung = np.repeat([half - on_bogie, middle, on_bogie - middle], 2)
    off = np.abs(hung - rigid) / rigid.mean()
    assert off.max() > 0.1
    assert np.sqrt(np.mean(off**2)) < 1.5 * unstated.load_std


@pytest.mark.parametrize('stated', [{'rover.load_std': 0.03}, {'rover.suspension': 'rigid'}])
def test_loads_that_a_file_states_are_believed(stated):
    stated = Rover.from_configuration(reader.from_parameters({**TEN_LINES, **stated}))
    four = {k: v[:4] if isinstance(v, list) else v for k, v in TEN_LINES.items()}
    assert stated.load_std == Rover.from_configuration(reader.from_parameters(four)).load_std
    assert stated.load_std == pytest.approx(0.03)


@pytest.mark.parametrize(
    ('wheels', 'stated', 'std'),
    [
        (4, {'rover.suspension': 'rigid'}, 0.2),
        (4, {'rover.suspension': 'shares'}, 0.0),
        (3, {}, 0.0),
        (4, {'rover.load_std': 0.05}, 0.0),
    ],
)
def test_loads_are_open_where_no_balance_gives_them(wheels, stated, std):
    """Published with the loads, as the balance's own deviation is."""
    rover = {k: v[:wheels] if isinstance(v, list) else v for k, v in TEN_LINES.items()}
    configuration = reader.from_parameters({**rover, **stated})
    told = Rover.from_configuration(configuration)
    assert told.indeterminate_load_std == pytest.approx(std)
    estimator = WheelSoilEstimator(configuration)
    estimator.step(*step_inputs(0.0, np.ones(wheels), np.ones(wheels)))
    published = estimator.estimates().normal_load_std / (MASS * GRAVITY / wheels)
    assert published == pytest.approx(np.full(wheels, np.hypot(std, told.load_std)), rel=0.02)


@pytest.mark.slow
def test_published_loads_of_a_rigid_chassis_hold_on_uneven_ground():
    """Simulator C: there they are off by 0.15 of the mean load."""
    drive = SIMULATORS['C'].simulate('climb', 5142, 9.0, None)
    estimates, _ = run_estimator(drive.configuration, [a.measurement for a in drive.arrivals])
    truth = drive.truth
    row = {stamp: i for i, stamp in enumerate(truth.stamp.tolist())}
    errors = np.array(
        [
            (e.normal_load - truth.normal_load[row[e.stamp]]) / e.normal_load_std
            for e in estimates
            if e.stamp in row and truth.wheel_rate[row[e.stamp]].min() > 0.1
        ]
    )
    assert len(errors) > 50
    assert np.mean(np.abs(errors) < 1.96) > 0.9
