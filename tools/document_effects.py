# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/effects.md and a picture per effect from the catalogue.

python tools/document_effects.py
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from io import StringIO
from pathlib import Path

import numpy as np

from wheel_terra_estimator.cli.effects import left_aside, touched
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_estimator.terramechanics.effects import Effect, EffectParameter, catalogue
from wheel_terra_estimator.terramechanics.effects import learned_closure as law
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

ROOT = Path(__file__).resolve().parents[1]
SOIL = Soil(15.6e3, 2407.4e3, 1.1, 250.0, np.radians(31.9), 0.0114, 0.5, -0.2, 1605.0)
SLIP = np.linspace(0.0, 0.9, 31)
# What an effect needs to be seen besides slip: a slope, a second pass, another speed, bare rim.
SETTINGS = {
    'slope': {'slope': 0.2},
    'pass_number': {'pass_number': 2},
    'angular_velocity': {'angular_velocity': 2.0},
    'slip_angle': {'slip_angle': 0.3},
}
PANELS = ('sinkage [mm]', 'drawbar pull [N]', 'torque [N m]', 'lateral force [N]')
SCALES = (1e3, 1.0, 1.0)
SMOOTH = frozenset({'rim_friction'})
HASHES = re.compile('p[0-9a-f]{10}')
"""Names of clips in a picture: hashes of places, which differ from machine to machine in the last
bit."""


def draw(effect: Effect, path: Path) -> None:
    """Draw its outputs without the effect, at half, one and twice its default."""
    from matplotlib.figure import Figure

    parameter = effect.parameters[0]
    inputs: dict[str, float] = {}
    for need in effect.needs:
        inputs.update(SETTINGS.get(need, {}))
    wheel = Wheel(0.1574, 0.165, 0.0 if effect.name in SMOOTH else 0.010, 30)
    points = OperatingPoints(SLIP, 80.0, wheel, **inputs)
    values = [None, *(factor * parameter.default for factor in (0.5, 1.0, 2.0))]
    with picture_style():
        figure = Figure(figsize=(8.2, 2.5))
        aside = 'lateral_force' in effect.touches
        texts = PANELS[-1:] if aside else PANELS[:-1]
        axes = np.atleast_1d(figure.subplots(1, len(texts)))
        for value, colour in zip(values, LINE_COLOURS, strict=False):
            if value is not None and not parameter.lower <= value <= parameter.upper:
                continue
            settings = {} if value is None else {effect.name: {parameter.name: value}}
            state = WheelSoilModel(SOIL, settings).steady_state(points)
            columns = [state.lateral_force] if aside else [*(state.outputs() * SCALES).T]
            unit = '' if parameter.unit == '-' else f' {parameter.unit}'
            label = 'off' if value is None else f'{parameter.name} = {value:g}{unit}'
            for axis, column in zip(axes, columns, strict=True):
                axis.plot(SLIP, column, color=colour, label=label)
        for axis, text in zip(axes, texts, strict=True):
            axis.set_xlabel('slip [-]')
            axis.set_ylabel(text)
        axes[0].invert_yaxis()
        axes[0].legend(fontsize=7)
        drawn = StringIO()
        figure.savefig(drawn, format='svg', metadata={'Date': None})
    now = drawn.getvalue()
    if not path.exists() or HASHES.sub('', path.read_text('utf-8')) != HASHES.sub('', now):
        path.write_text(now, encoding='utf-8')


