# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tests of a mutant run on the mutated copy; only a test that fails because of it catches it."""

import pytest

from wheel_terra_lab.studies.mutation import PACKAGE, Mutant, verdict

TEXT = 'HALF = 1 / 2\n'
TEST = """import pytest

from {package}.errors import HALF


@pytest.fixture
def sound():
    assert {fixture}


def test_half(sound):
    assert {asked}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ('asked', 'fixture', 'file', 'said'),
    [
        ('HALF == 0.5', 'True', 'test_half.py', 'caught'),
        ('HALF > 0.0', 'True', 'test_half.py', 'survived'),
        ('True', 'HALF == 0.5', 'test_half.py', 'error'),  # no test of its own failed
        # Fails without the mutant, too.
        ('HALF == 0.7', 'True', 'test_half.py', 'error'),
        ('True', 'True', 'test_gone.py', 'error'),
    ],
)
def test_a_mutant_is_caught_by_a_test_that_fails_because_of_it(
    tmp_path, monkeypatch, asked, fixture, file, said
):
    monkeypatch.setenv('PYTEST_DISABLE_PLUGIN_AUTOLOAD', '1')  # half of the time of a run
    module = tmp_path / PACKAGE / 'errors.py'  # a module that the study has loaded itself
    module.parent.mkdir()
    (module.parent / '__init__.py').write_text('')
    module.write_text(TEXT)
    test = TEST.format(asked=asked, fixture=fixture, package=PACKAGE)
    (tmp_path / 'test_half.py').write_text(test)
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    at = TEXT.index('/')
    mutant = Mutant(f'{PACKAGE}/errors.py', 1, 'sign', at, at + 1, '/', '*')
    assert verdict(mutant, tmp_path, [file]) == said
    assert module.read_text() == TEXT
