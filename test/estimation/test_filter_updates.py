# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Process and measurements of the filter, each by itself."""

import numpy as np
import pytest
from parts import on_sand

from wheel_terra_estimator.estimation.contacts.linearisation import Linearisation
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.stationary_wheels import StationaryPull
from wheel_terra_estimator.estimation.filter.consistency import correlated_cycles
from wheel_terra_estimator.estimation.filter.force_balance import ForceBalance
from wheel_terra_estimator.estimation.filter.reference import ReferenceUpdate
from wheel_terra_estimator.estimation.filter.sinkage import FLOOR_VARIANCE, SinkageUpdate
from wheel_terra_estimator.estimation.filter.sinkage_process import SinkageProcess
from wheel_terra_estimator.estimation.filter.soil_process import SoilProcess
from wheel_terra_estimator.estimation.filter.state import (
    CENTROID,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
    Prediction,
)
from wheel_terra_estimator.estimation.filter.torque import TorqueUpdate
from wheel_terra_estimator.estimation.filter.zero_velocity import ZeroVelocityUpdate
from wheel_terra_estimator.estimation.inputs.contact_sensors import SinkageSums
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.inputs.noise import ObservedNoise
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity
from wheel_terra_estimator.estimation.outputs import Outputs

NAN = float('nan')
FORWARD = (0.05,) * 6


@pytest.fixture
def ekf(parts):
    found = parts.filter()
    found.set(SPEED, 0.045, 0.005**2)
    return found


def window(force_x, force_z, readings=5, noise=0.0):
    """Return IMU readings of a tenth of a second with this mean specific force."""
    sums = (readings * force_x, 0.0, readings * force_z)
    return InertialWindow(readings, *sums, duration=0.1, noise_density=noise)


# -- Reference velocity -----------------------------------------------------------------------


def reference_update(parts):
    return ReferenceUpdate(parts.configuration, parts.rover, parts.sensors, parts.layout)


def hear(parts, update, ekf, time, speed, still=False, fastest_rim=0.05):
    """Fuse a reference of the stated deviation; return whether the speed was opened to it."""
    reading, variance = ReferenceVelocity(0, speed, 0.0), parts.sensors.reference_std**2
    return update.update(
        ekf,
        time,
        reading,
        still=still,
        fastest_rim=fastest_rim,
        opposed=speed < 0.0,
        variance=variance,
    )


def references(parts, ekf, speeds, gap=1.0, fastest_rim=0.05):
    """Fuse references `gap` seconds apart; return for each whether the speed was opened to it."""
    update, opened = reference_update(parts), []
    for i, speed in enumerate(speeds):
        ekf.inflate(SPEED, 1e-8)
        opened.append(hear(parts, update, ekf, gap * i, speed, fastest_rim=fastest_rim))
    return update, opened


def test_a_reference_is_the_textbook_update(parts, ekf):
    before, variance = 0.045, float(ekf.P[SPEED, SPEED])
    references(parts, ekf, [0.046])
    noise, prior = parts.sensors.reference_std**2, variance + 1e-8
    expected = before + prior / (prior + noise) * 0.001
    assert ekf.x[SPEED] == pytest.approx(expected)


def test_a_reference_is_as_noisy_as_it_states_or_as_a_file_does_else_as_is_seen(parts):
    """White innovations of a filter that follows nothing show the noise twice (with K = 0)."""
    update, std = reference_update(parts), 0.25 * parts.sensors.reference_std
    rng, silent = np.random.default_rng(5), ReferenceVelocity(0, 0.05, 0.0)
    told, unsaid = ObservedNoise(parts.sensors), ObservedNoise(parts.sensors, given=())
    assert update.variance(silent, unsaid) == parts.sensors.reference_std**2
    for i, innovation in enumerate(std * rng.normal(size=200)):
        for noise in (told, unsaid):
            noise.compare_reference(float(i), innovation, std**2, 1e-9 * std**2)
    assert update.variance(silent, unsaid) == pytest.approx(std**2, rel=0.5)
    assert update.variance(silent, told) == parts.sensors.reference_std**2
    stated = ReferenceVelocity(0, 0.05, 0.01**2)
    assert update.variance(stated, unsaid) == pytest.approx(0.01**2)
    for _ in range(200):
        unsaid.compare_reference(0.0, 0.0, std**2, 1e-9 * std**2)
    assert update.variance(silent, unsaid) == parts.sensors.reference_std_floor**2


@pytest.mark.parametrize('gap', [0.1, 0.5, 1.0, 2.0])
def test_references_that_jump_are_believed_once_they_last_for_seconds(parts, ekf, gap):
    """Errors of satellites jump for a second or two, at whatever rate they are read."""
    ekf.set(SPEED, 0.9, 0.005**2)
    good, lasting = round(10.0 / gap), round(5.0 / gap)
    _, opened = references(parts, ekf, [0.9] * good + [0.5] * lasting, gap, fastest_rim=1.0)
    first = opened.index(True)
    assert 2.1 < gap * (first - good + 1) <= max(2.3 + gap, 2.0 * gap)
    assert ekf.x[SPEED] == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize('gap', [0.1, 0.2, 0.5])
