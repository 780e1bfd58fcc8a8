# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A visit from a decoded soilmoist_msgs/Visit, without ROS."""

from __future__ import annotations

import math
from typing import Any

from soilmoist_ros.exploration import Visit, VisitEnd
from soilmoist_ros.foundation import foreign_text


def visit_of(message: Any, robot: int = 1) -> Visit:
    """The visit of a message.

    :param message: a soilmoist_msgs/Visit, decoded by ROS or by rosbags; an unknown code becomes
        ``VisitEnd.UNKNOWN``
    :param robot: number of the robot, from 1
    :raises ValueError: if a field of a visit is missing
    """
    try:
        return Visit(
            name=foreign_text(str(message.stop)),
            x_m=float(message.position.x),
            y_m=float(message.position.y),
            arrived_s=float(message.arrival_s),
            dwell_s=float(message.dwell_s),
            raw_counts=int(message.raw_counts),
            reason=foreign_text(str(message.choice)),
            robot=robot,
            records=int(message.records),
            exposure_s=float(message.exposure_s),
            effective_exposure_s=float(message.effective_exposure_s),
            ended=_end(str(message.reason_code)),
            outcome=foreign_text(str(message.reason)),
            dwell=foreign_text(str(message.dwell_rule)),
            arrival_stamp_s=_seconds(message.arrival),
            end_stamp_s=_seconds(message.header.stamp),
            stop_x_m=float(message.stop_position.x),
            stop_y_m=float(message.stop_position.y),
        )
    except AttributeError as error:
        raise ValueError(f"the message is not a visit: {error}") from None


def _end(code: str) -> VisitEnd:
    try:
        return VisitEnd(code)
    except ValueError:
        return VisitEnd.UNKNOWN


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec * 1e-9) or math.nan
