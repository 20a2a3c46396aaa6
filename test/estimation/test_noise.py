# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise as it is seen, on ramps and beside a moving filter, and as messages of the IMU state it."""

from dataclasses import replace
from math import nan, radians

import numpy as np
import pytest
from fake_estimator import SECOND, play
from parts import on_sand
from test_core_with_filter import START
from test_core_with_filter import drive as noisy_drive

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.inputs.noise import ObservedNoise, StatedNoise
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    InertialVariance,
    StepInputs,
    WheelOdometry,
)

NAN = float('nan')


def sensors():
    figures = on_sand().sensors
    return replace(figures, imu_rate=100.0, wheel_odometry_rate=10.0, sinkage_rate=10.0)


@pytest.fixture
def noise():
    return ObservedNoise(sensors())


def read(noise, sensor, std, times, slope=0.0, messages=1):
    """Readings of six wheels on a ramp, each the mean of some messages."""
    rng = np.random.default_rng(5)
    for time in times:
        values = slope * time + std / np.sqrt(messages) * rng.normal(size=6)
        noise.read(sensor, float(time), tuple(values.tolist()))
    return noise.observed(sensor)


@pytest.mark.parametrize(
    ('sensor', 'std', 'count', 'how'),
    [
        ('torque', 0.8, 400, {'slope': 5.0}),
        ('gyro', 0.01, 800, {'messages': 10}),  # means of several tell the noise of one
    ],
)
def test_white_noise_is_seen_as_it_is_on_a_ramp_and_in_means(noise, sensor, std, count, how):
    assert read(noise, sensor, std, 0.1 * np.arange(count), **how) == pytest.approx(std, rel=0.08)


def test_noise_is_seen_in_readings_that_are_not_evenly_spaced(noise):
    """Wheel rates at 50 Hz, merged for estimates at 20 Hz, come after 40 and 60 ms in turn."""
    times = np.cumsum(np.tile([0.04, 0.06], 500))
    assert read(noise, 'wheel_rate', 0.1, times, slope=5.0) == pytest.approx(0.1, rel=0.08)


def test_noise_clearly_beyond_what_is_stated_is_taken_in_its_place(noise):
    stated, times = noise.stated['torque'], 0.1 * np.arange(400)
    for share, taken in ((0.5, False), (1.5, False), (4.0, True)):
        noise.reset()
        observed = read(noise, 'torque', share * stated, times)
        assert noise.variance('torque') == pytest.approx((observed if taken else stated) ** 2)
    # A message that states more than is seen is believed.
    assert noise.variance('torque', 100.0 * stated**2) == 100.0 * stated**2


def test_noise_that_nobody_stated_is_taken_as_it_is_seen():
    times, default = 0.1 * np.arange(400), sensors().torque_std
    silent = ObservedNoise(sensors(), given={'sensors.sinkage_std'})
    assert silent.variance('torque') == default**2
    observed = read(silent, 'torque', 0.1 * default, times)
    assert silent.variance('torque') == pytest.approx(observed**2)
    assert observed == pytest.approx(0.1 * default, rel=0.1)
    read(silent, 'sinkage', 0.1 * silent.stated['sinkage'], times)
    assert silent.variance('sinkage') == silent.stated['sinkage'] ** 2


def test_noise_that_messages_of_the_imu_state_is_told_as_stated():
    noise, times = ObservedNoise(sensors(), given=()), 0.1 * np.arange(400)
    by_imu = StatedNoise(angular_rate_std=0.0005)
    observed = read(noise, 'gyro', 0.02, times)
    found = noise.report(by_imu)
    assert found['gyro_noise_stated_rad_s'] == 0.0005
    assert 'noise_beyond_stated' not in found  # vibration is no fault
    words = found['noise_beyond_default']
    assert f'gyro noise {observed / 0.0005:.0f} times what is stated' in words
    assert '(covariance of imu/data, or sensors.angular_rate_std: ' in words


def test_what_nobody_stated_is_known_after_the_first_seconds():
    rng = np.random.default_rng(8)
    told, silent = ObservedNoise(sensors()), ObservedNoise(sensors(), given=())
    for i in range(120):
        odometry = WheelOdometry(0, np.full(6, 0.5), 3.0 + 0.02 * rng.normal(size=6))
        for noise in (told, silent):
            noise.update(0.1 * i, StepInputs(wheel_odometry=odometry))
    assert told.observed('torque') is None
    assert silent.observed('torque') == pytest.approx(0.02, rel=0.1)


def test_coarse_wheel_rates_are_known_by_the_first_readings_of_a_drive():
    rng, seen = np.random.default_rng(11), ObservedNoise(sensors(), given=())
    for i in range(30):
        odometry = WheelOdometry(0, rng.normal(0.5, 0.08, 6), np.full(6, 2.0))
        seen.update(0.1 * i, StepInputs(wheel_odometry=odometry))
    assert seen.variance('wheel_rate') == pytest.approx(0.08**2, rel=0.4)
    assert seen.observed('torque') is None  # constant at rest: too soon


