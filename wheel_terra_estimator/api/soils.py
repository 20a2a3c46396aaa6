# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Soil parameters: shipped, from a file, changed, fitted to a table, and saved."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wheel_terra_estimator.api.arguments import check_kind, one_number
from wheel_terra_estimator.configuration import reader, ros_yaml, shipped
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.configuration.parameters import declared, nearest
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import check_file, new_file
from wheel_terra_estimator.terramechanics import soil as terramechanics_soil
from wheel_terra_estimator.terramechanics.effects import EffectSettings
from wheel_terra_estimator.terramechanics.model import OVERLOADED, SteadyState, WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import STANDARD_GRAVITY
from wheel_terra_estimator.terramechanics.terms import SOIL_NUMBERS
from wheel_terra_estimator.terramechanics.wheel import Wheel

if TYPE_CHECKING:
    from wheel_terra_estimator.discrepancy.tables.steady_table import SteadyTable

_KNOWN_TO = 1.0
"""Share of the start's value to which a fit of a soil takes each of its numbers as known."""
_ZERO = {'sinkage_offset': {'offset': 0.0, 'offset_std': 0.003}}  # [m], of a sensor; assumed
_SHIFT_FACTOR = 2.0  # shift of the exponent that shows such a zero, over its deviation by it [-]
_DEGREES = 'friction_angle_deg'
_MODULI = ('cohesive_modulus', 'frictional_modulus')
"""Without a unit in the law of Reece."""


