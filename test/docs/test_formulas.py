# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Formulas of the catalogue become mathematics: nothing is lost, brackets close."""

import re

import formulas
import pytest

from wheel_terra_estimator.terramechanics.effects import catalogue

SYMBOLS = [form.symbol for effect in catalogue().values() for form in effect.forms]


@pytest.mark.parametrize(
    ('formula', 'tex'),
    [
        ('F -= kb b D1 z^2, D1 = cot X', ['F -= k_{b} b D_{1} z ^2', 'D_{1} = \\cot X']),
        ('c, tan(phi) *= (v_rim/0.05)^shear', [
            'c , \\tan (\\varphi ) \\times= (v_{\\mathrm{rim}} /0.05)^{\\text{shear}}']),
        ('z = (3 W)^(2/(2N+1));  T += 2 sgn(w)',
         ['z = (3 W )^{2/(2 N +1)}', 'T += 2 \\mathrm{sgn}(w )']),
    ],
)  # fmt: skip
def test_statements_symbols_and_powers(formula, tex):
    def bare(text: str) -> str:
        return re.sub(r'\s', '', text)

    assert [bare(line) for line in formulas.as_tex(formula)] == [bare(line) for line in tex]


def test_every_formula_of_the_catalogue_is_whole():
    numbers = r'\d+(?:\.\d+)?'
    for formula in SYMBOLS:
        tex = ' '.join(formulas.as_tex(formula))
        assert tex.count('{') == tex.count('}'), formula
        assert sorted(re.findall(numbers, tex)) == sorted(re.findall(numbers, formula))
    convert = pytest.importorskip('latex2mathml.converter').convert
    for formula in SYMBOLS:
        mathematics = convert(' '.join(formulas.as_tex(formula)))
        assert '\\' not in mathematics and 'merror' not in mathematics, formula
