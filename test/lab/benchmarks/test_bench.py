# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra bench`` runs, and its peers do the same work as what they stand beside."""

import json
import subprocess

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from wheel_terra_estimator.configuration import reader
from wheel_terra_lab.benchmarks.pairs import Figure
from wheel_terra_lab.benchmarks.peers import PlainFilter, smooth_wheel
from wheel_terra_lab.benchmarks.run import FILES, RADIUS, WIDTH, forces


@pytest.mark.parametrize('slip', [0.05, 0.3, 0.7])
def test_the_peer_of_the_models_gives_their_numbers(slip):
    soil = reader.load(FILES).soil
    plain = smooth_wheel(soil, RADIUS, WIDTH, slip, 80.0)
    ours = forces(soil, 'quadrature', np.array([slip]), np.array([80.0]))[0]
    np.testing.assert_allclose(ours, plain, rtol=1e-3, atol=0.01)
    quick = forces(soil, 'closed_form', np.array([slip]), np.array([80.0]))[0]
    np.testing.assert_allclose(quick, plain, rtol=0.02, atol=0.5)


def test_the_peer_of_the_filter_is_a_kalman_filter():
    random = np.random.default_rng(3)
    F, H = random.standard_normal((4, 4)), random.standard_normal((2, 4))
    other = KalmanFilter(4, 2)
    other.F, other.H, other.Q, other.R = F, H, 0.1 * np.eye(4), np.diag([0.2, 0.3])
    other.predict()
    other.update(np.array([1.0, -1.0]))
    plain = PlainFilter(np.zeros(4), np.eye(4))
    plain.predict(np.zeros(4), F, 0.1 * np.eye(4))
    plain.update(np.array([1.0, -1.0]), H, np.array([0.2, 0.3]))
    np.testing.assert_allclose(plain.P, other.P, atol=1e-10)
    np.testing.assert_allclose(plain.x, other.x[:, 0], atol=1e-10)


def test_the_ratio_is_the_median_of_the_pairs():
    figure = Figure('a', 'b', (1.0, 2.0, 4.0), (10.0, 10.0, 10.0), drive=20.0)
    assert figure.ratio == 5.0
    assert figure.as_dict()['real_time_factor'] == 10.0


@pytest.mark.slow
@pytest.mark.parametrize('processes', [False, True])
def test_it_runs(printed, monkeypatch, processes):
    started = []
    if not processes:
        monkeypatch.setattr(subprocess, 'run', lambda command, **_: started.append(command))
    told = printed(['bench', '--quick', '--json'])
    figures = json.loads(told)['figures']
    assert len(figures) == 12
    assert all(entry['seconds'] > 0 and entry['times_as_fast'] > 0 for entry in figures)
    assert processes or {'diagnose', '--help', 'predict'} <= {c[3] for c in started if len(c) > 3}


def test_an_earlier_run_is_compared_by_its_ratios(tmp_path, monkeypatch, printed):
    def of_ratio(ratio):
        figure = Figure('a', 'b', (1.0,), (ratio,))
        monkeypatch.setattr('wheel_terra_lab.benchmarks.run.figures', lambda _: [figure])

    of_ratio(2.0)
    (tmp_path / 'before.json').write_text(printed(['bench', '--json']))
    of_ratio(3.0)
    against = ['bench', '--against', str(tmp_path / 'before.json')]
    assert '3 times as fast (3 to 3) as b' in (said := printed(against))
    assert '1.50 times the earlier ratio' in said
