# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Zeros and gains of readings that were found as effects, as the keys ``sensors.*`` of a node.

A sensor reads ``gain * true + zero``; estimator, drive rows, diagnosis and ``predict`` all start
from these keys. What a diagnosis adds to them is written there, and the effect stays off, so that
nothing corrects the same error twice.
"""

from __future__ import annotations

from wheel_terra_estimator.configuration.configuration import Configuration

# Effects that are an error of a reading and nothing else: name -> its parameter.
_GAINS = {'torque': 'torque_gain', 'sinkage': 'sinkage_gain'}
_SINKAGE_ZERO, _TORQUE_ZERO = 'sinkage_offset', 'drivetrain_friction'


def sensor_keys(
    configuration: Configuration, turning: float
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Return the keys that say the same as the instrument effects of a model, and those effects.

    Parameters
    ----------
    configuration : Configuration
        With the effects on.
    turning : float
        +1 or -1: which way the wheel turned in all rows. 0: both ways; a constant friction, which
        turns with the wheel, is then no zero of the reading and stays an effect.
    """
    effects, stds, sensors = configuration.effects, configuration.effects_std, configuration.sensors
    keys: dict[str, object] = {}
    moved: list[str] = []
    for quantity, name in _GAINS.items():
        gains, zeros = getattr(sensors, name), getattr(sensors, f'{quantity}_zero')
        factor = 1.0
        if name in effects:
            factor += effects[name]['gain']
            keys[f'sensors.{name}'] = [float(gain * factor) for gain in gains]
            if quantity == 'torque' and 'gain' in stds.get(name, {}):
                keys['sensors.torque_gain_std'] = float(stds[name]['gain'] * gains.mean())
            moved.append(name)
        owner = _SINKAGE_ZERO if quantity == 'sinkage' else _TORQUE_ZERO
        found = effects.get(owner)
        if found is None or (owner == _TORQUE_ZERO and (not turning or 'torque' not in found)):
            continue
        # The gain acts on the friction as well: what the motor gives is what is read.
        parameter, scale = ('offset', 1.0)
        if owner == _TORQUE_ZERO:
            parameter, scale = 'torque', turning * factor
        size = scale * found[parameter]
        keys[f'sensors.{quantity}_zero'] = [
            float(zero + gain * size) for zero, gain in zip(zeros, gains, strict=True)
        ]
        if parameter in stds.get(owner, {}):
            keys[f'sensors.{quantity}_zero_std'] = float(stds[owner][parameter] * gains.mean())
        moved.append(owner)
    return keys, tuple(moved)
