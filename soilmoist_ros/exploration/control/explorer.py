# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From the map and the robot's place to the next stop: prepares the situation and asks the strategy.

The settings of a mission on a real field make its explorer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration.control.field_access import NO_MARGIN, AccessRules
from soilmoist_ros.exploration.control.team import PendingMeasurement, foreseen, taken, with_samples
from soilmoist_ros.exploration.mission.events import Planned, RequestPlan
from soilmoist_ros.exploration.mission.types import Changes, MissionRules, PlanKind
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.planning.decision import EXPLORING, Thresholds
from soilmoist_ros.exploration.planning.forecast import MAX_CELLS as FORECAST_CELLS
from soilmoist_ros.exploration.planning.forecast import Forecast, Forecaster
from soilmoist_ros.exploration.planning.planning_model import (
    MAX_CELLS,
    MAX_STOPS,
    Counting,
    PlanningModel,
    Prospect,
    spread_cells,
)
from soilmoist_ros.exploration.planning.properties import Aim, AimedMap, Property, slope2, variation
from soilmoist_ros.exploration.strategies.registry import warm_up
from soilmoist_ros.exploration.strategies.strategy import Choice, Situation, Strategy
from soilmoist_ros.exploration.travel.stop import Stop, inside_any, stops_xy
from soilmoist_ros.exploration.travel.travel import RobotMotion, TravelModel
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import (
    Changing,
    Field,
    FieldGrid,
    FieldMap,
    Knowledge,
    Samples,
    SoilMap,
    TimedSamples,
    coincident,
)
from soilmoist_ros.sensing import MoistureCurve

Array = NDArray[np.float64]
Place = tuple[float, float]
_ON_THE_WAY_TOO = Counting()
_MIN_EXPOSURE_S = 1.0
_M_PER_S = 0.01  # distance that counts as much as a second, to find the sample of a visit


