# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All figures of ``wheel-terra bench``."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.estimation.filter.ekf import GatedFilter
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.benchmarks.pairs import Figure, timed_pairs
from wheel_terra_lab.benchmarks.peers import PlainFilter, read_with_rosbags, smooth_wheel

SCENARIO = 'firm_drive'
FILES = ('generic_six_wheel', 'test_sand')
RATES = {'sensors.wheel_odometry_rate': 100.0, 'sensors.imu_rate': 100.0}
"""Joint states and IMU of the drive that is replayed [Hz]: what rovers send."""
WHEELS = 6
CYCLES = 300
"""Filter cycles in one timing."""
RADIUS, WIDTH = 0.135, 0.165
"""Wheel of the wheel tests on HIT-LSS1 [m] (Ding et al. 2011)."""
ROW_SEED = 1
TABLE_FILES = ('hit_wh3', 'hit_fit')
LOADS = ('60', '80', '100')
"""On the wheel of the tables that are diagnosed [N]."""
NOISE = '3e-4,0.5,0.1'
"""Of their sinkage [m], pull [N] and torque [N m]."""
MISSING = 'effects.soil_mound.enabled:=true'
"""What they have and the model that they are compared with has not."""


@dataclass(frozen=True)
class Size:
    """How much is done.

    Length of the drive [s], pairs, wheels in a batch, peers among them, rows of two tables.
    """

    drive: float = 120.0
    pairs: int = 5
    batch: int = 10_000
    peers: int = 20
    rows: int = 60
    many_rows: int = 20_001


QUICK = Size(drive=4.0, pairs=1, batch=200, peers=2, many_rows=90)


def figures(size: Size) -> Iterator[Figure]:
    """Yield the figures one by one."""
    with TemporaryDirectory(prefix='wheel-terra-bench-') as folder:
        yield from _replay(Path(folder), size)
        yield _filter_cycle(size)
        yield from _models(size)
        yield from _commands(Path(folder), size)


def _replay(folder: Path, size: Size) -> Iterator[Figure]:
    from wheel_terra_estimator.bags.reader import MeasurementReader
    from wheel_terra_estimator.bags.replay import Options, replay
    from wheel_terra_estimator.bags.simulated_drive import write_simulated_drive
    from wheel_terra_estimator.bags.storage import open_bag
    from wheel_terra_estimator.simulation import scenario
    from wheel_terra_estimator.simulation.drive import simulate

    path = folder / 'drive'
    drive = scenario.load(SCENARIO)
    drive = replace(drive, configuration=drive.configuration.replace(RATES))
    write_simulated_drive(simulate(drive, seed=1, duration=size.drive), path)
    usual = reader.load(FILES)

    def read() -> int:
        with open_bag(path) as bag:
            return sum(1 for _ in MeasurementReader(bag, {}, usual).messages())

    with open_bag(path) as bag:
        topics = tuple(MeasurementReader(bag, {}, usual).topics.values())
    floor, words = (lambda: read_with_rosbags(path, topics), 1), 'reading with rosbags alone'
    yield timed_pairs(
        f'reading and unpacking of {size.drive:.0f} s', (read, 1), words, floor, size.pairs
    )
    for rate, overrides in (('default output rate', ()), ('every stamp', ('output_rate:=0.0',))):
        configuration = reader.load(FILES, overrides)

        def run(configuration: object = configuration) -> None:
            with open_bag(path) as bag:
                replay(bag, configuration, {}, options=Options(progress=False))  # type: ignore[arg-type]

        yield timed_pairs(
            f'replay of {size.drive:.0f} s, {rate}', (run, 1),
            words, floor, size.pairs, size.drive,
        )  # fmt: skip


def _filter_cycle(size: Size) -> Figure:
    """Time prediction and one update of a reading of each kind per wheel and one of the body."""
    n, m = StateLayout(WHEELS).size, 3 * WHEELS + 1
    random = np.random.default_rng(ROW_SEED)
    F = np.eye(n) + 0.01 * random.standard_normal((n, n)) / n
    Q, H = 1e-4 * np.eye(n), random.standard_normal((m, n)) / n
    residual, noise = 0.01 * random.standard_normal(m), np.full(m, 0.01)
    mean, covariance = np.zeros(n), 0.1 * np.eye(n)
    bound = np.full(n, 1e3)

    def cycles(kalman: GatedFilter | PlainFilter) -> None:
        for _ in range(CYCLES):
            kalman.predict(mean, F, Q)
            kalman.update(residual, H, noise)

    return timed_pairs(
        f'filter cycle, {n} states, {m} readings (algebra alone)',
        (lambda: cycles(GatedFilter(mean, covariance, -bound, bound)), CYCLES),
        'plain numpy filter in Joseph form',
        (lambda: cycles(PlainFilter(mean, covariance)), CYCLES),
        size.pairs,
    )


