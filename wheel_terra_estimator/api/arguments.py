# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the Python interface: a wrong type is reported with an example."""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.errors import UserError


def check_kind(given: Any, kind: Any, what: str, example: str) -> None:
    """Raise UserError, with what would be right, unless an argument is of a kind."""
    if not isinstance(given, kind):
        raise UserError(f'{what} is of type {type(given).__name__}; give {example}')


def one_number(given: Any, what: str) -> float:
    """Return a float or an array of one; raise UserError for more, or for none."""
    if np.size(given) != 1:
        raise UserError(
            f'{what} has {np.size(given)} values; give one number: a model has one wheel, one soil '
            '(rows of a table may have columns of their wheels)'
        )
    return float(np.asarray(given).item())
