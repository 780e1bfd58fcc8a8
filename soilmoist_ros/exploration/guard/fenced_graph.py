# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The part of a navigation's map that the fence allows, and how to send a robot along it.

A topological navigation plans routes itself: from a node near the robot, over the shortest route of its whole map,
even through a no-go area. A goal is sent as it is only if every shortest route of the whole map stays inside the
fence. Otherwise the robot is sent node by node along an allowed route.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import InputError, distance_text, listing
from soilmoist_ros.mapping import Misplaced

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

AT_NODE_M = 1.5  # a robot this close to a node is at the node: the navigation plans from there [m]
ON_EDGE_M = 1.5  # the navigation may also plan from an end of an edge this close to the robot [m]
SAME_NODE_M = 0.5  # a place this close to a node of the map is the node [m]
_MAX_HOME_M = 5000.0  # distance of the home from the field beyond which it is a mistake [m]
_LONGER, _LONGER_M = 1.1, 2.0
"""A navigation that counts lengths differently may prefer a route that is longer by this factor, and metres."""
_TIE_M = 1e-3  # routes whose lengths differ by less count as equally long [m]


class Outside(StrEnum):
    """Use of nodes and edges outside the field; no-go areas are never entered."""

    NEVER = "never"
    HOME = "home"
    WAY = "way"


