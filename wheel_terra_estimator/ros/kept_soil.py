# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What a node keeps over a restart, and why it is not kept where it cannot be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from wheel_terra_estimator.configuration import soil_file
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.soil_file import StuckState
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import cannot_write, check_target, try_to_write


class KeptSoil:
    """Soil, sensor biases and stuck warning of one node in the file of its ``soil_file``.

    A file that may never be written to is refused; what may change (a disk that is full) is told in
    `fault`.

    ``inputs``: other files that the node reads. Raises UserError where the file is none of this
    program, or one of `inputs`.
    """

    def __init__(self, path: Path, inputs: Iterable[Path] = ()) -> None:
        self.path = path.resolve()
        self.fault = ''  # why nothing is kept, in words; empty where it is
        self._unusable = ''
        try:
            check_target(self.path, True, inputs, foreign=soil_file.why_foreign)
        except UserError as error:
            raise UserError(
                f'soil_file: {error}, or leave it out of the files that the node reads: it is '
                'read at the start without that'
            ) from None
        self._state_path = soil_file.state_path(self.path)
        try:
            try_to_write(self.path)
        except UserError as error:
            self.fault = str(error)

    def values(self, configuration: Configuration) -> dict[str, Any]:
        """Return the parameters that were kept; those that do not suit the rover are left alone."""
        try:
            kept = soil_file.read_values(self.path)
            configuration.replace(kept)
        except UserError as error:
            self._unusable = f'not used, and not written to before it is removed: {error}'
            self.fault = self._unusable
            return {}
        return kept

    def warning(self) -> StuckState:
        """Return the stuck warning that was kept."""
        try:
            return soil_file.read_state(self._state_path)
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
                    soil_file.write_values(self.path, learned)
            finally:
                soil_file.write_state(self._state_path, warning)
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
