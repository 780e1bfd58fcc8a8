# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The access to a field as it is now: map of the navigation, cells, home and part of the map can change."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable

from soilmoist_ros.exploration.control.mission_setup import AccessRules, FieldAccess
from soilmoist_ros.exploration.travel.travel import RobotMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import Field

_log = logging.getLogger(__name__)

Place = tuple[float, float]


class CurrentAccess:
    """Makes the access to a field again when something that it depends on changes; an error changes nothing.

    :param field: the field
    :param motion: how the robot moves
    :param rules: where it may drive
    :param home: the name of the stop to return to, as it is now; empty for none
    :param use: called with each new access

    Attributes
    ----------
    field : Field
        the field
    access : FieldAccess or None
        ``None`` before a map of the navigation can be used
    waiting_for : str
        what is missing while there is no access
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
        self.access: FieldAccess | None = None
        self.waiting_for = "the map of the navigation"
        self._motion, self._rules = motion, rules
        self._home, self._use = home, use
        self._graph: TravelGraph | None = None
        self._cell_m: float | None = None
        self._asked_at: Place | None = None  # where the part of the map was last looked for

    def use_graph(self, graph: TravelGraph | None, place: Place | None = None) -> None:
        """Travel along a graph, or straight where nothing is in the way.

        :param graph: the graph
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
