# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay`` and ``compare``: findings before estimates, outputs, truth in sight."""

import contextlib
import io
import itertools
import json
import re
import signal
import warnings
from typing import Any

import numpy as np
import pytest
from message_factory import serialised
from recordings import changed

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.history import read_estimates
from wheel_terra_estimator.bags.simulated_drive import TRUTH_TOPICS, write_simulated_drive
from wheel_terra_estimator.bags.storage import messages_of, open_bag
from wheel_terra_estimator.bags.writer import NAMESPACE
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.ros_yaml import read as read_values
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.messages.convert import INPUT_TYPES, JOINT_STATE
from wheel_terra_estimator.simulation import scenario
from wheel_terra_estimator.simulation.drive import simulate

CONFIG = ['--config', 'generic_six_wheel', '--config', 'test_sand']


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    """Half a metre in four seconds."""
    fast = {'drive__time': [0.0], 'drive__forward': [0.2], 'drive__turn_rate': [0.0]}
    folder = tmp_path_factory.mktemp('drive') / 'drive'
    write_simulated_drive(simulate(scenario.load('turns', **fast), 5, 4.0), folder)
    return folder


@pytest.fixture(scope='module')
def live(simulated, tmp_path_factory):
    """Folder of the estimates `out` and their table, and what was said."""
    folder, said = tmp_path_factory.mktemp('live'), io.StringIO()
    written = ['--table', str(folder / 'table.csv'), '-o', str(folder / 'out')]
    with contextlib.redirect_stdout(said):
        assert main(['replay', str(simulated), *CONFIG, *written]) == 0
    return folder, said.getvalue()


def test_truth_and_table(live):
    folder, said = live
    assert 'against the truth (/ground_truth)' in said and 'true / estimated' in said
    assert 'not used, on /ground_truth' not in said
    assert (folder / 'table.csv').read_text().startswith('stamp [ns],wheel,')


@pytest.fixture
def upside_down(make_drive, tmp_path):
    """Drives with the IMU on its back, by their steps; topics of the truth without a message."""

    def make(steps):
        inputs = ('joint_states', 'imu/data', 'reference_odom')
        topics = {**{f'/{name}': INPUT_TYPES[name] for name in inputs}, **TRUTH_TOPICS}
        with BagFile(tmp_path / f'{steps}', topics) as bag:
            for number, (topic, message, time) in enumerate(make_drive(steps)):
                if topic == '/imu/data':
                    message.linear_acceleration.z = -9.8
                    message.angular_velocity.z = 0.001 * (number % 4 - 1.5)
                    message.orientation_covariance[0] = -1.0
                bag.write(topic, serialised(message), time)
        return bag.path

    return make


def test_findings_come_before_anything_else(upside_down, config, printed):
    told = json.loads(printed(['replay', upside_down(100), *config, '--json']))
    assert [f['kind'] for f in told['findings']] == ['mounting']
    assert not told['warnings']
    for wheel in told['wheels']:
        seconds = dict(wheel['seconds'])
        # The inputs are on trial for 8 s.
        assert sum(seconds.values()) - seconds['unknown'] < 8.0, 'until it is told'
    said = printed(['replay', upside_down(30), *config])
    assert said.startswith('finding: mounting') and 'imu_mounting_roll_deg: 180' in said
    assert 'against the truth' not in said


