# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""What an explanation leaves, and whether its soil can be believed: absolute tests of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc  # scipy.stats takes longer to load than a diagnosis

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.fitting.evidence import log_sum
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.problem import Problem
from wheel_terra_estimator.discrepancy.selection.weights import Selection

# Misfit that even the best floor leaves improbable.
IMPROBABLE = 1e-3
# Stated deviations by which no configured number may be pulled: a chance of 5 % for the farthest of
# seven, of which 15 % are known 2.5 times worse than stated (``coordinates.BELIEVED_WIDTHS``).
LARGEST_Z_SCORE = 5.0


@dataclass(frozen=True)
class Remainder:
    """What one explanation leaves."""

    probability: float  # that a smooth misfit beyond the model-error floor is left
    # That any structural error of more than one per cent is left, floor included
    probability_of_any: float
    amplitude: float  # most probable amplitude of the structural error, share of the range
    p_value: float  # of the whole misfit under the best floor (chi-square)
    z_score: float  # farthest of a configured number, in its stated deviations

    @property
    def accounted_for(self) -> bool:
        """True where floor and noise, and numbers that can be believed, are enough."""
        return self.p_value > IMPROBABLE and self.z_score < LARGEST_Z_SCORE

    @property
    def only_far(self) -> bool:
        """True where everything fits, but with a number that cannot be believed."""
        return self.significant and self.probability <= 0.5 and self.p_value > IMPROBABLE

    @property
    def significant(self) -> bool:
        """True where something is left that wants a name."""
        return self.probability > 0.5 or not self.accounted_for

    @property
    def noticeable(self) -> bool:
        """True where noise alone is not enough: also a misfit within the model-error floor."""
        return self.significant or self.probability_of_any > 0.8


def remainder(selection: Selection, index: int, problem: Problem) -> Remainder:
    """Test what explanation number ``index`` leaves of the cells."""
    explanation = selection.explanations[index]
    joint = selection.log_joint[index]
    share = float(np.exp(log_sum(joint[selection.unexplained]) - log_sum(joint)))
    top = int(np.argmax(joint))
    real = np.array([floor.largest >= 0.01 for floor in selection.floors])
    any_share = float(np.exp(log_sum(joint[real]) - log_sum(joint)))
    quiet = [k for k, floor in enumerate(selection.floors) if not floor.unexplained]
    best = quiet[int(np.argmax(joint[quiet]))]
    floor = selection.floors[best]
    variance = problem.variance(floor.amplitude)
    # A reference has no misfit that asks for a name: its structural error moves the soil as well.
    z_score = largest_z_score(explanation.fitted) if selection.unexplained.any() else 0.0
    return Remainder(
        share,
        any_share,
        selection.floors[top].largest,
        chi_square_p_value(explanation.fitted, variance),
        z_score,
    )


def chi_square_p_value(fitted: Fit, variance: FloatArray) -> float:
    """P-value of the whole misfit, parameters and their priors integrated out.

    Under the hypothesis, residual and the soil's prior pull together are chi-square with one degree
    of freedom per cell, however many soil parameters were fitted; an effect's strength takes one.
    """
    target = fitted.residual + fitted.jacobian @ fitted.u
    weighted = fitted.jacobian / variance[:, None]
    strength = np.array([c.role == 'strength' for c in fitted.coordinates])
    precision = weighted.T @ fitted.jacobian + np.diag(np.where(strength, 1e-9, 1.0))
    right = weighted.T @ target
    square = float(target @ (target / variance) - right @ np.linalg.solve(precision, right))
    return float(chdtrc(len(target) - strength.sum(), square))


def largest_z_score(fitted: Fit) -> float:
    """Return the largest shift of a configured number in its stated deviations; 0 if none is free.

    Soil numbers and parameters of effects that are on: a fit may hide what is missing in either. A
    sum over all numbers would dilute one huge shift, by which an effect outside the catalogue that
    works like another soil (friction that softens with slip) shows itself.
    """
    believed = zip(fitted.coordinates, fitted.u, strict=True)
    return max((abs(c.stated * float(u)) for c, u in believed if c.role == 'believed'), default=0.0)
