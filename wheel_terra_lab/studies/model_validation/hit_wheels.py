# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""HIT wheel (Ding et al. 2011, digitised): fitted smooth, predicted with lugs."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel
from wheel_terra_lab.studies.model_validation.fitting import (
    HEADER,
    FloatArray,
    Free,
    Misfit,
    Model,
    fit,
    left_out,
    listed,
    rows_of,
)
from wheel_terra_lab.studies.model_validation.pictures import compare

SIGMA = (0.0015, 2.0, 0.3)
# Moduli, cohesion, friction angle: soil tests of the source. The rest is where the fit starts.
BASE = Model(
    Soil(15.6e3, 2407.4e3, 1.1, 250.0, np.radians(31.9), 0.008, 0.45, -0.2, 1605.0),
    {'slip_sinkage_exponent': {}, 'stress_peak_shift': {}, 'rim_friction': {}},
)
SMOOTH_PARAMETERS = (
    Free('soil.sinkage_exponent', 1.0, 0.15, 0.5, 1.6),
    Free('effects.slip_sinkage_exponent.n1', 0.4, 0.3, 0.0, 1.5),
    Free('soil.peak_stress_ratio', 0.45, 0.1, 0.2, 0.8),
    Free('effects.stress_peak_shift.c2', 0.2, 0.15, 0.0, 0.5),
    Free('soil.leaving_angle_ratio', -0.2, 0.15, -0.8, -0.01),
    Free('soil.shear_modulus', 0.008, 0.004, 0.002, 0.03),
    Free('effects.rim_friction.loss', 0.2, 0.15, 0.0, 0.6),
)
PUBLISHED_LUGS = {
    'effects.lug_shear_radius.lam': 0.5,
    'effects.lug_digging.kd': 1.0,
    'effects.lug_support.dz4': 0.0015,
}
FITTED_LUGS = (
    Free('effects.lug_digging.kd', 0.7, 0.5, 0.0, 3.0),
    Free('effects.rim_friction.ring_height', 0.015, 0.02, 0.001, 0.05),
)


def read(path: Path, series: str) -> tuple[OperatingPoints, FloatArray]:
    """Return points and measured rows of a digitised series.

    The slip refers to the shear radius, as equation 14 of the authors is printed; the torque at
    zero slip is a placeholder of the digitiser and left out.
    """
    with path.open(encoding='utf-8') as stream:
        rows = [row for row in csv.DictReader(stream) if row['series'] == series]

    def column(name: str) -> FloatArray:
        return np.array([float(row[name] or 'nan') for row in rows])

    points = OperatingPoints(
        column('slip'),
        column('load_N'),
        Wheel(column('radius_m'), column('width_m'), column('lug_height_m'), column('lug_count')),
        slip_radius='shear',
    )
    measured = np.stack(
        [column('sinkage_m'), column('drawbar_pull_N'), column('torque_Nm')], axis=1
    )
    measured[(points.slip == 0.0) & (measured[:, 2] == 0.0), 2] = np.nan
    return points, measured


def _held_out(model: Model, data: tuple[OperatingPoints, FloatArray]) -> FloatArray:
    """Predict each row with lug parameters fitted on every second row, the others."""
    predicted = np.empty_like(data[1])
    even = np.arange(len(data[1])) % 2 == 0
    for fitted_on in (even, ~even):
        fitted, _ = fit(model, [rows_of(data, fitted_on)], SIGMA, FITTED_LUGS)
        predicted[~fitted_on] = fitted.predict(rows_of(data, ~fitted_on)[0])
    return predicted


def section(shared: Path, figures: Path) -> str:
    """Return the section and draw its picture."""
    table = shared / 'reference' / 'measured_single_wheel.csv'
    smooth, lugged = read(table, 'HIT_Wh34_smooth'), read(table, 'HIT_Wh32_lug10')
    model, values = fit(BASE, [smooth], SIGMA, SMOOTH_PARAMETERS)
    published = model.with_values(PUBLISHED_LUGS)
    with_lugs = published.with_values({'effects.lug_digging.rework': 1.0})
    fitted, lug_values = fit(with_lugs, [lugged], SIGMA, FITTED_LUGS)
    slip = np.linspace(0.0, 0.65, 40)
    dense = {
        h: replace(smooth[0], slip=slip, normal_load=80.0, slope=0.0, gravity=9.80665,
                   angular_velocity=np.nan, pass_number=1, leaving_angle=np.nan,
                   wheel=Wheel(0.15735, 0.165, h, 30))
        for h in (0.0, 0.01)
    }  # fmt: skip
    compare(
        figures / 'hit.svg',
        {'smooth': (smooth[0].slip, smooth[1]), 'lugs 10 mm': (lugged[0].slip, lugged[1])},
        [
            ('fitted', slip, model.predict(dense[0.0]), 0),
            ('lug parameters fitted', slip, fitted.predict(dense[0.01]), 1),
            ('as published', slip, published.predict(dense[0.01]), -2),
        ],
    )
    return '\n'.join(
        [
            '## HIT wheel, smooth and with lugs of 10 mm',
            '',
            'Ding et al. 2011, 157 mm x 165 mm, 80 N, read off figures by a third party (about '
            '1 N, 0.5 mm, 0.2 N m at best). Moduli, cohesion and friction angle are those of the '
            f'soil tests. Fitted to the smooth wheel: {listed(values)}. The lugged wheel is '
            'then predicted with lug parameters only: either those that Ding et al. 2010 print '
            '(lambda 0.5, h s, 1.5 mm), or two fitted ones beside the printed lambda and 1.5 mm '
            f'({listed(lug_values)}; digging counted per advance, h s/(1 - s)).',
            '',
            HEADER,
            Misfit.of(model.predict(smooth[0]), smooth[1]).row('smooth, fitted'),
            Misfit.of(left_out(BASE, smooth, SIGMA, SMOOTH_PARAMETERS), smooth[1]).row(
                'smooth, each row by a fit to the others'
            ),
            Misfit.of(published.predict(lugged[0]), lugged[1]).row('lugs, nothing fitted'),
            Misfit.of(fitted.predict(lugged[0]), lugged[1]).row('lugs, two lug parameters'),
            Misfit.of(_held_out(with_lugs, lugged), lugged[1]).row(
                'the same, each row by a fit to every second row without it'
            ),
            '',
            '![HIT wheel](figures/hit.svg)',
            '',
            'Each row by a fit to the others: the last row, s = 0.6, is then extrapolated and the '
            'worst of the smooth wheel.',
            '',
            'Targets: pull within 10 % of its range, sinkage within 1.5 mm rms. With the printed '
            'lug terms the pull misses its target, whatever reading. With two fitted lug '
            'parameters both are met in the root mean square, on rows that the fit did not see as '
            'well; row by row the pull is not: the last row, s = 0.6, lies outside 10 %, fitted or '
            'held out, by 3 to 4 N, where the '
            'digitising itself is good for 1 N. Six rows and two parameters are no independent '
            'prediction: only the held-out line is one. A third one (lambda) brings the worst row '
            'to 9.6 % where it is fitted, but not where it is held out (13.7 %). What the printed '
            'lug terms lack: the measured sinkage of the lugged wheel leaves that of the smooth '
            'one only above s = 0.4 and then by a whole lug height, which a term linear in slip '
            'cannot follow; and the gain of traction over the smooth rim grows with slip, where '
            'a full change to soil friction overshoots at low slip.',
        ]
    )
