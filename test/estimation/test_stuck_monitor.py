# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stuck warning on made-up courses of slip: early where it digs, silent where it does not."""

import math

import pytest

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.settings import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.signs import SIGNS
from wheel_terra_estimator.estimation.judgement.stuck.situation import (
    RoverMotion,
    SituationObserver,
    SituationTuning,
    WheelMotion,
)


def wheel(slip, rim=0.05, known=True, torque=math.nan):
    return WheelMotion(
        slip=slip,
        slip_std=0.03,
        rim_speed=rim,
        known=known,
        torque_share=torque,
        sinkage=0.02,
        radius=0.12,
    )


def judge(monitor, time, speed, speed_known, wheels, **more):
    return monitor.update(time, RoverMotion(speed, speed_known, tuple(wheels), **more))


def course(rows, dt=0.1, monitor=None, start=0.0):
    """Run rows of wheels; return the assessments."""
    monitor = monitor or StuckMonitor()
    found = []
    for i, wheels in enumerate(rows):
        moving = [w for w in wheels if w.known]
        speed = sum((1.0 - w.slip) * w.rim_speed for w in moving) / max(len(moving), 1)
        found.append(judge(monitor, start + i * dt, speed, True, wheels))
    return found


def first(found, dt=0.1):
    return next((i * dt for i, a in enumerate(found) if a.stuck), None)


def test_gradual_entrapment_is_announced_seconds_before():
    slips = [min(0.2 + 0.02 * 0.1 * i * (1 + 0.02 * i * 0.1), 1.0) for i in range(400)]
    when = first(course([[wheel(s)] * 6 for s in slips]))
    entrapped = next(i for i, s in enumerate(slips) if s > 0.9) * 0.1 + 1.0
    assert when is not None
    assert entrapped - when >= 3.0


def test_sudden_entrapment_is_announced_before_it_lasts_a_second():
    slips = [0.3] * 100 + [min(0.3 + 0.15 * 0.1 * i, 1.0) for i in range(200)]
    when = first(course([[wheel(s)] * 6 for s in slips]))
    entrapped = next(i for i, s in enumerate(slips) if s > 0.9) * 0.1 + 1.0
    assert when < entrapped


def test_steep_climb_that_holds_raises_nothing():
    slips = [min(0.1 + 0.01 * 0.1 * i, 0.6) for i in range(1500)]
    assert first(course([[wheel(s)] * 6 for s in slips])) is None


def test_one_spinning_wheel_raises_nothing():
    rows = [[wheel(0.1)] * 5 + [wheel(0.95, rim=0.2)] for _ in range(600)]
    assert first(course(rows)) is None


def test_braking_and_locked_wheels_raise_nothing():
    rows = [[wheel(-0.95, rim=0.005)] * 6 for _ in range(300)]
    assert first(course(rows)) is None


def test_spin_in_place_slip_raises_nothing_by_its_trend():
    monitor = StuckMonitor()
    found = [
        judge(monitor, 0.1 * i, 0.0, True, [wheel(min(0.01 * i, 0.7))] * 6, turning=True)
        for i in range(200)
    ]
    assert first(found) is None


def test_clears_after_three_seconds_below():
    monitor = StuckMonitor()
    stuck = course([[wheel(0.97)] * 6] * 40, monitor=monitor)
    assert stuck[-1].stuck
    out = course([[wheel(0.3)] * 6] * 60, monitor=monitor, start=4.0)
    cleared = next(i for i, a in enumerate(out) if not a.stuck) * 0.1
    assert 3.0 <= cleared <= 3.3


def test_two_stalled_wheels_of_four_raise_it_without_any_speed():
    monitor = StuckMonitor()
    rolling = [wheel(0.2, rim=1.0, torque=0.4)] * 4
    stalled = [wheel(0.0, rim=0.0, known=False, torque=0.95)] * 2 + [
        wheel(0.2, rim=1.5, torque=0.1)
    ] * 2
    found = [judge(monitor, 0.1 * i, 0.0, False, rolling) for i in range(30)]
    assert not found[-1].stuck
    found = [judge(monitor, 3.0 + 0.1 * i, 0.0, False, stalled) for i in range(15)]
    assert 0.1 <= first(found) <= 0.3
    assert found[-1].stalled == (True, True, False, False)
    assert 'stalled' in found[-1].reason


