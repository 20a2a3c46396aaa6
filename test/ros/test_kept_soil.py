# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The soil file of a node: nobody else's file is written, one node writes, nothing fails unsaid."""

import errno
import json
import os
import resource
from pathlib import Path

import pytest
from test_estimator_node import ROVER

from wheel_terra_estimator import output_folder
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.soil_file import HEADER, KeptSoil, StuckState, write_values
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.ros.arrival_log import ArrivalLog

LEARNED = {'soil.cohesion': 400.0, 'soil.cohesion_std': 100.0}
STUCK = StuckState(True, 'wheels dig in', 90, 1)
OWN = f'# {HEADER}\n/**:\n  ros__parameters:\n'
FOREIGN = {
    'rover file': '/**:\n  ros__parameters:\n    rover.mass: 120.0\n',
    'soil without our header': '# my sand\n/**:\n  ros__parameters:\n    soil.cohesion: 170.0\n',
    'header further down': f'# mine\n{OWN}    soil.cohesion: 170.0\n',
    'our header, own keys added': f'{OWN}    effects.lug_digging.enabled: true\n',
    'notes': 'years of work\n',
    'no text': b'\x00\xff' * 50,
}


@pytest.fixture
def configuration():
    return reader.load(['pathfinder'])


@pytest.fixture
def path(tmp_path):
    return tmp_path / 's.yaml'


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def left_over(folder):
    """Names in a folder that the node's files do not account for."""
    return {p.name for p in folder.iterdir()} - {'s.yaml', 's.yaml.state.json'}


@pytest.mark.parametrize('content', FOREIGN.values(), ids=FOREIGN)
@pytest.mark.parametrize('linked', [False, True])
def test_a_file_of_somebody_else_is_refused_and_stays_as_it_is(tmp_path, content, linked):
    path = write(tmp_path / 'mine.yaml', content)
    before = path.read_bytes()
    if linked:
        path = tmp_path / 'link.yaml'
        path.symlink_to('mine.yaml')
    with pytest.raises(UserError, match=r'soil_file: .* choose another path'):
        KeptSoil(path)
    assert (tmp_path / 'mine.yaml').read_bytes() == before
    assert not list(tmp_path.glob('.*')), 'nothing is left beside it'


def test_a_path_without_a_name_is_refused():
    with pytest.raises(UserError, match=r'soil_file: /: is a folder'):
        KeptSoil(Path('/'))


def test_a_file_that_the_node_reads_is_refused_even_if_it_is_a_soil_file(path, tmp_path):
    write_values(path, LEARNED)
    with pytest.raises(UserError, match='which the command reads'):
        KeptSoil(path, [path])
    hard = tmp_path / 'hard.yaml'
    hard.hardlink_to(path)
    with pytest.raises(UserError, match='which the command reads'):
        KeptSoil(hard, [path])


@pytest.mark.parametrize('before', [None, '', f'{OWN}    soil.cohesion: 170.0\n'])
def test_a_new_an_empty_and_an_own_file_are_written(path, tmp_path, configuration, before):
    if before is not None:
        write(path, before)
    kept = KeptSoil(path)
    kept.values(configuration)
    kept.save(LEARNED, STUCK)
    assert not kept.fault
    again = KeptSoil(path)
    assert again.values(configuration) == LEARNED
    assert again.warning() == STUCK
    assert not left_over(tmp_path)


def test_what_is_put_in_its_place_later_is_not_overwritten(path, tmp_path):
    kept = KeptSoil(path)
    kept.save(LEARNED, STUCK)
    mine = write(path, FOREIGN['rover file']).read_bytes()
    with pytest.raises(UserError, match='not overwritten'):
        kept.save(LEARNED, STUCK)
    assert 'not overwritten' in kept.fault
    assert path.read_bytes() == mine
    state = write(tmp_path / 's.yaml.state.json', '{"my": "notes"}')
    path.unlink()
    with pytest.raises(UserError, match='no state of the estimator'):
        kept.save(LEARNED, STUCK)
    assert state.read_text() == '{"my": "notes"}'


