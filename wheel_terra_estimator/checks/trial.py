# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""How a cure is tried before it is named: found on one half of a recording, applied to the other.

The residual of the evidence has to fall there, and no rival's cure may do as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

LEAST_HALF = 12  # rows of a half that something is found on, at least
LEAST_FALL = 0.7  # residual with a cure over that without, on the other half, at most [-]
LEAST_MARGIN = 0.8  # the same over that with a rival's cure [-]


class Trial(NamedTuple):
    """Residuals without a cure, with it, and with the best rival's, each on the other half."""

    before: float
    after: float
    rival: float = np.inf

    @property
    def falls(self) -> bool:
        """Whether the cure mends something."""
        return self.after < LEAST_FALL * self.before

    @property
    def passes(self) -> bool:
        """Whether the cure mends something and no rival does as well."""
        return self.falls and self.after < LEAST_MARGIN * self.rival

    def words(self, what: str, unit: str) -> str:
        """Return what the trial showed, to be put behind a finding."""
        unit = f' {unit}' if unit else ''
        return f' ({what} {self.before:.3g} -> {self.after:.3g}{unit} on the other half)'


def halves(energy: FloatArray) -> tuple[slice, slice]:
    """Return two stretches of rows that hold as much of an energy (k,) each."""
    total = np.cumsum(energy)
    middle = int(np.searchsorted(total, 0.5 * total[-1])) + 1 if total.size else 0
    return slice(0, middle), slice(middle, total.size)


def tried(fit: Callable[[slice], float], nothing: float, energy: FloatArray) -> Trial:
    """Fit a number on each half of some rows and return what it leaves on the other, the worse one.

    ``nothing`` is the number that changes nothing, ``energy`` (k,) what each row tells of it.
    """
    parts = halves(energy)
    if min(part.stop - part.start for part in parts) < LEAST_HALF:
        return Trial(0.0, np.inf)
    first, second = (fit(part) for part in parts)
    apart = abs(second - first)
    return worst([Trial(abs(second - nothing), apart), Trial(abs(first - nothing), apart)])


def worst(trials: Sequence[Trial]) -> Trial:
    """Return the trial, of those on the halves, in which the cure did least."""
    return max(trials, key=lambda t: t.after / max(min(t.before, t.rival), 1e-12))
