# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The decision: which explanation is reported, from the findings of the search alone.

The best explanation is refitted under its own floor and predicts rows that the fit did not see: it
stands, or the next one is tried, and in the end the soil alone is reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.discrepancy.assessment.held_out import (
    channels_off,
    gaps,
    hold_out,
    slip_groups,
)
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.proposal import (
    Gap,
    Rival,
    like,
    propose,
    rivals,
)
from wheel_terra_estimator.discrepancy.result import (
    OPEN,
    Curves,
    FittedParameter,
    NamedEffect,
    Proposal,
    QuantityGap,
)
from wheel_terra_estimator.discrepancy.selection.readings import units_apart
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.selection.verdict import (
    Verdict,
    chi_square_p_value,
    choose,
    confidence,
    features,
    largest_z_score,
    unnamed,
)
from wheel_terra_estimator.discrepancy.selection.weights import FIT_FLOOR
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import NAME as LAW

_USUAL_Z_SCORE = 2.5  # stated deviations: a larger shift lowers the confidence of a name
_AT_NOISE = 1.2  # times the noise: a quantity that was never off
# Beside a free soil it fits within one nat of a biased radius, whichever is true (16 of 17 tables
# of an independent simulation): the radius alone is measured on a hard floor.
_SAME_ERROR = 'the same error of all slips (reference speed, or readings that lag behind a sweep)'
_SAME_ERROR_ODDS = 0.5  # how frequent it is assumed to be beside a wrong radius [-]
_NOTABLE = 0.2  # odds beside a name from which something without one is told
_SURE = 2.0  # deviations within which a bias of the radius is the height of the lugs
_RARE = 3.0  # deviations of its prior, beyond which a gain or bias may as well be something else
_MOST_TRIED = 3  # doubtful names, after which none is given
_LONG = 40  # iterations of a fit that may have to go far
# A name is given where it, or one of those that the rows cannot tell from it, is more likely right
# than not; below the second figure a law has to do worse than the name.
_LIKELY = 0.5
_OPEN_TO_BEDS = 0.2  # probability of beds that differ from which no law is proposed
_BEYOND_DOUBT = 0.85
# So many can imitate any smooth rows: they are named where they predict unseen levels.
_SEVERAL = 3
# How sure these can be: of such sets on granular and resistive-force tables (12 of 56) most
# names are wrong, and a law outside the catalogue is as likely beforehand as three effects at once.
_OF_SEVERAL = 0.75
_CLEARLY = 0.05  # of the gap: so much more a law must close than a doubtful name, or the name
# Relative changes of one reading, as another unit of its column is.
_GAINS = ('sinkage_gain', 'pull_gain', 'torque_gain', 'drivetrain_friction')
# Odds for several names that close more than any law and leave noise alone (chosen on seeds 3200 to
# 3209).
_BEATS_LAW = 4.0


@dataclass(frozen=True)
class Decision:
    """What was decided, and the fits and predictions that speak for it."""

    # Those of the search, with ``nothing`` refitted under the floor of the decision
    findings: Findings
    verdict: Verdict
    floor: float  # model-error floor in use, share of each quantity's range
    after: Fit  # the chosen explanation, refitted under that floor
    variance: FloatArray
    curves: Curves
    gap: Mapping[str, QuantityGap]  # quantity -> QuantityGap
    effects: tuple[NamedEffect, ...] = ()  # strongest first; empty unless ``named``
    # Those that would have been named, were they likely enough
    doubtful: tuple[NamedEffect, ...] = ()
    # Column -> factor that it lacks, or what it is, where it looks misread; nothing is named then
    misread: Mapping[str, float | str] = field(default_factory=dict)
    proposal: Proposal | None = None  # A law, where something is missing and no name is given
    beds_differ: float = 0.0  # probability that only the soil differs, where notable
    ground: str = ''  # what has soil of its own then: row, sweep or day

    def unless(self, apart: Decision, probability: float, ground: str) -> Decision:
        """Return ``apart``, the decision where beds differ, if that is the more probable one.

        Else, or where it has another model than the configured one, the names are less sure, and
        no law is proposed unless beds are improbable.
        """
        if not apart.verdict.left.accounted_for or len(apart.effects) > len(self.effects):
            return self  # nor do beds, or not by themselves
        ours, theirs = (d.findings.setting.forward.base_effects for d in (self, apart))
        if probability > _LIKELY and ours.keys() == theirs.keys():
            return replace(apart, beds_differ=probability, ground=ground)
        effects = _as_sure(self.effects, 1.0 - probability)
        law = self.proposal if probability < _OPEN_TO_BEDS else None
        return replace(self, effects=effects, proposal=law, beds_differ=probability, ground=ground)


