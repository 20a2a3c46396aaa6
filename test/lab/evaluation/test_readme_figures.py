# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""README's table of the estimator: figures by hand, intervals over soils, written in its place."""

import csv
from collections import Counter
from typing import Any

import pytest
import yaml

from wheel_terra_estimator.errors import UserError
from wheel_terra_lab.evaluation.simulators import SIMULATORS
from wheel_terra_lab.studies import readme_figures

ERRORS = {'A': {1: 0.1, 2: 0.1, 3: 0.4}, 'B': {1: 0.2, 2: 0.2, 3: 0.2}}
"""Simulator -> seed -> error of the slip in every sample."""


def rows() -> list[dict[str, Any]]:
    return [
        {
            'simulator': simulator,
            'kind': 'climb',
            'seed': seed,
            'mode': mode,
            'commit': 'abc1234',
            **{f'{name}_samples': 100 for name in readme_figures.QUANTITIES},
            **{f'{name}_squares': 100 * error**2 for name in readme_figures.QUANTITIES},
            'slip_within': 50 if seed == 3 else 95,
            'entrapped': 1,
            'warned': int(seed == 1),
            'false': 2,
            'hours': 0.5,
        }
        for simulator, soils in ERRORS.items()
        for seed, error in soils.items()
        for mode in readme_figures.MODES
    ]


def test_figures_are_those_by_hand():
    found = readme_figures.table(rows())
    # sqrt((0.1^2 + 0.1^2 + 0.4^2) / 3); soils drawn anew are all of 0.1, or all of 0.4, at the ends
    assert found['with one: slip, rms error'][0] == '0.245 (0.100 to 0.400)'
    assert found['with one: slip, rms error'][1] == '0.200 (0.200 to 0.200)'
    assert found['with one: slip, worst soil'][0] == '0.400, seed 3'
    held = found['with one: 95 % intervals that hold the true slip; worst soil']
    assert held[0] == '80 %; 50 %'
    warned = found['without a reference: entrapments warned before; false warnings']
    assert warned[0] == '1 of 3; 6 in 1.5 h'


def test_each_kind_on_half_of_the_soils_and_an_entrapment_of_each_simulator_on_each():
    driven = readme_figures.drives(7800, 10)
    counts = Counter((simulator, kind) for simulator, kind, _ in driven)
    assert set(counts.values()) == {5} and len(driven) == len(set(driven))
    for name in readme_figures.DRIVEN:
        simulator = SIMULATORS[name]
        assert {kind for driver, kind in counts if driver == name} == set(simulator.kinds)
        trapped = [seed for s, kind, seed in driven if s == name and kind in simulator.entrapments]
        assert set(trapped) == set(range(7800, 7810))


def test_rows_of_two_commits_are_refused():
    mixed = rows()
    mixed[0]['commit'] = 'def5678'
    with pytest.raises(UserError, match='abc1234, def5678'):
        readme_figures.write(mixed)


def test_written_in_its_place(tmp_path, monkeypatch):
    for name in ('README', 'WORTH', 'FIGURES'):
        source = getattr(readme_figures, name)
        copy = tmp_path / source.name
        copy.write_text(source.read_text(encoding='utf-8'), encoding='utf-8')
        monkeypatch.setattr(readme_figures, name, copy)
    monkeypatch.setattr(readme_figures, 'DRAWS', 50)  # of the intervals, which nobody looks at here
    for _ in range(2):  # a second time changes nothing more
        readme_figures.write(rows())
        readme = readme_figures.README.read_text(encoding='utf-8')
        entries = yaml.safe_load(readme_figures.FIGURES.read_text(encoding='utf-8'))
    assert readme.count(readme_figures.markdown(rows())) == 1
    assert readme.count('simulator A') == 1 and '0.394' not in readme
    worth = readme_figures.WORTH.read_text(encoding='utf-8')
    assert worth.count(readme_figures.page(rows())) == 1 and '0.394' not in worth
    assert '| A climb | 0.245; 80 % | 0.245; 80 % |' in worth
    assert [entry['what'] for entry in entries].count(readme_figures.WHAT) == 1
    assert entries[0]['commit'] == 'abc1234' and entries[0]['seeds'] == '1 to 3'
    assert entries[0]['rows'] == readme_figures.table(rows())


@pytest.mark.slow
@pytest.mark.skipif(not readme_figures.RESULTS.is_file(), reason='the study was not run yet')
def test_the_pages_show_the_committed_results():
    with readme_figures.RESULTS.open(encoding='utf-8', newline='') as stream:
        found = list(csv.DictReader(stream))
    assert readme_figures.markdown(found) in readme_figures.README.read_text(encoding='utf-8')
    assert readme_figures.page(found) in readme_figures.WORTH.read_text(encoding='utf-8')
