# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write a page with pictures: the wheel-soil models against measured wheels.

    python -m wheel_terra_lab.studies.validate_models -o DIR [--shared ../shared] [--only ...]

Needs the folder with measured data; takes about a minute. What follows from it is said in
``docs/models/validation.md``, which shows some of the pictures.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECTIONS = (
    'hit_wheels',
    'grc3_wheel',
    'cmu_wheel',
    'cmu_sideways',
    'small_wheels',
)
HEAD = '# Validation of the wheel-soil models'


def main() -> int:
    """Run the sections."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('-o', '--output', type=Path, required=True, help='folder of the page')
    parser.add_argument('--shared', type=Path, default=ROOT.parent / 'shared')
    parser.add_argument('--only', nargs='+', choices=SECTIONS, default=SECTIONS)
    arguments = parser.parse_args()
    if not (arguments.shared / 'measured').is_dir():
        print(f'no measured data in {arguments.shared}; name the folder with --shared')
        return 2
    figures = arguments.output / 'figures'
    figures.mkdir(parents=True, exist_ok=True)
    texts = [HEAD]
    for name in arguments.only:
        print(f'{name} ...', file=sys.stderr)
        module = importlib.import_module(f'wheel_terra_lab.studies.model_validation.{name}')
        texts.append(module.section(arguments.shared, figures).strip())
    page = arguments.output / 'validation.md'
    page.write_text('\n\n'.join(texts) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
