# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Stuck warning on made-up courses of slip: early where it digs, silent where it does not."""

import math

import pytest
from parts import SAND

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.judgement.stuck.forecast import StuckSettings
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.situation import RoverMotion, WheelMotion

SETTINGS = StuckSettings.from_configuration(reader.load(SAND))


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


def course(rows, monitor=None, start=0.0):
    """Run rows of wheels, ten a second, at the speed that they slip by; return the assessments."""
    monitor = monitor or StuckMonitor(SETTINGS)
    found = []
    for i, wheels in enumerate(rows):
        moving = [w for w in wheels if w.known]
        speed = sum((1.0 - w.slip) * w.rim_speed for w in moving) / max(len(moving), 1)
        found.append(judge(monitor, start + 0.1 * i, speed, True, wheels))
    return found


def held(monitor, wheels, seconds, start=0.0, speed=0.0, speed_known=False, **more):
    """Hold wheels and speed for some seconds, by default a speed that nobody knows."""
    times = [start + 0.1 * i for i in range(round(10 * seconds))]
    return [judge(monitor, time, speed, speed_known, wheels, **more) for time in times]


def first(found):
    return next((0.1 * i for i, a in enumerate(found) if a.stuck), None)


@pytest.mark.parametrize(
    ('slips', 'ahead'),
    [
        ([0.2 + 0.002 * i * (1 + 0.002 * i) for i in range(400)], 2.5),  # gradually
        ([0.3] * 100 + [0.3 + 0.015 * i for i in range(200)], 0.1),
    ],
)
def test_entrapment_is_announced_before_it_has_lasted_a_second(slips, ahead):
    when = first(course([[wheel(min(s, 1.0))] * 6 for s in slips]))
    entrapped = next(i for i, s in enumerate(slips) if s > 0.9) * 0.1 + 1.0
    assert when <= entrapped - ahead


@pytest.mark.parametrize(
    ('known', 'read', 'growth', 'wheels', 'warned'),
    [
        (False, True, 0.05, 6, True),
        (True, True, 0.05, 6, False),  # a speed says that the rover gets on
        (False, False, 0.05, 6, False),  # a depth that only its model tells
        (False, True, 0.0, 6, False),  # deep snow
        (False, True, 0.05, 2, False),  # two of six in a hole
        (False, True, 2.0, 6, False),  # a border to soft soil
    ],
)
def test_without_a_speed_wheels_that_are_read_to_bury_themselves(
    known, read, growth, wheels, warned
):
    """At slip 0.1, as it seems; depth in metres per metre of rim travel, from 0.42 radii on."""
    monitor, found = StuckMonitor(SETTINGS), []
    for i in range(400):  # 17 radii of rim travel
        deep = min(0.05 + growth * 0.05 * 0.1 * i, 0.12)
        rows = [wheel(0.1)._replace(sinkage=deep if n < wheels else 0.05) for n in range(6)]
        found.append(judge(monitor, 0.1 * i, 0.045, known, rows, depth_read=read))
    assert (first(found) is not None) == warned
    assert found[-1].buried == warned
    if warned:
        raised = next(a for a in found if a.stuck)
        assert '% of their radius' in raised.reason


HOLDS = [[wheel(min(0.1 + 0.001 * i, 0.6))] * 6 for i in range(800)]
GUESS = wheel(1.0)._replace(slip_std=0.4)


@pytest.mark.parametrize(
    ('rows', 'most'),
    [
        (HOLDS, 1.0),  # a steep climb
        ([[wheel(0.1)] * 5 + [wheel(0.95, rim=0.2)]] * 300, 1.0),
        ([[GUESS] * 6] * 150, 1.0),  # the first set of a run may say slip 0.95 +- 1
        # Class 3, but a wheel that is dragged digs nobody in.
        ([[wheel(-0.97, rim=0.0005)] * 6] * 150, 0.05),
        ([[wheel(-0.97, rim=0.003, torque=-0.95)] * 6] * 150, 0.05),
        ([[wheel(-0.97, rim=0.003, torque=0.0)] * 6] * 150, 0.05),
    ],
    ids=['climb', 'one spins', 'a guess', 'locked', 'dragged', 'skids'],
)
def test_what_is_no_entrapment_raises_nothing(rows, most):
    found = course(rows)
    assert first(found) is None
    assert all(w.probability < most for w in found[-1].wheels)


