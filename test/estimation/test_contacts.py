# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels on the ground: turning, wheels without load or standing, smoothed slopes, pulls."""

import math
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from parts import straight_headings
from scipy.optimize import minimize_scalar

from wheel_terra_estimator.estimation.contacts.contact_age import (
    VARIANCE_AT_ONE_LENGTH,
    VARIANCE_DECAY,
    ContactAge,
)
from wheel_terra_estimator.estimation.contacts.demand import Demand
from wheel_terra_estimator.estimation.contacts.linearisation import Linearisation, turning_wheels
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.pulls import (
    KnownSum,
    PullEvidence,
    Pulls,
    distributed,
)
from wheel_terra_estimator.estimation.contacts.ruts import Ruts, curvature_of
from wheel_terra_estimator.estimation.contacts.stationary_wheels import StationaryWheels
from wheel_terra_estimator.estimation.contacts.steering import headings
from wheel_terra_estimator.estimation.contacts.turning import Turning, sides_oppose
from wheel_terra_estimator.estimation.contacts.unloaded_wheels import UnloadedWheels
from wheel_terra_estimator.estimation.contacts.wheel_models import WheelStates
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    RUT_SHARE,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SPEED,
)
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.sideways import Sideways

NAN = float('nan')
FORWARD = (0.05,) * 6


def window(yaw=0.0, pitch=0.0, force=(0.0, 0.0, 9.8), readings=5):
    return InertialWindow(
        readings,
        *(readings * f for f in force),
        yaw_rate=readings * yaw,
        pitch_rate=readings * pitch,
        rate_readings=readings,
    )


# -- Turning ----------------------------------------------------------------------------------


def turned(parts, yaw, seconds=10.0, pitch=0.0, speed=0.05):
    turning = Turning(parts.rover, parts.sensors)
    for _ in range(round(10 * seconds)):
        turning.update(
            window(yaw, pitch), 0.1, speed, 0.05, straight_headings(parts.rover), FORWARD
        )
    return turning


def test_the_lateral_motion_is_that_of_the_outer_wheels(parts):
    turning = turned(parts, 0.05)
    side = 0.05 * parts.rover.curvature_length / 0.05
    assert turning.state.yaw_rate == pytest.approx(0.05)
    assert turning.state.lateral_motion == pytest.approx(side)
    assert turned(parts, 0.0).state.lateral_motion == 0.0


def test_ground_that_curves_upwards_turns_the_nose_up(parts):
    curvature = turned(parts, 0.0, seconds=60.0, pitch=-0.05 * 0.05).curvature(0.05)
    assert 0.8 * 0.05 < curvature < 0.05  # a little less: the gyro's zero could be part of it
    assert turned(parts, 0.0, pitch=-0.05 * 0.05).curvature(0.0005) < 0.01
    assert turned(parts, 0.0, seconds=0.2).curvature(0.05) == 0.0


# -- Starts and reversals ---------------------------------------------------------------------


def test_a_reversal_begins_a_new_contact(parts):
    age = ContactAge(parts.rover)
    assert not age.update(NAN)
    assert not age.update(0.0)
    assert not age.update(0.05)  # the first drive reverses none
    age.advance(1.0)
    assert age.settled
    assert not age.update(0.05)
    assert age.update(-0.05)
    assert not age.settled
    age.advance(1.0)
    late = age.shear_variance
    age.stop()
    assert age.state.travel == 0.0
    assert not age.update(-0.05)
    assert age.shear_variance > 100.0 * late


# -- Steering -----------------------------------------------------------------------------------


def rigid_body(rover, angles, speed, side, yaw_rate):
    """Return the speed of each hub along and across its wheel, from the cross product."""
    hubs = np.column_stack([rover.longitudinal, rover.lateral, np.zeros(rover.wheel_count)])
    velocity = np.array([speed, side, 0.0]) + np.cross([0.0, 0.0, yaw_rate], hubs)
    ahead = np.column_stack([np.cos(angles), np.sin(angles)])
    left = np.column_stack([-np.sin(angles), np.cos(angles)])
    return (velocity[:, :2] * ahead).sum(axis=1), (velocity[:, :2] * left).sum(axis=1)