@dataclass(frozen=True)
class Soil(terramechanics_soil.Soil):
    """Soil parameters, in SI units and radians.

    Attributes
    ----------
    cohesive_modulus : float
        kc [N/m^(n+1)] in p = (kc/b + kphi) z^n (Bekker); kc' [-] in
        p = (c kc' + density g b kphi') (z/b)^n (Reece).
    frictional_modulus : float
        kphi [N/m^(n+2)] (Bekker) or kphi' [-] (Reece).
    sinkage_exponent : float
        n [-].
    cohesion : float
        c [Pa].
    friction_angle : float
        phi [rad]; degrees only in keys of files and arguments that end in ``_deg``.
    shear_modulus : float
        K, shear deformation modulus of Janosi and Hanamoto [m].
    peak_stress_ratio : float
        c1 = angle of greatest stress over entrance angle at zero slip [-].
    leaving_angle_ratio : float
        c3 = leaving angle over entrance angle [-], zero or negative.
    density : float
        Bulk density [kg/m^3].
    pressure_law : str
        ``bekker`` or ``reece``; how the two moduli are defined.
    std : mapping of str to float
        Field -> standard deviation in its unit, where a file states it or a fit found it.
    source : str
        Where the numbers without one come from: '' (tests of this soil), ``published`` or
        ``proxy``; a diagnosis lets them move accordingly.

    Examples
    --------
    >>> sand = Soil.load('dlr_mss')
    >>> sand
    Soil, pressure law bekker
      cohesive_modulus 5790 N/m^(n+1), frictional_modulus 180000 N/m^(n+2), sinkage_exponent 0.8
      cohesion 300 Pa, friction_angle 0.3107 rad (17.80 deg), shear_modulus 0.01 m
      peak_stress_ratio 0.4, leaving_angle_ratio 0, density 1600 kg/m^3
    >>> round(sand.replace(cohesion=500.0, friction_angle_deg=30.0).friction_angle, 4)
    0.5236
    >>> 'dlr_mss' in Soil.available()
    True
    """

    std: Mapping[str, float] = field(default_factory=dict, compare=False)
    source: str = field(default='', compare=False)

    @classmethod
    def available(cls) -> list[str]:
        """Return the bare names of the shipped soils, for `load`; their files name the source."""
        return [key.partition('/')[2] for key in shipped.files() if key.startswith('soils/')]

    @classmethod
    def load(cls, name: str | Path) -> Soil:
        """Return a shipped soil by its bare name, or that of a configuration file.

        Raises UserError if no file has the name, or it states no soil.
        """
        configuration = reader.load([name], complete=False)
        if not configuration.soil_stated:
            raise UserError(f"{name}: states no soil; Soil.available() has 'dlr_mss' and others")
        return cls._of(configuration)

    @classmethod
    def fit(
        cls,
        table: Any,
        wheel: Wheel,
        *,
        start: terramechanics_soil.Soil | str | Path | None = None,
        effects: EffectSettings | None = None,
        slip_radius: str = 'lug_tip',
        gravity: float = STANDARD_GRAVITY,
        columns: Mapping[str, Any] | str | Path | None = None,
        ignore_columns: Sequence[str] = (),
    ) -> Soil:
        """Return the soil with which the model comes nearest to steady measurements.

        A regularised least-squares fit: each number is taken as known to its own value around the
        start, so that what the rows cannot separate (kc from kphi on one wheel width, angles
        without pull or torque) stays near it. Density and pressure law are those of the start;
        ``std`` has the deviation of each fitted number. Warns if more is left than noise and a
        model error of 2 % of the range permit, or if a zero error of the sinkage would mean
        another soil.

        Parameters
        ----------
        table : DataFrame, mapping or path
            Steady measurements, as for ``diagnose``; best with sinkage, pull and torque.
        wheel : Wheel
            The wheel, where the table has no columns of it.
        start : Soil or name, optional
            Where the fit starts; default: the shipped soil nearest to the rows.
        effects, slip_radius, gravity
            Of the model, as for ``Model``.
        columns, ignore_columns
            As for ``diagnose``.

        Examples
        --------
        >>> wheel, true = Wheel(radius=0.13, width=0.16), Soil.load('dlr_mss')
        >>> slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 12), [60.0, 90.0]))
        >>> from wheel_terra_estimator.api import Model
        >>> rows = Model(wheel, true.replace(cohesion=700.0)).curve(slip, load).to_frame()
        >>> bool(abs(Soil.fit(rows, wheel, start=true).cohesion - 700.0) < 50.0)
        True
        """
        from wheel_terra_estimator.api.tables import read
        from wheel_terra_estimator.discrepancy.report.model_file import corrected
        from wheel_terra_estimator.discrepancy.tables.header import Choice
        from wheel_terra_estimator.discrepancy.workflow import Options, diagnose

        rows = read(table, 'table', Choice.of(columns or {}, ignore_columns))
        rest = (effects or {}, slip_radius, gravity)
        if isinstance(start, str | Path):
            start = cls.load(start)
        if start is None:
            start = _nearest(rows, wheel, [cls.load(name) for name in cls.available()], rest)
        prior = configuration_of(wheel, start, *rest)
        options = Options(effects=(), soil_known_to=_KNOWN_TO)
        diagnosis = diagnose(rows, prior, None, options)
        over = [name for name, gap in diagnosis.gap.items() if gap.fitted > gap.limit]
        if over:
            words = (
                f'the soil alone does not explain {", ".join(over)}: ask diagnose what is missing'
            )
            warnings.warn(words, stacklevel=2)
        fitted = cls._of(corrected(diagnosis)[0])
        if not over and 'sinkage' in rows.quantities and 'sinkage_offset' not in rest[0]:
            prior = configuration_of(wheel, start, {**rest[0], **_ZERO}, *rest[1:])
            free = cls._of(corrected(diagnose(rows, prior, None, options))[0])
            n, with_zero = float(fitted.sinkage_exponent), float(free.sinkage_exponent)
            own, std = fitted.std['sinkage_exponent'], free.std['sinkage_exponent']
            if abs(with_zero - n) > _SHIFT_FACTOR * max(math.sqrt(max(std**2 - own**2, 0.0)), own):
                words = (
                    f'sinkage_exponent is {n:.2f}, or {with_zero:.2f} if the sinkage sensor has a '
                    'zero error of some millimetres: read it on a hard floor'
                )
                warnings.warn(words, stacklevel=2)
        return fitted

    def replace(self, **changes: Any) -> Soil:
        """Return a soil with other values of some fields, or of ``friction_angle_deg`` [deg].

        Raises UserError for a name that is no field, with the nearest one.
        """
        known = [*(f.name for f in fields(self)), _DEGREES]
        for name in changes:
            if name not in known:
                raise UserError(f"Soil: no field '{name}'; did you mean '{nearest(name, known)}'?")
        if _DEGREES in changes:
            changes['friction_angle'] = math.radians(changes.pop(_DEGREES))
        changes.setdefault('std', {k: v for k, v in self.std.items() if k not in changes})
        return replace(self, **changes)

    def save(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Write a parameter file: ``--config`` of the commands, ``--params-file`` of the node.

        Raises UserError if the file exists and ``overwrite`` is False, or it cannot be written.
        """
        target = Path(path)
        check_file(target, overwrite)
        with new_file(target, overwrite) as temporary:
            ros_yaml.write(temporary, parameters_of(self), 'Soil, written by wheel_terra_estimator')
        return target

    @classmethod
    def _of(cls, configuration: Configuration) -> Soil:
        soil = configuration.soil
        numbers = {f.name: getattr(soil, f.name) for f in fields(soil)}
        source = configuration.soil_source
        return cls(**numbers, std=configuration.soil_std_stated, source=source)

    def __repr__(self) -> str:
        """Return the numbers with their units in four lines."""
        shown = [self._shown(name) for name in SOIL_NUMBERS]
        lines = (shown[:3], shown[3:6], shown[6:])
        return '\n  '.join(
            [f'Soil, pressure law {self.pressure_law}', *(', '.join(line) for line in lines)]
        )

    def _shown(self, name: str) -> str:
        value, std = getattr(self, name), self.std.get(name)
        if np.ndim(value):
            return f'{name} {value}'
        if name == 'friction_angle':
            unit = f'rad ({math.degrees(value):.2f} deg)'
        else:
            unit = declared()[f'soil.{name}'].unit
            unit = '' if self.pressure_law == 'reece' and name in _MODULI else unit
        text = f'{name} {value:.4g}' if abs(value) < 1e4 else f'{name} {value:.0f}'
        return (
            text + (f' +- {std:.2g}' if std else '') + (f' {unit}' if unit not in ('-', '') else '')
        )


def parameters_of(soil: terramechanics_soil.Soil) -> dict[str, ros_yaml.Value]:
    """Return the parameters of a configuration file for a soil."""
    values: dict[str, ros_yaml.Value] = {'soil.pressure_law': soil.pressure_law}
    std: Mapping[str, float] = {}
    if isinstance(soil, Soil):
        std, values['soil.source'] = soil.std, soil.source
    for name in SOIL_NUMBERS:
        ending, factor = ('_deg', math.degrees(1.0)) if name == 'friction_angle' else ('', 1.0)
        values[f'soil.{name}{ending}'] = factor * one_number(getattr(soil, name), f'soil: {name}')
        if name in std:
            values[f'soil.{name}_std{ending}'] = factor * float(std[name])
    return values


def configuration_of(
    wheel: Wheel,
    soil: terramechanics_soil.Soil,
    effects: EffectSettings,
    slip_radius: str,
    gravity: float,
) -> Configuration:
    """Return the configuration parameters of these objects."""
    of_files = "(of files: use Model.load('hit_wh3', 'hit_fit'))"
    check_kind(wheel, Wheel, 'wheel', f'Wheel(radius=0.13, width=0.16) {of_files}')
    check_kind(soil, terramechanics_soil.Soil, 'soil', f"Soil.load('dlr_mss') {of_files}")
    check_kind(effects, Mapping, 'effects', "{'lug_digging': {}} or {'lug_digging': {'kd': 1.0}}")
    for name, settings in effects.items():
        check_kind(settings, Mapping, f'effect {name}', 'its parameters, {} for the usual values')
    values: dict[str, Any] = {
        'wheels.names': ['wheel'],
        'slip_radius': slip_radius,
        'rover.gravity': float(gravity),
        **parameters_of(soil),
    }
    for f in fields(wheel):
        values[f'wheels.{f.name}'] = [one_number(getattr(wheel, f.name), f'wheel: {f.name}')]
    for name, settings in effects.items():
        values[f'effects.{name}.enabled'] = True
        values |= {f'effects.{name}.{key}': value for key, value in settings.items()}
    return reader.from_parameters(values, source='model', complete=False)


def _nearest(
    table: SteadyTable, wheel: Wheel, soils: Iterable[Soil], rest: tuple[EffectSettings, str, float]
) -> Soil:
    """Return the soil of Bekker's law whose plain model is nearest to the measured rows."""
    from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES, operating_points

    def state_of(soil: Soil) -> SteadyState:
        points = operating_points(table.columns, configuration_of(wheel, soil, *rest), table.name)
        return WheelSoilModel(soil, rest[0], 'closed_form').steady_state(points)

    def distance(soil: Soil) -> float:
        state = state_of(soil)
        total = 10.0 * float(np.mean(state.flags & OVERLOADED))  # rows that it does not carry
        for quantity, measured in zip(QUANTITIES, table.measured.T, strict=True):
            if np.isfinite(measured).any():
                error = np.sqrt(np.nanmean((getattr(state, quantity) - measured) ** 2))
                total += float(error / max(np.nanmax(np.abs(measured)), 1e-9))
        return total

    found = min((soil for soil in soils if soil.pressure_law == 'bekker'), key=distance)
    if (state_of(found).flags & OVERLOADED).any():
        raise UserError(
            f'{table.name}: no shipped soil carries these loads on this wheel; check the units of '
            'normal_load and wheel, or give the soil where the fit begins: start'
        )
    return found
