# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The travel graph: named nodes and the edges between them, read or built from a field's outline."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import MIN_REACH_M, PLACE_DIGITS, DrivableArea, Stop, stops_xy
from soilmoist_ros.foundation import InputError, Mistake, PlaneMove, did_you_mean, listing
from soilmoist_ros.mapping import Field

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TravelGraph:
    """Named nodes and directed edges between them. Made by :meth:`from_edges`."""

    names: tuple[str, ...]  # names of the nodes, unique
    xy: Array  # their places, shape (n, 2) [m]
    edges: Indices  # start and end of each edge as indices of nodes, shape (e, 2)
    length_m: Array  # length of each edge, shape (e,) [m], >= 0
    barred: Flags | None = None  # edges that the robot must not use, shape (e,); ``None`` without any
    limit_mps: Array | None = (
        None  # highest speed on each edge, inf without a limit, shape (e,); ``None`` without any
    )
    _rows: dict[int, tuple[Array, Indices]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def from_edges(
        cls, nodes: Sequence[Stop], edges: Iterable[tuple[str, str]], path: Path | None = None
    ) -> TravelGraph:
        """Graph of nodes and of edges given by the names of their ends.

        :param edges: (start, end) of each edge; give both directions if the robot may drive both
        :raises InputError: with every unknown end, duplicate name and bad place
        """
        pairs = list(edges)
        names = tuple(node.name for node in nodes)
        xy = np.array([(node.x_m, node.y_m) for node in nodes], float).reshape(-1, 2)
        index = {name: number for number, name in enumerate(names)}
        mistakes = []
        if not names:
            mistakes.append(("the travel graph has no nodes", "give at least one place the robot can go to"))
        if double := [name for name, count in Counter(names).items() if count > 1]:
            mistakes.append((f"more than one node has the name {listing(double)}", "give each its own name"))
        if lost := [name for name, place in zip(names, xy, strict=True) if not np.isfinite(place).all()]:
            mistakes.append((f"the place is not finite of {listing(lost)}", "give x and y in metres"))
        mistakes += [
            (
                f"the edge from {a!r} to {b!r}: there is no node {end!r}{did_you_mean(end, names)}",
                "add the node or remove the edge",
            )
            for a, b in pairs
            for end in dict.fromkeys((a, b))
            if end not in index
        ]
        if mistakes:
            raise InputError([Mistake(*mistake, path) for mistake in mistakes])
        ends = np.array([(index[start], index[end]) for start, end in pairs], np.intp).reshape(-1, 2)
        return cls(names, xy, ends, np.hypot(*(xy[ends[:, 1]] - xy[ends[:, 0]]).T))

    def moved(self, move: PlaneMove) -> TravelGraph:
        """The graph in the coordinates of another plane; itself if the two planes are one."""
        return self if move.is_identity else replace(self, xy=move.places(self.xy))

    @cached_property
    def stops(self) -> tuple[Stop, ...]:
        """The nodes as stops, in order; each is reached nearer to it than to any other node."""
        reach_m = np.maximum(self.spacing_m / 2, MIN_REACH_M)
        return tuple(
            Stop(name, float(x), float(y), float(near))
            for name, (x, y), near in zip(self.names, self.xy, reach_m, strict=True)
        )

    @cached_property
    def spacing_m(self) -> Array:
        """Distance from each node to the nearest other one, shape (n,) [m]; inf for a single node."""
        from scipy.spatial import KDTree

        return np.asarray(KDTree(self.xy).query(self.xy, k=2)[0][:, 1])

    def crowded(self) -> str:
        """Nodes so near to another one that the robot may be taken to be there; empty if there are none."""
        near = [name for name, away_m in zip(self.names, self.spacing_m, strict=True) if away_m < 2 * MIN_REACH_M]
        text = f"a robot cannot tell nodes apart that are nearer to each other than {2 * MIN_REACH_M:g} m: "
        return text + listing(near) if near else ""

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.names)}

    def index(self, name: str) -> int:
        """Number of a node.

        :raises InputError: if there is none of this name
        """
        try:
            return self._index[name]
        except KeyError:
            raise InputError(
                f"the travel graph has no node {name!r}",
                f"use one of its {len(self.names)} nodes{did_you_mean(name, self.names)}",
            ) from None

    def nearest(self, xy: ArrayLike) -> str:
        """Name of the node nearest to a place as the crow flies; the first of equals."""
        return self.names[int(np.argmin(np.hypot(*(self.xy - np.asarray(xy, float)).T)))]

    def routes_from(self, start: int, back: bool = False) -> tuple[Array, Indices]:
        """Shortest routes from one node to each, or ``back`` from each to the node; they are not kept.

        :returns: their lengths, shape (n,) [m], inf without a route; and the neighbour of each node on its route,
            on the side of ``start``, shape (n,)
        """
        from scipy.sparse.csgraph import dijkstra

        matrix = self._matrix.T.tocsr() if back else self._matrix
        lengths, before = dijkstra(matrix, indices=start, return_predecessors=True)
        return np.asarray(lengths), np.asarray(before)

    def routes_to_all(self, start: int) -> tuple[Array, Indices]:
        """Shortest routes from a node to each, as :meth:`routes_from`; kept, so they must not be changed."""
        if start not in self._rows:
            self._rows[start] = self.routes_from(start)
        return self._rows[start]

    def distance_m(self, start: str, end: str) -> float:
        """Length of the shortest route from one node to another [m]; inf if unreachable."""
        return float(self.routes_to_all(self.index(start))[0][self.index(end)])

    def path(self, start: str, end: str) -> tuple[str, ...]:
        """Nodes of the shortest route, both ends included; empty if there is none."""
        source, node = self.index(start), self.index(end)
        length, before = self.routes_to_all(source)
        if not np.isfinite(length[node]):
            return ()
        way = [node]
        while way[-1] != source:
            way.append(int(before[way[-1]]))
        return tuple(self.names[number] for number in reversed(way))

    def components(self) -> Indices:
        """Number of the part of the graph to which each node belongs, shape (n,).

        Two nodes are of one part if each can be reached from the other. Parts are numbered from the
        largest (0) to the smallest, the one that holds the earliest node first among equals.
        """
        from scipy.sparse.csgraph import connected_components

        _, label = connected_components(self._matrix, directed=True, connection="strong")
        found, first, size = np.unique(label, return_index=True, return_counts=True)
        rank = np.empty(len(found), np.intp)
        rank[np.lexsort([first, -size])] = np.arange(len(found))
        return np.asarray(rank[np.searchsorted(found, label)], np.intp)

    def part(self, keep: NDArray[np.bool_]) -> TravelGraph:
        """The graph of some of the nodes and the edges between them."""
        number = np.cumsum(keep) - 1
        within = np.asarray(keep[self.edges].all(axis=1))
        names = tuple(name for name, kept in zip(self.names, keep, strict=True) if kept)
        some = self.with_edges(within)
        return replace(some, names=names, xy=self.xy[keep], edges=number[some.edges])

    def with_edges(self, kept: Flags) -> TravelGraph:
        """The graph with some of its edges, none of them barred."""
        limits = None if self.limit_mps is None else self.limit_mps[kept]
        return TravelGraph(self.names, self.xy, self.edges[kept], self.length_m[kept], None, limits)

    def slower_m(self, way: Array, speed_mps: float) -> float:
        """Length that limits of its edges add to a way: a longer one would take as long without them [m].

        :param way: corners, shape (p, 2) [m]; a part between two nodes is on their edge
        """
        if self.limit_mps is None:
            return 0.0
        parts = zip(way[:-1].round(6).tolist(), way[1:].round(6).tolist(), strict=True)
        limits = [self._limits.get((*start, *end), np.inf) for start, end in parts]
        return float(np.hypot(*np.diff(way, axis=0).T) @ np.maximum(speed_mps / np.array(limits) - 1, 0.0))

    def slower_to_all_m(self, start: int, speed_mps: float) -> Array:
        """As :meth:`slower_m`, of the shortest routes from a node to all, shape (n,) [m]; 0 out of reach."""
        lengths, before = self.routes_to_all(start)
        slower, last = np.zeros(len(lengths)), np.arange(len(lengths))
        if self.limit_mps is None:
            return slower
        to = np.flatnonzero(np.isfinite(lengths) & (last != start))
        last[to] = before[to]
        edges = np.hstack([self.xy[last[to]], self.xy[to]])
        limit = np.array([self._limits[*ends] for ends in edges.round(6).tolist()])
        slower[to] = np.hypot(*(edges[:, 2:] - edges[:, :2]).T) * np.maximum(speed_mps / limit - 1, 0.0)
        while (last[last] != last).any():  # each has the sum from there on; twice as far in each turn
            slower, last = slower + slower[last], last[last]
        return slower

    @cached_property
    def _limits(self) -> dict[tuple[float, ...], float]:
        """Highest speed on each edge by the places of its ends, the highest of parallel edges [m/s]."""
        assert self.limit_mps is not None
        ends, found = self.xy[self.edges].reshape(-1, 4).round(6).tolist(), dict[tuple[float, ...], float]()
        for place, limit in zip(map(tuple, ends), self.limit_mps.tolist(), strict=True):
            found[place] = max(limit, found.get(place, 0.0))
        return found

    @cached_property
    def _matrix(self) -> Any:
        """Lengths as a sparse matrix; the shortest of parallel edges."""
        from scipy.sparse import csr_array

        order = np.lexsort([self.length_m, self.edges[:, 1], self.edges[:, 0]])
        # Graph routines of SciPy 1.11, which Ubuntu 24.04 has, read indices of 32 bits only.
        ends, lengths = self.edges[order].astype(np.int32), self.length_m[order]
        first = np.ones(len(ends), bool)
        first[1:] = (ends[1:] != ends[:-1]).any(axis=1)
        size = len(self.names)
        return csr_array((lengths[first], (ends[first, 0], ends[first, 1])), shape=(size, size))


