# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Each form of an effect against a contact integrated by hand, written from the equations alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import brentq
from terra_tools import SAND, WHEEL, points, state

from wheel_terra_estimator.terramechanics.conditioned import INPUTS, ConditionedForces
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

K = SAND.cohesive_modulus / WHEEL.width + SAND.frictional_modulus
TAN = math.tan(SAND.friction_angle)
G = 9.80665
TIP = WHEEL.radius + WHEEL.lug_height
LOAD = 240.0


def plain_stress(sigma, depth, t, t1, t2):
    """Return the stress of the pressure-sinkage curve as it is."""
    return sigma


@dataclass
class ByHand:
    """One contact by the midpoint rule and a bracketed root; numbers of the sand unless changed."""

    slip: float
    load: float = LOAD
    r: float = WHEEL.radius
    R: float = WHEEL.radius
    k: float = K
    n: float = SAND.sinkage_exponent
    c1: float = SAND.peak_stress_ratio
    modulus: float = SAND.shear_modulus
    ratio: float = math.nan  # v/w
    # (stress, depth of the law, angle, t1, t2) -> stress
    stress: Callable = plain_stress

    def __post_init__(self) -> None:
        if math.isnan(self.ratio):
            s = self.slip
            self.ratio = TIP * (1.0 - s) if s >= 0.0 else TIP / (1.0 + s)

    def forces(self, t1: float) -> tuple[float, float, float]:
        tm, t2 = self.c1 * t1, SAND.leaving_angle_ratio * t1
        total = np.zeros(3)
        for low, high in ((t2, tm), (tm, t1)):
            t = low + (high - low) * (np.arange(4000) + 0.5) / 4000
            mirrored = t if high == t1 else t1 - (t - t2) / (tm - t2) * (t1 - tm)
            depth = self.r * (np.cos(mirrored) - math.cos(t1))
            sigma = self.stress(self.k * depth**self.n, depth, t, t1, t2)
            j = self.R * (t1 - t) - self.ratio * (math.sin(t1) - np.sin(t))
            grip = np.sign(j) * (1.0 - np.exp(-np.abs(j) / self.modulus))
            tau = (SAND.cohesion + sigma * TAN) * grip
            parts = (
                self.r * sigma * np.cos(t) + self.R * tau * np.sin(t),
                self.R * tau * np.cos(t) - self.r * sigma * np.sin(t),
                self.R * self.R * tau,
            )
            total += [np.sum(p) * (high - low) / 4000 * WHEEL.width for p in parts]
        return tuple(total)

    def solve(self) -> tuple[float, float, float, float]:
        """Sinkage, pull, torque, entrance angle."""
        t1 = brentq(lambda t: self.forces(t)[0] - self.load, 0.02, 1.5, xtol=1e-12)
        _, pull, torque = self.forces(t1)
        return self.r * (1.0 - math.cos(t1)), pull, torque, t1


def model(slip: float, name: str, load: float = LOAD, **others) -> np.ndarray:
    base, _, form = name.partition(':')
    values = others.pop('values', {})
    settings = {base: {**({'form': form} if form else {}), **values}}
    return state(slip, load, effects=settings, **others).outputs()[0]


def same(ours: np.ndarray, z: float, pull: float, torque: float) -> None:
    assert ours[0] == pytest.approx(z, rel=5e-4)
    assert ours[1] == pytest.approx(pull, rel=1e-3, abs=0.02)
    assert ours[2] == pytest.approx(torque, rel=1e-3, abs=0.003)


SLIPS = (-0.3, 0.1, 0.6)


@pytest.mark.parametrize('slip', SLIPS)
def test_hand_and_model_agree_without_effects(slip: float) -> None:
    same(state(slip, LOAD).outputs()[0], *ByHand(slip).solve()[:3])


