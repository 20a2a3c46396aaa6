# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Every command that reads recordings bounds what it unpacks and holds by the same options."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pytest

from wheel_terra_estimator.bags import storage
from wheel_terra_estimator.bags.salvage.limits import LIMITS, Limits, in_words
from wheel_terra_estimator.cli import bag_arguments
from wheel_terra_estimator.cli.main import main
from wheel_terra_estimator.errors import UserError


def parsed(*options: str) -> Limits:
    parser = argparse.ArgumentParser()
    bag_arguments.add_limits(parser)
    return bag_arguments.limits_of(parser.parse_args(options))


def test_without_options_the_limits_are_the_usual_ones() -> None:
    assert parsed() == LIMITS


@pytest.mark.parametrize(
    ('text', 'size'),
    [('300', 300), ('7B', 7), ('2 kB', 2048), ('256MB', 2**28), ('1gb', 2**30), ('5K', 5 * 2**10)],
)
def test_sizes(text: str, size: int) -> None:
    assert parsed('--largest-message', text).chunk == size
    assert parsed('--most-held', text).held == size


@pytest.mark.parametrize('text', ['0', '-1', '1.5GB', 'much', '1TB', '9' * 5000, '', '²'])
def test_no_sizes(text: str, capsys: Any) -> None:
    with pytest.raises(SystemExit):
        parsed(f'--most-held={text}')
    assert 'is no size; give one such as 256MB' in capsys.readouterr().err


def test_sizes_in_words() -> None:
    sizes = (300, 5000, 2**28, 3 * 2**29)
    assert [in_words(size) for size in sizes] == ['300 B', '4.88 kB', '256 MB', '1.5 GB']


def commands(bag: Path, folder: Path) -> dict[str, list[str]]:
    rover = ['--config', 'frostyboy']
    return {
        'replay': [str(bag), *rover],
        'check': [str(bag), *rover],
        'calibrate': [str(bag), *rover, '-o', str(folder / 'c.yaml')],
        'compare': [str(bag), str(bag)],
        'diagnose': [str(bag), *rover, '-o', str(folder / 'd')],
        'init': [
            *('--bag', str(bag), '--radius', '0.2', '--track', '1', '--wheelbase', '1'),
            *('--mass', '40', '-o', str(folder / 'i.yaml')),
        ],
    }


NAMES = sorted(commands(Path(), Path()))


@pytest.mark.parametrize('name', NAMES)
def test_each_command_hands_its_limits_to_the_reader(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    seen: list[Limits] = []

    def refuse(path: Path, notes: Any, stack: Any, given: Limits) -> Any:
        seen.append(given)
        raise UserError('seen')

    monkeypatch.setattr(storage, '_open_sources', refuse)
    bag = tmp_path / 'a.mcap'
    bag.touch()
    command = [name, *commands(bag, tmp_path)[name]]
    assert main(command) == 2
    assert main([*command, '--largest-message', '3MB', '--most-held=2GB']) == 2
    assert seen == [LIMITS, Limits(3 * 2**20, 2**31, 3 * 2**20)]


def test_a_message_that_is_heard_has_a_limit_of_its_own(make_bag: Any, rover: Any) -> None:
    from wheel_terra_estimator.bags.reader import MeasurementReader
    from wheel_terra_estimator.bags.storage import open_bag

    with open_bag(make_bag(), Limits(message=200)) as bag:
        reader = MeasurementReader(bag, {}, rover)
        heard = list(reader.measurements())
    assert heard
    assert reader.rejected['imu/data', 'above 200 B']