def test_references_that_fall_away_gradually_are_believed_at_the_second_outlier(parts, ekf, gap):
    """Wheels that lose their hold slow the rover down by 0.04 m/s^2."""
    ekf.set(SPEED, 0.9, 0.002**2)
    update = reference_update(parts)
    for i in range(round(20.0 / gap)):
        ekf.inflate(SPEED, 1e-8)
        speed = 0.9 - 0.04 * max(gap * i - 5.0, 0.0)
        opened = hear(parts, update, ekf, gap * i, speed, fastest_rim=1.0)
        assert update.state.rejected <= 2
        if update.state.rejected == 2:
            break
    assert opened


def test_a_rover_that_drives_faster_than_its_wheels_is_not_believed(parts):
    """Rims run at 0.05 m/s: two readings that agree are followed at 0.06, not at 0.13 m/s."""
    found = {}
    for speed in (0.06, 0.13):
        fresh = parts.filter()
        fresh.set(SPEED, 0.045, 0.001**2)
        references(parts, fresh, [0.045] * 5 + [speed] * 3)
        found[speed] = fresh.x[SPEED]
    assert found[0.06] > 0.053
    assert found[0.13] == pytest.approx(0.045, abs=0.002)


def test_a_reference_after_a_long_gap_is_believed_at_once_and_not_the_models(parts):
    """Rims run at 0.05 m/s, readings come every 10 s: one shows a rover that no longer advances.

    One that is faster than the wheels or against them is wild, and one on standing wheels may be.
    """
    cases = (
        (0.002, False, 0.002),
        (-0.002, False, -0.002),
        (-0.03, False, 0.045),
        (0.07, False, 0.045),
        (0.05, True, 0.0),
    )
    for speed, still, expected in cases:
        fresh = parts.filter()
        fresh.set(SPEED, 0.0 if still else 0.045, 0.001**2)
        update, _ = references(parts, fresh, [float(fresh.x[SPEED])] * 3, gap=10.0)
        assert hear(parts, update, fresh, 30.0, speed, still=still) is (speed == expected)
        assert fresh.x[SPEED] == pytest.approx(expected, abs=0.003)
        assert (update.model_variance_factor > 50.0) is (speed == expected)


def test_models_are_doubted_while_the_references_keep_to_one_side(parts, ekf):
    """Each of these is within its gate; six to one side are none by chance (0.4 %)."""
    rng = np.random.default_rng(7)
    speeds = {'white': rng.normal(0.045, 0.003, 6), 'one side': np.full(6, 0.049)}
    doubt = {}
    for name, values in speeds.items():
        fresh = parts.filter()
        fresh.set(SPEED, 0.045, 1e-8)
        doubt[name] = references(parts, fresh, values)[0].model_variance_factor
    # A mean with gain 1/6, of variance 1/11 where they are white; its square over that, squared.
    mean = (1.0 - (5.0 / 6.0) ** 6) * 0.004 / parts.sensors.reference_std
    assert doubt['one side'] == pytest.approx((11.0 * mean**2) ** 2, rel=0.1) and mean > 0.5
    assert doubt['white'] < 2.0


def test_two_references_on_standing_wheels_say_that_the_rover_slides(parts, ekf):
    """A single one may be wild: neither is it believed, nor does it open the speed."""
    update = reference_update(parts)
    ekf.set(SPEED, 0.0, 0.0005**2)
    readings = [(0.0, 0.0), (1.0, 0.5), (2.0, 0.0), (3.0, 0.03), (4.0, 0.03), (5.0, 0.03)]
    for time, speed in readings:
        hear(parts, update, ekf, time, speed, still=True, fastest_rim=0.0)
        sliding = time > 3.0
        assert (update.state.sliding_until > time) is sliding
        assert update.known(time) is sliding
        assert ekf.x[SPEED] == pytest.approx(0.03 if sliding else 0.0, abs=0.003)


def test_two_unlike_references_on_standing_wheels_are_wild(parts, ekf):
    update = reference_update(parts)
    ekf.set(SPEED, 0.0, 0.0005**2)
    for time, speed in ((0.0, 0.0), (1.0, 0.15), (2.0, -0.05), (3.0, 0.08)):
        hear(parts, update, ekf, time, speed, still=True, fastest_rim=0.0)
        assert update.state.sliding_until <= time
        assert ekf.x[SPEED] == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(('deviations', 'alike'), [(3.0, True), (6.0, False)])
def test_outliers_four_deviations_apart_do_not_agree(parts, ekf, deviations, alike):
    update, std = reference_update(parts), parts.sensors.reference_std
    ekf.set(SPEED, 0.9, 0.1 * std**2)
    assert not hear(parts, update, ekf, 1.0, 0.5, fastest_rim=1.0)
    _, prior = update.innovation(ekf, ReferenceVelocity(0, 0.5, 0.0))
    apart = deviations * np.sqrt(3.0 * std**2 + prior)  # of both readings, and of the innovation
    assert bool(hear(parts, update, ekf, 2.0, 0.5 - apart, fastest_rim=1.0)) is alike