@pytest.mark.parametrize('spinning', [True, False])
def test_a_side_that_turns_round_behind_a_spin_is_no_stall(spinning):
    """Left wheels from -0.3 to 0.5 rad/s within a second, near their torque limit at zero."""
    monitor = StuckMonitor()
    right = wheel(0.1, rim=0.05, torque=0.3)
    before = [wheel(0.5, rim=-0.045 if spinning else 0.045, torque=0.3), right] * 3
    found = [
        judge(monitor, 0.1 * i, 0.0 if spinning else 0.045, True, before, turning=spinning)
        for i in range(40)
    ]
    assert first(found) is None
    held = [wheel(0.2, rim=0.003, torque=0.9), right] * 3
    found = [judge(monitor, 4.0 + 0.1 * i, 0.012, True, held) for i in range(6)]
    assert found[-1].stuck is not spinning


def test_pulling_away_from_rest_is_no_stall():
    monitor = StuckMonitor()
    slow, quick = ([wheel(0.1, rim=k * i, torque=0.95) for i in range(9)] for k in (0.1, 0.2))
    rows = [[a] * 2 + [b] * 2 for a, b in zip(slow, quick, strict=True)]
    assert not any(judge(monitor, 0.1 * i, 0.1 * i, False, w).stuck for i, w in enumerate(rows))


def test_travel_left_shrinks_to_nothing():
    slips = [min(0.3 + 0.03 * 0.1 * i, 0.97) for i in range(300)]
    left = [a.wheels[0].travel for a in course([[wheel(s)] * 6 for s in slips])]
    assert left[0] == 10.0
    middle = left[100]
    assert 0.0 < middle < 2.0
    assert left[-1] == 0.0


@pytest.mark.parametrize('ahead', [1, -1])
def test_the_direction_is_that_of_the_rims_that_led_in_and_stays_until_it_clears(ahead):
    monitor = StuckMonitor()

    def drive(slip, rim, seconds, start):
        rows = [[wheel(slip, rim=ahead * rim, known=rim != 0.0)] * 6] * round(10 * seconds)
        return course(rows, monitor=monitor, start=start)[-1]

    assert drive(0.2, -0.05, 20.0, 0.0).direction == 0, 'none while it is not stuck'
    assert drive(0.97, 0.05, 20.0, 20.0).direction == ahead
    assert drive(0.97, 0.0, 600.0, 40.0).direction == ahead, 'rest changes nothing'
    backing = drive(0.97, -0.05, 20.0, 640.0)
    assert backing.stuck and backing.direction == ahead, 'nor does digging on the way out'
    assert drive(0.1, -0.05, 20.0, 660.0).direction == 0
    assert drive(0.97, -0.05, 20.0, 680.0).direction == -ahead, 'a new one is its own'


def stalling(before, seconds):
    """Wheels turn so, [m/s], for some seconds, the last of them on the spot; then two stall."""
    monitor = StuckMonitor()
    stalled = [wheel(0.0, rim=0.0, known=False, torque=0.95)] * 2 + [wheel(0.2, torque=0.1)] * 2
    for i in range(round(10 * seconds)):
        rims = before(0.1 * i)
        wheels = [wheel(0.2, rim=rim, torque=0.4) for rim in rims] * 2
        judge(monitor, 0.1 * i, sum(rims) / 2, True, wheels)
    found = [judge(monitor, seconds + 0.1 * i, 0.0, True, stalled) for i in range(5)]
    assert found[-1].stuck
    return found[-1].direction


def test_the_direction_is_unknown_where_the_rims_went_both_ways():
    assert stalling(lambda t: (0.05, 0.05), 20.0) == 1
    rocking = stalling(lambda t: (0.05, 0.05) if t % 1.0 < 0.5 else (-0.05, -0.05), 20.0)
    assert rocking == stalling(lambda t: (0.05, -0.05), 20.0) == 0


def test_memory_comes_back():
    monitor = StuckMonitor()
    course([[wheel(0.97)] * 6] * 10, monitor=monitor)
    memory = monitor.snapshot()
    one = course([[wheel(0.97)] * 6] * 20, monitor=monitor, start=1.0)
    monitor.restore(memory)
    two = course([[wheel(0.97)] * 6] * 20, monitor=monitor, start=1.0)
    assert [a.stuck for a in one] == [a.stuck for a in two]


