# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Measured sinkage: unit, sign, zero, noise, wheel order."""

from __future__ import annotations

import math

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import Finding, Outcome, listed, not_checked
from wheel_terra_estimator.checks.rover_facts import RoverFacts
from wheel_terra_estimator.checks.series import SinkageSeries
from wheel_terra_estimator.checks.statistics import bend_noise, halves
from wheel_terra_estimator.checks.turning import sides_exchanged
from wheel_terra_estimator.estimation.sensor_errors import LinearErrors

DEEPEST = 1.2  # sinkage over radius that no wheel gets out of [-]
DEEPEST_USUAL = 0.75  # the same that no rover drives with most of the time [-]
NO_DEPTH = 3.0  # the same over the other wheels, either way, that is no zero of a sensor [-]
LEAST_READINGS = 50
ANOTHER_UNIT = 30.0  # noise over the stated one from which it may be another unit [-]
USUAL_RADIUS = 0.15  # wheels below this [m] have smaller limits, as their radii are
DEEP_SPELL = 0.004  # highest readings [m] from which a reading below the ground is no sign error
BELOW_ZERO = 0.006  # median above the ground that no sinkage has [m] (lugs carry less)
UNLIKE_AXLES = 3.0  # sinkage of an axle over that of another one, at most [-]
ALIKE_SHARE = 0.4  # change of an offset over a drive that is still a zero, as a share [-]
DEEP_STD = 0.02  # deviation of a zero of all wheels: their true sinkage [m]
ODD_ZERO = 0.01  # A wheel that reads this much less or more than every other of its side [m] is odd


def check_sinkage(evidence: Evidence) -> tuple[list[Outcome], Evidence]:
    """Return faults of the sinkage readings, and the evidence with their signs corrected."""
    sinkage = evidence.recording.sinkage
    if sinkage is None:
        return [not_checked('zero', 'no_sinkage')], evidence
    outcomes: list[Outcome] = [not_checked('exchanged_wheels', 'sinkage_order')]
    outcomes.append(not_checked('delay', 'sinkage'))
    names, table = without_stated_errors(evidence.facts, sinkage)
    nothing = [names[i] for i in np.flatnonzero(~np.isfinite(table).any(axis=0))]
    few = not names or np.isfinite(table).sum(axis=0).max() < LEAST_READINGS
    if few or not np.nan_to_num(table).any():
        why = ('zero', 'sinkage_few') if few else ('placeholder', 'sinkage_zero')
        return [*outcomes, not_checked(*why)], evidence
    if nothing:
        outcomes.append(not_checked('zero', 'sinkage_no_number', wheels=', '.join(nothing)))
    unit, table = _unit(evidence, table)
    middle = np.nanmedian(table, axis=0)
    evidence.figures['sinkage.median_m'] = [round(float(m), 4) for m in middle]
    evidence.figures['sinkage.noise_m'] = noise = float(f'{_reading_noise(table):.3g}')
    facts = evidence.facts
    if facts.known and noise > ANOTHER_UNIT * float(facts.sensors.sinkage_std):
        unknown = np.full_like(sinkage.sinkage, np.nan)  # zeros and signs would be those of noise
        mended = evidence.with_channel('sinkage', sinkage=unknown)
        return [*outcomes, *unit, not_checked('unit', 'sinkage_scatters', noise=noise)], mended
    findings = _sign_and_zero(evidence, names, table, middle)
    outcomes += [*unit, *findings]
    known = sinkage.sinkage
    for finding in findings:
        if isinstance(finding, Finding):  # a zero is left unknown, as what may be a sign is
            wrong = [finding.wheel in (None, name) for name in sinkage.names]
            known = np.where(wrong, np.nan, known)
    return outcomes, evidence.with_channel('sinkage', sinkage=known)


def without_stated_errors(
    facts: RoverFacts, sinkage: SinkageSeries
) -> tuple[list[str], FloatArray]:
    """Return wheels and their readings (k, p) without the errors that the rover file states."""
    if not facts.known:
        return list(sinkage.names), sinkage.sinkage
    # The wheels as the sinkage names them: as the joints do, or the rover file.
    pairs = zip(facts.names, facts.configuration.wheels.names, strict=True)
    own = [now if now in sinkage.names else stated for now, stated in pairs]
    names, errors = [name for name in sinkage.names if name in own], facts.errors.sinkage
    rows = [own.index(name) for name in names]
    table = sinkage.sinkage[:, [sinkage.names.index(name) for name in names]]
    return names, LinearErrors(errors.zero[rows], errors.gain[rows]).true(table)


def _radius(evidence: Evidence) -> float:
    return float(np.nanmean(evidence.facts.radius)) if evidence.facts.known else 0.5


