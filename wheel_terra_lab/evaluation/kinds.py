# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of simulated drives on which the estimator is tuned and judged.

The estimator is told the nominal soil, which each seed puts off by about 20 % in stiffness,
cohesion, friction, shear deformation modulus and slip-sinkage, and a model without mound,
bulldozing or compaction by earlier wheels. Tuning seeds and test seeds are apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

TUNING_SEEDS = range(1000, 1020)
TEST_SEEDS = range(2166, 2226)  # 2000 to 2165 were looked at while the filter was built

# Nominal soils: a file of config/soils and what differs from it.
_HIT = ('hit_lss1', 'soil.leaving_angle_ratio:=-0.1')
_DRY_SAND = (
    'dry_sand_ding2015',
    'soil.peak_stress_ratio:=0.45',
    'soil.leaving_angle_ratio:=-0.15',
)
_LUNAR = ('lunar_soil_ding2015', 'soil.leaving_angle_ratio:=-0.1')
# Firm ground has no file of its own: the values of config/rovers/pathfinder, which drove on it.
_FIRM = (
    'hit_lss1',
    'soil.cohesive_modulus:=1000.0',
    'soil.frictional_modulus:=20000000.0',
    'soil.sinkage_exponent:=1.0',
    'soil.cohesion:=1000.0',
    'soil.friction_angle_deg:=38.0',
    'soil.shear_modulus:=0.01',
)
# What the estimator knows of effects, and what is there besides.
_KNOWN = (
    'effects.slip_sinkage_exponent.enabled:=true',
    'effects.slip_sinkage_exponent.n1:=0.25',
    'effects.lug_digging.enabled:=true',
    'effects.lug_shear_radius.enabled:=true',
)
_HIDDEN = [
    'effects.soil_mound.enabled:=true',
    'effects.soil_mound.kappa:=0.6',
    'effects.bulldozing.enabled:=true',
    'effects.bulldozing.kb:=0.3',
    'effects.multipass.enabled:=true',
    'effects.multipass.stiffening:=0.3',
]
_VARIATION = {
    'variation.stiffness': 0.2,
    'variation.cohesion': 0.2,
    'variation.friction': 0.2,
    'variation.shear_modulus': 0.2,
    'variation.slip_sinkage': 0.2,
    'variation.patch': 0.2,
    'variation.speed': 0.2,
    'variation.mass': 0.02,
    'variation.slope_deg': 1.0,
    'slope.undulation_deg': 1.0,
    'patchiness': 0.15,
    'faults.random_rate': 0.0,
}


def _kind(soil: tuple[str, ...], description: str, **keys: Any) -> dict[str, Any]:
    scenario: dict[str, Any] = {
        'configuration': ['generic_six_wheel', soil[0]],
        'parameters': [*soil[1:], *_KNOWN],
        'truth': list(_HIDDEN),
        'description': description,
        'duration': 100.0,
        **_VARIATION,
    }
    for key, value in keys.items():
        name = key.replace('__', '.')
        if name in ('parameters', 'truth'):
            scenario[name] = [*scenario[name], *value]
        else:
            scenario[name] = value
    return scenario


