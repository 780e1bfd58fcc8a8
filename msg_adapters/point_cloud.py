# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Structured numpy arrays <-> sensor_msgs/PointCloud2, and seconds since 1970 UTC <-> builtin_interfaces/Time."""

from __future__ import annotations

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from soilmoist_ros.recording import DATATYPES, points, stamp_parts
from soilmoist_ros.recording import FRAME as FRAME


def points_to_message(table: NDArray[Any], stamp_s: float, frame_id: str = FRAME) -> PointCloud2:
    """Message of points."""
    height, width = table.shape if table.ndim == 2 else (1, len(table))
    fields = table.dtype.fields
    assert fields is not None  # a structured array has fields
    return PointCloud2(
        header=Header(stamp=to_time(stamp_s), frame_id=frame_id),
        height=int(height),
        width=int(width),
        fields=[
            PointField(name=name, offset=int(fields[name][1]), datatype=DATATYPES[fields[name][0].str], count=1)
            for name in fields
        ],
        is_bigendian=False,
        point_step=table.dtype.itemsize,
        row_step=table.dtype.itemsize * int(width),
        data=table.tobytes(),
        is_dense=all(bool(np.isfinite(table[axis]).all()) for axis in ("x", "y", "z")),
    )


class OtherFrameError(ValueError):
    """Points of a message have another frame than the one expected."""


def require_frame(message: PointCloud2, frame: str) -> None:
    """Check the frame of a message, apart from a leading slash; raises :class:`OtherFrameError`."""
    found = message.header.frame_id
    if found.lstrip("/") != frame.lstrip("/"):
        points = message.height * message.width
        raise OtherFrameError(f"{points} points in frame {found!r} instead of {frame!r}")


def points_from_message(message: PointCloud2, wanted: np.dtype[Any]) -> NDArray[Any]:
    """Points of a message, shape (height, width); fields are found by name, others are ignored."""
    check_fields(message, wanted)
    found = points(message)
    chosen = np.empty(found.shape, wanted)
    for name in wanted.names or ():
        chosen[name] = found[name]
    return chosen


def check_fields(message: PointCloud2, wanted: np.dtype[Any]) -> None:
    """Check the fields of a message; ``ValueError`` names one that is missing or of another type."""
    found = {field.name: field for field in message.fields}
    for name in wanted.names or ():
        if name not in found:
            raise ValueError(f"the message has no field {name!r}, only: {', '.join(found) or 'none'}")
        if found[name].datatype != DATATYPES[wanted[name].str]:
            raise ValueError(f"field {name!r} is of datatype {found[name].datatype}, not {wanted[name].str}")


# Seconds since 1970 UTC <-> builtin_interfaces/Time -------------------------------------------------------------


def to_time(stamp_s: float) -> Time:
    """Message of a time. A time that the message cannot represent becomes zero, which means unknown in ROS.

    :param stamp_s: seconds since 1970 UTC; NaN if unknown
    """
    second, nanosecond = stamp_parts(stamp_s)
    return Time(sec=second, nanosec=nanosecond)


def to_seconds(stamp: Time) -> float:
    """Seconds since 1970 UTC of a message."""
    return float(stamp.sec + stamp.nanosec * 1e-9)
