# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The page of parameters is what the table says."""

from wheel_terra_estimator.configuration import documentation
from wheel_terra_estimator.configuration.parameters import declared


def test_the_page_is_current():
    command = 'python -m wheel_terra_estimator.configuration.documentation'
    assert documentation.path().read_text() == documentation.page(), f'run {command}'


def test_every_parameter_is_on_the_page():
    page = documentation.page()
    for key in declared():
        if not key.startswith('effects.'):  # on a page of their own
            assert f'| `{key}` |' in page
