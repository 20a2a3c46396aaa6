# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Special treatments of the estimator, each with the way to switch it off.

What only stands in for a sensor that is not there (yaw rate of the wheels without a gyro, loads of
level ground without an accelerometer) is no treatment of this list.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from wheel_terra_estimator.estimation.contacts.turning import Turning
from wheel_terra_estimator.estimation.filter.observability import considered_entries
from wheel_terra_estimator.estimation.filter.soil_process import SoilProcess
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.estimation.judgement.stuck.monitor import StuckMonitor
from wheel_terra_estimator.estimation.judgement.stuck.situation import SituationObserver
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import NAN, median
from wheel_terra_lab.studies.ablations.drives import Drive
from wheel_terra_lab.studies.ablations.switches import Switch, both, patched, tuned, without_sign

NEVER = 1e9
INPUTS = frozenset(('reference', 'torque', 'sinkage'))


@dataclass(frozen=True)
class Treatment:
    """One special treatment.

    Attributes
    ----------
    name, group : str
        In the table.
    off : Switch
        Switches it off.
    needs : str
        Tags of the drives on which it can act, all of them; none: on all.
    warning_only : bool
        Whether it can change nothing but ``~/stuck``.
    """

    name: str
    group: str
    off: Switch
    needs: str = ''
    warning_only: bool = False

    @property
    def special(self) -> bool:
        """Whether it needs more than some of the sensors."""
        return not INPUTS.issuperset(self.needs.split())

    def acts_in(self, drive: Drive) -> bool:
        """Say whether a drive is one on which it can act and is to be tried."""
        tried = not drive.warning_only or self.warning_only or self.group == _GUARD
        return tried and drive.tags.issuperset(self.needs.split())


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _none_of_it(*_: Any, **__: Any) -> float:
    return 0.0


def _plain_row(self: Any, row: Any, prior: float) -> Any:
    return row


def _without_torque_zeros(rover: Rover, sensors: SensorFigures) -> StateLayout:
    wanders = sensors.reference_wander_std > 0.0
    return StateLayout(rover.wheel_count, reference_wanders=wanders)


def _without_reference_error(rover: Rover, sensors: SensorFigures) -> StateLayout:
    return StateLayout(rover.wheel_count, torque_zeros=sensors.torque_zero_std > 0.0)


def _as_stated(self: Any, sensor: str, stated: float | None = None) -> float:
    return float(self.stated[sensor] ** 2) if stated is None else stated


def _median_of(values: list[float]) -> float:
    return median(values) if values else 0.0


_LEAST_ALONG = 0.2  # wheel speed for each body speed [-]
_yaw_rate = Turning._yaw_rate
_predict_soil = SoilProcess.predict
_rolling_since = SituationObserver._rolling_since
_update_monitor = StuckMonitor.update


def _speed_learned_back(layout: StateLayout, *, opposes_rims: bool, **more: Any) -> list[int]:
    return considered_entries(layout, opposes_rims=False, **more)


def _walk_on(self: Any, prediction: Any, travel: float, **known: bool) -> None:
    _predict_soil(self, prediction, travel, **{**known, 'reference_known': True})


def _on_through_turns(self: Any, *motion: float, anew: bool) -> float:
    return _rolling_since(self, *motion, anew=False)


def _as_if_straight(self: Any, time: float, motion: Any) -> Any:
    return _update_monitor(self, time, motion._replace(turning=False))


def _by_gyro_alone(self: Any, window: Any, change: float) -> float:
    return float(_yaw_rate(self, window, 0.0))


def _as_if_rolling(self: Any, wheel: int, rim: float, yaw_rate: float) -> float:
    along = float(self.by_speed[wheel])
    told = along >= _LEAST_ALONG  # else it heads across
    return (rim - yaw_rate * float(self.by_yaw_rate[wheel])) / along if told else NAN


def _speed(**values: Any) -> Switch:
    return tuned('filter.speed_process:SpeedTuning', **values)


def _reference(**values: Any) -> Switch:
    return tuned('filter.reference:ReferenceTuning', **values)


def _turning(**values: Any) -> Switch:
    return tuned('contacts.turning:TurningTuning', **values)


