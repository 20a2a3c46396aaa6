# Copyright 2026 wheel_terra_estimator developers
# SPDX-License-Identifier: Apache-2.0
"""Messages out of and into their CDR bytes, quickly where one is like the last of its topic.

rclpy and rosbags unpack every field of a message. Of the messages that come a hundred times a
second only some fields are used, and their names do not change from one to the next: where the
beginning (frame and names) is byte by byte that of an earlier message that the library has
unpacked, only the numbers are taken out; of many messages of a recording all at once. Everything
else goes through the library: other types, big-endian or damaged messages.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Callable, Container, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from wheel_terra_estimator.arrays import FloatArray, IntArray
from wheel_terra_estimator.estimation.estimates import EstimateSet
from wheel_terra_estimator.messages.convert import (
    BASE_FRAME,
    JOINT_OUTPUTS,
    JOINT_STATE,
    ODOMETRY,
    joint_fields,
    stamp_of,
    twist_fields,
)

IMU = 'sensor_msgs/msg/Imu'
TWIST = 'geometry_msgs/msg/TwistWithCovarianceStamped'

SET_TOPICS = (*JOINT_OUTPUTS, 'slip_class', 'twist')
"""Private topics that have a message of each set (``slip_on_slope``: once a second)."""

_LITTLE_ENDIAN = b'\x00\x01'
_HEAD = _LITTLE_ENDIAN + bytes(2)
_BODY = 4  # where the fields begin, and from where they are aligned [byte]
_AFTER_STAMP = 12  # the frame of the header [byte]
_LONGEST_PADDING = 3  # [byte] behind the last field
_MOST_BEGINNINGS = 8  # beginnings of messages that are remembered of one topic

_STAMP = struct.Struct('<iI')
_COUNT = struct.Struct('<I')
_IMU = struct.Struct('<37d')  # attitude (4 + 9), angular rate (3 + 9), specific force (3 + 9)
_POSE = 43 * 8  # [byte] of an Odometry: position, attitude, covariance
_TWIST = struct.Struct('<42d')  # linear, angular, covariance
_NO_VALUES: FloatArray = np.zeros(0)


class DamagedMessageError(ValueError):
    """Bytes that are no message of the type."""


class Stamp(NamedTuple):
    """A time of a message."""

    sec: int
    nanosec: int


class Header(NamedTuple):
    """A header; its frame is not used."""

    stamp: Stamp


class Vector(NamedTuple):
    """A vector, or the vector part of a quaternion."""

    x: float
    y: float
    z: float


class Quaternion(NamedTuple):
    """An attitude."""

    x: float
    y: float
    z: float
    w: float


class JointState(NamedTuple):
    """A ``sensor_msgs/msg/JointState``."""

    header: Header
    name: tuple[str, ...]
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray


class Imu(NamedTuple):
    """A ``sensor_msgs/msg/Imu``."""

    header: Header
    orientation: Quaternion
    orientation_covariance: tuple[float, ...]
    angular_velocity: Vector
    angular_velocity_covariance: tuple[float, ...]
    linear_acceleration: Vector
    linear_acceleration_covariance: tuple[float, ...]


class Twist(NamedTuple):
    """A ``geometry_msgs/msg/Twist``."""

    linear: Vector
    angular: Vector


class TwistWithCovariance(NamedTuple):
    """A ``geometry_msgs/msg/TwistWithCovariance``."""

    twist: Twist
    covariance: tuple[float, ...]


class TwistStamped(NamedTuple):
    """A ``geometry_msgs/msg/TwistWithCovarianceStamped``."""

    header: Header
    twist: TwistWithCovariance


class Odometry(NamedTuple):
    """The velocity of a ``nav_msgs/msg/Odometry``; its pose is not used."""

    header: Header
    twist: TwistWithCovariance


class _Beginning(NamedTuple):
    """What stands between the stamp and the numbers of a message."""

    content: bytes
    names: tuple[str, ...]
    end: int


class Alike(NamedTuple):
    """Messages of a topic that differ in their stamps and numbers only.

    Of a JointState the numbers are position, velocity and effort, of an Imu all 37, of a velocity
    the 42 of its twist: each (messages, n), in the order of the message.
    """

    order: IntArray  # their places among the messages that were given
    stamps: IntArray  # [ns]
    names: tuple[str, ...]
    numbers: tuple[FloatArray, ...]


class TopicMessages:
    """Unpacks the messages of one topic.

    ``kind``: message type, as in ``sensor_msgs/msg/Imu``. ``whole``: unpacks all fields of a
    message from its bytes, as the library does.
    """

    def __init__(self, kind: str, whole: Callable[[bytes], Any]) -> None:
        self._kind = kind
        self._whole = whole
        quick: tuple[_Quick | None, bool, int] = _QUICK.get(kind, (None, False, 0))
        self._quick, self._names, self._strings = quick
        self._known: list[_Beginning] = []

    def unpack(self, data: bytes) -> Any:
        """Return a message.

        Raises DamagedMessageError where the bytes are no message of the type.
        """
        quick = self._quick
        if quick is not None and (known := self._beginning(data)) is not None:
            message = quick(data, known)
            if message is not None:
                return message
        try:
            message = self._whole(data)
        except Exception as error:  # the libraries let many kinds through on damaged bytes
            raise DamagedMessageError(str(error)) from None
        if quick is not None and data[:2] == _LITTLE_ENDIAN:
            self._remember(data, message)
        return message

    def unpack_alike(self, messages: Sequence[bytes]) -> Iterator[Alike]:
        """Yield the numbers of messages, those that are alike together; damaged ones are left out.

        For the types that are unpacked quickly.
        """
        by_length: defaultdict[int, list[int]] = defaultdict(list)
        for index, data in enumerate(messages):
            by_length[len(data)].append(index)
        for left in by_length.values():
            for _ in range(_MOST_BEGINNINGS):
                if len(left) > 1 and (alike := self._like_first(messages, left)) is not None:
                    yield alike
                    left = np.setdiff1d(left, alike.order).tolist()
            for index in left:
                try:
                    message = self.unpack(messages[index])
                except DamagedMessageError:
                    continue
                yield _alone(index, message)

    def _like_first(self, messages: Sequence[bytes], indices: Sequence[int]) -> Alike | None:
        """Return which of some messages of equal length are like the first, if it is sound."""
        first = messages[indices[0]]
        try:
            self.unpack(first)
        except DamagedMessageError:
            return None
        known = self._beginning(first)
        places = None if known is None else _places(self._kind, first, known)
        if known is None or places is None:
            return None
        size = len(first)
        table = np.frombuffer(b''.join(messages[i] for i in indices), np.uint8).reshape(-1, size)
        fixed = np.ones(size, dtype=bool)
        fixed[len(_LITTLE_ENDIAN) : _AFTER_STAMP] = False
        if self._kind == ODOMETRY:  # its pose
            fixed[known.end : places[0][0]] = False
        for at, count in places:
            fixed[at : at + 8 * count] = False
        same = np.all(table[:, fixed] == table[0, fixed], axis=1)
        table = table[same]
        seconds = np.ascontiguousarray(table[:, _BODY : _BODY + 4]).view('<i4')[:, 0]
        rest = np.ascontiguousarray(table[:, _BODY + 4 : _AFTER_STAMP]).view('<u4')[:, 0]
        return Alike(
            np.asarray(indices)[same],
            seconds.astype(np.int64) * 1_000_000_000 + rest,
            known.names,
            tuple(
                np.ascontiguousarray(table[:, at : at + 8 * count]).view('<f8')
                if count
                else np.zeros((len(table), 0))
                for at, count in places
            ),
        )

    def _beginning(self, data: bytes) -> _Beginning | None:
        if data[:2] == _LITTLE_ENDIAN:
            for known in self._known:
                if data.startswith(known.content, _AFTER_STAMP):
                    return known
        return None

    def _remember(self, data: bytes, message: Any) -> None:
        """Remember the beginning of a message that is sound."""
        end = _AFTER_STAMP
        for _ in range(self._strings):
            end = _behind_string(data, end)
        names: tuple[str, ...] = ()
        if self._names:
            names = tuple(message.name)
            end = _aligned(end, 4) + _COUNT.size
            for _ in names:
                end = _behind_string(data, end)
        self._known.insert(0, _Beginning(bytes(data[_AFTER_STAMP:end]), names, end))
        del self._known[_MOST_BEGINNINGS:]


def _joint_state(data: bytes, known: _Beginning) -> JointState | None:
    places = _joint_places(data, known)
    if places is None:
        return None
    fields = [
        np.frombuffer(data, np.float64, count, at) if count else _NO_VALUES for at, count in places
    ]
    return JointState(_header(data), known.names, *fields)


def _joint_places(data: bytes, known: _Beginning) -> list[tuple[int, int]] | None:
    """Return where position, velocity and effort begin [byte], and how many numbers they have."""
    end = len(data)
    at = _aligned(known.end, 4)
    places = []
    for _ in range(3):
        if at + 4 > end:
            return None
        (count,) = _COUNT.unpack_from(data, at)
        at += 4
        if count:
            at += -(at - _BODY) % 8
            if at + 8 * count > end:
                return None
        places.append((at, count))
        at += 8 * count
    return None if end - at > _LONGEST_PADDING else places


def _places(kind: str, data: bytes, known: _Beginning) -> list[tuple[int, int]] | None:
    """Return where the fields of numbers begin [byte], and how many numbers they have."""
    if kind == JOINT_STATE:
        return _joint_places(data, known)
    at = _aligned(known.end, 8) + (_POSE if kind == ODOMETRY else 0)
    size = (_IMU if kind == IMU else _TWIST).size
    return [(at, size // 8)] if 0 <= len(data) - at - size <= _LONGEST_PADDING else None


def _alone(index: int, message: Any) -> Alike:
    """Return a message that is like no other."""
    names: tuple[str, ...] = ()
    fields: list[Any]
    if hasattr(message, 'name'):
        names = tuple(message.name)
        fields = [message.position, message.velocity, message.effort]
    elif hasattr(message, 'twist'):
        twist = message.twist.twist
        fields = [[*_xyz(twist.linear), *_xyz(twist.angular), *message.twist.covariance]]
    else:
        attitude = message.orientation
        fields = [
            [
                *_xyz(attitude),
                attitude.w,
                *message.orientation_covariance,
                *_xyz(message.angular_velocity),
                *message.angular_velocity_covariance,
                *_xyz(message.linear_acceleration),
                *message.linear_acceleration_covariance,
            ]
        ]
    numbers = tuple(np.array(field, dtype=np.float64)[np.newaxis] for field in fields)
    return Alike(np.array([index]), np.array([stamp_of(message)]), names, numbers)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _imu(data: bytes, known: _Beginning) -> Imu | None:
    at = _aligned(known.end, 8)
    if not 0 <= len(data) - at - _IMU.size <= _LONGEST_PADDING:
        return None
    v = _IMU.unpack_from(data, at)
    return Imu(
        _header(data),
        Quaternion(*v[:4]),
        v[4:13],
        Vector(*v[13:16]),
        v[16:25],
        Vector(*v[25:28]),
        v[28:],
    )


def _odometry(data: bytes, known: _Beginning) -> Odometry | None:
    twist = _twist(data, _aligned(known.end, 8) + _POSE)
    return None if twist is None else Odometry(_header(data), twist)


def _twist_stamped(data: bytes, known: _Beginning) -> TwistStamped | None:
    twist = _twist(data, _aligned(known.end, 8))
    return None if twist is None else TwistStamped(_header(data), twist)


def _twist(data: bytes, at: int) -> TwistWithCovariance | None:
    if not 0 <= len(data) - at - _TWIST.size <= _LONGEST_PADDING:
        return None
    v = _TWIST.unpack_from(data, at)
    return TwistWithCovariance(Twist(Vector(*v[:3]), Vector(*v[3:6])), v[6:])


_Quick = Callable[[bytes, _Beginning], Any]
_QUICK: dict[str, tuple[_Quick, bool, int]] = {
    JOINT_STATE: (_joint_state, True, 1),
    IMU: (_imu, False, 1),
    ODOMETRY: (_odometry, False, 2),
    TWIST: (_twist_stamped, False, 1),
}
"""Type -> how it is unpacked, whether names follow, and how many strings stand before."""


def _header(data: bytes) -> Header:
    return Header(Stamp(*_STAMP.unpack_from(data, _BODY)))


def _aligned(at: int, size: int) -> int:
    return at + -(at - _BODY) % size


def _behind_string(data: bytes, at: int) -> int:
    at = _aligned(at, 4)
    return at + _COUNT.size + int(_COUNT.unpack_from(data, at)[0])


class JointStatePacker:
    """Packs the JointStates of one frame: what does not change from one to the next only once."""

    def __init__(self, frame: str) -> None:
        self._frame = _string(frame)
        self._layouts: dict[tuple[Any, ...], tuple[struct.Struct, bytes]] = {}

    def packed(
        self,
        stamp: int,
        names: tuple[str, ...],
        position: Sequence[float],
        velocity: Sequence[float],
        effort: Sequence[float],
    ) -> bytes:
        """Return the CDR bytes of a message; the stamp in ns."""
        counts = len(position), len(velocity), len(effort)
        layout = self._layouts.get((names, counts))
        if layout is None:
            layout = self._layouts[names, counts] = self._layout(names, counts)
        form, beginning = layout
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        return form.pack(
            _HEAD,
            seconds,
            nanoseconds,
            beginning,
            counts[0],
            *position,
            counts[1],
            *velocity,
            counts[2],
            *effort,
        )

    def _layout(self, names: tuple[str, ...], counts: Sequence[int]) -> tuple[struct.Struct, bytes]:
        """Return how a message is packed, and what stands between its stamp and its numbers."""
        beginning = _padded(self._frame, 4) + _COUNT.pack(len(names))
        for name in names:
            beginning = _padded(beginning, 4) + _string(name)
        beginning = _padded(beginning, 4)
        at = _AFTER_STAMP + len(beginning)
        form = f'<4siI{len(beginning)}s'
        for count in counts:
            form += 'I'
            at += _COUNT.size
            if count:
                padding = -(at - _BODY) % 8
                form += f'{padding}x{count}d'
                at += padding + 8 * count
        return struct.Struct(form), beginning


class TwistPacker:
    """Packs the stamped twists of one frame, see `JointStatePacker`."""

    def __init__(self, frame: str) -> None:
        self._beginning = _padded(_string(frame), 8)
        self._form = struct.Struct(f'<4siI{len(self._beginning)}s42d')

    def packed(
        self,
        stamp: int,
        velocity: tuple[float, float],
        yaw_rate: float,
        covariance: Sequence[float],
    ) -> bytes:
        """Return the CDR bytes of a message: stamp [ns], velocity x and y, 36 covariances."""
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        twist = (*velocity, 0.0, 0.0, 0.0, yaw_rate)
        return self._form.pack(_HEAD, seconds, nanoseconds, self._beginning, *twist, *covariance)


class ClassPacker:
    """Packs the slip classes of wheels as a ``std_msgs/msg/UInt8MultiArray``."""

    def __init__(self, wheels: int) -> None:
        one_dimension = _COUNT.pack(1) + _string('wheel')
        aligned = one_dimension + bytes(-len(one_dimension) % 4)
        no_offset = 0
        self._beginning = _HEAD + aligned + struct.pack('<4I', wheels, wheels, no_offset, wheels)

    def packed(self, classes: Sequence[int]) -> bytes:
        """Return the CDR bytes of a message."""
        return self._beginning + bytes(classes)


class EstimatePacker:
    """Packs estimate sets as the node and a recording send them; names of the wheels."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._joint_states = JointStatePacker(BASE_FRAME)
        self._classes = ClassPacker(len(names))
        self._twists = TwistPacker(BASE_FRAME)

    def packed(
        self, estimates: EstimateSet, wanted: Container[str] = SET_TOPICS
    ) -> Iterator[tuple[str, bytes]]:
        """Yield private topic and CDR bytes of the messages of a set on the topics wanted."""
        stamp = estimates.stamp
        for topic, fields in joint_fields(estimates, self._names).items():
            if topic in wanted:
                yield topic, self._joint_states.packed(stamp, *fields)
            if topic == 'slip' and 'slip_class' in wanted:
                yield 'slip_class', self._classes.packed(estimates.slip_class.tolist())
        if 'twist' in wanted:
            yield 'twist', self._twists.packed(stamp, *twist_fields(estimates))


def _string(text: str) -> bytes:
    content = text.encode() + b'\0'
    return _COUNT.pack(len(content)) + content


def _padded(behind_stamp: bytes, size: int) -> bytes:
    """Return bytes that begin behind the stamp, filled up to a multiple of ``size``."""
    return behind_stamp + bytes(-(_AFTER_STAMP + len(behind_stamp) - _BODY) % size)
