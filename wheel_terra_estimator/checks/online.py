# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The checks of a recording while driving, on means over 0.1 s of the last half minute.

Every two seconds at first, every six later, the window is judged as a recording is. A tally per
fault decides: one that was not seen before takes as long to be believed as the inputs were right.
"""

from __future__ import annotations

import logging
import math
import warnings
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray, Floats
from wheel_terra_estimator.checks import rover_facts
from wheel_terra_estimator.checks.finding import FAULTS, RANK, CheckReport, Finding, NotChecked
from wheel_terra_estimator.checks.run import (
    LEAST_RIM_SPEED,
    WHILE_DRIVING,
    Mended,
    against_each_other,
)
from wheel_terra_estimator.checks.series import (
    ImuSeries,
    JointSeries,
    Recording,
    SinkageSeries,
    VelocitySeries,
)
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import StepInputs

_LOGGER = logging.getLogger(__name__)
BIN = 100_000_000  # means are over this [ns of stamps]
KEPT = 300  # bins that are kept: 30 s
OFTEN, SELDOM = 20, 60  # bins between judgements: 2 s in the first half minute of motion, 6 s later
TRIAL = 80  # bins of motion in which wrong signs and units would show on a straight
NEEDED = 2  # judgements that agree before a fault is told
MEMORY = 6  # judgements without a fault that are remembered when one is seen
CAP = 4  # agreeing judgements beyond this many count no more
LEAST_SURE = 0.5  # confidence from which a finding counts
DIGITS = 12  # decimals of means: those of one number, summed up elsewhere, differ behind them


_OTHERS = 8
"""Numbers of a step beside rate [rad/s], torque [N m] and sinkage [m] of each wheel: specific force
[m/s^2], angular rate [rad/s], reference velocity [m/s], its variance; nan where nothing came."""


class Tally(NamedTuple):
    """Judgements that spoke for a fault less those against it; what the first one said."""

    score: int
    check: str
    finding: Finding
    stands: bool = False

    @property
    def open(self) -> bool:
        """Whether it is suspected and not told."""
        return self.score > 0 and not self.stands

    def after(self, found: Finding | None) -> Tally:
        """Return the tally with one more judgement; a finding goes when it is back at 0."""
        if found is None:
            score = self.score - 1
            return self._replace(score=score, stands=self.stands and score > 0)
        score = min(self.score + 1, CAP)
        finding = self.finding if self.stands else found
        return self._replace(score=score, stands=score >= NEEDED, finding=finding)


@dataclass(frozen=True)
class _Verdicts:
    """What the judgements so far said; replaced, never changed."""

    tallies: dict[str, Tally] = field(default_factory=dict)
    clean: dict[tuple[str, str], int] = field(default_factory=dict)  # by check and kind
    moved: int = 0  # bins of motion
    waited: int = 0  # bins since the last judgement
    moved_since: bool = False


class OnlineChecks:
    """Judge of a stream of steps; deterministic, driven by stamps alone."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._facts = rover_facts.from_configuration(configuration)
        self._radius: list[float] = self._facts.radius.tolist()
        self.reset()

    def standing(self, driving: str) -> tuple[Finding, ...]:
        """Return the findings that stand now.

        ``driving``: as in `faults.yaml`, 'slip': those that make slip meaningless; 'beside': those
        beside which slip is judged all the same.
        """
        tallies = self._verdicts.tallies
        standing = [n for n, t in tallies.items() if t.stands and FAULTS[n].driving == driving]
        return tuple(tallies[name].finding for name in sorted(standing, key=RANK.__getitem__))

    @property
    def undecided(self) -> str:
        """What may yet turn out to be wrong, in words; empty: nothing that can be told soon."""
        if self._verdicts.moved < TRIAL:
            return 'the first seconds of motion show whether signs and units are right'
        for name, tally in self._verdicts.tallies.items():
            if tally.open and FAULTS[name].driving == 'slip':
                return f'a fault of the inputs is not excluded yet ({name.replace("_", " ")})'
        return ''

    def reset(self) -> None:
        """Forget everything."""
        self._begin: int | None = None  # of the bin [ns]
        # End of each bin [ns], and the means over it of the numbers of a step
        self._rows: tuple[tuple[int, Floats], ...] = ()
        self._verdicts = _Verdicts()
        self._samples: tuple[list[float], ...] = ()  # of the bin, by step
        self._failed = False  # by an error of the program, until the next run

    def snapshot(self) -> tuple[Any, ...]:
        """Return the state in a form that later steps leave alone."""
        return self._begin, self._rows, self._verdicts, self._samples, self._failed

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Return to a kept state."""
        self._begin, self._rows, self._verdicts, self._samples, self._failed = snapshot

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start again."""
        self.reset()

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Take all inputs of a stamp [ns], later than the one before."""
        if self._failed:
            return
        try:
            if self._begin is None or stamp - self._begin > KEPT * BIN:  # the first one, or a pause
                self._begin, self._rows, self._samples = stamp, (), ()
            if stamp - self._begin >= BIN:
                self._close(stamp)
            n = len(self._radius)
            sample = [math.nan] * (3 * n + _OTHERS)
            if (rolled := inputs.wheel_odometry) is not None:
                sample[: 2 * n] = rolled.rate.tolist() + rolled.torque.tolist()
            if inputs.sinkage is not None:
                sample[2 * n : 3 * n] = inputs.sinkage.sinkage.tolist()
            if (imu := inputs.inertial) is not None:
                sample[3 * n : -2] = imu.specific_force.tolist() + imu.angular_rate.tolist()
            if inputs.reference is not None:
                sample[-2:] = inputs.reference.forward, inputs.reference.variance
            self._samples += (sample,)
        except Exception:  # an observer: the estimator works without it
            _LOGGER.debug('checks while driving', exc_info=True)
            self.reset()
            self._failed = True

    def _close(self, stamp: int) -> None:
        """Close the bin before a stamp, and judge if it is time to."""
        assert self._begin is not None
        bins = (stamp - self._begin) // BIN
        self._begin += bins * BIN
        table = np.array(self._samples)
        known = np.isfinite(table)
        number = np.where(known.any(axis=0), known.sum(axis=0), math.nan)
        means = (np.where(known, table, 0.0).sum(axis=0) / number).round(DIGITS).tolist()
        end, self._samples = self._begin - (bins - 1) * BIN, ()
        old = next((i for i, (at, _) in enumerate(self._rows) if end - at < KEPT * BIN), 0)
        self._rows = (*self._rows[old:], (end, tuple(means)))
        rims = [abs(w * r) for w, r in zip(means, self._radius, strict=False)]
        moves = max((rim for rim in rims if rim == rim), default=0.0) > LEAST_RIM_SPEED
        verdicts = self._verdicts = replace(
            self._verdicts,
            moved=self._verdicts.moved + bins * moves,
            waited=self._verdicts.waited + bins,
            moved_since=self._verdicts.moved_since or moves,
        )
        often = verdicts.moved < KEPT or any(t.open for t in verdicts.tallies.values())
        if verdicts.waited >= (OFTEN if often else SELDOM):
            self._judge()

    # -- Judgement ------------------------------------------------------------------------------

    def _judge(self) -> None:
        """Judge the window, and bring the tallies up to date."""
        moved, mended = self._verdicts.moved_since, Mended(CheckReport())
        with np.errstate(all='ignore'), warnings.catch_warnings():
            warnings.simplefilter('ignore', RuntimeWarning)
            checks = WHILE_DRIVING if moved else WHILE_DRIVING[:1]
            against_each_other(self.window(), self._facts, checks, mended)
        tallies, clean = dict(self._verdicts.tallies), dict(self._verdicts.clean)
        for check, outcomes in mended.by_check.items():
            found = {f.fault: f for f in outcomes if isinstance(f, Finding)}
            silent = {entry.kind for entry in outcomes if isinstance(entry, NotChecked)}
            for name, finding in found.items():
                if not FAULTS[name].driving or finding.confidence < LEAST_SURE:
                    continue
                right = 0 if FAULTS[name].begins else clean.get((check, finding.kind), 0)
                tally = tallies.get(name) or Tally(-min(right, MEMORY), check, finding)
                tallies[name] = tally.after(finding)
            for name, tally in list(tallies.items()):
                if tally.check == check and name not in found and FAULTS[name].kind not in silent:
                    tallies[name] = tally.after(None)
                    if tallies[name].score <= 0:
                        del tallies[name]
            for kind in {fault.kind for fault in FAULTS.values()} - silent:
                seen = any(f.kind == kind for f in found.values())
                clean[check, kind] = 0 if seen else clean.get((check, kind), 0) + 1
        self._verdicts = replace(
            self._verdicts, tallies=tallies, clean=clean, waited=0, moved_since=False
        )

    def window(self) -> Recording:
        """Return what is kept as a recording: as the sensors read, on the right stamps."""
        facts, errors = self._facts, self._facts.errors
        stamp = np.array([end for end, _ in self._rows], dtype=np.int64)
        n, means = len(self._radius), np.array([means for _, means in self._rows])
        rate, torques, depth, inertial, velocity = np.split(means, [n, 2 * n, 3 * n, -2], axis=1)

        def series(kind: Any, topic: str, rows: BoolArray, *values: Any, least: int = 1) -> Any:
            at = stamp[rows]
            return kind(topic, at, at, *values) if at.size >= least else None

        def there(values: FloatArray) -> Any:
            return np.isfinite(values).any(axis=1)

        names, k = facts.names, there(rate)
        read = facts.direction * rate[k], facts.direction * errors.torque.reading(torques[k])
        joints = series(JointSeries, self._configuration.wheel_odometry, k, names, *read)
        # A reading with a part that is no number says nothing of the sensor.
        k = np.isfinite(inertial).all(axis=1)
        biases = errors.specific_force_bias, errors.angular_rate_bias
        halves = zip(np.hsplit(inertial[k], 2), biases, strict=True)
        felt = [(half + bias) @ facts.mounting for half, bias in halves]
        imu = series(ImuSeries, 'imu/data', k, *felt, np.full((k.sum(), 4), np.nan))
        k = there(depth)
        sinkage = series(SinkageSeries, 'sinkage', k, names, errors.sinkage.reading(depth[k]))
        k = np.isfinite(velocity[:, 0])
        ahead = np.column_stack([velocity[k, 0], np.zeros((k.sum(), 2))])
        seen = ahead, ahead[:, 1], velocity[k, 1]
        reference = series(VelocitySeries, 'reference_odom', k, *seen, least=2)
        return Recording('', (), joints, imu, sinkage, reference, None)
