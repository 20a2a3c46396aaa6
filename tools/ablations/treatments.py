# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Special treatments of the estimator, each with the way to switch it off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ablations.switches import Switch, patched, tuned, without_sign
from wheel_terra_estimator.estimation.filter.state import StateLayout
from wheel_terra_estimator.estimation.rover import Rover, SensorFigures
from wheel_terra_estimator.estimation.scalars import median

NEVER = 1e9


@dataclass(frozen=True)
class Treatment:
    """One special treatment; `warnings_only` where it can change nothing but ``~/stuck``."""

    name: str
    group: str
    off: Switch
    warnings_only: bool = False


def _nothing(*_: Any, **__: Any) -> None:
    return None


def _none_of_it(*_: Any, **__: Any) -> float:
    return 0.0


def _plain_row(self: Any, ekf: Any, row: Any) -> Any:
    return row


def _without_torque_zeros(rover: Rover, sensors: SensorFigures) -> StateLayout:
    wanders = sensors.reference_wander_std > 0.0
    return StateLayout(rover.wheel_count, reference_wanders=wanders)


def _as_stated(self: Any, sensor: str, stated: float | None = None) -> float:
    return float(self.stated[sensor] ** 2) if stated is None else stated


def _median_of(values: list[float]) -> float:
    return median(values) if values else 0.0


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


SIGNS = (
    'likely',
    'within_horizon',
    'digging',
    'deepening',
    'held',
    'bogging',
    'stall',
    'labour',
)
_OPENING, _GATE, _HOLD = 'process opening', 'gate rule', 'hold'
_AFTER, _MODEL, _SIGN = 'correction after the update', 'model of a special case', 'stuck sign'

TREATMENTS: tuple[Treatment, ...] = (
    Treatment(
        'slip follows the demand', _OPENING, patched('contacts.demand:Demand.update', _none_of_it)
    ),
    Treatment(
        'opening on a change of torque',
        _OPENING,
        tuned('contacts.torque_change:TorqueChangeTuning', most_effort_slip=0.0),
    ),
    Treatment('opening on a change of turning', _OPENING, _turning(speed_change=0.0)),
    Treatment('opening where wheels disagree', _OPENING, _speed(rate_noise=NEVER)),
    Treatment('opening where sides change for a second', _OPENING, _speed(side_change=0.0)),
    Treatment('wider walk while a wheel is dragged', _OPENING, _speed(drag_walk=0.0)),
    Treatment('noise with a change of rim speed', _OPENING, _speed(rim_change=0.0)),
    Treatment('all openings of the speed', _OPENING, _speed(inflation_rate=0.0)),
    Treatment('models doubted while references lean', _OPENING, _reference(most_doubt=1.0)),
    Treatment('soft ground is weak', _OPENING, _soil(soft_is_weak=0.0)),
    Treatment('own stiffness of each wheel', _OPENING, _soil(own_stiffness_walk=0.01)),
    Treatment(
        'return to the usual slip', _OPENING, _speed(usual_slip_std=NEVER, usual_length=NEVER)
    ),
    Treatment('references beyond the rim speed', _GATE, _reference(beyond_rim=NEVER)),
    Treatment(
        'references must agree before they are believed',
        _GATE,
        _reference(count=1, count_unwitnessed=1, count_beyond=1),
    ),
    Treatment('witness for a reference', _GATE, _reference(count_unwitnessed=2)),
    Treatment('no witness on the plateau', _GATE, _speed(plateau_slope=0.0)),
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
        'sinkage readings rejected',
        _GATE,
        tuned('filter.sinkage:SinkageUpdateTuning', believed_after=1),
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
        'no higher class by a guess', _HOLD, patched('judgement.classes:_BAND_PER_GUESS', 0.0)
    ),
    Treatment('sinkage tells half of the slip', _HOLD, _sinkage(law_share=1.0)),
    Treatment('bearing law frozen at high slip', _HOLD, _sinkage(steady_slip=2.0)),
    Treatment(
        'jolt at a start undone',
        _AFTER,
        patched('filter.speed_process:SpeedProcess.undo_jolt', _nothing),
    ),
    Treatment(
        'least deviation of the speed',
        _AFTER,
        patched('filter.speed_process:SpeedProcess.keep_least_variance', _nothing),
    ),
    Treatment('pull follows the torque at once', _AFTER, _pulls(excess_gain=0.0)),
    Treatment(
        'residual of the balance distributed',
        _AFTER,
        patched('contacts.pulls:Pulls.distributed', lambda self, pull, *_: list(pull)),
    ),
    Treatment('scrub of turns in the force rows', _MODEL, _turning(scrub=0.0)),
    Treatment(
        'zeros of torque sensors as states',
        _MODEL,
        patched('wheel_soil_estimator:layout_of', _without_torque_zeros),
    ),
    Treatment(
        'pulls of spins on the spot from the models',
        _MODEL,
        patched('contacts.contact_age:ContactAge.sheared', property(lambda self: False)),
    ),
    Treatment('curvature of the ground', _MODEL, _turning(steepest=0.0)),
    Treatment(
        'wheels without load',
        _MODEL,
        tuned('contacts.unloaded_wheels:UnloadedTuning', hold=NEVER),
    ),
    Treatment(
        'sliding on standing wheels believed',
        _MODEL,
        _reference(slide_gaps=0.0, shortest_slide=0.0),
    ),
    Treatment(
        'others settle anew where a wheel is held',
        _SIGN,
        tuned('judgement.stuck.situation:SituationTuning', standing_ratio=0.0),
        warnings_only=True,
    ),
    Treatment(
        'sinkage grows where that of more than half does',
        _SIGN,
        patched('judgement.stuck.forecast:_growth_of_most', _median_of),
        warnings_only=True,
    ),
    *(Treatment(f'sign {name}', _SIGN, without_sign(name), warnings_only=True) for name in SIGNS),
)
