# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis for people: one HTML file, and its pictures beside it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.discrepancy.numbers import (
    SHOWN,
    amount,
    number,
    percent,
    plain,
    with_unit,
)
from wheel_terra_estimator.discrepancy.report import pictures as pictures
from wheel_terra_estimator.discrepancy.report.model_file import corrected
from wheel_terra_estimator.discrepancy.report.words import in_words, law_line, soil_line
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter, NextMeasurement
from wheel_terra_estimator.discrepancy.selection.remainder import LARGEST_Z_SCORE
from wheel_terra_estimator.reporting.html import picture, render
from wheel_terra_estimator.terramechanics.effects import catalogue

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TEMPLATES = Path(__file__).parent / 'templates'
_RESOLUTION = 110  # [dots per inch]
SOIL_WORDS = {
    'stiffness': 'bearing stiffness (factor on both moduli)',
    'tan_friction': 'tangent of the friction angle',
}
_TONES = {'agrees': 'good', 'named': 'warn', 'unexplained': 'bad', 'undecided': 'warn'}


def write_report(diagnosis: Diagnosis, folder: str | Path) -> Path:
    """Write ``report.html`` into a folder that exists; return its path.

    Pictures are written there as PNG files as well; the page itself needs none of them.
    """
    folder = Path(folder)
    configuration, keys = corrected(diagnosis)
    new, old = configuration.flat(), diagnosis.configuration.flat()
    known = catalogue()
    used = dict.fromkeys([*(e.name for e in diagnosis.effects), *diagnosis.base_effects])
    page = render(
        'diagnosis.html',
        TEMPLATES,
        diagnosis=diagnosis,
        tone=_TONES[diagnosis.verdict],
        said=in_words(diagnosis),
        title=Path(diagnosis.table.name).name,
        cards=_cards(diagnosis),
        figures=_figures(folder, diagnosis),
        best=max([10.0, *(c.log_evidence for c in diagnosis.candidates)]),
        noise=diagnosis.to_dict()['noise'],
        changes=[
            (key, _before(diagnosis, key, old.get(key)), shown(new[key]))
            for key in keys
            if key in new and shown(old.get(key)) != shown(new[key])
        ],
        sources=[(plain(name), known[name].source) for name in used if name in known],
        sentence=diagnosis.sentence.replace('+-', '±'),
        soil_line=soil_line(diagnosis),
        law_line=law_line(diagnosis),
        where=_where(diagnosis),
        soil_words=SOIL_WORDS,
        far=LARGEST_Z_SCORE,
        # How things are written
        words=plain,
        number=number,
        percent=percent,
        amount=amount,
        unit_of=lambda quantity: SHOWN[quantity][1],
        with_unit=with_unit,
        parameter=_parameter,
        share=_share,
        proposed=_proposed,
    )
    path = folder / 'report.html'
    path.write_text(page, encoding='utf-8')
    return path


def shown(value: Any) -> str:
    """Return a configuration value for people."""
    if value is None:
        return 'not set'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return number(value, 4)
    if isinstance(value, list | tuple):
        return '[' + ', '.join(shown(item) for item in value) + ']'
    return str(value)


def _before(diagnosis: Diagnosis, key: str, value: Any) -> str:
    """Return the configured value; a deviation or effect that nobody stated has none."""
    optional = '_std' in key or (key.startswith('effects.') and not key.endswith('.enabled'))
    return '-' if optional and key not in diagnosis.configuration.stated else shown(value)


def _where(diagnosis: Diagnosis) -> str:
    """Return the sentence of where the gap is, as one."""
    text = diagnosis.where.sentence
    for name in diagnosis.table.columns:
        text = text.replace(name, plain(name))
    return text[:1].upper() + text[1:].rstrip('.') + '.'


