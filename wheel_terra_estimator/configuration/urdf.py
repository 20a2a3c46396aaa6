# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels, what steers them and mass of a rover from its URDF.

A URDF may come from anywhere: documents with a DTD or entities are refused (they could blow up or
read files), and the size is bounded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.rover_template import (
    CENTRE_HEIGHT,
    DEFAULT_WIDTH_SHARE,
    RoverSketch,
)
from wheel_terra_estimator.errors import UserError

LARGEST_FILE = 20_000_000  # [byte]
DEEPEST_CHAIN = 1000
BASE_LINKS = ('base_link', 'base_footprint')

_ROUND = ('cylinder', 'sphere')
_ACROSS = 0.1  # y of an axis below which its sign is unknown
_NEAR = 0.01  # axles that differ less in height may be of wheels alike [m]
_UPRIGHT = 0.8  # cosine between the axis of a joint that steers and the vertical, at least

Pose = FloatArray  # (4, 4)


def read_urdf(
    path: Path,
    wheels: Sequence[str] = (),
    data: bytes | None = None,
    radius: float | None = None,
    width: float | None = None,
) -> RoverSketch:
    """Return the rover that a URDF describes (xacro has to be expanded first).

    ``wheels``: names of the wheel joints; default: continuous joints with wheel in name or link.
    ``data``: the document, where it does not stand in a file; ``path`` then names it in errors.
    ``radius``, ``width``: of the wheels [m], in place of those of the document.
    Raises UserError for no URDF, no wheels, or a wheel without a radius.
    """
    robot = _Robot(path, _parse(path, data))
    joints = robot.joints
    names = list(wheels) or [name for name, joint in joints.items() if _is_wheel(name, joint)]
    missing = [name for name in names if name not in joints]
    if missing or not names:
        turning = [n for n, j in joints.items() if j.get('type') in ('continuous', 'revolute')]
        raise UserError(
            f'{path}: {"no joint " + missing[0] if missing else "no joint named as a wheel"}; give '
            f'the wheels, of its turning joints: --wheels {",".join(turning) or "(none)"}'
        )
    placed = [(name, robot.pose(joints[name])) for name in names]
    placed.sort(key=lambda item: (-round(item[1][0, 3], 3), -item[1][1, 3]))
    names = [name for name, _ in placed]
    poses = [pose for _, pose in placed]
    shapes = [robot.shape(joints[name]) for name in names]
    ground = min(p[2, 3] - (r or math.inf) for p, (r, _) in zip(poses, shapes, strict=True))
    turning = [name for name, joint in joints.items() if joint.get('type') == 'continuous']
    height = {n: robot.pose(joints[n])[2, 3] for n in turning if n not in names and not wheels}
    lower = [name for name, z in height.items() if z < ground]
    if lower:
        raise UserError(
            f'{path}: {", ".join(lower)} would turn below the ground that {", ".join(names)} '
            f'stands on; give the wheels: --wheels {",".join(lower)}'
        )
    shapes = [(radius or r, width or w) for r, w in shapes]
    if bare := [name for name, (r, _) in zip(names, shapes, strict=True) if not r]:
        raise UserError(
            f'{path}: no cylinder to take the radius from: {", ".join(bare)}; give --radius'
            + ('' if width else ' and --width')
        )
    guessed = set() if all(w for _, w in shapes) else {'wheels.width'}
    radii = [r for r, _ in shapes]
    leftward = [_leftward(joints[n], p, path) for n, p in zip(names, poses, strict=True)]
    if any(abs(left) < _ACROSS for left in leftward):
        guessed.add('wheels.direction')
    steering = [robot.steering_joint(joints[name]) for name in names]
    if any(axis < 0.0 for _, axis in steering):
        guessed.add('wheels.steering_joints')
    mass, centre = robot.mass()
    if not mass:
        guessed |= {'rover.mass', 'rover.centre_of_gravity'}
        ground = min(float(p[2, 3]) - r for p, r in zip(poses, radii, strict=True))
        centre = [0.0, 0.0, round(ground + CENTRE_HEIGHT * max(radii), 4)]
    elif not round(poses[-1][0, 3], 3) <= round(centre[0], 3) <= round(poses[0][0, 3], 3):
        guessed.add('rover.mass')  # a caster, or what else there is, carries a part of it
    return RoverSketch(
        name=robot.name,
        wheels=names,
        radius=radii,
        width=[w or DEFAULT_WIDTH_SHARE * r for r, w in shapes],
        x=[round(float(p[0, 3]), 5) for p in poses],
        y=[round(float(p[1, 3]), 5) for p in poses],
        z=[round(float(p[2, 3]), 5) for p in poses],
        mass=round(mass, 3) or 50.0,
        centre_of_gravity=centre,
        direction=[-1 if left < -_ACROSS else 1 for left in leftward],
        steering_joints=[joint for joint, _ in steering],
        left_out=[n for n, z in height.items() if z < max(p[2, 3] for p in poses) + _NEAR],
        guessed=frozenset(guessed),
        source=f'{path.name}, relative to {robot.base}',
    )


