# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Filter, classes and warnings of one rover: one step per stamp, estimates on demand.

Between two filter cycles (``filter.period``) only sums are kept and the speed is carried on, so
that wheel odometry at 100 Hz costs little more than at 10 Hz; a cycle predicts, fuses what came
since, and works out the outputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.estimation.estimates import EstimateSet, SlipClass
from wheel_terra_estimator.estimation.filter import GatedFilter, chi_square_gate
from wheel_terra_estimator.estimation.filter_settings import FilterSettings
from wheel_terra_estimator.estimation.filter_state import (
    CENTROID,
    GRAVITY_BIAS,
    MOUND,
    SHEAR_MODULUS,
    SHEAR_STRENGTH,
    SLIP_SINKAGE,
    SPEED,
    StateLayout,
)
from wheel_terra_estimator.estimation.measurement_models import (
    WheelForces,
    WheelModels,
    slip_of_speed_ratio,
)
from wheel_terra_estimator.estimation.measurements import ReferenceVelocity, StepInputs
from wheel_terra_estimator.estimation.slip_classes import SlipClassifier
from wheel_terra_estimator.estimation.speed_process import (
    Attitude,
    InertialWindow,
    SpeedStep,
    median,
    speed_step,
    take_inertial,
)
from wheel_terra_estimator.estimation.stuck_warning import (
    StuckAssessment,
    StuckMonitor,
    StuckTuning,
    WheelMotionState,
)

FloatArray = NDArray[np.float64]
_NAN = math.nan
_SLOPE_KEEP = 0.9  # per cycle
_LEAST_SLIP_STD, _LEAST_TURNING_STD = 0.02, 0.04
_TURNING_SLIP_STD = 0.05
_UNLOADED_HOLD = 0.3
_EFFORT_GAIN = 0.5
_FAIR_NIS = 3.0
_PILED_STD = 0.05  # of the load, at slip 1
_BALANCE_STD = 0.005  # of the weight: what curvature, ruts and mass leave open
# Slip of a rover in loose soil on level ground, its spread, and the rim travel of its changes [m].
_USUAL_SLIP, _USUAL_STD, _USUAL_LENGTH = 0.12, 0.2, 1.0


@dataclass
class _Run:
    """Everything that changes, except the filter, the classifier and the warning."""

    origin: int = 0  # [ns]
    stamp: int = 0
    time: float = 0.0  # [s] since origin
    cycle_time: float | None = None
    inertial_time: float | None = None
    odometry_time: float | None = None
    torque_time: float | None = None
    sinkage_time: float | None = None
    reference_time: float | None = None
    reference_gap: float = 10.0  # [s] between fixes, smoothed
    still_since: float | None = None
    sliding_until: float = -1.0
    rim_at_cycle: float | None = None
    rim_speed: list[float] = field(default_factory=list)  # nan = unknown
    rate_time: list[float] = field(default_factory=list)
    torque_sum: list[float] = field(default_factory=list)
    torque_count: list[int] = field(default_factory=list)
    torque_held: list[float] = field(default_factory=list)
    torque_now: list[float] = field(default_factory=list)  # smoothed, by sensor or model
    sinkage_sum: list[float] = field(default_factory=list)
    sinkage_count: list[int] = field(default_factory=list)
    sinkage_rejected: list[int] = field(default_factory=list)
    sinkage_seen: list[bool] = field(default_factory=list)
    leaving_angle: list[float] = field(default_factory=list)
    leaving_time: list[float] = field(default_factory=list)
    rest_since: list[float] = field(default_factory=list)  # nan = not at rest
    resting: list[bool] = field(default_factory=list)
    slip: list[float] = field(default_factory=list)
    slip_std: list[float] = field(default_factory=list)
    wheel_class: list[int] = field(default_factory=list)
    window: InertialWindow = field(default_factory=InertialWindow)
    attitude: Attitude = field(default_factory=Attitude)
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)  # specific force of the last window
    force_known: bool = False
    yaw_rate: float = 0.0
    turned_up: float = 0.0  # nose-up rotation over the last rover length [rad]
    side_slow: float = 0.0
    renewal: float = 0.0  # how far turning has changed while the contacts form anew
    unrest: float = 0.0  # change of speed that contacts under change may bring [m/s]
    side_motion: float = 0.0  # of the outer wheels over the fastest rim speed
    turned_over: float = 0.0  # and the travel that it took [m]
    yaw_bias: float = 0.0
    yaw_bias_weight: float = 0.0
    ratio: float = 0.95  # remembered v / rim speed
    ratio_std: float = 0.3
    ratio_walk: float = 0.13  # of v / rim speed [1/sqrt(m)]
    drive_direction: float = 0.0
    starting: bool = True
    fresh_travel: float = 0.0  # [m] since the start or the last change of direction
    load: list[float] = field(default_factory=list)
    torque_slope: list[float] = field(default_factory=list)  # by v/(r w), smoothed; nan = none
    pull_slope: list[float] = field(default_factory=list)
    pull: list[float] = field(default_factory=list)
    pull_std: list[float] = field(default_factory=list)
    sinkage_rate: list[float] = field(default_factory=list)
    sinkage_rate_std: list[float] = field(default_factory=list)
    pull_margin: list[float] = field(default_factory=list)
    margin_time: float = -10.0
    rejected: dict[str, int] = field(default_factory=dict)
    reference_rejected: int = 0  # in a row
    reference_doubt: float = 0.0  # residual of the last rejected fix [m/s]
    effort: list[float] = field(
        default_factory=lambda: [_NAN, _NAN]
    )  # torque over load, fast and slow
    unloaded_since: list[float] = field(default_factory=list)  # nan = carries its load
    unloaded: list[bool] = field(default_factory=list)
    steepness: float = 0.0
    effort_time: float = 0.0
    stand_pull: list[float] = field(default_factory=list)
    nis: dict[str, float] = field(default_factory=dict)
    assessment: StuckAssessment | None = None

    def copy(self) -> _Run:
        """Return a copy whose lists are its own."""
        values: dict[str, Any] = {}
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, (list, dict, InertialWindow, Attitude)):
                value = value.copy()
            values[entry.name] = value
        return _Run(**values)