def test_the_first_reference_of_a_run_may_be_wild(parts):
    """No gap is known yet: it is no seldom one that shows another slip."""
    fresh = parts.filter()
    fresh.set(SPEED, 0.045, 0.001**2)
    update = reference_update(parts)
    assert not hear(parts, update, fresh, 5.0, 0.01)
    assert fresh.x[SPEED] > 0.04


def test_neither_a_rejected_reference_nor_one_at_rest_tells_of_slip(parts, ekf):
    update = reference_update(parts)
    ekf.set(SPEED, 0.0, 0.0005**2)
    hear(parts, update, ekf, 0.0, 0.0, still=True, fastest_rim=0.0)
    assert not update.known(0.1)
    ekf.set(SPEED, 0.045, 0.001**2)
    hear(parts, update, ekf, 1.0, 0.02)  # beyond its gate, and alone
    assert not update.known(1.1)
    hear(parts, update, ekf, 2.0, 0.02)
    assert update.known(2.1)
    hear(parts, update, ekf, 3.0, 0.5)  # wild
    assert update.known(3.1) and update.known(6.9) and not update.known(7.1)
    assert not update.known_twice(3.1)
    hear(parts, update, ekf, 4.0, 0.02)
    assert update.known_twice(6.9) and not update.known_twice(7.1)
    assert update.fresh(13.9) and not update.fresh(14.1)  # ten seconds after the last of all
    assert not reference_update(parts).fresh(0.0)


def test_a_rejected_reference_leaves_the_speed_in_doubt_until_the_next_one(parts, ekf):
    """As likely wild as true: two speeds, half each, deviate by half of their difference."""
    update = reference_update(parts)
    ekf.set(SPEED, 0.045, 0.001**2)
    hear(parts, update, ekf, 0.0, 0.045)
    told = float(ekf.x[SPEED])
    hear(parts, update, ekf, 1.0, 0.02)
    assert update.doubt_variance(1.1) == pytest.approx(np.var([told, 0.02]))
    assert update.doubt_variance(6.0) == 0.0  # the slip is forgotten
    hear(parts, update, ekf, 2.0, 0.9)  # no wheel drives so fast
    assert update.doubt_variance(2.1) == 0.0
    hear(parts, update, ekf, 3.0, 0.02)
    hear(parts, update, ekf, 4.0, float(ekf.x[SPEED]))
    assert update.doubt_variance(4.1) == 0.0


def wandering(rng, count, dt, std, time):
    """Return a first-order Gauss-Markov error at `count` times."""
    hold, values = np.exp(-dt / time), [std * rng.standard_normal()]
    for _ in range(count - 1):
        values.append(hold * values[-1] + std * np.sqrt(1 - hold**2) * rng.standard_normal())
    return values


@pytest.mark.parametrize(('stated', 'least', 'most'), [(0.03, 0.85, 1.0), (0.0, 0.0, 0.4)])
def test_readings_that_are_off_by_the_same_are_no_many_readings(stated, least, most):
    """A satellite receiver at 5 Hz, off by 3 cm/s for 15 s at a time: its errors are covered."""
    keys = [f'sensors.reference_wander_std:={stated}', 'sensors.reference_std:=0.01']
    parts = on_sand(*keys, 'filter.gate:=1e6')
    rng, dt, count, inside = np.random.default_rng(4), 0.2, 75, []
    for _ in range(16):
        ekf, update = parts.filter(), reference_update(parts)
        ekf.set(SPEED, 0.5 + 0.1 * rng.standard_normal(), 0.1**2)
        for i, error in enumerate(wandering(rng, count, dt, 0.03, 15.0)):
            prediction = Prediction.unchanged(ekf.x)
            update.predict(prediction, dt if i else 0.0)
            ekf.predict(*prediction)
            speed = 0.5 + error + 0.01 * rng.standard_normal()
            hear(parts, update, ekf, dt * i, speed, fastest_rim=0.6)
        inside.append(abs(ekf.x[SPEED] - 0.5) < 1.96 * np.sqrt(ekf.P[SPEED, SPEED]))
    assert least <= np.mean(inside) <= most


def test_the_error_that_lasts_keeps_its_deviation_over_any_step():
    parts = on_sand('sensors.reference_wander_std:=0.03')
    prediction, e = Prediction.unchanged(parts.filter().x), parts.layout.reference_error
    reference_update(parts).predict(prediction, 0.5 * parts.sensors.reference_wander_time)
    hold = prediction.F[e, e]
    assert hold == pytest.approx(np.exp(-0.5))
    assert hold**2 * 0.03**2 + prediction.Q[e, e] == pytest.approx(0.03**2)


# -- Zero velocity ----------------------------------------------------------------------------


