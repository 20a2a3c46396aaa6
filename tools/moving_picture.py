# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Makes the moving picture of README and site: ``python tools/moving_picture.py``.

A replay of the shipped entrapment in 15 s: the left wheels at their estimated sinkage, to scale,
in the colour of their slip class; the median slip beside the truth; warnings when they came.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wheel_terra_estimator.bags.replay import Options
from wheel_terra_estimator.configuration import reader
from wheel_terra_estimator.configuration.shipped import demo_recording
from wheel_terra_estimator.estimation.estimates import SlipClass
from wheel_terra_estimator.fleet.drive import Drive, replay_drive
from wheel_terra_estimator.reporting.drive_style import CLASS_COLOURS, Border, known
from wheel_terra_estimator.reporting.style import DARK, INK, SOFT, WARNING_COLOUR
from wheel_terra_estimator.simulation.truth import entrapped

FloatArray = NDArray[np.float64]

IMAGE = Path(__file__).resolve().parents[1] / 'docs' / 'images' / 'entrapment.svg'
CONFIGURATION = ('generic_six_wheel', 'test_sand')
LENGTH, HOLD = 15.0, 1.5  # of the picture, and of its last moment [s]
FRAMES, POINTS = 75, 240  # moments of the rover, points of a curve
WIDTH, HEIGHT = 760, 430
GROUND, SCALE, START = 112, 155.0, 60.0  # soil surface [px], px per metre, first hub [px]
PLOT = (46, 205, 690, 185)  # left, top, width, height of the curve [px]
LABEL = 150.0  # width of a label and its room [px]
CLASSES = (SlipClass.LOW, SlipClass.MODERATE, SlipClass.HIGH, SlipClass.STUCK)


def main() -> None:
    """Replay, draw, write."""
    drive = replay_drive(
        demo_recording('entrapment'),
        reader.load(list(CONFIGURATION)),
        {},
        None,
        Options(progress=False),
    )
    IMAGE.write_text(picture(drive), encoding='utf-8')
    print(f'{IMAGE}: {IMAGE.stat().st_size / 1e3:.0f} kB')


def picture(drive: Drive) -> str:
    """Return the picture as SVG."""
    history = drive.result.history
    end = float(history.seconds[-1])
    frames = np.unique(np.linspace(0, history.seconds.size - 1, FRAMES).astype(int))
    clock = Clock(end, history.seconds[frames])
    rules = ''.join(f'.c{int(c)}{{fill:{CLASS_COLOURS[c]}}}' for c in (*CLASSES, SlipClass.UNKNOWN))
    dark = ''.join(f'.c{int(c)}{{fill:{DARK[CLASS_COLOURS[c]]}}}' for c in CLASSES)
    style = (
        f'text{{font:14px "DejaVu Sans",Verdana,sans-serif;fill:{INK}}}.soft{{fill:{SOFT}}}'
        f'.ink{{stroke:{INK};fill:none}}.bad{{fill:{WARNING_COLOUR}}}.soil{{fill:#d9c9a3}}.paper{{fill:#fff}}'
        f'.body{{fill:#8a949e}}.slip{{stroke:#0083d3;fill:none;stroke-width:2.4}}{rules}'
        '@media (prefers-color-scheme:dark){'
        f'text{{fill:{DARK[INK]}}}.soft{{fill:{DARK[SOFT]}}}.ink{{stroke:{DARK[INK]}}}'
        f'.bad{{fill:{DARK[WARNING_COLOUR]}}}.soil{{fill:#5d5139}}.paper{{fill:#1a2128}}'
        f'.slip{{stroke:{DARK["#0083d3"]}}}{dark}}}'
    )
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        'aria-label="a rover sinks into soft sand; its slip, and the stuck warning in time">'
        f'<style>{style}</style><rect class="paper" width="{WIDTH}" height="{HEIGHT}"/>',
        *_rover(drive, frames, clock),
        *_curve(drive, clock),
        *_warnings(drive, clock),
        '</svg>\n',
    ]
    return '\n'.join(parts)


