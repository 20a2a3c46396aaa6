# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Wheels, what steers and carries them, and mass of a rover from its URDF.

A URDF may come from anywhere: documents with a DTD or entities are refused (they could blow up or
read files), and the size is bounded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.configuration.ros_yaml import Value
from wheel_terra_estimator.configuration.rover_template import (
    CENTRE_HEIGHT,
    DEFAULT_WIDTH_SHARE,
    RoverSketch,
)
from wheel_terra_estimator.errors import UserError
from wheel_terra_estimator.input_file import read_text

LARGEST_FILE = 20 * 2**20  # [byte]
DEEPEST_CHAIN = 1000
BASE_LINKS = ('base_link', 'base_footprint')

_ROUND = ('cylinder', 'sphere')
_ACROSS = 0.1  # y of a wheel's axis (leftward if a positive rate drives forward): known from here
_NEAR = 0.01  # axles that differ less in height may be of wheels alike [m]
_ALONG = 0.8  # cosine between an axis and a direction that it points along, at least
_ROCKER_BOGIE = 3  # wheels on each side of a rover with rockers and bogies

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
        named = 'no joint ' + missing[0] if missing else 'no continuous joint named as a wheel'
        raise UserError(
            f'{path}: {named}; give the wheels (tracks are not modelled), of its turning joints: '
            f'--wheels {",".join(robot.turning_across()) or "(none)"}'
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
    axes = [p[:3, :3] @ _axis(joints[n], path) for n, p in zip(names, poses, strict=True)]
    if any(abs(axis[1]) < _ACROSS for axis in axes):
        guessed.add('wheels.direction')
    if all(abs(axis[0]) > _ALONG for axis in axes):
        guessed |= {'wheels.x', 'wheels.y'}  # they roll along y, so that x may not be forward
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
    suspension, rockers_known = robot.suspension(names, poses, centre[0])
    if suspension and not rockers_known:
        guessed.add('rover.rocker_pivot')
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
        direction=[-1 if axis[1] < -_ACROSS else 1 for axis in axes],
        steering_joints=[joint for joint, _ in steering],
        suspension=suspension,
        left_out=[n for n, z in height.items() if z < max(p[2, 3] for p in poses) + _NEAR],
        guessed=frozenset(guessed),
        source=f'{path.name}, relative to {robot.base}',
    )


def _parse(path: Path, data: bytes | None) -> ElementTree.Element:
    if data is None:
        text = read_text(path, LARGEST_FILE)
    else:
        text = data[:LARGEST_FILE].decode(errors='replace')
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
    caster = re.search('cast[eo]r', f'{words} {_link(joint, "parent")}'.lower())
    other = caster or 'steer' in words
    return joint.get('type') == 'continuous' and 'wheel' in words and not other


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


def _mean_x_z(poses: Sequence[Pose]) -> list[float]:
    return [round(float(np.mean([pose[k, 3] for pose in poses])), 5) for k in (0, 2)]