class Explorer:
    """Chooses stops for one mission.

    :param properties: what is mapped, all in the same cells of one grid. The mission counts the first, so its
        counts decide the dwell, and stops are weighed by maps only once it has one
    :param warm_up: the strategy until the map may guide
    :param nominal_rate_cps: rate to expect before there is a map [counts/s]
    :param forecasts: whether plans have forecasts of the map
    :param grid: the field, where the maps are only of the cells of :func:`planning_grid`; their grid if ``None``
    :param certified: chooses as :meth:`choose`, and takes the stops of a certificate in; ``None`` without one
    """

    def __init__(
        self,
        properties: Sequence[Property],
        stops: tuple[Stop, ...],
        travel: TravelModel,
        strategy: Strategy,
        warm_up: Strategy,
        rules: MissionRules,
        rng: np.random.Generator,
        nominal_rate_cps: float = 4.0,
        counting: Counting = _ON_THE_WAY_TOO,
        forecasts: bool = True,
        grid: FieldGrid | None = None,
        certified: Certified | None = None,
    ) -> None:
        self.properties = list(properties)
        mapped = self.properties[0].field_map.grid
        self.grid = mapped if grid is None else grid
        self.stops = stops
        self.travel = travel
        self.strategy = strategy
        self.warm_up = warm_up
        self.rng = rng
        self.nominal_rate_cps = nominal_rate_cps
        self.counting = counting
        self.certified = certified
        self._xy = stops_xy(stops)
        self._numbers = {stop.name: number for number, stop in enumerate(stops)}
        self._map_xy = self.grid.cells
        self._stops_are_cells = np.array_equal(self._xy, self._map_xy)
        represented = planning_grid(self.grid).mask
        self._cells = represented[self.grid.mask]
        self._cells_xy = self._map_xy[self._cells]
        self._mapped = represented[mapped.mask]  # of the cells that are mapped
        self._considered = self._few_stops()
        self.use_rules(rules)
        self._forecasts = forecasts
        self._forecaster = forecaster(self.grid, nominal_rate_cps)

    def go_on_from(self, earlier: Explorer, same_strategy: bool) -> None:
        """Take the place of an explorer whose settings were changed; its random stream goes on.

        :param same_strategy: whether the strategy goes on with what it has planned, too
        """
        self.rng, self._forecaster, self.certified = earlier.rng, earlier._forecaster, earlier.certified
        if same_strategy:
            self.strategy, self.warm_up = earlier.strategy, earlier.warm_up

    def use_rules(self, rules: MissionRules) -> None:
        """Choose by these rules from now on: the mission knows better how the robot moves."""
        self.rules = rules
        self._to_home_s = self._home_s = np.zeros(len(self.stops))
        if rules.home is not None:  # the way back is assumed to be as long as the way there
            self._to_home_s = self.travel.travel_s(rules.home.xy, self.stops)
            trips = zip(self.stops, self._to_home_s.tolist(), strict=True)
            kept = [rules.way_home_s(stop.xy, time_s) for stop, time_s in trips]
            self._home_s = np.maximum(self._to_home_s, kept)

    def plan(self, request: RequestPlan, position_xy: Place, others: Sequence[PendingMeasurement] = ()) -> Planned:
        """Choose the next stop for a robot at a place [m]; the time of the answer is 0."""
        choose = self.certified or Explorer.choose
        planned = choose(self, request, position_xy, others)
        if not self._forecasts:
            return planned
        times_s = request.time_used_s, request.time_left_s
        forecast = self._forecaster.forecast(
            self.properties[0], *times_s, 1 + len(others), self.rules.aim, self.rules.by_person
        )
        return replace(planned, forecast=forecast)

    def home_s(self, stop: str) -> float:
        """Travel time home from a stop, by its name [s]; 0 if it is not known."""
        number = self._numbers.get(stop)
        return 0.0 if number is None else float(self._to_home_s[number])

    def fits(self, stop: Stop, position_xy: Place, request: RequestPlan) -> bool:
        """True if a trip to a stop, the shortest dwell and the way home fit into the time of a request."""
        travel_s = float(self.travel.travel_s(position_xy, [stop])[0])
        home_s = self.rules.way_home_s(stop.xy, self.home_s(stop.name))
        return travel_s + self.rules.needed_dwell_s + home_s <= request.budget_left_s

    def choose(
        self, request: RequestPlan, position_xy: Place, others: Sequence[PendingMeasurement] = ()
    ) -> Planned:
        """Choose a stop by the strategy; the plan has no forecast."""
        situation = self.situation(request, position_xy, others)
        strategy = self.warm_up if request.kind is PlanKind.WARM_UP else self.strategy
        choice = self._checked(strategy.choose(situation, self.rng), strategy)
        home_s = self.home_s(request.staying if choice is None else choice.stop.name)
        if choice is None:
            return Planned(0.0, request.plan_id, None, home_s=home_s)
        stays = bool(request.staying) and choice.stop.name == request.staying
        travel_s = 0.0 if stays else float(self.travel.travel_s(position_xy, [choice.stop])[0])
        return Planned(0.0, request.plan_id, choice, travel_s, home_s=home_s)

    def _checked(self, choice: Choice | None, strategy: Strategy) -> Choice | None:
        """The choice of a strategy, which may be a plug-in's; an :class:`InputError` if it is none."""
        if choice is None or (isinstance(choice, Choice) and getattr(choice.stop, "name", None) in self._numbers):
            return choice
        what = "a Choice of another stop" if isinstance(choice, Choice) else type(choice).__name__
        message = f"strategy {type(strategy).__name__}: choose must return a Choice or None; it returned {what}"
        raise InputError(message, "return Choice(stop, reason) with a stop of situation.candidates")

    def achieved(self) -> Forecast | None:
        """Standard deviation of the map now, ``None`` without a map."""
        return self._forecaster.achieved(self.properties[0], self.rules.aim)

    def situation(
        self, request: RequestPlan, position_xy: Place, others: Sequence[PendingMeasurement] = ()
    ) -> Situation:
        """Situation for the strategy, without stops ruled out or taken; pending measurements appear as counted."""
        maps = self._maps(others, request.certified)
        counted = maps[0].field_map
        free = ~taken(self._xy, others, self.grid.cell_m)
        if request.blacklisted:
            ruled_out = set(request.blacklisted)
            free &= np.array([stop.name not in ruled_out for stop in self.stops], bool)
        if request.ruled_out:
            free &= ~inside_any(request.ruled_out, self._xy)
        kept = np.flatnonzero(free)
        candidates = self.stops if free.all() else tuple(self.stops[index] for index in kept)
        number = self._numbers.get(request.staying)
        staying = None if number is None or number not in kept else int(np.searchsorted(kept, number))
        travel_s = self.travel.travel_s(position_xy, candidates)
        if staying is not None:
            travel_s[staying] = 0.0
        fits = travel_s + self.rules.needed_dwell_s + self._home_s[kept] <= request.budget_left_s
        known_rate = counted.soil_map is not None
        weighed = free & self._considered
        if staying is not None:
            weighed[kept[staying]] = True
        considered = np.flatnonzero(weighed)
        rows = np.searchsorted(kept, considered)
        place = (float(position_xy[0]), float(position_xy[1]))
        rate = float(counted.rate.mean()) if known_rate else self.nominal_rate_cps
        return Situation(
            candidates=candidates,
            candidates_xy=self._xy[kept],
            stop_variance=lambda: _sum(each.weight * self._variance(each.field_map, kept) for each in maps),
            map_variance=_sum(each.weight * each.field_map.variance for each in maps)
            if known_rate
            else np.ones(len(counted.variance)),
            map_xy=self._map_xy,
            cell_m=self.grid.cell_m,
            position_xy=np.asarray(position_xy, float),
            measured_xy=counted.samples.xy,
            travel_s=np.where(fits, travel_s, np.inf),
            travel_between_s=lambda indices: self.travel.between_s(candidates, indices),
            legs_s=lambda indices: self.travel.legs_s(candidates, indices),
            time_left_s=request.time_left_s,
            expected_dwell_s=max(self.rules.dwell.expected_s(rate, maps[0].factor), self.rules.min_dwell_s),
            staying=staying,
            rate_cps=rate,
            map_rate=counted.rate if known_rate else None,
            thresholds=maps[0].thresholds,
            overhead_s=self.travel.motion.stop_overhead_s,
            counting=self.counting,
            dwell=self.rules.dwell,
            prospect=cache(lambda: self._prospect(maps, considered, travel_s[rows], place, request, rows)),
            goal=lambda: self._goal(maps[0]),
        )

    def _goal(self, of: Property) -> AimedMap | None:
        """Aim on the map as it is; ``None`` without a map, or an aim that is planned for."""
        field_map, aim = of.field_map, self.rules.until
        if aim is None or field_map.soil_map is None:
            return None
        rate, variance = field_map.rate[self._mapped], field_map.variance[self._mapped]
        return AimedMap(aim, rate, variance, slope2(of, rate))

    def _maps(self, others: Sequence[PendingMeasurement], certified: Sequence[Visit]) -> list[Property]:
        """The properties that matter, as far as there are maps; pending measurements seem counted.

        Visits of a certificate seem not counted.

        Their weights are in units of the variance of the first, which is always among them.
        """
        counted, *more = (
            replace(each, field_map=foreseen(without_visits(each.field_map, certified), others, each.factor))
            for each in self.properties
            if each is self.properties[0] or (each.weight > 0 and each.field_map.soil_map is not None)
        )
        found = [counted]
        if counted.field_map.soil_map is not None and more:
            unit = variation(counted.field_map.soil_map.variogram, self._cells_xy)
            for each in more:
                assert each.field_map.soil_map is not None
                varies = variation(each.field_map.soil_map.variogram, self._cells_xy)
                if varies > 0:
                    found.append(replace(each, weight=each.weight * (unit / varies)))
        return found

    def _prospect(
        self,
        maps: Sequence[Property],
        numbers: NDArray[np.intp],
        travel_s: Array,
        position_xy: tuple[float, float],
        request: RequestPlan,
        of_candidates: NDArray[np.intp],
    ) -> Prospect | None:
        """The stops of these numbers and travel times, as a planner weighs them; ``None`` without a map."""
        places, models = self._xy[numbers], []
        explores = request.time_used_s < EXPLORING * (request.time_used_s + request.time_left_s)
        shapes = [self._shape(each) for each in maps]
        for each, shape in zip(maps, shapes, strict=True):
            field_map = each.field_map
            if field_map.soil_map is None:
                return None
            # Moisture has another unit than the rate: all shapes get the mean of the first.
            weights = each.weight * (shape * (shapes[0].mean() / shape.mean()))
            models.append(
                PlanningModel(
                    field_map.soil_map,
                    self._cells_xy,
                    weights,
                    places,
                    each.factor,
                    cell_variance=self._smooth_variance(field_map.soil_map, field_map.variance),
                    thresholds=None if explores else each.thresholds,
                )
            )
        models[0].others = tuple(models[1:])
        budget_s = request.budget_left_s - self._home_s[numbers]
        fits = np.flatnonzero((travel_s + self.rules.needed_dwell_s <= budget_s) & (travel_s < budget_s))
        stops = tuple(self.stops[number] for number in numbers[fits].tolist())
        return Prospect(
            models[0], stops, fits, of_candidates[fits], self.travel, position_xy, self.counting,
            self.rules.min_dwell_s,
        )  # fmt: skip

    def _shape(self, of: Property) -> Array:
        """Relative weight of each cell in the integrated variance; squared slopes make it that of the moisture."""
        weights = np.full(len(self._cells_xy), 1 / len(self._cells_xy))
        if of.curve is not None and of.thresholds is None and of.field_map.soil_map is not None:
            weights = weights * of.curve.weight(of.field_map.rate[self._mapped])
        return weights

    def _smooth_variance(self, soil_map: SoilMap, variance: Array) -> Array | None:
        """Variance of the smooth rate at the cells that represent the field, from that of all cells of a map.

        :returns: ``None`` if a cell shares the micro-scale variation of a sample exactly there
        """
        if not soil_map.keep_nugget or len(coincident(self._cells_xy, soil_map.samples.xy)[0]):
            return None
        return np.asarray(np.maximum(variance[self._mapped] - soil_map.variogram.nugget, 0.0))

    def _few_stops(self) -> NDArray[np.bool_]:
        """Stops that are compared: all, or an even selection of them."""
        if self._stops_are_cells:
            return self._cells
        if len(self.stops) <= MAX_STOPS:
            return np.ones(len(self.stops), bool)
        # The farthest from those before, again and again: every n-th stop would leave out strips of the field.
        chosen = np.zeros(len(self.stops), bool)
        gap_m2, number = np.full(len(self.stops), np.inf), 0
        for _ in range(MAX_STOPS):
            chosen[number] = True
            gap_m2 = np.minimum(gap_m2, ((self._xy - self._xy[number]) ** 2).sum(axis=1))
            number = int(gap_m2.argmax())
        return chosen

    def _variance(self, field_map: FieldMap, kept: NDArray[np.intp]) -> Array:
        if field_map.soil_map is None:
            return np.ones(len(kept))
        if self._stops_are_cells and len(self._mapped) == len(self._xy):
            return field_map.variance[kept]
        assert field_map.kriging is not None
        return field_map.kriging.predict(self._xy[kept])[1]


