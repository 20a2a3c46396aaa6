# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Views of the outputs in PlotJuggler and in Foxglove (or Lichtblick), for given wheels.

Names are those of the programs' sources. PlotJuggler: ``topic/joint/field`` of a JointState
(``plotjuggler_plugins/ParserROS/ros_parser.cpp``, parseJointStateMsg). Foxglove: message paths
``topic.field[i]`` (``packages/message-path`` of Lichtblick), a ``label`` per path; a message
without a header has no header stamp, and its series stays empty unless it goes by ``receiveTime``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from wheel_terra_estimator.messages.diagnostics import NODE
from wheel_terra_estimator.output_folder import check_file, new_file

PLOTS = (
    ('Slip ratio [-]', 'slip', 'position'),
    ('Drawbar pull [N]', 'slip', 'effort'),
    ('Sinkage [m]', 'sinkage', 'position'),
    ('Rim travel left before stuck [m]', 'mobility', 'position'),
)
"""Title, topic, field of the plots with a line per wheel."""
_COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9')  # Okabe and Ito


def plotjuggler(wheels: Sequence[str]) -> str:
    """Return a layout of PlotJuggler (XML)."""
    root = ElementTree.Element('root')
    window = ElementTree.SubElement(
        root, 'tabbed_widget', {'parent': 'main_window', 'name': 'Main Window'}
    )
    tab = ElementTree.SubElement(window, 'Tab', containers='1', tab_name=NODE)
    box = ElementTree.SubElement(tab, 'Container')
    sizes = ';'.join([f'{1.0 / len(PLOTS):g}'] * len(PLOTS))
    split = ElementTree.SubElement(
        box, 'DockSplitter', count=f'{len(PLOTS)}', orientation='-', sizes=sizes
    )
    for title, topic, field in PLOTS:
        area = ElementTree.SubElement(split, 'DockArea', name=title)
        plot = ElementTree.SubElement(area, 'plot', mode='TimeSeries', style='Lines')
        for i, wheel in enumerate(wheels):
            ElementTree.SubElement(
                plot, 'curve', name=f'/{NODE}/{topic}/{wheel}/{field}', color=_colour(i)
            )
    ElementTree.SubElement(window, 'currentTabIndex', index='0')
    ElementTree.SubElement(root, 'use_relative_time_offset', enabled='1')
    ElementTree.indent(root, ' ')
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ElementTree.tostring(root, 'unicode')}\n"


def foxglove(wheels: Sequence[str]) -> str:
    """Return a layout of Foxglove and of Lichtblick (JSON)."""
    panels: dict[str, dict[str, Any]] = {
        f'Plot!{topic}_{field}': _plot(
            title, [(f'{topic}.{field}[{i}]', wheel) for i, wheel in enumerate(wheels)]
        )
        for title, topic, field in PLOTS
    }
    classes = [(f'slip_class.data[{i}]', wheel) for i, wheel in enumerate(wheels)]
    panels['Plot!classes'] = _plot('Slip class (255 not known)', classes, 'receiveTime')
    panels['Plot!speed'] = _plot('Body speed [m/s]', [('twist.twist.twist.linear.x', 'forward')])
    panels['Indicator!stuck'] = {
        **_title('Stuck warning'),
        'path': f'/{NODE}/stuck.data',
        'style': 'background',
        'fallbackLabel': 'no warning',
        'fallbackColor': '#0072b2',
        'rules': [{'operator': '=', 'rawValue': 'true', 'color': '#d55e00', 'label': 'STUCK'}],
    }
    panels['DiagnosticSummary!all'] = {
        'topicToRender': '/diagnostics',
        'minLevel': 0,
        'pinnedIds': [],
        'hardwareIdFilter': '',
        'sortByLevel': True,
    }
    slip, pull, sinkage, travel, classes_panel, speed, stuck, summary = panels
    layout = _split(
        'row',
        66,
        _split('row', 50, _split('column', 50, slip, pull), _split('column', 50, sinkage, travel)),
        _split(
            'column',
            50,
            _split('column', 25, stuck, classes_panel),
            _split('column', 40, speed, summary),
        ),
    )
    document = {
        'configById': panels,
        'globalVariables': {},
        'userNodes': {},
        'playbackConfig': {'speed': 1},
        'layout': layout,
    }
    return json.dumps(document, indent=1) + '\n'


def write_layouts(wheels: Sequence[str], beside: Path, overwrite: bool) -> list[Path]:
    """Write both layouts beside a rover file, under its name; return their paths."""
    made = {
        beside.with_suffix('.plotjuggler.xml'): plotjuggler,
        beside.with_suffix('.foxglove.json'): foxglove,
    }
    for path in made:
        check_file(path, overwrite)
    for path, text in made.items():
        with new_file(path, overwrite) as temporary:
            temporary.write_text(text(wheels), encoding='utf-8')
    return list(made)


def _colour(index: int) -> str:
    return _COLOURS[index % len(_COLOURS)]


def _title(text: str) -> dict[str, str]:
    return {'foxglovePanelTitle': text, 'lichtblickPanelTitle': text}


def _plot(
    title: str, paths: Sequence[tuple[str, str]], stamp: str = 'headerStamp'
) -> dict[str, Any]:
    return {
        **_title(title),
        'paths': [
            {
                'value': f'/{NODE}/{path}',
                'label': label,
                'color': _colour(i),
                'enabled': True,
                'timestampMethod': stamp,
            }
            for i, (path, label) in enumerate(paths)
        ],
        'yAxisLabel': title,
        'showXAxisLabels': True,
        'showYAxisLabels': True,
        'showLegend': True,
        'legendDisplay': 'floating',
        'isSynced': True,
        'xAxisVal': 'timestamp',
    }


def _split(direction: str, percentage: int, first: Any, second: Any) -> dict[str, Any]:
    return {
        'first': first,
        'second': second,
        'direction': direction,
        'splitPercentage': percentage,
    }