class _Robot:
    """A document with its links and joints by name, and the link that all poses are given in."""

    def __init__(self, path: Path, root: ElementTree.Element) -> None:
        self.path = path
        self.name = root.get('name', path.stem)
        joints = [(j.get('name', ''), j) for j in root.iter('joint') if j.get('type')]
        self.joints = dict(joints)
        for name, joint in joints:
            if self.joints[name] is not joint:
                raise UserError(f'{path}: two joints are named {name!r}; rename one')
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

    def turning_across(self) -> list[str]:
        """Return the joints that may turn wheels: of those about y if there are any, else all."""
        turning = [n for n, j in self.joints.items() if j.get('type') in ('continuous', 'revolute')]
        axes = {
            n: self.pose(self.joints[n])[:3, :3] @ _axis(self.joints[n], self.path) for n in turning
        }
        free = [n for n in turning if self.joints[n].get('type') == 'continuous'] or turning
        return [n for n in free if abs(axes[n][1]) > _ALONG] or turning

    def _turning_above(self, wheel: ElementTree.Element) -> Iterator[tuple[str, Pose, FloatArray]]:
        """Give name, pose and axis in the base of what turns above a wheel, nearest first."""
        joint = self._above.get(_link(wheel, 'parent'))
        for _ in range(DEEPEST_CHAIN):
            if joint is None or _link(joint, 'child') == self.base:
                return
            if joint.get('type') in ('revolute', 'continuous'):
                pose = self.pose(joint)
                yield joint.get('name', ''), pose, pose[:3, :3] @ _axis(joint, self.path)
            joint = self._above.get(_link(joint, 'parent'))

    def steering_joint(self, wheel: ElementTree.Element) -> tuple[str, float]:
        """Return the joint that steers a wheel, and the z of its axis in the base: -1 counts right.

        It is the nearest turning joint above the wheel whose axis is upright; '' and 0 for none.
        """
        above = self._turning_above(wheel)
        steering = ((name, float(axis[2])) for name, _, axis in above if abs(axis[2]) > _ALONG)
        return next(steering, ('', 0.0))

    def suspension(
        self, wheels: Sequence[str], poses: Sequence[Pose], centre: float
    ) -> tuple[dict[str, Value], bool]:
        """Return the keys of a rocker-bogie suspension, and whether the rockers' pivots are known.

        A bogie is a joint about y that carries two wheels of a side, a rocker one that carries all
        three. Where another bogie joins the remaining wheels of both sides (a triple bogie), the
        loads are those of rockers about the same pivots as the bogies. Rockers fixed to the
        chassis are taken to turn below the ``centre`` of gravity, x [m]. Nothing for other rovers.
        """
        pivots: dict[str, Pose] = {}
        carried: dict[str, set[int]] = {}
        for i, wheel in enumerate(wheels):
            for name, pose, axis in self._turning_above(self.joints[wheel]):
                if abs(axis[2]) < _ALONG:
                    pivots[name] = pose
                    carried.setdefault(name, set()).add(i)
        bogies, rockers, fronts = [], [], set()
        x = [float(pose[0, 3]) for pose in poses]
        left = {i for i, pose in enumerate(poses) if pose[1, 3] > 0.0}
        for side in (left, set(range(len(wheels))) - left):
            bogie = [n for n, held in carried.items() if len(held) == 2 and held < side]
            if len(side) != _ROCKER_BOGIE or len(bogie) != 1:
                return {}, False
            pair = [x[i] for i in carried[bogie[0]]]
            pivot = pivots[bogie[0]]
            if not min(pair) < pivot[0, 3] < max(pair):
                return {}, False
            bogies.append(pivot)
            rockers += [pivots[n] for n, held in carried.items() if held == side][:1]
            (alone,) = side - carried[bogie[0]]
            fronts.add(min(pair) > x[alone])
            joined = any(alone in h and h - side and len(h) == 2 for h in carried.values())
        if len(fronts) != 1:
            return {}, False
        bogie_x, bogie_z = _mean_x_z(bogies)
        if len(rockers) == len(bogies):
            rocker = _mean_x_z(rockers)
        else:
            rocker = [bogie_x if joined else centre, bogie_z]
        return {
            'rover.suspension': 'rocker_bogie',
            'rover.rocker_pivot': rocker,
            'rover.bogie_pivot': [bogie_x, bogie_z],
            'rover.bogie_wheels': 'front' if fronts.pop() else 'rear',
        }, joined or len(rockers) == len(bogies)

    def mass(self) -> tuple[float, list[float]]:
        """Return the mass of all links and their centre of gravity in the base."""
        total, moment = 0.0, np.zeros(3)
        for name, link in self._links.items():
            mass_of = link.find('inertial/mass')
            if mass_of is None:
                continue
            mass = _numbers(mass_of.get('value'), (0.0,), self.path)[0]
            if mass < 0.0:
                raise UserError(f'{self.path}: the mass of link {name} is {mass:g} kg; correct it')
            pose = self._link_pose(name)
            if pose is not None and mass:
                total += mass
                moment += mass * (pose @ _origin(link.find('inertial'), self.path))[:3, 3]
        centre = moment / total if total else moment
        return total, [round(float(value), 4) for value in centre]
