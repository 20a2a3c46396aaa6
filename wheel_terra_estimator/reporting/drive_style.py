# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What pictures of drives have in common: colours of the classes, bands, slip that is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.history import EstimateHistory
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.reporting.style import RIM_COLOUR

CLASS_COLOURS = {
    SlipClass.LOW: '#efe3a8',
    SlipClass.MODERATE: '#e9a94b',
    SlipClass.HIGH: '#c4552d',
    SlipClass.STUCK: '#6b1238',
    SlipClass.UNKNOWN: RIM_COLOUR,
}
"""Darker is worse: they differ in grey and for every eye; unknown is drawn thinner."""
BAND = 2.0
"""Half width of the drawn bands in standard deviations."""
NEVER_KNOWN = 1.0
"""Standard deviation of a slip of which nothing is known [-]."""


def drawn_slip(history: EstimateHistory) -> NDArray[np.float64]:
    """Return the slip to draw, (k, n): nan where nothing is known of it."""
    unknown = history.slip_class == SlipClass.UNKNOWN
    unknown &= history.values['slip_std'] >= NEVER_KNOWN
    return np.where(unknown, np.nan, history.values['slip'])