@dataclass(frozen=True)
class Decider:
    """What a decision is made from."""

    table: SteadyTable  # the rows under diagnosis; those of a reference stand behind them
    findings: Findings
    allowed_error: float  # model error that is no reason for doubt [share of the range]
    misread: Mapping[str, float | str] = field(default_factory=dict)  # as in the decision
    beds_differ: bool = False  # unseen rows may be off by more than noise
    beside: tuple[Rival, ...] = ()  # an effect that is on and should not be
    # Best law beside each floor, soil held or not: it competes with names, or is proposed
    laws: dict[tuple[float, bool], Proposal | None] = field(default_factory=dict)

    def decision(self) -> Decision:
        """Return the best explanation that stands, else the soil alone."""
        selection, problem = self.findings.selection, self.findings.setting.problem
        tried, doubtful = list[int](), tuple[NamedEffect, ...]()
        while True:
            enough = self.misread or len(tried) >= _MOST_TRIED
            verdict = unnamed(selection, problem) if enough else choose(selection, problem, tried)
            decision = self._judged(verdict)
            if verdict.status == 'agrees' and not self.beds_differ and channels_off(decision.gap):
                verdict = choose(selection, problem, tried, off=True)
                decision = self._judged(verdict)
            if verdict.status != 'named':
                return self._left_open(replace(decision, doubtful=doubtful))
            tried.append(verdict.index)
            named = _names(self.table, decision, self._rivals)
            names, likely = self._against_law(decision, named)
            if likely and any(item.after < item.refit for item in decision.gap.values()):
                share = _OF_SEVERAL if len(names) >= _SEVERAL else 1.0
                return replace(decision, effects=_as_sure(names, share))
            doubtful = doubtful or names

    @cached_property
    def _rivals(self) -> tuple[Rival, ...]:
        """What has no name, and competes with names."""
        laws = LAW not in self.findings.setting.forward.base_effects
        return (*self.beside, *(rivals(self.table, self.findings) if laws else ()))

    def _law(self, decision: Decision, hold_soil: bool = False) -> Proposal | None:
        """Return the law for what a decision's refit of the soil leaves."""
        on_top = LAW in self.findings.setting.forward.base_effects
        if self.misread or self.beds_differ or on_top or not self.findings.signatures:
            return None  # not for a wrong unit, what beds do, on a law, or for the soil alone
        key = decision.floor, hold_soil
        if key not in self.laws:
            self.laws[key] = propose(self._gap(decision), hold_soil=hold_soil)
        return self.laws[key]

    def _gap(self, decision: Decision) -> Gap:
        return Gap(self.table, decision.findings, decision.gap, decision.variance)

    def _against_law(
        self, decision: Decision, names: tuple[NamedEffect, ...]
    ) -> tuple[tuple[NamedEffect, ...], bool]:
        """Return the names, as sure as they are beside a law, and whether they are given."""
        beyond_doubt = _least(names) >= _BEYOND_DOUBT
        if beyond_doubt and len(names) < _SEVERAL:
            return names, True
        gap = self._gap(decision)
        unseen = gap.unseen(decision.after)
        imitates = len(names) > _SEVERAL and decision.verdict.left.noticeable
        if len(names) >= _SEVERAL and (imitates or not gap.leaves_noise(unseen)):
            return names, False
        if beyond_doubt:
            return names, True
        law = self._law(decision)
        if law and law.fit and {*map(like, law.fit.names)} <= {n.name for n in names}:
            law = None  # it says the same in other words
        ahead = gap.closed(unseen) - (law.closed if law else 0.0)
        if law is not None and ahead < -_CLEARLY:
            return names, False
        ahead_of_all = ahead >= _CLEARLY and len(names) > 1
        odds = _BEATS_LAW if ahead_of_all and not decision.verdict.left.significant else 1.0
        surer = [confidence(n.features, n.features['alike'], odds) for n in names]
        names = tuple(
            replace(n, confidence=c.of_name, confidence_of_set=c.of_set)
            for n, c in zip(names, surer, strict=True)
        )
        return names, _least(names, odds) >= _LIKELY

    def _left_open(self, decision: Decision) -> Decision:
        """Return an open decision with the soil plainly refitted, and a law if it does better.

        Without a floor, which keeps the soil from the rows, it is nearer to the truth elsewhere.
        """
        if decision.verdict.status not in OPEN:
            return decision
        law = self._law(decision, decision.verdict.left.only_far)
        if self.findings.setting.forward.active is not None:
            return replace(decision, proposal=law)  # its floor stands for what a reference shares
        setting, nothing = self.findings.setting, decision.findings.nothing
        # Estimated noise may be next to nothing beside a few smooth rows.
        exact = 'estimated' not in self.findings.noise.origin.values()
        variance = setting.problem.variance(0.0 if exact else FIT_FLOOR)
        # Far from the configured soil, and without a floor, the fit goes along a bent valley.
        nothing = setting.refit(nothing, variance, _LONG)
        plain = self._predicted(decision.verdict, [nothing], variance, 0.0)
        if decision.verdict.status == 'undecided' and not channels_off(plain.gap):
            plain = decision  # what is off is so beside the floor alone
        if law and not (law.soil_held or self._gap(plain).is_closed_by(law)):
            law = None
        return replace(plain, floor=decision.floor, doubtful=decision.doubtful, proposal=law)

    def _judged(self, verdict: Verdict) -> Decision:
        """Refit nothing and the chosen explanation under its own floor, and predict unseen rows."""
        selection, nothing = self.findings.selection, self.findings.nothing
        floor = selection.floors[selection.quiet_floor(verdict.index)]
        chosen = selection.explanations[verdict.index]
        own = self.findings.setting.problem.variance(floor.amplitude)
        fits = [nothing, chosen.fitted] if chosen.names else [nothing]
        return self._predicted(verdict, fits, own, floor.largest)

    def _predicted(
        self, verdict: Verdict, fits: list[Fit], variance: FloatArray, floor: float
    ) -> Decision:
        """Refit nothing and what was chosen (the last), and predict rows that no fit saw."""
        setting = self.findings.setting
        fits = [setting.refit(f, variance) for f in fits]
        findings = replace(self.findings, nothing=fits[0])
        beside = setting.problem.variance(floor)
        rows, every = len(self.table), self.findings.table
        groups = np.where(np.arange(len(every)) < rows, slip_groups(every), -1)
        outs = hold_out(setting, fits, beside, groups)
        curves = _curves(rows, findings, fits[-1], outs, floor)
        gap = gaps(self.table, findings, curves, self.allowed_error)
        return Decision(
            findings, verdict, floor, fits[-1], beside, curves, gap, misread=self.misread
        )


