# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Converts a decision into the reported diagnosis, without deciding anything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.assessment import next_measurement
from wheel_terra_estimator.discrepancy.assessment.along import changed_stretch, changes_along_rows
from wheel_terra_estimator.discrepancy.assessment.where import locate
from wheel_terra_estimator.discrepancy.decision import Decision
from wheel_terra_estimator.discrepancy.fitting.coordinates import BED
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.numbers import joined
from wheel_terra_estimator.discrepancy.report import words
from wheel_terra_estimator.discrepancy.result import (
    OPEN,
    Candidate,
    Diagnosis,
    FittedParameter,
    NextMeasurement,
    Proposal,
    SoilShift,
)
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.selection.signatures import CLEAR
from wheel_terra_estimator.discrepancy.selection.verdict import chi_square_p_value
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.base import effect_of
from wheel_terra_estimator.terramechanics.effects.learned_closure import NAME

_CANDIDATES_SHOWN = 12
_NEAREST = 3  # effects listed as nearest where none is identified


def render(table: SteadyTable, configuration: Configuration, decision: Decision) -> Diagnosis:
    """Return the diagnosis of a decision on the rows of a table."""
    findings, after, variance = decision.findings, decision.after, decision.variance
    setting, left = findings.setting, decision.verdict.left
    nearest = () if after.names or decision.misread else _nearest(decision)
    stretch = changed_stretch(findings.table, setting, after, variance)
    proposal = _proposal(decision)
    gap_p_value = chi_square_p_value(decision.findings.nothing, decision.variance)
    along = changes_along_rows(table, decision.curves.after, decision.curves.band)
    soil = _shifts(findings, after, 'soil')
    bed = words.another_bed(after)
    remarks, fresh = words.own_beds(decision, table)
    beds_first = decision.beds_differ > 0.5  # more likely than not
    moved = (*soil, *_shifts(findings, after, *setting.forward.base_effects))
    return Diagnosis(
        verdict=decision.verdict.status,
        sentence=words.sentence(decision, gap_p_value, stretch, nearest),
        table=table,
        configuration=configuration,
        effects=decision.effects,
        candidates=_candidates(decision),
        gap=decision.gap,
        not_visible=dict(findings.not_visible),
        smallest_visible=_smallest_visible(findings),
        where=locate(findings, variance),
        next_measurement=(
            *(fresh if beds_first else ()),
            *([words.REFERENCE_AGAIN] if bed else []),
            *_next(decision),
            *(() if beds_first else fresh),
        ),
        curves=decision.curves,
        noise=replace(findings.noise, std=findings.noise.std[: len(table)]),
        soil=soil,
        moved=moved,
        outliers=tuple(
            (r, QUANTITIES[q], size) for r, q, size in findings.outliers if r < len(table)
        ),
        gap_p_value=gap_p_value,
        remainder_p_value=left.p_value,
        remainder_amplitude=left.amplitude,
        floor=decision.floor,
        notes=(
            *words.notes(findings, after, () if decision.misread else moved, stretch),
            *(f'{change.text}; look for what changed there' for change in along),
            *remarks,
            *([bed] if bed else []),
            *words.alone(decision.gap),
        ),
        bed=_beds(findings, after),
        base_effects=tuple(configuration.effects),
        refitted=_parameters(after, base=True),
        along_rows=tuple(along),
        nearest=nearest,
        proposal=proposal,
        misread=decision.misread,
    )


def _parameters(fitted: Fit, *, base: bool = False) -> dict[str, FittedParameter]:
    """Return the parameters of the effects of a fit, or of those that were on before."""
    return {
        c.key: FittedParameter(value, std, c.unit, c.meaning)
        for c, _, value, std, _ in fitted.numbers()
        if c.owner not in ('soil', BED) and (c.owner in fitted.names) != base
    }


def _proposal(decision: Decision) -> Proposal | None:
    """Return the law of the decision with the soil and effects refitted beside it."""
    findings, found = decision.findings, decision.proposal
    if found is None or found.fit is None:
        return None
    base = _parameters(found.fit, base=True)
    return replace(
        found,
        soil=_shifts(findings, found.fit, 'soil'),
        bed=_beds(findings, found.fit),
        refitted={key: value for key, value in base.items() if not key.startswith(f'{NAME}.')},
    )


def _nearest(decision: Decision) -> tuple[str, ...]:
    """Return up to three effects: those that were too doubtful to be named, then single ones."""
    best_first = decision.findings.selection.explanations
    singles = (e.names[0] for e in best_first if len(e.names) == 1)
    names = [*(effect.name for effect in decision.doubtful), *map(effect_of, singles)]
    return tuple(dict.fromkeys(names))[:_NEAREST]


