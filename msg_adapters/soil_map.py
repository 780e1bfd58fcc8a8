# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""``soil_map``: organised PointCloud2; ``uncertainty`` and the keep-out mask: OccupancyGrid.

All have the rows and columns of the field's grid: rows from south to north, columns from west to east.
"""

from __future__ import annotations

from array import array
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from nav_msgs.msg import MapMetaData, OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from msg_adapters.point_cloud import FRAME, points_from_message, points_to_message, to_time
from soilmoist_ros.exploration import KeepoutMask
from soilmoist_ros.mapping import CELL, FieldGrid, SoilMap, map_cells

OUTSIDE: Final = -1  # uncertainty of a cell outside the field
KEEPOUT_TYPE: Final = 0  # number of the keep-out filter among the filters of Nav2


def soil_map_to_message(
    grid: FieldGrid, soil_map: SoilMap | None, stamp_s: float, frame_id: str = FRAME
) -> PointCloud2:
    """Message of a map, rounded to 32 bits for viewers; NaN before the first map."""
    return points_to_message(map_cells(grid, soil_map), stamp_s, frame_id)


def soil_map_from_message(message: PointCloud2) -> NDArray[Any]:
    """Cells of a message: array of :data:`CELL`, shape (rows, columns), NaN outside the field.

    :raises ValueError: if a field is missing
    """
    return points_from_message(message, CELL)


def uncertainty_to_message(
    grid: FieldGrid, soil_map: SoilMap | None, stamp_s: float, frame_id: str = FRAME
) -> OccupancyGrid:
    """Message of the standard deviation of the rate, in percent of the value without samples nearby.

    0 is exact, 100 is the value without samples or more, -1 is outside the field.
    """
    share = np.ones(grid.shape)
    if soil_map is not None:
        unknown = soil_map.unknown_rate_sd
        share = soil_map.rate_sd / unknown if unknown > 0 else np.zeros(grid.shape)
    values = np.full(grid.shape, OUTSIDE, np.int8)
    values[grid.mask] = np.rint(100 * np.minimum(share[grid.mask], 1.0))
    corner = float(grid.x_m[0] - grid.cell_m / 2), float(grid.y_m[0] - grid.cell_m / 2)
    return _occupancy(values, grid.cell_m, corner, stamp_s, frame_id)


def _occupancy(
    values: NDArray[np.int8], cell_m: float, corner: tuple[float, float], stamp_s: float, frame_id: str
) -> OccupancyGrid:
    rows, columns = values.shape
    stamp = to_time(stamp_s)
    place = Point(x=float(corner[0]), y=float(corner[1]), z=0.0)
    return OccupancyGrid(
        header=Header(stamp=stamp, frame_id=frame_id),
        info=MapMetaData(
            map_load_time=stamp,
            resolution=float(cell_m),
            width=int(columns),
            height=int(rows),
            origin=Pose(position=place, orientation=Quaternion(w=1.0)),
        ),
        data=array("b", values.tobytes()),
    )


# ``OccupancyGrid`` and ``CostmapFilterInfo`` of a keep-out mask, as Nav2's keep-out filter reads them -----------


def mask_to_message(mask: KeepoutMask, stamp_s: float, frame_id: str) -> OccupancyGrid:
    """Message of a mask: 0 is free, 100 is kept out."""
    return _occupancy(mask.values, mask.resolution_m, mask.origin_m, stamp_s, frame_id)


def filter_info(kind: Any, mask_topic: str, stamp_s: float, frame_id: str) -> Any:
    """Message that names a mask to a costmap filter: values of the mask are costs in percent."""
    return kind(
        header=Header(stamp=to_time(stamp_s), frame_id=frame_id),
        type=KEEPOUT_TYPE,
        filter_mask_topic=mask_topic,
        base=0.0,
        multiplier=1.0,
    )
