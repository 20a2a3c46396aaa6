# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a bag's ``metadata.yaml`` states; it is compared with the files, never relied on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, TypeVar

from yaml import YAMLError

from wheel_terra_estimator.configuration.ros_yaml import TEXTS, load
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import read_text

NAME = 'metadata.yaml'
LARGEST = 4 * 2**20  # greatest size of the file [byte]; a thousand topics need one megabyte

MOST_VALUES = 200_000  # keys and values; a topic has about a hundred

_LONGEST_NUMBER = 19  # digits
Kind = TypeVar('Kind')


@dataclass(frozen=True)
class Metadata:
    """Files and messages per topic, and faults of the file as text."""

    files: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)
    fault: str = ''


def read(folder: Path) -> Metadata:
    """Read the metadata of a bag; what cannot be used is a fault, not an error."""
    path = folder / NAME
    if not path.exists():
        return Metadata(fault=f'{NAME} is missing')
    try:
        # All values as text: no merge keys, no numbers of thousands of digits.
        document = load(read_text(path, LARGEST), TEXTS, aliases=True, most=MOST_VALUES)
        information = _a(dict, _a(dict, document)['rosbag2_bagfile_information'])
        counts: Counter[str] = Counter()
        for entry in _a(list, information['topics_with_message_count']):
            name = _a(dict, _a(dict, entry)['topic_metadata'])['name']
            number = _a(str, entry['message_count'])
            if len(number) > _LONGEST_NUMBER:
                raise ValueError
            counts[_a(str, name)] += int(number)
        files = _a(list, information['relative_file_paths'])
        names = tuple(PurePath(_a(str, file)).name for file in files)
        return Metadata(names, dict(counts))
    except KeyError as error:
        return Metadata(fault=f'{NAME} was ignored (it has no {error.args[0]})')
    except UserError as error:
        return Metadata(fault=f'{NAME} was ignored ({str(error).removeprefix(f"{path}: ")})')
    except (YAMLError, ValueError, TypeError, RecursionError):
        return Metadata(fault=f'{NAME} was ignored (it cannot be understood)')


def _a(kind: type[Kind], value: Any) -> Kind:
    """Return a value that is of a kind."""
    if not isinstance(value, kind):
        raise TypeError
    return value
