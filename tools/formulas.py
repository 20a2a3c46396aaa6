# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Formulas of the effect catalogue, written for a terminal, as TeX for the site."""

from __future__ import annotations

import re

GREEK = {'phi', 'rho', 'sigma', 'tau', 'kappa', 'delta', 'pi', 'lam'}
FUNCTIONS = {'exp', 'tan', 'cot', 'sin', 'cos', 'ln', 'max'}
PAIRS = {'kb', 'kd', 'ks', 'Kc', 'Kg', 'Nc', 'Ng', 'Np', 'nw'}
"""Symbols of two letters whose second is an index."""
_TOKEN = re.compile(
    r'(?P<word>[A-Za-z]+\d?(?:_[A-Za-z0-9]+)?)|(?P<number>\d+(?:\.\d+)?)'
    r'|(?P<assign>[-+*]=)|(?P<other>\S)|(?P<space>\s+)'
)


def as_tex(formula: str) -> list[str]:
    """Return one TeX formula per statement of a formula."""
    statements = []
    for segment in re.split(r';\s+', formula):
        for piece in _pieces(segment):
            statements.append(_tex(piece))
    return statements


def _pieces(segment: str) -> list[str]:
    """Split at commas outside of brackets; what states nothing stays with its neighbour."""
    parts, depth, begin = [], 0, 0
    for at, sign in enumerate(segment):
        depth += (sign in '([') - (sign in ')]')
        if segment.startswith(', ', at) and depth == 0:
            parts.append(segment[begin:at])
            begin = at + 2
    parts.append(segment[begin:])
    joined: list[str] = []
    for part in parts:
        if joined and ('=' not in part or '=' not in joined[-1]):
            joined[-1] += f', {part}'
        else:
            joined.append(part)
    return joined


def _tex(piece: str) -> str:
    text = re.sub(r'<(?=\S)([^<>]+)>', r'⟨\1⟩', piece)
    text = re.sub(r'\^([a-z]{2,})', r'^{\1}', text)
    text = re.sub(r'\)\+(?=$|/|\s\()', r')_{+}', text)
    for name, opening in (('sqrt', r'\\sqrt{'), (r'\^', '^{'), (r'\^-', '^{-')):
        text = _braces(text, name, opening)
    made = ''
    for token in _TOKEN.finditer(text):
        kind, value = token.lastgroup, token.group()
        made += _word(value) if kind == 'word' else value.replace('*=', r'\times= ')
    made = made.replace('⟨', r'\langle ').replace('⟩', r'\rangle ').replace('...', r'\dots ')
    return re.sub(r'\s+', ' ', made).strip()


def _braces(text: str, name: str, opening: str) -> str:
    """Put braces in the place of the brackets that follow a name."""
    while found := re.search(rf'{name}\(', text):
        depth, end = 1, found.end()
        while depth:
            depth += (text[end] == '(') - (text[end] == ')')
            end += 1
        inside = text[found.end() : end - 1]
        text = text[: found.start()] + opening.replace('\\\\', '\\') + inside + '}' + text[end:]
    return text


def _word(word: str) -> str:
    base, _, index = word.partition('_')
    if word == 'sqrt':
        return word
    if base in GREEK:
        made = {'lam': r'\lambda', 'phi': r'\varphi'}.get(base, f'\\{base}')
    elif base in FUNCTIONS:
        return f'\\{base} '
    elif base == 'Int':
        return r'\int '
    elif base == 'dt':
        return r'\,\mathrm{d}t'
    elif base == 'sgn':
        return r'\mathrm{sgn}'
    elif base in PAIRS or re.fullmatch(r'[A-Za-z]\d', base):
        made, index = base[0], base[1]
    elif len(base) == 1:
        made = base
    else:
        return rf'\text{{ {word.replace("_", " ")} }}'
    if not index:
        return f'{made} '
    return f'{made}_{{{index}}} ' if len(index) == 1 else rf'{made}_{{\mathrm{{{index}}}}} '
