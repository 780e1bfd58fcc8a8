# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From a field, a travel graph and settings to all that a mission on a real field needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np

from soilmoist_ros.exploration.control.explorer import Explorer, cell_stops
from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.guard.fenced_graph import FencedGraph, Outside
from soilmoist_ros.exploration.mission.types import Changes, MissionRules
from soilmoist_ros.exploration.planning.dwell import DwellRule
from soilmoist_ros.exploration.planning.forecast import Forecast
from soilmoist_ros.exploration.planning.forecaster import MAX_CELLS, prior_forecast
from soilmoist_ros.exploration.planning.planning_model import spread_cells
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import make_strategy, strategy_kind, warm_up
from soilmoist_ros.exploration.travel.stop import Stop, stops_xy
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion, TravelModel
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.foundation import InputError, did_you_mean
from soilmoist_ros.mapping import Field, FieldGrid, FieldMap, FieldMapSettings, Knowledge, VariogramFit
from soilmoist_ros.sensing import MoistureCurve


@dataclass(frozen=True, kw_only=True)
class AccessRules:
    """Where a robot may drive.

    :param robot_radius_m: distance that its centre keeps from the border and the no-go areas [m], >= 0
    :param beyond_m: nodes and edges of a travel graph this far outside the field belong to it [m], >= 0; allows
        for errors of the survey
    :param outside: use of nodes and edges further outside
    :param entry_m: the robot may set off this far outside; it then drives straight back in [m], >= 0
    :param by_name: the navigation is sent names of nodes, and plans its routes itself
    """

    robot_radius_m: float = 0.0
    beyond_m: float = 0.1
    outside: Outside = Outside.HOME
    entry_m: float = 10.0
    by_name: bool = False


NO_MARGIN = AccessRules()
PAST_M = 0.5
"""Distance that a way past a standing robot keeps in addition, so that noise of the fixes stops nobody [m]."""
_STAYS_M = 0.05
MOVED_M = 2.0
"""A stop that a new map places this far away is another one [m]; frames of robot and field may differ by less."""


@dataclass(frozen=True, kw_only=True)
class ExplorerSettings:
    """How stops are chosen, and where the robot may drive.

    :param strategy: one of :data:`STRATEGIES`
    :param preset: one of :data:`PRESETS`
    :param seed: seed of the strategy's randomness
    :param dwell: dwell rule
    :param motion: how the robot moves
    :param curve: calibration, if the map of the moisture is to be good rather than that of the rate
    :param access: where the robot may drive
    :param learn_travel: whether speed, turning time and stop overhead are learned from the legs driven
    :param calibration: calibration that is there for an operator who asks for the map of the moisture
    :param knowledge: what is known of the field before the survey
    """

    strategy: str
    preset: str
    seed: int
    dwell: DwellRule
    motion: RobotMotion
    curve: MoistureCurve | None = None
    access: AccessRules = NO_MARGIN
    calibration: MoistureCurve | None = None
    learn_travel: bool = True
    knowledge: Knowledge = field(default_factory=Knowledge)

    @property
    def needs_map(self) -> bool:
        """Whether the strategy cannot do without a map."""
        return strategy_kind(self.strategy).needs_map

    @property
    def warm_up_stops(self) -> int:
        """Samples to take before the map guides."""
        return warm_up(self.strategy, self.preset)[0]


OpenSurvey = Callable[[Changes], tuple[Field, ExplorerSettings]]
"""Opens the field, earlier runs and covariates that an operator chooses; raises an ``InputError``."""


def changed_settings(settings: ExplorerSettings, rules: MissionRules, changes: Changes | None) -> ExplorerSettings:
    """How stops are chosen after an operator's changes.

    :param settings: those of the start
    :param rules: those of now
    :param changes: what was changed
    """
    if changes is None:
        return settings
    curve = settings.curve
    if changes.target is not None:
        curve = settings.calibration if changes.target == "vwc" else None
    strategy = settings.strategy if changes.strategy is None else changes.strategy
    return replace(settings, strategy=strategy, dwell=rules.dwell, curve=curve)


