# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady measurements against a model: which physical effect is missing."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wheel_terra_estimator.api.arguments import check_kind
from wheel_terra_estimator.api.models import Model
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration

if TYPE_CHECKING:
    from wheel_terra_estimator.discrepancy.result import Diagnosis
    from wheel_terra_estimator.discrepancy.tables.header import Choice
    from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

_WORSE = 1.05
"""Error on unseen rows, refitted over as configured, that is told."""


def diagnose(
    data: Any,
    model: Model | Configuration | str | Path | Sequence[str | Path],
    *,
    reference: Any = None,
    effects: str | Sequence[str] | None = None,
    remaps: Mapping[str, str] | None = None,
    smooth: bool = False,
    columns: Mapping[str, Any] | str | Path | None = None,
    ignore_columns: Sequence[str] = (),
) -> Diagnosis:
    """Find where measurements and a model disagree, and name the effect that is missing.

    ``Diagnosis.to_dict()`` is ``report.json``. Raises UserError for input that cannot be used, with
    row or column and the remedy.

    Parameters
    ----------
    data : DataFrame, mapping or path
        Columns of steady measurements (``docs/tables.md``), a CSV file of them, or a rosbag2. Units
        stand in the titles (``sinkage [mm]``) or in ``attrs['units']`` of a DataFrame; else SI.
    model : Model, Configuration, or names of configuration files
        The prior model.
    reference : DataFrame, mapping or path, optional
        Measurements in which the effect in question is absent; fitted first, so that structural
        error common to both cancels.
    effects : str or sequence of str, optional
        Effects that may be named; default: all of the catalogue. None at all (``[]``) fits the soil
        alone, as ``Soil.fit`` does.
    remaps : mapping, optional
        For a bag: the estimator's topic -> the bag's.
    smooth : bool
        For a bag: slip from the fixed-interval smoother, see ``docs/discrepancy/drives.md``.
    columns : mapping or path, optional
        Which column of the table is what, where its titles do not say: ``{'sinkage': '-z [mm]'}``,
        or a YAML file of such lines.
    ignore_columns : sequence of str
        Titles of columns of numbers that are left out; ``['all']``: whatever is not understood.

    Examples
    --------
    >>> import numpy as np
    >>> slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 12), [60.0, 90.0]))
    >>> rows = Model.load('hit_wh3', 'hit_fit').curve(slip, load).columns()
    >>> measured = {name: rows[name] for name in ('slip', 'normal_load', 'sinkage', 'torque')}
    >>> diagnose(measured, ['hit_wh3', 'hit_fit'], effects=['cohesion']).verdict
    'agrees'
    """
    from wheel_terra_estimator.discrepancy.tables.header import Choice
    from wheel_terra_estimator.discrepancy.workflow import Options
    from wheel_terra_estimator.discrepancy.workflow import diagnose as run

    configuration = _configuration(model)
    choice = Choice.of(columns or {}, ignore_columns)
    table = _table(data, 'data', configuration, remaps or {}, smooth, choice)
    before = None
    if reference is not None:
        before = _table(reference, 'reference', configuration, remaps or {}, smooth, choice)
    named = [effects] if isinstance(effects, str) else effects
    options = Options(None if named is None else tuple(named))
    return run(table, configuration, before, options)


def corrected_model(diagnosis: Diagnosis) -> Model:
    """Return the model after a diagnosis: soil refitted, named effects added.

    The same as ``Model.load`` of the configuration and the written ``model.yaml``. Warns if the
    verdict is open and a quantity is predicted worse on rows that the fit did not see than by the
    model as configured: the refit compensates for a missing effect.
    """
    from wheel_terra_estimator.discrepancy.report.model_file import corrected
    from wheel_terra_estimator.discrepancy.result import OPEN

    worse = [
        f'{name} {100.0 * (gap.after / gap.before - 1.0):.0f} %'
        for name, gap in diagnosis.gap.items()
        if gap.after > _WORSE * gap.before
    ]
    if diagnosis.verdict in OPEN and worse:
        words = (
            f'verdict {diagnosis.verdict}: the refitted soil predicts unseen rows worse than the '
            f'configured one ({", ".join(worse)}); keep that (diagnosis.configuration) until the '
            'verdict is settled (diagnosis.next_measurement)'
        )
        warnings.warn(words, stacklevel=2)
    return Model.of(corrected(diagnosis)[0])


def _configuration(
    model: Model | Configuration | str | Path | Sequence[str | Path],
) -> Configuration:
    if isinstance(model, Model):
        return model.configuration
    if isinstance(model, Configuration):
        return model
    files = [model] if isinstance(model, str | Path) else model
    check_kind(files, Sequence, 'model', "Model(wheel, soil) or ['hit_wh3', 'hit_fit']")
    return reader.load(files, complete=False)


def read(data: Any, name: str, choice: Choice) -> SteadyTable:
    """Return a table of steady rows: a DataFrame, a mapping, or a CSV file."""
    from wheel_terra_estimator.discrepancy.tables.parsing import read_table, table_of

    if isinstance(data, str | Path):
        return read_table(data, choice)
    return table_of(data, name, choice)


def _table(
    data: Any,
    name: str,
    configuration: Configuration,
    remaps: Mapping[str, str],
    smooth: bool,
    choice: Choice,
) -> SteadyTable:
    if not isinstance(data, str | Path) or Path(data).suffix.lower() in ('.csv', '.txt'):
        return read(data, name, choice)
    from wheel_terra_estimator.discrepancy.drives.windows import rows_from_bag

    return rows_from_bag(Path(data), configuration, remaps, smooth=smooth).table()
