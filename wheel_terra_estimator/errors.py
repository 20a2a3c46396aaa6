# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The one error that users are meant to see, and which others are not the program's own."""

from __future__ import annotations

import errno
import traceback

EFFECT_FILE_MODULE = 'wheel_terra_effects_'
"""Begins the name of the module that a user's file of effects becomes."""
_REFUSED = frozenset({errno.EACCES, errno.EPERM})  # a permission is missing
_NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO})  # the disk
_LIMITS = frozenset({errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN})  # of the machine
_NAMES = frozenset({errno.ENAMETOOLONG, errno.ELOOP, errno.ESTALE})  # that cannot be used


class UserError(Exception):
    """Input that cannot be used: one line that names file, key or row, and the remedy.

    Commands print it on standard error and exit with status 2; the node logs it and ends.
    """

    def __init__(self, line: str) -> None:
        super().__init__(' '.join(line.splitlines()))  # cells and keys may hold line feeds


class ConfigurationWarning(UserWarning):
    """A number that looks as if it were in another unit, or a key of an earlier version."""


def outside_cause(error: BaseException) -> str | None:
    """Return in words what outside the program an error comes from; None: the program itself."""
    if isinstance(error, UserError):
        return str(error)
    words = f'{type(error).__name__}: {error}'
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        if str(frame.f_globals.get('__name__')).startswith(EFFECT_FILE_MODULE):
            return f'{frame.f_code.co_filename}, line {line}: {words}; correct that effect file'
    if isinstance(error, MemoryError):
        return f'not enough memory ({error})'
    if isinstance(error, OSError) and error.errno in _REFUSED | _NO_ROOM | _LIMITS | _NAMES:
        place = error.filename or 'output or a temporary file'
        cure = 'change its permissions' if error.errno in _REFUSED else 'make room'
        return f'{place}: {error.strerror}; {cure} or use another place'
    if isinstance(error, UnicodeEncodeError) and error.reason == 'surrogates not allowed':
        return f'a name that is not UTF-8 ({error.object[:200]!a}): rename that file or folder'
    return None
