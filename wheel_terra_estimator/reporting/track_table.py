# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""The map of a drive as a table (CSV) or for a map program (GeoJSON, RFC 7946)."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from wheel_terra_estimator.bags.track import COLUMNS, Track
from wheel_terra_estimator.csv_file import write_csv
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.estimation.estimates import SlipClass

SUFFIXES = ('.csv', '.geojson')
EARTH_RADIUS = 6_378_137.0
"""Of the equator [m] (WGS 84)."""
WHOLE = ('slip_class', 'stuck')  # columns of whole numbers
DIGITS = 6  # significant ones in a table
STRETCH_DIGITS = 4  # in the properties of a stretch


def check_track(path: Path) -> None:
    """Refuse, before anything is computed, a map that cannot be written."""
    if path.suffix not in SUFFIXES:
        raise UserError(f'{path}: a track ends in .csv or .geojson')


def parse_origin(text: str) -> tuple[float, float]:
    """Return latitude and longitude [deg] of LAT,LON."""
    try:
        latitude, longitude = (float(part) for part in text.split(','))
    except ValueError:
        raise UserError(
            f'--track-origin {text}: give LAT,LON in degrees, such as 48.1,11.6'
        ) from None
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise UserError(
            f'--track-origin {text}: the latitude lies between -89 and 89, the longitude between '
            '-180 and 180'
        )
    return latitude, longitude


def write_track(track: Track, path: Path, origin: tuple[float, float] = (0.0, 0.0)) -> None:
    """Write a track by the ending of ``path``; `origin`: latitude, longitude [deg] of a GeoJSON."""
    if path.suffix == '.geojson':
        path.write_text(json.dumps(as_geojson(track, origin), indent=1) + '\n', encoding='utf-8')
        return
    heads = [f'{name} [{unit}]' if unit else name for name, unit in COLUMNS.items()]
    columns = [
        [int(v) for v in track.values[name]]
        if name in WHOLE
        else [f'{v:.{DIGITS}g}' for v in track.values[name]]
        for name in COLUMNS
    ]
    write_csv(path, ['stamp [ns]', *heads], zip(track.stamp.tolist(), *columns, strict=True))


def as_geojson(track: Track, origin: tuple[float, float]) -> dict[str, Any]:
    """Return a track as GeoJSON: a line per stretch of one slip class, a point per stuck warning.

    x is east and y north of the origin, as in REP 103.
    """
    values, features = track.values, []
    latitude, longitude = origin
    east = np.degrees(values['x'] / (EARTH_RADIUS * math.cos(math.radians(latitude)))) + longitude
    north = np.degrees(values['y'] / EARTH_RADIUS) + latitude
    # A nanodegree is a tenth of a millimetre.
    places = np.round(np.column_stack([east, north, values['z']]), 9).tolist()
    for begin, end in stretches(track):
        rows = slice(begin, min(end + 1, len(places)))  # up to where the next one begins
        if rows.stop - rows.start > 1:
            line = {'type': 'LineString', 'coordinates': places[rows]}
            features.append(_feature(line, _of_stretch(track, slice(begin, end))))
    raised = np.flatnonzero(np.diff(np.concatenate([[0.0], values['stuck']])) > 0.0)
    for row in raised.tolist():
        point = {'type': 'Point', 'coordinates': places[row]}
        time = round(float(values['time'][row]), 3)
        features.append(_feature(point, {'name': 'stuck warning', 'time_s': time}))
    return {'type': 'FeatureCollection', 'features': features}


def stretches(track: Track) -> list[tuple[int, int]]:
    """Return first row and the row behind the last of each stretch of one slip class."""
    classes = track.values['slip_class']
    if not classes.size:
        return []
    starts = [0, *(np.flatnonzero(np.diff(classes)) + 1).tolist()]
    return list(zip(starts, [*starts[1:], classes.size], strict=True))


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {'type': 'Feature', 'geometry': geometry, 'properties': properties}


def _of_stretch(track: Track, rows: slice) -> dict[str, Any]:
    values = {name: column[rows] for name, column in track.values.items()}
    figures = {
        'from_s': values['time'][0],
        'to_s': values['time'][-1],
        'mean_slip': values['slip'].mean(),
        'greatest_sinkage_m': values['sinkage'].max(),
        'least_pull_margin_N': values['pull_margin'].min(),
        'mean_soil_strength': values['soil_strength'].mean(),
        'mean_soil_stiffness': values['soil_stiffness'].mean(),
        'greatest_stuck_probability': values['stuck_probability'].max(),
    }
    rounded: dict[str, float | None] = {
        name: float(f'{value:.{STRETCH_DIGITS}g}') for name, value in figures.items()
    }
    kind = SlipClass(int(values['slip_class'][0]))
    if kind is SlipClass.UNKNOWN:
        rounded['mean_slip'] = None  # at rest and in the first instant it is no slip
    return {'slip_class': kind.name.lower(), **rounded}
