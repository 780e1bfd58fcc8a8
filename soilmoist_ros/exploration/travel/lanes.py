# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lanes: tracks and roads of a file as a travel graph, and routes of a car, which cannot turn around on them."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.route_graph import geojson_features, is_route_graph, read_route_graph
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.topological_map import (
    TopologicalMap,
    make_topological_map,
    read_topological_map,
)
from soilmoist_ros.exploration.travel.travel import GraphTravel
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import BorderSource, Field

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LINE_FILES: Final = (".geojson", ".gpx", ".kml", ".kmz", ".shp", ".gpkg", ".fgb", ".zip")
"""Files that are read as lines; all others are topological maps."""
JOIN_M: Final = 2.0
"""An end of a line this near to another line is on it [m]: people draw tracks by hand."""
STRAIGHT_M: Final = 0.5  # corners nearer to a straight line than this are left out [m]
MIN_SPACING_M: Final = 5.0  # least distance of nodes on a straight lane [m]
MAX_STOPS: Final = 300  # nodes are further apart where more would be in the field
AROUND_M: Final = 1000.0  # lanes farther from the field than this are left out [m]
HEADING_M: Final = 10.0
"""Distance that shows the direction of travel [m]: more than fixes wander while a car stands."""
_log = logging.getLogger(__name__)
BACK_M: Final = 5.0  # a stop this near behind needs no way around [m]


def read_travel_map(path: Path, field: Field) -> TopologicalMap:
    """Read a map to travel on: a topological map, a graph of Nav2, or lines in a file of :data:`LINE_FILES`.

    :raises InputError: if it cannot be read, or no line lies in the field
    """
    if path.suffix.lower() not in LINE_FILES:
        return read_topological_map(path)
    frame = "map"
    features = geojson_features(path) if path.suffix.lower() == ".geojson" else []
    if is_route_graph(features):
        graph, frame, unused = read_route_graph(path, features)
        if unused:
            _log.warning(unused)
    else:
        graph = read_lanes(path, field)
    found = make_topological_map(graph, path.stem, datetime.fromtimestamp(path.stat().st_mtime, UTC))
    return replace(found, frame=frame)


def read_lanes(path: Path, field: Field) -> TravelGraph:
    """Travel graph of the lines in a file, in the plane of a field.

    Lines join where they cross or share a corner, and where one ends near another; not on bridges and in tunnels.
    The tags ``oneway`` and ``junction`` of OpenStreetMap forbid edges.

    :raises InputError: if the file cannot be read, or no line comes near the field
    """
    import shapely

    near = shapely.Polygon(field.polygon).buffer(AROUND_M)
    shapes, tags = list[Any](), list[Mapping[str, str]]()
    for degrees, about in BorderSource(path).lines():
        shape = shapely.LineString(field.frame.to_local(degrees[:, 1], degrees[:, 0]))
        shape = shape.simplify(STRAIGHT_M, preserve_topology=False)
        if shape.length > 0 and shape.intersects(near):
            shapes.append(shape)
            tags.append(about)
    inside_m = sum(shape.intersection(shapely.Polygon(field.polygon)).length for shape in shapes)
    if not inside_m:
        raise InputError(f"has no line in the field {field.name!r}", "check the file, or the field's datum", path)
    spacing_m = max(MIN_SPACING_M, inside_m / MAX_STOPS)
    nodes, edges, known = list[Stop](), list[tuple[str, str]](), dict[tuple[float, float], str]()
    for number, (line, about) in enumerate(zip(_joined(shapes, tags), tags, strict=True), 1):
        if not line.length:  # it was shorter than what counts as joined
            continue
        places = shapely.get_coordinates(shapely.segmentize(line, spacing_m)).round(1).tolist()
        names = list[str]()
        for x_m, y_m in places:
            if (x_m, y_m) not in known:
                known[x_m, y_m] = f"lane{number}-{len(names) + 1}"
                nodes.append(Stop(known[x_m, y_m], x_m, y_m))
            names.append(known[x_m, y_m])
        steps = [step for step in pairwise(names) if step[0] != step[1]]
        oneway = about.get("oneway", "yes" if about.get("junction") == "roundabout" else "no").lower()
        if oneway not in ("-1", "reverse"):
            edges += steps
        if oneway not in ("yes", "true", "1"):
            edges += [(end, start) for start, end in steps]
    return TravelGraph.from_edges(nodes, dict.fromkeys(edges), path)


