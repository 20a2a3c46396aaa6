# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Final check of a set of estimates: no published field is ever nan or infinite."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from operator import attrgetter
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import (
    NO_ENTRAPMENT_IN_SIGHT,
    EstimateSet,
    SlipClass,
)

_WHEEL_FIELDS = tuple(
    f.name
    for f in fields(EstimateSet)
    if f.type == 'FloatArray' and f.name not in ('soil', 'soil_std')
)
_SCALAR_FIELDS = tuple(f.name for f in fields(EstimateSet) if f.type == 'float')
_ARRAYS = attrgetter(*_WHEEL_FIELDS, 'soil', 'soil_std')
_SCALARS = attrgetter(*_SCALAR_FIELDS)


class OutputGuard:
    """Holds the last good values of fields that became nan or infinite, with large deviations."""

    def __init__(self, configuration: Configuration) -> None:
        self._blank = blank_estimates(configuration)
        self._good = self._blank

    def repaired(self, stamp: int, outcome: EstimateSet | Exception) -> tuple[EstimateSet, bool]:
        """Return a set that can be published at a stamp [ns], and whether something was held."""
        if isinstance(outcome, Exception):
            return self._held(stamp, self._good, f'{type(outcome).__name__}: {outcome}'), True
        if _is_finite(outcome):
            if outcome.stamp != stamp:
                outcome = replace(outcome, stamp=stamp)
            self._good = outcome
            return outcome, False
        return self._held(stamp, self._repaired(outcome), 'an estimate was NaN'), True

    def _repaired(self, estimates: EstimateSet) -> EstimateSet:
        changes: dict[str, Any] = {}
        for name in _WHEEL_FIELDS:
            values = getattr(estimates, name)
            changes[name] = np.where(np.isfinite(values), values, getattr(self._good, name))
        for name in _SCALAR_FIELDS:
            value = getattr(estimates, name)
            changes[name] = value if math.isfinite(value) else getattr(self._good, name)
        known = np.isfinite(estimates.soil) & np.isfinite(estimates.soil_std)
        changes['soil_names'] = tuple(
            name for name, good in zip(estimates.soil_names, known, strict=True) if good
        )
        changes['soil'] = estimates.soil[known]
        changes['soil_std'] = estimates.soil_std[known]
        slopes = estimates.slip_on_slope
        if slopes is not None and not np.isfinite(slopes).all():
            changes['slip_on_slope'] = self._good.slip_on_slope
        if not estimates.sideways_known.finite:
            changes['sideways'] = self._good.sideways
        return replace(estimates, **changes)

    def _held(self, stamp: int, estimates: EstimateSet, words: str) -> EstimateSet:
        """Return a set with the deviations of unknown quantities."""
        blank = self._blank
        held = replace(
            estimates,
            stamp=stamp,
            slip_class=blank.slip_class,
            faults={**estimates.faults, 'filter': f'restarted: {words}'},
            reasons=blank.reasons,
            forward_velocity_variance=blank.forward_velocity_variance,
            yaw_rate_variance=blank.yaw_rate_variance,
            sideways=estimates.sideways_known.with_unknown_std(blank.normal_load),
            **{name: getattr(blank, name) for name in _WHEEL_FIELDS if name.endswith('_std')},
        )
        self._good = held
        return held


def blank_estimates(configuration: Configuration) -> EstimateSet:
    """Return the set of a rover of which nothing is known yet."""
    wheels, rover = configuration.wheels, configuration.rover
    n = wheels.count
    zeros, ones = np.zeros(n), np.ones(n)
    load = np.full(n, rover.mass * rover.gravity / n)
    return EstimateSet(
        stamp=0,
        slip=zeros,
        slip_std=ones,
        slip_velocity=zeros,
        slip_velocity_std=ones,
        drawbar_pull=zeros,
        drawbar_pull_std=load,
        sinkage=zeros,
        sinkage_std=wheels.radius,
        sinkage_rate=zeros,
        sinkage_rate_std=wheels.radius,
        normal_load=load,
        normal_load_std=load,
        slip_class=np.full(n, SlipClass.UNKNOWN, dtype=np.uint8),
        rim_travel_left=np.full(n, NO_ENTRAPMENT_IN_SIGHT),
        pull_margin=zeros,
        soil_names=(),
        soil=np.zeros(0),
        soil_std=np.zeros(0),
        forward_velocity=0.0,
        forward_velocity_variance=1.0,
        yaw_rate=0.0,
        yaw_rate_variance=1.0,
        stuck=False,
        stuck_probability=zeros,
        time_to_stuck=zeros,
        reasons=('nothing known',) * n,
    )


def _is_finite(estimates: EstimateSet) -> bool:
    numbers = np.concatenate(_ARRAYS(estimates))
    # A sum is cheap and never hides a nan; where it overflows, the long way decides.
    finite = math.isfinite(np.add.reduce(numbers)) or bool(np.isfinite(numbers).all())
    if estimates.slip_on_slope is not None:
        finite = finite and bool(np.isfinite(estimates.slip_on_slope).all())
    return (
        finite and estimates.sideways_known.finite and all(map(math.isfinite, _SCALARS(estimates)))
    )
