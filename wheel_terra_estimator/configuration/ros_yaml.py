# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""ROS parameter files without ROS: the same values that ``rcl_yaml_param_parser`` would read.

PyYAML follows YAML 1.1, ROS follows C: ``1.8e6`` is a number there, ``010`` is eight, ``1_000`` a
string. The rules of ROS are applied to every plain scalar, by a loader class of our own; PyYAML's
global loaders stay as they are. No document can blow up: `load` bounds depth and number of values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import read_text

DEEPEST = 32  # levels of a document; ROS parameter files have about five

MOST_VALUES = 20_000  # keys and values of a document; the largest of ours has about 400

TEXTS: Any = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)  # scalars as they stand there


def load(text: str, loader: Any, aliases: bool = False, most: int = MOST_VALUES) -> Any:
    """Return the document in a text.

    ``text``: the document; its size is bounded by whoever read it. ``aliases``: whether ``*name``
    is allowed. ROS parameter files have none, and a few of them can stand for billions of values.
    Raises yaml.YAMLError for no YAML, too deep a nest, too many values, or an alias.
    """
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=TEXTS)):  # however deep
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


def _error(event: Any, problem: str) -> yaml.YAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


NODE_NAME = 'wheel_terra_estimator'

Scalar: TypeAlias = 'bool | int | float | str'
Value: TypeAlias = 'Scalar | list[Any]'

_TRUE = frozenset({'Y', 'y', 'yes', 'Yes', 'YES', 'true', 'True', 'TRUE', 'on', 'On', 'ON'})
_FALSE = frozenset({'N', 'n', 'no', 'No', 'NO', 'false', 'False', 'FALSE', 'off', 'Off', 'OFF'})
LONGEST_INTEGER = 24  # digits, leading zeros too: those of 64 bits to the base 8, and the prefix

_NULL = frozenset({'', '~', 'null', 'Null', 'NULL'})
_INTEGER = re.compile(r'[+-]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
_DECIMAL = re.compile(r'[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?')
_HEXADECIMAL = re.compile(r'[+-]?0[xX][0-9a-fA-F]+\.?[0-9a-fA-F]*([pP][+-]?[0-9]+)?')
_NOT_FINITE = re.compile(r'([+-]?)\.?(inf(?:inity)?|nan)', re.IGNORECASE)
_OUR_SECTION = re.compile(rf'/\*\*|(.*/)?{NODE_NAME}')

# That of libyaml where it is compiled in: the parser of ROS itself, and four times as fast.
_SafeLoader: Any = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)


class _RosLoader(_SafeLoader):
    """Safe loader whose plain scalars follow ROS; resolvers are its own."""

    yaml_implicit_resolvers: dict[str, list[Any]] = {}  # noqa: RUF012  (PyYAML's attribute)


def _construct_mapping(loader: _RosLoader, node: yaml.MappingNode) -> dict[str, Any]:
    mapping: dict[str, Any] = {}
    for key_node, value_node in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise yaml.MarkedYAMLError(problem='a key is not a word', problem_mark=node.start_mark)
        if key_node.value in mapping:
            raise yaml.MarkedYAMLError(
                problem=f"'{key_node.value}' is given twice", problem_mark=key_node.start_mark
            )
        mapping[key_node.value] = loader.construct_object(value_node, deep=True)
    return mapping


_RosLoader.add_constructor(
    'tag:yaml.org,2002:str',
    lambda loader, node: node.value if node.style else plain_scalar(node.value),
)
_RosLoader.add_constructor('tag:yaml.org,2002:map', _construct_mapping)