def _joined(shapes: Sequence[Any], tags: Sequence[Mapping[str, str]]) -> list[Any]:
    """Lines with a corner wherever they meet another one; their ends are moved onto the lines next to them."""
    import shapely

    tree = shapely.STRtree(shapes)
    meets: list[list[Any]] = [[] for _ in shapes]
    apart = [any(about.get(key, "no") != "no" for key in ("bridge", "tunnel")) for about in tags]
    for one, other in tree.query(shapes, "dwithin", JOIN_M).T.tolist():
        if one == other:
            continue
        line, end_points = shapes[one], [shapely.Point(shapes[other].coords[index]) for index in (0, -1)]
        meets[one] += [line.interpolate(line.project(end)) for end in end_points if line.distance(end) <= JOIN_M]
        if not (apart[one] or apart[other]):
            crossing = shapely.intersection(line, shapes[other])
            meets[one] += map(shapely.Point, shapely.get_coordinates(crossing))
    lines = []
    for number, line in enumerate(shapes):
        corners = [(line.project(shapely.Point(corner)), corner) for corner in line.coords[1:-1]]
        cuts = [(line.project(point), (point.x, point.y)) for point in meets[number]]
        ends = [_end(line, index, number, shapes, tree) for index in (0, -1)]
        inner = [place for along_m, place in sorted(corners + cuts) if 0 < along_m < line.length]
        lines.append(shapely.LineString([ends[0], *inner, ends[1]]))
    return lines


def _end(line: Any, index: int, number: int, shapes: Sequence[Any], tree: Any) -> tuple[float, float]:
    """An end of a line, on the nearest line before it in the file if that is near."""
    import shapely

    end = shapely.Point(line.coords[index])
    near = sorted(one for one in tree.query(end, "dwithin", JOIN_M).tolist() if one < number)
    if near:
        other = min((shapes[one] for one in near), key=end.distance)
        end = other.interpolate(other.project(end))
    return end.x, end.y


