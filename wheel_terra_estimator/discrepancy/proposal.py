# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Find a sparse law in the closures of the model, and test it on rows that were left out.

Terms (a target changed by a feature, see ``learned_closure``) are added one at a time, by evidence
beyond the length of their description, soil and all terms refitted; then each is left out again.
The law is proposed only where it predicts whole levels of an input that were left out better than
the soil refit does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IndexArray
from wheel_terra_estimator.discrepancy.assessment.held_out import (
    error,
    hold_out,
    kept_cells,
    level_groups,
    slip_groups,
)
from wheel_terra_estimator.discrepancy.fitting.coordinates import narrowed
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.numbers import SHOWN, amount, number, plain, with_unit
from wheel_terra_estimator.discrepancy.result import LeftOut, Proposal, QuantityGap
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.selection.signatures import against_soil
from wheel_terra_estimator.discrepancy.selection.verdict import (
    LARGEST_Z_SCORE,
    MOST_ODDS,
    TEMPERATURE,
    largest_z_score,
)
from wheel_terra_estimator.discrepancy.selection.weights import (
    Explanation,
    Setting,
    explain_fewer,
    explained,
    linear_starts,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    INPUT_COLUMNS,
    QUANTITIES,
    SteadyTable,
)
from wheel_terra_estimator.frames import unit_of
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import (
    EFFECT,
    FEATURES,
    NAME,
    PRODUCTS,
    TARGETS,
    pair_of,
)
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints

MOST_TERMS = 4
_TRIED = 6  # terms of the greatest expected gain that are fitted in each step
_WORTH = 3.0  # nats by which a term must raise the evidence beyond its description length
_LEVELS = 6  # levels of an input that are left out one at a time, at most
_CLOSED = 0.15  # share of the gap on what was left out that a law must close
_SMALL_FLOOR = 0.015  # structural error that stays beside a law [share of the range]
_WORSE = 1.1  # times the soil refit: an error of one quantity that no law may reach ...
_FINE = 1.35  # ... unless it is no more than so many times the noise, ...
_PAYS = 5.0  # ... or so many times as much (in squared noise deviations) goes from the others
_HOLDS = (2.5, 5.0, 10.0, 20.0, 40.0)  # times narrower: until the refitted soil is plausible
_PRIOR_OF_LAW = 0.1  # probability of a law of one term beside the names: about that of a misfit
_ALIKE = 0.8  # cosine of two signatures from which one resembles the other
_RESEMBLING = 3
# Terms that are near a named effect, or equivalent to it in one of its forms.
_LIKE = {
    'exponent_by_slip': 'slip_sinkage_exponent',
    'peak_angle_by_slip': 'stress_peak_shift',
    'sinkage_by_slip': 'lug_digging',
    'torque_by_one': 'drivetrain_friction',
    'drawbar_pull_by_one': 'pull_zero',
    'sinkage_by_one': 'sinkage_offset',
    'shear_modulus_by_load': 'shear_deformation',
    'shear_modulus_by_slip': 'shear_deformation',
    'exponent_by_load': 'slip_sinkage_exponent',
    'drawbar_pull_by_load': 'pull_zero',
    'torque_by_torque_squared': 'torque_gain',
}
# Features that grow with slip: whichever, the term is the same in other words.
_GROWING = ('slip', 'slip_squared', 'slip_over_02', 'slip_over_04', 'slip_over_06')
# Inputs of which any influence on the soil has one name.
_LIKE_ON_SOIL = {'pass': 'multipass', 'rim_speed': 'rate_dependence'}
_LEVEL_INPUTS = (
    'normal_load',
    'lug_height',
    'wheel_radius',
    'wheel_width',
    'angular_velocity',
    'pass_number',
    'slope',
)