def test_wheels_that_are_being_stopped_raise_nothing_by_an_early_reference():
    monitor = StuckMonitor()
    # The reference stands 0.9 s before the wheels do, as in a recorded stop on firm ground.
    found = []
    for i in range(120):
        t = 0.1 * i
        speed = min(max(0.7 - 0.9 * max(t - 8.0, 0.0), 0.0), 0.7)
        rim = min(max(0.7 - 1.2 * max(t - 9.3, 0.0), 0.0), 0.7)
        slip = 1.0 - speed / rim if rim > 0.01 else 0.0
        rows = [wheel(slip, rim=rim, known=rim > 0.01, torque=0.1)] * 4
        found.append(judge(monitor, t, speed, True, rows))
    assert first(found) is None


def test_drives_that_give_way_near_their_limit_raise_it_without_any_speed():
    monitor = StuckMonitor()
    cruise = [wheel(0.2, rim=1.8, torque=0.4)] * 4
    hard = [wheel(0.2, rim=1.1, torque=0.75)] * 2 + [wheel(0.2, rim=1.75, torque=0.4)] * 2
    steep = [wheel(0.2, rim=1.75, torque=0.75)] * 4
    found = [judge(monitor, 0.1 * i, 0.0, False, cruise) for i in range(50)]
    assert not found[-1].stuck
    # Near the limit at full speed is only a steep climb.
    found = [judge(monitor, 5.0 + 0.1 * i, 0.0, False, steep) for i in range(50)]
    assert not found[-1].stuck
    found = [judge(monitor, 10.0 + 0.1 * i, 0.0, False, hard) for i in range(10)]
    assert 0.3 <= first(found) <= 0.6
    assert 'torque limit' in found[-1].reason


def test_without_a_speed_the_margin_of_the_soil_decides():
    slips = [min(0.3 + 0.004 * i, 0.78) for i in range(300)]
    answers = []
    for margin in (0.1, 0.005):
        monitor = StuckMonitor()
        found = [
            judge(monitor, 0.1 * i, 0.01, False, [wheel(s)] * 6, margin=margin)
            for i, s in enumerate(slips)
        ]
        answers.append(found[-1].stuck)
    assert answers == [False, True]


def test_spin_in_place_raises_nothing():
    """The rover is steered into a spin: its speed goes, its wheels turn on against each other."""

    def raised(turning):
        monitor = StuckMonitor()
        found = []
        for i in range(300):
            time = 0.1 * i
            speed = 0.05 * min(max(1.0 - (time - 10.0) / 2.0, 0.0), 1.0)
            rims = [0.05 + (0.03 if time > 10.0 else 0.0), speed - (0.03 if time > 10.0 else 0.0)]
            wheels = [wheel(0.4, rim=rim, torque=0.6) for rim in rims * 3]
            found.append(judge(monitor, time, speed, True, wheels, turning=turning and time > 10))
        return first(found)

    assert raised(turning=False) is not None  # without the turning it would be a rover that bogs
    assert raised(turning=True) is None


def test_a_level_found_to_be_wrong_is_no_growth():
    """After wild references the speed is opened to them: the jump of the slip is not a trend."""

    def warned(forget):
        monitor = StuckMonitor()
        before = course([[wheel(0.3)] * 6] * 100, monitor=monitor)
        if forget:
            monitor.forget_trend()
        after = course([[wheel(0.68)] * 6] * 60, monitor=monitor, start=10.0)
        return first(before + after) is not None

    assert warned(forget=False)
    assert not warned(forget=True)


