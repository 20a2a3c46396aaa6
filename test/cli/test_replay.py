# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""``wheel-terra replay`` from the command line."""

import itertools
import re
import signal
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.bag_file import BagFile
from wheel_terra_estimator.bags.history import EstimateHistory, read_estimates
from wheel_terra_estimator.bags.storage import messages_of, open_bag
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.soil_file import read_values
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.messages.convert import JOINT_STATE

SLIP_ON_SLOPE = '/wheel_terra_estimator/slip_on_slope'


def assert_slip_follows_the_reference(history: EstimateHistory) -> None:
    """Rim speed 0.42 m/s, reference 0.36 m/s: slip 1/7 on both wheels when it was just heard."""
    seconds = history.seconds
    just_heard = (seconds % 1.0 > 0.05) & (seconds % 1.0 < 0.15) & (seconds > 1.5)
    assert just_heard.any()
    np.testing.assert_allclose(history.values['slip'][just_heard], 1 / 7, atol=0.06)


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
        on_slopes = [m.stamp for _, _, m in messages_of(bag, {SLIP_ON_SLOPE: JOINT_STATE})]
    assert len(on_slopes) >= 3 and all(round(d * 1e-9) == 1 for d in np.diff(on_slopes))
    assert_slip_follows_the_reference(history)
    assert (history.slip_class[-10:] == SlipClass.LOW).all()
    page = report.read_text()
    assert len(re.findall('<path class="line', page)) == 2 + 2 * 3 + 2  # speeds; two wheels; slopes
    assert not re.search(r'(?:src|href)="(?!data:|#)', page)  # nothing is loaded from elsewhere


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


def test_interrupted_replay_leaves_a_readable_bag(make_bag, config, tmp_path, capsys, monkeypatch):
    """Ctrl-C in the midst of a drive (of a process: test_several_bags)."""
    bag, out = make_bag(), tmp_path / 'out'
    write, count = BagFile.write, itertools.count()

    def interrupted(*arguments: Any) -> None:
        write(*arguments)
        if next(count) == 250:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(BagFile, 'write', interrupted)
    assert main(['replay', str(bag), *config, '-o', str(out)]) == 130
    assert 'interrupted' in capsys.readouterr().out
    with open_bag(out) as opened:
        assert not opened.notes
        history = read_estimates(opened)
    assert 10 < history.stamp.size < 40
