# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The report for people says what the diagnosis says, and needs nothing beside itself."""

from __future__ import annotations

import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from itertools import chain
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.image import imread
from test_workflow import FEW, run

from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy import decision
from wheel_terra_estimator.discrepancy.assessment.held_out import _cell_noise
from wheel_terra_estimator.discrepancy.numbers import number
from wheel_terra_estimator.discrepancy.report import page as page_module
from wheel_terra_estimator.discrepancy.report.model_file import write_model
from wheel_terra_estimator.discrepancy.report.page import write_report
from wheel_terra_estimator.discrepancy.report.words import FACTORS, _leaves, in_words, sentence
from wheel_terra_estimator.discrepancy.result import LeftOut, Proposal, QuantityGap
from wheel_terra_estimator.discrepancy.selection.verdict import Remainder
from wheel_terra_estimator.discrepancy.tables.steady_table import QUANTITIES
from wheel_terra_estimator.discrepancy.workflow import Options
from wheel_terra_estimator.terramechanics.effects import catalogue
from wheel_terra_lab.studies.campaigns import Plan, make_campaign


class Page(HTMLParser):
    """Text, links and table rows of a page; complains about tags that do not close."""

    VOID = ('meta', 'img', 'br', 'link', 'hr', 'source')

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.names: set[str] = set()
        self.rows: list[list[str]] = []
        self.text = ''
        self.feed(text)
        assert not self.open, f'not closed: {self.open}'

    def handle_starttag(self, tag, attributes):
        if tag not in self.VOID:
            self.open.append(tag)
        self.sources += [value for key, value in attributes if key in ('src', 'href', 'srcset')]
        self.names |= {value for key, value in attributes if key == 'id'}
        if tag == 'tr':
            self.rows.append([])
        elif tag in ('td', 'th') and self.rows:
            self.rows[-1].append('')

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ('style', 'script'):
            self.text += data
        if self.rows and self.rows[-1] and {'td', 'th'} & set(self.open):
            self.rows[-1][-1] += data.strip() + ' '

    def row(self, first: str, head: str = '') -> list[str]:
        """Return the row of this name; two tables may have it: below the heading ``head``."""
        names = [row[0].strip() if row else '' for row in self.rows]
        below = names.index(head) if head else 0
        found = [row for row in self.rows[below:] if row and row[0].strip() == first]
        assert found, f'no row {first!r} among {[row[0] for row in self.rows if row]}'
        return [cell.strip() for cell in found[0]]


def campaign_diagnosis(seed, design='slope48', **plan):
    campaign = make_campaign(seed, design, Plan(**plan))
    few = Options((*campaign.hidden, *FEW.effects))
    return run(campaign.table, campaign.settings(), options=few)


@pytest.fixture(scope='module')
def named():
    """A diagnosis that names an effect, of a table with outliers and gaps."""
    diagnosis = campaign_diagnosis(15, outliers=0.03, missing=0.03)
    assert diagnosis.verdict == 'named'
    return diagnosis


@pytest.fixture(scope='module')
def written(named, tmp_path_factory):
    """Folder of a report, its pictures, and matplotlib's settings before it was written."""
    folder, settings = tmp_path_factory.mktemp('report'), dict(mpl.rcParams)
    drawn, draw = [], page_module._figures
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            page_module, '_figures', lambda *given: drawn.append(draw(*given)) or drawn[0]
        )
        write_report(named, folder)
    return folder, drawn[0], settings


@pytest.fixture
def same_pictures(written, monkeypatch):
    """Those of the module's report again: for tests of words."""
    monkeypatch.setattr(page_module, '_figures', lambda *_: written[1])


@pytest.fixture
def page(written):
    folder = written[0]
    return Page((folder / 'report.html').read_text(encoding='utf-8')), folder


def test_page_needs_nothing_from_elsewhere(page):
    parsed, _ = page
    assert len(parsed.sources) >= 3
    assert all(source.startswith(('data:', '#')) for source in parsed.sources)
    within = {source[1:] for source in parsed.sources if source.startswith('#')}
    assert within
    assert within <= parsed.names, 'contents lead to sections that are not there'


def test_every_picture_is_in_the_page_and_beside_it(page):
    parsed, folder = page
    files = {path.name: imread(path) for path in folder.glob('*.png')}
    drawn = [source for source in parsed.sources if source.startswith('data:')]
    assert len(drawn) == len(files)
    assert all(b'</svg>' in b64decode(source.partition(',')[2]) for source in drawn)
    assert any(name.startswith('residuals_by_') for name in files)
    assert 'curves_over_slip.png' in files, 'two loads on three slopes are six curves'
    for name, pixels in files.items():
        height, width, _ = pixels.shape
        assert width > 600 and height > 250, name
        assert len(np.unique(pixels)) > 100, f'{name} looks empty'