def test_an_own_file_that_does_not_suit_the_rover_is_told_and_left_alone(path, configuration):
    other_rover = f'{OWN}    sensors.torque_zero: [0.0, 0.0, 0.0]\n'
    write(path, other_rover)
    kept = KeptSoil(path)
    assert kept.values(configuration) == {}
    assert 'torque_zero' in kept.fault
    with pytest.raises(UserError, match='until it is removed'):
        kept.save(LEARNED, STUCK)
    kept.save({}, STUCK)
    assert kept.fault, 'a warning that can be kept takes nothing back'
    assert path.read_text() == other_rover
    assert kept.warning() == STUCK


@pytest.mark.parametrize('number', [errno.ENOSPC, errno.EROFS, errno.EIO, errno.EDQUOT])
@pytest.mark.parametrize('call', ['fsync', 'write'])
def test_a_disk_that_takes_nothing_is_told_and_nothing_is_left(
    path, tmp_path, configuration, monkeypatch, number, call
):
    kept = KeptSoil(path)
    kept.save(LEARNED, STUCK)

    def fails(*arguments, **options):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as context:
        if call == 'fsync':
            context.setattr(output_folder.os, 'fsync', fails)
        else:
            context.setattr('pathlib.Path.write_text', fails)
        with pytest.raises(UserError, match='cannot be written'):
            kept.save({'soil.cohesion': 1.0}, StuckState())
    assert os.strerror(number) in kept.fault
    assert kept.values(configuration) == LEARNED
    assert not left_over(tmp_path)
    kept.save(LEARNED, STUCK)
    assert not kept.fault


def test_the_folder_is_on_the_disk_behind_each_rename(tmp_path, monkeypatch):
    synced, fsync = [], os.fsync
    monkeypatch.setattr(
        output_folder.os, 'fsync', lambda fd: (synced.append(os.fstat(fd).st_ino), fsync(fd))
    )
    KeptSoil(tmp_path / 's.yaml').save(LEARNED, STUCK)
    for name in ('s.yaml', 's.yaml.state.json'):
        file = synced.index((tmp_path / name).stat().st_ino)
        assert tmp_path.stat().st_ino in synced[file:]


@pytest.mark.parametrize('name', ['soil_file', 'record_arrival'])
def test_a_node_writes_to_no_file_that_it_reads(listener, parameters, name):
    """With an error of which `run_node` makes one line and an exit status."""
    from wheel_terra_estimator.ros.lifecycle_node import EstimatorNode

    before = Path(parameters).read_text()
    arguments = [*ROVER, parameters, '-p', f'{name}:={parameters}']
    with pytest.raises(UserError, match=f'{name}: {parameters}: is, or lies in'):
        EstimatorNode(context=listener[0].context, cli_args=arguments)
    assert Path(parameters).read_text() == before


def test_an_arrival_log_replaces_nothing_but_an_arrival_log(tmp_path):
    log = write(tmp_path / 'arrival.txt', 'imu/data 1700000000000000000\nreset\n')
    ArrivalLog(str(log), (), print).close()
    for content in ('years of work\n', 'imu/data\n', b'\xff' * 1000):
        with pytest.raises(UserError, match='is no arrival log'):
            ArrivalLog(str(write(log, content)), (), print)


def test_a_full_disk_ends_the_arrival_log_alone(tmp_path):
    """An error would end the estimator."""
    path, said = tmp_path / 'arrival.txt', []
    first = ArrivalLog(str(path), (), said.append)
    first.write('imu/data 1')
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20, hard))
    try:
        for stamp in range(5):
            first.write(f'imu/data {stamp}')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert said == ['record_arrival: the log ends here (File too large)']
    ArrivalLog(str(path), (), said.append).close()  # free for the next
    ArrivalLog('', (), said.append).write('imu/data 1')


def test_a_damaged_state_is_told_and_the_soil_is_kept_all_the_same(path, tmp_path):
    state = write(tmp_path / 's.yaml.state.json', json.dumps(['no state']))
    kept = KeptSoil(path)
    assert kept.warning() == StuckState()
    assert 'is not a state' in kept.fault
    with pytest.raises(UserError, match='no state of the'):
        kept.save(LEARNED, STUCK)
    assert path.exists()
    assert json.loads(state.read_text()) == ['no state']
