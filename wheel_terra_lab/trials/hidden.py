# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Effects of the hidden world: those of the catalogue, other formulas of them, and strangers.

``LISTED[name]`` follows the equations of the catalogue's sources; ``OTHER[name]``
stands for the same physical claim written with another formula (what a real soil would do to us);
``OUTSIDE[name]`` are effects that no catalogue entry describes. Each is a function
``(size, secondary, rows, soil) -> Hidden``: ``size`` is the main parameter in its own unit,
``secondary`` in 0..1 draws the second one (onset slip, layer depth).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wheel_terra_lab.trials.truth import (
    OUTPUTS,
    FloatArray,
    Hidden,
    Rows,
    Setup,
    TrueSoil,
    solve,
)

Prepare = Callable[[Setup, Rows], None]
Finish = Callable[[Rows, Setup, Rows], None]
Adds = Callable[[Rows, Setup, Rows], FloatArray]
REFERENCE_SPEED = 0.05  # rim speed [m/s] at which rate effects are zero
TINY = 1e-9  # keeps divisions finite


class Change(Hidden):
    """A hidden effect made of two functions."""

    def __init__(
        self,
        name: str,
        prepare: Prepare | None = None,
        finish: Finish | None = None,
        **second: float,
    ):
        self.name = name
        self.second = second  # further parameters by their name in the catalogue
        self._prepare, self._finish = prepare, finish

    def prepare(self, setup: Setup, rows: Rows) -> None:
        """Change the set-up in place."""
        if self._prepare:
            self._prepare(setup, rows)

    def finish(self, out: Rows, setup: Setup, rows: Rows) -> None:
        """Change the outcome in place."""
        if self._finish:
            self._finish(out, setup, rows)


@dataclass(frozen=True)
class Kind:
    """How an effect is drawn: function, typical and largest size, whether the sign is free."""

    make: Callable[[float, float, Rows, TrueSoil], Hidden]
    typical: Callable[[Rows, TrueSoil], float]
    largest: float  # in units of the typical size
    signed: bool = False
    needs: tuple[str, ...] = ()  # rows must vary in these columns, else nothing can be seen
    # One output that the effect cannot be seen without; empty = any will do.
    requires: str = ''
    all_or_nothing: bool = False  # a claim with no amplitude: half of the cases keep size 1


