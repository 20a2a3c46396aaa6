# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Layout of the filter's state, with the reasons, and a prediction of it.

===============  =====  ===========================================================================
entry            unit   why it is there
===============  =====  ===========================================================================
speed            m/s    Body speed. The process follows the rim speed (v / rim speed changes only
                        with the terrain) and the accelerometer, weighted by their variances.
                        Speed itself, not the ratio, so that locked wheels can slide.
gravity_bias     m/s^2  Accelerometer bias plus the gravity component by attitude errors: the error
                        of the accelerometer as a sensor of dv/dt.
shear_strength   ln     Common factor on cohesion and tan(phi); wheels of nearly equal load do
                        not separate the two.
shear_modulus    ln     Common factor on K; seen at low slip, as shear_strength is at high slip.
slip_sinkage     -      Added to n1 in N = n0 + n1 |s|.
centroid         -      Common shift of the centroid of the contact stress, as a share of the
                        entrance angle: takes up errors of c1, c2, c3 and of resistances that the
                        torque does not see (bulldozing). Seen by torque against the balance.
slip_per_demand  -      Change of slip by that of the required traction coefficient: the inverse
                        slope of the traction curve. It predicts the slip on a change of slope
                        before the next reference velocity shows it, and is learned from these.
sinkage (n)      m      Rim below the surface.
stiffness (n)    ln     Factor on the bearing modulus, per wheel: wheels enter a patch one by one.
shear_error (n)  ln     Error of the shear model, per wheel, first-order Gauss-Markov over travel:
                        a wheel's own error changes with the place, the common one is that of the
                        law. By it ten equal residuals at constant slip count as one, and the torque
                        of a wheel corrects its pull in another soil.
torque_zero (n)  N m    Zero of each torque sensor, constant. Seen where loads and slip change:
                        the soil's share of a torque goes with the load, the zero does not.
rut_share        -      Share of the rut of the wheel before that stays pressed: a wheel which
                        follows begins there (multi-pass), so that its contact is shorter than its
                        sinkage below the undisturbed surface says. Seen as axles differ.
reference_error  m/s    Only with ``sensors.reference_wander_std``: correlated part of the error of
                        the reference velocity, first-order Gauss-Markov over time, as of a
                        satellite receiver whose error lasts over many readings.
===============  =====  ===========================================================================

Not in it: c and phi separately, n0 beside the stiffness, zeros of sinkage sensors (constant, not
observable beside the soil: they enter the published deviations).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray

(
    SPEED,
    GRAVITY_BIAS,
    SHEAR_STRENGTH,
    SHEAR_MODULUS,
    SLIP_SINKAGE,
    CENTROID,
    SLIP_PER_DEMAND,
    RUT_SHARE,
) = range(8)
_COMMON = 8


@dataclass(frozen=True)
class StateLayout:
    """Where each entry of the state vector is, for n wheels."""

    wheel_count: int
    torque_zeros: bool = False
    reference_wanders: bool = False
    size: int = field(init=False)
    sinkage: slice = field(init=False)
    stiffness: slice = field(init=False)
    shear_error: slice = field(init=False)
    torque_zero: slice = field(init=False)  # empty: they are not in it
    reference_error: int | None = field(init=False)  # None: it is not in it

    def __post_init__(self) -> None:
        n = self.wheel_count
        errors = _COMMON + 3 * n
        each = errors + (n if self.torque_zeros else 0)
        object.__setattr__(self, 'size', each + self.reference_wanders)
        object.__setattr__(self, 'sinkage', slice(_COMMON, _COMMON + n))
        object.__setattr__(self, 'stiffness', slice(_COMMON + n, _COMMON + 2 * n))
        object.__setattr__(self, 'shear_error', slice(_COMMON + 2 * n, errors))
        object.__setattr__(self, 'torque_zero', slice(errors, each))
        object.__setattr__(self, 'reference_error', each if self.reference_wanders else None)

    def considered(
        self, *, forces_show_speed: bool, unread: Sequence[int], blurred: bool
    ) -> list[int]:
        """Return the considered entries (Schmidt 1966), which measurements must not change.

        Their uncertainty counts, but they keep mean and variance; else model errors would be taken
        for them. The speed is one of them unless `forces_show_speed`. Of wheels without a sinkage
        reading (`unread`), sinkage and errors of the shear model are not separable. Where the noise
        of the wheel rates hides how torques depend on soil (`blurred`), the soil is not learned
        from them.
        """
        entries = [] if forces_show_speed else [SPEED]
        for part in (self.sinkage, self.stiffness):
            entries += [part.start + i for i in unread]
        if len(unread) == self.wheel_count:
            entries.append(SLIP_SINKAGE)
        if blurred:
            errors = range(self.shear_error.start, self.shear_error.stop)
            entries += [SHEAR_STRENGTH, SHEAR_MODULUS, CENTROID, *errors]
        return entries


class Prediction(NamedTuple):
    """Predicted mean, transition matrix F and process noise Q; each part fills in its entries."""

    mean: FloatArray  # (size,)
    F: FloatArray  # (size, size)
    Q: FloatArray  # (size, size)

    @classmethod
    def unchanged(cls, mean: FloatArray) -> Prediction:
        """Return the prediction of an unchanged state without process noise."""
        size = len(mean)
        return cls(mean.copy(), np.eye(size), np.zeros((size, size)))
