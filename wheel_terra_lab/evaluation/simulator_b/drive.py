# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One drive of simulator B, from its kind and seed."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_lab.evaluation import bench_drive
from wheel_terra_lab.evaluation.bench_drive import Arrival
from wheel_terra_lab.evaluation.simulator_b.ground import Ground, Patch, RandomField
from wheel_terra_lab.evaluation.simulator_b.kinds import KINDS, Kind, PatchPlan
from wheel_terra_lab.evaluation.simulator_b.motion import Plant, State, WheelCommand, World
from wheel_terra_lab.evaluation.simulator_b.rovers import (
    Draw,
    TrueSoil,
    draw_rover,
    slope_for_slip,
    steepest_slope,
)
from wheel_terra_lab.evaluation.simulator_b.sensing import (
    Course,
    SensorSet,
    measure,
    odometry_times,
    stamps,
)
from wheel_terra_lab.evaluation.simulator_b.wheel_soil import slip_ratio

FloatArray = NDArray[np.float64]

_CLASS_BORDERS = (0.3, 0.6, 0.9)
_REST_SPEED, _REST_TIME = 2e-3, 0.5  # [m/s], [s]
_UNKNOWN_CLASS = 255
_STANDING = 3.0  # [s] at rest before the first start
_RAMP = 1.0  # [s]
_HEADING_GAIN = 0.4  # [1/s], of the driver that keeps the heading
_STEERING_SHARE = 0.3  # of the speed, at most, for that
_STEERING_ZERO = np.radians(0.5)  # deviation of the zeros of steering angles [rad]
_TRAPPING_SHARE = 0.85  # of the slope: what a patch that traps still carries the rover up


@dataclass(frozen=True)
class Truth(bench_drive.Truth):
    """Ground truth with the torques of the wheels (k, n) [N m]."""

    torque: FloatArray


@dataclass(frozen=True)
class RivalDrive:
    """A finished drive: what the estimator is told, hears, and should have said."""

    configuration: Configuration
    arrivals: list[Arrival]
    truth: Truth
    draw: Draw
    course: Course
    sensors: SensorSet


def simulate(kind: str, seed: int, duration: float | None = None) -> RivalDrive:
    """Simulate a drive of a kind of ``kinds.KINDS``; the same seed gives the same drive.

    The plan is stretched to a `duration` [s] other than that of the kind.
    """
    plan = KINDS[kind]
    length = plan.duration if duration is None else duration
    generator = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    draw = draw_rover(generator, plan.rover, plan.soils, plan.firm)
    world = _world(generator, plan, draw, length)
    sensors = draw_sensors(generator, plan, draw)
    course, truth_rows = _drive(generator, plan, draw, world, length)
    arrivals = measure(generator, course, sensors, draw.speed)
    configuration = draw.configuration(_sensor_keys(generator, sensors, draw))
    truth = _truth(course, truth_rows, sensors, draw)
    return RivalDrive(configuration, arrivals, truth, draw, course, sensors)


def _world(generator: np.random.Generator, plan: Kind, draw: Draw, length: float) -> World:
    vehicle, soil = draw.vehicle, draw.soil
    way = draw.speed * (length - _STANDING)
    wheelbase = float(np.ptp(vehicle.x))
    front = 0.5 * wheelbase
    size = max(wheelbase, 0.2 * way)
    scatter = plan.soil_scatter
    slopes = [slope_for_slip(vehicle, soil, slip) for _, slip in plan.slopes]
    ground = Ground(
        slope_position=np.array([share * way for share, _ in plan.slopes]),
        slope_angle=np.array(slopes),
        side_slope=slope_for_slip(vehicle, soil, plan.side_slip),
        undulation=RandomField(generator, plan.undulation, size),
        stiffness=RandomField(generator, scatter * float(generator.uniform(0.05, 0.2)), 0.5 * size),
        friction=RandomField(generator, scatter * float(generator.uniform(0.01, 0.04)), 0.5 * size),
        patches=tuple(_patch(p, draw, way, front, slopes[-1]) for p in plan.patches),
    )
    return World(
        vehicle=vehicle,
        ground=ground,
        soil=soil.under(vehicle.shape.width, vehicle.gravity),
        laws=soil.laws,
        digging=soil.digging,
        torque_limit=draw.torque_limit,
        rut_stiffening=float(generator.uniform(0.0, 0.15)),
        load_errors=tuple(RandomField(generator, 0.025, wheelbase) for _ in range(vehicle.count)),
    )


