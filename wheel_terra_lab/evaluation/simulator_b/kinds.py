# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of drives: what is asked of the rover, in measures that fit any rover and soil.

Slopes are stated as the slip that the true soil should give there, positions as shares of the way
that the rover makes without slip, speeds as shares of the nominal one. So one kind suits a rover
of 2 kg on the Moon and one of 800 kg on Earth.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wheel_terra_lab.evaluation.simulator_b.rovers import EARTH, MARS, MOON, SOILS, RoverClass

FaultKind = Literal['locked', 'free', 'dead']

_SKID_STEERED = RoverClass(wheels=(4,), track=(1.0, 1.4))


@dataclass(frozen=True)
class PatchPlan:
    """Other soil between two shares of the way; factors as in ``ground.Patch``.

    One that `traps` is made weak enough that the rover cannot climb it on the slope there.
    """

    start: float
    end: float
    stiffness: float
    friction: float
    cohesion: float = 1.0
    border: float = 0.03
    side: Literal['both', 'left', 'right'] = 'both'
    traps: bool = False


@dataclass(frozen=True)
class Fault:
    """A wheel out of order between two shares of the duration."""

    kind: FaultKind  # wheel stands, turns without drive, or sends neither rate nor torque
    start: float
    end: float


@dataclass(frozen=True)
class Kind:
    """One kind of drive."""

    description: str
    rover: RoverClass = field(default_factory=RoverClass)
    # Share of the way, slip that the slope should give (negative: downhill, braking)
    slopes: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    # Share of the duration, forward speed, turn rate; linear in between. The turn rate counts in
    # nominal speed over half the track: 1 with speed 0 is a spin at full wheel speed
    commands: tuple[tuple[float, float, float], ...] = ((0.0, 1.0, 0.0),)
    patches: tuple[PatchPlan, ...] = ()
    faults: tuple[Fault, ...] = ()
    side_slip: float = 0.0  # side slope, by the slip that it would give uphill
    soils: tuple[str, ...] = SOILS
    firm: bool = False
    reference: Literal['camera', 'satellite'] = 'camera'
    duration: float = 90.0  # [s]
    undulation: float = 0.012  # [rad]
    soil_scatter: float = 1.0  # factor on how much the soil varies with place


_RAMP = 0.02  # of the duration, for each change of speed


def _stages(*stages: tuple[float, float, float]) -> tuple[tuple[float, float, float], ...]:
    """Return commands that hold each (speed, turn rate) from its share of the duration on."""
    commands = [stages[0]]
    for before, after in itertools.pairwise(stages):
        commands += [(after[0], *before[1:]), (after[0] + _RAMP, *after[1:])]
    return tuple(commands)


