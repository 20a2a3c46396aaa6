# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel-soil model: operating points in, sinkage, drawbar pull and torque out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.checks import check_range, common_length
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, catalogue, check_settings
from wheel_terra_estimator.terramechanics.load_balance import (
    balance,
    explicit_entrance_angle,
    solve_entrance_angle,
)
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.quantity import Quantity
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import (
    SOIL_NUMBERS,
    Terms,
    build_contact,
    set_angles,
)

METHODS = ('quadrature', 'closed_form', 'triangles')

# Scale of finite steps for soil parameters that may be zero.
_SMALLEST_SCALE = {'cohesion': 100.0, 'cohesive_modulus': 1e3, 'friction_angle': 0.1}

OVERLOADED = 1  # the soil cannot carry the load: values belong to a sinkage of one radius
# |slip| above 0.95, where no steady state is known; or effects made the strength negative.
OUTSIDE_VALIDITY = 2


@dataclass(frozen=True)
class SteadyState:
    """Steady answer of the soil, one entry per operating point.

    Attributes
    ----------
    sinkage, drawbar_pull, torque : numpy.ndarray
        (N,) as the instruments of the model would read them [m], [N], [N m].
    entrance_angle, peak_stress_angle, leaving_angle : numpy.ndarray
        (N,) [rad].
    lateral_force : numpy.ndarray
        (N,) force of the soil on the wheel, positive left [N]; 0 where the slip angle is.
    flags : numpy.ndarray
        (N,) sum of `OVERLOADED` and `OUTSIDE_VALIDITY`.
    """

    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray
    entrance_angle: FloatArray
    peak_stress_angle: FloatArray
    leaving_angle: FloatArray
    lateral_force: FloatArray
    flags: NDArray[np.int_]

    def outputs(self) -> FloatArray:
        """Return (N, 3): sinkage, drawbar pull, torque."""
        return np.stack([self.sinkage, self.drawbar_pull, self.torque], axis=-1)