def rest(parts, ekf, seconds, yaw=0.0):
    update = ZeroVelocityUpdate(parts.rover)
    for i in range(round(10 * seconds)):
        window = InertialWindow(readings=5, rate_readings=5, pitch_rate=5 * 0.002)
        cycle = parts.cycle((0.0,) * 6, time=0.1 * i, still=True, window=window, yaw_rate=yaw)
        update.update(ekf, cycle, sliding=False)
    return update


def test_a_rover_that_stands_has_no_speed_and_learns_the_zero_of_its_gyro(parts, ekf):
    update = rest(parts, ekf, 5.0, yaw=0.003)
    assert abs(ekf.x[SPEED]) < 1e-3
    assert update.standing()
    assert update.state.zero.yaw == pytest.approx(0.003 * np.sum(1.0 / np.arange(1, 45)), rel=0.1)
    assert update.state.zero.pitch > 0.0
    turning = rest(parts, parts.filter(), 5.0, yaw=0.1)
    assert turning.state.zero == (0.0, 0.0)


# -- Sinkage ----------------------------------------------------------------------------------


def read_sinkage(parts, update, ekf, time, depth, count=1, unmodelled_std=0.0, slip_known=False):
    """Fuse the sum of some readings of the first wheel; return its mean, None where it stays."""
    sums, unmodelled = SinkageSums((depth,) + (0.0,) * 5, (count,) + (0,) * 5), np.zeros(6)
    variance, unmodelled[:] = parts.sensors.sinkage_std**2, unmodelled_std
    rows = update.update(ekf, time, sums, variance, unmodelled, slip_known=slip_known)
    ekf.fuse(rows)
    return float(ekf.x[parts.layout.sinkage.start]) if rows else None


@pytest.fixture
def sinkage_update(parts):
    return SinkageUpdate(parts.configuration, parts.layout)


def test_a_spike_of_the_sinkage_is_dropped_and_three_in_a_row_are_believed(
    parts, ekf, sinkage_update
):
    update = sinkage_update
    for i in range(20):
        assert read_sinkage(parts, update, ekf, 0.1 * i, 0.03) is not None
    believed = [read_sinkage(parts, update, ekf, 2.0 + 0.1 * i, 0.1) for i in range(3)]
    assert believed == [None, None, pytest.approx(0.1, abs=0.002)]
    assert update.state.rejected == 3
    assert update.unread(3.0) == [1, 2, 3, 4, 5]
    assert update.unread(9.0) == list(range(6))


def test_with_a_known_slip_a_jump_of_the_sinkage_is_other_ground(parts, ekf, sinkage_update):
    """Its stiffness carries the load at the new depth, and nothing is known of its strength."""
    layout, n = parts.layout, float(parts.configuration.soil.sinkage_exponent)
    for i in range(23):
        depth = 0.02 if i < 20 else 0.06
        read_sinkage(parts, sinkage_update, ekf, 0.1 * i, depth, slip_known=True)
    softer = (n + 0.5) * np.log(3.0)  # load = k z^(n + 1/2) (Bekker)
    stiffness = ekf.x[layout.stiffness]
    assert stiffness[0] - stiffness[1] == pytest.approx(-softer, rel=0.05)
    stds = np.sqrt(np.diagonal(ekf.P)[layout.shear_error])
    assert stds[0] == pytest.approx(np.hypot(stds[1], 0.5 * softer), rel=0.02)


@pytest.mark.parametrize(
    ('rest', 'std', 'read'),
    [
        (0.04, 0.025, [0.1, *[0.03] * 3]),  # a spike within the deviations at the start
        (0.04, 0.025, [0.2, *[0.03] * 3]),  # and one beyond
        (0.01, 0.005, [0.1, 0.1, 0.1]),  # far from the configured soil
    ],
)
def test_a_first_reading_is_believed_where_the_next_ones_agree(
    parts, ekf, sinkage_update, rest, std, read
):
    ekf.set(parts.layout.sinkage.start, rest, std**2)
    found = [
        read_sinkage(parts, sinkage_update, ekf, 0.1 * i, depth) for i, depth in enumerate(read)
    ]
    assert found[-1] == pytest.approx(read[-1], abs=0.002)
    assert len(read) > 3 or found[0] is None


def test_two_readings_of_the_sinkage_are_the_textbook_update(parts, ekf, sinkage_update):
    """Information adds up: that of the state, and that of their mean with its floor."""
    zi, noise = parts.layout.sinkage.start, parts.sensors.sinkage_std**2 / 2.0 + FLOOR_VARIANCE
    ekf.set(zi, 0.03, 0.002**2)
    information = 1.0 / 0.002**2 + 1.0 / noise
    mean = (0.03 / 0.002**2 + 0.031 / noise) / information
    assert read_sinkage(parts, sinkage_update, ekf, 0.0, 0.062, 2) == pytest.approx(mean)
    assert float(ekf.P[zi, zi]) == pytest.approx(1.0 / information)


def test_the_first_reading_of_a_wheel_that_dug_in_is_believed(parts, ekf, sinkage_update):
    ekf.set(parts.layout.sinkage.start, 0.03, 0.002**2)
    assert read_sinkage(parts, sinkage_update, ekf, 0.0, 0.11) is None, 'a spike'
    assert read_sinkage(
        parts, sinkage_update, ekf, 0.1, 0.11, unmodelled_std=0.08
    ) == pytest.approx(0.11, abs=0.001)