def _candidates(decision: Decision) -> tuple[Candidate, ...]:
    """Return the best explanations, the empty one included, each with the reason against it."""
    findings, verdict = decision.findings, decision.verdict
    selection = findings.selection
    nothing = selection.nothing
    shown = [h for h, e in enumerate(selection.explanations) if e.names][:_CANDIDATES_SHOWN]
    if verdict.index not in (nothing, *shown):
        shown.append(verdict.index)
    totals = selection.totals
    at_nothing = selection.explanations[nothing].log_evidence
    return tuple(
        Candidate(
            explanation.names,
            explanation.log_evidence - at_nothing,
            float(selection.probability[h].sum()),
            _parameters(explanation.fitted),
            words.why_not(findings, verdict, h),
            joined(explanation.names),
            ', '.join(key for key in explanation.names if effect_of(key) != key),
        )
        for h in sorted((nothing, *shown), key=lambda h: -totals[h])
        for explanation in (selection.explanations[h],)
    )


def _smallest_visible(findings: Findings) -> dict[str, tuple[str, float, str]]:
    """Size of each effect that these rows would have shown clearly (signature scaled linearly)."""
    found, known = dict[str, tuple[str, float, str]](), catalogue()
    for name, s in findings.signatures.items():
        if name in findings.setting.effects and s.distance > 0.0:
            parameter = known[name].parameters[0]
            size = (parameter.name, abs(s.size) * CLEAR / s.distance, parameter.unit)
            found.setdefault(effect_of(name), size)  # of the first form that is visible
    return found


def _next(decision: Decision) -> tuple[NextMeasurement, ...]:
    findings, verdict, after = decision.findings, decision.verdict, decision.after
    if decision.misread:
        return ()
    selection = findings.selection
    competitors: list[Fit] = []
    for member, names in enumerate(verdict.ambiguity_groups):
        others = set(after.names) - {after.names[member]}
        for competitor in names:
            place = selection.index((*others, competitor))
            competitors.append(selection.explanations[place].fitted)
    if not competitors:
        by_effects: dict[frozenset[str], Fit] = {}
        for explanation in selection.explanations:  # each set of effects in its best forms
            by_effects.setdefault(explanation.effects, explanation.fitted)
        best = list(by_effects.values())
        if verdict.status in OPEN:  # the two names that come nearest, and nothing
            after, *competitors = [f for f in best if f.names][:2] or [after]
            competitors.append(decision.findings.nothing)
        else:
            named = verdict.status == 'named'
            wanted = [f for f in best if f.names != after.names and (f.names or named)]
            competitors = [f for f in wanted if not set(after.names) < set(f.names)][:1]
    known = [column[np.isfinite(column)] for column in findings.noise.std.T]
    noise = np.array([np.median(column) if column.size else np.inf for column in known])
    return next_measurement.propose(findings.setting, after, competitors, noise)


def _shifts(findings: Findings, after: Fit, *owners: str) -> tuple[SoilShift, ...]:
    """Return the configured numbers of the soil, or of effects that were on, before and after."""
    before = findings.nothing.numbers()  # it has the same ones, first
    return tuple(
        SoilShift(
            c.name if c.owner == 'soil' else f'effects.{c.key}',
            float(c.value(0.0)),
            c.deviation(0.0, 1.0 / c.stated),
            refit.value,
            value,
            std,
            c.stated * u,
            c.unit,
            c.source,
        )
        for (c, u, value, std, _), refit in zip(after.numbers(), before, strict=False)
        if c.owner in owners and c.role == 'believed'
    )


def _beds(findings: Findings, after: Fit) -> tuple[SoilShift, ...]:
    """Return soil numbers of the bed under diagnosis, ``before`` on that of the reference."""
    covariance, numbers, before = after.covariance(), after.numbers(), findings.nothing.numbers()
    place = {number.coordinate.key: k for k, number in enumerate(numbers)}
    found = []
    for index, (c, u, times, _, _) in enumerate(numbers):
        if c.owner != BED:
            continue
        of_soil = place[f'soil.{c.name}']
        soil, u_of_soil, usual, *_ = numbers[of_soil]
        both = [of_soil, index]  # the product is better known than either
        slope = times * soil.deviation(u_of_soil, 1.0), usual * c.deviation(u, 1.0)
        std = float(np.sqrt(slope @ covariance[np.ix_(both, both)] @ slope))
        prior_std = usual * c.deviation(0.0, 1.0 / c.stated)
        refit = before[of_soil].value * before[index].value
        found.append(
            SoilShift(
                c.name, usual, prior_std, refit, usual * times, std, c.stated * u, soil.unit,
                'beds differ so',
            )
        )  # fmt: skip
    return tuple(found)
