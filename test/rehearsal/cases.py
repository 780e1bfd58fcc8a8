# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Rehearsals by number: a seed and a number make a field, a navigator, a strategy and faults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from soilmoist_ros.exploration import BUILT_IN, Stop, TravelGraph, open_lattice
from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.mapping import Field

NAVIGATORS = ("goto_node", "navigate_to_pose", "goal_pose")
STATED = ("true", "zero", "unknown")  # standard deviations that a receiver states
NO_FAULT_EACH = 12  # one in so many rehearsals has no fault
QUIET_HZ = (1.0, 0.5, 5.0, 1.0, 0.5, 10.0)  # fixes in a second of missions without faults, in turn; many take long
QUIET_STRATEGIES = ("random", "greedy")
FIXES_HZ = (1.0, 1.0, 0.5, 1.0, 5.0)  # fixes in a second, by the number of the field
OUTLINES = ("convex", "concave", "notched", "holes", "divided")
"""Shapes of random fields; ``divided`` by a ditch, the others without holes may have one no-go area."""
GRAPHS = ("lattice", "wild", "islands")
"""Random travel graphs: a lattice inside the drivable area; nodes and edges anywhere, some of them one-way; the
same cut into parts that are not joined."""
ROWS, APART_M, ROW_M = "rows", 2.5, 8.0
"""Rows of nodes as in polytunnels; distance of their nodes and of the rows [m]."""
POND_M = (5.0, 6.0)  # sides of a small no-go area [m]
ROBOT_RADIUS_M = 0.5
SPACING_M = 14.0  # mean distance between the nodes of a graph [m]

Array = NDArray[np.float64]
Place = tuple[float, float]


# Faults


class Fault(StrEnum):
    """What goes wrong."""

    FIX_JUMP = "fix_jump"  # fixes jump to somewhere else, by 15 m to 3 km
    FIX_FROZEN = "fix_frozen"  # fixes repeat the place at which the fault began
    FIX_SILENT = "fix_silent"  # no fix comes
    FIX_RUNS = "fix_runs"  # fixes move away at 20 to 200 m/s
    SERVER_DEAD = "server_dead"  # the navigation server is gone; the robot stops
    RUNAWAY = "runaway"  # the navigation server is gone, and the robot drives on to its last goal
    SERVER_DEAF = "server_deaf"  # the server rejects each cancellation and goes on
    RUNS_ON = "runs_on"  # the server confirms a cancellation, and the robot drives on for 8 s
    SERVER_ABORTS = "server_aborts"  # the server aborts each goal at once
    SERVER_LIES = "server_lies"  # the server reports success without motion
    SERVER_HANGS = "server_hangs"  # the server accepts goals and does nothing
    CLOCK_BACK = "clock_back"  # the clock steps back by an hour
    CLOCK_FORWARD = "clock_forward"  # the clock steps forward by six hours
    SENSOR_SILENT = "sensor_silent"  # no record comes
    SENSOR_ZERO = "sensor_zero"  # records hold no counts
    MAPPER_SILENT = "mapper_silent"  # the mapper publishes nothing
    PLANNER_SLOW = "planner_slow"  # choosing a stop takes two minutes
    LOW_BATTERY = "low_battery"  # the battery runs down
    KILL_PLANNER = "kill_planner"  # the planner is killed, and comes back
    KILL_MAPPER = "kill_mapper"  # the mapper is killed, and comes back
    EMERGENCY = "emergency"  # somebody presses the emergency stop, and releases it later
    PAUSE = "pause"  # the operator pauses, and resumes later
    ABORT = "abort"  # the operator aborts
    SKIP = "skip"  # the operator skips a stop
    RETURN = "return_home"  # the operator sends the robot home
    MEASURE = "measure"  # the operator asks for a measurement anywhere, also outside the field
    RULE_OUT = "rule_out"  # the operator rules out an area anywhere
    CHANGE = "change"  # the operator changes strategy and time
    REORDER = "reorder"  # the operator asks for two measurements, and then for the other order of the queue
    LINK_CUT = "link_cut"  # logger and receiver are cut off: what they send meanwhile is lost
    LINK_STALL = "link_stall"  # what logger and receiver send is held back, and comes all at once
    LINK_GARBAGE = "link_garbage"
    """Half of the lines of logger and receiver are damaged, with garbage between them."""
    KILL_DRIVER = "kill_driver"  # the driver is killed, and comes back
    DISK_FULL = "disk_full"  # no space is left on the disk
    BATTERY_STALE = "battery_stale"  # the state of the battery is no longer published
    DETOUR = "detour"  # the navigation drives into the nearest no-go area, and stays in it for half a minute
    STRAY = "stray"  # the navigation leaves its route by 3 to 20 m
    OTHER_MAP = "other_map"
    """The navigation's map is shifted by 4 to 60 m or turned, as with another datum or frame."""
    NEIGHBOUR = "neighbour"  # the navigation reports the arrival one node, or 2.5 m, before the goal
    NO_RESULT = "no_result"  # the server confirms each cancellation, drives on, and never reports an end
    OTHER_CLIENT = "other_client"  # somebody else sends the robot to another place, by the server of the mission
    CREEP = "creep"  # a robot that should stand creeps at 0.06 to 0.3 m/s
    SLIDE = "slide"  # a robot that stands slips by 1 to 8 m, once
    FIX_STEP = "fix_step"  # fixes of a robot that stands jump by 3.5 to 15 m
    FIX_DRIFT = "fix_drift"  # fixes of a robot that stands drift away at 0.1 to 2 m/s


