# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy workflow: a table and a model in, a diagnosis out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration, Readings
from wheel_terra_estimator.discrepancy.decision import Decider, Decision
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    BED,
    Coordinate,
    base_coordinates,
    bed_coordinates,
    soil_coordinates,
)
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.proposal import Rival
from wheel_terra_estimator.discrepancy.render import render
from wheel_terra_estimator.discrepancy.result import Diagnosis
from wheel_terra_estimator.discrepancy.selection.readings import Columns
from wheel_terra_estimator.discrepancy.selection.search import Findings, apart, search
from wheel_terra_estimator.discrepancy.selection.verdict import MOST_ODDS
from wheel_terra_estimator.discrepancy.selection.weights import default_floors, shared_floors
from wheel_terra_estimator.discrepancy.tables.averaging import join
from wheel_terra_estimator.discrepancy.tables.checks import (
    check_against_wheel,
    check_pull_against_model,
    check_wheel_of_model,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    QUANTITIES,
    Ground,
    SteadyTable,
    operating_points,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects import Catalogue, catalogue
from wheel_terra_estimator.terramechanics.effects.base import Effect, effect_of

_UNLIKELY = 0.05  # odds of different beds below which they are not reported
_WRONGLY_ON = 0.05  # prior probability of an effect that is on and should not be; assumed


@dataclass(frozen=True)
class Options:
    """Choices of a diagnosis."""

    # Effects that may be named; None = all candidates of the catalogue
    effects: tuple[str, ...] | None = None
    # Model error that is no reason for doubt, share of each quantity's range: a channel that is off
    # by more than twice its root sum of squares with the noise does not agree
    allowed_error: float = 0.02
    # Share of its value to which each soil number is known; None = as stated, else by the class of
    # its source
    soil_known_to: float | None = None


def diagnose(
    table: SteadyTable,  # checked rows (``tables.parsing.read_table``)
    # The prior model: soil, effects that are on, the wheel where the table has none
    configuration: Configuration,
    # Rows in which the effect in question is absent; fitted first, so that the structural error
    # common to both tables cancels
    reference: SteadyTable | None = None,
    options: Options | None = None,
) -> Diagnosis:
    """Find where a model and a table disagree, and name the missing effect.

    Raises UserError if the table does not fit the wheel or the soil of the configuration.
    """
    started = time.perf_counter()
    chosen = options or Options()
    both, active = table, None
    if reference is not None:
        table, both, active = join(table, reference)
    points = operating_points(both.columns, configuration, both.name)
    check_wheel_of_model(both, configuration)
    check_against_wheel(both, np.broadcast_to(points.wheel.radius, (len(both),)))
    load, radius = (float(np.median(v)) for v in (points.normal_load, points.wheel.radius))
    known = Catalogue({key: e.sized(load, radius) for key, e in catalogue().items()})
    effects, not_tried = _effects_to_try(configuration, chosen, known)
    readings = Readings.of(configuration).true_on(both.true_rows)
    forward = Forward(
        points, configuration.soil, configuration.effects, known, active=active, readings=readings
    )
    configured = _check_soil_carries(both, forward)
    check_pull_against_model(both, configured[:, 1])
    # soil.relative_std is for an unknown soil on the way of a rover, not for a measured one.
    stated_std, source = configuration.soil_std_stated, configuration.soil_source
    nuisance = (
        *soil_coordinates(configuration.soil, stated_std, source, chosen.soil_known_to),
        *(bed_coordinates() if reference is not None else ()),
        *base_coordinates(configuration.effects, configuration.effects_std, known),
    )
    floors = default_floors() if reference is None else shared_floors()

    findings = search(both, forward, nuisance, effects, floors)
    tens_alone = chosen.effects is not None
    if reference is None:
        columns = Columns(both, forward, nuisance, effects, findings, configured)
        misread_in, misread = '', columns.asked(tens_alone)
    else:
        misread_in, misread = _misread_in_either(
            (reference, table), configuration, forward, nuisance, effects, tens_alone
        )
    decider = Decider(table, findings, chosen.allowed_error, misread)
    decision = decider.decision()
    notes: tuple[str, ...] = ()
    if not misread:
        grounds = table.grounds()
        if reference is not None:  # beside the bed of each, soil that drifts on it
            grounds = {'drift': table.drift(reference)}
        decision = _beside_beds(decision, decider, grounds)
        if reference is None and decision.verdict.status != 'agrees':
            on = _forms_of_what_is_on(forward, chosen)
            for name, forms in on.items():
                if len(forms) > 1:
                    not_tried[name] += '; its other forms, in its place, were tried'
            decision, notes = _in_doubt_of_what_is_on(
                decision, decider, forward, effects, on, grounds
            )
    diagnosis = render(table, configuration, decision)
    seconds = time.perf_counter() - started
    notes, said = (*notes, *diagnosis.notes), f'{misread_in}{diagnosis.sentence}'
    return replace(diagnosis, sentence=said, not_tried=not_tried, notes=notes, seconds=seconds)


def _misread_in_either(
    parts: Sequence[SteadyTable],  # reference and table
    configuration: Configuration,
    forward: Forward,  # of both
    nuisance: tuple[Coordinate, ...],
    effects: Mapping[str, Effect],
    tens_alone: bool,
) -> tuple[str, Mapping[str, float | str]]:
    """Return which of two tables has columns that look misread, in words, and these columns.

    Each is asked by itself: floors that both share take any reading.
    """
    asked: dict[str, Mapping[str, float | str]] = {}
    believed = tuple(c for c in nuisance if c.owner != BED)
    for part in parts:
        points = operating_points(part.columns, configuration, part.name)
        readings = Readings.of(configuration).true_on(part.true_rows)
        rows = replace(forward, points=points, active=None, readings=readings)
        size = _check_soil_carries(part, rows)
        for tried in ({}, effects):  # most are done with before any effect
            own = search(part, rows, believed, tried, default_floors())
            columns = Columns(part, rows, believed, tried, own, size, strictly=True)
            asked[part.name] = columns.asked(tens_alone)
            if not asked[part.name]:
                break
    found = next(((f'{name}: ', said) for name, said in asked.items() if said), None)
    if found and len(set(map(str, asked.values()))) > 1:
        return found
    if found and any(
        quantity in QUANTITIES and not math.log10(float(times)).is_integer()
        for quantity, times in found[1].items()
    ):  # a load, slip or mere size may be an error that both share
        return f'{" and ".join(asked)}: ', found[1]
    return '', {}


def _effects_to_try(
    configuration: Configuration, options: Options, known: Mapping[str, Effect]
) -> tuple[dict[str, Effect], dict[str, str]]:
    """Return the effects to be tried, and why the others are not."""
    for name in options.effects or ():
        if name not in known:
            raise UserError(f'effect {name} is not in the catalogue: {", ".join(known)}')
    on = configuration.effects
    tried, not_tried = {}, {}
    for name, effect in known.items():
        excluding = sorted(effect.incompatible_with & on.keys())
        if name in on:
            not_tried[name] = 'is on in the configuration already'
        elif excluding:
            not_tried[name] = f'excluded by {", ".join(excluding)}, which is on'
        elif options.effects is not None and name not in options.effects:
            not_tried[name] = 'was not asked for'
        elif effect.sparse:
            not_tried[name] = 'is a law found from the rows: it is only proposed, never named'
        else:
            asked = options.effects is not None
            tried.update({f.name: f for f in effect.forms if asked or f.candidate})
            aside = [form for form in effect.forms if form.name not in tried]
            keys = [f'{name}:{form.form}' for form in aside]
            if len(aside) == len(effect.forms):
                keys = [name, *keys[1:]]
            for key, form in zip(keys, aside, strict=True):
                why = f': {form.why_aside}' if form.why_aside else ''
                not_tried[key] = f'is tried only when asked for (--only {name}){why}'
    return tried, not_tried


def _beside_beds(
    decision: Decision,
    decider: Decider,
    grounds: Mapping[str, Ground],
    off: Sequence[Findings] = (),  # each without an effect that is on and should not be
) -> Decision:
    """Let soil that differs between grounds compete with a decision, whatever is on."""
    if not grounds or decision.verdict.status == 'agrees':
        return decision
    weights = [0.0, *[math.log(_WRONGLY_ON)] * len(off)]
    found = [decider.findings, *off]
    parted = [apart(findings, grounds) for findings in found]
    alike = max(w + f.selection.totals[0] for w, f in zip(weights, found, strict=True))
    differing = [w + f.selection.totals[0] for w, (_, f) in zip(weights, parted, strict=True)]
    ground, findings = parted[int(np.argmax(differing))]
    odds = math.exp(min(max(differing) - alike, MOST_ODDS)) * grounds[ground].odds
    if odds <= _UNLIKELY:
        return decision
    other = replace(decider, findings=findings, beds_differ=True, laws={}).decision()
    return decision.unless(other, odds / (1.0 + odds), ground)


def _in_doubt_of_what_is_on(
    decision: Decision,
    decider: Decider,
    forward: Forward,
    effects: Mapping[str, Effect],
    on: Mapping[str, Mapping[str, Effect]],  # each effect that is on -> forms to be tried
    grounds: Mapping[str, Ground],
) -> tuple[Decision, tuple[str, ...]]:
    """Let each effect that is on compete with its other forms and with its absence.

    Return the decision then, and a note where the rows fit better without one.
    """
    findings, setting, wrong = decider.findings, decider.findings.setting, dict[str, Rival]()
    off = list[Findings]()
    for name, forms in on.items():
        rest = tuple(c for c in setting.nuisance if effect_of(c.owner) != name)
        others = {key: v for key, v in forward.base_effects.items() if effect_of(key) != name}
        given = decider.table, replace(forward, base_effects=others), rest
        alone = search(*given, forms, setting.floors)
        best = alone.selection.explanations[0].names
        total = alone.selection.totals[0] + math.log(_WRONGLY_ON)
        if total < findings.selection.totals[0] or set(best) & forward.base_effects.keys():
            continue  # as it is, with what else is missing, or with other numbers
        if best:
            found = search(*given, {**effects, **forms}, setting.floors)
            again = replace(decider, findings=found, laws={})
            renamed = _beside_beds(again.decision(), again, grounds)
            if [effect.name for effect in renamed.effects] == [name]:
                before = {q: decision.gap[q].before for q in renamed.gap}  # as configured
                gap = {q: replace(g, before=before[q]) for q, g in renamed.gap.items()}
                curves = replace(renamed.curves, before=decision.curves.before)
                note = f'{name} is on in another form; the form named here takes its place'
                return replace(renamed, gap=gap, curves=curves), (note,)
        wrong[name] = Rival(total, f'{name}, which is on, where it is not')
        off.append(alone)
    if wrong:
        decider = replace(decider, beside=tuple(wrong.values()))
        decision = _beside_beds(decider.decision(), decider, grounds, off)
    words = 'is on, and these rows fit better without it: look for it first'
    return decision, tuple(f'{name} {words}' for name in wrong)


def _forms_of_what_is_on(forward: Forward, options: Options) -> dict[str, dict[str, Effect]]:
    """Return each effect that is on with its form, and others where they may be named.

    A form that has all parameters of the one that is on extends it: what it explains better may be
    anything.
    """
    found = {}
    for key in forward.base_effects:
        name, own = effect_of(key), forward.catalogue[key]
        if own.sparse:
            continue
        found[name] = {key: own}
        if options.effects and name not in options.effects:
            continue
        held = {p.name for p in own.parameters if p.free}
        for form in forward.catalogue[name].forms:
            if form.candidate and not held <= {p.name for p in form.parameters}:
                found[name][form.name] = form
    return found


def _check_soil_carries(table: SteadyTable, forward: Forward) -> FloatArray:
    """Return (N, 4) values as configured; raise where the soil lets the wheel sink to its hub."""
    state = forward.solve([()], [np.zeros(0)], jacobian=False)
    sunk = state.angle[0] > 1.45
    if sunk.any():
        row = int(np.flatnonzero(sunk)[0])
        load = table.columns['normal_load'][row]
        raise UserError(
            f'{table.name}, line {table.lines[row]}: the configured soil cannot carry '
            f'{load:g} N on this wheel; check the soil of --config and the units of normal_load'
        )
    return np.asarray(state.outputs[0])