@pytest.mark.parametrize('slip', SLIPS)
def test_hard_layer_in_both_forms(slip: float) -> None:
    def ramp(x: np.ndarray) -> np.ndarray:
        inside = np.clip(x, 0.0, None)
        return 8e6 * np.where(inside < 1e-3, inside**2 / 2e-3, inside - 5e-4)

    def true_depth(sigma, depth, t, t1, t2):
        return sigma + ramp(WHEEL.radius * (np.cos(t) - math.cos(t1)) - 0.008)

    def bearing(sigma, depth, t, t1, t2):
        return sigma + ramp(depth - 0.008)

    values = {'stiffness': 8e6, 'depth': 0.008}
    for form, law in (('true_depth', true_depth), ('bearing', bearing)):
        settings = {'hard_layer': {'form': form, **values}}
        hand = ByHand(slip, stress=law).solve()[:3]
        fine = WheelSoilModel(SAND, settings, nodes=80).steady_state(points(slip, LOAD))
        same(fine.outputs()[0], *hand)
        # The usual eight nodes lie across the edge of this very stiff layer.
        usual = state(slip, LOAD, effects=settings).outputs()[0]
        assert usual == pytest.approx(hand, rel=0.01)


@pytest.mark.parametrize('slip', SLIPS)
def test_second_pass_starts_from_the_rut(slip: float) -> None:
    def precompressed(sigma, depth, t, t1, t2):
        return K * (depth + 0.006) ** SAND.sinkage_exponent

    z, pull, torque, _ = ByHand(slip, stress=precompressed).solve()
    ours = model(slip, 'multipass:rut', values={'rut': 0.006}, pass_number=2)
    same(ours, z + 0.006, pull, torque)
    first = model(slip, 'multipass:rut', values={'rut': 0.006}, pass_number=1)
    assert first == pytest.approx(state(slip, LOAD).outputs()[0])
    # A wheel of the same load that starts where another stopped hardly sinks further.
    deep = state(slip, LOAD).sinkage[0]
    again = model(slip, 'multipass:rut', values={'rut': deep}, pass_number=2)[0] - deep
    assert again < 0.45 * deep


@pytest.mark.parametrize('slip', SLIPS)
def test_stress_peak_moves_backward(slip: float) -> None:
    hand = ByHand(slip, c1=SAND.peak_stress_ratio - 0.25 * slip).solve()
    same(model(slip, 'stress_peak_shift:backward', values={'retreat': 0.25}), *hand[:3])


@pytest.mark.parametrize('slip', SLIPS)
def test_shear_deformation_grows_with_pressure(slip: float) -> None:
    pressure = LOAD / (WHEEL.width * WHEEL.radius)
    hand = ByHand(slip, modulus=SAND.shear_modulus * (pressure / 3000.0) ** 0.7).solve()
    same(model(slip, 'shear_deformation:pressure', values={'growth': 0.7}), *hand[:3])
    hand = ByHand(slip, modulus=1.5 * SAND.shear_modulus).solve()
    same(model(slip, 'shear_deformation', values={'log_factor': math.log(1.5)}), *hand[:3])


@pytest.mark.parametrize('slip', SLIPS)
def test_sticking_soil_is_a_larger_wheel_or_a_tension(slip: float) -> None:
    d = 0.004
    z, pull, torque, _ = ByHand(slip, r=WHEEL.radius + d, R=WHEEL.radius + d).solve()
    same(model(slip, 'soil_adhesion', values={'thickness': d}), z - d, pull, torque)

    def held_back(sigma, depth, t, t1, t2):
        return sigma - 900.0 * np.clip(t / t2, 0.0, None)

    hand = ByHand(slip, stress=held_back).solve()
    same(model(slip, 'soil_adhesion:tension', values={'tension': 900.0}), *hand[:3])


@pytest.mark.parametrize('slip', SLIPS)
def test_a_flattened_wheel_is_the_circle_of_the_same_chord(slip: float) -> None:
    r, n = WHEEL.radius, SAND.sinkage_exponent
    rigid = (3.0 * LOAD / ((3.0 - n) * WHEEL.width * K * math.sqrt(2.0 * r))) ** (2 / (2 * n + 1))
    f = 1.5e-5 * LOAD
    flat = r * (1.0 + f / rigid)
    # Chord of half length a: z + f on the circle of the rim, z on the flatter one.
    a = math.sqrt(2.0 * r * (rigid + f))
    assert a * a / (2.0 * flat) == pytest.approx(rigid, rel=1e-12)
    ratio = (TIP * (1 - slip) if slip >= 0 else TIP / (1 + slip)) * flat / r
    z, pull, torque, _ = ByHand(slip, r=flat, R=flat, ratio=ratio).solve()
    same(
        model(slip, 'wheel_flexibility', values={'compliance': 1.5e-5}), z, pull, torque * r / flat
    )