def test_any_steering_is_that_of_a_rigid_body_which_slides_least(parts):
    rng = np.random.default_rng(3)
    angles, speed, yaw_rate = rng.uniform(-0.6, 0.6, 6), 0.05, 0.04
    found = headings(parts.rover, angles.tolist())

    def sliding(drift):
        return (rigid_body(parts.rover, angles, speed, drift, yaw_rate)[1] ** 2).sum()

    least = minimize_scalar(sliding, bounds=(-0.1, 0.1), method='bounded', options={'xatol': 1e-9})
    along, aside = rigid_body(parts.rover, angles, speed, least.x, yaw_rate)
    speeds = found.speeds(speed, yaw_rate).tolist()
    assert speeds == pytest.approx(along.tolist(), abs=1e-5)
    assert found.side_speeds(speed, yaw_rate) == pytest.approx(aside.tolist(), abs=1e-5)


def test_wheels_that_roll_ask_for_the_speed_of_the_body(parts):
    """All axles steer about a point 2 m to the left: rim speeds are the distances from it."""
    rover, yaw_rate = parts.rover, 0.03
    ahead, aside = np.array(rover.longitudinal), 2.0 - np.array(rover.lateral)
    found, rims = (
        headings(rover, np.arctan2(ahead, aside).tolist()),
        yaw_rate * np.hypot(ahead, aside),
    )
    asked = [found.body_speed(i, rim, yaw_rate) for i, rim in enumerate(rims)]
    assert asked == pytest.approx([2.0 * yaw_rate] * 6)
    assert math.isnan(found.body_speed(0, NAN, yaw_rate))


def followed(parts, rims_told):
    """Return the errors of the yaw rate through a turn that begins within a second [rad/s]."""
    turning, straight = Turning(parts.rover, parts.sensors), straight_headings(parts.rover)
    errors = []
    for yaw in np.concatenate([np.zeros(10), np.linspace(0.0, 0.03, 11), np.full(10, 0.03)]):
        # A rover that skids turns at a share of what its wheels ask for.
        rims = tuple([0.05 - yaw / 0.6 * y if rims_told else NAN for y in parts.rover.lateral])
        state = turning.update(window(yaw), 0.1, 0.05, 0.05, straight, rims)
        errors.append(abs(state.yaw_rate - yaw))
    return errors


def test_a_turn_that_begins_is_told_by_the_wheels_without_delay(parts):
    assert max(followed(parts, rims_told=False)) > 0.001
    assert max(followed(parts, rims_told=True)) < 1e-9


def test_a_wheel_that_spins_up_alone_is_no_turn(parts):
    turning, straight = turned(parts, 0.0), straight_headings(parts.rover)
    rims = (0.15, *FORWARD[1:])
    asked = 0.6 * straight.yaw_rate(rims)
    found = [
        turning.update(window(0.0), 0.1, 0.05, 0.15, straight, rims).yaw_rate for _ in range(10)
    ]
    assert abs(asked) > 0.01
    assert abs(found[0]) < 0.5 * abs(asked)  # the gyro knows better
    assert abs(found[-1]) < 0.1 * abs(asked)


def test_without_a_gyro_the_sides_tell_the_yaw_rate(parts):
    """Wheels that roll: exact. A rover that has to skid turns less, by an unknown share."""
    straight = straight_headings(parts.rover)
    rims = tuple([0.05 - 0.04 * y for y in parts.rover.lateral])
    assert straight.yaw_rate(rims) == pytest.approx(0.04)
    turning = Turning(parts.rover, parts.sensors)
    turning.update(InertialWindow(), 0.1, 0.05, 0.06, straight, rims, gyro_silent=True)
    assert turning.state.yaw_rate == pytest.approx(0.6 * 0.04)
    assert turning.state.yaw_rate_std > 0.3 * turning.state.yaw_rate
    # With a gyro nothing but their changes count.
    turning.update(window(0.01), 0.1, 0.05, 0.06, straight, rims)
    assert turning.state.yaw_rate < 0.6 * 0.04


# -- What the ground asks -----------------------------------------------------------------------


def test_the_demand_gives_its_changes_and_nothing_but_them():
    demand = Demand()
    assert demand.update(0.05, 0.1, settled=True) == 0.0  # the level is no change
    changes = [demand.update(0.15, 0.1, settled=True) for _ in range(40)]
    assert changes[0] > changes[1] > 0.0
    assert sum(changes) == pytest.approx(0.10, rel=1e-3)
    # Nor is a start, nor what nobody knows.
    for asked, settled in ((0.30, False), (0.30, True), (NAN, True)):
        assert demand.update(asked, 0.1, settled=settled) == 0.0
    assert demand.state == 0.30


