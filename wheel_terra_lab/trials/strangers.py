# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Strangers kept for scoring: no rule of the workflow was chosen with them in sight."""

from __future__ import annotations

import numpy as np

from wheel_terra_lab.trials.hidden import Change, Kind, fixed, mean_load
from wheel_terra_lab.trials.truth import Hidden, Rows, Setup, TrueSoil


def _carriage(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """The carriage that guides the wheel binds: the soil carries more where slip is high."""

    def prepare(setup: Setup, rows: Rows) -> None:
        setup.load = setup.load * (1.0 + size * np.clip(rows['slip'], 0.0, 1.0))

    return Change('binding_carriage', prepare)


def _curved_envelope(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """The strength of the soil grows with less than the pressure."""

    def prepare(setup: Setup, rows: Rows) -> None:
        pressure = rows['normal_load'] / (rows['wheel_width'] * rows['wheel_radius'])
        setup.tan_phi = setup.tan_phi * (pressure / np.mean(pressure)) ** -size

    return Change('curved_envelope', prepare)


def _collapse(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """Beyond a slip the bed under the wheel collapses: stiffness drops within a narrow band."""
    edge = 0.3 + 0.3 * secondary

    def prepare(setup: Setup, rows: Rows) -> None:
        share = 0.5 * (1.0 + np.tanh((rows['slip'] - edge) / 0.04))
        setup.stiffness = setup.stiffness * (1.0 - size * share)

    return Change('collapse', prepare)


def _sinkage_stop(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """The sinkage sensor flattens towards the end of its travel."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        z = out['sinkage']
        top = np.nanmax(z)
        out['sinkage'] = z - size * top * np.clip(z / top - 0.5, 0.0, None) ** 2

    return Change('sinkage_stop', None, finish)


def _hysteresis(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """The pull reading lags: what it shows depends on how fast pull grows with slip."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        lag = np.exp(-np.clip(rows['slip'], 0.0, 1.0) / (0.05 + 0.15 * secondary))
        out['drawbar_pull'] = out['drawbar_pull'] - size * mean_load(rows) * lag

    return Change('lagging_pull', None, finish)


def _bulge(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """Soil pressed out at the sides carries as well: the more so the deeper the rut."""

    def prepare(setup: Setup, rows: Rows) -> None:
        relative = rows['normal_load'] / mean_load(rows)
        setup.width = setup.width * (1.0 + size * relative * np.clip(rows['slip'], 0.0, 1.0) ** 2)

    return Change('side_bulge', prepare)


SCORED = {
    'binding_carriage': Kind(_carriage, fixed(0.1), 6, signed=True),
    'curved_envelope': Kind(_curved_envelope, fixed(0.1), 5, needs=('normal_load',)),
    'collapse': Kind(_collapse, fixed(0.2), 4),
    'sinkage_stop': Kind(_sinkage_stop, fixed(0.3), 5),
    'lagging_pull': Kind(_hysteresis, fixed(0.05), 10, signed=True),
    'side_bulge': Kind(_bulge, fixed(0.15), 8),
}
