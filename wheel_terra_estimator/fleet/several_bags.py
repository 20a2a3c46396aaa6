# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Many recordings side by side: a folder each, a summary of all, resumable after an end.

The marker of a folder holds a digest of its recording and one of the settings: a later run passes
over recordings that are there already, whatever their names, and refuses other settings.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from wheel_terra_estimator import __version__
from wheel_terra_estimator.bags.replay import DEFAULT, Options
from wheel_terra_estimator.configuration.configuration import Configuration
from wheel_terra_estimator.errors import UserError, outside_cause
from wheel_terra_estimator.fleet.drive import replay_drive
from wheel_terra_estimator.output_folder import (
    CannotWriteError,
    facts_of,
    mark,
    new_file,
    working_folder,
)
from wheel_terra_estimator.reporting.fleet_summary import DriveRow, write_summary_page, write_table
from wheel_terra_estimator.scheduler import finished
from wheel_terra_estimator.terramechanics.effects import load_file

SUMMARY_TABLE = 'summary.csv'
SUMMARY_PAGE = 'summary.html'

DIGEST_SIZE = 20  # bytes of a digest: no two recordings have the same
READ_AT_ONCE = 2**20  # bytes of a recording that are read at a time for its digest


@dataclass(frozen=True)
class Settings:
    """Settings common to all recordings."""

    configuration: Configuration
    remaps: Mapping[str, str]
    output: Path
    files: Mapping[str, str]  # as for `Drive.write` -> name in the folder of each recording
    options: Options = DEFAULT


@dataclass(frozen=True)
class _Task:
    path: Path
    digests: Mapping[str, str]  # of the recording and of the settings, as the marker has them
    folder: str


def replay_bags(
    bags: Sequence[Path], settings: Settings, *, overwrite: bool, jobs: int, scheduler: str
) -> list[DriveRow]:
    """Replay recordings into one folder each and write the summary over all.

    ``overwrite``: whether an earlier output is replaced; else a folder of an earlier run is
    continued. Raises UserError where the output folder cannot be used, or the disk is full: the
    same call goes on from there. Returns them in the order of `bags`; one that failed has its
    error.
    """
    entries = SUMMARY_TABLE, SUMMARY_PAGE
    with working_folder(settings.output, overwrite, not overwrite, entries):
        settings = replace(settings, output=settings.output.absolute())
        return _replay_into(settings, bags, jobs, scheduler)


def _replay_into(
    settings: Settings, bags: Sequence[Path], jobs: int, scheduler: str
) -> list[DriveRow]:
    """Replay what the folder does not hold yet, and write what all came to."""
    output = settings.output
    paths = [path.absolute() for path in bags]
    rows: dict[int, DriveRow] = {}
    tasks = _tasks(settings, paths, rows)
    numbers = list(tasks)
    replayed = finished(partial(_replay, settings), list(tasks.values()), jobs, scheduler)
    for k, row in _shown(replayed, len(tasks)):
        i = numbers[k]
        if isinstance(row, CannotWriteError):
            raise row  # no fault of the recording: the next would fare no better
        if isinstance(row, Exception):
            row = DriveRow(str(bags[i]), error=_words(row, paths[i]))
        rows[i] = row
    ordered = [replace(rows[i], bag=str(bag)) for i, bag in enumerate(bags)]
    with new_file(output / SUMMARY_TABLE, overwrite=True) as path:
        write_table(ordered, path)
    write_summary_page(ordered, output / SUMMARY_PAGE, settings.files.get('report', ''))
    return ordered


