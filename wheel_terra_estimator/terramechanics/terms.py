# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""From points, soil and switched-on effects to contacts whose angles are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import SimpleNamespace

import numpy as np

from wheel_terra_estimator.arrays import Quantity
from wheel_terra_estimator.terramechanics import stresses
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.effects import by_variant, catalogue
from wheel_terra_estimator.terramechanics.effects.base import STAGES, EffectSettings, Term
from wheel_terra_estimator.terramechanics.kinematics import speed_ratio
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil

SOIL_NUMBERS = tuple(f.name for f in fields(Soil) if f.name != 'pressure_law')
# Share of the contact length that the peak of the stress keeps from either end.
PEAK_MARGIN = 1e-3
_MOST_LEAVING = 0.9  # measured leaving angle over the entrance angle, at most [-]


class Terms:
    """The terms of the switched-on effects, sorted by stage, with their parameter values.

    Within a stage their order does not depend on that of the settings: what an instrument does to
    the inputs (a misread slip) is undone before the soil sees them, what it does to the outputs
    comes after all soil and drive.
    """

    def __init__(self, settings: EffectSettings) -> None:
        known, variants = catalogue(), sorted(by_variant(settings).items())
        effects = [(known[key], SimpleNamespace(**values)) for key, values in variants]
        self.stages: dict[str, list[tuple[Term, SimpleNamespace]]] = {}
        for stage in STAGES:
            instruments_first = stage == 'on_inputs'
            self.stages[stage] = [
                (term, values)
                for effect, values in sorted(
                    effects, key=lambda each: each[0].instrument != instruments_first
                )
                if (term := getattr(effect, stage)) is not None
            ]

    def apply(self, stage: str, contact: Contact) -> None:
        """Run all terms of a stage on the contact."""
        for term, parameters in self.stages[stage]:
            term(contact, parameters)


def build_contact(
    points: OperatingPoints, soil: Mapping[str, Quantity], pressure_law: str, terms: Terms
) -> Contact:
    """Return the contacts before the load balance, with stage ``on_inputs`` done.

    ``soil``: value of each of `SOIL_NUMBERS`, any shape that broadcasts against (N,).
    """
    wheel = points.wheel
    rate = points.angular_velocity
    tip, rim = wheel.tip_radius, wheel.radius
    modulus, depth = stresses.bearing_law(
        pressure_law,
        soil['cohesive_modulus'],
        soil['frictional_modulus'],
        wheel.width,
        soil['cohesion'],
        soil['density'] * points.gravity,
    )
    ratio = speed_ratio(points.slip)
    contact = Contact(
        slip=points.slip,
        velocity_ratio=ratio * (tip if points.slip_radius == 'lug_tip' else rim),
        normal_load=points.normal_load,
        stated_load=points.normal_load,
        slope=points.slope,
        gravity=points.gravity,
        rim_speed=np.abs(rate) * rim,
        direction=np.where(rate < 0.0, -1.0, 1.0),
        pass_number=points.pass_number,
        radius=rim,
        width=wheel.width,
        lug_height=wheel.lug_height,
        lug_count=wheel.lug_count,
        lug_thickness=wheel.lug_thickness,
        shear_radius=rim,
        bearing_modulus=modulus,
        reference_depth=depth,
        sinkage_exponent=soil['sinkage_exponent'],
        cohesion=soil['cohesion'],
        tan_friction=np.tan(soil['friction_angle']),
        shear_modulus=soil['shear_modulus'],
        peak_ratio=soil['peak_stress_ratio'],
        leaving_ratio=soil['leaving_angle_ratio'],
        density=soil['density'],
        rim_radius=rim,
    )
    contact.lateral_ratio = _lateral_ratio(points, contact)
    terms.apply('on_inputs', contact)
    if points.slip_radius == 'shear':
        contact.scale_speed(contact.shear_radius / contact.radius)
    return contact


def _lateral_ratio(points: OperatingPoints, contact: Contact) -> Quantity:
    """Return v_y/w [m], positive left; the float 0.0 where no wheel slides sideways."""
    stated = ~np.isnan(points.lateral_speed_ratio)
    if not (np.any(points.slip_angle) or np.any(stated)):
        return 0.0
    # In reverse v/w stays positive: left is left whichever way the wheel rolls.
    ratio = contact.velocity_ratio * np.copysign(np.tan(points.slip_angle), points.slip_angle)
    radius = {'lug_tip': points.wheel.tip_radius, 'rim': points.wheel.radius}
    stated_ratio = points.lateral_speed_ratio * radius.get(points.slip_radius, contact.shear_radius)
    return np.where(stated, stated_ratio, ratio)


def set_angles(
    contact: Contact, entrance_angle: Quantity, measured_leaving: Quantity | None, terms: Terms
) -> None:
    """Set entrance, leaving and peak angle; a measured leaving angle overrides the law."""
    contact.entrance_angle = entrance_angle
    contact.leaving_angle = contact.leaving_ratio * entrance_angle
    contact.peak_angle = contact.peak_ratio * entrance_angle
    terms.apply('on_contact', contact)
    if measured_leaving is not None:
        given = np.minimum(measured_leaving, _MOST_LEAVING * entrance_angle)
        contact.leaving_angle = np.where(np.isnan(measured_leaving), contact.leaving_angle, given)
    margin = PEAK_MARGIN * (entrance_angle - contact.leaving_angle)
    contact.peak_angle = np.minimum(
        np.maximum(contact.peak_angle, contact.leaving_angle + margin), entrance_angle - margin
    )
