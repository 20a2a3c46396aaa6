# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""wheel-terra effects: the catalogue for people, for programs and for the documentation."""

import json
from pathlib import Path

from document_effects import as_markdown

from wheel_terra_estimator.terramechanics.effects import catalogue

ROOT = Path(__file__).resolve().parents[2]


def test_text_names_every_effect_and_parameter(printed):
    text = printed(['effects'])
    for name, effect in catalogue().items():
        assert f'\n{name}\n' in f'\n{text}'
        if effect.sparse:
            assert 'features: one, slip, ' in text
            continue
        for parameter in effect.parameters:
            assert f'{parameter.name} [{parameter.unit}]' in text
    assert max(map(len, text.splitlines())) <= 100 and text.isascii()


def test_json_holds_what_a_program_needs(printed):
    records = {record['name']: record for record in json.loads(printed(['effects', '--json']))}
    assert records.keys() == catalogue().keys()
    digging = records['lug_digging']
    assert digging['touches'] == ['sinkage'] and digging['parameters'][0]['name'] == 'kd'


def test_one_effect_and_a_misspelt_one(printed, refused):
    text = printed(['effects', 'soil_mound'])
    assert text.startswith('soil_mound') and 'lug_digging' not in text
    words = ' '.join(text.split())  # the numbers of docs/effects.md
    assert 'range 0 to 8, prior half-normal, scale 1 onset' in words
    assert 'range 0 to 0.9, prior normal, 0.4 +- 0.15 form' in words
    refused(['effects', 'soil_mund'], "did you mean 'soil_mound'?")


def test_the_page_and_its_pictures_are_up_to_date():
    page = (ROOT / 'docs' / 'effects.md').read_text(encoding='utf-8')
    assert page == as_markdown(catalogue()), 'run python tools/document_effects.py'
    for name, effect in catalogue().items():
        if effect.sparse:
            continue  # a law has no shape of its own
        picture = ROOT / 'docs' / 'models' / 'effects' / f'{name}.svg'
        assert picture.is_file() and picture.stat().st_size < 60_000