def test_numbers_are_those_of_the_diagnosis(page, named):
    parsed, _ = page
    text = re.sub(r'\s+', ' ', parsed.text)
    for line in (named.sentence.replace('+-', '±'), *chain(*in_words(named).values())):
        assert line in text
    first = named.effects[0]
    assert f'{100 * first.confidence:.0f} %' in parsed.text
    for name, item in first.parameters.items():
        assert f'{name} = {number(item.value)} ± {number(item.std, 2)}' in parsed.text
    for quantity, unit, scale in (('sinkage', 'mm', 1e3), ('drawbar pull', 'N', 1.0)):
        gap = named.gap[quantity.replace(' ', '_')]
        cells = parsed.row(f'{quantity} [{unit}]')
        assert cells[1:4] == [number(scale * x) for x in (gap.before, gap.refit, gap.after)]
    for candidate in named.candidates:
        cells = parsed.row(candidate.label.replace('_', ' '))
        assert cells[1] == f'{candidate.log_evidence:.1f}'
        assert cells[-1] == candidate.why_not
    for shift in named.soil:
        cells = parsed.row(FACTORS.get(shift.name, shift.name.replace('_', ' ')), 'parameter')
        assert cells[5] == f'{shift.z_score:+.1f}'
    for item in named.next_measurement:
        assert item.what in parsed.text
    for name in named.not_visible:
        assert name.replace('_', ' ') in parsed.text
    assert catalogue()[first.name].source in parsed.text


def test_outliers_are_listed_with_their_line(page, named):
    parsed, _ = page
    assert named.outliers
    for row, quantity, _ in named.outliers:
        assert f'line {named.table.lines[row]} {quantity.replace("_", " ")}' in parsed.text


def test_changed_keys_are_those_of_the_model_file(page, named, tmp_path):
    parsed, _ = page
    write_model(named, tmp_path / 'model.yaml')
    new = reader.load([tmp_path / 'model.yaml'], complete=False).flat()
    effect = named.effects[0]
    assert parsed.row(f'effects.{effect.name}.enabled')[1:] == ['false', 'true']
    key = 'soil.frictional_modulus'
    before, after = parsed.row(key)[1:]
    assert float(after) == pytest.approx(new[key], rel=1e-3)
    assert float(before) == pytest.approx(named.configuration.flat()[key], rel=1e-3)


def test_what_to_do_next_follows_from_what_stays_open(named):
    """The very model is called the one to go on with only where nothing is left."""
    whole = replace(named, effects=(), next_measurement=(), proposal=None, gap={})
    said = in_words(whole)
    assert said['open'] == ['Nothing beyond noise and the allowed model error.']
    assert said['next'] == ['Nothing; continue with model.yaml.']
    effect = replace(named.effects[0], remainder=True, confounded_with=())
    said = in_words(replace(whole, effects=(effect,)))
    assert 'does not explain' in said['open'][0]
    assert 'best model so far' in said['next'][0]
    alike = replace(effect, remainder=False, alike=('another unit of the column',))
    said = in_words(replace(whole, effects=(alike,)))
    assert said['open'][0].endswith('from another unit of the column.')


@pytest.mark.parametrize(
    'plan',
    [
        {'hide': 'none'},
        {'drop': 'torque'},
        pytest.param({'noise_given': False}, marks=pytest.mark.slow),
    ],
)
def test_every_kind_of_diagnosis_has_a_report(plan, tmp_path, undrawn):
    diagnosis = campaign_diagnosis(4, 'basic16', **plan)
    parsed = Page(write_report(diagnosis, tmp_path).read_text(encoding='utf-8'))
    assert {'agrees': 'Agrees.', 'named': 'Named.', 'unexplained': 'Unexplained.'}[
        diagnosis.verdict
    ] in parsed.text
    if plan.get('drop'):
        assert not any(row and row[0].strip() == 'torque [N m]' for row in parsed.rows)


def test_a_proposed_law_is_on_the_page(named, tmp_path, same_pictures):
    gap = {name: replace(item, after=0.123) for name, item in named.gap.items()}
    left_out = {'normal_load': {'torque': LeftOut(0.5, 0.25)}}
    words = 'Torque grows by 0.1 per 0.1 of slip.'
    law = Proposal(
        words, ('torque',), ('slip',), (1.0,), (0.1,), gap, (), ('slip above 0.6',), left_out
    )
    diagnosis = replace(named, effects=(), proposal=law)
    parsed = Page(write_report(diagnosis, tmp_path).read_text(encoding='utf-8'))
    assert words in parsed.text and 'Do not trust it for: slip above 0.6.' in parsed.text
    assert parsed.row('normal load', 'left out, level by level')[1:] == [
        'torque [N m]',
        '0.5',
        '0.25',
    ]
    assert parsed.row('torque [N m]', 'quantity')[3] == '0.123'


