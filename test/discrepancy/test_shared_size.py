# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One size of an effect in several soils: value, evidence, and whether the sizes are one."""

import math
from types import SimpleNamespace

import pytest
from scipy import integrate, stats

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.report.several import (
    over_all,
    shared_size,
    write_shared_effect,
)
from wheel_terra_estimator.discrepancy.result import Candidate, FittedParameter
from wheel_terra_estimator.terramechanics.effects import catalogue

NAME = 'drivetrain_friction'
PARAMETER = catalogue()[NAME].parameters[0]


def table(value, std, log_evidence=20.0):
    size = FittedParameter(value, std, PARAMETER.unit)
    named = Candidate((NAME,), log_evidence, 0.9, 5.0, 40.0, 30.0,
                      {f'{NAME}.{PARAMETER.name}': size}, 6.0, '')  # fmt: skip
    nothing = Candidate((), 0.0, 0.1, 0.0, 80.0, 31.0, {}, 0.0, '')
    return SimpleNamespace(candidates=(named, nothing))


def prior(size):
    """As written down: half normal, small, large and very large ones with these shares."""
    scale = PARAMETER.prior_scale
    widths = {0.3 * scale: 0.45, 2.0 * scale: 0.45, 10.0 * scale: 0.10}
    return sum(s * stats.halfnorm.pdf(abs(size), scale=w) for w, s in widths.items())


def test_value_deviation_evidence_and_scatter():
    told = [(1.0, 0.05), (1.06, 0.1), (0.94, 0.04)]
    found = {str(k): table(*pair) for k, pair in enumerate(told)}
    shared = shared_size(found, NAME)
    weights = [std**-2 for _, std in told]
    mean = sum(w * v for w, (v, _) in zip(weights, told, strict=True)) / sum(weights)
    item = shared.parameters[PARAMETER.name]
    assert item.value == pytest.approx(mean)
    assert item.std == pytest.approx(sum(weights) ** -0.5)
    scatter = sum(((v - mean) / s) ** 2 for v, s in told)
    assert shared.p_value == pytest.approx(stats.chi2.sf(scatter, 2))

    def joint(size):
        posteriors = math.prod(stats.norm.pdf(size, v, s) for v, s in told)
        return posteriors / prior(size) ** 2

    overlap, _ = integrate.quad(joint, 0.5, 1.5, points=[mean])
    assert shared.log_evidence == pytest.approx(60.0 + math.log(overlap), abs=0.05)


def test_sizes_that_agree_count_for_more_than_sizes_that_do_not():
    alike = shared_size({'a': table(1.0, 0.05), 'b': table(1.02, 0.05)}, NAME)
    apart = shared_size({'a': table(1.0, 0.05), 'b': table(1.5, 0.05)}, NAME)
    assert alike.log_evidence > 40.0 > apart.log_evidence
    assert 'with one size' in over_all({'a': table(1.0, 0.05), 'b': table(1.02, 0.05)})
    assert 'not one size' in over_all({'a': table(1.0, 0.05), 'b': table(1.5, 0.05)})


def test_an_effect_that_a_table_does_not_list_has_no_shared_size():
    nothing = SimpleNamespace(candidates=table(1.0, 0.1).candidates[1:])
    assert shared_size({'a': table(1.0, 0.05), 'b': nothing}, NAME) is None


def test_the_file_of_the_shared_effect_is_a_further_configuration(tmp_path):
    path = tmp_path / 'effect.yaml'
    write_shared_effect({'a': table(1.0, 0.05), 'b': table(1.5, 0.05)}, path)
    assert not path.exists(), 'the sizes are not one'
    write_shared_effect({'a': table(1.0, 0.05), 'b': table(1.1, 0.05)}, path)
    effects = reader.load(['hit_wh1', 'hit_fit', path], complete=False).effects
    assert effects[NAME][PARAMETER.name] == pytest.approx(1.05)