class FieldAccess:
    """Where the robot may go and measure in a field, and how it travels there; all of it inside the fence.

    :param field: the field
    :param motion: how the robot moves
    :param graph: travel graph; straight lines around no-go areas without. Nodes and edges that the fence refuses,
        and those of other parts than the robot's, are not used; :attr:`warning` names them
    :param rules: where the robot may drive
    :param cell_m: cell size of the map [m]; the field's own if ``None``
    :param home: name of the stop to return to; empty for none
    :param place: where the robot is [m], ``None`` if not known yet
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
        self.warning = ""
        self._given = field, motion, graph, rules, cell_m
        self._rules = rules
        self._named: tuple[Stop, ...]
        self.travel: TravelModel
        self._fenced: FencedGraph | None = None
        if graph is None:
            self.fence = Fence(field, rules.robot_radius_m)
            self.warning = self.fence.divided()
            self.travel = FreeTravel(motion, (field.polygon,), field.no_go, rules.robot_radius_m)
            self._named = cell_stops(self.grid)
            self.stops = _inside(self._named, self.fence)
            self.home = self.stop(home) if home else None
        else:
            self._named = graph.stops
            self.home = self.stop(home) if home else None
            fence = Fence(field, rules.robot_radius_m, rules.beyond_m)
            self._fenced = FencedGraph(graph, fence, rules.outside, home, place, max(rules.beyond_m, 1.0))
            self.fence, self.warning = self._fenced.fence, self._fenced.warning
            enters = partial(self.fence.may_enter, entry_m=rules.entry_m)
            self.travel = GraphTravel(self._fenced.graph, motion, enters)
            self.stops = self._fenced.stops
        if self.home is not None and (refusal := self.refusal(self.home)):
            raise InputError(f"the home {home} is not allowed: {refusal}", "choose another home")

    @property
    def on_graph(self) -> bool:
        """True if the robot travels along a graph."""
        return self._fenced is not None

    def serves(self, place: tuple[float, float]) -> bool:
        """Whether a robot at this place can use it; otherwise make one for the place."""
        return self._fenced is None or self._fenced.serves(place)

    def with_home(self, home: str, place: tuple[float, float] | None) -> FieldAccess:
        """The same with another home, for a robot at a place.

        :raises InputError: if the home is not known or not allowed, or no allowed way leads there
        """
        return FieldAccess(*self._given, home, place)

    def around(
        self, place: tuple[float, float], others: Sequence[tuple[float, float]], apart_m: float
    ) -> FieldAccess:
        """Access of a robot at a place, by ways that keep apart from places where other robots stand.

        Ways keep :data:`PAST_M` more, and from a robot that stands close by no less than now.

        :param others: where they stand [m]
        :param apart_m: distance to keep [m]
        :raises InputError: if no way is left
        """
        field, motion, graph, rules, cell_m = self._given
        angles = np.arange(16) * (np.pi / 8)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        margin_m = rules.robot_radius_m
        radii = [min(apart_m + PAST_M, math.dist(place, other) - _STAYS_M) - 1.1 * margin_m for other in others]
        rings = [radius * circle + other for other, radius in zip(others, radii, strict=True) if radius > 0]
        home = "" if self.home is None else self.home.name
        if self.home is not None:
            at = self.home.x_m, self.home.y_m
            if any(math.dist(at, other) < apart_m + PAST_M for other in others):
                home = ""  # somebody stands there: it is refused as a stop, and needs no way
        around = replace(field, no_go=(*field.no_go, *rings))
        return FieldAccess(around, motion, graph, rules, cell_m, home, place)

    def refusal(self, stop: Stop) -> str:
        """Why a stop must not be measured at or driven to; empty if it may be."""
        return self.fence.refusal([(stop.x_m, stop.y_m)])

    def way(self, place: tuple[float, float], stop: Stop) -> Way:
        """The route from a place to a stop, validated by the fence.

        :param place: where the robot is [m]
        :param stop: where to
        :raises InputError: if no route leads there, or the fence refuses it
        """
        if refusal := self.refusal(stop):
            raise InputError(f"{stop.name} is not allowed: {refusal}", "choose another stop")
        try:
            corners = self.travel.route(place, stop)
        except ValueError as error:
            raise InputError(str(error), "choose another stop") from None
        there, now = (stop.x_m, stop.y_m), tuple(corners[-1].tolist())
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

    def stop(self, name: str) -> Stop:
        """The stop of this name, also one outside the field.

        :raises InputError: if there is none
        """
        for stop in self._named:
            if stop.name == name:
                return stop
        names = [stop.name for stop in self._named]
        remedy = f"use one of the {len(names)} nodes or cells of this field{did_you_mean(name, names)}"
        raise InputError(f"there is no stop {name!r} to return to", remedy)


STREAMS_PER_ROBOT = 3
"""Random streams of each robot of a mission: those of its sensor, of its strategy and of its GNSS receiver."""


def strategy_stream(seed: int, robot: int = 0) -> np.random.Generator:
    """Random choices of a strategy: planner and simulator draw the same stops with the same seed.

    :param seed: seed of the mission
    :param robot: number of the robot, from 0
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAMS_PER_ROBOT * robot + 1,)))


