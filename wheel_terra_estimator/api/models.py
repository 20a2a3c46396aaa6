# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The wheel-soil model and the steady curves that follow from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.api.arguments import check_kind
from wheel_terra_estimator.api.soils import Soil, configuration_of
from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration, Readings
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.frames import Columns, to_frame, unit_of
from wheel_terra_estimator.terramechanics import soil as terramechanics_soil
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import OVERLOADED, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY, OperatingPoints
from wheel_terra_estimator.terramechanics.wheel import Wheel

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class Curve:
    """Steady state of the contact over slip; every array is (N,).

    Attributes
    ----------
    slip, normal_load, slope : numpy.ndarray
        Slip ratio [-], load [N], slope [rad, positive uphill].
    sinkage, drawbar_pull, torque : numpy.ndarray
        [m], [N], [N m]; nan where the soil cannot carry the load.
    entrance_angle, peak_stress_angle, leaving_angle : numpy.ndarray
        Contact angles from the vertical [rad].
    """

    slip: FloatArray
    normal_load: FloatArray
    slope: FloatArray
    sinkage: FloatArray
    drawbar_pull: FloatArray
    torque: FloatArray
    entrance_angle: FloatArray
    peak_stress_angle: FloatArray
    leaving_angle: FloatArray

    def columns(self) -> Columns:
        """Return the arrays by name; the first six are columns that ``diagnose`` reads."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def to_frame(self) -> DataFrame:
        """Return the columns as a DataFrame (needs pandas), units in ``attrs['units']``."""
        return to_frame(self.columns())

    def __repr__(self) -> str:
        """Return the ranges of slip, load and results."""
        return f'Curve of {self.slip.size} points' + ''.join(
            f'\n  {name} {np.nanmin(values):.4g} to {np.nanmax(values):.4g} {unit_of(name)}'
            for name, values in self.columns().items()
            if name in ('slip', *OUTPUTS) and values.size
        )


class Model:
    """The wheel-soil model: steady rolling of a rigid wheel in loose soil.

    Parameters
    ----------
    wheel : Wheel
        One wheel (floats).
    soil : Soil, str or pathlib.Path
        Its soil, or the name of a shipped one.
    effects : mapping, optional
        Effect name -> parameter -> value; a missing parameter takes its default. Names and
        parameters: ``wheel-terra effects``.
    slip_radius : str
        Radius that slip refers to: ``lug_tip`` (r + h) or ``rim`` (r).
    gravity : float
        [m/s^2].
    method : str
        ``quadrature`` (the reference) or ``closed_form`` (as used on board).

    Attributes
    ----------
    configuration : Configuration
        The same as parameters of the commands and of the node.

    Examples
    --------
    >>> wheel = Wheel(radius=0.13, width=0.16)
    >>> plain = Model(wheel, Soil.load('dlr_mss'))
    >>> digging = Model(wheel, Soil.load('dlr_mss'), {'slip_sinkage_exponent': {'n1': 0.5}})
    >>> deeper = digging.curve(slip=[0.5], normal_load=80).sinkage
    >>> bool(deeper > plain.curve(slip=[0.5], normal_load=80).sinkage)
    True
    """

    def __init__(
        self,
        wheel: Wheel,
        soil: terramechanics_soil.Soil | str | Path,
        effects: EffectSettings | None = None,
        *,
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
        method: str = 'quadrature',
    ) -> None:
        if isinstance(soil, str | Path):
            soil = Soil.load(soil)
        self._set(configuration_of(wheel, soil, effects or {}, slip_radius, gravity), method)

    @classmethod
    def load(
        cls, *files: str | Path, parameters: Sequence[str] = (), method: str = 'quadrature'
    ) -> Model:
        """Return the model of configuration files, the ``model.yaml`` of a diagnosis included.

        ``files``: paths, or bare names of shipped files; later ones win key by key, and
        ``parameters``, ``NAME:=VALUE`` each, over all of them.

        Examples
        --------
        >>> Model.load('hit_wh3', 'hit_fit').wheel.radius
        0.1574
        """
        return cls.of(reader.load(files, parameters, complete=False), method=method)

    @classmethod
    def of(cls, configuration: Configuration, *, method: str = 'quadrature') -> Model:
        """Return the model of a configuration; its first wheel is taken."""
        model = cls.__new__(cls)
        model._set(configuration, method)
        return model

    def _set(self, configuration: Configuration, method: str) -> None:
        self.configuration = configuration
        self.soil = Soil._of(configuration)
        self.effects = configuration.effects
        self._model = WheelSoilModel(configuration.soil, self.effects, method)

    @property
    def wheel(self) -> Wheel:
        """The wheel (the first of a rover)."""
        return self.configuration.wheels.wheel.map(lambda values: float(values[0]))

    def __repr__(self) -> str:
        """Return wheel, effects and soil in five lines, the first line of the soil's left out."""
        wheel, on = self.wheel, ', '.join(self.effects) or 'none'
        return '\n'.join(
            (
                f'Model, wheel radius {wheel.radius:g} m, width {wheel.width:g} m, '
                f'{wheel.lug_count:g} lugs of {wheel.lug_height:g} m',
                f'  effects: {on}',
                *repr(self.soil).splitlines()[1:],
            )
        )

    def curve(
        self,
        slip: ArrayLike,
        normal_load: ArrayLike,
        slope: ArrayLike = 0.0,
        *,
        angular_velocity: ArrayLike = np.nan,
        pass_number: ArrayLike = 1,
    ) -> Curve:
        """Return sinkage, drawbar pull and torque at steady operating points.

        Raises ValueError for values that are out of range.

        Parameters
        ----------
        slip : array_like
            (N,) slip ratio in [-1, 1]; above |0.95| no steady state is known from experiment.
        normal_load, slope, angular_velocity, pass_number : array_like
            (N,) or one number: load [N], slope [rad], wheel rate [rad/s, nan = not needed], pass.
        """
        points = OperatingPoints(
            slip=np.atleast_1d(np.asarray(slip, dtype=np.float64)),
            normal_load=np.asarray(normal_load, dtype=np.float64),
            wheel=self.wheel,
            slope=np.asarray(slope, dtype=np.float64),
            slip_radius=self.configuration.slip_radius,
            gravity=float(self.configuration.rover.gravity),
            angular_velocity=np.asarray(angular_velocity, dtype=np.float64),
            pass_number=np.asarray(pass_number),
        )
        state = self._model.steady_state(points)
        outputs = {name: getattr(state, name) for name in (f.name for f in fields(Curve)[3:])}
        # As the sensors of the wheel would read them (``sensors.*`` of the configuration).
        outputs |= Readings.of(self.configuration).of_state(state)
        carried = (state.flags & OVERLOADED) == 0
        outputs = {name: np.where(carried, values, np.nan) for name, values in outputs.items()}
        inputs = (np.array(values) for values in (points.slip, points.normal_load, points.slope))
        return Curve(*inputs, **outputs)

    def sweep(
        self,
        slip: ArrayLike,
        normal_load: ArrayLike,
        slope: ArrayLike = 0.0,
        *,
        parameters: Mapping[str, Any] | None = None,
        as_frame: bool = True,
    ) -> DataFrame | Columns:
        """Return the curves of every combination of operating points and parameters.

        A column per parameter, then those of `Curve`; one row per combination, slip changing
        fastest. Units are in ``attrs['units']``.

        Parameters
        ----------
        slip, normal_load, slope : array_like
            One-dimensional, or one number: slip ratio [-], load [N], slope [rad].
        parameters : mapping of str to sequence
            Key of the configuration -> values or one value, such as
            ``{'soil.cohesion': [100.0, 300.0]}`` [Pa] or ``{'soil.friction_angle_deg': 30}`` [deg].
        as_frame : bool
            True: a DataFrame (needs pandas); False: the same columns as a dict of arrays.

        Examples
        --------
        >>> model = Model(Wheel(radius=0.13, width=0.16), 'dlr_mss')
        >>> rows = model.sweep([0.1, 0.3], [60, 90], parameters={'soil.cohesion': [100, 500]})
        >>> rows.groupby('soil.cohesion')['drawbar_pull'].max().round(1).to_dict()
        {100: -1.8, 500: 1.1}
        """
        axes = (np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (slip, normal_load, slope))
        # Transposed, so that slip changes fastest and each curve stands in one piece.
        points = [grid.T.ravel() for grid in np.meshgrid(*axes, indexing='ij')]
        keys = parameters or {}
        check_kind(keys, Mapping, 'sweep: parameters', "{'soil.cohesion': [100.0, 300.0]}")
        choices = [
            list(v) if np.iterable(v) and not isinstance(v, str) else [v] for v in keys.values()
        ]
        if [] in choices:
            empty = list(keys)[choices.index([])]
            raise UserError(f'sweep: no value for {empty}; give one, or leave it out')
        found: dict[str, list[NDArray[Any]]] = {}
        for values in product(*choices):
            changes = dict(zip(keys, values, strict=True))
            model = Model.of(self.configuration.replace(changes), method=self._model.method)
            if not found:
                reader.warn_of_idle(list(keys), model.configuration)
            answer = model.curve(*points).columns()
            for name, column in {**changes, **answer}.items():
                found.setdefault(name, []).append(np.broadcast_to(column, points[0].shape))
        columns = {name: np.concatenate(parts) for name, parts in found.items()}
        return to_frame(columns) if as_frame else columns
