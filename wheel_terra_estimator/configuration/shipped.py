# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Where the shipped files are, however the package was installed, and how they are called."""

from __future__ import annotations

import difflib
import functools
import os
from collections.abc import Iterator
from pathlib import Path

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import check_regular

PACKAGE = 'wheel_terra_estimator'


def configuration_folder() -> Path:
    """Return the folder that holds ``rovers``, ``soils``, ``scenarios`` and so on.

    A source tree or editable install has it beside the package; pip and colcon put it below
    ``share`` of a prefix above the package, or of another one in ``AMENT_PREFIX_PATH``.
    """
    return _shipped_folder('config')


def demo_recording(name: str) -> Path:
    """Return the folder of a drive, or of the trial, that is shipped for ``wheel-terra demo``."""
    return _shipped_folder('data') / 'demo' / name


def _shipped_folder(top: str) -> Path:
    for folder in _candidates(top):
        if folder.is_dir():
            return folder
    raise UserError(
        f'the shipped files (share/{PACKAGE}/{top}) were not found; install {PACKAGE} with pip or '
        'colcon, or name files by their path'
    )


def _candidates(top: str) -> Iterator[Path]:
    package = Path(__file__).resolve().parents[1]
    if (package.parent / 'package.xml').is_file():
        yield package.parent / top
    below = Path('share') / PACKAGE / top
    for prefix in package.parents:
        yield prefix / below
    for prefix_text in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix_text:
            yield Path(prefix_text) / below


def files(folder: Path | None = None) -> dict[str, Path]:
    """Return the shipped files by name relative to the folder, without suffix."""
    return dict(_files_below(folder or configuration_folder()))


@functools.cache
def _files_below(folder: Path) -> dict[str, Path]:
    found = sorted(p for p in folder.rglob('*') if p.suffix in ('.yaml', '.yml'))
    return {p.relative_to(folder).with_suffix('').as_posix(): p for p in found}


class FileName(str):
    """A path, or the bare name of a shipped file, as an option of a command has it."""


def find(name: str | Path, kind: str = '', folder: Path | None = None) -> Path:
    """Return the file that ``name`` means: a path, or the bare name of a shipped file.

    A bare name (``frostyboy``) may have its folder in front (``soils/hit_lss1``); ``kind``: folder
    to search (``scenarios``), empty: all; ``folder``: where the shipped files lie, None: those of
    the package. Raises UserError if no file or more than one has the name.
    """
    path = Path(name).expanduser()
    if path.is_file():
        return path
    text = str(name)
    shipped = files(folder)
    if kind:
        shipped = {key: p for key, p in shipped.items() if key.startswith(f'{kind}/')}
    wanted = text.removesuffix('.yaml').removesuffix('.yml')
    matches = [key for key in shipped if key == wanted or key.endswith(f'/{wanted}')]
    if len(matches) == 1:
        return shipped[matches[0]]
    if matches:
        raise UserError(f"'{text}' is ambiguous: {' or '.join(matches)}")
    if path.is_dir():
        raise UserError(f'{text}: is a folder, not a configuration file')
    if path.exists():
        check_regular(path)
    by_name = {key.rsplit('/', 1)[-1]: key for key in shipped}
    close = difflib.get_close_matches(wanted.rsplit('/', 1)[-1], by_name, 3, 0.0)
    alike = difflib.get_close_matches(wanted.rsplit('/', 1)[-1], close[:1])
    hint = f"did you mean '{alike[0]}'? " if alike else ''
    near = [by_name[name] for name in close]
    raise UserError(
        f'{text}: no such file, and no shipped file of this name; {hint}the nearest are '
        f'{", ".join(near)}' + ('' if folder else ' (all: wheel-terra config list)')
    )