# -- Wheels without load ----------------------------------------------------------------------


def lifted(parts, torque, steps, lateral_motion=0.0, rims=FORWARD, found=None, start=0):
    found = found or UnloadedWheels(parts.rover, parts.sensors)
    for i in range(start, start + steps):
        given = {'torque': torque, 'lateral_motion': lateral_motion}
        found.update(parts.cycle(rims, time=0.1 * i, **given))
    return found


def test_a_wheel_without_torque_carries_nothing_and_is_taken_back(parts):
    up, down = (0.5, *(10.0,) * 5), (10.0,) * 6
    found = lifted(parts, up, 3)
    assert not any(found.state.unloaded)  # not at once
    lifted(parts, up, 3, found=found, start=3)
    assert found.state.unloaded == (True, *(False,) * 5)
    lifted(parts, down, 6, found=found, start=6)
    assert not any(found.state.unloaded)


@pytest.mark.parametrize(
    'changes',
    [
        {'lateral_motion': 0.5},  # turns part the torques
        {'rims': (0.01, *(0.05,) * 5)},  # a slower wheel is held
        {'rims': (0.05, -0.05) * 3},  # wheels against each other have no middle rim speed
        {'torque': (0.01, *(0.2,) * 5)},  # too little torque to compare
    ],
)
def test_no_wheel_is_called_unloaded_where_torque_does_not_tell(parts, changes):
    given = {'torque': (0.5, *(10.0,) * 5), **changes}
    assert not any(lifted(parts, steps=20, **given).state.unloaded)


def test_the_load_of_an_unloaded_wheel_goes_to_the_others(parts):
    loads, zero = WheelLoads(parts.rover), (0.0,) * 6
    straight = straight_headings(parts.rover)
    level = loads.update(window(), zero, zero, (False,) * 6, straight)
    without = loads.update(window(), zero, zero, (True, *(False,) * 5), straight)
    assert without.load[0] == 0.0
    assert sum(without.load) == pytest.approx(sum(level.load))
    assert loads.update(InertialWindow(), zero, zero, (False,) * 6, straight) == without  # held


def test_vibration_does_not_shake_the_loads(parts):
    """White noise of half of gravity in each cycle of 0.1 s leaves 3 % of it in the slope."""
    loads, zero, rng = WheelLoads(parts.rover), (0.0,) * 6, np.random.default_rng(1)
    g = parts.rover.gravity
    shaken = window()._replace(noise_density=0.1 * (0.5 * g) ** 2, duration=0.1)
    shares = []
    for noise in 0.5 * g * rng.normal(size=4000):
        given = shaken._replace(force_x=noise, force_z=g)
        loads.update(given, zero, zero, (False,) * 6, straight_headings(parts.rover))
        shares.append(loads.state.slope_share)
    assert np.std(shares[1000:]) == pytest.approx(0.03, rel=0.2)


# -- Wheels that stand ------------------------------------------------------------------------


def standing_pull(parts, *given, **named):
    return standing_wheel(parts, *given, **named).expected


def standing_wheel(parts, torque, speed, lateral_motion=0.0, speed_std=0.0, others=0.0):
    x = parts.filter().x.copy()
    x[SPEED] = speed
    wheels = StationaryWheels(parts.rover, parts.sensors, parts.layout, parts.models)
    n = parts.rover.wheel_count
    rims, turns = (0.0,) + (others,) * (n - 1), (False,) * n
    cycle = parts.cycle(
        rims, (60.0,) * n, turns=turns, torque=(torque,) * n, lateral_motion=lateral_motion
    )
    return wheels.update(x, speed_std, cycle)[0]


def test_a_dragged_wheel_is_a_drag_by_its_torque_whatever_its_jammed_drive_reads(parts):
    for torque in (-8.0, 20.0):
        assert standing_pull(parts, torque, 0.05) < -0.2 * 60.0
        assert standing_pull(parts, -torque, -0.05) > 0.2 * 60.0
    assert standing_pull(parts, -8.0, 0.05) < standing_pull(parts, -4.0, 0.05) - 5.0
    # In a turn a torque against the drag may be the soil's.
    straight, turn = (standing_pull(parts, 8.0, 0.05, side) for side in (0.0, 0.5))
    assert turn > straight + 5.0