class FencedGraph:
    """Nodes and edges that the robot may use: one connected part of a map, and ways to home and from the robot.

    :param outside: use of nodes and edges outside the fence that avoid the no-go areas: none, only the shortest
        ways between the field and home or robot, or all of them. None is measured at
    :param place: where the robot is [m]. Its part of the map is used; without a place that of the home, or the
        largest
    :raises InputError: if no node lies in the fence, or no allowed way leads from there to the robot or home
    """

    def __init__(
        self,
        whole: TravelGraph,
        fence: Fence,
        outside: Outside = Outside.NEVER,
        home: str = "",
        place: tuple[float, float] | None = None,
    ) -> None:
        inside = fence.contains(whole.xy)
        if not inside.any() or _in_degrees(whole, fence):
            raise _elsewhere(whole, fence)
        start, end = whole.xy[whole.edges[:, 0]], whole.xy[whole.edges[:, 1]]
        within = fence.area.allows(start, end)
        clear = within if outside is Outside.NEVER else within | fence.avoids_no_go(start, end)
        if whole.barred is not None:
            within, clear = within & ~whole.barred, clear & ~whole.barred
        self._beyond = _home_outside(whole, fence, home) if home else ""
        self.whole, self.fence = whole, fence
        self._usable = inside if outside is Outside.NEVER else inside | fence.avoids_no_go(whole.xy, whole.xy)
        self._passable = whole.with_edges(clear)
        wide = outside is Outside.WAY
        core = self._usable if wide else inside
        used = clear if wide else within
        main = self._main_part(core, inside, whole.with_edges(used), place, home)
        used = used & main[whole.edges].all(axis=1)
        self._nodes = nodes = main.copy()
        for number, what in self._ends(place, home):
            for way in self._ways_to(number, main, what, lambda: self._lost(inside, within)):
                nodes[way] = True
                used |= clear & _along(whole, way)
        beyond = used & ~within
        self.graph = whole.with_edges(used).part(nodes)
        self.stops = tuple(stop for stop, kept in zip(whole.stops, main & inside, strict=True) if kept)
        if beyond.any():
            corridors = np.stack([start, end], axis=1)[beyond]
            self.fence = Fence(fence.field, fence.margin_m, fence.beyond_m, corridors)
        self._forbidden = ~(within | used)
        self._known: dict[int, tuple[Array, Array]] = {}
        beyond_text = f"the home {home} lies {self._beyond}: the robot drives there and back outside"
        self.warning = ". ".join(filter(None, (self._lost(inside, within | used), self._beyond and beyond_text)))

    def serves(self, place: tuple[float, float]) -> bool:
        """True if the part that is used is the one where the robot stands."""
        return bool(self._nodes[self._nearest(place)])

    # Which part of the map ------------------------------------------------------------------------------------

    def _nearest(self, place: tuple[float, float]) -> int:
        """The usable node nearest to a place."""
        away_m = np.hypot(*(self.whole.xy - place).T)
        return int(np.argmin(np.where(self._usable, away_m, np.inf)))

    def _ends(self, place: tuple[float, float] | None, home: str) -> list[tuple[int, str]]:
        """Nodes that need a way to the part that is used, each with what it is."""
        ends = [] if place is None else [(self._nearest(place), "")]
        return [*ends, (self.whole.index(home), home)] if home else ends

    def _main_part(
        self, core: Flags, inside: Flags, graph: TravelGraph, place: tuple[float, float] | None, home: str
    ) -> Flags:
        """Nodes of the part that is used: each can be reached from the others.

        It is the part of the robot, or else of the home. If that is a single node, the largest part that can be
        reached from there is used; without robot and home, the largest of all.
        """
        part = np.where(core, graph.components(), -1)
        size = np.bincount(part[inside], minlength=part.max() + 1)
        chosen = _largest(size, part[inside])
        for number, _ in self._ends(place, home)[:1]:
            if core[number] and size[part[number]] > 1:
                chosen = int(part[number])
                break
            reached = part[np.isfinite(self._passable.routes_from(number)[0]) & inside]
            if len(reached) and size[_largest(size, reached)] > 1:
                chosen = _largest(size, reached)
        return np.asarray(part == chosen)

    def _ways_to(self, number: int, main: Flags, home: str, lost: Callable[[], str]) -> list[list[int]]:
        """Shortest ways from a node to the part that is used, and back; none if it belongs to the part."""
        if main[number]:
            return []
        ways = [self._way(number, main, back) for back in (False, True)]
        if not ways[0] or (home and not ways[1]):
            name = self.whole.names[number]
            outside = f", {self._beyond}," if self._beyond else ""
            what = f"the home {home}{outside}" if home else f"{name}, where the robot stands,"
            one = f"only the way {'to' if ways[0] else 'from'} it is missing" if any(ways) else ""
            both = f"{what} and the nodes of the topological map in the field"
            why = "; ".join(filter(None, (both, one, lost())))
            raise InputError(
                f"no way that is allowed leads between {why}",
                "check the no-go areas and the parameter outside, or choose another node",
            )
        return ways

    def _way(self, number: int, main: Flags, back: bool) -> list[int]:
        if not self._usable[number]:
            return []
        lengths, before = self._passable.routes_from(number, back)
        if not np.isfinite(lengths[main]).any():
            return []
        way = [int(np.argmin(np.where(main, lengths, np.inf)))]
        while way[-1] != number:
            way.append(int(before[way[-1]]))
        return way if back else way[::-1]

    def _lost(self, inside: Flags, allowed: Flags) -> str:
        """One sentence about nodes and edges that are not used; empty if all are."""
        names, xy = np.array(self.whole.names), self.whole.xy
        no_go = ~inside & ~self.fence.avoids_no_go(xy, xy)
        outside = ~inside & ~no_go & ~self._nodes
        groups = {
            "in a no-go area": no_go,
            "outside the field": outside,
            "without a way there and back from the others": ~(self._nodes | no_go | outside),
        }
        found = [
            f"{flags.sum()} {what} ({listing(names[flags])})" for what, flags in groups.items() if flags.any()
        ]
        lost = ~allowed & (self._nodes | inside)[self.whole.edges].all(axis=1)
        if self.whole.barred is not None:  # the map's own doubts name them
            lost &= ~self.whole.barred
        edges = dict.fromkeys(tuple(sorted(pair)) for pair in names[self.whole.edges[lost]].tolist())
        if edges:
            said = listing(f"{start} - {end}" for start, end in edges)
            count = "1 edge" if len(edges) == 1 else f"{len(edges)} edges"
            found.append(f"{count} across the border or a no-go area ({said})")
        if self.fence.margin_m > 0 and (edges or no_go.any()):
            bare = Fence(self.fence.field, 0.0, self.fence.beyond_m)
            start, end = (names[self.whole.edges[lost, side]] for side in (0, 1))
            free = bare.area.allows(*(xy[self.whole.edges[lost, side]] for side in (0, 1)))
            narrow = {tuple(sorted(pair)) for pair in zip(start[free], end[free], strict=True)}
            if close := int((no_go & bare.contains(xy)).sum()) + len(narrow):
                found.append(f"{close} of them only for robot_radius_m, {self.fence.margin_m:g} m")
        return f"not used of the topological map: {'; '.join(found)}" if found else ""

    # How to send the robot ------------------------------------------------------------------------------------

    def nodes_to_send(self, place: tuple[float, float], stop: Stop, entry_m: float) -> tuple[str, ...]:
        """Names of the nodes to send one after the other to a topological navigation, the stop last.

        :param entry_m: the robot may be this far outside [m]
        :raises InputError: if the navigation could plan from a node that is not allowed, or no way leads there
        """
        self.check_origins(place, entry_m)
        names, origins = self.whole.names, self.origins(place)
        path = [self.whole.index(name) for name in self.graph.path(names[origins[0]], stop.name)]
        if not path:
            raise InputError(f"no allowed way leads from {names[origins[0]]} to {stop.name}", "choose another")
        sent = [self._last_safe(path, origins, lambda *leg: self._drives_in(place, entry_m, *leg))]
        while sent[-1] != path[-1]:
            sent.append(self._last_safe(path[path.index(sent[-1]) + 1 :], sent[-1:]))
        return tuple(names[number] for number in sent)

    def check_origins(self, place: tuple[float, float], entry_m: float) -> None:
        """Check the nodes from which the navigation may plan.

        :param entry_m: the robot may be this far outside [m]
        :raises InputError: if one of them is not allowed
        """
        for origin in self.origins(place):
            why = self.fence.refusal_of_entry(place, self.whole.xy[origin], entry_m)
            if not self._nodes[origin]:
                why = why or "it is not connected with the nodes that are used"
            if why:
                near = f"{self.whole.names[origin]}, which is near the robot but not allowed"
                raise InputError(
                    f"the navigation may plan from {near}: {why}", "drive the robot to an allowed node"
                )

    def _last_safe(
        self, ahead: list[int], origins: list[int], check: Callable[[int, int], bool] = lambda *leg: True
    ) -> int:
        """The last node ahead to which every route of the navigation is allowed, whatever its origin."""
        for node in reversed(ahead):
            if all(self._is_safe(origin, node) and check(origin, node) for origin in origins):
                return node
        names = listing(self.whole.names[origin] for origin in origins)
        raise InputError(
            f"the navigation could leave the allowed ways on its route from {names}",
            "drive the robot to an allowed node",
        )

    def _drives_in(self, place: tuple[float, float], entry_m: float, origin: int, target: int) -> bool:
        """True if a robot away from its origin may drive straight to the node after it, as some versions do."""
        if math.dist(place, self.whole.xy[origin]) <= AT_NODE_M or origin == target:
            return True
        names = self.whole.names
        following = self.whole.index(self.whole.path(names[origin], names[target])[1])
        return not self.fence.refusal_of_entry(place, self.whole.xy[following], entry_m)

    def choices(self, place: tuple[float, float], names: Sequence[str]) -> Array:
        """Lines that the navigation may follow to nodes sent one after the other, shape (k, 2, 2) [m].

        These are the edges of all routes that are about as short as the shortest, and the way to their begin.
        """
        whole, origins = self.whole, self.origins(place)
        begin, end = whole.edges.T
        used = np.zeros(len(whole.edges), bool)
        entered = list(origins)
        for leg, name in enumerate(names):
            target = whole.index(name)
            to = whole.routes_from(target, back=True)[0]
            for origin in origins:
                through = whole.routes_to_all(origin)[0][begin] + whole.length_m + to[end]
                used |= through <= _LONGER * to[origin] + _LONGER_M
            if leg == 0:  # some versions drive straight to the node after the origin
                entered += end[used & np.isin(begin, origins)].tolist()
            origins = [target]
        edges = np.stack([whole.xy[begin[used]], whole.xy[end[used]]], axis=1)
        first = np.stack(np.broadcast_arrays(np.asarray(place, float), whole.xy[entered]), axis=1)
        return np.concatenate([edges, first])

    def refusal(self, nodes: Array) -> str:
        """Reason why straight lines between nodes, shape (k, 2) [m], are not allowed: edges that the map bars."""
        names, xy, edges, barred = self.whole.names, self.whole.xy, self.whole.edges, self.whole.barred
        for begin, end in pairwise(nodes):
            at = np.hypot(*(xy[edges] - np.array([begin, end])).T).max(axis=0) < SAME_NODE_M
            if barred is not None and at.any() and barred[at].all():
                start, stop = edges[np.argmax(at)]
                return f"it takes the edge {names[start]} - {names[stop]}, which is not for this robot"
        return ""

    def origins(self, place: tuple[float, float]) -> list[int]:
        """Nodes from which the navigation may plan: the nearest one, then the ends of edges at the robot."""
        here = np.asarray(place, float)
        away_m = np.hypot(*(self.whole.xy - here).T)
        nearest = int(np.argmin(away_m))
        if away_m[nearest] <= AT_NODE_M or not len(self.whole.edges):
            return [nearest]
        start, end = self.whole.xy[self.whole.edges[:, 0]], self.whole.xy[self.whole.edges[:, 1]]
        close = _distance_m(here, start, end) <= ON_EDGE_M
        return list(dict.fromkeys([nearest, *self.whole.edges[close].ravel().tolist()]))

    def _is_safe(self, start: int, end: int) -> bool:
        """True if every shortest route of the whole map avoids the forbidden edges."""
        shortest, forbidden = self._lengths_from(start)
        return bool(forbidden[end] > shortest[end] + _TIE_M)

    def _lengths_from(self, start: int) -> tuple[Array, Array]:
        """Lengths of the shortest routes over any edges, and of the shortest routes with a forbidden edge [m]."""
        if start not in self._known:
            whole, size, bad = self.whole, len(self.whole.names), self._forbidden
            # Two copies of the map; each forbidden edge also leads from the first to the second.
            doubled = TravelGraph(
                (*whole.names, *whole.names),
                np.concatenate([whole.xy, whole.xy]),
                np.concatenate([whole.edges, whole.edges[bad] + [0, size], whole.edges + size]),
                np.concatenate([whole.length_m, whole.length_m[bad], whole.length_m]),
            )
            lengths = doubled.routes_from(start)[0]
            self._known[start] = (lengths[:size], lengths[size:])
        return self._known[start]