def make_explorer(access: FieldAccess, settings: ExplorerSettings, rules: MissionRules) -> Explorer:
    """An explorer for one mission.

    :param access: where the robot may go
    :param settings: how stops are chosen
    :param rules: those of the mission
    """
    planning = FieldMapSettings(for_planning=True)
    return Explorer(
        [Property(FieldMap(access.grid, planning, settings.knowledge), curve=settings.curve)],
        access.stops,
        access.travel,
        make_strategy(settings.strategy, settings.preset),
        warm_up(settings.strategy, settings.preset)[1],
        settings.dwell,
        strategy_stream(settings.seed),
        rules.min_dwell_s,
        home=rules.home,
        nominal_rate_cps=nominal_rate_cps(settings.calibration),
        kept_for_home_s=rules.way_home_s,
        min_last_dwell_s=rules.min_last_dwell_s,
    )


def nominal_rate_cps(calibration: MoistureCurve | None) -> float:
    """Expected rate before the first record: that at 15 % moisture by the calibration, if any [counts/s]."""
    return 4.0 if calibration is None else float(calibration.rate_cps(0.15))


def first_forecast(grid: FieldGrid, settings: ExplorerSettings, budget_s: float) -> Forecast:
    """The forecast before a mission starts.

    :param grid: grid of the field
    :param settings: how stops are chosen
    :param budget_s: mission time [s]
    """
    expected = _expected_fit(grid, settings.knowledge)
    rate_cps = nominal_rate_cps(settings.calibration) if expected is None else expected.mean_rate
    slope = None if settings.curve is None else math.sqrt(float(settings.curve.weight([rate_cps])[0]))
    return _first_forecast(grid, rate_cps, budget_s, slope, expected)


@lru_cache(maxsize=4)
def _first_forecast(
    grid: FieldGrid,
    rate_cps: float,
    budget_s: float,
    slope: float | None,
    expected: VariogramFit | None,
) -> Forecast:
    cells_xy = grid.cells[spread_cells(grid.mask, MAX_CELLS)[grid.mask]]
    return prior_forecast(cells_xy, grid.extent_m, rate_cps, budget_s, slope, expected)


@lru_cache(maxsize=2)
def _expected_fit(grid: FieldGrid, knowledge: Knowledge) -> VariogramFit | None:
    return FieldMap(grid, knowledge=knowledge).expected_fit


def _inside(stops: tuple[Stop, ...], fence: Fence) -> tuple[Stop, ...]:
    inside = fence.contains(stops_xy(stops))
    return tuple(stop for stop, within in zip(stops, inside, strict=True) if within)
