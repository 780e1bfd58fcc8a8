# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Run one mission on a surrogate field: the real mission logic, virtual robots and sensors, a simulated clock."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.exploration import (
    PUBLISHED_MIN_LAST_DWELL_S,
    Action,
    CancelGoal,
    CertifiedStops,
    Command,
    Counting,
    Event,
    Explorer,
    Finish,
    GoalFailed,
    GoalReached,
    GoTo,
    LearnedMotion,
    Mission,
    MissionRules,
    Moved,
    PendingMeasurement,
    Phase,
    Property,
    Publish,
    RecordArrived,
    RequestPlan,
    StartCounting,
    Stop,
    Thresholds,
    Tick,
    Verb,
    Visit,
    VisitDone,
    check_time,
    correction_factor,
    dwell_rule,
    make_strategy,
    nominal_rate_cps,
    parse_thresholds,
    pending_measurement,
    person_rules,
    strategy_kind,
    strategy_stream,
    warm_up,
)
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import CovariateSource, EarlierSurvey, read_covariates
from soilmoist_ros.sensing import CountRecord
from soilmoist_ros.simulation.mission.channel import Channel, mission_fields, mission_properties
from soilmoist_ros.simulation.mission.mission_ground import start_stops, travel_and_stops
from soilmoist_ros.simulation.mission.mission_result import (
    MissionResult,
    Moment,
    RobotMoment,
    SeriesRow,
    TimedForecast,
    Watch,
)
from soilmoist_ros.simulation.mission.settings import MissionSettings
from soilmoist_ros.simulation.mission.streams import person_stream, position_errors, sealed_seed, sensor_stream
from soilmoist_ros.simulation.robot.virtual_devices import VirtualSensor
from soilmoist_ros.simulation.robot.virtual_navigation import Habits, VirtualPerson, VirtualRobot

Array = NDArray[np.float64]

_log = logging.getLogger(__name__)

_NO_SURVEYS: Mapping[str, Sequence[EarlierSurvey]] = MappingProxyType({})
PLACES_PER_RECORD = 10  # number of positions, evenly spaced in time, at which the rate of a record is sampled


def simulate_mission(
    settings: MissionSettings,
    progress: Callable[[float], None] | None = None,
    forecasts: bool = False,
    earlier: Mapping[str, Sequence[EarlierSurvey]] = _NO_SURVEYS,
    covariates: Sequence[CovariateSource] = (),
    watch: Watch | None = None,
) -> MissionResult:
    """Simulate one mission. The settings determine the result, bit for bit.

    :param progress: called regularly with the elapsed share of the mission time [0..1]
    :param forecasts: whether to forecast the map's standard deviation, some milliseconds each; always done where a
        forecast may end the mission
    :param earlier: earlier surveys that inform the maps, by name of the property
    :param watch: receives each moment, which does not change the mission; its false ends the mission
    :raises InputError: if the settings cannot be used: an unknown field, strategy or dwell rule, bad files
    """
    return _Simulation(settings, forecasts, earlier, covariates).run(progress or (lambda share: None), watch)


@dataclass(eq=False)
class _Robot:
    """One robot of a mission: state machine, explorer, position, and records."""

    number: int  # from 1
    mission: Mission
    explorer: Explorer
    body: VirtualRobot
    sensors: Sequence[VirtualSensor]  # one per property
    noise_m: Iterator[tuple[float, float]]  # successive position errors, east and north [m]
    learned: LearnedMotion  # how it moves, as its planner knows
    goal: tuple[float, GoTo] | None = None  # time of arrival, and the action
    ahead: tuple[Stop, ...] = ()
    records: list[list[CountRecord]] = field(default_factory=list)  # in order of time, one record per sensor each
    ended: str = ""
    deadline_s: float = math.inf  # set by next_s()
    sent_xy: tuple[float, float] | None = None  # position at the last Moved event

    @property
    def record_s(self) -> float:
        """Time when the next record ends [s]."""
        return (len(self.records) + 1) * self.sensors[0].cadence_s

    def next_s(self, now_s: float) -> float:
        """Time of the next event of the robot [s]; inf after the end of its mission."""
        if self.ended:
            return math.inf
        arrival_s = self.goal[0] if self.goal else math.inf
        deadline_s = self.mission.next_deadline_s
        self.deadline_s = math.inf if deadline_s is None else max(deadline_s, now_s)
        return min(self.record_s, arrival_s, self.deadline_s)