def _sum(arrays: Iterable[Array]) -> Array:
    return reduce(np.add, arrays)


def without_visits(field_map: FieldMap, visits: Sequence[Visit]) -> FieldMap:
    """A map for planning without the counts of some visits; the map itself if there are none."""
    if not visits:
        return field_map
    samples, changing = _less(field_map.samples, visits)[0], field_map.changing
    if not len(samples):
        return FieldMap(field_map.grid, field_map.settings)
    if changing is not None:
        fewer, kept = _less(changing.timed.samples, visits, changing.timed.time_s)
        changing = Changing(TimedSamples(fewer, changing.timed.time_s[kept]), changing.change, changing.now_s)
    return with_samples(field_map, samples, changing)


def _less(
    samples: Samples, visits: Sequence[Visit], time_s: Array | None = None
) -> tuple[Samples, NDArray[np.bool_]]:
    """Samples without the counts of visits, and which ones are left."""
    counts, exposure_s = samples.counts.copy(), samples.exposure_s.copy()
    for visit in visits:
        away = np.hypot(*(samples.xy - (visit.x_m, visit.y_m)).T)
        if time_s is not None:
            away = away + _M_PER_S * np.abs(time_s - (visit.arrival_stamp_s + visit.end_stamp_s) / 2)
        nearest = int(np.argmin(away))
        counts[nearest] = max(counts[nearest] - visit.raw_counts, 0.0)
        exposure_s[nearest] -= visit.effective_exposure_s
    kept = exposure_s >= _MIN_EXPOSURE_S
    return Samples(samples.xy[kept], counts[kept], exposure_s[kept], samples.spread[kept]), kept


