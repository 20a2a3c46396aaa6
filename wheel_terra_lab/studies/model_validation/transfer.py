# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Fitted on one wheel, load or slip range and judged on another, for every set of rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_lab.studies.model_validation import cmu_wheel, grc3_wheel, hit_wheels, small_wheels
from wheel_terra_lab.studies.model_validation.fitting import FloatArray, Free, Misfit, Model, fit

Rows = tuple[OperatingPoints, FloatArray]
HIGH_SLIP = 0.3
"""Above it a row counts as high slip: none of the driving advice of the sources goes beyond."""


@dataclass(frozen=True)
class Transfer:
    """A fit to some rows, judged on others; beside it the same parameters fitted there."""

    label: str
    start: Model
    free: Sequence[Free]
    sigma: Sequence[float]
    fitted_on: Rows
    judged_on: Rows
    carried: dict[str, float]  # set for the judged rows only: the other wheel's lug terms

    def line(self) -> str:
        """Return a row of the table."""
        there, measured = self.judged_on
        carried, _ = fit(self.start, [self.fitted_on], self.sigma, self.free)
        own, _ = fit(self.start.with_values(self.carried), [self.judged_on], self.sigma, self.free)
        cells = []
        for model in (carried.with_values(self.carried), own):
            misfit = Misfit.of(model.predict(there), measured)
            cells += [
                f'{100 * misfit.pull_rms / misfit.pull_range:.0f} %',
                f'{1e3 * misfit.sinkage_rms:.1f}',
                f'{misfit.torque_rms:.2f}',
            ]
        text = ' | '.join('-' if 'nan' in cell else cell for cell in cells)
        return f'| {self.label} | {len(measured)} | {text} |'


def _without(free: Sequence[Free], *names: str) -> tuple[Free, ...]:
    return tuple(item for item in free if item.name not in names)


def _hit(shared: Path) -> list[Transfer]:
    table = shared / 'reference' / 'measured_single_wheel.csv'
    smooth, lugged = (
        hit_wheels.read(table, name) for name in ('HIT_Wh34_smooth', 'HIT_Wh32_lug10')
    )
    free = hit_wheels.SMOOTH_PARAMETERS
    base, lugs = hit_wheels.BASE, hit_wheels.PUBLISHED_LUGS
    sigma = hit_wheels.SIGMA
    return [
        Transfer('HIT: smooth to lugs of 10 mm', base, free, sigma, smooth, lugged, lugs),
        Transfer(
            'HIT: lugs of 10 mm to smooth', base.with_values(lugs), free, sigma, lugged, smooth, {}
        ),
    ]


def _kls(shared: Path) -> list[Transfer]:
    table = shared / 'reference' / 'measured_single_wheel.csv'
    smooth, lugged = (hit_wheels.read(table, name) for name in ('KLS1_smooth', 'KLS1_lug10'))
    torque = small_wheels.TORQUE
    base = small_wheels.KLS.with_values({torque.name: torque.expected})
    free = (*small_wheels.BEARING, *small_wheels.KLS_EXTRA, torque)
    lugs = hit_wheels.PUBLISHED_LUGS
    sigma = small_wheels.SIGMA
    return [
        Transfer('KLS-1: smooth to lugs of 10 mm', base, free, sigma, smooth, lugged, lugs),
        Transfer(
            'KLS-1: lugs of 10 mm to smooth',
            base.with_values(lugs), free, sigma, lugged, smooth, {},
        ),
    ]  # fmt: skip


def _cmu(shared: Path) -> list[Transfer]:
    soil, points, measured = cmu_wheel.rows(shared)
    driving = points.slip > -0.01
    heavy = points.normal_load > np.median(points.normal_load[driving])
    steep = points.slip > HIGH_SLIP
    base = Model(soil, cmu_wheel.EFFECTS)

    def part(selected: FloatArray) -> Rows:
        return cmu_wheel.chosen(points, selected), measured[selected]

    def transfer(label: str, first: FloatArray, second: FloatArray) -> Transfer:
        rows = part(driving & first), part(driving & second)
        return Transfer(label, base, cmu_wheel.FREE, cmu_wheel.SIGMA, *rows, {})

    return [
        transfer('CMU smooth: lighter half of the loads to the heavier', ~heavy, heavy),
        transfer('CMU smooth: heavier half of the loads to the lighter', heavy, ~heavy),
        transfer(f'CMU smooth: slip to {HIGH_SLIP:g} to slip above', ~steep, steep),
        transfer(f'CMU smooth: slip above {HIGH_SLIP:g} to slip below', steep, ~steep),
    ]


def _grc3(shared: Path) -> list[Transfer]:
    slip, measured = grc3_wheel.read(shared)
    low = slip < HIGH_SLIP + 0.05  # three rows are recorded a little above 0.3
    rows = [(grc3_wheel.points_at(slip[chosen]), measured[chosen]) for chosen in (low, ~low)]
    base, free, sigma = grc3_wheel.BASE, grc3_wheel.SOIL, grc3_wheel.SIGMA
    return [Transfer(f'GRC-3: slip to {HIGH_SLIP:g} to slip above', base, free, sigma, *rows, {})]


def section(shared: Path, figures: Path) -> str:
    """Return the section."""
    lines = [t.line() for group in (_hit, _kls, _cmu, _grc3) for t in group(shared)]
    return '\n'.join(
        [
            '## Transfer: fitted on one wheel, load or slip, judged on another',
            '',
            'The same parameters are fitted twice: to the rows before "to", and (own fit) to the '
            'judged rows themselves, which is the best that the model can do there. Lugs carry the '
            'terms that Ding et al. 2010 print (lambda 0.5, h s, 1.5 mm), nothing of them fitted.',
            '',
            '| fitted on, judged on | rows judged | pull, of its range | sinkage rms [mm] '
            '| torque rms [N m] | own fit: pull | sinkage | torque |',
            '|---|---|---|---|---|---|---|---|',
            *lines,
            '',
            'What carries over: another load on the same wheel and soil (pull and sinkage within '
            'half as much again of the own fit). What does not: lugs of which only height and '
            'number are known (the pull of a lugged wheel wants at least the two lug parameters '
            'fitted above), and a range of slip that was not measured: below 0.3 nothing tells '
            'the growth of sinkage with slip. A model for high slip has to be fitted at high slip.',
        ]
    )
