# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel-soil model: operating points in, sinkage, drawbar pull and torque out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.arrays import BoolArray, FloatArray, Quantity
from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.checks import check_range
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import EffectSettings, with_defaults
from wheel_terra_estimator.terramechanics.kinematics import STEADY_SLIP
from wheel_terra_estimator.terramechanics.load_balance import (
    balance,
    explicit_entrance_angle,
    solve_entrance_angle,
)
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import (
    SOIL_NUMBERS,
    Terms,
    build_contact,
    set_angles,
)

_FORCES: Mapping[str, ModuleType] = {'quadrature': quadrature, 'closed_form': closed_form}
METHODS = tuple(_FORCES)

OVERLOADED = 1  # the soil cannot carry the load: values belong to a sinkage of one radius
# |slip| above `STEADY_SLIP`, or effects made the strength negative.
OUTSIDE_VALIDITY = 2


@dataclass(frozen=True)
class SteadyState:
    """Steady state of the contact, one entry per operating point."""

    # ``sinkage``, ``drawbar_pull``, ``torque``: (N,) as the instruments of the model would read
    # them [m], [N], [N m]
    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray
    # ``entrance_angle``, ``peak_stress_angle``, ``leaving_angle``: (N,) [rad]
    entrance_angle: FloatArray
    peak_stress_angle: FloatArray
    leaving_angle: FloatArray
    # (N,) force of the soil on the wheel, positive left [N]; 0 where the slip angle is
    lateral_force: FloatArray
    flags: NDArray[np.int_]  # (N,) sum of `OVERLOADED` and `OUTSIDE_VALIDITY`

    def outputs(self) -> FloatArray:
        """Return (N, 3): sinkage, drawbar pull, torque."""
        return np.stack([self.sinkage, self.drawbar_pull, self.torque], axis=-1)


class WheelSoilModel:
    """Steady wheel-soil contact with a set of effects."""

    def __init__(
        self,
        soil: Soil,
        # Effect name -> parameter -> value, and ``form``; only switched-on effects; what is missing
        # takes its default. ``model.effects`` has them by variant (``effects.by_variant``).
        effects: EffectSettings | None = None,
        # ``quadrature`` or ``closed_form`` (branch moments, for on-board use)
        method: str = 'quadrature',
    ) -> None:
        if method not in METHODS:
            raise ValueError(f'method is {method!r}; allowed is one of {METHODS}')
        self.soil = soil
        self.effects = with_defaults(effects or {})
        self.method = method
        self._soil = {name: getattr(soil, name) for name in SOIL_NUMBERS}

    @property
    def _law(self) -> ModuleType:
        return _FORCES[self.method]  # no attribute: a module cannot be pickled

    def steady_state(self, points: OperatingPoints) -> SteadyState:
        """Solve the load balance and return sinkage, drawbar pull and torque.

        Where the soil cannot carry the load, they are those at a sinkage of one radius, flagged.
        Raises ValueError where the width leaves no bearing strength.
        """
        terms = Terms(self.effects)
        contact = build_contact(points, self._soil, self.soil.pressure_law, terms)
        law = 'kc/b + kphi' if self.soil.pressure_law == 'bekker' else "c kc' + rho g b kphi'"
        check_range(f'bearing modulus {law}', contact.bearing_modulus, 0.0, open_lower=True)
        load = np.broadcast_to(contact.normal_load, (len(points),))
        explicit = (
            self.method == 'closed_form'
            and not (terms.stages['on_contact'] or terms.stages['on_normal_stress'])
            and bool(np.isnan(points.leaving_angle).all())
        )
        if explicit:
            angle, pull, torque, carries = balance(closed_form.proportional_forces(contact), load)
        else:
            angle, carries = self._entrance_angle(contact, load, points, terms)
        set_angles(contact, angle, None if explicit else points.leaving_angle, terms)
        contact.lateral_force = self._law.lateral_force(contact, terms)
        if not explicit:
            _, pull, torque = self._law.forces(contact, terms)
        contact.sinkage = contact.radius * (1.0 - np.cos(angle))
        contact.drawbar_pull = contact.direction * pull
        contact.torque = contact.direction * torque
        terms.apply('on_outputs', contact)  # as the instruments read them
        return _steady_state(contact, points, angle, carries)

    def _entrance_angle(
        self, contact: Contact, load: FloatArray, points: OperatingPoints, terms: Terms
    ) -> tuple[FloatArray, BoolArray]:
        def carried(angle: FloatArray) -> FloatArray:
            set_angles(contact, angle, points.leaving_angle, terms)
            load: FloatArray = self._law.forces(contact, terms)[0]
            return load

        return solve_entrance_angle(carried, load, explicit_entrance_angle(contact))


def _steady_state(
    contact: Contact, points: OperatingPoints, angle: FloatArray, carries: BoolArray
) -> SteadyState:
    flags = np.where(carries, 0, OVERLOADED)
    weakened = (np.asarray(contact.cohesion) < 0.0) | (np.asarray(contact.tan_friction) < 0.0)
    weakened |= np.asarray(contact.sinkage_exponent) <= 0.0
    flags = flags + np.where((np.abs(points.slip) > STEADY_SLIP) | weakened, OUTSIDE_VALIDITY, 0)

    def whole(value: Quantity) -> FloatArray:
        return np.array(np.broadcast_to(value, angle.shape))

    return SteadyState(
        sinkage=whole(contact.sinkage),
        drawbar_pull=whole(contact.drawbar_pull),
        torque=whole(contact.torque),
        entrance_angle=whole(angle),
        peak_stress_angle=whole(contact.peak_angle),
        leaving_angle=whole(contact.leaving_angle),
        lateral_force=whole(contact.lateral_force),
        flags=flags,
    )