def planning_grid(grid: FieldGrid) -> FieldGrid:
    """The grid with only those cells that represent the field to a planner."""
    return replace(grid, mask=spread_cells(grid.mask, MAX_CELLS))


# What a mission on a real field needs ---------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ExplorerSettings:
    """Choice of stops, and where the robot may drive."""

    strategy: str  # one of STRATEGIES
    preset: str  # one of PRESETS
    seed: int  # seed of the strategy's randomness
    motion: RobotMotion  # motion of the robot
    curve: MoistureCurve | None = None  # calibration, if the map of the moisture is to be good, not of the rate
    access: AccessRules = NO_MARGIN  # rules for the region of the robot
    calibration: MoistureCurve | None = None  # for an operator who asks for the map of the moisture
    thresholds: Thresholds | None = None  # thresholds of the decision that the map is for, if it is for one
    knowledge: Knowledge = field(default_factory=Knowledge)  # knowledge of the field before the survey
    certify: int = 0  # number of places of a certificate; 0 for none

    @property
    def target(self) -> str:
        """Target of the map, as an operator names it."""
        if self.thresholds is not None:
            return "decision"
        return "rate" if self.curve is None else "vwc"

    @property
    def targets(self) -> list[str]:
        """Targets among which an operator may choose."""
        return ["rate", *["vwc"] * (self.calibration is not None), *["decision"] * (self.thresholds is not None)]

    @property
    def warm_up_stops(self) -> int:
        """Samples to take before the map guides."""
        return warm_up(self.strategy, self.preset)[0]