def _parse(path: Path, data: bytes | None) -> ElementTree.Element:
    try:
        data = path.read_bytes() if data is None else data
    except OSError as error:
        raise UserError(f'{path}: cannot be read: {error.strerror}') from None
    if len(data) > LARGEST_FILE:
        raise UserError(f'{path}: larger than {LARGEST_FILE // 1_000_000} MB: not a URDF')
    try:
        text = data.decode('utf-8')
    except UnicodeDecodeError:
        raise UserError(f'{path}: not a UTF-8 text') from None
    if re.search(r'<!(DOCTYPE|ENTITY)', text, re.IGNORECASE):
        raise UserError(f'{path}: holds a DTD or entities, which a URDF does not need; remove them')
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise UserError(f'{path}: not valid XML: {error}') from None
    if robot.tag != 'robot':
        raise UserError(f'{path}: the root is <{robot.tag}>, a URDF has <robot>')
    uncommented = re.sub(r'<!--.*?-->', '', text, flags=re.DOTALL)  # xacro leaves its banner there
    if '${' in uncommented or '<xacro:' in uncommented:
        raise UserError(f'{path}: is a xacro; expand it first: xacro {path.name} > rover.urdf')
    return robot


def _is_wheel(name: str, joint: ElementTree.Element) -> bool:
    words = f'{name} {_link(joint, "child")}'.lower()
    caster = re.search(r'caster|steer', words)
    return joint.get('type') == 'continuous' and 'wheel' in words and not caster


def _link(joint: ElementTree.Element, side: str) -> str:
    """Return the link on the ``parent`` or ``child`` side of a joint."""
    found = joint.find(side)
    return found.get('link', '') if found is not None else ''


def _numbers(text: str | None, default: tuple[float, ...], path: Path) -> list[float]:
    try:
        values = [float(item) for item in text.split()] if text else list(default)
    except ValueError:
        raise UserError(f'{path}: {text!r} is not a list of numbers') from None
    if len(values) != len(default) or not all(math.isfinite(v) for v in values):
        raise UserError(f'{path}: {text!r} must be {len(default)} finite numbers')
    return values