def _unit(evidence: Evidence, table: FloatArray) -> tuple[list[Outcome], FloatArray]:
    radius, stated = _radius(evidence), evidence.facts.sensors.sinkage_std
    noise = _reading_noise(table)
    level = float(np.nanmedian(np.abs(table)))
    off = {}
    for unit, factor in (('millimetres', 1e-3), ('centimetres', 1e-2), ('inches', 0.0254)):
        # Both the depth and the noise have to fit the unit.
        ratio = noise * factor / max(stated, 1e-4)
        if level > DEEPEST * radius and 0.1 < ratio < 10.0 and level * factor < 0.8 * radius:
            off[unit, factor] = abs(math.log(ratio))
    if off:
        (unit, factor), *others = sorted(off, key=lambda entry: off[entry])
        details = {'level': level, 'noise': noise, 'radius': radius, 'unit': unit}
        details['alternative'] = ''.join(f', or in {other}' for other, _ in others)
        finding = evidence.found('sinkage_unit', 0.97 / len(off), value=factor, **details)
        return [finding], table * factor
    return [], table


def _reading_noise(table: FloatArray) -> float:
    columns = [column[np.isfinite(column)] for column in table.T]
    return float(np.median([bend_noise(c) for c in columns if c.size > 12] or [0.0]))


def _sign_and_zero(
    evidence: Evidence, names: list[str], table: FloatArray, middle: FloatArray
) -> list[Outcome]:
    lugs = float(np.max(evidence.facts.configuration.wheels.lug_height))
    small = min(_radius(evidence) / USUAL_RADIUS, 1.0)
    limit, usual = BELOW_ZERO * small + lugs, float(np.nanquantile(middle, 0.5, method='higher'))
    deep = usual > DEEPEST_USUAL * _radius(evidence)  # perhaps the height of the hub
    if usual < -limit or deep:  # most wheels
        top = float(np.nanmedian(np.nanquantile(table, 0.98, axis=0)))
        if top > DEEP_SPELL * small and not deep:
            how = f'median sinkage {1000 * usual:.0f} mm: the wheels would float'
            return [_zero(evidence, names, usual, DEEP_STD * small, how)]
        return [evidence.found('sinkage_sign', 0.5, value=-1.0, reading=1000 * usual)]
    shallow = np.nanmedian(np.abs(middle)) < limit
    unseen = ('sign', 'sinkage_shallow') if shallow else ('zero', 'sinkage_deep')
    outcomes: list[Outcome] = [not_checked(*unseen)]
    facts = evidence.facts
    across = {a: facts.names[i] for a, i in zip(facts.names, sides_exchanged(facts), strict=True)}
    for index, name in enumerate(names):
        others, own = np.delete(middle, index), float(middle[index])
        if others.size < 2 or not np.isfinite(own):
            continue
        typical = float(np.nanmedian(others))
        far = own - typical
        spread = max(float(np.nanmax(others) - np.nanmin(others)), 0.1 * abs(far))
        how = f'reads {1000 * far:+.0f} mm against the other wheels all the time'
        least = max(ODD_ZERO * small, 3.0 * float(np.nanmax(others) - np.nanmin(others)))
        # A reading far beyond that is no sinkage.
        if least < abs(far) < NO_DEPTH * _radius(evidence) and _lasting(table, index, far):
            other = across.get(name, name)
            axles = own > 0.0 and max(own, typical) < UNLIKE_AXLES * min(own, typical)
            if axles and other != name:  # of an axle that sinks so much deeper, or less deep
                how += f', or {other} {-1000 * far:+.0f} mm and their axle sinks otherwise'
            outcomes.append(_zero(evidence, [name], far, spread, how, 0.5 if axles else 0.9))
    return outcomes


def _lasting(table: FloatArray, index: int, far: float) -> bool:
    """Return whether a wheel reads so much more than the others in both halves, shallow and deep.

    A zero shifts all readings; a wheel that digs itself in is deeper now and then.
    """
    differences = []
    for part in halves(np.ones(table.shape[0])):
        low, high = np.nanquantile(table[part], [0.1, 0.9], axis=0)
        differences += [float(q[index] - np.nanmedian(np.delete(q, index))) for q in (low, high)]
    return all(abs(one - far) < ALIKE_SHARE * abs(far) for one in differences)


def _zero(
    evidence: Evidence, names: list[str], left: float, std: float, how: str, sure: float = 0.8
) -> Finding:
    """Return the finding of a zero [m] that is left in the readings of some wheels."""
    facts = evidence.facts
    zeros, gain = facts.errors.sinkage.zero.copy(), facts.errors.sinkage.gain
    rows = [facts.names.index(name) for name in names if name in facts.names]
    zeros[rows] += gain[rows] * left
    value = round(float(np.mean(zeros[rows])), 4) if rows else round(left, 4)
    wheel = names[0] if len(names) == 1 else None
    details = {'wheel': wheel, 'value': value, 'std': round(std, 4), 'zeros': listed(zeros)}
    return evidence.found('sinkage_zero', sure, how=how, **details)