def plain_scalar(text: str) -> Scalar | None:
    """Return the value that ROS gives to an unquoted scalar.

    Returns the value; numbers as C's ``strtoll`` (base 0) and ``strtod`` read them. None stands for
    none, which ROS parameter files cannot hold.
    """
    if text in _NULL:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if _INTEGER.fullmatch(text):
        digits = text.lstrip('+-')
        if len(digits) > LONGEST_INTEGER:
            return _in_range(float, text) if _DECIMAL.fullmatch(text) else text
        if digits[:2] in ('0x', '0X'):
            value = int(digits, 16)
        else:
            value = int(digits, 8 if digits.startswith('0') else 10)
        value = -value if text.startswith('-') else value
        if -(2**63) <= value < 2**63:
            return value
    if _DECIMAL.fullmatch(text):
        return _in_range(float, text)
    if _HEXADECIMAL.fullmatch(text):
        return _in_range(float.fromhex, text)
    special = _NOT_FINITE.fullmatch(text)
    if special:
        return float(special[1] + special[2])
    return text


def _in_range(read: Callable[[str], float], text: str) -> float | str:
    """Return a number; its text where it is too large or too small for one, as ROS does."""
    try:
        value = read(text)
    except OverflowError:
        return text
    mantissa = re.split('[pP]' if 'x' in text.lower() else '[eE]', text)[0]
    vanished = value == 0.0 and mantissa.strip('+-0xX.') != ''
    return text if math.isinf(value) or vanished else value


def parse_value(text: str, source: str) -> Value:
    """Return the value of ``text`` as it would be read behind a key; errors name ``source``."""
    value = _loaded(text, source)
    return _checked(value if text.strip() else None, source)


def _loaded(text: str, source: object) -> Any:
    try:
        return load(text, _RosLoader)
    except yaml.YAMLError as error:
        raise UserError(f'{source}: {in_words(error)}') from None


def read(path: Path) -> dict[str, Value]:
    """Return the parameters that a file gives to the estimator, keys dotted.

    Sections ``/**``, ``wheel_terra_estimator`` and ``/any/ns/wheel_terra_estimator`` count, in this
    order (the narrower one wins, as in ROS); sections of other nodes are passed over. A file of
    keys alone, dotted or nested, is read as if it stood below ``/**``; the node's ``--params-file``
    needs the section. Raises UserError if the file cannot be read, is not YAML or not a parameter
    file.
    """
    document = _loaded(read_text(path), path)
    if not isinstance(document, Mapping):
        raise UserError(
            f"{path}: no parameters; give lines 'rover.mass: 22.0', or a ROS parameter file, which "
            "starts with '/**:' and 'ros__parameters:'"
        )
    if _is_plain(document):
        return flatten(document, str(path))
    found = list(_sections(document, '', path))
    ours = [section for section in found if _OUR_SECTION.fullmatch(section[0])]
    if not ours:
        there = ', '.join(f"'{name}'" for name, _ in found) or 'none'
        raise UserError(
            f"{path}: no section for this node: sections there: {there}; use '/**:' with "
            "'ros__parameters:' below it"
        )
    values: dict[str, Value] = {}
    for _, parameters in sorted(ours, key=lambda section: section[0] != '/**'):
        values.update(flatten(parameters, str(path)))
    return values


def sections(path: Path) -> list[str]:
    """Return the names of the sections of a parameter file, as their nodes are called.

    Raises UserError if the file cannot be read, or is no parameter file of ROS.
    """
    return [name for name, _ in _sections(_loaded(read_text(path), path) or {}, '', path)]


def flatten(parameters: Mapping[str, Any], source: str, prefix: str = '') -> dict[str, Value]:
    """Return nested mappings as one mapping with dotted keys, values checked for ROS's types."""
    flat: dict[str, Value] = {}
    for name, value in parameters.items():
        key = f'{prefix}{name}'
        if isinstance(value, Mapping):
            inner = flatten(value, source, f'{key}.')
        else:
            inner = {key: _checked(value, f'{source}: {key}')}
        for inner_key, inner_value in inner.items():
            if inner_key in flat:
                raise UserError(f'{source}: {inner_key} is given twice')
            flat[inner_key] = inner_value
    return flat


