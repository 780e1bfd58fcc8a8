# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One rehearsal: the planner's real control loop, a mapper, an operator, and a world with faults."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

from rehearsal.cases import RECEIVERS, Case, Fault, Place, Span
from rehearsal.disk import Disk
from rehearsal.judge import Judge, Kind, Limits, Violation
from rehearsal.planner import PlannerProcess, PoseNavigator
from rehearsal.world import World
from soilmoist_ros.exploration import OperatorRequest, Phase, Verb
from soilmoist_ros.foundation import InputError
from soilmoist_ros.mapping import FieldMap
from soilmoist_ros.recording.map_records import MapRecords
from soilmoist_ros.sensing import CountRecord, Doubt

HOME_WITHIN_S = 250.0  # a robot with a low battery is home within this time [s]
BACK_AFTER_S = 8.0  # a killed process is back after this time [s]
ANSWER_S = 30.0  # time that the operator takes to answer [s]
WRONG_M = 3.0  # people see that a robot is this far from where the map shows it [m]
UNKNOWN_M = 1.0  # noise of a receiver that states none, as far as the package can know it [m]
UNTAUGHT_M = 3.0  # motion that such a receiver may hide as long as no standstill has taught its noise [m]
THEIRS_S = 15.0  # what the watch sees of a robot that people have driven, it sees up to this time later [s]
OTHER_ENTRY_M = 25.0  # a navigation that is sent to a node may be this far from the shortest way [m]
PATIENCE = 6  # people who are asked so many times abort the mission
AFTER_RELEASE_S = 15.0  # time between the release of the emergency stop and the resume [s]
BUTTON = "button"
POLL_S = 4.0  # time between looks of the mapper at the disk [s]; each second would take long
OVERTIME_S = 900.0  # a rehearsal ends this long after the budget at the latest [s]
AFTERWARDS_S = 30.0  # the robot is watched this long after the mission has ended [s]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a rehearsal went."""

    violations: tuple[Violation, ...]  # what must not have happened
    visits: int = 0  # number of visits
    driven_m: float = 0.0  # distance driven [m]
    kills: int = 0  # number of kills of planner, mapper and driver
    alarms: int = 0  # number of times at which the guard raised an alarm
    stops: Counter[str] = field(default_factory=Counter)  # alarms that stopped it; not while people drive
    asked: int = 0  # number of times that people were asked
    quarantined: int = 0  # number of records that no map has because of their places
    hours: float = 0.0  # length [h]
    refused: str = ""  # why the mission could not start; empty if it did
    ended: str = ""  # the last reason that the mission gave


def rehearse(case: Case, store: Disk) -> Outcome:
    """Rehearse a case from start to end. The case determines the outcome.

    :param case: what is rehearsed
    :param store: keeps the journal through kills
    """
    rehearsal = _Rehearsal(case, store)
    log = logging.getLogger("soilmoist_ros")
    log.addHandler(rehearsal.crashes)
    try:
        rehearsal.run()
    except Exception as error:
        logging.getLogger(__name__).warning("the rehearsal ends with an exception", exc_info=True)
        rehearsal.judge.blame(Kind.CRASH, rehearsal.world.time_s, f"{type(error).__name__}: {error}")
    finally:
        log.removeHandler(rehearsal.crashes)
        rehearsal.close()
    return rehearsal.outcome()


def home_by_s(case: Case) -> float:
    """When the robot must be home because its battery is low [s]; inf if something else goes wrong, too."""
    low = [span for span in case.faults.spans if span.fault is Fault.LOW_BATTERY]
    if not low or len(case.faults.spans) > 1 or not case.home:
        return math.inf
    return math.ceil(low[0].at_s) + HOME_WITHIN_S


def limits_of(case: Case) -> Limits:
    sd_m = RECEIVERS[case.receiver].sd_m
    noise_m = 4 * sd_m if sd_m > 0.1 else 0.0 if case.stated == "true" else UNKNOWN_M
    off_m = 11.0 if case.stated == "true" else 15.0  # no standstill has taught the noise yet
    if case.navigator == "goto_node":  # the navigation may enter the graph by another node
        off_m = OTHER_ENTRY_M
    moved_m = 1.0 if case.stated == "true" or sd_m > 0.1 else UNTAUGHT_M
    return Limits(notice_s=3.0 if case.fixes_hz >= 1 else 5.0, noise_m=noise_m, off_m=off_m, moved_m=moved_m)


