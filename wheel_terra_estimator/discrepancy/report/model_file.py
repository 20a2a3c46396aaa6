# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""All files of a diagnosis; the corrected model with its provenance.

A sensor reads ``gain * true + zero``: zeros and gains of readings that were found as effects are
written as keys ``sensors.*``, from which estimator, drive rows, diagnosis and ``predict`` start,
and the effect stays off, so that nothing corrects the same error twice.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.numbers import percent
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter, Proposal, SoilShift
from wheel_terra_estimator.terramechanics.effects.base import effect_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import NAME
from wheel_terra_estimator.terramechanics.soil import Soil

# Effects that are an error of a reading and nothing else: name -> its parameter.
_GAINS = {'torque': 'torque_gain', 'sinkage': 'sinkage_gain'}
_DECIMALS = 12  # a fit that stands at a bound is off by rounding, and no file may be
_SINKAGE_ZERO, _TORQUE_ZERO = 'sinkage_offset', 'drivetrain_friction'


def write_files(diagnosis: Diagnosis, folder: Path, *, pictures: bool) -> None:
    """Write ``report.json``, ``model.yaml``, ``proposal.yaml`` and, with pictures, the page."""
    report = json.dumps(diagnosis.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
    (folder / 'report.json').write_text(f'{report}\n', encoding='utf-8')
    write_model(diagnosis, folder / 'model.yaml')
    if diagnosis.proposal:
        write_proposal(diagnosis, diagnosis.proposal, folder / 'proposal.yaml')
    if pictures:
        from wheel_terra_estimator.discrepancy.report.page import write_report

        write_report(diagnosis, folder)


def corrected(diagnosis: Diagnosis) -> tuple[Configuration, list[str]]:
    """Return the configuration with the diagnosis put in, and the keys that it sets."""
    changes = _refitted(diagnosis, diagnosis.soil, diagnosis.refitted)
    for effect in diagnosis.effects:
        prefix = f'effects.{effect.name}'
        changes[f'{prefix}.enabled'] = True
        if effect.form:
            changes[f'{prefix}.form'] = effect.form
        for name, parameter in effect.parameters.items():
            changes[f'{prefix}.{name}'] = round(float(parameter.value), _DECIMALS)
            changes[f'{prefix}.{name}_std'] = float(parameter.std)
    changes['provenance'] = provenance(diagnosis)
    return _with(diagnosis, changes)


def proposed(diagnosis: Diagnosis, proposal: Proposal) -> tuple[Configuration, list[str]]:
    """Return the configuration with a proposed law put in, and the keys that it sets."""
    changes = _refitted(diagnosis, proposal.soil, proposal.refitted)
    prefix = f'effects.{NAME}'
    changes[f'{prefix}.enabled'] = True
    for key in ('targets', 'features', 'coefficients', 'coefficients_std'):
        changes[f'{prefix}.{key}'] = list(getattr(proposal, key))
    changes['provenance'] = provenance(diagnosis, proposal)
    return _with(diagnosis, changes)


def _refitted(
    diagnosis: Diagnosis, soil: Iterable[SoilShift], refitted: Mapping[str, FittedParameter]
) -> dict[str, object]:
    """Return the keys of soil and of effects that were on already, at their fitted values."""
    changes: dict[str, object] = {}
    for shift in soil:
        believed = diagnosis.configuration.soil
        after = round(shift.after, _DECIMALS)
        changes.update(_soil_keys(shift.name, after, shift.after_std, believed))
    for key, parameter in refitted.items():
        owner, name = key.split('.', 1)
        prefix = f'effects.{effect_of(owner)}.{name}'
        changes[prefix] = round(float(parameter.value), _DECIMALS)
        changes[f'{prefix}_std'] = float(parameter.std)
    return changes


def _with(diagnosis: Diagnosis, changes: dict[str, object]) -> tuple[Configuration, list[str]]:
    """Return the configuration with the changes, and all keys that its file has to hold."""
    stated = diagnosis.configuration.flat()
    if stated.get('effect_file'):
        changes.setdefault('effect_file', stated['effect_file'])
    fitted = diagnosis.configuration.replace(changes)  # type: ignore[arg-type]
    errors, moved = _sensor_keys(fitted, _turning(diagnosis))
    off = {f'effects.{name}.enabled': False for name in moved if name in diagnosis.base_effects}
    kept = [
        key
        for key in (*stated, *changes)
        if key in changes or (key.startswith('effects.') and key in diagnosis.configuration.stated)
        if not any(key.startswith(f'effects.{name}.') for name in moved)
    ]
    replaced = {**changes, **{f'effects.{name}.enabled': False for name in moved}, **errors}
    whole = diagnosis.configuration.replace(replaced)  # type: ignore[arg-type]
    return whole, [*dict.fromkeys(kept), *off, *errors]


def _sensor_keys(
    configuration: Configuration, turning: float
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Return the keys that say the same as the instrument effects of a model, and those effects.

    ``turning`` is +1 or -1 where the wheel turned one way in all rows. 0: both ways; a constant
    friction, which turns with the wheel, is then no zero of the reading and stays an effect.
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


def provenance(diagnosis: Diagnosis, proposal: Proposal | None = None) -> str:
    """Return one line: what was changed, from which table, how sure."""
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
    return f'{before}; {line}' if before else line


def write_model(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write ``model.yaml``: a further ``--config`` of every command and of the node."""
    _write(path, *corrected(diagnosis), provenance(diagnosis))


def write_proposal(diagnosis: Diagnosis, proposal: Proposal, path: str | Path) -> None:
    """Write ``proposal.yaml``: the law, with the soil and effects refitted beside it."""
    comment = f'{provenance(diagnosis, proposal)}\n{proposal.words}'
    _write(path, *proposed(diagnosis, proposal), comment)


def _write(path: str | Path, configuration: Configuration, keys: list[str], comment: str) -> None:
    unique = list(dict.fromkeys(keys))
    if 'effect_file' in unique:
        comment = f'Runs Python code (effect_file): needs --allow-effect-files\n{comment}'
    configuration.write(path, unique, comment=comment)