def test_torque_over_radius_is_the_pull_of_a_wheel_that_holds_a_standing_rover(parts):
    assert standing_pull(parts, 3.0, 0.0) == pytest.approx(3.0 / parts.rover.shear_radius[0])
    assert standing_pull(parts, 1e3, 0.0) == 60.0  # no soil gives more than the load
    # A speed within its own deviation is no slide where no wheel turns.
    slow = {'torque': 3.0, 'speed': -0.004, 'speed_std': 0.003}
    assert standing_pull(parts, **slow) == standing_pull(parts, 3.0, 0.0)
    drags = standing_pull(parts, 3.0, -0.004)
    assert standing_pull(parts, **slow, others=0.05) == drags


def test_a_wheel_that_stands_without_a_torque_may_be_dragged(parts):
    """It may also roll beside a dead encoder: both, and a rover that stands, are within 2 std."""
    whole = standing_pull(parts, -8.0, 0.05)
    for direction in (1.0, -1.0):
        dragged = standing_wheel(parts, NAN, 0.05 * direction)
        assert dragged.unread
        for pull in (0.0, direction * whole):
            assert abs(dragged.expected - pull) < 2.0 * dragged.std
        assert dragged.expected * direction < -0.1 * 60.0
    held = standing_wheel(parts, NAN, 0.0)
    assert (held.expected, held.unread) == (0.0, True)
    assert not standing_wheel(parts, -8.0, 0.05).unread


@pytest.mark.parametrize('way', [1.0, -1.0])
def test_a_wheel_that_stalls_beside_spinning_ones_has_the_pull_of_its_torque(parts, way):
    """At slip 1 torque and pull follow from one another, whatever the strength of the soil."""
    rims, loads = tuple(way * r for r in (*(0.07,) * 5, 0.0036)), (60.0,) * 6
    turns = turning_wheels(parts.rover, rims, loads)
    assert turns == (True,) * 5 + (False,)
    x = parts.filter().x.copy()
    spun = WheelStates(0.0, x[parts.layout.sinkage], np.array(loads), 0.2, 0.0)
    torque, pull = parts.models.torque_and_pull(spun)
    wheels = StationaryWheels(parts.rover, parts.sensors, parts.layout, parts.models)
    x[SPEED] = -0.003 * way  # within what is known of a rover that is stuck
    cycle = parts.cycle(rims, loads, turns=turns, torque=tuple((way * torque).tolist()))
    expected = wheels.update(x, 0.003, cycle)
    assert expected[5].expected == pytest.approx(way * float(pull[5]), rel=0.02)
    assert expected[:5] == [None] * 5
    # One that is dragged, or turns the other way, is locked.
    for speed, last in ((0.05 * way, 0.0036 * way), (-0.003 * way, -0.0036 * way)):
        x[SPEED] = speed
        locked, turned = (
            wheels.update(x, 0.001, cycle._replace(rims=(*rims[:5], rim)))[5] for rim in (0.0, last)
        )
        assert turned == locked


# -- Linearisation ----------------------------------------------------------------------------


RUTS = (0.0, 0.0, 0.02, 0.02, 0.025, 0.2)  # the last one deeper than its wheel stands


def forces_at(parts, ruts=RUTS, **moved):
    """Return the forces at slip 0.3 and sinkages of 3 cm, state entries moved by so much."""
    ekf, layout = parts.filter(), parts.layout
    linearisation = Linearisation(parts.rover, layout, parts.models, 0.05)
    x = ekf.x
    x[SPEED], x[layout.sinkage], x[RUT_SHARE] = 0.7 * 0.05, 0.03, 0.5
    for name, change in moved.items():
        x[ENTRIES[name](layout)] += change
    cycle = parts.cycle(FORWARD)
    for _ in range(40):  # the slopes are means over a second
        forces = linearisation.update(x, cycle, ruts)
    return forces


ENTRIES = {
    'speed': lambda layout: SPEED,
    'strength': lambda layout: SHEAR_STRENGTH,
    'modulus': lambda layout: SHEAR_MODULUS,
    'centroid': lambda layout: CENTROID,
    'rut_share': lambda layout: RUT_SHARE,
    'sinkage': lambda layout: range(layout.size)[layout.sinkage],
}


@pytest.fixture(scope='module')
def here(parts):
    return forces_at(parts)