OF_MOTION = tuple(list(Fault)[-10:])
"""Faults in which the robot, or its place, moves otherwise than the mission asked for."""


@dataclass(frozen=True, slots=True)
class Span:
    """One fault, from a time on [s]; ``size`` in 0..1 says how bad it is."""

    fault: Fault
    at_s: float
    for_s: float
    size: float

    @property
    def end_s(self) -> float:
        """When it is over [s]."""
        return self.at_s + self.for_s

    def __str__(self) -> str:
        return f"{self.fault} {self.at_s:.0f}..{self.end_s:.0f} s"


class Faults:
    """All faults of a rehearsal."""

    def __init__(self, spans: Sequence[Span] = ()) -> None:
        self.spans = tuple(sorted(spans, key=lambda span: span.at_s))

    def span(self, fault: Fault, now_s: float) -> Span | None:
        for span in self.spans:
            if span.fault is fault and span.at_s <= now_s < span.end_s:
                return span
        return None

    def on(self, fault: Fault, now_s: float) -> bool:
        """Whether a fault is on now; a runaway robot has no server either."""
        if fault is Fault.SERVER_DEAD and self.span(Fault.RUNAWAY, now_s) is not None:
            return True
        return self.span(fault, now_s) is not None

    def begin(self, from_s: float, to_s: float) -> list[Span]:
        """Faults that begin after one time, and not after another."""
        return [span for span in self.spans if from_s < span.at_s <= to_s]

    def __str__(self) -> str:
        return ", ".join(map(str, self.spans)) or "none"


_STOPPING = (Fault.PAUSE, Fault.ABORT, Fault.EMERGENCY, Fault.SKIP)
_AT_A_STOP = (
    Fault.SERVER_DEAF, Fault.RUNS_ON, Fault.RUNAWAY, Fault.SERVER_DEAD, Fault.FIX_JUMP, Fault.FIX_SILENT,
    Fault.CREEP, Fault.NO_RESULT, Fault.OTHER_CLIENT,
)  # fmt: skip
"""These matter most when the robot is to be stopped meanwhile."""