def write(path: Path, values: Mapping[str, Value], comment: str = '') -> None:
    """Write a parameter file for any node name, with a comment on top."""
    path.write_text(as_text(values, comment), encoding='utf-8')


def as_text(
    values: Mapping[str, Value], comment: str, notes: Mapping[str, str] | None = None
) -> str:
    """Return the text of a parameter file; ``notes``: key -> comment above it."""
    lines = [f'# {line}'.rstrip() for line in comment.splitlines()]
    lines += ['/**:', '  ros__parameters:']
    for key, value in values.items():
        lines += [f'    # {notes[key]}'] if notes and key in notes else []
        lines.append(f'    {key}: {format_value(value)}')
    return '\n'.join(lines) + '\n'


def format_value(value: Value) -> str:
    """Return a value as it stands in a parameter file, read back to the same value and type."""
    if isinstance(value, (list, tuple)):
        return '[' + ', '.join(format_value(item) for item in value) + ']'
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        escaped = ''.join(_ESCAPES.get(character, character) for character in value)
        return f'"{escaped}"'
    return str(value) if isinstance(value, int) else repr(float(value))


_ESCAPES = {'\\': '\\\\', '"': '\\"', '\n': '\\n', '\t': '\\t', '\r': '\\r'}


def _is_plain(document: Mapping[str, Any]) -> bool:
    """Return whether a file holds keys alone, without a section of ROS."""

    def of_ros(below: Mapping[str, Any]) -> bool:
        parts = (value for value in below.values() if isinstance(value, Mapping))
        return 'ros__parameters' in below or any(map(of_ros, parts))

    named = any(name.startswith('/') or name == NODE_NAME for name in document)
    return bool(document) and not named and not of_ros(document)


def _sections(
    document: Mapping[str, Any], prefix: str, path: Path
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Walk namespaces down to each ``ros__parameters``."""
    for name, below in document.items():
        section = f'{prefix}{name}'
        if not isinstance(below, Mapping):
            raise UserError(f"{path}: '{section}' has no 'ros__parameters:' below it")
        if 'ros__parameters' in below:
            parameters = below['ros__parameters']
            if not isinstance(parameters, Mapping):
                raise UserError(f"{path}: 'ros__parameters' of '{section}' holds no keys")
            yield section, parameters
        yield from _sections(
            {key: value for key, value in below.items() if key != 'ros__parameters'},
            f'{section.rstrip("/")}/',
            path,
        )


def _checked(value: Any, source: str) -> Value:
    """Refuse what a ROS parameter cannot be."""
    if value is None:
        raise UserError(f'{source} has no value; ROS parameters know no null')
    if not isinstance(value, list):
        if isinstance(value, (bool, int, float, str)):
            return value
        raise UserError(f'{source}: only scalars and flat lists are allowed')
    if not value:
        raise UserError(f'{source} is an empty list, which ROS parameter files cannot hold')
    for item in value:
        if item is None:
            raise UserError(f'{source} holds an empty entry; ROS parameters know no null')
        if not isinstance(item, (bool, int, float, str)):
            raise UserError(f'{source} is a nested list; only flat lists are allowed')
    kinds = {type(item) for item in value}
    if kinds == {int, float}:
        remedy = ', '.join(format_value(float(item)) for item in value)
        raise UserError(f'{source} mixes integers and numbers, which ROS refuses; write [{remedy}]')
    if len(kinds) > 1:
        raise UserError(f'{source} mixes types in one list: {value}')
    return value


def in_words(error: yaml.YAMLError) -> str:
    """Return a YAML error in one line, with the line number."""
    mark = getattr(error, 'problem_mark', None)
    problem = getattr(error, 'problem', None) or 'cannot be understood'
    context = getattr(error, 'context', None)
    words = f'{problem} ({context})' if context else str(problem)
    if 'cannot start any token' in words:
        words += '; indent with spaces, not tabs'
    where = f'line {mark.line + 1}: ' if mark is not None else ''
    return f'not valid YAML: {where}{words}'.replace('\n', ' ')