def test_a_near_miss_raises_nothing():
    """Slip peaks at 0.65 while all wheels sink by 1 cm per metre of rim travel, and falls again."""
    slips = [0.2 + 0.45 * math.exp(-(((0.1 * i - 30.0) / 8.0) ** 2)) for i in range(500)]
    rows = [
        [wheel(s)._replace(sinkage=0.02 + 0.01 * 0.05 * 0.1 * i)] * 6 for i, s in enumerate(slips)
    ]
    found = course(rows)
    assert max(slips) > 0.64 and first(found) is None
    assert max(a.wheels[0].probability for a in found) < 0.5


def test_two_stalled_wheels_of_four_raise_it_without_any_speed():
    monitor = StuckMonitor(SETTINGS)
    turning = wheel(0.2, rim=1.5, torque=0.1)
    stalled = [wheel(0.0, rim=0.0, known=False, torque=0.95)] * 2 + [turning] * 2
    assert not held(monitor, [wheel(0.2, rim=1.0, torque=0.4)] * 4, 3.0)[-1].stuck
    found = held(monitor, stalled, 1.5, start=3.0)
    assert 0.1 <= first(found) <= 0.3
    assert found[-1].stalled == (True, True, False, False)
    assert found[-1].wheels[0] == (1.0, 0.0, 0.0), 'it is there: no time and no travel left'
    assert '2 wheels stalled' in found[-1].reason


def test_a_rover_parked_on_a_slope_by_wheels_at_their_limit_is_not_stuck():
    """Their torques are what holds it; on the level the same ones press against something."""
    shares = (0.95, 0.95, 0.5, 0.4)
    for holding_share, raises in ((0.7, False), (0.0, True)):
        monitor = StuckMonitor(SETTINGS)
        held(monitor, [wheel(0.2, rim=0.05, torque=0.4)] * 4, 3.0)
        parked = [wheel(0.2, rim=0.0, known=False, torque=share) for share in shares]
        found = held(monitor, parked, 10.0, start=3.0, holding_share=holding_share)
        assert any(a.stuck for a in found) is raises


@pytest.mark.parametrize(
    ('torques', 'raises'), [((0.99, 0.95, 0.1, -0.9), True), ((0.95,), False), ((0.85,) * 4, False)]
)
def test_wheels_that_pull_at_rest_are_stalled_and_two_of_them_raise_it(torques, raises):
    """Wheels that need less than a second to pull away do not. They spring back as they stop."""
    monitor = StuckMonitor(SETTINGS)
    held(monitor, [wheel(0.2, rim=0.05, torque=0.4)] * 4, 2.9)
    held(monitor, [wheel(0.2, rim=-0.003, torque=-0.9)] * 4, 0.1, start=2.9)
    torques = (*torques, 0.0, 0.0, 0.0)[:4]
    stands = [wheel(0.2, rim=0.0, known=False, torque=torque) for torque in torques]
    found = held(monitor, stands, 10.0, start=3.0)
    assert found[-1].stalled == tuple(torque > 0.9 for torque in torques)
    assert not any(any(a.stalled) or a.stuck for a in found[:10])
    if not raises:
        assert first(found) is None
        return
    assert 1.0 < first(found) < 1.5 and found[-1].direction == 1
    assert found[-1].reason.startswith('2 wheels stalled near their torque limit')
    told = [wheel(0.2, rim=math.nan, known=False, torque=torque) for torque in torques]
    assert not any(held(StuckMonitor(SETTINGS), told, 3.0)[-1].stalled), 'no rates are no rest'


@pytest.mark.parametrize('spinning', [True, False])
def test_a_side_that_turns_round_behind_a_spin_is_no_stall(spinning):
    """Left wheels from -0.3 to 0.5 rad/s within a second, near their torque limit at zero."""
    monitor = StuckMonitor(SETTINGS)
    right = wheel(0.1, rim=0.05, torque=0.3)
    before = [wheel(0.5, rim=-0.045 if spinning else 0.045, torque=0.3), right] * 3
    speed = 0.0 if spinning else 0.045
    found = held(monitor, before, 8.0, speed=speed, speed_known=True, turning=spinning)
    assert first(found) is None
    slowed = [wheel(0.2, rim=0.003, torque=0.9), right] * 3
    found = held(monitor, slowed, 0.6, start=8.0, speed=0.012, speed_known=True)
    assert found[-1].stuck is not spinning


