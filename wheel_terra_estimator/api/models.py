# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheel, soil and the steady curves that follow from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wheel_terra_estimator.api.frames import Columns, to_frame
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.readings import Readings
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.terramechanics import soil as terramechanics_soil
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.effects.base import OUTPUTS
from wheel_terra_estimator.terramechanics.model import OVERLOADED, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import (
    STANDARD_GRAVITY,
    OperatingPoints,
)
from wheel_terra_estimator.terramechanics.wheel import Wheel

if TYPE_CHECKING:
    from pandas import DataFrame

FloatArray = NDArray[np.float64]
__all__ = ['Curve', 'Model', 'Soil', 'Wheel']


@dataclass(frozen=True)
class Soil(terramechanics_soil.Soil):
    """Soil parameters; fields and units as in ``terramechanics.soil.Soil``.

    Examples
    --------
    >>> sand = Soil.load('dlr_mss')
    >>> sand.cohesion
    300.0
    """

    @classmethod
    def load(cls, name: str | Path) -> Soil:
        """Return a shipped soil by its bare name, or that of a configuration file.

        Raises
        ------
        UserError
            If no file answers to the name, or it states no soil.
        """
        return cls._of(reader.load([name], complete=False).soil)

    @classmethod
    def _of(cls, soil: terramechanics_soil.Soil) -> Soil:
        return cls(**{f.name: getattr(soil, f.name) for f in fields(soil)})


@dataclass(frozen=True)
class Curve:
    """Steady answer of the soil over slip; every array is (N,).

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
        """Return the columns as a DataFrame (needs pandas)."""
        return to_frame(self.columns())


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
        for given, kind in ((wheel, Wheel), (soil, terramechanics_soil.Soil)):
            if not isinstance(given, kind):
                raise UserError(
                    f'Model: {given!r} is no {kind.__name__}; give Wheel(radius=0.13, width=0.16) '
                    "and Soil.load('dlr_mss'), or use Model.load('hit_wh3', 'hit_fit')"
                )
        self._set(_configuration(wheel, soil, effects or {}, slip_radius, gravity), method)

    @classmethod
    def load(
        cls,
        *files: str | Path,
        parameters: Sequence[str] = (),
        method: str = 'quadrature',
    ) -> Model:
        """Return the model of configuration files, the ``model.yaml`` of a diagnosis included.

        Parameters
        ----------
        *files : str or pathlib.Path
            Paths, or bare names of shipped files; later ones win key by key.
        parameters : sequence of str
            ``NAME:=VALUE``, winning over the files.
        method : str
            As above.

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
        self.soil = Soil._of(configuration.soil)
        self.effects = configuration.effects
        self._model = WheelSoilModel(configuration.soil, self.effects, method, strict=False)

    @property
    def wheel(self) -> Wheel:
        """The wheel (the first of a rover)."""
        wheels = self.configuration.wheels
        return Wheel(
            *(
                float(values[0])
                for values in (
                    wheels.radius,
                    wheels.width,
                    wheels.lug_height,
                    wheels.lug_count,
                    wheels.lug_thickness,
                )
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

        Parameters
        ----------
        slip : array_like
            (N,) slip ratio in [-1, 1]; above |0.95| no steady state is known from experiment.
        normal_load, slope, angular_velocity, pass_number : array_like
            (N,) or one number: load [N], slope [rad], wheel rate [rad/s, nan = not needed], pass.

        Raises
        ------
        ValueError
            For values that are out of range.
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
        carried = (state.flags & OVERLOADED) == 0
        answers = {
            name: np.where(carried, getattr(state, name), np.nan)
            for name in (f.name for f in fields(Curve)[3:])
        }
        # As the sensors of the wheel would read them (``sensors.*`` of the configuration).
        read = Readings.of(self.configuration).read(
            np.column_stack([answers[name] for name in OUTPUTS])
        )
        answers |= dict(zip(OUTPUTS, read.T, strict=True))
        inputs = (np.array(values) for values in (points.slip, points.normal_load, points.slope))
        return Curve(*inputs, **answers)


def _configuration(
    wheel: Wheel,
    soil: terramechanics_soil.Soil,
    effects: EffectSettings,
    slip_radius: str,
    gravity: float,
) -> Configuration:
    """Return the parameters that say the same as these objects."""
    values: dict[str, Any] = {
        'wheels.names': ['wheel'],
        'slip_radius': slip_radius,
        'rover.gravity': float(gravity),
    }
    values |= {f'wheels.{f.name}': [float(getattr(wheel, f.name))] for f in fields(wheel)}
    values['wheels.lug_count'] = [round(float(wheel.lug_count))]
    for f in fields(soil):
        value = getattr(soil, f.name)
        if f.name == 'friction_angle':
            values['soil.friction_angle_deg'] = float(np.degrees(value))
        else:
            values[f'soil.{f.name}'] = value if isinstance(value, str) else float(value)
    for name, settings in effects.items():
        values[f'effects.{name}.enabled'] = True
        values |= {f'effects.{name}.{key}': value for key, value in settings.items()}
    return reader.from_parameters(values, source='model', complete=False)