def test_names_from_the_table_cannot_break_the_page(named, tmp_path, same_pictures):
    table = replace(named.table, name='<b>&"x".csv')
    parsed = Page(write_report(replace(named, table=table), tmp_path).read_text(encoding='utf-8'))
    assert '<b>&"x".csv' in parsed.text


@pytest.mark.parametrize(
    ('value', 'text'),
    [(0.0, '0'), (1234.5, '1234'), (0.00176, '0.00176'), (3.2e7, '32000000'), (np.nan, '-')],
)
def test_numbers_for_people(value, text):
    assert number(value, 4 if value == 1234.5 else 3) == text


def test_soil_pulls_are_in_the_deviations_that_were_stated(named):
    """The fit's own coordinates are wider; a reader compares with the number in the file."""
    flat = named.configuration.flat()
    (shift,) = (s for s in named.soil if s.name == 'sinkage_exponent')
    stated = flat['soil.sinkage_exponent_std'] or 0.05  # the default where none was stated
    assert shift.prior_std == pytest.approx(stated)
    assert shift.z_score == pytest.approx((shift.after - shift.before) / stated, rel=1e-6)
    assert shift.before == pytest.approx(flat['soil.sinkage_exponent'])


def test_the_gap_is_the_error_on_unseen_rows_and_its_share_above_the_noise(named):
    measured = named.table.measured.copy()
    for row, quantity, _ in named.outliers:
        measured[row, QUANTITIES.index(quantity)] = np.nan
    curves = named.curves
    for q, item in enumerate(named.gap.values()):
        for error, values in (
            (item.before, curves.before),
            (item.refit, curves.held_out_refit),
            (item.after, curves.held_out_after),
            (item.fitted, curves.after),
        ):
            expected = np.sqrt(np.nanmean((values - measured)[:, q] ** 2))
            assert error == pytest.approx(expected, rel=1e-9)
        noise = np.sqrt(np.mean(named.noise.std[np.isfinite(measured[:, q]), q] ** 2))
        assert item.noise == pytest.approx(noise, rel=1e-6)


def test_how_far_a_name_worsens_a_quantity_is_in_squares_of_its_noise(monkeypatch):
    """Errors of 3 where there were 2, at a noise of 5: (9 - 4) / 25."""
    monkeypatch.setattr(decision, 'chi_square_p_value', lambda *_: 1.0)
    monkeypatch.setattr(decision, 'largest_z_score', lambda *_: 3.5)
    findings = SimpleNamespace(
        nothing=SimpleNamespace(outputs=np.zeros((4, 3))),
        noise=SimpleNamespace(std=np.ones((4, 3))),
        setting=SimpleNamespace(forward=SimpleNamespace(active=None)),
    )
    fitted = SimpleNamespace(outputs=np.ones((4, 3)), variance=None)
    gap = {'torque': QuantityGap(4.0, 2.0, 3.0, 5.0)}
    found = decision._what_rows_show(findings, fitted, gap)
    assert found['worse'] == pytest.approx(np.tanh(0.2))
    assert found['pull'] == pytest.approx(1.0)


def test_noise_of_a_cell_is_its_own_part_of_the_covariance():
    """Slip errors tie the cells of a row together: the diagonal is what each of them has."""
    covariance = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 1.0]])
    problem = SimpleNamespace(
        std=np.ones(3),
        block=np.array([-1, -1, -1]),
        unrotation=np.linalg.cholesky(covariance),
        row=np.zeros(3, dtype=int),
        quantity=np.arange(3),
    )
    findings = SimpleNamespace(
        setting=SimpleNamespace(problem=problem), noise=SimpleNamespace(std=np.full((2, 3), 7.0))
    )
    assert _cell_noise(findings) == pytest.approx(np.array([[2.0, 3.0, 1.0], [7.0, 7.0, 7.0]]))


@pytest.mark.parametrize(
    ('probability', 'p_value', 'said'),
    [(0.9, 0.5, 'smooth misfit'), (0.1, 1e-6, 'more scatter'), (0.1, 0.5, 'uncertain')],
)
def test_a_candidate_that_was_not_named_leaves_what_it_leaves(probability, p_value, said):
    assert said in _leaves(Remainder(probability, probability, 0.1, p_value, 1.0))


@pytest.mark.parametrize(
    ('shared', 'nearest', 'said'),
    [
        (False, (), '(nothing smooth, but more scatter than the noise allows, is left)'),
        (True, ('cohesion',), 'to be named (nearest: cohesion).'),
        (True, (), 'well enough to be named.'),
    ],
)
def test_scatter_is_left_only_where_no_reference_shares_an_error(shared, nearest, said):
    left = Remainder(0.1, 0.1, 0.0, 1e-6, 1.0, shared)
    verdict = SimpleNamespace(status='unexplained', left=left)
    chosen = SimpleNamespace(verdict=verdict, misread={}, effects=())
    assert said in sentence(chosen, 1e-6, None, nearest)