@pytest.mark.parametrize('rest', [1, 20])
def test_pulling_away_is_no_stall_until_the_wheels_have_rolled(rest):
    """Half of the wheels turn half as fast, near their limit: warned after 0.25 m of rim travel."""
    rows = [[wheel(0.1, rim=0.05, torque=0.95)] * 2 + [wheel(0.1, rim=0.1, torque=0.95)] * 2] * 60
    rows[:1] = [[wheel(0.0, rim=0.0, known=False)] * 4] * rest
    assert 0.25 < 0.1 * (first(course(rows)) - 0.1 * rest) < 0.3


@pytest.mark.parametrize('ahead', [1, -1])
def test_the_direction_is_that_of_the_rims_that_led_in_and_stays_until_it_clears(ahead):
    monitor = StuckMonitor(SETTINGS)

    def drive(slip, rim, seconds, start):
        rows = [[wheel(slip, rim=ahead * rim, known=rim != 0.0)] * 6] * round(10 * seconds)
        return course(rows, monitor=monitor, start=start)[-1]

    assert drive(0.2, -0.05, 5.0, 0.0).direction == 0, 'none while it is not stuck'
    assert drive(0.97, 0.05, 10.0, 5.0).direction == ahead
    assert drive(0.97, 0.0, 20.0, 15.0).direction == ahead, 'rest changes nothing'
    backing = drive(0.97, -0.05, 10.0, 35.0)
    assert backing.stuck and backing.direction == ahead, 'nor does digging on the way out'
    assert drive(0.1, -0.05, 10.0, 45.0).direction == 0
    assert drive(0.97, -0.05, 10.0, 55.0).direction == -ahead, 'a new one is its own'


@pytest.mark.parametrize(
    ('depth', 'told', 'read', 'clears'),
    [(0.3, 0, 1, 1), (0.5, 0, 1, 0), (0.5, 1, 1, 1), (0.5, 0, 0, 1)],
)
def test_it_does_not_clear_by_a_guessed_slip_of_wheels_too_deep(depth, told, read, clears):
    monitor = StuckMonitor(SETTINGS)
    assert course([[wheel(0.97)] * 6] * 100, monitor)[-1].stuck
    deep = wheel(0.2)._replace(sinkage=depth * wheel(0.2).radius)
    given = {'speed_known': bool(told), 'depth_read': bool(read)}
    settled = held(monitor, [deep] * 6, 10.0, start=10.0, speed=0.04, **given)
    assert settled[-1].stuck is not bool(clears)


def stalling(before, seconds):
    """Wheels turn so, [m/s], for some seconds, the last of them on the spot; then two stall."""
    monitor = StuckMonitor(SETTINGS)
    stalled = [wheel(0.0, rim=0.0, known=False, torque=0.95)] * 2 + [wheel(0.2, torque=0.1)] * 2
    for i in range(round(10 * seconds)):
        rims = before(0.1 * i)
        wheels = [wheel(0.2, rim=rim, torque=0.4) for rim in rims] * 2
        judge(monitor, 0.1 * i, sum(rims) / 2, True, wheels)
    found = held(monitor, stalled, 0.5, start=seconds, speed_known=True)[-1]
    assert found.stuck
    return found.direction


def test_the_direction_is_unknown_where_the_rims_went_both_ways():
    assert stalling(lambda t: (0.05, 0.05), 8.0) == 1
    rocking = stalling(lambda t: (0.05, 0.05) if t % 1.0 < 0.5 else (-0.05, -0.05), 8.0)
    assert rocking == stalling(lambda t: (0.05, -0.05), 8.0) == 0


def slowing(speed, deceleration, start):
    """Return a speed as a function of time that falls to zero from a time on."""
    return lambda time: max(speed - deceleration * max(time - start, 0.0), 0.0)


