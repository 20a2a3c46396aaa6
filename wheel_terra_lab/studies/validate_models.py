# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write docs/models/validation.md and its pictures: models against truth and measurement.

    python -m wheel_terra_lab.studies.validate_models [--shared ../shared] [--only SECTION ...]

Needs the folder with measured data; takes about two minutes. With ``--only`` these sections of the
page are written anew and the others are left as they are.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECTIONS = (
    'closed_forms',
    'hit_wheels',
    'ding_statements',
    'equivalent_circle',
    'grc3_wheel',
    'cmu_wheel',
    'small_wheels',
    'transfer',
    'rover_slope',
    'speed',
)
HEAD = """# Validation of the wheel-soil models

<!-- Written by `python -m wheel_terra_lab.studies.validate_models`; do not edit. -->

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
    page = pages / 'validation.md'
    texts = _sections(page) if arguments.only else {}
    for name in arguments.only or SECTIONS:
        print(f'{name} ...', file=sys.stderr)
        module = importlib.import_module(f'wheel_terra_lab.studies.model_validation.{name}')
        text = module.section(arguments.shared, pages / 'figures')
        texts[_title(text)] = text
    body = '\n\n'.join(text.strip() for text in texts.values())
    page.write_text(f'{HEAD}\n{body}\n', encoding='utf-8')
    return 0


def _sections(page: Path) -> dict[str, str]:
    """Return the sections of the page as it is, by title."""
    parts = page.read_text(encoding='utf-8').split('\n## ')[1:]
    return {_title(f'## {part}'): f'## {part}' for part in parts}


def _title(text: str) -> str:
    return text.splitlines()[0]


if __name__ == '__main__':
    sys.exit(main())
