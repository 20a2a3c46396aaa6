# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives of simulator C: configuration, measurements in the order of arrival, and the truth."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.evaluation.bench_drive import Arrival, Truth
from wheel_terra_lab.evaluation.simulator_c.dynamics import STEP, Course, Motion, drive
from wheel_terra_lab.evaluation.simulator_c.ground import Ground
from wheel_terra_lab.evaluation.simulator_c.plans import (
    ENTRAPMENTS,
    KINDS,
    TRAPPED_SLIP,
    TRAPPED_TIME,
    Driver,
    Kind,
    slip_ratio,
)
from wheel_terra_lab.evaluation.simulator_c.rover import FAMILIES, Rover, draw_rover
from wheel_terra_lab.evaluation.simulator_c.rover_file import configuration_of
from wheel_terra_lab.evaluation.simulator_c.sensors import (
    Instruments,
    Sensing,
    draw_instruments,
    sampled,
)
from wheel_terra_lab.evaluation.simulator_c.site import Site, draw_site

FloatArray = NDArray[np.float64]

_TRIES = 6
"""How often the land is changed until a drive becomes what its kind promises."""
_NEAR_MISS = (0.58, 0.84)  # greatest median slip
_EARLIEST_TRAP = 12.0  # [s]
_START_TIME = 4.0  # of a drive, in which slips mean little [s]
_ALMOST_TRAPPED, _OFTEN = 0.85, 0.05  # median slip, and for which share of the time at most
_HARDER, _EASIER = 1.25, 0.75  # steps of hardness until the right one is bracketed
_UNKNOWN = 255


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive as the bench needs it, with the course and the rover for tests."""

    configuration: Configuration
    arrivals: Sequence[Arrival]
    truth: Truth
    course: Course
    rover: Rover
    soil: Ground  # without its patches
    instruments: Instruments


def simulate(kind: str, seed: int, duration: float | None = None) -> SimulatedDrive:
    """Simulate a drive of a kind of `plans.KINDS`, no longer than a `duration` [s].

    The seed draws rover, soil, land, sensors and rover file.
    """
    if kind not in KINDS:
        raise UserError(f'simulator C has no kind of drive {kind!r}; it has {", ".join(KINDS)}')
    plan = KINDS[kind]
    rover, site, course = _driven(kind, plan, seed)
    if duration is not None:
        rows = min(len(course.time), max(round(duration / STEP), 2))
        course = Course(**{name: values[:rows] for name, values in vars(course).items()})
    rng = _generator(kind, seed, 'sensors')
    instruments = draw_instruments(rng, plan, rover)
    sensing = Sensing(rng, rover, instruments, course)
    configuration = configuration_of(
        _generator(kind, seed, 'file'), plan, rover, instruments, site.base
    )
    truth = truth_of(course, configuration, sensing.odometry_stamps)
    arrivals = sensing.arrivals()
    return SimulatedDrive(configuration, arrivals, truth, course, rover, site.base, instruments)


def _generator(kind: str, seed: int, what: str, again: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(f'{kind} {what}'.encode()), again])


def _driven(name: str, kind: Kind, seed: int) -> tuple[Rover, Site, Course]:
    """Drive; change the land until the drive is what its kind promises."""
    for again in range(_TRIES):
        rng = _generator(name, seed, 'land', again)
        family = FAMILIES[str(rng.choice(kind.families))]
        rover = draw_rover(rng, family, float(rng.choice(kind.gravity)))
        site = draw_site(rng, kind, rover)
        locked = int(rng.integers(rover.count)) if kind.dragged else None
        patience = float(rng.uniform(2.0, 8.0))
        hardness, easy, hard = 1.0, 0.0, np.inf
        for _ in range(_TRIES):
            gives_up = name not in ENTRAPMENTS
            driver = Driver(rover, kind.phases, patience, locked, gives_up, site.end(rover))
            course = drive(Motion(rover, site.land()), driver, kind.duration)
            verdict = _verdict(name, kind, rover, course)
            if verdict == 0:
                return rover, site, course
            easy, hard = (hardness, hard) if verdict < 0 else (easy, hardness)
            wanted = 0.5 * (easy + hard) if np.isfinite(hard) else _HARDER * hardness
            wanted = max(wanted, _EASIER * hardness)
            if not site.change(wanted / hardness):
                break
            hardness = wanted
    return rover, site, course


def _verdict(name: str, kind: Kind, rover: Rover, course: Course) -> int:
    """Return whether a drive is too easy for its kind (-1), right (0) or too hard (1)."""
    median = _driving_median(course, rover.rims.radius + rover.rims.lug_height)
    began = _beginning(median)
    if name in ENTRAPMENTS:
        if began is None:
            return -1
        return int(course.time[began] < _EARLIEST_TRAP)
    late = course.time > _START_TIME
    if began is not None or np.mean(median[late] > _ALMOST_TRAPPED) > _OFTEN:
        return 1
    if kind.patch == 'near_miss':
        moving = np.abs(course.velocity[:, 0]) > 0.05 * rover.speed
        worst = median[moving & late].max(initial=0.0)
        return int(worst > _NEAR_MISS[1]) - int(worst < _NEAR_MISS[0])
    return 0


def _driving_median(course: Course, radius: FloatArray) -> FloatArray:
    """Return (k,) the median slip of the wheels, 0 at rest; braking counts as negative."""
    rim = course.rate * radius
    median = np.median(slip_ratio(rim, course.speed), axis=1)
    return np.where(np.abs(rim).max(axis=1) > 0.004, median, 0.0)


def _beginning(median: FloatArray) -> int | None:
    """Return the step at which an entrapment begins."""
    above = np.concatenate([[0], median > TRAPPED_SLIP, [0]]).astype(int)
    edges = np.flatnonzero(np.diff(above))
    long = edges[1::2] - edges[::2] >= round(TRAPPED_TIME / STEP)
    return int(edges[::2][long][0]) if long.any() else None


def truth_of(course: Course, configuration: Configuration, stamps: NDArray[np.int64]) -> Truth:
    """Return the truth at stamps, with the slip radius that the configuration states."""
    radius = configuration.wheels.slip_radius
    rate, speed = (sampled(course.time, a, stamps) for a in (course.rate, course.speed))
    rest_speed = configuration.rest_speed
    slip = slip_ratio(rate * radius, speed, rest_speed)
    slow = (np.abs(course.rate * radius) < rest_speed) & (np.abs(course.speed) < rest_speed)
    needed = round(configuration.filter.rest_time / STEP)
    step = np.arange(len(slow))[:, None]
    moved = np.maximum.accumulate(np.where(slow, -needed, step), axis=0)
    at_rest = step - moved >= needed  # the rover also stood before the drive
    resting = sampled(course.time, at_rest.astype(float), stamps) > 0.5
    bounds = configuration.filter.class_thresholds
    classes = np.searchsorted(bounds, np.abs(slip), side='left').astype(np.uint8)
    return Truth(
        stamp=stamps,
        slip=np.where(resting, np.nan, slip),
        slip_velocity=rate * radius - speed,
        drawbar_pull=sampled(course.time, course.pull, stamps),
        normal_load=sampled(course.time, course.normal, stamps),
        sinkage=sampled(course.time, course.sinkage, stamps),
        wheel_rate=rate,
        slip_class=np.where(resting, _UNKNOWN, classes).astype(np.uint8),
        yaw_rate=sampled(course.time, course.velocity[:, 2], stamps),
    )