@pytest.mark.parametrize(
    ('rims', 'speeds', 'known', 'torque', 'least'),
    [
        # The reference stands 0.9 s before the wheels do, as in a recorded stop on firm ground.
        (slowing(0.7, 1.2, 9.3), slowing(0.7, 0.9, 8.0), True, 0.1, 0.01),
        # Wheels that are stopped hold the slope: their torque is what it was, half of the limit.
        (slowing(0.05, 0.02, 8.0), slowing(0.04, 0.016, 8.0), False, 0.5, 0.002),
        # The same on a slope that takes three quarters of it.
        (slowing(0.05, 0.02, 8.0), slowing(0.04, 0.016, 8.0), True, 0.78, 0.002),
    ],
)
def test_wheels_that_are_being_stopped_raise_nothing(rims, speeds, known, torque, least):
    monitor, found = StuckMonitor(SETTINGS), []
    for time in (0.1 * i for i in range(120)):
        rim, speed = rims(time), speeds(time)
        slip = 1.0 - speed / rim if rim > least else 0.0
        rows = [wheel(slip, rim=rim, known=rim > least, torque=torque)] * 4
        found.append(judge(monitor, time, speed, known, rows))
    assert first(found) is None


def test_drives_that_give_way_near_their_limit_raise_it_without_any_speed():
    monitor = StuckMonitor(SETTINGS)
    cruise = [wheel(0.2, rim=1.8, torque=0.4)] * 4
    hard = [wheel(0.2, rim=0.8, torque=0.95)] * 2 + [wheel(0.2, rim=1.75, torque=0.4)] * 2
    steep = [wheel(0.2, rim=1.75, torque=0.75)] * 4
    assert not held(monitor, cruise, 5.0)[-1].stuck
    # Near the limit at full speed is only a steep climb.
    assert not held(monitor, steep, 5.0, start=5.0)[-1].stuck
    found = held(monitor, hard, 1.0, start=10.0)
    assert 0.1 <= first(found) <= 0.4
    assert 'torque limit' in found[-1].reason


@pytest.mark.parametrize(
    ('before', 'torque', 'stuck'),
    [
        (0.4, 0.95, True),
        (0.4, 0.75, True),
        (0.4, 0.4, False),
        (0.72, 0.77, False),  # stopped on a climb that takes nearly as much
        (0.88, 0.92, True),  # more than 0.9 is the limit
    ],
)
def test_wheels_that_slow_evenly_are_held_if_their_torque_rose_near_its_limit(
    before, torque, stuck
):
    rows = [[wheel(0.2, rim=1.8, torque=before)] * 4] * 50 + [[wheel(0.2, torque=torque)] * 4] * 10
    found = course(rows)
    assert not found[50].stuck and found[-1].stuck is stuck


def test_wheels_that_lag_behind_the_others_stay_held_however_long_they_do():
    monitor = StuckMonitor(SETTINGS)
    held(monitor, [wheel(0.2, rim=1.8, torque=0.4)] * 4, 5.0)
    lag = [wheel(0.2, rim=1.3, torque=0.75)] * 3 + [wheel(0.2, rim=1.75, torque=0.4)]
    assert held(monitor, lag, 30.0, start=5.0)[-1].stuck


def test_a_short_drive_between_two_stops_on_a_steep_climb_raises_nothing():
    monitor = StuckMonitor(SETTINGS)
    held(monitor, [wheel(0.0, rim=0.0, known=False, torque=0.5)] * 4, 5.0)
    held(monitor, [wheel(0.2, rim=0.1, torque=0.78)] * 4, 4.0, start=5.0)
    assert first(held(monitor, [wheel(0.2, rim=0.05, torque=0.78)] * 4, 2.0, start=9.0)) is None


@pytest.mark.parametrize('silent', [0, 3])
def test_silent_wheels_neither_stand_nor_hide_the_slip_of_the_others(silent):
    mute = wheel(0.0, rim=math.nan, known=False, torque=0.95)
    sound = [[wheel(0.1, torque=0.4)] * (6 - silent) + [mute] * silent] * 100
    slips = [[wheel(0.95, torque=0.4)] * (6 - silent) + [mute] * silent] * 30
    found = course(sound + slips)
    assert not any(a.stuck for a in found[:100])
    assert found[-1].stuck


