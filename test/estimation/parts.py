# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Constants of a rover for tests of single parts of the estimator."""

from dataclasses import dataclass

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.contacts.contact_models import contact_models
from wheel_terra_estimator.estimation.contacts.loads import WheelLoads
from wheel_terra_estimator.estimation.filter.initial_state import initial_filter, layout_of
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures

SAND = ['generic_six_wheel', 'dry_sand_ding2015']


@dataclass
class Parts:
    """What parts of the estimator are made of."""

    configuration: Configuration

    def __post_init__(self):
        self.rover = Rover.from_configuration(self.configuration)
        self.sensors = SensorFigures.from_configuration(self.configuration)
        self.layout = layout_of(self.rover, self.sensors)
        self.models = contact_models(self.configuration)

    def filter(self):
        """Return a filter at the start of a run."""
        loads = WheelLoads(self.rover).state.load
        return initial_filter(
            self.configuration, self.rover, self.sensors, self.layout, self.models, loads
        )
