# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the picture of a blind trial in the README: ``python tools/readme_pictures.py``.

The trial that ``wheel-terra demo`` runs: measured sinkage under each load, the model as configured
and after the diagnosis, and the gap on rows that the fit did not see.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wheel_terra_estimator.api import plot_diagnosis
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_lab.trials import trial

IMAGE = Path(__file__).resolve().parents[1] / 'docs' / 'images' / 'diagnosis.png'


def main() -> None:
    """Hide, diagnose blind, open the seal, draw."""
    from matplotlib import pyplot

    folder = demo_recording('trial')
    diagnosis = trial.solve_blind(folder)
    outcome = trial.compare(folder, diagnosis)
    columns, curves = diagnosis.table.columns, diagnosis.curves
    with picture_style():
        figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 3.6))
        for i, load in enumerate(np.unique(columns['normal_load'])):
            mine = np.flatnonzero(columns['normal_load'] == load)
            mine = mine[np.argsort(columns['slip'][mine])]
            slip, colour = columns['slip'][mine], LINE_COLOURS[i % len(LINE_COLOURS)]
            measured = 1e3 * diagnosis.table.measured[mine, 0]
            left.plot(slip, measured, 'o', color=colour, markersize=4)
            left.plot(slip, 1e3 * curves.before[mine, 0], ':', color=colour)
            left.plot(slip, 1e3 * curves.after[mine, 0], color=colour, label=f'{load:.0f} N')
        left.set_xlabel('slip ratio [-]')
        left.set_ylabel('sinkage [mm]')
        left.set_title('dots: measured; dotted: model before; lines: after')
        left.legend()
        plot_diagnosis(diagnosis, right)
        right.set_title(f'said: {" + ".join(outcome.said)}; hidden: {outcome.hidden}')
        figure.savefig(IMAGE, dpi=110)
    print(outcome.words)


if __name__ == '__main__':
    main()