def _tasks(
    settings: Settings, paths: Sequence[Path], rows: dict[int, DriveRow]
) -> dict[int, _Task]:
    """Return the recordings left to do, by number; results of the others go to `rows`."""
    output, done, own = settings.output, {}, _digest_of_settings(settings)
    for folder in sorted(output.iterdir()):
        facts = facts_of(folder) if folder.is_dir() else {}
        if isinstance(facts.get('digest'), str) and isinstance(facts.get('row'), dict):
            if facts.get('settings') != own:
                raise UserError(
                    f'{folder}: made with other parameters or options, or by another version, so '
                    'this is no continuation; choose another path or give --overwrite'
                )
            done[facts['digest']] = replace(DriveRow.from_json(facts['row']), folder=folder.name)
    digests = {}
    for i, path in enumerate(paths):
        try:
            digests[i] = _digest(path)
        except UserError as error:
            rows[i] = DriveRow(str(path), error=_words(error, path))
    taken = {row.folder for row in done.values()}
    tasks = {}
    for i, digest in digests.items():
        if digest in done:
            rows[i] = done[digest]
            continue
        name = _free_name(paths[i], taken)
        taken.add(name)
        tasks[i] = _Task(paths[i], {'digest': digest, 'settings': own}, name)
    mark(output, [f'{task.folder}/' for task in tasks.values()])
    return tasks


def _free_name(path: Path, taken: set[str]) -> str:
    path = path.resolve()
    stem = path.name if path.is_dir() else path.stem
    name, number = stem, 1
    while name in taken or name in (SUMMARY_TABLE, SUMMARY_PAGE):
        number += 1
        name = f'{stem}_{number}'
    return name


def _digest_of_settings(settings: Settings) -> str:
    """Return the digest of all that outputs follow from, but the recordings."""
    configuration = settings.configuration
    values = configuration.flat()
    stated = {
        'version': __version__,
        'values': values,
        'stated': sorted(configuration.stated),
        'remaps': dict(settings.remaps),
        'files': dict(settings.files),
        'smooth': settings.options.smooth,
    }
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    digest.update(json.dumps(stated, sort_keys=True, default=str).encode())
    if values['effect_file']:
        digest.update(Path(str(values['effect_file'])).read_bytes())
    return digest.hexdigest()


def _digest(path: Path) -> str:
    """Return the digest of the content of a recording, whatever its name."""
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    try:
        if path.is_dir():
            files = sorted(p for p in path.iterdir() if p.is_file())
        else:
            files = [path, *(p for p in [path.with_name(f'{path.name}-wal')] if p.is_file())]
        for file in files:
            if not file.is_file():
                raise UserError(f'{file}: there is no such recording')
            digest.update(f'{file.suffix} {file.stat().st_size}\n'.encode())
            with file.open('rb') as stream:
                while block := stream.read(READ_AT_ONCE):
                    digest.update(block)
    except OSError as error:
        raise UserError(f'{path}: cannot be read ({error.strerror or error})') from None
    return digest.hexdigest()


def _replay(settings: Settings, task: _Task) -> DriveRow:
    """Replay a recording in a worker; the digest is noted last, when everything is there."""
    configuration = settings.configuration
    if effect_file := configuration.flat().get('effect_file'):
        load_file(str(effect_file))  # its reader has allowed it; this may be another machine
    output = settings.output / task.folder
    options = replace(settings.options, overwrite=True, progress=False)
    drive = replay_drive(task.path, configuration, settings.remaps, output, options)
    drive.write({kind: output / name for kind, name in settings.files.items()}, overwrite=True)
    row = DriveRow.from_drive(str(task.path), drive.summary, drive.checked)
    row = replace(row, folder=task.folder)
    mark(output, [], {**task.digests, 'row': asdict(row)})
    return row


def _words(error: Exception, path: Path) -> str:
    words = outside_cause(error) or f'error of the program ({type(error).__name__}: {error})'
    return ' '.join(words.split()).removeprefix(f'{path}: ')


def _shown(
    outcomes: Generator[tuple[int, Any], None, None], total: int
) -> Iterator[tuple[int, Any]]:
    """Show the rate and the time left on a terminal; end the workers when the loop is left."""
    from tqdm import tqdm

    with closing(outcomes):  # None: quiet where there is no terminal
        yield from tqdm(outcomes, total=total, unit='bag', disable=None)