@dataclass(frozen=True)
class Gap:
    """What a decision leaves of a table: laws, or effects, are judged by how much they close."""

    table: SteadyTable  # the rows under diagnosis (a reference not among them)
    findings: Findings
    # As reported: ``before``, ``noise`` and the range of each quantity are taken from it
    reported: Mapping[str, QuantityGap]
    variance: FloatArray  # (m,) of the rotated axes, for the predictions of what was left out

    def unseen(self, fitted: Fit) -> dict[str, dict[str, LeftOut]]:
        """Return the errors on left-out levels of the refit and of a set of effects."""
        setting, nothing = self.findings.setting, self.findings.nothing
        fits = [setting.refit(f, self.variance) for f in (nothing, fitted)]
        return self.on_levels(setting, fits)

    def leaves_noise(self, unseen: Mapping[str, Mapping[str, LeftOut]]) -> bool:
        """Return whether errors on left-out levels are noise, and what error is allowed.

        Three to five hidden effects ended at up to 1.7 times, sets that imitate other laws at 1.8,
        and 4.9 to 12.
        """
        return all(
            item.law <= self.reported[name].limit
            for column, quantities in unseen.items()
            for name, item in quantities.items()
            if column != 'pass_number'  # without one of few passes their law is open
        )

    @cached_property
    def measured(self) -> FloatArray:
        """(N, 4) cells that the model has to match; nan where they were rejected."""
        # Where slips are latent the model stands at the most probable one.
        moved = self.findings.setting.problem.moved[: len(self.table)]
        return kept_cells(self.table, self.findings) + moved

    def left_out(
        self, setting: Setting, fits: Sequence[Fit], groups: IndexArray
    ) -> dict[str, LeftOut]:
        """Return the errors of soil refit and law on groups that their fits did not see."""
        reference = np.full(len(setting.forward.points) - len(groups), -1)
        groups = np.concatenate([groups, reference]).astype(np.intp)
        outputs = hold_out(setting, fits, self.variance, groups)
        return {
            quantity: LeftOut(*(error(out, self.measured, q) for out in outputs))
            for q, quantity in enumerate(QUANTITIES)
            if np.isfinite(self.measured[:, q]).any()
        }

    def on_levels(self, setting: Setting, fits: Sequence[Fit]) -> dict[str, dict[str, LeftOut]]:
        """Return input -> errors on whole levels of it; of the slips where nothing else varies."""
        varying = set(self.table.varying())
        found = {}
        for name in _LEVEL_INPUTS:
            if name in varying:
                groups = level_groups(np.nan_to_num(self.table.columns[name], nan=-1.0), _LEVELS)
                found[name] = self.left_out(setting, fits, groups)
        return found or {'slip': self.left_out(setting, fits, slip_groups(self.table))}

    def closed(self, left_out: Mapping[str, Mapping[str, LeftOut]]) -> float:
        """Share of the gap on what was left out that a law closes; 0: it worsens a quantity."""
        open_refit = open_law = lost = gained = 0.0
        worsened = False
        for quantities in left_out.values():
            for name, item in quantities.items():
                noise = self.reported[name].noise or 1e-9
                worsened |= item.law > max(_WORSE * item.refit, _FINE * noise)
                refit, law = (item.refit / noise) ** 2, (item.law / noise) ** 2
                lost += max(law - refit, 0.0)
                gained += max(refit - law, 0.0)
                open_refit += max(refit - 1.0, 0.0)
                open_law += max(law - 1.0, 0.0)
        if worsened and gained < _PAYS * lost:
            return 0.0
        return 1.0 - math.sqrt(open_law / open_refit) if open_refit > 0.0 else 0.0

    def is_closed_by(self, law: Proposal) -> bool:
        """Return whether unseen slips are predicted better with a law than as reported without."""
        both = {q: LeftOut(g.refit, law.gap[q].after) for q, g in self.reported.items()}
        return self.closed({'slip': both}) > _CLOSED