def as_markdown(effects: Mapping[str, Effect]) -> str:
    """Return the catalogue as a page of the documentation."""
    lines = [
        '# Effects',
        '',
        '<!-- Written by `python tools/document_effects.py`; do not edit. -->',
        '',
        'Each is off unless a file has `effects.<name>.enabled: true`; `effects.<name>.form` '
        'chooses a form; what it shares with the first is not repeated. Numbers of a parameter: '
        'default (range), prior: mean ± deviation, or scale of a half-normal one (†: grows with W, '
        'of a torque with W r). *Needs*: columns that must vary. *Confounded with*: in brackets '
        'what tells the two apart. Figures, and †: wheel of 157 mm radius with 10 mm lugs, 80 N, '
        'HIT-LSS1 sand.',
        '',
        'By the outputs that they change:',
        '',
    ]
    by_touch: dict[str, list[str]] = {}
    for effect in effects.values():
        by_touch.setdefault(touched(effect), []).append(f'[`{effect.name}`](#{effect.name})')
    lines += [f'- {what}: {", ".join(names)}' for what, names in by_touch.items()]
    for effect in effects.values():
        lines += ['', f'## {effect.name}', '']
        said: set[str] = set()
        for form in effect.forms:
            if len(effect.forms) > 1:
                first = ' (default)' if form is effect.forms[0] else ''
                lines += [f'**`form: {form.form}`**{first}', '']
            lines += [f'{form.claim[0].upper()}{form.claim[1:]}.', '', f'    {form.symbol}', '']
            lines += _law_table() if form.sparse else []
            for facts in (_parameters(form), _facts(effect, form)):
                new = [fact for fact in facts if fact not in said]
                said.update(new)
                listed = '\n' if facts and facts[0].startswith('- ') else ' '
                lines += [listed.join(new), ''] if new else []
        others = ', '.join(f'`{other}` ({by})' for other, by in effect.confounded_with.items())
        if others:
            lines += [f'*Confounded with*: {others}.', '']
        if effect.incompatible_with:
            lines += [f'*Not together with*: {", ".join(sorted(effect.incompatible_with))}.', '']
        for text in left_aside(effect):
            lines += [f'{text[0].upper()}{text[1:]}.', '']
        if not effect.sparse:
            lines.append(f'![{effect.name}](models/effects/{effect.name}.svg)')
    return '\n'.join(lines) + '\n'


def _parameters(form: Effect) -> list[str]:
    return [] if form.sparse else [_parameter(p) for p in form.parameters]


def _facts(effect: Effect, form: Effect) -> list[str]:
    """Return what a form needs, where it holds and where it comes from."""
    facts = []
    if form.touches != effect.touches:
        facts.append(f'*Touches*: {touched(form)}.')
    if form.needs:
        facts.append(f'*Needs*: {", ".join(form.needs)}.')
    return [*facts, f'*Valid*: {form.validity}.', f'*Source*: {_linked(form.source)}.']


def _linked(source: str) -> str:
    """Return a source with its DOIs as links; that a book has none needs no word."""
    source = re.sub(r',? no DOI\b', '', source)
    return re.sub(r'\bdoi (10\.[^\s,;]+[^\s,;).])', r'[doi](https://doi.org/\1)', source)


def _law_table() -> list[str]:
    """Return what a sparse law may change, and with what, as tables."""
    lines = [
        'Flat lists of equal length: `targets`, `features`, `coefficients`, `coefficients_std`.',
        '',
        '| target | changes | how | bound of the change |',
        '|---|---|---|---|',
    ]
    for name, target in law.TARGETS.items():
        unit = '' if target.unit == '-' else f', in {target.unit}'
        how = 'factor exp(x)' if target.factor else f'added{unit}'
        lines.append(f'| `{name}` | {target.meaning} | {how} | {target.bound:g} |')
    of_targets: dict[tuple[str, ...], list[str]] = {}
    for name, feature in law.FEATURES.items():
        value = '' if '_times_' in name else f' ({feature.meaning})'
        of_targets.setdefault(tuple(feature.targets), []).append(f'`{name}`{value}')
    lines += ['', 'Features:', '']
    for targets, features in of_targets.items():
        only = f'for {", ".join(f"`{t}`" for t in targets)} only: ' if targets else ''
        lines.append(f'- {only}{", ".join(features)}')
    return [*lines, '']


def _parameter(p: EffectParameter) -> str:
    unit = '' if p.unit == '-' else f' [{p.unit}]'
    note = '' if p.free else ', not fitted'
    return (
        f'- `{p.name}`{unit}: {p.meaning}; {p.default:g} ({p.lower:g} to {p.upper:g}), '
        f'{_prior(p)}{note}'
    )


def _prior(p: EffectParameter) -> str:
    centre = 'half-normal ' if p.prior == 'half_normal' else f'{p.prior_mean:g} ± '
    return f'{centre}{p.prior_scale:g}{"†" if p.by_load else ""}'


def main() -> None:
    """Write the page and the pictures."""
    folder = ROOT / 'docs' / 'models' / 'effects'
    folder.mkdir(parents=True, exist_ok=True)
    for effect in catalogue().values():
        if not effect.sparse:  # a law has no shape of its own
            draw(effect, folder / f'{effect.name}.svg')
    (ROOT / 'docs' / 'effects.md').write_text(as_markdown(catalogue()), encoding='utf-8')


if __name__ == '__main__':
    main()
