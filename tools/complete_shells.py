# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Write the completion of bash and zsh from the parsers of the commands.

python tools/complete_shells.py
"""

from __future__ import annotations

import argparse
import re
import shlex
from pathlib import Path

from wheel_terra_estimator.cli.main import COMMANDS, sub_parsers
from wheel_terra_estimator.configuration import shipped

FOLDER = Path(__file__).resolve().parents[1] / 'wheel_terra_estimator' / 'cli' / 'completion'
FILES = {'bash': FOLDER / 'wheel-terra', 'zsh': FOLDER / '_wheel-terra'}
"""Shell -> its shipped file, under the name that the shell looks for."""
_HEAD = '# Written by python tools/complete_shells.py; do not edit.'
_BASH = """\
{head}
_wheel_terra() {{
    local command="${{COMP_WORDS[1]}}" current="${{COMP_WORDS[COMP_CWORD]}}" words=''
    if [[ $COMP_CWORD -eq 1 ]]; then
        words={commands}
    elif [[ $current == -* ]]; then
        case "$command" in
{options}
        esac
    else
        case "$command ${{COMP_WORDS[COMP_CWORD-1]}}" in
{values}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o bashdefault -o default -F _wheel_terra wheel-terra
"""
_ZSH = """\
#compdef wheel-terra
{head}
local -a found
if [[ $CURRENT -eq 2 ]]; then
    found=({commands})
elif [[ ${{words[CURRENT]}} == -* ]]; then
    case ${{words[2]}} in
{options}
    esac
else
    case "${{words[2]}} ${{words[CURRENT-1]}}" in
{values}
    esac
    _files
fi
_describe wheel-terra found
"""
_HELP_WORDS = 60  # characters of a description


def scripts() -> dict[str, str]:
    """Return shell -> text of its file."""
    options: dict[str, dict[str, str]] = {}
    values = {('*', '--config'): _configurations()}
    for command, parser in sub_parsers().items():
        subs = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
        names = [name for action in subs for name in action.choices]
        if names:
            values[command, command] = names
        below = [p for action in subs for p in action.choices.values()]
        options[command] = {}
        for action in [action for p in (parser, *below) for action in p._actions]:
            for option in action.option_strings if action.help != argparse.SUPPRESS else ():
                options[command][option] = _brief(action.help or '')
                if action.choices:
                    values[command, option] = [str(choice) for choice in action.choices]
    return {'bash': _bash(options, values), 'zsh': _zsh(options, values)}


def _configurations() -> list[str]:
    names = [key.partition('/') for key in shipped.files()]
    return [name for folder, _, name in names if folder in ('rovers', 'soils')]


def _brief(text: str) -> str:
    return re.split(r'[,;:(\[]', text.replace('%', ''))[0].strip()[:_HELP_WORDS]


def _pattern(name: str) -> str:
    return '*' + shlex.quote(name[1:]) if name.startswith('*') else shlex.quote(name)


def _bash(options: dict[str, dict[str, str]], values: dict[tuple[str, str], list[str]]) -> str:
    def case(name: str, words: list[str]) -> str:
        return f'        {_pattern(name)}) words={shlex.quote(" ".join(words))} ;;'

    return _BASH.format(
        head=_HEAD,
        commands=shlex.quote(' '.join(COMMANDS)),
        options='\n'.join(case(name, list(found)) for name, found in options.items()),
        values='\n'.join(case(' '.join(key), found) for key, found in values.items()),
    )


def _zsh(options: dict[str, dict[str, str]], values: dict[tuple[str, str], list[str]]) -> str:
    def words(found: dict[str, str]) -> str:
        return ' '.join(shlex.quote(f'{name}:{text}') for name, text in found.items())

    def case(name: str, found: str) -> str:
        return f'        {_pattern(name)}) found=({found}) ;;'

    return _ZSH.format(
        head=_HEAD,
        commands=words({name: _brief(text) for name, text in COMMANDS.items()}),
        options='\n'.join(case(name, words(found)) for name, found in options.items()),
        values='\n'.join(
            case(' '.join(key), ' '.join(map(shlex.quote, found))) for key, found in values.items()
        ),
    )


if __name__ == '__main__':
    for shell, text in scripts().items():
        FILES[shell].write_text(text, encoding='utf-8')
