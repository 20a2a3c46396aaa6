# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a node keeps over a restart: soil and sensors in a parameter file, the warning beside it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wheel_terra_estimator.configuration import ros_yaml
from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.errors import UserError

_LATEST_STAMP = 2**63 - 1  # [ns]
_COMMENT = 'Learned by the estimator on the drive; read at its next start.'


@dataclass(frozen=True)
class StuckState:
    """The stuck warning when it was last written.

    Attributes
    ----------
    stuck : bool
        ``~/stuck``.
    reason : str
        In words.
    stamp : int
        Stamp of the set that raised or lowered it [ns]; 0 = unknown.
    direction : int
        ``~/stuck_direction``: of the rims that led to it, 1 forward, -1 backward, 0 none, both or
        unknown.
    """

    stuck: bool = False
    reason: str = ''
    stamp: int = 0
    direction: int = 0


def state_path(soil_file: Path) -> Path:
    """Return where the warning is kept beside a soil file."""
    return soil_file.with_name(f'{soil_file.name}.state.json')


def read_values(soil_file: Path) -> dict[str, Any]:
    """Return the parameters in a soil file; none where it is not there yet.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    return dict(ros_yaml.read(soil_file)) if soil_file.exists() else {}


def write_values(soil_file: Path, learned: Mapping[str, Any]) -> None:
    """Write what was learned, as far as it has declared keys and lies in their ranges.

    The file is replaced at once and whole: a power cut leaves the old one or the new one.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    table = declared()
    values = {
        key: value
        for key, value in learned.items()
        if key in table and _in_range(value, table[key].lower, table[key].upper)
    }
    partial = soil_file.with_name(f'.{soil_file.name}.{os.getpid()}')
    try:
        ros_yaml.write(partial, values, _COMMENT)
        _replace(partial, soil_file)
    except OSError as error:
        raise UserError(f'{soil_file}: cannot be written ({error.strerror})') from None


def read_state(soil_file: Path) -> StuckState:
    """Return the warning as it was last written; none where there is no such file.

    A warning stands also where its stamp or its direction cannot be used: these are unknown then.

    Raises
    ------
    UserError
        If the file cannot be used.
    """
    path = state_path(soil_file)
    if not path.exists():
        return StuckState()
    try:
        found = json.loads(path.read_text(encoding='utf-8'))
        stuck, reason, stamp = found['stuck'], str(found['reason']), found['stamp']
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        raise UserError(f'{path}: is no state of the estimator; remove it') from None
    if not isinstance(stuck, bool):
        raise UserError(f'{path}: stuck is neither true nor false; remove the file')
    usable = isinstance(stamp, int) and 0 <= stamp <= _LATEST_STAMP
    direction = found.get('direction', 0)
    return StuckState(
        stuck, reason, stamp if usable else 0, int(direction) if direction in (-1, 0, 1) else 0
    )


def write_state(soil_file: Path, state: StuckState) -> None:
    """Write the warning, at once and whole.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    path = state_path(soil_file)
    partial = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        partial.write_text(json.dumps(asdict(state)) + '\n', encoding='utf-8')
        _replace(partial, path)
    except OSError as error:
        raise UserError(f'{path}: cannot be written ({error.strerror})') from None


def clear_state(soil_file: Path) -> None:
    """Forget the warning."""
    state_path(soil_file).unlink(missing_ok=True)


def _replace(partial: Path, path: Path) -> None:
    with partial.open('rb') as file:
        os.fsync(file.fileno())
    partial.replace(path)


def _in_range(value: Any, lower: float, upper: float) -> bool:
    values = value if isinstance(value, (list, tuple)) else [value]
    return all(lower <= item <= upper for item in values)
