# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Output folders are whole or not there, and nobody else's file is ever removed."""

from pathlib import Path

import pytest

from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.output_folder import (
    MARKER,
    check_file,
    check_folder,
    new_file,
    new_folder,
    working_folder,
)


def write(path: Path, overwrite: bool = False, content: str = 'new') -> None:
    with new_folder(path, overwrite) as folder:
        (folder / 'report.json').write_text(content)
        (folder / 'below').mkdir()
        (folder / 'below' / 'picture.png').write_text(content)


def contents(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): p.read_text()
        for p in folder.rglob('*')
        if p.is_file() and p.name != MARKER
    }


def test_overwrite_replaces_what_was_listed_and_nothing_else(tmp_path):
    out = tmp_path / 'out'
    write(out, content='old')
    with pytest.raises(UserError, match='exists already'):
        write(out)
    write(out, overwrite=True)
    assert contents(out) == {'report.json': 'new', 'below/picture.png': 'new'}
    (out / 'below' / 'thesis.md').write_text('years of work')
    with pytest.raises(UserError, match=r'holds below/thesis\.md, which this program'):
        write(out, overwrite=True)
    assert len(contents(out)) == 3
    assert [p.name for p in tmp_path.iterdir()] == ['out']


def test_a_file_of_others_in_an_output_within_an_output_is_left_alone(tmp_path):
    out = tmp_path / 'out'
    with working_folder(out, False, False, ['inner/']):
        write(out / 'inner')
    (out / 'inner' / 'thesis.md').write_text('years of work')
    with pytest.raises(UserError, match=r'thesis\.md, which this program did not write'):
        write(out, overwrite=True)


@pytest.mark.parametrize('foreign', ['summary.json', 'report.json', 'x.mcap', 'notes.md', 'deep/'])
def test_a_folder_without_our_list_is_never_overwritten(tmp_path, foreign):
    out = tmp_path / 'out'
    out.mkdir()
    (out / foreign).mkdir() if foreign.endswith('/') else (out / foreign).write_text('mine')
    with pytest.raises(UserError, match='not overwritten'):
        write(out, overwrite=True)
    with pytest.raises(UserError, match='not overwritten'):
        check_folder(out, True)
    with pytest.raises(UserError, match='not overwritten'):
        working_folder(out, True, False, ['summary.json']).__enter__()
    assert (out / foreign).exists()


@pytest.mark.parametrize(
    'marker',
    [
        '',
        '[]',
        '{"files": 1}',
        '{"files": ["../../victim"]}',
        '{"files": ["/etc/passwd"]}',
        '[' * 10000,
    ],
)
def test_a_forged_marker_removes_nothing(tmp_path, marker):
    out = tmp_path / 'a' / 'out'
    out.mkdir(parents=True)
    (tmp_path / 'victim').write_text('mine')
    (out / MARKER).write_text(marker)
    with pytest.raises(UserError, match='is not a list of files'):
        write(out, overwrite=True)
    assert (tmp_path / 'victim').exists()


def test_places_that_no_command_replaces(tmp_path, monkeypatch):
    work = tmp_path / 'work'
    work.mkdir()
    monkeypatch.chdir(work)
    link, loop = tmp_path / 'link', tmp_path / 'loop'
    link.symlink_to(work)
    loop.symlink_to(loop)
    bag = tmp_path / 'bags' / 'bag'
    bag.mkdir(parents=True)
    for path, words in (
        (Path(), 'working folder'),
        (Path('..'), 'working folder'),
        (tmp_path, 'working folder'),
        (link, 'is a link'),
        (loop, 'is a link'),
        (bag, 'which the command reads'),
        (bag.parent, 'which the command reads'),
        (bag / 'out', 'which the command reads'),
        (loop / 'out', 'cannot be'),
    ):
        for overwrite in (False, True):
            with pytest.raises(UserError, match=words) as caught:
                check_folder(path, overwrite, [bag])
            assert '\n' not in str(caught.value)


def test_a_file_is_replaced_only_when_told_so(tmp_path):
    report = tmp_path / 'r.html'
    report.write_text('old')
    with pytest.raises(UserError, match='exists already'):
        check_file(report, False)
    with pytest.raises(RuntimeError), new_file(report, True) as path:
        path.write_text('half')
        raise RuntimeError
    assert report.read_text() == 'old'
    with new_file(report, True) as path:
        path.write_text('new')
    assert report.read_text() == 'new'
    link = tmp_path / 'link.html'
    link.symlink_to(report)
    for path, words in (
        (link, 'is a link'),
        (Path('/dev/full'), 'no regular file'),
        (tmp_path, 'is a folder'),
        (report, 'which the command reads'),
    ):
        with pytest.raises(UserError, match=words):
            check_file(path, True, [report])
    assert [p.name for p in sorted(tmp_path.iterdir())] == ['link.html', 'r.html']


def test_only_leftovers_of_what_a_folder_lists_are_removed(tmp_path):
    run = tmp_path / 'run'
    with working_folder(run, False, False, ['a/']):
        (run / 'a').mkdir()
        (run / 'a' / 'x').write_text('0')
    for name in 'ab':
        (run / f'.{name}.wheel-terra-1').mkdir()
    with working_folder(run, False, True, ['a/']):
        assert [p.name for p in run.glob('.?.*')] == ['.b.wheel-terra-1']
    with (
        pytest.raises(UserError, match='holds nothing that this command can resume'),
        working_folder(run, False, True, ['b/']),
    ):
        pass


def test_a_working_folder_goes_on_or_starts_anew(tmp_path):
    run = tmp_path / 'run'
    entries = ['summary.json', '.work/']

    def fill(overwrite: bool, resume: bool, name: str = '') -> None:
        with working_folder(run, overwrite, resume, entries):
            (run / '.work' / 'frames').mkdir(parents=True, exist_ok=True)
            if name:
                (run / '.work' / 'frames' / name).write_text('0')
            raise KeyboardInterrupt

    for _ in range(2):  # nothing was written: the place is free
        with pytest.raises(KeyboardInterrupt):
            fill(False, False)
        assert not run.exists()
    with pytest.raises(KeyboardInterrupt):
        fill(False, False, '0.npz')
    with pytest.raises(UserError, match='--resume continues it, --overwrite replaces it'):
        fill(False, False)
    with pytest.raises(KeyboardInterrupt):
        fill(False, True)
    assert set(contents(run)) == {'.work/frames/0.npz'}
    with pytest.raises(KeyboardInterrupt):
        fill(True, False, '1.npz')
    assert set(contents(run)) == {'.work/frames/1.npz'}
    (run / 'notes.md').write_text('mine')
    with pytest.raises(UserError, match=r'notes\.md'):
        fill(True, False)
    assert set(contents(run)) == {'.work/frames/1.npz', 'notes.md'}
