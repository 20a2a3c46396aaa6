# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of curves, estimates and diagnoses; each returns its matplotlib axes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.api.arguments import check_kind
from wheel_terra_estimator.api.models import Curve
from wheel_terra_estimator.discrepancy.numbers import SHOWN, axis_label, plain
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.reporting.style import LINE_COLOURS, WARNING_COLOUR, picture_style
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from wheel_terra_estimator.discrepancy.result import Diagnosis

UNKNOWN_CLASS = 255


def plot_curve(
    curves: Curve | Mapping[str, Curve], axes: NDArray[np.object_] | None = None
) -> NDArray[np.object_]:
    """Draw sinkage, drawbar pull and torque over slip; return the (3,) axes.

    ``curves``: one, or several by their labels. ``axes``: (3,), where to draw; default: a new
    figure.
    """
    named = {'': curves} if isinstance(curves, Curve) else curves
    check_kind(named, Mapping, 'curves', 'model.curve(slip, load), or several by their labels')
    for name, curve in named.items():
        check_kind(curve, Curve, f'curve {name!r}', 'model.curve(slip, load)')
    with picture_style():
        panels = _panels(len(OUTPUTS), (10.5, 3.2), columns=True) if axes is None else axes
        for panel, quantity in zip(panels, OUTPUTS, strict=True):
            scale = SHOWN[quantity][0]
            for i, (name, curve) in enumerate(named.items()):
                order = np.argsort(curve.slip, kind='stable')
                panel.plot(
                    curve.slip[order],
                    scale * getattr(curve, quantity)[order],
                    color=LINE_COLOURS[i % len(LINE_COLOURS)],
                    label=name or None,
                )
            panel.set_xlabel('slip ratio [-]')
            panel.set_ylabel(axis_label(quantity))
        if any(named):
            panels[0].legend()
    return panels


def plot_estimates(estimates: Any, quantity: str = 'slip', axes: Axes | None = None) -> Axes:
    """Draw one estimated quantity of all wheels over time, stuck warnings shaded.

    ``estimates``: what ``estimate`` returned. ``quantity``: ``slip`` (where its class is known),
    ``sinkage`` [m], ``drawbar_pull`` [N], ``normal_load`` [N], ... ``axes``: where to draw;
    default: a new figure.
    """
    wheels = [key.partition('.')[2] for key in estimates if str(key).startswith(f'{quantity}.')]
    if not wheels:
        known = dict.fromkeys(str(key).partition('.')[0] for key in estimates if '.' in str(key))
        there = ', '.join(known) or 'none: give what estimate returned'
        raise UserError(f'no quantity {quantity!r}; there are {there}')
    with picture_style():
        panel = _panels(1, (9.0, 3.4))[0] if axes is None else axes
        time = np.asarray(estimates['time'], dtype=float)
        for i, wheel in enumerate(wheels):
            values = np.array(estimates[f'{quantity}.{wheel}'], dtype=float)
            if quantity == 'slip':
                unknown = np.asarray(estimates[f'slip_class.{wheel}']) == UNKNOWN_CLASS
                values[unknown] = np.nan
            panel.plot(time, values, color=LINE_COLOURS[i % len(LINE_COLOURS)], label=wheel)
        stuck = np.concatenate(([False], np.asarray(estimates['stuck'], dtype=bool), [False]))
        edges = np.flatnonzero(np.diff(stuck.astype(int)))
        for start, end in edges.reshape(-1, 2):
            last = time[min(end, time.size - 1)]
            panel.axvspan(time[start], last, color=WARNING_COLOUR, alpha=0.1, linewidth=0)
        panel.set_xlabel('time [s]')
        panel.set_ylabel(plain(quantity))
        panel.legend(ncols=3)
    return panel


def plot_diagnosis(diagnosis: Diagnosis, axes: Axes | None = None) -> Axes:
    """Draw how the held-out error shrinks: as configured, soil refitted, effect added.

    Errors are shares of the error as configured; black marks: noise, where known. ``axes``: where
    to draw; default: a new figure.
    """
    steps = ('before', 'refit', 'after')
    labels = ('as configured', 'soil refitted', 'in the end')
    with picture_style():
        panel = _panels(1, (6.5, 3.2))[0] if axes is None else axes
        width = 0.8 / len(steps)
        for row, (quantity, gap) in enumerate(diagnosis.gap.items()):
            whole = gap.before if gap.before > 0.0 else 1.0
            for k, step in enumerate(steps):
                panel.bar(
                    row + (k - 1) * width,
                    getattr(gap, step) / whole,
                    0.9 * width,
                    color=LINE_COLOURS[k],
                    label=labels[k] if row == 0 else None,
                )
            panel.hlines(
                gap.noise / whole,
                row - 0.4,
                row + 0.4,
                color='black',
                label='noise' if row == 0 else '_',
            )
            panel.annotate(
                plain(quantity),
                (row, 0.0),
                (0, -14),
                ha='center',
                xycoords='data',
                textcoords='offset points',
            )
        panel.set_xticks([])
        panel.set_ylabel('error on unseen rows / as configured [-]')
        panel.set_title(diagnosis.verdict)
        panel.legend(loc='upper center', bbox_to_anchor=(0.5, -0.08), ncols=4)
    return panel


def _panels(count: int, size: tuple[float, float], columns: bool = False) -> NDArray[np.object_]:
    from matplotlib import pyplot

    shape = (1, count) if columns else (count, 1)
    _, axes = pyplot.subplots(*shape, figsize=size, squeeze=False)
    return axes.ravel()
