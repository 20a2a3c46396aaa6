# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a diagnosis. Every function returns a figure and leaves no global state behind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, IndexArray
from wheel_terra_estimator.discrepancy.numbers import SHOWN, axis_label, plain, with_unit
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.reporting.style import INK, LINE_COLOURS, NOISE_COLOUR, picture_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SHOWN_INPUT = {
    'slope': (180.0 / np.pi, 'deg'),
    'wheel_radius': (1e3, 'mm'),
    'wheel_width': (1e3, 'mm'),
    'lug_height': (1e3, 'mm'),
    'leaving_angle': (180.0 / np.pi, 'deg'),
}
RED = LINE_COLOURS[1]
# Levels differ in brightness and in shape as well, for the colour-blind and for grey prints.
_DISCRETE = ('#E69F00', '#009E73', '#0072B2', '#7B4FA3', '#111111', '#D55E00')
_SHAPES = 'os^Dv<'
_MOST_CURVES = 6
_LEGEND_LINE, _LEGEND_MARK, _LEGEND_LETTER = 0.28, 0.45, 0.072  # room they take [inch]


def shown_input(name: str) -> tuple[float, str]:
    """Return factor and unit of an input in pictures."""
    return SHOWN_INPUT.get(name, (1.0, unit_of(name)))


def curves_over_slip(diagnosis: Diagnosis) -> Figure | None:
    """Draw measurement and model over slip, one curve for each setting of the other inputs.

    None where the table has no sweeps of slip, or too many to be distinguished.
    """
    table, curves = diagnosis.table, diagnosis.curves
    groups = _sweeps(diagnosis)
    if not groups:
        return None
    slip = table.columns['slip']
    others = [plain(name) for name in table.varying() if name != 'slip']
    texts = [*([f'{", ".join(others)}:'] if others else []), *(text for text, _ in groups)]
    models = ['model as configured', f'model {_last(diagnosis)}']
    with picture_style():
        figure, axes = _panels(1, table.quantities, height=3.0)
        for axis, name in zip(axes[0], table.quantities, strict=True):
            q, (scale, unit) = QUANTITIES.index(name), SHOWN[name]
            axis.set(xlabel='slip', title=plain(name), ylabel=f'[{unit}]')
            kept = np.isfinite(table.measured[:, q]) & ~_rejected_cells(diagnosis, q)
            for (_, rows), colour, shape in zip(groups, _DISCRETE, _SHAPES, strict=False):
                for values, style in ((curves.before, ':'), (curves.after, '-')):
                    axis.plot(slip[rows], scale * values[rows, q], style, color=colour, lw=1.2)
                mine = rows[kept[rows]]
                axis.errorbar(
                    slip[mine],
                    scale * table.measured[mine, q],
                    2 * scale * diagnosis.noise.std[mine, q],
                    fmt=shape,
                    ms=4.5,
                    color=colour,
                    elinewidth=0.9,
                )
        from matplotlib.lines import Line2D

        marks = _marks(len(groups))
        lines = [Line2D([], [], ls=style, color=INK, lw=1.2) for style in (':', '-')]
        if others:
            marks = [Line2D([], [], ls=''), *marks]
        _legend(figure, marks, texts, 'lower left')
        _legend(figure, lines, models)
    return figure


def _sweeps(diagnosis: Diagnosis) -> list[tuple[str, IndexArray]]:
    """Return values and rows, by slip, of each setting of the inputs other than slip."""
    table = diagnosis.table
    others = [name for name in table.varying() if name != 'slip']
    keys = np.column_stack([table.columns[name] for name in others] or [np.zeros(len(table))])
    _, group = np.unique(np.round(np.nan_to_num(keys), 6), axis=0, return_inverse=True)
    group = np.ravel(group)
    found = []
    for g in range(group.max() + 1):
        rows = np.flatnonzero(group == g)
        if len(np.unique(table.columns['slip'][rows])) < 3:
            continue
        text = []
        for name in others:
            factor, unit = shown_input(name)
            text.append(with_unit(f'{factor * table.columns[name][rows[0]]:.3g}', unit))
        ordered = rows[np.argsort(table.columns['slip'][rows], kind='stable')]
        found.append((', '.join(text) or 'measured', ordered))
    covered = sum(len(rows) for _, rows in found)
    return found if len(found) <= _MOST_CURVES and 2 * covered > len(table) else []


