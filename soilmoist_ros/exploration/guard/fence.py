# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The fence: the field without its no-go areas. Every stop, edge, goal and route is validated by it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import TOLERANCE_M, DrivableArea
from soilmoist_ros.foundation import InputError, PlaneMove, listing
from soilmoist_ros.mapping import Field

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROBOT_RADIUS_M = 0.75  # half the width of Thorvald [m]
CORRIDOR_M = 1.0  # half width of the ways outside the field [m]
_ROUNDING_M = 1e-3
_STEP_M = 0.5  # step along a route at which its distance from the allowed area is measured [m]
_ENTRIES = 20  # as many of the nearest places are judged for a robot that stands outside
_LEAVING = 2.0  # a robot leaves a no-go area and its margin on a way of at most this multiple of the shortest one
_NOISE_M = 0.1  # a robot that seems to be less deep in a no-go area than this stands at the edge [m]
_STUCK_M = 0.5  # a place that seems to be this deep in a no-go area may be an error of the receiver [m]


class Fence:
    """Region in which the robot's centre may be: in the field, and not in a no-go area.

    :param field: outline and no-go areas
    :param margin_m: distance to keep from the border and the no-go areas, such as the robot's radius [m], >= 0
    :param beyond_m: the border lies this far outside the field's outline, and keeps no margin [m], >= 0. The
        margin of no-go areas stays. For nodes that the farm has surveyed close to the border
    :param corridors: straight lines outside the field that may be driven, shape (k, 2, 2) [m]
    :raises InputError: if no place is left
    """

    def __init__(
        self, field: Field, margin_m: float = 0.0, beyond_m: float = 0.0, corridors: ArrayLike = ()
    ) -> None:
        import shapely

        self.field = field
        self.margin_m = margin_m
        self.beyond_m = beyond_m
        self.corridors = np.asarray(corridors, float).reshape(-1, 2, 2)
        self._no_go_areas = [shapely.Polygon(ring) for ring in field.no_go]
        self._no_go = [area.buffer(margin_m, join_style="mitre") for area in self._no_go_areas]
        self._closed = shapely.union_all(self._no_go)
        self._border = DrivableArea((field.polygon,), (), margin_m, beyond_m)
        self.area = DrivableArea((field.polygon,), field.no_go, margin_m, beyond_m)
        if self.area.shape.is_empty:
            raise InputError(
                f"no place of the field {field.name!r} is {margin_m:g} m away from its border and no-go areas",
                "check the field's corners and no-go areas, or set a smaller robot_radius_m",
            )
        if len(self.corridors):
            lines = shapely.union_all(shapely.linestrings(self.corridors)).buffer(CORRIDOR_M)
            driven = lines.difference(self._closed)
            self.area, self._border = self.area.joined(driven), self._border.joined(driven)

    def divided(self) -> str:
        """Parts of the field between which a robot with the margin cannot drive, in words; empty if whole."""
        import shapely

        parts = [part for part in shapely.get_parts(self.area.shape) if part.area >= Field.MIN_AREA_M2]
        if len(parts) < 2:
            return ""
        said = []
        for part in sorted(parts, key=lambda part: -part.area):
            size = f"{part.area / 1e4:.2f} ha" if part.area >= 1000 else f"{part.area:.0f} m2"
            inside = part.representative_point()
            said.append(f"{size} about ({inside.x:.0f}, {inside.y:.0f})")
        margin = f" by a robot that keeps {self.margin_m:g} m distance" if self.margin_m > 0 else ""
        return (
            f"border and no-go areas divide the field into {len(parts)} parts that cannot be reached from each "
            f"other{margin} ({listing(said)}): only the part where the robot stands is surveyed"
        )

    def avoids_no_go(self, start_xy: ArrayLike, end_xy: ArrayLike) -> Flags:
        """True for each straight line that stays out of the no-go areas, in the field or not, shape (k,)."""
        import shapely

        start, end = np.asarray(start_xy, float).reshape(-1, 2), np.asarray(end_xy, float).reshape(-1, 2)
        entered = self._closed.buffer(-TOLERANCE_M, join_style="mitre")
        shapely.prepare(entered)
        lines = shapely.linestrings(np.stack([start, end], axis=1))
        return ~np.asarray(shapely.intersects(entered, lines), bool)

    def contains(self, xy: ArrayLike) -> Flags:
        """True for each place that is inside, shape (k,); a place that is not finite is not."""
        return self.area.contains(xy)

    def allows(self, polyline: ArrayLike) -> bool:
        """True if a whole route stays inside."""
        corners = np.asarray(polyline, float).reshape(-1, 2)
        if not len(corners) or not np.isfinite(corners).all():
            return False
        return bool(self.area.contains(corners).all() and self.area.allows(corners[:-1], corners[1:]).all())

    def outside_m(self, place: ArrayLike) -> float:
        """Distance of a place outside the field, or into a no-go area [m]: 0 inside and in the margin.

        Inf for a place that is not finite.
        """
        import shapely

        xy = np.asarray(place, float)
        if not np.isfinite(xy).all():
            return float("inf")
        away_m = float(self.area.shape.distance(shapely.Point(xy))) - self.margin_m
        return max(0.0, round(away_m, 3))  # errors of rounding make nobody stand outside

    def beyond_border_m(self, place: tuple[float, float]) -> float:
        """Distance of a place beyond the border of the field [m]: 0 inside, in the margin and in no-go areas."""
        import shapely

        return max(0.0, round(float(self._border.shape.distance(shapely.Point(place))) - self.margin_m, 3))

    def in_no_go_m(self, place: tuple[float, float]) -> float:
        """Depth of a place in a no-go area, the margin included [m]; 0 outside all of them."""
        import shapely

        here = shapely.Point(place)
        return round(float(self._closed.boundary.distance(here)), 3) if self._closed.contains(here) else 0.0

    @property
    def leaving_m(self) -> float:
        """Largest depth in a no-go area, the margin included, from which a robot is sent out of it [m]."""
        return self.margin_m + max(self.margin_m, _STUCK_M)

    def refusal(self, polyline: ArrayLike) -> str:
        """Reason why a route or place is not allowed: what it enters or leaves, where, how far; empty if it is."""
        import shapely

        corners = np.asarray(polyline, float).reshape(-1, 2)
        if self.allows(corners):
            return ""
        if not len(corners) or not np.isfinite(corners).all():
            return "it has no place, or one that is not finite"
        is_place = bool((corners == corners[0]).all())
        line = shapely.Point(corners[0]) if is_place else shapely.LineString(corners)
        for number, area in enumerate(self._no_go, 1):
            entered = line.intersection(area)
            if not entered.is_empty and self._depth_m(entered) > 0:
                what = f"is in no-go area {number}" if is_place else f"enters no-go area {number}"
                return self._text(what, line, entered, "deep")
        left = line.difference(self._border.shape)
        what = "is outside the field" if is_place else "leaves the field"
        return self._text(what, line, left if not left.is_empty else line, "outside")

    def may_enter(self, place: ArrayLike, xy: ArrayLike, entry_m: float) -> Flags:
        """Flags of places to which a robot may drive straight; from outside only for the nearest, shape (k,)."""
        here, there = np.asarray(place, float), np.asarray(xy, float).reshape(-1, 2)
        if self.contains(here)[0]:
            return np.asarray(self.area.allows(here, there), bool)
        found = np.zeros(len(there), bool)
        for number in np.argsort(np.hypot(*(there - here).T))[:_ENTRIES].tolist():
            found[number] = not self.refusal_of_entry(here, there[number], entry_m)
        return found

    def refusal_of_entry(self, place: ArrayLike, first: ArrayLike, entry_m: float) -> str:
        """As :meth:`refusal`, for the straight line on which a robot outside drives back in.

        A robot in the margin of a no-go area comes no closer to the area. One in the area, at its edge, leaves it
        outwards by about the shortest way. One that is deeper in it than the margin, and than half a metre, does
        not move: it is not where its fix says, or it is stuck.

        :param first: where it drives to, shape (2,) [m]
        :param entry_m: the line may be outside this close to the robot [m]; no-go areas are not entered
        """
        import shapely

        line = np.array([place, first], float)
        if self.contains(line[0])[0] or not np.isfinite(line).all():
            return self.refusal(line)
        outside_m = self.outside_m(line[0])
        if outside_m > entry_m:
            return f"the robot stands {outside_m:.1f} m outside, more than {entry_m:g} m: {self.refusal(line[:1])}"
        driven = shapely.LineString(line)
        outside = driven.difference(self.area.shape.buffer(TOLERANCE_M))
        far_m = np.hypot(*(shapely.get_coordinates(outside) - line[0]).T).max(initial=0.0)
        too_far = far_m > entry_m + self.margin_m + _ROUNDING_M
        return self.refusal(line) if too_far else self._refusal_to_leave(line)

    def _refusal_to_leave(self, line: Array) -> str:
        """Reason why a straight line that begins in no-go areas, or in their margin, does not lead out of them."""
        import shapely

        here, driven = shapely.Point(line[0]), shapely.LineString(line)
        for number, (area, wide) in enumerate(zip(self._no_go_areas, self._no_go, strict=True), 1):
            if not driven.intersects(wide):
                continue
            deep_m = area.boundary.distance(here) if area.contains(here) else 0.0
            if deep_m > max(self.margin_m, _STUCK_M) + TOLERANCE_M:
                return f"the robot stands {deep_m:.1f} m deep in no-go area {number}"
            out_m = wide.boundary.distance(here) if wide.contains(here) else 0.0  # holes have borders too
            deeper = wide.buffer(-out_m - TOLERANCE_M, join_style="mitre")
            far = deep_m > _NOISE_M and driven.intersection(wide).length > _LEAVING * out_m + TOLERANCE_M
            if far or driven.intersects(deeper):
                return self.refusal(line)
        return ""

    def _text(self, what: str, line: BaseGeometry, part: BaseGeometry, how: str) -> str:
        import shapely

        at = shapely.get_coordinates(part)
        first = at[0]
        if line.geom_type == "LineString":
            first = at[np.argmin(shapely.line_locate_point(line, shapely.points(at)))]
        margin = f" with {self.margin_m:g} m margin" if self.margin_m > 0 else ""
        return f"it {what} at ({first[0]:.1f}, {first[1]:.1f}), {self._depth_m(part):.1f} m {how}{margin}"

    def _depth_m(self, part: BaseGeometry) -> float:
        """Largest distance of a part of a route from the allowed area [m]."""
        import shapely

        places = shapely.points(shapely.get_coordinates(shapely.segmentize(part, _STEP_M)))
        return float(np.max(shapely.distance(self.area.shape, places), initial=0.0))


