# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Entries of the state that the present measurements must not teach (Schmidt 1966: considered).

Their uncertainty counts, but they keep mean and variance: else what the models get wrong would end
up there.
"""

from __future__ import annotations

from collections.abc import Sequence

from wheel_terra_estimator.estimation.filter.state import SLIP_SINKAGE, SPEED, StateLayout


def considered_entries(
    layout: StateLayout, *, settled: bool, opposes_rims: bool, unread: Sequence[int]
) -> list[int]:
    """Return the indices of what is considered, not learned.

    The rut that forms at a start, or is left behind after a spin on the spot (contacts that are not
    `settled`), tells no speed. Where the rover moves against its wheels (`opposes_rims`), their
    forces are the same at any such speed. Of wheels without a sinkage reading (`unread`), sinkage
    and errors of the shear model are not told apart.
    """
    entries = []
    if not settled or opposes_rims:
        entries.append(SPEED)
    for part in (layout.sinkage, layout.stiffness):
        entries += [part.start + i for i in unread]
    if len(unread) == layout.wheel_count:
        entries.append(SLIP_SINKAGE)
    return entries
