# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""An estimator whose state depends on every input, its stamp and its order, to detect lapses."""

import math
from dataclasses import replace
from operator import itemgetter

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.output_guard import blank_estimates

SECOND = 1_000_000_000


def stamp_at(seconds):
    """Stamp [ns] of a time on a clock that starts at 100 s."""
    return 100 * SECOND + round(seconds * SECOND)


def configuration(**changes):
    """Two wheels, and what a test wants otherwise."""
    values = {
        'wheels.names': ['left', 'right'],
        'wheels.radius': [0.1, 0.1],
        'wheels.width': [0.1, 0.1],
        'wheels.y': [0.3, -0.3],
        'rover.mass': 10.0,
    }
    values.update({key.replace('__', '.'): value for key, value in changes.items()})
    return reader.from_parameters(values)


class FakeEstimator:
    """Leaky sum of all inputs: ``value``; ``runs`` and ``steps`` tell what was asked of it."""

    def __init__(self, config):
        self.blank = blank_estimates(config)
        self.value = 0.0
        self.stamp = None
        self.started = False
        self.steps = 0
        self.begun = []
        self.references = 0

    def begin_run(self, stamp, keep_soil):
        self.begun.append((stamp, keep_soil))
        self.value = self.value * 0.5 if keep_soil else 0.0
        self.stamp = stamp
        self.started = True
        self.references = 0

    def step(self, stamp, inputs):
        assert self.stamp is not None
        assert stamp > self.stamp or self.started
        self.started = False
        self.steps += 1
        self.value *= math.exp(-(stamp - self.stamp) / SECOND)
        self.stamp = stamp
        if inputs.wheel_odometry is not None:
            self.value += float(np.nansum(inputs.wheel_odometry.rate)) * 1.1
        if inputs.inertial is not None:
            self.value += float(np.nan_to_num(inputs.inertial.specific_force[0])) * 1.3
        if inputs.sinkage is not None:
            self.value += float(np.nansum(inputs.sinkage.sinkage)) * 1.7
        if inputs.reference is not None:
            self.references += 1
            self.value += inputs.reference.forward * 1.9

    def estimates(self):
        return replace(
            self.blank,
            stamp=self.stamp,
            forward_velocity=self.value,
            yaw_rate=float(self.references),
            slip_std=np.full(2, 0.01),
            slip_class=np.zeros(2, dtype=np.uint8),
        )

    def snapshot(self):
        return self.value, self.stamp, self.started, self.references

    def restore(self, snapshot):
        self.value, self.stamp, self.started, self.references = snapshot

    def health(self):
        return {'fake_steps': self.steps}


def make_core(**changes):
    """Core with a fake estimator, a set for every stamp, nothing held back; returns both."""
    config = configuration(**{'output_rate': 0.0, 'max_lag': 0.0, **changes})
    fake = FakeEstimator(config)
    return EstimatorCore(config, fake), fake


def odometry(t, rate=1.0, torque=math.nan):
    return WheelOdometry(stamp_at(t), np.array([rate, rate]), np.full(2, torque))


def imu(t, force=0.1):
    return InertialReading(stamp_at(t), np.array([force, 0.0, 9.8]), np.zeros(3), None)


def sinkage(t, depth=0.01):
    return SinkageReading(stamp_at(t), np.array([depth, depth]))


def reference(t, forward=0.05, variance=1e-4):
    return ReferenceVelocity(stamp_at(t), forward, variance)


def play(core, measurements, flush=True):
    """Feed the core and return all sets."""
    sets = [estimates for measurement in measurements for estimates in core.add(measurement)]
    return sets + core.flush() if flush else sets


def every(step, kind, count, late=0.0, start=0.0):
    """(time of arrival, message) of a topic whose messages come so much late [s]."""
    return [(t + late, kind(t)) for t in (start + step * i for i in range(count))]


def by_arrival(*topics):
    """Messages of topics as `every` gives them, in the order of their arrival."""
    return [m for _, m in sorted((pair for topic in topics for pair in topic), key=itemgetter(0))]


def arriving(stream, delays):
    """The stream in its order of arrival, each message late by its delay [s]."""
    pairs = zip(delays, stream, strict=True)
    return [m for _, m in sorted(pairs, key=lambda pair: pair[1].stamp + pair[0] * SECOND)]


def with_runs_in_order(stream, delays, **changes):
    """Yield each set, and the last of a run in order through the inputs up to it that had come."""
    core, _ = make_core(**changes)
    arrived = []
    for measurement in arriving(stream, delays):
        arrived.append(measurement)
        for estimates in core.add(measurement):
            used = [m for m in arrived if m.stamp <= estimates.stamp]
            plain, _ = make_core(**{**changes, 'max_lag': 30.0})
            yield estimates, play(plain, sorted(used, key=lambda m: m.stamp))[-1]


def essence(sets):
    """What must be equal to the bit."""
    return [(s.stamp, s.forward_velocity, s.yaw_rate, s.slip_class.tolist()) for s in sets]