def _along(graph: TravelGraph, way: Iterable[int]) -> Flags:
    """Edges that a way takes, shape (e,)."""
    steps = set(pairwise(way))
    return np.array([(start, end) in steps for start, end in graph.edges.tolist()], bool)


def _largest(size: NDArray[np.intp], parts: NDArray[np.intp]) -> int:
    """The part with the most nodes; the first of equals."""
    found = np.unique(parts)
    return int(found[np.argmax(size[found])])


def _distance_m(place: Array, start: Array, end: Array) -> Array:
    """Distances from a place to straight lines, shape (k,) [m]."""
    along = end - start
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((place - start) * along).sum(axis=1) / square, 0.0, 1.0)
    return np.asarray(np.hypot(*(start + share[:, None] * along - place).T))


def _home_outside(graph: TravelGraph, fence: Fence, home: str) -> str:
    """Distance of a home from the field, in words; empty if it lies in the field.

    :raises InputError: if it lies in a no-go area, or too far away
    """
    import shapely

    place = graph.xy[graph.index(home)]
    if fence.contains(place)[0]:
        return ""
    if not fence.avoids_no_go(place, place)[0]:
        raise InputError(f"the home {home} is not allowed: {fence.refusal(place)}", "choose another home")
    away_m = float(shapely.Polygon(fence.field.polygon).distance(shapely.Point(place)))
    if away_m > _MAX_HOME_M:
        what = f"the home {home} lies {distance_text(away_m)} from the field {fence.field.name!r}"
        raise InputError(what, "choose a node near the field, and check the places of the map")
    return f"{away_m:.1f} m outside the field" if away_m < 10 else f"{distance_text(away_m)} outside the field"


