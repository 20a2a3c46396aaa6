# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Faults put into a simulated drive are told while driving, and nothing is judged meanwhile."""

import functools
from dataclasses import fields, replace

import numpy as np
import pytest
from estimate_sets import some_estimates

from wheel_terra_estimator.checks.finding import FAULTS as FAULT_TABLE
from wheel_terra_estimator.checks.finding import Finding, found
from wheel_terra_estimator.checks.input_judge import LONGEST_WAIT, InputJudge
from wheel_terra_estimator.checks.online import CAP, OnlineChecks, Tally
from wheel_terra_estimator.checks.series import Recording
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.parameters import DECLARED
from wheel_terra_estimator.estimation.core import EstimatorCore
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    ReferenceVelocity,
    SinkageReading,
    StepInputs,
    WheelOdometry,
)
from wheel_terra_estimator.messages.pipeline import Pipeline
from wheel_terra_estimator.simulation import scenario
from wheel_terra_estimator.simulation.drive import simulate

REST, STRAIGHT, END = 3.0, 17.0, 32.0  # [s]
PROFILE = {
    'drive.time': [0.0, REST, REST, STRAIGHT, STRAIGHT],
    'drive.forward': [0.0, 0.0, 0.08, 0.08, 0.06],
    'drive.turn_rate': [0.0, 0.0, 0.0, 0.0, 0.25],
}
SIX, FOUR = None, 'frostyboy'


@functools.cache
def drive_of(rover):
    changes = {key.replace('.', '__'): value for key, value in PROFILE.items()}
    source = scenario.load('calibration_drive', rover=rover, duration=END, **changes)
    return simulate(source, seed=7)


def on_wheels(rate=1.0, torque=1.0):
    """Return a fault that multiplies rates and torques, per wheel or all."""

    def fault(m):
        if not isinstance(m, WheelOdometry):
            return m
        return replace(m, rate=m.rate * rate, torque=m.torque * torque)

    return fault


def on_imu(force=1.0, rate=1.0):
    def fault(m):
        if not isinstance(m, InertialReading):
            return m
        return replace(
            m,
            specific_force=m.specific_force * force,
            angular_rate=m.angular_rate * rate,
            orientation=None,
        )

    return fault


def swap_sides(m):
    """Left and right wheels exchanged: in the files they come in pairs, left first."""
    if not isinstance(m, WheelOdometry):
        return m
    order = np.arange(len(m.rate)).reshape(-1, 2)[:, ::-1].ravel()
    return replace(m, rate=m.rate[order], torque=m.torque[order])


def reverse_reference(m):
    return replace(m, forward=-m.forward) if isinstance(m, ReferenceVelocity) else m


def first_backwards_in_two_messages(m):
    """Every other wheel in each, at 10 Hz together."""
    if not isinstance(m, WheelOdometry):
        return m
    there = np.arange(len(m.rate)) % 2 == m.stamp // 100_000_000 % 2
    told = np.where(there, 1.0, np.nan)
    return on_wheels(told * FIRST_BACKWARDS, told)(m)