class LaneTravel(GraphTravel):
    """Shortest routes along lanes, on which nobody turns around but at their ends and junctions.

    Routes from where the car is begin in its direction of travel, which :meth:`moved` keeps; other routes, and
    those between stops of a tour, begin in any.
    """

    def __init__(self, graph: TravelGraph, *args: Any) -> None:
        super().__init__(graph, *args)
        self._anchor: tuple[float, float] | None = None
        self._heading: Array | None = None
        self._place: tuple[float, float] | None = None
        begin, end = graph.edges.T
        neighbours = [set[int]() for _ in graph.names]
        for a, b in graph.edges.tolist():
            neighbours[a].add(b)
            neighbours[b].add(a)
        may_turn = np.array([len(those) != 2 for those in neighbours])
        leaving = [np.flatnonzero(begin == node) for node in range(len(graph.names))]
        turns = [
            (edge, after)
            for edge in range(len(end))
            for after in leaving[end[edge]].tolist()
            if end[after] != begin[edge] or may_turn[end[edge]]
        ]
        steps = np.array(turns, np.intp).reshape(-1, 2)
        names = tuple(map(str, range(len(graph.edges))))
        # The places of this graph are edges that have just been driven.
        self._driven = TravelGraph(names, graph.xy[end], steps, graph.length_m[steps[:, 1]])
        self._from_edge: dict[int, tuple[Array, Indices]] = {}

    def moved(self, place: tuple[float, float]) -> None:
        """See :class:`TravelModel`."""
        self._place = place
        if self._anchor is None:
            self._anchor = place
        elif math.dist(place, self._anchor) >= HEADING_M:
            self._heading = np.subtract(place, self._anchor)
            self._anchor = place

    def route(self, from_xy: ArrayLike, stop: Stop) -> Array:
        """See :class:`TravelModel`."""
        start, node, graph = np.asarray(from_xy, float), self.graph.index(stop.name), self.graph
        lead_m, edge, entry = self._best_entry(start, node)
        if not math.isfinite(lead_m):
            raise ValueError(f"no lane leads from ({start[0]:g}, {start[1]:g}) to {stop.name}")
        corners = [start, entry]
        if edge >= 0:
            way = self._edges_to(edge, node)
            corners += [graph.xy[graph.edges[one, 1]] for one in way]
        different = [True, *(not np.array_equal(a, b) for a, b in pairwise(corners))]
        kept = [corner for corner, differs in zip(corners, different, strict=True) if differs]
        return np.array(kept if len(kept) > 1 else [start, start])

    def lengths_m(self, from_xy: Array, stops: Sequence[Stop]) -> Array:
        """See :class:`TravelModel`."""
        nodes = self._nodes(stops)
        found = np.full(len(self.graph.names), np.inf)
        for lead_m, edge, node, _ in self._entries(np.asarray(from_xy, float)):
            if edge < 0:
                found[node] = min(found[node], lead_m)
            else:
                found = np.minimum(found, lead_m + self._lengths_from(edge)[0])
        return np.asarray(found[nodes])

    def _slower_to_m(self, start: Array, stops: Sequence[Stop]) -> Array:
        """See :class:`TravelModel`."""
        limited = self.graph.limit_mps is not None
        return np.array(
            [self.slower_m(way) for way in self._ways(start, stops)] if limited else np.zeros(len(stops))
        )

    def _entries(self, place: Array) -> list[tuple[float, int, int, Array]]:
        """Ways onto the lanes: length to the end of an edge [m], the edge, its end, and the corner to enter at.

        The edge is -1 for a node just behind, to which one rolls back.
        """
        begin, end = (self.graph.xy[self.graph.edges[:, side]] for side in (0, 1))
        step = end - begin
        length = np.maximum(self.graph.length_m, 1e-9)
        share = np.clip(((place - begin) * step).sum(axis=1) / length**2, 0.0, 1.0)
        entry = begin + share[:, None] * step
        away_m = np.hypot(*(entry - place).T)
        near = np.flatnonzero(away_m <= away_m.min() + 0.1)
        if self._heading is not None and self._place is not None and math.dist(place, self._place) <= HEADING_M:
            ahead = near[step[near] @ self._heading > 0]
            near = ahead if len(ahead) else near
        found = []
        for edge in near.tolist():
            a, b = self.graph.edges[edge].tolist()
            found.append((float(away_m[edge] + (1 - share[edge]) * length[edge]), edge, b, entry[edge]))
            behind_m = float(away_m[edge] + share[edge] * length[edge])
            if behind_m <= BACK_M:
                found.append((behind_m, -1, a, self.graph.xy[a]))
        return found

    def _best_entry(self, place: Array, node: int) -> tuple[float, int, Array]:
        """The entry of the shortest route to a node: its length [m], the edge, and the corner to enter at."""
        best: tuple[float, int, Array] = (math.inf, -1, place)
        for lead_m, edge, end, entry in self._entries(place):
            if edge >= 0:
                lead_m += float(self._lengths_from(edge)[0][node])
            elif end != node:
                continue
            if lead_m < best[0]:
                best = lead_m, edge, entry
        return best

    def _lengths_from(self, edge: int) -> tuple[Array, Indices]:
        """Lengths of the routes on from the end of an edge to each node, and the last edge of each."""
        if edge not in self._from_edge:
            lengths, end = self._driven.routes_to_all(edge)[0], self.graph.edges[:, 1]
            order = np.lexsort([lengths, end])
            nodes, first = np.unique(end[order], return_index=True)
            to_node, last = np.full(len(self.graph.names), np.inf), np.full(len(self.graph.names), -1, np.intp)
            to_node[nodes], last[nodes] = lengths[order][first], order[first]
            self._from_edge[edge] = to_node, last
        return self._from_edge[edge]

    def _edges_to(self, edge: int, node: int) -> list[int]:
        """Edges of the shortest route to a node that begins with an edge, both included."""
        last = self._lengths_from(edge)[1][node]
        return [int(name) for name in self._driven.path(str(edge), str(last))]
