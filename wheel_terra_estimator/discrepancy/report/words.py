# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Numbers and words of the report that follow from the search: gaps, reasons, notes, verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from scipy.special import chdtrc

from wheel_terra_estimator.discrepancy.assessment.along import Stretch
from wheel_terra_estimator.discrepancy.assessment.held_out import channels_off
from wheel_terra_estimator.discrepancy.decision import Decision
from wheel_terra_estimator.discrepancy.fitting.coordinates import BED, BED_SCATTER, SCATTER
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit
from wheel_terra_estimator.discrepancy.fitting.noise import ENOUGH_REPEATS, SCATTER_CHANCE
from wheel_terra_estimator.discrepancy.numbers import (
    OF_BEDS,
    SHOWN,
    amount,
    joined,
    number,
    percent,
    plain,
    with_unit,
)
from wheel_terra_estimator.discrepancy.result import (
    OPEN,
    Diagnosis,
    NextMeasurement,
    Noise,
    QuantityGap,
    SoilShift,
)
from wheel_terra_estimator.discrepancy.selection.readings import BY_RIM, BY_SPEED, units_apart
from wheel_terra_estimator.discrepancy.selection.search import Findings
from wheel_terra_estimator.discrepancy.selection.verdict import (
    IMPROBABLE,
    LARGEST_Z_SCORE,
    Remainder,
    Verdict,
    remainder,
)
from wheel_terra_estimator.discrepancy.tables.steady_table import (
    ON_ONE_BED,
    QUANTITIES,
    SteadyTable,
)
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.learned_closure import FEATURES

FACTORS = {
    'stiffness': 'the factor on soil.frictional_modulus and soil.cohesive_modulus',
    'tan_friction': 'the tangent of soil.friction_angle_deg',
}
# Inputs that tell effects apart, in the order of how easily a rig varies them.
_WORTH_VARYING = ('normal_load', 'lug_height')
_SURE = 2.0  # deviations, after the fit
_SHARED = 1.5  # times the error on unseen rows: more on seen ones is not in the model
_USUAL_OF_BEDS = 3.0  # deviations of ``BED_SCATTER``
REFERENCE_AGAIN = NextMeasurement(
    'the rows of the reference again on a fresh bed', ('another bed', 'an effect'), 0.0, math.inf
)
_SCATTERED = 0.2  # of the range: estimated noise beyond which agreement says little
_NOISIER = 1.2  # times the stated noise: a scatter that is worth a note
_COARSE = 0.05  # model-error floor above which agreement says little


