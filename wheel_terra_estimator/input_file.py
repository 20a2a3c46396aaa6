# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Files that a command reads whole: regular files of a bounded size, in UTF-8."""

from __future__ import annotations

import stat
from pathlib import Path

from wheel_terra_estimator.errors import UserError

LARGEST_TEXT = 2**20
"""A configuration file has some kilobytes; a text above this size [byte] is none."""

LARGEST_TABLE = 128 * 2**20
"""A table of measurements above this size [byte] has more rows than can be worked on."""


def check_regular(path: Path) -> int:
    """Return the size of a regular file [byte]; never wait for a pipe, never read a device.

    Raises UserError where there is no regular file.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        raise UserError(
            f'{path}: cannot be read: No such file or directory; give the path of one'
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise UserError(f'{path}: cannot be read: {reason}') from None
    if stat.S_ISDIR(found.st_mode):
        raise UserError(f'{path}: cannot be read: it is a folder; give the path of a file')
    if not stat.S_ISREG(found.st_mode):
        raise UserError(f'{path}: cannot be read: it is a pipe or a device; name a regular file')
    return found.st_size


def check_size(path: Path, largest: int | None) -> None:
    """Refuse what is no regular file, or larger than so many bytes (None: of any size).

    Raises UserError where it is, and where there is nothing.
    """
    size = check_regular(path)
    if largest is not None and size > largest:
        raise UserError(
            f'{path}: {size / 2**20:.0f} MB; of such a file at most {largest / 2**20:g} MB are read'
        )


def read_text(path: Path, largest: int = LARGEST_TEXT) -> str:
    """Return the text of a file.

    Raises UserError where it is not there, no regular file, too large, or not UTF-8.
    """
    check_size(path, largest)
    try:
        with path.open('rb') as file:
            content = file.read(largest)
    except OSError as error:
        raise UserError(f'{path}: cannot be read: {error.strerror}') from None
    try:
        return content.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        line = content.count(b'\n', 0, error.start) + 1
        raise UserError(f'{path}: cannot be read: line {line}: not a UTF-8 text') from None
