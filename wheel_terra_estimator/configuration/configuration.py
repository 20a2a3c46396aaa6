# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The checked configuration: SI units and radians, arrays over wheels, all values checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wheel_terra_estimator.arrays import BoolArray, FloatArray
from wheel_terra_estimator.configuration import ros_yaml
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import SteadyState
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.terms import SOIL_NUMBERS
from wheel_terra_estimator.terramechanics.wheel import Wheel

EffectSettings: TypeAlias = dict[str, dict[str, Any]]

_SOIL_LABELS = ('soil.name', 'soil.source')


class Section:
    """The parameters below one prefix as attributes, read-only.

    Lists of numbers are numpy arrays; keys that end in ``_deg`` lose the suffix and are radians.
    """

    def __init__(self, values: Mapping[str, Value], prefix: str) -> None:
        attributes: dict[str, Any] = {}
        for key, value in values.items():
            if key.startswith(prefix):
                name = key[len(prefix) :]
                attributes[name.removesuffix('_deg')] = _internal(name, value)
        self.__dict__.update(attributes)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError('a configuration is read-only; see Configuration.replace')

    def __getattr__(self, name: str) -> Any:
        # Reached only for names that the table does not declare.
        raise AttributeError(f'no such parameter: {name}')


class Wheels(Section):
    """Wheels of the rover; every array is (n,) in the order of ``names``."""

    names: tuple[str, ...]
    radius: FloatArray  # rim [m]
    width: FloatArray  # [m]
    lug_height: FloatArray  # [m]
    lug_count: FloatArray  # [-]
    lug_thickness: FloatArray  # [m]
    x: FloatArray  # hub in base_link [m]
    y: FloatArray
    z: FloatArray
    direction: FloatArray  # +1 or -1
    steering_joints: tuple[str, ...]  # that steer each wheel, '' = not steered
    torque_limit: FloatArray  # [N m], 0 = not known
    passes: FloatArray  # pass number of the soil
    wrench_frame: tuple[str, ...]  # of the wrenches that the node publishes, empty text = none

    def __init__(self, values: Mapping[str, Value]) -> None:
        super().__init__(values, 'wheels.')
        tip = values['slip_radius'] == 'lug_tip'
        slip_radius = self.radius + self.lug_height if tip else self.radius.copy()
        slip_radius.setflags(write=False)
        self.__dict__['slip_radius'] = slip_radius
        self.__dict__['wheel'] = Wheel(**{f.name: getattr(self, f.name) for f in fields(Wheel)})

    slip_radius: FloatArray  # radius that the slip ratio refers to [m]
    wheel: Wheel

    @property
    def steered(self) -> tuple[bool, ...]:
        """Which wheels steer."""
        return tuple(bool(joint) for joint in self.steering_joints)

    @property
    def count(self) -> int:
        """Number of wheels."""
        return len(self.names)


class Rover(Section):
    """Mass, gravity and suspension."""

    name: str
    mass: float  # [kg]
    gravity: float  # [m/s^2]
    centre_of_gravity: FloatArray  # (3,) [m]
    suspension: str  # rigid, rocker_bogie, shares
    load_shares: FloatArray  # (n,)
    rocker_pivot: FloatArray  # x, z [m]
    bogie_pivot: FloatArray  # x, z [m]
    bogie_wheels: str  # front, rear
    load_std: float
    contact_law: str  # see terramechanics/contact_law.py

    def __init__(self, values: Mapping[str, Value]) -> None:
        super().__init__(values, 'rover.')


