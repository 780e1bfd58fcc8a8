# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Runs a mission on a real robot: what comes in goes to the mission, what it asks for is carried out.

No ROS in here: the node passes messages in and out, and tests do the same without any.
"""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from soilmoist_ros.exploration.control.explorer import (
    ExplorerSettings,
    OpenSurvey,
    changed_settings,
    first_forecast,
)
from soilmoist_ros.exploration.control.field_access import CurrentAccess, FieldAccess
from soilmoist_ros.exploration.control.mission_feed import MissionClock, MissionFeed
from soilmoist_ros.exploration.control.operator_request import (
    OperatorRequest,
    Reply,
    ReplyCode,
    RequestError,
    Requests,
    refused,
)
from soilmoist_ros.exploration.control.planning_queue import OWN, PlanningQueue, PlanningThread, PropertyMap, Terms
from soilmoist_ros.exploration.control.team import SHUT_IN, Team, pending_measurement, taken
from soilmoist_ros.exploration.control.watching import Watching
from soilmoist_ros.exploration.guard.failsafes import Cause
from soilmoist_ros.exploration.guard.fence import Fence
from soilmoist_ros.exploration.guard.watch import Watch
from soilmoist_ros.exploration.mission import events
from soilmoist_ros.exploration.mission.journal import MissionJournal
from soilmoist_ros.exploration.mission.mission import SDS, Mission
from soilmoist_ros.exploration.mission.types import Changes, MissionRules, MissionStatus, Phase, PlanKind, Verb
from soilmoist_ros.exploration.mission.visit import Visit
from soilmoist_ros.exploration.navigation.navigator import Ended, Navigator, Outcome, in_frame
from soilmoist_ros.exploration.navigation.pose_client import MAX_AGE_S
from soilmoist_ros.exploration.planning.properties import correction_factor
from soilmoist_ros.exploration.strategies.strategy import Choice
from soilmoist_ros.exploration.travel.stop import Array, Stop, Way, inside_any
from soilmoist_ros.exploration.travel.travel import LearnedMotion
from soilmoist_ros.exploration.travel.travel_graph import TravelGraph
from soilmoist_ros.foundation import Health, InputError, Level, LocalFrame, PlaneMove, other_datum
from soilmoist_ros.mapping import Changing, Field, Samples, VariogramFit
from soilmoist_ros.sensing import CountRecord, Doubt, Fix, Heard, PlaceFix, none_since

if TYPE_CHECKING:
    from soilmoist_ros.exploration.guard.robot_frames import RobotFrames

PLACE_TIME = "place_s"  # value of the status: when the newest place has come [s]; -inf for none
PLACE_SHOWN_S = 2.0
"""In a mission the status shows places that are not older than this [s]; a simulated clock waits for that."""
DATUM = "datum"  # value of the status: latitude and longitude of the datum of its places [deg]
GUIDED = "guided_m"
"""Value of the status for a mission by a person: distance at which one is at a stop [m]."""
EXPOSURE = "exposure_s"
"""Value of the status for a mission by a person: exposure of the counts at the stop [s]."""
LEADS = "leads"
"""Value of the status for a person on the way: place to which the arrow points, and length of the way [m]."""
RECORD_STAMP = "record_stamp_s"
"""Value of the status: stamp of the newest record that has come, with or without a place [s]; -inf for none."""

_DECISIONS = (Verb.START, Verb.RESUME, Verb.ABORT, Verb.SKIP, Verb.RETURN)
"""Commands after which a mission that was interrupted is an ordinary one again."""

STEP_S = 1.0  # smaller steps of the clock are the work of a time service [s]
_STUCK_PLANS = 1.25
"""Multiple of the longest wait for a plan after which the thread that makes it counts as stuck."""
_log = logging.getLogger(__name__)


class Outputs(Protocol):
    """Interface that carries out a mission's actions. No method waits."""

    def now_s(self) -> float:
        """Time on the clock that stamps the records [s]; 0 while it does not run yet."""

    def show(self, status: MissionStatus, ahead: tuple[Stop, ...], more: Mapping[str, str]) -> None:
        """Show the mission and the stops ahead, the next one first."""

    def visit(self, visit: Visit) -> None:
        """A stop is complete."""

    def finish(self, finish: events.Finish) -> None:
        """The mission has ended: let the mapper save the map."""

    def wake(self) -> None:
        """Call :meth:`MissionControl.hand_on` soon, from another thread than this one."""


