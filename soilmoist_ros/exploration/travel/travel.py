# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Routes and travel times, on straight lines or along a travel graph; motion is learned from legs driven."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import DrivableArea, Stop, stops_xy
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import squared_distances

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class RobotMotion:
    """Motion of the robot; the defaults are those of the published experiments.

    :param metre_cost_s: time that it is worth to avoid a metre [s/m], >= 0; makes it drive less. It counts where
        tours are compared, never on the clock
    """

    speed_mps: float = 0.6  # speed on the way [m/s], > 0
    stop_overhead_s: float = 12.0  # time lost at each stop: braking, settling, the next goal [s], >= 0
    metre_cost_s: float = 0.0

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value, low = getattr(self, name), ">" if name == "speed_mps" else ">="
            if not (np.isfinite(value) and value >= 0) or (low == ">" and value == 0):
                raise ValueError(f"{name} must be {low} 0 and finite, got {value}")

    def travel_s(self, length_m: ArrayLike) -> Array:
        """Time for lengths of routes, one stop overhead included [s]; inf for an infinite length."""
        return np.asarray(np.asarray(length_m, float) / self.speed_mps + self.stop_overhead_s)


def polyline_length_m(polyline: Array) -> float:
    """Length of a route given by its corners, shape (p, 2) [m]."""
    return float(np.hypot(*np.diff(polyline, axis=0).T).sum())


def along(polyline: Array, shares: Array) -> Array:
    """Places at shares of the length of a route, shape (m, 2) [m]."""
    reached = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(polyline, axis=0).T))])
    return np.column_stack([np.interp(shares * reached[-1], reached, axis) for axis in polyline.T])


class TravelModel(ABC):
    """Routes and travel times. A route is the shortest one, and its time depends on its length."""

    motion: RobotMotion

    def moved(self, place: tuple[float, float]) -> None:  # noqa: B027 - it matters on lanes only
        """The robot is at a place [m]."""

    @abstractmethod
    def route(self, from_xy: ArrayLike, stop: Stop) -> Array:
        """Corners of the route from a place to a stop, both included, shape (p, 2) [m].

        :raises ValueError: if the stop cannot be reached
        """

    def along(self, from_xy: ArrayLike, stops: Sequence[Stop], shares: Array) -> Array:
        """Places at shares of the way to each stop, 0..1, shape (k, m); shape (k, m, 2) [m]."""
        ways = self._ways(np.asarray(from_xy, float), stops)
        return np.array([along(way, share) for way, share in zip(ways, shares, strict=True)])

    def _ways(self, start: Array, stops: Sequence[Stop]) -> list[Array]:
        """Routes to stops; only the start for those out of reach."""
        reached = np.isfinite(self.lengths_m(start, stops))
        return [self.route(start, stop) if ok else start[None] for stop, ok in zip(stops, reached, strict=True)]

    @abstractmethod
    def lengths_m(self, from_xy: Array, stops: Sequence[Stop]) -> Array:
        """Lengths of the routes from a place, shape (k,) [m]; inf if unreachable."""

    def slower_m(self, way: Array, speed_mps: float = 0.0) -> float:
        """Length that limits of the speed add to a way: a longer one would take as long without them [m].

        :param speed_mps: speed without limits; by default that of the motion
        """
        return 0.0

    def _slower_to_m(self, start: Array, stops: Sequence[Stop]) -> Array:
        """As :meth:`slower_m` of the routes from a place, shape (k,) [m]."""
        return np.zeros(len(stops))

    def travel_s(self, from_xy: ArrayLike, stops: Sequence[Stop]) -> Array:
        """Time from a place to each stop, one stop overhead included, shape (k,) [s]; inf if unreachable."""
        if not len(stops):
            return np.empty(0)
        start = np.asarray(from_xy, float)
        return self.motion.travel_s(self.lengths_m(start, stops) + self._slower_to_m(start, stops))

    @abstractmethod
    def between_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """Times between some of the stops, from row to column, shape (m, m) [s]; 0 on the diagonal."""

    @abstractmethod
    def legs_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """Times from each of the stops of a route to the next, shape (m - 1,) [s]."""


_PAIRS = 10_000  # number of pairs of places whose ways around corners are compared at once


