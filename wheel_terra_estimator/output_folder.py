# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Where a command writes: folders and files that are complete or absent, and never those of others.

A place is refused before anything is computed; output is written beside it and renamed at the end,
so that after an error an earlier one stands. Errors of the disk become a `UserError` of one line.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path, PurePosixPath
from typing import Any

from wheel_terra_estimator import __version__
from wheel_terra_estimator.errors import UserError

MARKER = '.wheel-terra.json'
"""File in an output folder that lists what the program wrote there; folders end in ``/``."""

LEAST_ROOM = 2**16  # free space on the disk below which no output is begun [byte]

BESIDE = '.wheel-terra-'
"""In the name of a hidden folder in which an output is written, beside its place."""

LARGEST_MARKER = 16 * 2**20  # A marker is a short list: a longer file [byte] is none of ours


def check_target(
    path: Path,  # what is to be written
    overwrite: bool,  # whether what is there may be replaced
    # What the command reads; the output may neither be it, nor hold it, nor lie in it
    inputs: Iterable[Path] = (),
    *,
    # Whether a folder is to be written; of one that is there only what an earlier run listed is
    # ever replaced
    folder: bool = False,
    # Takes a file that is there and returns why it is none of this program, empty where it is one.
    # Empty files may be replaced.
    foreign: Callable[[Path], str] = lambda path: '',
) -> None:
    """Decide whether a file (or a folder) may be written at ``path``; the only place that does.

    Raises UserError where it may not: what stands there, and what to do.
    """
    try:
        wrong_kind = not path.is_dir() if folder else not path.is_file()
        if path.exists() and not path.is_symlink() and wrong_kind:
            kind = 'a folder' if path.is_dir() else 'not a folder' if folder else 'no regular file'
            raise UserError(f'{path}: is {kind}; choose another path')
        _refuse_place(path, inputs)
        if not path.exists():
            return
        if not overwrite:
            raise UserError(f'{path}: exists already; choose another path or give --overwrite')
        if folder:
            _own_files(path)
        elif path.stat().st_size and (reason := foreign(path)):
            raise UserError(f'{path}: {reason}, so it is not overwritten; choose another path')
    except OSError as error:
        raise cannot_write(path, error) from None


