# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Management zones of a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import InputError
from soilmoist_ros.reporting.certainty import Certainty, certainty
from soilmoist_ros.reporting.dose import DoseSettings, find_dose
from soilmoist_ros.reporting.exports.source import ExportedProperty
from soilmoist_ros.reporting.workable import SHARE_OF_FIELD, places_in, swaths, zones_of_blocks

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]


def zone_limits(values: ArrayLike, classes: int) -> Array:
    """Limits between classes of equal area, shape (classes - 1,), fewer where values repeat.

    :param values: any shape, one value for each cell; NaN is ignored
    """
    finite: Array = np.asarray(values, float)
    finite = finite[np.isfinite(finite)]
    edges = np.unique(np.quantile(finite, np.arange(1, classes) / classes)) if finite.size else finite
    return edges[(edges > finite.min()) & (edges < finite.max())] if finite.size else edges


@dataclass(frozen=True, eq=False)
class Zone:
    """A connected area of one class.

    :param shape: polygon in the plane of the field [m]
    :param number: number of its class, from 1 for the lowest values
    :param mean: mean of its cells in the unit for readers, with their mean standard deviation ``sd``
    :param other: share of its cells that the map puts into another class [0..1]: small parts that joined it
    :param missing: water missing to field capacity, its quantiles 0.05 and 0.95 [mm]; NaN without a root zone
    """

    shape: BaseGeometry
    number: int
    mean: float
    sd: float
    certainty: Certainty
    other: float
    missing: tuple[float, float, float]

    @property
    def area_ha(self) -> float:
        """Area of the zone [ha]."""
        return float(self.shape.area) / 1e4

    def water_mm(self, root_depth_mm: float, shift: float = 0.0) -> float:
        """Water above a depth if the moisture is given in % by volume, and on average differs from it by a shift
        [m^3/m^3] at all depths [mm].
        """
        return (self.mean / 100 + shift) * root_depth_mm


def management_zones(
    the_map: ExportedProperty,
    boundary: BaseGeometry,
    classes: int = 3,
    min_area_m2: float | None = None,
    limits: Sequence[float] | None = None,
    zone: DoseSettings | None = None,
) -> list[Zone]:
    """Zones of a map, from low to high classes. They do not overlap, and together they are the field.

    Blocks of the map get the class of their mean, see :func:`zones_of_blocks`; means are those of the map itself.

    :param boundary: the field in its plane [m]
    :param classes: number of classes of equal area, where no limits are given
    :param min_area_m2: minimum area of a part that is a zone [m^2]; by default 5 % of the field
    :param limits: limits between the classes in the unit for readers
    :param zone: root zone, to whose field capacity water is missing; where its limits are those of the classes,
        their errors count in the certainty
    :raises InputError: for a number of classes, an area or limits out of range, or an old shapely
    """
    if not 1 <= classes <= 20:
        raise InputError(f"{classes} zones are not possible", "choose from 1 to 20")
    smallest_m2 = SHARE_OF_FIELD * boundary.area if min_area_m2 is None else min_area_m2
    if not smallest_m2 >= 0:
        raise InputError(f"{smallest_m2} m2 is no area", "choose one from 0")
    edges = zone_limits(the_map.values, classes) if limits is None else np.asarray(limits, float)
    of_plants = zone is not None and limits is not None and np.allclose(edges, 100 * np.array(zone.limits[0]))
    shown = edges - 100 * zone.shift if of_plants and zone is not None else edges
    if (np.diff(edges) <= 0).any():
        raise InputError(f"the limits of zones {list(edges)} do not rise", "give them in rising order")
    values, xy = the_map.values[the_map.cells[0]], the_map.cells[1]

    def classes_of(mean: Array) -> NDArray[np.intp]:
        return np.asarray(np.searchsorted(shown, mean, side="right") + 1, np.intp)

    direction_deg = None if zone is None else zone.direction_deg
    of_machine = swaths(boundary, smallest_m2 / 16, the_map.cell_m / 2, None, direction_deg)  # finer than a dose
    shapes, number = zones_of_blocks([values], classes_of, xy, the_map.cell_m, boundary, of_machine, smallest_m2)
    of_map = classes_of(values)
    limiting = zone if of_plants else None
    probability = {
        one: the_map.probability(one - 1, edges, limits is None, limiting)[the_map.cells[0]]
        for one in set(number.tolist())
    }
    return _described(the_map, shapes, number, of_map, probability, zone)


def _described(
    the_map: ExportedProperty, shapes: Sequence[BaseGeometry], number: NDArray[np.intp],
    of_map: NDArray[np.intp], probability: Mapping[int, Array], zone: DoseSettings | None,
) -> list[Zone]:  # fmt: skip
    """Zones with the figures of their cells, of which the map knows the class ``of_map``."""
    inside, xy = the_map.cells
    values, sd = the_map.values[inside], the_map.sd[inside]
    below = [np.full(len(xy), np.nan)] * 3
    if zone is not None and the_map.curve is not None:
        capacity = zone.model_copy(update={"target": None, "target_share": 1.0})
        need = find_dose(the_map.bands["rate"][inside], the_map.bands["rate_sd"][inside], the_map.curve, capacity)
        below = [need.net_mm, need.p05_mm, need.p95_mm]
    zones = []
    for shape, one in zip(shapes, number.tolist(), strict=True):
        own = places_in(shape, xy)
        known = own[np.isfinite(values[own])]
        mean, spread, *missing = (
            float(band[known].mean()) if known.size else np.nan for band in (values, sd, *below)
        )
        other = float((of_map[known] != one).mean()) if known.size else np.nan
        sure = certainty(probability[one][own])
        zones.append(Zone(shape, one, mean, spread, sure, other, (missing[0], missing[1], missing[2])))
    return sorted(zones, key=lambda zone: (zone.number, -zone.area_ha))