def _cards(diagnosis: Diagnosis) -> list[dict[str, str]]:
    cards = []
    if diagnosis.effects:
        first = diagnosis.effects[0]
        shares = ', '.join(percent(effect.confidence) for effect in diagnosis.effects)
        names = 'names, in their order' if len(diagnosis.effects) > 1 else 'name'
        cards.append({'value': shares, 'label': f'confidence of the {names}'})
        if first.confounded_with:
            cards.append(
                {
                    'value': percent(first.confidence_of_set),
                    'label': 'that it is the name or one it is confounded with',
                }
            )
    worst = max(
        diagnosis.gap.items(),
        # The greatest gap that the soil leaves open; where it closes all, the greatest of all.
        key=lambda item: (
            (item[1].before if diagnosis.verdict == 'agrees' else item[1].refit)
            / (item[1].noise or 1e9)
        ),
        default=None,
    )
    if worst is not None:
        name, item = worst
        scale, unit = SHOWN[name]
        stages = {'as configured': item.before, 'soil refitted': item.refit}
        if diagnosis.effects:
            stages['effect added'] = item.after
        values = ' → '.join(number(scale * value, 2) for value in stages.values())
        cards.append(
            {
                'value': f'{values} {unit}',
                'label': f'rms error of {plain(name)} on unseen rows: ' + ', '.join(stages),
            }
        )
    closed = {name: g.shrink for name, g in diagnosis.gap.items() if g.shrink is not None}
    if diagnosis.effects and closed:
        ends = sorted({f'{100 * share:.0f}' for share in closed.values()}, key=float)
        cards.append(
            {
                'value': ' to '.join(dict.fromkeys((ends[0], ends[-1]))) + ' %',
                'label': f'of the gap above the noise closed ({", ".join(map(plain, closed))})',
            }
        )
    cards.append({'value': str(len(diagnosis.table)), 'label': 'rows'})
    cards.append({'value': f'{diagnosis.seconds:.2f} s', 'label': 'time of the diagnosis'})
    return cards


def _figures(folder: Path, diagnosis: Diagnosis) -> dict[str, Any]:
    """Draw every picture that this diagnosis has; each is written as PNG and embedded."""

    def keep(name: str, figure: Figure | None) -> str | None:
        if figure is None:
            return None
        figure.savefig(folder / f'{name}.png', dpi=_RESOLUTION, metadata={'Software': None})
        figure.set_layout_engine('none')  # laid out once, for both formats
        return picture(figure)

    proposed = next((m for m in diagnosis.next_measurement if m.rows is not None), None)
    residuals = [
        (
            plain(name),
            keep(f'residuals_by_{name}', pictures.residuals(diagnosis, name)),
        )
        for name in pictures.colour_inputs(diagnosis)
    ]
    return {
        'curves': keep('curves_over_slip', pictures.curves_over_slip(diagnosis)),
        'parity': keep('measured_against_model', pictures.measured_against_model(diagnosis)),
        'residuals': residuals,
        'where': keep('where', pictures.where_map(diagnosis)),
        'competitors': keep('next_measurement', pictures.competitors(proposed))
        if proposed
        else None,
        'competitors_title': proposed.what if proposed else '',
    }


def _parameter(name: str, item: FittedParameter) -> str:
    value = with_unit(f'{number(item.value)} ± {number(item.std, 2)}', item.unit)
    reach = item.upper - item.lower
    end = np.isfinite(reach) and min(item.value - item.lower, item.upper - item.value)
    return f'{name} = {value}{" (at its bound)" if end is not False and end < 1e-3 * reach else ""}'


def _share(value: float) -> str:
    if value < 0.001:
        return '< 0.1 %'
    return '> 99.9 %' if value > 0.999 else f'{100 * value:.1f} %'


def _proposed(item: NextMeasurement) -> str:
    """Return the rows of a proposed measurement in words; empty for a check of an instrument."""
    if item.rows is None:
        return ''
    ranges = []
    for name, column in item.rows.items():
        factor, unit = pictures.shown_input(name)
        ends = factor * np.min(column), factor * np.max(column)
        text = ' to '.join(map(number, ends)) if not np.isclose(*ends) else number(ends[0])
        ranges.append(with_unit(f'{plain(name)} {text}', unit))
    return f'{len(item.rows["slip"])} rows: ' + ', '.join(ranges)