class WheelSoilModel:
    """Steady wheel-soil contact with a set of effects.

    Parameters
    ----------
    soil : Soil
        Floats.
    effects : mapping
        Effect name -> parameter -> value, and ``form``; only switched-on effects; what is missing
        takes its default. ``model.effects`` has them by variant (``effects.by_variant``).
    method : str
        ``quadrature``, ``closed_form`` (branch moments, for on-board use) or ``triangles``
        (the linearised stresses of the literature, for comparison).
    strict : bool
        True: a soil that cannot carry the load raises ``ValueError``; False: the point is clamped
        at a sinkage of one radius and flagged.
    nodes : int
        Quadrature nodes on each side of the peak stress.
    """

    def __init__(
        self,
        soil: Soil,
        effects: EffectSettings | None = None,
        method: str = 'quadrature',
        *,
        strict: bool = True,
        nodes: int = quadrature.NODES,
    ) -> None:
        if method not in METHODS:
            raise ValueError(f'method is {method!r}; allowed is one of {METHODS}')
        if nodes < 2:
            raise ValueError(f'nodes is {nodes}; allowed is 2 or more')
        self.soil = soil
        self.effects = check_settings(effects or {})
        self.method = method
        self.strict = strict
        self.nodes = nodes
        self._soil = {name: getattr(soil, name) for name in SOIL_NUMBERS}

    def steady_state(self, points: OperatingPoints) -> SteadyState:
        """Solve the load balance and return sinkage, drawbar pull and torque.

        Raises
        ------
        ValueError
            If `strict` and the soil cannot carry the load of a point, or the effects leave no
            strength; if an array of the soil has another length than the points.
        """
        terms = Terms(self.effects)
        length = common_length(
            {**{f'soil {name}': v for name, v in self._soil.items()}, 'slip': points.slip}
        )
        if length != len(points):
            raise ValueError(f'the soil has {length} entries, the points {len(points)}')
        contact = build_contact(points, self._soil, self.soil.pressure_law, terms)
        self._check(contact)
        load = np.broadcast_to(contact.normal_load, (len(points),))
        explicit = (
            self.method == 'closed_form'
            and closed_form.angles_in_proportion(terms)
            and bool(np.isnan(points.leaving_angle).all())
        )
        if explicit:
            form = closed_form.proportional_forces(contact)
            angle, pull, torque, carries = balance(form, load)
        else:
            angle, carries = self._entrance_angle(contact, load, points, terms)
        if self.strict and not carries.all():
            worst = int(np.flatnonzero(~carries)[0])
            limit = np.broadcast_to(
                self._response(contact, np.full_like(angle, np.pi / 2), points, terms)[0]
                + contact.normal_load,
                angle.shape,
            )[worst]
            raise ValueError(
                f'normal load is {load[worst]:g} N (entry {worst}); this soil carries at most '
                f'about {limit:.3g} N at a sinkage of one radius'
            )
        outputs: Sequence[Quantity]
        if explicit:
            set_angles(contact, angle, None, terms)
            contact.lateral_force = self._lateral_force(contact, terms)
            outputs = self._outputs(contact, angle, pull, torque, terms)
        else:
            set_angles(contact, angle, points.leaving_angle, terms)
            contact.lateral_force = self._lateral_force(contact, terms)
            _, *outputs = self._response(contact, angle, points, terms)
        return self._pack(contact, points, angle, carries, outputs)

    def _check(self, contact: Contact[Quantity]) -> None:
        """Complain of what effects, or the width, made of the soil."""
        law = 'kc/b + kphi' if self.soil.pressure_law == 'bekker' else "c kc' + rho g b kphi'"
        check_range(f'bearing modulus {law}', contact.bearing_modulus, 0.0, open_lower=True)
        if self.strict and self.effects:
            for quantity, unit, positive in (
                ('cohesion', 'Pa', False),
                ('tan_friction', '-', False),
                ('shear_modulus', 'm', True),
                ('sinkage_exponent', '-', True),
            ):
                name, value = quantity.replace('_', ' '), getattr(contact, quantity)
                check_range(
                    f'{name} with the effects on', value, 0.0, np.inf, unit, open_lower=positive
                )

    def jacobian(
        self, points: OperatingPoints, names: Sequence[str]
    ) -> tuple[SteadyState, FloatArray]:
        """Return the steady state and its derivatives by the implicit function theorem.

        The load balance is solved once; one batched evaluation at the fixed entrance angle then
        gives the partial derivatives of the balance and of the outputs for all names.

        Parameters
        ----------
        points : OperatingPoints
            N points.
        names : sequence of str
            ``soil.<field>``, ``effects.<name>.<parameter>`` (``<name>:<form>`` for another form
            than the first; an effect that is off counts as on at its neutral values), ``slip`` or
            ``normal_load``.

        Returns
        -------
        SteadyState
        numpy.ndarray
            (N, 3, P) derivatives of sinkage, drawbar pull, torque per unit of each name.
        """
        state = self.steady_state(points)
        batch = _Batch(self._soil, self.effects, points, names)
        terms = Terms(batch.effects)
        contact = build_contact(batch.points, batch.soil, self.soil.pressure_law, terms)
        angle = np.broadcast_to(state.entrance_angle, (batch.rows, len(points))).copy()
        angle_step = 1e-5 * state.entrance_angle
        angle[-2] += angle_step
        angle[-1] -= angle_step
        response = np.stack(
            [
                np.broadcast_to(values, angle.shape)
                for values in self._response(contact, angle, batch.points, terms)
            ],
            axis=-1,
        )  # (rows, N, 4): balance, sinkage, pull, torque
        count = len(names)
        steps = batch.steps[..., None]
        partial = (response[:count] - response[count : 2 * count]) / steps
        slope = (response[-2] - response[-1]) / (2.0 * angle_step[:, None])
        shift = -partial[..., 0] / slope[:, 0]
        total = partial[..., 1:] + shift[..., None] * slope[:, 1:]
        return state, np.moveaxis(total, 0, -1)

    def _entrance_angle(
        self, contact: Contact[Quantity], load: FloatArray, points: OperatingPoints, terms: Terms
    ) -> tuple[FloatArray, BoolArray]:
        start = explicit_entrance_angle(contact)

        def carried(angle: FloatArray) -> FloatArray:
            set_angles(contact, angle, points.leaving_angle, terms)
            return self._forces(contact, terms)[0]

        return solve_entrance_angle(carried, load, start)

    def _forces(self, contact: Contact[Quantity], terms: Terms) -> tuple[Any, Any, Any]:
        if self.method == 'quadrature':
            return quadrature.forces(contact, terms, self.nodes)
        if self.method == 'closed_form':
            return closed_form.forces(contact, terms)
        return closed_form.triangle_forces(contact, terms)

    def _lateral_force(self, contact: Contact[Quantity], terms: Terms) -> Quantity:
        if self.method == 'quadrature':
            return quadrature.lateral_force(contact, terms, self.nodes)
        if self.method == 'closed_form':
            return closed_form.lateral_force(contact, terms)
        return closed_form.triangle_lateral_force(contact, terms)

    def _response(
        self, contact: Contact[Quantity], angle: FloatArray, points: OperatingPoints, terms: Terms
    ) -> tuple[Quantity, Quantity, Quantity, Quantity]:
        """Balance W(t1) - load, and the three outputs, at given entrance angles."""
        set_angles(contact, angle, points.leaving_angle, terms)
        load, pull, torque = self._forces(contact, terms)
        return load - contact.normal_load, *self._outputs(contact, angle, pull, torque, terms)

    @staticmethod
    def _outputs(
        contact: Contact[Quantity],
        angle: FloatArray,
        pull: Quantity,
        torque: Quantity,
        terms: Terms,
    ) -> tuple[Quantity, Quantity, Quantity]:
        """Sinkage, pull and torque as the instruments read them."""
        contact.sinkage = contact.radius * (1.0 - np.cos(angle))
        contact.drawbar_pull = contact.direction * pull
        contact.torque = contact.direction * torque
        terms.apply('on_outputs', contact)
        return contact.sinkage, contact.drawbar_pull, contact.torque

    @staticmethod
    def _pack(
        contact: Contact[Quantity],
        points: OperatingPoints,
        angle: FloatArray,
        carries: BoolArray,
        outputs: Sequence[Quantity],
    ) -> SteadyState:
        flags = np.where(carries, 0, OVERLOADED)
        weakened = (np.asarray(contact.cohesion) < 0.0) | (np.asarray(contact.tan_friction) < 0.0)
        weakened |= np.asarray(contact.sinkage_exponent) <= 0.0
        flags = flags + np.where((np.abs(points.slip) > 0.95) | weakened, OUTSIDE_VALIDITY, 0)
        shape = angle.shape
        angles = angle, contact.peak_angle, contact.leaving_angle
        columns = (*outputs, *angles, contact.lateral_force)
        sinkage, pull, torque, entrance, peak, leaving, lateral = (
            np.array(np.broadcast_to(column, shape)) for column in columns
        )
        return SteadyState(sinkage, pull, torque, entrance, peak, leaving, lateral, flags)