@pytest.mark.parametrize(
    ('name', 'step'), [(n, 1e-5 if n in {'speed', 'sinkage'} else 1e-3) for n in ENTRIES]
)
def test_rows_are_the_derivatives_of_torque_and_pull(parts, here, name, step):
    up, down = (forces_at(parts, **{name: side * step}) for side in (1.0, -1.0))
    columns = np.zeros(parts.layout.size)
    columns[ENTRIES[name](parts.layout)] = 1.0
    for rows, more, less in (
        (here.torque_rows, up.torque, down.torque),
        (here.pull_rows, up.pull, down.pull),
    ):
        slopes = (more - less) / (2.0 * step)
        assert rows @ columns == pytest.approx(slopes, rel=0.02, abs=1e-3 * abs(slopes).max())
    pulls, torques = here.moved_to(here.state)
    assert pulls == pytest.approx(here.pull)
    assert torques == pytest.approx(here.torque)


@pytest.mark.parametrize('std', [0.0005, 0.01])
def test_the_noise_of_a_rim_speed_is_one_of_its_torque_and_pull_and_may_hide_the_soil(parts, std):
    x = parts.filter().x
    x[SPEED], x[parts.layout.sinkage] = 0.7 * 0.05, 0.03

    def at(rim):
        linearisation = Linearisation(parts.rover, parts.layout, parts.models, 0.05)
        return linearisation.update(x, parts.cycle((rim,) * 6, rim_noise=(std,) * 6), (0.0,) * 6)

    here, faster, slower = at(0.05), at(0.05 + 1e-5), at(0.05 - 1e-5)
    for noise, more, less in (
        (here.torque_noise, faster.torque, slower.torque),
        (here.pull_noise, faster.pull, slower.pull),
    ):
        assert noise == pytest.approx(np.abs(more - less) / 2e-5 * std, rel=0.02)
    loads = WheelLoads(parts.rover).state.load
    relative = here.torque_noise / (np.array(loads) * parts.rover.shear_radius)
    assert here.blurred is bool(np.median(relative) > 0.05) is (std > 0.001)


def test_a_wheel_in_a_rut_has_the_contact_of_one_that_stands_so_much_higher(parts):
    in_rut = forces_at(parts, ruts=(0.02,) * 6)
    higher = forces_at(parts, ruts=(0.0,) * 6, sinkage=-0.5 * 0.02)
    assert in_rut.torque == pytest.approx(higher.torque)
    assert in_rut.pull == pytest.approx(higher.pull)


# -- Ruts -------------------------------------------------------------------------------------

DEPTHS = (0.02, 0.02, 0.03, 0.03, 0.04, 0.04)  # of the front, middle and rear axle


def test_wheels_meet_the_ruts_of_those_before_them(parts):
    ruts = Ruts(parts.rover)
    ruts.advance(0.01, 1.0, DEPTHS, 0.0)
    assert ruts.state.depth == (0.0, 0.0, 0.02, 0.02, 0.03, 0.03)
    for _ in range(1000):  # the front axle comes to firm ground; the others follow
        ruts.advance(0.01, 1.0, (0.0,) * 6, 0.0)
    assert ruts.state.depth == pytest.approx((0.0,) * 6, abs=1e-3)


def test_ruts_come_a_wheelbase_later(parts):
    """The mean of the delay is the way from wheel to wheel."""
    ruts, rover = Ruts(parts.rover), parts.rover
    ruts.advance(0.0, 1.0, DEPTHS, 0.0)
    step, met = 0.005, []
    for _ in range(2000):
        ruts.advance(step, 1.0, (0.0, 0.0, *DEPTHS[2:]), 0.0)
        met.append(ruts.state.depth[2] / DEPTHS[0])
    assert sum(met) * step == pytest.approx(rover.longitudinal[0] - rover.longitudinal[2], rel=0.02)


def test_in_a_turn_wheels_run_beside_the_ruts(parts):
    ruts, rover = Ruts(parts.rover), parts.rover
    reach = abs(rover.longitudinal[2] ** 2 - rover.longitudinal[0] ** 2)
    width = rover.width[2]
    # Paths about one centre lie (x_1^2 - x_2^2) / (2 R) apart: here half a width.
    ruts.advance(0.01, 1.0, DEPTHS, width / reach)
    assert ruts.state.depth[2] == pytest.approx(0.5 * DEPTHS[0], rel=0.01)
    ruts = Ruts(parts.rover)
    ruts.advance(0.01, 1.0, DEPTHS, 3.0 * width / reach)
    assert ruts.state.depth[2] == 0.0
    assert curvature_of(-0.05, 0.1) == pytest.approx(2.0)
    assert curvature_of(0.0, 0.1) < math.inf


