# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Ding et al. 2010: figures 3 to 5 and every number of the text, from shipped soil and wheels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.terramechanics import closed_form, quadrature
from wheel_terra_estimator.terramechanics.contact import Contact
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.terms import Terms, build_contact, set_angles
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.reproduction.statement import Statement, within
from wheel_terra_lab.studies.model_validation import closed_forms, ding_statements
from wheel_terra_lab.studies.model_validation.ding_statements import SLIPS, crossover, sinkage
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Model

TITLE = 'Ding et al. 2010, J. Cent. South Univ. Technol. 17 (doi 10.1007/s11771-010-0021-7)'
REFERENCE_SHARE = 1e-4  # of the load: where the quadrature is called reference
SEED = 36
MOST_NODES = 256  # on each side of the peak
POINTS = 20_000  # drawn contacts, half of them driving, half skidding
SKIDDING = (-0.9, 0.0)
DRIVING = (0.0, 0.9)
LEAST_PRESSURE = 1e3  # load over 2 r b [Pa], of a wheel that carries something
LEVEL_OF_TEXT = {'z(0)': 5.0, 'z(0.6)': 30.0}  # of wheel 3 [mm]
RATIO = (3.0, 7.0)
WONG_REECE = 5.0  # [mm]
CROSSING_SHARE = 0.15
LUGS = (0.005, 0.010, 0.015)
NOT_FIXED = 'the moduli are not printed: stiffness and angles are free for the two stated sinkages'
CANNOT = 'h s - dz4 of the same paper crosses there whatever the soil: 10 and 15 mm at (3 - 1.5)/5'
TOO_HIGH = 'a support dz4 of 3 mm taken off 5 mm at rest leaves 2 mm to divide by'


def model() -> Model:
    """Return the printed exponents on the shipped soil, stiffness and angles as the text asks."""
    shipped = reader.load(['hit_fit'], complete=False)
    effects = {name: dict(values) for name, values in shipped.effects.items()}
    return ding_statements.printed_model(Model(shipped.soil, effects))


def statements(count: int = POINTS) -> list[Statement]:
    """Return what the paper states beside ours; `count` contacts judge the integration."""
    ding = model()
    return [*_sinkages(ding), *_orders(ding), *(numerics(count) if count else ())]


def draw(path: Path) -> None:
    """Draw the ten curves of figures 3 to 5."""
    ding_statements.draw(model(), path)


def _sinkages(ding: Model) -> list[Statement]:
    third = {height: sinkage(ding, 'Wh3', height) for height in (0.0, *LUGS)}
    found = []
    for (what, said), at in zip(LEVEL_OF_TEXT.items(), (0, -1), strict=True):
        ours = float(third[0.010][at])
        why = f'{within(said, ours, 0.1)[1]}; {NOT_FIXED}'
        found.append(
            Statement('figure 3', f'Wh3: {what} [mm]', f'{said:g}', f'{ours:.1f}', None, why)
        )
    spread = np.abs(sinkage(ding, 'Wh3', 0.01, 8) - sinkage(ding, 'Wh3', 0.01, 30)).max()
    why = 'no term of the model has the number of lugs'
    what = 'lugs 8 to 30 change the sinkage by [mm]'
    found.append(Statement('figure 3', what, 'little', f'{spread:.1f}', None, why))
    for height, curve in third.items():
        ratio = float(curve[-1] / curve[0])
        holds = RATIO[0] <= ratio <= RATIO[1]
        why = '' if holds else TOO_HIGH
        what = f'z(0.6)/z(0) of Wh3, h = {1e3 * height:.0f} mm'
        place = 'figure 4' if height else 'text'
        found.append(Statement(place, what, '3 to 7', f'{ratio:.1f}', holds, why))
    for wheel in ('Wh1', 'Wh2'):
        of = ding_statements.with_printed_exponents(ding, wheel)
        curve = sinkage(of, wheel, 0.01)
        ratio = float(curve[-1] / curve[0])
        holds = RATIO[0] <= ratio <= RATIO[1]
        what = f'z(0.6)/z(0) of {wheel}'
        found.append(Statement('figure 5', what, '3 to 7', f'{ratio:.1f}', holds))
    alone = sinkage(ding.with_values({'effects.slip_sinkage_exponent.n1': 0.0}), 'Wh3', 0.0)
    growth = float(alone[-1] - alone[0])
    what = 'growth by stresses alone, s = 0 to 0.6 [mm]'
    found.append(Statement('text', what, 'below 5', f'{growth:.1f}', growth < WONG_REECE))
    return found


def _orders(ding: Model) -> list[Statement]:
    found = []
    for low, high in ((0.010, 0.015), (0.0, 0.010)):
        ours = crossover(ding, low, high)
        holds, why = within(ding_statements.CROSSING, ours, CROSSING_SHARE)
        what = f'slip above which {1e3 * high:.0f} mm lugs sink more than {1e3 * low:.0f} mm'
        why += '' if holds else f'; {CANNOT if low else "as above, with 1.5 mm over 10 mm"}'
        found.append(Statement('figure 4', what, 'about 0.4', f'{ours:.2f}', holds, why))
    slopes = [float((c[-1] - c[0]) / SLIPS[-1]) for c in (sinkage(ding, 'Wh3', h) for h in LUGS)]
    grows = bool(np.all(np.diff(slopes) > 0.0))
    told = ', '.join(f'{value:.0f}' for value in slopes)
    what = 'slope of z(s) at h = 5, 10, 15 mm [mm]'
    found.append(Statement('figure 4', what, 'grows with h', told, grows))
    one, two, three = (float(sinkage(ding, wheel, 0.01)[-1]) for wheel in ('Wh1', 'Wh2', 'Wh3'))
    for what, more in (('narrower (Wh2 - Wh1)', two - one), ('smaller (Wh1 - Wh3)', one - three)):
        name = f'{what} at s = 0.6 [mm]'
        found.append(Statement('figure 5', name, 'sinks more', f'{more:+.1f}', more > 0.0))
    return found


def numerics(count: int) -> list[Statement]:
    """Return how far quadrature and closed form are from the integrals of equation 19.

    Wheels, named soils (every number +-30 %), slips and entrance angles are drawn; load and pull
    at these angles are compared. The nodes are doubled until both change by less than
    `REFERENCE_SHARE` of the load.
    """
    found = []
    for name, slips in (('driving', DRIVING), ('skidding', SKIDDING)):
        contact, terms = _drawn(count // 2, slips)
        nodes, change, reference = _reference(contact, terms)
        what = f'quadrature, {name}: last doubling changes load or pull by [% of load]'
        asked, told = f'below {100 * REFERENCE_SHARE:g} %', f'{100 * change:.4f}'
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
            told = f'95 % below {most:.3f}, worst {100 * error.max():.2f}'
            what = f'{label}, {name}: error of load or pull [% of load]'
            found.append(Statement('equation 19', what, '-', told, None, 'accuracy of ours'))
    return found


def _drawn(count: int, slips: tuple[float, float]) -> tuple[Contact, Terms]:
    """Return drawn contacts with their angles set: r 0.05 to 0.3 m, entrance 0.15 to 1 rad."""
    random = np.random.default_rng(SEED)
    radius = random.uniform(0.05, 0.3, count)
    wheel = Wheel(radius, radius * random.uniform(0.5, 1.5, count))
    points = OperatingPoints(random.uniform(*slips, count), 1.0, wheel, slip_radius='rim')
    terms = Terms({})
    contact = build_contact(points, closed_forms.named_soil(random, count), 'bekker', terms)
    set_angles(contact, random.uniform(0.15, 1.0, count), None, terms)
    return contact, terms


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
