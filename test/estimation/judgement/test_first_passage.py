# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The probability of a first passage against simulated paths, and what moves it."""

import math

import numpy as np
import pytest
from parts import SAND

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.judgement.entrapment import ENTRAPPED_SLIP
from wheel_terra_estimator.estimation.judgement.stuck.forecast import (
    DIGGING,
    RETURN_LENGTH,
    SCATTER,
    TRAVELS,
    TYPICAL_SLIP,
    TYPICAL_STD,
    StuckSettings,
    outlook,
    passage_probability,
)
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    Memory,
    RoverMotion,
    Situation,
    WheelMotion,
    driving_share,
)

RIM = 0.05  # [m/s]
DEFAULTS = StuckSettings.from_configuration(reader.load(SAND))


def motion(slip, sunk=0.01, std=0.03, radius=0.12):
    wheel = WheelMotion(slip, std, RIM, True, math.nan, sunk, radius)
    return RoverMotion(RIM * (1.0 - slip), True, (wheel,) * 6)


def followed(motions):
    """Return the situation at the end of motions that are 0.1 s apart."""
    memory = Memory()
    for i, there in enumerate(motions):
        found = Situation(0.1 * i, there, memory)
        memory = found.memory
    return found


def likely(situation, settings=DEFAULTS):
    return outlook(situation, settings).probability


def sinking(slip, growth=0.0, std=0.03, seconds=20.0, radius=0.12):
    """Return the situation after a drive in which the sinkage grew steadily up to now."""
    times = 0.1 * np.arange(round(10 * seconds) + 1)
    return followed(motion(slip, growth * RIM * time, std, radius) for time in times)


@pytest.mark.parametrize(('sinks', 'of', 'digging'), [(4, 6, 0.03), (3, 6, 0.0), (2, 3, 0.03)])
def test_digging_is_what_more_than_half_of_the_wheels_do(sinks, of, digging):
    """A sinkage that a first-order lag of 8 cm follows stays 8 cm times its growth ahead of it."""
    growths = [0.03] * sinks + [0.0] * (of - sinks)
    motions = []
    for time in 0.1 * np.arange(301):
        (wheel, *_) = motion(0.3).wheels
        wheels = [wheel._replace(sinkage=0.05 + growth * RIM * time) for growth in growths]
        motions.append(motion(0.3)._replace(wheels=tuple(wheels)))
    assert followed(motions).digging == pytest.approx(digging, rel=0.05, abs=1e-9)


def simulated(slip, std, deepening, travel, paths=40_000):
    """Share of simulated paths that come above 0.9, in steps of 5 cm, exact in each."""
    rng, step = np.random.default_rng(1), 0.05
    # The present slip: what is seen and what slips usually are, each with its own weight.
    weight = TYPICAL_STD**2 / (TYPICAL_STD**2 + std**2)
    s = TYPICAL_SLIP + weight * (slip - TYPICAL_SLIP)
    s = s + math.sqrt(weight) * std * rng.standard_normal(paths)
    level = DIGGING * deepening * (TYPICAL_SLIP + weight * (slip - TYPICAL_SLIP))
    rate = 1.0 / RETURN_LENGTH
    spread = SCATTER * math.sqrt((1.0 - math.exp(-2.0 * rate * step)) / (2.0 * rate))
    there = s > ENTRAPPED_SLIP
    for _ in range(round(travel / step)):
        s = level - (level - s) * math.exp(-rate * step) + spread * rng.standard_normal(paths)
        there |= s > ENTRAPPED_SLIP
    return there.mean()


@pytest.mark.parametrize(
    ('slip', 'std', 'deepening', 'travel'),
    [
        (0.3, 0.05, 0.0, 0.75),
        (0.6, 0.05, 0.0, 0.75),
        (0.8, 0.05, 0.0, 0.3),
        (0.85, 0.02, 0.01, 0.75),
        (0.4, 0.1, 0.02, 0.75),
        (0.4, 0.05, 0.04, 1.5),
        (0.5, 0.3, 0.0, 3.0),
    ],
)
def test_the_probability_is_that_of_simulated_paths(slip, std, deepening, travel):
    found = np.interp(travel, TRAVELS, passage_probability([slip], [std], deepening)[0])
    assert found == pytest.approx(simulated(slip, std, deepening, travel), abs=0.02)


def test_it_is_between_0_and_1_and_grows_with_slip_travel_and_digging():
    slips = np.linspace(-1.0, 1.0, 41)
    for std in (1e-4, 0.1, 0.9):
        found = passage_probability(slips, [std] * 41, 0.02)
        assert (found >= -1e-9).all() and (found <= 1.0 + 1e-9).all()
        assert (np.diff(found, axis=0) > -1e-6).all() and (np.diff(found, axis=1) > -1e-9).all()
    grown = [passage_probability([0.5], [0.05], d)[0, 15] for d in (-1.0, 0.0, 0.02, 0.05, 9.0)]
    assert grown[0] == grown[1] and grown == sorted(grown) and grown[-1] > 0.95