def sinkage_predicted(parts, x, loads=None, angle=NAN, rims=FORWARD):
    """Return the prediction over a tenth of a second, and the travel."""
    prediction = Prediction.unchanged(x)
    cycle = parts.cycle(rims, loads, leaving_angles=np.full(6, angle))
    process = SinkageProcess(parts.rover, parts.layout, parts.models)
    return prediction, process.predict(prediction, x, cycle)


def relaxed(parts, ekf, seconds, speed=0.05, start=None):
    x, travel = ekf.x.copy(), 0.0
    x[SPEED] = speed
    if start is not None:
        x[parts.layout.sinkage] = start
    for _ in range(round(10 * seconds)):
        prediction, way = sinkage_predicted(parts, x)
        x, travel = prediction.mean, travel + way
    return x[parts.layout.sinkage], travel, prediction


def test_digging_leaves_the_sinkage_open_until_it_is_read_or_the_wheel_rolls_on(parts, ekf):
    """Sand that a standing wheel spins out is gone: 0 to 0.1 of the way that the rim slips."""
    process = SinkageProcess(parts.rover, parts.layout, parts.models)

    def goes_on(seconds, speed, read=()):
        ekf.x[SPEED] = speed
        unread = [i for i in range(6) if i not in read]
        for _ in range(round(10 * seconds)):
            process.predict(Prediction.unchanged(ekf.x), ekf.x, parts.cycle(FORWARD))
            process.end_cycle(ekf, ekf.x[parts.layout.sinkage].copy(), unread, 0.1)
        return process.state.unmodelled_std

    assert goes_on(20.0, 0.0, read=[2])[[1, 2]] == pytest.approx([0.1 * 0.05 * 20.0, 0.0])
    assert (goes_on(10.0, 0.05) < 2e-3).all()


def test_the_sinkage_relaxes_over_travel_to_where_the_bearing_law_carries_the_load(parts, ekf):
    at_rest = ekf.x[parts.layout.sinkage]  # the same law without slip
    found, travel, _ = relaxed(parts, ekf, 30.0, start=0.05)
    assert travel == pytest.approx(1.5)
    assert found == pytest.approx(at_rest, rel=0.05)
    halfway, _, _ = relaxed(parts, ekf, 1.0, start=0.05)
    assert ((at_rest < halfway) & (halfway < 0.05)).all()


def test_wheels_sink_backwards_as_they_do_forwards(parts, ekf):
    found = []
    for way in (1.0, -1.0):
        x = ekf.x.copy()
        x[SPEED], x[parts.layout.sinkage] = 0.03 * way, 0.05
        rims = tuple(way * rim for rim in FORWARD)
        prediction, travel = sinkage_predicted(parts, x, rims=rims)
        of_sinkage = np.diagonal(prediction.F)[parts.layout.sinkage]
        found.append([prediction.mean[parts.layout.sinkage], of_sinkage, np.diagonal(prediction.Q)])
        assert travel > 0.0 and (found[-1][0] < 0.05).all()
    for forward, backward in zip(*found, strict=True):
        np.testing.assert_array_equal(forward, backward)


# -- Soil -------------------------------------------------------------------------------------


def soil_noise(parts, **given):
    prediction = Prediction.unchanged(np.ones(parts.layout.size))
    SoilProcess(parts.configuration, parts.layout).predict(prediction, 0.5, **given)
    return prediction


def test_soil_walks_with_travel_and_returns_to_the_configured_one(parts):
    walked = soil_noise(parts, torque_known=True)
    for index, std in ((SHEAR_STRENGTH, 0.1), (SHEAR_MODULUS, 0.1), (SLIP_SINKAGE, 0.05)):
        assert walked.Q[index, index] == pytest.approx(std**2 * 0.5)
        assert walked.mean[index] == pytest.approx(np.exp(-0.5 / 100.0))


def test_what_all_wheels_share_of_the_shear_error_lasts_longer_than_what_one_has(parts):
    e = parts.layout.shear_error
    prediction = soil_noise(parts, torque_known=True)
    F, Q = prediction.F[e, e], prediction.Q[e, e]
    alternating = np.array([1.0, -1.0] * 3)
    assert F @ np.ones(6) == pytest.approx(np.exp(-0.5 / 5.0) * np.ones(6))
    assert F @ alternating == pytest.approx(np.exp(-0.5 / 0.5) * alternating)
    assert prediction.mean[e] == pytest.approx(F @ np.ones(6))
    gain = parts.configuration.sensors.torque_gain_std
    stationary = (0.05**2 + gain**2) * np.eye(6) + 0.12**2
    assert F @ stationary @ F.T + Q == pytest.approx(stationary)
    assert parts.filter().P[e, e] == pytest.approx(stationary)


