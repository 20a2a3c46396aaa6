# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a node keeps over a restart: soil and sensors in a parameter file, the warning beside it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import ros_yaml
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import declared
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import read_text
from wheel_terra_estimator.output_folder import cannot_write, check_target, new_file, try_to_write

_LATEST_STAMP = 2**63 - 1  # [ns]
HEADER = 'Learned by the estimator on the drive; read at its next start.'
"""First line, as a comment, of every soil file."""
STATE = '.state.json'  # behind the name of a soil file: the file that keeps the warning
_COMMENT = f'{HEADER}\nOverwritten each time: keep nothing of your own in it.'
_SECTIONS = ('soil.', 'sensors.')  # of the keys that are written


@dataclass(frozen=True)
class StuckState:
    """The stuck warning when it was last written."""

    stuck: bool = False  # ``~/stuck``
    reason: str = ''
    stamp: int = 0  # stamp of the set that raised or lowered it [ns]; 0 = unknown
    # ``~/stuck_direction``: of the rims that led to it, 1 forward, -1 backward, 0 none, both or
    # unknown
    direction: int = 0


def why_foreign(path: Path) -> str:
    """Return why a file is no soil file of this program; empty where it is one.

    A file with the header that cannot be read otherwise is one; its reader reports that.
    """
    try:
        first, _, _ = read_text(path).partition('\n')
    except UserError as error:
        return f'is not recognised as a soil file ({error})'
    if first.strip() != f'# {HEADER}':
        return f"does not begin with '# {HEADER}', as the soil files of this program do"
    try:
        others = [key for key in ros_yaml.read(path) if not key.startswith(_SECTIONS)]
    except UserError:
        others = []
    return f'holds {others[0]}, which no soil file does' if others else ''


def write_values(soil_file: Path, learned: Mapping[str, Any], overwrite: bool = True) -> None:
    """Write what was learned, as far as it has declared keys and lies in their ranges.

    The file is replaced at once and whole: a power cut leaves the old one or the new one. Raises
    UserError if there is a file that is none of this program, or it cannot be written.
    """
    table = declared()
    values = {
        key: value
        for key, value in learned.items()
        if key in table
        if all(table[key].lower <= v <= table[key].at_most for v in np.ravel(value).tolist())
    }
    with new_file(soil_file, overwrite, foreign=why_foreign) as path:
        ros_yaml.write(path, values, _COMMENT)


def read_state(path: Path) -> StuckState:
    """Return the warning as it was last written; none where there is no such file.

    A warning stands also where its stamp or its direction cannot be used: these are unknown then.
    Raises UserError if the file cannot be used.
    """
    if not path.exists():
        return StuckState()
    try:
        found = json.loads(read_text(path))
        stuck, reason, stamp = found['stuck'], str(found['reason']), found['stamp']
    except (ValueError, TypeError, KeyError, RecursionError):
        raise UserError(f'{path}: is not a state file of the estimator; remove it') from None
    if not isinstance(stuck, bool):
        raise UserError(f'{path}: stuck is neither true nor false; remove the file')
    usable = isinstance(stamp, int) and 0 <= stamp <= _LATEST_STAMP
    direction = found.get('direction', 0)
    return StuckState(
        stuck, reason, stamp if usable else 0, int(direction) if direction in (-1, 0, 1) else 0
    )


def write_state(path: Path, state: StuckState) -> None:
    """Write the warning, at once and whole.

    Raises UserError if there is a file that is no state of the estimator, or it cannot be written.
    """
    with new_file(path, overwrite=True, foreign=_why_no_state) as fresh:
        fresh.write_text(json.dumps(asdict(state)) + '\n', encoding='utf-8')


def _why_no_state(path: Path) -> str:
    try:
        read_state(path)
    except UserError:
        return 'is no state of the estimator'
    return ''


class KeptSoil:
    """Soil, sensor biases and stuck warning of one node in the file of its ``soil_file``.

    A file that may never be written to is refused; what may change (a disk that is full) is told in
    `fault`.

    ``inputs``: other files that the node reads. Raises UserError where the file is none of this
    program, or one of `inputs`.
    """

    def __init__(self, path: Path, inputs: Iterable[Path] = ()) -> None:
        self.path = path.resolve()
        self.fault = ''  # reason why nothing is kept; empty where it is
        self._unusable = ''
        try:
            check_target(self.path, True, inputs, foreign=why_foreign)
        except UserError as error:
            raise UserError(
                f'soil_file: {error}, or leave it out of the files that the node reads: it is '
                'read at the start without that'
            ) from None
        self._state_path = self.path.with_name(f'{self.path.name}{STATE}')
        try:
            try_to_write(self.path)
        except UserError as error:
            self.fault = str(error)

    def values(self, configuration: Configuration) -> dict[str, Any]:
        """Return the parameters that were kept; those that do not suit the rover are left alone."""
        try:
            there = self.path.exists() and self.path.stat().st_size
            kept = ros_yaml.read(self.path) if there else {}
            configuration.replace(kept)
        except UserError as error:
            self._unusable = f'not used, and not written to until it is removed: {error}'
            self.fault = self._unusable
            return {}
        return kept

    def warning(self) -> StuckState:
        """Return the stuck warning that was kept."""
        try:
            return read_state(self._state_path)
        except UserError as error:
            self.fault = str(error)
            return StuckState()

    def save(self, learned: Mapping[str, Any], warning: StuckState) -> None:
        """Write what was learned, if anything, and the warning.

        Raises UserError where it cannot be written, or must not be; also in `fault`.
        """
        try:
            try:
                if learned and self._unusable:
                    raise UserError(self._unusable)
                if learned:
                    write_values(self.path, learned)
            finally:
                write_state(self._state_path, warning)
        except UserError as error:
            self.fault = str(error)
            raise
        self.fault = self._unusable

    def forget_warning(self) -> None:
        """Remove the warning that was kept."""
        try:
            self._state_path.unlink(missing_ok=True)
        except OSError as error:
            self.fault = str(cannot_write(self._state_path, error))