def entering(count, wheels=4):
    """Return the situation after so many wheels have sunk by 0.2 m per metre for 0.1 m."""

    def course():
        for i in range(201):
            there = motion(0.35)
            sunk = 0.01 + 0.2 * max(RIM * 0.1 * (i - 180), 0.0)
            into = there.wheels[0]._replace(sinkage=sunk)
            rest = there.wheels[: wheels - count]
            yield there._replace(wheels=(into,) * count + rest)

    return likely(followed(course()))


def test_the_first_axle_of_two_that_enters_loose_soil_is_no_entrapment():
    patch, trap = entering(2), entering(3)
    assert patch < 0.15 < 0.5 < trap
    assert patch == pytest.approx(entering(0))
    # The middle two of six wheels are more than half with the last two.
    assert entering(4, 6) > 0.5 > entering(3, 6)


@pytest.mark.parametrize('slip', [0.3, 0.7, 0.9])
def test_the_travel_left_is_that_within_which_it_is_as_likely_as_not(slip):
    (wheel, *_), *_ = outlook(sinking(slip, 0.08, radius=1.0), DEFAULTS)
    course = passage_probability([slip], [0.03], 0.08)[0]
    assert np.interp(wheel.travel, TRAVELS, course) == pytest.approx(0.5, abs=0.04)
    assert wheel.time == pytest.approx(wheel.travel / RIM)
    nothing = outlook(sinking(0.2), DEFAULTS).wheels[0]
    assert (nothing.travel, nothing.time) == (10.0, 600.0)


def test_the_travel_left_ends_where_a_wheel_is_in_too_deep_to_climb_out():
    growth, seconds = 0.03, 20.0
    (wheel, *_), *_ = outlook(sinking(0.35, growth, seconds=seconds), DEFAULTS)
    left = (0.4 * 0.12 - growth * RIM * seconds) / growth
    assert wheel.travel == pytest.approx(left, rel=0.05)
    assert wheel.time == pytest.approx(wheel.travel / RIM)


def test_no_travel_is_left_to_wheels_too_deep_unless_a_measured_speed_shows_that_they_climb():
    def left(speed_known):
        motions = [motion(0.35, 0.0015 * 0.1 * i) for i in range(401)]
        there = followed([each._replace(speed_known=speed_known) for each in motions])
        (wheel, *_), *_ = outlook(there, DEFAULTS)
        return wheel.travel, wheel.time, passage_probability([0.35], [0.03], there.digging)[0]

    assert left(speed_known=False)[:2] == (0.0, 0.0)
    travel, _, course = left(speed_known=True)
    assert travel > 1.0  # of the slips alone
    assert np.interp(travel, TRAVELS, course) == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize(('rim', 'share'), [(0.05, 0.75), (-0.05, -0.75)])
def test_a_torque_against_the_way_is_a_drag(rim, share):
    assert driving_share(30.0, 40.0, rim) == share
    assert driving_share(-30.0, 40.0, rim) == -share
    assert math.isnan(driving_share(math.nan, 40.0, rim))
    assert math.isnan(driving_share(30.0, 0.0, rim))


def test_a_longer_look_ahead_sees_more_of_wheels_that_sink():
    there = sinking(0.4, 0.06)
    near, far = (likely(there, DEFAULTS._replace(horizon=h, travel=0.01)) for h in (2.0, 15.0))
    assert near < 0.2 < 0.4 < far
    by_travel = likely(there, DEFAULTS._replace(horizon=2.0, travel=15.0 * RIM))
    assert by_travel == pytest.approx(far)
    course = passage_probability([0.4], [0.03], there.digging)[0]
    for horizon in (7.3, 1e3):  # between two travels, and beyond the last
        expected = np.interp(horizon * RIM, TRAVELS, course)
        assert likely(there, DEFAULTS._replace(horizon=horizon)) == pytest.approx(expected)


def test_wheels_that_dig_in_a_spin_on_the_spot_are_no_entrapment():
    def warned(turning):
        monitor = StuckMonitor(DEFAULTS)
        found = [
            monitor.update(
                0.1 * i,
                motion(0.6, 0.01 + 0.0006 * max(i - 60, 0))._replace(turning=turning and i > 60),
            )
            for i in range(120)
        ]
        return any(a.stuck for a in found[62:])

    assert warned(turning=False)
    assert not warned(turning=True)


def test_a_rover_that_pulls_away_in_slip_is_not_yet_foreseen():
    assert likely(sinking(0.7, 0.1, seconds=4.0)) < 0.05 < likely(sinking(0.7, 0.1, seconds=10.0))
