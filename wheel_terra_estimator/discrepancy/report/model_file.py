# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All files of a diagnosis; the corrected model with its provenance.

A sensor reads ``gain * true + zero``: zeros and gains of readings that were found as effects are
written as keys ``sensors.*``, from which estimator, drive rows, diagnosis and ``predict`` start,
and the effect stays off, so that no error is corrected twice.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.numbers import OF_BEDS, number, percent
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter, Proposal
from wheel_terra_estimator.terramechanics.effects.base import effect_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import NAME
from wheel_terra_estimator.terramechanics.soil import Soil

# Effects that are purely an error of a reading: name -> its parameter.
_GAINS = {'torque': 'torque_gain', 'sinkage': 'sinkage_gain'}
_SINKAGE_ZERO, _TORQUE_ZERO = 'sinkage_offset', 'drivetrain_friction'


def write_files(diagnosis: Diagnosis, folder: Path, *, pictures: bool) -> None:
    """Write ``report.json``, ``model.yaml``, ``proposal.yaml`` and, with pictures, the page."""
    report = json.dumps(diagnosis.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / 'report.json').write_text(f'{report}\n', encoding='utf-8')
    write_model(diagnosis, folder / 'model.yaml')
    if diagnosis.proposal:
        write_model(diagnosis, folder / 'proposal.yaml', diagnosis.proposal)
    if pictures:
        from wheel_terra_estimator.discrepancy.report.page import write_report

        write_report(diagnosis, folder)


def corrected(
    diagnosis: Diagnosis, proposal: Proposal | None = None
) -> tuple[Configuration, list[str]]:
    """Return the configuration with diagnosis, or a proposed law, put in, and the keys it sets."""
    fitted, believed = proposal or diagnosis, diagnosis.configuration
    changes: dict[str, Any] = {}
    for shift in (*fitted.soil, *fitted.bed):  # of the table's bed, not of the reference's
        changes |= _soil_keys(shift.name, shift.after, shift.after_std, believed.soil)
    for key, parameter in fitted.refitted.items():  # of effects that were on already
        owner, name = key.split('.', 1)
        changes |= _stated(f'effects.{effect_of(owner)}.{name}', parameter)
    for effect in () if proposal else diagnosis.effects:
        prefix = f'effects.{effect.name}'
        changes[f'{prefix}.enabled'] = True
        if effect.form:
            changes[f'{prefix}.form'] = effect.form
        for name, parameter in effect.parameters.items():
            changes |= _stated(f'{prefix}.{name}', parameter)
    if proposal:
        changes[f'effects.{NAME}.enabled'] = True
        for key in ('targets', 'features', 'coefficients', 'coefficients_std'):
            changes[f'effects.{NAME}.{key}'] = list(getattr(proposal, key))
    changes['provenance'] = provenance(diagnosis, proposal)
    stated = believed.flat()
    if stated.get('effect_file'):
        changes.setdefault('effect_file', stated['effect_file'])
    errors, moved = _sensor_keys(believed.replace(changes), _turning(diagnosis))
    off = {f'effects.{name}.enabled': False for name in moved}
    kept = [
        key
        for key in (*stated, *changes)
        if key in changes or (key.startswith('effects.') and key in believed.stated)
        if not any(key.startswith(f'effects.{name}.') for name in moved)
    ]
    kept += [key for key, name in zip(off, moved, strict=True) if name in diagnosis.base_effects]
    return believed.replace({**changes, **off, **errors}), [*dict.fromkeys([*kept, *errors])]


def _stated(key: str, parameter: FittedParameter) -> dict[str, float]:
    """Return the keys of a fitted parameter of an effect and of its deviation."""
    return {key: parameter.value, f'{key}_std': parameter.std}


def _sensor_keys(
    configuration: Configuration, turning: float
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the keys equivalent to the instrument effects of a model, and those effects.

    ``turning`` is +1 or -1 where the wheel turned one way in all rows. 0: both ways; a constant
    friction, which turns with the wheel, is then no zero of the reading and stays an effect.
    """
    effects, stds, sensors = configuration.effects, configuration.effects_std, configuration.sensors
    keys: dict[str, Any] = {}
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
        # The gain acts on the friction as well: the reading is the motor's torque.
        parameter, scale = ('offset', 1.0)
        if owner == _TORQUE_ZERO:
            parameter, scale = 'torque', turning * factor
        size = scale * found[parameter]
        keys[f'sensors.{quantity}_zero'] = [
            float(zero + gain * size) for zero, gain in zip(zeros, gains, strict=True)
        ]
        if parameter in stds.get(owner, {}):
            std = abs(scale) * stds[owner][parameter]
            keys[f'sensors.{quantity}_zero_std'] = float(std * gains.mean())
        moved.append(owner)
    return keys, tuple(moved)


def _turning(diagnosis: Diagnosis) -> float:
    """Return +1 where the wheel turned forward in all rows, -1 backward, 0 where it did both."""
    rates = diagnosis.table.columns.get('angular_velocity', np.zeros(1))
    backward = rates < 0.0
    return 0.0 if backward.any() and not backward.all() else (-1.0 if backward.any() else 1.0)


def _soil_keys(name: str, value: float, std: float, soil: Soil) -> dict[str, float]:
    if name == 'stiffness':
        return {
            f'soil.{field}': getattr(soil, field) * value
            for field in ('cohesive_modulus', 'frictional_modulus')
        } | {'soil.frictional_modulus_std': soil.frictional_modulus * std}
    if name == 'tan_friction':
        return {
            'soil.friction_angle_deg': math.degrees(math.atan(value)),
            'soil.friction_angle_std_deg': math.degrees(std / (1.0 + value * value)),
        }
    return {f'soil.{name}': value, f'soil.{name}_std': std}


def provenance(diagnosis: Diagnosis, proposal: Proposal | None) -> str:
    """Return one line: the change, its table, its probability."""
    before = diagnosis.configuration.provenance
    if proposal is not None:
        done = 'a law proposed (learned_closure) and soil refitted'
    elif diagnosis.effects:
        effects = ', '.join(
            f'{e.name} (confidence {percent(e.confidence)})' for e in diagnosis.effects
        )
        done = f'{effects} added and soil refitted'
    else:
        done = f'soil refitted (verdict: {diagnosis.verdict})'
    line = f'{done} by wheel-terra diagnose on {Path(diagnosis.table.name).name}'
    line += f', {len(diagnosis.table)} rows'
    beds = (proposal or diagnosis).bed
    if beds:
        factors = ' and '.join(
            f'{number(shift.after / shift.before, 3)} times the {OF_BEDS[shift.name]}'
            for shift in beds
        )
        line += f'; the soil is that of the bed of these rows, {factors} of the reference'
    return f'{before}; {line}' if before else line


def write_model(diagnosis: Diagnosis, path: str | Path, proposal: Proposal | None = None) -> None:
    """Write ``model.yaml``: a further ``--config`` of every command and of the node.

    With a proposal ``proposal.yaml``: the law, with the soil and effects refitted beside it.
    """
    configuration, keys = corrected(diagnosis, proposal)
    comment = provenance(diagnosis, proposal) + (f'\n{proposal.words}' if proposal else '')
    if 'effect_file' in keys:
        comment = f'Runs Python code (effect_file): needs --allow-effect-files\n{comment}'
    configuration.write(path, keys, comment=comment)
