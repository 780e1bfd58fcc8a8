# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""tf2_msgs/TFMessage to transforms of the core; the robot's pose as a geometry_msgs/PoseWithCovarianceStamped.

The module does not import tf2_msgs, which a machine without the package of apt may lack.
"""

from __future__ import annotations

import math
from typing import Any, Final

from geometry_msgs.msg import Point, Pose, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion
from std_msgs.msg import Header

from msg_adapters.stamps import to_seconds, to_time
from soilmoist_ros.exploration import Transform, yaw_rotation
from soilmoist_ros.sensing import Covariance

_UNKNOWN_M2: Final = 1e6
"""Variance of a coordinate that is unknown [m^2]."""
_UNKNOWN_RAD2: Final = math.tau**2
_KNOWN_RAD2: Final = 0.1**2
_YAW: Final = 35


def transforms_from_message(message: Any, static: bool) -> list[Transform]:
    """Transforms of a message; slashes before the names of frames, as ROS 1 wrote them, are dropped.

    :param message: a tf2_msgs/TFMessage
    :param static: whether it came on ``/tf_static``
    """
    found = []
    for stamped in message.transforms:
        shift, turn = stamped.transform.translation, stamped.transform.rotation
        found.append(
            Transform(
                frame_name(stamped.header.frame_id),
                frame_name(stamped.child_frame_id),
                (float(shift.x), float(shift.y), float(shift.z)),
                (float(turn.x), float(turn.y), float(turn.z), float(turn.w)),
                to_seconds(stamped.header.stamp),
                static,
            )
        )
    return found


def frame_name(frame_id: str) -> str:
    """Name of a frame, without the slash that ROS 1 wrote before it."""
    return frame_id.lstrip("/")


def pose_to_message(
    place: tuple[float, float], yaw_rad: float, covariance_m2: Covariance, stamp_s: float, frame_id: str
) -> PoseWithCovarianceStamped:
    """Message of the robot's pose.

    :param place: east and north [m]
    :param yaw_rad: heading, counter-clockwise from east [rad]; NaN if unknown, which gives the pose the heading 0
        with a variance of a whole turn
    :param covariance_m2: covariance of east, north and up [m^2], NaN if unknown
    :param stamp_s: time of the pose [s since 1970-01-01 UTC]
    :param frame_id: frame of the pose
    """
    unknown = math.isnan(yaw_rad)
    x, y, z, w = yaw_rotation(0.0 if unknown else float(yaw_rad))
    values = [0.0] * 36
    for row in range(2):
        for column in range(2):
            value = float(covariance_m2[row][column])
            values[6 * row + column] = value if math.isfinite(value) else _UNKNOWN_M2 * (row == column)
    for number in (14, 21, 28):
        values[number] = _UNKNOWN_M2
    values[_YAW] = _UNKNOWN_RAD2 if unknown else _KNOWN_RAD2
    pose = Pose(position=Point(x=float(place[0]), y=float(place[1])), orientation=Quaternion(x=x, y=y, z=z, w=w))
    return PoseWithCovarianceStamped(
        header=Header(stamp=to_time(stamp_s), frame_id=frame_id),
        pose=PoseWithCovariance(pose=pose, covariance=values),
    )
