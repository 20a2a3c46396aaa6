# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults of set-up that make slip meaningless, found while driving.

The steps of the estimator are gathered into windows of one second. A window speaks for a fault,
against it, or not at all; a tally per fault decides. Wrong signs and units are there from the
start, so windows that speak against one count for long. Thresholds come from simulated drives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import isnan
from statistics import median
from typing import Any, NamedTuple

from wheel_terra_estimator.checks.faults import (
    LEAST_TURN_RATE,
    RATE_UNITS,
    STANDARD_GRAVITY,
    found,
    of_offset,
)
from wheel_terra_estimator.checks.felt_motion import LEAST_YAW, YAW_SIGMAS
from wheel_terra_estimator.checks.finding import Finding
from wheel_terra_estimator.checks.online_motion import MotionHistory
from wheel_terra_estimator.checks.turning import ordinary_track
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)

Floats = tuple[float, ...]

WINDOW = 1_000_000_000
"""Length of a window [ns of stamps]."""
GREATEST_SURE = 0.99
CAP = 12
"""Agreeing windows beyond this many count no more."""

LEAST_RIM_SPEED = 0.005
"""Rim speed [m/s] below which a window says nothing of the wheels."""
MEAN_SHARE = 0.5
"""Mean over greatest rim speed of a window, above which it is no noise."""
UNSTEADY = 0.4
"""Change of the rim speed within a window, as a share of it, that is a start or a stop."""
STRAIGHT = 0.15
"""Rim speed from yawing over rim speed below which a window is straight."""
GRAVITY_SHARE = 0.2
"""Share by which the mean specific force may differ from gravity."""
GRAVITY_OFF = 0.3
"""Specific force over gravity below which gravity was taken off."""
UNIT_BAND = (0.85, 1.5)
"""Rim speed over reference speed of a rolling wheel, slip included."""
UPSIDE_DOWN = 150.0
"""Angle [deg] between gravity and straight down above which an IMU lies on its back."""
LEAST_READINGS = 5
"""Readings of an IMU in a window that must not all be the same."""
HELD_TORQUE = 1.5
"""Torque of a standing wheel over that of the others from which it is held, not dead [-]."""
UPRIGHT = math.cos(math.radians(50.0))
"""Upward share of the specific force that no rover drives below."""
GREATEST_RIM_SPEED = 15.0
"""Rim speed [m/s] that no rover of this kind drives."""
ORDINARY_RATIO = (0.3, 5.0)
"""Rim speed over reference speed of wheels in the right unit that still make way."""
CLEAR_TURN = 0.1
"""Rim speed from yawing over rim speed above which sides are compared."""
ORDINARY_TRACKS = (0.3, 6.0)
"""Effective over geometric track of wheels and gyro in the right units."""
TOO_FAST_TRACK = 8.0
"""The same, above which wheel rates are in another unit."""
IMPOSSIBLE_YAW = 3.0
"""Rim speed from yawing over the fastest rim speed that no wheel gives."""
UNLIKE_SIDES = 0.6
"""Slower over faster side for sides that seem to turn against each other on the spot."""
LEVEL = -0.01
"""Specific force along the drive over gravity above which wheels must drive."""
LEAST_TRACTION = 0.02
"""Sum of T/r over the weight that tells its sign."""
AS_MUCH = 3.0
"""Torque of a wheel over that of the others, and the reverse, that is alike [-]."""
ORDINARY_TRACTION = 1.5
"""The same, that wheels may give on any ground."""
ABSURD_TRACTION = 3.0
"""The same, that no ground carries: another unit, or a current."""
ABOVE_GROUND = 0.003
"""Mean sinkage [m] by which the readings of all wheels may lie above the surface."""
BUSY = 5
"""Changes of the other wheels' rates in a window beside which an unchanged one is frozen."""
SAME = 1e-9
"""Relative difference of two rates that are one reading, averaged differently."""
TRIAL = 5
"""Windows of motion in which wrong signs and units would show on a straight."""


class Tally(NamedTuple):
    """How often windows spoke for a fault."""

    score: int = 0  # agreeing less contrary windows
    stands: bool = False


