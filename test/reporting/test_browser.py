# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Reports in a headless browser: two widths, light and dark; skipped where there is no Chromium."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wheel_terra_estimator import api
from wheel_terra_estimator.bags.history import WHEEL_FIELDS, EstimateHistory, StuckWarning
from wheel_terra_estimator.bags.replay import Replay
from wheel_terra_estimator.bags.truth import Truth, WheelTruth
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.discrepancy.report.page import write_report
from wheel_terra_estimator.reporting.drive_style import Border
from wheel_terra_estimator.reporting.drive_summary import summarise
from wheel_terra_estimator.reporting.fleet_summary import CLASSES, DriveRow, write_summary_page
from wheel_terra_estimator.reporting.replay_report import write_replay_report
from wheel_terra_lab.soilbin import output
from wheel_terra_lab.soilbin.bookkeeping import SERIES
from wheel_terra_lab.soilbin.case import Case

BROWSER = next(
    (
        path
        for name in ('chromium', 'chromium-browser', 'google-chrome')
        if (path := shutil.which(name))
    ),
    None,
)
SMALLEST_TEXT = 11.0  # [px]
LARGEST_FILE = 4_000_000  # bytes, for an hour of driving
HOUR = 3600.0  # [s]
RATE = 10.0  # sets a second

LEAST_CONTRAST = 4.5  # WCAG 2.2, 1.4.3

PROBE = """
<script>
window.addEventListener('load', () => setTimeout(() => {
  const [small, faint, cut, boxes] = [[], [], [], []];
  const numbers = (text) => (text.match(/[\\d.]+/g) || []).map(Number);
  const level = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const found = numbers(getComputedStyle(e).backgroundColor);
      if (found.length === 3 || found[3] === 1) return found;
    }
    return [255, 255, 255];
  };
  const scrolled = (element) => element.closest('pre, .scroll, .read, .head');
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const text = walk.currentNode.textContent.trim();
    const element = walk.currentNode.parentElement;
    if (!text || ['SCRIPT', 'STYLE', 'NOSCRIPT'].includes(element.tagName)) continue;
    if (!element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const size = parseFloat(style.fontSize);
    if (size < %(smallest)g) small.push(text.slice(0, 30) + ': ' + size);
    const [a, b] = [level(numbers(style.color)), level(ground(element))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < %(contrast)g) faint.push(text.slice(0, 30) + ': ' + contrast.toFixed(2));
    const range = document.createRange();
    range.selectNodeContents(walk.currentNode);
    for (const r of range.getClientRects()) {
      if (r.width < 1) continue;
      if ((r.right > window.innerWidth + 1 || r.left < -1) && !scrolled(element)) {
        cut.push(text.slice(0, 30));
      }
      const inset = 0.2 * r.height;                      // a line is higher than its letters
      boxes.push([text.slice(0, 30), r.left, r.right, r.top + inset, r.bottom - inset]);
    }
  }
  const overlaps = [];
  boxes.forEach((p, i) => boxes.slice(i + 1).forEach((q) => {
    const across = Math.min(p[2], q[2]) - Math.max(p[1], q[1]);
    const down = Math.min(p[4], q[4]) - Math.max(p[3], q[3]);
    if (across > 1 && down > 1) overlaps.push(p[0] + ' | ' + q[0]);
  }));
  const result = {
    width: window.innerWidth,
    overflow: document.documentElement.scrollWidth - window.innerWidth,
    dark: matchMedia('(prefers-color-scheme: dark)').matches,
    small, faint, cut, overlaps, texts: boxes.length,
    paths: [...document.querySelectorAll('.chart path.line')]
      .filter((p) => p.checkVisibility()).length,
    ground: getComputedStyle(document.body).backgroundColor,
  };
  parent.postMessage(JSON.stringify(result), '*');
}, 500));
</script></body>
"""
FRAME = """<!DOCTYPE html><body style="margin:0">
<iframe src="%(page)s" style="border:0;width:%(width)dpx;height:900px"></iframe>
<pre id="result"></pre>
<script>addEventListener('message', (event) => {
  document.getElementById('result').textContent = 'RESULT' + event.data + 'END'; });</script>
</body>"""