def propose(gap: Gap, *, hold_soil: bool = False) -> Proposal | None:
    """Return the law that the rows ask for; None where none predicts what was left out.

    ``hold_soil`` where it is plausible, in the refit as well: where only another soil leaves no
    gap, the law has to do without it, or is none.
    """
    findings, variance = gap.findings, gap.variance
    # A large smooth error would absorb the law.
    floors = tuple(floor for floor in findings.setting.floors if floor.largest <= _SMALL_FLOOR)
    setting = replace(findings.setting, effects=_terms(gap.table), floors=floors)
    plain = setting.refit(findings.nothing)
    for factor in _HOLDS if hold_soil else ():
        if _can_be_believed(plain):
            break
        setting = replace(setting, nuisance=narrowed(findings.setting.nuisance, factor))
        plain = setting.fit([()], [np.zeros(len(plain.u))], findings.nothing.angle)[0]
    nothing = setting.explain(plain)
    refit = setting.refit(plain, variance)
    best, most = None, _CLOSED
    for law in _search(setting, nothing):
        fitted = setting.refit(law.fitted, variance)
        if hold_soil and not _can_be_believed(fitted):
            continue
        left_out = gap.on_levels(setting, [refit, fitted])
        closed = gap.closed(left_out)
        if closed > most:
            best, most = (fitted, left_out), closed
    if best is None:
        return None
    found = _proposal(gap, setting, refit, *best)
    return replace(found, closed=most, soil_held=hold_soil)


@dataclass(frozen=True)
class Rival:
    """What explains rows and has no name in the catalogue: names compete with it."""

    total: float  # log of prior times evidence
    words: str
    like: str = ''  # effect that comes near it, or is the same

    def odds(self, total: float) -> float:
        """Return the odds of it against an explanation of that total, tempered."""
        return math.exp(min((self.total - total) / TEMPERATURE, MOST_ODDS))


def rivals(table: SteadyTable, findings: Findings) -> tuple[Rival, ...]:
    """Return the laws of one term that come nearest to the rows."""
    terms = _terms(table)
    setting = replace(findings.setting, effects=terms)
    starts = linear_starts(setting, findings.nothing, tuple(terms))
    nearest = sorted(starts, key=lambda s: -s[0])[:_TRIED]
    prior = math.log(_PRIOR_OF_LAW / max(len(terms), 1))
    return tuple(
        Rival(law.log_evidence + prior, f'a law ({plain(law.names[0])})', like(law.names[0]))
        for law in explained(setting, [start for _, start in nearest])
    )


def like(term: str) -> str:
    """Return the effect that a term of a law comes near, or is; empty if there is none."""
    target, feature = pair_of(term)
    inputs = FEATURES[feature].factors or (feature,)
    whole = [_LIKE_ON_SOIL[name] for name in inputs if name in _LIKE_ON_SOIL]
    if whole and target not in QUANTITIES:
        return whole[0]
    return _LIKE.get(f'{target}_by_slip' if feature in _GROWING else term, '')


def _can_be_believed(fitted: Fit) -> bool:
    return largest_z_score(fitted) < LARGEST_Z_SCORE


def _terms(table: SteadyTable) -> dict[str, Effect]:
    """Return the terms whose features vary in the table, each as an effect of one parameter."""
    varying = set(table.varying())
    measured = set(table.quantities)
    found = {}
    for parameter in EFFECT.parameters:
        target, feature = pair_of(parameter.name)
        parts = [FEATURES[part].columns for part in FEATURES[feature].factors or (feature,)]
        known = all(
            not columns or any(len(_levels(table, c)) > 2 for c in varying & set(columns))
            for columns in parts
        )
        if known and target not in set(QUANTITIES) - measured:
            found[parameter.name] = replace(EFFECT, parameters=(parameter,))
    return found


def _levels(table: SteadyTable, column: str) -> FloatArray:
    """Return the values of an input; of two, neither can be left out and come back."""
    values = table.columns[column]
    return np.unique(np.round(values[np.isfinite(values)], 9))


