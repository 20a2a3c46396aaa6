# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The page of parameters is what the table says."""

import re

import document_parameters as documentation

from wheel_terra_estimator.configuration.parameters import declared


def test_the_page_is_current():
    page = documentation.PAGE.read_text(encoding='utf-8')
    assert page == documentation.page(), 'run python tools/document_parameters.py'


def test_every_parameter_is_on_the_page_once():
    rows = re.findall(r'^- ((?:`[\w.]+`(?:, )?)+) \(', documentation.page(), re.MULTILINE)
    told = [key for row in rows for key in re.findall(r'`([\w.]+)`', row)]
    # Those of effects have a page of their own.
    assert sorted(told) == sorted(key for key in declared() if not key.startswith('effects.'))
