# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Drives to estimates: a rosbag2, a table of logged values, or a simulated drive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.api.arguments import check_kind
from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import (
    InertialReading,
    LeavingAngleReading,
    Measurement,
    ReferenceVelocity,
    SinkageReading,
    WheelOdometry,
)
from wheel_terra_estimator.estimation.taught import Taught
from wheel_terra_estimator.frames import Columns, columns_of, dates_of, to_frame
from wheel_terra_estimator.simulation.drive import SimulatedDrive

if TYPE_CHECKING:
    from pandas import DataFrame


NANOSECONDS = 1_000_000_000
LONGEST_STEP = 5.0
"""Median time between rows of a log [s]; after half a second without rates slip is unknown."""
LATEST = 2.0**31  # time that the stamp of a message can hold [s]
AXES = ('x', 'y', 'z')
PER_WHEEL = ('rate', 'torque', 'sinkage', 'leaving_angle', 'steering')
WHOLE = (
    'time',
    *(f'specific_force.{axis}' for axis in AXES),
    *(f'angular_rate.{axis}' for axis in AXES),
    *(f'orientation.{axis}' for axis in (*AXES, 'w')),
    'reference_velocity',
    'reference_velocity_std',
)


def estimate(
    drive: Any,
    rover: str | Path | Sequence[str | Path] | Configuration | None = None,
    *,
    parameters: Sequence[str] = (),
    remaps: Mapping[str, str] | None = None,
    as_frame: bool = True,
) -> DataFrame | Columns:
    """Run the estimator over a whole drive.

    The numbers are those of the node and of ``wheel-terra replay`` on the same input.

    Parameters
    ----------
    drive : path, DataFrame, mapping or SimulatedDrive
        A rosbag2 (folder, ``.mcap``, ``.db3``); what `simulate` gave; or logged values, one row per
        instant in order of time, nan where a sensor gave no reading: ``time`` [s]; per wheel
        ``rate.<wheel>`` [rad/s], ``torque.<wheel>`` [N m], ``sinkage.<wheel>`` [m],
        ``leaving_angle.<wheel>`` [rad], ``steering.<wheel>`` [rad]; ``specific_force.x`` (y, z)
        [m/s^2], ``angular_rate.x`` (y, z) [rad/s], ``orientation.x`` (y, z, w);
        ``reference_velocity`` [m/s] and ``reference_velocity_std``, in the row of the instant of
        measurement. A DataFrame may have an index of dates or durations in place of ``time``, and
        other units in ``attrs['units']`` ({'rate.fl': 'rpm'}). Vectors are in
        ``base_link``; rates are positive forward.
    rover : str, path, sequence or Configuration
        Configuration files, or bare names of shipped ones; not needed for a simulated drive.
    parameters : sequence of str
        ``NAME:=VALUE``, winning over ``rover``.
    remaps : mapping, optional
        For a bag: the estimator's topic -> the bag's.
    as_frame : bool
        True: a DataFrame (needs pandas), its index the ROS time as dates (UTC, or the time zone of
        a log's index), so that ``resample``, slices of time and ``join`` with the log or
        ``truth.to_frame()`` work, its units in ``attrs['units']``; False: the same columns as a
        dict of arrays.

    Returns
    -------
    DataFrame or dict
        One row per estimate set: ``stamp`` [ns], ``time`` [s since the first set],
        ``forward_velocity`` and ``forward_velocity_std`` [m/s], ``stuck``, and per wheel
        ``slip.<wheel>``, ``slip_std.<wheel>``, ``slip_velocity.<wheel>`` [m/s],
        ``drawbar_pull.<wheel>`` [N], ``sinkage.<wheel>`` [m], ``normal_load.<wheel>`` [N],
        ``rim_travel_left.<wheel>`` [m], ``pull_margin.<wheel>`` [N], deviations ``*_std``, and
        ``slip_class.<wheel>`` (0 low, 1 moderate, 2 high, 3 stuck, 255 unknown).

    Raises
    ------
    UserError
        For input that cannot be used: file, column or key, and the remedy.

    Examples
    --------
    >>> drive = simulate('firm_drive', seed=1, duration=1.0)
    >>> columns = estimate(drive, as_frame=False)
    >>> wheel = drive.configuration.wheels.names[0]
    >>> bool(abs(columns[f'slip.{wheel}'][-1]) < 0.3)
    True
    """
    return _result(_run(drive, rover, parameters, remaps)[0], drive, as_frame)