def check_folder(path: Path, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Make sure, before anything is computed, that a folder can be written at ``path``.

    Raises UserError where it may not be written to (`check_target`) or cannot be written.
    """
    check_target(path, overwrite, inputs, folder=True)
    try_to_write(path)


def check_file(
    path: Path,
    overwrite: bool,
    inputs: Iterable[Path] = (),
    foreign: Callable[[Path], str] = lambda path: '',
) -> None:
    """Make sure, before anything is computed, that a file can be written at ``path``.

    Raises UserError where it may not be written to (`check_target`) or cannot be written.
    """
    check_target(path, overwrite, inputs, foreign=foreign)
    try_to_write(path)


def try_to_write(path: Path) -> None:
    """Raise UserError if the nearest folder that exists takes no new entries of some size."""
    try:
        place = _absolute(path).parent
        while not place.exists() and place != place.parent:
            place = place.parent
        with tempfile.TemporaryDirectory(dir=place, prefix=BESIDE) as probe:
            (Path(probe) / 'probe').write_bytes(bytes(LEAST_ROOM))
    except OSError as error:
        raise cannot_write(path, error) from None


@contextmanager
def new_folder(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield an empty folder to be filled; at the end of the block it is at ``path``.

    Raises UserError as `check_target`, and where the disk is full or fails.
    """
    check_target(path, overwrite, folder=True)
    path = _absolute(path)
    try:
        with _beside(path) as beside:
            fresh = beside / path.name
            fresh.mkdir()
            yield fresh
            mark(fresh)
            _put_in_place(fresh, path, beside)
    except OSError as error:
        raise cannot_write(path, error) from None


@contextmanager
def new_file(
    path: Path,
    overwrite: bool = False,
    foreign: Callable[[Path], str] = lambda path: '',
) -> Iterator[Path]:
    """Yield the path of a file to be written; at the end of the block it is at ``path``.

    Its folder is made if it is missing; in a folder of ours the marker then lists the file. A power
    cut leaves the old file or the new one. Raises UserError as `check_target`, and where the disk
    is full or fails.
    """
    check_target(path, overwrite, foreign=foreign)
    path = _absolute(path)
    try:
        with _beside(path) as beside:
            yield beside / path.name
            _sync(beside / path.name)
            (beside / path.name).replace(path)
            _sync(path.parent)
            if is_ours(path.parent):
                mark(path.parent, [path.name])
    except OSError as error:
        raise cannot_write(path, error) from None


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    """Yield a hidden folder beside ``path`` that goes at the end."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made = tempfile.TemporaryDirectory(
        dir=path.parent, prefix=f'.{path.name}{BESIDE}', ignore_cleanup_errors=True
    )
    with made as beside:
        yield Path(beside)


@contextmanager
def working_folder(
    path: Path, overwrite: bool, resume: bool, entries: Iterable[str]
) -> Iterator[None]:
    """Make a folder that a command fills in place in the block, so that it can be resumed.

    Where the block ends with no result the folder goes, and the place is free for the next try.

    ``resume``: whether to continue a folder as it is, where an earlier run of the command made
    it. ``entries``: all names that the command may write there, as in `mark`. Raises UserError as
    `check_folder`.
    """
    entries = [*entries]
    earlier = is_ours(path) and {*entries} <= _marked(path)[0]
    if earlier:
        _remove_leftovers(path)
    if resume and path.exists():
        _refuse_place(path)
        if not earlier and not (path.is_dir() and not any(path.iterdir())):
            raise UserError(
                f'{path}: exists and holds nothing that this command can resume; choose '
                'another path or give --overwrite'
            )
    elif path.exists() and not overwrite:
        raise UserError(f'{path}: exists already; --resume continues it, --overwrite replaces it')
    else:
        check_folder(path, overwrite)
    path = _absolute(path)
    try:
        if path.exists() and not resume:
            _remove_own_files(path)
        path.mkdir(parents=True, exist_ok=True)
        mark(path, entries)
    except OSError as error:
        raise cannot_write(path, error) from None
    try:
        yield
    finally:
        with suppress(OSError, UserError):
            _remove_leftovers(path)
            if path.is_dir():
                found = [path / name for name in _own_files(path)]
                if not any(e.lstat().st_size for e in found if not e.is_dir()):
                    _remove_own_files(path)  # an empty folder is no result


def mark(
    folder: Path,
    # Names relative to the folder, added to those listed already; a name that ends in ``/`` stands
    # for a folder with all that it holds. Default: everything that is there now.
    entries: Iterable[str] | None = None,
    # What the command wants to know when it meets the folder again, see `facts_of`
    facts: Mapping[str, Any] | None = None,
) -> None:
    """List files in the marker of a folder."""
    if entries is None:
        entries = (name for name in _files(folder) if name != MARKER)
    listed, noted = _marked(folder) if is_ours(folder) else ((), {})
    content: dict[str, Any] = {
        'program': f'wheel-terra {__version__}',
        'files': sorted({*listed, *entries}),
    }
    if known := {**noted, **(facts or {})}:
        content['facts'] = known
    part = folder / f'{MARKER}.part'
    try:
        part.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')
        part.replace(folder / MARKER)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def facts_of(folder: Path) -> dict[str, Any]:
    """Return what a command noted in the marker of a folder, where all listed files are there."""
    if not is_ours(folder):
        return {}
    try:
        listed, facts = _marked(folder)
    except UserError:
        return {}
    whole = all(name.endswith('/') or (folder / name).is_file() for name in listed)
    return facts if whole else {}


def _remove_leftovers(folder: Path) -> None:
    """Remove what killed runs left, beside its place, of outputs that a folder lists."""
    for name in _marked(folder)[0]:
        for left in folder.glob(f'.{escape(name.rstrip("/"))}{BESIDE}*'):
            shutil.rmtree(left, ignore_errors=True)


def is_ours(folder: Path) -> bool:
    """Whether a folder bears the marker of this program."""
    return (folder / MARKER).is_file()


class CannotWriteError(UserError):
    """The disk is full, or the path is not writable."""


def cannot_write(path: Path, error: OSError) -> CannotWriteError:
    """Return the one line for an error of the disk."""
    reason = error.strerror or str(error) or type(error).__name__
    remedy = {
        errno.ENOSPC: '; free some space',
        errno.EDQUOT: '; free some space',
        errno.EROFS: '; choose another place',
        errno.EACCES: '; choose another place',
    }.get(error.errno or 0, '')
    return CannotWriteError(f'{path}: cannot be written ({reason}){remedy}')


def refuse_inputs(path: Path, inputs: Iterable[Path]) -> None:
    """Raise UserError for a path that is what the command reads, or holds it, or lies in it."""
    target = _resolved(path)
    for given in inputs:
        try:
            source = given.resolve()
            same = target.exists() and source.exists() and target.samefile(source)
        except (OSError, RuntimeError):  # its reader will report it
            continue
        if same or source == target or target in source.parents or source in target.parents:
            raise UserError(
                f'{path}: is, or lies in, or holds {given}, which the command reads; '
                'choose another path'
            )


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links (Python < 3.13)
        raise UserError(f'{path}: cannot be followed ({error}); choose another path') from None


def _refuse_place(path: Path, inputs: Iterable[Path] = ()) -> None:
    """Refuse places that no command may replace, whatever they hold."""
    if path.is_symlink():
        raise UserError(f'{path}: is a link; name what it leads to, or choose another path')
    target = _resolved(path)
    if target == Path.cwd() or target in Path.cwd().parents:
        raise UserError(f'{path}: is the working folder or holds it; name a new folder')
    refuse_inputs(path, inputs)


def _sync(path: Path) -> None:
    """Have a file, or the entries of a folder, on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _absolute(path: Path) -> Path:
    """Return the path with its folder resolved, so that a name such as ``a/..`` is plain."""
    return path.parent.resolve() / path.name if path.name not in ('', '..') else path.resolve()


def _marked(folder: Path) -> tuple[set[str], dict[str, Any]]:
    """Return what the marker of a folder lists, and the facts in it."""
    marker = folder / MARKER
    try:
        if marker.is_symlink() or marker.stat().st_size > LARGEST_MARKER:
            raise ValueError
        content = json.loads(marker.read_text(encoding='utf-8'))
        names, facts = content['files'], content.get('facts')
        inside = (PurePosixPath(name).parts for name in names)
        if not all(parts and not {'/', '//', '..'} & {*parts} for parts in inside):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise UserError(
            f'{marker}: is not a list of files of this program, so {folder} is not overwritten; '
            'choose another path'
        ) from None
    return set(names), facts if isinstance(facts, dict) else {}


def _files(folder: Path, prefix: str = '') -> Iterator[str]:
    """Yield what a folder holds: files, links and empty folders (with ``/``), never followed."""
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        name = prefix + entry.name
        if entry.is_dir(follow_symlinks=False):
            inner = list(_files(Path(entry.path), f'{name}/'))
            yield from inner or [f'{name}/']
        else:
            yield name


def _own_files(folder: Path) -> list[str]:
    """Return what a folder holds, all of it ours; anything else is an error."""
    there = [name for name in _files(folder) if name != MARKER]
    if there and not is_ours(folder):
        raise UserError(
            f'{folder}: holds {there[0]} and no list of what this program wrote ({MARKER}), so it '
            'is not overwritten; choose another path, or remove it yourself'
        )
    listed = _marked(folder)[0] if is_ours(folder) else set()
    whole = {name for name in listed if name.endswith('/')}
    lists = {name for name in whole if is_ours(folder / name)}  # these files name their own program
    for name in lists:
        _own_files(folder / name)
    foreign = [n for n in there if n not in listed and not n.startswith(tuple(whole))]
    if foreign:
        raise UserError(
            f'{folder}: holds {foreign[0]}, which this program did not write, so it is not '
            'overwritten; choose another path, or take that file away'
        )
    return there


def _remove_own_files(folder: Path) -> None:
    for name in _own_files(folder):
        entry = folder / name
        entry.rmdir() if name.endswith('/') else entry.unlink()
    (folder / MARKER).unlink(missing_ok=True)
    for place, _, _ in os.walk(folder, topdown=False):
        Path(place).rmdir()


def _put_in_place(fresh: Path, path: Path, beside: Path) -> None:
    """Rename the new folder to its place; an earlier one, if all of it is ours, goes."""
    if not path.exists():
        fresh.rename(path)
        return
    _own_files(path)  # somebody may have put a file there in the meantime
    earlier = beside / 'earlier'
    path.rename(earlier)
    try:
        fresh.rename(path)
    except OSError:
        earlier.rename(path)
        raise
