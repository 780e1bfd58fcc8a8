# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Region in which a robot may travel and measure in a field, and its travel model.

The map of the navigation, the cells, the home and the robot's part of the map can change: :class:`CurrentAccess`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.guard.fenced_graph import FencedGraph, Outside
from soilmoist_ros.exploration.travel.lanes import LaneTravel
from soilmoist_ros.exploration.travel.stop import Array, Stop, Way, stops_xy
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion, TravelModel
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.mapping import Field, FieldGrid

_log = logging.getLogger(__name__)

Place = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class AccessRules:
    """Rules for the region in which a robot may drive.

    :param beyond_m: nodes and edges of a travel graph this far outside the field belong to it [m], >= 0; allows
        for errors of the survey
    """

    robot_radius_m: float = 0.0  # distance that its centre keeps from the border and the no-go areas [m], >= 0
    beyond_m: float = 0.1
    outside: Outside = Outside.HOME  # use of nodes and edges further outside
    entry_m: float = 10.0  # the robot may set off this far outside; it then drives straight back in [m], >= 0
    by_name: bool = False  # the navigation is sent names of nodes, and plans its routes itself
    lanes: bool = False  # a car: it turns around only at ends and junctions of the graph


NO_MARGIN = AccessRules()
PAST_M = 0.5
"""Distance that a way past a standing robot keeps in addition, so that noise of the fixes stops nobody [m]."""
_STAYS_M = 0.05
MOVED_M = 2.0
"""A stop that a new map places this far away is another one [m]; frames of robot and field may differ by less."""


