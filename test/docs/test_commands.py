# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Commands in all pages are understood by the programs they name; tutorials also run them."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import sub_parsers

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted((ROOT / 'docs').rglob('*.md')), ROOT / 'README.md', ROOT / 'CONTRIBUTING.md']
PARSERS = sub_parsers()
PROGRAMS = r'(?:wheel-terra|python3? -m wheel_terra\S+|python3? tools/\S+)'
BLOCKS = re.compile(r'^ *```(?:sh|bash|console)\n(.*?)^ *```|((?:^    \S.*\n)+)', re.M | re.S)
SHORTENED = re.compile(r'\.\.\.|…|COMMAND')


def commands(page: Path) -> list[str]:
    """Return the commands of ours in the blocks of a page, one line each."""
    text = page.read_text(encoding='utf-8')
    blocks = ''.join(a or b for a, b in BLOCKS.findall(text)).replace('\\\n', ' ')
    found = re.findall(rf'^ *({PROGRAMS} [^\n|>;&#`]*)', blocks, re.M)
    return [line for line in found if not SHORTENED.search(line)]


CASES = [
    pytest.param(line, id=f'{page.relative_to(ROOT)}: {line[:60]}')
    for page in PAGES
    for line in dict.fromkeys(commands(page))
]


def test_there_are_commands_to_judge():
    assert len(CASES) > 60


@pytest.mark.parametrize('line', CASES)
def test_a_command_of_a_page_is_understood(line):
    words = shlex.split(re.sub(r'\$\w+', '1', line))
    if words[0] == 'wheel-terra':
        if words[1].startswith('-'):
            return  # of the program itself: --version, --help
        try:
            PARSERS[words[1]].parse_args(words[2:])
        except SystemExit as end:
            assert end.code == 0, line
    elif words[1] == '-m':
        assert importlib.util.find_spec(words[2]) is not None, line
    else:
        assert (ROOT / words[1]).is_file(), line
