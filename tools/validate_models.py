# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/models/validation.md and its pictures: models against truth and measurement.

    python tools/validate_models.py [--shared ../shared] [--only SECTION ...]

Needs the folder with measured data; takes about two minutes. With ``--only`` the sections are
printed and nothing is written but their pictures.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SECTIONS = (
    'closed_forms',
    'hit_wheels',
    'ding_statements',
    'grc3_wheel',
    'cmu_wheel',
    'small_wheels',
    'speed',
)
HEAD = """# Validation of the wheel-soil models

<!-- Written by `python tools/validate_models.py`; do not edit. -->

Every figure on this page is measured by that command. Limit cases with known algebra, property
tests and Jacobians are in `test/terramechanics`.
"""


def main() -> int:
    """Run the sections."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else '')
    parser.add_argument('--shared', type=Path, default=ROOT.parent / 'shared')
    parser.add_argument('--only', nargs='+', choices=SECTIONS)
    arguments = parser.parse_args()
    if not (arguments.shared / 'measured').is_dir():
        print(f'no measured data in {arguments.shared}; name the folder with --shared')
        return 2
    pages = ROOT / 'docs' / 'models'
    texts = []
    for name in arguments.only or SECTIONS:
        print(f'{name} ...', file=sys.stderr)
        module = importlib.import_module(f'model_validation.{name}')
        texts.append(module.section(arguments.shared, pages / 'figures'))
    page = '\n\n'.join(texts) + '\n'
    if arguments.only:
        print(page)
    else:
        (pages / 'validation.md').write_text(f'{HEAD}\n{page}', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