class Rule(NamedTuple):
    """When a tally becomes a finding."""

    needed: int  # agreeing windows
    memory: int  # contrary windows that are remembered

    def after(self, tally: Tally, agrees: bool) -> Tally:
        """Return the tally with one more window; a finding goes when the tally is back at 0."""
        score = min(tally.score + 1, CAP) if agrees else max(tally.score - 1, -self.memory)
        return Tally(score, score >= self.needed or (tally.stands and score > 0))


RULES = {
    'gravity': Rule(3, 3),
    'mounting': Rule(3, 3),
    'gyro_unit': Rule(3, 6),
    'sides': Rule(3, 20),
    'backwards': Rule(3, 20),
    'one_side_backwards': Rule(4, 20),
    'reference_sign': Rule(4, 30),
    'rate_unit': Rule(4, 60),
    'rate_unit_in_turns': Rule(4, 30),
    'absurd_rate': Rule(2, 2),
    'torque': Rule(5, 20),
    'torque_of_wheel': Rule(8, 20),
    'torque_unit': Rule(4, 20),
    'sinkage': Rule(5, 20),
    'frozen': Rule(10, 2),  # a coarse encoder repeats itself at a steady speed
    'imu_frozen': Rule(3, 2),
    'imu_yaw': Rule(2, 3),
    'exchanged': Rule(2, 3),
    'reference_delay': Rule(2, 4),
}

REMARKS = frozenset({'reference_delay', 'imu_frozen', 'imu_yaw', 'exchanged'})
"""Faults that are told while slip is judged all the same."""

Suspicion = tuple[str, int]
"""A name of RULES, and the wheel (-1: all)."""


@dataclass
class _Sums:
    """What came since the window began; written into, so that a step costs little."""

    rims: list[float]  # [m/s]
    torques: list[float]  # [N m]
    changes: list[int]  # how often a wheel's rate was another than before
    last: Floats  # rim speeds of the last wheel odometry [m/s], in whichever window
    begin: int | None = None  # [ns]
    odometry: int = 0
    slowest: float = math.inf  # typical size of the rim speeds
    fastest: float = 0.0
    force_x: float = 0.0  # [m/s^2]
    force_y: float = 0.0
    force_z: float = 0.0
    yaw_rate: float = 0.0
    inertial: int = 0
    inertial_changes: int = 0
    reference: float = 0.0
    reference_variance: float = 0.0
    references: int = 0
    depth: float = 0.0  # mean sinkage of the wheels [m]
    depths: int = 0

    def copy(self) -> _Sums:
        """Return sums that later steps leave alone."""
        return replace(
            self, rims=list(self.rims), torques=list(self.torques), changes=list(self.changes)
        )


class _Verdicts(NamedTuple):
    """What the windows so far said; replaced, never changed."""

    tallies: dict[Suspicion, Tally]
    figures: dict[Suspicion, float]  # what the last agreeing window showed
    findings: tuple[Finding, ...]
    remarks: tuple[Finding, ...] = ()
    in_motion: int = 0  # windows in which wheels turned


@dataclass(frozen=True)
class _Window:
    """Means of one window."""

    rims: Floats  # [m/s], nan: unknown
    torques: Floats  # [N m]
    steady: bool
    force: tuple[float, float, float] | None
    yaw_rate: float  # [rad/s], nan: unknown
    reference: float  # [m/s], nan: none or lost in its noise
    fastest: float  # greatest typical rim speed of one message [m/s]
    changes: tuple[int, ...]
    depth: float  # [m], nan: none
    imu_dead: bool  # all its readings are the same

    @property
    def typical(self) -> float:
        """Median rim speed, signed; nan where no wheel is known."""
        known = [rim for rim in self.rims if not isnan(rim)]
        return median(known) if known else math.nan

    @property
    def moving(self) -> bool:
        """Whether the wheels turn; noise about a standstill has no mean."""
        return self.size > max(LEAST_RIM_SPEED, MEAN_SHARE * self.fastest)

    @property
    def size(self) -> float:
        """Median size of the rim speeds; 0 where no wheel is known."""
        known = [abs(rim) for rim in self.rims if not isnan(rim)]
        return median(known) if known else 0.0


