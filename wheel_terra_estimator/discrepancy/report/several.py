# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What several tables say together, each diagnosed with a soil of its own."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import chdtrc

from wheel_terra_estimator.configuration.reader import from_parameters
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    EFFECT_SCALES,
    EFFECT_SHARES,
    Coordinate,
    effect_coordinates,
)
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.base import effect_of

_CLEAR = 3.0  # nats over the soil alone from which a table favours an effect
_APART = 0.01  # chance below which sizes of several tables are not one


def evidence_over_all(found: Mapping[str, Diagnosis]) -> dict[str, tuple[float, int]]:
    """Return effect -> (sum of its log evidence over the tables [nats], tables that favour it).

    Each table has its own soil and its own size of the effect, so that the evidences multiply. An
    effect that a table does not list counts as its least listed one.
    """
    total: dict[str, tuple[float, int]] = {}
    by_table = []
    for diagnosis in found.values():
        best: dict[str, float] = {}
        for candidate in diagnosis.candidates:
            if len(candidate.names) == 1:
                name = effect_of(candidate.names[0])
                best[name] = max(candidate.log_evidence, best.get(name, -float('inf')))
        by_table.append(best)
    for name in dict.fromkeys(name for best in by_table for name in best):
        values = [best.get(name, min([*best.values(), 0.0])) for best in by_table]
        total[name] = sum(values), sum(value > _CLEAR for value in values)
    return dict(sorted(total.items(), key=lambda item: -item[1][0]))


@dataclass(frozen=True)
class SharedSize:
    """An effect with one size in several tables, each with a soil of its own."""

    form: str  # name of its form; empty: the first
    # Name of the parameter -> value and deviation that all tables give together
    parameters: Mapping[str, FittedParameter]
    log_evidence: float  # for it, over the soils alone [nats]
    # Chance that sizes which are one scatter as much from table to table as these do
    p_value: float

    @property
    def one(self) -> bool:
        """Whether the sizes of the tables scatter no more than chance lets them."""
        return self.p_value >= _APART


def shared_size(found: Mapping[str, Diagnosis], name: str) -> SharedSize | None:
    """Return what the tables say of one effect with one size; None where one does not list it.

    Each table's posterior of the size, its soil integrated out, is taken as a normal one, the
    prior as constant over it: the evidence of one size is the product of the evidences times the
    overlap of the posteriors over the prior, the latter once less than there are tables. The form
    of the effect is the one with the greatest sum of evidence.
    """
    listed = [
        {
            candidate.names[0]: candidate
            for candidate in diagnosis.candidates
            if len(candidate.names) == 1 and effect_of(candidate.names[0]) == name
        }
        for diagnosis in found.values()
    ]
    keys = [key for key in listed[0] if all(key in table for table in listed)]
    if not keys:
        return None
    key = max(keys, key=lambda one: sum(table[one].log_evidence for table in listed))
    chosen = [table[key] for table in listed]
    form = next(form for form in catalogue()[name].forms if form.name == key)
    evidence = sum(candidate.log_evidence for candidate in chosen)
    parameters, distance, degrees = {}, 0.0, 0
    for coordinate in effect_coordinates(form):
        sizes = [candidate.parameters.get(coordinate.key) for candidate in chosen]
        known = [size for size in sizes if size is not None and size.std > 0.0]
        if len(known) < len(chosen):
            continue
        value = np.array([size.value for size in known])
        weight = np.array([size.std for size in known]) ** -2.0
        mean, std = float(value @ weight / weight.sum()), float(weight.sum() ** -0.5)
        parameters[coordinate.name] = replace(known[0], value=mean, std=std)
        apart = float(((value - mean) ** 2) @ weight)
        overlap = 0.5 * float(np.log(weight / (2.0 * np.pi)).sum()) - 0.5 * apart
        overlap += 0.5 * math.log(2.0 * np.pi) + math.log(std)
        evidence += overlap - (len(known) - 1) * _log_prior(coordinate, mean)
        distance += apart
        degrees += len(known) - 1
    if not parameters:
        return None
    return SharedSize(form.form, parameters, evidence, float(chdtrc(degrees, distance)))


