# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Closed forms against the quadrature over random wheels, soils, loads and slips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import configuration_folder
from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.balanced_branches import balanced_forces
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.load_balance import (
    explicit_entrance_angle,
    solve_entrance_angle,
)
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.terms import (
    SOIL_NUMBERS,
    Terms,
    build_contact,
    set_angles,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.model_validation.fitting import FloatArray
from wheel_terra_lab.terramechanics.decoupled_pull import decoupled_pull, decoupled_pull_shaped

FORMS = {
    'branch moments': closed_form.forces,
    'triangles (A, B, C)': closed_form.triangle_forces,
}


REFERENCE_NODES = 64
"""On each side: load and pull are settled to 1e-4 of the load (``reproduction.integration``)."""


@dataclass
class Family:
    """Random contacts, one entry each, with the quadrature's answer."""

    contact: Contact
    terms: Terms
    load: FloatArray
    slip: FloatArray
    angle: FloatArray
    carried: FloatArray
    pull: FloatArray
    torque: FloatArray

    def solve(self, forces) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:  # type: ignore[no-untyped-def]
        """Balance the load with another form; entrance angle, pull, torque, success."""

        def carried(angle: FloatArray) -> FloatArray:
            set_angles(self.contact, angle, None, self.terms)
            return forces(self.contact, self.terms)[0]

        angle, good = solve_entrance_angle(
            carried, self.load, explicit_entrance_angle(self.contact)
        )
        set_angles(self.contact, angle, None, self.terms)
        _, pull, torque = forces(self.contact, self.terms)
        return angle, pull, torque, good


def soils() -> list[dict[str, float]]:
    """Return the named soils in Bekker form."""
    found = []
    for path in sorted((configuration_folder() / 'soils').glob('*.yaml')):
        soil = reader.load([path], complete=False).soil
        if soil.pressure_law == 'bekker' and not path.stem.endswith('_fit'):
            found.append({name: float(getattr(soil, name)) for name in SOIL_NUMBERS})
    return found


def named_soil(random: np.random.Generator, count: int) -> dict[str, FloatArray]:
    """Draw named soils with every number +-30 %."""
    named = soils()
    drawn = random.integers(len(named), size=count)
    soil = {
        name: np.array([named[k][name] for k in drawn]) * random.uniform(0.7, 1.3, count)
        for name in SOIL_NUMBERS
    }
    soil['friction_angle'] = np.minimum(soil['friction_angle'], np.radians(55.0))
    return soil


def any_soil(random: np.random.Generator, count: int) -> dict[str, FloatArray]:
    """Draw soils that nobody named.

    k_phi 0.3 to 6 MPa/m^N evenly in its logarithm, k_c 0 to 20 kPa/m^(N-1), N 0.5 to 1.4, c 0 to 3
    kPa, phi 15 to 45 deg, K 2 to 40 mm evenly in its logarithm.
    """
    return {
        'cohesive_modulus': random.uniform(0.0, 20e3, count),
        'frictional_modulus': np.exp(random.uniform(np.log(0.3e6), np.log(6e6), count)),
        'sinkage_exponent': random.uniform(0.5, 1.4, count),
        'cohesion': random.uniform(0.0, 3e3, count),
        'friction_angle': np.radians(random.uniform(15.0, 45.0, count)),
        'shear_modulus': np.exp(random.uniform(np.log(2e-3), np.log(40e-3), count)),
        'density': np.full(count, 1600.0),
    }


def family(
    count: int,
    seed: int,
    mound: bool,
    slips: tuple[float, float] = (0.0, 0.95),
    drawn_soil: Callable[[np.random.Generator, int], dict[str, FloatArray]] = named_soil,
) -> Family:
    """Draw random wheels, soils, loads and slips.

    r 0.05 to 0.3 m, b/r 0.5 to 1.5, h/r 0 to 0.15, named soils with every number +-30 %, mean
    pressure W/(r b) 1 to 10 kPa, slip 0 to 0.95, c1 0.3 to 0.6, c2 0 to 0.3, c3 -0.4 to 0, n1 0 to
    0.5, lambda 0 to 1; mound kappa 0 to 2, onset 0.2 to 0.6. Kept: the soil carries the load.
    """
    random = np.random.default_rng(seed)
    soil = drawn_soil(random, count)
    soil['peak_stress_ratio'] = random.uniform(0.3, 0.6, count)
    soil['leaving_angle_ratio'] = random.uniform(-0.4, 0.0, count)
    radius = random.uniform(0.05, 0.3, count)
    width = radius * random.uniform(0.5, 1.5, count)
    lugs = radius * random.uniform(0.0, 0.15, count)
    load = random.uniform(1e3, 10e3, count) * radius * width
    slip = random.uniform(*slips, count)
    effects = {
        'slip_sinkage_exponent': {'n1': random.uniform(0.0, 0.5, count), 'n2': 0.0, 'side': 0.0},
        'stress_peak_shift': {'c2': random.uniform(0.0, 0.3, count), 'skid': 0.0},
        'lug_shear_radius': {'lam': random.uniform(0.0, 1.0, count)},
    }
    if mound:
        effects['soil_mound'] = {
            'kappa': random.uniform(0.0, 2.0, count),
            'onset': random.uniform(0.2, 0.6, count),
        }
    points = OperatingPoints(slip, load, Wheel(radius, width, lugs, 20))
    terms = Terms(effects)
    contact = build_contact(points, soil, 'bekker', terms)
    blank = np.zeros(count)
    drawn_family = Family(contact, terms, load, slip, blank, blank, blank, blank)
    angle, pull, torque, good = drawn_family.solve(
        lambda c, t: quadrature.forces(c, t, REFERENCE_NODES)
    )
    drawn_family.angle, drawn_family.pull = angle, pull
    drawn_family.torque, drawn_family.carried = torque, good
    return drawn_family


def table(count: int, seed: int) -> list[str]:
    """Return the rows of the accuracy table."""
    lines = [
        '| | cases | pull within 5 % of W and sinkage within 10 % | pull, 95 % below | sinkage, '
        '95 % below |',
        '|---|---|---|---|---|',
    ]
    decoupled = [
        '| | cases | within 2 % of W | 95 % below | within 2 %, sinkage below r/2 |',
        '|---|---|---|---|---|',
    ]
    lines += skid_rows(count, seed + 2)
    lines += other_rows(count, seed + 11)
    told: list[str] = []
    for mound in (False, True):
        label = 'with mound' if mound else 'no mound'
        cases = family(count, seed + mound, mound)
        depth = 1.0 - np.cos(cases.angle)
        for name, forces in FORMS.items():
            angle, pull, _, good = cases.solve(forces)
            known = cases.carried & good & (cases.slip <= 0.9)
            pull_error = (np.abs(pull - cases.pull) / cases.load)[known]
            depth_error = np.abs((1.0 - np.cos(angle)) / depth - 1.0)[known]
            lines.append(accuracy(f'{name}, {label}', pull_error, depth_error))
        given = filter_error(cases)
        told.append(f'{100 * np.quantile(given, 0.95):.1f} % ({label})')
        set_angles(cases.contact, cases.angle, None, cases.terms)
        contact = cases.contact
        pull = decoupled_pull(
            cases.torque,
            cases.load,
            contact.entrance_angle,
            contact.peak_angle,
            contact.leaving_angle,
            contact.shear_radius,
        )
        shaped = decoupled_pull_shaped(cases.torque, contact)
        doubtful = replace(contact)
        random = np.random.default_rng(seed + 3)
        for field in ('cohesion', 'tan_friction', 'shear_modulus'):
            factor = 2.0 ** random.uniform(-1.0, 1.0, count)
            setattr(doubtful, field, getattr(contact, field) * factor)
        guessed = decoupled_pull_shaped(cases.torque, doubtful)
        for form, value in (
            ('A, B, C: no soil', pull),
            ('shaped by the soil', shaped),
            ('shaped, c, tan(phi), K off by up to 2', guessed),
        ):
            error = np.abs(value - cases.pull) / cases.load
            known = cases.carried
            shallow = known & (depth < 0.5)
            decoupled.append(
                f'| {form}, {label} | {known.sum()} | {100 * np.mean(error[known] < 0.02):.1f} % '
                f'| {100 * np.quantile(error[known], 0.95):.2f} % of W '
                f'| {100 * np.mean(error[shallow] < 0.02):.1f} % |'
            )
    return [
        *lines,
        '',
        'Soils nobody named: k_phi 0.3 to 6 MPa/m^N, k_c 0 to 20 kPa/m^(N-1), N 0.5 to 1.4, c 0 to '
        '3 kPa, phi 15 to 45 deg, K 2 to 40 mm; wheels, loads and angles as above. Target: 95 % '
        'within 1 % of W, driving and braking. At the true sinkage, as the filter evaluates it, '
        f'95 % of the pulls are within {" and ".join(told)} of W.',
        '',
        'Drawbar pull from torque, load and the true angles (slip to 0.95); target: 95 % of cases '
        'within 2 % of W. The form to use is `decoupled_pull_shaped`, as soon as anything is known '
        'of the soil: c, tan(phi) and K wrong by a factor of two still leave it inside. '
        '`decoupled_pull` is the A, B, C form of the literature for a soil of which nothing is '
        'known; it meets the target without a mound and misses it with one, since a triangle has '
        'the centroid of N = 1 and a mound makes the rear side long. One nominal soil for all '
        '(N = 1, K = 12 mm) in the shaped form does not help: 95 % and 89 %; it is the exponent '
        'that counts.',
        '',
        *decoupled,
    ]


def skid_rows(count: int, seed: int) -> list[str]:
    """Return rows of the accuracy table for the same family in skid, in two ranges."""
    cases = family(count, seed, mound=False, slips=(-0.9, 0.0))
    return [
        row(cases, f'branch moments with nodes in skid, no mound, {label}', chosen)
        for label, chosen in (
            ('slip -0.6 to 0', cases.slip >= -0.6),
            ('slip -0.9 to -0.6', cases.slip < -0.6),
        )
    ]


def other_rows(count: int, seed: int) -> list[str]:
    """Return rows for soils that nobody named: driving with and without mound, braking."""
    return [
        row(
            family(count, seed + k, mound, slips, any_soil),
            f'branch moments, soils nobody named, {label}',
        )
        for k, (label, mound, slips) in enumerate(
            (
                ('slip 0 to 0.9', False, (0.0, 0.9)),
                ('slip 0 to 0.9, with mound', True, (0.0, 0.9)),
                ('slip -0.6 to 0', False, (-0.6, 0.0)),
            )
        )
    ]


def row(cases: Family, label: str, chosen: NDArray[np.bool_] | bool = True) -> str:
    """Return a row of the accuracy table for the branch moments."""
    depth = 1.0 - np.cos(cases.angle)
    angle, pull, _, good = cases.solve(closed_form.forces)
    known = cases.carried & good & chosen
    pull_error = (np.abs(pull - cases.pull) / cases.load)[known]
    depth_error = np.abs((1.0 - np.cos(angle)) / depth - 1.0)[known]
    return accuracy(label, pull_error, depth_error)


def accuracy(label: str, pull_error: FloatArray, depth_error: FloatArray) -> str:
    """Return a row of the accuracy table; errors of pull over load and of sinkage over sinkage."""
    both = np.mean((pull_error < 0.05) & (depth_error < 0.1))
    return (
        f'| {label} | {pull_error.size} | {100 * both:.1f} % '
        f'| {100 * np.quantile(pull_error, 0.95):.2f} % of W '
        f'| {100 * np.quantile(depth_error, 0.95):.2f} % |'
    )


def filter_error(cases: Family) -> FloatArray:
    """Error of the filter's pull at the true sinkage, over the load, where it is carried."""
    contact = cases.contact
    set_angles(contact, cases.angle, None, cases.terms)
    columns = {
        field.name: np.broadcast_to(
            np.asarray(getattr(contact, field.name), float), cases.slip.shape
        )
        for field in fields(contact)
        if field.name not in ('angle', 'normal_stress')  # of the quadrature's nodes
    }
    still = (0.0,) * 5
    errors = []
    for k in np.flatnonzero(cases.carried & (cases.slip <= 0.9)):
        one = replace(contact, **{name: float(values[k]) for name, values in columns.items()})
        _, pull, _, _ = balanced_forces(one, 0.0, still, still)
        errors.append(abs(pull - cases.pull[k]) / cases.load[k])
    return np.array(errors)


def section(shared: Path, figures: Path, count: int = 4000, seed: int = 20) -> str:
    """Return the section."""
    return '\n'.join(
        [
            '## Closed forms against the quadrature',
            '',
            f'{count} random contacts each: {" ".join(family.__doc__.split(".", 1)[1].split())}',
            '',
            *table(count, seed),
            '',
            'Nothing in the branch moments is fitted, so there is no other seed to judge a fit on; '
            'the two constants 8 and 16 of the mobilised share were chosen on cases of their own.',
        ]
    )