def _search(setting: Setting, nothing: Explanation) -> list[Explanation]:
    """Return laws of one, two, ... terms, each with the greatest evidence."""
    price = _description_lengths(setting.effects)

    def worth(law: Explanation) -> float:
        return law.log_evidence - sum(price[name] for name in law.names)

    best, found = nothing, list[Explanation]()
    for _ in range(MOST_TERMS):
        others = [name for name in setting.effects if name not in best.names]
        starts = linear_starts(setting, best.fitted, others)
        starts = sorted(starts, key=lambda s: price[s[1][0][-1]] - s[0])[:_TRIED]
        top = max(explained(setting, [s for _, s in starts]), key=worth, default=None)
        if top is None or worth(top) < worth(best):
            break
        best = top
        found.append(best)
    if len(best.names) > 2:
        fewer = max(explain_fewer(setting, best), key=worth)
        if worth(fewer) > worth(best):  # later terms have made one idle
            found.append(fewer)
    return found


def _description_lengths(terms: Iterable[str]) -> dict[str, float]:
    """Return the description length of each term [nats]; a product has a second feature."""
    single = [name for name in terms if pair_of(name)[1] not in PRODUCTS]
    plain = math.log(max(len(single), 1)) + _WORTH
    second = math.log(max(len({pair_of(name)[1] for name in single}), 1))
    return {name: plain if name in single else plain + second for name in terms}


def _proposal(
    gap: Gap, setting: Setting, refit: Fit, law: Fit, left_out: Mapping[str, Mapping[str, LeftOut]]
) -> Proposal:
    by_slip = gap.left_out(setting, [refit, law], slip_groups(gap.table))
    terms = [number for number in law.numbers() if number.coordinate.owner == NAME]
    names, values = [t.coordinate.name for t in terms], tuple(t.value for t in terms)
    alone = setting.at(gap.findings.table.columns['slip'], law.coordinates, law.u)
    measured = kept_cells(gap.table, gap.findings)
    gaps = {
        quantity: replace(
            gap.reported[quantity],
            refit=by_slip[quantity].refit,
            after=by_slip[quantity].law,
            fitted=error(alone, measured, q),
        )
        for q, quantity in enumerate(QUANTITIES)
        if quantity in by_slip
    }
    return Proposal(
        law_in_words(names, values, gap.table, setting.forward.points),
        tuple(pair_of(name)[0] for name in names),
        tuple(pair_of(name)[1] for name in names),
        values,
        tuple(t.std for t in terms),
        gaps,
        _resembling(gap.findings, refit, law),
        limits_of_trust(gap.table),
        left_out,
        fit=law,
    )


def _resembling(findings: Findings, refit: Fit, law: Fit) -> tuple[str, ...]:
    """Return named effects whose signature points the same way, beyond what the soil can do."""
    problem, nothing = findings.setting.problem, findings.nothing
    own = problem.rotation @ problem.flat(law.outputs - refit.outputs)
    weighted = against_soil(nothing, nothing.variance, own)
    size = math.sqrt(max(float(own @ weighted), 1e-30))
    alike: dict[str, float] = {}
    for key, signature in findings.signatures.items():
        far = signature.distance * size
        cosine = float(signature.change @ weighted) / far if far > 0.0 else 0.0
        alike[effect_of(key)] = max(abs(cosine), alike.get(effect_of(key), 0.0))
    order = sorted(alike, key=lambda name: -alike[name])
    same = [like(c.name) for c in law.coordinates if c.owner == NAME and like(c.name)]
    found = [*same, *(name for name in order if alike[name] > _ALIKE)]
    return tuple(dict.fromkeys(found))[:_RESEMBLING]