def _log_prior(coordinate: Coordinate, value: float) -> float:
    """Return the log density of the prior; a strength may be small, large or very large."""
    strength = coordinate.role == 'strength'
    factors = np.array(EFFECT_SCALES if strength else (1.0,))
    shares = np.array(EFFECT_SHARES if strength else (1.0,))
    scales = coordinate.scale * factors
    u = (value - coordinate.centre) / scales
    sides = 2.0 if 0.0 in (coordinate.lower, coordinate.upper) else 1.0
    density = sides * np.exp(-0.5 * u * u) / (scales * math.sqrt(2.0 * math.pi))
    return math.log(max(float(shares @ density), 1e-300))


def write_shared_effect(found: Mapping[str, Diagnosis], path: Path) -> None:
    """Write the effect that all tables favour most with one size: goes on top of any soil.

    Nothing is written where no effect is favoured, or its sizes are not one.
    """
    total = evidence_over_all(found)
    name = next(iter(total), '')
    shared = shared_size(found, name) if name and total[name][0] > _CLEAR else None
    if shared is None or not shared.one:
        return
    prefix = f'effects.{name}'
    values: dict[str, Value] = {f'{prefix}.enabled': True}
    if shared.form:
        values[f'{prefix}.form'] = shared.form
    for key, item in shared.parameters.items():
        values[f'{prefix}.{key}'] = item.value
        values[f'{prefix}.{key}_std'] = item.std
    listed = ', '.join(found)
    from_parameters(values, complete=False).write(
        path, list(values), comment=f'One size of {name} in the soils of {listed}.'
    )


def over_all(found: Mapping[str, Diagnosis]) -> str:
    """Return the effects that the tables favour together, in words."""
    total = evidence_over_all(found)
    names = [name for name, (value, _) in total.items() if value > _CLEAR][:3]
    begin = f'over all {len(found)} tables, each with its own soil: '
    if not names:
        return f'{begin}no effect is favoured'
    return begin + '; '.join(
        f'{name} ({total[name][0]:+.1f} nats over the soils alone, for it {total[name][1]} of '
        f'{len(found)} tables{_in_words(shared_size(found, name))})'
        for name in names
    )


def _in_words(shared: SharedSize | None) -> str:
    if shared is None:
        return ''
    values = ', '.join(
        f'{name} = {item.value:.3g} +- {item.std:.2g}{"" if item.unit == "-" else " " + item.unit}'
        for name, item in shared.parameters.items()
    )
    if not shared.one:
        return f'; not one size: the tables differ, p = {shared.p_value:.1g}'
    return f'; with one size {shared.log_evidence:+.1f} nats, {values}'


def write_summary(found: Mapping[str, Diagnosis], path: Path) -> None:
    """Write one row per table: verdict, names, confidence, and the gap of each quantity [SI]."""
    quantities = dict.fromkeys(q for diagnosis in found.values() for q in diagnosis.gap)
    parts = ('before', 'refit', 'after', 'noise')
    with path.open('w', encoding='utf-8', newline='') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(
            [
                'table',
                'verdict',
                'effects',
                'confidence',
                *(f'{q}_{p}' for q in quantities for p in parts),
            ]
        )
        for name, diagnosis in found.items():
            effects = ' + '.join(effect.name for effect in diagnosis.effects)
            sure = f'{diagnosis.effects[0].confidence:.3g}' if diagnosis.effects else ''
            gaps = [
                '' if (value := getattr(diagnosis.gap.get(q), p, None)) is None else f'{value:.6g}'
                for q in quantities
                for p in parts
            ]
            writer.writerow([name, diagnosis.verdict, effects, sure, *gaps])
