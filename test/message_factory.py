# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of rosbags built from plain values: an independent truth for the bytes of ours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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
        """Return a message of a type such as ``std_msgs/msg/Bool``."""
        return self.store.types[kind](**values)

    def header(self, stamp: int, frame: str = BASE_FRAME) -> Any:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        time = self.make('builtin_interfaces/msg/Time', sec=seconds, nanosec=nanoseconds)
        return self.make('std_msgs/msg/Header', stamp=time, frame_id=frame)

    def joint_state(
        self,
        header: Any,
        names: Sequence[str],
        position: ArrayLike = (),
        velocity: ArrayLike = (),
        effort: ArrayLike = (),
    ) -> Any:
        return self.make(
            JOINT_STATE,
            header=header,
            name=list(names),
            position=np.asarray(position, dtype=np.float64),
            velocity=np.asarray(velocity, dtype=np.float64),
            effort=np.asarray(effort, dtype=np.float64),
        )

    def slip_class(self, classes: ArrayLike) -> Any:
        """Return the classes of the wheels as a UInt8MultiArray."""
        data = np.asarray(classes, dtype=np.uint8)
        dimension = self.make(
            'std_msgs/msg/MultiArrayDimension', label='wheel', size=data.size, stride=data.size
        )
        layout = self.make('std_msgs/msg/MultiArrayLayout', dim=[dimension], data_offset=0)
        return self.make('std_msgs/msg/UInt8MultiArray', layout=layout, data=data)

    def vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
        return self.make('geometry_msgs/msg/Vector3', x=float(x), y=float(y), z=float(z))

    def quaternion(self, x: float, y: float, z: float, w: float) -> Any:
        return self.make(
            'geometry_msgs/msg/Quaternion', x=float(x), y=float(y), z=float(z), w=float(w)
        )

    def twist_with_covariance(self, forward: float, yaw_rate: float, covariance: ArrayLike) -> Any:
        """Return a TwistWithCovariance of a body that moves along x and turns about z."""
        twist = self.make(
            'geometry_msgs/msg/Twist', linear=self.vector(forward), angular=self.vector(z=yaw_rate)
        )
        return self.make(
            'geometry_msgs/msg/TwistWithCovariance',
            twist=twist,
            covariance=np.asarray(covariance, dtype=np.float64).reshape(36),
        )

    def twist_stamped(
        self, header: Any, forward: float, yaw_rate: float, covariance: ArrayLike
    ) -> Any:
        return self.make(
            'geometry_msgs/msg/TwistWithCovarianceStamped',
            header=header,
            twist=self.twist_with_covariance(forward, yaw_rate, covariance),
        )

    def odometry(self, header: Any, twist: Any) -> Any:
        """Return an Odometry that states a twist only (pose at the origin, placeholder 0.1)."""
        position = self.make('geometry_msgs/msg/Point', x=0.0, y=0.0, z=0.0)
        pose = self.make(
            'geometry_msgs/msg/Pose',
            position=position,
            orientation=self.quaternion(0.0, 0.0, 0.0, 1.0),
        )
        return self.make(
            'nav_msgs/msg/Odometry',
            header=header,
            child_frame_id=BASE_FRAME,
            pose=self.make(
                'geometry_msgs/msg/PoseWithCovariance',
                pose=pose,
                covariance=(0.1 * np.eye(6)).reshape(36),
            ),
            twist=twist,
        )

    def imu(
        self,
        header: Any,
        specific_force: Sequence[float],
        angular_rate: Sequence[float],
        orientation: Sequence[float] | FloatArray | None,
        variances: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Any:
        """Return an Imu; ``variances`` of orientation, angular rate and specific force."""
        of_orientation, of_rate, of_force = ((np.eye(3) * v).reshape(9) for v in variances)
        if orientation is None:
            of_orientation = np.array([-1.0, *[0.0] * 8])
        return self.make(
            'sensor_msgs/msg/Imu',
            header=header,
            orientation=self.quaternion(
                *((0.0, 0.0, 0.0, 1.0) if orientation is None else orientation)
            ),
            orientation_covariance=of_orientation,
            angular_velocity=self.vector(*angular_rate),
            angular_velocity_covariance=of_rate,
            linear_acceleration=self.vector(*specific_force),
            linear_acceleration_covariance=of_force,
        )

    def diagnostic_array(self, header: Any, found: Sequence[Status]) -> Any:
        return self.make(
            'diagnostic_msgs/msg/DiagnosticArray',
            header=header,
            status=[
                self.make(
                    'diagnostic_msgs/msg/DiagnosticStatus',
                    level=status.level,
                    name=status.name,
                    message=status.message,
                    hardware_id=status.hardware_id,
                    values=[
                        self.make('diagnostic_msgs/msg/KeyValue', key=key, value=value)
                        for key, value in status.values
                    ],
                )
                for status in found
            ],
        )
