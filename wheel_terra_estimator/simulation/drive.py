# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A whole simulated drive in memory, and its parts for a closed loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.simulation.drives import Command, Drives
from wheel_terra_estimator.simulation.plant import LONGEST_STEP, RoverPlant
from wheel_terra_estimator.simulation.scenario import SENSOR_FAULTS, WHEEL_FAULTS, Fault, Scenario
from wheel_terra_estimator.simulation.sensors import START, Arrival, SensorSuite
from wheel_terra_estimator.simulation.terrain import SOIL_QUANTITIES, Ground, Terrain
from wheel_terra_estimator.simulation.truth import Truth, TruthTable

DEFAULT_TORQUE_RATIO = 1.5
"""Torque limit over mean load times radius, where neither rover nor scenario states one."""


@dataclass(frozen=True)
class SimulatedDrive:
    """What a drive gave: ``arrivals`` (measurements in the order of their arrival), ``truth``.

    ``configuration`` is what an estimator may know of it.
    """

    scenario: Scenario
    seed: int
    arrivals: list[Arrival]
    truth: TruthTable

    @property
    def configuration(self) -> Configuration:
        """What the estimator receives."""
        return self.scenario.configuration

    def __repr__(self) -> str:
        """Return the scenario, the seed and the truth."""
        return f'SimulatedDrive, seed {self.seed}, {len(self.arrivals)} arrivals\n  {self.truth!r}'


