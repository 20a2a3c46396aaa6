# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The forward model for many hypotheses at once.

A hypothesis is a set of free parameters. All hypotheses, and all one-sided differences for their
Jacobians, are rows of one array, so that the contact integral is evaluated a few times instead of
thousands of times. The physics is that of ``terramechanics``; nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.discrepancy.parameters import Coordinate
from wheel_terra_estimator.terramechanics import quadrature
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.load_balance import explicit_entrance_angle
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import (
    SOIL_NUMBERS,
    Terms,
    build_contact,
    set_angles,
)

FloatArray = NDArray[np.float64]

STEP = 1e-5  # of u, for one-sided differences
NODES = 8  # quadrature nodes on each side of the peak stress
_LEAST_ANGLE, _GREATEST_ANGLE = 1e-3, 1.55  # [rad]
_TOLERANCE, _ITERATIONS = 1e-7, 60  # relative to the load


@dataclass
class State:
    """Solutions of B hypotheses at N rows.

    ``u`` are their coordinates, ``angle`` (B, N) entrance angles, ``outputs`` (B, N, 3), ``jacobian``
    one (N, 3, P_b) array per hypothesis (derivative by u).
    """

    u: list[FloatArray]
    angle: FloatArray
    outputs: FloatArray
    jacobian: list[FloatArray]
    angle_slope: list[FloatArray]


