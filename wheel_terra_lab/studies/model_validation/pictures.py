# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Measured points against model curves, one small picture per section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style

LABELS = (('sinkage [mm]', 1e3), ('drawbar pull [N]', 1.0), ('torque [N m]', 1.0))


def compare(
    path: Path,
    # Label -> slip (N,), measured (N, 3); one colour each, in this order
    measured: Mapping[str, tuple[FloatArray, FloatArray]],
    # Label, slip, predicted (N, 3), colour index; negative: dashed
    curves: Sequence[tuple[str, FloatArray, FloatArray, int]],
    columns: Sequence[int] = (0, 1, 2),  # of sinkage, pull, torque
) -> None:
    """Draw points and curves over slip."""
    from matplotlib.figure import Figure

    with picture_style():
        figure = Figure(figsize=(3.1 * len(columns) + 0.3, 2.9))
        axes = np.atleast_1d(figure.subplots(1, len(columns)))
        for axis, column in zip(axes, columns, strict=True):
            text, scale = LABELS[column]
            for index, (label, (slip, values)) in enumerate(measured.items()):
                axis.plot(
                    slip, scale * values[:, column], 'o', ms=4, color=LINE_COLOURS[index],
                    label=label,
                )  # fmt: skip
            for label, slip, values, index in curves:
                axis.plot(
                    slip,
                    scale * values[:, column],
                    '--' if index < 0 else '-',
                    color=LINE_COLOURS[abs(index) - 1 if index < 0 else index],
                    label=label,
                )
            axis.set_xlabel('slip [-]')
            axis.set_ylabel(text)
        if 0 in columns:
            axes[list(columns).index(0)].invert_yaxis()
        axes[-1].legend(fontsize=7)
        save(figure, path)


def save(figure: object, path: Path) -> None:
    """Write an SVG without a date, so that the same picture is the same file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={'Date': None})  # type: ignore[attr-defined]
