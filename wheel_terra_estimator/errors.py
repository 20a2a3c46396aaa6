# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The one error that users are meant to see."""


class UserError(Exception):
    """Input that cannot be used: one line that names file, key or row, and the cure.

    Commands print it on standard error and exit with status 2; the node logs it and ends.
    """

    def __init__(self, line: str) -> None:
        super().__init__(' '.join(line.splitlines()))  # cells and keys may hold line feeds