class Forward:
    """Contact model of N operating points as a function of free coordinates."""

    def __init__(
        self,
        points: OperatingPoints,
        soil: Soil,
        base_effects: Mapping[str, Mapping[str, float]],
        catalogue: Mapping[str, Effect],
        nodes: int = NODES,
    ) -> None:
        self.points = points
        self.soil = soil
        self.base_effects = {name: dict(values) for name, values in base_effects.items()}
        self.catalogue = catalogue
        self.nodes = nodes
        measured = np.asarray(points.leaving_angle, dtype=float)
        self._leaving_angle = None if np.isnan(measured).all() else measured

    def at(self, points: OperatingPoints) -> Forward:
        """Return the same model at other points."""
        return Forward(points, self.soil, self.base_effects, self.catalogue, self.nodes)

    def _contact(
        self, hypotheses: Sequence[Sequence[Coordinate]], columns: Sequence[Mapping[str, float]]
    ) -> tuple[Contact, Terms]:
        """Return contacts of shape (C, N) from C sets of values."""
        keys = {c.key: c for h in hypotheses for c in h}
        stacked = {}
        for key, coordinate in keys.items():
            fill = self._resting_value(coordinate)
            stacked[key] = np.array([c.get(key, fill) for c in columns])[:, None]
        one = np.ones((len(columns), 1))
        soil = {name: getattr(self.soil, name) * one for name in SOIL_NUMBERS}
        for key, values in stacked.items():
            owner, name = key.split('.')
            if owner != 'soil':
                continue
            if name == 'stiffness':
                soil['cohesive_modulus'] = self.soil.cohesive_modulus * values
                soil['frictional_modulus'] = self.soil.frictional_modulus * values
            elif name == 'tan_friction':
                soil['friction_angle'] = np.arctan(values)
            else:
                soil[name] = values
        names = dict.fromkeys(self.base_effects)
        names.update(dict.fromkeys(c.owner for c in keys.values() if c.owner != 'soil'))
        settings: dict[str, dict[str, Any]] = {}
        for name in names:
            resting = {**self.catalogue[name].defaults(), **self.base_effects.get(name, {})}
            settings[name] = {
                p: stacked.get(f'{name}.{p}', value * one) for p, value in resting.items()
            }
        terms = Terms(settings)
        return build_contact(self.points, soil, self.soil.pressure_law, terms), terms

    def _response(
        self, contact: Contact, terms: Terms, angle: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the load balance (C, N) [N] and the outputs (C, N, 3) at given angles."""
        set_angles(contact, angle, self._leaving_angle, terms)
        load, pull, torque = quadrature.forces(contact, terms, self.nodes)
        contact.sinkage = contact.radius * (1.0 - np.cos(angle))
        contact.drawbar_pull = contact.direction * pull
        contact.torque = contact.direction * torque
        terms.apply('on_outputs', contact)
        outputs = np.empty((*angle.shape, 3))
        outputs[..., 0] = contact.sinkage
        outputs[..., 1] = contact.drawbar_pull
        outputs[..., 2] = contact.torque
        return load - contact.normal_load, outputs

    def _resting_value(self, coordinate: Coordinate) -> float:
        """Value of a coordinate in hypotheses that do not have it."""
        if coordinate.owner == 'soil':
            return float(coordinate.value(0.0))
        if coordinate.owner in self.base_effects:
            return self.base_effects[coordinate.owner][coordinate.name]
        return coordinate.neutral

    def solve(
        self,
        hypotheses: Sequence[Sequence[Coordinate]],
        u: Sequence[FloatArray],
        start: FloatArray | None = None,
        jacobian: bool = True,
    ) -> State:
        """Solve the load balance of every hypothesis; with Jacobians by u unless told otherwise."""
        columns = [
            {c.key: float(c.value(x)) for c, x in zip(h, values, strict=True)}
            for h, values in zip(hypotheses, u, strict=True)
        ]
        contact, terms = self._contact(hypotheses, columns)
        angle, outputs = self._balance(contact, terms, (len(u), len(self.points)), start)
        if not jacobian:
            return State([np.asarray(x) for x in u], angle, outputs, [], [])
        return self._differences(hypotheses, u, columns, angle, outputs)

    def _differences(
        self,
        hypotheses: Sequence[Sequence[Coordinate]],
        u: Sequence[FloatArray],
        columns: Sequence[dict[str, float]],
        angle: FloatArray,
        outputs: FloatArray,
    ) -> State:
        """Jacobians by the implicit function theorem: dy/du at fixed angle, then along the balance."""
        copies: list[dict[str, float]] = []
        owner: list[int] = []
        for b, (hypothesis, values) in enumerate(zip(hypotheses, u, strict=True)):
            copies.append(columns[b])
            owner.append(b)
            for c, x in zip(hypothesis, values, strict=True):
                copies.append({**columns[b], c.key: float(c.value(x + self._step(c, x)))})
                owner.append(b)
        contact, terms = self._contact(hypotheses, copies)
        residual, shifted = self._response(contact, terms, angle[owner])
        # Once more the plain copies, for the derivative along the angle.
        contact, terms = self._contact(hypotheses, columns)
        step = 1e-6
        beyond, moved = self._response(contact, terms, angle + step)
        jacobians, slopes, at = [], [], 0
        for b, hypothesis in enumerate(hypotheses):
            count = len(hypothesis)
            steps = np.array([self._step(c, x) for c, x in zip(hypothesis, u[b], strict=True)])
            base_r, base_y = residual[at], shifted[at]
            by_angle = (beyond[b] - base_r) / step
            y_by_angle = (moved[b] - base_y) / step
            direct_r = (residual[at + 1 : at + 1 + count] - base_r) / steps[:, None]
            direct_y = (shifted[at + 1 : at + 1 + count] - base_y) / steps[:, None, None]
            angle_by_u = -direct_r / by_angle
            total = direct_y + y_by_angle[None] * angle_by_u[:, :, None]
            jacobians.append(np.moveaxis(total, 0, -1))
            slopes.append(angle_by_u.T)
            at += count + 1
        return State([np.asarray(x) for x in u], angle, outputs, jacobians, slopes)

    @staticmethod
    def _step(coordinate: Coordinate, x: float) -> float:
        return -STEP if x + STEP > coordinate.upper else STEP

    def by_slip(
        self, hypothesis: Sequence[Coordinate], u: FloatArray, angle: FloatArray
    ) -> FloatArray:
        """Return (N, 3) derivative of the outputs by the recorded slip."""
        step = np.where(self.points.slip > 0.99, -1e-4, 1e-4)
        beside = replace(self.points, slip=self.points.slip + step)
        base = self.solve([hypothesis], [u], angle[None], jacobian=False).outputs[0]
        other = self.at(beside).solve([hypothesis], [u], angle[None], jacobian=False).outputs[0]
        return (other - base) / step[:, None]

    def _balance(
        self, contact: Contact, terms: Terms, shape: tuple[int, int], start: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Solve the load balance for the entrance angle by safeguarded Newton steps."""
        first = explicit_entrance_angle(contact) if start is None else start
        angle = np.array(np.broadcast_to(first, shape))
        low, high = np.full(shape, _LEAST_ANGLE), np.full(shape, _GREATEST_ANGLE)
        slope = np.ones(shape)
        for iteration in range(_ITERATIONS):
            residual, outputs = self._response(contact, terms, angle)
            if iteration and np.max(np.abs(residual) / contact.normal_load) < _TOLERANCE:
                break
            # With a good start the first slope serves for all steps.
            if iteration % (4 if start is not None else 2) == 0:
                beyond, _ = self._response(contact, terms, angle + 1e-6)
                slope = (beyond - residual) / 1e-6
            low = np.where(residual < 0.0, angle, low)
            high = np.where(residual < 0.0, high, angle)
            with np.errstate(divide='ignore', invalid='ignore'):
                new = angle - residual / slope
            inside = (new > low) & (new < high)
            angle = np.where(inside, new, 0.5 * (low + high))
        return angle, outputs