def unreachable(field: Field, margin_m: float) -> str:
    """Parts of a field that a robot cannot reach from each other, or all of it, in words; empty if it reaches all.

    A fault for a robot alone: a person may go there.

    :param margin_m: distance to keep from the border and the no-go areas [m]
    """
    try:
        return Fence(field, margin_m).divided()
    except InputError as error:
        return str(error)


# The fence as a raster: where a costmap keeps the robot's centre out, whatever route the navigation plans -------

MAX_CELLS: Final = 4_000_000  # a mask has no more cells, however large the field is
RIM_M: Final = 5.0
"""Width of the rim around the fence that is kept out, because a costmap is free where there is no mask [m]."""
FREE, KEPT_OUT = 0, 100
_HERE = PlaneMove()


@dataclass(frozen=True, eq=False)
class KeepoutMask:
    """Square cells, as an occupancy grid has them."""

    values: NDArray[np.int8]  # FREE or KEPT_OUT, shape (rows, columns); rows run along y, columns along x
    resolution_m: float  # side of a cell [m]
    origin_m: tuple[float, float]  # corner of the first cell where x and y are lowest [m]


def keepout_mask(fence: Fence, resolution_m: float, move: PlaneMove = _HERE) -> KeepoutMask:
    """Mask of all places that the fence does not allow.

    A cell that touches the fence is free, so that no allowed route is blocked. Free cells reach up to one diagonal
    of a cell beyond the fence: with a resolution of half the robot's radius they stay out of the no-go areas.

    :param fence: where the robot's centre may be; its margin is in the mask, as filters of a costmap inflate none
    :param resolution_m: side of a cell [m], > 0; larger ones are taken if there would be too many
    :param move: from the plane of the field to that of the mask, whose rows and columns follow its axes
    """
    import shapely

    if not (math.isfinite(resolution_m) and resolution_m > 0):
        raise ValueError(f"resolution_m must be > 0 and finite, got {resolution_m}")
    shape = shapely.transform(fence.area.shape, move.places)
    extent_m = np.subtract(shape.bounds[2:], shape.bounds[:2]) + 2 * RIM_M
    resolution_m = max(resolution_m, 1.01 * math.sqrt(extent_m.prod() / MAX_CELLS))
    low = np.floor((np.array(shape.bounds[:2]) - RIM_M) / resolution_m)
    size = np.ceil((np.array(shape.bounds[2:]) + RIM_M) / resolution_m) - low
    x, y = ((low[axis] + 0.5 + np.arange(int(size[axis]))) * resolution_m for axis in (0, 1))
    touched = shape.buffer(resolution_m * math.sqrt(0.5))
    shapely.prepare(touched)
    free = shapely.contains_xy(touched, x[None, :], y[:, None])
    origin_x, origin_y = (low * resolution_m).tolist()
    values = np.where(free, FREE, KEPT_OUT).astype(np.int8)
    return KeepoutMask(values, resolution_m, (origin_x, origin_y))
