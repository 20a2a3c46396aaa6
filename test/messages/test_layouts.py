# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Every path in the shipped layouts names a field that the node publishes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wheel_terra_estimator.messages.convert import JOINT_OUTPUTS, OUTPUT_TYPES
from wheel_terra_estimator.messages.diagnostics import NODE

LAYOUTS = Path(__file__).resolve().parents[2] / 'config' / 'layouts'
FIELDS = {
    **{topic: {'position', 'velocity', 'effort'} for topic in JOINT_OUTPUTS},
    'mobility': {'position', 'effort'},
    'slip_class': {'data'},
    'twist': {'twist.twist.linear.x', 'twist.twist.angular.z'},
    'stuck': {'data'},
}


def foxglove() -> list[str]:
    panels = json.loads((LAYOUTS / 'foxglove.json').read_text())['configById'].values()
    paths = [path['value'] for panel in panels for path in panel.get('paths', [])]
    return paths + [panel['path'] for panel in panels if 'path' in panel]


def plotjuggler() -> list[str]:
    curves = ElementTree.parse(LAYOUTS / 'plotjuggler.xml').iter('curve')
    return [re.sub(r'/(\w+)((\[\d+\])?)$', r'.\1\2', curve.attrib['name']) for curve in curves]


@pytest.mark.parametrize('paths', [foxglove(), plotjuggler()], ids=['foxglove', 'plotjuggler'])
def test_paths_are_published(paths: list[str]) -> None:
    assert len(paths) > 20
    for path in paths:
        found = re.fullmatch(rf'/{NODE}/(\w+)\.([\w.]+?)(\[[0-5]\])?', path)
        assert found, path
        assert found[1] in OUTPUT_TYPES
        assert found[2] in FIELDS[found[1]], path


def test_panels_of_the_layout_are_there() -> None:
    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())

    def leaves(node: object) -> set[str]:
        if isinstance(node, str):
            return {node}
        assert isinstance(node, dict)
        return leaves(node['first']) | leaves(node['second'])

    assert leaves(layout['layout']) == set(layout['configById'])