def _as_sure(names: tuple[NamedEffect, ...], share: float) -> tuple[NamedEffect, ...]:
    """Return names beside something else that may be the truth."""
    return tuple(
        replace(n, confidence=share * n.confidence, confidence_of_set=share * n.confidence_of_set)
        for n in names
    )


def _least(names: tuple[NamedEffect, ...], odds: float = 1.0) -> float:
    """Return the confidence of the least likely set of names, among what was tried."""
    every = ((name.features, name.features['nameless']) for name in names)
    return min(confidence(values, nameless, odds).of_set for values, nameless in every)


def _names(
    table: SteadyTable, decision: Decision, beside: tuple[Rival, ...]
) -> tuple[NamedEffect, ...]:
    """Return the named effects with their confidence; first the one that alone explains more."""
    findings, fitted, known = decision.findings, decision.after, catalogue()
    selection = findings.selection
    shown = _what_rows_show(findings, fitted, decision.gap)
    found = []
    total, own = selection.totals[decision.verdict.index], set(map(effect_of, fitted.names))
    nameless = {r.words: r.odds(total) for r in beside if r.like not in own}
    for place, key in enumerate(fitted.names):
        name, values = effect_of(key), features(selection, decision.verdict, place) | shown
        values['strength'] = _strength(fitted, key)
        competitors = decision.verdict.ambiguity_groups[place]
        alike = _known_alike(key, decision, known, table.units)
        values['alike'] = float(len(alike))
        bias = 'wheel_radius_bias'  # slips of a drive are our own
        if (name == bias or bias in competitors) and not table.true_rows.any():
            alike = (_SAME_ERROR, *alike)
            values['alike'] += _SAME_ERROR_ODDS
        values['nameless'] = sum(nameless.values())
        values['alike'] += values['nameless']
        alike = (*alike, *(words for words, odds in nameless.items() if odds > _NOTABLE))
        alone = float(selection.totals[selection.index((key,))])
        sure = confidence(values, values['alike'])
        effect = NamedEffect(
            name,
            {
                c.name: FittedParameter(value, std, c.unit, c.meaning)
                for c, _, value, std, _ in fitted.numbers()
                if c.owner == key
            },
            sure.of_name,
            sure.of_set,
            tuple(map(effect_of, competitors)),
            decision.verdict.left.noticeable,
            known[key].claim,
            values,
            known[key].form if len(known[name].forms) > 1 else '',
            alike,
        )
        found.append((alone, effect))
    return tuple(effect for _, effect in sorted(found, key=lambda item: -item[0]))