Evidence = tuple[str, int, bool, float]
"""Name of the rule, wheel, whether the window agrees, figure."""


class OnlineChecks:
    """Judge of a stream of steps; deterministic, driven by stamps alone.

    Parameters
    ----------
    configuration : Configuration
        What the measurements are judged against.
    """

    def __init__(self, configuration: Configuration) -> None:
        wheels, rover = configuration.wheels, configuration.rover
        self._names = wheels.names
        self._odometry = configuration.wheel_odometry
        self._direction: list[float] = wheels.direction.tolist()
        self._radius: list[float] = wheels.slip_radius.tolist()
        self._lateral = tuple(wheels.y.tolist())
        lateral = self._lateral
        self._left = [i for i, y in enumerate(lateral) if y > 0.0]
        self._right = [i for i, y in enumerate(lateral) if y < 0.0]
        self._track = 0.0
        if self._left and self._right:
            self._track = sum(lateral[i] for i in self._left) / len(self._left) - sum(
                lateral[i] for i in self._right
            ) / len(self._right)
        self._gravity = float(rover.gravity)
        self._weight = float(rover.mass) * self._gravity
        self._reference_std = float(configuration.sensors.reference_std)
        self._configuration = configuration
        sensors = configuration.sensors
        self._above_ground = max(
            ABOVE_GROUND, 2.0 * float(sensors.sinkage_zero_std), float(sensors.sinkage_std)
        )
        self._sums = self._empty()
        self._motion = MotionHistory()
        self._force = (math.nan,) * 3
        self._verdicts = _Verdicts({}, {}, ())

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What stands now and makes slip meaningless; empty: nothing."""
        return self._verdicts.findings

    @property
    def remarks(self) -> tuple[Finding, ...]:
        """What stands now beside which slip is judged all the same."""
        return self._verdicts.remarks

    @property
    def undecided(self) -> str:
        """What may yet turn out to be wrong, in words; empty: nothing that can be told soon."""
        if self._verdicts.in_motion < TRIAL:
            return 'the first seconds of motion show whether signs and units are right'
        for (name, _), tally in self._verdicts.tallies.items():
            if tally.score > 0 and not tally.stands and name not in REMARKS:
                return f'a fault of the inputs is not excluded yet ({name.replace("_", " ")})'
        return ''

    def reset(self) -> None:
        """Forget everything."""
        self._sums = self._empty()
        self._motion = MotionHistory()
        self._force = (math.nan,) * 3
        self._verdicts = _Verdicts({}, {}, ())

    def snapshot(self) -> tuple[Any, ...]:
        """Return the state in a form that later steps leave alone."""
        return self._sums.copy(), self._motion.copy(), self._force, self._verdicts

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Return to a kept state."""
        sums, motion, self._force, self._verdicts = snapshot
        self._sums, self._motion = sums.copy(), motion.copy()

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Take all inputs of a stamp [ns], later than the one before."""
        sums = self._sums
        if sums.begin is None:
            sums.begin = stamp
        if self._motion.advance(stamp):
            self._weigh(self._of_motion())
        if inputs.wheel_odometry is not None:
            self._add_odometry(inputs.wheel_odometry)
        if inputs.inertial is not None:
            self._add_inertial(inputs.inertial)
        if inputs.reference is not None:
            self._add_reference(inputs.reference)
            self._motion.reference = inputs.reference.forward
        if inputs.sinkage is not None:
            self._add_sinkage(inputs.sinkage)
        if stamp - sums.begin >= WINDOW:
            self._judge(self._window(sums))
            self._sums = self._empty(sums.last)
            self._sums.begin = stamp

    # -- Windows --------------------------------------------------------------------------------

    def _empty(self, last: Floats = ()) -> _Sums:
        count = len(self._radius)
        return _Sums([0.0] * count, [0.0] * count, [0] * count, last or (math.nan,) * count)

    def _add_odometry(self, odometry: WheelOdometry) -> None:
        sums, rims, torques = self._sums, self._sums.rims, self._sums.torques
        changes, last = sums.changes, sums.last
        sizes, heard = [], []
        for i, (rate, torque) in enumerate(
            zip(odometry.rate.tolist(), odometry.torque.tolist(), strict=True)
        ):
            rim = rate * self._radius[i]
            heard.append(rim)
            changes[i] += not abs(rim - last[i]) <= SAME * abs(rim)
            if not isnan(rim):
                sizes.append(abs(rim))
            rims[i] += rim  # nan stays: the wheel is not known in this window
            torques[i] += torque
        sums.odometry += 1
        sums.last = tuple(heard)
        self._motion.rims = sums.last
        if not sizes:
            return
        sizes.sort()
        size = sizes[len(sizes) // 2]
        sums.slowest = min(sums.slowest, size)
        sums.fastest = max(sums.fastest, size)

    def _add_inertial(self, reading: InertialReading) -> None:
        sums = self._sums
        x, y, z = reading.specific_force.tolist()
        if isnan(x) or isnan(float(reading.angular_rate[2])):
            return
        sums.force_x += x
        sums.force_y += y
        sums.force_z += z
        sums.yaw_rate += float(reading.angular_rate[2])
        sums.inertial += 1
        sums.inertial_changes += (x, y, z) != self._force
        self._force = (x, y, z)
        self._motion.add_inertial(x, y, float(reading.angular_rate[2]))

    def _add_reference(self, reference: ReferenceVelocity) -> None:
        sums = self._sums
        variance = reference.variance if reference.variance > 0.0 else self._reference_std**2
        sums.reference += reference.forward
        sums.reference_variance += variance
        sums.references += 1

    def _add_sinkage(self, reading: SinkageReading) -> None:
        known = [z for z in reading.sinkage.tolist() if not isnan(z)]
        if known:
            self._sums.depth += sum(known) / len(known)
            self._sums.depths += 1

    def _window(self, sums: _Sums) -> _Window:
        count = max(sums.odometry, 1)
        reference = math.nan
        if sums.references:
            reference = sums.reference / sums.references
            std = math.sqrt(sums.reference_variance) / sums.references
            if abs(reference) < max(3.0 * std, LEAST_RIM_SPEED):
                reference = math.nan
        dead = sums.inertial >= LEAST_READINGS and not sums.inertial_changes
        inertial = 0 if dead else sums.inertial  # what does not change says nothing
        force = (sums.force_x, sums.force_y, sums.force_z)
        return _Window(
            rims=tuple(rim / count if sums.odometry else math.nan for rim in sums.rims),
            torques=tuple(t / count if sums.odometry else math.nan for t in sums.torques),
            steady=sums.odometry > 0
            and sums.slowest > LEAST_RIM_SPEED
            and sums.fastest - sums.slowest < UNSTEADY * sums.fastest,
            force=(force[0] / inertial, force[1] / inertial, force[2] / inertial)
            if inertial
            else None,
            yaw_rate=sums.yaw_rate / inertial if inertial else math.nan,
            reference=reference,
            fastest=sums.fastest,
            changes=tuple(sums.changes),
            depth=sums.depth / sums.depths if sums.depths else math.nan,
            imu_dead=dead,
        )

    # -- Judgement ------------------------------------------------------------------------------

    def _judge(self, window: _Window) -> None:
        self._verdicts = self._verdicts._replace(in_motion=self._verdicts.in_motion + window.moving)
        self._weigh(self._evidence(window))

    def _weigh(self, evidence: Iterable[Evidence]) -> None:
        """Bring the tallies up to date, and what stands."""
        tallies, figures = dict(self._verdicts.tallies), dict(self._verdicts.figures)
        for name, wheel, agrees, figure in evidence:
            key = name, wheel
            tallies[key] = RULES[name].after(tallies.get(key, Tally()), agrees)
            if agrees:
                figures[key] = figure
        changed = tallies != self._verdicts.tallies
        self._verdicts = self._verdicts._replace(tallies=tallies, figures=figures)
        if changed:
            told = list(self._findings())
            self._verdicts = self._verdicts._replace(
                findings=tuple(finding for name, finding in told if name not in REMARKS),
                remarks=tuple(finding for name, finding in told if name in REMARKS),
            )

    def _of_motion(self) -> Iterator[Evidence]:
        """What the last half minute says, by the comparisons of a recording."""
        yaw = self._motion.yaw_of_imu()
        if yaw is not None:
            yield 'imu_yaw', -1, yaw != 0.0, yaw
        pair = self._motion.exchanged(self._lateral)
        if pair is not None:
            yield 'exchanged', -1, pair[0] >= 0, float(pair[0] * len(self._names) + pair[1])
        late = self._motion.late_reference()
        if late is not None:
            yield 'reference_delay', -1, late > 0.0, late

    def _evidence(self, window: _Window) -> Iterator[Evidence]:
        if window.force is not None:
            yield from self._of_gravity(window.force)
        if window.moving:
            yield from self._of_frozen_rates(window)
            if window.imu_dead or window.force is not None:
                yield 'imu_frozen', -1, window.imu_dead, 0.0
            if abs(window.depth) > self._above_ground:
                yield 'sinkage', -1, window.depth < 0.0, window.depth
        yield from self._of_torque_unit(window)
        if not window.steady:
            return
        yield 'absurd_rate', -1, window.size > GREATEST_RIM_SPEED, window.size
        yield from self._of_turning(window)
        yield from self._of_single_wheels(window)
        yield from self._of_the_reference(window)
        yield from self._of_torque(window)

    def _of_gravity(self, force: tuple[float, float, float]) -> Iterator[Evidence]:
        size = math.sqrt(sum(f * f for f in force))
        share = size / self._gravity
        yield 'gravity', -1, abs(share - 1.0) > GRAVITY_SHARE, abs(force[2])
        if share > GRAVITY_OFF:
            yield 'mounting', -1, force[2] < UPRIGHT * size, force[2] / size

    def _of_turning(self, window: _Window) -> Iterator[Evidence]:
        """Rolling without slip, right less left rim speed is yaw rate times track."""
        yaw_rate = window.yaw_rate
        if not self._track or isnan(yaw_rate):
            return
        left = _mean(window.rims, self._left)
        right = _mean(window.rims, self._right)
        difference, turn = right - left, yaw_rate * self._track
        if isnan(difference):
            return
        fastest = max(abs(rim) for rim in window.rims if not isnan(rim))
        slower, faster = sorted((abs(left), abs(right)))
        if left * right < 0.0 and slower > UNLIKE_SIDES * faster:
            if abs(turn) < 0.1 * abs(difference):
                yield 'one_side_backwards', -1, True, window.reference
            elif turn * difference > 0.0:
                yield 'one_side_backwards', -1, False, 0.0
        elif left * right > 0.0 and self._straight(window):
            yield 'one_side_backwards', -1, False, 0.0
        if abs(yaw_rate) < LEAST_TURN_RATE or 0.5 * abs(turn) < CLEAR_TURN * window.size:
            return
        ratio = difference / turn
        if 0.5 * abs(turn) > IMPOSSIBLE_YAW * fastest:
            yield 'gyro_unit', -1, True, yaw_rate
        elif ORDINARY_TRACKS[0] < ratio < ORDINARY_TRACKS[1]:
            yield 'gyro_unit', -1, False, yaw_rate
        if ratio > ORDINARY_TRACKS[0] or ordinary_track(ratio):
            yield 'sides', -1, ratio < 0.0, ratio
        if ORDINARY_TRACKS[0] < ratio < ORDINARY_TRACKS[1]:
            yield 'rate_unit_in_turns', -1, False, ratio
        elif ratio > TOO_FAST_TRACK:
            yield 'rate_unit_in_turns', -1, True, ratio

    def _straight(self, window: _Window) -> bool:
        turn = window.yaw_rate * 0.5 * self._track
        return not abs(turn) > STRAIGHT * window.size  # a rover without gyro counts as straight

    def _of_single_wheels(self, window: _Window) -> Iterator[Evidence]:
        if len(window.rims) < 3 or not self._straight(window):
            return
        found = []
        for i, rim in enumerate(window.rims):
            others = [r for j, r in enumerate(window.rims) if j != i and not isnan(r)]
            if isnan(rim) or len(others) < 2:
                continue
            beside = median(others)
            if abs(beside) > LEAST_RIM_SPEED:
                found.append((i, rim / beside))
        backwards = [i for i, ratio in found if ratio < -0.5]
        if 2 * len(backwards) >= len(window.rims):
            return
        for i, ratio in found:
            if abs(ratio) > 0.3:
                yield 'backwards', i, i in backwards, ratio

    def _of_frozen_rates(self, window: _Window) -> Iterator[Evidence]:
        """A rate that stays the very same number while the others change; no wheel that is held."""
        for i, (rim, changes) in enumerate(zip(window.rims, window.changes, strict=True)):
            others = [n for j, n in enumerate(window.changes) if j != i]
            if isnan(rim) or len(others) < 2 or median(others) < BUSY:
                continue
            if rim == 0.0:
                beside = [abs(t) for j, t in enumerate(window.torques) if j != i and not isnan(t)]
                if not beside or not abs(window.torques[i]) < HELD_TORQUE * median(beside):
                    continue
            yield 'frozen', i, changes == 0, rim

    def _of_the_reference(self, window: _Window) -> Iterator[Evidence]:
        typical, reference = window.typical, window.reference
        if isnan(reference) or abs(typical) < LEAST_RIM_SPEED:
            return
        if not self._straight(window):
            return
        ratio = typical / reference
        yield 'reference_sign', -1, -2.0 < ratio < 0.0, reference
        if ORDINARY_RATIO[0] < abs(ratio) < ORDINARY_RATIO[1]:
            yield 'rate_unit', -1, False, abs(ratio)
        elif rate_unit(abs(ratio)) is not None:
            yield 'rate_unit', -1, True, abs(ratio)

    def _of_torque_unit(self, window: _Window) -> Iterator[Evidence]:
        """No ground carries several times the weight; at rest a small torque says nothing."""
        pairs = zip(window.torques, self._radius, strict=True)
        size = sum(abs(torque) / radius for torque, radius in pairs) / self._weight
        if size > ABSURD_TRACTION:
            yield 'torque_unit', -1, True, size
        elif size < ORDINARY_TRACTION and window.moving:
            yield 'torque_unit', -1, False, size

    def _of_torque(self, window: _Window) -> Iterator[Evidence]:
        """On the level or uphill driven wheels take torque; a flipped one mirrors the others."""
        force, torques, typical = window.force, window.torques, window.typical
        if force is None or any(isnan(t) for t in torques) or abs(typical) < LEAST_RIM_SPEED:
            return
        sense = math.copysign(1.0, typical)
        if force[0] * sense < LEVEL * self._gravity or not self._straight(window):
            return
        thrusts = [sense * t / r for t, r in zip(torques, self._radius, strict=True)]
        total = sum(thrusts) / self._weight
        if abs(total) > LEAST_TRACTION:
            yield 'torque', -1, total < 0.0, total
        if len(thrusts) < 3:
            return
        least = LEAST_TRACTION * self._weight / len(thrusts)
        for i, thrust in enumerate(thrusts):
            beside = median(t for j, t in enumerate(thrusts) if j != i)
            # On firm ground wheels push against each other; what is flipped takes as much.
            if beside > least and 1.0 < AS_MUCH * abs(thrust) / beside < AS_MUCH**2:
                yield 'torque_of_wheel', i, thrust < 0.0, thrust / beside

    # -- Findings -------------------------------------------------------------------------------

    def _findings(self) -> Iterator[tuple[str, Finding]]:
        """Word what stands, by rule; what follows from another finding is left out."""
        tallies = self._verdicts.tallies
        standing = {key: tally.score for key, tally in tallies.items() if tally.stands}
        left_out: set[str] = set()
        for name, _ in standing:
            left_out |= _CONSEQUENCES.get(name, set())
        for name in dict.fromkeys(name for name, _ in standing):
            if name in left_out:
                continue
            wheels = [wheel for other, wheel in standing if other == name]
            score = min(standing[name, wheel] for wheel in wheels)
            figure = self._verdicts.figures[name, wheels[0]]
            sure = min(1.0 - 0.5 ** (score + 1), GREATEST_SURE)
            yield name, self._worded(name, [w for w in wheels if w >= 0], figure, sure)

    def _worded(self, name: str, wheels: list[int], figure: float, sure: float) -> Finding:
        """Return the finding of a rule in the words of its fault."""
        if name in IMU_RULES:
            return self._of_imu(name, figure, sure)
        if name in ('reference_sign', 'reference_delay'):
            return self._of_reference(name, figure, sure)
        if name in ('sides', 'exchanged', 'backwards', 'one_side_backwards'):
            return self._of_places(name, wheels, figure, sure)
        who = ', '.join(self._names[i] for i in wheels) or None
        odometry = self._odometry
        if name in ('rate_unit', 'rate_unit_in_turns'):
            unit = rate_unit(figure) if name == 'rate_unit' else _unit_of_turns(figure)
            how = f'rim speed {figure:.3g} times the reference'
            if name != 'rate_unit':
                how = f'turns {figure:.3g} times those of the gyro'
            value = RATE_UNITS[unit or RPM]
            return found('rate_unit', odometry, sure, value=value, unit=unit, how=how)
        if name == 'frozen':
            how = f'rim speed stays at exactly {figure:.4g} m/s'
            return found('rate_frozen', odometry, sure, wheel=who, how=how)
        if name in ('torque', 'torque_of_wheel'):
            all_of_them = who or 'all wheels'
            return found('torque_sign', odometry, sure, wheel=who, wheels=all_of_them, value=-1.0)
        if name == 'sinkage':
            return found('sinkage_above', 'sinkage', sure, value=-1.0, height=-1000.0 * figure)
        key = {'absurd_rate': 'absurd_rate', 'torque_unit': 'torque_absurd'}[name]
        return found(key, odometry, sure, figure=figure)

    def _of_imu(self, name: str, figure: float, sure: float) -> Finding:
        imu = 'imu/data'
        if name == 'gravity':
            return self._of_size(figure, sure)
        if name == 'imu_frozen':
            how = 'its numbers stay the same while the rover moves'
            return found('sensor_frozen', imu, sure, how=how)
        if name == 'gyro_unit':
            value = math.pi / 180.0
            return found('gyro_degrees', imu, sure, value=value, times=1.0 / value, how='rims')
        if name == 'imu_yaw':
            key, angle = 'sensors.imu_mounting_yaw_deg', math.degrees(figure)
            off = math.degrees(LEAST_YAW) / YAW_SIGMAS
            return found(
                'imu_yaw', imu, sure, angle=angle, off=off, angles=_SEE_CHECK, parameter=key
            )
        tilt = math.degrees(math.acos(max(-1.0, min(1.0, figure))))
        key = 'sensors.imu_mounting_roll_deg'
        return found(
            'imu_upside',
            imu,
            sure,
            force=f'gravity points {tilt:.0f} degrees off straight down',
            angles=f'{key}: 180.0' if tilt > UPSIDE_DOWN else _SEE_CHECK,
            parameter=key,
        )

    def _of_places(self, name: str, wheels: list[int], figure: float, sure: float) -> Finding:
        odometry = self._odometry
        if name == 'sides':
            mirrored = ', '.join(f'{-y:g}' for y in self._lateral)
            return found(
                'swapped_sides',
                odometry,
                sure,
                rival=', all wheels count backwards, or the gyro counts yaw to the right',
                names=', '.join(self._names),
                mirrored=f', or wheels.y: [{mirrored}]; or negate angular_velocity.z in the driver',
            )
        if name == 'exchanged':
            a, b = divmod(int(figure), len(self._names))
            names = list(self._names)
            names[a], names[b] = names[b], names[a]
            pair = f'{self._names[a]}, {self._names[b]}'
            return found('exchanged', odometry, sure, wheel=pair, names=', '.join(names))
        if name == 'backwards':
            return found(
                'backwards',
                odometry,
                sure,
                wheel=', '.join(self._names[i] for i in wheels),
                value=-self._direction[wheels[0]],
                directions=self._directions(wheels),
                torque='',
            )
        left, right = self._directions(self._left), self._directions(self._right)
        return found('one_side_backwards', odometry, sure, value=-1.0, left=left, right=right)

    def _of_reference(self, name: str, figure: float, sure: float) -> Finding:
        reference = 'reference_odom'
        if name == 'reference_sign':
            every = self._directions(range(len(self._names)))
            wheels_too = f'; if all wheels count backwards, wheels.direction: [{every}]'
            return found('reference_reversed', reference, sure, value=-1.0, or_wheels=wheels_too)
        against = 'starts and stops of the wheels; wheel-terra check has the exact figure'
        told = of_offset('reference', figure, ONLINE_DELAY_STD, against, self._configuration)
        return found('reference_offset', reference, sure, **told)

    def _of_size(self, size: float, sure: float) -> Finding:
        """Return what a specific force of another size than gravity is."""
        share, imu = size / self._gravity, 'imu/data'
        told: dict[str, Any] = {'size': size, 'gravity': self._gravity}
        for unit, factor in (('g', STANDARD_GRAVITY), ('mg', STANDARD_GRAVITY / 1000.0)):
            if abs(share * factor - 1.0) < GRAVITY_SHARE:
                return found('force_unit', imu, sure, value=factor, unit=unit, **told)
        if share < GRAVITY_OFF:
            return found('gravity_off', imu, sure, **told)
        place = 'another planet, or another scale'
        return found('planet', imu, sure, value=size, place=place, **told)

    def _directions(self, flipped: Iterable[int]) -> str:
        turned = set(flipped)
        signs = (int(-d if i in turned else d) for i, d in enumerate(self._direction))
        return ', '.join(str(sign) for sign in signs)


def rate_unit(ratio: float) -> str | None:
    """Return the unit in which wheels read so many times too fast; None: none."""
    for unit, factor in RATE_UNITS.items():
        if factor < 1.0 and UNIT_BAND[0] < ratio * factor < UNIT_BAND[1]:
            return unit
    return None


def _unit_of_turns(ratio: float) -> str:
    """Return the unit in which turns read so many times too fast; skidding makes it more."""
    slower = sorted(RATE_UNITS, key=lambda unit: -RATE_UNITS[unit])[1:]
    return next((unit for unit in slower if ratio * RATE_UNITS[unit] < 3.0), slower[-1])


IMU_RULES = ('gravity', 'mounting', 'gyro_unit', 'imu_yaw', 'imu_frozen')
RPM = 'revolutions per minute'
ONLINE_DELAY_STD = 0.1
"""Deviation of a delay that is told while driving: a bin of its history [s]."""
_SEE_CHECK = 'state sensors.imu_mounting_*_deg (wheel-terra check has the angles)'

_CONSEQUENCES = {
    'reference_sign': {'reference_delay'},
    'mounting': {'gyro_unit', 'sides', 'one_side_backwards', 'torque', 'torque_of_wheel'},
    'gravity': {'torque', 'torque_of_wheel'},
    'rate_unit': {'absurd_rate', 'rate_unit_in_turns', 'one_side_backwards'},
    'rate_unit_in_turns': {'absurd_rate', 'one_side_backwards'},
    'backwards': {'torque', 'torque_of_wheel', 'sides', 'one_side_backwards'},
    'one_side_backwards': {'torque', 'torque_of_wheel', 'sides', 'reference_sign'},
    'torque': {'torque_of_wheel'},
    'torque_unit': {'torque', 'torque_of_wheel'},
}
"""Fault -> what it makes other windows say."""


def _mean(values: Floats, indices: list[int]) -> float:
    known = [values[i] for i in indices if not isnan(values[i])]
    return sum(known) / len(known) if known else math.nan
