# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The statistics against brute force: evidence, tests, noise, outliers, Jacobians."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy
from scipy.optimize import least_squares

from wheel_terra_estimator.discrepancy.assessment import held_out
from wheel_terra_estimator.discrepancy.assessment.along import changed_stretch
from wheel_terra_estimator.discrepancy.assessment.where import locate
from wheel_terra_estimator.discrepancy.decision import _strength
from wheel_terra_estimator.discrepancy.fitting import noise
from wheel_terra_estimator.discrepancy.fitting import noise as outliers
from wheel_terra_estimator.discrepancy.fitting.coordinates import (
    EFFECT_SCALES,
    EFFECT_SHARES,
    WIDENING,
    WORSE_SHARE,
    Coordinate,
    bounds,
    effect_coordinates,
    soil_coordinates,
)
from wheel_terra_estimator.discrepancy.fitting.evidence import Floor, evidence
from wheel_terra_estimator.discrepancy.fitting.forward import Forward
from wheel_terra_estimator.discrepancy.fitting.gauss_newton import Fit, fit
from wheel_terra_estimator.discrepancy.fitting.problem import (
    CommonError,
    build_problem,
    kernel,
    over_covariance,
    slip_features,
)
from wheel_terra_estimator.discrepancy.report.words import _repeatability
from wheel_terra_estimator.discrepancy.result import Noise
from wheel_terra_estimator.discrepancy.selection import verdict as gap_test
from wheel_terra_estimator.discrepancy.selection.signatures import shapes
from wheel_terra_estimator.discrepancy.selection.verdict import _competitors
from wheel_terra_estimator.discrepancy.selection.weights import Setting, default_floors
from wheel_terra_estimator.discrepancy.tables.checks import check_table
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_estimator.terramechanics.model import WheelSoilModel
from wheel_terra_estimator.terramechanics.operating_points import OperatingPoints
from wheel_terra_estimator.terramechanics.soil import Soil
from wheel_terra_estimator.terramechanics.wheel import Wheel

NUMBER = re.compile(r'(\d+(?:\.\d+)?)( %)?')
SOIL = Soil(15600.0, 2.4e6, 1.1, 250.0, np.radians(31.9), 0.011, 0.4, -0.2)
WHEEL = Wheel(0.157, 0.165, 0.01, 30.0, 0.002)


@pytest.fixture(scope='module')
def forward():
    slip = np.tile(np.linspace(0.03, 0.8, 8), 2)
    points = OperatingPoints(
        slip, np.repeat([60.0, 110.0], 8), WHEEL, pass_number=np.tile([1, 2], 8)
    )
    return Forward(points, SOIL, {}, catalogue())


def test_less_cohesion_than_none_is_none(forward):
    """A fit may look there; the wheel on soil without cohesion is what it sees."""
    cohesion = effect_coordinates(catalogue()['cohesion'])
    less = np.array([cohesion[0].coordinate(-2.0 * SOIL.cohesion)])
    found = forward.solve([cohesion], [less], jacobian=False).outputs[0]
    loose = WheelSoilModel(replace(SOIL, cohesion=0.0), {}).steady_state(forward.points)
    assert found[:, 1] == pytest.approx(loose.drawbar_pull, rel=1e-4)


@pytest.fixture(scope='module')
def setting(forward):
    """Truth, inputs and noise of a table on these points."""
    soil = soil_coordinates(SOIL, {})
    truth = forward.solve([soil], [np.zeros(len(soil))], jacobian=False).outputs[0]
    truth[:, 3] = np.nan  # no lateral force measured
    std = np.broadcast_to([4e-4, 1.0, 0.1, np.nan], truth.shape)
    points = forward.points
    inputs = np.column_stack([points.slip / 0.8, (points.normal_load - 60.0) / 50.0])
    return soil, truth, std, inputs, np.ptp(truth, axis=0)


def of_soil(forward, problem, soil, variance, *more):
    """Return the fit of the soil alone."""
    start = [np.zeros(len(soil))]
    return fit(forward, problem, [((), soil)], start, variance, *more)[0]


def smooth_error(problem, inputs, scale, amplitude):
    """Return the dense covariance of a structural error."""
    row, quantity = problem.row, problem.quantity
    alike = kernel(inputs)[np.ix_(row, row)] * (quantity[:, None] == quantity[None, :])
    return alike * np.outer(scale[quantity], scale[quantity]) * amplitude**2