def _known_alike(
    name: str, decision: Decision, known: Mapping[str, Effect], units: Mapping[str, float]
) -> tuple[str, ...]:
    """Return what looks like a name and was not tried: effects, another unit or radius."""
    findings, fitted = decision.findings, decision.after
    points, found = findings.setting.forward.points, list[str]()
    heights = points.wheel.lug_height / points.wheel.radius
    lug = float(np.max(heights)) if np.ptp(heights) == 0.0 else 0.0
    due = {'rim': -lug / (1.0 + lug), 'lug_tip': lug}.get(points.slip_radius, 0.0)
    for c, u, value, scatter, _ in fitted.numbers():
        if c.key == f'{name}.bias' == 'wheel_radius_bias.bias' and due:
            other = 'rim' if points.slip_radius == 'lug_tip' else 'lug_tip'
            if abs(value - due) < _SURE * scatter:
                found.append(f'a slip that refers to the other radius (slip_radius: {other})')
        elif c.unit == '-' and effect_of(c.owner) == effect_of(name) in _GAINS:
            column, gain = min(known[c.owner].touches), 1.0 + value
            text = units_apart(column, 1.0 / gain, scatter / gain, units.get(column, 1.0))
            if text:
                found.append(f'another unit of the column ({text})')
            elif abs(u) > _RARE:
                found.append('something else in that column (so large a gain is rare)')
        elif effect_of(c.owner) == effect_of(name) == 'wheel_radius_bias' and abs(u) > _RARE:
            found.append('something else (so wrong a radius is rare)')
    on = set(findings.setting.forward.base_effects)
    own = known[effect_of(name)].confounded_with
    others = (o.base_name for o in known.values() if effect_of(name) in o.confounded_with)
    aside = {n for n, o in known.items() if not o.candidate or o.incompatible_with & on}
    names = dict.fromkeys((*own, *others))
    untried = [name for name in names if name not in aside and name not in findings.tried]
    return (*untried, *found)


def _what_rows_show(
    findings: Findings, fitted: Fit, gap: Mapping[str, QuantityGap]
) -> dict[str, float]:
    """Return features of the confidence that follow from unseen rows and from the fit.

    ``worse``: how far an effect worsens a quantity; ``idle``: share of its signature in quantities
    that were never off; ``misfit``: how improbable the residual is; ``pull``: the
    largest shift of a configured number beyond ``_USUAL_Z_SCORE`` of its stated deviations.
    """
    change = (fitted.outputs - findings.nothing.outputs)[: len(findings.noise.std)]
    worse, idle, total = 0.0, 0.0, 1e-12
    for q, item in enumerate(gap.get(name) for name in QUANTITIES):
        if item is None or not item.noise:
            continue
        worse = max(worse, (item.after**2 - item.refit**2) / item.noise**2)
        square = float(np.nanmean(change[:, q] ** 2)) / item.noise**2
        total += square
        idle += square if item.refit < _AT_NOISE * item.noise else 0.0
    misfit = chi_square_p_value(fitted, fitted.variance)
    alone = findings.setting.forward.active is None  # a reference's structural error pulls as well
    largest = largest_z_score(fitted) if alone else 0.0
    return {
        'worse': float(np.tanh(worse)),
        'idle': idle / total,
        'misfit': -float(np.log10(max(misfit, 1e-6))),
        'pull': max(largest - _USUAL_Z_SCORE, 0.0),
    }


def _strength(fitted: Fit, name: str) -> float:
    """Size of an effect in deviations of its prior, compressed."""
    sizes = [
        abs(u - c.coordinate(c.neutral))
        for c, u in zip(fitted.coordinates, fitted.u, strict=True)
        if c.owner == name and c.role == 'strength'
    ]
    return float(np.log1p(max(sizes, default=0.0)))


def _curves(
    rows: int, findings: Findings, after: Fit, held_out: list[FloatArray], floor: float
) -> Curves:
    setting = findings.setting
    nuisance, problem = setting.nuisance, setting.problem
    read = findings.table.columns['slip']
    configured = setting.at(read, nuisance, np.zeros(len(nuisance)))
    moved = bool(np.any(problem.moved))
    alone = setting.at(read, after.coordinates, after.u) if moved else after.outputs
    fits = [findings.nothing.outputs, after.outputs]
    refit, fitted = setting.predicted(fits, problem.variance(floor))
    left = floor if setting.forward.active is None else 0.0  # what a reference shows is in them
    band = np.sqrt(findings.noise.std**2 + (left * problem.scale) ** 2)
    # Where slips are latent the model stands at the most probable slip; a curve is compared with
    # what was read, so that it goes back along the tangent (cells that were not measured stay).
    curves = [values - problem.moved for values in (refit, fitted, held_out[0], held_out[-1])]
    return Curves(*[values[:rows] for values in (configured, *curves, alone, band)])
