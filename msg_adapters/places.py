# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Places: ``plan`` and ``plan_markers``, poses for the navigation, ``robot_pose``, and transforms of TF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Vector3,
)
from nav_msgs.msg import Path
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from msg_adapters.point_cloud import FRAME, to_seconds, to_time
from soilmoist_ros.exploration import Polygons, Stop, Transform, yaw_rotation
from soilmoist_ros.sensing import Covariance

_NEXT: Final = ColorRGBA(r=1.0, g=0.5, b=0.0, a=1.0)
_LATER: Final = ColorRGBA(r=0.1, g=0.4, b=0.9, a=0.8)
_RULED_OUT: Final = ColorRGBA(r=0.8, g=0.1, b=0.1, a=0.9)
_STOP_M: Final = 1.0
_TEXT_M: Final = 1.2
_LINE_M: Final = 0.15
_UNKNOWN_M2: Final = 1e6  # variance of a coordinate that is unknown [m^2]
_UNKNOWN_RAD2: Final = math.tau**2
_KNOWN_RAD2: Final = 0.1**2
_YAW: Final = 35


def plan_to_path(stops: Sequence[Stop], stamp_s: float, frame_id: str = FRAME) -> Path:
    """Path through the stops ahead, the next one first; without stops it clears the display."""
    header = Header(stamp=to_time(stamp_s), frame_id=frame_id)
    return Path(header=header, poses=[pose_stamped(stop.x_m, stop.y_m, stamp_s, frame_id) for stop in stops])


def path_to_places(path: Path) -> list[tuple[float, float]]:
    """Places of a path [m]; a path has no names of stops."""
    return [(float(pose.pose.position.x), float(pose.pose.position.y)) for pose in path.poses]


def pose_stamped(
    x_m: float, y_m: float, stamp_s: float, frame_id: str = FRAME, heading_rad: float = 0.0
) -> PoseStamped:
    """Pose at a place [m], heading anticlockwise from east [rad]."""
    turn = Quaternion(z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))
    pose = Pose(position=_point(x_m, y_m), orientation=turn)
    return PoseStamped(header=Header(stamp=to_time(stamp_s), frame_id=frame_id), pose=pose)


def plan_to_markers(
    stops: Sequence[Stop], dwell_s: float, ruled_out: Polygons, stamp_s: float, frame_id: str = FRAME
) -> MarkerArray:
    """Markers of the stops, with order, name and dwell, and of areas; they replace the earlier markers."""
    header = Header(stamp=to_time(stamp_s), frame_id=frame_id)
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    if len(stops) > 1:
        line = _marker(header, "way", 0, Marker.LINE_STRIP, _LATER, _LINE_M)
        line.points = [_point(stop.x_m, stop.y_m) for stop in stops]
        markers.append(line)
    for number, corners in enumerate(ruled_out):
        border = _marker(header, "ruled_out", number, Marker.LINE_STRIP, _RULED_OUT, _LINE_M)
        border.points = [_point(*corner) for corner in (*corners, corners[0])]
        markers.append(border)
    for number, stop in enumerate(stops):
        colour = _LATER if number else _NEXT
        place = _marker(header, "stops", number, Marker.CYLINDER, colour, _STOP_M)
        place.pose.position = _point(stop.x_m, stop.y_m)
        place.scale.z = _LINE_M
        label = _marker(header, "labels", number, Marker.TEXT_VIEW_FACING, colour, _TEXT_M)
        label.pose.position = _point(stop.x_m, stop.y_m, _TEXT_M)
        label.text = f"{number + 1}: {stop.name}, {dwell_s:.0f} s"
        markers += [place, label]
    return MarkerArray(markers=markers)


def _marker(header: Header, group: str, number: int, kind: int, colour: ColorRGBA, size_m: float) -> Marker:
    marker = Marker(header=header, ns=group, id=number, type=kind, action=Marker.ADD, color=colour)
    marker.pose.orientation.w = 1.0
    marker.scale = Vector3(x=size_m, y=size_m, z=size_m)
    return marker


def _point(x_m: float, y_m: float, z_m: float = 0.0) -> Point:
    return Point(x=float(x_m), y=float(y_m), z=float(z_m))


# tf2_msgs/TFMessage to transforms of the core; the robot's pose as a geometry_msgs/PoseWithCovarianceStamped ----


def transforms_from_message(message: Any, static: bool) -> list[Transform]:
    """Transforms of a message; slashes before the names of frames, as ROS 1 wrote them, are dropped."""
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

    :param yaw_rad: heading, counter-clockwise from east [rad]; NaN if unknown, which gives the pose the heading 0
        with a variance of a whole turn
    :param covariance_m2: covariance of east, north and up [m^2], NaN if unknown
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