@pytest.mark.parametrize(
    ('source', 'row'), [('', '| empty'), ('published', '| `published`'), ('proxy', '| `proxy`')]
)
def test_soil_numbers_are_known_as_well_as_the_documentation_says(source, row):
    """Logarithms to a share, the others to what stands there, cohesion to a share and pascals."""
    page = (Path(__file__).parents[2] / 'docs' / 'diagnose.md').read_text(encoding='utf-8')
    cells = next(line for line in page.splitlines() if line.startswith(row)).split('|')[2:8]
    modulus, exponent, friction, shear, (share, pascal), ratios = (
        [float(n) * (0.01 if percent else 1.0) for n, percent in NUMBER.findall(cell)]
        for cell in cells
    )
    expected = [*modulus, *exponent, *friction, *shear, share * SOIL.cohesion + pascal]
    expected += [ratios[0], ratios[-1]]
    found = [c.scale / WIDENING for c in soil_coordinates(SOIL, {}, source)]
    assert found == pytest.approx(expected)


def test_batched_model_is_the_package_model(forward):
    """Outputs and Jacobians against terramechanics, one hypothesis at a time, other steps."""
    soil = soil_coordinates(SOIL, {})
    names = [name for name, effect in catalogue().items() if effect.candidate]
    hypotheses = [(*soil, *effect_coordinates(catalogue()[name])) for name in names]
    u = [
        np.concatenate([np.zeros(len(soil)), np.full(len(h) - len(soil), 0.4)]) for h in hypotheses
    ]
    state = forward.solve(hypotheses, u)
    for b, name in enumerate(names):
        own = effect_coordinates(catalogue()[name])
        values = {c.name: float(c.value(0.4)) for c in own}
        expected = WheelSoilModel(SOIL, {name: values}).steady_state(forward.points)
        scale = np.abs(expected.outputs()).max(axis=0)
        np.testing.assert_allclose(
            state.outputs[b][:, :3] / scale, expected.outputs() / scale, atol=3e-4
        )
        places = [4, *range(len(soil), len(soil) + len(own))]
        for c, column in zip((soil[4], *own), places, strict=True):
            step = 1e-3 * c.scale
            ends = []
            for change in (step, -step):
                moved = SOIL, {**values, c.name: values.get(c.name, 0.0) + change}
                if c.owner == 'soil':
                    moved = replace(SOIL, cohesion=SOIL.cohesion + change), values
                model = WheelSoilModel(moved[0], {name: moved[1]})
                ends.append(model.steady_state(forward.points).outputs())
            mine = state.jacobian[b][:, :3, column] / scale
            theirs = (ends[0] - ends[1]) / 2e-3 / scale
            np.testing.assert_allclose(mine, theirs, atol=2e-3 + 0.02 * np.abs(theirs).max())


