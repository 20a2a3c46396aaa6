# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a contact law costs that is not the ground's: slip, pull and coverage under each law.

    python -m wheel_terra_lab.studies.law_study --seeds 6600 6601

Simulator A takes each law for the ground, B follows Wong and Reece with laws of its own, C an
elastoplastic shear that no filter has. The filter gets each law in turn on the same measurements.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.errors import ConfigurationWarning
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.scenario import load
from wheel_terra_estimator.terramechanics.contact_law import LAWS
from wheel_terra_lab.evaluation.kinds import KINDS
from wheel_terra_lab.evaluation.runner import inputs_of_mode, record, run_estimator
from wheel_terra_lab.evaluation.scores import coverage, rms, scored_rows
from wheel_terra_lab.evaluation.simulators import SIMULATORS, BenchDrive

FloatArray = NDArray[np.float64]
DRIVES = ('cruise', 'climb')
MODES = ('reference', 'no_reference')
DURATION = 40.0  # [s]


class Errors(NamedTuple):
    """Errors and deviations of the scored wheels and rows, pulls over the load."""

    slip: FloatArray
    slip_std: FloatArray
    pull: FloatArray
    pull_std: FloatArray


def drives_of(kind: str, seed: int) -> Iterator[tuple[str, BenchDrive]]:
    """Yield the ground and its drive for each of them."""
    for law in LAWS:
        keys = dict(KINDS[kind])
        keys['truth'] = [*keys['truth'], f'rover.contact_law:={law}']
        drive = simulate(load(keys), seed, DURATION)
        yield f'A, `{law}`', BenchDrive(drive.configuration, drive.arrivals, drive.truth)
    for name in ('B', 'C'):
        yield name, SIMULATORS[name].simulate(kind, seed, DURATION, None)


def errors(drive: BenchDrive, law: str, mode: str) -> Errors:
    """Return the errors of the filter with a law."""
    configuration = drive.configuration.replace({'rover.contact_law': law})
    found = record(*run_estimator(configuration, inputs_of_mode(drive.arrivals, mode)))
    truth = drive.truth
    position, scored = scored_rows(truth, found, configuration.wheels.slip_radius)
    mean_load = truth.normal_load.mean()
    return Errors(
        (found.slip[position] - truth.slip)[scored],
        found.slip_std[position][scored],
        ((found.drawbar_pull[position] - truth.drawbar_pull) / mean_load)[scored],
        (found.drawbar_pull_std[position] / mean_load)[scored],
    )


def row(parts: list[Errors]) -> str:
    """Return RMS error and coverage of slip and pull."""
    joined = Errors(*(np.concatenate(part) for part in zip(*parts, strict=True)))
    slip, pull = coverage(joined.slip, joined.slip_std), coverage(joined.pull, joined.pull_std)
    return f'{rms(joined.slip):.3f} ({slip:.2f}), {rms(joined.pull):.3f} ({pull:.2f})'


def main() -> None:
    """Print a table: ground and inputs down, the filter's law across."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seeds', nargs='+', type=int, default=[6600, 6601])
    parser.add_argument('--kinds', nargs='+', default=list(DRIVES))
    arguments = parser.parse_args()
    warnings.simplefilter('ignore', ConfigurationWarning)  # effects that a law has not
    found: dict[tuple[str, str, str], list[Errors]] = {}
    for kind in arguments.kinds:
        for seed in arguments.seeds:
            for ground, drive in drives_of(kind, seed):
                for mode in MODES:
                    for law in LAWS:
                        part = errors(drive, law, mode)
                        found.setdefault((mode, ground, law), []).append(part)
                        print(f'{kind} {seed}, {ground}, {mode}, {law}: {row([part])}', flush=True)
    print('| inputs | ground | ' + ' | '.join(f'`{law}`' for law in LAWS) + ' |')
    print('|---' * (2 + len(LAWS)) + '|')
    for mode, ground in dict.fromkeys(key[:2] for key in found):
        cells = [row(found[mode, ground, law]) for law in LAWS]
        print(f'| {mode.replace("_", " ")} | {ground} | {" | ".join(cells)} |')


if __name__ == '__main__':
    main()
