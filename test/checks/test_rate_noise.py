# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steps of a coarse encoder: counted from angles, told with their size, apart from noise."""

import math
from dataclasses import replace

import numpy as np
import pytest
import rolling_rover as rolling

from wheel_terra_estimator.checks.wheel_rates import rate_step

WHOLE = rolling.recording()
COUNTS = 180  # per turn of the wheel


def counted(counts=COUNTS, jitter=0.0):
    """The drive as an encoder sees it: whole counts of the angle, over the time between stamps."""
    random = np.random.default_rng(4)
    joints = WHOLE.joints
    stamp = joints.stamp + np.round(jitter * random.uniform(size=joints.stamp.size) * 1e9)
    time = (stamp - stamp[0]) * 1e-9
    angle = np.vstack([np.zeros(4), np.cumsum(0.1 * joints.rate[1:], axis=0)])
    ticks = np.floor(angle * counts / (2.0 * math.pi))
    rate = np.diff(ticks, axis=0) * 2.0 * math.pi / counts / np.diff(time)[:, None]
    rate = np.vstack([np.zeros(4), rate])
    return replace(joints, stamp=stamp.astype(np.int64), rate=rate)


@pytest.mark.parametrize('jitter', [0.0, 0.02])
def test_steps_are_named_with_the_noise_that_they_make(jitter):
    report = rolling.checked(joints=counted(jitter=jitter))
    (finding,) = [f for f in report.findings if f.parameter == 'sensors.wheel_rate_std']
    step = 2.0 * math.pi / COUNTS / 0.1
    assert finding.kind == 'noise' and finding.wheel is None
    assert report.figures['wheels.rate_step_rad_s'] == pytest.approx(step, rel=0.02)
    assert finding.value == pytest.approx(step / math.sqrt(6.0), rel=0.05)
    assert f'{COUNTS} counts per turn' in finding.words


def test_counting_makes_that_noise():
    """A rate from two counts, each cut off at a whole one, against the rate itself."""
    turning = np.abs(WHOLE.joints.rate).mean(axis=1) > 1.0
    error = (counted().rate - WHOLE.joints.rate)[turning]
    step = 2.0 * math.pi / COUNTS / 0.1
    assert np.std(error) == pytest.approx(step / math.sqrt(6.0), rel=0.05)


def test_fine_steps_and_real_noise_are_no_steps():
    fine = rolling.checked(joints=counted(20_000))
    assert not fine.findings, [str(f) for f in fine.findings]
    assert 'wheels.rate_step_rad_s' not in rolling.checked().figures
    assert rate_step(np.full(100, 2.0), np.full(100, 0.1)) == 0.0, 'one value is no step'
    random = np.random.default_rng(1)
    assert rate_step(random.normal(size=500), np.full(500, 0.1)) == 0.0
