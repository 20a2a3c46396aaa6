# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay BAG BAG ...``: the numbers of one replay, failures, restarts, summary."""

import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.output_folder import MARKER


@pytest.fixture
def bags(make_bag, drive):
    """Drives of three lengths, and what is none."""
    paths = [make_bag(drive[: len(drive) * k // 9], name=f'drive{k}') for k in (3, 2, 1)]
    broken = paths[0].parent / 'broken.mcap'
    broken.write_bytes(b'none')
    return [str(path) for path in (paths[0], broken, *paths[1:])]


def estimates(folder: Path) -> bytes:
    (file,) = folder.glob('*.mcap')
    return file.read_bytes()


def test_several_are_what_each_is_alone(bags, config, tmp_path, printed):
    out = tmp_path / 'out'
    arguments = ['replay', *bags, *config, '-o', str(out), '--jobs', '2', '--table', 't.csv']
    said = printed(arguments, 1).splitlines()
    assert said[-2] == '1 of 4 recordings failed:'
    assert said[-1].startswith(f'  {bags[1]}: not one message can be read')
    for name in ('drive3', 'drive2', 'drive1'):
        alone = tmp_path / 'alone' / name
        assert main(['replay', str(tmp_path / name), *config, '-o', str(alone)]) == 0
        assert estimates(out / name) == estimates(alone)
        assert (out / name / 't.csv').is_file()
    with (out / 'summary.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['bag'] for row in rows] == bags
    assert [bool(row['error']) for row in rows] == [False, True, False, False]
    lengths = [float(row['duration [s]']) for row in rows if not row['error']]
    assert lengths == sorted(lengths, reverse=True)
    page = (out / 'summary.html').read_text()
    assert '<td>drive3</td>' in page and 'broken.mcap' in page


def test_a_restart_passes_over_what_is_done_by_content(bags, config, tmp_path, printed):
    """Same content under another name is done; other content of one name gets another folder."""
    out = tmp_path / 'out'
    good = [bags[0], *bags[2:]]
    assert main(['replay', *good[:2], *config, '-o', str(out)]) == 0

    def written() -> dict[str, int]:
        return {p.parent.name: p.stat().st_mtime_ns for p in out.glob('*/*.mcap')}

    first = written()
    summary = (out / 'summary.csv').read_bytes()
    assert main(['replay', *good[:2], *config, '-o', str(out)]) == 0
    assert written() == first and (out / 'summary.csv').read_bytes() == summary
    renamed = Path(good[0]).with_name('renamed')
    Path(good[0]).rename(renamed)
    (tmp_path / 'other').mkdir()
    third = Path(good[2]).rename(tmp_path / 'other' / 'drive3')
    for given, folders in (
        ([str(third), good[1]], ['drive3_2', 'drive2']),
        ([str(renamed), good[1], str(third)], ['drive3', 'drive2', 'drive3_2']),
    ):
        told = json.loads(printed(['replay', *given, *config, '-o', str(out), '--json']))
        assert [drive['folder'] for drive in told['drives']] == folders
        assert [drive['bag'] for drive in told['drives']] == given
        then = written()
        assert set(then) == {'drive3', 'drive2', 'drive3_2'}
        assert {name: then[name] for name in first} == first


def test_other_settings_are_no_continuation(bags, config, tmp_path, refused):
    """As for one recording, outputs of other parameters are replaced with --overwrite alone."""
    out = tmp_path / 'out'
    again = ['replay', *bags[2:], *config, '-o', str(out)]
    assert main(again) == 0
    before = {name: estimates(out / name) for name in ('drive1', 'drive2')}
    summary = (out / 'summary.csv').read_bytes()
    for other in (['-p', 'rover.mass:=41.0'], ['--smooth'], ['--table', 't.csv']):
        refused([*again, *other], 'drive1: made with other parameters or options')
    assert {name: estimates(out / name) for name in before} == before
    assert (out / 'summary.csv').read_bytes() == summary
    assert main([*again, '-p', 'rover.mass:=41.0', '--overwrite']) == 0
    assert estimates(out / 'drive1') != before['drive1']


def test_an_output_that_has_lost_a_file_is_made_anew(bags, config, tmp_path, undrawn):
    out = tmp_path / 'out'
    arguments = ['replay', bags[1], bags[3], *config, '-o', str(out), '--report', 'r.html']
    assert main(arguments) == 1
    assert (out / 'drive1' / 'r.html').is_file()
    assert 'href="drive1/r.html"' in (out / 'summary.html').read_text()
    (file,) = (out / 'drive1').glob('*.mcap')
    kept = file.read_bytes()
    file.unlink()
    assert main(arguments) == 1
    assert estimates(out / 'drive1') == kept
    (out / 'note.txt').touch()  # of somebody else: nothing is removed
    assert main([*arguments, '--overwrite']) == 2
    (out / 'note.txt').unlink()
    assert main(['replay', bags[1], bags[1], *config, '-o', str(out), '--overwrite']) == 1
    assert not (out / 'drive1').exists()


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        ([], 'add -o DIR'),
        (['-o', 'taken'], 'holds nothing that this command can resume; choose another path'),
        (['-o', 'o', '--report', 'there/r.html'], 'give a plain name such as r.html'),
        (['-o', 'o', '--jobs', '0'], 'give 1 or more'),
        (['-o', 'o', '--arrival', 'log'], 'belongs to one recording'),
    ],
)
def test_what_cannot_be_done_is_said_first(
    bags, config, tmp_path, monkeypatch, refused, more, words
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'taken').mkdir()
    (tmp_path / 'taken' / 'note.txt').touch()
    refused(['replay', *bags, *config, *more], words)
    assert not (tmp_path / 'o').exists()


@pytest.mark.slow
def test_ctrl_c_leaves_whole_outputs_and_the_next_run_goes_on(
    make_bag, make_drive, config, tmp_path
):
    long = make_bag(make_drive(150), name='long')
    short = make_bag(name='short')
    out = tmp_path / 'out'
    program = [sys.executable, '-m', 'wheel_terra_estimator.cli.main']
    command = [*program, 'replay', str(short), str(long), *config, '-o', str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60.0
        while not (out / 'short' / MARKER).is_file() and time.monotonic() < deadline:
            time.sleep(0.02)
        while not list(out.glob('.long.*')) and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.endswith('interrupted; the same command without --overwrite resumes\n')
    assert sorted(p.name for p in out.iterdir()) == [MARKER, 'short']
    before = estimates(out / 'short')
    assert main(command[3:]) == 0
    assert estimates(out / 'short') == before and (out / 'long').is_dir()
