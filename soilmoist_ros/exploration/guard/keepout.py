# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fence as a raster: where a costmap keeps the robot's centre out, whatever route the navigation plans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.foundation import InputError, PlaneMove

MAX_CELLS: Final = 4_000_000
"""Cells of a mask beyond which its resolution counts as a mistake."""
RIM_M: Final = 5.0
"""Width of the rim around the fence that is kept out, because a costmap is free where there is no mask [m]."""
FREE, KEPT_OUT = 0, 100
_HERE = PlaneMove()


@dataclass(frozen=True, eq=False)
class KeepoutMask:
    """Square cells, as an occupancy grid has them.

    :param values: :data:`FREE` or :data:`KEPT_OUT`, shape (rows, columns); rows run along y, columns along x
    :param resolution_m: side of a cell [m]
    :param origin_m: corner of the first cell where x and y are lowest [m]
    """

    values: NDArray[np.int8]
    resolution_m: float
    origin_m: tuple[float, float]


def keepout_mask(fence: Fence, resolution_m: float, move: PlaneMove = _HERE) -> KeepoutMask:
    """Mask of all places that the fence does not allow.

    A cell that touches the fence is free, so that no allowed route is blocked. Free cells reach up to one diagonal
    of a cell beyond the fence: with a resolution of half the robot's radius they stay out of the no-go areas.

    :param fence: where the robot's centre may be; its margin is in the mask, as filters of a costmap inflate none
    :param resolution_m: side of a cell [m], > 0
    :param move: from the plane of the field to that of the mask, whose rows and columns follow its axes
    :raises InputError: if the mask would have more than :data:`MAX_CELLS` cells
    """
    import shapely

    if not (math.isfinite(resolution_m) and resolution_m > 0):
        raise ValueError(f"resolution_m must be > 0 and finite, got {resolution_m}")
    shape = shapely.transform(fence.area.shape, move.places)
    low = np.floor((np.array(shape.bounds[:2]) - RIM_M) / resolution_m)
    size = np.ceil((np.array(shape.bounds[2:]) + RIM_M) / resolution_m) - low
    if size.prod() > MAX_CELLS:
        raise InputError(
            f"a mask of {resolution_m:g} m has {size.prod():.2g} cells (at most {MAX_CELLS:,})",
            "set a larger keepout_resolution_m",
        )
    x, y = ((low[axis] + 0.5 + np.arange(int(size[axis]))) * resolution_m for axis in (0, 1))
    touched = shape.buffer(resolution_m * math.sqrt(0.5))
    shapely.prepare(touched)
    free = shapely.contains_xy(touched, x[None, :], y[:, None])
    origin_x, origin_y = (low * resolution_m).tolist()
    values = np.where(free, FREE, KEPT_OUT).astype(np.int8)
    return KeepoutMask(values, resolution_m, (origin_x, origin_y))
