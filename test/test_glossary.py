# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One glossary for reports and site."""

from pathlib import Path

from wheel_terra_estimator import glossary
from wheel_terra_estimator.discrepancy.numbers import percent
from wheel_terra_estimator.reporting.html import render

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'nomenclature.md'


def test_the_page_of_the_site_has_the_glossary():
    words = '\n'.join(
        f'- **{t.term}**{f" ({t.also})" if t.also else ""}: {t.meaning}' for t in glossary.terms()
    )
    assert words in PAGE.read_text(encoding='utf-8'), words
    assert all(term.meaning.endswith('.') for term in glossary.terms())


def test_a_report_explains_its_words_and_no_others(tmp_path):
    text = '<p title="sinkage">pull_margin</p><script>confidence</script><style>slip</style>'
    (tmp_path / 'a.html').write_text(
        '{% extends "base.html" %}{% block content %}' + text + '{% endblock %}'
    )
    page = render('a.html', tmp_path)
    explained = page.partition('Words on this page')[2]
    assert '<dt>pull margin</dt>' in explained
    assert explained.count('<dt>') == 2  # and drawbar pull, "pull" for short
    assert 'confidence' not in explained


def test_no_probability_is_said_to_be_certain():
    assert [percent(p) for p in (1.0, 0.995, 0.99, 0.5, 0.004)] == [
        'over 99 %',
        'over 99 %',
        '99 %',
        '50 %',
        'below 1 %',
    ]