def _patch(plan: PatchPlan, draw: Draw, way: float, front: float, slope: float) -> Patch:
    """Return a patch in metres; on a slope [rad] that it shall not carry the rover up."""
    friction = plan.friction
    while plan.traps and steepest_slope(draw.vehicle, _in_patch(draw.soil, plan, friction)) > (
        _TRAPPING_SHARE * slope
    ):
        friction *= 0.95
    return Patch(
        start=plan.start * way + front,
        end=plan.end * way + front,
        stiffness=plan.stiffness,
        cohesion=plan.cohesion,
        friction=friction,
        right=0.0 if plan.side == 'left' else -np.inf,
        left=0.0 if plan.side == 'right' else np.inf,
        border=plan.border * way,
    )


def _in_patch(soil: TrueSoil, plan: PatchPlan, friction: float) -> TrueSoil:
    return replace(
        soil,
        stiffness=soil.stiffness * plan.stiffness,
        cohesive_modulus=soil.cohesive_modulus * plan.stiffness,
        cohesion=soil.cohesion * plan.cohesion,
        tan_friction=soil.tan_friction * friction,
    )


@dataclass(frozen=True)
class _TruthRows:
    pull: FloatArray
    load: FloatArray


def _drive(
    generator: np.random.Generator, plan: Kind, draw: Draw, world: World, length: float
) -> tuple[Course, _TruthRows]:
    plant, driver = Plant(world), _Driver(plan, draw, length)
    vehicle = draw.vehicle
    faulty = generator.permutation(vehicle.count)[: len(plan.faults)]
    rows: dict[str, list[FloatArray]] = {name: [] for name in (*_COLUMNS, 'silent')}
    while plant.state.time < length:
        share = plant.state.time / length
        speed, steering = driver.wheels(plant.state)
        rate = speed / vehicle.shape.tip_radius
        locked, free, silent = (
            _out_of_order(plan, np.arange(vehicle.count), faulty, kind, share)
            for kind in ('locked', 'free', 'dead')
        )
        plant.step(WheelCommand(rate, locked, free, steering))
        rows['silent'].append(silent.astype(float))
        for name, values in zip(_COLUMNS, _row(plant.state, vehicle.x, vehicle.y), strict=True):
            rows[name].append(values)
    columns = {name: np.array(values) for name, values in rows.items()}
    truth = _TruthRows(columns.pop('pull'), columns.pop('load'))
    return Course(**columns), truth


def _out_of_order(
    plan: Kind, wheels: NDArray[np.int64], faulty: NDArray[np.int64], kind: str, share: float
) -> NDArray[np.bool_]:
    """Return which wheels (n,) have a fault of a kind now; each fault befalls another wheel."""
    now = [f.kind == kind and f.start <= share < f.end for f in plan.faults]
    return np.isin(wheels, faulty[np.array(now, dtype=bool)])