FIRST_BACKWARDS = np.array([-1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
UPSIDE_DOWN = np.array([1.0, -1.0, -1.0])
FAULTS = {
    # name: (fault, kind, topic, in the cure, when its motion begins [s])
    'one_wheel': (on_wheels(FIRST_BACKWARDS), 'sign', 'joint_states', '[-1, 1, 1, 1, 1, 1]', REST),
    'in_two_messages': (
        first_backwards_in_two_messages,
        *('sign', 'joint_states', '[-1, 1, 1, 1, 1, 1]', REST),
    ),
    'sides': (swap_sides, 'swapped_sides', 'joint_states', 'wheels.names', STRAIGHT),
    'rpm': (on_wheels(30.0 / np.pi), 'unit', 'joint_states', '0.10472', REST),
    'thousand': (on_wheels(200.0 / 0.5), 'unit', 'joint_states', 'rad/s', REST),
    'upside_down': (on_imu(UPSIDE_DOWN, UPSIDE_DOWN), 'mounting', 'imu/data', '180', 0.0),
    'g': (on_imu(1.0 / 9.80665), 'unit', 'imu/data', '9.80', 0.0),
    'no_gravity': (on_imu(np.array([1.0, 1.0, 0.02])), 'gravity', 'imu/data', 'REP 145', 0.0),
    'gyro_degrees': (on_imu(1.0, 180.0 / np.pi), 'unit', 'imu/data', '0.0174533', STRAIGHT),
    'torques': (on_wheels(1.0, -1.0), 'sign', 'joint_states', 'negate effort', REST),
    'one_torque': (on_wheels(1.0, FIRST_BACKWARDS), 'sign', 'joint_states', 'negate effort', REST),
    'torque_in_n_mm': (on_wheels(1.0, 1000.0), 'unit', 'joint_states', 'effort by 0.001', REST),
    'reference': (reverse_reference, 'sign', 'reference_odom', 'negate twist.linear.x', REST),
}
LONGEST = 15.0
"""Seconds of the motion that shows a fault after which it is told."""


class AlwaysStuck:
    """An estimator that takes every wheel for stuck, as the real one does of a wrong rate."""

    def __init__(self, wheels, **more):
        self.wheels, self.stamp, self.more = wheels, 0, more

    def step(self, stamp, inputs):
        self.stamp = stamp

    def estimates(self):
        classes = np.full(self.wheels, SlipClass.STUCK, dtype=np.uint8)
        said = {'stamp': self.stamp, 'slip_class': classes, 'stuck': True, **self.more}
        return some_estimates(self.wheels, **said)

    def health(self):
        return {}

    def snapshot(self):
        return self.stamp

    def restore(self, snapshot):
        self.stamp = snapshot

    def begin_run(self, stamp, keep_soil):
        self.stamp = stamp


def sets_of(drive, fault, seconds=END, stands=END, **said):
    """Sets of a drive with a fault, until the fault has been told for so many seconds."""
    core = EstimatorCore(
        drive.configuration,
        AlwaysStuck(drive.configuration.wheels.count, **said),
        judged_by=InputJudge,
    )
    begin = drive.arrivals[0].arrival
    sets = []
    first = None
    for arrival in drive.arrivals:
        if arrival.arrival - begin >= seconds * 1e9:
            break
        new = core.add(fault(arrival.measurement))
        first = first or next((s.stamp for s in new if told(s)), None)
        sets += new
        if first and sets[-1].stamp - first > stands * 1e9:
            break
    return sets + core.flush()


def told(estimates):
    return {key: words for key, words in estimates.faults.items() if key.startswith('check of ')}


QUICK = FAULTS.keys() - {'thousand', 'torques'}  # as rpm and one_torque are


@pytest.mark.parametrize(
    'name', [pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK)) for n in FAULTS]
)
def test_a_fault_is_told_with_its_cure_and_nothing_is_judged(name):
    fault, kind, topic, cure, begins = FAULTS[name]
    drive = drive_of(SIX)
    sets = sets_of(drive, fault, min(END, begins + LONGEST + 2.0), stands=3.0)
    found = [s for s in sets if told(s)]
    assert found, f'{kind} was not found'
    start = sets[0].stamp
    assert (found[0].stamp - start) * 1e-9 < begins + LONGEST
    assert set(told(found[-1])) == {f'check of {topic}'}
    assert cure in told(found[-1])[f'check of {topic}']
    alone = name in ('one_wheel', 'in_two_messages', 'one_torque')
    for estimates in found:
        assert estimates.slip_class[0] == SlipClass.UNKNOWN
        others = set(estimates.slip_class[1:])
        assert others == {SlipClass.LOW if alone else SlipClass.UNKNOWN}, 'one wheel alone'
        assert estimates.stuck == alone
    assert found[-1] is sets[-1], 'it stands'


def test_a_rover_that_may_slide_back_on_a_slope_has_no_reversed_reference():
    def slides_back(m):
        if isinstance(m, InertialReading):
            return replace(m, specific_force=m.specific_force + np.array([3.0, 0.0, 0.0]))
        return reverse_reference(m)

    sets = sets_of(drive_of(SIX), slides_back, STRAIGHT)
    assert not any('linear.x' in words for s in sets for words in told(s).values())
    assert any(s.stuck for s in sets)


def test_a_warning_that_was_confirmed_once_stays_and_wrong_torques_confirm_none(monkeypatch):
    judge = InputJudge(Wheels().configuration)

    def out(fault, confirmations):
        words = {'kind': 'gain', 'topic': 'joint_states', 'words': 'wrong', 'cure': 'mend it'}
        finding = Finding(**words, confidence=0.97, fault=fault)
        monkeypatch.setattr(judge, 'standing', lambda driving: (finding,) * (driving == 'slip'))
        return [
            judge.judged(some_estimates(6, stuck=True, stuck_confirmed=confirmed), {}).stuck
            for confirmed in confirmations
        ]

    assert out('torque_scale', [True, True]) == [False, False]
    assert out('rate_unit', [False, True, False]) == [False, True, True]