class FieldAccess:
    """Stops and travel model of a robot in a field, all inside its fence.

    :param graph: travel graph; straight lines around no-go areas without. Nodes and edges that the fence refuses,
        and those of other parts than the robot's, are not used; :attr:`warning` names them
    :param cell_m: cell size of the map [m]; the field's own if ``None``
    :raises InputError: if the field cannot be gridded, no place or node in it is allowed, or no allowed way leads
        between the robot, the home and the stops
    """

    def __init__(
        self,
        field: Field,
        motion: RobotMotion,
        graph: TravelGraph | None,
        rules: AccessRules = NO_MARGIN,
        cell_m: float | None = None,
        home: str = "",
        place: tuple[float, float] | None = None,
    ) -> None:
        self.grid = field.grid(cell_m)
        self.place = place
        self._given = field, motion, graph, rules, cell_m
        self._rules = rules
        self._named = cell_stops(self.grid) if graph is None else graph.stops
        self.home = self.stop(home) if home else None
        self.travel: TravelModel
        self._fenced: FencedGraph | None = None
        if graph is None:
            self.fence = Fence(field, rules.robot_radius_m)
            self.warning = self.fence.divided()
            self.travel = FreeTravel(motion, (field.polygon,), field.no_go, rules.robot_radius_m)
            inside = self.fence.contains(stops_xy(self._named))
            self.stops = tuple(stop for stop, within in zip(self._named, inside, strict=True) if within)
        else:
            fence = Fence(field, rules.robot_radius_m, rules.beyond_m)
            self._fenced = FencedGraph(graph, fence, rules.outside, home, place)
            self.fence, self.warning = self._fenced.fence, self._fenced.warning
            enters = partial(self.fence.may_enter, entry_m=rules.entry_m)
            self.travel = (LaneTravel if rules.lanes else GraphTravel)(self._fenced.graph, motion, enters)
            self.stops = self._fenced.stops
        if self.home is not None and (refusal := self.refusal(self.home)):
            raise InputError(f"the home {home} is not allowed: {refusal}", "choose another home")

    @property
    def on_graph(self) -> bool:
        """True if the robot travels along a graph."""
        return self._fenced is not None

    def serves(self, place: tuple[float, float]) -> bool:
        """True if a robot at this place can use it; otherwise make one for the place."""
        return self._fenced is None or self._fenced.serves(place)

    def with_home(self, home: str, place: tuple[float, float] | None) -> FieldAccess:
        """The access with another home, for a robot at a place; errors as of :class:`FieldAccess`."""
        return FieldAccess(*self._given, home, place)

    def around(
        self, place: tuple[float, float], others: Sequence[tuple[float, float]], apart_m: float
    ) -> FieldAccess:
        """Access of a robot at a place, by ways that keep apart from places where other robots stand.

        Ways keep :data:`PAST_M` more, and from a robot that stands close by no less than now.

        :raises InputError: if no way is left
        """
        field, motion, graph, rules, cell_m = self._given
        angles = np.arange(16) * (np.pi / 8)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        margin_m = rules.robot_radius_m
        radii = [min(apart_m + PAST_M, math.dist(place, other) - _STAYS_M) - 1.1 * margin_m for other in others]
        rings = [radius * circle + other for other, radius in zip(others, radii, strict=True) if radius > 0]
        home = "" if self.home is None else self.home.name
        if self.home is not None and any(math.dist(self.home.xy, other) < apart_m + PAST_M for other in others):
            home = ""  # somebody stands there: it is refused as a stop, and needs no way
        around = replace(field, no_go=(*field.no_go, *rings))
        return FieldAccess(around, motion, graph, rules, cell_m, home, place)

    def refusal(self, stop: Stop) -> str:
        """Reason why a stop must not be measured at or driven to; empty if it may be."""
        return self.fence.refusal([stop.xy])

    def way(self, place: tuple[float, float], stop: Stop) -> Way:
        """The route from a place to a stop, validated by the fence.

        :raises InputError: if no route leads there, or the fence refuses it
        """
        if refusal := self.refusal(stop):
            raise InputError(f"{stop.name} is not allowed: {refusal}", "choose another stop")
        try:
            corners = self.travel.route(place, stop)
        except ValueError as error:
            raise InputError(str(error), "choose another stop") from None
        there, now = stop.xy, tuple(corners[-1].tolist())
        if math.dist(there, now) > MOVED_M:  # it was chosen on an earlier map
            moved = "{} is at ({:.1f}, {:.1f}) now, not at ({:.1f}, {:.1f})".format(stop.name, *now, *there)
            raise InputError(moved, "choose it again")
        refusal = self.fence.refusal_of_entry(corners[0], corners[min(1, len(corners) - 1)], self._rules.entry_m)
        if refusal or (refusal := self.fence.refusal([*corners[1:], there])):
            raise InputError(f"the route to {stop.name} is not allowed: {refusal}", "drive the robot elsewhere")
        if self._fenced is None:
            return Way(corners)
        if not self._rules.by_name:
            return Way(corners, (stop,))
        names = self._fenced.nodes_to_send(place, stop, self._rules.entry_m)
        return Way(corners, tuple(map(self.stop, names)), self._fenced.choices(place, names))

    def refusal_of_route(self, place: tuple[float, float], path: Array, nodes: Array) -> str:
        """Reason why a route that the navigation announces is not allowed; empty if it is.

        :param place: where the robot is; it drives straight to the begin of the path [m]
        :param path: what it will drive along, shape (k, 2) [m]
        :param nodes: nodes of its graph on the way, shape (n, 2) [m]
        """
        if not len(path):
            return "it has no places"
        refusal = self.fence.refusal_of_entry(place, path[0], self._rules.entry_m) or self.fence.refusal(path)
        if not refusal and len(nodes):
            refusal = self.fence.refusal(nodes) or (self._fenced.refusal(nodes) if self._fenced else "")
        return refusal

    def check_origins(self, place: tuple[float, float]) -> None:
        """Check that the navigation plans from allowed nodes only.

        :raises InputError: if it may plan from another one, so that no goal can be sent from this place
        """
        if self._fenced is not None and self._rules.by_name:
            self._fenced.check_origins(place, self._rules.entry_m)

    def stop(self, name: str) -> Stop:
        """The stop of this name, also one outside the field.

        :raises InputError: if there is none
        """
        named = {stop.name: stop for stop in self._named}
        if name in named:
            return named[name]
        remedy = f"use one of the {len(named)} nodes or cells of this field{did_you_mean(name, list(named))}"
        raise InputError(f"there is no stop {name!r} to return to", remedy)


