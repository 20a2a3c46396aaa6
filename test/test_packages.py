# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The source distribution and the wheel, built and used without the source tree."""

from __future__ import annotations

import os
import subprocess
import venv
import zipfile
from email import message_from_string
from pathlib import Path

import pytest

from wheel_terra_estimator import __version__

ROOT = Path(__file__).resolve().parents[1]
pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command without this source tree on the path; return what it prints."""
    environment = {k: v for k, v in os.environ.items() if k != 'PYTHONPATH'}
    result = subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


@pytest.fixture(scope='module')
def built_wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the source distribution (as a package index would hold both)."""
    return build(tmp_path_factory.mktemp('packages'))


def build(work: Path, without: str = 'nothing') -> Path:
    """Return the wheel of the committed files, without those below a folder."""
    source = work / 'source'
    listed = run('git', 'ls-files', cwd=ROOT).splitlines()
    for name in listed:
        if (ROOT / name).is_file() and not name.startswith(f'{without}/'):
            target = source / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((ROOT / name).read_bytes())
    tools = work / 'tools'
    venv.create(tools, with_pip=True)
    run(tools / 'bin' / 'pip', 'install', '--quiet', 'build', cwd=work)
    run(tools / 'bin' / 'python', '-m', 'build', '--outdir', work / 'dist', source, cwd=work)
    assert list((work / 'dist').glob('*.tar.gz'))
    return next((work / 'dist').glob('*.whl'))


def test_metadata(built_wheel: Path) -> None:
    with zipfile.ZipFile(built_wheel) as archive:
        name = next(n for n in archive.namelist() if n.endswith('.dist-info/METADATA'))
        metadata = message_from_string(archive.read(name).decode())
        files = archive.namelist()
    assert metadata['Version'] == __version__
    assert metadata['License-Expression'] == 'Apache-2.0'
    assert metadata['Requires-Python'] == '>=3.10'
    assert metadata['Description-Content-Type'] == 'text/markdown'
    assert metadata.get_all('Classifier')
    assert any(n.endswith('data/demo/entrapment/entrapment.mcap') for n in files)
    assert any(n.endswith('config/soils/dlr_mss.yaml') for n in files)
    assert 'wheel_terra_lab/soilbin/config/cases/quick.yaml' in files
    assert not any(n.startswith(('test/', 'tools/')) for n in files)


def installed(wheel: Path, folder: Path) -> Path:
    """Install a wheel in an environment of its own; return the command."""
    environment = folder / 'environment'
    venv.create(environment, with_pip=True)
    pins = ROOT / 'requirements' / 'runtime.txt'
    run(environment / 'bin' / 'pip', 'install', '--quiet', '-r', pins, cwd=folder)
    run(environment / 'bin' / 'pip', 'install', '--quiet', '--no-deps', wheel, cwd=folder)
    return environment / 'bin' / 'wheel-terra'


def test_demo_after_pip_install_alone(built_wheel: Path, tmp_path: Path) -> None:
    command = installed(built_wheel, tmp_path)
    check_demo(command, tmp_path)
    assert 'usage: wheel-terra trial' in run(command, 'trial', '--help', cwd=tmp_path)


def test_the_product_without_the_laboratory(tmp_path: Path) -> None:
    command = installed(build(tmp_path, without='wheel_terra_lab'), tmp_path)
    assert not list((tmp_path / 'environment').rglob('wheel_terra_lab'))
    check_demo(command, tmp_path)
    for name in ('trial', 'soilbin', 'evaluate', 'bench'):
        said = subprocess.run([command, name], cwd=tmp_path, capture_output=True, text=True)
        assert said.returncode == 2
        assert 'wheel_terra_lab) is not installed' in said.stderr


def check_demo(command: Path, tmp_path: Path) -> None:
    assert run(command, '--version', cwd=tmp_path).split()[-1] == __version__
    said = run(command, 'demo', '--no-node', cwd=tmp_path)
    assert 'entrapped at' in said
    assert 'warned' in said
    assert 'hidden effect hard_layer, identified hard_layer: right' in said
    for name in ('entrapment', 'pathfinder', 'trial/diagnosis/report'):
        assert (tmp_path / 'demo_output' / f'{name}.html').stat().st_size > 100_000