def smooth(
    drive: Any,
    rover: str | Path | Sequence[str | Path] | Configuration | None = None,
    *,
    parameters: Sequence[str] = (),
    remaps: Mapping[str, str] | None = None,
    as_frame: bool = True,
) -> DataFrame | Columns:
    """Run the fixed-interval smoother over a whole drive, with arguments and columns of `estimate`.

    The numbers are those of ``wheel-terra replay --smooth`` on the same input. What foretells
    (``stuck``, ``rim_travel_left``, ``pull_margin``) is as it was live.

    Examples
    --------
    >>> drive = simulate('firm_drive', seed=1, duration=1.0)
    >>> columns = smooth(drive, as_frame=False)
    >>> columns.keys() == estimate(drive, as_frame=False).keys()
    True
    """
    return _result(_run(drive, rover, parameters, remaps, smoothed=True)[0], drive, as_frame)


def simulate(
    scenario: str | Path | Mapping[str, Any] = 'climb_soft_patch',
    *,
    seed: int = 0,
    duration: float | None = None,
    output: str | Path | None = None,
    overwrite: bool = False,
) -> SimulatedDrive:
    """Drive a simulated rover and return its measurements and the truth.

    Parameters
    ----------
    scenario : str, path or mapping
        Bare name of a shipped scenario, a file, or dotted keys with values.
    seed : int
        Decides all random quantities.
    duration : float, optional
        In place of the scenario's [s].
    output : path, optional
        Folder of a rosbag2 to be written as well, as ``wheel-terra simulate`` does.

    Examples
    --------
    >>> drive = simulate('firm_drive', seed=1, duration=1.0)
    >>> drive.truth.slip.shape[1] == drive.configuration.wheels.count
    True
    """
    from wheel_terra_estimator.simulation import drive as simulation
    from wheel_terra_estimator.simulation.scenario import load

    check_kind(scenario, str | Path | Mapping, 'scenario', 'its name, a file, or keys with values')
    if not isinstance(seed, Integral) or seed < 0:
        raise UserError(f'simulate: seed is {seed!r}; give a whole number from 0 on')
    result = simulation.simulate(load(scenario), int(seed), duration)
    if output is not None:
        from wheel_terra_estimator.bags.simulated_drive import write_simulated_drive

        write_simulated_drive(result, Path(output), overwrite)
    return result


def taught(
    drive: Any,
    rover: str | Path | Sequence[str | Path] | Configuration | None = None,
    *,
    parameters: Sequence[str] = (),
    remaps: Mapping[str, str] | None = None,
) -> tuple[Taught, ...]:
    """Run the estimator over a drive (as `estimate`); return what that taught of soil and sensors.

    Examples
    --------
    >>> rows = taught(simulate('firm_drive', seed=1, duration=1.0))
    >>> {row.verdict for row in rows} <= {'learned', 'assumed', 'confounded'}
    True
    """
    return _run(drive, rover, parameters, remaps)[1]


def _run(
    drive: Any,
    rover: str | Path | Sequence[str | Path] | Configuration | None,
    parameters: Sequence[str],
    remaps: Mapping[str, str] | None,
    *,
    smoothed: bool = False,
) -> tuple[Any, tuple[Taught, ...]]:
    """Return the history of the estimates of a drive, and what it taught."""
    if isinstance(drive, SimulatedDrive):
        configuration = _rover(drive.configuration if rover is None else rover, parameters)
        return _estimated((a.measurement for a in drive.arrivals), configuration, smoothed)
    if rover is None:
        raise UserError("rover is missing; name its configuration files, such as ['my_rover']")
    configuration = _rover(rover, parameters)
    if not isinstance(drive, str | Path):
        rows, start = _logged(drive, configuration.wheels.names)
        measurements = _measurements(rows, configuration.wheels.names)
        history, learned = _estimated(measurements, configuration, smoothed)
        return replace(history, stamp=history.stamp + start - NANOSECONDS), learned
    from wheel_terra_estimator.bags.replay import Options, replay
    from wheel_terra_estimator.bags.storage import open_bag

    with open_bag(Path(drive)) as bag:
        replayed = replay(bag, configuration, remaps or {}, options=Options(smooth=smoothed))
    return replayed.history, tuple(replayed.taught)


def _rover(
    rover: str | Path | Sequence[str | Path] | Configuration, parameters: Sequence[str]
) -> Configuration:
    if isinstance(rover, Configuration):
        return rover.replace({}, parameters) if parameters else rover
    check_kind(rover, Iterable, 'rover', "names of files, such as ['my_rover.yaml']")
    files = [rover] if isinstance(rover, str | Path) else list(rover)
    return reader.load(files, parameters)


def _estimated(
    measurements: Iterable[Measurement], configuration: Configuration, smoothed: bool
) -> tuple[Any, tuple[Taught, ...]]:
    from wheel_terra_estimator.bags.history import HistoryRecorder
    from wheel_terra_estimator.checks.input_judge import InputJudge
    from wheel_terra_estimator.estimation.core import EstimatorCore
    from wheel_terra_estimator.estimation.smoothing.smoother import DriveSmoother

    smoother = DriveSmoother(configuration) if smoothed else None
    estimator = smoother.estimator if smoother else None
    core = EstimatorCore(configuration, estimator, judged_by=InputJudge)
    recorder = HistoryRecorder(configuration.wheels.names)
    sets = core.run(measurements)
    for estimates in smoother.smoothed(sets) if smoother else sets:
        recorder.add(estimates)
    return recorder.history(), core.taught()


