# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a proposed manoeuvre teaches what it promises: 100 drives of simulator A.

Each rover drives, is told which of two manoeuvres has the greatest gain, and drives it on the
same soil, of which neither the filter nor the proposal knows more than the nominal one. Half of
them state no soil, half drive but 8 s before. Printed: how often the deviation ends within a factor
of 1.5 of what was promised.

    python -m wheel_terra_lab.studies.manoeuvre_study --seeds 7500 7600
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.taught import Taught
from wheel_terra_estimator.simulation import scenario
from wheel_terra_estimator.simulation.drive import simulate
from wheel_terra_estimator.simulation.manoeuvres import (
    MANOEUVRES,
    SENSORS,
    Manoeuvre,
    after,
    with_manoeuvres,
)
from wheel_terra_lab.evaluation.kinds import KINDS

DRIVES = ('cruise', 'climb', 'descent', 'stop_and_go')
"""Without patches: the manoeuvre then meets the very soil that a seed has drawn."""
DURATIONS = 8.0, 20.0  # of the drive before [s]
SPEED = 0.05  # [m/s]
TRIED = 2
"""Manoeuvres of a drive, drawn: so that it is not the same two that are tested."""
FACTOR = 1.5
_TUNING = ('7400', '7420')


class Case(NamedTuple):
    """A parameter of a proposal: its deviation before, as promised and as it came."""

    seed: int
    name: str
    manoeuvre: str
    before: float
    promised: float
    came: float
    best: bool  # whether it has the greatest promise of its drive

    @property
    def kept(self) -> bool:
        """Whether the promise was kept."""
        return 1.0 / FACTOR <= self.came / self.promised <= FACTOR


def cases(seed: int) -> list[Case]:
    """Return what was promised and came of the manoeuvre proposed after the drive of a seed."""
    kind = KINDS[DRIVES[seed % len(DRIVES)]]
    drawn = _scenario(kind, seed)
    core = EstimatorCore(drawn.configuration)
    for arrival in simulate(drawn, seed, DURATIONS[seed // 8 % 2]).arrivals:
        core.add(arrival.measurement)
    core.flush()
    posterior = core.posterior()
    assert posterior is not None
    drawn_places = np.random.default_rng(seed).permutation(len(MANOEUVRES))[:TRIED]
    tried = [MANOEUVRES[i] for i in drawn_places]
    rows = [
        row
        for row in with_manoeuvres(
            core.taught(),
            drawn.configuration,
            posterior,
            soil=core.learned(),
            speed=SPEED,
            sensors=SENSORS,
            candidates=tried,
        )
        if row.promised_std
    ]
    if not rows:
        return []
    best = min(rows, key=_share)
    words = best.manoeuvre or ''
    driven = next(m for m in tried if _same(m, words))
    keys = {**driven.keys(SPEED), 'variation.speed': 0.0}
    then = after(simulate(_scenario({**kind, **keys}, seed), seed), posterior)
    return [
        Case(seed, r.name, words, r.std, r.promised_std or 0.0, then[r.name].std, r is best)
        for r in rows
        if r.manoeuvre == words
    ]


def _scenario(keys: Any, seed: int) -> scenario.Scenario:
    loaded = scenario.load(keys)
    if seed // len(DRIVES) % 2:
        return loaded
    known = loaded.configuration
    rest = frozenset(key for key in known.stated if not key.startswith('soil.'))
    return replace(loaded, configuration=replace(known, stated=rest))


def _share(row: Taught) -> float:
    return (row.promised_std or np.inf) / row.std


def _same(manoeuvre: Manoeuvre, words: str) -> bool:
    before, _, behind = manoeuvre.words.partition('{distance}')
    return words.startswith(before) and words.endswith(behind)


def main(argv: Sequence[str] | None = None) -> None:
    """Print the cases and the share of promises that were kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seeds', nargs=2, type=int, default=_TUNING, metavar=('FIRST', 'END'))
    arguments = parser.parse_args(argv)
    found: list[Case] = []
    for seed in range(*map(int, arguments.seeds)):
        for case in cases(seed):
            found.append(case)
            print(
                f'{seed} {case.name:30} {case.before:.3g} -> promised {case.promised:.3g}, '
                f'came {case.came:.3g}: {case.manoeuvre}',
                flush=True,
            )
    for what, chosen in (('best of each drive', [c for c in found if c.best]), ('all', found)):
        if chosen:
            came, promised, before = (
                np.array([getattr(c, name) for c in chosen])
                for name in ('came', 'promised', 'before')
            )
            print(
                f'{what}: {len(chosen)}, kept {np.mean([c.kept for c in chosen]):.0%}, median '
                f'deviation promised {np.median(promised / before):.2f} of that before, came '
                f'{np.median(came / before):.2f}'
            )


if __name__ == '__main__':
    main()