class Drive:
    """A seeded rover with its sensors, one step at a time.

    ``scenario``: the scenario; its command profile is used by ``run`` only.
    """

    def __init__(self, scenario: Scenario, seed: int = 0) -> None:
        # Separate, so that one more draw of one kind does not change the others.
        variation, unevenness, noise = (
            np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
        )
        self.scenario = scenario
        self.seed = seed
        draw = scenario.variation
        truth = scenario.truth

        def factor(deviation: float) -> float:
            return float(np.exp(deviation * np.clip(variation.standard_normal(), -2.5, 2.5)))

        soil = {name: factor(getattr(draw, name)) for name in SOIL_QUANTITIES}
        stiffness = [p.factors['stiffness'] * factor(draw.patch) for p in scenario.patches]
        patches = [
            replace(p, factors=p.factors | {'stiffness': own})
            for p, own in zip(scenario.patches, stiffness, strict=True)
        ]
        slope_shift = draw.slope * variation.standard_normal()
        # Factor on the commands of the scenario, as drawn [-]
        self.speed_factor = factor(draw.speed)
        changes = {'rover.mass': truth.rover.mass * factor(draw.mass)}
        radius_factor = factor(draw.radius)
        if radius_factor != 1.0:
            changes['wheels.radius'] = (truth.wheels.radius * radius_factor).tolist()
        # True rover and base soil of this drive
        self.configuration = truth.replace(changes)
        profile = scenario.profile
        fastest = self.speed_factor * float(
            np.max(
                np.abs(profile.forward)
                + np.abs(profile.turn_rate) * np.abs(truth.wheels.y).max(initial=0.0)
            )
        )
        reach = fastest * scenario.duration + 2.0 * float(np.abs(truth.wheels.x).max()) + 1.0
        slope = scenario.slope
        ground = Ground(
            slope_position=slope.position,
            slope_angle=slope.angle + np.where(slope.angle != 0.0, slope_shift, 0.0),
            side_slope=slope.side,
            patches=patches,
            border=scenario.values['patches.border'],
            base_factors=soil,
            undulation=slope.undulation,
            undulation_length=slope.undulation_length,
            patchiness=scenario.values['patchiness'],
            patchiness_length=scenario.values['patchiness_length'],
            extent=(-reach, reach),
        )
        terrain = Terrain(ground, unevenness)
        drives = self._drives(max(fastest, 0.01))
        efficiency = scenario.values['dig_efficiency']
        self.plant = RoverPlant(self.configuration, terrain, drives, efficiency)
        self.faults = (*scenario.faults, *_random_faults(scenario, noise))
        self.sensors = SensorSuite(scenario, noise, self.faults)
        period = self.sensors.odometry_period
        self.step_length = period / np.ceil(period / LONGEST_STEP - 1e-9)  # duration of a step [s]
        self.last_truth: Truth = self.plant.truth()  # truth at the end of the last step

    def step(self, command: Command) -> list[Arrival]:
        """Drive under a command for ``step_length`` and return the sensor readings."""
        self._set_wheel_faults()
        self.last_truth = self.plant.step(command, self.step_length)
        return self.sensors.measure(self.last_truth)

    def run(
        self, duration: float | None = None, progress: Callable[[int], object] | None = None
    ) -> SimulatedDrive:
        """Drive the scenario's profile and return everything.

        ``duration``: in place of the scenario's [s]. ``progress``: called with 1 for each second
        driven.
        """
        duration = self.scenario.duration if duration is None else duration
        profile = self.scenario.profile
        arrivals: list[Arrival] = []
        stamps: list[int] = []
        rows: list[Truth] = []
        period = self.sensors.odometry_period
        if not period <= duration < math.inf:
            raise UserError(
                f'duration is {duration:g} s; the wheels are read every {period:g} s: give more'
            )
        due = period
        factor = self.speed_factor
        for _ in range(round(duration / self.step_length)):
            command = profile.at(self.plant.time)
            arrivals += self.step(Command(factor * command.forward, factor * command.turn_rate))
            while due <= self.plant.time + 1e-9:
                stamps.append(START + round(due * 1e9))
                rows.append(self.last_truth)
                due += period
            if progress and self.plant.time // 1.0 > (self.plant.time - self.step_length) // 1.0:
                progress(1)
        arrivals.sort(key=lambda a: a.arrival)
        thresholds = self.configuration.filter.class_thresholds
        table = TruthTable.from_rows(
            stamps, rows, thresholds, self.scenario.configuration.wheels.names
        )
        return SimulatedDrive(self.scenario, self.seed, arrivals, table)

    def _drives(self, fastest: float) -> Drives:
        truth, drive = self.configuration, self.scenario.drive
        wheels = truth.wheels
        by_load = truth.rover.mass * truth.rover.gravity / wheels.count * wheels.radius
        if drive.torque_ratio:
            limit = drive.torque_ratio * by_load
        else:
            known = wheels.torque_limit
            limit = np.where(known > 0.0, known, DEFAULT_TORQUE_RATIO * by_load)
        return Drives(limit, fastest / wheels.slip_radius, drive.acceleration / wheels.slip_radius)

    def _set_wheel_faults(self) -> None:
        faults = self.plant.faults
        for array in (faults.rate_factor, faults.torque_factor, faults.load_factor):
            array[:] = 1.0
        for fault in self.faults:
            if fault.kind not in WHEEL_FAULTS or not fault.active(self.plant.time):
                continue
            factor, value = WHEEL_FAULTS[fault.kind]
            getattr(faults, factor)[slice(None) if fault.wheel is None else fault.wheel] = value


def simulate(scenario: Scenario, seed: int = 0, duration: float | None = None) -> SimulatedDrive:
    """Run a scenario; the seed decides all random quantities, ``duration`` [s] replaces its own."""
    return Drive(scenario, seed).run(duration)


def _random_faults(scenario: Scenario, random: np.random.Generator) -> list[Fault]:
    """Draw sensor faults: when, which, which wheel, for 2 to 20 s."""
    rate = scenario.values['faults.random_rate']  # per hour
    count = random.poisson(rate * scenario.duration / 3600.0)
    faults = []
    for _ in range(count):
        start = random.uniform(0.0, scenario.duration)
        wheel = int(random.integers(-1, scenario.configuration.wheels.count))
        faults.append(
            Fault(
                str(random.choice(SENSOR_FAULTS)),
                None if wheel < 0 else wheel,
                start,
                start + random.uniform(2.0, 20.0),
            )
        )
    return faults
