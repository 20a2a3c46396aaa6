# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra effects``."""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wheel_terra_estimator.cli.terminal import suggestion
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects import (
    Effect,
    EffectParameter,
    catalogue,
    load_file,
)
from wheel_terra_estimator.terramechanics.effects import learned_closure as law
from wheel_terra_estimator.terramechanics.effects.base import REFERENCE_LOAD, TOUCHABLE

EXAMPLES = ('wheel-terra effects', 'wheel-terra effects lug_digging multipass')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.add_argument('names', nargs='*', metavar='NAME', help='only these, in full')
    parser.add_argument('--json', action='store_true', help='print them as JSON')
    parser.add_argument(
        '--load',
        type=Path,
        action='append',
        default=[],
        metavar='F.py',
        help='a file with effects of your own, listed with the others',
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    for path in arguments.load:
        try:
            load_file(path)
        except ValueError as error:
            raise UserError(str(error)) from None
    known = catalogue()
    for name in arguments.names:
        if name not in known:
            raise UserError(f'no effect {name}; {suggestion(name, list(known))}')
    chosen = {name: known[name] for name in arguments.names or known}
    sys.stdout.write(as_json(chosen) if arguments.json else as_text(chosen))
    return 0


def as_text(effects: Mapping[str, Effect]) -> str:
    """Return the catalogue for a terminal."""
    blocks = []
    for effect in effects.values():
        lines = [effect.name]
        for form in effect.forms:
            if len(effect.forms) > 1:
                lines += _wrapped('form ', form.form)
            lines += [*_wrapped('', form.claim), *_wrapped('term: ', form.symbol)]
            if form.sparse:  # what it may change, and with what
                lines += _wrapped('targets: ', ', '.join(law.TARGETS))
                lines += _wrapped('features: ', ', '.join(law.FEATURES))
            else:
                lines += [line for p in form.parameters for line in _parameter_text(p)]
            if form is not effect.forms[0]:
                lines += [*_wrapped('valid: ', form.validity), *_wrapped('source: ', form.source)]
        kind = 'instrument' if effect.instrument else 'soil'
        lines += _wrapped('touches: ', f'{touched(effect)} ({kind})')
        if effect.needs:
            lines += _wrapped('needs: ', ', '.join(effect.needs))
        for other, separates in effect.confounded_with.items():
            lines += _wrapped('like ', f'{other}; what separates them: {separates}')
        if effect.incompatible_with:
            lines += _wrapped('not with: ', ', '.join(sorted(effect.incompatible_with)))
        if effect.sparse:
            lines.append('- Proposed by the discrepancy workflow, never named.')
        for text in left_aside(effect):
            lines += _wrapped('', text)
        lines += _wrapped('valid: ', effect.validity)
        lines += _wrapped('source: ', effect.source)
        blocks.append('\n'.join(lines) + '\n')
    return '\n'.join(blocks).replace('±', '+-')


def left_aside(effect: Effect) -> list[str]:
    """Return which forms the discrepancy workflow does not try, and why."""
    found = []
    for form in effect.forms:
        if not form.candidate and not form.sparse:
            of = f'the form {form.form} is ' if len(effect.forms) > 1 else ''
            why = f': {form.why_aside}' if form.why_aside else ''
            found.append(f'{of}tried by diagnose only when asked for by name{why}')
    return found


def _parameter_text(p: EffectParameter) -> list[str]:
    """Return range and prior of a parameter, in words."""
    note = '' if p.free else '; not fitted'
    by_load = f' at {REFERENCE_LOAD:g} N, more with the load' if p.by_load else ''
    half = p.prior == 'half_normal'
    prior = 'half-normal, scale ' if half else f'normal, {p.prior_mean:g} ± '
    return _wrapped(
        f'{p.name} [{p.unit}]: ',
        f'{p.meaning}; default {p.default:g}, range {p.lower:g} to {p.upper:g}, '
        f'prior {prior}{p.prior_scale:g}{by_load}{note}',
    )


def as_json(effects: Mapping[str, Effect]) -> str:
    """Return the catalogue for programs."""
    records = [
        {
            'name': effect.name,
            **_law(effect),
            'instrument': effect.instrument,
            'confounded_with': dict(effect.confounded_with),
            'incompatible_with': sorted(effect.incompatible_with),
            'candidate': effect.candidate,
            'other_forms': [_law(form) for form in effect.forms[1:]],
        }
        for effect in effects.values()
    ]
    return json.dumps(records, indent=2) + '\n'


def _law(form: Effect) -> dict[str, Any]:
    return {
        'form': form.form,
        'claim': form.claim,
        'symbol': form.symbol,
        'parameters': [
            {'fitted' if name == 'free' else name: value for name, value in vars(p).items()}
            for p in form.parameters
        ],
        'touches': [name for name in TOUCHABLE if name in form.touches],
        'needs': list(form.needs),
        'validity': form.validity,
        'source': form.source,
    }


def touched(effect: Effect) -> str:
    """Return which quantities an effect touches, in words."""
    return ', '.join(name.replace('_', ' ') for name in TOUCHABLE if name in effect.touches)


def _wrapped(head: str, text: str) -> list[str]:
    return textwrap.wrap(
        head + text, 92, initial_indent='    ', subsequent_indent='    ' + ' ' * len(head)
    )