def test_channel_effects_are_what_they_say() -> None:
    for slip in SLIPS:
        z, pull, torque = state(slip, LOAD).outputs()[0]
        zero = model(slip, 'pull_zero', values={'offset': 3.0})
        assert zero == pytest.approx([z, pull + 3.0, torque])
        assert model(slip, 'pull_gain', values={'gain': 0.2})[1] == pytest.approx(1.2 * pull)
        assert model(slip, 'torque_gain', values={'gain': -0.1})[2] == pytest.approx(0.9 * torque)
        assert model(slip, 'sinkage_gain', values={'gain': 0.3})[0] == pytest.approx(1.3 * z)
        share = model(slip, 'drivetrain_friction:proportional', values={'share': 0.2})[2]
        assert share == pytest.approx(torque + 0.2 * abs(torque))
        viscous = model(
            slip, 'drivetrain_friction:viscous', values={'damping': 0.5}, angular_velocity=2.0
        )
        assert viscous[2] == pytest.approx(torque + 1.0)
    back = model(0.3, 'drivetrain_friction:viscous', values={'damping': 0.5}, angular_velocity=-2.0)
    assert back[2] == pytest.approx(-state(0.3, LOAD).torque[0] - 1.0)
    unknown = model(
        0.3, 'drivetrain_friction:viscous', values={'damping': 0.5}, angular_velocity=math.nan
    )
    assert unknown[2] == pytest.approx(state(0.3, LOAD).torque[0])


def test_a_gain_acts_before_a_zero_error_and_after_the_soil() -> None:
    settings = {
        'sinkage_offset': {'offset': 0.002},
        'sinkage_gain': {'gain': 0.2},
        'lug_digging': {'kd': 1.0},
    }
    z = state(0.5, LOAD).sinkage[0]
    read = state(0.5, LOAD, effects=settings).sinkage[0]
    assert read == pytest.approx(1.2 * (z + 0.5 * WHEEL.lug_height) + 0.002)


def test_lug_terms() -> None:
    z = state(0.5, LOAD).sinkage[0]
    for height, saved in ((0.005, 0.0), (0.010, 0.0015), (0.015, 0.003)):
        wheel = Wheel(WHEEL.radius, WHEEL.width, height, 30)
        plain = state(0.5, LOAD, wheel=wheel).sinkage[0]
        carried = model(0.5, 'lug_support:by_height', wheel=wheel)[0]
        assert plain - carried == pytest.approx(saved, abs=1e-9)  # Ding et al. 2010, 3.2.2
    dug = model(0.5, 'lug_digging:saturating', values={'kd': 1.0, 'range': 0.25})[0]
    assert dug - z == pytest.approx(WHEEL.lug_height * (1.0 - math.exp(-2.0)))


def test_bulldozing_after_terzaghi() -> None:
    """Printed bearing factors of Terzaghi at 30 degrees: Nc 37.2, Nq 22.5, Ng 19.7."""
    phi = math.radians(30.0)
    soil = Soil(**{**SAND.__dict__, 'friction_angle': phi})
    z, pull, _ = state(0.2, LOAD, soil=soil).outputs()[0]
    pushed = model(0.2, 'bulldozing:terzaghi', values={'kb': 1.0}, soil=soil)[1]
    t1 = math.acos(1.0 - z / WHEEL.radius)
    a = 0.5 * (math.pi - t1)
    k_c = (37.2 - math.tan(phi)) * math.cos(phi) ** 2
    k_g = (2.0 * 19.7 / math.tan(phi) + 1.0) * math.cos(phi) ** 2
    front = math.sin(a + phi) / (2.0 * math.sin(a) * math.cos(phi))
    weight = soil.density * G
    expected = WHEEL.width * front * (2.0 * z * soil.cohesion * k_c + weight * z * z * k_g)
    assert pull - pushed == pytest.approx(expected, rel=0.03)


