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

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration.configuration import Readings
from wheel_terra_estimator.discrepancy.fitting.coordinates import BED, Coordinate
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.terramechanics import quadrature
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import by_variant
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

STEP = 1e-5  # of u, for one-sided differences
_LEAST_ANGLE, _GREATEST_ANGLE = 1e-3, 1.55  # [rad]
_TOLERANCE, _ITERATIONS = 1e-6, 60  # relative to the load


@dataclass
class State:
    """Solutions of B hypotheses at N rows.

    ``angle`` (B, N) entrance angles, ``outputs`` (B, N, 4), ``jacobian`` one (N, 4, P_b) array per
    hypothesis (derivative by u).
    """

    angle: FloatArray
    outputs: FloatArray
    jacobian: list[FloatArray]
    angle_slope: list[FloatArray]


@dataclass(eq=False)
class Forward:
    """Contact model of N operating points as a function of free coordinates."""

    points: OperatingPoints
    soil: Soil
    base_effects: Mapping[str, Mapping[str, float]]
    catalogue: Mapping[str, Effect]
    active: BoolArray | None = None
    readings: Readings | None = None

    def __post_init__(self) -> None:
        self.base_effects = by_variant(self.base_effects)
        measured = np.asarray(self.points.leaving_angle, dtype=float)
        self._leaving_angle = None if np.isnan(measured).all() else measured

    def _contact(
        self, hypotheses: Sequence[Sequence[Coordinate]], columns: Sequence[Mapping[str, float]]
    ) -> tuple[Contact, Terms]:
        """Return contacts of shape (C, N) from C sets of values."""
        keys = {c.key: c for h in hypotheses for c in h}
        resting = np.array([self._resting_value(c) for c in keys.values()])
        table = np.repeat(resting[:, None], len(columns), axis=1)
        place = {key: k for k, key in enumerate(keys)}
        given = [(place[key], k, x) for k, c in enumerate(columns) for key, x in c.items()]
        if given:
            at, of, values = zip(*given, strict=True)
            table[at, of] = values
        stacked = dict(zip(keys, table[:, :, None], strict=True))
        one = np.ones((len(columns), 1))
        soil = {name: getattr(self.soil, name) * one for name in SOIL_NUMBERS}
        for key, value in stacked.items():  # those of a bed after those of the soil
            owner, name = key.split('.')
            if owner == BED and self.active is not None:
                value = np.where(self.active, value, 1.0)
            if owner not in ('soil', BED):
                continue
            if name == 'stiffness':
                soil['cohesive_modulus'] = soil['cohesive_modulus'] * value
                soil['frictional_modulus'] = soil['frictional_modulus'] * value
            elif owner == BED:
                soil['friction_angle'] = np.arctan(np.tan(soil['friction_angle']) * value)
            elif name == 'tan_friction':
                soil['friction_angle'] = np.arctan(value)
            else:
                soil[name] = value
        of_effects = (c.owner for c in keys.values() if c.owner not in ('soil', BED))
        settings: dict[str, dict[str, Any]] = {}
        for name in dict.fromkeys((*self.base_effects, *of_effects)):
            setting = {**self.catalogue[name].defaults(), **self.base_effects.get(name, {})}
            for c in keys.values():  # terms of a sparse law have no defaults
                if c.owner == name:
                    setting.setdefault(c.name, c.neutral)
            settings[name] = {
                p: stacked.get(f'{name}.{p}', value * one) for p, value in setting.items()
            }
            if self.active is not None and name not in self.base_effects:
                # A candidate is at neutral on rows of a reference.
                neutral = self.catalogue[name].neutral()
                settings[name] = {
                    p: np.where(self.active, values, neutral.get(p, 0.0))
                    if f'{name}.{p}' in stacked
                    else values
                    for p, values in settings[name].items()
                }
        terms = Terms(settings)
        contact = build_contact(self.points, soil, self.soil.pressure_law, terms)
        contact.cohesion = np.maximum(contact.cohesion, 0.0)  # below it is no soil
        return contact, terms

    def _response(
        self, contact: Contact, terms: Terms, angle: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the load balance (C, N) [N] and the outputs (C, N, 4) at given angles."""
        set_angles(contact, angle, self._leaving_angle, terms)
        load, pull, torque = quadrature.forces(contact, terms)
        contact.sinkage = contact.radius * (1.0 - np.cos(angle))
        contact.drawbar_pull = contact.direction * pull
        contact.torque = contact.direction * torque
        contact.lateral_force = quadrature.lateral_force(contact, terms)
        terms.apply('on_outputs', contact)
        outputs = np.empty((*angle.shape, len(QUANTITIES)))
        for q, quantity in enumerate(QUANTITIES):
            outputs[..., q] = getattr(contact, quantity)
        if self.readings is not None:
            outputs[..., :3] = self.readings.read(outputs[..., :3])
        return np.asarray(load - contact.normal_load), outputs

    def _resting_value(self, coordinate: Coordinate) -> float:
        """Value of a coordinate in hypotheses that do not have it."""
        if coordinate.owner in ('soil', BED):
            return float(coordinate.value(0.0))
        if coordinate.owner in self.base_effects:
            return self.base_effects[coordinate.owner][coordinate.name]
        # Strengths vanish; a range or a depth keeps a value at which its term can be computed.
        neutral = self.catalogue[coordinate.owner].neutral()
        return neutral.get(coordinate.name, coordinate.neutral)

    def solve(
        self,
        hypotheses: Sequence[Sequence[Coordinate]],
        u: Sequence[FloatArray],
        start: FloatArray | None = None,  # (B, N) or (N,) entrance angles near the solution [rad]
        jacobian: bool = True,
        # Coordinates of each hypothesis by which to differentiate (default: all)
        by: Sequence[Sequence[int]] | None = None,
    ) -> State:
        """Solve the load balance of every hypothesis; with Jacobians by u by default."""
        if by is None:
            by = [range(len(h)) for h in hypotheses]
        if start is not None:
            start = np.broadcast_to(start, (len(u), len(self.points)))
        columns = [
            {c.key: float(c.value(x)) for c, x in zip(h, values, strict=True)}
            for h, values in zip(hypotheses, u, strict=True)
        ]
        angle, outputs = self._balance(hypotheses, columns, start)
        if not jacobian:
            return State(angle, outputs, [], [])
        return self._differences(hypotheses, u, by, columns, angle, outputs)

    def _differences(
        self,
        hypotheses: Sequence[Sequence[Coordinate]],
        u: Sequence[FloatArray],
        by: Sequence[Sequence[int]],
        columns: Sequence[dict[str, float]],
        angle: FloatArray,
        outputs: FloatArray,
    ) -> State:
        """Jacobians (implicit functions): dy/du at fixed angle, then along the balance."""
        copies = list(columns)
        owner = list(range(len(columns)))
        steps = list[FloatArray]()
        for b, (hypothesis, values) in enumerate(zip(hypotheses, u, strict=True)):
            moved_by = list[float]()
            for c, x in ((hypothesis[k], values[k]) for k in by[b]):
                moved_by.append(-STEP if x + STEP > c.upper else STEP)
                copies.append({**columns[b], c.key: float(c.value(x + moved_by[-1]))})
                owner.append(b)
            steps.append(np.array(moved_by))
        # Once more the plain copies, for the derivative along the angle.
        step = 1e-6
        contact, terms = self._contact(hypotheses, [*copies, *columns])
        residual, shifted = self._response(
            contact, terms, np.concatenate([angle[owner], angle + step])
        )
        beyond, moved = residual[len(copies) :], shifted[len(copies) :]
        jacobians, slopes, at = [], [], len(columns)
        for b, own in enumerate(steps):
            count = len(own)
            base_r, base_y = residual[b], shifted[b]
            by_angle = (beyond[b] - base_r) / step
            y_by_angle = (moved[b] - base_y) / step
            direct_r = (residual[at : at + count] - base_r) / own[:, None]
            direct_y = (shifted[at : at + count] - base_y) / own[:, None, None]
            angle_by_u = -direct_r / by_angle
            total = direct_y + y_by_angle[None] * angle_by_u[:, :, None]
            jacobians.append(np.moveaxis(total, 0, -1))
            slopes.append(angle_by_u.T)
            at += count
        return State(angle, outputs, jacobians, slopes)

    def by_input(
        self, name: str, hypothesis: Sequence[Coordinate], u: FloatArray, angle: FloatArray
    ) -> FloatArray:
        """Return (N, 4) derivative of the outputs by slip, load or leaving angle; 0 where nan."""
        given = np.asarray(getattr(self.points, name), dtype=float)
        step = np.where((given > 0.99) | (name == 'leaving_angle'), -1e-4, 1e-4)
        if name == 'normal_load':
            step = 1e-4 * given
        moved: dict[str, Any] = {name: given + step}
        beside = replace(self, points=replace(self.points, **moved))
        base, other = (
            model.solve([hypothesis], [u], angle[None], jacobian=False).outputs[0]
            for model in (self, beside)
        )
        return np.where(np.isnan(given)[:, None], 0.0, (other - base) / step[:, None])

    def _balance(
        self,
        hypotheses: Sequence[Sequence[Coordinate]],
        columns: Sequence[Mapping[str, float]],
        start: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray]:
        """Solve the load balance of every hypothesis for the entrance angle.

        Load grows nearly like a power of the angle, so secant steps run on logarithms, inside a
        bracket; hypotheses that have converged leave the batch.
        """
        shape = (len(columns), len(self.points))
        angles, solved = np.empty(shape), np.empty((*shape, len(QUANTITIES)))
        live = np.arange(len(columns))
        contact, terms = self._contact(hypotheses, columns)
        first = explicit_entrance_angle(contact) if start is None else start
        angle = np.array(np.broadcast_to(first, shape))
        low, high = np.full(shape, _LEAST_ANGLE), np.full(shape, _GREATEST_ANGLE)
        exponent, keep = np.zeros(shape), np.ones(len(columns), dtype=bool)
        before = old_ratio = np.zeros(shape)
        for iteration in range(_ITERATIONS):
            if len(live) < len(angle):
                angle, low, high = angle[keep], low[keep], high[keep]
                exponent, before, old_ratio = exponent[keep], before[keep], old_ratio[keep]
                contact, terms = self._contact(hypotheses, [columns[int(b)] for b in live])
            balance, outputs = self._response(contact, terms, angle)
            relative = balance / contact.normal_load
            done = np.max(np.abs(relative), axis=1) < _TOLERANCE
            narrow = np.max(high - low, axis=1) < 1e-12
            finished = done | narrow | (iteration == _ITERATIONS - 1)
            angles[live[finished]], solved[live[finished]] = angle[finished], outputs[finished]
            if finished.all():
                break
            with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
                ratio = np.log(np.maximum(1.0 + relative, 1e-9))
                if iteration == 0:
                    beyond, _ = self._response(contact, terms, angle * (1.0 + 1e-5))
                    further = np.log(np.maximum(1.0 + beyond / contact.normal_load, 1e-9))
                    exponent = (further - ratio) / np.log1p(1e-5)
                else:
                    secant = (ratio - old_ratio) / np.log(angle / before)
                    usable = np.isfinite(secant) & (secant > 0.2) & (np.abs(ratio) > 1e-9)
                    exponent = np.where(usable, secant, exponent)
                proposal = angle * np.exp(-ratio / exponent)
            low = np.where(relative < 0.0, np.maximum(low, angle), low)
            high = np.where(relative >= 0.0, np.minimum(high, angle), high)
            before, old_ratio = angle, ratio
            inside = (proposal > low) & (proposal < high) & (exponent > 0.2)
            angle = np.where(inside, proposal, np.sqrt(low * high))
            keep = ~finished
            live = live[~finished]
        return angles, solved
