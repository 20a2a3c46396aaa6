# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A rover for tests of single parts of the estimator, steady inputs of all, simulated drives."""

import functools
import math
from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.cycle import Cycle, RimSpeeds
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.contacts.steering import headings
from wheel_terra_estimator.estimation.filter.initial_state import initial_filter, layout_of
from wheel_terra_estimator.estimation.inputs.inertial import InertialWindow
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    StepInputs,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load

SAND = ['generic_six_wheel', 'dry_sand_ding2015']


def drive(duration=4.5, seed=3, **keys):
    """Return a simulated drive on sand without jitter and spikes, by default on the level."""
    base = {'configuration': SAND, 'sensors.jitter': 0.0, 'sensors.sinkage_outliers': 0.0}
    return simulate(load({**base, 'duration': duration, **keys}), seed)


def step_inputs(time, rate, torque, force=(0.1, 0.0, 9.8), speed=None):
    """Return stamp and inputs of a step; a speed is that of an exact reference."""
    stamp = 10**12 + round(time * 1e9)
    return stamp, StepInputs(
        wheel_odometry=WheelOdometry(stamp, np.asarray(rate), np.asarray(torque)),
        inertial=InertialReading(stamp, np.array(force), np.zeros(3), None),
        reference=None if speed is None else ReferenceVelocity(stamp, speed, 1e-6),
    )


def straight_headings(rover):
    """Return the headings of wheels that point straight ahead."""
    return headings(rover, (0.0,) * rover.wheel_count)


@dataclass
class Parts:
    """What parts of the estimator are made of."""

    configuration: Configuration

    def __post_init__(self):
        self.rover = Rover.from_configuration(self.configuration)
        self.sensors = SensorFigures.from_configuration(self.configuration)
        self.layout = layout_of(self.rover, self.sensors)
        self.models = contact_models(self.configuration)

    def cycle(self, rims=(0.05,) * 6, loads=None, **given):
        """Return a cycle of a rover that drives straight ahead on level ground."""
        n = self.rover.wheel_count
        level = WheelLoads(self.rover).state
        driving = {
            'time': 0.0,
            'dt': 0.1,
            'window': InertialWindow(),
            'rims': rims,
            'rim_noise': (0.0,) * n,
            'yaw_compensated': RimSpeeds.of(rims, 0.0, straight_headings(self.rover)),
            'yaw_rate': 0.0,
            'lateral_motion': 0.0,
            'headings': straight_headings(self.rover),
            'still': False,
            'torque': (math.nan,) * n,
            'leaving_angles': None,
            'loads': level._replace(load=loads or level.load, force_known=True),
            'turns': (True,) * n,
            'reference_known': True,
            'demand_change': 0.0,
        }
        return Cycle(**(driving | given))

    def filter(self):
        """Return a filter at the start of a run."""
        loads = WheelLoads(self.rover).state.load
        return initial_filter(
            self.configuration, self.rover, self.sensors, self.layout, self.models, loads
        )


@functools.cache
def on_sand(*keys):
    """Return the parts of a rover on sand, with other values of keys; nobody changes them."""
    return Parts(reader.load(SAND, keys))
