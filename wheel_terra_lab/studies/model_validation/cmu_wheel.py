# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""CMU smooth wheel in sand: bearing from plates, fitted apart from the wheel tests."""

from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.model_validation.fitting import (
    HEADER,
    Free,
    Misfit,
    Model,
    fit,
    listed,
)
from wheel_terra_lab.studies.model_validation.pictures import compare

WHEEL = Wheel(0.058, 0.050)
SIGMA = (0.001, 1.0, 1.0)
EFFECTS: dict[str, dict[str, float]] = {'slip_sinkage_exponent': {}, 'stress_peak_shift': {}}
FREE = (
    Free('effects.slip_sinkage_exponent.n1', 0.3, 0.4, 0.0, 2.0),
    Free('effects.stress_peak_shift.c2', 0.1, 0.2, -0.3, 0.5),
    Free('soil.friction_angle', np.radians(30.0), 0.1, 0.2, 0.8),
    Free('soil.shear_modulus', 0.008, 0.006, 0.001, 0.04),
    Free('soil.peak_stress_ratio', 0.4, 0.1, 0.2, 0.8),
    Free('soil.leaving_angle_ratio', -0.2, 0.2, -0.8, -0.001),
)
SKID_EXPONENT = Free('effects.slip_sinkage_exponent.n2', 0.0, 0.5, -2.0, 3.0)
SKID_PEAK = Free('effects.stress_peak_shift.skid', 0.0, 0.5, -1.0, 1.0)
# Soil that rises behind a wheel at high slip: needed by a model of all slips, driving and braking.
MOUND = (
    Free('effects.soil_mound.kappa', 1.0, 2.0, 0.0, 8.0),
    Free('effects.soil_mound.onset', 0.5, 0.2, 0.0, 0.9),
)
BULLDOZING = Free('effects.bulldozing.kb', 0.5, 0.5, 0.0, 5.0)
# Terms of the braking wheel, fitted one set after the other.
BRAKING = {
    'n2': (SKID_EXPONENT,),
    'n2 and skid': (SKID_EXPONENT, SKID_PEAK),
    'n2 and bulldozing': (SKID_EXPONENT, BULLDOZING),
}


def plates(path: Path) -> tuple[Soil, float, dict[str, float]]:
    """Fit (kc/b + kphi) z^n to all plate tests, depths 3 to 25 mm, b the plate's radius."""
    tests: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    with path.open(encoding='utf-8') as stream:
        for row in csv.DictReader(stream):
            if row['indenter'].startswith('plate'):
                tests[row['test'], row['indenter']].append(
                    (1e-3 * float(row['sinkage_mm']), float(row['force_N']))
                )
    depth, pressure, size = [], [], []
    for (_, indenter), rows in tests.items():
        diameter = 1e-3 * float(indenter.removeprefix('plate_').removesuffix('mm'))
        curve = np.array(sorted(rows))
        grid = np.arange(0.003, min(0.025, curve[-1, 0]), 0.001)
        depth += list(grid)
        pressure += list(np.interp(grid, *curve.T) / (np.pi * diameter**2 / 4))
        size += [diameter / 2] * grid.size
    z, p, b = (np.array(values) for values in (depth, pressure, size))
    found = least_squares(
        lambda x: np.log(1e3 * x[0] / b + 1e6 * x[1]) + x[2] * np.log(z) - np.log(p),
        (1.0, 1.0, 1.0),
    )
    soil = Soil(
        1e3 * found.x[0], 1e6 * found.x[1], found.x[2], 50.0, np.radians(30.0), 0.008, 0.4, -0.2
    )
    values = {'soil.cohesive_modulus': soil.cohesive_modulus}
    values['soil.frictional_modulus'] = soil.frictional_modulus
    values['soil.sinkage_exponent'] = soil.sinkage_exponent
    return soil, float(np.sqrt(np.mean(found.fun**2))), values


def rows(shared: Path) -> tuple[Soil, OperatingPoints, FloatArray]:
    """Return the soil of the plates, all steady rows without side slip, and their measurements."""
    folder = shared / 'measured' / 'cmu_single_wheel'
    soil, _, _ = plates(folder / 'pressure_sinkage.csv')
    with (folder / 'steady_state.csv').open(encoding='utf-8') as stream:
        found = [row for row in csv.DictReader(stream) if row['beta_cmd_deg'] == '0']
    found.sort(key=lambda row: float(row['slip_ratio']))

    def column(name: str) -> FloatArray:
        return np.array([float(row[name]) for row in found])

    measured = np.full((len(found), 3), np.nan)
    measured[:, 0], measured[:, 1] = 1e-3 * column('sinkage_mm'), column('drawbar_pull_N')
    slip = np.clip(column('slip_ratio'), -1.0, 1.0)
    return soil, OperatingPoints(slip, column('vertical_load_N'), WHEEL), measured


