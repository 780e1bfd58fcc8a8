# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``OccupancyGrid`` and ``CostmapFilterInfo`` of a keep-out mask, as Nav2's keep-out filter reads them."""

from __future__ import annotations

from array import array
from typing import Any, Final

from geometry_msgs.msg import Point, Pose, Quaternion
from nav_msgs.msg import MapMetaData, OccupancyGrid
from std_msgs.msg import Header

from msg_adapters.stamps import to_time
from soilmoist_ros.exploration import KeepoutMask

KEEPOUT_TYPE: Final = 0
"""Number of the keep-out filter among the filters of Nav2."""


def mask_to_message(mask: KeepoutMask, stamp_s: float, frame_id: str) -> OccupancyGrid:
    """Message of a mask: 0 is free, 100 is kept out.

    :param mask: the mask, in the plane of the frame
    :param stamp_s: time [s since 1970-01-01 UTC]
    :param frame_id: frame of the mask
    """
    rows, columns = mask.values.shape
    stamp = to_time(stamp_s)
    corner = Point(x=float(mask.origin_m[0]), y=float(mask.origin_m[1]), z=0.0)
    return OccupancyGrid(
        header=Header(stamp=stamp, frame_id=frame_id),
        info=MapMetaData(
            map_load_time=stamp,
            resolution=float(mask.resolution_m),
            width=int(columns),
            height=int(rows),
            origin=Pose(position=corner, orientation=Quaternion(w=1.0)),
        ),
        data=array("b", mask.values.tobytes()),
    )


def filter_info(kind: Any, mask_topic: str, stamp_s: float, frame_id: str) -> Any:
    """Message that names a mask to a costmap filter: values of the mask are costs in percent.

    :param kind: class ``nav2_msgs/CostmapFilterInfo``
    :param mask_topic: full name of the topic of the mask
    :param stamp_s: time [s since 1970-01-01 UTC]
    :param frame_id: frame of the mask
    """
    return kind(
        header=Header(stamp=to_time(stamp_s), frame_id=frame_id),
        type=KEEPOUT_TYPE,
        filter_mask_topic=mask_topic,
        base=0.0,
        multiplier=1.0,
    )
