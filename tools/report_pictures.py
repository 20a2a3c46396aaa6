# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of a report as readers see it: 1280 and 390 pixels wide, light and dark, side by side.

    python tools/report_pictures.py report.html -o docs/development/report_replay.jpg

Needs Chromium, and Pillow (which matplotlib brings).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

WIDTHS = (1280, 390)  # [px]
SCHEMES = {'light': 1, 'dark': 0}  # Chromium's numbers
NARROWEST = 500  # [px], of a headless window
GAP = 20  # [px]
QUALITY = 80  # of a JPEG
BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('page', type=Path)
    parser.add_argument('-o', dest='output', type=Path, required=True)
    parser.add_argument('--height', type=int, default=1500, help='of the page that is shown [px]')
    parser.add_argument('--scale', type=float, default=0.5, help='of the picture')
    arguments = parser.parse_args()
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        parser.error('there is no Chromium here')
    shots = [
        shot(browser, arguments.page.resolve(), width, scheme, arguments.height)
        for width in WIDTHS
        for scheme in SCHEMES
    ]
    whole = Image.new('RGB', (sum(s.width + GAP for s in shots) - GAP, arguments.height), 'grey')
    left = 0
    for picture in shots:
        whole.paste(picture, (left, 0))
        left += picture.width + GAP
    size = (round(whole.width * arguments.scale), round(whole.height * arguments.scale))
    small = whole.resize(size, Image.Resampling.LANCZOS)
    small.save(arguments.output, quality=QUALITY, optimize=True)


def shot(browser: str, page: Path, width: int, scheme: str, height: int) -> Image.Image:
    """Return the top of a page; a frame makes it narrower than a headless window can be."""
    with tempfile.TemporaryDirectory() as folder:
        frame, target = Path(folder) / 'frame.html', Path(folder) / 'shot.png'
        style = f'border:0;width:{width}px;height:{height}px'
        frame.write_text(
            f'<body style="margin:0"><iframe src="{page.as_uri()}" style="{style}"></iframe></body>'
        )
        subprocess.run(
            [
                browser,
                '--headless',
                '--no-sandbox',
                '--disable-gpu',
                '--hide-scrollbars',
                '--allow-file-access-from-files',
                '--virtual-time-budget=8000',
                f'--user-data-dir={Path(folder) / "profile"}',
                f'--blink-settings=preferredColorScheme={SCHEMES[scheme]}',
                f'--window-size={max(width, NARROWEST)},{height}',
                f'--screenshot={target}',
                frame.as_uri(),
            ],
            check=True,
            capture_output=True,
        )
        with Image.open(target) as picture:
            return picture.convert('RGB').crop((0, 0, width, height))


if __name__ == '__main__':
    main()
