# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the picture of a diagnosis in the README: ``python tools/readme_pictures.py``.

A wheel that digs in with slip, measured with noise (model-made, known seed); the model that knows
nothing of it, and the model after ``diagnose`` has named the effect.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.api import Model, corrected_model, diagnose, plot_diagnosis
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style

IMAGE = Path(__file__).resolve().parents[1] / 'docs' / 'images' / 'diagnosis.png'
FILES = ('hit_wh3', 'dlr_mss')
HIDDEN = (
    'effects.slip_sinkage_exponent.enabled:=true',
    'effects.slip_sinkage_exponent.n1:=0.4',
)
NOISE = {'sinkage': 4e-4, 'drawbar_pull': 0.6, 'torque': 0.06}  # [m], [N], [N m]
LOADS = (60.0, 90.0, 120.0)  # [N]
SEED = 7


def main() -> None:
    """Measure, diagnose, draw."""
    from matplotlib import pyplot

    random = np.random.default_rng(SEED)
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.03, 0.6, 12), LOADS))
    before = Model.load(*FILES)
    true = Model.load(*FILES, parameters=HIDDEN).curve(slip, load).columns()
    rows = {'slip': slip, 'normal_load': load}
    for name, std in NOISE.items():
        rows[name] = true[name] + std * random.standard_normal(slip.size)
        rows[f'{name}_std'] = np.full(slip.size, std)
    diagnosis = diagnose(rows, before)
    after = corrected_model(diagnosis)
    with picture_style():
        figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 3.6))
        fine = np.linspace(0.0, 0.62, 60)
        for i, weight in enumerate(LOADS):
            colour = LINE_COLOURS[i]
            mine = load == weight
            left.plot(slip[mine], 1e3 * rows['sinkage'][mine], 'o', color=colour, markersize=4)
            left.plot(fine, 1e3 * before.curve(fine, weight).sinkage, ':', color=colour)
            left.plot(
                fine, 1e3 * after.curve(fine, weight).sinkage, color=colour, label=f'{weight:g} N'
            )
        left.set_xlabel('slip ratio [-]')
        left.set_ylabel('sinkage [mm]')
        left.set_title('dots: measured; dotted: model before; lines: after')
        left.legend()
        plot_diagnosis(diagnosis, right)
        right.set_title(f'missing: {", ".join(e.name for e in diagnosis.effects)}')
        figure.savefig(IMAGE, dpi=110)
    print(diagnosis.sentence)


if __name__ == '__main__':
    main()