_TWICE = math.log(2.0)  # from which a growth is stated as a factor
# Feature -> for which step of it a change is stated, and that step.
_PER = {
    'one': ('everywhere alike', 1.0),
    'slip': ('per 0.1 of slip', 0.1),
    'slip_squared': ('with the square of slip, at 1', 1.0),
    'slip_over_02': ('per 0.1 of slip beyond 0.2', 0.1),
    'slip_over_04': ('per 0.1 of slip beyond 0.4', 0.1),
    'slip_over_06': ('per 0.1 of slip beyond 0.6', 0.1),
    'slip_near_02': ('in a band of slip around 0.2', 1.0),
    'slip_near_04': ('in a band of slip around 0.4', 1.0),
    'slip_near_06': ('in a band of slip around 0.6', 1.0),
    'load': ('per doubling of the load', math.log10(2.0)),
    'lug': ('per 0.05 r of lug height', 0.05),
    'width': ('per 0.1 r of width', 0.1),
    'rim_speed': ('per decade of rim speed', 1.0),
    'pass': ('per earlier pass', 1.0),
    'slope': ('per 10 degrees of slope', math.radians(10.0)),
    'depth': ('per 0.01 r of sinkage', 0.01),
    'pull': ('per 0.1 W of drawbar pull', 0.1),
    'torque': ('per 0.1 W r of torque', 0.1),
    'torque_squared': (
        'with the square of the torque, where T^2 is 0.1 W r times rho g b r^3',
        0.1,
    ),
}


def law_in_words(
    names: Sequence[str], coefficients: Sequence[float], table: SteadyTable, points: OperatingPoints
) -> str:
    """Return the terms in words: "torque grows by 0.1 N m (4 % of its mean) per decade of ..."."""
    parts = []
    for name, value in zip(names, coefficients, strict=True):
        target, feature = pair_of(name)
        law = TARGETS[target]
        per, step = _per(feature)
        change = value * step
        change *= law.bound / (law.bound + abs(change))
        if law.factor and change > _TWICE:
            parts.append(
                f'{law.meaning} grows to {number(math.exp(change), 2)} times as much {per}'
            )
            continue
        if law.factor:
            size = f'{number(100 * abs(math.expm1(change)), 2)} %'
        elif law.unit == '-':
            size = f'{number(abs(change), 2)}'
        else:
            size = _size(target, abs(change), table, points)
        parts.append(f'{law.meaning} {"grows" if change > 0.0 else "falls"} by {size} {per}')
    text = '; '.join(parts)
    return f'{text[0].upper()}{text[1:]}, beyond what the soil explains.'


def _per(feature: str) -> tuple[str, float]:
    """Return for which step of a feature a change is stated, and that step."""
    parts = [_PER[part] for part in FEATURES[feature].factors or (feature,)]
    words = ' times '.join(text.removeprefix('per ') for text, _ in parts)
    return parts[0][0] if len(parts) == 1 else f'per {words}', math.prod(s for _, s in parts)


def _size(target: str, change: float, table: SteadyTable, points: OperatingPoints) -> str:
    """Return a change of an angle or an output in the units of the rows."""
    if target not in QUANTITIES:
        return f'{number(100 * change, 2)} % of the entrance angle'
    rows = slice(len(table))
    load = np.asarray(points.normal_load)[rows]
    radius = np.broadcast_to(points.wheel.radius, (len(points),))[rows]
    scale = {'sinkage': radius, 'drawbar_pull': load, 'torque': load * radius}[target]
    size = change * float(np.mean(scale))
    mean = float(np.nanmean(np.abs(table.measured[:, QUANTITIES.index(target)])))
    shown = f'{amount(target, size, 2)} {SHOWN[target][1]}'
    return f'{shown} ({number(100 * size / mean, 2)} % of its mean)' if mean else shown


def limits_of_trust(table: SteadyTable) -> tuple[str, ...]:
    """Return where the law must not be used: outside the ranges of the rows that it came from."""
    varying = set(table.varying())
    found = []
    for name in INPUT_COLUMNS:
        if name not in varying:
            continue
        values = table.columns[name][np.isfinite(table.columns[name])]
        ends = f'{number(values.min())} to {number(values.max())}'
        found.append(with_unit(f'{name} outside {ends}', unit_of(name)))
    still = [name for name in INPUT_COLUMNS if name in table.columns and name not in varying]
    if still:
        found.append(f'other values of what did not vary: {", ".join(still)}')
    return (*found, 'another soil')