# Travel graphs made from a field's outline: a lattice for open ground, rows with headlands for crops ------------

MAX_NODES = 100_000  # largest number of nodes; a smaller spacing is a mistake


@dataclass(frozen=True, eq=False)
class BuiltGraph:
    """A travel graph and its dropped nodes."""

    graph: TravelGraph  # the largest connected part
    dropped: tuple[Stop, ...] = ()  # nodes that could not be reached without leaving the drivable area

    @property
    def summary(self) -> str:
        """One sentence for the operator."""
        text = f"{len(self.graph.names)} nodes, {len(self.graph.edges)} directed edges"
        if self.dropped:
            text += f"; left out, since no way leads there: {listing(stop.name for stop in self.dropped)}"
        return text


def open_lattice(field: Field, spacing_m: float, *, margin_m: float = 0.0) -> BuiltGraph:
    """Nodes on a square lattice, centred on the field, with edges in both directions to the eight neighbours.

    No edge crosses the border or a no-go area.

    :raises InputError: if not even two joined nodes, or far too many, would lie in the field
    """
    import shapely

    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    count = np.prod(np.floor((high - low) / spacing_m) + 1) if spacing_m > 0 else 0
    require(float(count), spacing_m=spacing_m)
    x_m, y_m = (_centred(low[axis], high[axis], spacing_m) for axis in (0, 1))
    area = DrivableArea((field.polygon,), field.no_go, margin_m)
    remedy = f"use a spacing smaller than {spacing_m:g} m"
    if shapely.Polygon(field.polygon).buffer(-margin_m).is_empty:
        remedy = f"a margin of {margin_m:g} m leaves nothing of the field: use a smaller one"
    digits = len(str(max(len(x_m), len(y_m))))
    nodes = {
        (row, column): node(f"r{row + 1:0{digits}d}c{column + 1:0{digits}d}", float(x), float(y))
        for row, y in enumerate(y_m)
        for column, x in enumerate(x_m)
    }
    inside = area.contains([(stop.x_m, stop.y_m) for stop in nodes.values()])
    nodes = {key: stop for (key, stop), within in zip(nodes.items(), inside, strict=True) if within}
    ways = [
        (stop, nodes[row + up, column + right])
        for (row, column), stop in nodes.items()
        for up, right in ((0, 1), (1, 0), (1, 1), (1, -1))
        if (row + up, column + right) in nodes
    ]
    return connected(list(nodes.values()), allowed_ways(ways, area), remedy)