class _Crashes(logging.Handler):
    """Exceptions that the package logs and survives."""

    def __init__(self, blame: Callable[[str], None]) -> None:
        super().__init__(logging.ERROR)
        self._blame = blame

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info:
            self._blame(f"{record.getMessage()}: {record.exc_info[1]!r}")


class MapperProcess:
    """The mapper, as far as the map is concerned."""

    def __init__(self, world: World, store: Disk) -> None:
        self.map = FieldMap(world.case.ground.field.grid())
        self.records = MapRecords(self.map)
        self.sources = store.open_map(self.records)
        for doubt in world.doubts.all:
            self.records.doubt(doubt)
        self._world = world

    def second(self, records: list[CountRecord]) -> None:
        if records:
            self.sources.received(records)
        elif self._world.time_s % POLL_S == 0:
            self.sources.poll()


class _Rehearsal:
    """The world, the processes in it, and the operator."""

    def __init__(self, case: Case, store: Disk) -> None:
        self.case, self.store = case, store
        self.world = World(case)
        self.judge = Judge(case.ground, case.budget_s, limits_of(case), case.radius_m)
        self.crashes = _Crashes(lambda what: self.judge.blame(Kind.CRASH, self.world.time_s, what))
        self.planner: PlannerProcess | None = None
        self.mapper: MapperProcess | None = MapperProcess(self.world, store)
        self._back_s = dict.fromkeys((Fault.KILL_PLANNER, Fault.KILL_MAPPER, Fault.KILL_DRIVER), math.inf)
        self._todo: list[tuple[float, Callable[[PlannerProcess], None]]] = []
        self._pressed: bool | None = None
        self._space_s = math.inf
        self._asked_s = math.inf
        self._started = False
        self._visits = self._kills = self._alarms = self.asked = 0
        self._stops: Counter[str] = Counter()
        self._refusal = self._ended = ""
        self._on: set[str] = set()
        self._people_s = -math.inf
        self._home_by_s = home_by_s(case)

    def run(self) -> None:
        """Rehearse until the mission has ended, and a little longer."""
        try:
            self.planner = PlannerProcess(self.world, self.store, self.judge, self._doubted)
        except InputError as error:
            self._refusal = str(error)
            return
        end_s = self.case.budget_s + OVERTIME_S
        while self.world.time_s < end_s:
            if self._second():
                end_s = min(end_s, self.world.time_s + AFTERWARDS_S)
        now_s = self.world.time_s
        self.store.full(False)
        if self.planner is not None:
            self.judge.ended(now_s, self.planner.status)
        if self.mapper is None:
            return
        self.mapper.sources.poll()
        records = self.store.stored()
        self.judge.kept(now_s, self.world.published, records, "the driver's log")
        self.judge.known(now_s, records, self.world.published, "the driver's log")
        self.judge.mapped(now_s, self.mapper.map.samples, self._whole(records).samples)
        self.judge.placed(now_s, list(map(self.world.doubts.placed, records)), self.world.truth)
        self.judge.mapped(now_s, self.mapper.map.samples, self._whole(self.world.published).samples)

    def _whole(self, records: Sequence[CountRecord]) -> FieldMap:
        """The map of records, made at once and in the order of time."""
        assert self.mapper is not None
        whole = FieldMap(self.mapper.map.grid)
        for record in sorted(records, key=lambda record: record.stamp_s):
            whole.add(self.world.doubts.placed(record))
        return whole

    def _doubted(self, doubt: Doubt) -> None:
        if self.mapper is not None:
            self.mapper.records.doubt(doubt)

    def close(self) -> None:
        if self.mapper is not None:
            self.mapper.sources.close()
        self.store.close_journal()

    def outcome(self) -> Outcome:
        return Outcome(
            violations=tuple(self.judge.violations),
            visits=self._visits + (self.planner.visits if self.planner is not None else 0),
            driven_m=self.world.robot.odometer_m, kills=self._kills, alarms=self._alarms, stops=self._stops,
            asked=self.asked,
            quarantined=sum(bool(self.world.doubts.placed(one).quarantine) for one in self.world.published),
            hours=self.world.time_s / 3600, refused="" if self._started else self._refusal or "it did not start",
            ended=self._ended,
        )  # fmt: skip

    def _second(self) -> bool:
        """Let a second pass; whether the mission has ended."""
        world, before, passed = self.world, self.world.robot.place, list[Place]()
        said, right = None if self.planner is None else self.planner.status, world.robot.right
        way = () if self.planner is None else self.planner.link.corners
        for places, fixes in world.second():
            passed += places
            for place, stamp_s in fixes:
                if self.planner is not None:
                    self.planner.control.fix(place, world.case.stated_sd_m, stamp_s)
        if said is not None:
            led = world.led, world.with_people
            self.judge.drove(world.time_s, before, passed, said, world.obeys, *led, right, way)
        begun, replies = world.events()
        for span in begun:
            self._begin(span)
        self._come_back()
        records = world.records()
        if records:
            self.store.publish(records)
        if self.mapper is not None:
            self.mapper.second(records)
        if self.planner is None:
            return False
        for reply in replies:
            self.planner.link.heard(reply)
        if records:
            self.planner.control.records(records)
            self._map()
        if world.charge is not None:
            self.planner.control.battery(world.charge, math.nan)
        self.planner.second()
        self._operate(self.planner)
        status = self.planner.status
        assert status is not None
        on = {alarm.cause for alarm in status.alarms}
        if world.with_people:
            self._people_s = world.time_s
        self._alarms += len(on - self._on)
        self._stops.update(
            alarm.cause
            for alarm in status.alarms
            if alarm.response.stops and alarm.cause not in self._on and world.time_s > self._people_s + THEIRS_S
        )
        self._on = on
        self._ended = f"{status.phase}: {status.reason}"
        self.judge.said(world.time_s, status, world.wrong_m)
        for server in (world.server, world.listener):
            if server.overridden:
                self.judge.overridden(world.time_s, server.overridden)
        if world.time_s == self._home_by_s:
            self.judge.home_by(world.time_s, world.robot.place, self.planner.home)
        return self.planner.finished

    def _begin(self, span: Span) -> None:
        match span.fault:
            case Fault.KILL_PLANNER if self.planner is not None:
                self._visits += self.planner.visits
                self.planner = None
                self.store.close_journal()
                self._back_s[span.fault] = self.world.time_s + BACK_AFTER_S
                self._kills += 1
            case Fault.OTHER_CLIENT if self.planner is not None and isinstance(self.planner.link, PoseNavigator):
                self.planner.link.overhear()  # its pose is on the topic
            case Fault.KILL_MAPPER if self.mapper is not None:
                self.mapper.sources.close()
                self.mapper = None
                self._back_s[span.fault] = self.world.time_s + BACK_AFTER_S
                self._kills += 1
            case Fault.KILL_DRIVER:
                self.world.has_driver = False
                self._back_s[span.fault] = self.world.time_s + BACK_AFTER_S
                self._kills += 1
            case Fault.DISK_FULL:
                self.store.full(True)
                self._space_s = span.end_s
            case Fault.EMERGENCY:
                self._press(True)
                self._todo += [
                    (self.world.time_s + 2.0, self._resume),  # refused: it is still pressed
                    (span.end_s, lambda planner: self._press(False)),
                    (span.end_s + AFTER_RELEASE_S, self._resume),
                ]
            case Fault.PAUSE:
                self._todo += [(span.at_s, partial(self._stop, Verb.PAUSE)), (span.end_s, self._resume)]
            case Fault.ABORT:
                self._todo.append((span.at_s, partial(self._stop, Verb.ABORT)))
            case Fault.SKIP | Fault.RETURN | Fault.MEASURE | Fault.RULE_OUT | Fault.CHANGE | Fault.REORDER:
                self._todo.append((span.at_s, partial(self._ask, span)))
            case _:
                pass

    def _come_back(self) -> None:
        """Start the processes again that were killed, and make space on the disk."""
        if self.world.time_s >= self._space_s:
            self._space_s = math.inf
            self.store.full(False)
        for process, back_s in self._back_s.items():
            if back_s > self.world.time_s:
                continue
            self._back_s[process] = math.inf
            if process is Fault.KILL_PLANNER:
                self.planner = PlannerProcess(self.world, self.store, self.judge, self._doubted)
                if self._pressed is not None:
                    self.planner.control.emergency(self._pressed, BUTTON)  # the topic is latched
            elif process is Fault.KILL_DRIVER:
                self.world.has_driver = True
            else:
                self.mapper = MapperProcess(self.world, self.store)
            self._map()

    def _map(self) -> None:
        """The mapper publishes; the variogram only when the planner waits for it, to save time."""
        silent = self.world.faults.on(Fault.MAPPER_SILENT, self.world.time_s)
        if self.mapper is None or self.planner is None or silent:
            return
        field_map, control, status = self.mapper.map, self.planner.control, self.planner.status
        state = field_map.state
        control.samples(state.samples, state.stamp_s)
        if status is None or status.phase is Phase.PLANNING:
            control.fit(field_map.fit(state), state.stamp_s, cell_m=field_map.grid.cell_m)

    # People

    def _operate(self, planner: PlannerProcess) -> None:
        """What people do now: as the case says, and resume when the mission asks."""
        now_s = self.world.time_s
        if not self._started:
            self._started = self.judge.resumes(now_s, partial(self._start, planner))
        due = [do for at_s, do in self._todo if at_s <= now_s]
        self._todo = [(at_s, do) for at_s, do in self._todo if at_s > now_s]
        asked = planner.status is not None and planner.status.needs_operator
        self._asked_s = min(self._asked_s, now_s) if asked else math.inf
        if now_s > self._asked_s + ANSWER_S:
            self.asked += 1
            due.append(self._resume if self.asked < PATIENCE else partial(self._stop, Verb.ABORT))
            self._asked_s = math.inf
        for do in due:
            do(planner)

    def _start(self, planner: PlannerProcess) -> bool:
        answer = planner.control.command(Verb.START)
        self._refusal = answer.message
        return answer.accepted

    def _press(self, pressed: bool) -> None:
        """Press or release the emergency stop; a planner that is not there hears of it later."""
        self._pressed = pressed
        if pressed:
            self.judge.stopped(self.world.time_s, "an emergency stop")
        if self.planner is not None:
            self.planner.control.emergency(pressed, BUTTON)

    def _resume(self, planner: PlannerProcess) -> None:
        """Resume; people look first whether the robot is where it may be, and where the map shows it."""
        if not (self.world.with_people or self.world.in_the_field):
            self.world.bring_back()
        if self.world.with_people or self.world.wrong_m > WRONG_M:
            self._todo.append((self.world.time_s + ANSWER_S, self._resume))
            return
        self.judge.resumes(self.world.time_s, lambda: planner.control.command(Verb.RESUME).accepted)

    def _stop(self, verb: Verb, planner: PlannerProcess) -> None:
        if planner.control.command(verb).accepted:
            self.judge.stopped(self.world.time_s, verb)

    def _ask(self, span: Span, planner: PlannerProcess) -> None:
        """A request at a place that has nothing to do with the fence."""
        low, high = (
            self.case.ground.field.polygon.min(axis=0) - 10,
            self.case.ground.field.polygon.max(axis=0) + 10,
        )
        x, y = (low + (high - low) * ((7 * span.size) % 1, (31 * span.size) % 1)).tolist()
        requests = {
            Fault.MEASURE: OperatorRequest("measure", place=(x, y), dwell="30"),
            Fault.RULE_OUT: OperatorRequest("rule_out", polygon=((x, y), (x + 25, y), (x, y + 25))),
            Fault.CHANGE: OperatorRequest("change", strategy="random", hours=self.case.budget_s / 4000),
        }
        if span.fault is Fault.REORDER:
            for place in ((x, y), tuple(((low + high) / 2).tolist())):
                planner.control.request(OperatorRequest("measure", place=place, dwell="20"))
            queue = planner.status.queue if planner.status is not None else ()
            requests[span.fault] = OperatorRequest("order", stops=tuple(reversed(queue)))
        request = requests.get(span.fault, OperatorRequest(span.fault))
        if span.fault is Fault.RETURN:  # it lets the robot drive, too
            self.judge.resumes(self.world.time_s, lambda: planner.control.request(request).accepted)
        else:
            planner.control.request(request)
