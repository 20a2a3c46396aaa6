# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report of a diagnosis for people: one HTML file, and its pictures beside it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.discrepancy.numbers import number
from wheel_terra_estimator.discrepancy.report import pictures as pictures
from wheel_terra_estimator.discrepancy.report.model_file import corrected
from wheel_terra_estimator.discrepancy.report.words import (
    STRONG_PULL,
    far_soil,
    in_words,
    soil_line,
)
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter, NextMeasurement
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.reporting.html import picture, render, write_page

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
    """Write ``report.html`` with its pictures into a folder that exists.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    folder : str or pathlib.Path
        Pictures are written there as PNG files as well; the page itself needs none of them.

    Returns
    -------
    pathlib.Path
        The page.
    """
    folder = Path(folder)
    another_soil = far_soil(diagnosis) if diagnosis.verdict == 'agrees' else []
    configuration, keys = corrected(diagnosis)
    new, old = configuration.flat(), diagnosis.configuration.flat()
    page = render(
        'diagnosis.html',
        TEMPLATES,
        diagnosis=diagnosis,
        tone='warn' if another_soil else _TONES[diagnosis.verdict],
        another_soil=another_soil,
        said=in_words(diagnosis),
        left_out=_left_out(diagnosis),
        title=Path(diagnosis.table.name).name,
        cards=_cards(diagnosis),
        figures=_figures(folder, diagnosis),
        gap=[_gap_row(name, item) for name, item in diagnosis.gap.items()],
        effects=[_effect(effect) for effect in diagnosis.effects],
        candidates=_candidates(diagnosis),
        soil=[_soil_row(shift) for shift in diagnosis.soil],
        noise=_noise(diagnosis),
        outliers=[
            (int(diagnosis.table.lines[row]), pictures.words(quantity), f'{size:.1f}')
            for row, quantity, size in diagnosis.outliers
        ],
        next_measurements=[_next(item) for item in diagnosis.next_measurement],
        visible=[
            (name, f'{parameter} {number(size)}{_unit(unit)}')
            for name, (parameter, size, unit) in sorted(diagnosis.smallest_visible.items())
        ],
        changes=[
            (key, _before(diagnosis, key, old.get(key)), shown(new[key]))
            for key in keys
            if key in new and shown(old.get(key)) != shown(new[key])
        ],
        sources=_sources(diagnosis),
        sentence=diagnosis.sentence.replace('+-', '±'),
        soil_line=soil_line(diagnosis),
        where=_where(diagnosis),
    )
    path = folder / 'report.html'
    write_page(path, page)
    return path


def _left_out(diagnosis: Diagnosis) -> list[tuple[str, str, str, str]]:
    """Rows (left out, quantity, refitted, with the law) of a proposed law."""
    rows = []
    for name, quantities in (diagnosis.proposal.left_out if diagnosis.proposal else {}).items():
        for quantity, item in quantities.items():
            scale, unit = pictures.SHOWN[quantity]
            texts = [number(scale * value) for value in (item.refit, item.law)]
            shown_name = f'{pictures.words(quantity)} [{unit}]'
            rows.append((pictures.words(name), shown_name, texts[0], texts[1]))
    return rows


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
        text = text.replace(name, pictures.words(name))
    return text[:1].upper() + text[1:].rstrip('.') + '.'


def _unit(unit: str) -> str:
    return '' if unit in ('', '-') else f' {unit}'