def random_faults(rng: np.random.Generator, first: Fault | None, more: int, until_s: float) -> Faults:
    """Some faults of a rehearsal.

    Half of them are short. A fault that matters when the robot is to be stopped often comes with such a command.

    :param rng: source of all randomness
    :param first: a fault that must be among them, if any
    :param more: number of further faults
    :param until_s: all begin before this time [s]
    """
    kinds = list(Fault)
    chosen = [] if first is None else [first]
    chosen += [kinds[int(number)] for number in rng.integers(len(kinds), size=more)]
    spans = []
    for kind in chosen:
        for_s = float(np.exp(rng.uniform(0.0, np.log(150.0)))) + 60.0 * (kind in OF_MOTION)
        span = Span(kind, float(rng.uniform(15, until_s)), for_s, float(rng.uniform()))
        if kind is Fault.OTHER_MAP:  # a map is wrong from the start
            span = replace(span, at_s=0.0, for_s=math.inf)
        spans.append(span)
        if kind in (Fault.PAUSE, Fault.EMERGENCY) and rng.uniform() < 0.4:  # it must survive a kill
            spans.append(Span(Fault.KILL_PLANNER, span.at_s + float(rng.uniform(0, for_s)), 1.0, 0.0))
        if kind in _AT_A_STOP and rng.uniform() < 0.6:
            stop = _STOPPING[int(rng.integers(len(_STOPPING)))]
            at_s = span.at_s + float(rng.uniform(0, min(for_s, 20.0)))
            spans.append(Span(stop, at_s, float(rng.uniform(10, 90)), 0.0))
    return Faults(spans)


# Fields


@dataclass(frozen=True, eq=False)
class Ground:
    """A field, and where the robot begins."""

    outline: str  # one of :data:`OUTLINES`
    field: Field  # the field
    graph: TravelGraph | None  # travel graph as the navigation knows it, ``None`` to drive freely
    start: tuple[float, float]  # place of the robot at the start [m]


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
    return TravelGraph.from_edges([stop for row in rows for stop in row], sorted(set(both)))


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
    return TravelGraph.from_edges(stops, edges)


def _can_leave(graph: TravelGraph, stop: Stop, area: BaseGeometry) -> bool:
    """Whether edges inside an area lead from a node to another one, and back."""
    names = graph.names
    inside = shapely.covers(area, shapely.linestrings(graph.xy[graph.edges]))
    edges = [(names[a], names[b]) for a, b in graph.edges[inside].tolist()]
    part = TravelGraph.from_edges(graph.stops, edges).components()
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


