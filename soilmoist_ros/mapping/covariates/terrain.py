# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What elevations say about water: slope, aspect, curvature and the topographic wetness index.

Rasters have square cells, rows from south to north, and NaN where nothing is known. A neighbour without a value is
extrapolated from the opposite one, so that a plane has its slope up to its edge.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Offset = tuple[int, int]

NEIGHBOURS: tuple[Offset, ...] = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""Steps to the eight neighbours: rows to the north, columns to the east."""
MIN_SLOPE = 0.001
"""Slope below which the wetness index takes the ground as level [m/m]."""
FLAT_STEP = 1e-5
"""Slope given to filled pits and flats, towards their outlet [m/m]."""


def derivatives(elevation_m: Array, step_m: float) -> dict[str, Array]:
    """Everything that is derived from elevations, by its name.

    * slope: tangent of the steepest slope [m/m], by the third-order finite differences of Horn (1981)
    * northness, eastness: components of the unit normal of the surface, > 0 where it faces north or east [-]
    * curvature: minus twice (D + E) of Zevenbergen and Thorne (1987) [1/m], > 0 on crests, < 0 in hollows
    * wetness: topographic wetness index ln(a / tan b) of Beven and Kirkby (1979) [ln m], see :func:`wetness`

    :param elevation_m: elevations, shape (ny, nx) [m]
    :param step_m: distance between neighbours, > 0 [m]
    """
    around = _around(elevation_m)
    # Horn, Proc. IEEE 69:14-47: weights 1, 2, 1
    east = (around[1, 1] + 2 * around[0, 1] + around[-1, 1]) - (around[1, -1] + 2 * around[0, -1] + around[-1, -1])
    north = (around[1, 1] + 2 * around[1, 0] + around[1, -1]) - (
        around[-1, 1] + 2 * around[-1, 0] + around[-1, -1]
    )
    east, north = east / (8 * step_m), north / (8 * step_m)
    slope = np.hypot(east, north)
    length = np.sqrt(1 + slope**2)
    laplacian = (around[0, 1] + around[0, -1] + around[1, 0] + around[-1, 0] - 4 * elevation_m) / step_m**2
    return {
        "elevation": elevation_m,
        "slope": slope,
        "northness": -north / length,
        "eastness": -east / length,
        "curvature": -laplacian,
        "wetness": wetness(elevation_m, slope, step_m),
    }


def _around(values: Array) -> Mapping[Offset, Array]:
    """The eight neighbours of every cell; a missing one is extrapolated from the others, or the cell itself."""
    near = {offset: _shifted(values, offset) for offset in NEIGHBOURS}
    found = {}
    for row, column in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        there = np.where(np.isnan(near[row, column]), 2 * values - near[-row, -column], near[row, column])
        found[row, column] = np.where(np.isnan(there), values, there)
    for row, column in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        there = found[row, 0] + found[0, column] - values
        found[row, column] = np.where(np.isnan(near[row, column]), there, near[row, column])
    return found


def _shifted(values: Array, offset: Offset, outside: float = np.nan) -> Array:
    """The value of the neighbour at an offset, for every cell."""
    padded = np.pad(values, 1, constant_values=outside)
    row, column = offset
    rows, columns = values.shape
    return padded[1 + row : 1 + row + rows, 1 + column : 1 + column + columns]


def wetness(elevation_m: Array, slope: Array, step_m: float) -> Array:
    """Topographic wetness index ln(a / tan b), a the upslope area per metre of contour [m], b the slope.

    :param slope: tangent of the slope, shape (ny, nx); at least :data:`MIN_SLOPE` is taken
    """
    area = upslope_area(filled_pits(elevation_m, step_m), step_m)
    return np.log(area / step_m / np.maximum(slope, MIN_SLOPE))


def filled_pits(elevation_m: Array, step_m: float) -> Array:
    """Elevations from which water runs off everywhere.

    The priority-flood algorithm with small slopes, Barnes, Lehman and Mulla (2014), Computers & Geosciences
    62:117-127. Water leaves at the edge of what is known.
    """
    filled = elevation_m.copy()
    known = np.isfinite(filled)
    edge = known & ~np.all([_shifted(known, offset, False) for offset in NEIGHBOURS], axis=0)
    done = ~known | edge
    queue = [(float(filled[row, column]), row, column) for row, column in np.argwhere(edge).tolist()]
    heapq.heapify(queue)
    rise = {offset: FLAT_STEP * step_m * float(np.hypot(*offset)) for offset in NEIGHBOURS}
    rows, columns = filled.shape
    while queue:
        level, row, column = heapq.heappop(queue)
        for (up, right), least in rise.items():
            next_row, next_column = row + up, column + right
            if 0 <= next_row < rows and 0 <= next_column < columns and not done[next_row, next_column]:
                done[next_row, next_column] = True
                height = max(float(filled[next_row, next_column]), level + least)
                filled[next_row, next_column] = height
                heapq.heappush(queue, (height, next_row, next_column))
    return filled


def upslope_area(filled_m: Array, step_m: float) -> Array:
    """Area that drains through each cell, its own included, shape (ny, nx) [m^2].

    Water is shared by all lower neighbours in proportion to slope and contour length: Quinn, Beven, Chevallier and
    Planchon (1991), Hydrological Processes 5:59-79.

    :param filled_m: elevations without pits, shape (ny, nx) [m]
    """
    from scipy.sparse import csr_array, eye_array
    from scipy.sparse.linalg import spsolve_triangular

    known = np.isfinite(filled_m)
    count = int(np.count_nonzero(known))
    height = filled_m[known]
    # Every cell gets its place in the order from high to low, so that water only flows to later cells.
    place = np.full(filled_m.shape, -1)
    place[known] = np.argsort(np.argsort(-height, kind="stable"), kind="stable")
    share, receiver = [], []
    for offset in NEIGHBOURS:
        diagonal = 0 not in offset
        drop = filled_m - _shifted(filled_m, offset)
        # contour length 0.5 or 0.354 of a cell, distance 1 or 1.414 cells
        weight = np.where(drop > 0, drop * (0.25 if diagonal else 0.5), 0.0)
        share.append(weight[known])
        receiver.append(_shifted(place.astype(float), offset, -1.0)[known].astype(int))
    shares, receivers = np.array(share), np.array(receiver)
    total = shares.sum(axis=0)
    shares = np.divide(shares, total, out=np.zeros_like(shares), where=total > 0)
    donors = np.broadcast_to(place[known], shares.shape)
    flows = shares > 0
    inflow = csr_array((shares[flows], (receivers[flows], donors[flows])), shape=(count, count))
    area = spsolve_triangular((eye_array(count) - inflow).tocsr(), np.full(count, step_m**2), lower=True)
    found = np.full(filled_m.shape, np.nan)
    found[known] = np.asarray(area)[place[known]]
    return found