class _Simulation:
    """State of one running mission."""

    def __init__(
        self,
        settings: MissionSettings,
        forecasts: bool = False,
        earlier: Mapping[str, Sequence[EarlierSurvey]] = _NO_SURVEYS,
        covariates: Sequence[CovariateSource] = (),
    ) -> None:
        settings.check()
        self.settings = settings
        ends = (
            bool(settings.until)
            or settings.until_sd > 0
            or settings.until_gain > 0
            or settings.threshold is not None
        )
        self.forecasts_wanted = forecasts or ends
        # Without this, nothing depends on the maps; they are made for the entries of the series only.
        kind = strategy_kind(settings.strategy)
        self.guided = kind.needs_map or self.forecasts_wanted
        fields = mission_fields(settings)
        self.field = first = fields[0]
        if settings.target == "vwc" and first.curve is None:
            raise InputError(
                f"the field {first.name!r} has no calibration, so its moisture cannot be mapped",
                "choose the target rate, or give the field a calibration",
            )
        self.thresholds = None
        if settings.threshold is not None:
            self.thresholds = Thresholds.of(parse_thresholds(settings.threshold), first.curve)
        self.of_moisture = settings.of_moisture(first.curve is not None)
        self.grid = first.field.grid(settings.cell_m)
        self.travel, self.stops = travel_and_stops(first.field, self.grid, settings.motion, settings)
        known = read_covariates((*first.field.covariates, *covariates), first.frame, self.grid)
        # The calibration belongs to the mission field; other properties have no moisture.
        self.channels = [
            Channel(
                one, self.grid, settings, one.curve if one is first else None, wanted, number,
                earlier.get(wanted.name, ()), known, kind.whole_map or settings.map_from == "stops",
            )
            for number, (one, wanted) in enumerate(zip(fields, mission_properties(settings), strict=True))
        ]  # fmt: skip
        starts = start_stops(first.field, self.stops, settings)
        self.robots = [self.robot(number, start) for number, start in enumerate(starts)]
        # Times from the positions of a record to its end.
        self.before_s = settings.cadence_s * (np.arange(PLACES_PER_RECORD) + 0.5) / PLACES_PER_RECORD
        self.now_s = 0.0
        self.visits: list[Visit] = []
        self.series: list[SeriesRow] = []
        self.log: list[str] = []
        self.forecasts: list[TimedForecast] = []

    def robot(self, number: int, start: Stop) -> _Robot:
        """Create a robot at its start, numbered from 0; all robots share the maps."""
        settings, seed = self.settings, self.settings.seed
        recommended = settings.preset == "recommended"
        min_dwell_s = settings.min_dwell_s or settings.cadence_s
        warm_up_stops, first_strategy = warm_up(settings.strategy, settings.preset)
        rules = MissionRules(
            budget_s=settings.hours * 3600,
            dwell=dwell_rule(settings.dwell),
            warm_up_stops=warm_up_stops,
            speed_mps=settings.speed_mps,
            detour=1.0,
            stop_overhead_s=settings.stop_overhead_s,
            min_dwell_s=min_dwell_s,
            # A record must be counted wholly at the stop, and the time of its beginning is not chosen.
            min_last_dwell_s=min_dwell_s + settings.cadence_s
            if recommended
            else settings.min_dwell_s or PUBLISHED_MIN_LAST_DWELL_S,
            stays=recommended and settings.map_from == "records",
            arrival_radius_m=max(3.0, 5 * settings.position_sd_m),
            standstill_s=0.0,  # a simulated robot stands at once
            backoff_s=0.0,
            silence_limit_s=max(60.0, 3 * settings.cadence_s),
            until_sd=settings.until_sd,
            until_gain=settings.until_gain,
            until=settings.aim,
        )
        check_time(settings.certify, self.grid.area_m2, settings.motion, rules, settings.cadence_s)
        mission = Mission(rules if settings.person is None else person_rules(rules))
        explorer = Explorer(
            [
                Property(
                    channel.field_map,
                    channel.wanted.weight,
                    curve=channel.curve if self.of_moisture else None,
                    thresholds=None if channel is not self.channels[0] else self.thresholds,
                )
                for channel in self.channels
            ],
            self.stops,
            copy(self.travel),  # each robot learns its own motion
            make_strategy(settings.strategy, settings.preset),
            first_strategy,
            mission.rules,
            strategy_stream(seed, number),
            nominal_rate_cps(self.field.curve),
            Counting(settings.cadence_s, settings.map_from == "records"),
            forecasts=self.forecasts_wanted,
            grid=self.grid,
            certified=CertifiedStops(settings.certify, lambda: sealed_seed(seed)).plan
            if settings.certify
            else None,
        )
        body = VirtualRobot(settings.motion, start.xy)
        if settings.person is not None:
            habits, rng = Habits.parse(settings.person), person_stream(seed, number)
            body = VirtualPerson(body.motion, start.xy, habits, self.stops, settings.position_sd_m, rng)
        sensors = [
            VirtualSensor(
                channel.field, sensor_stream(seed, kind, number, settings.robots), settings.cadence_s,
                settings.footprint_m, settings.weather, settings.rate_drift,
            )
            for kind, channel in enumerate(self.channels)
        ]  # fmt: skip
        noise_m = position_errors(seed, number, settings.position_sd_m)
        learned = LearnedMotion(settings.motion)
        return _Robot(number + 1, mission, explorer, body, sensors, noise_m, learned)

    def run(self, progress: Callable[[float], None], watch: Watch | None = None) -> MissionResult:
        """Process events in order of time until the missions of all robots have ended."""
        for robot in self.robots:
            self.give(robot, Moved(self.now_s, *robot.body.at(self.now_s), sd_m=self.settings.position_sd_m))
            self.give(robot, Command(self.now_s, Verb.START))
        self.enter_series()
        next_entry_s = self.settings.series_every_s
        while not all(robot.ended for robot in self.robots):
            due = [robot.next_s(self.now_s) for robot in self.robots]
            self.now_s = min(next_entry_s, *due)
            for robot, due_s in zip(self.robots, due, strict=True):
                if due_s == self.now_s:
                    self.advance(robot)
            if self.now_s == next_entry_s:
                self.enter_series()
                next_entry_s += self.settings.series_every_s
                progress(min(self.now_s / (3600 * self.settings.hours), 1.0))
            if watch is not None and not watch(self.moment()):
                watch = None
                for robot in self.robots:
                    self.give(robot, Command(self.now_s, Verb.ABORT))
        for robot in self.robots:
            robot.body.stop(self.now_s)
        for channel in self.channels:
            channel.finish(self.now_s)
        self.enter_series()
        progress(1.0)
        return self.result()

    def moment(self) -> Moment:
        """All robots and the map of the mission field now."""
        mapped = self.channels[0].field_map
        robots = tuple(
            RobotMoment(robot.mission.status, robot.body.at(self.now_s), robot.ahead) for robot in self.robots
        )
        return Moment(
            self.now_s, robots, self.visits, mapped.samples, lambda: mapped.compute(mapped.state, grid=self.grid)
        )

    def advance(self, robot: _Robot) -> None:
        """Process the due events of a robot."""
        if self.now_s == robot.record_s:
            here = robot.body.at(self.now_s)
            reported = self.reported(robot, here)
            if here != robot.sent_xy or self.now_s >= robot.deadline_s:  # deadlines precede the record
                robot.sent_xy = here
                self.give(robot, Moved(self.now_s, *reported, sd_m=self.settings.position_sd_m))
            self.give(robot, RecordArrived(self.now_s, self.record(robot)))
        if robot.goal and self.now_s >= robot.goal[0]:
            goal = robot.goal[1]
            robot.goal = None
            for corner in robot.body.passed(self.now_s):
                robot.explorer.travel.moved(corner)
            if isinstance(robot.body, VirtualPerson) and not robot.body.stands(self.now_s):  # in a pause
                robot.body.stop(self.now_s)
            place = self.reported(robot, robot.body.at(self.now_s))
            self.give(robot, GoalReached(self.now_s, goal.goal_id, *place))
        if self.now_s >= robot.deadline_s:
            self.give(robot, Tick(self.now_s))

    def give(self, robot: _Robot, event: Event) -> None:
        """Pass an event to the mission of a robot and carry out its actions."""
        for action in robot.mission.step(event):
            self.carry_out(robot, action)

    def carry_out(self, robot: _Robot, action: Action) -> None:
        """Carry out an action; answers and statuses need no action here."""
        match action:
            case Publish():  # the most frequent one
                pass
            case RequestPlan():
                for channel in self.channels:
                    (channel.update if self.guided else channel.update_later)(self.now_s)
                robot.explorer.travel.motion = robot.learned.motion
                plan = robot.explorer.plan(action, robot.body.at(self.now_s), self.pending_of_others(robot))
                self.note(robot, f"plan: {plan.choice.reason}" if plan.choice else "plan: nothing left to measure")
                robot.ahead = (plan.choice.stop, *plan.choice.ahead) if plan.choice else ()
                if plan.forecast is not None:
                    self.forecasts.append(TimedForecast(self.now_s, plan.forecast))
                self.give(robot, replace(plan, now_s=self.now_s))
            case GoTo():
                body, travel = robot.body, robot.explorer.travel
                way = travel.route(body.at(self.now_s), action.stop)
                if isinstance(body, VirtualPerson):
                    robot.goal = (body.walk(self.now_s, travel, action.stop), action)
                else:
                    slower_m = travel.slower_m(way, body.motion.speed_mps)
                    robot.goal = (body.go(self.now_s, way, slower_m), action)
                robot.learned.set_off(self.now_s, way, travel.slower_m(way))
                self.note(robot, f"go to {action.stop.name}: {action.reason}")
            case CancelGoal():
                robot.body.stop(self.now_s)
                robot.goal = None
                robot.learned.give_up()
                self.give(robot, GoalFailed(self.now_s, action.goal_id, "cancelled"))
            case StartCounting():
                robot.learned.arrive(self.now_s)
            case VisitDone(visit=visit):
                self.take(robot, replace(visit, robot=robot.number))
            case Finish(reason=reason):
                robot.ended = reason
                self.note(robot, f"end: {reason}")

    def pending_of_others(self, robot: _Robot) -> list[PendingMeasurement]:
        """Pending measurements of all other robots."""
        at_once = self.settings.map_from == "records"
        statuses = [other.mission.status for other in self.robots if other is not robot]
        return [found for status in statuses if (found := pending_measurement(status, at_once)) is not None]

    def take(self, robot: _Robot, visit: Visit) -> None:
        """Add a complete visit to the maps and the series."""
        self.note(robot, f"sample at {visit.name}: {visit.outcome}")
        self.visits.append(visit)
        if self.settings.map_from == "records":
            return
        warmed_up = len(self.visits) >= min(3, max(robot.mission.rules.warm_up_stops, 2))
        for channel, counted in zip(
            self.channels, zip(*robot.records[-visit.records :], strict=True), strict=True
        ):
            channel.take_stop(self.now_s, visit, counted, warmed_up)
        self.enter_series()

    def record(self, robot: _Robot) -> CountRecord:
        """Count with all sensors over the interval that ends now; returns the record of the mission field."""
        places = robot.body.places(self.now_s - self.before_s)
        x_m, y_m = places[len(places) // 2].tolist()
        reported = self.reported(robot, (x_m, y_m))
        records = [sensor.record(self.now_s, places, reported) for sensor in robot.sensors]
        robot.records.append(records)
        for channel, mapped, record in zip(self.channels, robot.explorer.properties, records, strict=True):
            channel.take(record)
            mapped.factor = correction_factor(record)
        return records[0]

    def reported(self, robot: _Robot, xy: tuple[float, float]) -> tuple[float, float]:
        """A position as the GNSS of a robot reports it."""
        east_m, north_m = next(robot.noise_m)
        return xy[0] + east_m, xy[1] + north_m

    def enter_series(self) -> None:
        """Append the current state to the series."""
        for channel in self.channels:
            channel.catch_up()
        row = SeriesRow(
            time_s=self.now_s,
            distance_m=sum(robot.body.distance_m(self.now_s) for robot in self.robots),
            samples=len(self.visits),
            counting_s=sum(robot.mission.state.all_counting_s for robot in self.robots),
            errors=tuple(channel.errors for channel in self.channels),
        )
        if self.series and self.series[-1].time_s == self.now_s:
            self.series[-1] = row
        else:
            self.series.append(row)

    def note(self, robot: _Robot, text: str) -> None:
        """Append a line to the log of the mission."""
        self.log.append(f"{self.now_s:8.0f} s  {self.named(robot)}{text}")

    def named(self, robot: _Robot) -> str:
        """Prefix with the number of the robot; empty for a single robot."""
        return f"robot {robot.number}: " if len(self.robots) > 1 else ""

    def result(self) -> MissionResult:
        """Result of the mission."""
        assert all(robot.mission.state.phase in (Phase.FINISHED, Phase.IDLE) for robot in self.robots)
        if self.forecasts_wanted and (last := self.robots[0].explorer.achieved()) is not None:
            self.forecasts.append(TimedForecast(self.now_s, last))
        return MissionResult(
            settings=self.settings, series=tuple(self.series), visits=tuple(self.visits),
            tracks=tuple(np.array(robot.body.track) for robot in self.robots),
            properties=tuple(channel.mapped(self.now_s) for channel in self.channels), frame=self.field.frame,
            motion=tuple(robot.learned for robot in self.robots),
            ended="; ".join(f"{self.named(robot)}{robot.ended}" for robot in self.robots), log=tuple(self.log),
            forecasts=tuple(self.forecasts), certificate=self.robots[0].mission.state.certificate,
        )  # fmt: skip