class Clock:
    """Time of the drive to shares of the picture's time, and animations of SVG."""

    def __init__(self, end: float, frames: FloatArray) -> None:
        self._scale = (LENGTH - HOLD) / LENGTH / end
        self._keys = ';'.join(f'{t:.4f}' for t in (*self._scale * frames, 1.0))

    def share(self, seconds: float) -> float:
        """Return the share of the picture's time at which a time of the drive comes."""
        return self._scale * seconds

    def follow(self, attribute: str, values: list[str], *, jumps: bool = False) -> str:
        """Return an animation that follows the values at the frames."""
        mode = ' calcMode="discrete"' if jumps else ''
        return (
            f'<animate attributeName="{attribute}" dur="{LENGTH:g}s" repeatCount="indefinite"'
            f'{mode} keyTimes="{self._keys}" values="{";".join([*values, values[-1]])}"/>'
        )

    def move(self, kind: str, values: list[str]) -> str:
        """Return an animated transform (``translate``, ``rotate``)."""
        return (
            f'<animateTransform attributeName="transform" type="{kind}" dur="{LENGTH:g}s" '
            f'repeatCount="indefinite" keyTimes="{self._keys}" '
            f'values="{";".join([*values, values[-1]])}"/>'
        )

    def appear(self, start: float) -> str:
        """Return an animation that shows something from a time of the drive on."""
        return (
            f'<animate attributeName="visibility" dur="{LENGTH:g}s" repeatCount="indefinite" '
            f'calcMode="discrete" keyTimes="0.0000;{self.share(start):.4f}" '
            f'values="hidden;visible"/>'
        )


def _rover(drive: Drive, frames: NDArray[np.int_], clock: Clock) -> list[str]:
    """Return soil, wheels and body."""
    history, wheels = drive.result.history, drive.configuration.wheels
    seconds = history.seconds
    way = np.concatenate([[0.0], np.cumsum(np.diff(seconds) * history.forward_velocity[1:])])
    sinkage = history.values['sinkage']
    rows = [i for i, y in enumerate(wheels.y) if y > 0.0]
    parts = [f'<rect class="soil" y="{GROUND}" width="{WIDTH}" height="36"/>']
    hubs = []
    for i in rows:
        radius = SCALE * float(wheels.radius[i])
        x = START + SCALE * (way[frames] + float(wheels.x[i] - wheels.x.min()))
        y = GROUND - radius + SCALE * sinkage[frames, i]
        hubs.append((x, y))
        speed = history.forward_velocity + history.values['slip_velocity'][:, i]
        angle = np.cumsum(np.gradient(seconds) * speed) / float(wheels.radius[i])
        classes = [f'c{int(c)}' for c in history.slip_class[frames, i]]
        spokes = ''.join(
            f'M0 0L{radius * np.cos(a):.1f} {radius * np.sin(a):.1f}'
            for a in np.arange(6) * np.pi / 3
        )
        parts.append(
            f'<g>{clock.move("translate", _pairs(x, y))}<circle r="{radius:.1f}" class="c0">'
            f'{clock.follow("class", classes, jumps=True)}</circle>'
            f'<path class="ink" stroke-width="1.5" d="{spokes}">'
            f'{clock.move("rotate", [f"{d:.0f}" for d in np.degrees(angle[frames])])}</path>'
            f'<circle class="ink" stroke-width="2" r="{radius:.1f}"/></g>'
        )
    half = 0.5 * SCALE * float(np.ptp(wheels.x[rows]))
    middle = (sum(x for x, _ in hubs) / len(hubs), sum(y for _, y in hubs) / len(hubs))
    parts.append(
        f'<g>{clock.move("translate", _pairs(*middle))}'
        f'<rect class="body" x="{-half:.0f}" y="-52" width="{2 * half:.0f}" height="24" rx="5"/>'
        f'<path class="ink" stroke-width="3" d="M{-half:.0f} 0V-30M0 0V-30M{half:.0f} 0V-30"/></g>'
    )
    return parts