class FreeTravel(TravelModel):
    """Straight lines, or the shortest route around the field's border and the no-go areas.

    Routes bend at corners of the border and of the no-go areas (a visibility graph), and keep the margin. A robot
    outside first drives straight to the nearest place inside. Stops outside, or in another part of the field, are
    unreachable.

    :param polygons: outlines of the field, each of shape (k, 2) [m]; without any, all routes are straight
    :param margin_m: distance to keep from the border and the no-go areas, such as the robot's radius [m], >= 0
    """

    def __init__(
        self,
        motion: RobotMotion,
        polygons: Sequence[ArrayLike] = (),
        no_go: Sequence[ArrayLike] = (),
        margin_m: float = 0.0,
    ) -> None:
        self.motion = motion
        self._area = DrivableArea(polygons, no_go, margin_m) if len(polygons) else None
        self._seen: dict[tuple[float, float], Array] = {}
        self._asked: list[tuple[tuple[Stop, ...], Array, NDArray[np.bool_]]] = []

    def route(self, from_xy: ArrayLike, stop: Stop) -> Array:
        """See :class:`TravelModel`."""
        begin, end = np.asarray(from_xy, float), np.array([stop.x_m, stop.y_m])
        start = begin if self._area is None else self._area.nearest(begin)
        lead = [] if np.array_equal(start, begin) else [begin]
        if self._area is None or self._area.allows(start, end)[0]:
            return np.array([*lead, start, end])
        lengths, before = self._corner_ways
        total = self._to_corners(start)[:, None] + lengths + self._to_corners(end)
        if not (total.size and np.isfinite(total.min())):
            raise ValueError(f"{stop.name} cannot be reached from ({begin[0]:g}, {begin[1]:g})")
        first, corner = (int(number) for number in np.unravel_index(np.argmin(total), total.shape))
        bends = [corner]
        while bends[-1] != first:
            bends.append(int(before[first, bends[-1]]))
        corners = self._area.turning_corners[bends[::-1]]
        return np.array([*lead, start, *corners, end])

    def between_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """See :class:`TravelModel`."""
        places, inside = self._places(stops)
        places, inside = places[indices], inside[indices]
        lengths = np.sqrt(squared_distances(places, places))
        if self._area is not None and not self._area.is_convex:
            row, other = np.triu_indices(len(places), 1)
            lengths[row, other] = lengths[other, row] = self._around_m(places, row, other)
        lengths[~inside] = lengths[:, ~inside] = np.inf
        times = self.motion.travel_s(lengths)
        np.fill_diagonal(times, 0.0)
        return times

    def legs_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """See :class:`TravelModel`."""
        places, inside = self._places(stops)
        places, inside = places[indices], inside[indices]
        number = np.arange(len(places))
        lengths = self._around_m(places, number[:-1], number[1:])
        return self.motion.travel_s(np.where(inside[:-1] & inside[1:], lengths, np.inf))

    def _around_m(self, places: Array, starts: Indices, ends: Indices) -> Array:
        """Lengths of the routes between pairs of places inside, given by their numbers [m]; inf if unreachable."""
        lengths = np.hypot(*(places[ends] - places[starts]).T)
        if self._area is None or self._area.is_convex or not len(starts):
            return np.asarray(lengths)
        blocked = np.flatnonzero(~self._area.allows(places[starts], places[ends]))
        if len(blocked):
            ways = self._corner_ways[0]
            first, start = np.unique(starts[blocked], return_inverse=True)
            last, end = np.unique(ends[blocked], return_inverse=True)
            reach, seen = (np.array([self._to_corners(one) for one in places[used]]) for used in (first, last))
            reach = np.array([(row[:, None] + ways).min(axis=0, initial=np.inf) for row in reach])
            for some in np.array_split(np.arange(len(blocked)), -(-len(blocked) // _PAIRS)):  # to limit memory
                around_m = reach[start[some]] + seen[end[some]]
                lengths[blocked[some]] = around_m.min(axis=1, initial=np.inf)
        return np.asarray(lengths)

    def along(self, from_xy: ArrayLike, stops: Sequence[Stop], shares: Array) -> Array:
        """See :class:`TravelModel`; quick where most ways are straight, as a planner asks for hundreds."""
        start = np.asarray(from_xy, float)
        ends, inside = self._places(stops)
        places = start + shares[:, :, None] * (ends - start)[:, None, :]
        straight = np.ones(len(ends), bool)
        if self._area is not None:
            straight = inside & self._area.allows(start, ends)
        for row in np.flatnonzero(~straight).tolist():
            places[row] = along(self.route(start, stops[row]), shares[row])
        return np.asarray(places)

    def lengths_m(self, from_xy: Array, stops: Sequence[Stop]) -> Array:
        """See :class:`TravelModel`."""
        places, inside = self._places(stops)
        if self._area is None:
            return np.asarray(np.hypot(*(places - from_xy).T))
        start = self._area.nearest(from_xy)
        if self._area.is_convex:
            lengths = np.where(inside, np.hypot(*(places - start).T), np.inf)
        else:
            ends = np.arange(len(places)) + 1
            lengths = self._around_m(np.vstack([start, places]), np.zeros_like(ends), ends)
        return np.asarray(lengths + np.hypot(*(start - from_xy)))

    def _places(self, stops: Sequence[Stop]) -> tuple[Array, NDArray[np.bool_]]:
        """Places of stops, and whether each is inside the field; cached for the last two tuples."""
        for asked in self._asked:
            if asked[0] is stops:
                self._asked = [*(each for each in self._asked if each is not asked), asked]
                return asked[1:]
        places = stops_xy(stops)
        inside = np.ones(len(places), bool) if self._area is None else self._area.contains(places)
        if isinstance(stops, tuple):
            self._asked = [*self._asked[-1:], (stops, places, inside)]
        return places, inside

    def _to_corners(self, place: Array) -> Array:
        """Straight distance from a place to each corner that can be seen from it, inf to others, shape (c,)."""
        key = (float(place[0]), float(place[1]))
        if key not in self._seen:
            assert self._area is not None
            corners = self._area.turning_corners
            straight = np.hypot(*(corners - place).T)
            blocked = ~self._area.allows(place, corners) if len(corners) else np.zeros(0, bool)
            self._seen[key] = np.where(blocked, np.inf, straight)
        return self._seen[key]

    @cached_property
    def _corner_ways(self) -> tuple[Array, Indices]:
        """Lengths of the shortest routes between corners, and the corner before each on the route."""
        from scipy.sparse.csgraph import dijkstra

        assert self._area is not None
        corners = self._area.turning_corners
        if not len(corners):
            return np.empty((0, 0)), np.empty((0, 0), np.intp)
        lengths, before = dijkstra(
            np.array([self._to_corners(corner) for corner in corners]), return_predecessors=True
        )
        return np.asarray(lengths), np.asarray(before)


class GraphTravel(TravelModel):
    """Shortest routes along a travel graph; the robot enters the graph at the nearest node.

    :param enters: whether a robot at a place, shape (2,), may drive straight to others, shape (k, 2): it enters
        the graph at the nearest node of those, if there is one
    """

    def __init__(
        self, graph: TravelGraph, motion: RobotMotion, enters: Callable[[Array, Array], Flags] | None = None
    ) -> None:
        self.graph = graph
        self.motion = motion
        self._enters = enters

    def slower_m(self, way: Array, speed_mps: float = 0.0) -> float:
        """See :class:`TravelModel`."""
        return self.graph.slower_m(way, speed_mps or self.motion.speed_mps)

    def _slower_to_m(self, start: Array, stops: Sequence[Stop]) -> Array:
        """See :class:`TravelModel`."""
        entry = self.graph.index(self._entry(start))
        return self.graph.slower_to_all_m(entry, self.motion.speed_mps)[self._nodes(stops)]

    def _as_long_m(self, node: int) -> Array:
        """Lengths of the routes from a node to all, with :meth:`slower_m` [m]."""
        return self.graph.routes_to_all(node)[0] + self.graph.slower_to_all_m(node, self.motion.speed_mps)

    def route(self, from_xy: ArrayLike, stop: Stop) -> Array:
        """See :class:`TravelModel`."""
        start = np.asarray(from_xy, float)
        entry = self._entry(start)
        way = self.graph.path(entry, stop.name)
        if not way:
            raise ValueError(f"no way of the graph leads from {entry} to {stop.name}")
        corners = self.graph.xy[[self.graph.index(name) for name in way]]
        if np.array_equal(corners[0], start) and len(corners) > 1:
            return corners
        return np.vstack([start, corners])

    def between_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """See :class:`TravelModel`."""
        nodes = self._nodes([stops[int(index)] for index in indices])
        lengths = np.array([self._as_long_m(node)[nodes] for node in nodes])
        times = self.motion.travel_s(lengths.reshape(len(nodes), len(nodes)))
        np.fill_diagonal(times, 0.0)
        return times

    def legs_s(self, stops: Sequence[Stop], indices: Indices) -> Array:
        """See :class:`TravelModel`."""
        nodes = self._nodes([stops[int(index)] for index in indices])
        lengths = [self._as_long_m(start)[end] for start, end in pairwise(nodes)]
        return self.motion.travel_s(np.array(lengths, float))

    def lengths_m(self, from_xy: Array, stops: Sequence[Stop]) -> Array:
        """See :class:`TravelModel`."""
        entry = self.graph.index(self._entry(from_xy))
        lead = np.hypot(*(self.graph.xy[entry] - from_xy))
        return np.asarray(self.graph.routes_to_all(entry)[0][self._nodes(stops)] + lead)

    def _nodes(self, stops: Sequence[Stop]) -> list[int]:
        return [self.graph.index(stop.name) for stop in stops]

    def _entry(self, place: Array) -> str:
        """Node at which a robot enters the graph."""
        nearest = self.graph.nearest(place)
        xy = self.graph.xy
        if self._enters is None or self._enters(place, xy[[self.graph.index(nearest)]])[0]:
            return nearest
        free = self._enters(place, xy)
        if not free.any():
            return nearest
        return self.graph.names[int(np.argmin(np.where(free, np.hypot(*(xy - place).T), np.inf)))]


# Real motion of the robot: speed and stop overhead, learned from the legs that it has driven ---------------------

MAX_LEGS = 100  # number of the last legs that count: ground and battery change
PACE_SD = 0.3  # prior standard deviation of the time per metre, as a share of the parameter
OVERHEAD_SD, OVERHEAD_SD_S = 0.5, 5.0
"""Prior standard deviation of the stop overhead: a share of the parameter, and seconds that are added."""
LEG_SD, LEG_SD_S = 0.05, 1.0
"""Standard deviation of the time of a leg without an obstacle: a share of its time, and seconds that are added."""
DEGREES_OF_FREEDOM = 3.0  # degrees of freedom of the errors; few make outliers count little
SAME = 0.01  # smallest relative change of a leg's time that is worth replacing the parameters
_ROUNDS, _CONVERGED = 30, 1e-6
_SLOWEST, _FASTEST = 0.1, 10.0


@dataclass(frozen=True, slots=True)
class Leg:
    """A drive to a stop that ended there."""

    length_m: float  # length of the route [m]
    time_s: float  # from the goal to the arrival [s]


class LearnedMotion:
    """The motion of a robot, as far as its legs show it. The cost of a metre is the operator's."""

    def __init__(self, prior: RobotMotion) -> None:
        self.prior = self.motion = prior
        self.legs: deque[Leg] = deque(maxlen=MAX_LEGS)
        self._begun: tuple[float, float] | None = None  # time and length

    def set_off(self, now_s: float, way: Array, slower_m: float = 0.0) -> None:
        """The robot gets a goal; ``slower_m`` is that of the travel model [m]."""
        self._begun = now_s, polyline_length_m(way) + slower_m

    def give_up(self) -> None:
        """The goal has ended in another way than by arrival."""
        self._begun = None

    def arrive(self, now_s: float) -> bool:
        """The robot has arrived and counts; whether a leg was learned from."""
        begun, self._begun = self._begun, None
        if begun is None:
            return False
        self.add(Leg(begun[1], now_s - begun[0]))
        return True

    def add(self, leg: Leg) -> None:
        """Learn from a leg."""
        self.legs.append(leg)
        self.motion = learned_motion(self.prior, tuple(self.legs))

    @property
    def cautious(self) -> RobotMotion:
        """For limits: never faster than the parameters say."""
        return replace(
            self.prior,
            speed_mps=min(self.prior.speed_mps, self.motion.speed_mps),
            stop_overhead_s=max(self.prior.stop_overhead_s, self.motion.stop_overhead_s),
        )

    def __str__(self) -> str:
        source = "as set" if self.motion is self.prior else f"learned from {len(self.legs)} legs"
        return f"{self.motion.speed_mps:.2f} m/s, {self.motion.stop_overhead_s:.0f} s per stop, {source}"


def learned_motion(prior: RobotMotion, legs: tuple[Leg, ...]) -> RobotMotion:
    """The motion that prior and legs make most likely; ``prior`` itself where hardly a time would change.

    A leg takes ``length / speed + overhead``. The parameters are the prior of a regression on the legs; errors
    follow a Student t distribution, so that a leg with an obstacle hardly counts.
    """
    start = np.array([1 / prior.speed_mps, prior.stop_overhead_s])
    spread = np.array([PACE_SD * start[0], OVERHEAD_SD * start[1] + OVERHEAD_SD_S])
    driven = np.array([(leg.length_m, 1.0) for leg in legs])
    time_s = np.array([leg.time_s for leg in legs])
    sd_s = LEG_SD * time_s + LEG_SD_S
    estimate, late_s = start, time_s - driven @ start
    for _ in range(_ROUNDS):
        error = (time_s - driven @ estimate) / sd_s
        weight = (DEGREES_OF_FREEDOM + 1) / (DEGREES_OF_FREEDOM + error**2) / sd_s**2
        precision = driven.T @ (weight[:, None] * driven) + np.diag(1 / spread**2)
        before, estimate = estimate, start + np.linalg.solve(precision, driven.T @ (weight * late_s))
        if np.abs(estimate - before).max() <= _CONVERGED:
            break
    pace, overhead_s = np.clip(estimate, [start[0] * _SLOWEST, 0.0], [start[0] * _FASTEST, np.inf]).tolist()
    usual_s = driven @ start
    if (np.abs(driven @ [pace, overhead_s] - usual_s) <= SAME * usual_s).all():
        return prior
    return replace(prior, speed_mps=1 / pace, stop_overhead_s=overhead_s)
