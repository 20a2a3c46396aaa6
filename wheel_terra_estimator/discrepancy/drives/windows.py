# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Steady rows out of a drive: windows over whole lug periods, with their deviations.

The slip of a drive is not set: it follows from the slope, and is known only as well as the
reference velocity. Nor is the pull of a wheel measured: the accelerometer gives the sum over the
wheels. So each window yields

- one row per wheel with slip, normal load (from the specific force and the load model), torque and
  sinkage, no pull;
- one row for the mean wheel (mean slip, mean load) with the pull per wheel, m f_x / n, and nothing
  else. It is left out where the wheels differ in size or in slip so much that the mean of their
  pulls is not the pull of the mean wheel.

No cell is used twice and no pull is made up. Pull is taken along the chassis and turned to the
local slope by the tilt that the measured sinkages give (wheels that sink deeper behind tip the
chassis nose-up).

Deviations of a window's means come from the scatter of the means over single lug passages, with
their lag-one correlation pooled over all windows of the run: a window of its own is too short to
know it (naive standard errors cover 28 % instead of 95 %). Errors that a whole drive shares (zero
and gain of torque and sinkage sensors, bias of the accelerometer, as ``sensors.*`` state them) are
added at sqrt(number of windows) times their size: the rows together then know a common shift
exactly as well as the instrument does, and a zero error within its stated size is not taken for an
effect.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.discrepancy.drives.series import (
    Channel,
    DriveSeries,
    SpeedSmoother,
    collect,
)
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.steady_table import WHEEL, SteadyTable
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.measurements import Measurement
from wheel_terra_estimator.estimation.rover import Rover
from wheel_terra_estimator.estimation.sensor_errors import SensorErrors
from wheel_terra_estimator.terramechanics.kinematics import slip_ratio

_GREATEST_CORRELATION = 0.95  # of neighbouring segments

LEAST_PASSAGES = 10  # lug passages in a window
LEAST_DURATION = 4.0  # [s]
LEAST_SEGMENTS = 8  # into which a window is cut to judge drift and scatter
MOST_ROWS = 120  # more are averaged over windows of like slip, slope and rate
TURNING = 0.03  # mean yaw rate [rad/s] beyond which a window counts as a turn
SLIP_SPREAD = 0.15  # between wheels, beyond which there is no mean wheel
MOST_SLIP = 0.97  # of a wheel: beyond it no state is steady
SETTLING_TRAVEL = 0.5  # rim travel after standing, in wheel radii, that is not used

# Greatest drift over a window: share of the mean, and an absolute amount that is always allowed.
_DRIFT = {'wheel rate': (0.10, 0.01), 'slip': (0.10, 0.02), 'slope': (0.0, 0.0035)}
_CREEP = (0.10, 0.5e-3, 0.02)  # share of the sinkage, least [m], most in wheel radii

SMOOTHED = 'slip: from the fixed-interval smoother, without torque and sinkage'
GOOD = 'steady'


@dataclass(frozen=True)
class Window:
    """Means of a steady window and their deviations by scatter."""

    # [s] from the first wheel odometry
    start: float
    end: float
    passages: int  # lug passages in it (0 for a smooth wheel)
    # (n,) means; nan = not measured
    slip: FloatArray
    normal_load: FloatArray
    torque: FloatArray
    sinkage: FloatArray
    rate: FloatArray
    pull: float  # mean per wheel [N], along the local slope
    slope: float  # of the ground, positive uphill in the direction of travel [rad]
    segments: int
    # ``slip``, ``torque``, ``sinkage``, ``pull`` -> means of the segments, (segments, n or 1)
    series: Mapping[str, FloatArray]
    # Of the mean reference velocity, as its messages or the smoother state it [m/s]
    reference_std: float
    std: Mapping[str, FloatArray] = field(default_factory=dict)