def _cards(diagnosis: Diagnosis) -> list[dict[str, str]]:
    cards = []
    if diagnosis.effects:
        first = diagnosis.effects[0]
        shares = ', '.join(f'{100 * effect.confidence:.0f} %' for effect in diagnosis.effects)
        names = 'names, in their order' if len(diagnosis.effects) > 1 else 'name'
        cards.append({'value': shares, 'label': f'confidence of the {names}'})
        if first.confounded_with:
            cards.append(
                {
                    'value': f'{100 * first.confidence_of_set:.0f} %',
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
        scale, unit = pictures.SHOWN[name]
        stages = {'as configured': item.before, 'soil refitted': item.refit}
        if diagnosis.effects:
            stages['effect added'] = item.after
        values = ' → '.join(number(scale * value, 2) for value in stages.values())
        cards.append(
            {
                'value': f'{values} {unit}',
                'label': f'rms error of {pictures.words(name)} on unseen rows: '
                + ', '.join(stages),
            }
        )
    closed = {name: g.shrink for name, g in diagnosis.gap.items() if g.shrink is not None}
    if diagnosis.effects and closed:
        ends = sorted({f'{100 * share:.0f}' for share in closed.values()}, key=float)
        cards.append(
            {
                'value': ' to '.join(dict.fromkeys((ends[0], ends[-1]))) + ' %',
                'label': 'of the gap above the noise closed '
                f'({", ".join(map(pictures.words, closed))})',
            }
        )
    cards.append({'value': str(len(diagnosis.table)), 'label': 'rows'})
    cards.append({'value': f'{diagnosis.seconds:.2f} s', 'label': 'time of the diagnosis'})
    return cards


Drawn = dict[str, str]
"""A picture as addresses of images in the page: ``wide``, and ``narrow`` for a phone."""


def _figures(folder: Path, diagnosis: Diagnosis) -> dict[str, Any]:
    """Draw every picture that this diagnosis has; each is written as PNG and embedded twice."""

    def keep(name: str, draw: Callable[[bool], Figure | None]) -> Drawn | None:
        figure, narrow = draw(False), draw(True)
        if figure is None or narrow is None:
            return None
        figure.savefig(folder / f'{name}.png', dpi=_RESOLUTION, metadata={'Software': None})
        return {'wide': picture(figure), 'narrow': picture(narrow)}

    proposed = next((m for m in diagnosis.next_measurement if m.rows is not None), None)
    residuals = [
        (
            pictures.words(name),
            keep(f'residuals_by_{name}', partial(pictures.residuals, diagnosis, name)),
        )
        for name in pictures.colour_inputs(diagnosis)
    ]
    return {
        'curves': keep('curves_over_slip', partial(pictures.curves_over_slip, diagnosis)),
        'parity': keep(
            'measured_against_model', partial(pictures.measured_against_model, diagnosis)
        ),
        'residuals': residuals,
        'where': keep('where', partial(pictures.where_map, diagnosis)),
        'structural_error': keep('structural_error', partial(pictures.structural_error, diagnosis)),
        'rivals': keep('next_measurement', partial(pictures.rivals, proposed))
        if proposed
        else None,
        'rivals_title': proposed.what if proposed else '',
    }


def _gap_row(name: str, item: Any) -> dict[str, str]:
    scale, unit = pictures.SHOWN[name]
    row = {
        'name': f'{pictures.words(name)} [{unit}]',
        'before': number(scale * item.before),
        'refit': number(scale * item.refit),
        'after': number(scale * item.after),
        'noise': '-' if item.noise is None else number(scale * item.noise),
        'floor': number(scale * item.floor, 2) if item.floor else '-',
        'rows': str(item.rows),
        'shrink': '-',
    }
    if item.shrink is not None:
        row['shrink'] = f'{100 * item.shrink:.0f} %'
        if item.shrink_low is not None and item.shrink_high is not None:
            row['shrink'] += f' ({100 * item.shrink_low:.0f} to {100 * item.shrink_high:.0f})'
    return row


def _parameter(name: str, item: FittedParameter) -> str:
    text = f'{name} = {number(item.value)} ± {number(item.std, 2)}{_unit(item.unit)}'
    reach = item.upper - item.lower
    if np.isfinite(reach) and min(item.value - item.lower, item.upper - item.value) < 1e-3 * reach:
        text += ' (at its bound)'
    return text


def _effect(effect: Any) -> dict[str, Any]:
    return {
        'name': pictures.words(effect.name),
        'key': effect.name,
        'claim': effect.claim,
        'parameters': [
            (_parameter(name, item), item.meaning) for name, item in effect.parameters.items()
        ],
        'confidence': f'{100 * effect.confidence:.0f} %',
        'confidence_of_set': f'{100 * effect.confidence_of_set:.0f} %',
        'confounded': [
            (pictures.words(name), effect.separates.get(name, ''))
            for name in effect.confounded_with
        ],
        'remainder': effect.remainder,
    }


def _candidates(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    best = max((c.log_evidence for c in diagnosis.candidates), default=0.0)
    span = max(best, 10.0)
    rows = []
    for candidate in diagnosis.candidates:
        rows.append(
            {
                'label': pictures.words(candidate.full_label),
                'chosen': bool(candidate.names) and not candidate.why_not,
                'parameters': [
                    f'{key.split(".")[-1]} {number(item.value)} ± {number(item.std, 2)}'
                    + _unit(item.unit)
                    for key, item in candidate.parameters.items()
                ],
                'log_evidence': f'{candidate.log_evidence:.1f}',
                'bar': f'{100 * float(np.clip(candidate.log_evidence / span, 0.0, 1.0)):.0f}',
                'probability': _share(candidate.probability),
                'held_out_gain': f'{candidate.held_out_gain:.1f}',
                'fit': f'{candidate.chi2:.0f} / {candidate.degrees_of_freedom:.0f}',
                'size': f'{candidate.size:.1f}',
                'why_not': candidate.why_not,
            }
        )
    return rows


def _share(value: float) -> str:
    if value < 0.001:
        return '< 0.1 %'
    return '> 99.9 %' if value > 0.999 else f'{100 * value:.1f} %'


def _soil_row(shift: Any) -> dict[str, Any]:
    return {
        'name': SOIL_WORDS.get(shift.name, pictures.words(shift.name)),
        'unit': '' if shift.unit == '-' else shift.unit,
        'before': f'{number(shift.before)} ± {number(shift.prior_std, 2)}',
        'refit': number(shift.refit),
        'after': f'{number(shift.after)} ± {number(shift.after_std, 2)}',
        'pull': f'{shift.pull:+.1f}',
        'source': shift.source,
        'far': abs(shift.pull) > STRONG_PULL,
        'left': f'{50 + 25 * float(np.clip(shift.pull / STRONG_PULL, -2, 2)):.1f}',
    }


def _noise(diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    rows = []
    for q, name in enumerate(QUANTITIES):
        if name in diagnosis.noise.origin and name in diagnosis.table.quantities:
            scale, unit = pictures.SHOWN[name]
            std = float(np.nanmedian(diagnosis.noise.std[:, q]))
            rows.append(
                (
                    pictures.words(name),
                    f'{number(scale * std, 2)} {unit}',
                    diagnosis.noise.origin[name],
                )
            )
    return rows


def _next(item: NextMeasurement) -> dict[str, Any]:
    rows = None
    if item.rows is not None:
        names = [name for name in item.rows if len(item.rows[name])]
        count = len(item.rows[names[0]]) if names else 0
        ranges = []
        for name in names:
            factor, unit = pictures.shown_input(name)
            values = factor * np.asarray(item.rows[name], dtype=float)
            low, high = float(values.min()), float(values.max())
            text = number(low) if np.isclose(low, high) else f'{number(low)} to {number(high)}'
            ranges.append(f'{pictures.words(name)} {text}{_unit(unit)}')
        rows = f'{count} rows: ' + ', '.join(ranges)
    return {
        'what': item.what,
        'rows': rows,
        'separates': ' / '.join(pictures.words(name) for name in item.separates),
        'now': f'{item.distance_now:.1f}',
        'then': f'{item.distance_then:.1f}' if np.isfinite(item.distance_then) else 'decides',
    }


def _sources(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Sources of the effects used: the named ones and those that were on before."""
    from wheel_terra_estimator.terramechanics.effects import catalogue

    known = catalogue()
    names = dict.fromkeys([*(e.name for e in diagnosis.effects), *diagnosis.base_effects])
    return [(pictures.words(name), known[name].source) for name in names if name in known]