def test_softer_ground_is_weaker_ground_where_no_torque_says_how_weak(parts):
    k, e = parts.layout.stiffness, parts.layout.shear_error
    assert (soil_noise(parts, torque_known=True).Q[k, e] == 0.0).all()
    Q = soil_noise(parts, torque_known=False).Q
    own = Q[k, k] - Q[k, k][0, 1]
    error = Q[e, e] - Q[e, e][0, 1]
    correlation = np.diagonal(Q[k, e]) / np.sqrt(np.diagonal(own) * np.diagonal(error))
    assert correlation == pytest.approx([0.7] * 6)


# -- Torque and balance -----------------------------------------------------------------------


def linearised(parts, x, loads, angle=NAN, angle_std=0.05):
    linearisation = Linearisation(parts.rover, parts.layout, parts.models, angle_std)
    cycle = parts.cycle(FORWARD, loads, leaving_angles=np.full(6, angle))
    return linearisation.update(x, cycle, (0.0,) * 6)


def forces(parts, ekf):
    loads = WheelLoads(parts.rover).state.load
    return linearised(parts, ekf.x, loads), loads


def torque_update(parts, ekf, found, cycle, doubt=0.0, repeats=1.0):
    return TorqueUpdate(parts.configuration, parts.rover, parts.layout).update(
        ekf,
        found,
        cycle,
        variance=parts.sensors.torque_std**2,
        model_variance=doubt,
        repeats=repeats,
    )


def torque_rows(parts, ekf, doubt=0.0, repeats=1.0, reference_known=True):
    """Rows of four wheels that turn and were read 0.3 N m above the model; and the model's."""
    found, _ = forces(parts, ekf)
    cycle = parts.cycle(
        FORWARD,
        torque=(*(found.torque + 0.3).tolist()[:5], NAN),
        turns=(True,) * 4 + (False,) * 2,
        reference_known=reference_known,
    )
    return torque_update(parts, ekf, found, cycle, doubt, repeats), found.torque


def test_without_a_reference_torques_tell_little_by_what_they_differ(parts, ekf):
    """The mean of all is known as well as by single rows, what they differ by a fifth as well."""
    alone, _ = torque_rows(parts, ekf, repeats=10.0)
    rows, model = torque_rows(parts, ekf, repeats=10.0, reference_known=False)
    same, coordinates = np.ones(4), np.linalg.pinv(np.array([row.jacobian for row in alone]))

    def information(rows):
        """Fisher information of the jacobians' own coordinates: H' R^-1 H with H = rows of I."""
        J = np.array([row.jacobian for row in rows])
        W = J / np.sqrt([[row.variance] for row in rows]) @ coordinates
        return W.T @ W

    inverse = np.linalg.inv(information(rows))
    single = np.diag([row.variance for row in alone])
    apart = 0.025 * float(np.abs(model).mean())
    expected = single + apart**2 * 10.0 * 5.0 / 0.15 * (np.eye(4) - 0.25)
    assert inverse == pytest.approx(expected, rel=1e-6)
    assert same @ inverse @ same == pytest.approx(same @ single @ same)


def test_torques_are_rows_of_turning_wheels_that_were_read(parts, ekf):
    rows, model = torque_rows(parts, ekf)
    assert [row.residual for row in rows] == pytest.approx([0.3] * 4)
    noise = parts.sensors.torque_std**2 + (parts.rover.load_std * model[0]) ** 2
    assert rows[0].variance == pytest.approx(noise, rel=1e-3)
    many, doubted = (torque_rows(parts, ekf, *how)[0] for how in ((0.0, 30.0), (2.0,)))
    assert many[0].variance == pytest.approx(30.0 * noise, rel=1e-3)
    assert doubted[0].variance - rows[0].variance == pytest.approx(2.0 * model[0] ** 2)


def test_a_wheel_that_the_models_keep_missing_counts_less_and_no_other(parts, ekf):
    """Its variance grows by the square of the mean of its NIS (Birge 1932) beyond 1."""
    found, _ = forces(parts, ekf)
    update = TorqueUpdate(parts.configuration, parts.rover, parts.layout)
    off = np.array([20.0 * parts.sensors.torque_std, 0.0, 0.0, 0.0, 0.0, 0.0])
    cycle = parts.cycle(FORWARD, torque=tuple((found.torque + off).tolist()))
    arguments = {'variance': parts.sensors.torque_std**2, **SURE}
    first, *_, last = [update.update(ekf, found, cycle, **arguments) for _ in range(21)]
    assert [row.variance for row in last[1:]] == [row.variance for row in first[1:]]
    prior = first[0].jacobian @ ekf.P @ first[0].jacobian
    noise = parts.sensors.torque_std**2 + (parts.rover.load_std * found.torque[0]) ** 2
    nis = off[0] ** 2 / (prior + noise)
    mean = nis + (1.0 - nis) * 0.9**21
    gate = max(off[0] ** 2 / parts.configuration.filter.gate - (prior + noise), 0.0)
    assert last[0].variance == pytest.approx(noise * mean**2 + gate, rel=1e-3)
    assert mean > 2.0


