# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ways to switch off a part of the estimator for a while, from outside, by name.

A switch names what it changes; what is not there is an error, so that the list of treatments
cannot outlive them unseen.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import wheel_terra_estimator.estimation as estimation

Switch = Callable[[], AbstractContextManager[None]]
ROOT = 'wheel_terra_estimator.estimation.'


def tuned(place: str, **values: Any) -> Switch:
    """Return a switch that gives a tuning dataclass (`module:Class`) other numbers.

    The defaults of every function and every name of the estimator that hold an instance of the
    class are replaced, wherever the instance stands.
    """

    @contextlib.contextmanager
    def switched() -> Iterator[None]:
        kind = _object(place)
        swap = _swapping(lambda v: replace(v, **values) if isinstance(v, kind) else v)
        undo = [u for holder in _holders() for u in swap(holder)]
        if not undo:
            raise LookupError(f'{place}: no default holds an instance of it')
        try:
            yield
        finally:
            for restore in reversed(undo):
                restore()

    return switched


def patched(place: str, value: Any) -> Switch:
    """Return a switch that replaces a function, a method or a constant (`module:name.name`)."""

    @contextlib.contextmanager
    def switched() -> Iterator[None]:
        module, _, path = place.partition(':')
        *parents, name = path.split('.')
        owner: Any = importlib.import_module(ROOT + module)
        for parent in parents:
            owner = getattr(owner, parent)
        kept = inspect.getattr_static(owner, name)
        setattr(owner, name, value)
        try:
            yield
        finally:
            setattr(owner, name, kept)

    return switched


def both(*switches: Switch) -> Switch:
    """Return a switch that throws several."""

    @contextlib.contextmanager
    def switched() -> Iterator[None]:
        with contextlib.ExitStack() as stack:
            for switch in switches:
                stack.enter_context(switch())
            yield

    return switched


def without_sign(name: str) -> Switch:
    """Return a switch that leaves a stuck sign out."""

    @contextlib.contextmanager
    def switched() -> Iterator[None]:
        signs = _object('judgement.stuck.signs:SIGNS')
        left = tuple(sign for sign in signs if sign.name != name)
        if len(left) == len(signs):
            raise LookupError(f'no sign {name!r}')
        swap = _swapping(lambda value: left if value is signs else value)
        undo = [u for holder in _holders() for u in swap(holder)]
        try:
            yield
        finally:
            for restore in reversed(undo):
                restore()

    return switched


def _object(place: str) -> Any:
    module, _, name = place.partition(':')
    return getattr(importlib.import_module(ROOT + module), name)


@functools.cache
def _modules() -> tuple[Any, ...]:
    found = pkgutil.walk_packages(estimation.__path__, ROOT)
    return tuple(importlib.import_module(info.name) for info in found)


@functools.cache
def _holders() -> tuple[Any, ...]:
    """Return modules, and the functions of the estimator with those of its classes."""
    functions = []
    for module in _modules():
        for member in vars(module).values():
            if getattr(member, '__module__', None) != module.__name__:
                continue
            members = vars(member).values() if inspect.isclass(member) else (member,)
            # A class method wraps its function.
            functions += [getattr(value, '__func__', value) for value in members]
    return (*_modules(), *(f for f in functions if inspect.isfunction(f)))


def _swapping(other: Callable[[Any], Any]) -> Callable[[Any], list[Callable[[], None]]]:
    """Return what replaces the defaults or names of a holder, and gives what undoes it."""

    def swap(holder: Any) -> list[Callable[[], None]]:
        undo: list[Callable[[], None]] = []
        if inspect.isfunction(holder):
            defaults, by_name = holder.__defaults__ or (), holder.__kwdefaults__ or {}
            if any(other(v) is not v for v in (*defaults, *by_name.values())):
                undo.append(lambda: setattr(holder, '__defaults__', defaults or None))
                undo.append(lambda: setattr(holder, '__kwdefaults__', by_name or None))
                holder.__defaults__ = tuple(map(other, defaults)) or None
                holder.__kwdefaults__ = {k: other(v) for k, v in by_name.items()} or None
            return undo
        for name, value in list(vars(holder).items()):
            new = other(value)
            if new is not value:
                undo.append(functools.partial(setattr, holder, name, value))
                setattr(holder, name, new)
        return undo

    return swap
