# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A reference whose stamps are late, found while driving by starts and stops.

Rim speeds and reference velocities of some seconds are kept by their stamps. Where the rims changed
clearly, the reference is compared with the rims of so much earlier, for several lags: with honest
stamps none of them fits much better than no lag.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from math import isnan
from typing import NamedTuple

BIN = 100_000_000
"""Rim speeds are means over this [ns of stamps]."""
BLOCK = 60
"""Bins that are judged at once: 6 s."""
LONGEST = 20
"""Greatest lag that is tried [bins]: 2 s."""
LEAST = 3
"""Lag [bins] below which it is chassis, soil or a filter."""
CHANGE = 0.4
"""Change of the rim speed within a block, as a share of it, that shows a lag."""
LEAST_RIM_SPEED = 0.02
"""Rim speed [m/s] that a block must reach."""
LEAST_REFERENCES = 6
FOLLOWS = 0.15
"""Unexplained share of the reference's changes, above which it does not follow the rims."""
CLEAR = 4.0
"""Times that the unexplained share is larger without the lag than with it."""
HONEST = 2.0
"""The same, below which the stamps are right."""


class Verdict(NamedTuple):
    """Whether a block shows a late reference, and by how much [s]."""

    late: bool
    lag: float


@dataclass
class SpeedHistory:
    """Rim speeds and reference velocities since ``begin``; written into, so that a step is cheap.

    The first ``LONGEST`` bins are those before the block that is judged next.
    """

    begin: int | None = None  # [ns]
    rims: list[float] = field(default_factory=list)  # [m/s], one per bin, nan: none yet
    references: list[tuple[int, float]] = field(default_factory=list)  # stamp [ns], [m/s]
    total: float = 0.0
    count: int = 0

    def copy(self) -> SpeedHistory:
        """Return a history that later steps leave alone."""
        return replace(self, rims=list(self.rims), references=list(self.references))

    def advance(self, stamp: int) -> Verdict | None:
        """Close the bins before a stamp [ns]; return what a full block shows, None: nothing."""
        if self.begin is None:
            self.begin = stamp
        verdict = None
        if stamp - self.begin > 4 * BLOCK * BIN:  # a pause
            self._forget(stamp)
        while stamp - self.begin >= (len(self.rims) + 1) * BIN:
            before = self.rims[-1] if self.rims else math.nan
            self.rims.append(self.total / self.count if self.count else before)
            self.total, self.count = 0.0, 0
            if len(self.rims) == LONGEST + BLOCK:
                verdict = self._judged() or verdict
                self._keep_the_last()
        return verdict

    def add_rim(self, speed: float) -> None:
        """Take the mean rim speed of a message [m/s]."""
        self.total += speed
        self.count += 1

    def add_reference(self, stamp: int, forward: float) -> None:
        """Take a reference velocity [m/s] by its stamp [ns]."""
        self.references.append((stamp, forward))

    def _forget(self, stamp: int) -> None:
        self.begin, self.rims, self.references = stamp, [], []
        self.total, self.count = 0.0, 0

    def _keep_the_last(self) -> None:
        assert self.begin is not None
        self.begin += BLOCK * BIN
        self.rims = self.rims[BLOCK:]
        self.references = [r for r in self.references if r[0] >= self.begin + LONGEST * BIN]

    def _judged(self) -> Verdict | None:
        """Compare the references of the block with the rims of each lag before them."""
        known = [rim for rim in self.rims if not isnan(rim)]
        top = max(map(abs, known), default=0.0)
        if len(known) < len(self.rims) or top < LEAST_RIM_SPEED:
            return None
        if max(known) - min(known) < CHANGE * top:
            return None
        assert self.begin is not None
        at = [((stamp - self.begin) // BIN, speed) for stamp, speed in self.references]
        inside = [(int(k), v) for k, v in at if LONGEST <= k < len(self.rims)]
        if len(inside) < LEAST_REFERENCES:
            return None
        left = [self._unexplained(inside, lag) for lag in range(LONGEST + 1)]
        best = min(range(len(left)), key=left.__getitem__)
        if left[best] > FOLLOWS:
            return None
        late = best >= LEAST and left[0] > CLEAR * left[best]
        if not late and left[0] > HONEST * left[best]:
            return None
        return Verdict(late, best * BIN * 1e-9)

    def _unexplained(self, inside: list[tuple[int, float]], lag: int) -> float:
        """Return the share of the reference's scatter that the rims of a lag leave, slip apart."""
        rims = [self.rims[k - lag] for k, _ in inside]
        speeds = [speed for _, speed in inside]
        mean = sum(speeds) / len(speeds)
        scatter = sum((speed - mean) ** 2 for speed in speeds)
        size = sum(rim * rim for rim in rims)
        gain = sum(r * v for r, v in zip(rims, speeds, strict=True)) / size if size else 0.0
        error = sum((v - gain * r) ** 2 for r, v in zip(rims, speeds, strict=True))
        return error / scatter if scatter else math.inf