def cell_stops(grid: FieldGrid) -> tuple[Stop, ...]:
    """A stop at the centre of each cell inside the field, for free travel; named by row and column."""
    rows, columns = np.nonzero(grid.mask)
    return tuple(
        Stop(f"r{row}c{column}", x, y)
        for row, column, (x, y) in zip(rows.tolist(), columns.tolist(), grid.cells.tolist(), strict=True)
    )


class CurrentAccess:
    """Makes the access to a field again when something that it depends on changes; an error changes nothing.

    :param home: the name of the stop to return to, as it is now; empty for none
    """

    def __init__(
        self,
        field: Field,
        motion: RobotMotion,
        rules: AccessRules,
        home: Callable[[], str],
        use: Callable[[FieldAccess], None],
    ) -> None:
        self.field = field
        self.access: FieldAccess | None = None  # before a map of the navigation can be used
        self.waiting_for = "the map of the navigation"
        self._motion, self._rules = motion, rules
        self._home, self._use = home, use
        self._graph: TravelGraph | None = None
        self._cell_m: float | None = None
        self._asked_at: Place | None = None  # where the part of the map was last looked for

    def use_graph(self, graph: TravelGraph | None, place: Place | None = None) -> None:
        """Travel along a graph, or straight where nothing is in the way.

        :param place: where the robot is, so that its part of the map is used; ``None`` to look for that later [m]
        :raises InputError: if it does not fit the field, or does not know the home
        """
        try:
            self._renew(graph, self._cell_m, place)
        except Exception as error:
            self.waiting_for = f"a map that can be used ({error})"
            raise

    def use_cells(self, cell_m: float) -> None:
        """Plan on cells of this size [m].

        :raises InputError: if the field cannot be gridded with them, or does not know the home then
        """
        if self.access is not None and self.access.grid.cell_m != cell_m:
            self._renew(self._graph, cell_m, self.access.place)
        self._cell_m = cell_m

    def use_home(self, place: Place | None) -> None:
        """Return to another home, with the robot at a place.

        :raises InputError: if the home is not known or not allowed
        """
        self._renew(self._graph, self._cell_m, place)

    def use_part(self, place: Place | None) -> str:
        """Use the part of the map where the robot stands; returns why that is not possible, empty if it is."""
        if self.access is not None and place is not None and not self.access.serves(place):
            self._asked_at = place
            try:
                self._renew(self._graph, self._cell_m, place)
            except InputError as error:
                return str(error)
        return ""

    def moved(self, place: Place, radius_m: float) -> None:
        """The robot is at a place: look for its part of the map again once it is farther away than a radius."""
        if self._asked_at is None or math.dist(place, self._asked_at) > radius_m:
            self.use_part(place)

    def opened(self, field: Field, place: Place | None) -> Callable[[], None]:
        """The function that uses another field, whose mapper has yet to publish the cells.

        :raises InputError: if it cannot be used
        """
        access = None if self.access is None else self._made(field, self._graph, None, place)

        def use() -> None:
            self.field, self._cell_m = field, None
            if access is not None:
                self._take(access, self._graph, place)

        return use

    def _renew(self, graph: TravelGraph | None, cell_m: float | None, place: Place | None) -> None:
        self._take(self._made(self.field, graph, cell_m, place), graph, place)

    def _made(
        self, field: Field, graph: TravelGraph | None, cell_m: float | None, place: Place | None
    ) -> FieldAccess:
        return FieldAccess(field, self._motion, graph, self._rules, cell_m, self._home(), place)

    def _take(self, access: FieldAccess, graph: TravelGraph | None, place: Place | None) -> None:
        before = self.access
        if access.warning and (before is None or access.warning != before.warning):
            _log.warning(access.warning)
        if graph is not None and (before is None or access.stops != before.stops):
            _log.info("%d of %d nodes of the topological map are stops", len(access.stops), len(graph.names))
        self.access, self._graph, self._asked_at = access, graph, place
        self._use(access)