@dataclass(frozen=True)
class DriveRows:
    """Rows of a drive as columns of the table format, and what was found on the way."""

    name: str  # where the drive came from
    columns: Mapping[str, FloatArray]  # column -> (N,) values [SI], nan = not measured
    windows: tuple[Window, ...]  # the steady ones
    seconds: Mapping[str, float]  # quality -> how long; ``steady`` are the windows
    notes: tuple[str, ...]  # for people

    def table(self) -> SteadyTable:
        """Return the rows as a checked table: the stated errors of the sensors are off already."""
        table = check_table(
            self.name, self.columns, notes=self.notes, most=MOST_ROWS, computed=('drawbar_pull',)
        )
        return replace(table, true_rows=np.ones(len(table), dtype=bool))


def rows_from_bag(
    path: str | Path,  # folder, or a single ``.mcap`` or ``.db3``
    configuration: Configuration,  # wheels, mass and load model
    remaps: Mapping[str, str] | None,  # estimator's topic -> the bag's
    *,
    # Whether the slip comes from the fixed-interval smoother in place of the references alone; it
    # takes about 1.7 times as long as a replay
    smooth: bool = False,
) -> DriveRows:
    """Return the steady rows of a rosbag2.

    Raises UserError if the bag cannot be read, lacks a sensor, or holds no steady window.
    """
    from wheel_terra_estimator.bags.reader import MeasurementReader
    from wheel_terra_estimator.bags.storage import open_bag

    with open_bag(path) as bag:
        heard = MeasurementReader(bag, remaps or {}, configuration).measurements()
        rows = rows_from_measurements(heard, configuration, str(path), smooth=smooth)
        return replace(rows, notes=(*bag.notes, *rows.notes))


def rows_from_measurements(
    measurements: Iterable[Measurement],
    configuration: Configuration,
    name: str = 'drive',
    *,
    smooth: bool = False,
) -> DriveRows:
    """Return the steady rows of a drive; see `rows_from_bag`. To smooth, in order of arrival."""
    wheels = configuration.wheels
    smoother = SpeedSmoother(configuration) if smooth else None
    heard = measurements if smoother is None else smoother.hear(measurements)
    corrected = map(SensorErrors(configuration).corrected, heard)
    series = collect(corrected, wheels.count, name)
    if smoother is not None:
        series = replace(series, smoothed=smoother.speed())
    finder = _WindowFinder(series, configuration)
    found = finder.search()
    if not found:
        seen = ', '.join(f'{key} {finder.seconds[key]:.1f} s' for key in finder.seconds)
        raise UserError(
            f'{name}: no steady window of {LEAST_DURATION:g} s and {LEAST_PASSAGES} lug passages '
            f'({seen or "nothing"}); drive straight at constant wheel rate, a few seconds per slope'
        )
    windows = _with_deviations(found, configuration)
    columns, left_out = _columns(windows, configuration)
    _add_shared_errors(columns, configuration, len(windows))
    return DriveRows(
        name, columns, tuple(windows), dict(finder.seconds), _notes(finder, windows, left_out)
    )