class _Batch:
    """Perturbed copies of all inputs for one evaluation of all partial derivatives.

    Rows: P with the parameter raised, P with it lowered (or as it is, at the edge of its range),
    two unchanged ones for the entrance angle.
    """

    def __init__(
        self,
        soil: Mapping[str, Any],
        effects: Mapping[str, Mapping[str, float]],
        points: OperatingPoints,
        names: Sequence[str],
    ) -> None:
        self.rows = 2 * len(names) + 2
        self.steps = np.empty((len(names), len(points)))
        self.soil = dict(soil)
        self.effects: dict[str, dict[str, Any]] = {k: dict(v) for k, v in effects.items()}
        self.points: Any = SimpleNamespace(
            **{name: getattr(points, name) for name in points.__dataclass_fields__}
        )
        for index, name in enumerate(names):
            head, _, tail = name.partition('.')
            if head == 'soil' and tail in self.soil:
                value = self.soil[tail]
                step = 1e-5 * max(float(np.max(np.abs(value))), _SMALLEST_SCALE.get(tail, 1e-3))
                lower, upper = (-np.inf, 0.0) if tail == 'leaving_angle_ratio' else (0.0, np.inf)
                self.soil[tail] = self._perturb(index, value, step, lower, upper)
            elif head == 'effects':
                self._perturb_effect(index, name, *tail.split('.'))
            elif name == 'slip':
                points_slip = self._perturb(index, points.slip, 1e-6, -1.0, 1.0)
                self.points.slip = points_slip
            elif name == 'normal_load':
                step = 1e-5 * float(np.min(points.normal_load))
                self.points.normal_load = self._perturb(
                    index, points.normal_load, step, 0.0, np.inf
                )
            else:
                raise ValueError(f'no derivative by {name!r}: not a parameter of the model')

    def _perturb(
        self, index: int, value: Quantity, step: float, lower: float, upper: float
    ) -> FloatArray:
        """Return `value` for all rows, raised in one row and lowered in its partner."""
        value = np.asarray(value, float)
        if value.ndim < 2:
            value = np.broadcast_to(value, (self.rows, value.size))
        batch = value.copy()
        raised, lowered = index, index + (self.rows - 2) // 2
        batch[raised] = np.where(batch[raised] + step <= upper, batch[raised] + step, batch[raised])
        batch[lowered] = np.where(
            batch[lowered] - step >= lower, batch[lowered] - step, batch[lowered]
        )
        self.steps[index] = batch[raised] - batch[lowered]
        return batch

    def _perturb_effect(self, index: int, name: str, effect: str, parameter: str = '') -> None:
        known = catalogue().get(effect)
        if known is None or parameter not in known.forms[0].defaults():
            raise ValueError(f'no derivative by {name!r}: not in the catalogue of effects')
        if effect not in self.effects:
            self.effects[effect] = dict(known.neutral())
        values = self.effects[effect]
        declared = known.parameter(parameter)
        values[parameter] = self._perturb(
            index, values[parameter], 1e-4 * declared.prior_scale, declared.lower, declared.upper
        )