@dataclass(frozen=True, kw_only=True)
class MissionSetup:
    """Field and mission that a control is made for."""

    field: Field
    settings: ExplorerSettings  # settings of the choice of stops
    rules: MissionRules  # rules of the mission, without its home
    home: str = ""  # name of the stop to return to; empty to stay at the last stop
    map_wait_s: float = 20.0  # longest wait for the map before a stop is chosen [s]
    start_delay_s: float = 0.0  # time from the warning to the motion after a standstill by order [s]
    properties: Mapping[str, float] | None = None  # namespaces of further properties, and their weights
    open_survey: OpenSurvey | None = None  # opens what an operator chooses; ``None`` for no choice


class MissionControl:
    """A mission and all around it.

    :param make_navigator: makes the navigator, which is given the function that takes its reports
    :param clock: mission time; ROS time if ``None``
    :param mission: interrupted mission, for :meth:`take_up`; a new one if ``None``
    :param executor: where stops are chosen; its own thread if ``None``
    :param watch: what is watched, by which limits; causes that others find are reported to it
    :param frames: knows the frame of the navigation; ``None`` for the plane of the field
    """

    def __init__(
        self,
        setup: MissionSetup,
        make_navigator: Callable[[Callable[[Ended], None]], Navigator],
        outputs: Outputs,
        journal: MissionJournal | None = None,
        clock: MissionClock | None = None,
        watch: Watch | None = None,
        team: Team | None = None,
        mission: Mission | None = None,
        executor: Executor | None = None,
        frames: RobotFrames | None = None,
    ) -> None:
        self.watch, self.team = watch or Watch(), team or Team()
        self._watching = Watching(self.watch)
        settings = self._settings = setup.settings
        self._open_survey, self._home = setup.open_survey, setup.home
        self._outputs = outputs
        self._clock = clock or MissionClock(outputs.now_s)
        self._current = CurrentAccess(setup.field, settings.motion, settings.access, self._home_name, self._use)
        self._journal = journal or MissionJournal(None)
        self._interrupted = ""
        self._last_command = "", math.nan
        self._has_place = self._resume_when_ready = False
        self._start_delay_s, self._stood = setup.start_delay_s, True
        self._announced: events.GoTo | None = None
        self._due_s = -math.inf  # end of the last warning [s]
        self._start(mission or Mission(setup.rules))
        named = (PropertyMap(name, weight) for name, weight in (setup.properties or {}).items())
        self._queue = PlanningQueue(setup.map_wait_s, (OWN, *named))
        self._planning = PlanningThread(outputs.wake, executor)
        self._choice: Choice | None = None
        self._learned = LearnedMotion(settings.motion)
        self._record_stamp_s = self._shown_stamp_s = self._shown_place_s = -math.inf
        self._frames = frames
        self.navigator = make_navigator(self.ended)

    def _start(self, mission: Mission) -> None:
        self._journal.keep(mission)
        self._mission = mission
        self.heard, self._came = Heard(), 0  # what has come of the receiver
        self._feed = MissionFeed(mission, self._carry_out, self._journal, self.watch)

    def take_up(self, mission: Mission, auto: bool) -> None:
        """Go on with a mission that was interrupted; the robot does not move before somebody resumes it.

        :param auto: resume by itself, once all that is needed is there, unless it was paused until people resume
        """
        doing, stop = mission.state.phase, mission.state.target
        self._interrupted = f"resumable: interrupted while {doing}{f' ({stop.stop.name})' if stop else ''}"
        self._resume_when_ready = auto and not mission.state.waits_for_people
        self._start(mission)
        self._clock.go_on_from(mission.state)
        now_s = max(self._clock.now_s(), mission.state.now_s or 0.0)
        self.watch.adopt((alarm.cause for alarm in mission.state.alarms), now_s)
        self._feed.command(events.Command(now_s, Verb.PAUSE, who=events.RESTART))
        state, visit = mission.state, mission.state.counting
        if state.goal is not None:
            self.navigator.cancel(state.goal.goal_id)  # the robot may still be driving there
        elif state.under_way and visit is not None:
            self.watch.places.stood((visit.x_m, visit.y_m), visit.sd_m, now_s)
        elif state.under_way and state.position is not None:
            self.watch.places.stood(state.position, state.position_sd_m, now_s)

    # What comes in -------------------------------------------------------------------------------------------

    def use_graph(self, graph: TravelGraph | None) -> None:
        """Use a travel graph; without one, the robot drives straight where nothing is in the way.

        :raises InputError: if it does not fit the field, or does not know the home
        """
        self._current.use_graph(graph, self._feed.place if self.under_way else None)

    def _home_name(self) -> str:
        changed = self._mission.state.changes
        return changed.home.name if changed is not None and changed.home is not None else self._home

    def _use(self, access: FieldAccess) -> None:
        self._mission.rules = replace(self._mission.rules, home=access.home)
        access.travel.motion = self._learned.motion
        self._watching.use(access)

    @property
    def _access(self) -> FieldAccess | None:
        return self._current.access

    @property
    def fence(self) -> Fence | None:
        """Region in which the robot's centre may be; ``None`` while it is unknown."""
        return None if self._access is None else self._access.fence

    def may_count(self) -> bool:
        """True if the robot is inside the field, where a stop of a person's own choice makes sense."""
        place, fence = self._feed.place, self.fence
        return place is not None and fence is not None and bool(fence.contains([place])[0])

    @property
    def plane(self) -> LocalFrame:
        """Plane of all places."""
        return self._current.field.frame

    @property
    def under_way(self) -> bool:
        """True if a mission has started and not ended."""
        return self._mission.state.under_way

    @property
    def takes_graph(self) -> bool:
        """True if :meth:`use_graph` may be called: before the first, or while no robot drives in a mission."""
        return self._access is None or not self.under_way or self._mission.state.phase is Phase.PAUSED

    def missing(self) -> tuple[str, ...]:
        """Reasons why a mission cannot start: what is missing; empty if it can."""
        missing = {
            "the time (is /clock published?)": self._clock.now_s() <= 0,
            self._current.waiting_for: self._access is None,
            f"a position{f' ({self._no_place})' if self._no_place else ''}": self._feed.place is None,
            self._waiting_for: bool(self._waiting_for),
            f"the place of {self.team.waiting_for} ({self.team.lost_s:g} s at most)": bool(self.team.waiting_for),
        }
        return tuple(what for what, lacks in missing.items() if lacks)

    @property
    def _waiting_for(self) -> str:
        """Part of the navigation, or of its frame, that is missing; empty if nothing is."""
        return (self._frames.waiting_for if self._frames else "") or self.navigator.waiting_for

    @property
    def about_to_move(self) -> bool:
        """True while people are warned that the robot will move, after a standstill by order."""
        return self._announced is not None

    @property
    def stuck(self) -> bool:
        """True if a stop is being chosen for far longer than the mission waits for it."""
        return self._planning.busy_s > _STUCK_PLANS * self._mission.rules.plan_limit_s

    @property
    def dangers(self) -> str:
        """Reason why a start would be refused now although nothing is missing; empty without a reason."""
        return self._mission.state.start_hindrance

    def command(self, verb: Verb) -> events.Answer:
        """The operator asks for something that needs no details."""
        return self._command(events.Command(self._clock.now_s(), verb))

    def request(self, request: OperatorRequest) -> Reply:
        """An operator, known by name, asks for something; what cannot be used changes nothing."""
        rules, state = self._mission.current_rules, self._mission.state
        requests = Requests(self._current.field, self._access, self._settings, rules, state)
        try:
            command = requests.command(request, self._clock.now_s())
            use_survey = self._opened(command.changes)
            answer = self._command(command)
        except RequestError as error:
            return Reply(error.code, str(error))
        if answer.accepted:
            use_survey()
        return Reply(ReplyCode.ACCEPTED if answer.accepted else ReplyCode.REFUSED, answer.message)

    def _opened(self, changes: Changes | None) -> Callable[[], None]:
        """Open what an operator chooses for the next mission; the function that uses it.

        :raises RequestError: if it cannot be used
        """
        if changes is None or not changes.of_survey or self.under_way:  # the mission refuses it then
            return lambda: None
        with refused(ReplyCode.BAD_SETTING):
            if self._open_survey is None:
                raise InputError("the field cannot be chosen here", "start the planner with it")
            before = self._mission.state.changes or Changes()
            field, settings = self._open_survey(replace(before, **changes.of_survey))
            if field.frame != self._current.field.frame:
                remedy = f"keep the datum {self._current.field.frame}, or start all nodes with the field"
                raise InputError(f"the datum of {field.name!r} is {field.frame}", remedy)
            use_field = self._current.opened(field, self._feed.place)

        def use() -> None:
            self._settings = settings
            use_field()
            self.show()

        return use

    def _command(self, command: events.Command) -> events.Answer:
        verb = command.verb
        sets_off = verb is Verb.RESUME or (verb is Verb.START and not self.under_way)
        if sets_off and (missing := self.missing()):
            return events.Answer(False, f"not yet, waiting for {', '.join(missing)}")
        if sets_off and (refusal := self._current.use_part(self._feed.place)):
            return events.Answer(False, refusal)
        if sets_off:
            self._stood, self._due_s = True, -math.inf
        answer = self._feed.command(command)
        if not answer.accepted:
            return answer
        if command.changes is not None and command.changes.home is not None:
            self._current.use_home(self._feed.place)
        self._last_command = f"{verb} by {command.by}: {answer.message}", command.now_s
        if sets_off:
            self.watch.places.confirm()
        if verb in _DECISIONS:
            self._interrupted = ""
        self._resume_when_ready &= verb not in (*_DECISIONS, Verb.PAUSE)
        if verb is Verb.ABORT:
            self._watching.stopped(command.now_s)
        self.show()
        return answer

    def emergency(self, pressed: bool, source: str) -> None:
        """An emergency stop is pressed or released; a release moves nothing."""
        if pressed:
            self._resume_when_ready = False
            self._watching.stopped(self._clock.now_s())
        self._feed.give(events.EmergencyStop(self._clock.now_s(), pressed, source))

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that an operator may change, as they are now, by the names of the parameters."""
        mission = self._mission
        rules, changes = mission.current_rules, mission.state.changes
        explorer = changed_settings(self._settings, changes)
        home = rules.home.name if rules.home is not None else self._home
        return {
            "hours": round(rules.budget_s / 3600, 9),
            "dwell": str(rules.dwell),
            "strategy": explorer.strategy,
            "target": explorer.target,
            "home": home,
            "until_sd": rules.until_sd,
            "until_gain": rules.until_gain,
            **(changes.of_survey if changes else {}),
        }

    def hear(self, fix: Fix) -> None:
        """An epoch of the receiver has come, with or without a place."""
        self.heard.add(fix)
        self.watch.fix_fault = "" if fix.no_place is None else f"{fix.no_place.text}, {fix.said}"

    @property
    def _no_place(self) -> str:
        """Reason for a missing position, in words; empty if no epoch of a receiver has come."""
        why = self.heard.why_none()
        if why is None:
            return f"{self.heard.placed} came, none plausible so far"
        return why.message.removeprefix("has ") if self.heard.epochs or self.heard.other_type else ""

    def fix(self, place: tuple[float, float], sd_m: float = math.nan, stamp_s: float = math.nan) -> None:
        """The receiver reports a place [m]; one that is not plausible is ignored.

        :param sd_m: standard deviation of each coordinate [m], NaN if unknown
        :param stamp_s: when it was measured [s], NaN if unknown
        """
        self._wake()
        now_s = self._clock.now_s()
        self._watching.expect(self._mission.state, now_s, self._mission.rules.by_person)
        if self._feed.fix(PlaceFix(now_s, *place, sd_m, stamp_s)):
            self._moved(now_s, self.watch.places.sd_m(sd_m))
            if self.under_way and now_s - self._shown_place_s >= PLACE_SHOWN_S:
                self.show()

    def _moved(self, now_s: float, sd_m: float = math.nan) -> None:
        place = self._feed.place
        assert place is not None
        if not self.under_way:
            self._current.moved(place, self._mission.rules.arrival_radius_m)
        if self._access is not None:
            self._access.travel.moved(place)
        self._watching.moved(place, sd_m)
        if self._feed.place_age_s <= MAX_AGE_S:  # where the robot was is no arrival, and no place to stop at
            move = PlaneMove() if self._frames is None else self._frames.move
            if move is not None:
                self.navigator.moved(move.place(place), now_s, sd_m)

    def battery(self, charge: float, voltage_v: float) -> None:
        """The state of the robot's battery: charge [0..1] and voltage [V], NaN if unknown."""
        self.watch.battery(self._clock.now_s(), charge, voltage_v)

    def records(self, records: Sequence[CountRecord], name: str = "", more: bool = False) -> None:
        """Records of a property have come; those with an impossible stamp and quarantined ones are only watched.

        The mission counts those of the robot's own namespace.

        :param more: whether further records of the same message follow: the disk is synced once for all
        """
        self._wake()
        now_s, came = self._clock.now_s(), len(records)
        arrived = self._watching.stamped(records, self._outputs.now_s())
        records = [record for record in arrived if not record.quarantine]
        if records:
            self._queue.take_factor(name, correction_factor(records[-1]))
        if name:
            return
        self._came += came
        self._record_stamp_s = max((record.stamp_s for record in arrived), default=self._record_stamp_s)
        before_s = self._feed.place_s
        self._watching.records(arrived, now_s)
        self._feed.records(now_s, records, more)
        if self._feed.place_s != before_s:
            self._moved(now_s)
        if self._mission.state.phase is Phase.COUNTING and self._shown_stamp_s != self._record_stamp_s:
            self.show()  # a simulated clock waits until each record has been received

    def samples(self, samples: Samples, stamp_s: float, name: str = "") -> None:
        """The merged samples of a property have come."""
        self._queue.take_samples(name, samples, stamp_s)
        if not name:
            self.watch.map(self._clock.now_s(), stamp_s)
        self._plan_if_due()

    def fit(
        self,
        fit: VariogramFit | None,
        stamp_s: float,
        name: str = "",
        cell_m: float | None = None,
        changing: Changing | None = None,
    ) -> None:
        """Use a new variogram of a property in plans.

        :param cell_m: cell size of the map [m]; the planner takes over that of the robot's own property
        :param changing: the drift that the map allows for; ``None`` without one
        """
        if not name and cell_m is not None:
            self._current.use_cells(cell_m)
        self._queue.take_fit(name, fit, stamp_s, changing)
        self._plan_if_due()

    def other(
        self,
        name: str,
        status: MissionStatus | None,
        goes_first: bool = False,
        datum: tuple[float, float] | None = None,
    ) -> None:
        """The status of another robot's mission has come.

        :param status: of its mission, ``None`` while none has come
        :param goes_first: whether it keeps a stop that both have chosen; one that counts there always keeps it
        :param datum: latitude and longitude of the datum of its places [deg]; ``None`` if it does not say
        """
        robot, now_s = self.team.robot(name), self._clock.now_s()
        if datum is not None and (fault := other_datum(datum, self._current.field.frame)):
            robot.stranger, status = fault, None
        pending = None
        if status is not None:
            robot.hear(status, now_s, goes_first)
            pending = pending_measurement(status, apart_m=self.team.apart_m)
        self._queue.take_other(name, pending)
        state, access = self._mission.state, self._access
        keeps = goes_first or (status is not None and status.phase is Phase.COUNTING)
        if not keeps or pending is None or access is None or state.target is None:
            return
        place = np.array([state.target.stop.xy])
        if state.phase is Phase.TRAVELLING and taken(place, [pending], access.grid.cell_m)[0]:
            self._feed.give(events.Command(self._clock.now_s(), Verb.SKIP, f"because {name} goes there"))

    def doubts(self) -> list[Doubt]:
        """Doubts about the place that are new or over since the last call, on the clock that stamps records."""
        places, offset_s = self.watch.places, self._mission.state.stamp_offset_s
        places.set_clock(offset_s, self._clock.now_s())
        found = places.news()
        if places.fix is not None and not self._has_place:
            self._has_place = True
            found.insert(0, none_since(places.fix.time_s + offset_s))
        return found

    def now_s(self) -> float:
        """Time of the mission [s]."""
        return self._clock.now_s()

    def second(self) -> None:
        """A second of steady time has passed: robots that are not heard are lost some day."""
        for name in self.team.pass_time(1.0):
            self._queue.take_other(name, None)

    def _wake(self) -> None:
        """If the planner slept while it had a goal, pause before anything that has come meanwhile is believed."""
        slept_s, mission = self._clock.slept_s(), self._mission
        if slept_s and mission.state.goal is not None and not mission.rules.by_person:
            now_s = self._clock.now_s()
            alarm = self.watch.answer(Cause.WATCHDOG, f"the planner was silent for {slept_s:.0f} s", now_s)
            if alarm is not None:
                self._feed.give(alarm)

    def ended(self, ended: Ended) -> None:
        """The navigator reports the end of a goal."""
        self._wake()
        self._feed.ended(self._clock.now_s(), ended)

    def tick(self) -> None:
        """Time has passed; to be called several times a second."""
        self._wake()
        self.navigator.tick(self._clock.now_s())
        if self._clock.now_s() > 0:
            for event in self._clock.events(self._mission.state):
                if isinstance(event, events.ClockStepped):
                    _log.warning("the clock was set by %+.1f s; the mission goes on in its own time", event.step_s)
                    if abs(event.step_s) >= STEP_S:
                        way = "forward" if event.step_s > 0 else "back"
                        self.watch.note(Cause.CLOCK_STEP, f"the clock was set {way} by {abs(event.step_s):.0f} s")
                self._feed.give(event)
            self._feed.give(events.Tick(self._clock.now_s()))
        state = self._mission.state
        if not state.under_way or state.phase is Phase.PAUSED:
            self._stood, self._due_s = True, -math.inf
        if self._announced is not None and self._clock.now_s() >= self._due_s:
            goal, self._announced = self._announced, None
            self._go(goal)
        ready = state.phase is Phase.PAUSED and state.interrupted and self.watch.places.doubt is None
        resumes = self._resume_when_ready and ready and not (self.missing() or state.hindrance)
        if resumes and self.command(Verb.RESUME).accepted:  # a refused one would be written down at each tick
            self._last_command = "continued by itself after an interruption", self._last_command[1]
        self._plan_if_due()

    def check(self) -> None:
        """Let the watch judge; to be called several times a second of steady time."""
        now_s = self._clock.now_s()
        if now_s > 0:
            doing = self._watching.doing(self._mission, self.navigator, self._waiting_for)
            waits = Cause.OTHER_ROBOT in self.watch.on
            near = self.team.fault(self._feed.place, doing.driving, waits, now_s)
            rules, place = self._mission.current_rules, self._feed.place
            if not near and self.team.is_shut_in(self._access, place, rules, self.under_way, now_s):
                near = SHUT_IN
            self.watch.report(Cause.OTHER_ROBOT, near)
            for event in self.watch.check(now_s, doing):
                self._feed.give(event)

    def hand_on(self) -> None:
        """Hand the plans that are ready to the mission."""
        for answer in self._planning.answers():
            event = replace(answer, now_s=self._clock.now_s())
            if isinstance(event, events.Planned):
                self._choice = event.choice
                if event.choice is None and self.team.waits(event.now_s):
                    event = events.PlanFailed(event.now_s, event.plan_id, SHUT_IN)
            self._feed.give(event)

    def close(self) -> None:
        """Stop the robot: nobody would know what to do when it arrives."""
        self._feed.close()
        announced, self._announced = self._announced, None
        if self._mission.state.goal is not None and announced is None:
            self.navigator.cancel(self._mission.state.goal.goal_id)
        self._planning.close()

    # What is shown -------------------------------------------------------------------------------------------

    def show(self) -> None:
        """Show the mission as it is."""
        status = self._mission.status
        offset_s, end_s = status.clock_offset_s, status.estimated_end_s
        if offset_s:  # people compare it with their clocks
            end_s = None if end_s is None else end_s + offset_s
            status = replace(status, now_s=status.now_s + offset_s, estimated_end_s=end_s)
        missing = self.missing() if status.phase is Phase.IDLE else ()
        if missing:
            status = replace(status, reason=f"waiting for {', '.join(missing)}", hindered=True)
        elif status.phase is Phase.IDLE and self.dangers:
            why = f"waiting for start, which is refused: {self.dangers}"
            status = replace(status, reason=why, hindered=True)
        if status.phase in (Phase.PAUSED, Phase.CANCELLING) and self._interrupted:
            why = "resume or abort" if self._mission.state.interrupted else status.reason
            status = replace(status, reason=f"{self._interrupted}; {why}", needs_operator=True)
        if call := self.team.call(self._clock.now_s()):
            status = replace(status, reason=call, needs_operator=True)
        if status.phase is Phase.IDLE and self._access is not None:
            rules, changes = self._mission.current_rules, self._mission.state.changes
            settings = changed_settings(self._settings, changes)
            forecast = first_forecast(self._access.grid, settings, rules.budget_s, rules.aim)
            status = replace(status, forecast=forecast)
        target, choice = status.target, self._choice
        requested = tuple(queued.stop for queued in self._mission.state.queue)
        ahead = requested if target is None else (target, *requested)
        if choice is not None and choice.stop == target:
            ahead = (choice.stop, *requested, *choice.ahead)
        barred = inside_any(status.ruled_out, [stop.xy for stop in ahead])
        ahead = tuple(stop for stop, out in zip(ahead, barred, strict=True) if not out)
        home = self._mission.current_rules.home
        self._shown_stamp_s, self._shown_place_s = self._record_stamp_s, self._feed.place_s
        more = {
            "on_the_way": self.navigator.on_the_way,
            "travel": str(self._learned),
            DATUM: json.dumps([self._current.field.frame.latitude_deg, self._current.field.frame.longitude_deg]),
            RECORD_STAMP: repr(self._record_stamp_s),
            PLACE_TIME: repr(self._feed.place_s + offset_s),
            "settings": json.dumps({**self.settings, "targets": self._settings.targets}),
            "home_place": json.dumps(home and list(home.xy)),
            "last_command": self._last_command[0],
            "last_command_s": repr(self._last_command[1]),
        }
        if self._mission.rules.by_person:
            rules, counting = self._mission.current_rules, self._mission.state.counting
            more[GUIDED] = repr(rules.arrival_radius_m if target is None else rules.reach_m(target))
            more[EXPOSURE] = repr(counting.exposure_s if counting else 0.0)
            place, on_the_way = self._feed.place, status.phase in (Phase.TRAVELLING, Phase.RETURNING)
            if on_the_way and target is not None and place is not None and self._access is not None:
                way = Way(np.array([place, target.xy]))
                with suppress(InputError):  # people find a way, wherever they stand
                    way = self._access.way(place, target)
                more[LEADS] = json.dumps([round(value, 1) for value in way.leads])
        self._outputs.show(status, ahead, more)

    def health(self) -> list[Health]:
        """Health of what the mission depends on."""
        now_s = self._clock.now_s()
        waiting, navigator = self._waiting_for, self.navigator
        doubt = f"waiting for {waiting}" if waiting else navigator.caution
        level = self._severity if doubt else Level.OK
        problem = self._journal.problem
        faults, weighed = self._queue.faults, ", ".join(self._queue.weighed)
        known = [Health("properties", Level.OK, f"the last stop was chosen with the map of {weighed}")]
        others = self.team.health(self.under_way)
        return [
            *([Health("journal", Level.ERROR, problem)] if problem else []),
            *([others] if others is not None else []),
            *([Health("properties", Level.WARN, "; ".join(faults))] if faults else known if weighed else []),
            Health("navigation", level, doubt or navigator.on_the_way or "there"),
            self._age("position", now_s - self._feed.place_s, self.watch.limits.fix_old_s),
            self._age("records", now_s - self._feed.record_s, self.watch.limits.records_old_s),
            self.watch.health(now_s),
        ]

    @property
    def _severity(self) -> Level:
        return Level.ERROR if self.under_way else Level.WARN

    def _age(self, name: str, age_s: float, limit_s: float) -> Health:
        values = {"without_place": str(self._feed.records_without_place)} if name == "records" else {}
        if math.isinf(age_s):
            unused = f"{self._came} came, all quarantined or with an impossible stamp" if self._came else ""
            none = self._no_place if name == "position" else unused
            return Health(name, self._severity, none or "none has come", values)
        level = self._severity if age_s > limit_s else Level.OK
        return Health(name, level, f"{age_s:.0f} s old", {"age_s": f"{age_s:.1f}", **values})

    # What the mission asks for -------------------------------------------------------------------------------

    def _carry_out(self, action: events.Action) -> None:
        match action:
            case events.RequestPlan():
                if self._access is not None:
                    self._access.travel.motion = self._learned.motion
                if action.staying:
                    self._measured()
                self._queue.ask(action, self._clock.now_s())
                self._plan_if_due()
            case events.GoTo():
                self._announce_or_go(action)
            case events.StartCounting():
                self._learn()
            case events.CancelGoal():
                self._learned.give_up()
                if self._announced is not None and self._announced.goal_id == action.goal_id:
                    self._announced, self._stood = None, True  # what follows waits for the rest of the delay
                    self.ended(Ended(action.goal_id, Outcome.CANCELED, "cancelled before it was sent"))
                else:
                    self.navigator.cancel(action.goal_id)
            case events.VisitDone(visit=visit):
                self._journal.visit(visit)
                self._outputs.visit(visit)
                self._measured()
            case events.Publish():
                self._journal.keep(self._mission)
                self.show()
            case events.Finish():
                self._outputs.finish(action)

    def _announce_or_go(self, goal: events.GoTo) -> None:
        """Send a goal; first warn people if the robot stood by order."""
        now_s, delay_s = self._clock.now_s(), self._start_delay_s
        if not (self._stood and delay_s > 0):
            self._go(goal)
            return
        self._stood = False
        if now_s >= self._due_s:
            self._due_s = now_s + delay_s
        self._announced = goal

    def _measured(self) -> None:
        """All records so far are mapped before the next stop is chosen."""
        if (ended_s := self._mission.state.last_stamp_s) is not None:
            self._queue.measured(ended_s + self._mission.state.stamp_offset_s)

    def _go(self, goal: events.GoTo) -> None:
        """Send a goal with its route; one that the fence refuses is never sent."""
        place = self._feed.place
        try:
            if self._access is None or place is None:
                raise InputError("where the robot is, or may go, is not known")
            way = self.team.way(self._access, place, goal.stop)
        except InputError as refusal:
            if place is None or not self._mission.rules.by_person:
                failed = events.GoalFailed(self._clock.now_s(), goal.goal_id, f"not sent: {refusal}", True)
                self._feed.give(failed)
                return
            way = Way(np.array([place, goal.stop.xy]))  # people find one, wherever they stand
        slower_m = self._access.travel.slower_m(way.corners) if self._access is not None else 0.0
        self._learned.set_off(self._clock.now_s(), way.corners, slower_m)
        self.team.set_off()
        self._watching.sent(way)
        way = replace(way, judge=self._judge_route)
        stop, way = self._reached(goal.stop), replace(way, nodes=tuple(map(self._reached, way.nodes)))
        if self._frames is not None:
            assert self._frames.move is not None, "no mission starts before it is known"
            stop, way = in_frame(stop, way, self._frames.move)
        self.navigator.go(goal.goal_id, stop, way)

    def _judge_route(self, path: Array, nodes: Array) -> str:
        """Reason why a route that the navigation announces is not allowed; one that is becomes the watched one."""
        access, place = self._access, self._feed.place
        if access is None or place is None:
            return "the robot's place is not known"
        if refusal := access.refusal_of_route(place, path, nodes):
            return refusal
        way = Way(np.concatenate([[place], path]))
        for name, at in self.team.standing():
            if way.passes_m(at) < self.team.apart_m:
                return f"{name} stands in the way"
        self._watching.sent(way)
        return ""

    def _reached(self, stop: Stop) -> Stop:
        """The stop with the distance at which the mission takes the robot to be there, by the noise of now."""
        noise_m = SDS * self._mission.state.position_sd_m
        return replace(stop, reach_m=self._mission.current_rules.reach_m(stop, noise_m))

    def _learn(self) -> None:
        """Learn from the leg that has just ended, if one has, how the robot moves."""
        if self._learned.arrive(self._clock.now_s()):
            cautious = self._learned.cautious
            self._mission.rules = replace(
                self._mission.rules, speed_mps=cautious.speed_mps, stop_overhead_s=cautious.stop_overhead_s
            )

    # Planning ------------------------------------------------------------------------------------------------

    def _plan_if_due(self) -> None:
        job, access = self._queue.due(self._clock.now_s(), self._feed.place), self._access
        if job is None or self._feed.closed:
            return
        assert access is not None, "a mission does not start before it knows where the robot may go"
        for fault in self._queue.faults if job.request.kind is PlanKind.EXPLORE else ():
            _log.warning(fault)
        rules, state = self._mission.current_rules, self._mission.state
        settings = changed_settings(self._settings, state.changes)
        if not_free := self.team.plan(access, job.place, rules, job.request):
            blacklisted = (*job.request.blacklisted, *sorted(not_free))
            job = replace(job, request=replace(job.request, blacklisted=blacklisted))
        self._planning.submit(job, Terms(state.started_s, access, settings, rules))