class _WindowFinder:
    """Walks along a drive and cuts out the steady windows."""

    def __init__(self, series: DriveSeries, configuration: Configuration) -> None:
        self.series = series
        self.configuration = configuration
        self.settings = Rover.from_configuration(configuration)
        self.seconds: dict[str, float] = {}

    def search(self) -> list[Window]:
        """Return the windows in order of time."""
        wheels = self.configuration.wheels
        time = self.series.rate.time
        now, end = float(time[0]), float(time[-1])
        settle = SETTLING_TRAVEL * float(np.mean(wheels.radius))
        unsettled = settle
        windows: list[Window] = []
        while now < end:
            ahead = self.series.rate.within(now, now + 0.5).values
            rate = float(np.nanmean(np.abs(ahead))) if np.isfinite(ahead).any() else np.nan
            rim = rate * float(np.mean(wheels.slip_radius))
            if not rim > 3 * self.configuration.rest_speed:
                now = self._pass(now, 0.5, 'standing' if rim >= 0 else 'no data')
                unsettled = settle
                continue
            if unsettled > 0:
                step = min(0.5, unsettled / rim)
                unsettled -= step * rim
                now = self._pass(now, step, 'settling')
                continue
            duration, passages = self._duration(rate)
            if now + duration > end:
                self._pass(now, end - now, 'no data')
                break
            quality, window = self._judge(now, now + duration, passages)
            if window is not None:
                windows.append(window)
                now = self._pass(now, duration, GOOD)
            else:
                now = self._pass(now, max(0.25 * duration, 0.5), quality)
                if quality == 'slope changes':  # until the last wheel has followed
                    unsettled = float(np.ptp(wheels.x))
        return windows

    def _pass(self, now: float, step: float, quality: str) -> float:
        """Book a stretch and return its end."""
        self.seconds[quality] = self.seconds.get(quality, 0.0) + step
        return now + step

    def _duration(self, rate: float) -> tuple[float, int]:
        """Return the length [s] of a window at this wheel rate, and its lug passages."""
        lugs = int(np.max(self.configuration.wheels.lug_count))
        if not lugs or not np.any(self.configuration.wheels.lug_height > 0):
            return LEAST_DURATION, 0
        period = 2 * np.pi / (lugs * rate)
        passages = max(LEAST_PASSAGES, int(np.ceil(LEAST_DURATION / period)))
        return passages * period, passages

    def _judge(self, start: float, end: float, passages: int) -> tuple[str, Window | None]:
        """Return the quality of a stretch and, where it is steady, its window."""
        s = self.series
        samples = len(s.rate.within(start, end).time)
        count = min(passages or LEAST_SEGMENTS, samples // 3)
        if count < LEAST_SEGMENTS or s.rate.longest_gap(start, end) > 1.0:
            return 'no data', None
        if s.reference.longest_gap(start, end) > max(3.0, 0.5 * (end - start)):
            return 'no reference', None
        force = _segments(s.specific_force, start, end, count)
        yaw = _segments(s.yaw_rate, start, end, count)
        if np.isnan(force).any() or np.isnan(yaw).any():
            return 'no data', None
        if abs(yaw.mean()) > TURNING:
            return 'turning', None
        rate = _segments(s.rate, start, end, count)
        torque = _segments(s.torque, start, end, count)
        sinkage = _segments(s.sinkage, start, end, count)
        slip = self._slip(start, end, count, rate)
        if np.isnan(rate).any() or np.isnan(slip).any():
            return 'no data', None
        if slip.mean(0).max() > MOST_SLIP:
            return 'no way made', None
        direction = np.sign(np.mean(rate))
        tilt = np.nan_to_num(sinkage) @ np.asarray(self.settings.rut_tilt)
        pitch = np.arctan2(force[:, 0], force[:, 2])
        slope = direction * (pitch - tilt)
        for what, values in (
            ('wheel rate', rate.mean(1)),
            ('slip', slip.mean(1)),
            ('slope', slope),
        ):
            share, always = _DRIFT[what]
            if _drifts(values, max(share * abs(values.mean()), always)):
                return f'{what} changes', None
        depth = sinkage.mean(1) if np.isfinite(sinkage).all() else np.zeros(count)
        radius = float(np.mean(self.settings.rim_radius))
        if _drifts(depth, np.clip(_CREEP[0] * depth.mean(), _CREEP[1], _CREEP[2] * radius)):
            return 'digging in', None
        mass, wheels = self.settings.mass, self.settings.wheel_count
        along = force[:, 0] * np.cos(tilt) - force[:, 2] * np.sin(tilt)
        pull = direction * mass / wheels * along
        mean = force.mean(0)
        return GOOD, Window(
            start,
            end,
            passages,
            slip.mean(0),
            self._loads(mean, _mean(torque), float(along.mean())),
            direction * _mean(torque),
            _mean(sinkage),
            rate.mean(0),
            float(pull.mean()),
            float(slope.mean()),
            count,
            {'slip': slip, 'torque': torque, 'sinkage': sinkage, 'pull': pull[:, None]},
            s.speed_std(start, end),
        )

    def _loads(self, force: FloatArray, torque: FloatArray, along: float) -> FloatArray:
        """Return the normal loads [N]; each wheel's moment about its hub shifts them."""
        settings = self.settings
        pull = np.full(settings.wheel_count, settings.mass * along / settings.wheel_count)
        if np.isnan(torque).any():
            return settings.load.loads(force, pull)
        return settings.load.loads(force, pull, torque - pull * np.asarray(settings.rim_radius))

    def _slip(self, start: float, end: float, count: int, rate: FloatArray) -> FloatArray:
        """Return the slip of each wheel in each segment, (count, n)."""
        s = self.series
        edges = np.linspace(start, end, count + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        forward = np.interp(middle, s.speed.time, s.speed.values[:, 0])
        yaw = np.interp(middle, s.yaw_rate.time, s.yaw_rate.values[:, 0])
        lateral = np.asarray(self.settings.lateral)
        ground = forward[:, None] - yaw[:, None] * lateral
        # Ratio of means, not mean of ratios: where the reference is noisy only the first is right.
        rim = rate * np.asarray(self.settings.slip_radius)
        slip = slip_ratio(ground.mean(0), rim.mean(0), self.configuration.rest_speed)
        single = slip_ratio(ground, rim, self.configuration.rest_speed)
        return single - np.nanmean(single, axis=0) + slip


def _segments(channel: Channel, start: float, end: float, count: int) -> FloatArray:
    """Return the means of equal parts of a stretch, (count, m); nan where a part has no sample."""
    inside_stretch = channel.within(start, end)
    times, values = inside_stretch.time, inside_stretch.values
    index = np.minimum(((times - start) / (end - start) * count).astype(int), count - 1)
    result = np.full((count, values.shape[1]), np.nan)
    for part in range(count):
        inside = values[index == part]
        good = np.isfinite(inside).any(axis=0)
        if good.any():
            result[part, good] = np.nanmean(inside[:, good], axis=0)
    return result


def _mean(values: FloatArray) -> FloatArray:
    """Column means; nan where less than half of the segments have a value."""
    good = np.isfinite(values)
    total = np.where(good, values, 0.0).sum(0)
    enough = 2 * good.sum(0) > len(values)
    return np.where(enough, total / np.maximum(good.sum(0), 1), np.nan)


def _drifts(values: FloatArray, allowed: float | np.floating) -> bool:
    """Return whether the mean before some moment differs from that after it, and significantly.

    All moments are tried: a drift parts the halves, a step at the end parts the last segment. The
    noise comes from successive differences, in which a step counts once.
    """
    n = len(values)
    before = np.arange(1, n)
    total = np.cumsum(values)[:-1]
    parted = (values.sum() - total) / (n - before) - total / before
    noise = float(np.median(np.abs(np.diff(values)))) / 0.954  # of the difference of two normals
    error = noise * np.sqrt(1 / before + 1 / (n - before))
    return bool(np.any((np.abs(parted) > float(allowed)) & (np.abs(parted) > 3 * error)))


def block_moments(length: int, correlation: float) -> tuple[float, float, float]:
    """Moments of a first-order process of variance 1 in a block that lost its mean.

    Returns the expected sum of products of neighbours, the expected sum of squares (both about the
    block's mean), and the variance of that mean.
    """
    place = np.arange(length)
    covariance = correlation ** np.abs(place[:, None] - place[None, :])
    to_mean = covariance.mean(axis=1)  # covariance of each with the mean
    of_mean = float(to_mean.mean())
    neighbours = correlation - to_mean[1:] - to_mean[:-1] + of_mean
    return float(neighbours.sum()), length * (1.0 - of_mean), of_mean


def pooled_correlation(blocks: Iterable[FloatArray]) -> float:
    """Return the lag-one correlation within blocks (k, n) of any lengths, pooled.

    The correlation at which the expected sums over all blocks, each with its own length, stand in
    the ratio of those found: the order of the blocks has no effect.
    """
    above = below = 0.0
    columns: Counter[int] = Counter()
    for block in blocks:
        d = block - block.mean(0)
        d = d[:, np.isfinite(d).all(0)]
        if d.size and len(d) > 1:
            above += float((d[1:] * d[:-1]).sum())
            below += float((d * d).sum())
            columns[len(d)] += d.shape[1]
    if below <= 0.0:
        return 0.0

    def excess(correlation: float) -> float:
        sums = [(n, block_moments(k, correlation)) for k, n in columns.items()]
        return sum(n * m[0] for n, m in sums) / sum(n * m[1] for n, m in sums) - above / below

    if excess(0.0) >= 0.0 or excess(_GREATEST_CORRELATION) <= 0.0:
        return 0.0 if excess(0.0) >= 0.0 else _GREATEST_CORRELATION
    from scipy.optimize import brentq  # heavy

    return float(brentq(excess, 0.0, _GREATEST_CORRELATION))


def _with_deviations(windows: list[Window], configuration: Configuration) -> list[Window]:
    """Return the windows with the standard deviations of their means."""
    settings, sensors = Rover.from_configuration(configuration), configuration.sensors
    names = ('slip', 'torque', 'sinkage', 'pull')
    correlation = {name: pooled_correlation(w.series[name] for w in windows) for name in names}
    pooled = {
        name: _mean(np.array([_variance(w.series[name], correlation[name]) for w in windows]))
        for name in names
    }
    # What white noise of the sensors leaves at best: the scatter must not promise more.
    load = settings.mass * settings.gravity / settings.wheel_count
    least = {
        'torque': 1e-3 * load * np.mean(settings.rim_radius),
        'sinkage': 5e-5,
        'pull': settings.mass / settings.wheel_count * float(sensors.specific_force_std),
    }
    result = []
    for window in windows:
        std: dict[str, FloatArray] = {}
        for name in names:
            k = window.segments
            # A window's own scatter counts as much as ten degrees of freedom of all windows.
            r = correlation[name]
            own = _variance(window.series[name], r)
            variance = (own * (k - 1) + 10 * pooled[name]) / (k + 9)
            std[name] = np.sqrt(variance * block_moments(k, r)[2])
        rim = np.abs(window.rate) * np.asarray(settings.slip_radius)
        std['slip'] = np.maximum(np.maximum(std['slip'], window.reference_std / rim), 2e-3)
        imu = max((window.end - window.start) * float(sensors.imu_rate), 1.0)
        for name, floor in least.items():
            std[name] = np.maximum(std[name], floor / (imu**0.5 if name == 'pull' else 1.0))
        result.append(replace(window, std=std))
    return result


def _variance(values: FloatArray, correlation: float) -> FloatArray:
    """Variance of a correlated series from the deviations about its mean."""
    good = np.isfinite(values).all(0)
    squares = len(values) * np.var(np.where(good, values, 0.0), axis=0)
    return np.where(good, squares / block_moments(len(values), correlation)[1], np.nan)


def _columns(
    windows: list[Window], configuration: Configuration
) -> tuple[dict[str, FloatArray], int]:
    """Return the columns, and in how many windows there was no mean wheel."""
    wheels = configuration.wheels
    alike = all(
        np.ptp(values) <= 1e-6 * np.max(np.abs(values))
        for values in (wheels.radius, wheels.width, wheels.lug_height + 1.0)
    )
    fields = {**WHEEL, 'pass_number': 'passes'}.items()
    sizes = [
        {column: float(getattr(wheels, name)[i]) for column, name in fields}
        for i in range(wheels.count)
    ]
    rows: list[dict[str, float]] = []
    left_out = 0
    for window in windows:
        constant = {
            'time': 0.5 * (window.start + window.end),
            'slope': window.slope,
            'gravity': float(configuration.rover.gravity),
        }
        for i, size in enumerate(sizes):
            if np.isnan([window.torque[i], window.sinkage[i]]).all() or window.normal_load[i] <= 0:
                continue
            row = {**constant, **size, 'normal_load': window.normal_load[i]}
            row['angular_velocity'] = window.rate[i]
            for name in ('slip', 'torque', 'sinkage'):
                row[name] = getattr(window, name)[i]
                row[f'{name}_std'] = window.std[name][i]
            rows.append(row)
        if not alike or np.ptp(window.slip) > SLIP_SPREAD:
            left_out += 1
            continue
        rows.append(
            {
                **constant,
                **sizes[0],
                'pass_number': float(np.mean(wheels.passes)),
                'slip': float(np.mean(window.slip)),
                'slip_std': float(np.mean(window.std['slip'])),
                'normal_load': float(np.mean(window.normal_load)),
                'angular_velocity': float(np.mean(window.rate)),
                'drawbar_pull': window.pull,
                'drawbar_pull_std': float(window.std['pull'][0]),
            }
        )
    names = dict.fromkeys(key for row in rows for key in row)
    columns = {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}
    for quantity in ('torque', 'sinkage', 'drawbar_pull'):
        if quantity in columns:
            columns[f'{quantity}_std'][np.isnan(columns[quantity])] = np.nan
            if np.isnan(columns[quantity]).all():
                del columns[quantity], columns[f'{quantity}_std']
    return columns, left_out


def _add_shared_errors(
    columns: dict[str, FloatArray], configuration: Configuration, windows: int
) -> None:
    """Widen deviations by what all rows of a sensor share, see the module's text."""
    sensors, rover = configuration.sensors, configuration.rover
    bias = float(sensors.specific_force_bias_std) * float(rover.mass) / configuration.wheels.count
    shared = {  # zero and gain
        'torque': (float(sensors.torque_zero_std), float(sensors.torque_gain_std)),
        'sinkage': (float(sensors.sinkage_zero_std), 0.0),
        'drawbar_pull': (bias, 0.0),
    }
    for quantity, (zero, gain) in shared.items():
        if quantity in columns:
            error = windows**0.5 * np.hypot(zero, gain * np.abs(columns[quantity]))
            columns[f'{quantity}_std'] = np.hypot(columns[f'{quantity}_std'], error)


def _notes(finder: _WindowFinder, windows: list[Window], left_out: int) -> tuple[str, ...]:
    used = finder.seconds.get(GOOD, 0.0)
    total = sum(finder.seconds.values())
    passages = [w.passages for w in windows]
    kind = 'smooth wheels'
    if max(passages):
        kind = f'{min(passages)} to {max(passages)} lug passages each'
    slips = [float(np.mean(w.slip)) for w in windows]
    longest_first = sorted(finder.seconds.items(), key=lambda item: -item[1])
    rest = [f'{key} {s:.0f} s' for key, s in longest_first if key != GOOD and s >= 0.5]
    notes = (
        f'{len(windows)} steady windows ({kind}), {used:.0f} of {total:.0f} s used, mean slip '
        f'{min(slips):.2f} to {max(slips):.2f} with a standard deviation of '
        f'{np.median([np.median(w.std["slip"]) for w in windows]):.3f}',
        f'not used: {", ".join(rest)}' if rest else '',
        SMOOTHED if finder.series.smoothed is not None else '',
        'pull: mean over the wheels (the accelerometer gives no more), in rows of their own',
        f'{left_out} windows give no pull: the wheels differ too much for a mean wheel'
        if left_out
        else '',
    )
    return tuple(filter(None, notes))
