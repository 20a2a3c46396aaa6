# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The page of parameters is what the table says."""

import document_parameters as documentation

from wheel_terra_estimator.configuration.parameters import declared


def test_the_page_is_current():
    page = documentation.PAGE.read_text(encoding='utf-8')
    assert page == documentation.page(), 'run python tools/document_parameters.py'


def test_every_parameter_is_on_the_page():
    page = documentation.page()
    for key in declared():
        if not key.startswith('effects.'):  # on a page of their own
            assert f'- `{key}` (' in page