KINDS: Mapping[str, Kind] = {
    'cruise': Kind('level, uneven ground'),
    'climb': Kind(
        'a slope that steepens and eases',
        slopes=((0.0, 0.02), (0.2, 0.15), (0.45, 0.4), (0.7, 0.2)),
    ),
    'descend': Kind(
        'downhill, wheels braking', slopes=((0.0, 0.0), (0.2, -0.05), (0.5, -0.2), (0.8, -0.1))
    ),
    'soft_patch': Kind(
        'patches of loose soil',
        slopes=((0.0, 0.05),),
        patches=(
            PatchPlan(0.25, 0.42, 0.4, 0.85),
            PatchPlan(0.6, 0.8, 0.5, 0.8, side='left'),
        ),
    ),
    'entrapment': Kind(
        'a climb into loose soil that does not carry: trapped within seconds',
        slopes=((0.0, 0.05), (0.15, 0.25)),
        patches=(PatchPlan(0.18, 9.0, 0.3, 0.7, 0.3, traps=True),),
    ),
    'creeping_entrapment': Kind(
        'soil that gets weaker: slip from 0.4 to 0.9 in about a minute',
        slopes=((0.0, 0.1), (0.12, 0.38)),
        patches=(PatchPlan(0.14, 9.0, 0.6, 0.8, 0.6, border=0.33, traps=True),),
        undulation=0.003,
        soil_scatter=0.3,
        duration=120.0,
    ),
    'recovery': Kind(
        'a steep pitch at high slip, driven out of',
        slopes=((0.0, 0.05), (0.12, 0.3), (0.2, 0.47), (0.3, 0.47), (0.38, 0.1)),
        undulation=0.003,
        soil_scatter=0.3,
    ),
    'stop_and_go': Kind(
        'stops and starts on a slope',
        slopes=((0.0, 0.2),),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.2, 0.0, 0.0),
            (0.28, 1.2, 0.0),
            (0.5, 0.0, 0.0),
            (0.58, 0.7, 0.0),
            (0.75, 0.0, 0.0),
            (0.83, 1.0, 0.0),
        ),
    ),
    'turns': Kind(
        'arcs to both sides',
        rover=RoverClass(track=(0.9, 1.2)),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.2, 0.8, 0.25),
            (0.45, 1.0, 0.0),
            (0.55, 0.7, -0.3),
            (0.85, 1.0, 0.0),
        ),
    ),
    'spin': Kind(
        'spins on the spot between straights',
        rover=_SKID_STEERED,
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.28, 0.0, 0.0),
            (0.32, 0.0, 0.7),
            (0.5, 0.0, 0.0),
            (0.54, 1.0, 0.0),
            (0.7, 0.0, 0.0),
            (0.74, 0.0, -0.6),
            (0.88, 0.0, 0.0),
            (0.92, 1.0, 0.0),
        ),
    ),
    'steered': Kind(
        'arcs and a spin on the spot, wheels of the first and last axle steered',
        rover=RoverClass(track=(0.7, 1.0), steered=True),
        slopes=((0.0, 0.05), (0.6, 0.12)),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.2, 0.8, 0.25),
            (0.4, 1.0, 0.0),
            (0.5, 0.0, 0.0),
            (0.54, 0.0, 0.5),
            (0.66, 0.0, 0.0),
            (0.7, 0.8, -0.3),
            (0.9, 1.0, 0.0),
        ),
    ),
    'reversal': Kind(
        'forward, back and forward on a slope',
        slopes=((-1.0, 0.15), (1.0, 0.15)),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.35, 0.0, 0.0),
            (0.42, -1.0, 0.0),
            (0.68, 0.0, 0.0),
            (0.75, 1.0, 0.0),
        ),
    ),
    'wheel_faults': Kind(
        'one wheel stands, one turns free, one is silent',
        slopes=((0.0, 0.1),),
        faults=(
            Fault('locked', 0.2, 0.32),
            Fault('free', 0.42, 0.58),
            Fault('dead', 0.68, 0.85),
        ),
    ),
    'firm': Kind(
        'firm ground, slopes and arcs',
        firm=True,
        slopes=((0.0, 0.0), (0.3, 0.06), (0.6, -0.04), (0.9, 0.0)),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.4, 0.8, 0.2),
            (0.6, 1.0, 0.0),
        ),
    ),
    'low_gravity': Kind(
        'Moon or Mars: a climb and a soft patch',
        rover=RoverClass(gravity=(MOON, MARS)),
        slopes=((0.0, 0.05), (0.3, 0.3), (0.6, 0.1)),
        patches=(PatchPlan(0.65, 0.85, 0.5, 0.9),),
    ),
    'light': Kind(
        'a rover of 1 to 5 kg: a climb and a soft patch',
        rover=RoverClass(mass=(1.0, 5.0), wheels=(4, 6), speed=(0.015, 0.05)),
        slopes=((0.0, 0.05), (0.3, 0.3), (0.6, 0.1)),
        patches=(PatchPlan(0.65, 0.85, 0.5, 0.9),),
    ),
    'heavy': Kind(
        'a rover of 300 to 900 kg: a climb and a soft patch',
        rover=RoverClass(mass=(300.0, 900.0), wheels=(4, 6), speed=(0.05, 0.15)),
        slopes=((0.0, 0.05), (0.3, 0.3), (0.6, 0.1)),
        patches=(PatchPlan(0.65, 0.85, 0.5, 0.9),),
    ),
    'eight_wheels': Kind(
        'eight wheels: a climb, arcs',
        rover=RoverClass(wheels=(8,)),
        slopes=((0.0, 0.05), (0.2, 0.25), (0.5, 0.1)),
        commands=_stages(
            (0.0, 1.0, 0.0),
            (0.6, 0.8, 0.2),
            (0.8, 1.0, 0.0),
        ),
    ),
    'cross_slope': Kind(
        'across a slope, left and right wheels in different soil',
        slopes=((0.0, 0.05),),
        side_slip=0.12,
        patches=(
            PatchPlan(0.2, 0.5, 0.45, 0.85, side='right'),
            PatchPlan(0.55, 0.85, 0.45, 0.85, side='left'),
        ),
    ),
    'field': Kind(
        'half a metre a second on Earth, satellite velocity as reference',
        rover=RoverClass(mass=(60.0, 600.0), wheels=(4, 6), speed=(0.3, 0.8), gravity=(EARTH,)),
        slopes=((0.0, 0.02), (0.2, 0.15), (0.5, 0.3), (0.8, -0.05)),
        patches=(PatchPlan(0.6, 0.75, 0.5, 0.85),),
        reference='satellite',
    ),
}

ENTRAPMENTS = ('entrapment', 'creeping_entrapment')
