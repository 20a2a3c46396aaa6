# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of rosbags built from plain values: an independent truth for the bytes of ours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from rosbags.interfaces import Nodetype

from wheel_terra_estimator.arrays import FloatArray
from wheel_terra_estimator.bags.storage import jazzy_types
from wheel_terra_estimator.messages.convert import JOINT_STATE
from wheel_terra_estimator.messages.diagnostics import Status
from wheel_terra_estimator.messages.pack import BASE_FRAME


def serialised(message: Any) -> bytes:
    """Return the CDR bytes of a message of rosbags."""
    return bytes(jazzy_types().serialize_cdr(message, message.__msgtype__))


class MessageFactory:
    """Builds messages that rosbags can serialise; stamps are integer nanoseconds."""

    def __init__(self) -> None:
        self.store = jazzy_types()

    def make(self, kind: str, **values: Any) -> Any:
        """Return a message of a type such as ``std_msgs/msg/Bool``.

        A dictionary states a message within it; what is not stated is zero, false or empty.
        """
        _, fields = self.store.fielddefs[kind]
        assert values.keys() <= dict(fields).keys()
        parts = {name: self._part(values.get(name), *field) for name, field in fields}
        return self.store.types[kind](**parts)

    def _part(self, given: Any, node: Nodetype, of: Any) -> Any:
        """Return the value of a field, or of an entry of one."""
        if node is Nodetype.NAME:
            stated = {} if given is None else given
            return self.make(of, **stated) if isinstance(stated, dict) else stated
        if node is Nodetype.BASE:
            usual = {'string': '', 'bool': False, 'float64': 0.0}.get(of[0], 0)
            return usual if given is None else type(usual)(given)
        entry, size = of
        if entry[0] is Nodetype.NAME or entry[1][0] == 'string':
            return [self._part(each, *entry) for each in (given or ())]
        return np.asarray([0] * size if given is None else given, dtype=entry[1][0]).ravel()

    def header(self, stamp: int, frame: str = BASE_FRAME) -> Any:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        time = {'sec': seconds, 'nanosec': nanoseconds}
        return self.make('std_msgs/msg/Header', stamp=time, frame_id=frame)

    def joint_state(
        self,
        header: Any,
        names: Sequence[str],
        position: ArrayLike = (),
        velocity: ArrayLike = (),
        effort: ArrayLike = (),
    ) -> Any:
        columns = {'position': position, 'velocity': velocity, 'effort': effort}
        return self.make(JOINT_STATE, header=header, name=names, **columns)

    def slip_class(self, classes: Sequence[int]) -> Any:
        """Return the classes of the wheels as a UInt8MultiArray."""
        dimension = {'label': 'wheel', 'size': len(classes), 'stride': len(classes)}
        return self.make('std_msgs/msg/UInt8MultiArray', layout={'dim': [dimension]}, data=classes)

    def twist_with_covariance(self, forward: float, yaw_rate: float, covariance: ArrayLike) -> Any:
        """Return a TwistWithCovariance of a body that moves along x and turns about z."""
        twist = {'linear': {'x': forward}, 'angular': {'z': yaw_rate}}
        kind = 'geometry_msgs/msg/TwistWithCovariance'
        return self.make(kind, twist=twist, covariance=covariance)

    def twist_stamped(
        self, header: Any, forward: float, yaw_rate: float, covariance: ArrayLike
    ) -> Any:
        twist = self.twist_with_covariance(forward, yaw_rate, covariance)
        return self.make('geometry_msgs/msg/TwistWithCovarianceStamped', header=header, twist=twist)

    def odometry(self, header: Any, twist: Any, x: float = 0.0) -> Any:
        """Return an Odometry that states a twist, and a place along x; placeholder 0.1."""
        pose = {'pose': {'position': {'x': x}, 'orientation': {'w': 1.0}}}
        pose['covariance'] = 0.1 * np.eye(6)
        kind = 'nav_msgs/msg/Odometry'
        return self.make(kind, header=header, child_frame_id=BASE_FRAME, pose=pose, twist=twist)

    def imu(
        self,
        header: Any,
        specific_force: Sequence[float],
        angular_rate: Sequence[float],
        orientation: Sequence[float] | FloatArray | None,
        variances: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Any:
        """Return an Imu; ``variances`` of orientation, angular rate and specific force."""
        of_orientation, of_rate, of_force = (np.eye(3) * v for v in variances)
        if orientation is None:
            orientation, of_orientation = (0.0, 0.0, 0.0, 1.0), np.array([-1.0, *[0.0] * 8])
        return self.make(
            'sensor_msgs/msg/Imu',
            header=header,
            orientation=dict(zip('xyzw', orientation, strict=True)),
            orientation_covariance=of_orientation,
            angular_velocity=dict(zip('xyz', angular_rate, strict=True)),
            angular_velocity_covariance=of_rate,
            linear_acceleration=dict(zip('xyz', specific_force, strict=True)),
            linear_acceleration_covariance=of_force,
        )

    def diagnostic_array(self, header: Any, found: Sequence[Status]) -> Any:
        """Return a DiagnosticArray of statuses."""
        statuses = [
            {**s._asdict(), 'values': [{'key': key, 'value': value} for key, value in s.values]}
            for s in found
        ]
        return self.make('diagnostic_msgs/msg/DiagnosticArray', header=header, status=statuses)