def test_behind_a_reversal_all_wheels_roll_in_ruts_at_first(parts):
    ruts = Ruts(parts.rover)
    for _ in range(100):
        ruts.advance(0.01, 1.0, DEPTHS, 0.0)
    ruts.advance(0.01, -1.0, DEPTHS, 0.0)
    assert ruts.state.depth == DEPTHS
    for _ in range(1000):
        ruts.advance(0.01, -1.0, DEPTHS, 0.0)
    # The rear axle leads over virgin ground.
    behind = (DEPTHS[2], DEPTHS[2], DEPTHS[4], DEPTHS[4], 0.0, 0.0)
    assert ruts.state.depth == pytest.approx(behind, abs=1e-3)


# -- Pulls ------------------------------------------------------------------------------------


def test_the_residuals_of_known_sums_are_distributed_as_least_squares_does():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(6, 6))
    covariance = root @ root.T
    pulls = rng.normal(scale=20.0, size=6)
    shares, variances = rng.normal(size=(2, 6)), np.array([2.0, 0.5])
    sums = shares @ pulls + np.array([6.0, -3.0])
    known = [KnownSum(*each) for each in zip(shares, sums, variances, strict=True)]
    found = distributed(pulls, covariance, known, (300.0,) * 6)
    # Six priors and two sums, each row in units of its own deviation.
    whiten, deviations = np.linalg.inv(np.linalg.cholesky(covariance)), np.sqrt(variances)
    rows = np.vstack([whiten, shares / deviations[:, None]])
    values = np.append(whiten @ pulls, sums / deviations)
    assert found == pytest.approx(np.linalg.lstsq(rows, values, rcond=None)[0])


def published_pulls(parts, forces, cycle, excess=NAN, cycles=1, aside=None, load_std=None):
    """Pulls after cycles in which all torques read `excess` more than the model."""
    rover = parts.rover if load_std is None else replace(parts.rover, load_std=load_std)
    pulls = Pulls(rover, parts.sensors, parts.layout, (300.0,) * 6)
    readings = tuple((forces.torque + excess).tolist())
    evidence = PullEvidence(forces, None, cycle, readings, (None,) * 6, aside, tilt_std=0.0)
    for _ in range(cycles):
        pulls.update(forces.state, 1e-9 * np.eye(len(forces.state)), evidence, tilt=0.0)
    return pulls.state


def test_a_pull_is_as_open_as_its_load(parts, here):
    """A load that is off by a share of the mean one takes as much of its pull along."""
    cycle = parts.cycle()
    states = [published_pulls(parts, here, cycle, load_std=share) for share in (0.05, 0.2)]
    of_load = 300.0 * np.array(states[0].pull) / cycle.loads.load
    more = np.square(states[1].std) - np.square(states[0].std)
    assert more == pytest.approx((0.2**2 - 0.05**2) * of_load**2, rel=1e-6)
    # One that seems in the air, on a climb of 20 degrees: a third of what its load is off by.
    cycle = parts.cycle(loads=(0.0, *(360.0,) * 5), turns=(False, *(True,) * 5))
    climb = cycle._replace(loads=cycle.loads._replace(force=(3.4, 0.0, 9.2)))
    lifted = published_pulls(parts, here, climb)
    assert lifted.pull[0] == 0.0
    assert lifted.std[0] == pytest.approx(300.0 * parts.rover.load_std * 3.4 / 9.2, rel=1e-3)


def test_a_pull_is_as_open_as_the_zero_of_its_sinkage_sensor(parts, here):
    """The strength that explains the torque goes along: pull less torque times their ratio."""
    cycle, stds = parts.cycle(), []
    for zero in (0.0, 0.005):
        other = copy(parts)
        other.sensors = replace(parts.sensors, sinkage_zero_std=zero)
        stds.append(np.array(published_pulls(other, here, cycle).std))
    ratio = here.pull_rows[:, SHEAR_STRENGTH] / here.torque_rows[:, SHEAR_STRENGTH]
    z = parts.layout.sinkage
    by_sinkage = np.diagonal(here.pull_rows[:, z]) - ratio * np.diagonal(here.torque_rows[:, z])
    assert stds[1] ** 2 - stds[0] ** 2 == pytest.approx((0.005 * by_sinkage) ** 2, rel=1e-6)
    assert (stds[1] > stds[0]).all()


