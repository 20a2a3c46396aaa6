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
from wheel_terra_estimator.discrepancy.report.words import FACTORS, in_words, soil_line
from wheel_terra_estimator.discrepancy.result import Diagnosis, FittedParameter, NextMeasurement
from wheel_terra_estimator.discrepancy.selection.verdict import LARGEST_Z_SCORE
from wheel_terra_estimator.reporting.html import picture, render
from wheel_terra_estimator.terramechanics.effects import catalogue

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TEMPLATES = Path(__file__).parent / 'templates'
_RESOLUTION = 110  # [dots per inch]
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
        where=_where(diagnosis),
        soil_words=FACTORS,
        far=LARGEST_Z_SCORE,
        # How things are written
        words=plain,
        number=number,
        percent=percent,
        amount=amount,
        unit_of=lambda quantity: SHOWN[quantity][1],
        with_unit=with_unit,
        parameter=_parameter,
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
    """Return the configured value; a deviation or effect that is not stated has none."""
    optional = '_std' in key or (key.startswith('effects.') and not key.endswith('.enabled'))
    return '-' if optional and key not in diagnosis.configuration.stated else shown(value)


def _where(diagnosis: Diagnosis) -> str:
    """Return the sentence of where the gap is, as one."""
    text = diagnosis.where.sentence
    for name in diagnosis.table.columns:
        text = text.replace(name, plain(name))
    return text[:1].upper() + text[1:].rstrip('.') + '.'


def _figures(folder: Path, diagnosis: Diagnosis) -> dict[str, Any]:
    """Draw every picture that this diagnosis has; each is written as PNG and embedded."""

    def keep(name: str, figure: Figure | None) -> str | None:
        if figure is None:
            return None
        figure.savefig(folder / f'{name}.png', dpi=_RESOLUTION, metadata={'Software': None})
        figure.set_layout_engine('none')  # laid out once, for both formats
        return picture(figure)

    colour = pictures.colour_input(diagnosis)
    return {
        'curves': keep('curves_over_slip', pictures.curves_over_slip(diagnosis)),
        'residuals': keep(f'residuals_by_{colour}', pictures.residuals(diagnosis, colour)),
        'colour': plain(colour),
    }


def _parameter(name: str, item: FittedParameter) -> str:
    return with_unit(f'{name} = {number(item.value)} ± {number(item.std, 2)}', item.unit)


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