def _origin(element: ElementTree.Element | None, path: Path) -> Pose:
    pose = np.eye(4)
    origin = element.find('origin') if element is not None else None
    if origin is None:
        return pose
    roll, pitch, yaw = _numbers(origin.get('rpy'), (0.0, 0.0, 0.0), path)
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in (roll, pitch, yaw))
    pose[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    pose[:3, 3] = _numbers(origin.get('xyz'), (0.0, 0.0, 0.0), path)
    return pose


def _axis(joint: ElementTree.Element, path: Path) -> FloatArray:
    axis = joint.find('axis')
    return np.array(_numbers(axis.get('xyz') if axis is not None else None, (1.0, 0, 0), path))


def _leftward(joint: ElementTree.Element, pose: Pose, path: Path) -> float:
    """Return y of a joint's axis: a positive rate drives forward where it points left."""
    return float((pose[:3, :3] @ _axis(joint, path))[1])


class _Robot:
    """A document with its links and joints by name, and the link that all poses are given in."""

    def __init__(self, path: Path, root: ElementTree.Element) -> None:
        self.path = path
        self.name = root.get('name', path.stem)
        self.joints = {j.get('name', ''): j for j in root.iter('joint') if j.get('type')}
        self._links = {link.get('name', ''): link for link in root.iter('link')}
        self._above = {
            _link(joint, 'child'): joint for joint in self.joints.values()
        }  # by their children
        roots = [name for name in self._links if name not in self._above]
        named = [name for name in BASE_LINKS if name in self._links]
        self.base = next(iter((*named, *roots, *self._links)), '')

    def pose(self, joint: ElementTree.Element) -> Pose:
        """Return the pose of the link that hangs on a joint."""
        pose = self._link_pose(_link(joint, 'child'))
        if pose is None:
            raise UserError(f'{self.path}: joint {joint.get("name")} does not hang on {self.base}')
        return pose

    def _link_pose(self, link: str) -> Pose | None:
        """Return the pose of a link in the base; None if they have no common ancestor."""
        top, pose = self._climbed(link, self.base)
        if top == self.base:
            return pose
        root, to_base = self._climbed(self.base, top)  # both below a root, such as a footprint
        return np.asarray(np.linalg.inv(to_base) @ pose) if root == top else None

    def _climbed(self, link: str, end: str) -> tuple[str, Pose]:
        """Go up from a link as far as `end`, else to its root; return that link and the pose."""
        start, pose = link, np.eye(4)
        for _ in range(DEEPEST_CHAIN):
            joint = self._above.get(link)
            if link == end or joint is None:
                return link, pose
            pose = _origin(joint, self.path) @ pose
            link = _link(joint, 'parent')
        raise UserError(f'{self.path}: the joints of link {start} form a loop')

    def shape(self, joint: ElementTree.Element) -> tuple[float, float]:
        """Return radius and width of a wheel, the largest of its link; 0 = unknown."""
        link = self._links.get(_link(joint, 'child'))
        for kind in ('collision', 'visual'):
            parts = link.iter(kind) if link is not None else ()
            forms = [form for part in parts for name in _ROUND for form in part.iter(name)]
            sizes = [
                [_numbers(form.get(key), (0.0,), self.path)[0] for key in ('radius', 'length')]
                for form in forms
            ]
            radius, length = max(sizes, default=(0.0, 0.0))
            if radius > 0.0:
                return radius, length
        return 0.0, 0.0

    def steering_joint(self, wheel: ElementTree.Element) -> tuple[str, float]:
        """Return the joint that steers a wheel, and the z of its axis in the base: -1 counts right.

        It is the nearest turning joint above the wheel whose axis is upright; '' and 0 for none.
        """
        joint = self._above.get(_link(wheel, 'parent'))
        for _ in range(DEEPEST_CHAIN):
            if joint is None or _link(joint, 'child') == self.base:
                break
            if joint.get('type') in ('revolute', 'continuous'):
                up = float((self.pose(joint)[:3, :3] @ _axis(joint, self.path))[2])
                if abs(up) > _UPRIGHT:
                    return joint.get('name', ''), up
            joint = self._above.get(_link(joint, 'parent'))
        return '', 0.0

    def mass(self) -> tuple[float, list[float]]:
        """Return the mass of all links and their centre of gravity in the base."""
        total, moment = 0.0, np.zeros(3)
        for name, link in self._links.items():
            mass_of = link.find('inertial/mass')
            if mass_of is None:
                continue
            mass = _numbers(mass_of.get('value'), (0.0,), self.path)[0]
            pose = self._link_pose(name)
            if pose is not None and mass > 0.0:
                total += mass
                moment += mass * (pose @ _origin(link.find('inertial'), self.path))[:3, 3]
        centre = moment / total if total else moment
        return total, [round(float(value), 4) for value in centre]
