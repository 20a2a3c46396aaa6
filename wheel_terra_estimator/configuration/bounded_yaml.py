# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""YAML that cannot blow up: bounded in depth and number of values, without aliases."""

from __future__ import annotations

from typing import Any

import yaml
from yaml import YAMLError

__all__ = ['YAMLError', 'load', 'load_texts']

DEEPEST = 32  # levels of a document; ROS parameter files have about five

MOST_VALUES = 20_000  # keys and values of a document; the largest of ours has about 400

_EVENTS: Any = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)


def load(text: str, loader: Any, aliases: bool = False, most: int = MOST_VALUES) -> Any:
    """Return the document in a text.

    ``text``: the document; its size is bounded by whoever read it. ``aliases``: whether ``*name``
    is allowed. ROS parameter files have none, and a few of them can stand for billions of values.
    Raises yaml.YAMLError for no YAML, too deep a nest, too many values, or an alias.
    """
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=_EVENTS)):  # however deep
        if count > most:
            raise _error(event, f'more than {most} keys and values')
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEEPEST:
                raise _error(event, f'nested deeper than {DEEPEST} levels')
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.AliasEvent) and not aliases:
            raise _error(event, f'*{event.anchor} is an alias, which ROS refuses; write it out')
    return yaml.load(text, Loader=loader)


def load_texts(text: str, most: int = MOST_VALUES) -> Any:
    """Return the document in a text, every scalar as it stands there; aliases are allowed."""
    return load(text, _EVENTS, True, most)


def _error(event: Any, problem: str) -> yaml.YAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