def _models(size: Size) -> Iterator[Figure]:
    soil = reader.load(FILES).soil
    slips = np.linspace(0.05, 0.8, size.batch)
    loads = np.linspace(60.0, 120.0, size.batch)
    chosen = np.linspace(0, size.batch - 1, size.peers).astype(int)
    peer = 'adaptive quadrature and root find, wheel by wheel'

    def peers() -> None:
        for i in chosen:
            smooth_wheel(soil, RADIUS, WIDTH, float(slips[i]), float(loads[i]))

    def scalars() -> None:
        for i in chosen:
            forces(soil, 'closed_form', slips[i : i + 1], loads[i : i + 1])

    other = (peers, size.peers)
    yield timed_pairs(
        'closed form, one wheel in arrays', (scalars, size.peers), peer, other, size.pairs
    )
    for method in ('closed_form', 'quadrature'):
        yield timed_pairs(
            f'{method.replace("_", " ")}, {size.batch} wheels at once, a wheel',
            (lambda method=method: forces(soil, method, slips, loads), size.batch),  # type: ignore[misc]
            peer, other, size.pairs,
        )  # fmt: skip


def forces(soil: Soil, method: str, slip: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return (N, 3) sinkage [m], drawbar pull [N], torque [N m] of the smooth wheel."""
    points = OperatingPoints(slip=slip, normal_load=load, wheel=Wheel(RADIUS, WIDTH))
    state = WheelSoilModel(soil, {}, method=method).steady_state(points)
    return np.column_stack([state.sinkage, state.drawbar_pull, state.torque])


def _commands(folder: Path, size: Size) -> Iterator[Figure]:
    environment = dict(os.environ)
    if sys.dont_write_bytecode:
        # An installed package has its bytecode; the first call, which does not count, makes it.
        environment.pop('PYTHONDONTWRITEBYTECODE', None)
        environment['PYTHONPYCACHEPREFIX'] = str(folder / 'bytecode')

    def process(*arguments: str) -> None:
        command = [sys.executable, *arguments]
        subprocess.run(command, check=True, capture_output=True, env=environment)

    def command(*arguments: str) -> None:
        process('-m', 'wheel_terra_estimator.cli.main', *arguments)

    def files(*names: str) -> list[str]:
        return [word for name in names for word in ('--config', name)]

    def rows(count: int) -> str:
        path = str(folder / f'rows_{count}.csv')
        slips = ['--slip', f'0.05:0.6:{count // len(LOADS)}', '--load', ','.join(LOADS)]
        command(
            'predict', *files(*TABLE_FILES), '-p', MISSING, *slips, '--noise', NOISE, '-o', path
        )  # fmt: skip
        return path

    def diagnose(table: str, *more: str) -> list[str]:
        output = ['-o', str(folder / 'diagnosis'), '--overwrite', *more]
        return ['diagnose', table, *files(*TABLE_FILES), *output]

    few, many = rows(size.rows), rows(size.many_rows)
    fitting, drawing = 'import scipy.optimize', 'import scipy.optimize, matplotlib.pyplot'
    for name, arguments, code in (
        (f'diagnose, {size.rows} rows, without pictures', diagnose(few, '--no-pictures'), fitting),
        (f'diagnose, {size.rows} rows', diagnose(few), drawing),
        (
            f'diagnose, {size.many_rows} rows, without pictures',
            diagnose(many, '--no-pictures'),
            fitting,
        ),
        ('--help', ['--help'], 'import argparse'),
        ('predict', ['predict', *files(*FILES), '--load', '80'], 'import numpy'),
    ):
        yield timed_pairs(
            f'command: {name}', (lambda a=arguments: command(*a), 1),  # type: ignore[misc]
            f'python -c "{code}"', (lambda c=code: process('-c', c), 1),  # type: ignore[misc]
            size.pairs,
        )  # fmt: skip