def test_a_wheel_that_sends_nothing_for_a_while_changes_nothing():
    """What a wheel does that tells no rate is not known: the trend of the others is followed."""
    silent = wheel(0.0, rim=math.nan, known=False)
    slips = [0.2] * 100 + [min(0.2 + 0.1 * 0.1 * i, 0.7) for i in range(80)]
    rows = [[wheel(s)] * 5 + [silent if i // 7 % 2 else wheel(s)] for i, s in enumerate(slips)]
    assert first(course(rows)) == pytest.approx(first(course([[wheel(s)] * 6 for s in slips])))


def test_a_wheel_that_is_dragged_is_not_stalled():
    """Its torque is as great as that of a stalled wheel and works against the drive."""

    def stalled(torque):
        monitor = StuckMonitor(SETTINGS)
        rolling = [wheel(0.2, rim=1.0, torque=0.4)] * 4
        stands = [wheel(-1.0, rim=0.0, known=False, torque=torque)] * 2
        held(monitor, rolling, 3.0, speed=0.8)
        return held(monitor, stands + rolling[:2], 1.5, start=3.0, speed=0.5)[-1]

    assert stalled(0.9).stuck and stalled(0.9).stalled == (True, True, False, False)
    assert not any(stalled(-0.9).stalled)


def test_an_entrapment_is_as_near_as_the_slip_is_known():
    outlook = course([[wheel(0.95)._replace(slip_std=1.0)] * 6])[0].wheels[0]
    assert outlook.probability < 0.05 and outlook.travel == 10.0
    assert course([[wheel(0.95)] * 6])[0].wheels[0].travel == 0.0


def test_the_parameters_of_the_configuration_reach_the_warning():
    keys = ['filter.stuck_horizon:=7.0', 'filter.stuck_travel:=0.1', 'filter.stuck_clear_slip:=0.4']
    keys.append('filter.stuck_threshold:=0.7')
    given = StuckSettings.from_configuration(reader.load(['frostyboy'], keys))
    assert (given.horizon, given.travel, given.clear_slip, given.clear_time) == (7.0, 0.1, 0.4, 3.0)
    assert given.threshold == 0.7


def test_a_sign_that_is_there_keeps_the_warning():
    """Slip has fallen, but two wheels are still held near their torque limit."""
    monitor, cruise = StuckMonitor(SETTINGS), [wheel(0.2, rim=1.0, torque=0.3)] * 4
    stalled = [*cruise[:2], *[wheel(0.0, rim=0.1, known=False, torque=0.95)] * 2]
    held(monitor, cruise, 5.0)
    assert held(monitor, stalled, 10.0, start=5.0)[-1].stuck
    free = held(monitor, cruise, 6.0, start=15.0)
    assert 30 <= next(i for i, a in enumerate(free) if not a.stuck) <= 32


def test_an_entrapment_is_in_sight_for_as_long_as_the_warning_expects_it():
    """Slip of 0.95, then 0.7 on the same slope: the warning stands; then the rover backs out."""
    monitor = StuckMonitor(SETTINGS)
    held(monitor, [wheel(0.95)] * 4, 15.0, speed=0.0025, speed_known=True)
    slow = [wheel(0.7, rim=0.003), *[wheel(0.7)] * 3]
    stands = held(monitor, slow, 5.0, start=15.0, speed=0.015, speed_known=True)
    for ahead in stands[-1].wheels:
        assert ahead.travel <= 0.05 * SETTINGS.horizon and ahead.time <= SETTINGS.horizon
    back = [wheel(0.1, rim=-0.05)] * 4
    backs = held(monitor, back, 0.5, start=20.0, speed=-0.045, speed_known=True)
    assert stands[-1].stuck and backs[-1].stuck and backs[-1].wheels[0].travel == 10.0


def test_a_wheel_whose_slip_is_not_known_or_brakes_has_no_entrapment_in_sight():
    rows = [[wheel(0.95), wheel(0.95, known=False), wheel(-0.3), wheel(0.1)]] * 30
    chances = [wheel.probability for wheel in course(rows)[-1].wheels]
    assert chances[0] > 0.5
    assert chances[1] == chances[2] == 0.0


@pytest.mark.parametrize(('speed', 'confirmed'), [(0.0, True), (0.002, True), (0.05, False)])
def test_a_rover_that_stands_by_a_reference_confirms_the_warning(speed, confirmed):
    """Rim speeds in a wrong unit make slip 0.98 of 5 cm/s, but no speed of zero."""
    monitor = StuckMonitor(SETTINGS)
    spinning = [wheel(0.98, rim=2.5)._replace(slip_std=0.003 / 2.5)] * 6
    found = held(monitor, spinning, 3.0, speed=speed, speed_known=True)
    assert found[-1].stuck and found[-1].confirmed is confirmed
    assert not any(a.confirmed for a in found if not a.stuck)
    blind = held(StuckMonitor(SETTINGS), spinning, 3.0, speed=speed)
    assert not any(a.confirmed for a in blind)


def test_a_start_or_a_stop_does_not_confirm_it():
    """There a reference is at rest for up to 0.9 s while the wheels, in a wrong unit, turn fast."""
    monitor = StuckMonitor(SETTINGS)
    spinning = [wheel(0.98, rim=2.5)._replace(slip_std=0.003 / 2.5)] * 6
    found = held(monitor, spinning, 3.0, speed=0.05, speed_known=True)
    found += held(monitor, spinning, 0.9, start=3.0, speed=0.0, speed_known=True)
    noise = [w._replace(rim_speed=0.007) for w in spinning]  # of rates at rest, in that unit
    found += held(monitor, noise, 3.0, start=3.9, speed=0.0, speed_known=True)
    found += held(monitor, spinning, 3.0, start=6.9, speed=0.05, speed_known=True)
    assert found[-1].stuck and not any(a.confirmed for a in found)


@pytest.mark.parametrize(('torque', 'confirmed'), [(0.95, True), (950.0, False)])
def test_wheels_at_their_torque_limit_confirm_it_and_torques_far_beyond_do_not(torque, confirmed):
    """Torques in a wrong unit are a thousand times too great."""
    monitor = StuckMonitor(SETTINGS)
    held(monitor, [wheel(0.2, rim=1.0, torque=0.4)] * 4, 3.0)
    stalled = [wheel(0.0, rim=0.0, known=False, torque=torque)] * 3
    found = held(monitor, [wheel(0.2, rim=1.0, torque=torque), *stalled], 1.0, start=3.0)[-1]
    assert found.stuck and found.confirmed is confirmed


def test_a_median_above_0_9_is_warned_of_also_right_after_a_start():
    found = course([[wheel(0.97)] * 6] * 30)
    assert first(found) == pytest.approx(1.0, abs=0.11)
    assert found[-1].reason == 'median slip 0.97: entrapment under way; stop, back out'
    # Less surely known, it is where a reference says that the rover stands.
    doubtful = [wheel(0.98, rim=0.05)._replace(slip_std=0.1)] * 6
    sees = {'speed_known': True, 'slip_known': True}
    assert first(held(StuckMonitor(SETTINGS), doubtful, 3.0, **sees)) == pytest.approx(
        1.0, abs=0.11
    )
    for one in sees:
        assert not any(a.stuck for a in held(StuckMonitor(SETTINGS), doubtful, 3.0, **{one: True}))
    spins = held(StuckMonitor(SETTINGS), doubtful, 3.0, turning=True, **sees)
    assert not any(a.stuck for a in spins), 'a rover that turns on the spot stands, too'


@pytest.mark.parametrize('threshold', [0.2, 0.5, 0.8])
def test_the_threshold_is_the_probability_that_raises_it(threshold):
    monitor, before, sunk = StuckMonitor(SETTINGS._replace(threshold=threshold)), [], 0.01
    for i in range(600):
        sunk += 0.0002 * i * 0.05 * 0.1  # more and more per rim travel
        wheels = [wheel(0.4)._replace(sinkage=sunk)] * 6
        found = judge(monitor, 0.1 * i, 0.03, True, wheels)
        if found.stuck:
            break
        before.append(found.wheels[0].probability)
    assert found.stuck and found.wheels[0].probability > threshold
    likely = next(i for i, probability in enumerate(before) if probability > threshold)
    assert len(before) - likely == pytest.approx(5, abs=1), 'for half a second'
