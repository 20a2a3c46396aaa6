# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The corrected model: a parameter file with the effects on, soil refitted, and its provenance."""

from __future__ import annotations

import math
from pathlib import Path

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.effect_keys import effect_of
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.terramechanics.soil import Soil


def corrected(diagnosis: Diagnosis) -> tuple[Configuration, list[str]]:
    """Return the configuration with the diagnosis put in, and the keys that it sets."""
    changes: dict[str, object] = {}
    soil = diagnosis.configuration.soil
    for shift in diagnosis.soil:
        changes.update(_soil_keys(shift.name, shift.after, shift.after_std, soil))
    for key, parameter in diagnosis.refitted.items():
        owner, name = key.split('.', 1)
        prefix = f'effects.{effect_of(owner)}.{name}'
        changes[prefix] = float(parameter.value)
        changes[f'{prefix}_std'] = float(parameter.std)
    for effect in diagnosis.effects:
        prefix = f'effects.{effect.name}'
        changes[f'{prefix}.enabled'] = True
        if effect.form:
            changes[f'{prefix}.form'] = effect.form
        for name, parameter in effect.parameters.items():
            changes[f'{prefix}.{name}'] = float(parameter.value)
            changes[f'{prefix}.{name}_std'] = float(parameter.std)
    changes['provenance'] = provenance(diagnosis)
    stated = diagnosis.configuration.flat()
    if stated.get('effect_file'):
        changes.setdefault('effect_file', stated['effect_file'])
    kept = [
        key
        for key in stated
        if key.startswith('effects.') and key in diagnosis.configuration.stated
    ]
    return diagnosis.configuration.replace(changes), [*kept, *changes]  # type: ignore[arg-type]


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


def provenance(diagnosis: Diagnosis) -> str:
    """Return one line: what was changed, from which table, how sure."""
    before = diagnosis.configuration.provenance
    if diagnosis.effects:
        effects = ', '.join(f'{e.name} (confidence {e.confidence:.2f})' for e in diagnosis.effects)
        done = f'{effects} added and soil refitted'
    else:
        done = f'soil refitted (verdict: {diagnosis.verdict})'
    line = f'{done} by wheel-terra diagnose on {Path(diagnosis.table.name).name}'
    line += f', {len(diagnosis.table)} rows'
    return f'{before}; {line}' if before else line


def write_model(diagnosis: Diagnosis, path: str | Path) -> None:
    """Write ``model.yaml``: a further ``--config`` of every command and of the node."""
    configuration, keys = corrected(diagnosis)
    unique = list(dict.fromkeys(keys))
    comment = provenance(diagnosis)
    if 'effect_file' in unique:
        comment = f'Runs Python code (effect_file): needs --allow-effect-files\n{comment}'
    configuration.write(path, unique, comment=comment)
