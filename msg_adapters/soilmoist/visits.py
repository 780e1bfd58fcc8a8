# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``visits``: each visit as a soilmoist_msgs/Visit."""

from __future__ import annotations

from geometry_msgs.msg import Point
from soilmoist_msgs.msg import Visit as VisitMessage
from std_msgs.msg import Header

from msg_adapters.point_cloud import FRAME
from msg_adapters.stamps import to_time
from soilmoist_ros.exploration import Visit
from soilmoist_ros.recording import visit_of


def visit_to_message(visit: Visit, robot: str = "", frame_id: str = FRAME) -> VisitMessage:
    """Message of a visit.

    :param visit: the visit
    :param robot: namespace of the planner
    """
    return VisitMessage(
        header=Header(stamp=to_time(visit.end_stamp_s), frame_id=frame_id),
        robot=robot,
        stop=visit.name,
        stop_position=Point(x=float(visit.stop_x_m), y=float(visit.stop_y_m)),
        position=Point(x=float(visit.x_m), y=float(visit.y_m)),
        arrival=to_time(visit.arrival_stamp_s),
        arrival_s=float(visit.arrived_s),
        dwell_s=float(visit.dwell_s),
        dwell_rule=visit.dwell,
        records=int(visit.records),
        raw_counts=int(visit.raw_counts),
        exposure_s=float(visit.exposure_s),
        effective_exposure_s=float(visit.effective_exposure_s),
        choice=visit.reason,
        reason_code=str(visit.ended),
        reason=visit.outcome,
    )


def visit_from_message(message: VisitMessage, robot: int = 1) -> Visit:
    """Visit of a message; ``robot`` sets the visit's robot number, since the message has only a namespace."""
    return visit_of(message, robot)
