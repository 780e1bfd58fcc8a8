# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Travel graphs made from a field's outline: a lattice for open ground, rows with headlands for crops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.travel.drivable_area import DrivableArea
from soilmoist_ros.exploration.travel.stop import PLACE_DIGITS, Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, listing
from soilmoist_ros.mapping import Field

Array = NDArray[np.float64]

MAX_NODES = 100_000
"""Largest number of nodes; a smaller spacing is a mistake."""


@dataclass(frozen=True, eq=False)
class BuiltGraph:
    """A travel graph and its dropped nodes.

    :param graph: the largest connected part
    :param dropped: nodes of other parts, which the robot could not reach without leaving the drivable area
    """

    graph: TravelGraph
    dropped: tuple[Stop, ...] = ()

    @property
    def summary(self) -> str:
        """One sentence for the operator."""
        text = f"{len(self.graph.names)} nodes, {len(self.graph.edges)} directed edges"
        if self.dropped:
            text += f"; left out, since no way leads there: {listing(stop.name for stop in self.dropped)}"
        return text


def open_lattice(
    field: Field, spacing_m: float, *, neighbours: Literal[4, 8] = 8, margin_m: float = 0.0
) -> BuiltGraph:
    """Nodes on a square lattice, centred on the field, with edges in both directions to the neighbours.

    No edge crosses the border or a no-go area.

    :param field: outline and no-go areas
    :param spacing_m: distance between rows and between columns [m], > 0
    :param neighbours: 4 (along rows and columns) or 8 (diagonals too)
    :param margin_m: distance to keep from the border and the no-go areas [m], >= 0
    :raises InputError: if not even two joined nodes, or far too many, would lie in the field
    """
    import shapely

    _require_positive(spacing_m=spacing_m)
    low, high = field.polygon.min(axis=0), field.polygon.max(axis=0)
    _require_few(float(np.prod(np.floor((high - low) / spacing_m) + 1)), spacing_m)
    x_m, y_m = (_centred(low[axis], high[axis], spacing_m) for axis in (0, 1))
    area = DrivableArea((field.polygon,), field.no_go, margin_m)
    remedy = f"use a spacing smaller than {spacing_m:g} m"
    if shapely.Polygon(field.polygon).buffer(-margin_m).is_empty:
        remedy = f"a margin of {margin_m:g} m leaves nothing of the field: use a smaller one"
    digits = len(str(max(len(x_m), len(y_m))))
    nodes = {
        (row, column): _node(f"r{row + 1:0{digits}d}c{column + 1:0{digits}d}", float(x), float(y))
        for row, y in enumerate(y_m)
        for column, x in enumerate(x_m)
    }
    inside = area.contains([(stop.x_m, stop.y_m) for stop in nodes.values()])
    nodes = {key: stop for (key, stop), within in zip(nodes.items(), inside, strict=True) if within}
    steps = [(0, 1), (1, 0)] if neighbours == 4 else [(0, 1), (1, 0), (1, 1), (1, -1)]
    ways = [
        (stop, nodes[row + up, column + right])
        for (row, column), stop in nodes.items()
        for up, right in steps
        if (row + up, column + right) in nodes
    ]
    return _connected(list(nodes.values()), _allowed(ways, area), remedy)


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

    :param field: outline and no-go areas
    :param row_spacing_m: distance between rows [m], > 0; the rows are centred on the field
    :param node_spacing_m: greatest distance between the nodes of a row [m], > 0
    :param heading_deg: direction of the rows, clockwise from north [deg]; ``start`` is where one comes from
    :param headland_m: width of the headlands, measured along the rows [m], > 0
    :param margin_m: distance to keep from the border and the no-go areas [m], >= 0
    :raises InputError: if no row, no two joined nodes, or far too many would lie in the field
    """
    _require_positive(row_spacing_m=row_spacing_m, node_spacing_m=node_spacing_m, headland_m=headland_m)
    heading = np.radians(heading_deg)
    along = np.array([np.sin(heading), np.cos(heading)])
    across = np.array([along[1], -along[0]])
    offsets = field.polygon @ across
    nodes_per_row = np.ptp(field.polygon @ along) / node_spacing_m + 3
    _require_few(float(np.ptp(offsets) / row_spacing_m * nodes_per_row), min(row_spacing_m, node_spacing_m))
    lines = _centred(offsets.min(), offsets.max(), row_spacing_m, inset=True)
    area = DrivableArea((field.polygon,), field.no_go, margin_m)
    rows = [
        [
            _Row.laid(f"row{number:0{len(str(len(lines)))}d}{part}", piece, node_spacing_m, headland_m)
            for part, piece in zip(_part_names(), _crossings(field.polygon, along, across, offset), strict=False)
            if np.hypot(*(piece[1] - piece[0])) > headland_m
        ]
        for number, offset in enumerate(lines, start=1)
    ]
    stops = [stop for line in rows for row in line for stop in row.stops]
    kept = {stop for stop, inside in zip(stops, area.contains(_places(stops)), strict=True) if inside}
    ways = [pair for line in rows for row in line for pair in pairwise(row.stops)]
    turns = [
        (first.stops[end], second.stops[end])
        for line, following in pairwise(rows)
        for first in line
        for second in following
        for end in (0, -1)
    ]
    ways = _allowed([way for way in ways if kept.issuperset(way)], area)
    turns = _in_headland([way for way in turns if kept.issuperset(way)], field.polygon, headland_m)
    remedy = "use a smaller row spacing or narrower headlands, and check the heading"
    return _connected([stop for stop in stops if stop in kept], ways + _allowed(turns, area), remedy)


@dataclass(frozen=True)
class _Row:
    """Nodes along a row in order; the first and the last stand in the headlands."""

    stops: tuple[Stop, ...]

    @classmethod
    def laid(cls, name: str, piece: Array, node_spacing_m: float, headland_m: float) -> _Row:
        """Nodes on a straight piece from border to border, shape (2, 2) [m]."""
        length = float(np.hypot(*(piece[1] - piece[0])))
        crop = length - 2 * headland_m
        inner = np.linspace(headland_m, length - headland_m, int(np.ceil(crop / node_spacing_m - 1e-9)) + 1)
        at = np.array([headland_m / 2, *(inner if crop > 0 else []), length - headland_m / 2]) / length
        places = piece[0] + at[:, None] * (piece[1] - piece[0])
        digits = len(str(len(inner)))
        labels = ["start", *(f"{number:0{digits}d}" for number in range(1, len(at) - 1)), "end"]
        nodes = zip(labels, places.tolist(), strict=True)
        return cls(tuple(_node(f"{name}-{label}", x, y) for label, (x, y) in nodes))


def _part_names() -> list[str]:
    return ["", *(chr(letter) for letter in range(ord("b"), ord("z") + 1))]


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
    lines = shapely.linestrings([_places(way) for way in ways])
    return [way for way, inside in zip(ways, shapely.covers(strip, lines), strict=True) if inside]


def _allowed(ways: list[tuple[Stop, Stop]], area: DrivableArea) -> list[tuple[Stop, Stop]]:
    if not ways:
        return []
    allowed = area.allows(_places([way[0] for way in ways]), _places([way[1] for way in ways]))
    return [way for way, inside in zip(ways, allowed, strict=True) if inside]


def _connected(nodes: list[Stop], ways: list[tuple[Stop, Stop]], remedy: str) -> BuiltGraph:
    """The largest connected part of nodes and edges, with every edge in both directions."""
    if not nodes:
        raise InputError("no node of the travel graph would lie inside the field", remedy)
    names = [(a.name, b.name) for a, b in ways]
    whole = TravelGraph.from_edges(nodes, names + [(b, a) for a, b in names], connected=False)
    main = whole.components() == 0
    if main.sum() < 2:
        found = "only one node" if len(nodes) == 1 else f"{len(nodes)} nodes, but no way between them"
        raise InputError(f"the travel graph would have {found}: there is nowhere to drive", remedy)
    dropped = tuple(stop for stop, kept in zip(whole.stops, main, strict=True) if not kept)
    return BuiltGraph(whole.part(main), dropped)


def _node(name: str, x_m: float, y_m: float) -> Stop:
    """A node, rounded as in a topological map: what is validated here is what is driven."""
    return Stop(name, round(x_m, PLACE_DIGITS) + 0.0, round(y_m, PLACE_DIGITS) + 0.0)


def _places(stops: Sequence[Stop]) -> Array:
    return np.array([(stop.x_m, stop.y_m) for stop in stops], float).reshape(-1, 2)


def _centred(low: float, high: float, spacing_m: float, inset: bool = False) -> Array:
    """Places one spacing apart, centred between two bounds; inset, none is nearer to a bound than half of it."""
    width = float(high - low)
    count = max(int(np.floor(width / spacing_m + 1e-9)) + (0 if inset else 1), 1)
    return np.asarray((low + high) / 2 + (np.arange(count) - (count - 1) / 2) * spacing_m, np.float64)


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} must be > 0 and finite, got {value}", "give it in metres")


def _require_few(count: float, spacing_m: float) -> None:
    if count > MAX_NODES:
        raise InputError(
            f"a spacing of {spacing_m:g} m gives about {count:.2g} nodes (at most {MAX_NODES:,})",
            "use a larger spacing, and check that the field's coordinates are metres",
        )
