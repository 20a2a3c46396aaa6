# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The discrepancy workflow: a table and a model in, a diagnosis out."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.readings import Readings
from wheel_terra_estimator.discrepancy.assessment import next_measurement
from wheel_terra_estimator.discrepancy.assessment.along import changed_stretch
from wheel_terra_estimator.discrepancy.assessment.held_out import hold_out, log_scores, slip_groups
from wheel_terra_estimator.discrepancy.assessment.structural_error import structural_error
from wheel_terra_estimator.discrepancy.assessment.where import locate
from wheel_terra_estimator.discrepancy.effect_keys import effect_of
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    WIDENING,
    Coordinate,
    base_coordinates,
    soil_coordinates,
)
from wheel_terra_estimator.discrepancy.fitting.evidence import log_sum
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.reference import join, shared_error
from wheel_terra_estimator.discrepancy.proposal.find import promise_on_top, propose
from wheel_terra_estimator.discrepancy.report import words
from wheel_terra_estimator.discrepancy.result import (
    OPEN,
    Candidate,
    Curves,
    Diagnosis,
    FittedParameter,
    NamedEffect,
    NextMeasurement,
    Proposal,
    QuantityGap,
    SoilShift,
)
from wheel_terra_estimator.discrepancy.selection import confidence as confidences
from wheel_terra_estimator.discrepancy.selection import significance
from wheel_terra_estimator.discrepancy.selection.remainder import Remainder
from wheel_terra_estimator.discrepancy.selection.search import Findings, search
from wheel_terra_estimator.discrepancy.selection.signatures import CLEAR
from wheel_terra_estimator.discrepancy.selection.verdict import Verdict, decide
from wheel_terra_estimator.discrepancy.selection.weights import default_floors, shared_floors
from wheel_terra_estimator.discrepancy.tables.checks import (
    check_against_wheel,
    check_pull_against_model,
    check_wheel_of_model,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, SteadyTable
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.base import Effect
from wheel_terra_estimator.terramechanics.effects.learned_closure import NAME
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

FloatArray = NDArray[np.float64]

_CANDIDATES_SHOWN = 12
_AT_NOISE = 1.2  # times the noise: a quantity that was never off
_MOST_EXCLUDED = 3  # names that worsen a quantity, after which the last one stands
# Confidence that at least one name of several must reach; below, they patch what no listed effect
# explains (one of ten names in five such sets of tuning campaigns was right).
_PATCHWORK = 1.0 / 3.0
_NEAREST = 3  # effects named as nearest where nothing is named


@dataclass(frozen=True)
class Options:
    """Choices of a diagnosis.

    Attributes
    ----------
    effects : tuple of str or None
        Effects that may be named; None = all candidates of the catalogue.
    floor : float or None
        Greatest model-error floor, share of each quantity's range; None = as the data ask, to 4 %.
    allowed_error : float
        Model error that is no reason for doubt, share of each quantity's range: a channel that is
        off by more than twice its root sum of squares with the noise does not agree.
    """

    effects: tuple[str, ...] | None = None
    floor: float | None = None
    allowed_error: float = 0.02


def diagnose(
    table: SteadyTable,
    configuration: Configuration,
    reference: SteadyTable | None = None,
    options: Options | None = None,
) -> Diagnosis:
    """Find where a model and a table disagree, and name the missing effect.

    Parameters
    ----------
    table : SteadyTable
        Checked rows (``table.read_table``).
    configuration : Configuration
        The model believed in: soil, effects that are on, the wheel where the table has none.
    reference : SteadyTable, optional
        Rows in which the effect in question is absent; fitted first, so that the structural error
        common to both tables cancels.
    options : Options, optional

    Raises
    ------
    UserError
        If the table does not fit the wheel or the soil of the configuration.
    """
    started = time.perf_counter()
    chosen = options or Options()
    both, active = (table, None) if reference is None else join(table, reference)
    points = operating_points(both, configuration)
    wheels, stated = configuration.wheels, configuration.stated
    check_wheel_of_model(
        both,
        wheels.radius if 'wheels.radius' in stated else (),
        wheels.width if 'wheels.width' in stated else (),
    )
    check_against_wheel(
        both,
        np.broadcast_to(points.wheel.radius, (len(both),)),
        np.broadcast_to(points.wheel.width, (len(both),)),
    )
    known = catalogue()
    effects, not_tried = _effects_to_try(configuration, chosen, known)
    readings = Readings.of(configuration).true_on(both.true_rows)
    forward = Forward(
        points, configuration.soil, configuration.effects, known, active=active, readings=readings
    )
    configured = _check_soil_carries(both, forward, configuration)
    check_pull_against_model(both, configured[:, 1])
    nuisance = nuisance_coordinates(configuration, known)
    floors = default_floors(chosen.floor) if reference is None else shared_floors()
    findings = search(both, forward, nuisance, effects, floors)
    diagnosis = _report(table, both, configuration, findings, known, chosen)
    seconds = time.perf_counter() - started
    return replace(diagnosis, not_tried=not_tried, seconds=seconds)


def operating_points(table: SteadyTable, configuration: Configuration) -> OperatingPoints:
    """Return the table's rows as operating points; what it does not state comes from the model.

    Raises
    ------
    UserError
        If neither the table nor the configuration states the wheel.
    """
    wheels, columns = configuration.wheels, table.columns
    stated = configuration.stated
    values = {}
    for name, field in (
        ('wheel_radius', 'radius'),
        ('wheel_width', 'width'),
        ('lug_height', 'lug_height'),
        ('lug_count', 'lug_count'),
    ):
        first = getattr(wheels, field)
        default = float(first[0]) if len(first) else float('nan')
        if name in columns:
            values[field] = np.where(np.isfinite(columns[name]), columns[name], default)
        else:
            if field in ('radius', 'width') and f'wheels.{field}' not in stated:
                raise UserError(
                    f'{table.name}: no column {name}, and no wheel in the configuration; '
                    f'add the column, or --config with wheels.{field}'
                )
            values[field] = np.full(len(table), default)
    thickness = float(wheels.lug_thickness[0]) if len(wheels.lug_thickness) else 0.0

    def column(name: str, default: float) -> FloatArray:
        if name not in columns:
            return np.full(len(table), default)
        return np.where(np.isnan(columns[name]), default, columns[name])

    wheel = Wheel(**values, lug_thickness=thickness)
    try:
        return OperatingPoints(
            columns['slip'],
            columns['normal_load'],
            wheel,
            column('slope', 0.0),
            configuration.slip_radius,
            column('gravity', float(configuration.rover.gravity)),
            column('angular_velocity', np.nan),
            column('pass_number', 1.0),
            column('leaving_angle', np.nan),
        )
    except ValueError as error:
        raise UserError(f'{table.name}: {error}') from None


def nuisance_coordinates(
    configuration: Configuration, known: Mapping[str, Effect]
) -> tuple[Coordinate, ...]:
    """Return the soil parameters and the stated uncertain parameters of effects that are on."""
    # soil.relative_std is the estimator's doubt of a soil on its way, not that of a measured soil.
    stated = {
        field: value
        for field, value in configuration.soil_std.items()
        if configuration.stated & {f'soil.{field}_std', f'soil.{field}_std_deg'}
    }
    return (
        *soil_coordinates(configuration.soil, stated),
        *base_coordinates(configuration.effects, configuration.effects_std, known),
    )


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
            not_tried[name] = 'is a law found from the rows: it is proposed, never named'
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


def _check_soil_carries(
    table: SteadyTable, forward: Forward, configuration: Configuration
) -> FloatArray:
    """Return (N, 3) values as configured; raise where the soil lets the wheel sink to its hub."""
    nothing = soil_coordinates(configuration.soil, {})
    state = forward.solve([nothing], [np.zeros(len(nothing))], jacobian=False)
    sunk = state.angle[0] > 1.45
    if sunk.any():
        row = int(np.flatnonzero(sunk)[0])
        load = table.columns['normal_load'][row]
        raise UserError(
            f'{table.name}, line {table.lines[row]}: the configured soil cannot carry '
            f'{load:g} N on this wheel; check the soil of --config and the units of normal_load'
        )
    return np.asarray(state.outputs[0])


def _report(
    table: SteadyTable,
    both: SteadyTable,
    configuration: Configuration,
    findings: Findings,
    known: Mapping[str, Effect],
    options: Options,
    *,
    off: bool = False,
    excluded: tuple[int, ...] = (),
) -> Diagnosis:
    """Return the diagnosis; once more where it would agree beside a misfit, or name what worsens.

    Parameters
    ----------
    off, excluded
        As in ``verdict.decide``.
    """
    setting, selection = findings.setting, findings.selection
    problem = setting.problem
    verdict = decide(selection, problem.variance, off=off, excluded=excluded)
    left = verdict.left
    quiet = [k for k, floor in enumerate(selection.floors) if not floor.unexplained]
    floor_index = quiet[int(np.argmax(selection.log_joint[verdict.index][quiet]))]
    floor = selection.floors[floor_index].largest
    variance = problem.variance(floor)
    nothing, after = _under_own_floor(findings, verdict, floor_index)
    findings = replace(findings, nothing=nothing)
    shown = _shown(findings, verdict.index)
    groups = np.where(np.arange(len(both)) < len(table), slip_groups(both), -1)
    kept = [nothing, *(selection.explanations[h].fitted for h in shown)]
    scores = log_scores(setting, kept, variance, groups)
    gains = dict(zip(shown, (score - scores[0] for score in scores[1:]), strict=True))
    outs = hold_out(setting, [nothing, after] if after.names else [nothing], variance, groups)
    curves = _curves(len(table), findings, after, outs[0], outs[-1], floor)
    names = {name: s for name, s in findings.signatures.items() if name in setting.effects}
    one_sided = {
        name for name in names if all(p.prior == 'half_normal' for p in known[name].parameters[:1])
    }
    gap_p_value = min(
        1.0,
        2.0
        * min(
            significance.scan_p_value(nothing, variance, names, one_sided),
            significance.chi_square_p_value(nothing, variance),
        ),
    )
    gap = words.gaps(table, findings, curves, floor, options.allowed_error)
    if verdict.word == 'agrees' and not off and words.channels_off(gap):
        return _report(table, both, configuration, findings, known, options, off=True)
    if after.names and words.channels_worsened(gap, left) and len(excluded) < _MOST_EXCLUDED:
        further = (*excluded, verdict.index)
        return _report(
            table, both, configuration, findings, known, options, off=off, excluded=further
        )
    covariance = np.asarray(np.linalg.inv(after.precision()), dtype=float)
    nearest = () if after.names else _nearest(findings)
    effects = _named(table, findings, verdict, left, known, after, gap) if after.names else ()
    if len(effects) > 1 and max(effect.confidence for effect in effects) < _PATCHWORK:
        further = tuple(range(len(selection.explanations)))
        return _report(
            table, both, configuration, findings, known, options, off=off, excluded=further
        )
    candidates = _candidates(findings, verdict, shown, gains, floor_index)
    stretch = changed_stretch(both, setting, after, variance)
    proposal = _proposal(table, findings, verdict, gap, variance)
    law = None if proposal is None else proposal.fit
    return Diagnosis(
        verdict=verdict.word,
        sentence=words.sentence(verdict, effects, gap_p_value, left, floor, stretch, gap, nearest),
        table=table,
        configuration=configuration,
        effects=effects,
        candidates=candidates,
        gap=gap,
        not_visible=dict(findings.not_visible),
        smallest_visible=_smallest_visible(findings, known),
        where=locate(both, problem, nothing, setting.observed, len(table)),
        next_measurement=_next(findings, verdict, after),
        curves=curves,
        noise=replace(findings.noise, std=findings.noise.std[: len(table)]),
        soil=_soil_shifts(findings, after, variance),
        outliers=tuple(
            (r, QUANTITIES[q], size) for r, q, size in findings.outliers if r < len(table)
        ),
        gap_p_value=gap_p_value,
        remainder_p_value=left.p_value,
        remainder_amplitude=left.amplitude,
        floor=floor,
        notes=(
            *words.notes(both, findings, after, stretch),
            *words.untried({e.name: known_alike(e.name, findings, known) for e in effects}),
        ),
        base_effects=tuple(configuration.effects),
        refitted=_parameters(after, covariance, base=True),
        nearest=nearest,
        proposal=proposal,
        structural_error=structural_error(
            problem,
            both.scaled_inputs(),
            law or after,
            selection.floors,
            len(table),
            beyond_law=law is not None,
        ),
    )


def _index_of_nothing(findings: Findings) -> int:
    return next(h for h, e in enumerate(findings.selection.explanations) if not e.names)


def _shown(findings: Findings, chosen: int) -> list[int]:
    """Return the explanations that are listed: the best, and the chosen one among them."""
    with_names = [h for h, e in enumerate(findings.selection.explanations) if e.names]
    shown = with_names[:_CANDIDATES_SHOWN]
    if findings.selection.explanations[chosen].names and chosen not in shown:
        shown.append(chosen)
    return shown


def _under_own_floor(findings: Findings, verdict: Verdict, floor_index: int) -> tuple[Fit, Fit]:
    """Refit nothing and the chosen explanation with the noise and floor that it asks for."""
    setting, chosen = findings.setting, findings.selection.explanations[verdict.index]
    floor = findings.selection.floors[floor_index]
    variance = setting.problem.variance(floor.amplitude, chosen.posterior.noise_factor[floor_index])
    fits = [findings.nothing, chosen.fitted] if chosen.names else [findings.nothing]
    again = [setting.fit([f.names], [f.u], f.angle, variance)[0] for f in fits]
    return again[0], again[-1]


def _parameters(
    fitted: Fit, covariance: FloatArray, *, base: bool = False
) -> dict[str, FittedParameter]:
    """Return the parameters of the effects of a fit, or of those that were on before."""
    found = {}
    for index, c in enumerate(fitted.coordinates):
        if c.owner != 'soil' and (c.owner in fitted.names) != base:
            u, std = float(fitted.u[index]), float(np.sqrt(covariance[index, index]))
            found[c.key] = FittedParameter(
                float(c.value(u)),
                c.deviation(u, std),
                c.unit,
                float(c.value(c.lower)),
                float(c.value(c.upper)),
                c.meaning,
            )
    return found


def _named(
    table: SteadyTable,
    findings: Findings,
    verdict: Verdict,
    left: Remainder,
    known: Mapping[str, Effect],
    fitted: Fit,
    gap: Mapping[str, QuantityGap],
) -> tuple[NamedEffect, ...]:
    """Return the named effects; first the one that alone explains more."""
    covariance = np.asarray(np.linalg.inv(fitted.precision()), dtype=float)
    parameters = _parameters(fitted, covariance)
    shown = _what_rows_show(findings, fitted, gap)
    promise = promise_on_top(table, findings.setting, fitted)
    shown['law'] = float(np.log1p(max(promise, 0.0)))
    found = []
    for place, name in enumerate(fitted.names):
        values = confidences.features(findings.selection, verdict, place, left) | shown
        values['strength'] = _strength(fitted, name)
        alike = known_alike(name, findings, known)
        values['alike'] = float(len(alike))
        sure = confidences.confidence(values, len(alike))
        rivals = verdict.open_sets[place]
        forms = {
            explanation.names[0]: float(log_sum(findings.selection.joint_of(explanation.names)))
            for explanation in findings.selection.explanations
            if len(explanation.names) == 1 and effect_of(explanation.names[0]) == effect_of(name)
        }
        own = {
            key.split('.', 1)[1]: value
            for key, value in parameters.items()
            if key.split('.', 1)[0] == name
        }
        found.append(
            (
                float(np.logaddexp.reduce(findings.selection.joint_of((name,)))),
                NamedEffect(
                    effect_of(name),
                    own,
                    sure.of_name,
                    sure.of_set,
                    tuple(effect_of(rival) for rival in rivals),
                    left.noticeable,
                    known[name].claim,
                    known[name].source,
                    {
                        rival: known[name].confounded_with.get(rival)
                        or known[rival].confounded_with.get(effect_of(name), '')
                        for rival in map(effect_of, rivals)
                    },
                    values,
                    known[name].form if len(known[effect_of(name)].forms) > 1 else '',
                    {
                        known[key].form: forms[name] - weight
                        for key, weight in forms.items()
                        if key != name
                    },
                ),
            )
        )
    found.sort(key=lambda item: -item[0])
    return tuple(effect for _, effect in found)


def _proposal(
    table: SteadyTable,
    findings: Findings,
    verdict: Verdict,
    gap: Mapping[str, QuantityGap],
    variance: FloatArray,
) -> Proposal | None:
    """Return a law where something is missing and no name is given; not on top of another."""
    if verdict.word not in OPEN or NAME in findings.setting.forward.base_effects:
        return None
    found = propose(table, findings, gap, variance, hold_soil=verdict.left.only_soil)
    if found is None or found.fit is None:
        return None
    covariance = np.asarray(np.linalg.inv(found.fit.precision()), dtype=float)
    base = _parameters(found.fit, covariance, base=True)
    return replace(
        found,
        soil=_soil_shifts(findings, found.fit, variance),
        refitted={key: value for key, value in base.items() if not key.startswith(f'{NAME}.')},
    )


def known_alike(name: str, findings: Findings, known: Mapping[str, Effect]) -> tuple[str, ...]:
    """Return effects that are known to look like a name, might be named, and were not tried."""
    on = set(findings.setting.forward.base_effects)
    own = known[effect_of(name)].confounded_with
    others = (
        other.base_name for other in known.values() if effect_of(name) in other.confounded_with
    )

    def might_be(other: str) -> bool:
        return other not in known or (
            known[other].candidate and not known[other].incompatible_with & on
        )

    names = dict.fromkeys((*own, *others))
    return tuple(other for other in names if other not in findings.tried and might_be(other))


def _nearest(findings: Findings) -> tuple[str, ...]:
    """Return up to three single effects that the rows favour most."""
    weights = findings.selection.single_weights()
    order = sorted(weights, key=lambda name: -weights[name])
    return tuple(dict.fromkeys(effect_of(key) for key in order))[:_NEAREST]


def _what_rows_show(
    findings: Findings, fitted: Fit, gap: Mapping[str, QuantityGap]
) -> dict[str, float]:
    """Return features of the confidence that follow from unseen rows and from the fit.

    ``worse``: how far an effect worsens a quantity; ``idle``: share of its signature in quantities
    that were never off; ``misfit``, ``soil``: how improbable the residual and the soil are.
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
    misfit = significance.chi_square_p_value(fitted, fitted.variance)
    return {
        'worse': float(np.tanh(worse)),
        'idle': idle / total,
        'misfit': -float(np.log10(max(misfit, 1e-6))),
        'soil': -float(np.log10(max(significance.soil_p_value(fitted), 1e-6))),
    }


def _strength(fitted: Fit, name: str) -> float:
    """Size of an effect in deviations of its prior, compressed."""
    sizes = [
        abs(u - c.coordinate(c.neutral))
        for c, u in zip(fitted.coordinates, fitted.u, strict=True)
        if c.owner == name and c.role == 'strength'
    ]
    return float(np.log1p(max(sizes, default=0.0)))


def _distance_to_nothing(findings: Findings, fitted: Fit) -> float:
    change = findings.setting.problem.rotate(
        findings.setting.problem.flat(fitted.outputs - findings.nothing.outputs)
    )
    return float(np.sqrt((change**2 / fitted.variance).sum()))


def _candidates(
    findings: Findings,
    verdict: Verdict,
    shown: list[int],
    gains: Mapping[int, float],
    floor_index: int,
) -> tuple[Candidate, ...]:
    selection = findings.selection
    nothing = _index_of_nothing(findings)
    totals = np.logaddexp.reduce(selection.log_joint, axis=1)
    evidence = {h: selection.explanations[h].log_evidence for h in (*shown, nothing)}
    chosen = set(selection.explanations[verdict.index].names)
    found = []
    for h in sorted({*shown, nothing}, key=lambda h: -totals[h]):
        explanation = selection.explanations[h]
        fitted = explanation.fitted
        found.append(
            Candidate(
                explanation.names,
                evidence[h] - evidence[nothing],
                float(selection.probability[h].sum()),
                gains.get(h, 0.0),
                float((fitted.residual**2).sum()),
                float(findings.setting.problem.size - len(fitted.u)),
                _parameters(fitted, explanation.posterior.covariance[floor_index]),
                _distance_to_nothing(findings, fitted) if explanation.names else 0.0,
                '' if h == verdict.index else words.why_not(findings, verdict, h, totals, chosen),
            )
        )
    return tuple(found)


def _curves(
    rows: int,
    findings: Findings,
    after: Fit,
    held_refit: FloatArray,
    held_after: FloatArray,
    floor: float,
) -> Curves:
    setting = findings.setting
    nuisance = setting.nuisance
    refit_error, after_error = (
        _shared_error(findings, fitted, floor) for fitted in (findings.nothing, after)
    )
    configured = setting.forward.solve([nuisance], [np.zeros(len(nuisance))], jacobian=False)
    # Where slips are latent the model stands at the most probable slip; a curve is compared with
    # what was read, so that it goes back along the tangent (cells that were not measured stay).
    problem = setting.problem
    moved = np.zeros_like(after.outputs)
    moved[problem.row, problem.quantity] = setting.observed - problem.observed
    refit_error, after_error = refit_error - moved, after_error - moved
    band = np.sqrt(findings.noise.std**2 + (floor * problem.scale) ** 2)
    singles = [e.fitted for e in findings.selection.explanations if len(e.names) == 1]
    ordered = ([after] if after.names else []) + [f for f in singles if f.names != after.names]
    shapes = [_signature_shape(findings, f) for f in ordered[:2]]
    labels = [' + '.join(effect_of(key) for key in f.names) for f in ordered[:2]]
    return Curves(
        (configured.outputs[0] - moved)[:rows],
        (findings.nothing.outputs + refit_error)[:rows],
        (after.outputs + after_error)[:rows],
        (held_refit + refit_error)[:rows],
        (held_after + after_error)[:rows],
        band[:rows],
        shapes[0][:rows] if shapes else None,
        labels[0] if labels else '',
        shapes[1][:rows] if len(shapes) > 1 else None,
        labels[1] if len(labels) > 1 else '',
    )


def _shared_error(findings: Findings, fitted: Fit, floor: float) -> FloatArray:
    """(N, 3) structural error known from a reference; zero without one."""
    setting = findings.setting
    active = setting.forward.active
    if active is None or floor == 0.0:
        return np.zeros_like(fitted.outputs)
    return shared_error(setting.problem, fitted, setting.observed, floor, active)


def _signature_shape(findings: Findings, fitted: Fit) -> FloatArray:
    """(N, 3) change of the model from soil refit to fitted effect: comparable with the residual."""
    return fitted.outputs - findings.nothing.outputs


def _smallest_visible(
    findings: Findings, known: Mapping[str, Effect]
) -> dict[str, tuple[str, float, str]]:
    """Size of each effect that these rows would have shown clearly (signature scaled linearly)."""
    found: dict[str, tuple[str, float, str]] = {}
    for name, s in findings.signatures.items():
        if name in findings.setting.effects and s.distance > 0.0:
            parameter = known[name].parameters[0]
            size = (parameter.name, abs(s.size) * CLEAR / s.distance, parameter.unit)
            found.setdefault(effect_of(name), size)  # of the first form that is visible
    return found


def _next(findings: Findings, verdict: Verdict, after: Fit) -> tuple[NextMeasurement, ...]:
    selection = findings.selection
    rivals: list[Fit] = []
    if verdict.word == 'named':
        for place, names in enumerate(verdict.open_sets):
            others = set(after.names) - {after.names[place]}
            for rival in names:
                try:
                    rivals.append(selection.find((*others, rival)).fitted)
                except KeyError:
                    continue
    if not rivals:
        wanted = [e.fitted for e in selection.explanations if e.names != after.names]
        wanted = [f for f in wanted if f.names or verdict.word == 'named']
        rivals = [f for f in wanted if not set(after.names) < set(f.names)][:1]
    noise = np.array(
        [
            float(np.nanmedian(findings.noise.std[:, q]))
            if np.isfinite(findings.noise.std[:, q]).any()
            else np.inf
            for q in range(3)
        ]
    )
    return next_measurement.propose(findings.setting, after, rivals, noise)


def _soil_shifts(findings: Findings, after: Fit, variance: FloatArray) -> tuple[SoilShift, ...]:
    weighted = after.jacobian / variance[:, None]
    covariance = np.linalg.inv(weighted.T @ after.jacobian + np.diag(after.prior))
    refit = findings.nothing.values()
    found = []
    for index, c in enumerate(after.coordinates):
        if c.owner != 'soil':
            continue
        u = float(after.u[index])
        found.append(
            SoilShift(
                c.name,
                float(c.value(0.0)),
                c.deviation(0.0, 1.0 / WIDENING),
                refit[c.key],
                float(c.value(u)),
                c.deviation(u, float(np.sqrt(covariance[index, index]))),
                WIDENING * u,
                c.unit,
            )
        )
    return tuple(found)
