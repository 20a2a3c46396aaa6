# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The search: noise, robust pass, candidates and their weights, until they agree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.fitting import noise as noises
from wheel_terra_estimator.discrepancy.fitting.coordinates import SCATTER, Coordinate
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit, fit
from wheel_terra_estimator.discrepancy.fitting.noise import find_outliers
from wheel_terra_estimator.discrepancy.fitting.problem import (
    CommonError,
    Problem,
    build_problem,
    over_covariance,
    slip_features,
)
from wheel_terra_estimator.discrepancy.result import Noise
from wheel_terra_estimator.discrepancy.selection.signatures import (
    SEEN,
    Signature,
    signatures,
    unavailable,
)
from wheel_terra_estimator.discrepancy.selection.weights import (
    FIT_FLOOR,
    MISFIT,
    MOST_EFFECTS,
    Explanation,
    Selection,
    Setting,
    explain_more,
    explain_swaps,
    explained,
    linear_starts,
    weigh,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, Ground, SteadyTable
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of

Outliers: TypeAlias = Sequence[tuple[int, int, float]]  # row, quantity, deviation of a cell

_FLEXIBLE = 0.25  # floor of the first robust pass: wide enough for any effect [share of range]
_PASSES = 5
_LATENT_FLOOR = 0.03  # structural error allowed while slips are moved [share of range]
_CELLS = 8  # measured cells for each effect of a set, at least
_FIRST_SEEDS = 4  # best single effects to which a second one is added
_SEEDS = 3  # sets of each size to which one effect more is added
_BEHIND = 3.0  # nats behind the best of all, up to which that is done
_KEPT = 30  # best sets that are weighed again, where beds differ
_ROUNDS = 2  # of adding and swapping
_NEAR = 2.0  # nats behind the best one, up to which that is done
_FARTHEST = 2.0  # a slip is moved by at most so many of its deviations
# In a drive: deviation of a wheel's load, as simulated (docs/discrepancy/drives.md) [-], and of
# each wheel's own slip, since radii differ [-]; the latter is assumed.
_LOAD = 0.01
_WHEEL_SLIP = 0.005


@dataclass(frozen=True)
class Findings:
    """Outcome of the search on one table."""

    table: SteadyTable  # all rows, a reference's with them
    setting: Setting  # model, cells, noise as used in the end
    nothing: Fit  # soil refitted only
    selection: Selection
    signatures: Mapping[str, Signature]  # of all effects that the columns can show
    not_visible: Mapping[str, str]  # effect -> reason
    noise: Noise
    outliers: Outliers
    builder: _Builder
    # Effects that might have been named, seen or not, and those that were on already
    tried: frozenset[str] = frozenset()


def search(
    table: SteadyTable,
    forward: Forward,
    nuisance: tuple[Coordinate, ...],
    effects: Mapping[str, Effect],
    floors: tuple[Floor, ...],
) -> Findings:
    """Find noise, outliers and the weights of all explanations by effects that may be named."""
    builder = _Builder(table, forward, nuisance)
    stated = noises.stated_noise(table, builder.scale, builder.trials, builder.reference)
    problem, nothing = builder.fit_nothing(stated.std, (), None)
    if (table.slip_std > 0.0).any():
        builder.linearise(nothing, stated.std)
        problem, nothing = builder.fit_nothing(stated.std, (), nothing)
    if table.true_rows.any():  # a drive's
        load = np.where(table.true_rows, _LOAD * table.columns['normal_load'], 0.0)
        builder.let_err('normal_load', load, np.arange(len(table)), nothing)
    if table.leaving_angle_std.any():
        builder.let_err('leaving_angle', table.leaving_angle_std, np.arange(len(table)), nothing)
    noise = builder.estimate(stated, nothing, ())
    _, nothing = builder.fit_nothing(noise.std, (), nothing)
    # A smooth misfit of any size is allowed here, so that an effect does not look like outliers.
    free = builder.build(noise.std, (), free=True)
    outliers = find_outliers(free, nothing, _FLEXIBLE, builder.narrow)
    if outliers:
        noise = builder.estimate(stated, nothing, outliers)
    lug_height = np.broadcast_to(forward.points.wheel.lug_height, (len(table),))
    reasons = {name: unavailable(effect, table, lug_height) for name, effect in effects.items()}
    possible = {name: effect for name, effect in effects.items() if not reasons[name]}
    apart = [{cell[:2] for cell in outliers}]
    while True:
        problem, nothing = builder.fit_nothing(noise.std, outliers, nothing)
        rim = forward.points.wheel.radius * (1.0 - np.cos(nothing.angle))
        deepest = float(np.max(rim))
        found = signatures(builder.forward, problem, nothing, possible, deepest)
        visible = {name: possible[name] for name, s in found.items() if s.greatest >= SEEN}
        setting = Setting(builder.forward, problem, nuisance, visible, floors, deepest)
        selection = _select(setting, nothing)
        # Outliers are sought anew, from scratch, under the best explanation.
        best = selection.explanations[0].fitted
        floor = floors[int(np.argmax(selection.probability[0]))]
        whole = builder.build(noise.std, ())
        again = find_outliers(whole, best, np.array(floor.amplitude), builder.narrow)
        if {cell[:2] for cell in again} in apart or len(apart) == _PASSES:
            break  # the same cells as before, or as once before: they would go round
        outliers = again
        apart.append({cell[:2] for cell in outliers})
        noise = builder.estimate(stated, best, outliers)
    return Findings(
        table,
        setting,
        nothing,
        selection,
        found,
        _not_visible(reasons, found, selection),
        noise,
        tuple(outliers),
        builder,
        frozenset(map(effect_of, (*effects, *forward.base_effects))),
    )


def apart(findings: Findings, grounds: Mapping[str, Ground]) -> tuple[str, Findings]:
    """Weigh the best explanations once more, where the soil differs as it usually does.

    ``grounds``: what may have soil of its own. Returns which of them fits the soil alone best, and
    the findings.
    """
    alone, builder = list[tuple[float, str, Setting, Fit]](), copy(findings.builder)
    for name, ground in grounds.items():
        setting, nothing = findings.setting, findings.nothing
        for _ in range(2):  # one ground may end far from where several do
            builder.part_grounds(ground, SCATTER[name], setting.problem, nothing)
            problem = builder.build(findings.noise.std, findings.outliers)
            setting = replace(setting, problem=problem)
            nothing = setting.refit(nothing)
        likely = setting.explain(nothing).log_evidence + math.log(ground.odds)
        alone.append((likely, name, setting, nothing))
    _, chosen, setting, nothing = max(alone, key=lambda one: one[0])
    problem, ranked = setting.problem, enumerate(e.fitted for e in findings.selection.explanations)
    best = [f for place, f in ranked if len(f.names) == 1 or (f.names and place < _KEPT)]
    # Linear in both: only what is reported is fitted again.
    moved = [(f, problem.residual(f.outputs), problem.rotation @ f.sensitivity) for f in best]
    fits = (replace(f, residual=left, jacobian=slope) for f, left, slope in moved)
    explanations = [setting.explain(f) for f in (nothing, *fits)]
    selection = weigh(explanations, setting.floors, setting.effects)
    return chosen, replace(findings, setting=setting, nothing=nothing, selection=selection)


def _not_visible(
    reasons: Mapping[str, str], found: Mapping[str, Signature], selection: Selection
) -> dict[str, str]:
    """Return why effects could not have been seen; one visible form is enough to see an effect."""
    why = dict(reasons)
    for key, signature in found.items():
        if signature.distance < SEEN and key not in selection.explanations[0].names:
            why[key] = 'even a large one would stay below the noise on these rows'
    seen = {effect_of(key) for key in why if not why[key]}
    return {effect_of(key): text for key, text in why.items() if effect_of(key) not in seen}


def _ranges(table: SteadyTable) -> FloatArray:
    """(4,) range of each measured quantity, the unit of the floor; robust to single outliers."""
    scale = np.ones(len(QUANTITIES))
    for q in range(len(QUANTITIES)):
        values = np.sort(table.measured[np.isfinite(table.measured[:, q]), q])
        if values.size:
            cut = max(1, values.size // 20) if values.size > 8 else 0
            span = values[-1 - cut] - values[cut]
            scale[q] = max(span, 1e-3 * np.abs(values).max(), 1e-9)
    return scale


def _select(setting: Setting, nothing: Fit) -> Selection:
    """Weigh nothing, single effects and larger sets, as long as these come near the best of all.

    A set that costs more than it gains may lead to one that gains, so that sets some nats behind
    are gone on from as well. Then each effect of the best set is left out, and others are put in
    its place; where that changes it, once more. The best are those if no misfit asked for a name.
    """
    starts = [start for _, start in linear_starts(setting, nothing, tuple(setting.effects))]
    singles = [setting.explain(nothing), *explained(setting, starts)]
    selection = weigh(singles, setting.floors, setting.effects)
    ranked = sorted((e for e in singles if e.names), key=lambda e: -e.log_evidence)
    seeds, extended = ranked[:_FIRST_SEEDS], set[tuple[str, ...]]()
    most = min(MOST_EFFECTS, setting.problem.size // _CELLS)
    swapped: set[frozenset[str]] = set()
    for _ in range(_ROUNDS):
        for size in range(1, most):
            extended |= {e.names for e in seeds}
            selection = _joined_by(setting, selection, explain_more(setting, seeds))
            single = len(selection.explanations[0].names) < 2
            misfit = float(selection.probability[:, selection.unexplained].sum())
            if single and misfit < MISFIT and not _seeds(selection, 2):
                return selection  # one effect or none is enough, and no two come near it
            seeds = [e for e in _seeds(selection, size + 1) if e.names not in extended]
        before = selection.without_misfit(1)[0][1].names
        selection = _with_swaps(setting, selection, swapped)
        top = selection.without_misfit(1)[0][1]
        if top.names == before or len(top.names) >= most:
            break
        seeds = [e for e in _seeds(selection, 1) if e.names not in extended]
    return selection


def _seeds(selection: Selection, size: int) -> list[Explanation]:
    """Return the best sets of a size that are not far behind the best of all, in one form each."""
    leaders = selection.without_misfit(len(selection.explanations))
    found: dict[frozenset[str], Explanation] = {}
    for weight, explanation in leaders:
        if weight < leaders[0][0] - _BEHIND:
            break
        if len(explanation.names) == size:
            found.setdefault(explanation.effects, explanation)
    return list(found.values())[:_SEEDS]


def _with_swaps(setting: Setting, selection: Selection, done: set[frozenset[str]]) -> Selection:
    """Put others in the place of each effect of the best set, or of one near it."""
    leaders = selection.without_misfit(_SEEDS)
    near = [e for weight, e in leaders if weight > leaders[0][0] - _NEAR and len(e.names) > 1]
    best = next((e for e in near if e.effects not in done), None)
    if best is None:
        return selection
    done.add(best.effects)
    return _joined_by(setting, selection, explain_swaps(setting, best))


def _joined_by(setting: Setting, selection: Selection, more: list[Explanation]) -> Selection:
    """Return the selection with further explanations, each set of effects once, in its best fit."""
    known = {frozenset(e.names): e for e in selection.explanations}
    for explanation in more:
        key = frozenset(explanation.names)
        if key not in known or explanation.fitted.objective < known[key].fitted.objective:
            known[key] = explanation
    return weigh(tuple(known.values()), setting.floors, setting.effects)


def _slip_errors(table: SteadyTable) -> list[tuple[FloatArray, IndexArray]]:
    """Return the parts (N,) of the deviation of the slip, and the rows (N,) that share each.

    All wheels of a moment of a drive share the error of its speed. In a table those share one that
    are equal to the last digit, but no set value.
    """
    slip, std, own = table.columns['slip'], table.slip_std, np.arange(len(table))
    if table.true_rows.all() and 'time' in table.columns:
        moment = np.ravel(np.unique(table.columns['time'], return_inverse=True)[1])
        apart = np.minimum(std, _WHEEL_SLIP)
        return [(np.sqrt(std**2 - apart**2), moment.astype(np.intp)), (apart, own)]
    group = np.ravel(np.unique(slip, return_inverse=True)[1])
    nominal = np.abs(slip - np.round(slip, 2)) < 1e-9
    return [(std, np.where(nominal, group.max() + 1 + own, group).astype(np.intp))]


class _Builder:
    """Makes problems of one table, with uncertain inputs where there are some."""

    def __init__(
        self, table: SteadyTable, forward: Forward, nuisance: tuple[Coordinate, ...]
    ) -> None:
        self.table = table
        self.forward = forward
        self.nuisance = nuisance
        self.scale = _ranges(table)
        self.inputs = table.scaled_inputs()
        names = table.varying()
        self.narrow = slip_features(self.inputs, names.index('slip') if 'slip' in names else None)
        self.by_input: list[CommonError] = []
        self._moved: FloatArray | None = None
        self.by_ground: list[CommonError] = []
        # What differs between trials, each on its bed, or from a reference is no noise.
        self.trials = np.zeros(len(table)) if table.sweeps() is None else table.trials()
        self.reference = None if forward.active is None else ~forward.active
        self.apart = self.trials if forward.active is None else 2.0 * self.trials + forward.active

    def let_err(self, name: str, std: FloatArray, group: IndexArray, nothing: Fit) -> None:
        """Take an input of the model for uncertain, linearly around a fit."""
        slope = self.forward.by_input(name, nothing.coordinates, nothing.u, nothing.angle)
        self.by_input.append(CommonError(slope, std, group))

    def linearise(self, nothing: Fit, noise_std: FloatArray) -> None:
        """Linearise the slip errors around the most probable slips, given all quantities.

        Where the curves bend within an error of the slip, a tangent at the reading is not enough.
        """
        slip, errors = self.table.columns['slip'], _slip_errors(self.table)
        for std, group in errors:
            self.let_err('slip', std, group, nothing)
        problem = self.build(noise_std, ())
        jacobian = problem.rotation @ nothing.sensitivity
        target = problem.residual(nothing.outputs) + jacobian @ nothing.u
        variance = problem.variance(_LATENT_FLOOR)
        cells = problem.rotation.T @ over_covariance(target, variance, jacobian)
        by_slip = problem.flat(self.by_input[0].slope)
        moved = np.zeros(len(slip))
        for std, group in errors:
            pull = np.bincount(
                group[problem.row], by_slip * std[problem.row] * cells, minlength=group.max() + 1
            )
            moved += np.clip(pull[group], -_FARTHEST, _FARTHEST) * std
        moved = np.clip(slip + moved, -0.97, 0.97) - slip
        points = replace(self.forward.points, slip=slip + moved)
        self.forward = replace(self.forward, points=points)
        angle = self.forward.solve([nothing.coordinates], [nothing.u], jacobian=False).angle[0]
        slope = self.forward.by_input('slip', nothing.coordinates, nothing.u, angle)
        self.by_input = [CommonError(slope, std, group) for std, group in errors]
        # The reading lies off the point of linearisation: the tangent takes the cells along.
        self._moved = slope * moved[:, None]

    def part_grounds(
        self, ground: Ground, scatter: Mapping[str, float], problem: Problem, nothing: Fit
    ) -> None:
        """Let the soil differ between grounds, linearly around a fit."""
        self.by_ground = []
        for c, column in zip(nothing.coordinates, nothing.sensitivity.T, strict=True):
            if c.owner == 'soil' and c.name in scatter:
                slope = np.zeros(self.table.measured.shape)
                slope[problem.row, problem.quantity] = column / c.scale
                std = scatter[c.name] * ground.share
                self.by_ground.append(CommonError(slope, std, ground.number))

    def build(self, std: FloatArray, outliers: Outliers, *, free: bool = False) -> Problem:
        """Return the problem without some cells; ``free``: trials share no structural error."""
        common = [*self.by_ground, *self.by_input]
        rejected = [(row, quantity) for row, quantity, _ in outliers]
        group = self.apart if free else None
        return build_problem(
            self.table.measured, std, self.inputs, self.scale, rejected, common, self._moved, group
        )

    def fit_nothing(
        self, std: FloatArray, outliers: Outliers, previous: Fit | None
    ) -> tuple[Problem, Fit]:
        """Return the problem, and the fit of the soil alone from a previous one."""
        problem = self.build(std, outliers)
        start = np.zeros(len(self.nuisance)) if previous is None else previous.u
        angles = None if previous is None else previous.angle[None]
        variance, one = problem.variance(FIT_FLOOR), [((), self.nuisance)]
        return problem, fit(self.forward, problem, one, [start], variance, angles, 12)[0]

    def estimate(self, noise: Noise, fitted: Fit, outliers: Outliers) -> Noise:
        """Estimate the noise that was not stated: alike in all rows, or a share of the load."""
        load = self.table.columns['normal_load']
        shapes = np.ones(len(load)), load / np.sqrt(np.mean(load**2))
        return noises.estimate_noise(
            noise, fitted, shapes, lambda std: self.build(std, outliers, free=True)
        )
