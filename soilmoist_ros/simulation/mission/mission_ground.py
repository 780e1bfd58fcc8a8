# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Region that a simulated robot may travel: the whole field, or the ways of a topological map."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

import numpy as np

from soilmoist_ros.exploration import (
    PAST_M,
    ROBOT_RADIUS_M,
    Fence,
    FencedGraph,
    FreeTravel,
    GraphTravel,
    LaneTravel,
    Outside,
    RobotMotion,
    Stop,
    TopologicalMap,
    TravelModel,
    cell_stops,
    keep_apart_m,
    make_topological_map,
    open_lattice,
    read_travel_map,
    stops_xy,
)
from soilmoist_ros.foundation import InputError, move_between
from soilmoist_ros.mapping import Field, FieldGrid
from soilmoist_ros.simulation.mission.settings import MissionSettings

_log = logging.getLogger(__name__)

LATTICE_NODES = 300
"""Approximate number of nodes of the default lattice, used when travel needs a graph and none is given."""
_SAME_DATUM_M = 0.1  # distance between datums from which a warning names it [m]
_LATTICE_TIME = datetime(2026, 1, 1, tzinfo=UTC)


def travel_and_stops(
    field: Field, grid: FieldGrid, motion: RobotMotion, settings: MissionSettings
) -> tuple[TravelModel, tuple[Stop, ...]]:
    """Travel model of the robot and its candidate stops, all in the field and out of its no-go areas.

    :raises InputError: if the graph cannot be used
    """
    if divided := Fence(field).divided():
        _log.warning(divided)
    if settings.travel == "free":
        return FreeTravel(motion, (field.polygon,), field.no_go), _cell_stops(grid)
    on_lanes = settings.travel == "lanes"
    outside = Outside.WAY if on_lanes else Outside.NEVER
    fenced = fenced_map(field, mission_map(field, grid, settings.graph), outside)
    return (LaneTravel if on_lanes else GraphTravel)(fenced.graph, motion, fenced.fence.area.allows), fenced.stops


_cell_stops = lru_cache(maxsize=4)(cell_stops)


def mission_map(field: Field, grid: FieldGrid, graph: str | None = None) -> TopologicalMap:
    """Topological map of a field: from a file, or an open lattice of about :data:`LATTICE_NODES` nodes."""
    if graph is not None:
        return _on_field(read_travel_map(Path(graph), field), field)
    lattice = open_lattice(field, math.sqrt(grid.area_m2 / LATTICE_NODES)).graph
    return make_topological_map(lattice, "lattice", _LATTICE_TIME)


def _on_field(found: TopologicalMap, field: Field) -> TopologicalMap:
    """The map with its nodes in the plane of the field, which may have another datum than the map."""
    if found.datum is None:
        return found
    centre = field.polygon.mean(axis=0)
    try:
        move = move_between(field.frame, found.datum, about_m=centre)
    except ValueError as error:
        raise InputError(f"the map is not of the field {field.name!r}: {error}", "check the map's datum") from None
    away_m = math.dist(move.place((0.0, 0.0)), (0.0, 0.0))
    if away_m > _SAME_DATUM_M:
        _log.warning("the datum of the map is %.1f m from the field's: its nodes are placed by its own", away_m)
    return replace(found, graph=found.graph.moved(move.inverse))


def fenced_map(field: Field, navigated: TopologicalMap, outside: Outside = Outside.NEVER) -> FencedGraph:
    """The largest part of a topological map that stays in the field and out of its no-go areas; logs the rest.

    :param outside: use of nodes and edges outside the field
    :raises InputError: if no node does
    """
    fenced = FencedGraph(navigated.graph, Fence(field), outside)
    if fenced.warning:
        _log.warning(fenced.warning)
    return fenced


def start_stops(field: Field, stops: Sequence[Stop], settings: MissionSettings) -> tuple[Stop, ...]:
    """Start of each robot: the stop nearest to its own corner of the field that is far enough from those before.

    Robots that start nearer than their planners keep them apart would stand in each other's way. The first ways of
    all lead to the middle, so they start at different corners.

    :raises InputError: if there are too few such stops
    """
    xy, starts = stops_xy(stops), list[Stop]()
    noise_m = 3 * math.sqrt(2) * settings.position_sd_m  # three standard deviations of the distance of two robots
    apart_m = keep_apart_m(ROBOT_RADIUS_M) + PAST_M + noise_m
    free = np.ones(len(stops), bool)
    while len(starts) < settings.robots:
        corner = field.polygon[len(starts) % len(field.polygon)]
        nearest = int(np.argmin(np.where(free, ((xy - corner) ** 2).sum(axis=1), math.inf)))
        if not free[nearest]:
            raise InputError(
                f"{settings.robots} robots cannot start on the field {field.name!r}: only {len(starts)} of its "
                f"{len(stops)} stops are {apart_m:.1f} m apart",
                f"simulate at most {len(starts)}, or give a larger field or more stops",
            )
        starts.append(stops[nearest])
        free &= np.hypot(*(xy - xy[nearest]).T) >= apart_m
    return tuple(starts)