def adding(
    name: str, key: str, add: Adds, prepare: Prepare | None = None, **second: float
) -> Hidden:
    """Return an effect that adds to one output."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        out[key] = out[key] + add(out, setup, rows)

    return Change(name, prepare, finish, **second)


def _exponent(size: float, power: float) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        s = rows['slip']
        setup.exponent = setup.exponent + size * np.sign(s) * np.abs(s) ** power

    return Change('slip_sinkage_exponent', prepare)


def _peak_shift(size: float, power: float) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        s = rows['slip']
        setup.peak_ratio = setup.peak_ratio + size * np.sign(s) * np.abs(s) ** power

    return Change('stress_peak_shift', prepare)


def _mound(size: float, onset: float, law: str) -> Hidden:
    """Rear contact height z2 grows with slip (compendium 4.3: a ramp of power 1 to 2, or mass)."""

    def prepare(setup: Setup, rows: Rows) -> None:
        s = np.clip(rows['slip'], 0.0, 0.99)
        ramp = np.maximum(0.0, (s - onset) / (1 - onset))

        def leaving(t1: FloatArray, t2: FloatArray) -> FloatArray:
            z = setup.radius * (1 - np.cos(t1))
            if law == 'conveyance':  # what lugs and rim carry back, over what the rut offers
                band = rows['lug_height'] + 0.02 * setup.radius
                chi = band * s / np.maximum(z * (1 - s), TINY)
                rise = (chi / (1 + chi)) ** 2
            else:
                rise = ramp if law == 'hard ramp' else ramp**2
            rear = setup.radius * (1 - np.cos(t2)) + size * z * rise
            return -np.arccos(np.clip(1 - rear / setup.radius, -0.5, 1.0))

        setup.leaving.append(leaving)

    return Change('soil_mound', prepare, onset=onset)


def _other_mound(size: float, secondary: float) -> Hidden:
    law = 'conveyance' if secondary < 0.5 else 'hard ramp'
    return _mound(0.5 * size, 0.35 + 0.5 * (secondary - 0.5), law)


def _slope_gravity(size: float, only_pull: bool) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        if not only_pull:
            setup.load = setup.load * (1 - size * (1 - np.cos(rows['slope'])))

    def weight(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return -size * rows['normal_load'] * np.sin(rows['slope'])

    return adding('slope_gravity', 'drawbar_pull', weight, prepare)


def _bulldozing(size: float, soil: TrueSoil, rankine: bool) -> Hidden:
    def drag(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        z, phi = out['geometric_sinkage'], np.arctan(setup.tan_phi)
        weight = setup.density * rows['gravity']
        if rankine:  # passive earth pressure of a wall of height z
            passive = np.tan(np.pi / 4 + phi / 2)
            return (
                -size
                * setup.width
                * (weight * z**2 / 2 * passive**2 + 2 * setup.cohesion * z * passive)
            )
        slip_angle = np.pi / 4 - phi / 2  # Hegedus 1960, form of Ishigami 2007
        cot = 1 / np.tan(slip_angle)
        d1 = cot + np.tan(slip_angle + phi)
        d2 = cot + cot**2 * np.tan(phi)
        return -size * setup.width * d1 * (setup.cohesion * z + d2 * weight * z**2 / 2)

    return adding('bulldozing', 'drawbar_pull', drag)


def _cohesion(size: float, sliding: float) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        more = size * (1 - sliding * np.clip(rows['slip'], 0, 1))
        setup.cohesion = np.maximum(setup.cohesion + more, 0.0)

    return Change('cohesion', prepare)


def _multipass(size: float, linear: bool) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        earlier = rows['pass_number'] - 1
        gain = earlier if linear else 2 * (1 - 0.5**earlier)
        setup.stiffness = setup.stiffness * (1 + size * gain)

    return Change('multipass', prepare)


def _rate(size: float, logarithm: bool) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        ratio = np.abs(rows['angular_velocity']) * rows['wheel_radius'] / REFERENCE_SPEED
        factor = 1 + size * np.log(ratio) if logarithm else ratio**size
        setup.stiffness = setup.stiffness * np.maximum(factor, 0.05)

    return Change('rate_dependence', prepare)


def _layer(size: float, depth: float, power: float) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        # Same units for both powers: the stress at one depth below the layer's top is equal.
        setup.extra_normal.append(
            lambda true_depth: size * depth * (np.maximum(true_depth - depth, 0) / depth) ** power
        )

    return Change('hard_layer', prepare, depth=depth)


def layer_depth(secondary: float, rows: Rows, soil: TrueSoil) -> float:
    """Depth [m] of the layer: some rows reach it, others do not."""
    z = solve(rows, soil)['geometric_sinkage']
    low, high = np.nanquantile(z, 0.1), np.nanquantile(z, 0.95)
    return float(low * 0.6 + (high * 0.9 - low * 0.6) * (0.2 + 0.6 * secondary))


def _friction(size: float, with_load: float) -> Hidden:
    def more(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        load = rows['normal_load'] / np.mean(rows['normal_load'])
        return size * (1 - with_load + with_load * load) * np.sign(rows['angular_velocity'])

    return adding('drivetrain_friction', 'torque', more)


def _radius(size: float, whole_wheel: bool) -> Hidden:
    """Effective radius r (1 + e) against the configured r: 1 - s_true = (1 - s_recorded)/(1 + e).

    The other formula takes the whole contact on the larger wheel, more so under load.
    """

    def prepare(setup: Setup, rows: Rows) -> None:
        if whole_wheel:
            load = rows['normal_load'] / np.mean(rows['normal_load'])
            scale = 1 + size * (1 + 0.3 * (load - 1))
            setup.radius = setup.radius * scale
            setup.shear_radius = setup.shear_radius * scale
        else:
            setup.advance = setup.advance / (1 + size)

    return Change('wheel_radius_bias', prepare)


def _pitch(size: float, rotates: bool) -> Hidden:
    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        pull, load = out['drawbar_pull'], rows['normal_load']
        turned = pull * np.cos(size) + load * np.sin(size)
        out['drawbar_pull'] = turned if rotates else pull + load * np.sin(size)

    return Change('pitch_bias', None, finish)


def _reading(name: str, key: str, size: float, bent: float) -> Hidden:
    """Gain of a reading; the other formula saturates or grows with the reading."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        reading = out[key]
        share = np.abs(reading) / np.nanmax(np.abs(reading))
        out[key] = reading * (1.0 + size * (1.0 - bent * share))

    return Change(name, None, finish)