class WheelSoilEstimator:
    """Estimator of one rover; sees stamps in order and only checked numbers.

    Parameters
    ----------
    configuration : Configuration
        Rover, soil, sensors, tuning.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._settings = settings = FilterSettings.from_configuration(configuration)
        self._layout = StateLayout(settings.wheel_count)
        self._models = WheelModels(configuration)
        tuning = configuration.filter
        self._classifier = SlipClassifier(
            settings.wheel_count,
            [float(b) for b in tuning.class_thresholds],
            float(tuning.class_hysteresis),
            float(tuning.class_dwell),
        )
        self._stuck_tuning = StuckTuning(
            horizon=float(tuning.stuck_horizon),
            travel=float(tuning.stuck_travel),
            clear_slip=float(tuning.stuck_clear_slip),
            clear_time=float(tuning.stuck_clear_time),
        )
        self._monitor = StuckMonitor(self._stuck_tuning)
        # Below this rim speed v / rim speed is not told from noise.
        self._low_rim = max(3.0 * settings.rest_speed, 0.005)
        # Until a contact is new all along, its shear is not that of the steady model.
        n = settings.wheel_count
        common = float(tuning.shear_error_common_std)
        self._shear_error_covariance = np.eye(n) * settings.shear_error_std**2 + common**2
        self._curvature_length = 0.5 * (max(settings.longitudinal) - min(settings.longitudinal))
        self._contact_length = 0.5 * min(settings.rim_radius)
        rate = max(float(settings.sensors.imu_rate), 1.0)
        sensors = settings.sensors
        # Attitude errors change within about half a second over rough ground.
        attitude = settings.gravity * float(sensors.orientation_std)
        self._acceleration_noise = math.sqrt(
            float(sensors.specific_force_std) ** 2 / rate + attitude**2 * 0.5
        )
        self._start()

    # ------------------------------------------------------------------ runs

    def begin_run(self, stamp: int, keep_soil: bool) -> None:
        """Start anew at a stamp [ns]; with `keep_soil` soil and biases are kept, widened."""
        if not keep_soil:
            self._start()
            self._run.origin = self._run.stamp = stamp
            return
        old, mean = self._run, self._filter.mean.copy()
        covariance = self._filter.covariance.copy()
        self._start()
        self._run.origin = self._run.stamp = stamp
        self._run.yaw_bias, self._run.yaw_bias_weight = old.yaw_bias, 0.5 * old.yaw_bias_weight
        self._run.rejected = dict(old.rejected)
        layout = self._layout
        kept = [GRAVITY_BIAS, SHEAR_STRENGTH, SHEAR_MODULUS, SLIP_SINKAGE, CENTROID, MOUND]
        kept += range(layout.size)[layout.stiffness]
        prior = self._filter.covariance
        fresh = prior.copy()
        block = np.ix_(kept, kept)
        fresh[block] = 0.5 * (covariance[block] + prior[block])
        start = self._filter.mean.copy()
        start[kept] = mean[kept]
        self._filter.restore((start, fresh, self._filter.restarts))

    def _start(self) -> None:
        s = self._settings
        n = s.wheel_count
        run = _Run(
            rim_speed=[_NAN] * n,
            rate_time=[-1e9] * n,
            torque_sum=[0.0] * n,
            torque_count=[0] * n,
            torque_held=[_NAN] * n,
            torque_now=[0.0] * n,
            sinkage_sum=[0.0] * n,
            sinkage_count=[0] * n,
            sinkage_rejected=[0] * n,
            sinkage_seen=[False] * n,
            leaving_angle=[_NAN] * n,
            leaving_time=[-1e9] * n,
            rest_since=[_NAN] * n,
            resting=[False] * n,
            unloaded_since=[_NAN] * n,
            unloaded=[False] * n,
            stand_pull=[_NAN] * n,
            slip=[0.0] * n,
            slip_std=[1.0] * n,
            wheel_class=[int(SlipClass.UNKNOWN)] * n,
            pull=[0.0] * n,
            torque_slope=[_NAN] * n,
            pull_slope=[_NAN] * n,
            sinkage_rate=[0.0] * n,
            sinkage_rate_std=[1.0] * n,
            pull_margin=[0.0] * n,
            rejected={'reference': 0, 'sinkage': 0},
        )
        run.force = (0.0, 0.0, s.gravity)
        run.load = [float(w) for w in s.load.loads(run.force)]
        run.pull_std = list(run.load)
        self._run = run
        self._classifier = SlipClassifier(
            n,
            [float(b) for b in s.filter.class_thresholds],
            float(s.filter.class_hysteresis),
            float(s.filter.class_dwell),
        )
        self._monitor = StuckMonitor(self._stuck_tuning)
        self._filter = self._initial_filter()
        self._jacobian_pull = np.zeros((n, self._layout.size))
        self._linear: tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None = None

    def _initial_filter(self) -> GatedFilter:
        s, layout = self._settings, self._layout
        mean = np.zeros(layout.size)
        P = np.zeros((layout.size, layout.size))
        P[SPEED, SPEED] = 1.0
        P[GRAVITY_BIAS, GRAVITY_BIAS] = (
            float(s.sensors.specific_force_bias_std) ** 2
            + (s.gravity * float(s.sensors.orientation_std)) ** 2
        )
        P[SHEAR_STRENGTH, SHEAR_STRENGTH] = s.shear_strength_std**2
        P[SHEAR_MODULUS, SHEAR_MODULUS] = s.shear_modulus_std**2
        P[SLIP_SINKAGE, SLIP_SINKAGE] = 0.1**2
        P[CENTROID, CENTROID] = 0.06**2
        mound_known = 'soil_mound' in self._configuration.effects
        mean[MOUND] = 0.0 if mound_known else 0.05
        P[MOUND, MOUND] = 0.1**2
        n = s.wheel_count
        # Static sinkage by the bearing law: where the law carries the load at zero slip.
        for i in range(n):
            mean[layout.sinkage.start + i] = self._static_sinkage(i)
        z = mean[layout.sinkage]
        P[layout.sinkage, layout.sinkage] = np.diag((0.5 * z + 0.005) ** 2)
        shared, own = s.stiffness_std, 0.5 * s.stiffness_std
        P[layout.stiffness, layout.stiffness] = shared**2 + np.eye(n) * own**2
        P[layout.shear_error, layout.shear_error] = self._shear_error_covariance
        upper = np.full(layout.size, np.inf)
        upper[SPEED], upper[GRAVITY_BIAS] = 20.0, 2.0
        upper[SHEAR_STRENGTH], upper[SHEAR_MODULUS] = 1.0, 1.0
        upper[SLIP_SINKAGE], upper[CENTROID], upper[MOUND] = 0.8, 0.3, 0.6
        upper[layout.stiffness], upper[layout.shear_error] = 3.0, 1.5
        lower = -upper
        upper[layout.sinkage] = [0.9 * r for r in s.rim_radius]
        lower[layout.sinkage] = [-0.02 * r for r in s.rim_radius]
        return GatedFilter(mean, P, lower, upper)

    def _static_sinkage(self, wheel: int) -> float:
        low, high = 1e-4, 0.5 * self._settings.rim_radius[wheel]
        load = self._run.load[wheel]
        for _ in range(30):
            z = math.sqrt(low * high)
            bearing = self._models.bearing(wheel, 1.0, z, load, 0.0, 0.0, 0.0, 0.0, _NAN)
            if bearing.load < load:
                low = z
            else:
                high = z
        return high

    def snapshot(self) -> tuple[Any, ...]:
        """Return what `restore` needs to come back to this state."""
        return (
            self._run.copy(),
            self._filter.snapshot(),
            self._classifier.snapshot(),
            self._monitor.snapshot(),
            self._jacobian_pull,
        )

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Go back to a snapshot."""
        run, filter_memory, classes, monitor, self._jacobian_pull = snapshot
        self._run = run.copy()
        self._filter.restore(filter_memory)
        self._classifier.restore(classes)
        self._monitor.restore(monitor)

    # ------------------------------------------------------------------ step

    def step(self, stamp: int, inputs: StepInputs) -> None:
        """Bring the state to a stamp [ns] with the measurements of that stamp."""
        run = self._run
        if run.origin == 0:
            run.origin = stamp
        run.stamp = stamp
        run.time = time = (stamp - run.origin) * 1e-9
        if inputs.inertial is not None:
            dt = 0.0 if run.inertial_time is None else time - run.inertial_time
            run.inertial_time = time
            take_inertial(
                run.window,
                run.attitude,
                inputs.inertial,
                dt,
                self._settings.gravity,
                run.yaw_bias,
            )
        if inputs.sinkage is not None:
            for i, value in enumerate(inputs.sinkage.sinkage.tolist()):
                if value == value:
                    run.sinkage_sum[i] += value
                    run.sinkage_count[i] += 1
        if inputs.leaving_angle is not None:
            for i, value in enumerate(inputs.leaving_angle.leaving_angle.tolist()):
                if value == value:
                    fresh = time - run.leaving_time[i] > 1.0
                    old = value if fresh else run.leaving_angle[i]
                    run.leaving_angle[i] = old + 0.3 * (value - old)
                    run.leaving_time[i] = time
        if inputs.wheel_odometry is not None:
            self._take_wheel_odometry(time, inputs)
        silent = run.odometry_time is None or time - run.odometry_time > self._settings.silence
        due = (
            run.cycle_time is None
            or time - run.cycle_time >= float(self._settings.filter.period) - 1e-4
        )
        if inputs.reference is not None or (due and (inputs.wheel_odometry is not None or silent)):
            self._cycle(time, inputs.reference)
        if inputs.wheel_odometry is not None or silent:
            self._judge(time)

    def _take_wheel_odometry(self, time: float, inputs: StepInputs) -> None:
        run, s = self._run, self._settings
        odometry = inputs.wheel_odometry
        assert odometry is not None
        rates, torques = odometry.rate.tolist(), odometry.torque.tolist()
        dt = 1.0 if run.odometry_time is None else time - run.odometry_time
        # Fast odometry is noisy or quantised: smooth it over 50 ms, less than its use anywhere.
        keep = 0.0 if dt >= 0.06 else math.exp(-dt / 0.05)
        for i in range(s.wheel_count):
            rate = rates[i]
            if rate == rate:
                rim = rate * s.slip_radius[i]
                old = run.rim_speed[i]
                run.rim_speed[i] = rim if old != old else keep * old + (1.0 - keep) * rim
                run.rate_time[i] = time
            torque = torques[i]
            if torque == torque:
                run.torque_sum[i] += torque
                run.torque_count[i] += 1
                run.torque_time = time
        run.odometry_time = time

    def _rim(self, wheel: int) -> float:
        """Rim speed of a wheel [m/s], nan when its rate is unknown or too old."""
        run = self._run
        if run.time - run.rate_time[wheel] > self._settings.silence:
            return _NAN
        return run.rim_speed[wheel]

    def _representative_rim(self, yaw_rate: float) -> float | None:
        """Rim speed without the turning [m/s]; the median, so that no single wheel decides."""
        values = []
        for i in range(self._settings.wheel_count):
            rim = self._rim(i)
            if rim == rim:
                values.append(rim + yaw_rate * self._settings.lateral[i])
        return median(values) if values else None

    def _speed_step(self, time: float) -> SpeedStep:
        run = self._run
        dt = 0.0 if run.cycle_time is None else time - run.cycle_time
        return speed_step(
            dt=dt,
            rim_before=run.rim_at_cycle,
            rim_now=self._representative_rim(run.yaw_rate),
            ratio=run.ratio,
            ratio_std=run.ratio_std,
            low_rim=self._low_rim,
            ratio_walk=run.ratio_walk,
            unrest=run.unrest,
            window=run.window,
            acceleration_noise=self._acceleration_noise,
        )

    def _current_speed(self) -> tuple[float, float]:
        """Return speed and variance at the present stamp, carried on from the last cycle."""
        run = self._run
        x, P = self._filter.mean, self._filter.covariance
        if run.cycle_time is None or run.time - run.cycle_time < 1e-6:
            return float(x[SPEED]), float(P[SPEED, SPEED])
        step = self._speed_step(run.time)
        a, b = step.speed_gain, step.bias_gain
        speed = a * float(x[SPEED]) + b * float(x[GRAVITY_BIAS]) + step.constant
        variance = (
            a * a * float(P[SPEED, SPEED])
            + 2.0 * a * b * float(P[SPEED, GRAVITY_BIAS])
            + b * b * float(P[GRAVITY_BIAS, GRAVITY_BIAS])
            + step.variance
        )
        return speed, variance

    # ------------------------------------------------------------------ filter cycle

    def _cycle(self, time: float, reference: ReferenceVelocity | None) -> None:
        run, s = self._run, self._settings
        dt = 0.0 if run.cycle_time is None else time - run.cycle_time
        window = run.window
        if window.count:
            count = window.count
            run.force = (window.force_x / count, window.force_y / count, window.force_z / count)
            run.force_known = True
            self._follow_turning(window, dt)
            run.load = self._loads()
            self._note_turning(dt)
        rim = self._representative_rim(run.yaw_rate)
        self._follow_direction(rim)
        if run.rim_at_cycle is None and rim is not None:
            # First sight of the wheels: between rolling and spinning, or at rest.
            spread = max(0.3 * abs(rim), s.rest_speed)
            self._filter.set(SPEED, run.ratio * rim, spread * spread)
        rims = [self._rim(i) for i in range(s.wheel_count)]
        still = all(r != r or abs(r) < s.rest_speed for r in rims) and any(r == r for r in rims)
        before = self._filter.mean[self._layout.sinkage].copy()
        self._predict(time, dt, rims, still)
        if reference is not None:
            self._fuse_reference(time, reference, still)
        self._fuse_rest(time, rims, rim, still)
        self._fuse_models(dt, rims, still)
        self._after(time, dt, rim, rims, still, before)

    def _follow_turning(self, window: InertialWindow, dt: float) -> None:
        """Smooth the yaw rate while it is steady; measure how the ground curves along the path."""
        run, s = self._run, self._settings
        yaw_rate = window.yaw_rate / window.count
        noise = float(s.sensors.angular_rate_std) / math.sqrt(window.count)
        # Smooth what may be noise; follow what is more.
        gain = min(max(0.25 * abs(yaw_rate - run.yaw_rate) / max(noise, 1e-6), 0.25), 1.0)
        run.yaw_rate += gain * (yaw_rate - run.yaw_rate)
        # Nose-up rotation over travel, both forgotten over the length of the rover.
        travel = float(self._filter.mean[SPEED]) * dt
        keep = math.exp(-abs(travel) / max(self._curvature_length, 0.1))
        run.turned_up = keep * run.turned_up - window.pitch_rate / window.count * dt
        run.turned_over = keep * run.turned_over + travel

    def _reference_known(self) -> bool:
        """Say whether a fix came within the last travel over which soil is learned."""
        run = self._run
        return run.reference_time is not None and run.time - run.reference_time < 20.0

    def _open_shear(self, std: float) -> None:
        """Widen the shear strength, where fixes will settle it again."""
        if self._reference_known():
            self._filter.widen(SHEAR_STRENGTH, std * std)

    def _note_turning(self, dt: float) -> None:
        """Open the shear strength where turning begins or ends: the contacts form anew."""
        run = self._run
        known = [abs(r) for r in run.rim_speed if r == r]
        fastest = max(known, default=0.0)
        if fastest <= self._low_rim:
            return
        side = min(abs(run.yaw_rate) * self._curvature_length / fastest, 1.0)
        run.side_slow += -math.expm1(-dt / 1.0) * (side - run.side_slow)
        change = abs(side - run.side_slow) - 0.05
        if change > 0.0:
            run.unrest = max(run.unrest, 1.5 * change * fastest)
            run.renewal = max(run.renewal, change)
        run.renewal *= math.exp(-fastest * dt / self._contact_length)
        run.side_motion = side

    def _yaw_std(self) -> float:
        """Return the standard deviation of the smoothed yaw rate [rad/s]."""
        sensors = self._settings.sensors
        per_cycle = max(float(sensors.imu_rate) * float(self._settings.filter.period), 1.0)
        noise = float(sensors.angular_rate_std) / math.sqrt(per_cycle)
        return math.hypot(0.4 * noise, float(sensors.angular_rate_bias_std))

    def _curvature(self) -> float:
        """Return slope gained per travel [rad/m]: front wheels may climb steeper ground."""
        over = self._run.turned_over
        if abs(over) < 0.1 * self._curvature_length:
            return 0.0
        return min(max(self._run.turned_up / over, -0.3), 0.3)

    def _loads(self) -> list[float]:
        """Return the wheel loads for the last specific force, pulls and torques [N]."""
        run, s = self._run, self._settings
        moment = [
            (torque if torque == torque else 0.0) - pull * r
            for torque, pull, r in zip(run.torque_now, run.pull, s.rim_radius, strict=True)
        ]
        loads = [float(w) for w in s.load.loads(run.force, run.pull, moment)]
        if any(run.unloaded):
            total = sum(loads)
            loads = [0.0 if off else w for w, off in zip(loads, run.unloaded, strict=True)]
            loads = [w * total / max(sum(loads), 1e-9) for w in loads]
        return loads

    def _follow_direction(self, rim: float | None) -> None:
        """Forget v / rim speed where the drive changes its direction (up becomes down)."""
        run = self._run
        if rim is None or abs(rim) < self._low_rim:
            return
        if run.starting:
            # The contact forms anew, and with it what the shear model gets wrong.
            run.starting = False
            self._open_shear(0.3)
        direction = 1.0 if rim > 0.0 else -1.0
        if direction != run.drive_direction:
            if run.drive_direction != 0.0:
                demand = direction * run.force[0] / max(run.force[2], 0.1)
                run.ratio = min(max(0.9 - demand, 0.2), 1.1)
            run.ratio_std = 0.3
            run.drive_direction = direction
            run.fresh_travel = 0.0

    def _predict(self, time: float, dt: float, rims: list[float], still: bool) -> None:
        run, s, layout = self._run, self._settings, self._layout
        x = self._filter.mean
        step = self._speed_step(time)
        size = layout.size
        mean = x.copy()
        F = np.eye(size)
        Q = np.zeros((size, size))
        if not still and not self._reference_known():
            step = self._lean_on_experience(step, dt)
        mean[SPEED] = step.speed_gain * x[SPEED] + step.bias_gain * x[GRAVITY_BIAS] + step.constant
        F[SPEED, SPEED] = step.speed_gain
        F[SPEED, GRAVITY_BIAS] = step.bias_gain
        Q[SPEED, SPEED] = step.variance
        # The residual of gravity changes as the rover drives over rough ground.
        leak = s.gravity * float(s.sensors.orientation_std)
        Q[GRAVITY_BIAS, GRAVITY_BIAS] = (1e-3**2 + (0.3 * leak) ** 2 * 0.1) * dt
        travel = 0.0
        if not still and dt > 0.0:
            travel = self._predict_wheels(x, mean, F, Q, dt, rims)
        run.fresh_travel += travel
        if travel > 0.0:
            walk = float(s.filter.soil_walk) ** 2 * travel
            learn = walk if self._reference_known() else 0.0
            forget = math.exp(-travel / 100.0)
            for index, walk_std in (
                (SHEAR_STRENGTH, 0.1),
                (SHEAR_MODULUS, 0.1),
                (SLIP_SINKAGE, 0.05),
            ):
                mean[index] *= forget
                F[index, index] = forget
                Q[index, index] = walk_std**2 * learn
            mean[CENTROID] *= forget
            F[CENTROID, CENTROID] = forget
            Q[CENTROID, CENTROID] = 0.05**2 * walk
            Q[MOUND, MOUND] = 0.05**2 * walk
            n = s.wheel_count
            k = layout.stiffness
            Q[k, k] = (0.15**2 + np.eye(n) * 0.3**2) * walk
            hold = math.exp(-travel / float(s.filter.shear_error_length))
            e = layout.shear_error
            mean[e] *= hold
            F[e, e] *= hold
            Q[e, e] = self._shear_error_covariance * (1.0 - hold * hold)
        self._filter.predict(mean, F, Q)

    def _lean_on_experience(self, step: SpeedStep, dt: float) -> SpeedStep:
        """Without fixes, let v / rim speed return to what such a slope usually takes.

        On deep or saturated contacts torque and pull hardly change with slip. There the posterior
        is the prior, and a random walk is no prior: it ends anywhere.
        """
        run = self._run
        rim = self._representative_rim(run.yaw_rate)
        if rim is None or abs(rim) < self._low_rim:
            return step
        demand = run.drive_direction * run.force[0] / max(run.force[2], 0.1)
        usual = 1.0 - min(max(_USUAL_SLIP + (1.2 if demand > 0.0 else 0.4) * demand, -0.2), 0.8)
        keep = math.exp(-abs(rim) * dt / _USUAL_LENGTH)
        return SpeedStep(
            keep * step.speed_gain,
            keep * step.bias_gain,
            keep * step.constant + (1.0 - keep) * usual * rim,
            keep * keep * step.variance + (1.0 - keep * keep) * (_USUAL_STD * rim) ** 2,
        )

    def _predict_wheels(
        self,
        x: FloatArray,
        mean: FloatArray,
        F: FloatArray,
        Q: FloatArray,
        dt: float,
        rims: list[float],
    ) -> float:
        """Let each sinkage relax towards where the bearing law carries the load; return travel."""
        run, s, layout = self._run, self._settings, self._layout
        travels = []
        for i, rim in enumerate(rims):
            zi, ki = layout.sinkage.start + i, layout.stiffness.start + i
            if rim != rim or abs(rim) < s.rest_speed:
                Q[zi, zi] = 1e-10 * dt
                continue
            direction = 1.0 if rim > 0.0 else -1.0
            speed = direction * (float(x[SPEED]) - run.yaw_rate * s.lateral[i])
            rim = abs(rim)
            ratio = speed / rim
            slip = slip_of_speed_ratio(ratio)
            travels.append(abs(speed) + 0.1 * abs(rim - speed))
            z, load = float(x[zi]), run.load[i]
            if load <= 1e-3:
                Q[zi, zi] = 1e-4 * dt
                continue
            contact_length = max(math.sqrt(2.0 * s.rim_radius[i] * max(z, 1e-3)), 0.02)
            alpha = -math.expm1(-(abs(speed) + 0.3 * abs(rim - speed)) * dt / contact_length)
            soil = (
                float(x[SHEAR_STRENGTH]),
                float(x[SHEAR_MODULUS]),
                float(x[ki]),
                float(x[SLIP_SINKAGE]),
                self._leaving(i),
            )
            bearing = self._models.bearing(i, ratio, z, load, *soil)
            slower = self._models.bearing(i, ratio - 0.02, z, load, *soil)
            # One Newton step on log load over log sinkage, bounded: relaxation does the rest.
            power = bearing.exponent + 0.5
            growth = min(max(math.log(load / bearing.load) / power, -0.7), 0.7)
            z_floor = max(z, 5e-4)
            # No steady state where the wheel stands and digs: the sensor leads.
            trust = min(max((0.95 - slip) / 0.15, 0.0), 1.0)
            target = z_floor * math.exp(growth)
            mean[zi] = z + trust * alpha * (target - z)
            if trust < 1.0:
                # It digs at its own pace: carry on with the rate seen last.
                mean[zi] += 0.9 * (1.0 - trust) * max(run.sinkage_rate[i], 0.0) * dt
            sensitivity = trust * alpha * target / power
            F[zi, zi] = max(1.0 - trust * alpha * 0.9, 0.05)
            F[zi, ki] = -sensitivity
            F[zi, SLIP_SINKAGE] = -sensitivity * slip * bearing.log_depth
            by_ratio = math.log(bearing.load / slower.load) / 0.02
            F[zi, SPEED] = -sensitivity * by_ratio * direction / rim
            # What the law does not know: a tenth of the sinkage per contact length, and digging.
            digging = 0.05 * max(slip, 0.0) ** 2 * rim * dt
            Q[zi, zi] = (0.1 * z_floor) ** 2 * 2.0 * alpha + digging**2 + 1e-9 * dt
        return dt * math.fsum(travels) / len(rims) if travels else 0.0

    def _leaving(self, wheel: int) -> float:
        run = self._run
        return run.leaving_angle[wheel] if run.time - run.leaving_time[wheel] < 1.0 else _NAN

    def _fuse_reference(self, time: float, reference: ReferenceVelocity, still: bool) -> None:
        run, s = self._run, self._settings
        sensors = s.sensors
        variance = (
            reference.variance if reference.variance > 0.0 else float(sensors.reference_std) ** 2
        )
        variance = max(variance, float(sensors.reference_std_floor) ** 2)
        if run.reference_time is not None:
            gap = min(time - run.reference_time, 10.0)
            run.reference_gap += 0.3 * (gap - run.reference_gap)
        x, P = self._filter.mean, self._filter.covariance
        if still:
            # Wheels that stand: either the fix agrees with rest, or the rover slides on them.
            moving = abs(reference.forward) > max(3.0 * math.sqrt(variance), 2.0 * s.rest_speed)
            if moving:
                run.sliding_until = time + max(2.0 * run.reference_gap, 1.0)
                self._filter.widen(SPEED, reference.forward**2)
            else:
                run.sliding_until = time
        residual = reference.forward - float(x[SPEED])
        total = float(P[SPEED, SPEED]) + variance
        nis = residual * residual / total
        self._note_nis('reference', nis)
        gate = float(s.filter.gate)
        if nis > gate:
            run.reference_rejected += 1
            run.rejected['reference'] += 1
            fastest = max((abs(r) for r in run.rim_speed if r == r), default=0.0)
            beyond = abs(reference.forward) > 1.5 * fastest + 5.0 * math.sqrt(total)
            same = abs(residual - run.reference_doubt) < 4.0 * math.sqrt(2.0 * variance + total)
            run.reference_doubt = residual
            if run.reference_rejected >= 2 and same and not (beyond and run.reference_rejected < 4):
                # Fixes that keep disagreeing are right: open the state to them.
                self._filter.widen(SPEED, residual * residual)
                run.reference_rejected = 0
            else:
                variance += chi_square_gate(residual, total, 4.0 if not beyond else 0.01)
        else:
            run.reference_rejected = 0
            if nis > _FAIR_NIS:
                # More than chance, less than an outlier: the prediction was too sure of itself.
                self._filter.widen(SPEED, residual * residual / _FAIR_NIS - total)
        H = np.zeros((1, self._layout.size))
        H[0, SPEED] = 1.0
        self._filter.update(np.array([residual]), H, np.array([variance]))
        run.reference_time = time

    def _fuse_rest(self, time: float, rims: list[float], rim: float | None, still: bool) -> None:
        run, s = self._run, self._settings
        if not still:
            run.still_since = None
            spread = [abs(r) for r in rims if r == r]
            typical = sum(spread) / len(spread) if spread else 0.0
            if rim is not None and typical > s.rest_speed and abs(rim) < 0.2 * typical:
                # Spin in place: the body stays where it is, to a share of the rim speed.
                self._fuse_speed(0.0, max(typical, 0.002) ** 2)
            return
        if run.still_since is None:
            run.still_since = time
        if time < run.sliding_until:
            return
        x, P = self._filter.mean, self._filter.covariance
        settled = time - run.still_since
        if settled < 0.15:
            return
        variance = 0.0005**2
        if settled < 2.0:
            # A fast rover slides on for a moment: do not stop it against the accelerometer.
            variance += chi_square_gate(float(x[SPEED]), float(P[SPEED, SPEED]) + variance, 9.0)
        self._fuse_speed(0.0, variance)
        if settled > 0.5 and run.window.count and abs(run.yaw_rate) < 0.05:
            weight = min(run.yaw_bias_weight + 1.0, 200.0)
            run.yaw_bias += run.yaw_rate / weight
            run.yaw_bias_weight = weight

    def _fuse_speed(self, value: float, variance: float) -> None:
        H = np.zeros((1, self._layout.size))
        H[0, SPEED] = 1.0
        residual = np.array([value - float(self._filter.mean[SPEED])])
        self._filter.update(residual, H, np.array([variance]))

    def _distrusted(self, channel: str, variance: float) -> float:
        """Return the variance of a channel whose residuals keep being larger than foreseen."""
        return variance * max(self._run.nis.get(channel, 1.0), 1.0) ** 2

    def _note_nis(self, channel: str, nis: float) -> None:
        nis_of = self._run.nis
        nis_of[channel] = 0.95 * nis_of.get(channel, 1.0) + 0.05 * min(nis, 100.0)

    def _fuse_models(self, dt: float, rims: list[float], still: bool) -> None:
        """Fuse sinkage, torque and the balance of forces, h and H from one pass."""
        run, s, layout = self._run, self._settings, self._layout
        x, P = self._filter.mean, self._filter.covariance
        n, size = s.wheel_count, layout.size
        gate = float(s.filter.gate)
        residuals: list[float] = []
        variances: list[float] = []
        rows: list[FloatArray] = []

        for i in range(n):
            count = run.sinkage_count[i]
            if not count:
                continue
            reading = run.sinkage_sum[i] / count
            run.sinkage_sum[i], run.sinkage_count[i] = 0.0, 0
            zi = layout.sinkage.start + i
            variance = float(s.sensors.sinkage_std) ** 2 / count + 1e-10
            residual = reading - float(x[zi])
            total = float(P[zi, zi]) + variance
            nis = residual * residual / total
            if not run.sinkage_seen[i]:
                run.sinkage_seen[i] = True
            elif nis > gate:
                run.rejected['sinkage'] += 1
                run.sinkage_rejected[i] += 1
                if run.sinkage_rejected[i] < 8:
                    continue
                # So many in a row are no spikes: the wheel is somewhere else.
                self._filter.widen(zi, residual * residual)
            run.sinkage_rejected[i] = 0
            self._note_nis('sinkage', min(nis, gate))
            run.sinkage_time = run.time
            row = np.zeros(size)
            row[zi] = 1.0
            residuals.append(residual)
            variances.append(variance)
            rows.append(row)

        torque = [
            run.torque_sum[i] / run.torque_count[i] if run.torque_count[i] else _NAN
            for i in range(n)
        ]
        for i in range(n):
            if run.torque_count[i]:
                run.torque_held[i] = torque[i]
            run.torque_sum[i], run.torque_count[i] = 0.0, 0
        self._watch_torques(dt, torque, rims)
        if still:
            run.fresh_travel = 0.0
            run.starting = True
            run.torque_slope = [_NAN] * n
            run.pull_slope = [_NAN] * n
        elif run.fresh_travel > self._contact_length:
            self._model_rows(rims, torque, residuals, variances, rows)
        if rows:
            # Without fixes slip and shear strength are not told apart: do not let them drift.
            held = () if self._reference_known() else (SHEAR_STRENGTH, SHEAR_MODULUS)
            self._filter.update(
                np.array(residuals), np.array(rows), np.array(variances), considered=held
            )
        run.window = InertialWindow()

    def _watch_torques(self, dt: float, torque: list[float], rims: list[float]) -> None:
        """Find wheels that carry nothing, and sudden changes of what the wheels must give."""
        run, s = self._run, self._settings
        rolling = [
            i
            for i, rim in enumerate(rims)
            if rim == rim and abs(rim) > self._low_rim and torque[i] == torque[i]
        ]
        if len(rolling) < 2:
            if any(value == value for value in torque):
                run.effort = [_NAN, _NAN]
                run.unloaded = [False] * s.wheel_count
            return
        dt, run.effort_time = run.time - run.effort_time, run.time
        typical_torque = median([torque[i] for i in rolling])
        typical_rim = median([rims[i] for i in rolling])
        fastest = max(abs(rims[i]) for i in rolling)
        noise = float(s.sensors.torque_std) + float(s.sensors.torque_zero_std)
        telling = abs(typical_torque) > 5.0 * noise and run.side_motion < 0.1
        for i in rolling:
            share = torque[i] / typical_torque if telling else 1.0
            free = telling and abs(share) < 0.2 and rims[i] / typical_rim > 0.95
            if run.unloaded[i]:
                free = not telling or share < 0.4
            if free == run.unloaded[i]:
                run.unloaded_since[i] = _NAN
            elif run.unloaded_since[i] != run.unloaded_since[i]:
                run.unloaded_since[i] = run.time
            elif run.time - run.unloaded_since[i] > _UNLOADED_HOLD:
                run.unloaded[i], run.unloaded_since[i] = free, _NAN
        carrying = [i for i in rolling if not run.unloaded[i]]
        weight = sum(run.load[i] * s.shear_radius[i] for i in carrying)
        if weight <= 0.0:
            return
        effort = sum(math.copysign(torque[i], torque[i] * rims[i]) for i in carrying) / weight
        fast, slow = run.effort
        if fast != fast or dt <= 0.0:
            run.effort = [effort, effort]
            return
        fast += -math.expm1(-dt / 0.15) * (effort - fast)
        slow += -math.expm1(-dt / 1.0) * (effort - slow)
        run.effort = [fast, slow]
        noise = float(s.sensors.torque_std) * math.sqrt(len(carrying)) / weight
        excess = abs(fast - slow) - 3.0 * noise * 0.5
        if excess > 0.0 and run.steepness > 0.0:
            change = min(_EFFORT_GAIN * excess / max(run.steepness, 0.1), 0.4)
            run.unrest = max(run.unrest, change * fastest)

    def _model_rows(
        self,
        rims: list[float],
        torque: list[float],
        residuals: list[float],
        variances: list[float],
        rows: list[FloatArray],
    ) -> None:
        run, s, layout = self._run, self._settings, self._layout
        x, P = self._filter.mean, self._filter.covariance
        size = layout.size
        balance = np.zeros(size)
        balance_sum = 0.0
        open_variance = 0.0
        jacobian, jacobian_torque = np.zeros((2, s.wheel_count, size))
        pulls, torques = np.zeros((2, s.wheel_count))
        gate = float(s.filter.gate)
        # After a start the shear builds up over the contact length.
        fresh = 2.5 * math.exp(-2.0 * (run.fresh_travel / self._contact_length - 1.0))
        for i, rim in enumerate(rims):
            load = run.load[i]
            run.stand_pull[i] = _NAN
            if rim == rim and abs(rim) < 2.0 * s.rest_speed and load >= 1e-3:
                pull = self._dragged_pull(i, torque[i], load)
                if pull == pull:
                    run.stand_pull[i] = pull
                    balance_sum += pull
                    unsure = 0.1 + float(s.sensors.torque_gain_std)
                    open_variance += (unsure * load) ** 2
                    continue
            if rim != rim or abs(rim) < 2.0 * s.rest_speed or load < 1e-3:
                # Standing, lifted or unknown: it may carry its share of the slope, or nothing.
                share = load * run.force[0] / max(run.force[2], 0.1)
                balance_sum += share
                open_variance += (0.3 * load) ** 2
                continue
            direction = 1.0 if rim > 0.0 else -1.0
            pull, torque_model, row_pull, row_torque = self._wheel_rows(i, rim, direction)
            jacobian[i], jacobian_torque[i] = row_pull, row_torque
            pulls[i], torques[i] = pull, torque_model
            # Turning shears the soil sideways too, which the model does not know: ten cycles of
            # it are one piece of information.
            side = abs(run.yaw_rate) * self._curvature_length / abs(rim)
            scrub = 10.0 * min(side + run.renewal, 1.0) ** 2 + fresh
            open_variance += scrub * (0.1 * load) ** 2
            balance += row_pull
            balance_sum += pull
            reading = torque[i]
            if reading == reading:
                variance = (
                    float(s.sensors.torque_std) ** 2
                    + (s.load_std**2 + scrub) * torque_model**2
                    + 1e-6
                )
                residual = reading - torque_model
                total = float(row_torque @ P @ row_torque) + variance
                nis = residual * residual / total
                self._note_nis('torque', nis)
                # A soil change looks like an outlier: weaken it, do not lock it out.
                variance = self._distrusted('torque', variance)
                variance += chi_square_gate(residual, total, gate)
                residuals.append(residual)
                variances.append(variance)
                rows.append(row_torque)
        self._jacobian_pull = jacobian
        self._linear = (x.copy(), pulls, jacobian_torque, torques)
        self._set_ratio_walk(jacobian, rims)
        if run.force_known and run.window.count:
            weight = s.mass * run.force[2]
            tilt = 0.0
            for i, gain in enumerate(s.rut_tilt):
                zi = layout.sinkage.start + i
                tilt += gain * float(x[zi])
                # Specific force along the ground: f_x - f_z * tilt (body pitched up by the ruts).
                balance[zi] += weight * gain
            # On curved ground the wheels' own slopes differ from the body's.
            uphill = self._curvature() * sum(
                w * x_i for w, x_i in zip(run.load, s.longitudinal, strict=True)
            )
            residual = s.mass * run.force[0] - (balance_sum + weight * tilt - uphill)
            noise = float(s.sensors.specific_force_std) ** 2 / run.window.count
            variance = (
                s.mass**2 * (noise + float(s.sensors.specific_force_bias_std) ** 2)
                + (_BALANCE_STD * weight) ** 2
                + open_variance
            )
            total = float(balance @ P @ balance) + variance
            nis = residual * residual / total
            self._note_nis('balance', nis)
            variance = self._distrusted('balance', variance)
            variance += chi_square_gate(residual, total, gate)
            residuals.append(residual)
            variances.append(variance)
            rows.append(balance)

    def _dragged_pull(self, i: int, torque: float, load: float) -> float:
        """Return the pull of a wheel that stands while the rover moves, from its torque [N].

        A locked wheel slides: its shear is saturated, and torque gives the pull whatever the
        strength of the soil. Where its hub stands too, torque and pull balance about the hub.
        """
        run, s, layout = self._run, self._settings, self._layout
        x = self._filter.mean
        speed = float(x[SPEED]) - run.yaw_rate * s.lateral[i]
        if torque != torque:
            return _NAN
        if abs(speed) < 2.0 * s.rest_speed:
            return min(max(torque / s.shear_radius[i], -load), load)
        direction = 1.0 if speed > 0.0 else -1.0
        forces = self._models.forces(
            i,
            3.0,
            float(x[layout.sinkage.start + i]),
            load,
            float(x[SHEAR_STRENGTH]),
            float(x[SHEAR_MODULUS]),
            float(x[CENTROID]),
            0.0,
            _NAN,
            _NAN,
        )
        gain = forces.d_pull[2] / forces.d_torque[2] if forces.d_torque[2] else 0.0
        pull = forces.pull + gain * (direction * torque - forces.torque)
        return direction * min(max(pull, -1.2 * load), load)

    def _set_ratio_walk(self, jacobian: FloatArray, rims: list[float]) -> None:
        """Let the slip walk as what the ground asks does, over the slope of the traction curve.

        Where the curve is steep, a change of demand changes the slip little; on the plateau the
        same change makes the rover dig in.
        """
        run, s = self._run, self._settings
        steepness = sum(
            float(jacobian[i, SPEED]) * abs(rim) for i, rim in enumerate(rims) if rim == rim
        ) / max(sum(run.load), 1e-3)
        least, most = float(s.filter.ratio_walk_least), float(s.filter.ratio_walk)
        run.steepness = max(-steepness, 1e-3)
        walk = float(s.filter.demand_walk) / run.steepness
        run.ratio_walk = min(max(walk, least), most)

    def _wheel_rows(
        self, i: int, rim: float, direction: float
    ) -> tuple[float, float, FloatArray, FloatArray]:
        """Return pull, torque and their rows of the Jacobian, in the body's signs."""
        layout = self._layout
        zi, ei = layout.sinkage.start + i, layout.shear_error.start + i
        forces = self._forces(i, rim, direction)
        slopes = self._smooth_slopes(i, forces)
        row_pull, row_torque = np.zeros(layout.size), np.zeros(layout.size)
        for row, derivatives, by_ratio in (
            (row_pull, forces.d_pull, slopes[1]),
            (row_torque, forces.d_torque, slopes[0]),
        ):
            _, by_sinkage, by_strength, by_modulus, by_centroid, by_mound = derivatives
            # The ratio is that of the direction of rolling: the two signs cancel.
            row[SPEED] = by_ratio / abs(rim)
            row[zi] = direction * by_sinkage
            row[SHEAR_STRENGTH] = row[ei] = direction * by_strength
            row[SHEAR_MODULUS] = direction * by_modulus
            row[CENTROID] = direction * by_centroid
            row[MOUND] = direction * by_mound
        return direction * forces.pull, direction * forces.torque, row_pull, row_torque

    def _smooth_slopes(self, i: int, forces: WheelForces) -> tuple[float, float]:
        """Return dT and dF by v/(r w), smoothed over about a second.

        The curves bend within the uncertainty of the slip. A slope taken at the noisy estimate is
        correlated with its error, which pulls the slip to the flat side; a smoothed one is not.
        """
        run = self._run
        keep = _SLOPE_KEEP
        for smoothed, new in (
            (run.torque_slope, forces.d_torque[0]),
            (run.pull_slope, forces.d_pull[0]),
        ):
            old = smoothed[i]
            # The first slopes after a start are taken where the slip is known least: begin flat.
            smoothed[i] = 0.2 * new if old != old else keep * old + (1.0 - keep) * new
        return run.torque_slope[i], run.pull_slope[i]

    def _forces(self, i: int, rim: float, direction: float) -> WheelForces:
        """Return the forces of a turning wheel at the present state, in its own direction."""
        run, s, layout = self._run, self._settings, self._layout
        x = self._filter.mean
        v = direction * (float(x[SPEED]) - run.yaw_rate * s.lateral[i])
        return self._models.forces(
            i,
            v / abs(rim),
            float(x[layout.sinkage.start + i]),
            run.load[i],
            float(x[SHEAR_STRENGTH] + x[layout.shear_error.start + i]),
            float(x[SHEAR_MODULUS]),
            float(x[CENTROID]),
            float(x[MOUND]),
            abs(rim),
            self._leaving(i),
        )

    def _after(
        self,
        time: float,
        dt: float,
        rim: float | None,
        rims: list[float],
        still: bool,
        sinkage_before: FloatArray,
    ) -> None:
        """Keep what the next cycle needs, work out pulls and sinkage rates."""
        run, s, layout = self._run, self._settings, self._layout
        x, P = self._filter.mean, self._filter.covariance
        run.unrest *= math.exp(-dt / 0.3)
        run.cycle_time = time
        run.rim_at_cycle = rim
        settled = run.fresh_travel > self._contact_length
        if rim is not None and abs(rim) > 2.0 * self._low_rim and settled:
            run.ratio = min(max(float(x[SPEED]) / rim, -0.5), 2.0)
            run.ratio_std = min(max(math.sqrt(float(P[SPEED, SPEED])) / abs(rim), 0.1), 0.5)
        if dt > 0.0:
            keep = math.exp(-dt / 0.5)
            change = (x[layout.sinkage] - sinkage_before) / dt
            for i in range(s.wheel_count):
                run.sinkage_rate[i] += (1.0 - keep) * (float(change[i]) - run.sinkage_rate[i])
                zi = layout.sinkage.start + i
                run.sinkage_rate_std[i] = math.sqrt(2.0 * float(P[zi, zi])) / 1.0
        self._floor_speed_variance(rims)
        self._pulls(rims)

    def _floor_speed_variance(self, rims: list[float]) -> None:
        """Keep a least slip deviation: no set of soil models is better than that."""
        typical = sum(abs(r) for r in rims if r == r) / len(rims)
        least = (
            typical * (_LEAST_SLIP_STD + _LEAST_TURNING_STD * min(self._run.side_motion, 1.0))
        ) ** 2
        lacking = least - float(self._filter.covariance[SPEED, SPEED])
        if lacking > 0.0:
            self._filter.widen(SPEED, lacking)

    def _pulls(self, rims: list[float]) -> None:
        """Work out pulls and torques after the update, to first order from the last pass."""
        run, s = self._run, self._settings
        x, P = self._filter.mean, self._filter.covariance
        slope_share = run.force[0] / max(run.force[2], 0.1)
        zero = float(s.sensors.torque_zero_std)
        gain = float(s.sensors.torque_gain_std)
        linear, self._linear = self._linear, None
        if linear is not None:
            before, pulls, jacobian_torque, torques = linear
            moved = x - before
            pulls = pulls + self._jacobian_pull @ moved
            torques = torques + jacobian_torque @ moved
            spread = np.einsum('ij,jk,ik->i', self._jacobian_pull, P, self._jacobian_pull)
        for i, rim in enumerate(rims):
            load = run.load[i]
            turning = rim == rim and abs(rim) >= 2.0 * s.rest_speed and load >= 1e-3
            if not turning:
                # Static friction carries the slope, or it is dragged along.
                pull = run.stand_pull[i]
                run.pull[i] = pull if pull == pull else load * slope_share
                run.torque_now[i] = run.pull[i] * s.rim_radius[i]
                run.pull_std[i] = (0.1 * load if run.force_known else load) + 1e-3
                continue
            if linear is None:
                # The contact is fresh after a start: the load's share is the best guess.
                run.pull[i] = load * slope_share
                run.pull_std[i] = 0.1 * load + 1e-3
                continue
            # First order from far away overshoots: no soil gives more than the load.
            radius = s.shear_radius[i]
            run.pull[i] = min(max(float(pulls[i]), -load), load)
            most = 1.2 * load * radius
            run.torque_now[i] = min(max(float(torques[i]), -most), most)
            run.pull_std[i] = math.sqrt(
                max(float(spread[i]), 0.0)
                + (s.load_std * run.pull[i]) ** 2
                + (zero / radius) ** 2
                + (0.5 * gain * run.torque_now[i] / radius) ** 2
                + (0.01 * load) ** 2
                # Soil piled up by a wheel that hardly moves is in no model.
                + (_PILED_STD * max(run.slip[i] - 0.6, 0.0) / 0.4 * load) ** 2
            )

    # ------------------------------------------------------------------ slip, classes, warning

    def _judge(self, time: float) -> None:
        run, s = self._run, self._settings
        speed, variance = self._current_speed()
        speed_std = math.sqrt(max(variance, 0.0))
        yaw = run.yaw_rate
        yaw_std = self._yaw_std()
        rate_std = float(s.sensors.wheel_rate_std)
        motion = []
        stopped = run.still_since is not None and time >= run.sliding_until
        for i in range(s.wheel_count):
            rim = self._rim(i)
            v = speed - yaw * s.lateral[i]
            v_std = math.hypot(speed_std, yaw_std * s.lateral[i])
            if stopped and abs(speed) < s.rest_speed:
                # All wheels stand: what the gyro says beside them is noise.
                v, v_std = 0.0, 0.0
            if rim != rim:
                run.slip_std[i] = min(run.slip_std[i] + 0.02, 1.0)
                run.resting[i] = False
                run.wheel_class[i] = self._classifier.unknown(i)
            else:
                self._slip_of_wheel(i, time, rim, v, v_std, rate_std)
            limit = s.torque_limit[i]
            torque = run.torque_held[i]
            motion.append(
                WheelMotionState(
                    slip=run.slip[i],
                    slip_std=run.slip_std[i],
                    rim_speed=rim if rim == rim else 0.0,
                    known=rim == rim and not run.resting[i] and abs(rim) > s.rest_speed,
                    torque_share=abs(torque) / limit if limit > 0.0 else _NAN,
                    sinkage=float(self._filter.mean[self._layout.sinkage.start + i]),
                    radius=s.rim_radius[i],
                )
            )
        known = run.reference_time is not None and time - run.reference_time < 10.0
        run.assessment = self._monitor.update(
            time,
            speed,
            known,
            motion,
            turning=run.side_motion > 0.3,
            margin=self._margin_share(),
        )
        if time - run.margin_time >= 1.0:
            run.margin_time = time
            self._margins()

    def _slip_of_wheel(
        self, i: int, time: float, rim: float, v: float, v_std: float, rate_std: float
    ) -> None:
        run, s = self._run, self._settings
        rest = s.rest_speed
        if abs(rim) < rest and abs(v) < max(rest, 2.0 * v_std):
            if run.rest_since[i] != run.rest_since[i]:
                run.rest_since[i] = time
            run.resting[i] = time - run.rest_since[i] >= s.rest_time - 1e-6
            if run.resting[i]:
                run.wheel_class[i] = self._classifier.unknown(i)
            # Slip holds its last value.
            return
        run.rest_since[i] = _NAN
        run.resting[i] = False
        sliding_back = False
        if abs(rim) <= rest:
            slip, slip_std = -1.0, v_std / max(abs(v), rest)
        elif v * rim < 0.0:
            slip, slip_std = 1.0, v_std / abs(rim)
            # Told from standing still only where it is more than noise.
            sliding_back = abs(v) > max(rest, v_std)
        elif abs(v) <= abs(rim):
            slip = 1.0 - v / rim
            slip_std = math.hypot(v_std / rim, (1.0 - slip) * rate_std * s.slip_radius[i] / rim)
        else:
            slip = rim / v - 1.0
            slip_std = math.hypot(v_std * rim / (v * v), rate_std * s.slip_radius[i] / v)
        # Turning scrubs the soil sideways, which no model here knows.
        slip_std = math.hypot(slip_std, _TURNING_SLIP_STD * run.side_motion)
        run.slip[i], run.slip_std[i] = slip, min(max(slip_std, 1e-3), 1.0)
        run.wheel_class[i] = self._classifier.update(i, time, slip, slip_std, sliding_back)

    def _margin_share(self) -> float:
        """Return the pull left over, as a share of the load; nan where torque does not tell."""
        run, s = self._run, self._settings
        told = run.torque_time is not None and run.time - run.torque_time < 2.0
        if not told or run.margin_time < 0.0 or float(s.sensors.torque_gain_std) > 0.3:
            return _NAN
        return sum(run.pull_margin) / max(sum(run.load), 1e-3)

    def _margins(self) -> None:
        """Greatest pull that the present soil gives each wheel minus what the slope asks [N]."""
        run, s, layout = self._run, self._settings, self._layout
        x = self._filter.mean
        for i in range(s.wheel_count):
            load = run.load[i]
            if load < 1e-3:
                run.pull_margin[i] = 0.0
                continue
            strength = float(x[SHEAR_STRENGTH] + x[layout.shear_error.start + i])
            best = max(
                self._models.forces(
                    i,
                    1.0 - slip,
                    float(x[layout.sinkage.start + i]),
                    load,
                    strength,
                    float(x[SHEAR_MODULUS]),
                    float(x[CENTROID]),
                    float(x[MOUND]),
                    _NAN,
                    _NAN,
                ).pull
                for slip in (0.3, 0.6, 0.9)
            )
            direction = run.drive_direction or 1.0
            demand = direction * load * run.force[0] / max(run.force[2], 0.1)
            run.pull_margin[i] = best - demand

    # ------------------------------------------------------------------ outputs

    def estimates(self) -> EstimateSet:
        """Return all outputs at the present stamp; nothing changes."""
        run, s, layout = self._run, self._settings, self._layout
        n = s.wheel_count
        x, P = self._filter.mean, self._filter.covariance
        speed, variance = self._current_speed()
        rims = [self._rim(i) for i in range(n)]
        yaw_std = self._yaw_std()
        slip_velocity, slip_velocity_std = [], []
        for i in range(n):
            rim = rims[i]
            v = speed - run.yaw_rate * s.lateral[i]
            known = rim == rim
            slip_velocity.append(rim - v if known else 0.0)
            std = math.sqrt(max(variance, 0.0) + (yaw_std * s.lateral[i]) ** 2)
            rate = float(s.sensors.wheel_rate_std) * s.slip_radius[i]
            slip_velocity_std.append(math.hypot(std, rate) if known else 1.0)
        sinkage = x[layout.sinkage]
        zero = float(s.sensors.sinkage_zero_std)
        sinkage_std = np.sqrt(np.maximum(np.diagonal(P)[layout.sinkage], 0.0) + zero**2)
        assessment = run.assessment or self._monitor.update(run.time, speed, False, [])
        names, soil, soil_std = self._soil()
        lost = [w if w > 0 else 1.0 for w in run.load]
        return EstimateSet(
            stamp=run.stamp,
            slip=np.array(run.slip),
            slip_std=np.array(run.slip_std),
            slip_velocity=np.array(slip_velocity),
            slip_velocity_std=np.array(slip_velocity_std),
            drawbar_pull=np.array(run.pull),
            drawbar_pull_std=np.minimum(np.array(run.pull_std), np.array(lost)),
            sinkage=sinkage.copy(),
            sinkage_std=np.minimum(sinkage_std, s.rim_radius),
            sinkage_rate=np.array(run.sinkage_rate),
            sinkage_rate_std=np.array(run.sinkage_rate_std),
            normal_load=np.array(run.load),
            normal_load_std=np.array(
                [s.load_std * sum(run.load) / n if run.force_known else w for w in run.load]
            ),
            slip_class=np.array(run.wheel_class, dtype=np.uint8),
            rim_travel_left=np.array(assessment.rim_travel_left or [10.0] * n),
            pull_margin=np.array(run.pull_margin),
            soil_names=names,
            soil=soil,
            soil_std=soil_std,
            forward_velocity=speed,
            forward_velocity_variance=max(variance, 1e-12),
            yaw_rate=run.yaw_rate,
            yaw_rate_variance=yaw_std**2 if run.force_known else 1.0,
            stuck=assessment.stuck,
            stuck_probability=np.array(assessment.probability or [0.0] * n),
            time_to_stuck=np.array(assessment.time_to_stuck or [600.0] * n),
            reasons=self._reasons(assessment),
            faults=self._faults(),
        )

    def _soil(self) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
        x, P = self._filter.mean, self._filter.covariance
        soil, k = self._configuration.soil, self._layout.stiffness
        strength = math.exp(float(x[SHEAR_STRENGTH]))
        strength_std = math.sqrt(float(P[SHEAR_STRENGTH, SHEAR_STRENGTH]))
        tangent = math.tan(float(soil.friction_angle)) * strength
        angle = math.degrees(math.atan(tangent))
        angle_std = math.degrees(tangent * strength_std / (1.0 + tangent * tangent))
        cohesion = float(soil.cohesion) * strength
        modulus = float(soil.shear_modulus) * math.exp(float(x[SHEAR_MODULUS]))
        stiffness = math.exp(float(x[k].mean()))
        stiffness_std = math.sqrt(max(float(P[k, k].mean()), 0.0))
        entries = (
            ('soil.friction_angle_deg', angle, angle_std),
            ('soil.cohesion', cohesion, cohesion * strength_std),
            (
                'soil.shear_modulus',
                modulus,
                modulus * math.sqrt(float(P[SHEAR_MODULUS, SHEAR_MODULUS])),
            ),
            (
                'soil.frictional_modulus',
                float(soil.frictional_modulus) * stiffness,
                float(soil.frictional_modulus) * stiffness * stiffness_std,
            ),
            (
                'soil.cohesive_modulus',
                float(soil.cohesive_modulus) * stiffness,
                abs(float(soil.cohesive_modulus)) * stiffness * stiffness_std,
            ),
        )
        return (
            tuple(e[0] for e in entries),
            np.array([e[1] for e in entries]),
            np.array([e[2] for e in entries]),
        )

    def _reasons(self, assessment: StuckAssessment) -> tuple[str, ...]:
        run, s = self._run, self._settings
        words = []
        for i in range(s.wheel_count):
            rim = self._rim(i)
            if rim != rim:
                text = 'no wheel rate'
            elif assessment.stalled and assessment.stalled[i]:
                text = 'stalled: torque near its limit, hardly turning while others turn'
            elif run.resting[i]:
                text = 'at rest'
            else:
                text = f'slip {run.slip[i]:.2f} +- {run.slip_std[i]:.2f}'
            if assessment.stuck and assessment.reason:
                text += f'; rover: {assessment.reason}'
            words.append(text)
        return tuple(words)

    def _faults(self) -> dict[str, str]:
        run, s = self._run, self._settings
        faults: dict[str, str] = {}
        stale = s.silence
        if run.odometry_time is None or run.time - run.odometry_time > stale:
            faults['wheel_odometry'] = 'no wheel odometry: slip held'
        if run.inertial_time is None or run.time - run.inertial_time > stale:
            faults['imu'] = 'no IMU: loads of level ground, no balance of forces'
        elif not run.attitude.reported:
            faults['orientation'] = 'no orientation: slope from gyro and specific force'
        if run.torque_time is None or run.time - run.torque_time > 2.0:
            faults['torque'] = 'no torque: pull from the balance of forces and the soil model'
        if run.sinkage_time is None or run.time - run.sinkage_time > 2.0:
            faults['sinkage'] = 'no sinkage: held by its model'
        if run.reference_time is None or run.time - run.reference_time > 20.0:
            faults['reference'] = 'no reference velocity: slip from forces and soil model'
        return faults

    def health(self) -> dict[str, Any]:
        """Return counters and consistency figures for diagnostics."""
        run = self._run
        report: dict[str, Any] = {f'rejected_{k}': v for k, v in run.rejected.items()}
        report['filter_restarts'] = self._filter.restarts
        for channel, value in run.nis.items():
            report[f'nis_{channel}'] = round(value, 3)
        return report
