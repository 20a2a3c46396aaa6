# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Simulators of different hands, with one face for the bench."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from wheel_terra_estimator.configuration import shipped
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.evaluation import kinds as kinds_a
from wheel_terra_lab.evaluation.bench_drive import Arrival, BenchDrive, Truth
from wheel_terra_lab.evaluation.simulator_b import kinds as kinds_b
from wheel_terra_lab.evaluation.simulator_c import plans as plans_c

SCENARIO = 'scenarios/'
"""Begins the name of a kind that is a shipped scenario."""


@dataclass(frozen=True)
class Simulator:
    """A simulator: its kinds of drives, those made to entrap, and how to make one.

    ``simulate`` takes kind, seed, greatest duration [s] and a rover file in place of the kind's
    own rover (None: that of the kind).
    """

    name: str
    kinds: tuple[str, ...]
    more_kinds: tuple[str, ...]  # run only when named
    entrapments: tuple[str, ...]
    simulate: Callable[[str, int, float | None, str | None], BenchDrive]
    takes_scenarios: bool = False  # a kind may be `scenarios/NAME`, a shipped scenario

    def has(self, kind: str) -> bool:
        """Return whether the simulator makes drives of a kind."""
        if self.takes_scenarios and kind.startswith(SCENARIO):
            return shipped.find(kind).is_file()
        return kind in self.kinds or kind in self.more_kinds


def _simulate_a(kind: str, seed: int, duration: float | None, rover: str | None) -> BenchDrive:
    from wheel_terra_estimator.simulation.drive import simulate
    from wheel_terra_estimator.simulation.scenario import load

    kinds = {**kinds_a.KINDS, 'firm': kinds_a.FIRM}
    scenario = load(kinds.get(kind, kind), rover=rover)
    longest = scenario.duration if duration is None else min(duration, scenario.duration)
    drive = simulate(scenario, seed, longest)
    arrivals = [Arrival(*told) for told in drive.arrivals]
    return BenchDrive(drive.configuration, arrivals, Truth.of(drive.truth))


def _simulated(
    letter: str, kind: str, seed: int, duration: float | None, rover: str | None
) -> BenchDrive:
    if rover is not None:
        raise UserError(
            f'simulator {letter} has rovers of its own: another rover needs simulator A'
        )
    module = import_module(f'wheel_terra_lab.evaluation.simulator_{letter.lower()}.drive')
    drive = module.simulate(kind, seed, duration)
    return BenchDrive(drive.configuration, drive.arrivals, drive.truth)


SIMULATORS = {
    'A': Simulator('A', tuple(kinds_a.KINDS), ('firm',), kinds_a.ENTRAPMENTS, _simulate_a, True),
    'B': Simulator('B', tuple(kinds_b.KINDS), (), kinds_b.ENTRAPMENTS, partial(_simulated, 'B')),
    'C': Simulator('C', tuple(plans_c.KINDS), (), plans_c.ENTRAPMENTS, partial(_simulated, 'C')),
}
"""A: that of the package; B, C: written apart from it and from one another by other hands."""
