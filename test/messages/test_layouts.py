# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Every path in the shipped layouts names a field that the node publishes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import yaml

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


def test_foxglove_paths_are_published() -> None:
    assert len(foxglove()) > 20
    for path in foxglove():
        found = re.fullmatch(rf'/{NODE}/(\w+)\.([\w.]+?)(\[[0-5]\])?', path)
        assert found, path
        assert found[1] in OUTPUT_TYPES
        assert found[2] in FIELDS[found[1]], path


def test_plotjuggler_curves_are_its_names_of_joint_states() -> None:
    """PlotJuggler names a series topic/joint/field (its ros2_parsers/jointstates_msg.h)."""
    rover = yaml.safe_load((LAYOUTS.parent / 'rovers' / 'generic_six_wheel.yaml').read_text())
    wheels = rover['/**']['ros__parameters']['wheels']['names']
    plots = ElementTree.parse(LAYOUTS / 'plotjuggler.xml').iter('plot')
    curves = [[curve.attrib['name'] for curve in plot.iter('curve')] for plot in plots]
    shown = (('slip', 'position'), ('slip', 'effort'), ('sinkage', 'position'))
    assert curves == [
        [f'/{NODE}/{topic}/{wheel}/{field}' for wheel in wheels]
        for topic, field in (*shown, ('mobility', 'position'))
    ]


def test_panels_of_the_layout_are_there() -> None:
    layout = json.loads((LAYOUTS / 'foxglove.json').read_text())

    def leaves(node: object) -> set[str]:
        if isinstance(node, str):
            return {node}
        assert isinstance(node, dict)
        return leaves(node['first']) | leaves(node['second'])

    assert leaves(layout['layout']) == set(layout['configById'])
