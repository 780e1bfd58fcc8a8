# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Random fields with no-go areas, and random travel graphs that know nothing of either."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from soilmoist_ros.exploration import Stop, TravelGraph, open_lattice
from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import Field

Array = NDArray[np.float64]

OUTLINES = ("convex", "concave", "notched", "holes", "divided")
"""Shapes of random fields; ``divided`` by a ditch, the others without holes may have one no-go area."""
GRAPHS = ("lattice", "wild", "islands")
"""Random travel graphs: a lattice inside the drivable area; nodes and edges anywhere, some of them one-way; the
same cut into parts that are not joined."""
ROWS, APART_M, ROW_M = "rows", 2.5, 8.0
"""Rows of nodes as in polytunnels; distance of their nodes and of the rows [m]."""
POND_M = (5.0, 6.0)
"""Sides of a small no-go area [m]."""
ROBOT_RADIUS_M = 0.5
SPACING_M = 14.0
"""Mean distance between the nodes of a graph [m]."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A field, and where the robot begins.

    :param outline: one of :data:`OUTLINES`
    :param field: the field
    :param graph: travel graph as the navigation knows it, ``None`` to drive freely
    :param start: place of the robot at the start [m]
    """

    outline: str
    field: Field
    graph: TravelGraph | None
    start: tuple[float, float]


def random_ground(
    rng: np.random.Generator,
    outline: str,
    graph: str | None,
    ponds: int = 0,
    ponds_rng: np.random.Generator | None = None,
) -> Ground:
    """A random field of 50 to 110 m with a random graph.

    :param rng: source of all randomness
    :param outline: one of :data:`OUTLINES`
    :param graph: one of :data:`GRAPHS`, :data:`ROWS`, or ``None``
    :param ponds: number of small no-go areas more
    :param ponds_rng: source of their randomness, so that fields with and without them are the same
    """
    while True:
        polygon = _outline(rng, outline)
        no_go = tuple(_no_go(rng, outline, polygon))
        if ponds:
            no_go += tuple(_pond(ponds_rng or rng, polygon) for _ in range(ponds))
        drivable = shapely.Polygon(polygon).difference(shapely.union_all([shapely.Polygon(r) for r in no_go]))
        roomy = drivable.buffer(-2.5)
        if roomy.area < 800:
            continue
        frame = LocalFrame(float(rng.uniform(-60, 60)), float(rng.uniform(-179, 179)))
        cell_m = max(4.0, float(np.ptp(polygon, axis=0).max()) / 10)
        field = Field(f"random {outline}", frame, polygon, no_go, cell_m)
        largest = max(shapely.get_parts(roomy), key=lambda part: part.area)
        if graph is None:
            return Ground(outline, field, None, _place_in(rng, largest))
        made = _graph(rng, graph, field)
        # The robot begins near a node in a part of the graph that is worth driving.
        good = [stop for stop in made.stops if shapely.intersects_xy(roomy, stop.x_m, stop.y_m)]
        part = made.components()
        good = [stop for stop in good if (part == part[made.index(stop.name)]).sum() >= 6]
        if good:
            stop = good[int(rng.integers(len(good)))]
            if _can_leave(made, stop, drivable.buffer(-ROBOT_RADIUS_M)):
                return Ground(outline, field, made, (stop.x_m, stop.y_m))


def _outline(rng: np.random.Generator, kind: str) -> Array:
    if kind == "notched":
        width, height = rng.uniform(60, 110, 2)
        x, y = rng.uniform(0.3, 0.7, 2) * (width, height)
        ring = np.array([(0, 0), (width, 0), (width, y), (x, y), (x, height), (0, height)], float)
        return _turned(ring, float(rng.uniform(0, 2 * np.pi)))
    corners = int(rng.integers(7, 13))
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.3, 0.3, corners)) / corners
    radius = rng.uniform(25, 55) * rng.uniform(0.45 if kind == "concave" else 0.8, 1.0, corners)
    ring = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    if kind != "concave":
        ring = np.asarray(shapely.get_coordinates(shapely.Polygon(ring).convex_hull)[:-1])
    return ring