def an_hour() -> tuple[EstimateHistory, Truth]:
    """Return a made-up hour of driving that is as restless as estimates can be."""
    random = np.random.default_rng(5)
    names = tuple(f'{side}_{row}_wheel' for row in 'abc' for side in ('left', 'right'))
    count = round(HOUR * RATE)
    stamp = (np.arange(count) / RATE * 1e9).astype(np.int64) + 1_000_000_000
    values = {
        name: random.standard_normal((count, len(names))).cumsum(axis=0) * 1e-3
        for name in WHEEL_FIELDS
    }
    for name in ('slip_std', 'sinkage_std', 'drawbar_pull_std'):
        values[name] = np.abs(values[name]) + 0.01
    values['slip'] = np.tanh(values['slip'])
    values['slip'][:20], values['slip_std'][:20] = 1.0, 1.0
    classes = np.repeat(random.integers(0, 4, (count // 100, len(names))), 100, axis=0)
    classes[:20] = 255
    warning = StuckWarning(int(stamp[20_000]), int(stamp[22_000]), 'median slip 0.83: digging in')
    history = EstimateHistory(
        names,
        stamp,
        values,
        classes.astype(np.uint8),
        values['slip'][:, 0],
        values['slip_std'][:, 0],
        (warning,),
    )
    known = {
        name: WheelTruth(stamp, values[name] + 0.01) for name in ('slip', 'sinkage', 'drawbar_pull')
    }
    velocity = WheelTruth(stamp, history.forward_velocity[:, None])
    return history, Truth('/ground_truth', velocity, **known)


@pytest.fixture(scope='module')
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    history, truth = an_hour()
    topics = {'joint_states': '/joint_states'}
    result = Replay(history, topics, Counter(), Counter(), ('a note',))
    summary = summarise('an hour', result, Border(0.25, np.inf))
    path = tmp_path_factory.mktemp('report') / 'report.html'
    write_replay_report(path, summary, result, truth, reader.load(['generic_six_wheel']))
    return path


@pytest.mark.slow
def test_an_hour_of_driving_stays_a_small_file_that_needs_nothing_else(report: Path) -> None:
    text = report.read_text(encoding='utf-8')
    assert report.stat().st_size < LARGEST_FILE
    assert not re.search(r'(src|href)="(https?:)?//', text)
    assert text.count('class="line') >= 20
    assert 'digging in.' in text and 'By the estimates: ' in text  # a warning and its verdict


@pytest.fixture(scope='module')
def diagnosis_report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    slip, load = (a.ravel() for a in np.meshgrid(np.linspace(0.05, 0.6, 10), [60.0, 100.0]))
    model = api.Model.load('hit_wh3', 'dlr_mss')
    rows = api.Model.load(
        'hit_wh3', 'dlr_mss', parameters=['effects.slip_sinkage_exponent.enabled:=true']
    )
    columns = rows.curve(slip, load).columns()
    kept = ('slip', 'normal_load', 'sinkage', 'drawbar_pull', 'torque')
    folder = tmp_path_factory.mktemp('diagnosis')
    write_report(api.diagnose({name: columns[name] for name in kept}, model), folder)
    return folder / 'report.html'


@pytest.fixture(scope='module')
def soilbin_report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    series = np.random.default_rng(1).random((200, len(SERIES)))
    series[:, 0] = np.linspace(0.0, 40.0, 200)
    folder = tmp_path_factory.mktemp('soilbin')
    output.write_report(folder, series, Case(), {'slip (second half)': '21.3 % (24.1 %)'})
    return folder / 'report.html'


@pytest.fixture(scope='module')
def fleet_report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    shares = dict(zip(CLASSES, (60.0, 10.0, 5.0, 0.0, 1.0), strict=True))
    finding = 'radius (100 %), /joint_states: the rover runs 1.068 of what its rims say'
    drive = DriveRow('bags/a', 'a', verdict='No stuck warning.', duration=76.0, sets=760,
                     seconds=shares, findings=(finding,))  # fmt: skip
    rows = [drive, DriveRow('bags/b', error='no wheel of wheels.names is on /joint_states')]
    path = tmp_path_factory.mktemp('fleet') / 'summary.html'
    write_summary_page(rows, path, 'report.html')
    return path


KINDS = {'report': 20, 'diagnosis_report': 0, 'soilbin_report': 6, 'fleet_report': 0}
"""Page -> lines that its figure has at least."""


def probed(text: str, folder: Path, width: int, scheme: str) -> dict[str, Any]:
    """Return what the probe finds in a page; the browser must not complain."""
    page = folder / 'page.html'
    probe = PROBE % {'smallest': SMALLEST_TEXT, 'contrast': LEAST_CONTRAST}
    page.write_text(text.replace('</body>', probe), encoding='utf-8')
    frame = folder / 'frame.html'
    frame.write_text(FRAME % {'page': page.as_uri(), 'width': width}, encoding='utf-8')
    run = subprocess.run(
        [
            str(BROWSER),
            '--headless',
            '--no-sandbox',
            '--disable-gpu',
            '--enable-logging=stderr',
            '--allow-file-access-from-files',
            '--virtual-time-budget=15000',
            f'--user-data-dir={folder / "profile"}',
            f'--blink-settings=preferredColorScheme={0 if scheme == "dark" else 1}',
            '--window-size=1400,1000',
            '--dump-dom',
            frame.as_uri(),
        ],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    complaints = [line for line in run.stderr.splitlines() if 'CONSOLE' in line]
    assert not complaints, complaints
    found: dict[str, Any] = json.loads(
        html.unescape(re.search(r'RESULT(.*?)END', run.stdout, re.S)[1])
    )
    return found


FAULTY = """<!DOCTYPE html><body style="background:#fff;color:#000">
<p style="position:absolute;top:10px;left:10px">lower</p>
<p style="position:absolute;top:14px;left:20px">upper</p>
<p style="position:absolute;top:60px;color:#999">pale</p>
<p style="position:absolute;top:90px;font-size:9px">tiny</p>
<p style="position:absolute;top:120px;left:370px;white-space:nowrap">beyond the edge</p>
</body>"""


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason='no Chromium')
def test_the_probe_finds_what_it_looks_for(tmp_path: Path) -> None:
    found = probed(FAULTY, tmp_path, 390, 'light')
    assert found['overlaps'] == ['lower | upper']
    assert [words.partition(':')[0] for words in found['faint']] == ['pale']
    assert found['small'] == ['tiny: 9']
    assert found['cut'] == ['beyond the edge']
    assert found['overflow'] > 0


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason='no Chromium')
@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [1280, 390])
@pytest.mark.parametrize('kind', list(KINDS))
def test_in_a_browser(
    request: pytest.FixtureRequest, tmp_path: Path, kind: str, width: int, scheme: str
) -> None:
    report: Path = request.getfixturevalue(kind)
    found = probed(report.read_text(encoding='utf-8'), tmp_path, width, scheme)
    assert found['width'] == width
    assert found['dark'] == (scheme == 'dark')
    assert found['overflow'] <= 0
    assert found['texts'] > 20
    for fault in ('small', 'faint', 'cut', 'overlaps'):
        assert found[fault] == [], fault
    assert found['paths'] >= KINDS[kind]
    light = [int(v) for v in re.findall(r'\d+', found['ground'])[:3]]
    assert (sum(light) < 150) == (scheme == 'dark')
