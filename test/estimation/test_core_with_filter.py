# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The rules of time hold for the real filter: its kept states leave nothing out."""

import numpy as np
import pytest
from estimate_sets import assert_sound
from fake_estimator import SECOND, play

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.sideways import Sideways

START = 100 * SECOND


@pytest.fixture(scope='module')
def rover():
    return reader.load(['frostyboy'])


def drive(seed, duration=3.0):
    """A start, a drive and a stop, with all channels and noise."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal
    stream = []
    for i in range(round(10 * duration)):
        moving = 0.5 < 0.1 * i < duration - 1.0
        rate = 3.0 * moving * (1.0 + 0.05 * noise(4))
        stream.append(WheelOdometry(START + i * SECOND // 10, rate, 20.0 + 3.0 * noise(4)))
    for i in range(round(50 * duration)):
        force = np.array([0.3, 0.0, 9.8]) + 0.1 * noise(3)
        stamp = START + i * SECOND // 50
        stream.append(InertialReading(stamp, force, 0.01 * noise(3), None))
    for i in range(round(5 * duration)):
        stamp = START + i * SECOND // 5 + 3_000_000
        stream.append(SinkageReading(stamp, 0.02 + 0.002 * noise(4)))
    for i in range(round(2 * duration)):
        stamp = START + i * SECOND // 2 + 7_000_000
        stream.append(ReferenceVelocity(stamp, 0.6 + 0.02 * noise(), 4e-4))
    return sorted(stream, key=lambda m: m.stamp)


def tail(duration=3.0):
    """Wheel odometry after everything has arrived."""
    stamps = [START + round((duration + 1.0 + 0.1 * i) * SECOND) for i in range(3)]
    return [WheelOdometry(stamp, np.full(4, 3.0), np.full(4, 20.0)) for stamp in stamps]


def bits(estimates):
    return {
        name: value if isinstance(value, (str, dict, Sideways)) else np.asarray(value).tobytes()
        for name, value in vars(estimates).items()
    }


@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.slow)])
def test_late_inputs_end_in_the_same_bits(rover, seed):
    stream = drive(seed)
    rng = np.random.default_rng(seed)
    delays = rng.uniform(0.0, 0.95, len(stream)) * (rng.random(len(stream)) < 0.3) * SECOND
    arrival = [
        m.stamp + (0 if isinstance(m, WheelOdometry) else delay)
        for m, delay in zip(stream, delays, strict=True)
    ]
    late = [stream[i] for i in np.argsort(arrival, kind='stable')]
    ends = []
    for order in (stream, late):
        core = EstimatorCore(rover)
        ends.append(bits(play(core, (*order, *tail()))[-1]))
        assert core.health()['filter_restarts'] == 0
    assert ends[0] == ends[1]


def test_after_a_reset_nothing_is_left(rover):
    core = EstimatorCore(rover)
    for m in drive(1, 2.0):
        core.add(m)
    core.reset()
    again, fresh = (play(each, drive(2, 2.0)) for each in (core, EstimatorCore(rover)))
    assert list(map(bits, again)) == list(map(bits, fresh))


@pytest.mark.parametrize('seed', [0, pytest.param(1, marks=pytest.mark.slow)])
def test_garbage_in_no_nan_out(rover, seed):
    rng = np.random.default_rng(seed)
    junk = np.array([np.nan, np.inf, -np.inf, 0.0, 1e308, -1e308, 1e-308, -3.0, 50.0, 0.26])

    def spoil(values, share):
        values = np.array(values, dtype=float)
        return np.where(rng.random(values.shape) < share, rng.choice(junk, values.shape), values)

    core = EstimatorCore(rover)
    sets = []
    for m in drive(seed):
        steps = (-5.0, -1.5, -0.1, 0.1, 5.0, 1e6)
        shift = rng.choice(steps) if rng.random() < 0.04 else 0.0
        stamp = 0 if rng.random() < 0.02 else m.stamp + round(shift * SECOND)
        if isinstance(m, WheelOdometry):
            m = WheelOdometry(stamp, spoil(m.rate, 0.15), spoil(m.torque, 0.15))
        elif isinstance(m, InertialReading):
            attitude = spoil([0.0, 0.0, 0.0, 1.0], 0.1) if rng.random() < 0.5 else None
            force, rate = spoil(m.specific_force, 0.02), spoil(m.angular_rate, 0.02)
            m = InertialReading(stamp, force, rate, attitude)
        elif isinstance(m, SinkageReading):
            m = SinkageReading(stamp, spoil(m.sinkage, 0.15))
        else:
            forward, variance = spoil([m.forward, m.variance], 0.2)
            m = ReferenceVelocity(stamp, float(forward), float(variance))
        sets += core.add(m)
    sets += core.flush()
    assert len(sets) > 20
    for estimates in sets:
        assert_sound(estimates)
