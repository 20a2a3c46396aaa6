# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Common style of the pictures of drives: colours of the classes, unknown values hidden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.style import CLASS_LIGHT, RIM_COLOUR

CLASS_COLOURS = {
    SlipClass.LOW: CLASS_LIGHT[0],
    SlipClass.MODERATE: CLASS_LIGHT[1],
    SlipClass.HIGH: CLASS_LIGHT[2],
    SlipClass.STUCK: CLASS_LIGHT[3],
    SlipClass.UNKNOWN: RIM_COLOUR,
}
"""They differ in grey and for every eye; unknown is drawn thinner."""
BAND = 2.0
"""Half width of the drawn bands in standard deviations."""
SINKAGE_BORDER = 0.5
"""Standard deviation beyond which the sinkage is not known, over the wheel radius [-]."""
NOT_KNOWN = 'not known'


@dataclass(frozen=True)
class Border:
    """Standard deviations beyond which slip [-] and sinkage [m] (scalar or (n,)) are not known."""

    slip: float
    sinkage: float | FloatArray

    @classmethod
    def of(cls, configuration: Configuration) -> Border:
        """Return the border of a rover."""
        radius = np.asarray(configuration.wheels.radius, dtype=float)
        return cls(configuration.filter.class_std, SINKAGE_BORDER * radius)


def known(history: EstimateHistory, quantity: str, border: Border) -> FloatArray:
    """Return a quantity of `WHEEL_FIELDS`, (k, n): nan where it is not known."""
    values = history.values[quantity]
    if quantity == 'slip':
        beyond = history.slip_class == SlipClass.UNKNOWN
        beyond = beyond | (history.values['slip_std'] > border.slip)
    elif quantity == 'sinkage':
        beyond = history.values['sinkage_std'] > border.sinkage
    else:
        return values
    return np.where(beyond, np.nan, values)