@pytest.mark.parametrize(
    ('clears', 'given'),
    [
        (99.0, [4.0, 10.0]),
        (3.0, []),  # a spin at the start is over
        (6.0, [4.0, 10.0]),  # what has been given stays until it has cleared
    ],
)
def test_a_warning_whose_signs_pass_while_it_is_checked_is_not_given(monkeypatch, clears, given):
    monkeypatch.setattr(InputJudge, 'undecided', 'the first seconds of motion')
    judge, out = InputJudge(Wheels().configuration), []
    for time in np.arange(0.0, 10.5, 0.5):
        waits = some_estimates(6, stuck=True, stuck_clears=bool(time >= clears))
        if judge.judged(replace(waits, stamp=waits.stamp + round(1e9 * time)), {}).stuck:
            out.append(time)
    assert [out[0], out[-1]] == given if given else not out


@pytest.mark.parametrize('rover', [SIX, pytest.param(FOUR, marks=pytest.mark.slow)])
def test_a_drive_without_fault_is_silent(rover):
    sets = sets_of(drive_of(rover), lambda m: m)
    assert not any(told(s) for s in sets)
    decided = sets[0].stamp + LONGEST_WAIT
    assert all(s.stuck for s in sets if s.stamp >= decided), 'what the estimator says passes'


class Wheels:
    """Rates and sinkage at 20 Hz of a rover of six wheels, second by second."""

    def __init__(self, rover='generic_six_wheel', **changes):
        self.configuration = reader.load([rover]).replace(changes)
        self.count = self.configuration.wheels.count
        self.random = np.random.default_rng(3)

    def inputs(self, k, depth=0.01, frozen=False):
        rate = 0.5 + 0.01 * self.random.standard_normal(self.count)
        if frozen:
            rate[2] = 0.5
        stamp = 1_000_000_000 + k * 50_000_000
        return stamp, StepInputs(
            wheel_odometry=WheelOdometry(stamp, rate, np.full(self.count, np.nan)),
            sinkage=SinkageReading(stamp, depth + 0.001 * self.random.standard_normal(self.count)),
        )

    def checks_after(self, seconds, **what):
        checks = OnlineChecks(self.configuration)
        for k in range(20 * seconds):
            checks.step(*self.inputs(k, **what))
        return checks


def test_sinkage_counted_upwards_is_told_and_a_small_one_is_not():
    wheels = Wheels()
    assert not wheels.checks_after(12, depth=0.02).standing('slip')
    assert not wheels.checks_after(12, depth=-0.002).standing('slip'), 'within the zero error'
    (finding,) = wheels.checks_after(12, depth=-0.02).standing('slip')
    assert (finding.kind, finding.topic) == ('sign', 'sinkage')
    assert '-20 mm' in finding.words and 'negate position' in finding.cure


def test_sinkage_in_millimetres_and_a_variance_of_a_million_are_told_with_their_cure():
    def fault(m):
        if isinstance(m, SinkageReading):
            return replace(m, sinkage=1000.0 * (0.01 + m.sinkage))
        return replace(m, variance=1e6) if isinstance(m, ReferenceVelocity) else m

    drive = drive_of(SIX)
    pipeline = Pipeline(drive.configuration)
    for arrival in drive.arrivals[:500]:
        pipeline.core.add(fault(arrival.measurement))
    said = pipeline.diagnostics.stale('')[0].message.split('; ')
    for topic, cure in (
        ('sinkage', 'multiply position by 0.001'),
        ('reference_odom', 'sensors.reference_std'),
    ):
        assert any(words.startswith(topic) and cure in words for words in said)


def test_a_frozen_rate_is_told_and_noisy_ones_are_not():
    wheels = Wheels()
    assert not wheels.checks_after(10).standing('slip')
    assert not wheels.checks_after(8, frozen=True).standing('slip')  # nor is a coarse encoder's
    (finding,) = wheels.checks_after(18, frozen=True).standing('slip')
    assert (finding.kind, finding.wheel) == ('frozen', wheels.configuration.wheels.names[2])


def test_a_dead_imu_whose_means_are_rounded_is_told():
    """Means of one number over another count of messages each differ in the last digit."""
    wheels, reading = Wheels(), np.array([0.1, 0.1, 9.8, 0.01, 0.01, 0.01])
    checks, random = OnlineChecks(wheels.configuration), np.random.default_rng(1)
    for k in range(20 * 14):
        stamp, inputs = wheels.inputs(k)
        mean = reading + random.integers(-2, 3, 6) * np.spacing(reading)
        dead = InertialReading(stamp, mean[:3], mean[3:], None)
        checks.step(stamp, replace(inputs, inertial=dead))
    assert 'sensor_frozen' in {finding.fault for finding in checks.standing('beside')}