def test_the_zero_of_a_torque_sensor_is_told_from_the_soil_by_the_load(parts, ekf):
    """A wheel's share of the load changes along the way: the soil's torque does, the zero not."""
    zero, rng = 2.0 * parts.sensors.torque_zero_std, np.random.default_rng(2)
    level = np.array(WheelLoads(parts.rover).state.load)
    entries = range(parts.layout.size)
    learned = {SHEAR_STRENGTH, *entries[parts.layout.torque_zero]}
    for i in set(entries) - learned:
        ekf.set(i, float(ekf.x[i]), 1e-12)
    strong = ekf.x.copy()
    strong[SHEAR_STRENGTH] = 0.1  # the soil is stronger than the file says
    for _ in range(120):
        loads = tuple((level * (0.3 + 1.4 * rng.random(6))).tolist())
        found, true = (linearised(parts, x, loads) for x in (ekf.x, strong))
        torque = true.torque + np.array([zero, -zero, 0.0, 0.0, 0.0, 0.0])
        cycle = parts.cycle(FORWARD, torque=tuple(torque.tolist()))
        ekf.fuse(torque_update(parts, ekf, found, cycle))
    update = TorqueUpdate(parts.configuration, parts.rover, parts.layout)
    assert update.zeros(ekf.x) == pytest.approx((zero, -zero, 0, 0, 0, 0), abs=0.15 * zero)
    assert ekf.x[SHEAR_STRENGTH] == pytest.approx(0.1, abs=0.01)


SURE = {'model_variance': 0.0, 'repeats': 1.0}


def force_balance(parts):
    return ForceBalance(parts.configuration, parts.rover, parts.sensors, parts.layout)


def test_the_error_of_a_measured_leaving_angle_weakens_torque_and_balance(parts, ekf):
    """With 0.05 rad a row is as uncertain as half of what 0.1 rad change the force."""
    loads = WheelLoads(parts.rover).state.load
    balance = force_balance(parts)
    variances, torques, pulls = [], [], []
    for std, angle in ((1e-9, -0.2), (0.05, -0.2), (1e-9, -0.25), (0.05, NAN), (1e-9, NAN)):
        found = linearised(parts, ekf.x, loads, angle, std)
        torque = tuple(found.torque.tolist())
        cycle = parts.cycle(FORWARD, loads, torque=torque, window=window(0.0, 9.8))
        rows = torque_update(parts, ekf, found, cycle)
        total = balance.sum_of_pulls(cycle, 0.0)
        along = total._replace(along=float(found.pull.sum()))
        row = balance.update(ekf, found, along, cycle, stationary=[None] * 6, **SURE)
        variances.append((rows[0].variance, row.variance))
        torques.append(float(found.torque[0]))
        pulls.append(found.pull)
    sure, unsure, _, unmeasured, without = variances
    assert unsure[0] - sure[0] == pytest.approx((torques[2] - torques[0]) ** 2, rel=1e-6)
    assert unsure[1] - sure[1] == pytest.approx(float(((pulls[2] - pulls[0]) ** 2).sum()), rel=0.01)
    assert unmeasured == without


def test_noise_of_the_accelerometer_averages_out_over_the_same_ground(parts, ekf):
    """Cycles over one piece of ground share its tilt and the zero, not a strong vibration.

    A density of 0.04 is a variance of 0.4 over 0.1 s.
    """
    found, loads = forces(parts, ekf)
    balance, mass = force_balance(parts), parts.rover.mass
    cycle = parts.cycle(FORWARD, loads, window=window(0.0, 9.8, noise=0.04))
    total = balance.sum_of_pulls(cycle, 0.0)
    weight = parts.rover.gravity * mass
    assert total.vibration == pytest.approx(mass**2 * 0.4 - (0.04 * weight) ** 2)
    calm = balance.sum_of_pulls(cycle._replace(window=window(0.0, 9.8)), 0.0)
    added = mass**2 * (0.4 - parts.sensors.specific_force_std**2 / 5)
    assert total.variance - calm.variance == pytest.approx(added)
    given = {'stationary': [None] * 6, 'model_variance': 0.0}
    once, often = (
        force_balance(parts).update(ekf, found, total, cycle, repeats=repeats, **given).variance
        for repeats in (1.0, 30.0)
    )
    assert often - once == pytest.approx(29.0 * (total.variance - total.vibration))