class _Driver:
    """Who follows the plan and keeps the heading on straights, by what the wheels are told."""

    def __init__(self, plan: Kind, draw: Draw, length: float) -> None:
        self._plan, self._draw, self._length = plan, draw, length
        self._heading = 0.0

    def wheels(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return the speeds asked of the rims [m/s] and the headings of the wheels [rad], (n,)."""
        draw = self._draw
        forward, turn = _command(self._plan, draw, state.time, self._length)
        if turn != 0.0:
            self._heading = state.heading
        elif forward != 0.0:
            most = _STEERING_SHARE * abs(forward) / (0.5 * draw.track)
            error = self._heading - state.heading
            turn = float(np.clip(_HEADING_GAIN * error, -most, most))
        ahead, aside = forward - turn * draw.vehicle.y, turn * draw.vehicle.x
        if not draw.steered.any():
            return ahead, np.zeros(draw.vehicle.count)
        # Each steered wheel heads where its hub is to go, or away from it and turns backwards.
        back = np.where(ahead < 0.0, -1.0, 1.0)
        heading = np.where(draw.steered, np.arctan2(back * aside, np.abs(ahead)), 0.0)
        heading = np.where(np.hypot(ahead, aside) > _REST_SPEED, heading, state.steering)
        return np.where(draw.steered, back * np.hypot(ahead, aside), ahead), heading


_COLUMNS = (
    *('time', 'rate', 'torque', 'sinkage', 'speed', 'specific_force', 'slopes', 'tilt'),
    *('heading', 'steering', 'pull', 'load'),
)


def _row(state: State, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
    sinkage = state.sinkage
    across, along = x - x.mean(), y - y.mean()
    tilt = (-sinkage @ across / (across @ across), -sinkage @ along / (along @ along))
    force = state.force
    return (
        np.asarray(state.time),
        state.rate.copy(),
        state.forces.torque.copy(),
        sinkage,
        state.speed.copy(),
        np.array([force.forward, force.left, force.up]),
        np.array(state.slopes),
        np.array(tilt),
        np.asarray(state.heading),
        state.steering.copy(),
        state.forces.pull.copy(),
        state.load.copy(),
    )


def _command(plan: Kind, draw: Draw, time: float, length: float) -> tuple[float, float]:
    """Return forward speed [m/s] and turn rate [rad/s] that are asked for."""
    when, forward, turn = (np.array(c) for c in zip(*plan.commands, strict=True))
    share = time / length
    start = float(np.clip((time - _STANDING) / _RAMP, 0.0, 1.0))
    full_turn = draw.speed / (0.5 * draw.track)
    return (
        start * draw.speed * float(np.interp(share, when, forward)),
        start * full_turn * float(np.interp(share, when, turn)),
    )


def draw_sensors(generator: np.random.Generator, plan: Kind, draw: Draw) -> SensorSet:
    """Draw the true sensors of a drive."""
    vehicle, n = draw.vehicle, draw.vehicle.count
    radius = float(vehicle.shape.radius[0])
    torque = 0.3 * vehicle.weight / n * radius  # a working torque

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(generator.uniform(np.log(low), np.log(high))))

    satellite = plan.reference == 'satellite'
    noise = draw.speed * float(
        generator.uniform(0.02, 0.05) if satellite else log_uniform(0.03, 0.08)
    )
    stated = noise * float(generator.uniform(0.7, 1.4))
    return SensorSet(
        odometry_rate=float(generator.choice([10.0, 20.0, 50.0, 100.0])),
        encoder_steps=log_uniform(5e4, 1e6),
        torque_noise=torque * log_uniform(0.02, 0.08),
        torque_zero=0.04 * torque * generator.standard_normal(n),
        torque_gain=1.0 + 0.04 * generator.standard_normal(n),
        imu_rate=float(generator.choice([50.0, 100.0, 200.0])),
        force_noise=log_uniform(0.01, 0.05),
        force_bias=0.02 * generator.standard_normal(3),
        force_bias_walk=3e-4,
        vibration=log_uniform(0.03, 0.6),
        gyro_noise=log_uniform(0.002, 0.008),
        gyro_bias=0.002 * generator.standard_normal(3),
        gyro_bias_walk=3e-5,
        mounting=np.radians(0.2) * generator.standard_normal(2),
        attitude_error=np.radians(0.3),
        attitude=bool(generator.uniform() < 0.8),
        sinkage_rate=float(generator.choice([5.0, 10.0, 20.0])),
        sinkage_noise=radius * log_uniform(0.005, 0.02),
        sinkage_zero=0.006 * radius * generator.standard_normal(n),
        sinkage_step=0.003 * radius,
        reference_rate=float(
            generator.choice([1.0, 5.0] if satellite else [0.25, 0.5, 1.0, 2.0, 5.0])
        ),
        reference_noise=noise,
        reference_wander=0.04 * draw.speed if satellite else 0.0,
        reference_scale=0.005 * float(generator.standard_normal()),
        reference_delay=0.2 if satellite else float(generator.uniform(0.3, 1.75)),
        stated_variance=stated**2 if generator.uniform() < 0.75 else 0.0,
        steering_zero=np.where(
            draw.steered,
            _STEERING_ZERO * generator.standard_normal(n) if draw.steered.any() else 0.0,
            np.nan,
        ),
    )


def _sensor_keys(
    generator: np.random.Generator, sensors: SensorSet, draw: Draw
) -> dict[str, object]:
    """Return what the file says of the sensors: data sheets, some of them tried on the rover."""
    radius = float(draw.vehicle.shape.radius[0])
    torque = 0.3 * draw.vehicle.weight / draw.vehicle.count * radius

    def about(value: float) -> float:
        return float(value * generator.uniform(0.7, 1.4))

    shaken = generator.uniform() < 0.5  # the accelerometer's noise was looked at while driving
    force = np.hypot(sensors.force_noise, sensors.vibration) if shaken else sensors.force_noise
    step = 2.0 * np.pi / sensors.encoder_steps * sensors.odometry_rate
    return {
        'sensors.wheel_odometry_rate': sensors.odometry_rate,
        'sensors.wheel_rate_std': about(0.4 * step) + 1e-4,
        'sensors.torque_std': about(sensors.torque_noise),
        'sensors.torque_zero_std': about(0.04 * torque),
        'sensors.torque_gain_std': 0.04,
        'sensors.imu_rate': sensors.imu_rate,
        'sensors.specific_force_std': about(float(force)),
        'sensors.specific_force_bias_std': 0.02,
        'sensors.angular_rate_std': about(sensors.gyro_noise),
        'sensors.angular_rate_bias_std': 0.002,
        'sensors.orientation_std_deg': 0.4,
        'sensors.sinkage_rate': sensors.sinkage_rate,
        'sensors.sinkage_std': about(sensors.sinkage_noise),
        'sensors.sinkage_zero_std': about(0.006 * radius),
        'sensors.reference_rate': sensors.reference_rate,
        'sensors.reference_std': about(sensors.reference_noise),
        'sensors.reference_delay': sensors.reference_delay,
    }


def _truth(course: Course, rows: _TruthRows, sensors: SensorSet, draw: Draw) -> Truth:
    vehicle = draw.vehicle
    time = odometry_times(course, sensors)
    speed, rate = course.at('speed', time), course.at('rate', time)
    rim = rate * vehicle.shape.tip_radius
    angle = course.at('steering', time)
    ground = np.cos(angle) * (speed[:, :1] - speed[:, 2:] * vehicle.y)
    ground += np.sin(angle) * (speed[:, 1:2] + speed[:, 2:] * vehicle.x)
    held = np.where(np.abs(ground) > _REST_SPEED, -1.0, np.nan)
    slip = np.where(np.abs(rim) > _REST_SPEED, slip_ratio(ground, rim), held)
    slip = np.where(resting(time, rim, ground), np.nan, slip)

    def at(values: FloatArray) -> FloatArray:
        return np.stack([np.interp(time, course.time, c) for c in values.T], axis=1)

    return Truth(
        stamp=stamps(time),
        slip=slip,
        slip_velocity=rim - ground,
        drawbar_pull=at(rows.pull),
        normal_load=at(rows.load),
        sinkage=course.at('sinkage', time),
        torque=course.at('torque', time),
        wheel_rate=rate,
        slip_class=slip_classes(slip),
        yaw_rate=speed[:, 2],
    )


def resting(time: FloatArray, rim: FloatArray, ground: FloatArray) -> NDArray[np.bool_]:
    """Return which wheels (k, n) have stood still for the rest time."""
    still = np.maximum(np.abs(rim), np.abs(ground)) < _REST_SPEED
    moved = np.where(still, -np.inf, time[:, None])
    last = np.maximum.accumulate(moved, axis=0)
    return np.asarray(time[:, None] - np.maximum(last, time[0] - _REST_TIME) >= _REST_TIME)


def slip_classes(slip: FloatArray) -> NDArray[np.uint8]:
    """Return classes 0 to 3 of slips, 255 where nan."""
    found = np.searchsorted(_CLASS_BORDERS, np.abs(np.nan_to_num(slip)), side='left')
    return np.where(np.isnan(slip), _UNKNOWN_CLASS, found).astype(np.uint8)