def raised(wheels, begin, end=np.inf, seconds=20, flip_from=None):
    """Return when a warning between two stamps is published [s since the first]."""
    judge, found = InputJudge(wheels.configuration), []
    for k in range(20 * seconds):
        depth = -0.02 if flip_from is not None and k >= 20 * flip_from else 0.02
        stamp, inputs = wheels.inputs(k, depth=depth)
        judge.step(stamp, inputs)
        estimates = some_estimates(6, stamp=stamp, stuck=begin <= stamp < end)
        if judge.judged(estimates, {}).stuck:
            found.append((stamp - 1_000_000_000) * 1e-9)
    return found


def at(seconds):
    return 1_000_000_000 + round(seconds * 1e9)


def test_a_warning_waits_while_its_inputs_are_on_trial_and_no_longer():
    wheels = Wheels()
    first_seconds = raised(wheels, at(1.0))
    assert 1.0 < first_seconds[0] <= 1.0 + LONGEST_WAIT * 1e-9
    assert first_seconds[-1] > 19.0, 'what waited comes and stays'
    assert raised(wheels, at(10.0))[0] == pytest.approx(10.0), 'no wait later'
    assert not raised(wheels, at(1.0), at(3.0)), 'fell while it waited'


def test_a_warning_waits_for_the_verdict_on_a_suspicion_and_never_comes_if_it_is_one():
    assert not raised(Wheels(), at(7.0), flip_from=0.0)


@pytest.mark.parametrize(
    ('nis', 'stuck', 'told'), [(7.0, False, False), (13.0, False, True), (13.0, True, False)]
)
def test_torques_that_do_not_fit_are_told_and_slip_is_still_judged(nis, stuck, told):
    """Of a rover that has dug itself in no model fits, and none of its sensors is to blame."""
    judge = InputJudge(Wheels().configuration)
    dug_in = some_estimates(6, stuck=stuck, stuck_confirmed=stuck)
    estimates = judge.judged(dug_in, {'nis_torque': nis})
    assert ('fit of torque' in estimates.faults) is told
    if told:
        assert 'NIS 13' in estimates.faults['fit of torque']
        assert 'wheel-terra check' in estimates.faults['fit of torque']
    np.testing.assert_array_equal(estimates.slip_class, some_estimates(6).slip_class)


@pytest.mark.parametrize(('than', 'told'), [('default', False), ('stated', True)])
def test_noise_beyond_what_is_stated_is_told_with_its_parameter(than, told):
    words = 'torque noise 8 times it (sensors.torque_std: 4.8)'
    judge = InputJudge(Wheels().configuration)
    estimates = judge.judged(some_estimates(6), {f'noise_beyond_{than}': words})
    assert ('sensors.torque_std: 4.8' in estimates.faults.get('noise', '')) is told
    np.testing.assert_array_equal(estimates.slip_class, some_estimates(6).slip_class)


def test_the_table_of_faults_names_kinds_parameters_and_channels_that_there_are():
    keys = {declared.key for declared in DECLARED}
    for fault in FAULT_TABLE.values():
        assert fault.driving in ('', 'slip', 'beside')
        assert fault.parameter is None or fault.parameter in keys
        assert fault.channel in {field.name for field in fields(Recording)}


def test_a_finding_comes_and_goes_with_hysteresis():
    said = found('imu_upside', 'imu/data', 0.9, force='', angles='')
    tally = Tally(0, 'check_upside', said).after(said)
    assert tally.open and not tally.stands
    tally = tally.after(said)
    assert tally.stands
    assert tally.after(None).stands and not tally.after(None).after(None).stands
    for _ in range(100):
        tally = tally.after(said)
    assert tally.score == CAP
    doubted = Tally(-5, 'check_upside', said)  # judged right five times before
    for _ in range(6):
        assert not doubted.stands
        doubted = doubted.after(said)
    assert not doubted.stands and doubted.after(said).stands


@pytest.mark.check_fails
def test_checks_that_fail_leave_the_estimates_alone(monkeypatch):
    calls = []

    def fail(self):
        calls.append(self)
        raise ZeroDivisionError('on purpose')

    monkeypatch.setattr(OnlineChecks, '_judge', fail)
    sets = sets_of(drive_of(SIX), lambda m: m, seconds=20.0)
    assert len(calls) == 1, 'not asked again before the next run'
    assert all(s.stuck for s in sets if s.faults), 'a warning does not wait for them'
    assert any('internal error, see --debug' in ' '.join(s.faults.values()) for s in sets)
    assert not any('filter' in s.faults for s in sets)