def residuals(diagnosis: Diagnosis, colour_by: str) -> Figure:
    """Draw measured minus model against slip, coloured by an input, before and after.

    Columns: as configured, soil refitted, effect added (without one, the refit again).
    The grey band is two standard deviations of noise and floor.
    """
    curves, table = diagnosis.curves, diagnosis.table
    stages = [('as configured', curves.before), ('soil refitted', curves.refit)]
    if diagnosis.effects:
        stages.append((_last(diagnosis), curves.after))
    factor, unit = shown_input(colour_by)
    slip, colour = table.columns['slip'], factor * table.columns[colour_by]
    order = np.argsort(slip)
    few = np.unique(np.round(colour[np.isfinite(colour)], 9))
    discrete = len(few) <= 5
    texts = [with_unit(f'{plain(colour_by)} {value:.3g}', unit) for value in few]
    with picture_style():
        figure, axes = _panels(len(table.quantities), stages, height=1.95, shared=True)
        drawn: Any = None
        for row, name in zip(axes, table.quantities, strict=True):
            q, scale = QUANTITIES.index(name), SHOWN[name][0]
            outside = _rejected_cells(diagnosis, q)
            error = [scale * (table.measured[:, q] - values[:, q]) for _, values in stages]
            reach = 1.12 * max(float(np.nanmax(np.abs(e[~outside]))) for e in error)
            for axis, (title, _), residual in zip(row, stages, error, strict=True):
                half = 2 * scale * curves.band[order, q]
                known, bare = np.isfinite(half), {'color': NOISE_COLOUR, 'lw': 0, 'zorder': 0}
                axis.fill_between(slip[order][known], -half[known], half[known], **bare)
                axis.axhline(0.0, color=INK, lw=0.8)
                if discrete:
                    for value, shade, shape in zip(few, _DISCRETE, _SHAPES, strict=False):
                        chosen = ~outside & np.isclose(colour, value)
                        axis.plot(slip[chosen], residual[chosen], shape, ms=4, color=shade)
                else:
                    drawn = axis.scatter(
                        slip[~outside],
                        residual[~outside],
                        c=colour[~outside],
                        s=17,
                        cmap='viridis',
                        vmin=np.nanmin(colour),
                        vmax=np.nanmax(colour),
                    )
                axis.plot(slip[outside], np.clip(residual[outside], -reach, reach), 'x', color=RED)
                if name == table.quantities[0]:
                    axis.set_title(title)
                if name == table.quantities[-1]:
                    axis.set_xlabel('slip')
                if axis is row[0]:
                    axis.set_ylabel(axis_label(name))
            row[0].set_ylim(-reach, reach)
        if discrete:
            _legend(figure, _marks(len(few)), texts)
        else:
            text = plain(colour_by) if unit == '-' else f'{plain(colour_by)} [{unit}]'
            bar = figure.colorbar(drawn, ax=axes, label=text, pad=0.01, aspect=25)
            bar.outline.set_visible(False)
            bar.ax.grid(visible=False)
    return figure


def colour_input(diagnosis: Diagnosis) -> str:
    """Return the input by which residuals are coloured: where the gap is, load, slope, any."""
    varying = diagnosis.table.varying()
    box = [side.input for side in diagnosis.where.box]
    wanted = dict.fromkeys((*box, 'normal_load', 'slope', *varying))
    found = (name for name in wanted if name in varying and name != 'slip')
    return next(found, 'normal_load')


def _panels(
    rows: int, columns: Sequence[Any], height: float, *, shared: bool = False
) -> tuple[Figure, Any]:
    """Return a figure with (rows, columns) axes, each so high [inch]; ``shared``: rows share y."""
    from matplotlib.figure import Figure

    count = len(columns)
    width = {1: 6.5, 2: 4.1}.get(count, 3.4) * count
    figure = Figure(figsize=(width, 0.7 + rows * (height + 0.3)), layout='constrained')
    axes = figure.subplots(
        rows, count, squeeze=False, sharex=shared, sharey='row' if shared else False
    )
    for axis in axes.flat:
        axis.locator_params(nbins=5)
    return figure, axes


def _marks(count: int) -> list[Any]:
    from matplotlib.lines import Line2D

    kinds = list(zip(_DISCRETE, _SHAPES, strict=True))[:count]
    return [Line2D([], [], marker=shape, ms=5, ls='', color=colour) for colour, shape in kinds]


def _legend(figure: Figure, handles: Any, labels: Any, place: Any = 'upper left') -> None:
    """Put a legend above the panels, or below, in as many columns as there is room for."""
    widest = max(_LEGEND_MARK + _LEGEND_LETTER * len(text) for text in labels)
    columns = max(1, int(figure.get_figwidth() / widest))
    share = _LEGEND_LINE * -(-len(labels) // columns) / figure.get_figheight()
    engine: Any = figure.get_layout_engine()
    left, bottom, width, height = engine.get()['rect']
    bottom += share if place == 'lower left' else 0.0
    engine.set(rect=(left, bottom, width, height - share))
    figure.legend(handles, labels, loc=place, ncols=columns, columnspacing=1.4, handletextpad=0.4)


def _last(diagnosis: Diagnosis) -> str:
    names = [plain(effect.name) for effect in diagnosis.effects]
    return f'with {" and ".join(names)}' if names else 'soil refitted'


def _rejected_cells(diagnosis: Diagnosis, q: int) -> BoolArray:
    mask = np.zeros(len(diagnosis.table), dtype=bool)
    for row, quantity, _ in diagnosis.outliers:
        mask[row] |= QUANTITIES.index(quantity) == q
    return mask
