# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Equation 19 of Ding et al. 2010: how far quadrature and closed form are from the integrals."""

from __future__ import annotations

from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import configuration_folder
from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.terms import (
    SOIL_NUMBERS,
    Terms,
    build_contact,
    set_angles,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction.statement import Statement
from wheel_terra_lab.studies.model_validation.fitting import FloatArray

REFERENCE_SHARE = 1e-4  # of the load: where the quadrature is called reference
SEED = 36
MOST_NODES = 256  # on each side of the peak
POINTS = 20_000  # drawn contacts, half of them driving, half skidding
SKIDDING = (-0.9, 0.0)
DRIVING = (0.0, 0.9)
OURS = 'accuracy of ours'
LEAST_PRESSURE = 1e3  # load over 2 r b [Pa], of a wheel that carries something


def statements(count: int = POINTS) -> list[Statement]:
    """Return how far quadrature and closed form are from the integrals of equation 19.

    Wheels, named soils (every number +-30 %), slips and entrance angles are drawn; load and pull
    at these angles are compared. The nodes are doubled until both change by less than
    `REFERENCE_SHARE` of the load.
    """
    found, ours = [], dict[str, list[str]]()
    for name, slips in (('driving', DRIVING), ('skidding', SKIDDING)):
        contact, terms = _drawn(count // 2, slips)
        nodes, change, reference = _reference(contact, terms)
        what = f'quadrature, {name}: change of load or pull by the last doubling [% of load]'
        asked, told = f'below {100 * REFERENCE_SHARE:g}', f'{100 * change:.4f}'
        why = f'{nodes} nodes a side, {count // 2} contacts'
        settled = change < REFERENCE_SHARE
        found.append(Statement('equation 19', what, asked, told, settled, why))
        usual = _error(quadrature.forces(contact, terms), reference)
        closed = _error(closed_form.forces(contact, terms), reference)
        carries = reference[0] >= LEAST_PRESSURE * 2.0 * contact.radius * contact.width
        for label, error in (
            (f'quadrature with {quadrature.NODES} nodes', usual),
            ('closed form', closed),
            ('closed form at 1 kPa or more on 2 r b', closed[carries]),
        ):
            most = 100 * np.quantile(error, 0.95)
            told = f'{most:.3f}, {100 * error.max():.2f}'
            ours.setdefault(label, []).append(told)
    for label, told_of in ours.items():
        what = f'{label}: error that 95 % stay below, worst [% of load]; driving; skidding'
        found.append(Statement('equation 19', what, '-', '; '.join(told_of), None, OURS))
    return found


def _drawn(count: int, slips: tuple[float, float]) -> tuple[Contact, Terms]:
    """Return drawn contacts with their angles set: r 0.05 to 0.3 m, entrance 0.15 to 1 rad."""
    random = np.random.default_rng(SEED)
    radius = random.uniform(0.05, 0.3, count)
    wheel = Wheel(radius, radius * random.uniform(0.5, 1.5, count))
    points = OperatingPoints(random.uniform(*slips, count), 1.0, wheel, slip_radius='rim')
    terms = Terms({})
    contact = build_contact(points, _named_soil(random, count), 'bekker', terms)
    set_angles(contact, random.uniform(0.15, 1.0, count), None, terms)
    return contact, terms


def _named_soil(random: np.random.Generator, count: int) -> dict[str, FloatArray]:
    """Draw shipped soils in Bekker form, every number +-30 %."""
    named = []
    for path in sorted((configuration_folder() / 'soils').glob('*.yaml')):
        soil = reader.load([path], complete=False).soil
        if soil.pressure_law == 'bekker' and not path.stem.endswith('_fit'):
            named.append({name: float(getattr(soil, name)) for name in SOIL_NUMBERS})
    drawn = random.integers(len(named), size=count)
    soils = {
        name: np.array([named[k][name] for k in drawn]) * random.uniform(0.7, 1.3, count)
        for name in SOIL_NUMBERS
    }
    soils['friction_angle'] = np.minimum(soils['friction_angle'], np.radians(55.0))
    return soils


def _reference(contact: Contact, terms: Terms) -> tuple[int, float, tuple[FloatArray, FloatArray]]:
    """Return nodes, the change that the last doubling made, load and pull [N]."""
    nodes = quadrature.NODES
    before = quadrature.forces(contact, terms, nodes)
    while True:
        nodes *= 2
        load, pull, torque = quadrature.forces(contact, terms, nodes)
        change = float(_error(before, (load, pull)).max())
        if change < REFERENCE_SHARE or nodes >= MOST_NODES:
            return nodes, change, (load, pull)
        before = load, pull, torque


def _error(forces: tuple[Any, ...], reference: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the larger error of load and pull over the load [-]."""
    load, pull = reference
    apart = np.maximum(np.abs(forces[0] - load), np.abs(forces[1] - pull))
    return np.asarray(apart / np.abs(load))
