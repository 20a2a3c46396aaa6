# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Functions and files of the package on the way from a message of wheel rates to the outputs.

::

    python -m wheel_terra_lab.studies.call_walk  # of this source tree; PYTHONPATH names another

Counted is every function of the package that runs while one message of joint states makes a set of
estimates with a cycle of the filter, and the fields of all topics are taken out of that set. The
rover has driven for five seconds with IMU, sinkage and references before. Comprehensions, lambdas
and what the standard library and numpy call are not counted.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

from wheel_terra_estimator.bags.message_factory import MessageFactory
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.messages import convert
from wheel_terra_estimator.messages.pipeline import Pipeline

PACKAGE = Path(convert.__file__).resolve().parents[1]
STEP = 20_000_000  # [ns] between two messages of the IMU; every fifth time the wheels, too
WARM = 250  # steps
ROVER = ('generic_six_wheel', 'test_sand')


class Walk:
    """Notes the functions of the package that are called."""

    def __init__(self) -> None:
        self.calls: Counter[tuple[str, str]] = Counter()

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        """Note a call; for ``sys.setprofile``."""
        code = frame.f_code
        if event != 'call' or code.co_name.startswith('<'):
            return
        path = Path(code.co_filename)
        if path.is_relative_to(PACKAGE):
            name = getattr(code, 'co_qualname', code.co_name)
            self.calls[path.relative_to(PACKAGE).as_posix(), name] += 1


def walk() -> Walk:
    """Drive, and note what the last message of wheel rates calls."""
    configuration = reader.load(list(ROVER))
    pipeline, make = Pipeline(configuration), MessageFactory()
    names = configuration.wheels.names
    noted = Walk()
    for step in range(WARM + 1):
        header = make.header(1_700_000_000_000_000_000 + step * STEP)
        imu = make.imu(header, (0.0, 0.0, 9.80665), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        pipeline.hear('imu/data', imu)
        if step % 50 == 10:
            twist = make.twist_with_covariance(0.05, 0.0, [1e-4] + [0.0] * 35)
            pipeline.hear('reference_odom', make.odometry(header, twist))
        if step % 10 == 5:
            depths = make.joint_state(header, names, position=[0.02] * len(names))
            pipeline.hear('sinkage', depths)
        if step % 5 == 0:
            count = len(names)
            rates = make.joint_state(header, names, velocity=[0.5] * count, effort=[3.0] * count)
            last = step == WARM
            sys.setprofile(noted if last else None)
            sets = pipeline.hear('joint_states', rates)
            for estimates in sets:
                convert.joint_fields(estimates, names)
            sys.setprofile(None)
            assert not last or sets
    return noted


def main() -> None:
    """Print the counts, and by folder."""
    noted = walk()
    by_folder = Counter(path.rpartition('/')[0] for path, _ in noted.calls)
    files = len({path for path, _ in noted.calls})
    print(f'{len(noted.calls)} functions in {files} files, {noted.calls.total()} calls')
    for folder, count in sorted(by_folder.items()):
        print(f'  {folder:30} {count}')
    if '--list' in sys.argv:
        for (path, name), count in sorted(noted.calls.items()):
            print(f'    {path}:{name} {count}')


if __name__ == '__main__':
    main()