def test_smoothed_and_compared(simulated, live, tmp_path, printed, undrawn):
    """Same sets at the same times, warnings and diagnostics as given live, both in the report."""
    page, table = tmp_path / 'page.html', tmp_path / 'table.csv'
    ways = ['--track', str(tmp_path / 'way.csv')]
    smooth = ['--smooth', '--report', str(page), '--table', str(table), *ways]
    said = printed(['replay', str(simulated), *CONFIG, *smooth, '-o', str(tmp_path / 'smooth')])
    assert 'note: smoothed: each estimate uses' in said
    with open_bag(live[0] / 'out') as plain, open_bag(tmp_path / 'smooth') as smooth:
        assert plain.topics.keys() == smooth.topics.keys()
        for topic in plain.topics:
            one, other = list(plain.messages([topic])), list(smooth.messages([topic]))
            assert [m[0] for m in one] == [m[0] for m in other], topic
            same = [m[2] for m in one] == [m[2] for m in other]
            if topic in (
                '/diagnostics',
                *(f'{NAMESPACE}/{name}' for name in ('stuck', 'mobility')),
            ):
                assert same, topic
            elif topic in (f'{NAMESPACE}/{name}' for name in ('slip', 'slip_stddev', 'twist')):
                assert not same, topic
    assert 'The estimates are those of the fixed-interval smoother' in page.read_text()
    assert table.is_file()
    assert 'Where the ground is bad' in page.read_text()
    assert (tmp_path / 'way.csv').is_file()
    pair = [live[0] / 'out', tmp_path / 'smooth']
    told = json.loads(printed(['compare', *pair, '--truth', simulated, '--json']))
    assert told['differences']['drawbar_pull']['rms'] > 0.0
    assert told['errors']['a']['quantities']['slip']['rms'] > 0.0
    assert 'same slip class in' in printed(['compare', *pair])
    assert main(['compare', str(pair[0]), str(simulated)]) == 2


def test_files_have_their_endings_and_a_remap_leads_to_an_input(simulated, refused):
    command = ['replay', simulated, *CONFIG]
    refused([*command, '--report', 'r.pdf'], 'ends in .html')
    refused([*command, '--table', 't.xls'], 'ends in .csv or .parquet')
    refused([*command, '--track', 'way.png'], 'ends in .csv')
    said = refused([*command, '--remap', 'sinkage:=/nothing'])
    assert '--remap sinkage:=/ground_truth' not in said


SPANS = (10**10, 10**13, 4 * 10**17)  # [ns]
WILD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e9, 5e-324)


def run(command, bag, capsys, *more):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        status = main([command, str(bag), *CONFIG, *more])
    out, err = capsys.readouterr()
    assert status in (0, 1), err
    assert not err and 'nan' not in out.split() and 'internal error' not in out
    return out


@pytest.mark.parametrize(
    'seed', [s if s % 4 == 0 else pytest.param(s, marks=pytest.mark.slow) for s in range(9)]
)
def test_random_stamps(simulated, tmp_path, capsys, seed):
    random = np.random.default_rng(seed)

    def change(topic, message):
        if hasattr(message, 'header') and random.random() < (1.0, 0.5, 0.02)[seed // 3]:
            stamp = int(1.7e18) + int(random.integers(0, SPANS[seed % 3]))
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        return message

    bag = changed(simulated, tmp_path / 'bag', change)
    run('check', bag, capsys)
    run('replay', bag, capsys)


def test_a_recording_without_stamps_is_no_success(simulated, tmp_path, capsys):
    def change(topic, message):
        if hasattr(message, 'header'):
            message.header.stamp.sec = message.header.stamp.nanosec = 0
        return message

    assert main(['replay', str(changed(simulated, tmp_path / 'bag', change)), *CONFIG]) == 2
    said = capsys.readouterr()
    assert 'x stamp is zero or negative' in said.out and 'bag: no estimate; ' in said.err


def test_wild_numbers_in_the_truth(simulated, tmp_path, capsys):
    numbers = itertools.cycle(WILD)

    def change(topic, message):
        if topic == '/ground_truth/twist':
            message.twist.twist.linear.x = next(numbers)
        elif topic.startswith('/ground_truth/s') and hasattr(message, 'position'):
            message.position = np.array([next(numbers) for _ in message.position])
        return message

    assert 'against the truth' in run(
        'replay', changed(simulated, tmp_path / 'bag', change), capsys
    )


def test_without_an_imu_the_first_finding_says_so(simulated, tmp_path, printed):
    bag = changed(simulated, tmp_path / 'bag', lambda topic, m: None if 'imu' in topic else m)
    assert 'the recording has no IMU' in printed(['check', str(bag), *CONFIG], 1).splitlines()[1]
    assert 'the recording has no IMU' in printed(['replay', str(bag), *CONFIG]).splitlines()[0]


def test_drive_gives_a_bag_a_report_and_a_summary(make_bag, config, tmp_path, printed):
    out, report = tmp_path / 'out', tmp_path / 'report.html'
    arguments = ['replay', str(make_bag()), *config, '-o', str(out), '--report', str(report)]
    said = printed(arguments)
    assert '40 estimates' in said
    assert re.search(r'joint_states +40 +none', said)
    assert 'not in the bag: sinkage, leaving_angle' in said
    assert 'without a reference velocity' not in said
    with open_bag(out) as bag:
        history = read_estimates(bag)
        on_slopes = [
            m.stamp for _, _, m in messages_of(bag, {f'{NAMESPACE}/slip_on_slope': JOINT_STATE})
        ]
    assert len(on_slopes) >= 3 and all(round(d * 1e-9) == 1 for d in np.diff(on_slopes))
    # Rim speed 0.42 m/s, reference 0.36 m/s: slip 1/7 on both wheels when it was just heard.
    seconds = history.seconds
    just_heard = (seconds % 1.0 > 0.05) & (seconds % 1.0 < 0.15) & (seconds > 1.5)
    assert just_heard.any()
    np.testing.assert_allclose(history.values['slip'][just_heard], 1 / 7, atol=0.06)
    assert (history.slip_class[-10:] == SlipClass.LOW).all()
    page = report.read_text()
    assert len(re.findall('<path class="line', page)) == 2 + 2 * 3 + 2  # speeds; two wheels; slopes
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)  # nothing is loaded from elsewhere
    for i, name in enumerate(('left', 'right')):  # the terminal has the first figures of the page
        rows = re.findall(rf'<tr><td>{name}</td>(.*?)</tr>', page, re.DOTALL)
        cells = re.findall(r'data-label=".*?">(.*?)<', ''.join(rows))
        shown = re.split(' {3,}', re.search(rf'^  {name} +(.*)', said, re.MULTILINE)[1])
        assert [cell.replace('±', '+-') for cell in cells[: len(shown)]] == shown
        margin = float(cells[len(shown) + 1])
        assert margin == pytest.approx(history.values['pull_margin'][:, i].min(), abs=0.06)


