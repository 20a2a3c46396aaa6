# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How often the true soil lies within two deviations of what a drive has taught.

    python -m wheel_terra_lab.studies.taught_coverage --seeds 8600 8606 --simulators A B C

The truth is that of the parameters as each simulator has them: in A the factors on the nominal
soil, in B the drawn soil, whose other laws differ, in C what its laws come nearest to: the peak of
the friction, the length of shear. Bearing is compared by the pressure at the depth at which the
wheels drove, under a plate as wide as one. On odd seeds of A and B the file states no soil; in C
the simulator draws whether it does.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.filter.initial_state import layout_of
from wheel_terra_estimator.estimation.filter.state import (
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
)
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.simulation.drive import Drive
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_lab.evaluation.kinds import KINDS
from wheel_terra_lab.evaluation.simulator_b.drive import simulate as simulate_b
from wheel_terra_lab.evaluation.simulator_c.drive import simulate as simulate_c
from wheel_terra_lab.evaluation.simulator_c.ground import bearing_terms, pressure

DURATION = 60.0  # [s]
SCENARIOS: Mapping[str, Sequence[str]] = {
    'A': ('climb', 'stop_and_go', 'near_stuck'),
    'B': ('cruise', 'climb', 'stop_and_go'),
    'C': ('cruise', 'climb', 'stop_and_go'),
}


class Truth(NamedTuple):
    """Of a drive: logarithms of the true soil over the stated one."""

    strength: float
    shear_modulus: float
    stiffness: float
    slip_sinkage: float = np.nan  # beyond the stated n1 [-], where there is such a law


def drive_of(simulator: str, kind: str, seed: int) -> tuple[Configuration, Any, Truth]:
    """Return configuration, arrivals and truth of a drive."""
    if simulator == 'A':
        drive = Drive(load(KINDS[kind]), seed)
        done = drive.run(DURATION)
        factor = drive.soil_factors
        n1 = done.configuration.effects['slip_sinkage_exponent']['n1']
        truth = Truth(
            float(np.log(factor['friction'])),
            float(np.log(factor['shear_modulus'])),
            float(np.log(factor['stiffness'])),
            n1 * (factor['slip_sinkage'] - 1.0),
        )
        return _unstated(done.configuration, seed), done.arrivals, truth
    if simulator == 'B':
        b = simulate_b(kind, seed, DURATION)
        soil, width = b.draw.soil, b.draw.vehicle.shape.width[0]
        depth = float(np.nanmedian(b.truth.sinkage))
        bearing = (soil.cohesive_modulus / width + soil.stiffness) * depth**soil.exponent
        true = bearing, soil.tan_friction, soil.shear_modulus
        truth = _against(b.configuration.soil, width, depth, true)
        return _unstated(b.configuration, seed), b.arrivals, truth
    c = simulate_c(kind, seed, DURATION)
    width = c.rover.rims.width[0]
    depth = float(np.nanmedian(c.truth.sinkage))
    resistance = pressure(bearing_terms(c.soil, width, c.rover.gravity), np.array(depth))
    laws = float(resistance), float(c.soil.friction), float(c.soil.shear_length)
    return c.configuration, c.arrivals, _against(c.configuration.soil, width, depth, laws)


def _unstated(configuration: Configuration, seed: int) -> Configuration:
    if seed % 2 == 0:
        return configuration
    rest = frozenset(key for key in configuration.stated if not key.startswith('soil.'))
    return replace(configuration, stated=rest)


def _against(stated: Any, width: float, depth: float, true: tuple[Any, Any, Any]) -> Truth:
    modulus = stated.cohesive_modulus / width + stated.frictional_modulus
    nominal = (
        modulus * depth**stated.sinkage_exponent,
        np.tan(stated.friction_angle),
        stated.shear_modulus,
    )
    bearing, friction, length = (float(np.log(t / n)) for t, n in zip(true, nominal, strict=True))
    return Truth(friction, length, bearing)


def scored(simulator: str, kind: str, seed: int) -> list[tuple[str, str, float]]:
    """Return parameter, verdict and error over the deviation at the end of a drive."""
    configuration, arrivals, truth = drive_of(simulator, kind, seed)
    core = EstimatorCore(configuration)
    for arrival in sorted(arrivals, key=lambda a: a.arrival):
        core.add(arrival.measurement)
    core.flush()
    posterior = core.posterior()
    if posterior is None:
        return []
    sensors = SensorFigures.from_configuration(configuration)
    layout = layout_of(Rover.from_configuration(configuration), sensors)
    x, rows = posterior.mean, {row.name: row for row in core.taught()}
    found = [
        ('soil.friction_angle_deg', x[SHEAR_STRENGTH], truth.strength),
        ('soil.shear_modulus', x[SHEAR_MODULUS], truth.shear_modulus),
        ('soil.frictional_modulus', x[layout.stiffness].mean(), truth.stiffness),
        ('effects.slip_sinkage_exponent.n1', x[SLIP_SINKAGE], truth.slip_sinkage),
    ]
    return [
        (name, rows[name].verdict, float(mean - true) / rows[name].std)
        for name, mean, true in found
        if np.isfinite(true)
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Print the coverage of each parameter, learned or not, in each simulator."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', nargs=2, type=int, required=True, metavar=('FIRST', 'END'))
    parser.add_argument('--simulators', nargs='+', choices=SCENARIOS, default=list(SCENARIOS))
    arguments = parser.parse_args(argv)
    for simulator in arguments.simulators:
        errors: dict[tuple[str, str], list[float]] = defaultdict(list)
        for seed in range(*arguments.seeds):
            for kind in SCENARIOS[simulator]:
                for name, verdict, error in scored(simulator, kind, seed):
                    errors[name, verdict].append(error)
        for (_, verdict), each in list(errors.items()):
            errors['all', verdict] += each
        for (name, verdict), each in sorted(errors.items()):
            z = np.array(each)
            print(
                f'{simulator} {name:32} {verdict:10} {len(z):4}, within two deviations '
                f'{np.mean(np.abs(z) < 2.0):.0%}, rms {np.sqrt(np.mean(z**2)):.2f}',
                flush=True,
            )


if __name__ == '__main__':
    main()