def test_fixes_that_disagree_by_chance_are_no_bogging_down():
    """Slip 0.66 +- 0.07 near the torque limit: each second another reference moves the speed."""
    monitor = StuckMonitor()
    found = []
    for i in range(300):
        # 4 mm/s between references is what 3 mm/s of noise make of a speed of 17 mm/s.
        slip = 0.66 + (0.04 if i // 10 % 2 else -0.04)
        wheels = [wheel(slip, torque=0.6)._replace(slip_std=0.07)] * 6
        found.append(judge(monitor, 0.1 * i, 0.05 * (1.0 - slip), True, wheels))
    assert first(found) is None


def test_a_fast_loss_of_speed_near_the_torque_limit_is_bogging_down_where_drives_slow_down():
    def run(slowing):
        """Slip grows by 0.2 a second from 5 s on; rim speeds fall by so much a second."""
        monitor, found = StuckMonitor(), []
        for i in range(75):
            since = 0.1 * max(i - 50, 0)
            slip, rim = 0.3 + 0.2 * since, 1.0 - slowing * since
            # The first wheel is the fastest: it holds its speed.
            wheels = [wheel(slip, torque=0.6, rim=r) for r in (1.0, rim, rim, rim)]
            found.append(judge(monitor, 0.1 * i, rim * (1.0 - slip), True, wheels))
        return found

    assert 5.0 < first(run(0.2)) < 6.5
    assert 'bogging down' in next(a.reason for a in run(0.2) if a.stuck)
    # Drives that hold their rim speed lose way by slip alone, which other signs judge.
    assert not any('bogging down' in a.reason for a in run(0.0))


@pytest.mark.parametrize('held', [True, False])
def test_a_wheel_that_is_held_changes_the_slip_of_the_others_and_is_no_entrapment(held):
    """The others take over its share: slip grows to 0.6 within a second, wheels sink by 3 mm."""

    def row(i):
        share = min(max(0.1 * (i - 100), 0.0), 1.0)
        others = wheel(0.2 + 0.4 * share)._replace(sinkage=0.02 + 0.003 * share)
        stands = wheel(-1.0, rim=0.0, known=False, torque=-0.9)
        return [others] * 5 + [stands if held and share > 0.0 else others]

    assert (first(course([row(i) for i in range(200)])) is None) == held


def test_a_wheel_that_sends_nothing_for_a_while_changes_nothing():
    """What a wheel does that tells no rate is not known: the trend of the others is followed."""
    silent = wheel(0.0, rim=0.0, known=False)._replace(rate_told=False)
    slips = [0.2] * 100 + [min(0.2 + 0.1 * 0.1 * i, 0.7) for i in range(80)]
    rows = [[wheel(s)] * 5 + [silent if i // 7 % 2 else wheel(s)] for i, s in enumerate(slips)]
    assert first(course(rows)) == pytest.approx(first(course([[wheel(s)] * 6 for s in slips])))


def test_a_wheel_that_is_dragged_is_not_stalled():
    """Its torque is as great as that of a stalled wheel and works against the drive."""

    def stalled(torque):
        monitor = StuckMonitor()
        rolling = [wheel(0.2, rim=1.0, torque=0.4)] * 4
        stands = [wheel(-1.0, rim=0.0, known=False, torque=torque)] * 2
        for i in range(30):
            judge(monitor, 0.1 * i, 0.8, False, rolling)
        for i in range(15):
            found = judge(monitor, 3.0 + 0.1 * i, 0.5, False, stands + rolling[:2])
        return found

    assert stalled(0.9).stuck and stalled(0.9).stalled == (True, True, False, False)
    assert not any(stalled(-0.9).stalled)


def test_a_slip_that_nobody_knows_is_not_digging():
    guess = wheel(1.0)._replace(slip_std=0.4)
    assert first(course([[guess] * 6] * 300)) is None
    assert first(course([[wheel(1.0)] * 6] * 300)) is not None


def test_a_slip_of_which_nothing_is_known_forecasts_nothing():
    """The first set of a run may say slip 0.95 +- 1: that is no entrapment in sight."""
    untold = wheel(0.95)._replace(slip_std=1.0)
    outlook = course([[untold] * 6])[0].wheels[0]
    assert (outlook.probability, outlook.travel) == (0.0, 10.0)
    assert course([[wheel(0.95)] * 6])[0].wheels[0].travel == 0.0


# -- Horizon, travel and clearing -------------------------------------------------------------


def deepening(settings, slip=0.4, per_metre=0.03, seconds=40.0):
    """All wheels sink by `per_metre` of their rim travel at a steady slip."""
    monitor, found = StuckMonitor(settings), []
    for i in range(round(10 * seconds)):
        sunk = 0.01 + per_metre * 0.05 * 0.1 * i
        wheels = [wheel(slip)._replace(sinkage=min(sunk, 0.1))] * 6
        found.append(judge(monitor, 0.1 * i, 0.05 * (1.0 - slip), True, wheels))
    return found


def test_a_steady_deepening_warns_before_the_lugs_cannot_climb_out():
    found = deepening(StuckSettings())
    warned = next(i for i, a in enumerate(found) if a.stuck)
    assert 0.05 < found[warned].wheels[0].travel < 0.3
    assert 'rim travel' in found[warned].reason
    assert min(a.wheels[0].travel for a in found) == pytest.approx(0.05)
    # Ground on which wheels sink no further than into their ruts raises nothing.
    assert first(deepening(StuckSettings(), per_metre=0.01)) is None


def test_the_travel_parameter_says_how_early():
    when = [first(deepening(StuckSettings(travel=travel))) for travel in (0.01, 0.3, 1.0)]
    assert when[0] > when[1] + 3.0
    assert when[1] > when[2]


def test_two_wheels_of_six_that_dig_are_no_entrapment():
    monitor, found = StuckMonitor(), []
    for i in range(400):
        sunk = wheel(0.4)._replace(sinkage=min(0.01 + 0.0006 * i, 0.1))
        found.append(judge(monitor, 0.1 * i, 0.03, True, [sunk] * 2 + [wheel(0.4)] * 4))
    assert first(found) is None


def growing(settings, rate=0.004):
    slips = [min(0.5 + rate * 0.1 * i, 0.79) for i in range(720)]
    return first(
        course(
            [[wheel(s)._replace(slip_std=0.005)] * 6 for s in slips], monitor=StuckMonitor(settings)
        )
    )


def test_the_horizon_parameter_says_how_far_the_trend_is_followed():
    assert growing(StuckSettings(horizon=0.1)) is None
    assert growing(StuckSettings(horizon=15.0)) is None
    far = growing(StuckSettings(horizon=1e4))
    assert far is not None
    assert growing(StuckSettings(horizon=100.0)) >= far
    quick = [growing(StuckSettings(horizon=h), rate=0.02) for h in (0.1, 15.0)]
    assert quick[0] is None
    assert quick[1] is not None


def test_the_parameters_of_the_configuration_reach_the_warning():
    keys = ['filter.stuck_horizon:=7.0', 'filter.stuck_travel:=0.1', 'filter.stuck_clear_slip:=0.4']
    given = StuckSettings.from_configuration(reader.load(['frostyboy'], keys))
    assert (given.horizon, given.travel, given.clear_slip, given.clear_time) == (7.0, 0.1, 0.4, 3.0)


def test_a_sign_that_is_there_keeps_the_warning():
    """Slip has fallen, but two wheels are still held near their torque limit."""
    monitor = StuckMonitor()
    cruise = [wheel(0.2, rim=1.0, torque=0.3)] * 4
    held = [wheel(0.2, rim=1.0, torque=0.3)] * 2 + [
        wheel(0.0, rim=0.1, known=False, torque=0.95)
    ] * 2
    found = [judge(monitor, 0.1 * i, 0.0, False, cruise) for i in range(50)]
    found += [judge(monitor, 5.0 + 0.1 * i, 0.0, False, held) for i in range(100)]
    assert found[-1].stuck
    free = [judge(monitor, 15.0 + 0.1 * i, 0.0, False, cruise) for i in range(60)]
    cleared = next(i for i, a in enumerate(free) if not a.stuck)
    assert 30 <= cleared <= 32


def test_held_wheels_beside_one_that_stands_are_an_entrapment():
    """One wheel stalls, two slip: no other sign sees it."""

    def raised(speed):
        monitor = StuckMonitor()
        rolling = [wheel(0.2, rim=0.5, torque=0.2)] * 4
        stands = wheel(0.0, rim=0.0, known=False, torque=0.95)
        held = [stands, wheel(0.7, rim=0.5, torque=0.1), wheel(0.7, rim=0.5, torque=0.1)]
        held.append(wheel(0.1, rim=0.17, torque=0.1))
        found = [judge(monitor, 0.1 * i, 0.4, True, rolling) for i in range(30)]
        found += [judge(monitor, 3.0 + 0.1 * i, speed, True, held) for i in range(20)]
        return found[-1]

    assert raised(0.15).stuck
    assert 'others held' in raised(0.15).reason
    assert 'others held' not in raised(0.3).reason  # the rover makes way


def test_every_sign_has_its_own_name_and_words():
    assert len({sign.name for sign in SIGNS}) == len(SIGNS)
    assert all(sign.hold > 0.0 for sign in SIGNS)


def test_an_accelerometer_alone_raises_nothing():
    """Slip without reference, torque or sinkage may be the drift of an accelerometer."""
    for told in (True, False):
        monitor = StuckMonitor()
        found = [
            judge(monitor, 0.1 * i, 0.0, False, [wheel(0.98)] * 6, slip_told=told)
            for i in range(200)
        ]
        assert (first(found) is not None) == told


def test_a_wheel_whose_slip_is_not_known_or_brakes_has_no_entrapment_in_sight():
    rows = [[wheel(0.95), wheel(0.95, known=False), wheel(-0.3), wheel(0.1)]] * 30
    chances = [wheel.probability for wheel in course(rows)[-1].wheels]
    assert chances[0] > 0.5
    assert chances[1] == chances[2] == 0.0


def test_held_wheels_count_while_the_drive_is_being_stopped_too():
    """A driver who takes the speed back because the rover is held is still held."""
    rolling = [wheel(0.2, rim=0.5, torque=0.2)] * 4
    monitor = StuckMonitor()
    for i in range(30):
        judge(monitor, 0.1 * i, 0.4, True, rolling)
    found = []
    for i in range(8):
        rim = 0.5 * 0.88 ** (i + 1)
        stands = wheel(0.0, rim=0.0, known=False, torque=0.95)
        held = [stands, *[wheel(0.75, rim=rim, torque=0.1)] * 2, wheel(0.1, rim=0.3 * rim)]
        found.append(judge(monitor, 3.0 + 0.1 * i, 0.2 * rim, True, held))
    assert found[-1].stuck
    assert 'others held' in found[-1].reason


def test_a_growth_right_after_a_start_says_nothing_though_the_rover_drove_before():
    """Slip settles over the first travel after each start, not after the first one only."""

    def warned(pause):
        slips = [0.2] * 100 + [min(0.2 + 0.1 * 0.1 * i, 0.68) for i in range(60)]
        rows = [[wheel(s)] * 6 for s in slips]
        standing = [[wheel(0.0, rim=0.0, known=False)] * 6] * pause
        return any(a.stuck for a in course([*rows[:100], *standing, *rows[100:]]))

    assert warned(pause=0)
    assert not warned(pause=30)


def test_the_words_say_what_is_seen_and_what_to_do():
    monitor, found = StuckMonitor(), []
    for i in range(400):
        slip = min(0.2 + 0.004 * i, 0.85)
        wheels = [wheel(slip)._replace(sinkage=0.01 + 0.04 * 0.05 * 0.1 * i)] * 6
        speed = 0.05 * (1.0 - slip)
        found.append(judge(monitor, 0.1 * i, speed, True, wheels, margin=0.031))
    reason = next(a.reason for a in found if a.stuck)
    assert reason.endswith(
        ', 6 wheels sink 4 cm per metre of rim travel, pull left 3% of the load; stop, back out'
    )
    # Nothing is said of what is not known, and no number of nothing.
    plain = next(a.reason for a in course([[wheel(0.95)] * 6] * 100) if a.stuck)
    assert plain.endswith('; stop, back out')
    assert 'sink' not in plain and 'pull left' not in plain and '0.000' not in plain


def test_the_growth_of_the_slip_is_known_from_the_first_sample_that_spans_enough():
    """A tenth a second: 0 until a second is covered."""
    tuning = SituationTuning(shortest_trend=1.0, trend_spacing=0.25)
    observer, found = SituationObserver(StuckSettings(), tuning), []
    for time in (0.0, 0.25, 0.5, 0.75, 1.0):
        slips, trend = observer._trend(time, 0.2 + 0.1 * time, follow=True)
        observer.state = observer.state._replace(slips=slips, trend=trend)
        found.append(trend)
    assert found == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.1])