KINDS: Mapping[str, Mapping[str, Any]] = {
    'cruise': _kind(_HIT, 'uneven flat ground'),
    'climb': _kind(
        _HIT,
        'rising and falling slope',
        slope__position=[0.0, 1.0, 2.5, 3.5, 5.0],
        slope__angle_deg=[0.0, 4.0, 12.0, 8.0, 2.0],
    ),
    'descent': _kind(
        _DRY_SAND,
        'downhill, wheels braking',
        slope__position=[0.0, 1.0, 3.0],
        slope__angle_deg=[0.0, -6.0, -14.0],
    ),
    'soft_patch': _kind(
        _HIT,
        'patches of loose soil on level ground, wheel by wheel',
        patches__start=[1.5, 3.2],
        patches__end=[2.4, 4.5],
        patches__stiffness=[0.4, 0.5],
        patches__friction=[0.85, 0.8],
        patches__right=[-2.0, 0.0],
        patches__left=[2.0, 2.0],
    ),
    'entrapment_patch': _kind(
        _DRY_SAND,
        'climb into loose soil: the rover digs itself in',
        duration=80.0,
        slope__position=[0.0, 0.8, 2.0],
        slope__angle_deg=[0.0, 5.0, 8.0],
        patches__start=[1.6],
        patches__end=[9.0],
        patches__stiffness=[0.25],
        patches__friction=[0.5],
        patches__cohesion=[0.3],
    ),
    'entrapment_slope': _kind(
        _HIT,
        'steepening slope until the rover makes no way',
        slope__position=[0.0, 1.0, 4.0],
        slope__angle_deg=[0.0, 14.0, 32.0],
        duration=140.0,
    ),
    'near_stuck': _kind(
        _HIT,
        'steep pitch at high slip, driven out of',
        duration=150.0,
        slope__position=[0.0, 0.5, 1.1, 1.6, 2.1],
        slope__angle_deg=[0.0, 8.0, 21.5, 21.5, 2.0],
        # Less scatter than elsewhere, so that most drives come to slip 0.6 to 0.8 and none stays.
        variation__friction=0.05,
        variation__slope_deg=0.5,
    ),
    'turns': _kind(
        _HIT,
        'arcs to both sides and spins in place, skid-steered',
        drive__time=[0.0, 15.0, 17.0, 35.0, 37.0, 50.0, 52.0, 65.0, 67.0, 80.0, 82.0],
        drive__forward=[0.05, 0.05, 0.05, 0.05, 0.0, 0.0, 0.05, 0.05, 0.04, 0.04, 0.05],
        drive__turn_rate=[0.0, 0.0, 0.03, 0.03, 0.06, 0.06, 0.0, 0.0, -0.04, -0.04, 0.0],
    ),
    'stop_and_go': _kind(
        _DRY_SAND,
        'stops, restarts and reverses on a slope',
        slope__position=[0.0],
        slope__angle_deg=[6.0],
        drive__time=[0.0, 18.0, 19.0, 25.0, 26.0, 45.0, 46.0, 50.0, 51.0, 70.0, 71.0, 75.0, 76.0],
        drive__forward=[0.05, 0.05, 0, 0, 0.07, 0.07, 0, 0, -0.05, -0.05, 0, 0, 0.05],
    ),
    'low_gravity': _kind(
        _LUNAR,
        'Moon: climb and a soft patch',
        parameters=['rover.gravity:=1.62'],
        slope__position=[0.0, 1.0, 2.5, 3.5],
        slope__angle_deg=[0.0, 6.0, 12.0, 6.0],
        patches__start=[2.0],
        patches__end=[3.0],
        patches__stiffness=[0.5],
    ),
    'mixed_soil': _kind(
        _DRY_SAND,
        'left and right wheels in different soil, side slope',
        slope__position=[0.0, 1.0, 3.0],
        slope__angle_deg=[0.0, 5.0, 8.0],
        slope__side_deg=5.0,
        patches__start=[0.8, 2.5],
        patches__end=[2.2, 4.0],
        patches__right=[0.0, -2.0],
        patches__left=[2.0, 0.0],
        patches__stiffness=[0.4, 0.4],
        patches__friction=[0.75, 0.75],
    ),
    'wheel_faults': _kind(
        _HIT,
        'one wheel spins free, is locked, is lifted, coasts',
        slope__position=[0.0, 1.0],
        slope__angle_deg=[0.0, 5.0],
        faults__kind=['overspeed', 'locked', 'lifted', 'coasting'],
        faults__wheel=['middle_left', 'rear_right', 'front_left', 'middle_right'],
        faults__start=[15.0, 35.0, 55.0, 75.0],
        faults__end=[25.0, 42.0, 65.0, 85.0],
    ),
    'sensor_faults': _kind(
        _HIT,
        'wild references and readings, drop-outs, jitter',
        slope__position=[0.0, 1.0, 3.0],
        slope__angle_deg=[0.0, 6.0, 10.0],
        sensors__reference_outliers=0.1,
        sensors__reference_dropouts=0.2,
        sensors__sinkage_outliers=0.05,
        sensors__jitter=0.02,
        faults__random_rate=120.0,
    ),
}

ENTRAPMENTS = ('entrapment_patch', 'entrapment_slope')

FIRM: Mapping[str, Any] = _kind(
    _FIRM,
    'firm ground: slopes, turns, stops, for false alarms',
    duration=600.0,
    slope__position=[0.0, 5.0, 10.0, 15.0, 20.0, 25.0],
    slope__angle_deg=[0.0, 8.0, -5.0, 10.0, -10.0, 0.0],
    slope__undulation_deg=2.0,
    drive__time=[0, 100, 101, 110, 111, 200, 202, 240, 242, 400, 402, 430, 432],
    drive__forward=[0.05, 0.05, 0, 0, 0.07, 0.07, 0.05, 0.05, 0.05, 0.05, 0.0, 0.0, 0.05],
    drive__turn_rate=[0, 0, 0, 0, 0, 0, 0.03, 0.03, 0, 0, 0.06, 0.06, 0],
    faults__random_rate=20.0,
)

LIMITER: Mapping[str, Any] = _kind(
    _DRY_SAND,
    'a climb with a patch of loose soil on it, for the traction limiter',
    parameters=['rover.mass:=60.0'],
    duration=90.0,
    slope__position=[0.0, 0.5, 1.2],
    slope__angle_deg=[0.0, 0.0, 7.0],
    patches__start=[2.0],
    patches__end=[20.0],
    patches__border=0.8,
    patches__stiffness=[0.15],
    patches__friction=[0.6],
    patches__cohesion=[0.3],
    slope__undulation_deg=0.3,
    patchiness=0.05,
)
