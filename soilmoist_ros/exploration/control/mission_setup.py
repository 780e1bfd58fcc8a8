"""From a field, a travel graph and settings to all that a mission on a real field needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from soilmoist_ros.exploration.control.explorer import Explorer, cell_stops
from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.mission.types import MissionRules
from soilmoist_ros.exploration.planning.dwell import DwellRule
from soilmoist_ros.exploration.planning.properties import Property
from soilmoist_ros.exploration.strategies.registry import make_strategy, strategy_kind, warm_up
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.travel import FreeTravel, GraphTravel, RobotMotion, TravelModel
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.suggestions import did_you_mean
from soilmoist_ros.mapping.field import Field
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.sensing.moisture.curve import CalibrationCurve


@dataclass(frozen=True, kw_only=True)
class ExplorerSettings:
    """How stops are chosen.

    :param strategy: one of :data:`STRATEGIES`
    :param preset: one of :data:`PRESETS`
    :param seed: seed of the strategy's randomness
    :param dwell: dwell rule
    :param motion: how the robot moves
    :param curve: calibration, if the map of the moisture is to be good rather than that of the rate
    """

    strategy: str
    preset: str
    seed: int
    dwell: DwellRule
    motion: RobotMotion
    curve: CalibrationCurve | None = None

    @property
    def needs_map(self) -> bool:
        """Whether the strategy cannot do without a map."""
        return strategy_kind(self.strategy).needs_map

    @property
    def warm_up_stops(self) -> int:
        """Samples to take before the map guides."""
        return warm_up(self.strategy, self.preset)[0]


class FieldAccess:
    """Where the robot may go and measure in a field, and how it travels there.

    :param field: the field
    :param motion: how the robot moves
    :param graph: travel graph; straight lines around no-go areas without
    :param margin_m: nodes this far outside the field may still be measured at [m]
    :param cell_m: cell size of the map [m]; the field's own if ``None``
    :raises InputError: if the field cannot be gridded, or no node of the graph lies in it
    """

    def __init__(
        self,
        field: Field,
        motion: RobotMotion,
        graph: TravelGraph | None,
        margin_m: float = 0.0,
        cell_m: float | None = None,
    ) -> None:
        self.grid = field.grid(cell_m)
        self.fence = Fence(field, 0.0, 0.0 if graph is None else margin_m)
        self._named: tuple[Stop, ...]
        self.travel: TravelModel
        if graph is None:
            self.travel = FreeTravel(motion, (field.polygon,), field.no_go)
            self.stops = self._named = cell_stops(self.grid)
        else:
            self.travel = GraphTravel(graph, motion)
            self._named = graph.stops
            self.stops = _inside(field, graph, margin_m)

    def way(self, place: ArrayLike, stop: Stop) -> Way:
        """The route from a place to a stop, as it may be driven.

        :param place: where the robot is, shape (2,) [m]
        :raises InputError: if no route leads there, or the fence refuses it
        """
        try:
            corners = self.travel.route(place, stop)
        except ValueError as error:
            raise InputError(str(error), "choose another stop") from None
        return Way(corners)

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
    return Explorer(
        [Property(FieldMap(access.grid, FieldMapSettings(for_planning=True)), curve=settings.curve)],
        access.stops,
        access.travel,
        make_strategy(settings.strategy, settings.preset),
        warm_up(settings.strategy, settings.preset)[1],
        settings.dwell,
        strategy_stream(settings.seed),
        rules.min_dwell_s,
        home=rules.home,
        kept_for_home_s=rules.way_home_s,
    )


def _inside(field: Field, graph: TravelGraph, margin_m: float) -> tuple[Stop, ...]:
    import shapely

    area = shapely.Polygon(field.polygon).buffer(margin_m)
    inside = shapely.intersects_xy(area, graph.xy[:, 0], graph.xy[:, 1])
    if not inside.any():
        (west, south), (east, north) = graph.xy.min(axis=0), graph.xy.max(axis=0)
        raise InputError(
            f"no node of the topological map lies in the field {field.name!r}: they are at x {west:.0f} .. "
            f"{east:.0f} m, y {south:.0f} .. {north:.0f} m",
            "the map's places must be metres east and north of the field's datum: check the datum and the map",
        )
    return tuple(stop for stop, within in zip(graph.stops, inside, strict=True) if within)