def _gain_kind(name: str, key: str, other: bool) -> Kind:
    def make(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
        return _reading(name, key, size, 0.4 if other else 0.0)

    return Kind(make, lambda rows, soil: 0.08, 5, signed=True, requires=key)


def _pull_zero(size: float, with_load: float) -> Hidden:
    def shift(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return size * (1 + with_load * (rows['normal_load'] / mean_load(rows) - 1))

    return adding('pull_zero', 'drawbar_pull', shift)


def _lug(rows: Rows) -> float:
    return float(np.max(rows['lug_height']))


def mean_load(rows: Rows) -> float:
    """Mean load of the rows [N]."""
    return float(np.mean(rows['normal_load']))


def mean_radius(rows: Rows) -> float:
    """Mean rim radius of the rows [m]."""
    return float(np.mean(rows['wheel_radius']))


def _digging(size: float, power: float) -> Hidden:
    def dug(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return size * rows['lug_height'] * np.abs(rows['slip']) ** power

    return adding('lug_digging', 'sinkage', dug)


def _support(size: float, proportional: float) -> Hidden:
    """Constant where there are lugs; a smooth wheel has none to carry (Ding 2010, eq. 20)."""

    def less(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        h = rows['lug_height']
        share = h / max(float(np.max(h)), TINY)
        return -size * np.where(h > 0, 1 - proportional + proportional * share, 0.0)

    return adding('lug_support', 'sinkage', less)


def _shear_radius(size: float, sliding: float) -> Hidden:
    def prepare(setup: Setup, rows: Rows) -> None:
        lam = size * (1 - sliding * np.clip(rows['slip'], 0, 1))
        setup.shear_radius = setup.shear_radius + lam * rows['lug_height']

    return Change('lug_shear_radius', prepare)


def _offset(size: float, gain: float) -> Hidden:
    def off(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return size + gain * size / 0.01 * out['sinkage']

    return adding('sinkage_offset', 'sinkage', off)


def stiffness_near(rows: Rows, soil: TrueSoil) -> float:
    """Slope of the bearing stress [Pa/m] at a depth of 5 % of the radius."""
    z = 0.05 * mean_radius(rows)
    k = soil.cohesive_modulus / float(np.mean(rows['wheel_width'])) + soil.frictional_modulus
    return k * soil.sinkage_exponent * z ** (soil.sinkage_exponent - 1)


def fixed(value: float) -> Callable[[Rows, TrueSoil], float]:
    """Return a typical size that is the same for all rows and soils."""
    return lambda rows, soil: value


def _kinds(other: bool) -> dict[str, Kind]:
    p = 1.5 if other else 1.0
    o = 0.3 if other else 0.0
    return {
        'slip_sinkage_exponent': Kind(lambda a, k, r, s: _exponent(a, p), fixed(0.2), 4),
        'lug_digging': Kind(
            lambda a, k, r, s: _digging(a, p),
            fixed(0.6),
            4,
            needs=('lug_height',),
            requires='sinkage',
        ),
        'lug_support': Kind(
            lambda a, k, r, s: _support(a, 1.0 if other else 0.0),
            lambda r, s: 0.15 * _lug(r),
            4,
            needs=('lug_height',),
            requires='sinkage',
        ),
        'lug_shear_radius': Kind(
            lambda a, k, r, s: _shear_radius(a, o), fixed(0.4), 2.5, needs=('lug_height',)
        ),
        'soil_mound': Kind(
            (lambda a, k, r, s: _other_mound(a, k))
            if other
            else (lambda a, k, r, s: _mound(a, 0.3 + 0.25 * k, 'ramp')),
            fixed(1.0),
            5,
        ),
        'stress_peak_shift': Kind(lambda a, k, r, s: _peak_shift(a, p), fixed(0.15), 2.5),
        'slope_gravity': Kind(
            lambda a, k, r, s: _slope_gravity(a, other),
            fixed(1.0),
            1,
            needs=('slope',),
            all_or_nothing=True,
        ),
        'bulldozing': Kind(
            lambda a, k, r, s: _bulldozing(a, s, other),
            fixed(0.6),
            4,
            requires='drawbar_pull',
        ),
        'cohesion': Kind(
            lambda a, k, r, s: _cohesion(a, o), lambda r, s: 0.8 * s.cohesion, 5, signed=True
        ),
        'multipass': Kind(
            lambda a, k, r, s: _multipass(a, other), fixed(0.3), 4, needs=('pass_number',)
        ),
        'rate_dependence': Kind(
            lambda a, k, r, s: _rate(a, other),
            fixed(0.1),
            3,
            signed=True,
            needs=('angular_velocity',),
        ),
        'hard_layer': Kind(
            lambda a, k, rows, soil: _layer(a, layer_depth(k, rows, soil), p),
            stiffness_near,
            20,
        ),
        'drivetrain_friction': Kind(
            lambda a, k, r, s: _friction(a, o),
            lambda r, s: 0.04 * mean_load(r) * mean_radius(r),
            5,
            requires='torque',
        ),
        'wheel_radius_bias': Kind(
            lambda a, k, r, s: _radius(a, other), fixed(0.03), 3, signed=True
        ),
        'sinkage_offset': Kind(
            lambda a, k, r, s: _offset(a, 0.02 if other else 0.0),
            lambda r, s: 0.012 * mean_radius(r),
            4,
            signed=True,
            requires='sinkage',
        ),
        'pull_zero': Kind(
            lambda a, k, r, s: _pull_zero(a, 0.3 if other else 0.0),
            lambda r, s: 0.03 * mean_load(r),
            4,
            signed=True,
            requires='drawbar_pull',
        ),
        'pull_gain': _gain_kind('pull_gain', 'drawbar_pull', other),
        'torque_gain': _gain_kind('torque_gain', 'torque', other),
        'sinkage_gain': _gain_kind('sinkage_gain', 'sinkage', other),
        'pitch_bias': Kind(
            lambda a, k, r, s: _pitch(a, other),
            fixed(0.02),
            4,
            signed=True,
            requires='drawbar_pull',
        ),
    }


LISTED = _kinds(other=False)
OTHER = _kinds(other=True)


def _hump(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def hump(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        centre = 0.2 + 0.4 * secondary
        return size * rows['normal_load'] * np.exp(-(((rows['slip'] - centre) / 0.1) ** 2))

    return adding('hump', 'drawbar_pull', hump)


def _crosstalk(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    return adding(
        'crosstalk', 'drawbar_pull', lambda out, setup, rows: size * out['torque'] / setup.radius
    )


def _softening(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """Friction angle falls from peak to residual as slip grows."""

    def prepare(setup: Setup, rows: Rows) -> None:
        s = np.clip(rows['slip'], 0, 1)
        setup.tan_phi = setup.tan_phi * (1 - size * (1 - np.exp(-s / 0.25)))

    return Change('friction_softening', prepare)


def _ripple(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    def ripple(out: Rows, setup: Setup, rows: Rows) -> FloatArray:
        return size * rows['normal_load'] * np.sin(2 * np.pi * (rows['slip'] / 0.25 + secondary))

    return adding('ripple', 'drawbar_pull', ripple)


def _saturation(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """The torque sensor flattens near the top of its range."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        torque = out['torque']
        top = np.nanmax(np.abs(torque))
        out['torque'] = torque * (1 - size * (np.abs(torque) / top) ** 4)

    return Change('torque_saturation', None, finish)


def _side_drag(size: float, secondary: float, rows: Rows, soil: TrueSoil) -> Hidden:
    """Both side walls rub in the soil: a drag on pull and torque that grows with depth cubed."""

    def finish(out: Rows, setup: Setup, rows: Rows) -> None:
        z, r = np.maximum(out['geometric_sinkage'], 0), setup.radius
        rub = size * setup.density * rows['gravity'] * setup.tan_phi * z**2 * np.sqrt(2 * r * z)
        out['torque'] = out['torque'] + rub * r
        out['drawbar_pull'] = out['drawbar_pull'] - rub

    return Change('side_drag', None, finish)


def _side_drag_unit(rows: Rows, soil: TrueSoil) -> float:
    """Size at which the drag is 1 % of the load at a depth of 5 % of the radius."""
    r = mean_radius(rows)
    z = 0.05 * r
    rub = soil.density * 9.81 * np.tan(soil.friction_angle) * z**2 * np.sqrt(2 * r * z)
    return float(0.01 * mean_load(rows) / rub)


OUTSIDE = {
    'hump': Kind(_hump, fixed(0.05), 10, signed=True),
    'crosstalk': Kind(_crosstalk, fixed(0.05), 10, signed=True),
    'friction_softening': Kind(_softening, fixed(0.1), 6),
    'ripple': Kind(_ripple, fixed(0.03), 12, signed=True),
    'torque_saturation': Kind(_saturation, fixed(0.1), 6),
    'side_drag': Kind(_side_drag, _side_drag_unit, 30),
}


class SmoothError(Hidden):
    """Smooth structural error: a random function of the inputs, a share of each output's range."""

    name = 'structure'

    def __init__(self, share: float, rows: Rows, clean: Rows, rng: np.random.Generator):
        columns = [
            rows[key] / scale
            for key, scale in (
                ('slip', 0.4),
                ('normal_load', 0.7 * mean_load(rows)),
                ('slope', 0.3),
                ('lug_height', 1.5 * max(_lug(rows), 1e-3)),
                ('wheel_radius', mean_radius(rows)),
            )
        ]
        x = np.stack(columns, 1)
        distance = ((x[:, None] - x[None]) ** 2).sum(-1)
        root = np.linalg.cholesky(np.exp(-distance / 2) + 1e-8 * np.eye(len(x)))
        self._error = {
            key: share * np.ptp(clean[key]) * (root @ rng.standard_normal(len(x)))
            for key in OUTPUTS
        }

    def finish(self, out: Rows, setup: Setup, rows: Rows) -> None:
        """Add the error."""
        for key, error in self._error.items():
            out[key] = out[key] + error