def _pairs(x: FloatArray, y: FloatArray) -> list[str]:
    return [f'{a:.1f} {b:.1f}' for a, b in zip(x, y, strict=True)]


def _curve(drive: Drive, clock: Clock) -> list[str]:
    """Return the median slip and the true one as time uncovers them."""
    history, truth = drive.result.history, drive.truth
    left, top, width, height = PLOT
    end = float(history.seconds[-1])
    parts = [f'<text x="{left}" y="{top - 28}">slip, median of six wheels (dashed: truth)</text>']
    for value in (0.0, 0.5, 1.0):
        y = top + height * (1.0 - value)
        parts.append(
            f'<path class="ink" opacity="0.2" d="M{left} {y:.0f}h{width}"/>'
            f'<text class="soft" x="{left - 8}" y="{y + 5:.0f}" text-anchor="end">{value:g}</text>'
        )
    for second in range(0, int(end) + 1, 20):
        x = left + width * second / end
        parts.append(
            f'<text class="soft" x="{x:.0f}" y="{top + height + 20}" text-anchor="middle">'
            f'{second} s</text>'
        )
    parts.append(
        f'<clipPath id="past"><rect x="{left}" y="{top}" height="{height}" width="{width}">'
        f'<animate attributeName="width" dur="{LENGTH:g}s" repeatCount="indefinite" '
        f'keyTimes="0;{clock.share(end):.4f};1" values="0;{width};{width}"/></rect></clipPath>'
    )
    slip = known(history, 'slip', Border.of(drive.configuration))
    curves = [('slip', history.seconds, slip, '')]
    if truth is not None and truth.slip is not None:
        seconds = (truth.slip.stamp - history.stamp[0]) * 1e-9
        curves.append(('ink', seconds, truth.slip.value, ' stroke-dasharray="5 4"'))
    parts.append('<g clip-path="url(#past)">')
    for name, seconds, values, dash in curves:
        there = np.flatnonzero(np.isfinite(values).all(axis=1))
        rows = there[np.linspace(0, there.size - 1, POINTS).astype(int)]
        median = np.median(values[rows], axis=1)
        x = left + width * seconds[rows] / end
        y = top + height * (1.0 - np.clip(median, 0.0, 1.0))
        path = 'M' + 'L'.join(_pairs(x, y))
        parts.append(f'<path class="{name}"{dash} d="{path}"/>')
    parts.append('</g>')
    return parts


def _warnings(drive: Drive, clock: Clock) -> list[str]:
    """Return the warnings, and the true entrapment, each from its time on."""
    history, truth = drive.result.history, drive.truth
    left, top, width, height = PLOT
    end = float(history.seconds[-1])
    parts = []
    labelled = -LABEL
    for warning in drive.summary.warnings:
        last = end if warning.end is None else warning.end
        x, w = left + width * warning.start / end, width * (last - warning.start) / end
        words = ''
        if x - labelled >= LABEL:  # of warnings that crowd, the first is labelled
            labelled = x
            words = (
                f'<text class="bad" x="{x:.0f}" y="{top - 6}" text-anchor="middle">'
                f'stuck warning, {warning.start:.0f} s</text>'
            )
        parts.append(
            f'<g visibility="hidden">{clock.appear(warning.start)}<rect class="bad" opacity="0.16" '
            f'x="{x:.1f}" y="{top}" width="{w:.1f}" height="{height}"/>{words}</g>'
        )
    if truth is not None and truth.slip is not None:
        stuck = entrapped(truth.slip.stamp, truth.slip.value)
        if stuck.any():
            at = float((truth.slip.stamp[stuck][0] - history.stamp[0]) * 1e-9)
            x = left + width * at / end
            parts.append(
                f'<g visibility="hidden">{clock.appear(at)}<path class="ink" stroke-width="2" '
                f'd="M{x:.1f} {top - 24}v{height + 24}"/><text x="{x:.0f}" y="{top - 28}" '
                f'text-anchor="middle">entrapped, {at:.0f} s</text></g>'
            )
    return parts


if __name__ == '__main__':
    main()