def _result(history: Any, drive: Any, as_frame: bool) -> DataFrame | Columns:
    columns: Columns = {
        'stamp': history.stamp,
        'time': history.seconds,
        'forward_velocity': history.forward_velocity,
        'forward_velocity_std': history.forward_velocity_std,
        'stuck': history.stuck,
    }
    for field, values in {**history.values, 'slip_class': history.slip_class}.items():
        columns |= {f'{field}.{name}': values[:, i] for i, name in enumerate(history.names)}
    zone = getattr(getattr(drive, 'index', None), 'tz', None)  # of a log
    return to_frame(columns, history.stamp, zone) if as_frame else columns


def _logged(drive: Any, wheels: Sequence[str]) -> tuple[dict[str, FloatArray], int]:
    """Return the columns of logged values, checked, and the ROS time of the first row [ns]."""
    known = {*WHOLE, *(f'{field}.{wheel}' for field in PER_WHEEL for wheel in wheels)}
    check_kind(drive, Iterable, 'drive', 'a bag, a DataFrame, a mapping, or what simulate gave')
    columns, dates = columns_of(drive, 'drive', known.__contains__), dates_of(drive)
    for key in columns:
        if key not in known:
            raise UserError(
                f'drive: unknown column {key!r}; known are {", ".join(WHOLE)} and '
                f'{", ".join(PER_WHEEL)} with .<wheel>, wheels being {", ".join(wheels)}'
            )
    start = 0
    if 'time' not in columns and dates is not None:  # a float does not hold the nanoseconds
        start = int(dates[0]) if dates.size else 0
        columns['time'] = (dates - start).astype(np.float64) * 1e-9
    if 'time' not in columns or not any(f'rate.{wheel}' in columns for wheel in wheels):
        raise UserError(f"drive: needs the columns 'time' and 'rate.{wheels[0]}' (all wheels)")
    time = columns['time']
    gaps = np.diff(time)
    if not np.isfinite(time).all() or (gaps < 0.0).any():
        raise UserError('drive: time must be finite and must not go back; sort the rows')
    if (gaps.size and np.median(gaps) > LONGEST_STEP) or (np.abs(time) > LATEST).any():
        raise UserError(
            f'drive: time goes from {time[0]:g} to {time[-1]:g} s in {time.size} rows; is its unit '
            "right? Give it in s, or say its unit in attrs['units']"
        )
    whole, rest = divmod(float(time[0]) if time.size else 0.0, 1.0)
    return columns, start + int(whole) * NANOSECONDS + round(rest * NANOSECONDS)


def _measurements(
    columns: Mapping[str, FloatArray], wheels: Sequence[str]
) -> Iterator[Measurement]:
    """Yield what each row of logged values measured, stamps counted from 1 s on, in their order."""
    time = columns['time']
    blank = np.full(time.size, np.nan)

    def block(names: Iterable[str]) -> FloatArray:
        return np.column_stack([columns.get(name, blank) for name in names])

    rate, torque, sinkage, leaving, steering = (
        block(f'{f}.{w}' for w in wheels) for f in PER_WHEEL
    )
    force = block(f'specific_force.{axis}' for axis in AXES)
    turn = block(f'angular_rate.{axis}' for axis in AXES)
    attitude = block(f'orientation.{axis}' for axis in (*AXES, 'w'))
    velocity = columns.get('reference_velocity', blank)
    deviation = columns.get('reference_velocity_std', blank)
    # 0 is no stamp; the numbers depend on differences of stamps only.
    stamps = np.round((time - time[:1]) * NANOSECONDS).astype(np.int64) + NANOSECONDS
    for k, stamp in enumerate(stamps.tolist()):
        if np.isfinite(force[k]).all() and np.isfinite(turn[k]).all():
            known_attitude = attitude[k] if np.isfinite(attitude[k]).all() else None
            yield InertialReading(stamp, force[k], turn[k], known_attitude)
        if np.isfinite(sinkage[k]).any():
            yield SinkageReading(stamp, sinkage[k])
        if np.isfinite(leaving[k]).any():
            yield LeavingAngleReading(stamp, leaving[k])
        if np.isfinite(velocity[k]):
            stated = deviation[k] ** 2 if np.isfinite(deviation[k]) else 0.0
            yield ReferenceVelocity(stamp, float(velocity[k]), float(stated))
        if np.isfinite(rate[k]).any():
            angles = steering[k] if np.isfinite(steering[k]).any() else None
            yield WheelOdometry(stamp, rate[k], torque[k], angles)
