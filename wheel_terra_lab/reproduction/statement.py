# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""A statement of a paper beside ours, with a verdict."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

HEAD = (
    '# Three papers, statement by statement',
    '',
    '`wheel-terra reproduce all -o DIR` writes this page from installed code and shipped data.',
    'Allowed: 8 points of slip (section 6: 10 %), 10 % of forces, 15 % of sinkages and of the slip '
    'of a crossing, 25 % of power numbers, 5 % of a density, 2 degrees, a rank correlation of 0.7.',
    '*no test*: an input, a definition, a picture, or an accuracy that the paper does not state.',
    '*grains x2*: of twice the diameter. *z_a* counts from where the wheel begins to turn. '
    'Errors of the pull are the worst at slip 0.05 to 0.6, with a pull above a tenth of the load.',
    '',
)

_TOLERANCE = re.compile(r'\b(apart|allowed|asked)\b')
"""Parts of a reason that say no more than the head of the page."""
_ALLOWED = re.compile(r', [\d.]+(?: %)? (?:allowed|asked)')


@dataclass(frozen=True)
class Statement:
    """One row of the page."""

    place: str  # where the paper has it: ``figure 3``, ``table 7``, ``text``, ``equation 12``
    what: str  # the quantity with its unit
    paper: str  # what the paper states
    ours: str  # what we compute
    holds: bool | None  # None: not computed, or an input that cannot fail
    why: str = ''  # within what it is reproduced, or why it is not
    wheel: int = 0  # of several wheels with the same quantity; 0: no such

    @property
    def verdict(self) -> str:
        """The verdict in words, of what is not reproduced."""
        words = '**not**' if self.holds is False else 'no test'
        why = _ALLOWED.sub('', self.why)
        return f'{words}: {why}' if why else words


def belongs_to(statement: Statement, figure: str) -> bool:
    """Return whether a statement is one of a figure, ``12`` including ``12(a)``."""
    name = statement.place.removeprefix('figures ').removeprefix('figure ')
    plain = figure.removeprefix('figure ')
    return statement.place.startswith('figure') and (
        name == plain or name.partition('(')[0] == plain or plain in name.split(', ')
    )


def within(paper: float, ours: float, share: float) -> tuple[bool, str]:
    """Return whether two numbers agree to a share of the paper's, and how far they are apart."""
    off = abs(ours - paper) / abs(paper)
    return off <= share, f'{100 * off:.0f} % apart, {100 * share:.0f} % allowed'


def page(title: str, statements: Sequence[Statement]) -> list[str]:
    """Return the lines of one paper: what is reproduced, then the rest with the reason."""
    held = sum(row.holds is True for row in statements)
    judged = sum(row.holds is not None for row in statements)
    lines = [f'## {title}', '', f'{held} of {judged} statements that can fail are reproduced:', '']
    lines += ['| where | what | paper | ours |', '|---|---|---|---|']
    groups: dict[tuple[str, ...], list[Statement]] = {}
    for s in statements:
        alone = '' if s.holds and s.wheel else f'{s.wheel} {s.holds}'
        groups.setdefault((s.place, s.what, alone), []).append(s)
    lines += [_row(group) for group in groups.values() if group[0].holds]
    rest = [_row(group) for group in groups.values() if not group[0].holds]
    return [
        *lines,
        '',
        '| where | what | paper | ours | verdict |',
        '|---|---|---|---|---|',
        *rest,
        '',
    ]


def _in_runs(numbers: Sequence[int]) -> str:
    """Return numbers in their order, three and more that follow one another as ``1 to 3``."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ', '.join(
        f'{run[0]} to {run[-1]}' if len(run) > 2 else ', '.join(map(str, run)) for run in runs
    )


def _row(group: Sequence[Statement]) -> str:
    """Return one row: a statement, or those of several wheels that are all reproduced."""
    first, several = group[0], len(group) > 1
    wheels = _in_runs([s.wheel for s in group if s.wheel])
    what = f'wheel{"s" * several} {wheels}: {first.what}' if wheels else first.what
    paper, ours = ', '.join(s.paper for s in group), ', '.join(s.ours for s in group)
    if not first.holds:
        return f'| {first.place} | {what} | {paper} | {ours} | {first.verdict} |'
    note = '; '.join(part for part in first.why.split('; ') if not _TOLERANCE.search(part))
    if several:
        worst = max((s.why for s in group), key=lambda why: float(why.partition(' ')[0]))
        note = f'at worst {worst.partition(",")[0]}'
    return f'| {first.place} | {what} | {paper} | {ours}{f" ({note})" if note else ""} |'
