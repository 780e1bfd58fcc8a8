# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Management zones of a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.certainty import Certainty, certainty, class_probability
from soilmoist_ros.reporting.exports.source import ExportedProperty
from soilmoist_ros.reporting.workable import SHARE_OF_FIELD, places_in, swaths, zones_of_blocks

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Zone:
    """A connected area of one class.

    :param shape: polygon in the plane of the field [m]
    :param number: number of its class, from 1 for the lowest values
    :param mean: mean of its cells in the unit for readers, with their mean standard deviation ``sd``
    :param certainty: certainty of its class, with errors of the values that are normal
    :param other: share of its cells that the map puts into another class [0..1]: small parts that joined it
    """

    shape: BaseGeometry
    number: int
    mean: float
    sd: float
    certainty: Certainty
    other: float

    @property
    def area_ha(self) -> float:
        """Area of the zone [ha]."""
        return float(self.shape.area) / 1e4


def thirds(values: ArrayLike) -> Array:
    """Limits between three classes of equal area, fewer where values repeat; NaN is ignored."""
    finite: Array = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    edges = np.unique(np.quantile(finite, (1 / 3, 2 / 3)))
    return np.asarray(edges[(edges > finite.min()) & (edges < finite.max())])


def management_zones(
    the_map: ExportedProperty,
    boundary: BaseGeometry,
    limits: ArrayLike,
    min_area_m2: float | None = None,
    direction_deg: float | None = None,
) -> list[Zone]:
    """Zones of a map, from low to high classes. They do not overlap, and together they are the field.

    Blocks of the map get the class of their mean, see :func:`zones_of_blocks`; means are those of the map itself.

    :param boundary: the field in its plane [m]
    :param limits: rising limits between the classes in the unit for readers, shape (k,)
    :param min_area_m2: minimum area of a part that is a zone [m^2]; by default 5 % of the field
    :param direction_deg: driving direction of the machine from north; by default along the field
    :raises InputError: for an area out of range, or an old shapely
    """
    smallest_m2 = SHARE_OF_FIELD * boundary.area if min_area_m2 is None else min_area_m2
    if not smallest_m2 >= 0:
        raise InputError(f"{smallest_m2} m2 is no area", "choose one from 0")
    edges: Array = np.asarray(limits, float)
    inside, xy = the_map.cells
    values, sd = the_map.values[inside], the_map.sd[inside]

    def classes_of(mean: Array) -> NDArray[np.intp]:
        return np.asarray(np.searchsorted(edges, mean, side="right") + 1, np.intp)

    of_machine = swaths(boundary, smallest_m2 / 16, the_map.cell_m / 2, None, direction_deg)  # finer than a dose
    shapes, number = zones_of_blocks([values], classes_of, xy, the_map.cell_m, boundary, of_machine, smallest_m2)
    of_map, zones = classes_of(values), []
    for shape, one in zip(shapes, number.tolist(), strict=True):
        own = places_in(shape, xy)
        sure = certainty(class_probability(values[own], sd[own], one - 1, edges, None, relative=True))
        known = own[np.isfinite(values[own])]
        figures = (values[known], sd[known], of_map[known] != one)
        mean, spread, other = (float(figure.mean()) if known.size else np.nan for figure in figures)
        zones.append(Zone(shape, one, mean, spread, sure, other))
    return sorted(zones, key=lambda zone: (zone.number, -zone.area_ha))