def test_what_was_learned_is_a_further_config_of_every_command(
    make_bag, drive, config, tmp_path, printed, refused
):
    bag, kept = str(make_bag(drive[:20], storage='sqlite3')), tmp_path / 'learned.yaml'
    stated = ['-p', 'sensors.torque_zero:=[0.5, -0.25]', '-o', str(tmp_path / 'out')]
    assert f'soil: {kept}' in printed(['replay', bag, *config, *stated, '--save-soil', str(kept)])
    used = (tmp_path / 'out' / 'metadata.yaml').read_text()
    assert '"sensors.torque_zero":[0.5,-0.25]' in used
    values = read_values(kept)
    assert values['sensors.torque_zero'] == [0.5, -0.25]
    assert {'soil.cohesion', 'soil.cohesion_std', 'sensors.angular_rate_bias_std'} <= set(values)
    from_node = reader.from_parameters(reader.load([config[1], kept]).flat())
    assert {key: from_node.flat()[key] for key in values} == values
    again = [*config, '--config', str(kept)]
    assert main(['replay', bag, *again]) == 0
    assert main(['predict', *again, '--slip', '0.1:0.3:3', '--load', '100']) == 0
    refused(['replay', bag, *config, '--save-soil', str(kept)], 'exists already')
    assert read_values(kept) == values
    assert main(['replay', bag, *config, '--save-soil', str(kept), '--overwrite']) == 0
    assert read_values(kept)['sensors.torque_zero'] == [0.0, 0.0]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupted_replay_leaves_a_readable_bag(
    make_bag, config, tmp_path, capsys, monkeypatch, number
):
    """Ctrl-C, or a lost terminal, in the midst of a drive (of a process: test_several_bags)."""
    bag, out = make_bag(), tmp_path / 'out'
    write, count = BagFile.write, itertools.count()

    def interrupted(*arguments: Any) -> None:
        write(*arguments)
        if next(count) == 250:
            signal.raise_signal(number)

    monkeypatch.setattr(BagFile, 'write', interrupted)
    hang_up = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # `nohup` has it ignored
    try:
        assert main(['replay', str(bag), *config, '-o', str(out)]) == 130
    finally:
        signal.signal(signal.SIGHUP, hang_up)
    assert 'interrupted' in capsys.readouterr().out
    with open_bag(out) as opened:
        assert not opened.notes
        history = read_estimates(opened)
    assert 10 < history.stamp.size < 40