@dataclass(frozen=True, eq=False)
class Configuration:
    """Everything that files and overrides stated, checked, with defaults filled in."""

    wheels: Wheels
    rover: Rover
    # ``soil``, ``soil_std``: nominal soil, and field of ``Soil`` -> standard deviation in internal
    # units
    soil: Soil
    soil_std: dict[str, float]
    # ``effects``, ``effects_std``: enabled effect -> parameter of its form -> value or stated
    # standard deviation; ``form`` is among the values where it is not the first one of the effect
    effects: EffectSettings
    effects_std: EffectSettings
    # ``sensors``, ``filter``: ``sensors.*`` and ``filter.*`` as attributes
    sensors: Section
    filter: Section
    slip_radius: str
    wheel_odometry: str
    reference_odom_max_rate: float  # [Hz]
    rest_speed: float  # [m/s]
    output_rate: float  # [Hz], 0 = every stamp
    max_lag: float  # [s], below 0 = learned
    history: float  # [s]
    soil_file: str
    provenance: str
    stated: frozenset[str]  # keys that a file or an override gave, as against defaults
    _values: Mapping[str, Value]

    @property
    def soil_source(self) -> str:
        """Class of the source of soil numbers whose deviation is not stated.

        A soil that is not stated is another soil.
        """
        return str(self._values['soil.source']) if self.soil_stated else 'proxy'

    @property
    def soil_std_stated(self) -> dict[str, float]:
        """The part of ``soil_std`` that is stated number by number."""
        return {
            field: std
            for field, std in self.soil_std.items()
            if self.stated & {f'soil.{field}_std', f'soil.{field}_std_deg'}
        }

    @property
    def soil_stated(self) -> bool:
        """Whether a soil, or its deviations, are stated; else the default soil is a guess."""
        return any(key.startswith('soil.') and key not in _SOIL_LABELS for key in self.stated)

    @classmethod
    def from_values(cls, values: Mapping[str, Value], stated: Iterable[str]) -> Configuration:
        """Build from checked values of all declared keys (see ``reader``)."""
        effects, effects_std = _effects(values)
        single: dict[str, Any] = {f.name: values[f.name] for f in fields(cls) if f.name in values}
        section = Section(values, 'soil.')
        soil = Soil(**{field.name: getattr(section, field.name) for field in fields(Soil)})
        return cls(
            wheels=Wheels(values),
            rover=Rover(values),
            soil=soil,
            soil_std={
                name: float(
                    getattr(section, f'{name}_std')
                    or section.relative_std * abs(float(getattr(soil, name)))
                )
                for name in SOIL_NUMBERS
            },
            effects=effects,
            effects_std=effects_std,
            sensors=Section(values, 'sensors.'),
            filter=Section(values, 'filter.'),
            stated=frozenset(stated),
            _values=dict(values),
            **single,
        )

    def flat(self) -> dict[str, Value]:
        """Return canonical key -> value of every declared parameter, as it would be written."""
        return dict(self._values)

    def replace(self, changes: Mapping[str, Value], overrides: Sequence[str] = ()) -> Configuration:
        """Return a configuration in which some keys have other values, checked like a file.

        ``overrides``: ``NAME:=VALUE`` each.
        """
        from wheel_terra_estimator.configuration import reader

        stated = {key: self._values[key] for key in self.stated}
        return reader.from_parameters({**stated, **changes}, overrides, complete=False)

    def write(self, path: str | Path, keys: Iterable[str] | None = None, comment: str = '') -> None:
        """Write a parameter file that the commands and the node accept.

        ``keys`` are canonical, written in this order; default: all that were stated. ``comment``
        goes to the top.
        """
        chosen = [key for key in self._values if key in self.stated] if keys is None else keys
        ros_yaml.write(Path(path), {key: self._values[key] for key in chosen}, comment)


def _internal(name: str, value: Value) -> Any:
    if isinstance(value, list):
        if isinstance(value[0], str):
            return tuple(value)
        array = np.array(value, dtype=float)
        if name.endswith('_deg'):
            array = np.radians(array)
        array.setflags(write=False)
        return array
    if name.endswith('_deg') and not isinstance(value, str):
        return math.radians(value)
    return value


def _effects(values: Mapping[str, Any]) -> tuple[EffectSettings, EffectSettings]:
    enabled = [
        key.split('.')[1]
        for key, value in values.items()
        if key.startswith('effects.') and key.endswith('.enabled') and value
    ]
    settings: EffectSettings = {}
    deviations: EffectSettings = {}
    for name in enabled:
        effect, prefix = catalogue()[name], f'effects.{name}'
        if effect.sparse:
            settings[name], deviations[name] = law(values, prefix)
            continue
        form = str(values.get(f'{prefix}.form', effect.form))
        chosen = effect.in_form(form).parameters
        settings[name] = {p.name: float(values[f'{prefix}.{p.name}']) for p in chosen}
        deviations[name] = {p.name: float(values[f'{prefix}.{p.name}_std']) for p in chosen}
        if form != effect.form:
            settings[name]['form'] = form
    return settings, deviations


def law(values: Mapping[str, Value], prefix: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return coefficients and deviations of a law by the name of each term.

    Raises ValueError for terms that there are not, see `coefficients_of`.
    """
    from wheel_terra_estimator.terramechanics.effects.learned_closure import coefficients_of

    lists: dict[str, Any] = {
        key: values[f'{prefix}.{key}']
        for key in ('targets', 'features', 'coefficients', 'coefficients_std')
    }
    stds = lists['coefficients_std']
    if len(stds) == 1:
        stds = stds * len(lists['coefficients'])
    pairs = lists['targets'], lists['features']
    return coefficients_of(*pairs, lists['coefficients']), coefficients_of(*pairs, stds)


@dataclass(frozen=True)
class Readings:
    """Stated gains and zeros of sinkage [m], drawbar pull [N] and torque [N m].

    A sensor reads ``gain * true + zero`` where the model gives the true value.
    """

    # ``gain``, ``zero``: (3,), or (N, 3) where rows differ
    gain: FloatArray
    zero: FloatArray

    @classmethod
    def of(cls, configuration: Configuration, wheel: int = 0) -> Readings:
        """Return the errors that ``sensors.*`` states for one wheel; of the pull it states none."""
        sensors = configuration.sensors
        return cls(
            np.array([sensors.sinkage_gain[wheel], 1.0, sensors.torque_gain[wheel]]),
            np.array([sensors.sinkage_zero[wheel], 0.0, sensors.torque_zero[wheel]]),
        )

    def true_on(self, rows: BoolArray) -> Readings:
        """Return (N, 3) errors, none on the given rows: theirs were taken off before."""
        true = rows[:, None]
        return Readings(np.where(true, 1.0, self.gain), np.where(true, 0.0, self.zero))

    def read(self, true: FloatArray) -> FloatArray:
        """Return the readings of true values; quantities on the last axis."""
        return true * self.gain + self.zero

    def of_state(self, state: SteadyState) -> dict[str, FloatArray]:
        """Return the readings (N,) of each of `OUTPUTS` where the model has them."""
        true = np.column_stack([getattr(state, name) for name in OUTPUTS])
        return dict(zip(OUTPUTS, self.read(true).T, strict=True))