# Cases


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Errors of a kind of receiver."""

    white_sd_m: float = 0.02  # standard deviation of the part that each fix has anew [m]
    wander_sd_m: float = 0.0  # standard deviation of the part that wanders [m]
    wander_s: float = 60.0  # time in which the wandering part forgets itself [s]
    holds: bool = False  # whether the receiver holds its place while the robot stands (static hold)

    @property
    def sd_m(self) -> float:
        """Standard deviation of each coordinate [m]."""
        return math.hypot(self.white_sd_m, self.wander_sd_m)


RECEIVERS = {
    "rtk": Noise(white_sd_m=0.012, wander_sd_m=0.012),
    "float": Noise(white_sd_m=0.05, wander_sd_m=0.4, wander_s=120.0),
    "standalone": Noise(white_sd_m=0.2, wander_sd_m=1.5, wander_s=300.0),
    "standalone_poor": Noise(white_sd_m=0.4, wander_sd_m=2.4, wander_s=240.0),
    "static_hold": Noise(white_sd_m=0.2, wander_sd_m=1.0, wander_s=300.0, holds=True),
}
"""Receivers by name: with corrections (fixed and float), on their own in the open and under trees, and one that
holds its place."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """What is rehearsed."""

    ground: Ground  # field, graph and start
    navigator: str  # one of :data:`NAVIGATORS`
    strategy: str  # how stops are chosen
    faults: Faults  # what goes wrong
    seed: int  # seed of noise and counts
    budget_s: float = 1200.0  # budget of the mission [s]
    home: bool = True  # whether the robot must return to its start
    receiver: str = "rtk"  # one of :data:`RECEIVERS`
    fixes_hz: float = 1.0  # fixes in a second; whole or 0.5
    stated: str = "unknown"  # one of :data:`STATED`
    radius_m: float = 3.0  # the robot is at a stop within this distance [m]

    @property
    def stated_sd_m(self) -> float:
        """Standard deviation that the receiver states [m]; NaN for none."""
        sd_m = RECEIVERS[self.receiver].sd_m
        return {"true": sd_m, "zero": 0.0, "unknown": math.nan}[self.stated]

    def __str__(self) -> str:
        on = "free" if self.ground.graph is None else "graph"
        home = "home" if self.home else "no home"
        fixes = f"{self.receiver} at {self.fixes_hz:g} Hz, sd {self.stated}"
        what = f"{self.navigator}, {self.strategy}, {self.ground.outline}, {on}, {home}, {fixes}"
        return f"{what}; faults: {self.faults}"


def make_case(seed: int, number: int, fault: Fault | None = None) -> Case:
    """A rehearsal; three in a row, one of each navigator, share their field.

    Strategies and first faults take turns, so that each navigator meets each of them.

    :param seed: seed of all rehearsals
    :param number: of this one, from 0
    :param fault: its only fault, apart from commands of people that come with it; drawn if left out
    """
    field, turn = divmod(number, len(NAVIGATORS))
    ground_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0, field)))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, number)))
    navigator = NAVIGATORS[turn]
    outline = OUTLINES[field % len(OUTLINES)]
    on_graph = navigator == "goto_node" or rng.uniform() < 0.3
    graph = GRAPHS[int(ground_rng.integers(len(GRAPHS)))]
    kinds = list(Fault)
    firsts = (
        [fault] * len(NAVIGATORS)
        if fault is not None
        else [kinds[(field * 5 + each) % len(kinds)] for each in range(len(NAVIGATORS))]
    )
    ponds_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2, field)))
    ponds = 2 if field % 4 == 0 or Fault.DETOUR in firsts else 0
    graph = ROWS if Fault.NEIGHBOUR in firsts else graph
    ground = random_ground(ground_rng, outline, graph if on_graph else None, ponds, ponds_rng)
    none = fault is None and number % NO_FAULT_EACH == NO_FAULT_EACH - 1
    first = None if none else firsts[turn]
    strategies = list(BUILT_IN)
    budget_s = 900.0
    faults = random_faults(
        rng, first, int(rng.integers(3)) if first is not None and fault is None else 0, 0.7 * budget_s
    )
    if navigator == "goal_pose":  # its standstill is guessed from positions: one that repeats looks like it
        drawn = {span.fault for span in faults.spans}
        # a robot that never arrives, and cannot be stopped, does not show whether it or its place moves
        wrong = {Fault.FIX_FROZEN, *((Fault.FIX_DRIFT,) if Fault.OTHER_MAP in drawn else ())}
        faults = Faults([span for span in faults.spans if span.fault not in wrong])
    return Case(
        ground=ground, navigator=navigator, strategy=strategies[(field + 2 * turn) % len(strategies)],
        faults=faults, seed=seed * 1_000_003 + number, budget_s=budget_s, home=bool(rng.uniform() < 0.7),
        fixes_hz=FIXES_HZ[field % len(FIXES_HZ)], stated=STATED[(field + turn) % len(STATED)],
    )  # fmt: skip


def make_quiet_case(seed: int, number: int) -> Case:
    """A mission of an hour without faults; receivers, their rates and what they state take turns.

    :param seed: seed of all missions
    :param number: of this one, from 0
    """
    turn, receiver = divmod(number, len(RECEIVERS))
    turn, rate = divmod(turn, len(QUIET_HZ))
    case = make_case(seed, number + turn)  # each receiver and rate with each navigator
    return replace(
        case, faults=Faults(), budget_s=3600.0, strategy=QUIET_STRATEGIES[number % len(QUIET_STRATEGIES)],
        receiver=tuple(RECEIVERS)[receiver], fixes_hz=QUIET_HZ[rate], stated=STATED[(number // 7) % len(STATED)],
    )  # fmt: skip
