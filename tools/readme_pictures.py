# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of README and tutorials: ``python tools/readme_pictures.py``.

The head of the report of the shipped entrapment, as Chromium shows it; its file says the verdict
that it shows, and a test compares it. And the blind trial that ``wheel-terra demo`` runs: measured
sinkage under each load, the model as configured and after the diagnosis, and the gap on rows that
the fit did not see.
"""

from __future__ import annotations

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wheel_terra_estimator.api import plot_diagnosis
from wheel_terra_estimator.cli.main import main as wheel_terra
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_estimator.reporting.style import LINE_COLOURS, picture_style
from wheel_terra_lab.trials import trial

IMAGES = Path(__file__).resolve().parents[1] / 'docs' / 'images'
REPORT = IMAGES / 'report.png'
SIZE = (1000, 1080)  # [px] of the head of the report


def main() -> None:
    """Make both."""
    report_head()
    blind_trial()


def report_head() -> None:
    """Replay the shipped entrapment and take a picture of its report."""
    from PIL import Image, PngImagePlugin

    browser = shutil.which('chromium') or shutil.which('chromium-browser')
    if browser is None:
        sys.exit('tools/readme_pictures.py: no Chromium here; install it for the report')
    with TemporaryDirectory() as folder:
        page, shot = Path(folder) / 'report.html', Path(folder) / 'report.png'
        command = ['replay', str(demo_recording('entrapment')), '--report', str(page)]
        wheel_terra([*command, '--config', 'generic_six_wheel', '--config', 'test_sand'])
        options = ['--headless', '--no-sandbox', '--disable-gpu', '--hide-scrollbars']
        options += ['--window-size={},{}'.format(*SIZE), f'--screenshot={shot}']
        subprocess.run([browser, *options, page.as_uri()], check=True, capture_output=True)
        verdict = re.search(r'<div class="verdict[^>]*>(.*?)</div>', page.read_text('utf-8'), re.S)
        said = PngImagePlugin.PngInfo()
        said.add_text('Description', html.unescape(verdict[1]) if verdict else '')
        with Image.open(shot) as picture:
            picture.convert('RGB').save(REPORT, optimize=True, pnginfo=said)


def blind_trial() -> None:
    """Hide, diagnose blind, compare, draw."""
    from matplotlib import pyplot

    folder = demo_recording('trial')
    diagnosis = trial.solve_blind(folder)
    outcome = trial.compare(folder, diagnosis)
    columns, curves = diagnosis.table.columns, diagnosis.curves
    with picture_style():
        figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 3.6))
        for i, load in enumerate(np.unique(columns['normal_load'])):
            mine = np.flatnonzero(columns['normal_load'] == load)
            mine = mine[np.argsort(columns['slip'][mine])]
            slip, colour = columns['slip'][mine], LINE_COLOURS[i % len(LINE_COLOURS)]
            measured = 1e3 * diagnosis.table.measured[mine, 0]
            left.plot(slip, measured, 'o', color=colour, markersize=4)
            left.plot(slip, 1e3 * curves.before[mine, 0], ':', color=colour)
            left.plot(slip, 1e3 * curves.after[mine, 0], color=colour, label=f'{load:.0f} N')
        left.set_xlabel('slip ratio [-]')
        left.set_ylabel('sinkage [mm]')
        left.set_title('dots: measured; dotted: model before; lines: after')
        left.legend(loc='upper center', bbox_to_anchor=(0.5, -0.17), ncols=5)
        plot_diagnosis(diagnosis, right)
        right.set_title(f'said: {" + ".join(outcome.said)}; hidden: {outcome.hidden}')
        figure.savefig(IMAGES / 'diagnosis.png', dpi=110)
    print(outcome.words)


if __name__ == '__main__':
    main()