def test_textbook_grousers_carry_the_whole_surcharge() -> None:
    """Rankine: Np = 3.246 at 32 degrees; the two forms differ by q h (Np - (Np - 1) s)."""
    slip = 0.4
    z, pull, torque = state(slip, LOAD).outputs()[0]
    t1 = math.acos(1.0 - z / WHEEL.radius)
    span = t1 * (1.0 - SAND.leaving_angle_ratio)
    h, engaged = WHEEL.lug_height, 30 * span / (2.0 * math.pi)
    passive = (1.0 + math.sin(SAND.friction_angle)) / (1.0 - math.sin(SAND.friction_angle))
    q = LOAD / (WHEEL.width * WHEEL.radius * span)
    blade = 0.5 * SAND.density * G * h * h * passive + 2 * SAND.cohesion * h * math.sqrt(passive)
    grown = 1.0 - math.exp(-slip * WHEEL.radius * span / SAND.shear_modulus)
    for name, surcharge in (
        ('grouser_thrust', (passive - 1.0) * slip),
        ('grouser_thrust:textbook', passive),
    ):
        thrust = WHEEL.width * engaged * (blade + q * h * surcharge) * grown
        ours = model(slip, name, values={'share': 1.0})
        assert ours[1] - pull == pytest.approx(thrust, rel=1e-9)
        assert ours[2] - torque == pytest.approx(thrust * (WHEEL.radius + h / 2), rel=1e-9)


def test_soil_carried_round_balances_volume_and_energy() -> None:
    slip, fill = 0.5, 0.8
    z, pull, torque = state(slip, LOAD).outputs()[0]
    ours = model(slip, 'soil_transport', values={'fill': fill})
    rate = 3.0  # [rad/s]; the balances hold at any
    volume = fill * WHEEL.lug_height * slip * WHEEL.width * rate * WHEEL.radius  # m^3/s
    power = volume * SAND.density * G * 2.0 * WHEEL.radius
    assert (ours[2] - torque) * rate == pytest.approx(power)
    assert (ours[0] - z) * WHEEL.width * rate * WHEEL.radius == pytest.approx(volume)
    assert ours[1] == pytest.approx(pull)


ON_STRESS = {'hard_layer', 'hard_layer:bearing', 'multipass:rut', 'soil_adhesion:tension'}
VARIANTS = [form.name for effect in catalogue().values() for form in effect.forms]


@pytest.mark.parametrize('name', [name for name in VARIANTS if name not in ON_STRESS])
@pytest.mark.parametrize('slip', [-0.3, 0.4])
def test_the_filter_s_forces_from_the_sinkage_agree_with_the_model(name: str, slip: float) -> None:
    """What stands at the sinkage of the steady state gives its torque and pull."""
    steady = state(slip, 150.0, effects={name: {}}, method='closed_form', angular_velocity=2.0)
    wheel = ConditionedForces(WHEEL, SAND, {name: {}})
    ratio = 1.0 - slip if slip >= 0.0 else 1.0 / (1.0 + slip)
    known = {'rim_speed': 2.0 * WHEEL.radius}
    args = [ratio, steady.sinkage[0], 150.0, SAND.cohesion, TAN, SAND.shear_modulus]
    forces = wheel.forces(0, *args, **known)
    for way in ({}, {'direction': -1.0}, {'leaving_angle': -0.2}):
        full = wheel.forces(0, *args, **known, **way)
        alone = wheel.forces(0, *args, **known, **way, derivatives=False)
        assert (alone.torque, alone.drawbar_pull) == (full.torque, full.drawbar_pull)
    # In skid the filter's form keeps one place per side, the model takes four.
    share = 2e-3 if slip > 0.0 else 0.03
    assert forces.torque == pytest.approx(steady.torque[0], rel=share, abs=0.01)
    assert forces.drawbar_pull == pytest.approx(steady.drawbar_pull[0], rel=share, abs=0.1)
    for column, _ in enumerate(INPUTS[:6]):
        step = 1e-4 * args[column]
        pairs = []
        for sign in (1.0, -1.0):
            moved = list(args)
            moved[column] += sign * step
            pairs.append(wheel.forces(0, *moved, **known))
        torque = (pairs[0].torque - pairs[1].torque) / (2.0 * step)
        pull = (pairs[0].drawbar_pull - pairs[1].drawbar_pull) / (2.0 * step)
        assert forces.d_torque[column] == pytest.approx(torque, rel=2e-3, abs=1e-6 / step)
        assert forces.d_pull[column] == pytest.approx(pull, rel=2e-3, abs=1e-5 / step)
