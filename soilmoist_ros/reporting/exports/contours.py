# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Contour lines of a map at round values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.reporting.exports.classes import levels
from soilmoist_ros.reporting.exports.source import PropertyMap

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]

PAD = 2
"""Cells by which a map is continued beyond the field, so that lines reach its boundary."""
MIN_CELLS = 2.0
"""Length below which a line is left out [cells]."""


def continued(values: Array) -> Array:
    """A raster with a margin of :data:`PAD` cells; cells without a value have that of the nearest one."""
    from scipy.ndimage import distance_transform_edt

    wide = np.pad(values, PAD, constant_values=np.nan)
    nearest = distance_transform_edt(np.isnan(wide), return_distances=False, return_indices=True)
    return np.asarray(wide[tuple(nearest)], float)


def level_lines(the_map: PropertyMap, raster: Array, level: float) -> list[BaseGeometry]:
    """Lines on which a continued raster has a value, in the plane of the field [m], beyond its boundary too.

    :param raster: as :func:`continued` returns it
    """
    from contourpy import contour_generator
    from shapely.geometry import LineString

    found = contour_generator(z=raster).lines(level)
    places = [the_map.to_local(np.asarray(line, float) - PAD) for line in found]
    return [LineString(line) for line in places if len(np.unique(line, axis=0)) > 1]


def contour_lines(
    the_map: PropertyMap, boundary: BaseGeometry, step: float | None = None
) -> tuple[list[BaseGeometry], Array]:
    """Contour lines inside the field, and the value of each in the unit for readers.

    Lines lie between the centres of cells by linear interpolation. At the boundary the map goes on with its
    nearest values.

    :param the_map: the map
    :param boundary: the field in its plane
    :param step: distance of the values; by default a round one
    :raises InputError: if the step is far too small
    """
    from shapely import line_merge

    raster = continued(the_map.values)
    lines: list[BaseGeometry] = []
    values: list[float] = []
    for level in levels(the_map.values, step):
        for line in level_lines(the_map, raster, float(level)):
            inside = line_merge(line.intersection(boundary))
            for part in getattr(inside, "geoms", [inside]):
                if part.geom_type == "LineString" and part.length >= MIN_CELLS * the_map.cell_m:
                    lines.append(part)
                    values.append(float(level))
    return lines, np.array(values)
