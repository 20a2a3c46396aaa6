# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What several tables say together, each diagnosed with a soil of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.terramechanics.effects.base import effect_of

_CLEAR = 3.0  # nats over the soil alone from which a table favours an effect


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


def over_all(found: Mapping[str, Diagnosis]) -> str:
    """Return the effects that the tables favour together, in words."""
    total = evidence_over_all(found)
    names = [name for name, (value, _) in total.items() if value > _CLEAR][:3]
    begin = f'over all {len(found)} tables, each with its own soil: '
    if not names:
        return f'{begin}no effect is favoured'
    return begin + '; '.join(
        f'{name} ({total[name][0]:+.1f} nats over the soils alone, for it {total[name][1]} of '
        f'{len(found)} tables)'
        for name in names
    )


def write_summary(found: Mapping[str, Diagnosis], path: Path) -> None:
    """Write one row per table: verdict, names, confidence, and the gap of each quantity [SI]."""
    quantities = dict.fromkeys(q for diagnosis in found.values() for q in diagnosis.gap)
    parts = ('before', 'refit', 'after', 'noise')
    rows = []
    for name, diagnosis in found.items():
        effects = ' + '.join(effect.name for effect in diagnosis.effects)
        sure = f'{diagnosis.effects[0].confidence:.3g}' if diagnosis.effects else ''
        values = (getattr(diagnosis.gap.get(q), p, None) for q in quantities for p in parts)
        gaps = ['' if value is None else f'{value:.6g}' for value in values]
        rows.append([name, diagnosis.verdict, effects, sure, *gaps])
    header = ['table', 'verdict', 'effects', 'confidence']
    write_csv(path, [*header, *(f'{q}_{p}' for q in quantities for p in parts)], rows)