def crop_rows(
    field: Field,
    row_spacing_m: float,
    node_spacing_m: float,
    heading_deg: float,
    headland_m: float,
    *,
    margin_m: float = 0.0,
) -> BuiltGraph:
    """Rows that can be entered and left only at their ends, joined there along headlands.

    A row ends one headland before the border; in the middle of the headland it has a node ``row3-start`` or
    ``row3-end``, joined to those of the next rows where the way stays inside the headland strip. Where a
    no-go area cuts a row, there is no headland: the robot backs out. A row that is met twice (a field that
    is not convex) has the parts ``row3`` and ``row3b``. Parts that cannot be reached are left out.

    :param row_spacing_m: distance between rows [m], > 0; the rows are centred on the field
    :param heading_deg: direction of the rows, clockwise from north [deg]; ``start`` is where one comes from
    :param headland_m: width of the headlands, measured along the rows [m], > 0
    :raises InputError: if no row, no two joined nodes, or far too many would lie in the field
    """
    require(0, row_spacing_m=row_spacing_m, node_spacing_m=node_spacing_m, headland_m=headland_m)
    heading = np.radians(heading_deg)
    along = np.array([np.sin(heading), np.cos(heading)])
    across = np.array([along[1], -along[0]])
    offsets = field.polygon @ across
    nodes_per_row = np.ptp(field.polygon @ along) / node_spacing_m + 3
    require(float(np.ptp(offsets) / row_spacing_m * nodes_per_row), row=row_spacing_m, node=node_spacing_m)
    lines = _centred(offsets.min(), offsets.max(), row_spacing_m, inset=True)
    area = DrivableArea((field.polygon,), field.no_go, margin_m)
    parts = ("", *ascii_lowercase[1:])
    rows = [
        [
            _row(f"row{number:0{len(str(len(lines)))}d}{part}", piece, node_spacing_m, headland_m)
            for part, piece in zip(parts, _crossings(field.polygon, along, across, offset), strict=False)
            if np.hypot(*(piece[1] - piece[0])) > headland_m
        ]
        for number, offset in enumerate(lines, start=1)
    ]
    stops = [stop for line in rows for row in line for stop in row]
    kept = {stop for stop, inside in zip(stops, area.contains(stops_xy(stops)), strict=True) if inside}
    ways = [pair for line in rows for row in line for pair in pairwise(row)]
    turns = [
        (first[end], second[end])
        for line, following in pairwise(rows)
        for first in line
        for second in following
        for end in (0, -1)
    ]
    ways = allowed_ways([way for way in ways if kept.issuperset(way)], area)
    turns = _in_headland([way for way in turns if kept.issuperset(way)], field.polygon, headland_m)
    remedy = "use a smaller row spacing or narrower headlands, and check the heading"
    return connected([stop for stop in stops if stop in kept], ways + allowed_ways(turns, area), remedy)