def _pulls(**values: Any) -> Switch:
    return tuned('contacts.pulls:PullTuning', **values)


def _soil(**values: Any) -> Switch:
    return tuned('filter.soil_process:SoilTuning', **values)


def _sinkage(**values: Any) -> Switch:
    return tuned('filter.sinkage_process:SinkageTuning', **values)


def _slopes(**values: Any) -> Switch:
    return tuned('contacts.linearisation:LinearisationTuning', **values)


def _standing(**values: Any) -> Switch:
    return tuned('filter.zero_velocity:ZeroVelocityTuning', **values)


def _odometry(**values: Any) -> Switch:
    return tuned('inputs.wheel_odometry:WheelOdometryTuning', **values)


def _situation(**values: Any) -> Switch:
    return tuned('judgement.stuck.situation:SituationTuning', **values)


def _sign(**values: Any) -> Switch:
    return tuned('judgement.stuck.signs:SignTuning', **values)


def _process(**values: Any) -> Switch:
    return tuned('judgement.stuck.passage:SlipProcess', **values)


SIGNS = ('likely', 'digging', 'standing')
_OPENING, _GATE, _HOLD = 'process noise', 'gate rule', 'hold'
_AFTER, _MODEL, _INPUT = 'correction after the update', 'model of a special case', 'input'
_CLASS, _SIGN, _GUARD = 'class', 'stuck sign', 'guard of a sign'