def test_the_balance_of_forces_on_a_slope(parts, ekf):
    balance = force_balance(parts)
    found, loads = forces(parts, ekf)
    ekf.x[parts.layout.sinkage] = 0.03  # even ruts: the body lies along the ground
    along = float(found.pull.sum()) + 12.0
    cycle = parts.cycle(FORWARD, loads, window=window(along / parts.rover.mass, 9.6))
    total = balance.sum_of_pulls(cycle, 0.0)
    row = balance.update(ekf, found, total, cycle, stationary=[None] * 6, **SURE)
    assert row.residual == pytest.approx(12.0, abs=1e-6)
    rear = int(np.argmin(parts.rover.longitudinal))
    ekf.x[parts.layout.sinkage.start + rear] += 0.01  # the nose points up by it
    tilted = balance.update(ekf, found, total, cycle, stationary=[None] * 6, **SURE)
    tilt = 0.01 * parts.rover.rut_tilt[rear]
    assert tilt > 0.0
    assert tilted.residual == pytest.approx(12.0 - parts.rover.mass * 9.6 * tilt)
    standing = [StationaryPull(5.0, 20.0), *[None] * 5]
    held = balance.update(ekf, found, total, cycle, stationary=standing, **SURE)
    assert held.residual - tilted.residual == pytest.approx(float(found.pull[0]) - 5.0)
    # What the model does not know of the pull of a wheel: a tenth of its load at a deviation of 1.
    given = {'stationary': standing, 'model_variance': 4.0, 'repeats': 1.0}
    doubted = balance.update(ekf, found, total, cycle, **given)
    tenths = 0.1 * np.array(loads[1:])
    assert doubted.variance - held.variance == pytest.approx(4.0 * float(tenths @ tenths))
    own = 20.0**2 - float(found.pull_noise[0]) ** 2
    assert held.variance - tilted.variance == pytest.approx(own)


def test_cycles_that_see_the_same_ground_are_one_piece_of_information():
    assert correlated_cycles(FORWARD, 0.1) == pytest.approx(0.15 / 0.005)
    assert correlated_cycles((1.5, NAN), 0.2) == 1.0
    assert correlated_cycles((0.0,) * 4, 0.1) == 100.0


def test_what_is_not_seen_is_considered_and_not_learned(parts):
    layout = parts.layout

    def entries(**changes):
        given = {'forces_show_speed': True, 'unread': [], 'blurred': False}
        return set(layout.considered(**(given | changes)))

    assert entries() == set()
    assert entries(forces_show_speed=False) == {SPEED}
    one = entries(unread=[2])
    assert one == {layout.sinkage.start + 2, layout.stiffness.start + 2}
    assert SLIP_SINKAGE in entries(unread=list(range(6)))
    errors = range(layout.size)[layout.shear_error]
    assert entries(blurred=True) == {SHEAR_STRENGTH, SHEAR_MODULUS, CENTROID, *errors}


def test_the_jacobian_of_a_settled_sinkage_is_its_derivative(parts, ekf):
    part, wheel = parts.layout.sinkage, parts.layout.sinkage.start + 2
    settled, _, _ = relaxed(parts, ekf, 30.0, speed=0.04)

    def predicted(column, step):
        x = ekf.x.copy()
        x[SPEED], x[part] = 0.04, settled
        x[column] += step
        return sinkage_predicted(parts, x)[0]

    for column, step, error in (
        (parts.layout.stiffness.start + 2, 1e-3, 0.1),
        (SLIP_SINKAGE, 1e-3, 0.1),
        (SPEED, 1e-4, 0.1),
        (wheel, 1e-4, None),  # what is forgotten; the law's slope is a number of the tuning
    ):
        up, down = (predicted(column, way * step).mean[wheel] for way in (1.0, -1.0))
        difference, stated = (up - down) / (2.0 * step), predicted(column, 0.0).F[wheel, column]
        if error is None:
            assert 1.0 - stated == pytest.approx(1.0 - difference, rel=0.25)
        else:
            assert stated == pytest.approx(difference, rel=error), column


def test_a_stiffer_soil_has_both_moduli_of_sinkage_larger_by_the_same_factor():
    """k_c / b + k_phi is what the wheel feels: twice of it is twice of each."""
    parts = on_sand('soil.cohesive_modulus:=2000.0')
    outputs = Outputs(parts.configuration, parts.rover, parts.sensors, parts.layout)
    size = parts.layout.size
    names, before, _ = outputs.learned_soil(np.zeros(size), np.zeros((size, size)))
    mean = np.zeros(size)
    mean[parts.layout.stiffness] = np.log(2.0)
    _, after, _ = outputs.learned_soil(mean, np.zeros((size, size)))
    ratio = dict(zip(names, after / before, strict=True))
    assert before[names.index('soil.cohesive_modulus')] == pytest.approx(2000.0)
    for name in ('soil.cohesive_modulus', 'soil.frictional_modulus'):
        assert ratio[name] == pytest.approx(2.0)
    assert ratio['soil.shear_modulus'] == pytest.approx(1.0)


@pytest.mark.parametrize('entry', [SHEAR_STRENGTH, SHEAR_MODULUS])
def test_the_deviation_of_what_was_learned_is_half_of_what_two_of_the_state_change(parts, entry):
    outputs = Outputs(parts.configuration, parts.rover, parts.sensors, parts.layout)
    std, step = 0.02, np.zeros(parts.layout.size)
    step[entry] = std
    covariance = np.diag(step**2)
    above, below = (outputs.learned_soil(sign * step, covariance)[1] for sign in (1.0, -1.0))
    stated = outputs.learned_soil(0.0 * step, covariance)[2]
    assert stated == pytest.approx(0.5 * (above - below), rel=1e-3)
