# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""KLS-1 and Rashid-1 wheels: small wheels whose soils are only half known."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_lab.studies.model_validation.fitting import (
    HEADER,
    Free,
    Misfit,
    Model,
    fit,
    left_out,
    listed,
    rows_of,
)
from wheel_terra_lab.studies.model_validation.hit_wheels import read
from wheel_terra_lab.studies.model_validation.pictures import compare

SIGMA = (0.001, 1.0, 0.15)
RASHID_SIGMA = (0.001, 0.5, 1.0)
BEARING = (
    Free('soil.frictional_modulus', 820e3, 600e3, 50e3, 2e7),
    Free('soil.sinkage_exponent', 1.0, 0.2, 0.4, 2.0),
    Free('effects.slip_sinkage_exponent.n1', 0.4, 0.4, 0.0, 2.0),
    Free('soil.peak_stress_ratio', 0.4, 0.1, 0.1, 0.85),
    Free('soil.leaving_angle_ratio', -0.2, 0.2, -0.9, -0.001),
    Free('soil.shear_modulus', 0.012, 0.008, 0.001, 0.05),
)
KLS = Model(
    Soil(1.4e3, 820e3, 1.0, 1716.0, np.radians(40.6), 0.018, 0.4, -0.2, 1600.0),
    {'slip_sinkage_exponent': {}, 'rim_friction': {}},
)
KLS_EXTRA = (
    Free('effects.rim_friction.loss', 0.3, 0.3, 0.0, 0.9),
    Free('soil.cohesion', 500.0, 500.0, 0.0, 5000.0),
)
TORQUE = Free('effects.drivetrain_friction.torque', 0.5, 0.5, 0.0, 3.0)
LUGS = (
    Free('effects.lug_shear_radius.lam', 0.5, 0.3, 0.0, 1.0),
    Free('effects.lug_digging.kd', 0.7, 0.5, 0.0, 3.0),
    Free('effects.rim_friction.ring_height', 0.01, 0.02, 0.001, 0.05),
)
RASHID = Model(
    Soil(1.37e3, 820e3, 1.0, 800.0, np.radians(37.2), 0.018, 0.4, -0.2, 1740.0),
    {'slip_sinkage_exponent': {}, 'lug_shear_radius': {'lam': 0.5}, 'lug_digging': {'kd': 0.7}},
)


def section(shared: Path, figures: Path) -> str:
    """Return the section and draw its picture."""
    table = shared / 'reference' / 'measured_single_wheel.csv'
    smooth, lugged = read(table, 'KLS1_smooth'), read(table, 'KLS1_lug10')
    free = (*BEARING, *KLS_EXTRA)
    driven = KLS.with_values({TORQUE.name: TORQUE.expected})
    without, _ = fit(KLS, [smooth], SIGMA, free)
    model, values = fit(driven, [smooth], SIGMA, (*free, TORQUE))
    start = model.with_values(
        {'effects.lug_digging.rework': 1.0, 'effects.lug_shear_radius.lam': 0.5}
    )
    lugs, lug_values = fit(start, [lugged], SIGMA, LUGS)
    rashid = read(table, 'Rashid1_FJS1')
    chosen = np.array([True, False, True, False, True])
    rover, rover_values = fit(RASHID, [rows_of(rashid, chosen)], RASHID_SIGMA, BEARING)
    rest = ~chosen
    compare(
        figures / 'small_wheels.svg',
        {
            'KLS-1 smooth': (smooth[0].slip, smooth[1]),
            'KLS-1 lugs': (lugged[0].slip, lugged[1]),
            'Rashid-1': (rashid[0].slip, rashid[1]),
        },
        [
            ('', smooth[0].slip, model.predict(smooth[0]), 0),
            ('', lugged[0].slip, lugs.predict(lugged[0]), 1),
            ('', rashid[0].slip, rover.predict(rashid[0]), 2),
        ],
    )
    return '\n'.join(
        [
            '## KLS-1 and Rashid-1 wheels',
            '',
            'KLS-1 (85 mm x 80 mm, 59 N): only friction angle and cohesion of the soil were '
            'measured; bearing is fitted. The smooth wheel draws about 1 N m more torque than its '
            'pull can explain at every slip; contact stresses cannot do that, a constant friction '
            f'of the drive can: {listed(values)}. The lugged wheel changes lug parameters only '
            f'({listed(lug_values)}). Rashid-1 in loose FJS-1 (no torque): fitted on three of five '
            f'rows ({listed(rover_values)}), judged on two.',
            '',
            HEADER,
            Misfit.of(without.predict(smooth[0]), smooth[1]).row('KLS-1 smooth, no drive friction'),
            Misfit.of(model.predict(smooth[0]), smooth[1]).row('KLS-1 smooth, drive friction'),
            Misfit.of(left_out(driven, smooth, SIGMA, (*free, TORQUE)), smooth[1]).row(
                'the same, each row by a fit to the others'
            ),
            Misfit.of(lugs.predict(lugged[0]), lugged[1]).row('KLS-1 lugs, lug parameters'),
            Misfit.of(left_out(start, lugged, SIGMA, LUGS), lugged[1]).row(
                'the same, each row by a fit to the others'
            ),
            Misfit.of(rover.predict(rashid[0])[rest], rashid[1][rest]).row('Rashid-1, held out'),
            Misfit.of(left_out(RASHID, rashid, RASHID_SIGMA, BEARING), rashid[1]).row(
                'Rashid-1, each row by a fit to the others'
            ),
            '',
            '![small wheels](figures/small_wheels.svg)',
            '',
            'Fitted figures of five rows say little: with each row left out the pull of both KLS-1 '
            'wheels and of Rashid-1 is missed by a third to the whole of its range, the sinkage by '
            '0.6 to 1.5 mm. '
            'Two rows of Rashid-1 span 1 N only, so the share of the range says little there. The '
            'pull of the KLS-1 wheels falls between s = 0.4 and 0.5 by 2 and 6 N in one step, '
            'which no smooth law follows; five rows do not tell whether that is soil or rig.',
        ]
    )
