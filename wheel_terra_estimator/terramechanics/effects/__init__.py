# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of effects: one module of this folder per effect, found by itself.

To add one, put a module with an ``EFFECT`` here, or keep it outside the package and call
``register`` or ``load_file``. Nothing else in the package lists effects by name.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Mapping
from functools import lru_cache
from numbers import Real
from pathlib import Path
from types import MappingProxyType

from wheel_terra_estimator.terramechanics.effects.base import (
    OUTPUTS,
    Effect,
    EffectParameter,
    EffectSettings,
)

__all__ = [
    'OUTPUTS',
    'Effect',
    'EffectParameter',
    'EffectSettings',
    'catalogue',
    'check_settings',
    'load_file',
    'register',
]

_registered: dict[str, Effect] = {}


@lru_cache(maxsize=1)
def _built_in() -> Mapping[str, Effect]:
    found = {}
    for module in pkgutil.iter_modules(__path__):
        effect = getattr(importlib.import_module(f'{__name__}.{module.name}'), 'EFFECT', None)
        if isinstance(effect, Effect):
            found[effect.name] = effect
    return MappingProxyType(found)


def catalogue() -> Mapping[str, Effect]:
    """Return all effects by name: the built-in ones, then the registered ones."""
    return MappingProxyType({**_built_in(), **_registered})


def register(effect: Effect) -> Effect:
    """Add an effect to the catalogue; its name must be new (registering it again is fine)."""
    known = catalogue().get(effect.name)
    if effect.name in _built_in() or (known is not None and known != effect):
        raise ValueError(f'effect {effect.name} is in the catalogue already; choose another name')
    _registered[effect.name] = effect
    return effect


def load_file(path: str | Path) -> list[Effect]:
    """Run a Python file and register every ``Effect`` that it defines at its top level.

    Raises
    ------
    ValueError
        If the file cannot be run, defines no effect, or uses a name that is taken.
    """
    path = Path(path)
    spec = importlib.util.spec_from_file_location(f'wheel_terra_effects_{path.stem}', path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f'{path}: not a Python file')
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ValueError(f'{path}: {type(error).__name__}: {error}') from error
    effects = [value for value in vars(module).values() if isinstance(value, Effect)]
    if not effects:
        raise ValueError(f'{path}: defines no Effect')
    for effect in effects:
        known = _registered.get(effect.name)
        # A file loaded twice makes equal effects with other function objects: the newer one stands.
        if known is not None and known.claim == effect.claim:
            del _registered[effect.name]
        register(effect)
    return effects


def check_settings(settings: EffectSettings) -> dict[str, dict[str, float]]:
    """Return the settings with defaults filled in.

    Raises
    ------
    ValueError
        For an unknown effect or parameter, a value outside its range, or two effects that must
        not be on together; the message names them.
    """
    known = catalogue()
    full: dict[str, dict[str, float]] = {}
    for name, values in settings.items():
        if name not in known:
            raise ValueError(f'effect {name} is not in the catalogue: {", ".join(known)}')
        effect = known[name]
        full[name] = effect.defaults()
        if not isinstance(values, Mapping):
            raise ValueError(f'effects.{name} is {values!r}; allowed is a mapping of parameters')
        for key, value in values.items():
            if key not in full[name]:
                raise ValueError(
                    f'effect {name} has no parameter {key}; it has {", ".join(full[name])}'
                )
            parameter = effect.parameter(key)
            if not isinstance(value, Real):
                raise ValueError(f'effects.{name}.{key} is {value!r}; allowed is a number')
            if not parameter.lower <= value <= parameter.upper:
                raise ValueError(
                    f'effects.{name}.{key} is {value:g}; allowed is '
                    f'[{parameter.lower:g}, {parameter.upper:g}] {parameter.unit}'
                )
            full[name][key] = float(value)
        for other in sorted(effect.incompatible_with & settings.keys()):
            raise ValueError(f'effects {name} and {other} exclude each other: switch one off')
    return full