def _no_go(rng: np.random.Generator, kind: str, polygon: Array) -> list[Array]:
    area = shapely.Polygon(polygon)
    if kind == "divided":
        x, y = area.representative_point().x, area.representative_point().y
        ditch = np.array([(-200, -2), (200, -2), (200, 2), (-200, 2)], float)
        return [_turned(ditch, float(rng.uniform(0, np.pi))) + np.array([x, y])]
    count = int(rng.integers(2, 5)) if kind == "holes" else int(rng.integers(0, 2))
    rings = []
    for _ in range(count):
        corners = int(rng.integers(3, 9))
        angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
        ring = rng.uniform(4, 11) * np.column_stack([np.cos(angle), np.sin(angle)]) + _place_in(rng, area)
        if shapely.Polygon(ring).area > 10:
            rings.append(ring)
    return rings


def _pond(rng: np.random.Generator, polygon: Array) -> Array:
    x, y = _place_in(rng, shapely.Polygon(polygon).buffer(-6))
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * np.array(POND_M) / 2
    return np.asarray(_turned(ring, float(rng.uniform(0, np.pi))) + np.array([x, y]))


def _rows(field: Field) -> TravelGraph:
    """Rows of nodes inside the field, joined at their ends."""
    area = shapely.Polygon(field.polygon).difference(shapely.union_all([shapely.Polygon(r) for r in field.no_go]))
    roomy, (low, high) = area.buffer(-1.0), (field.polygon.min(axis=0), field.polygon.max(axis=0))
    rows: list[list[Stop]] = []
    edges: list[tuple[str, str]] = []
    number = 0
    for y in np.arange(low[1] + 2, high[1], ROW_M).tolist():
        row = []
        for x in np.arange(low[0] + 2, high[0], APART_M).tolist():
            if shapely.intersects_xy(roomy, x, y):
                row.append(Stop(f"n{number}", x, y))
                number += 1
        edges += [(one.name, other.name) for one, other in pairwise(row)]
        if rows and row:
            edges += [(rows[-1][end].name, row[end].name) for end in (0, -1)]
        rows += [row] if row else []
    both = [*edges, *((b, a) for a, b in edges)]
    return TravelGraph.from_edges([stop for row in rows for stop in row], sorted(set(both)), connected=False)


def _graph(rng: np.random.Generator, kind: str, field: Field) -> TravelGraph:
    if kind == ROWS:
        return _rows(field)
    if kind == "lattice":
        return open_lattice(field, SPACING_M * 0.7, margin_m=1.0).graph
    low, high = field.polygon.min(axis=0) - 8, field.polygon.max(axis=0) + 8
    columns, rows = np.ceil((high - low) / SPACING_M).astype(int)
    lattice = np.array([(x, y) for y in range(rows + 1) for x in range(columns + 1)], float) * SPACING_M + low
    xy = lattice + rng.uniform(-0.25, 0.25, lattice.shape) * SPACING_M
    xy = xy[rng.uniform(size=len(xy)) > 0.1]
    stops = [Stop(f"n{number}", float(x), float(y)) for number, (x, y) in enumerate(xy)]
    side = np.zeros(len(xy), bool)
    if kind == "islands":
        normal = rng.normal(size=2)
        side = (xy - xy.mean(axis=0)) @ normal > rng.uniform(-10, 10) * np.hypot(*normal)
    edges = []
    for a, b in _near_pairs(xy):
        if side[a] == side[b] and rng.uniform() > 0.12:
            edges.append((stops[a].name, stops[b].name))
            if rng.uniform() > 0.06:
                edges.append((stops[b].name, stops[a].name))
    return TravelGraph.from_edges(stops, edges, connected=False)


def _can_leave(graph: TravelGraph, stop: Stop, area: BaseGeometry) -> bool:
    """Whether edges inside an area lead from a node to another one, and back."""
    names = graph.names
    inside = shapely.covers(area, shapely.linestrings(graph.xy[graph.edges]))
    edges = [(names[a], names[b]) for a, b in graph.edges[inside].tolist()]
    part = TravelGraph.from_edges(graph.stops, edges, connected=False).components()
    return bool((part == part[graph.index(stop.name)]).sum() > 1)


def _near_pairs(xy: Array) -> list[tuple[int, int]]:
    away_m = np.linalg.norm(xy[:, None] - xy[None], axis=2)
    return [(a, b) for a, b in np.argwhere(away_m < 1.5 * SPACING_M).tolist() if a < b]


def _place_in(rng: np.random.Generator, area: BaseGeometry) -> tuple[float, float]:
    west, south, east, north = area.bounds
    while True:
        x, y = rng.uniform((west, south), (east, north)).tolist()
        if shapely.intersects_xy(area, x, y):
            return x, y


def _turned(ring: Array, angle: float) -> Array:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(ring @ turn.T)
