# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The package as ROS and pip see it."""

import ast
import importlib
import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

import wheel_terra_estimator
from wheel_terra_estimator.configuration import reader, shipped
from wheel_terra_estimator.messages.convert import INPUT_TYPES
from wheel_terra_estimator.simulation import scenario

ROOT = Path(__file__).resolve().parents[1]
NAME = 'wheel_terra_estimator'
SOURCES = sorted(
    path
    for top in (NAME, 'wheel_terra_lab', 'test', 'tools', 'launch')
    for path in (ROOT / top).rglob('*.py')
)


@pytest.fixture(scope='module')
def manifest():
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def setup_text() -> str:
    return (ROOT / 'setup.py').read_text()


def setup_functions() -> dict:
    """Return what setup.py defines, without running its setup()."""
    namespace: dict = {'__file__': str(ROOT / 'setup.py')}
    exec(compile(setup_text().split('\nsetup(')[0], 'setup.py', 'exec'), namespace)
    return namespace


def entry_points() -> dict[str, tuple[str, str]]:
    found = re.findall(r"'([\w-]+) = ([\w.]+):(\w+)'", setup_text())
    return {name: (module, function) for name, module, function in found}


def test_rosdep_keys_only(manifest):
    keys = [e.text or '' for e in manifest if e.tag.endswith('depend')]
    assert len(keys) == len(set(keys))
    assert all(re.fullmatch(r'[a-z][a-z0-9_-]*', key) for key in keys)
    wanted = {'numpy', 'scipy', 'yaml', 'matplotlib', 'jinja2', 'tqdm', 'filterpy', 'rosbags'}
    for word in wanted:
        assert any(re.fullmatch(rf'python3-{word}(-pip)?', key) for key in keys), word
    code = '\n'.join(path.read_text() for path in (ROOT / NAME / 'ros').glob('*.py'))
    imported = set(re.findall(r'^from (rclpy|\w+_(?:msgs|srvs|interfaces))\b', code, re.MULTILINE))
    assert len(imported) > 5
    assert imported | {'nav_msgs'} <= set(keys)


def test_one_version_everywhere(manifest):
    versions = {
        manifest.findtext('version'),
        setup_functions()['version'](),
        wheel_terra_estimator.__version__,
        re.search(r'^version: (.+)$', (ROOT / 'CITATION.cff').read_text(), re.MULTILINE)[1],
    }
    assert versions == {'0.1.0'}


def test_every_pin_has_a_hash_and_the_version_of_its_source():
    for path in sorted((ROOT / 'requirements').glob('*.txt')):
        pinned = re.split(r'\n(?=\S)', path.read_text())
        packages = [entry for entry in pinned if not entry.startswith('#')]
        assert packages, path
        assert all('--hash=sha256:' in entry for entry in packages), path
        versions = {re.sub('[-_.]+', '-', e.split()[0]).lower() for e in packages}
        by_hand = path.with_suffix('.in').read_text().splitlines()
        for line in by_hand:
            if line and not line.startswith(('#', '-')):
                wanted = re.sub('[-_.]+', '-', re.split(r'[;\s]', line)[0]).lower()
                assert wanted in versions, f'{line}: run requirements/compile'


def test_every_source_file_has_its_licence():
    assert len(SOURCES) > 100
    for path in SOURCES:
        head = path.read_text(encoding='utf-8').splitlines()[:3]
        text = '\n'.join(head)
        assert 'Copyright 2026 wheel_terra_estimator developers' in text, path
        assert 'SPDX-License-Identifier: Apache-2.0' in text, path


def test_ros_finds_the_package():
    assert (ROOT / 'resource' / NAME).is_file()
    assert '/lib/wheel_terra_estimator' in (ROOT / 'setup.cfg').read_text()
    assert {'wheel-terra', 'estimator_node', 'traction_limiter_node'} == set(entry_points())


@pytest.mark.parametrize('name', sorted(entry_points()))
def test_entry_points_exist(name):
    module, function = entry_points()[name]
    if '.ros.' in module:
        pytest.importorskip('rclpy')
    assert callable(getattr(importlib.import_module(module), function))