def linear_fit(rng, problem, at=0.0):
    """A linear model of a soil and an effect's parameter, linearised where both are `at`."""
    coordinates = (
        Coordinate('soil', 'a', 0.0, 1.0),
        Coordinate('e', 'b', 0.0, 1.0, 0.0, 3.0, role='strength'),
    )
    sensitivity = rng.standard_normal((problem.size, 2)) * problem.std[:, None]
    residual = problem.rotation @ (problem.observed - sensitivity.sum(axis=1) * at)
    u, outputs = np.full(2, at), np.zeros((problem.size // 3, 4))
    outputs[problem.row, problem.quantity] = sensitivity @ u
    rotated, ones, none = problem.rotation @ sensitivity, np.ones(2), np.zeros(problem.size // 3)
    variance = np.ones(problem.size)
    return Fit(('e',), coordinates, u, outputs, none, sensitivity, residual, rotated, variance,
               0.0, ones)  # fmt: skip


def test_evidence_is_the_integral_over_parameters(setting):
    """A linear model with one soil and one bounded effect parameter, against a grid."""
    rng = np.random.default_rng(1)
    _, truth, std, inputs, scale = setting
    measured = std * rng.standard_normal(truth.shape)
    problem = build_problem(measured, std, inputs, scale)
    model = linear_fit(rng, problem)
    amplitude = 0.02
    floor = Floor((amplitude,) * 4, 0.0, False)
    got = evidence(problem, model, (floor,))[0]

    smooth = smooth_error(problem, inputs, scale, amplitude)
    density = scipy.stats.multivariate_normal(
        np.zeros(problem.size), np.diag(problem.std**2) + smooth
    )
    total = 0.0
    for width, share in ((1 / WIDENING, 1 - WORSE_SHARE), (1.0, WORSE_SHARE)):
        for size, part in zip(EFFECT_SCALES, EFFECT_SHARES, strict=True):
            a = np.linspace(-6, 6, 121) * width
            b = (np.arange(300) + 0.5) / 100.0
            mesh = np.array([(x, y) for x in a for y in b])
            likelihood = density.pdf(problem.observed - mesh @ model.sensitivity.T)
            prior_a = np.exp(-0.5 * (mesh[:, 0] / width) ** 2)
            prior_b = np.exp(-0.5 * (mesh[:, 1] / size) ** 2)
            prior = prior_a * prior_b / (prior_a * prior_b).sum()
            total += share * part * float(likelihood @ prior)
    assert got == pytest.approx(np.log(total), abs=0.02)


def test_rotation_gives_the_dense_covariance(setting):
    _, truth, std, inputs, scale = setting
    by_slip = np.outer(np.linspace(1, 2, len(truth)), [1e-3, 5.0, 1.0])
    group = np.arange(len(truth)) // 2
    common = CommonError(by_slip, np.full(len(truth), 0.02), group)
    problem = build_problem(truth, std, inputs, scale, common=[common])
    back = np.linalg.inv(problem.rotation)
    dense = (back * problem.variance(0.03)) @ back.T
    row, quantity = problem.row, problem.quantity
    expected = np.diag(problem.std**2)
    error = 0.02 * by_slip[row, quantity]
    expected += np.outer(error, error) * (group[row][:, None] == group[row][None, :])
    expected += smooth_error(problem, inputs, scale, 0.03)
    root = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        dense / np.outer(root, root), expected / np.outer(root, root), atol=1e-8
    )


def test_gap_test_is_calibrated(forward, setting):
    """P-values of tables in which nothing is missing are uniform; a real effect gives tiny ones."""
    soil, truth, std, inputs, scale = setting
    rng = np.random.default_rng(3)
    problem = build_problem(truth, std, inputs, scale)
    one = np.ones(problem.size)
    at_truth = of_soil(forward, problem, soil, one, None, 3)
    squares = []
    for _ in range(200):
        shift = at_truth.sensitivity @ rng.standard_normal(len(soil))
        cells = problem.observed + shift + problem.std * rng.standard_normal(problem.size)
        case = replace(at_truth, residual=problem.rotation @ (cells - problem.observed))
        squares.append(gap_test.chi_square_p_value(case, one))
    assert scipy.stats.kstest(squares, 'uniform').pvalue > 1e-3
    digging = problem.rotation @ problem.flat(np.outer(0.004 * forward.points.slip, [1.0, 0, 0]))
    real = replace(at_truth, residual=digging)
    assert gap_test.chi_square_p_value(real, one) < 1e-3


def test_cells_left_out_are_marginalised(setting):
    """The inverse covariance without a group of cells against dense algebra."""
    rng = np.random.default_rng(4)
    _, truth, std, inputs, scale = setting
    problem = build_problem(std * rng.standard_normal(truth.shape), std, inputs, scale)
    amplitude, row = 0.02, problem.row
    noise = np.diag(problem.std**2) + smooth_error(problem, inputs, scale, amplitude)
    inverse = (problem.rotation.T / problem.variance(amplitude)) @ problem.rotation
    for label in range(4):
        out = row % 4 == label
        weight = np.linalg.inv(noise[np.ix_(~out, ~out)])
        found = held_out._without(inverse, np.flatnonzero(out))
        np.testing.assert_allclose(found[np.ix_(~out, ~out)], weight, rtol=1e-6, atol=1e-6)
        assert not found[out].any()
        assert not found[:, out].any()


def test_held_out_rows_are_predicted_by_a_fit_without_them():
    """Against scipy's bounded least squares; the soil is hardly known and one number at a bound."""
    slip = np.tile([0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6], 3)
    smooth = Wheel(0.14, 0.15, 0.0, 0.0, 0.0)
    points = OperatingPoints(slip, np.repeat([60.0, 90.0, 120.0], 8), smooth)
    loose = Soil(5790.0, 180e3, 0.8, 300.0, np.radians(17.8), 0.01, 0.4, 0.0)
    coordinates = soil_coordinates(loose, {}, 'published')
    forward = Forward(points, loose, {}, catalogue())
    rng = np.random.default_rng(6)
    true = np.clip(0.2 * rng.standard_normal(len(coordinates)), *bounds(coordinates))
    measured = forward.solve([coordinates], [true], jacobian=False).outputs[0]
    std = np.broadcast_to([5e-4, 0.6, 0.06, np.nan], measured.shape)
    measured = measured + std * rng.standard_normal(measured.shape)
    inputs = np.column_stack([slip / 0.6, points.normal_load / 60.0])
    problem = build_problem(measured, std, inputs, np.ptp(measured, axis=0))
    variance = problem.variance(0.0)
    start = [np.zeros(len(coordinates))]
    whole = fit(forward, problem, [((), coordinates)], start, variance)[0]
    groups = np.tile(np.arange(8), 3)
    work = Setting(forward, problem, coordinates, {}, (), 0.0)
    found = held_out.hold_out(work, [whole], variance, groups)[0]

    def predicted(u):
        return forward.solve([coordinates], [u], jacobian=False).outputs[0]

    for label in (1, 6):
        kept = groups != label

        def misfit(u, kept=kept):
            cells = ((predicted(u) - measured) / std)[kept, :3].ravel()
            return np.concatenate([cells, np.sqrt(whole.prior) * u])

        best = least_squares(misfit, whole.u, bounds=bounds(coordinates)).x
        off = (found - predicted(best))[~kept, :3] / std[0, :3]
        assert np.abs(off).max() < 0.2


def test_a_cell_that_the_model_takes_whole_is_no_outlier(setting):
    _, truth, std, inputs, scale = setting
    problem = build_problem(truth, std, inputs, scale)
    inverse = np.diag(1.0 / problem.std**2)
    inverse[7, 7] = -1e-12  # as rounding leaves it
    target = np.zeros(problem.size)
    target[3] = 9.0 * problem.std[3]
    with np.errstate(all='raise'):
        _, found = noise._rejected_cells(problem, inverse, target)
    assert [cell[:2] for cell in found] == [(problem.row[3], problem.quantity[3])]


def test_outliers_are_found_and_a_hump_is_none(forward, setting):
    soil, truth, std, inputs, scale = setting
    rng = np.random.default_rng(5)
    narrow = slip_features(inputs, 0)

    def cells_apart(measured):
        problem = build_problem(measured, std, inputs, scale)
        nothing = of_soil(forward, problem, soil, problem.variance(0.02))
        found = noise.find_outliers(problem, nothing, 0.25, narrow)
        return {cell[:2] for cell in found}

    clean = truth + std * rng.standard_normal(truth.shape)
    assert not cells_apart(clean)
    spoilt = clean.copy()
    spoilt[3, 1] += 9.0 * std[3, 1]
    spoilt[10, 0] -= 9.0 * std[10, 0]
    assert cells_apart(spoilt) == {(3, 1), (10, 0)}
    hump = clean.copy()
    hump[[3, 11], 1] += 9.0 * std[3, 1]  # the same slip at both loads
    assert not cells_apart(hump) & {(3, 1), (11, 1)}


def test_noise_is_estimated_beside_an_effect_and_never_none(forward, setting):
    soil, truth, std, inputs, scale = setting

    def estimated(measured, row=0, common=()):
        guess = np.broadcast_to(0.01 * scale, truth.shape)
        problem = build_problem(measured, guess, inputs, scale, common=common)
        nothing = of_soil(forward, problem, soil, problem.variance(0.1))
        origin = dict.fromkeys(('sinkage', 'drawbar_pull', 'torque'), 'estimated')
        after = noise.estimate_noise(
            Noise(guess, origin),
            nothing,
            [np.ones(len(truth)), shape],
            lambda std: build_problem(measured, std, inputs, scale, common=common),
        )
        return after.std[row, :3]

    shape = np.repeat([0.35, 1.37], 8)  # of another noise: four times as large at the heavier load

    rng, bent = np.random.default_rng(7), truth.copy()
    bent[:, 0] += 0.006 * forward.points.slip  # an effect of many deviations
    ratios = [
        estimated(bent + std * rng.standard_normal(truth.shape)) / std[0, :3] for _ in range(6)
    ]
    assert np.all(np.exp(np.mean(np.log(ratios), axis=0)) == pytest.approx(1.0, rel=0.3))
    # Errors of the slip, which pull and torque feel far beyond their noise, are no noise of theirs.
    slope = forward.by_input(
        'slip',
        soil,
        np.zeros(len(soil)),
        forward.solve([soil], [np.zeros(len(soil))], jacobian=False).angle[0],
    )
    misread = CommonError(slope, np.full(len(truth), 0.02), np.arange(len(truth)))
    ratios = []
    for _ in range(12):
        off = slope * (0.02 * rng.standard_normal(len(truth)))[:, None]
        drawn = truth + off + std * rng.standard_normal(truth.shape)
        ratios.append(estimated(drawn, common=[misread]) / std[0, :3])
    usual = np.exp(np.mean(np.log(ratios), axis=0))  # of few rows seldom less than 2 % of the range
    assert np.all((usual > 0.7) & (usual < 1.7))
    # Rows without scatter, read off a curve: half a per cent of the range at least.
    assert (estimated(truth) > 0.005 * scale[:3]).all()
    loud = truth + std * shape[:, None] * rng.standard_normal(truth.shape)
    assert (estimated(loud, -1) > 3.0 * estimated(loud)).any()


def test_a_load_that_hardly_grows_with_the_angle_is_bracketed_without_a_warning(
    forward, monkeypatch
):
    def step(_, contact, terms, angle):
        share = np.where(angle < 0.5, 1e-6 * (1.0 + 1e-3 * angle), 2.0)
        outputs = np.repeat(angle[..., None], 4, axis=-1)
        return contact.normal_load * (share - 1.0), outputs

    monkeypatch.setattr(Forward, '_response', step)
    with np.errstate(over='raise'):
        found = forward.solve([()], [np.zeros(0)], jacobian=False)
    np.testing.assert_allclose(found.angle, 0.5, rtol=1e-6)


def test_noise_of_six_rows_is_hardly_taken_for_less_than_it_is(forward, setting, rng):
    soil, truth, std, inputs, scale = setting
    guess = np.broadcast_to(0.02 * scale, truth.shape)
    origin = dict.fromkeys(('sinkage', 'drawbar_pull', 'torque'), 'estimated')
    ratios = []
    for _ in range(60):
        measured = truth + std * rng.standard_normal(truth.shape)
        measured[rng.permutation(len(truth))[6:]] = np.nan
        problem = build_problem(measured, guess, inputs, scale)
        nothing = of_soil(forward, problem, soil, problem.variance(0.01))
        found = noise.estimate_noise(
            Noise(guess, origin),
            nothing,
            [np.ones(len(truth))],
            lambda std, measured=measured: build_problem(measured, std, inputs, scale),
        )
        ratios.append(found.std[0, 0] / std[0, 0])
    assert np.exp(np.mean(np.log(ratios))) > 0.7  # the most probable one: 0.64
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.15)


def test_repeats_give_the_noise():
    rng = np.random.default_rng(2)
    slip = np.repeat(np.linspace(0.1, 0.8, 8), 5)
    table = check_table(
        'x',
        {
            'slip': slip,
            'normal_load': np.full(40, 80.0),
            'torque': 3.0 + slip + 0.05 * rng.standard_normal(40),
        },
    )
    one = np.zeros(40)
    std, freedom = noise.repeats(table, 2, one)
    assert freedom == 32
    assert std == pytest.approx(0.05, rel=0.3)
    wild = table.measured.copy()
    wild[7, 2] += 5.0
    assert noise.repeats(replace(table, measured=wild), 2, one)[0] < 1.6 * std
    found = noise.stated_noise(table, np.ones(len(QUANTITIES)), one)
    assert found.origin == {'torque': 'repeats'} and found.repeatability == {'torque': (std, 32)}
    for stated, notes in ((0.02, 1), (0.05, 0), (0.2, 1)):
        given = replace(table, stated_std=np.full_like(table.stated_std, stated))
        found = noise.stated_noise(given, np.ones(len(QUANTITIES)), one)
        said = _repeatability(found)
        assert len(said) == notes and all('scatter by' in text for text in said)
        assert found.std[0, 2] == pytest.approx(max(stated, std) if notes else stated)


def test_repeats_that_scatter_as_stated_leave_what_is_stated():
    """Rows five times noisier than others, as they say; or one wild reading in 24 pairs."""
    rng = np.random.default_rng(4)
    slip = np.repeat(np.linspace(0.1, 0.8, 24), 2)
    std = 0.02 * np.where(np.arange(48) % 6 < 2, 5.0, 1.0)
    columns = {'slip': slip, 'normal_load': np.full(48, 80.0)}
    even, one = np.full(48, 0.02), 0.6 * (np.arange(48) == 9)
    for stated, wild in ((std, 0.0), (even, one)):
        reading = 3.0 + slip + stated * rng.standard_normal(48) + wild
        table = check_table('x', {**columns, 'torque': reading, 'torque_std': stated})
        found = noise.stated_noise(table, np.ones(len(QUANTITIES)), np.zeros(48))
        assert found.origin == {'torque': 'given'}
        np.testing.assert_array_equal(found.std[:, 2], stated)
        assert not _repeatability(found)


@pytest.mark.parametrize('stated', [True, False])
def test_repeats_of_a_reference_say_nothing_of_the_other_table(stated):
    """The reference scatters five times as much: each has its own scatter, and its own note."""
    rng = np.random.default_rng(4)
    slip = np.tile(np.repeat(np.linspace(0.1, 0.8, 12), 2), 2)
    theirs = np.arange(48) >= 24
    reading = 3.0 + slip + 0.02 * np.where(theirs, 5.0, 1.0) * rng.standard_normal(48)
    columns = {'slip': slip, 'normal_load': np.full(48, 80.0), 'torque': reading}
    if stated:
        columns['torque_std'] = np.full(48, 0.02)
    table = check_table('x', columns)
    found = noise.stated_noise(table, np.ones(len(QUANTITIES)), np.zeros(48), theirs)
    assert found.std[:24, 2] == pytest.approx(0.02, rel=1e-12 if stated else 0.4)
    assert found.std[24:, 2] == pytest.approx(0.1, rel=0.4)
    said = _repeatability(found)
    assert len(said) == stated and all('torque of the reference' in text for text in said)


def test_confidence_follows_what_speaks_for_a_name():
    """The fitted map has a weight per feature, and each piece of evidence acts the right way."""
    sure = dict.fromkeys(gap_test.FEATURES, 0.0)
    sure.update(one=1.0, margin=3.0, margin_of_set=3.5, gain=3.0, gain_squared=9.0)

    def of_name(**changes):
        values = {**sure, **changes}
        values['margin_floor'] = values['margin'] * values['floor']
        values['margin_two'] = values['margin'] * values['two']
        return gap_test.confidence(values).of_name

    assert len(gap_test._weights()['name']) == len(gap_test.FEATURES)
    assert of_name() > 0.95
    behind = of_name(margin=-1.0, margin_of_set=-0.5)
    assert behind < 0.6 < of_name(margin=1.0) < of_name()
    # Two nats ahead of the next are odds of e^(2/1.5) and no more, whatever else speaks for it.
    assert of_name(margin=4.0 * np.tanh(2.0 / 8.0)) == pytest.approx(0.791, abs=0.001)
    # A structural error, a second effect and a remainder each leave several times the doubt.
    for change in ({'floor': 1.0}, {'two': 1.0}, {'remainder': 1.0}):
        assert 1.0 - of_name(**change) > 2.0 * (1.0 - of_name())


def test_the_strength_of_a_name_is_how_far_it_is_from_doing_nothing():
    coordinates = (
        Coordinate('soil', 'cohesion', 200.0, 50.0),
        Coordinate('lug_digging', 'kd', 1.0, 0.5, role='strength', neutral=0.0),
        Coordinate('soil_mound', 'onset', 0.0, 1.0, role='strength'),
        Coordinate('lug_digging', 'form', 0.0, 1.0, role='shape'),
    )
    fitted = SimpleNamespace(coordinates=coordinates, u=np.array([9.0, 1.0, 7.0, 8.0]))
    for name, deviations_off in (('lug_digging', 3.0), ('soil_mound', 7.0), ('cohesion', 0.0)):
        assert _strength(fitted, name) == pytest.approx(np.log1p(deviations_off))


def test_chi_square_is_that_of_the_best_parameters(setting):
    """Soil parameters are drawn to their prior, an effect's strength is free and takes a degree."""
    rng = np.random.default_rng(8)
    _, truth, std, inputs, scale = setting
    problem = build_problem(std * rng.standard_normal(truth.shape), std, inputs, scale)
    model = linear_fit(rng, problem, at=0.4)
    variance = np.full(problem.size, 1.3)
    rows = np.vstack([model.jacobian / np.sqrt(1.3), [1.0, 0.0]])
    right = np.append(problem.rotation @ problem.observed / np.sqrt(1.3), 0.0)
    rest = right - rows @ np.linalg.lstsq(rows, right, rcond=None)[0]
    expected = scipy.stats.chi2.sf(float(rest @ rest), problem.size - 1)
    assert gap_test.chi_square_p_value(model, variance) == pytest.approx(expected, rel=1e-6)


def test_where_the_misfit_sits_is_told_only_beyond_chance(forward, setting):
    """P-values of noise alone are those of chance; an error at high slip is found there."""
    soil, truth, std, inputs, scale = setting
    rng = np.random.default_rng(9)
    columns = {'slip': forward.points.slip, 'normal_load': forward.points.normal_load}
    found = []
    for number in range(24):
        measured = truth + std * rng.standard_normal(truth.shape)
        if number == 0:
            measured[forward.points.slip > 0.6, 1] += 12.0 * std[0, 1]
        problem = build_problem(measured, std, inputs, scale)
        one = np.ones(problem.size)
        nothing = of_soil(forward, problem, soil, one)
        named = dict(zip(QUANTITIES, measured.T, strict=True))
        table = check_table('t', {**columns, **named})
        setting = SimpleNamespace(problem=problem, forward=forward)
        seen = SimpleNamespace(table=table, nothing=nothing, setting=setting)
        found.append(locate(seen, one))
        if number == 0:
            cells = (problem.observed - problem.flat(nothing.outputs)) / problem.std
            pull = cells[problem.quantity == 1] ** 2
    spoilt, *clean = found
    assert spoilt.quantity == 'drawbar_pull' and spoilt.p_value < 0.02
    assert spoilt.share_of_gap > 0.6
    assert spoilt.share_of_gap == pytest.approx(pull[spoilt.rows].sum() / pull.sum())
    assert {0.0 < w.p_value <= 1.0 for w in found} == {True}
    assert scipy.stats.kstest([w.p_value for w in clean], 'uniform').pvalue > 1e-3
    assert sum(w.sentence == 'no region stands out from the noise' for w in clean) >= 20


def test_soil_that_changes_along_the_way_is_told_when_the_choice_of_the_stretch_is_paid_for(
    forward, setting
):
    """Rows in a shuffled order, the first half on soil of another stiffness, or on the same."""
    soil, truth, std, inputs, scale = setting
    rng = np.random.default_rng(10)
    order = rng.permutation(len(truth))
    stretches = sum(len(truth) - rows + 1 for rows in range(4, len(truth) - 4 + 1))

    half = order < len(truth) // 2

    def told(stiffness, rows=half, std=std):
        measured = truth + std * rng.standard_normal(truth.shape)
        other = WheelSoilModel(replace(SOIL, frictional_modulus=2.4e6 * stiffness), {})
        measured[rows, :3] += (other.steady_state(forward.points).outputs() - truth[:, :3])[rows]
        problem = build_problem(measured, std, inputs, scale)
        one = np.ones(problem.size)
        nothing = of_soil(forward, problem, soil, one)
        table = SimpleNamespace(columns={'time': order.astype(float)})
        work = SimpleNamespace(problem=problem)
        found = changed_stretch(table, work, nothing, one)
        if found is not None:  # against the densities of all readings, with and without it
            inside = (order >= found.start) & (order <= found.end)
            assert found.gain == pytest.approx(evidence(problem, nothing, inside))
        return found

    def evidence(problem, fitted, inside):
        names = [coordinate.name for coordinate in fitted.coordinates]
        soil = fitted.sensitivity[:, [names.index(n) for n in ('stiffness', 'tan_friction')]]
        own = 3.0 * problem.rotation @ (soil * inside[problem.row][:, None])
        common = fitted.jacobian / np.sqrt(fitted.prior)
        before = np.eye(problem.size) + common @ common.T
        target = problem.residual(fitted.outputs) + problem.rotation @ fitted.sensitivity @ fitted.u
        after, before = (
            scipy.stats.multivariate_normal(cov=covariance).logpdf(target)
            for covariance in (before + own @ own.T, before)
        )
        return float(after - before)

    assert 0.3 < told(0.5).stiffness < 0.8
    assert told(0.98, std=0.05 * std) is None  # sure, but too little to tell
    assert '0.9 times as stiff as on' in told(0.9, std=0.05 * std).text
    patch = told(0.4, (order >= 5) & (order <= 7))  # three rows: too few for a soil of their own
    assert patch.end - patch.start + 1.0 == 4.0
    found = [told(stiffness) for stiffness in np.linspace(0.6, 1.0, 30)]
    sure = [stretch.gain - np.log(stretches) for stretch in found if stretch is not None]
    assert 3 < len(sure) < 27
    assert min(sure) >= 5.0


def test_a_rival_explains_more_than_an_empty_place():
    """By a nat: evidence of nothing 0, so that 2 is a competitor and 0 is none."""
    names = ((), ('lug_support',), ('multipass',), ('cohesion',))
    evidence = (0.0, 5.0, 2.0, 0.0)
    selection = SimpleNamespace(
        explanations=[
            SimpleNamespace(names=n, log_evidence=e) for n, e in zip(names, evidence, strict=True)
        ]
    )
    total = np.full(4, 1.0)  # alike otherwise
    assert set(_competitors(selection, total, ('lug_support',), 'lug_support')) == {'multipass'}


def test_an_error_that_a_good_model_may_have_is_smaller_than_one_that_asks_for_a_name():
    floors = default_floors()
    allowed = [floor for floor in floors if not floor.unexplained]
    everywhere = [f for f in floors if f.unexplained and len(set(f.amplitude)) == 1]
    assert max(f.largest for f in allowed) < min(f.largest for f in everywhere)
    # In all quantities, in sinkage or pull or torque alone, or in all but sinkage.
    misfits = {tuple(np.flatnonzero(f.amplitude).tolist()) for f in floors if f.unexplained}
    assert misfits == {(0, 1, 2, 3), (0,), (1,), (2,), (1, 2, 3)}
    assert sum(np.exp(floor.log_prior) for floor in floors) == pytest.approx(1.0)


def test_shapes_that_are_tried_lie_about_the_prior_and_within_the_rows():
    """A mound begins at a slip of 0.4 ± 0.15 (docs/effects.md); a layer is above the ruts."""
    mound, layer = (effect_coordinates(catalogue()[name]) for name in ('soil_mound', 'hard_layer'))
    onsets = [float(mound[1].value(start[1])) for start in shapes(mound, 0.05, 1.0)]
    assert onsets == pytest.approx([0.25, 0.4, 0.55])
    depths = [float(layer[1].value(start[1])) for start in shapes(layer, 0.05, 1.0)]
    assert 0.0 < depths[0] < depths[1] < depths[2] < 0.05
    for own in (mound, layer):
        assert {start[0] for start in shapes(own, 0.05, 2.0)} == {own[0].coordinate(0.0) + 2.0}


def test_sizes_that_an_effect_may_have_share_one_probability():
    assert sum(EFFECT_SHARES) == pytest.approx(1.0)
    assert len(EFFECT_SHARES) == len(EFFECT_SCALES)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def test_covariance_is_that_of_the_conditioned_joint_one(rng):
    """Bayes for a linear model, by conditioning the joint Gaussian of parameters and readings."""
    jacobian, variance = rng.standard_normal((7, 3)), rng.uniform(0.2, 4.0, 7)
    prior = rng.uniform(0.5, 2.0, 3)
    nothing = np.zeros(0)
    found = Fit(
        (), (), nothing, nothing, nothing, nothing, nothing, jacobian, variance, 0.0, prior
    ).covariance()
    before = np.diag(1.0 / prior)
    seen = jacobian @ before @ jacobian.T + np.diag(variance)
    after = before - before @ jacobian.T @ np.linalg.solve(seen, jacobian @ before)
    np.testing.assert_allclose(found, after, rtol=1e-10)


def test_a_number_at_its_bound_is_the_bound():
    """0.3 * 3.3 - 0.99 is 0, but for a rounding below it."""
    own = Coordinate('soil', 'cohesion', -0.99, 0.3, 3.3), Coordinate('soil', 'cohesion', 2.0, 0.1)
    assert float(own[0].value(3.3)) < 0.0
    none = [np.zeros((0, 2))] * 5  # measured
    fitted = Fit((), own, np.array([3.3, 5.0]), *none, np.zeros(0), 0.0, np.ones(2))
    values = [number.value for number in fitted.numbers()]
    assert str(values) == '[0.0, 2.5]'


def test_what_is_over_a_covariance_is_over_the_dense_one(rng):
    variance, jacobian = rng.uniform(0.2, 4.0, 8), rng.standard_normal((8, 2))
    prior, vectors = np.array([0.3, 2.0]), rng.standard_normal((8, 3))
    whole = np.diag(variance) + (jacobian / prior) @ jacobian.T
    found = over_covariance(vectors, variance, jacobian, prior)
    np.testing.assert_allclose(whole @ found, vectors, atol=1e-12)


def test_a_cell_set_apart_is_the_evidence_of_its_wider_noise(rng):
    """Against the densities of both hypotheses, up to the factor that they share."""
    size, std = 30, 3.0
    covariance = np.diag(np.full(size, std**2)) + 0.3 * np.ones((size, size))
    target = std * rng.standard_normal(size)
    target[4] += 9.0 * std
    problem = SimpleNamespace(
        size=size, std=np.full(size, std), row=np.arange(size), quantity=np.zeros(size, int)
    )
    score, cells = outliers._rejected_cells(problem, np.linalg.inv(covariance), target)
    assert [cell[0] for cell in cells] == [4]
    wider = covariance.copy()
    wider[4, 4] = 0.3 + (outliers.OUTLIER_FACTOR * std) ** 2
    constant = -0.5 * size * np.log(2.0 * np.pi)
    price = np.log((1.0 - outliers.SHARE) / outliers.SHARE)
    expected = (
        scipy.stats.multivariate_normal(np.zeros(size), wider).logpdf(target) - constant - price
    )
    assert score == pytest.approx(float(expected))