_FILTER = (
    Treatment(
        'slip follows the demand',
        _OPENING,
        patched('contacts.demand:Demand.update', _none_of_it),
        'reference',
    ),
    Treatment('wider walk at a start', _OPENING, _speed(start_walk=0.0)),
    Treatment('wider walk while a wheel is dragged', _OPENING, _speed(drag_walk=0.0), 'faults'),
    Treatment(
        'opening on a change of torque',
        _OPENING,
        tuned('contacts.torque_change:TorqueChangeTuning', most_effort_slip=0.0),
        'reference torque',
    ),
    Treatment(
        'no opening by torques that build up',
        _OPENING,
        patched('wheel_soil_estimator:WheelSoilEstimator._torques_tell', lambda _: True),
        'reference torque stops',
    ),
    Treatment(
        'opening on a change of turning',
        _OPENING,
        _turning(speed_change=0.0),
        'reference turning',
    ),
    Treatment('opening where wheels disagree', _OPENING, _speed(rate_noise=NEVER)),
    Treatment(
        'opening where sides change for a second', _OPENING, _speed(side_change=0.0), 'reference'
    ),
    Treatment('all openings of the speed', _OPENING, _speed(inflation_rate=0.0), 'reference'),
    Treatment(
        'opening where references run to one side',
        _OPENING,
        _reference(run_excess=NEVER),
        'reference',
    ),
    Treatment('noise with a change of rim speed', _OPENING, _speed(rim_change=0.0)),
    Treatment(
        'models doubted while references lean', _OPENING, _reference(most_doubt=1.0), 'reference'
    ),
    Treatment(
        'models doubted for a small lean that lasts',
        _OPENING,
        _reference(lasting_count=NEVER),
        'reference',
    ),
    Treatment(
        'a soil that nobody states is wide',
        _OPENING,
        tuned(
            'filter.initial_state:PriorTuning',
            unstated_strength_std=0.13,
            unstated_shear_modulus_std=0.3,
            unstated_stiffness_std=0.2,
        ),
        'no_soil',
    ),
    Treatment('own stiffness of each wheel', _OPENING, _soil(own_stiffness_walk=0.01)),
    Treatment('soft ground is weak', _OPENING, _soil(soft_is_weak=0.0), 'no_torque'),
    Treatment('wider strength without torque', _OPENING, _soil(strength_spread=1.0), 'no_torque'),
    Treatment(
        'return to the usual slip',
        _OPENING,
        _speed(usual_slip_std=NEVER, usual_length=NEVER),
        'no_reference',
    ),
    Treatment(
        'references beyond the rim speed', _GATE, _reference(beyond_rim=NEVER), 'reference wild'
    ),
    Treatment(
        'references must agree before they are believed',
        _GATE,
        _reference(count=1, count_unwitnessed=1, count_beyond=1),
        'reference',
    ),
    Treatment(
        'witness for a reference', _GATE, _reference(count_unwitnessed=2), 'reference torque'
    ),
    Treatment(
        'no witness on the plateau', _GATE, _speed(plateau_slope=0.0), 'reference torque slope'
    ),
    Treatment(
        'outlying references weakened',
        _GATE,
        _reference(gate=NEVER, gate_beyond=NEVER),
        'reference',
    ),
    Treatment('references doubted on a ramp', _GATE, _reference(timing_std=0.0), 'reference'),
    Treatment(
        'no accelerometer where nothing tells of slip',
        _GATE,
        patched(
            'wheel_soil_estimator:WheelSoilEstimator._trusted', lambda self, window, time: window
        ),
        'no_reference no_torque',
    ),
    Treatment(
        'force rows weakened by gate and NIS',
        _GATE,
        patched('filter.torque:ForceRows.row', _plain_row),
    ),
    Treatment(
        'noise as seen where stated too small',
        _GATE,
        patched('inputs.seen_noise:SeenNoise.variance', _as_stated),
    ),
    Treatment(
        'noise of the IMU as its messages state it',
        _GATE,
        patched('inputs.stated_noise:StatedNoise.completed', lambda self, *_: self),
        'imu_covariance',
    ),
    Treatment(
        'accelerometer as noisy as it is seen',
        _GATE,
        tuned('inputs.inertial:InertialTuning', noise_time=NEVER),
    ),
    Treatment(
        'sinkage readings rejected',
        _GATE,
        tuned('filter.sinkage:SinkageUpdateTuning', believed_after=1),
        'sinkage',
    ),
    Treatment(
        'same ground counts once',
        _HOLD,
        patched('wheel_soil_estimator:repetitions', lambda *_: 1.0),
    ),
    Treatment(
        'states considered, not learned',
        _HOLD,
        patched('wheel_soil_estimator:considered_entries', lambda *_, **__: []),
    ),
    Treatment(
        'forces teach no speed against the wheels',
        _HOLD,
        patched('wheel_soil_estimator:considered_entries', _speed_learned_back),
    ),
    Treatment(
        'soil stays as it was learned without a reference',
        _HOLD,
        patched('filter.soil_process:SoilProcess.predict', _walk_on),
        'no_reference',
    ),
    Treatment(
        'shear model in doubt behind a start',
        _HOLD,
        tuned('contacts.contact_age:ContactAgeTuning', start_variance=0.0),
    ),
    Treatment(
        'no force rows before a contact length',
        _HOLD,
        patched('contacts.contact_age:ContactAge.settled', property(lambda self: True)),
    ),
    Treatment(
        'derivatives smoothed over cycles',
        _HOLD,
        both(_slopes(slope_keep=0.0), _sinkage(slope_keep=0.0)),
    ),
    Treatment('a new contact is one at once', _HOLD, _slopes(new_contact=NEVER), 'faults'),
    Treatment('sinkage tells half of the slip', _HOLD, _sinkage(law_share=1.0), 'no_reference'),
    Treatment(
        'jolt at a start undone',
        _AFTER,
        patched('filter.speed_process:SpeedProcess.undo_jolt', _nothing),
        'no_reference',
    ),
    Treatment(
        'least deviation of the speed',
        _AFTER,
        patched('filter.speed_process:SpeedProcess.keep_least_variance', _nothing),
    ),
    Treatment('least deviation wider in turns', _AFTER, _speed(turning_slip_std=0.0), 'turning'),
    Treatment('pull follows the torque at once', _AFTER, _pulls(excess_gain=0.0), 'torque'),
    Treatment(
        'residual of the balance distributed',
        _AFTER,
        patched('contacts.pulls:Pulls.distributed', lambda self, pull, *_: list(pull)),
    ),
    Treatment(
        'wider pulls in turns', _AFTER, _pulls(scrub_std=0.0, fresh_scrub_std=0.0), 'turning'
    ),
    Treatment('scrub of turns in the force rows', _MODEL, _turning(scrub=0.0), 'turning'),
    Treatment(
        'zeros of torque sensors as states',
        _MODEL,
        patched('wheel_soil_estimator:layout_of', _without_torque_zeros),
        'torque',
    ),
    Treatment(
        'lasting error of references as a state',
        _MODEL,
        patched('wheel_soil_estimator:layout_of', _without_reference_error),
        'wander',
    ),
    Treatment(
        'pulls of spins on the spot from the models',
        _MODEL,
        patched('contacts.contact_age:ContactAge.sheared', property(lambda self: False)),
        'spin',
    ),
    Treatment(
        'a spin on the spot stands',
        _MODEL,
        patched('filter.zero_velocity:ZeroVelocityUpdate._spin_in_place', _nothing),
        'spin',
    ),
    Treatment(
        'v / rim speed carried over at a reversal',
        _MODEL,
        patched('filter.speed_process:SpeedProcess.turn_back', _nothing),
        'reversal',
    ),
    Treatment(
        'half of the slip behind a reversal', _MODEL, _speed(reversed_slip_share=1.0), 'reversal'
    ),
    Treatment('curvature of the ground', _MODEL, _turning(steepest=0.0)),
    Treatment(
        'wheels without load',
        _MODEL,
        tuned('contacts.unloaded_wheels:UnloadedTuning', hold=NEVER),
        'torque faults',
    ),
    Treatment(
        'pull of a dragged wheel from its torque',
        _MODEL,
        patched('contacts.stationary_wheels:StationaryWheels.pull', lambda *_, **__: NAN),
        'torque',
    ),
    Treatment(
        'sliding on standing wheels believed',
        _MODEL,
        _reference(slide_gaps=0.0, shortest_slide=0.0),
        'reference stops',
    ),
    Treatment(
        'a fast rover may slide on',
        _MODEL,
        _standing(coasting_time=0.0),
        'stops',
    ),
    Treatment(
        'zeros of the gyro learned at rest',
        _INPUT,
        patched('filter.zero_velocity:ZeroVelocityUpdate._learn_zero', _nothing),
    ),
    Treatment('yaw rate smoothed while it is steady', _INPUT, _turning(least_gain=1.0)),
    Treatment(
        'yaw rate carried on by the wheels',
        _INPUT,
        patched('contacts.turning:Turning._yaw_rate', _by_gyro_alone),
        'turning',
    ),
    Treatment(
        'steered wheels that push against one another make less way',
        _MODEL,
        patched('contacts.steering:Headings.body_speed', _as_if_rolling),
        'steered',
    ),
    Treatment('rim speeds carried on along a ramp', _INPUT, _odometry(longest_carried=-1.0)),
    Treatment('rim speeds of fast odometry smoothed', _INPUT, _odometry(longest_smoothed=0.0)),
    Treatment(
        'doubt of the side drift of steered wheels',
        _CLASS,
        tuned('judgement.slip:SlipTuning', drift=0.0),
        'steered',
    ),
    Treatment(
        'a spin is one by its wheels',
        _GUARD,
        patched('wheel_soil_estimator:sides_oppose', lambda *_: False),
        'spin',
    ),
)

_GUARDS: dict[str, Switch] = {
    'others settle anew where a wheel is held': _situation(standing_ratio=0.0),
    'sinkage grows where that of more than half does': patched(
        'judgement.stuck.forecast:growth_of_most', _median_of
    ),
    'pulling away is no stall': _situation(pull_away_time=0.0),
    'a sharp turn begins pulling away anew': patched(
        'judgement.stuck.situation:SituationObserver._rolling_since', _on_through_turns
    ),
    'a sharp turn says nothing of an entrapment': patched(
        'judgement.stuck.monitor:StuckMonitor.update', _as_if_straight
    ),
    'no warning while wheels are stopped': _situation(stopping_share=0.0),
    'slip settles after a start': _situation(settling_travel=0.0),
    'digging only by a slip that is sure': _sign(sure_std=NEVER),
    'forecast by the growth of the sinkage': _process(digging=0.0),
}

TREATMENTS: tuple[Treatment, ...] = (
    *_FILTER,
    *(Treatment(name, _GUARD, off, warning_only=True) for name, off in _GUARDS.items()),
    *(Treatment(f'sign {name}', _SIGN, without_sign(name), warning_only=True) for name in SIGNS),
)