def test_shipped_files_load():
    for name in shipped.files():
        folder, _, file = name.partition('/')
        if folder in ('rovers', 'soils', 'demo'):
            assert reader.load([name], complete=folder == 'rovers').stated, name
        elif folder == 'scenarios':
            assert scenario.load(file).description, name


def test_every_shipped_folder_is_installed():
    installed = {file for _, files in setup_functions()['shared_files']() for file in files}
    on_disk = {
        p.relative_to(ROOT).as_posix()
        for top in ('config', 'data', 'launch')
        for p in (ROOT / top).rglob('*')
        if p.is_file() and p.suffix != '.pyc' and not p.name.startswith('.')
    }
    assert on_disk <= installed
    assert 'package.xml' in installed


def test_the_launch_file_of_a_replay_plays_inputs_only():
    """Outputs of an old run beside those of the node would be taken for them."""
    tree = ast.parse((ROOT / 'launch/replay.launch.py').read_text())
    tree.body = [node for node in tree.body if getattr(node, 'name', '') == 'played']
    namespace = {'INPUT_TYPES': INPUT_TYPES}
    exec(compile(tree, 'replay.launch.py', 'exec'), namespace)
    inputs = {f'/{topic}' for topic in INPUT_TYPES}
    assert set(namespace['played']([])) == inputs
    remaps = ['/truth/odometry:=reference_odom', 'odom:=/wheels', '/cmd_vel:=/replayed/cmd_vel']
    assert set(namespace['played'](remaps)) == inputs - {'/odom'} | {'/truth/odometry'}


def test_no_path_of_a_machine_is_committed():
    # Words are put together so that this file does not find itself.
    words = ['/work' + '/', '/home' + '/', '/root' + '/']
    files = [
        *SOURCES,
        *(p for p in (ROOT / 'docs').rglob('*.md')),
        *(p for p in (ROOT / 'config').rglob('*.yaml')),
        ROOT / 'Makefile',
        ROOT / 'setup.py',
    ]
    for path in files:
        text = path.read_text(encoding='utf-8')
        for word in words:
            assert word not in text, f'{path}: {word}'


def test_the_image_has_the_oldest_versions_and_what_rosdep_does_not():
    text = (ROOT / 'Dockerfile').read_text(encoding='utf-8')
    pinned = (ROOT / 'requirements' / 'oldest.txt').read_text(encoding='utf-8')
    pins = re.findall(r'([\w.-]+)==([\w.]+)', text)
    assert len(pins) == 7
    for name, number in pins:
        assert f'{re.sub("[._]", "-", name)}=={number} ' in pinned, name
    manifest = (ROOT / 'package.xml').read_text(encoding='utf-8')
    (skipped,) = re.findall(r"--skip-keys '([^']+)'", text)
    assert set(skipped.split()) == set(re.findall(r'>(python3-\w+-pip)<', manifest))
    container = json.loads((ROOT / '.devcontainer' / 'devcontainer.json').read_text())
    assert f'AS {container["build"]["target"]}\n' in text
    for line in re.findall(r'^COPY (\S+)', text, re.M):
        assert (ROOT / line).exists()


def test_the_conda_recipe_asks_for_what_setup_asks_for():
    recipe = yaml.safe_load((ROOT / 'packaging' / 'conda' / 'recipe.yaml').read_text())
    assert recipe['context']['version'] == wheel_terra_estimator.__version__
    wanted = re.findall(r"'([\w-]+>=[\d.]+)'", setup_text().split('extras_require')[0])
    names = {'PyYAML': 'pyyaml', 'matplotlib': 'matplotlib-base'}
    asked = {
        f'{names.get(name, name)} >={number}' for name, number in (w.split('>=') for w in wanted)
    }
    assert set(recipe['requirements']['run']) == {*asked, 'python >=${{ python_min }}'}
    for file in recipe['about']['license_file']:
        assert (ROOT / file).is_file()