def test_wheels_that_stand_tell_nothing_of_the_noise_of_their_rates():
    rng, seen = np.random.default_rng(9), ObservedNoise(sensors(), given=())
    for i in range(400):
        rate = rng.normal(0.5, 0.08, 6) * (i >= 60)
        odometry = WheelOdometry(0, np.append(rate[:5], 0.0), np.full(6, nan))
        seen.update(0.1 * i, StepInputs(wheel_odometry=odometry))
    assert seen.observed('wheel_rate') == pytest.approx(0.08, rel=0.15)


def test_steps_and_gaps_are_no_noise(noise):
    times = 0.1 * np.arange(400)
    std = noise.stated['sinkage']
    rng = np.random.default_rng(6)
    for i, time in enumerate(times):
        value = 0.02 * (i // 100) + std * rng.normal()  # a wheel enters another rut
        noise.read('sinkage', float(time), (value, NAN))
    assert noise.observed('sinkage') == pytest.approx(std, rel=0.3)
    before = noise.state.channels['sinkage'].readings
    noise.read('sinkage', 100.0, (0.5, 0.5))
    assert noise.state.channels['sinkage'].readings == before


def compared(noise, innovations, variance, filter_variance, *stated):
    for i, innovation in enumerate(innovations):
        noise.compare_reference(float(i), innovation, variance, filter_variance, *stated)
    return noise.observed('reference')


@pytest.mark.parametrize('factor', [0.5, 1.0, 4.0])
def test_the_noise_of_references_is_seen_beside_a_filter_that_follows_them(noise, factor):
    """A Kalman filter of a constant, told a wrong R; what it lags behind does not count."""
    rng = np.random.default_rng(7)
    R = noise.stated['reference'] ** 2
    true, mean, P = 0.05, 0.04, 1e-5
    for i in range(600):
        P += 0.02 * R
        innovation = true + factor * np.sqrt(R) * rng.normal() - mean
        noise.compare_reference(float(i), innovation, R, P)
        mean += P / (P + R) * innovation
        P *= R / (P + R)
    assert noise.observed('reference') == pytest.approx(factor * np.sqrt(R), rel=0.3)


def test_the_noise_of_references_is_a_mean_over_thirty(noise):
    """Differences of two deviations, then one of one: a quarter of the variance."""
    std = noise.stated['reference']
    before = compared(noise, [std * (-1) ** i for i in range(400)], std**2, 1e-9 * std**2)
    noise.compare_reference(400.0, 0.0, std**2, 1e-9 * std**2)
    after = noise.observed('reference')
    assert (after / before) ** 2 == pytest.approx(1.0 - (1.0 - 0.25) / 30.0)


def test_a_vibrating_rover_is_told_in_words(noise):
    std = 20.0 * noise.stated['accelerometer']
    read(noise, 'accelerometer', std, 0.01 * np.arange(6000))
    found = noise.report()
    assert found['accelerometer_noise_seen_m_s2'] == pytest.approx(std, rel=0.15)
    assert 'noise_beyond_default' not in found
    words = found['noise_beyond_stated']
    assert 'accelerometer noise' in words
    assert 'sensors.specific_force_std: 0.' in words


def test_a_reference_that_is_off_by_a_constant_is_not_noisy_for_it(noise):
    std = noise.stated['reference']
    innovations = std * (5.0 + np.random.default_rng(9).normal(size=600))
    assert compared(noise, innovations, std**2, 1e-9 * std**2) == pytest.approx(std, rel=0.3)


@pytest.mark.parametrize('first', [1, 15])
def test_wild_references_are_no_noise(noise, first):
    """One in twenty is off by fifty deviations; the others are still worth what they state."""
    rng, std = np.random.default_rng(11), 5.0 * noise.stated['reference']
    for i in range(300):
        innovation = std * rng.normal() + (50.0 * std if i % 20 == first else 0.0)
        noise.compare_reference(float(i), innovation, std**2, 1e-6 * std**2, std**2)
        assert noise.variance('reference', std**2) == std**2
    assert noise.observed('reference') == pytest.approx(std, rel=0.5)


@pytest.mark.parametrize(('share', 'told'), [(1.0, False), (0.1, True)])
def test_a_reference_is_held_against_its_own_covariance(noise, share, told):
    std = 20.0 * noise.stated['reference']
    innovations = std * np.random.default_rng(7).normal(size=300)
    observed = compared(noise, innovations, std**2, 1e-6 * std**2, (share * std) ** 2)
    assert observed == pytest.approx(std, rel=0.3)
    found = noise.report()
    assert found['reference_noise_stated_m_s'] == pytest.approx(share * std)
    assert ('covariance of reference_odom' in found.get('noise_beyond_stated', '')) is told
    assert 'noise_beyond_default' not in found


def test_a_factor_that_tells_nothing_is_not_written_out(noise):
    compared(noise, [0.05, -0.05] * 10, 1e-4, 1e-6, 1e-300)
    assert 'reference noise over 1000 times what is stated' in noise.report()['noise_beyond_stated']


# Noise of the IMU as its messages state it: the same as in a file, and no placeholder.


MIDDLE = START + SECOND
FIGURES = {
    'sensors.specific_force_std': 0.4,
    'sensors.angular_rate_std': 0.02,
    'sensors.orientation_std_deg': 1.5,
}
STATED = InertialVariance(0.4**2, 0.02**2, radians(1.5) ** 2)
SILENT = {
    'rover.mass': 50.0,
    'wheels.names': ['front_left', 'front_right', 'rear_left', 'rear_right'],
    'wheels.radius': [0.17] * 4,
    'wheels.width': [0.12] * 4,
    'wheels.x': [0.26, 0.26, -0.26, -0.26],
    'wheels.y': [0.29, -0.29, 0.29, -0.29],
}
ROVER = reader.from_parameters(SILENT)


def drive(variances, backwards=False):
    """A start, a drive and a stop; `variances` go to the messages of the IMU in turn."""
    stream, left = [], iter(variances)
    variance = None
    for m in noisy_drive(4, duration=2.0):
        if isinstance(m, InertialReading):
            variance = next(left, variance)
            m = replace(m, orientation=np.array([0.0, -0.015, 0.0, 1.0]), variance=variance)
        back = 30 * SECOND if backwards and m.stamp > MIDDLE else 0
        stream.append(replace(m, stamp=m.stamp - back))
    return stream


def run(configuration, stream):
    """Return speed, slip and their deviations of all sets, and what diagnostics tell."""
    core = EstimatorCore(configuration)
    sets = play(core, stream)
    rows = [[s.forward_velocity, s.forward_velocity_variance, *s.slip, *s.slip_std] for s in sets]
    return np.array(rows), core.health()


@pytest.fixture(scope='module')
def default():
    return run(ROVER, drive([InertialVariance()]))


@pytest.fixture(scope='module')
def by_message():
    return run(ROVER, drive([STATED]))[0]


def test_a_message_states_what_a_file_can_state(default, by_message):
    by_file, _ = run(ROVER.replace(FIGURES), drive([InertialVariance()]))
    np.testing.assert_array_equal(by_message, by_file)
    assert np.abs(by_message - default[0]).max() > 0.01


def test_a_file_comes_before_the_message_key_by_key(by_message):
    sharp = InertialVariance(1e-4, STATED.angular_rate, 1e-6)
    file = {k: v for k, v in FIGURES.items() if k != 'sensors.angular_rate_std'}
    both, _ = run(ROVER.replace(file), drive([sharp]))
    np.testing.assert_array_equal(both, by_message)


@pytest.mark.parametrize('variances', [(1e-12, 99999.0, nan), (-1.0, 1e-12, 99999.0)])
def test_placeholders_leave_the_defaults(variances, default):
    found, told = run(ROVER, drive([InertialVariance(*variances)]))
    np.testing.assert_array_equal(found, default[0])
    assert told == default[1]


def test_the_first_message_that_states_something_counts():
    later = InertialVariance(4.0, 0.1, 0.05**2)
    placeholder = InertialVariance(1e6, 0.0, nan)
    found, _ = run(ROVER, drive([placeholder, STATED, later]))
    np.testing.assert_array_equal(found, run(ROVER, drive([placeholder, STATED]))[0])
    # Each field by itself: one that comes later completes those before.
    known = StatedNoise().completed(InertialVariance(0.0, 1e-4, 0.0), ())
    known = known.completed(InertialVariance(0.04, 4e-4, 0.0), ())
    assert known == pytest.approx((0.2, 0.01, 0.0))


def test_late_messages_and_a_clock_set_back_change_nothing_of_it():
    stream = drive([STATED])
    imu = [m for m in stream if isinstance(m, InertialReading)]
    late = [m for m in stream if m is not imu[0]]
    late.insert(30, imu[0])
    end = [replace(stream[-1], stamp=stream[-1].stamp + SECOND)]
    np.testing.assert_array_equal(run(ROVER, late + end)[0][-1], run(ROVER, stream + end)[0][-1])
    by_message, health = run(ROVER, drive([STATED], backwards=True))
    assert health['clock_steps_back'] == 1
    np.testing.assert_array_equal(
        by_message, run(ROVER.replace(FIGURES), drive([STATED], backwards=True))[0]
    )