def published_pull(parts, here, excess, lateral_motion=0.0, aside=None):
    cycle = parts.cycle(lateral_motion=lateral_motion)
    return np.array(published_pulls(parts, here, cycle, excess, 40, aside).pull)


def test_the_pull_follows_a_torque_that_the_model_does_not_explain(parts, here):
    pull = published_pull(parts, here, 6.0)
    gain = here.pull_rows[:, SHEAR_STRENGTH] / here.torque_rows[:, SHEAR_STRENGTH]
    assert pull - here.pull == pytest.approx(6.0 * gain, rel=0.2)
    # In a turn, too; what the sensor's zero may be is not believed.
    assert published_pull(parts, here, 6.0, lateral_motion=0.5) == pytest.approx(pull)
    assert published_pull(parts, here, 0.05) == pytest.approx(here.pull, abs=1e-3)
    # James and Stein (1961) by hand: 1 - 2 noise / excess^2, the noise the sensor's zero alone.
    parts = copy(parts)
    parts.sensors = replace(parts.sensors, torque_std=0.0, torque_gain_std=0.0, torque_zero_std=1.0)
    half = published_pull(parts, here, 2.0)  # 1 - 2 * 1^2 / 2^2 = 0.5
    assert half - here.pull == pytest.approx(1.0 * gain, rel=1e-2)


def test_in_a_steady_turn_the_moments_of_pulls_and_lateral_forces_cancel(parts, here):
    parts = copy(parts)
    parts.sensors = replace(parts.sensors, sinkage_zero_std=0.0)  # pulls are known alike
    x, y = np.array(parts.rover.longitudinal), np.array(parts.rover.lateral)
    plain = published_pull(parts, here, 0.0)
    known = Sideways.unknown((60.0,) * 6)
    for force in (-20.0 * np.sign(x), 5.0 * x):
        aside = replace(known, force=tuple(force), force_std=(1e-6,) * 6)
        pull = published_pull(parts, here, 0.0, aside=aside)
        assert np.sum(x * force - y * pull) == pytest.approx(0.0, abs=1e-6)
        assert pull.sum() == pytest.approx(plain.sum(), abs=0.5)
    # base_link elsewhere on the same rover.
    moved = copy(parts)
    centre = (0.6, 0.0, 0.0)
    moved.rover = replace(parts.rover, longitudinal=tuple(x + 0.6), centre_of_gravity=centre)
    assert published_pull(moved, here, 0.0, aside=aside) == pytest.approx(pull)
    doubted = replace(aside, force_std=(1e6,) * 6)
    assert published_pull(moved, here, 0.0, aside=doubted) == pytest.approx(plain, abs=1e-6)


def test_contacts_form_within_their_length_and_their_doubt_falls_from_there_on(parts):
    age, half_formed, variances = ContactAge(parts.rover), [], []
    for _ in range(4):
        half_formed.append(age.half_formed)
        age.advance(0.4 * parts.rover.contact_length)
    assert half_formed == [False, False, True, False]  # from half of their length to all of it
    age = ContactAge(parts.rover)
    for _ in range(3):
        age.advance(parts.rover.contact_length)
        variances.append(age.shear_variance)
    assert variances == pytest.approx(
        VARIANCE_AT_ONE_LENGTH * np.exp(-VARIANCE_DECAY * np.arange(3))
    )


@pytest.mark.parametrize(
    ('rims', 'spins'),
    [
        ((-0.1, -0.1, -0.1, 0.1, 0.1, 0.1), True),
        ((-0.1, 0.1, -0.1, 0.06, 0.06, math.nan), True),  # one wheel of a side decides nothing
        ((-0.04, -0.04, -0.04, 0.1, 0.1, 0.1), False),  # a sharp turn about a wheel's side
        ((0.1, 0.1, 0.1, 0.1, 0.1, -0.1), False),
        ((math.nan,) * 3 + (0.1,) * 3, False),
    ],
)
def test_sides_that_turn_against_each_other_ask_for_a_spin(rims, spins):
    assert sides_oppose(rims, (-0.3,) * 3 + (0.3,) * 3) is spins