_METRES = "the map's places must be metres east and north of the field's datum, or of the one that the map names"
_DEGREES = "the places of its nodes are degrees: write metres east and north of the field's datum"
_REMEDIES = {
    Misplaced.LONLAT: _DEGREES,
    Misplaced.LATLON: _DEGREES,
    Misplaced.PROJECTED: "its places are those of a map projection, such as UTM, or its datum is wrong: write "
    "metres from the datum",
    Misplaced.SWAPPED: "with x and y swapped nodes are in the field: x is east, y north",
    Misplaced.FEET: f"{_METRES}: read as feet, nodes are in the field",
    None: _METRES,
}


def _cause(graph: TravelGraph, fence: Fence) -> Misplaced | None:
    import shapely

    return Misplaced.of(shapely.MultiPoint(graph.xy), shapely.Polygon(fence.field.polygon), fence.field.frame)


def _in_degrees(graph: TravelGraph, fence: Fence) -> bool:
    """True if the places of a map are rather degrees: as numbers of metres, they may even lie in the field."""
    return len(graph.xy) > 1 and _cause(graph, fence) in (Misplaced.LONLAT, Misplaced.LATLON)


def _elsewhere(graph: TravelGraph, fence: Fence) -> InputError:
    """The error of a map none of whose nodes is in the field, with its distance and the likely cause."""
    import shapely

    (west, south), (east, north) = graph.xy.min(axis=0), graph.xy.max(axis=0)
    away_m, remedy = min(map(fence.outside_m, graph.xy)), _REMEDIES[_cause(graph, fence)]
    within = shapely.intersects_xy(shapely.Polygon(fence.field.polygon), graph.xy)
    if within.any() and not _in_degrees(graph, fence):
        remedy = f"nodes are in the field: check its no-go areas, and robot_radius_m ({fence.margin_m:g} m)"
    return InputError(
        f"no node of the topological map lies in the field {fence.field.name!r} and outside its no-go areas: they "
        f"are at x {west:.0f} .. {east:.0f} m, y {south:.0f} .. {north:.0f} m, {distance_text(away_m)} away",
        remedy,
    )
