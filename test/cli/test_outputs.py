# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""No command writes to what it reads: every output of every command against every input."""

import argparse
import re
import socket
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from wheel_terra_estimator import scheduler
from wheel_terra_estimator.cli import demo
from wheel_terra_estimator.cli.main import main, sub_parsers
from wheel_terra_estimator.cli.outputs import Output, file_or_entry
from wheel_terra_estimator.configuration import reader, soil_file
from wheel_terra_estimator.configuration.shipped import FileName
from wheel_terra_estimator.output_folder import new_folder

PATH_LIKE = re.compile(r'(^|\|)(F|FILE|DIR|BAG|DATA|A|B|LOG|MAP)($|\||\.)')
"""Placeholders that stand for a path in the help of a command."""
READ = Path, FileName, file_or_entry
HARMLESS = argparse._HelpAction, argparse._StoreTrueAction, argparse._StoreConstAction
ROVER = 'wheels.names: [left, right]\n    rover.mass: 50.0\n'


def leaves(
    parsers: dict[str, argparse.ArgumentParser], prefix: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], argparse.ArgumentParser]]:
    for name, parser in parsers.items():
        below = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
        if below:
            yield from leaves(dict(below[0].choices), (*prefix, name))
        else:
            yield (*prefix, name), parser


COMMANDS = dict(leaves(sub_parsers()))


def outputs(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    return [action for action in parser._actions if isinstance(action, Output)]


def inputs(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    return [a for a in parser._actions if a.type in READ and not isinstance(a, Output)]


PAIRS = [
    pytest.param(words, output.dest, given.dest, id=f'{"_".join(words)}-{output.dest}-{given.dest}')
    for words, parser in COMMANDS.items()
    for output in outputs(parser)
    for given in inputs(parser)
]


@pytest.mark.parametrize('words', COMMANDS, ids=' '.join)
def test_every_option_says_whether_it_is_read_or_written(words):
    for action in COMMANDS[words]._actions:
        if isinstance(action, HARMLESS) or action.choices or isinstance(action, Output):
            continue
        metavar = action.metavar if isinstance(action.metavar, str) else action.dest
        if PATH_LIKE.search(metavar) and action.dest != 'name':  # of `config`, a shipped name
            assert action.type in READ, f'{action.dest}: type=Path or action=Output'


def test_the_walk_finds_what_it_is_for():
    assert len(PAIRS) > 30


def command_line(words: tuple[str, ...], given: dict[str, Path], spare: Path) -> list[str]:
    """Return a command line with all that is required; `spare` stands for files not given."""
    line = list(words)
    for action in COMMANDS[words]._actions:
        wanted = action.dest in given
        if not (wanted or action.required) or isinstance(action, HARMLESS):
            continue
        value = str(given.get(action.dest, spare))
        if action.choices:
            value = str(next(iter(action.choices)))
        line += [*([action.option_strings[-1]] if action.option_strings else []), value]
    return [*line, '--overwrite']


@pytest.mark.parametrize(('words', 'output', 'given'), PAIRS)
def test_no_output_is_an_input_or_holds_one_or_lies_in_it(words, output, given, tmp_path, refused):
    """By whatever name: the path itself, another spelling, a hard link, our own folder."""
    ours = tmp_path / 'ours'
    with new_folder(ours) as folder:
        (folder / 'mine.yaml').write_text(f'/**:\n  ros__parameters:\n    {ROVER}')
    mine = ours / 'mine.yaml'
    before = mine.read_bytes()
    (tmp_path / 'hard.yaml').hardlink_to(mine)
    for target in (mine, ours / '..' / 'ours' / 'mine.yaml', tmp_path / 'hard.yaml', ours):
        line = command_line(words, {given: mine, output: target}, tmp_path / 'spare.yaml')
        refused(line, 'which the command reads')
        assert mine.read_bytes() == before
    if next(a for a in inputs(COMMANDS[words]) if a.dest == given).type is Path:
        line = command_line(words, {given: ours, output: mine}, tmp_path / 'spare.yaml')
        refused(line, 'which the command reads')
    assert [p.name for p in ours.iterdir() if p.name != '.wheel-terra.json'] == ['mine.yaml']


def test_the_effect_file_of_a_rover_file_is_an_input(tmp_path, refused):
    effects = tmp_path / 'effects.py'
    effects.write_text('mine = 1\n')
    rover = tmp_path / 'rover.yaml'
    rover.write_text(f'/**:\n  ros__parameters:\n    {ROVER}    effect_file: effects.py\n')
    line = ['calibrate', 'bag', '--config', str(rover), '-o', str(effects), '--overwrite']
    refused(line, 'effects.py, which the command reads')
    assert effects.read_text() == 'mine = 1\n'


def test_one_path_for_two_outputs_is_refused(tmp_path, refused):
    out = str(tmp_path / 'out.csv')
    refused(['replay', 'bag', '--table', out, '--track', out], 'given for two outputs')


def test_a_soil_file_replaces_no_file_of_another_kind(tmp_path, refused):
    """--overwrite is for earlier soil files: a rover file is none."""
    mine = tmp_path / 'my_rover.yaml'
    reader.load(['pathfinder']).write(mine)
    before = mine.read_bytes()
    line = ['replay', 'bag', '--config', 'pathfinder', '--save-soil', str(mine), '--overwrite']
    refused(line, f"does not begin with '# {soil_file.HEADER}'")
    assert mine.read_bytes() == before


REFUSED = {
    'simulate': 'simulate --config {bad} -o',
    'calibrate': 'calibrate {bag} -o',
    'init': 'init --bag {bag} -o',
    'convert': 'convert {table} -o',
    'replay': 'replay {bag} {bad} --scheduler {silent} -o',
    'predict': 'predict --points {table} -o',
    'diagnose': 'diagnose {table} -o',
    'trial': 'trial --effect nobody -o',
    'soilbin run': 'soilbin run {bad} -o',
    'soilbin rows': 'soilbin rows --no-cache --sweep pull --seeds 1 --scheduler {silent} -o',
    'reproduce': 'reproduce nakashima --run --part table7 --seeds 1 --no-cache '
    '--scheduler {silent} -o',
    'evaluate': 'evaluate --kinds climb --first-seed -1 -o',
    'demo': 'demo --no-node -o',
}
"""Command line of every command that writes, refused as late as can be; the place is appended."""


def test_the_refused_are_all_commands():
    assert {' '.join(words) for words, parser in COMMANDS.items() if outputs(parser)} == {*REFUSED}


@pytest.mark.parametrize('command', REFUSED)
def test_a_refused_run_leaves_nothing_and_its_place_free(command, tmp_path, monkeypatch, capsys):
    """The next try is refused for the same reason, not because of what the first one left."""
    monkeypatch.setattr(scheduler, 'CONNECT_TIMEOUT', 0.2)
    monkeypatch.setattr(demo, '_running', lambda *_: nullcontext(lambda: (2, '')))
    with socket.create_server(('127.0.0.1', 0)) as silent:
        paths = {name: tmp_path / f'given.{name}' for name in ('bag', 'bad', 'table')}
        for path in paths.values():
            path.write_text('none of yours\n')
        names = {**paths, 'silent': f'tcp://127.0.0.1:{silent.getsockname()[1]}'}
        line = REFUSED[command].format(**names).split()
        said = []
        for _ in range(2):
            assert main([*line, str(tmp_path / 'out')]) == 2
            assert {path.name for path in tmp_path.iterdir()} == {p.name for p in paths.values()}
            said.append(capsys.readouterr().err)
    assert said[0] == said[1]
    assert 'exists' not in said[0]