def in_words(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Return what stays open and what to do next, without any statistics."""
    if diagnosis.misread:
        return {
            'open': ['What the column means: model.yaml is fitted to it as given.'],
            'next': ['Correct the column, and diagnose again.'],
        }
    still_off, known = channels_off(diagnosis.gap), catalogue()
    left = [
        f'{plain(name)} is still off by more than noise and the allowed model error.'
        for name in still_off
    ]
    if any(effect.remainder for effect in diagnosis.effects):
        left.append('A misfit remains that the named effect does not explain.')
    for effect in diagnosis.effects:
        for name in effect.confounded_with:
            by = known[effect.name].confounded_with.get(name)
            by = by or known[name].confounded_with.get(effect.name)
            what = f'; what separates them: {by}' if by else ''
            left.append(f'These rows cannot tell {plain(effect.name)} from {plain(name)}{what}.')
        for other in effect.alike:
            left.append(f'These rows cannot tell {plain(effect.name)} from {other}.')
    if diagnosis.verdict in OPEN and not still_off:
        left.append('Why these rows need a different soil, or more scatter, than stated.')
    settled = not left
    if settled:
        left.append('Nothing beyond noise and the allowed model error.')
    following = [f'Measure next: {worth(item)}.' for item in diagnosis.next_measurement[:1]]
    if diagnosis.verdict in OPEN and diagnosis.where.box:
        following.append(f'Look first where the gap is largest: {diagnosis.where.sentence}.')
    if diagnosis.verdict in OPEN:
        following += _to_settle(diagnosis)
    if diagnosis.proposal and diagnosis.proposal.soil_held:
        following.append(
            'The proposed law leaves a plausible soil; the refit without it does not. '
            'A measured soil number decides between the two.'
        )
    elif diagnosis.proposal:
        following.append('Until then use proposal.yaml, within the range of these rows only.')
    if not following and settled:
        following.append('Nothing; continue with model.yaml.')
    elif not following:
        following.append(
            'model.yaml is the best model so far; these rows do not show which measurement would '
            'settle what is open.'
        )
    return {'open': left, 'next': following}


def _to_settle(diagnosis: Diagnosis) -> list[str]:
    """Return what would settle an open verdict: the nearest effects, then what did not vary."""
    known = catalogue()
    names = diagnosis.proposal.resembles if diagnosis.proposal else diagnosis.nearest
    found = []
    for name in names:
        separates = next(iter(known[name].confounded_with.values()), '')
        if separates:
            found.append(f'To settle whether it is {plain(name)}, measure: {separates}.')
    if diagnosis.proposal:
        columns = [c for f in diagnosis.proposal.features for c in FEATURES[f].columns]
        levels = ' and '.join(plain(name) for name in dict.fromkeys(columns))
        if levels:
            found.append(f'More levels of {levels} would confirm the proposed law or refute it.')
    varied = set(diagnosis.table.varying())
    constant = [plain(name) for name in _WORTH_VARYING if name not in varied]
    if constant:
        found.append(f'Rows at another {" or ".join(constant)} would say more than further slips.')
    return found


def worth(item: NextMeasurement) -> str:
    """Return a measurement with what it is worth."""
    names = ['no effect' if name == 'nothing' else plain(name) for name in item.separates]
    competitors = ' from '.join(names)
    if not np.isfinite(item.distance_then):
        return f'{item.what} (separates {competitors})'
    now, then = number(item.distance_now, 2), number(item.distance_then, 2)
    return f'{item.what} (separates {competitors}: {now} times the noise apart now, {then} with it)'


def moved(shift: SoilShift) -> str:
    """Return how far the fit moved a configured number, and how well it was known."""
    key = shift.name if shift.name.startswith('effects.') else f'soil.{shift.name}'
    return (
        f'{FACTORS.get(shift.name, key)} from {number(shift.before)} to {number(shift.after)}, '
        f'{shift.z_score:+.1f} standard deviations ({shift.source})'
    )


_CLASS = 'class of source: '


def soil_line(diagnosis: Diagnosis) -> str:
    """Return which number the fit shifts farthest, and how well those of the soil were known."""
    sources = ', '.join(dict.fromkeys(s.source.removeprefix(_CLASS) for s in diagnosis.soil))
    farthest = max(diagnosis.moved, key=lambda shift: abs(shift.z_score))
    return f'Largest shift: {moved(farthest)}; standard deviations of the soil from: {sources}.'


def why_not(findings: Findings, verdict: Verdict, index: int) -> str:
    """Return why an explanation was not the one; empty for that one."""
    if index == verdict.index:
        return ''
    selection = findings.selection
    own, other = selection.explanations[index], selection.explanations[verdict.index]
    names, chosen = own.names, set(other.names)
    behind = float(selection.totals[verdict.index] - selection.totals[index])
    if own.effects == other.effects:
        return f'another form of the same: {behind:.1f} nats behind'
    open_names = {name for competitors in verdict.ambiguity_groups for name in competitors}
    if len(names) == len(chosen) and set(names) - chosen <= open_names:
        return f'cannot be told apart on these rows ({behind:.1f} nats behind)'
    if verdict.status == 'agrees':
        return f'no gap that needs it ({behind:.1f} nats behind nothing)'
    if verdict.status == 'unexplained':
        return _leaves(remainder(selection, index, findings.setting.problem))
    if chosen < set(names):
        extra = joined(sorted(set(names) - chosen))
        return f'{extra} is not supported by the data ({behind:.1f} nats behind)'
    if set(names) < chosen:
        return f'leaves what {joined(sorted(chosen - set(names)))} explains ({behind:.1f} nats)'
    return f'fits worse: {behind:.1f} nats behind {joined(sorted(chosen))}'


def _leaves(left: Remainder) -> str:
    """Return what an explanation leaves, for which it is not given."""
    if left.probability > 0.5:
        return 'leaves a smooth misfit that it does not explain'
    if left.p_value <= IMPROBABLE:
        return 'leaves more scatter than the noise allows'
    if left.z_score >= LARGEST_Z_SCORE:
        return 'needs a configured number implausibly far off'
    return 'too uncertain to be named'


def _undecided(gap: Mapping[str, QuantityGap], nearest: tuple[str, ...]) -> str:
    """Return what is off, by how much, and which effects come nearest."""
    off = ' and '.join(
        f'{plain(name)} is off by {amount(name, gap[name].after)} {SHOWN[name][1]} on unseen rows '
        f'(noise and allowed model error permit {amount(name, gap[name].limit)})'
        for name in channels_off(gap)
    )
    text = f'Undecided: {off}, but these rows favour neither the refitted soil nor an effect'
    return f'{text}; nearest: {", ".join(nearest)}.' if nearest else f'{text}.'


def notes(
    findings: Findings,
    after: Fit,
    shifts: Iterable[SoilShift],
    stretch: Stretch | None,
) -> tuple[str, ...]:
    """Return remarks for people: the reader's, noise, outliers, soil far off, effects at bounds."""
    table = findings.table
    found = list(table.notes)
    if stretch:
        found.append(f'{stretch.text}; diagnose the two apart')
    guessed = [q for q, origin in findings.noise.origin.items() if origin == 'estimated']
    if guessed:
        found.append(
            f'noise of {", ".join(guessed)} was not stated and was estimated from the scatter: '
            'errors that neighbouring rows share (digitised figures) are not in it; state them in '
            '*_std columns'
        )
    found += _repeatability(findings.noise)
    for q, name in enumerate(QUANTITIES):
        times = findings.noise.std[: len(table), q] / table.stated_std[:, q]
        if findings.noise.origin.get(name) == 'given' and np.nanmedian(times) > _NOISIER:
            so = f'the scatter is {number(float(np.nanmedian(times)), 2)} times the stated noise'
            found.append(f'{plain(name)}: {so}, and is used')
    if findings.outliers:
        count = len(findings.outliers)
        several = f'{count} cells were rejected as outliers'
        found.append('1 cell was rejected as an outlier' if count == 1 else several)
    found += [
        f'{moved(shift)}: check it before any effect'
        for shift in shifts
        if abs(shift.z_score) > LARGEST_Z_SCORE
    ]
    for c, u in zip(after.coordinates, after.u, strict=True):
        if c.owner != 'soil' and (u - c.lower < 1e-3 or c.upper - u < 1e-3):
            key = f'{OF_BEDS[c.name]} of the bed' if c.owner == BED else c.key
            found.append(f'{key} stands at the end of its range ({number(float(c.value(u)))})')
    return tuple(found)


def _repeatability(noise: Noise) -> list[str]:
    """Return where rows that repeat one another scatter by another amount than was stated."""
    found = []
    for name, (times, count) in noise.scatter.items():
        chance = float(chdtrc(count, count * times**2))
        if not SCATTER_CHANCE < chance < 1.0 - SCATTER_CHANCE:
            used = times > 1.0 and count >= ENOUGH_REPEATS
            so = 'the scatter is used' if used else 'one of the two is wrong'
            found.append(
                f'{plain(name)}: rows that repeat one another scatter by {number(times, 2)} times '
                f'their stated noise; {so}'
            )
    return found


def own_beds(
    decision: Decision, table: SteadyTable
) -> tuple[tuple[str, ...], tuple[NextMeasurement, ...]]:
    """Return a remark where the soil may differ (sweeps, days, rows), and what to measure then."""
    if not decision.beds_differ:
        return (), ()
    ground, usual = decision.ground, percent(SCATTER[decision.ground]['stiffness'])
    swept = ' and '.join(plain(name) for name in table.varying() if name not in ON_ONE_BED)
    what = {
        'row': 'the drive again beside its ruts',
        'sweep': 'one sweep again on a fresh bed, with a column trial',
        'day': 'a sweep of each day again, all on one day',
        'drift': 'the first rows again, after the last',
    }[ground]
    together = ''
    if ground == 'sweep' and not swept:  # trials alone
        what = 'the sweep again on three more fresh beds'
    elif ground == 'sweep':
        together = f'{swept} and bed changed together: '
        if 'trial' in table.columns:
            what = f'the sweeps of least and greatest {swept} again, each on two fresh beds'
    ends = 'the first row to the last' if ground == 'drift' else f'{ground} to {ground}'
    remark = (
        f'{together}that the beds differ from {ends} ({usual} of the stiffness is usual) is '
        f'{percent(decision.beds_differ)} likely'
    )
    competitors = 'another bed', f'an effect of {swept or "slip"}'
    return (remark,), (NextMeasurement(what, competitors, 0.0, math.inf),)


def another_bed(fitted: Fit) -> str:
    """Return how the bed differs from that of the reference; empty where the rows are not sure."""
    sure = [
        (c, u, value)
        for c, u, value, _, std_of_u in fitted.numbers()
        if c.owner == BED and abs(u) > _SURE * std_of_u
    ]
    factors = ' and '.join(f'{number(v, 3)} times the {OF_BEDS[c.name]}' for c, _, v in sure)
    farthest = max((c.stated * abs(u) for c, u, _ in sure), default=0.0)
    so = 'more than beds usually differ' if farthest > _USUAL_OF_BEDS else 'beds differ so'
    usual = ' and '.join(map(percent, BED_SCATTER.values()))
    return factors and f'the bed has {factors} of that of the reference: {so} ({usual} are usual)'


def alone(gap: Mapping[str, QuantityGap]) -> tuple[str, ...]:
    """Return how far the model is off where most of the fit is an error shared with a reference."""
    errors = [
        f'{plain(name)} {amount(name, item.fitted, 2)} {SHOWN[name][1]} '
        f'(as configured {amount(name, item.before, 2)})'
        for name, item in gap.items()
        if item.fitted > _SHARED * item.after
    ]
    if not errors:
        return ()
    share = 'the error that table and reference share is in no file: model.yaml alone errs by'
    return (f'{share} {", ".join(errors)}',)


_SLIPS = {
    'rim': ('referred to the rim', 'set slip_radius: rim'),
    'lug_tip': ('referred to the tips of the lugs', 'set slip_radius: lug_tip'),
    BY_SPEED: ('were r w/v - 1', 'a driving one of i is i/(1 + i)'),
    BY_RIM: ('were 1 - v/(r w)', 'a braking one of -i is -i/(1 + i)'),
}


def wrong_columns(misread: Mapping[str, float | str]) -> str:
    """Return which columns look as if they held something else than was said, and the remedy."""
    parts = []
    for name, times in misread.items():
        if isinstance(times, str):
            looks, remedy = _SLIPS[times]
            parts.append(f'the {name} looks as if it {looks} ({remedy})')
            continue
        usual = 'of one wheel or of a pair?' if name == 'normal_load' else ''
        which = units_apart(name, times) or usual
        aside = f' ({which})' if which else ''
        parts.append(f'the unit of {plain(name)} looks wrong{aside}, it lacks a factor {times:.4g}')
    text = ' and '.join(parts)
    return (
        f'{text[0].upper()}{text[1:]}: that explains the rows far better than any effect. '
        'Correct the column, or the soil of --config if it is right; no effect is named until then.'
    )


def _scattered(findings: Findings) -> str:
    """Return estimated noise so large that anything agrees; empty if there is none."""
    problem, noise = findings.setting.problem, findings.noise
    shares = {
        name: float(np.nanmedian(noise.std[:, q])) / problem.scale[q]
        for q, name in enumerate(QUANTITIES)
        if noise.origin.get(name) == 'estimated'
    }
    return ' and '.join(
        f'{percent(share)} of the range of the {plain(name)}'
        for name, share in shares.items()
        if share > _SCATTERED
    )


def _agreement(decision: Decision, gap_p_value: float) -> str:
    """Return beside what the rows agree with the model, the soil refitted."""
    floor, scattered = decision.floor, _scattered(decision.findings)
    if scattered:
        return (
            'These rows are too scattered to judge the model: it agrees with them beside a noise '
            f'estimated at {scattered}; state it in *_std columns, or look for what changes from '
            'row to row.'
        )
    error, shared = f'{number(100 * floor, 2)} % of the range', decision.verdict.left.shared
    if floor > _COARSE and not shared:
        return (
            'These rows are too scattered to judge the model: it agrees with them, but only within '
            f'{error} (p = {number(gap_p_value, 2)}).'
        )
    within, who = f', with a model-error floor of {error}', 'Model and measurement'
    if shared:
        within, who = f', but for an error of {error} that both have', 'Rows and reference'
    if not floor:
        within = '' if shared else ' (model-error floor needed: none)'
    only = f' only if each {decision.ground} had its own bed,' if decision.ground else ''
    if decision.ground == 'drift':
        only = ' only if the soil drifts from row to row,'
    rest = '; else something is missing' if only else ''
    return f'{who} agree{only} once the soil is refitted{within}{rest}.'


def sentence(
    decision: Decision,
    gap_p_value: float,
    stretch: Stretch | None,
    nearest: tuple[str, ...],
) -> str:
    """Return the verdict in words."""
    verdict, left = decision.verdict, decision.verdict.left
    near = f'nearest: {", ".join(nearest)}' if nearest else ''
    if decision.misread:
        return wrong_columns(decision.misread)
    if verdict.status == 'undecided':
        return _undecided(decision.gap, nearest)
    if verdict.status == 'agrees':
        return _agreement(decision, gap_p_value)
    if verdict.status == 'unexplained' and stretch:
        return (
            'Model and measurement disagree; none of the known effects alone explains it, but '
            f'{stretch.text}.'
        )
    if verdict.status == 'unexplained' and left.only_far:
        return (
            'Model and measurement agree only with numbers too far from the configured ones to be '
            f'believed (one by {left.z_score:.1f} of its standard deviations, at most '
            f'{LARGEST_Z_SCORE:g} are believed): they are wrong, or something is missing that acts '
            f'like them{f" ({near})" if near else ""}.'
        )
    if verdict.status == 'unexplained':
        share = f'{100 * left.amplitude:.0f} %'
        size = f'a plausible soil leaves a misfit of about {share} of the range'
        if left.amplitude < 0.005:  # with a reference what is shared is not in it
            scatter = 'nothing smooth, but more scatter than the noise allows, is left'
            size = '' if left.shared else scatter
        aside = '; '.join(filter(None, (size, near)))
        return (
            'Model and measurement disagree, and none of the known effects explains it well enough '
            f'to be named{f" ({aside})" if aside else ""}.'
        )
    parts = []
    for effect in decision.effects:
        values = ', '.join(
            with_unit(f'{name} = {number(p.value)} +- {number(p.std, 2)}', p.unit)
            for name, p in effect.parameters.items()
        )
        form = f' in the form {plain(effect.form)}' if effect.form else ''
        text = f'{effect.name}{form} ({values}; confidence {percent(effect.confidence)})'
        if effect.confounded_with:
            competitors = ' or '.join(effect.confounded_with)
            text += f' or {competitors} (one of them: {percent(effect.confidence_of_set)})'
        if effect.alike:
            text += f', unless it is {" or ".join(effect.alike)}, which would look alike'
        parts.append(text)
    result = 'Missing in the model: ' + ', and '.join(parts)
    if any(effect.remainder for effect in decision.effects):
        result += '; a misfit remains that this does not explain'
    return result + '.'