def _row(name: str, piece: Array, node_spacing_m: float, headland_m: float) -> tuple[Stop, ...]:
    """Nodes on a straight piece from border to border; the first and the last stand in the headlands."""
    length = float(np.hypot(*(piece[1] - piece[0])))
    crop = length - 2 * headland_m
    inner = np.linspace(headland_m, length - headland_m, int(np.ceil(crop / node_spacing_m - 1e-9)) + 1)
    at = np.array([headland_m / 2, *(inner if crop > 0 else []), length - headland_m / 2]) / length
    places = piece[0] + at[:, None] * (piece[1] - piece[0])
    digits = len(str(len(inner)))
    labels = ["start", *(f"{number:0{digits}d}" for number in range(1, len(at) - 1)), "end"]
    return tuple(node(f"{name}-{label}", x, y) for label, (x, y) in zip(labels, places.tolist(), strict=True))


def _crossings(polygon: Array, along: Array, across: Array, offset: float) -> list[Array]:
    """Pieces of a line across the field that lie inside its outline, each (2, 2) [m], in the line's direction."""
    import shapely

    reach = polygon @ along
    line = np.outer([reach.min() - 1, reach.max() + 1], along) + offset * across
    cut = shapely.intersection(shapely.Polygon(polygon), shapely.LineString(line))
    pieces: list[Any] = [part for part in shapely.get_parts(cut) if part.geom_type == "LineString"]
    ends = [shapely.get_coordinates(part)[[0, -1]] for part in pieces]
    ends = [piece if (piece[1] - piece[0]) @ along > 0 else piece[::-1] for piece in ends]
    return sorted(ends, key=lambda piece: float(piece[0] @ along))


