# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of effects: those of the modules of this folder, found by themselves.

To add one, put an ``Effect`` into a module here, at its top level, or keep it outside the package
and call ``register`` or ``load_file``.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from wheel_terra_estimator.errors import EFFECT_FILE_MODULE
from wheel_terra_estimator.terramechanics.effects.base import (
    FORM_MARK,
    OUTPUTS,
    STAGES,
    Effect,
    EffectParameter,
    EffectSettings,
    Form,
)

__all__ = [
    'OUTPUTS',
    'Effect',
    'EffectParameter',
    'EffectSettings',
    'Form',
    'by_variant',
    'catalogue',
    'load_file',
    'register',
    'with_defaults',
]

_registered: dict[str, Effect] = {}


@lru_cache(maxsize=1)
def _built_in() -> Catalogue:
    found: dict[str, Effect] = {}
    for listed in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f'{__name__}.{listed.name}')
        found |= {effect.name: effect for effect in _effects_in(module)}
    return Catalogue(dict(sorted(found.items())))


def _effects_in(module: ModuleType) -> list[Effect]:
    """Return the effects at the top level of a module, those in tuples with them."""
    values = (v if isinstance(v, tuple) else (v,) for v in vars(module).values())
    return [effect for group in values for effect in group if isinstance(effect, Effect)]


class Catalogue(Mapping[str, Effect]):
    """All effects by name; ``catalogue['name:form']`` is one of them in that form alone."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self._effects = effects

    def __getitem__(self, key: str) -> Effect:
        """Return the effect, or its form; ``KeyError`` if there is none."""
        name, _, form = key.partition(FORM_MARK)
        effect = self._effects[name]
        if not form:
            return effect
        try:
            return effect.in_form(form)
        except ValueError as error:
            raise KeyError(str(error)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)


def catalogue() -> Catalogue:
    """Return all effects by name: the built-in ones, then the registered ones."""
    return Catalogue({**_built_in(), **_registered}) if _registered else _built_in()


def by_variant(settings: EffectSettings) -> dict[str, dict[str, Any]]:
    """Return the settings with the entry ``form`` put into the key: numbers are all that is left.

    ``{'multipass': {'form': 'rut', 'rut': 0.01}}`` becomes ``{'multipass:rut': {'rut': 0.01}}``;
    the first form keeps the plain name. Keys that name a form already stay. Raises ValueError for a
    form that the effect does not have.
    """
    known = catalogue()
    plain: dict[str, dict[str, Any]] = {}
    for name, values in settings.items():
        numbers = dict(values)
        form = numbers.pop('form', None)
        plain[name if form is None else known[name].in_form(form).name] = numbers
    return plain


def register(effect: Effect) -> Effect:
    """Add an effect to the catalogue; its name must be new (registering it again is fine)."""
    known = catalogue().get(effect.name)
    if effect.name in _built_in() or (known is not None and known != effect):
        raise ValueError(f'effect {effect.name} is in the catalogue already; choose another name')
    _registered[effect.name] = effect
    return effect


def load_file(path: str | Path) -> list[Effect]:
    """Run a Python file and register every ``Effect`` that it defines at its top level.

    Raises ValueError if the file cannot be run, defines no effect, or uses a name that is taken.
    """
    path = Path(path)
    spec = importlib.util.spec_from_file_location(f'{EFFECT_FILE_MODULE}{path.stem}', path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f'{path}: not a Python file')
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise ValueError(f'{path}: {type(error).__name__}: {error}') from error
    effects = _effects_in(module)
    if not effects:
        raise ValueError(f'{path}: defines no Effect')
    for effect in effects:
        _check_terms(path, effect)
        known = _registered.get(effect.name)
        # A file loaded twice makes equal effects with other function objects: the newer one stands.
        if known is not None and known.claim == effect.claim:
            del _registered[effect.name]
        register(effect)
    return effects


def _check_terms(path: Path, effect: Effect) -> None:
    for term in filter(None, (getattr(form, stage) for form in effect.forms for stage in STAGES)):
        taken = len(inspect.signature(term).parameters)
        if taken != 2:
            raise ValueError(
                f'{path}: a term of {effect.name} takes (contact, parameters), '
                f'not {taken} arguments'
            )


def with_defaults(settings: EffectSettings) -> dict[str, dict[str, Any]]:
    """Return the settings by variant (see ``by_variant``), parameters left out at their defaults.

    Names and ranges are checked where settings are read, in ``configuration.reader``.
    """
    known = catalogue()
    return {
        key: {**known[key].defaults(), **values} for key, values in by_variant(settings).items()
    }
