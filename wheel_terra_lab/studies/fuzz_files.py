# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged recordings, configurations and tables, and odd measurements, in any number.

    python -m wheel_terra_lab.studies.fuzz_files --cases 1000 --seed 0

Every case has a number, from which it follows entirely: ``--only 4711`` runs one again. Exit
status 1 if a case raised anything but an error of one line, lost an intact message, or took more
than the limits. Ctrl-C ends it with what is done: go on with the seed behind the last case.
"""

from __future__ import annotations

import argparse
import random
import resource
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from wheel_terra_lab.studies.fuzzing.cases import CASES, run

SLOWEST = 5.0
"""Processor time of a case [s]."""
LARGEST = 1024.0
"""Memory of the program [MB]."""


def main() -> int:
    """Run the cases that were asked for and say what was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--cases', type=int, default=1000, metavar='N')
    parser.add_argument('--seed', type=int, default=0, metavar='S', help='number of the first case')
    parser.add_argument('--only', type=int, metavar='CASE', help='run this case alone')
    parser.add_argument('--kind', choices=CASES, help='this kind of input only')
    arguments = parser.parse_args()
    first, count = arguments.seed, arguments.cases
    if arguments.only is not None:
        first, count = arguments.only, 1
    done, faults = fuzz(first, count, arguments.kind)
    print(
        f'{done.total()} cases from {first}: '
        + ', '.join(f'{n} {kind}' for kind, n in done.items())
    )
    print(f'{len(faults)} faults')
    return 1 if faults else 0


def fuzz(first: int, count: int, kind: str | None = None) -> tuple[Counter[str], list[str]]:
    """Run cases by number; return how many of each kind, and a line for each that went wrong."""
    done: Counter[str] = Counter()
    faults: list[str] = []
    kinds = [name for name, (_, share) in CASES.items() for _ in range(share)]
    allowed = LARGEST
    with TemporaryDirectory() as folder:
        for number in range(first, first + count):
            dice = random.Random(number)
            chosen = dice.choice(kinds)
            chosen = kind or chosen
            begun = time.process_time()
            try:
                wrong = run(chosen, dice, Path(folder))
            except KeyboardInterrupt:
                break
            used = time.process_time() - begun
            if not wrong and used > SLOWEST:
                wrong = f'took {used:.1f} s'
            if not wrong and _memory() > allowed:
                wrong = f'the program takes {_memory():.0f} MB'
                allowed = _memory()  # its greatest size is all that is known: told once
            done[chosen] += 1
            if wrong:
                faults.append(f'case {number} ({chosen}): {wrong}')
                print(faults[-1], file=sys.stderr, flush=True)
    return done, faults


def _memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


if __name__ == '__main__':
    sys.exit(main())
