# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Every path in the layouts names a field that the node publishes, for any wheels."""

import json
import re
from xml.etree import ElementTree

from wheel_terra_estimator.messages import layouts
from wheel_terra_estimator.messages.convert import JOINT_OUTPUTS, OUTPUT_TYPES
from wheel_terra_estimator.messages.diagnostics import NODE

WHEELS = ['left "<1>" & co', 'right']
FIELDS = {
    **{topic: {'position', 'velocity', 'effort'} for topic in JOINT_OUTPUTS},
    'mobility': {'position', 'effort'},
    'slip_class': {'data'},
    'twist': {'twist.twist.linear.x', 'twist.twist.angular.z'},
    'stuck': {'data'},
}


def test_foxglove_paths_are_published_and_labelled():
    document = json.loads(layouts.foxglove(WHEELS))
    panels = document['configById'].values()
    paths = [path for panel in panels for path in panel.get('paths', [])]
    assert len(paths) == 5 * len(WHEELS) + 1
    for path in [*paths, {'value': panels_path(document), 'timestampMethod': 'receiveTime'}]:
        found = re.fullmatch(rf'/{NODE}/(\w+)\.([\w.]+?)(\[([01])\])?', path['value'])
        assert found, path
        assert found[2] in FIELDS[found[1]], path
        if found[3]:
            assert path['label'] == WHEELS[int(found[4])]
        # Lichtblick draws nothing by a header stamp that a message does not have.
        stamped = 'Stamped' in OUTPUT_TYPES[found[1]] or 'JointState' in OUTPUT_TYPES[found[1]]
        assert (path['timestampMethod'] == 'headerStamp') == stamped, path

    def leaves(node: object) -> list[str]:
        if isinstance(node, str):
            return [node]
        assert isinstance(node, dict)
        return leaves(node['first']) + leaves(node['second'])

    assert sorted(leaves(document['layout'])) == sorted(document['configById'])


def panels_path(document: dict[str, dict[str, dict[str, str]]]) -> str:
    return document['configById']['Indicator!stuck']['path']


def test_plotjuggler_curves_are_its_names_of_joint_states():
    """PlotJuggler names a series topic/joint/field (ParserROS::parseJointStateMsg)."""
    plots = ElementTree.fromstring(layouts.plotjuggler(WHEELS)).iter('DockArea')
    curves = {plot.attrib['name']: [c.attrib['name'] for c in plot.iter('curve')] for plot in plots}
    assert curves['Sinkage [m]'] == [f'/{NODE}/sinkage/{wheel}/position' for wheel in WHEELS]
    assert curves['Drawbar pull [N]'] == [f'/{NODE}/slip/{wheel}/effort' for wheel in WHEELS]
    assert len(curves) == 4