Certified = Callable[[Explorer, RequestPlan, Place, Sequence[PendingMeasurement]], Planned]
OpenSurvey = Callable[[Changes], tuple[Field, ExplorerSettings]]
"""Opens the field, earlier runs and covariates that an operator chooses; raises an ``InputError``."""


def changed_settings(settings: ExplorerSettings, changes: Changes | None) -> ExplorerSettings:
    """Choice of stops after an operator's changes."""
    if changes is None:
        return settings
    curve, thresholds = settings.curve, settings.thresholds
    if changes.target is not None:
        curve = None if changes.target == "rate" else settings.calibration
        thresholds = thresholds if changes.target == "decision" else None
    strategy = settings.strategy if changes.strategy is None else changes.strategy
    return replace(settings, strategy=strategy, curve=curve, thresholds=thresholds)


STREAMS_PER_ROBOT = 3
"""Random streams of each robot of a mission: those of its sensor, of its strategy and of its GNSS receiver."""


def strategy_stream(seed: int, robot: int = 0) -> np.random.Generator:
    """Random choices of a strategy: planner and simulator draw the same stops with the same seed.

    :param robot: number of the robot, from 0
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAMS_PER_ROBOT * robot + 1,)))


def nominal_rate_cps(calibration: MoistureCurve | None) -> float:
    """Expected rate before the first record: that at 15 % moisture by the calibration, if any [counts/s]."""
    return 4.0 if calibration is None else float(calibration.rate_cps(0.15))


@lru_cache(maxsize=4)
def first_forecast(
    grid: FieldGrid, settings: ExplorerSettings, budget_s: float, aim: Aim | None = None
) -> Forecast:
    """The forecast before a mission of this time [s] and aim starts."""
    rate_cps = nominal_rate_cps(settings.calibration)
    unmapped = Property(FieldMap(grid, knowledge=settings.knowledge), curve=settings.curve)
    return forecaster(grid, rate_cps).before(unmapped, budget_s, aim)


def forecaster(grid: FieldGrid, nominal_rate_cps: float) -> Forecaster:
    """The forecaster of a mission on a grid; the rate is that to expect before there is a map [counts/s]."""
    few = spread_cells(grid.mask, FORECAST_CELLS)[grid.mask]
    return Forecaster(grid.cells[few], grid.extent_m, nominal_rate_cps)
