# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Measured sinkage: unit, sign, zero, noise, wheel order."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.faults import found, listed
from wheel_terra_estimator.checks.finding import Finding, NotChecked, Outcome
from wheel_terra_estimator.checks.statistics import robust_std
from wheel_terra_estimator.checks.trial import halves
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.sensor_errors import LinearErrors, SensorErrors

FloatArray = NDArray[np.float64]

DEEPEST = 1.2
"""Sinkage over radius that no wheel gets out of [-]."""
LEAST_READINGS = 50
NOISE_FACTOR = 4.0
BELOW_ZERO = 0.006
"""A median sinkage further above the ground than this [m] is no sinkage (lugs carry less)."""
ALIKE_SHARE = 0.4
"""Share by which the offset of a wheel may change over a drive to count as its zero [-]."""
ODD_ZERO = 0.015
"""A wheel that reads this much less or more than every other of its side [m] is odd."""


def check_sinkage(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Return what is wrong with the sinkage readings."""
    sinkage, facts = evidence.recording.sinkage, evidence.facts
    if sinkage is None:
        return [NotChecked('zero', 'no sinkage in the recording')]
    outcomes: list[Outcome] = []
    stated = facts.configuration.wheels.names if facts.configuration else ()
    mute = [name for name in stated if name not in sinkage.names]
    if mute:
        outcomes.append(found('sinkage_missing', sinkage.topic, 0.9, wheel=', '.join(mute)))
    wheels = facts.configuration.wheels.names if facts.configuration else sinkage.names
    columns = [i for i, name in enumerate(sinkage.names) if name in wheels]
    table = sinkage.sinkage[:, columns]
    names = [sinkage.names[i] for i in columns]
    if not columns or np.isfinite(table).sum(axis=0).max() < LEAST_READINGS:
        return [*outcomes, NotChecked('zero', 'hardly any sinkage readings')]
    unit, table = _unit(evidence, table)
    outcomes += unit
    if facts.configuration is not None:
        table = without_stated_errors(facts.configuration, names, table)
    middle = np.array([_median(column) for column in table.T])
    figures['sinkage.median_m'] = [round(float(m), 4) for m in middle]
    outcomes += _sign_and_zero(evidence, names, table, middle)
    outcomes += _noise(evidence, table, figures)
    return outcomes


def without_stated_errors(
    configuration: Configuration, names: list[str], table: FloatArray
) -> FloatArray:
    """Return readings (k, p) of the named wheels without the errors that the rover file states."""
    errors = SensorErrors(configuration).sinkage
    rows = [configuration.wheels.names.index(name) for name in names]
    return LinearErrors(errors.zero[rows], errors.gain[rows]).true(table)


def _whole_zero(evidence: Evidence, name: str, left: float) -> float:
    """Return the zero of a reading [m] of which ``left`` remains behind the one stated."""
    configuration = evidence.facts.configuration
    if configuration is None:
        return left
    errors, index = SensorErrors(configuration).sinkage, configuration.wheels.names.index(name)
    return float(errors.zero[index] + errors.gain[index] * left)


def _median(column: FloatArray) -> float:
    known = column[np.isfinite(column)]
    return float(np.median(known)) if known.size else math.nan


def _unit(evidence: Evidence, table: FloatArray) -> tuple[list[Outcome], FloatArray]:
    sinkage, configuration = evidence.recording.sinkage, evidence.facts.configuration
    assert sinkage is not None
    radius = float(np.nanmean(evidence.facts.radius)) if configuration else 0.5
    stated = configuration.sensors.sinkage_std if configuration else 0.002
    noise = _reading_noise(table)
    level = float(np.nanmedian(np.abs(table)))
    for unit, factor in (('millimetres', 1e-3), ('centimetres', 1e-2)):
        # Both the depth and the noise have to fit the unit.
        fits = 0.1 < noise * factor / max(stated, 1e-4) < 10.0 and level * factor < 0.8 * radius
        if (level > DEEPEST * radius or noise > 0.2 * radius) and fits:
            outcome = found(
                'sinkage_unit',
                sinkage.topic,
                0.97,
                value=factor,
                level=level,
                noise=noise,
                radius=radius,
                unit=unit,
            )
            return [outcome], table * factor
    return [], table


def _reading_noise(table: FloatArray) -> float:
    bends = [np.diff(column[np.isfinite(column)], 2) / math.sqrt(6.0) for column in table.T]
    return float(np.median([robust_std(bend) for bend in bends if bend.size > 10] or [0.0]))


def _sign_and_zero(
    evidence: Evidence, names: list[str], table: FloatArray, middle: FloatArray
) -> list[Outcome]:
    sinkage, configuration = evidence.recording.sinkage, evidence.facts.configuration
    assert sinkage is not None
    lugs = float(np.max(configuration.wheels.lug_height)) if configuration else 0.0
    limit = BELOW_ZERO + lugs
    if np.nanmedian(middle) < -limit:
        return [_reversed_or_zero(evidence, names, table, float(np.nanmedian(middle)))]
    outcomes: list[Outcome] = []
    if np.nanmedian(np.abs(middle)) < limit:
        outcomes.append(NotChecked('sign', 'sinkage: hardly any in it; drive where it is soft'))
    for index, name in enumerate(names):
        others = np.delete(middle, index)
        if others.size < 2 or not np.isfinite(middle[index]):
            continue
        far = middle[index] - float(np.nanmedian(others))
        spread = float(np.nanmax(others) - np.nanmin(others))
        if middle[index] < -limit and np.nanmin(others) > -limit:
            reading = table[:, index]
            typical = float(np.nanmedian(others))
            mirrored = abs(-middle[index] - typical) < 0.6 * typical
            kind = 'sign' if mirrored and _skew(reading) <= 0.0 else 'zero'
            if kind == 'sign' or abs(far) > ODD_ZERO:
                outcomes.append(_one_wheel(evidence, name, kind, middle[index], typical))
        elif abs(far) > max(ODD_ZERO, 3.0 * spread) and _lasting(table, index, far):
            outcomes.append(
                _one_wheel(evidence, name, 'zero', middle[index], float(np.nanmedian(others)))
            )
    return outcomes


def _lasting(table: FloatArray, index: int, far: float) -> bool:
    """Return whether a wheel reads so much more than the others in both halves, shallow and deep.

    A zero shifts all readings; a wheel that digs itself in is deeper now and then.
    """
    apart = []
    for part in halves(np.ones(table.shape[0])):
        low, high = np.nanquantile(table[part], [0.1, 0.9], axis=0)
        apart += [float(q[index] - np.nanmedian(np.delete(q, index))) for q in (low, high)]
    return all(abs(one - far) < ALIKE_SHARE * abs(far) for one in apart)


def _one_wheel(evidence: Evidence, name: str, kind: str, reading: float, typical: float) -> Finding:
    assert evidence.recording.sinkage is not None
    topic = evidence.recording.sinkage.topic
    off = reading - typical
    if kind == 'sign':
        others = f', the others {1000 * typical:.0f} mm'
        told: dict[str, Any] = {'reading': 1000 * reading, 'others': others, 'of': f' of {name}'}
        return found('sinkage_sign', topic, 0.9, wheel=name, value=-1.0, **told)
    how = f'reads {1000 * off:+.0f} mm off the other wheels all the time'
    return _zero(evidence, [name], off, 0.9, how, wheel=name)


def _zero(
    evidence: Evidence,
    names: list[str],
    left: float,
    sure: float,
    how: str,
    wheel: str | None = None,
) -> Finding:
    """Return the finding of a zero [m] that is left in the readings of some wheels."""
    sinkage, facts = evidence.recording.sinkage, evidence.facts
    assert sinkage is not None
    zeros = np.zeros(len(facts.names))
    if facts.configuration is not None:
        zeros = SensorErrors(facts.configuration).sinkage.zero.copy()
    for name in names:
        if name in facts.names:
            zeros[facts.names.index(name)] = _whole_zero(evidence, name, left)
    value = float(np.mean([_whole_zero(evidence, name, left) for name in names]))
    return found(
        'sinkage_zero',
        sinkage.topic,
        sure,
        wheel=wheel,
        value=round(value, 4),
        how=how,
        zeros=listed(zeros),
    )


def _reversed_or_zero(
    evidence: Evidence, names: list[str], table: FloatArray, middle: float
) -> Finding:
    """Tell a reversed sign (deep spells go down) from a zero error (deep spells go up)."""
    sinkage = evidence.recording.sinkage
    assert sinkage is not None
    skew = float(np.median([_skew(column) for column in table.T]))
    top = float(np.nanmedian(np.nanquantile(table, 0.98, axis=0)))
    if top < 0.004 and skew < 0.3:
        told: dict[str, Any] = {'reading': 1000 * middle, 'others': '', 'of': ''}
        return found('sinkage_sign', sinkage.topic, 0.9, value=-1.0, **told)
    how = f'median sinkage {1000 * middle:.0f} mm: the wheels would float'
    return _zero(evidence, names, middle, 0.8, how)


def _skew(column: FloatArray) -> float:
    """Return the skewness by quantiles (Bowley 1901), from -1 to 1."""
    known = column[np.isfinite(column)]
    if known.size < LEAST_READINGS:
        return 0.0
    low, middle, high = np.quantile(known, [0.1, 0.5, 0.9])
    return float((high + low - 2.0 * middle) / max(high - low, 1e-9))


def _noise(evidence: Evidence, table: FloatArray, figures: dict[str, Any]) -> list[Outcome]:
    sinkage, configuration = evidence.recording.sinkage, evidence.facts.configuration
    if configuration is None or sinkage is None:
        return []
    noise = _reading_noise(table)
    figures['sinkage.noise_m'] = float(f'{noise:.3g}')
    stated = float(configuration.sensors.sinkage_std)
    if noise < NOISE_FACTOR * stated:
        return []
    return [
        found(
            'sinkage_noise',
            sinkage.topic,
            0.95,
            value=float(f'{noise:.2g}'),
            noise=noise,
            noise_mm=1000.0 * noise,
            stated=1000.0 * stated,
        )
    ]
