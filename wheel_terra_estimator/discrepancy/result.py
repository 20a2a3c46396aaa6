# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Result of a diagnosis: typed, for pictures, and written as ``report.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.terramechanics.effects.base import FORM_MARK

if TYPE_CHECKING:
    from wheel_terra_estimator.configuration.reader import Configuration
    from wheel_terra_estimator.discrepancy.assessment.along import Change
    from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit

_ASIDE: Mapping[str, Any] = {'json': False}  # metadata of a field that is no part of report.json
OPEN = ('unexplained', 'undecided')  # verdicts for which a law may be proposed


@dataclass(frozen=True)
class FittedParameter:
    """A fitted parameter: ``value`` and ``std`` in ``unit``."""

    value: float
    std: float
    unit: str
    meaning: str = field(default='', metadata=_ASIDE)


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was added to the model."""

    name: str  # as ``claim`` in the catalogue
    parameters: Mapping[str, FittedParameter]  # parameter name -> fitted parameter
    confidence: float  # probability that the name is right, calibrated on synthetic campaigns
    confidence_of_set: float  # probability that the name or one of ``confounded_with`` is right
    # Effects that the data cannot separate from it, most probable first
    confounded_with: tuple[str, ...] = ()
    remainder: bool = False  # True where something smooth is left that it does not explain
    claim: str = field(default='', metadata=_ASIDE)
    # What the confidence was computed from (``confidence.FEATURES``)
    features: Mapping[str, float] = field(default_factory=dict, metadata=_ASIDE)
    form: str = ''  # which form of the effect; empty where it has one only
    # What looks like it and was not tried
    alike: tuple[str, ...] = field(default=(), metadata=_ASIDE)


@dataclass(frozen=True)
class Candidate:
    """One set of effects that was fitted, the empty one (``nothing``) included."""

    names: tuple[str, ...] = field(metadata=_ASIDE)  # the effects in it
    # Log marginal likelihood relative to ``nothing``: above 0 the data favour it
    log_evidence: float
    probability: float  # posterior probability among all fitted sets
    parameters: Mapping[str, FittedParameter]  # ``effect.parameter`` -> fitted parameter
    why_not: str  # why it was not added; empty for the chosen one
    name: str  # names joined for people
    form: str  # forms of the effects, where they are not the first ones

    @property
    def label(self) -> str:
        """Names with their forms, where these are not the first ones."""
        parts = (key.partition(FORM_MARK) for key in self.names)
        return ' + '.join(f'{n} ({form})' if form else n for n, _, form in parts) or 'nothing'


@dataclass(frozen=True)
class QuantityGap:
    """Root-mean-square error of one quantity on rows that the fit did not see [its unit].

    ``noise`` is the stated or estimated standard deviation (an uncertain slip included), ``fitted``
    the error of the written model on all rows. ``limit`` is what noise and the allowed model error
    permit: an ``after`` beyond it wants an explanation.
    """

    before: float
    refit: float
    after: float
    noise: float
    fitted: float = 0.0
    limit: float = math.inf


@dataclass(frozen=True)
class LeftOut:
    """Errors on levels of an input that were left out: soil refitted, and with the law."""

    refit: float
    law: float


@dataclass(frozen=True)
class Proposal:
    """A law in the closures of the model for what no listed effect explains."""

    words: str  # statement of the law
    # Each term changes a target with a feature (``effects.learned_closure`` lists both)
    targets: tuple[str, ...]
    features: tuple[str, ...]
    coefficients: tuple[float, ...]
    coefficients_std: tuple[float, ...]
    # Quantity -> as in ``Diagnosis.gap``, with the law as ``after``
    gap: Mapping[str, QuantityGap]
    resembles: tuple[str, ...]  # listed effects of like signature
    not_trusted: tuple[str, ...]  # where it must not be used
    # Input -> quantity -> errors on whole levels of the input that were left out
    left_out: Mapping[str, Mapping[str, LeftOut]]
    # As in ``Diagnosis``, refitted with the law
    soil: tuple[SoilShift, ...] = field(default=(), metadata=_ASIDE)
    bed: tuple[SoilShift, ...] = field(default=(), metadata=_ASIDE)
    refitted: Mapping[str, FittedParameter] = field(default_factory=dict, metadata=_ASIDE)
    fit: Fit | None = field(default=None, metadata=_ASIDE)  # the fitted model, law included
    # Refit and law hold the soil where it is plausible: another soil alone would leave no gap,
    # but is too far from the configured one
    soil_held: bool = False
    # Share of the refit's gap on left-out levels that the law closes
    closed: float = field(default=0.0, metadata=_ASIDE)


@dataclass(frozen=True)
class InputRange:
    """One side of the box in which the gap is largest."""

    input: str
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Where:
    """Where model (soil refitted) and measurement disagree most."""

    sentence: str  # for people
    quantity: str  # the quantity with the largest share of the misfit
    # Quantity -> share of the squared misfit in excess of the noise, 0..1
    shares: Mapping[str, float]
    # Region with the largest gap; empty = everywhere (a constant shift)
    box: tuple[InputRange, ...]
    rows: IndexArray  # indices of the table rows inside the box
    share_of_gap: float  # share of the misfit inside
    p_value: float  # of the box, calibrated by the parametric bootstrap of the soil refit


@dataclass(frozen=True)
class NextMeasurement:
    """A measurement that would settle what stays open."""

    what: str  # for people
    separates: tuple[str, ...]  # the two competitors (``nothing`` may be one)
    # Distances between the competitors' best fits in noise standard deviations, before and with it
    distance_now: float
    distance_then: float
    # Column -> values of the proposed rows (SI); None for a zero check of an instrument
    rows: Mapping[str, FloatArray] | None = None


@dataclass(frozen=True)
class SoilShift:
    """A soil number, or a parameter of an effect that was on, before and after the fit.

    ``z_score`` is the shift in deviations of ``prior_std``, ``source`` says where these come from.
    """

    name: str
    before: float
    prior_std: float
    refit: float
    after: float
    after_std: float
    z_score: float
    unit: str
    source: str = ''


@dataclass(frozen=True)
class Curves:
    """(N, 4) model values of the table's rows: sinkage, drawbar pull, torque.

    ``before`` = as configured, ``refit`` = soil refitted, ``after`` = effects added; the
    ``held_out`` pair was computed row by row from fits that did not see the row. ``alone`` is
    ``after`` without the structural error that a reference shows: no model file has it. ``band`` is
    one standard deviation of noise plus floor.
    """

    before: FloatArray
    refit: FloatArray
    after: FloatArray
    held_out_refit: FloatArray
    held_out_after: FloatArray
    alone: FloatArray
    band: FloatArray


@dataclass(frozen=True)
class Noise:
    """Standard deviation of each cell and how it was found.

    ``std`` (N, 4) [m, N, N m]; ``origin`` quantity -> ``given``, ``repeats`` or ``estimated``.
    """

    std: FloatArray
    origin: Mapping[str, str]
    # Quantity -> pooled deviation of rows that repeat one another, its degrees of freedom
    repeatability: Mapping[str, tuple[float, int]] = field(default_factory=dict)
    # The same over the stated deviation of each row, of table and reference separately
    scatter: Mapping[str, tuple[float, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """Everything a diagnosis found."""

    verdict: str  # ``agrees``, ``named``, ``unexplained`` or ``undecided``
    sentence: str  # the verdict in one or two sentences
    table: SteadyTable = field(metadata=_ASIDE)
    configuration: Configuration = field(metadata=_ASIDE)
    effects: tuple[NamedEffect, ...]  # strongest first; empty unless ``named``
    candidates: tuple[Candidate, ...]  # best first, ``nothing`` among them
    gap: Mapping[str, QuantityGap]  # quantity -> QuantityGap
    # Effect -> why these rows could not have shown it
    not_visible: Mapping[str, str] = field(metadata=_ASIDE)
    # Effect -> (parameter, smallest size that these rows would have shown, unit)
    smallest_visible: Mapping[str, tuple[str, float, str]] = field(metadata=_ASIDE)
    where: Where
    next_measurement: tuple[NextMeasurement, ...]
    curves: Curves = field(metadata=_ASIDE)
    noise: Noise = field(metadata=_ASIDE)
    soil: tuple[SoilShift, ...]  # of the bed of the reference, where there are two
    # The same with the parameters of effects that were on
    moved: tuple[SoilShift, ...] = field(metadata=_ASIDE)
    # Row index, quantity, deviation in standard deviations of the cells that were rejected
    outliers: tuple[tuple[int, str, float], ...] = field(metadata=_ASIDE)
    gap_p_value: float  # of the test "the soil alone explains these rows"
    # Of what is left after the fit, and the smooth part in it as a share of the range
    remainder_p_value: float = field(metadata=_ASIDE)
    remainder_amplitude: float = field(metadata=_ASIDE)
    floor: float  # model-error floor in use, as a share of each quantity's range
    # Warnings for people (units, duplicates, constant columns, shifted soil numbers)
    notes: tuple[str, ...] = ()
    # Soil numbers of the bed under diagnosis, where it is another one; ``before`` = the reference's
    bed: tuple[SoilShift, ...] = ()
    base_effects: tuple[str, ...] = ()  # effects that the configuration had switched on already
    # ``effect.parameter`` -> fitted value, of parameters that were on already
    refitted: Mapping[str, FittedParameter] = field(default_factory=dict)
    nearest: tuple[str, ...] = ()  # where none was identified: the nearest effects
    # Quantities whose residuals change along the order of the rows
    along_rows: tuple[Change, ...] = ()
    proposal: Proposal | None = None  # A law for what no listed effect explains, where one helps
    # Column -> factor by which it has to be multiplied, or what it is, where it looks misread
    misread: Mapping[str, float | str] = field(default_factory=dict)
    # Effect of the catalogue that was not tried -> why
    not_tried: Mapping[str, str] = field(default_factory=dict)
    seconds: float = field(default=0.0, metadata=_ASIDE)  # time the diagnosis took

    def __repr__(self) -> str:
        """Return the verdict as text, and the error of each quantity on unseen rows."""
        errors = (
            f'{name} [{unit_of(name)}]: unseen rows off by {gap.before:.3g} as configured, '
            f'{gap.refit:.3g} soil refitted, {gap.after:.3g} in the end'
            for name, gap in self.gap.items()
        )
        return '\n  '.join((f'Diagnosis: {self.sentence}', *errors))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of ``report.json``: finite numbers, text and lists only."""
        freely = {
            'soil_pulls': {
                key: {'pull': shift.z_score, 'std': std, 'source': shift.source}
                for shift in self.moved
                for key, std in (self._stated_std(shift),)
            },
            'not_visible': sorted(self.not_visible),
            'why_not_visible': self.not_visible,
            'smallest_visible': {
                key: {'parameter': parameter, 'value': value, 'unit': unit}
                for key, (parameter, value, unit) in self.smallest_visible.items()
            },
            'noise': {
                quantity: {
                    'std': float(np.nanmedian(self.noise.std[:, column])),
                    'origin': self.noise.origin[quantity],
                    'repeatability': self.noise.repeatability.get(quantity, (None, 0))[0],
                }
                for column, quantity in enumerate(QUANTITIES)
                if quantity in self.noise.origin
            },
            'outliers': [
                {'line': int(self.table.lines[row]), 'quantity': quantity, 'deviation': size}
                for row, quantity, size in self.outliers
            ],
            'remainder': {'p_value': self.remainder_p_value, 'amplitude': self.remainder_amplitude},
            'rows': len(self.table.lines),
            'table': self.table.name,
        }
        plain: dict[str, Any] = as_json({**as_json(self), **freely})
        return plain

    def _stated_std(self, shift: SoilShift) -> tuple[str, float]:
        """Return the key of a soil number below ``soil.`` and its deviation in that key's unit."""
        if shift.name == 'stiffness':
            modulus = float(self.configuration.soil.frictional_modulus)
            return 'frictional_modulus', shift.prior_std * modulus
        if shift.name == 'tan_friction':
            return 'friction_angle_deg', math.degrees(shift.prior_std / (1.0 + shift.before**2))
        return shift.name, shift.prior_std


def as_json(value: Any) -> Any:
    """Turn results into dicts, lists, text and finite numbers: JSON has no NaN.

    A dataclass gives its fields but those marked as no part of the report.
    """
    if is_dataclass(value):
        own = [f.name for f in fields(value) if f.metadata.get('json', True)]
        return {name: as_json(getattr(value, name)) for name in own}
    if isinstance(value, Mapping):
        return {key: as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return as_json(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