def _in_headland(ways: list[tuple[Stop, Stop]], polygon: Array, headland_m: float) -> list[tuple[Stop, Stop]]:
    """Edges that stay within a headland of the border, so that they do not cross the crop."""
    if not ways:
        return []
    import shapely

    strip = shapely.Polygon(polygon).exterior.buffer(headland_m * (1 + 1e-9))
    shapely.prepare(strip)
    lines = shapely.linestrings([stops_xy(way) for way in ways])
    return [way for way, inside in zip(ways, shapely.covers(strip, lines), strict=True) if inside]


def allowed_ways(ways: list[tuple[Stop, Stop]], area: DrivableArea) -> list[tuple[Stop, Stop]]:
    """The straight ways that stay in an area."""
    if not ways:
        return []
    allowed = area.allows(stops_xy([way[0] for way in ways]), stops_xy([way[1] for way in ways]))
    return [way for way, inside in zip(ways, allowed, strict=True) if inside]


def connected(nodes: list[Stop], ways: list[tuple[Stop, Stop]], remedy: str) -> BuiltGraph:
    """The largest connected part of nodes and edges, with every edge in both directions."""
    if not nodes:
        raise InputError("no node of the travel graph would lie inside the field", remedy)
    names = [(a.name, b.name) for a, b in ways]
    whole = TravelGraph.from_edges(nodes, names + [(b, a) for a, b in names])
    main = whole.components() == 0
    if main.sum() < 2:
        found = "only one node" if len(nodes) == 1 else f"{len(nodes)} nodes, but no way between them"
        raise InputError(f"the travel graph would have {found}: there is nowhere to drive", remedy)
    dropped = tuple(stop for stop, kept in zip(whole.stops, main, strict=True) if not kept)
    return BuiltGraph(whole.part(main), dropped)


def node(name: str, x_m: float, y_m: float) -> Stop:
    """A node, rounded as in a topological map: what is validated here is what is driven."""
    return Stop(name, round(x_m, PLACE_DIGITS) + 0.0, round(y_m, PLACE_DIGITS) + 0.0)


def _centred(low: float, high: float, spacing_m: float, inset: bool = False) -> Array:
    """Places one spacing apart, centred between two bounds; inset, none is nearer to a bound than half of it."""
    width = float(high - low)
    count = max(int(np.floor(width / spacing_m + 1e-9)) + (0 if inset else 1), 1)
    return np.asarray((low + high) / 2 + (np.arange(count) - (count - 1) / 2) * spacing_m, np.float64)


def require(count: float, **lengths_m: float) -> None:
    """Refuse lengths that are not positive, and too many nodes."""
    for name, value in lengths_m.items():
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} must be > 0 and finite, got {value}", "give it in metres")
    if count > MAX_NODES:
        raise InputError(
            f"a spacing of {min(lengths_m.values()):g} m gives about {count:.2g} nodes (at most {MAX_NODES:,})",
            "use a larger spacing, and check that the field's coordinates are metres",
        )