def chosen(points: OperatingPoints, selected: BoolArray) -> OperatingPoints:
    """Return some of the rows."""
    return OperatingPoints(points.slip[selected], points.normal_load[selected], WHEEL)


def section(shared: Path, figures: Path) -> str:
    """Return the section and draw its picture."""
    soil, everything, measured = rows(shared)
    _, rms, plate_values = plates(shared / 'measured' / 'cmu_single_wheel' / 'pressure_sinkage.csv')
    slip = everything.slip

    def points(selected: BoolArray) -> OperatingPoints:
        return chosen(everything, selected)

    base = Model(soil, EFFECTS)
    rolling = np.abs(slip) < 0.01
    driving = slip > -0.01
    first = driving & (np.arange(slip.size) % 2 == 0)
    judge = driving & ~first
    off = base.with_values(
        {'effects.slip_sinkage_exponent.n1': 0.0, 'effects.stress_peak_shift.c2': 0.0}
    )
    static = off.predict(points(rolling))
    plain = off.predict(points(judge))
    model, values = fit(base, [(points(first), measured[first])], SIGMA, FREE)
    braking = ~driving
    skid_first = braking & (np.arange(slip.size) % 2 == 0)
    skid_judge = braking & ~skid_first
    turning = skid_judge & (slip > -0.99)
    skids = {
        label: fit(
            model.with_values({item.name: item.expected for item in free}),
            [(points(skid_first), measured[skid_first])],
            (0.003, 3.0, 1.0),
            free,
        )
        for label, free in BRAKING.items()
    }
    skid, _ = skids['n2 and skid']
    fitted = '; '.join(f'{label}: {listed(values)}' for label, (_, values) in skids.items())
    both = np.concatenate(
        [(m.predict(points(c)) - measured[c])[:, 0] for m, c in ((model, judge), (skid, turning))]
    )
    dense = np.linspace(-0.98, 0.95, 90)
    curve = OperatingPoints(dense, 24.0, WHEEL)
    compare(
        figures / 'cmu.svg',
        {'measured': (slip, measured)},
        [
            ('plates only', dense, off.predict(curve), 1),
            ('slip-sinkage fitted', dense, skid.predict(curve), 2),
        ],
        columns=(0, 1),
    )
    measured_static = 1e3 * np.mean(measured[rolling, 0])
    return '\n'.join(
        [
            '## CMU smooth wheel: bearing from plates',
            '',
            'Wheel of 58 mm x 50 mm, 18 to 26 N, no torque. Nine plate tests (60, 80, 100 mm) give '
            f'{listed(plate_values)} (rms {100 * rms:.0f} % in pressure). With that and no '
            'effect at all, the rolling wheel is predicted to sink '
            f'{1e3 * np.mean(static[:, 0]):.1f} mm '
            f'against {measured_static:.1f} mm measured. The other parameters are fitted on every '
            f'second driving row ({listed(values)}) and judged on the rest. Braking rows follow '
            'from the exponent on |s| with nothing fitted to them; a coefficient of their own (n2 '
            'beyond n1), a peak angle of their own (skid) and soil pushed ahead are then fitted to '
            f'every second of them ({fitted}). The driving coefficient serves in skid nearly as '
            'it is. A leaving angle that moves with skid was tried in their place: no better.',
            '',
            HEADER,
            Misfit.of(plain, measured[judge]).row('driving, held out, plates only'),
            Misfit.of(model.predict(points(judge)), measured[judge]).row(
                'driving, held out, fitted'
            ),
            Misfit.of(model.predict(points(skid_judge)), measured[skid_judge]).row(
                'braking, held out, driving model'
            ),
            *(
                Misfit.of(m.predict(points(skid_judge)), measured[skid_judge]).row(
                    f'braking, held out, {label}'
                )
                for label, (m, _) in skids.items()
            ),
            Misfit.of(skid.predict(points(turning)), measured[turning]).row(
                'braking, held out, n2 and skid, without the locked wheel'
            ),
            '',
            f'Sinkage over all held-out rows of a turning wheel, driving and braking: '
            f'{1e3 * np.sqrt(np.mean(both**2)):.1f} mm rms (target 3 mm).',
            '',
            '![CMU wheel](figures/cmu.svg)',
            '',
            'A locked wheel (s = -1) drags at twice its load and 50 mm of sinkage on a radius of '
            '58 mm: that is a plough, beyond any contact-stress model.',
        ]
    )
