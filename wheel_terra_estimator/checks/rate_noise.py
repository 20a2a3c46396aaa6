# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Noise of the wheel rates, and the steps of a coarse encoder."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.checks.evidence import Evidence
from wheel_terra_estimator.checks.finding import Finding, Outcome
from wheel_terra_estimator.checks.statistics import robust_std

FloatArray = NDArray[np.float64]

NOISE_FACTOR = 5.0
LEAST_NOISE_SHARE = 0.08
"""Noise of a rate that matters, as a share of the working rate."""
COUNTING_STD = 1.0 / math.sqrt(6.0)
"""Deviation of a rate from two counts, each off by up to one, as a share of a count [-]."""
STEP_FACTOR = 1.0
"""Noise by the steps over the one stated, above which it matters [-]."""
LEAST_STEP_SHARE = 0.02
"""Noise by the steps of an encoder that matters, as a share of the working rate."""
MOST_STEPS = 200
"""Different rates of one wheel beyond which steps do not matter."""
SAME_VALUE = 1e-6
"""Share of the greatest rate below which two rates are one."""
OFF_A_STEP = 0.05
"""Distance from a multiple of a step, as a share of it."""


def check_noise(evidence: Evidence, figures: dict[str, Any]) -> list[Outcome]:
    """Compare the noise and the steps of the rates with what the rover file states."""
    configuration, joints = evidence.facts.configuration, evidence.recording.joints
    rows = evidence.moving
    if configuration is None or joints is None or rows.sum() < 60:
        return []
    stated = float(configuration.sensors.wheel_rate_std)
    found: list[Outcome] = []
    noises, steps = {}, {}
    for index, name in enumerate(evidence.facts.names):
        rate = evidence.rate[:, index]
        bend = np.diff(rate, 2)[rows[1:-1]] / math.sqrt(6.0)
        bend = bend[np.isfinite(bend)]
        if bend.size > 50:
            noises[name] = max(robust_std(bend), 0.5 * float(np.std(bend)))
            steps[name] = rate_step(rate[rows], _intervals(evidence.time)[rows])
    if not noises:
        return []
    typical = float(np.median(list(noises.values())))
    figures['wheels.rate_noise_rad_s'] = float(f'{typical:.3g}')
    typical_step = float(np.median(list(steps.values())))
    if typical_step:
        figures['wheels.rate_step_rad_s'] = float(f'{typical_step:.3g}')
    limit = max(NOISE_FACTOR * stated, LEAST_NOISE_SHARE * evidence.working_rate)
    coarse = max(STEP_FACTOR * stated, LEAST_STEP_SHARE * evidence.working_rate)
    for name, noise in noises.items():
        of_steps = steps[name] * COUNTING_STD
        alone = noise > 4.0 * typical or steps[name] > 4.0 * typical_step
        if not (alone or name == next(iter(noises))):
            continue
        wheel = name if alone else None
        if of_steps > coarse:
            found.append(_coarse(evidence, wheel, steps[name], stated))
        elif noise > limit:
            found.append(
                Finding(
                    kind='noise',
                    topic=joints.topic,
                    wheel=wheel,
                    parameter='sensors.wheel_rate_std',
                    value=float(f'{noise:.2g}'),
                    confidence=0.95,
                    words=f'rate scatters by {noise:.2g} rad/s where the rover file has {stated:g}',
                    cure=f'sensors.wheel_rate_std: {noise:.2g}',
                )
            )
    return found


def _coarse(evidence: Evidence, wheel: str | None, step: float, stated: float) -> Finding:
    joints = evidence.recording.joints
    assert joints is not None
    noise = step * COUNTING_STD
    turn = 2.0 * math.pi / (step * evidence.period)
    return Finding(
        kind='noise',
        topic=joints.topic,
        wheel=wheel,
        parameter='sensors.wheel_rate_std',
        value=float(f'{noise:.2g}'),
        confidence=0.95,
        words=(
            f'rate comes in steps of {step:.3g} rad/s ({100 * step / evidence.working_rate:.0f} % '
            f'of the usual rate), as of an encoder of {turn:.0f} counts per turn of the wheel read '
            f'every {evidence.period:.3g} s; the rover file has a noise of {stated:g}'
        ),
        cure=(
            f'sensors.wheel_rate_std: {noise:.2g}, or form the rate over more counts (a longer '
            'interval) in the driver'
        ),
    )


def _intervals(time: FloatArray) -> FloatArray:
    """Return the time since the row before [s], usual at the first."""
    return np.diff(time, prepend=2.0 * time[0] - time[1]) if time.size > 1 else np.ones(time.size)


def common_step(rate: FloatArray, time: FloatArray) -> float:
    """Return the usual step of the rates (k, n) of all wheels [rad/s]; 0 for none."""
    interval = _intervals(time)
    return float(np.median([rate_step(column, interval) for column in rate.T]))


def rate_step(rate: FloatArray, interval: FloatArray) -> float:
    """Return the step of rates that are multiples of one number [rad/s]; 0 where they are not.

    Parameters
    ----------
    rate, interval : numpy.ndarray
        (k,) rates [rad/s], and the time over which each was counted [s]: counts over unequal
        times are multiples of an angle, not of a rate.
    """
    known = np.isfinite(rate) & (interval > 0.0)
    rate, interval = rate[known], interval[known]
    usual = float(np.median(interval)) if interval.size else 1.0
    for values in (rate, rate * interval / usual):
        step = _step_of(values)
        if step:
            return step
    return 0.0


def _step_of(values: FloatArray) -> float:
    top = float(np.abs(values).max()) if values.size else 0.0
    if not top:
        return 0.0
    distinct = np.unique(np.round(np.abs(values) / (SAME_VALUE * top))) * SAME_VALUE * top
    if not 1 < len(distinct) <= min(MOST_STEPS, values.size / 4):
        return 0.0
    step = float(np.quantile(np.diff(distinct), 0.1, method='lower'))
    for _ in range(2):  # refined by all multiples
        count = np.round(values / step)
        step = float(values @ count / (count @ count)) if count.any() else 0.0
        if step <= 0.0:
            return 0.0
    fits = np.abs(values / step - np.round(values / step)) < OFF_A_STEP
    return step if float(np.mean(fits)) > 0.95 else 0.0
